// The pupil's amplitude transmission on the frequency grid, computed once on the host in double precision.
#pragma once

#include "stages/field_grid.hpp"

#include <cstdint>
#include <vector>

namespace clsp {

enum class PupilShape : std::uint32_t { kCircle = 0, kImage = 1 };
enum class Normalization : std::uint32_t { kTransmission = 0, kUnitMean = 1 };

struct PupilParameters {
    PupilShape shape = PupilShape::kCircle;
    Normalization normalization = Normalization::kTransmission;
    double soft_rim = 0.0;
    const float *image = nullptr; // host memory, read only while the pupil is made
    std::uint32_t image_width = 0, image_height = 0;
    std::uint64_t image_pitch_bytes = 0;
};

struct Pupil {
    std::vector<float> transmission; // grid_height x grid_width, FFT order, normalized as asked
    std::uint32_t samples = 0;       // frequencies that pass
    double mean_transmission = 0.0;  // mean of |P|^2 with Normalization::kTransmission
};

// diameter in cycles per pixel. Throws if nothing passes.
Pupil make_pupil(const PupilParameters &parameters, const FieldGrid &grid, double relative_diameter);

} // namespace clsp

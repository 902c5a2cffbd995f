// What a user tries on a simulated capture: an effect of their own.
#pragma once

#include "capture/capture.hpp"

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace clsp {

// An effect of the user's own, on the arrays of a stage.
enum class HypothesisPoint : std::uint32_t {
    kIrradiance = 0, // the ideal image I0, before the speckle forms
    kIntensity = 1,  // behind the lens, before the sensor; 1 is the mean of flat and board
    kCodes = 2       // the sensor's codes, rounded to 0 ... 2^bits - 1 after the call
};
struct HypothesisFrame {
    const CaptureLayout *layout;
    std::size_t sequence;
    std::uint32_t frame_index;
    // The capture's. Counter-based randomness of the hypothesis is to depend on it, on frame_index and on sequence
    // alone (not on sequence where a pattern belongs to the camera).
    std::uint64_t seed;
    const double *values;
    float *pixels; // height * width, changed in place
};
struct HypothesisParameter {
    std::string name, unit;
    double minimum, maximum, weak, strong;
    bool whole = false;    // counts something: only whole numbers differ
    bool measured = false; // by a closed form, and not fitted: minimum and maximum are its 95 % interval
};
struct Hypothesis {
    std::string id, stage, summary;
    HypothesisPoint point = HypothesisPoint::kIntensity;
    std::vector<HypothesisParameter> parameters;
    // One of the two: a function of a frame, or OpenCL source with a function of a pixel (opencl_hypothesis.hpp).
    std::function<void(const HypothesisFrame &)> apply;
    std::string opencl_source;
};

} // namespace clsp

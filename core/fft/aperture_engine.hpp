// The fused, pruned speckle engine: field, transform, pupil, transform back and intensity in three passes over the
// frame, of which only lines that the pupil lets through are ever stored.
//   A  rows: field, forward transform; the kept lines
//   B  kept lines, along the columns: forward transform, pupil, inverse transform, in place
//   C  rows: inverse transform of the kept lines, |V|^2
// It has two shapes: lanes for CPUs (cpu/cpu_engine.cpp), and work-groups for GPUs (gpu/gpu_engine.cpp).
#pragma once

#include "runtime/command_chain.hpp"
#include "fft/engine.hpp"
#include "runtime/error.hpp"
#include "fft/gpu/codelets.hpp"
#include "runtime/image_view.hpp"
#include "stages/field.hpp"
#include "stages/field_grid.hpp"
#include "stages/phase.hpp"
#include "stages/pupil.hpp"
#include "stages/sensor.hpp"

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace clsp {

// A frame of a sensor that pass C makes in the place of the intensity.
struct ExposedFrame {
    Sensor *sensor = nullptr;
    std::uint64_t frame_index = 0;
    ImageView output;
};

using Weights = std::array<double, 2>;

class FusedEngine {
  public:
    virtual ~FusedEngine() = default;

    // Work memory for the kept lines.
    virtual std::uint64_t lines_bytes() const = 0;
    // Pass C writes |V|^2 of every sample of the grid instead of pixels.
    virtual bool leaves_sample_powers() const = 0;

    // Pass C can make the sensor's frames.
    virtual bool exposes(const Sensor &) const { return false; }

    // Builds what such frames need; nothing is built later. exposed: nullptr where no pass exposes. with_intensity:
    // whether some pass writes the intensity.
    virtual void prepare(const Phase &phase, Field &field, const std::vector<LaserLine> &laser_lines, bool with_screen,
                         bool shifted, const ExposedFrame *exposed, bool with_intensity) = 0;

    // How many polarizations the passes take at once: 1, or both.
    virtual std::uint32_t polarizations() const { return 1; }

    // A: from the irradiance to the kept lines. polarization: the first of polarizations().
    virtual void enqueue_lines(CommandChain &chain, const Phase &phase, Field &field, const FieldInput &input,
                               std::uint32_t polarization, const LaserLine &line, const cl::Buffer &lines,
                               const cl::Buffer &bad_pixels) = 0;
    // B. shift: along x and y, in samples of the grid.
    virtual void enqueue_pupil(CommandChain &chain, const cl::Buffer &lines,
                               const std::optional<std::array<double, 2>> &shift) = 0;
    // C: weight |V|^2 to `intensity`, added to `before` unless that is empty. Both may be the same pixels. weights: of
    // each of polarizations().
    virtual void enqueue_intensity(CommandChain &chain, const cl::Buffer &lines, Weights weights,
                                   const ImageView &before, const ImageView &intensity) = 0;
    // C with the sensor behind it, of an engine that exposes().
    virtual void enqueue_exposed(CommandChain &, const cl::Buffer & /* lines */, Weights,
                                 const ImageView & /* before */, const ExposedFrame &) {
        throw Error(Status::kInternal, "this engine exposes no sensor");
    }
};

struct FusedRequest {
    bool every_line = false;        // room for all lines, whatever the pupil
    bool sample_powers = false;     // as in leaves_sample_powers(): for weights over samples
    bool two_polarizations = false; // frames have both
};

// What became of a list of choices.
struct FusedDecision {
    std::unique_ptr<FusedEngine> engine; // none: clFFT
    EngineSpec spec;                     // as it was made, work-groups included
    std::string source;                  // of the choice that was taken
    std::string refusal;                 // why the transforms are clFFT's; "" if they are not
};

// Tries the choices in turn; what cannot be had is logged with the reason.
FusedDecision decide_engine(const std::shared_ptr<Context> &context, const FieldGrid &grid, const Pupil &pupil,
                            const FusedRequest &request, const std::vector<EngineChoice> &choices);

// The two shapes. They throw kUnsupported where a device cannot hold the grid's lines, or not in the work-groups that
// `spec` names; to a spec without work-groups, those that are taken are added.
std::unique_ptr<FusedEngine> make_fused_lanes(std::shared_ptr<Context> context, const FieldGrid &grid,
                                              const Pupil &pupil, const FusedRequest &request);
std::unique_ptr<FusedEngine> make_fused_groups(std::shared_ptr<Context> context, const FieldGrid &grid,
                                               const Pupil &pupil, const FusedRequest &request, EngineSpec &spec);
// What a device's work-groups may be.
GroupLimits group_limits(const Context &context);

} // namespace clsp

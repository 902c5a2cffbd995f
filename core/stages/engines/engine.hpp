// An engine carries out an aperture's transforms: from the irradiance to the intensity, or to a sensor's codes.
// Those for CPUs and for GPUs have three passes over the frame, and store only the columns that the pupil lets through:
//   rows_forward  field, transform of the rows; the pupil columns
//   columns       these columns' transform, pupil, transform back, in place
//   rows_inverse  transform back of the rows, |V|^2
// clFFT's has a kernel for each step.
#pragma once

#include "fft/engine_spec.hpp"
#include "fft/gpu/codelets.hpp"
#include "runtime/command_chain.hpp"
#include "runtime/image_view.hpp"
#include "stages/field.hpp"
#include "stages/field_grid.hpp"
#include "stages/phase.hpp"
#include "stages/pupil.hpp"
#include "stages/sample_pixels.hpp"
#include "stages/sensor.hpp"

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace clsp {

// A frame of a sensor that the last pass makes in the place of the intensity.
struct ExposedFrame {
    Sensor *sensor = nullptr;
    std::uint64_t frame_index = 0;
    ImageView output;
};

// What one exposure, or a part of it, is made of. The defaults are the plain case.
struct Exposure {
    Field *field = nullptr;                        // what the surface and the laser do; nullptr: nothing but sqrt(I0) z
    ImageView material;                            // with a material table
    const cl::Buffer *screen = nullptr;            // phase screen in turns, on the field grid
    const std::vector<LaserLine> *lines = nullptr; // of the laser; nullptr: the field's
    double gain = 1.0;                             // on the intensity
    double coherent_gain = 1.0;                    // on the amplitude of what keeps its phase, without a material table
    double shift_x_px = 0.0, shift_y_px = 0.0;
    bool moves_image = false; // the shift counts
    bool adds = false;        // to what the intensity image holds
    // What a sensor makes of the sum, in the place of the intensity; only of a sensor that the engine exposes().
    std::optional<ExposedFrame> exposed;
};

// Work memory of a frame: the field, or what the pupil leaves of it; the transform's scratch, or the samples' powers;
// the first sum of several, where the intensity's pixels are the irradiance that is still needed.
struct WorkBytes {
    std::uint64_t field = 0, scratch = 0, partial = 0;
};
struct WorkMemory {
    cl::Buffer field, scratch, partial;
};

// What an engine is made for.
struct EngineRequest {
    std::shared_ptr<Context> context;
    FieldGrid grid;
    const Pupil &pupil;
    cl::Buffer pupil_values;       // its amplitudes on the device: float, or float2 with a phase
    std::vector<float> pixel_taps; // weights over samples along each axis (pixel_taps()); none: a pixel's own ones
    double degree_of_polarization = 1.0;
    bool any_pupil = false; // room for all columns, whatever the pupil
};

class Engine {
  public:
    virtual ~Engine() = default;

    // As it was made, work-groups included.
    const EngineSpec &spec() const { return spec_; }
    WorkBytes work_bytes() const;
    // It can make the sensor's frames.
    virtual bool exposes(const Sensor &) const { return false; }
    // Builds what such frames need; nothing is built later.
    void prepare(const Phase &phase, Field &field, const Exposure &exposure);
    // field: the exposure's, or a plain one. irradiance and intensity may be the same pixels, unless several fields are
    // added that have no room apart.
    void enqueue(CommandChain &chain, const Phase &phase, Field &field, const ImageView &irradiance,
                 const ImageView &intensity, const Exposure &exposure, const WorkMemory &memory,
                 const cl::Buffer &bad_pixels);

  protected:
    // Of the one or two polarizations that a pass takes.
    using Weights = std::array<double, 2>;

    // A field of a frame: of one line of the laser, and one polarization or both.
    struct FieldPass {
        const Phase &phase;
        Field &field;
        const FieldInput &input;
        const std::optional<std::array<double, 2>> &shift; // along x and y, in samples of the grid
        const cl::Buffer &bad_pixels;
        LaserLine line;
        std::uint32_t polarization; // the first one
    };

    Engine(const EngineRequest &request, const EngineSpec &spec)
        : context_(request.context), grid_(request.grid), spec_(spec),
          degree_of_polarization_(request.degree_of_polarization) {}

    // What enqueue_pixels() writes, and how many samples along each axis it takes for a pixel of that.
    ImageSize written() const {
        return pixels_of_powers_ ? ImageSize{grid_.grid_width, grid_.grid_height}
                                 : ImageSize{grid_.width, grid_.height};
    }
    std::uint32_t pixel_samples() const { return pixels_of_powers_ ? 1 : grid_.oversampling; }

    std::shared_ptr<Context> context_;
    FieldGrid grid_;
    EngineSpec spec_;
    std::uint32_t polarizations_ = 1; // that a pass takes at once: 1, or both
    // If enqueue_pixels() writes |V|^2 of every sample of the grid: makes pixels of their sum.
    std::optional<SamplePixels> pixels_of_powers_;

  private:
    virtual std::uint64_t field_bytes() const = 0;
    virtual std::uint64_t scratch_bytes() const { return 0; }
    // with_intensity: whether a pass writes the intensity.
    virtual void build_kernels(const Phase &phase, Field &field, const std::vector<LaserLine> &lines,
                               const Exposure &exposure, bool with_intensity) = 0;
    // The field behind the pupil, to memory.field.
    virtual void enqueue_field(CommandChain &chain, const FieldPass &pass, const WorkMemory &memory) = 0;
    // weight |V|^2 of it to `intensity`, added to `before` unless that is empty. Both may be the same pixels.
    virtual void enqueue_pixels(CommandChain &chain, const cl::Buffer &field, Weights weights, const ImageView &before,
                                const ImageView &intensity) = 0;
    // The same with the sensor behind it, of an engine that exposes().
    virtual void enqueue_codes(CommandChain &chain, const cl::Buffer &field, Weights weights, const ImageView &before,
                               const ExposedFrame &exposed);

    std::uint32_t polarizations_of(const Field &field) const {
        return degree_of_polarization_ < 1.0 || field.weighs_polarizations() ? 2 : 1;
    }

    double degree_of_polarization_;
};

// What became of a list of choices.
struct EngineDecision {
    std::unique_ptr<Engine> engine;
    std::string source;  // of the choice that was taken
    std::string refusal; // why it is clFFT; "" if it is not
};

// Tries the choices in turn; what cannot be had is logged with the reason. The last one's error is thrown.
EngineDecision decide_engine(const EngineRequest &request, const std::vector<EngineChoice> &choices);

// They throw kUnsupported where a device cannot hold the grid's lines, or not in the work-groups that `spec` names.
std::unique_ptr<Engine> make_cpu_engine(const EngineRequest &request);
std::unique_ptr<Engine> make_gpu_engine(const EngineRequest &request, const EngineSpec &spec);
std::unique_ptr<Engine> make_clfft_engine(const EngineRequest &request);
// What a device's work-groups may be.
WorkGroupLimits work_group_limits(const Context &context);

} // namespace clsp

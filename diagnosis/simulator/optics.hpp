// The light of a sequence behind the lens: ideal image, surface, laser, pupil, glare.
#pragma once

#include "pipeline/pipeline.hpp"
#include "simulator/sequence_model.hpp"

#include <functional>
#include <memory>
#include <vector>

namespace clsp {

// Changes one host image (height * width floats) of a frame in place.
using FrameCallback = std::function<void(std::uint32_t frame_index, float *pixels)>;

// Counters of frames: every sequence of a capture has its own, so that one seed serves all of them.
inline std::uint64_t frame_counter(std::size_t sequence, std::uint32_t frame) {
    return (std::uint64_t{sequence} << 32) | frame;
}

// And every one of an exposure's independent patterns: numbers of frames have 48 bits.
inline std::uint64_t mode_counter(std::uint64_t frame_counter, std::size_t mode) {
    return frame_counter | (std::uint64_t{mode} << 42);
}

// Intensities of sequences. Keeps the stages between calls, and makes anew only what the model changes.
class Optics {
  public:
    Optics(std::shared_ptr<Context> context, const CaptureLayout &layout);

    // Frames 0 ... frame_count - 1 one behind the other; one frame alone if model.frames_differ is false. Only
    // enqueues, unless there are hypotheses on the irradiance. on_irradiance: empty, or what they do.
    void enqueue_render(cl_command_queue queue, const SequenceModel &model, std::size_t sequence, std::uint64_t seed,
                        std::uint32_t frame_count, const FrameCallback &on_irradiance, const DeviceBuffer &intensities);

  private:
    struct Stages {
        std::unique_ptr<Phase> phase;
        std::unique_ptr<Aperture> aperture;
        std::unique_ptr<Field> field;
    };
    ImageView image(const cl::Buffer &buffer, std::size_t index = 0) const;
    Stages &stages_for(const PipelineModel &model, std::uint64_t seed);
    void prepare_exposure(const PipelineParameters &parameters);
    // The ideal image without hypotheses, in irradiance_.
    void enqueue_irradiance(CommandChain &chain, const PipelineModel &model, CaptureScene scene);
    void enqueue_speckle(CommandChain &chain, const PipelineModel &model, Stages &stages, Airflow *airflow,
                         std::uint64_t seed, std::uint64_t counter, bool fresh, bool moving,
                         const ImageView &irradiance, const ImageView &intensity);

    std::shared_ptr<Context> context_;
    CaptureLayout layout_;
    std::size_t pixels_;
    std::vector<Stages> stages_; // by oversampling, the last one used in front
    std::unique_ptr<Dots> dots_;
    std::unique_ptr<Lens> distortion_, glare_;
    std::unique_ptr<FftFilter> subsurface_;
    double subsurface_length_px_ = 0.0;
    std::shared_ptr<FilterWorkspace> filter_workspace_;
    DeviceBuffer irradiance_, distorted_, uniform_, shaped_;
    // What an exposure is made of, and each pattern's lines of the laser. A resting scene has a path of 0: one pattern.
    std::vector<ExposureMode> exposure_modes_{{1.0, 1.0}};
    std::vector<std::vector<LaserLine>> lines_of_modes_{equal_lines(1)};
    double exposure_path_ = 0.0, dephasing_rad_ = 0.0;
    ExposureCorrelation exposure_correlation_ = ExposureCorrelation::kField;
    std::uint32_t line_count_ = 1;
    cl::Kernel dark_;
};

} // namespace clsp

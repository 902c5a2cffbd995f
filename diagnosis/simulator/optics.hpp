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

// Numbers of frames: every sequence of a capture has its own, so that one seed serves all of them.
inline std::uint64_t frame_number(std::size_t sequence, std::uint32_t frame) {
    return (std::uint64_t{sequence} << 32) | frame;
}

// Intensities of sequences, from pipelines without a sensor. Keeps them between calls, and makes anew only what the
// model changes.
class Optics {
  public:
    Optics(std::shared_ptr<Context> context, const CaptureLayout &layout);

    // Frames 0 ... frame_count - 1 one behind the other; one frame alone if model.frames_differ is false. Only
    // enqueues, unless there are hypotheses on the irradiance. on_irradiance: empty, or what they do.
    void enqueue_render(cl_command_queue queue, const SequenceModel &model, std::size_t sequence, std::uint64_t seed,
                        std::uint32_t frame_count, const FrameCallback &on_irradiance, const DeviceBuffer &intensities);

  private:
    ImageDescription image(const cl::Buffer &buffer, std::size_t index = 0) const;
    Pipeline &camera_for(const PipelineModel &model);
    // The ideal image without hypotheses.
    const DeviceBuffer &enqueue_irradiance(cl_command_queue queue, const SequenceModel &model, CaptureScene scene);

    std::shared_ptr<Context> context_;
    CaptureLayout layout_;
    std::size_t pixels_;
    struct Camera {
        std::uint32_t oversampling;
        std::unique_ptr<Pipeline> pipeline;
    };
    std::vector<Camera> cameras_; // the last one used in front
    std::unique_ptr<Dots> dots_;
    DeviceBuffer uniform_, irradiance_, shaped_;
};

} // namespace clsp

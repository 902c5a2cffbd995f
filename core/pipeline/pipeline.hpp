// A frame: pattern, phase, aperture, sensor, as one chain of commands.
#pragma once

#include "stages/aperture.hpp"
#include "stages/pattern.hpp"
#include "stages/phase.hpp"
#include "stages/sensor.hpp"

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace clsp {

enum class Refresh : std::uint32_t { kMask = 0, kAll = 1 };

struct PipelineStages {
    std::shared_ptr<Pattern> pattern; // may be empty
    std::shared_ptr<Phase> phase;
    std::shared_ptr<Aperture> aperture;
    std::shared_ptr<Sensor> sensor; // may be empty
};

struct Frame {
    Refresh refresh = Refresh::kMask;
    std::uint64_t frame_index = 0;
    const Geometry *geometry = nullptr;
    ImageDescription irradiance, refresh_mask, output;
};

struct StageTiming {
    std::string stage;
    double milliseconds;
};

class Pipeline {
  public:
    Pipeline(std::shared_ptr<Context> context, PipelineStages stages);

    const std::shared_ptr<Context> &context() const { return context_; }

    void enqueue_frame(cl_command_queue queue, const Frame &frame, cl_uint num_waits, const cl_event *waits,
                       cl_event *event);
    // Renders the frame, waits, and puts the phase state back.
    void warm_up(cl_command_queue queue, const Frame &frame);
    // Throws kInvalidData if a frame since the last check had bad pixels. Blocks.
    void check(cl_command_queue queue);
    // Blocks until the last frame is done.
    std::vector<StageTiming> timings();

  private:
    std::shared_ptr<Context> context_;
    PipelineStages stages_;
    // The pattern's image and, with a sensor, the intensity; empty where the frame's own images do.
    DeviceBuffer image_;
    ChainProfile profile_, next_profile_; // of the last frame; of the one being enqueued
    bool has_frame_ = false;
};

} // namespace clsp

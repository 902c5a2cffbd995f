// A frame: light, motion, phase, aperture, lens, sensor, as one chain of commands.
#pragma once

#include "pipeline/exposure_steps.hpp"
#include "pipeline/pipeline_model.hpp"
#include "runtime/lazy_kernel.hpp"
#include "stages/airflow.hpp"
#include "stages/aperture.hpp"
#include "stages/dots.hpp"
#include "stages/filter.hpp"
#include "stages/lens.hpp"
#include "stages/material.hpp"
#include "stages/motion.hpp"
#include "stages/pattern.hpp"
#include "stages/phase.hpp"
#include "stages/sensor.hpp"

#include <cstdint>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace clsp {

enum class Refresh : std::uint32_t { kMask = 0, kAll = 1 };
enum class Illumination : std::uint32_t { kLaser = 0, kIncoherent = 1, kDark = 2 };

struct PipelineStages {
    std::shared_ptr<Pattern> pattern; // may be empty, as all but phase and aperture
    std::shared_ptr<Dots> dots;
    std::shared_ptr<MaterialTable> materials;
    std::shared_ptr<Motion> motion;
    std::shared_ptr<Phase> phase;
    std::shared_ptr<Aperture> aperture;
    std::shared_ptr<Lens> lens;
    std::shared_ptr<Sensor> sensor;
};

struct Frame {
    Refresh refresh = Refresh::kMask;
    Illumination illumination = Illumination::kLaser;
    std::uint64_t frame_index = 0;
    const Geometry *geometry = nullptr;
    const MotionInput *motion = nullptr;
    ImageDescription irradiance, refresh_mask, material, output;
};

struct StageTiming {
    std::string stage;
    double milliseconds;
};

class Pipeline {
  public:
    Pipeline(std::shared_ptr<Context> context, PipelineStages stages, const PipelineParameters &parameters);

    const std::shared_ptr<Context> &context() const { return context_; }

    // Switches an effect of the catalogue (effects/effects.hpp) on, or changes its parameters; nullptr for their
    // defaults. After an error all is as it was.
    void set_effect(const std::string &id, const double *values, std::uint32_t count);
    // Off again.
    void clear_effect(const std::string &id);
    void clear_effects() { use_effects({}); }

    void enqueue_frame(cl_command_queue queue, const Frame &frame, cl_uint num_waits, const cl_event *waits,
                       cl_event *event) {
        enqueue_frames(queue, &frame, 1, num_waits, waits, event);
    }
    // Frames one after the other, as one chain; if one of them is refused, none is enqueued.
    void enqueue_frames(cl_command_queue queue, const Frame *frames, std::size_t count, cl_uint num_waits,
                        const cl_event *waits, cl_event *event);
    // Renders the frame, waits, and puts the phase state back.
    void warm_up(cl_command_queue queue, const Frame &frame);
    // Throws kInvalidData if a frame since the last check had bad pixels. Blocks.
    void check(cl_command_queue queue);
    // Blocks until the last frame is done.
    std::vector<StageTiming> timings();

  private:
    struct Checked; // the images of a frame, checked
    using Effects = std::map<std::string, std::vector<double>>;

    void check_stages() const;
    PipelineModel model() const;
    // What is the pipeline's own, and the parts of the model that stages have (kSets* of effects.hpp).
    void apply_own(const PipelineModel &model);
    // applied: the parts that have been changed, also if a later one throws.
    void apply_stages(const PipelineModel &model, unsigned sets, unsigned &applied);
    void use_effects(Effects effects);
    // The sensor's dark frame, which changes of the sensor must not lose.
    void keep_dark_frame();
    // The sensor's lag and the airflow begin anew.
    void forget_frames();
    // Buffers and filters that the parameters ask for.
    void allocate();
    Checked check_frame(const Frame &frame);
    void enqueue_checked(CommandChain &chain, const Frame &frame, const Checked &images);
    // The laser's frames get their codes in the aperture's last pass, not in a command of the sensor's.
    bool exposes_in_last_pass() const;
    ImageView own_image(const DeviceBuffer &buffer, Format format = Format::kFloat32) const;
    struct Surface; // what became of the surface since the last frame
    // Whether the surface moves while the shutter is open, unless all of it is drawn anew.
    bool blurs(const Frame &frame) const;
    // Sub-exposures of a frame. fresh: all of the surface is drawn anew.
    std::uint32_t exposures_of(const Frame &frame, bool fresh) const;
    // Checks all advances of the phase that enqueue_surface() and enqueue_laser() will ask for, which builds their kernels.
    void prepare_advances(const Frame &frame, const Checked &images);
    Surface enqueue_surface(CommandChain &chain, const Frame &frame, const Checked &images);
    void enqueue_laser(CommandChain &chain, const Frame &frame, const Checked &images);

    std::shared_ptr<Context> context_;
    PipelineStages stages_;
    PipelineParameters parameters_;
    ExposureSteps exposure_steps_;
    Effects effects_;
    std::optional<PipelineModel> base_; // without effects; while there are any
    std::vector<float> dark_frame_;
    // Light at the sensor; the laser's ideal image where it must be apart; the same and the materials behind the lens's
    // distortion; subsurface fractions. Empty where a frame needs none.
    DeviceBuffer light_, irradiance_, distorted_, distorted_material_, distorted_path_, distorted_correlation_,
        distorted_shift_, distorted_mask_, distorted_motion_mask_, subsurface_weight_, subsurface_table_;
    std::shared_ptr<FilterWorkspace> filter_workspace_;
    std::unique_ptr<FftFilter> subsurface_;
    std::unique_ptr<Airflow> airflow_;
    std::unique_ptr<Field> field_;
    bool lens_distorts_ = false, lens_finishes_ = false; // when the buffers were made
    cl::Kernel material_lookup_;
    LazyKernel dark_;
    ChainProfile profile_, next_profile_; // of the last frame; of the one being enqueued
    bool has_frame_ = false;
};

} // namespace clsp

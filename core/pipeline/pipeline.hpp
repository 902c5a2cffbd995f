// A frame: light, motion, phase, aperture, lens, sensor, as one chain of commands.
#pragma once

#include "effects/pipeline_model.hpp"
#include "pipeline/exposure_steps.hpp"
#include "pipeline/frame_plan.hpp"
#include "pipeline/own_effect.hpp"
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
    // The light on the surface is that of the frame before; only of a pipeline that keeps_irradiance.
    bool keeps_irradiance = false;
};

// How a pipeline is used.
struct PipelineOptions {
    bool keeps_irradiance = false;      // frames may have the light of the frame before
    bool independent_exposures = false; // exposures of frames drawn anew are made of independent_exposures()
    bool keeps_filters = false;         // filters and maps that are switched off stay: they come on again soon
};

struct StageTiming {
    std::string stage;
    double milliseconds;
};

class Pipeline {
  public:
    Pipeline(std::shared_ptr<Context> context, PipelineStages stages, const PipelineParameters &parameters,
             PipelineOptions options = {});

    const std::shared_ptr<Context> &context() const { return context_; }

    PipelineModel model() const;
    // Takes the parameters; stages whose own stay the same are left alone. After an error all is as it was.
    void configure(const PipelineModel &model);
    // The next frame is the first one: it draws the surface, and no frame was before it.
    void forget();

    // Switches an effect of the catalogue (effects/effects.hpp) on, or changes its parameters; nullptr for their
    // defaults. After an error all is as it was.
    void set_effect(const std::string &id, const double *values, std::uint32_t count);
    // Several at once, beside those that are on.
    using Effects = std::map<std::string, std::vector<double>>;
    void set_effects(const Effects &effects);
    // The camera's own pixels: maps take the place of effects that they hold. Both are tightly packed; empty: none.
    // They stay when effects go; another camera's, or none, take their place. Throws kInvalidArgument if the sensor has
    // maps that are no camera's.
    struct PixelMaps {
        std::vector<float> dark_frame_dn, gain_map;
        std::vector<std::string> holds;
    };
    void set_camera(const Effects &effects, PixelMaps maps);
    // An effect of the user's own, in the place of one with the same id, else behind those that are on at its point.
    void set_own_effect(const std::string &id, OwnEffectPoint point, OwnEffectStep step);
    // Off again, also the user's own.
    void clear_effect(const std::string &id);
    void clear_effects();

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
    struct Images;

    void check_stages() const;
    // What is the pipeline's own, and the parts of the model that stages have (kSets* of effects.hpp).
    // Refuses what no stage does; changes nothing.
    void check_own(const PipelineModel &model) const;
    void apply_own(const PipelineModel &model);
    // applied: the parts that have been changed, also if a later one throws.
    void apply(const PipelineModel &model, unsigned sets, unsigned &applied);
    void use_model(const PipelineModel &wanted, unsigned parts);
    // maps: the camera's; nothing: they stay as they are.
    void use_effects(Effects effects, std::optional<PixelMaps> maps = {});
    void add_effects(Effects effects, const Effects &wanted, std::optional<PixelMaps> maps = {});
    // The sensor's maps, which changes of the sensor must not lose.
    void keep_maps();
    // The sensor's lag and the airflow begin anew.
    void forget_frames();
    // Buffers and filters that the parameters ask for.
    void allocate();
    ImageView own_image(const DeviceBuffer &buffer, Format format = Format::kFloat32) const;
    bool distorts() const;
    bool finishes() const;
    bool has_own_effect(OwnEffectPoint point) const;
    // The laser's frames get their codes in the aperture's last pass, not in a command of the sensor's.
    bool exposes_in_last_pass() const;

    Images check_images(const Frame &frame);
    // A frame's steps, checked. fresh: all of the surface is drawn anew.
    void plan_frame(FramePlan &plan, const Frame &frame, bool fresh);
    void plan_laser(FramePlan &plan, const Frame &frame, const Images &images, bool fresh);
    // What becomes of the surface since the last frame.
    PhaseAdvance plan_surface(FramePlan &plan, const Frame &frame, ImageView mask, bool fresh);
    ImageView plan_subsurface(FramePlan &plan, const Frame &frame, const ImageView &irradiance,
                              const ImageView &material);
    // The image behind the user's own effects at a point; itself where there are none.
    ImageView plan_own_effects(FramePlan &plan, OwnEffectPoint point, const Frame &frame, const ImageView &image);
    void plan_scatter(FramePlan &plan, const ImageView &pixels, const ImageView &image);
    // The image as the lens shows it; itself where the lens moves nothing, or if it is empty.
    ImageView plan_distortion(FramePlan &plan, const ImageView &image, const DeviceBuffer &distorted,
                              Interpolation interpolation, bool adds_step = true);

    std::shared_ptr<Context> context_;
    PipelineStages stages_;
    PipelineParameters parameters_;
    PipelineOptions options_;
    std::optional<ExposureParameters> exposure_; // what exposure_steps_ were made of
    ExposureSteps exposure_steps_;
    std::vector<FramePlan> plans_; // of the last frames; kept for their memory
    Effects effects_;
    std::optional<PipelineModel> base_; // without effects; while there are any
    struct KeptMap {
        std::vector<float> values;
        bool of_camera = false; // set_camera() brought it
    };
    KeptMap dark_frame_, gain_map_; // of the base's sensor
    // Light at the sensor; the laser's ideal image where it must be apart; the same and the materials behind the lens's
    // distortion; subsurface fractions. Empty where a frame needs none.
    DeviceBuffer light_, irradiance_, distorted_, distorted_material_, distorted_path_, distorted_correlation_,
        distorted_shift_, distorted_mask_, distorted_motion_mask_, subsurface_weight_, subsurface_table_;
    std::unique_ptr<FftFilter> subsurface_;
    double subsurface_length_px_ = 0.0; // that it was made for
    bool subsurface_on_ = false;
    std::unique_ptr<Airflow> airflow_;
    std::unique_ptr<Field> field_;
    bool lens_distorts_ = false, lens_finishes_ = false; // when the buffers were made
    cl::Kernel material_lookup_;
    struct OwnEffect {
        std::string id;
        OwnEffectPoint point;
        std::shared_ptr<const OwnEffectStep> step;
    };
    std::vector<OwnEffect> own_effects_;
    DeviceBuffer own_pixels_[2];               // what they change in turn; empty without them
    std::map<Format, LazyKernel> gather_, scatter_;
    LazyKernel dark_;
    ChainProfile profile_, next_profile_; // of the last frame; of the one being enqueued
    bool has_frame_ = false;
    bool half_moved_ = false; // a frame failed after it had begun to move what later frames begin with
    bool lag_lost_ = false;   // that was the sensor's lag, too
};

} // namespace clsp

// How far each pixel's surface point has moved since the last frame. The equations are in motion.h of the C API.
#pragma once

#include "runtime/command_chain.hpp"
#include "runtime/device_buffer.hpp"
#include "runtime/image_view.hpp"
#include "stages/bad_pixels.hpp"
#include "stages/material.hpp"
#include "stages/pattern.hpp"
#include "stages/phase.hpp"

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

namespace clsp {

enum class MotionRule : std::uint32_t { kCorrelate = 0, kReplace = 1 };

struct MotionParameters {
    std::uint32_t width = 0, height = 0;
    MotionRule rule = MotionRule::kCorrelate;
    bool translate = false; // a phase's advance gets a shift
    DepthKind depth_kind = DepthKind::kAlongAxis;
    std::shared_ptr<MaterialTable> materials;          // empty: one material, the default one
    double fx_px = 0, fy_px = 0, cx_px = 0, cy_px = 0; // fx_px 0: not known
    double replace_threshold = 0.01;
    double occlusion_tolerance = 0.02;
};

struct MotionInput {
    double frame_time_s = 0.0;
    const double *previous_from_current = nullptr; // transform_count x [R|t]; host memory, read during the call
    std::uint32_t transform_count = 0;
    bool roll_from_motion = false;
    ImageDescription position, depth, normal, material, motion;
    ImageDescription previous_position, previous_depth, previous_normal, previous_material;
};

// Images of a caller's own; empty ones are not written.
struct MotionOutput {
    ImageDescription path, correlation, shift, displacement, mask;
};

class Motion {
  public:
    Motion(std::shared_ptr<Context> context, const MotionParameters &parameters);

    const std::shared_ptr<Context> &context() const { return context_; }
    const MotionParameters &parameters() const { return parameters_; }
    // Surface points whose past is not a number.
    BadPixelCounter &bad_pixels() { return bad_pixels_; }
    // Material ids outside the table (counted as `negative`).
    BadPixelCounter &bad_materials() { return bad_materials_; }

    // Checks an input for the call below, and builds and allocates what it needs.
    void check(const MotionInput &input);
    // The images of this object's own that enqueue_compute() writes, once an input has been checked.
    PhaseAdvance advance() const;
    // What an advance of a phase needs, in images of this object's own.
    PhaseAdvance enqueue_compute(CommandChain &chain, const MotionInput &input);
    void enqueue_compute(CommandChain &chain, const MotionInput &input, const MotionOutput &output);
    // Throws kInvalidData if there were bad pixels since the last check. Blocks.
    void check_bad_pixels(cl_command_queue queue);

  private:
    enum class Mode { kPreviousPosition = 0, kOneTransform = 1, kTransforms = 2, kMotionVectors = 3 };
    struct Views {
        Mode mode;
        ImageView point, normal, material, motion, previous, history, old_material, old_normal;
        bool has_position, history_position, roll;
    };
    struct OutputViews {
        ImageView path, correlation, shift, displacement, mask;
    };
    Views resolve(const MotionInput &input, bool with_shift) const;
    void make_own_images();
    OutputViews own_images() const;
    cl::Kernel &kernel_for(const Views &in, const OutputViews &out);
    void upload_transforms(CommandChain &chain, const MotionInput &input);
    void run(CommandChain &chain, const MotionInput &input, const Views &in, const OutputViews &out);

    std::shared_ptr<Context> context_;
    MotionParameters parameters_;
    cl_uint material_count_ = 1;
    bool lives_ = false; // some material has a finite correlation time
    DeviceBuffer table_, transforms_;
    DeviceBuffer path_, correlation_, shift_, mask_; // the images for a phase, made on first use
    BadPixelCounter bad_pixels_, bad_materials_;
    std::map<std::string, cl::Kernel> kernels_; // by build options
};

} // namespace clsp

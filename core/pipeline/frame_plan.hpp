// What one frame launches, step by step. Adding a step checks it and builds its kernels, so that what is enqueued is
// what has been checked, and nothing fails half way through a frame that could have failed before.
#pragma once

#include "pipeline/own_effect.hpp"
#include "runtime/command_chain.hpp"
#include "runtime/kernel_arguments.hpp"
#include "runtime/lazy_kernel.hpp"
#include "stages/airflow.hpp"
#include "stages/aperture.hpp"
#include "stages/dots.hpp"
#include "stages/filter.hpp"
#include "stages/lens.hpp"
#include "stages/motion.hpp"
#include "stages/pattern.hpp"
#include "stages/phase.hpp"
#include "stages/philox.hpp"
#include "stages/sensor.hpp"

#include <cstdint>
#include <memory>
#include <utility>
#include <variant>
#include <vector>

namespace clsp {

// Steps, each with what it needs: check() throws if it cannot run, enqueue() runs it. The stages must outlive the plan.
namespace frame_step {

struct LookUpPattern {
    Pattern *pattern;
    Geometry geometry;
    ImageView irradiance;
    void check() { pattern->check_lookup(geometry, irradiance); }
    void enqueue(CommandChain &chain) { pattern->enqueue_lookup(chain, geometry, irradiance); }
};

struct RenderDots {
    Dots *dots;
    ImageView irradiance;
    void check() { check_writable(irradiance, "irradiance"); }
    void enqueue(CommandChain &chain) { dots->enqueue_render(chain, irradiance); }
};

// To the images of Motion::advance().
struct ComputeMotion {
    Motion *motion;
    MotionInput input;
    void check() { motion->check(input); }
    void enqueue(CommandChain &chain) { motion->enqueue_compute(chain, input); }
};

struct Distort {
    Lens *lens;
    ImageView ideal, distorted;
    Interpolation interpolation;
    void check() { lens->check_distort(ideal, distorted, interpolation); }
    void enqueue(CommandChain &chain) { lens->enqueue_distort(chain, ideal, distorted, interpolation); }
};

struct DistortShift {
    Lens *lens;
    ImageView ideal, distorted;
    void check() { lens->check_distort_shift(ideal, distorted); }
    void enqueue(CommandChain &chain) { lens->enqueue_distort_shift(chain, ideal, distorted); }
};

struct DrawPhase {
    Phase *phase;
    std::uint64_t number;
    ImageView mask; // empty: all of it
    void check() {
        check_frame_index(number);
        if (mask)
            phase->prepare_masked_refresh();
    }
    void enqueue(CommandChain &chain) { phase->enqueue_refresh(chain, number, mask); }
};

struct AdvancePhase {
    Phase *phase;
    std::uint64_t number;
    PhaseAdvance advance;
    void check() { phase->check_advance(advance); }
    void enqueue(CommandChain &chain) { phase->enqueue_advance(chain, number, advance); }
};

// What each pixel's material has in a table.
struct LookUpMaterial {
    cl::Kernel *kernel;
    ImageView material;
    cl_uint material_count;
    cl::Buffer table, values;
    void check() {}
    void enqueue(CommandChain &chain) {
        KernelArguments(*kernel)
            .add(material)
            .add(material_count)
            .add(table)
            .add(values)
            .add(cl_uint{material.width})
            .add(cl_uint{material.height});
        chain.run("subsurface", *kernel, material.width, material.height);
    }
};

struct Spread {
    FftFilter *filter;
    ImageView in, out;
    double fraction;
    ImageView weight;
    void check() {}
    void enqueue(CommandChain &chain) { filter->enqueue(chain, "subsurface", in, out, fraction, weight); }
};

struct ResetAir {
    Airflow *airflow;
    void check() {}
    void enqueue(CommandChain &) { airflow->reset(); }
};

struct AdvanceAir {
    Airflow *airflow;
    std::uint64_t number;
    void check() { check_frame_index(number); }
    void enqueue(CommandChain &chain) { airflow->enqueue_advance(chain, number); }
};

struct Image {
    Aperture *aperture;
    Phase *phase;
    ImageView irradiance, intensity;
    Exposure exposure;
    void check() {
        aperture->check_phase(*phase, exposure.field);
        aperture->prepare(*phase, exposure);
    }
    void enqueue(CommandChain &chain) { aperture->enqueue_intensity(chain, *phase, irradiance, intensity, exposure); }
};

struct ImageIncoherent {
    Aperture *aperture;
    ImageView irradiance, intensity;
    void check() { aperture->prepare_incoherent(); }
    void enqueue(CommandChain &chain) { aperture->enqueue_incoherent(chain, irradiance, intensity); }
};

struct Darken {
    LazyKernel *kernel;
    Context *context;
    ImageView intensity;
    void check() { kernel->get(*context); }
    void enqueue(CommandChain &chain) {
        cl::Kernel &dark = kernel->get(*context);
        KernelArguments(dark).add(intensity).add(cl_uint{intensity.width}).add(cl_uint{intensity.height});
        chain.run("intensity", dark, intensity.width, intensity.height);
    }
};

struct FinishLens {
    Lens *lens;
    ImageView light, out;
    bool dark;
    void check() { lens->check_finish(light, out); }
    void enqueue(CommandChain &chain) { lens->enqueue_finish(chain, light, out, dark); }
};

// To the tightly packed floats that effects of the user's own work on.
struct GatherPixels {
    LazyKernel *kernel;
    Context *context;
    ImageView image;
    cl::Buffer pixels;
    void check() { kernel->get(*context); }
    void enqueue(CommandChain &chain) {
        cl::Kernel &gather = kernel->get(*context);
        KernelArguments(gather).add(image).add(pixels).add(cl_uint{image.width}).add(cl_uint{image.height});
        chain.run("own_effect", gather, image.width, image.height);
    }
};

struct ApplyOwnEffect {
    std::shared_ptr<const OwnEffectStep> step; // shared, as a copy of the function would take memory in each frame
    cl::Buffer before, after;
    OwnEffectFrame frame;
    void check() {}
    void enqueue(CommandChain &chain) { (*step)(chain, before, after, frame); }
};

// Back to an image; top: see the kernel.
struct ScatterPixels {
    LazyKernel *kernel;
    Context *context;
    cl::Buffer pixels;
    float top;
    ImageView image;
    void check() { kernel->get(*context); }
    void enqueue(CommandChain &chain) {
        cl::Kernel &scatter = kernel->get(*context);
        KernelArguments(scatter)
            .add(pixels)
            .add(cl_float{top})
            .add(image)
            .add(cl_uint{image.width})
            .add(cl_uint{image.height});
        chain.run("own_effect", scatter, image.width, image.height);
    }
};

struct Expose {
    Sensor *sensor;
    ImageView light;
    std::uint64_t number;
    ImageView output;
    void check() {}
    void enqueue(CommandChain &chain) { sensor->enqueue_expose(chain, light, number, output); }
};

// Whether later frames begin with what a step leaves, so that to run it twice is not to run it once: from its first
// command on, or from its last.
enum class Moves { kNothing, kFirst, kLast };
template <typename Step> Moves moves_on(const Step &) {
    return Moves::kNothing;
}
inline Moves moves_on(const AdvancePhase &) {
    return Moves::kLast;
}
inline Moves moves_on(const AdvanceAir &) {
    return Moves::kFirst;
}

} // namespace frame_step

class FramePlan {
  public:
    // Forgets the steps, and keeps their memory.
    void clear() { steps_.clear(); }
    template <typename Step> void add(Step step) {
        step.check();
        steps_.push_back(std::move(step));
    }
    // moved: becomes true with the first step that moves on.
    void enqueue(CommandChain &chain, bool &moved) {
        for (Step &step : steps_)
            std::visit(
                [&](auto &s) {
                    const frame_step::Moves moves = moves_on(s);
                    moved = moved || moves == frame_step::Moves::kFirst;
                    s.enqueue(chain);
                    moved = moved || moves == frame_step::Moves::kLast;
                },
                step);
    }

  private:
    using Step =
        std::variant<frame_step::LookUpPattern, frame_step::RenderDots, frame_step::ComputeMotion, frame_step::Distort,
                     frame_step::DistortShift, frame_step::DrawPhase, frame_step::AdvancePhase,
                     frame_step::LookUpMaterial, frame_step::Spread, frame_step::ResetAir, frame_step::AdvanceAir,
                     frame_step::Image, frame_step::ImageIncoherent, frame_step::Darken, frame_step::FinishLens,
                     frame_step::GatherPixels, frame_step::ApplyOwnEffect, frame_step::ScatterPixels,
                     frame_step::Expose>;
    std::vector<Step> steps_;
};

} // namespace clsp

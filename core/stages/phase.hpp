// The surface's random field: state, refresh, advance, use. phase.h of the C API says what is stored.
#pragma once

#include "runtime/command_chain.hpp"
#include "runtime/device_buffer.hpp"
#include "runtime/fields.hpp"
#include "runtime/image_view.hpp"
#include "runtime/kernel_arguments.hpp"
#include "runtime/lazy_kernel.hpp"
#include "stages/bad_pixels.hpp"
#include "stages/field_grid.hpp"

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <string>

namespace clsp {

enum class FieldKind : std::uint32_t { kCircularGaussian = 0, kUnitPhasor = 1 };
enum class Dynamics : std::uint32_t { kReplace = 0, kContinuous = 1 };

// Knots of a continuous field that a path of 1 passes: the d at which R(d) = (1 - d/2) cos(pi d/2) + sin(pi d/2) / pi,
// the field's correlation over d knots, is 1/e.
constexpr double kKnotsPerPath = 0.9386677132131623;
// The largest substep: counters have the bits 8 to 14 of their last word for it.
constexpr std::uint32_t kMaxSubstep = 127;

struct PhaseParameters {
    std::uint32_t width = 0, height = 0, oversampling = 1, guard_px = 0;
    FieldKind field = FieldKind::kCircularGaussian;
    std::uint32_t polarization_count = 2;
    std::uint64_t seed = 0;
    Dynamics dynamics = Dynamics::kReplace;
    bool translate = false; // the state moves with the surface
};
CLSP_EQUALITY(PhaseParameters, width, height, oversampling, guard_px, field, polarization_count, seed, dynamics,
              translate)

// What happened to the surface since the last advance. Images are those of the pixels; empty ones say nothing.
struct PhaseAdvance {
    ImageView path;                                       // in correlation lengths
    ImageView correlation;                                // what time leaves of the field's correlation
    ImageView shift;                                      // in pixels: where the surface point was minus where it is
    ImageView mask;                                       // not 0: a new surface
    double uniform_path = 0.0, uniform_correlation = 1.0; // without an image
    double path_scale = 1.0;                              // on the path image: a part of the way
    bool continues = false;                               // a later part: what has an infinite path is new already
    std::uint32_t substep = 0;                            // tells several advances of one frame apart
};

class Phase {
  public:
    Phase(std::shared_ptr<Context> context, const PhaseParameters &parameters);

    const std::shared_ptr<Context> &context() const { return context_; }
    const PhaseParameters &parameters() const { return parameters_; }
    // Other parameters for the same grid. Where the state's layout changes, a drawn state is lost, and of a restored
    // one the polarizations stay that there still are; a change that needs more of them than it has is refused. A
    // refused change changes nothing.
    void configure(const PhaseParameters &parameters);
    const FieldGrid &grid() const { return grid_; }
    std::uint32_t polarization_count() const { return parameters_.polarization_count; }
    bool refreshed() const { return refreshed_; }
    // Back to how it was made: the next refresh draws everything.
    void forget() { refreshed_ = false; }
    std::uint64_t state_bytes() const { return (planes_ + rest_planes()) * grid_.samples() * sizeof(cl_uint); }
    // Where the state is from.
    struct Origin {
        std::uint64_t epoch = 0; // frame index of the last refresh of everything
        bool restored = false;   // the host gave it since
        std::uint32_t held = 0;  // polarizations of a restored state: more than the parameters say until it changes
    };
    const Origin &origin() const { return origin_; }
    void set_origin(const Origin &origin) { origin_ = origin; }
    // Paths and correlations that were NaN or out of range, shifts that were not finite.
    BadPixelCounter &bad_pixels() { return bad_pixels_; }

    // For kernels that read the state through stages/phase_state.h: how to build them, and their first three arguments.
    std::string state_options() const;
    void add_state(KernelArguments &arguments, std::uint32_t polarization) const;

    // mask: empty to draw everything.
    void enqueue_refresh(CommandChain &chain, std::uint64_t frame_index, const ImageView &mask);
    // Checks a mask image against this phase.
    // What a refresh inside a mask needs; without it the first one builds it.
    void prepare_masked_refresh() { refresh_masked_.get(*context_); }
    ImageView check_mask(const ImageDescription &mask, const char *name) const;
    // Checks what can be checked of an advance, and builds the kernel that it needs.
    void check_advance(const PhaseAdvance &advance);
    void enqueue_advance(CommandChain &chain, std::uint64_t frame_index, const PhaseAdvance &advance);
    void enqueue_field(CommandChain &chain, std::uint32_t polarization, const ImageDescription &field);
    void enqueue_save(CommandChain &chain, cl_mem mem, std::uint64_t offset_bytes);
    void enqueue_restore(CommandChain &chain, cl_mem mem, std::uint64_t offset_bytes);

  private:
    using AdvanceVariant = std::array<bool, 5>; // images of path, correlation, shift, mask; a correlation for all
    struct AdvanceKernels {
        cl::Kernel advance, claim; // claim: with a shift
        bool in_lanes = false;     // the one of kernels/stages/phase_advance_lanes.cl, a work-item for each row
    };
    void check_refreshed() const;
    void check_polarization(std::uint32_t polarization) const;
    AdvanceKernels &advance_kernels(const PhaseAdvance &advance);
    std::string kernel_options() const;
    std::uint64_t rest_planes() const { return parameters_.translate ? 2 : 0; }
    // Copies the state from or to the host's memory, which has no gap.
    void enqueue_copy(CommandChain &chain, cl_mem mem, std::uint64_t offset_bytes, bool to_state);

    std::shared_ptr<Context> context_;
    PhaseParameters parameters_;
    FieldGrid grid_;
    bool refreshed_ = false;
    Origin origin_;
    std::uint64_t planes_ = 0;      // words of a sample, without the rest of the shift
    std::uint64_t rest_offset_ = 0; // in words of the state; where the rest of the shift begins
    DeviceBuffer state_;
    DeviceBuffer next_state_; // what a moving state is gathered into; then the two change places
    DeviceBuffer owner_;      // of a moving state: which sample gets what lies at each place
    BadPixelCounter bad_pixels_;
    // refresh_all_ is the one of kernels/stages/phase_refresh_lanes.cl, a work-item for each row.
    bool refreshes_in_lanes_ = false;
    cl::Kernel refresh_all_;
    LazyKernel refresh_masked_, export_;
    std::map<AdvanceVariant, AdvanceKernels> advance_;
};

} // namespace clsp

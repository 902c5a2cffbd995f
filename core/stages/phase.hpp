// The surface's random field: state, refresh, use. phase.h of the C API says what is stored.
#pragma once

#include "runtime/command_chain.hpp"
#include "runtime/device_buffer.hpp"
#include "runtime/image_view.hpp"
#include "stages/field_grid.hpp"

#include <cstdint>
#include <memory>

namespace clsp {

enum class FieldKind : std::uint32_t { kCircularGaussian = 0, kUnitPhasor = 1 };

struct PhaseParameters {
    std::uint32_t width = 0, height = 0, oversampling = 1, guard_px = 0;
    FieldKind field = FieldKind::kCircularGaussian;
    std::uint32_t polarization_count = 2;
    std::uint64_t seed = 0;
};

class Phase {
  public:
    Phase(std::shared_ptr<Context> context, const PhaseParameters &parameters);

    const std::shared_ptr<Context> &context() const { return context_; }
    const FieldGrid &grid() const { return grid_; }
    std::uint32_t polarization_count() const { return polarization_count_; }
    bool refreshed() const { return refreshed_; }
    // Back to how it was made: the next refresh draws everything.
    void forget() { refreshed_ = false; }
    std::uint64_t state_bytes() const { return state_.bytes(); }

    // mask: empty to draw everything.
    void enqueue_refresh(CommandChain &chain, std::uint64_t frame_index, const ImageView &mask);
    // Checks a mask image against this phase.
    ImageView check_mask(const ImageDescription &mask, const char *name) const;
    void enqueue_field(CommandChain &chain, std::uint32_t polarization, const ImageDescription &field);
    // U = sqrt(I0) z into the grid-sized complex buffer `field`.
    void enqueue_illuminate(CommandChain &chain, std::uint32_t polarization, const ImageView &irradiance,
                            const cl::Buffer &field, const cl::Buffer &bad_pixels);
    void enqueue_save(CommandChain &chain, cl_mem mem, std::uint64_t offset_bytes);
    void enqueue_restore(CommandChain &chain, cl_mem mem, std::uint64_t offset_bytes);

  private:
    void check_refreshed() const;
    void check_polarization(std::uint32_t polarization) const;

    std::shared_ptr<Context> context_;
    FieldGrid grid_;
    FieldKind field_;
    std::uint32_t polarization_count_;
    std::uint64_t seed_;
    bool refreshed_ = false;
    DeviceBuffer state_;
    cl::Kernel refresh_all_, refresh_masked_, export_, illuminate_;
};

} // namespace clsp

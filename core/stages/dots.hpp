// Ideal projected dots with the defects of laser and DOE. The equations are in dots.h of the C API.
#pragma once

#include "runtime/command_chain.hpp"
#include "runtime/device_buffer.hpp"
#include "runtime/fields.hpp"
#include "runtime/image_view.hpp"

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

namespace clsp {

constexpr std::uint32_t kMaxDots = 1000000;

using Vector2 = std::array<double, 2>; // x, y

struct DotsParameters {
    std::uint32_t width = 0, height = 0;
    std::uint64_t count = 0;
    // Host memory, only read by the constructor and by configure().
    const double *positions_px = nullptr; // x, y of each dot
    const double *sigmas_px = nullptr;    // of each dot; nullptr: sigma_px
    const double *peaks = nullptr;        // of each dot; nullptr: 1
    double sigma_px = 2.0;
    double scale = 1.0;
    std::optional<Vector2> principal_point_px; // empty: the image's centre
    double relative_wavelength_shift = 0.0;
    double beam_skew = 0.0, beam_skew_angle_rad = 0.0;
    double beam_flatness = 0.0;
    double zero_order_relative_intensity = 0.0;
    double ghost_relative_intensity = 0.0;
    std::optional<Vector2> ghost_offset_px; // empty: from the lattice
    // Then half way along which of its vectors: both, the one to the right, the one downwards.
    enum class GhostDirection { kBoth, kRight, kDown } ghost_direction = GhostDirection::kBoth;
    double scatter_fraction = 0.0;
};
CLSP_EQUALITY(DotsParameters, width, height, count, positions_px, sigmas_px, peaks, sigma_px, scale,
              principal_point_px, relative_wavelength_shift, beam_skew, beam_skew_angle_rad, beam_flatness,
              zero_order_relative_intensity, ghost_relative_intensity, ghost_offset_px, ghost_direction,
              scatter_fraction)

class Dots {
  public:
    Dots(std::shared_ptr<Context> context, const DotsParameters &parameters);

    const std::shared_ptr<Context> &context() const { return context_; }
    // The pointers are to this object's own copies, and good until the next configure().
    const DotsParameters &parameters() const { return state_.parameters; }
    // All or nothing. The size stays as it is; count 0 with the three pointers nullptr: the dots of before.
    void configure(const DotsParameters &parameters);
    void enqueue_render(CommandChain &chain, const ImageView &irradiance);

  private:
    struct State {
        DotsParameters parameters;
        std::vector<double> positions_px, sigmas_px, peaks;
        DeviceBuffer first, members, nearest, shape; // as in stages/dots.cl
        cl::Kernel render;
        cl_float cosine = 1, sine = 0, skew_sixth = 0, power = 1, kept = 1, background = 0;
        std::uint32_t tiles_x = 0, tiles_y = 0;
    };
    State make_state(DotsParameters parameters) const;
    void add_common_arguments(class KernelArguments &arguments, const State &state) const;
    double mean_of_image(const State &state, const std::string &defines) const;

    std::shared_ptr<Context> context_;
    State state_;
};

} // namespace clsp

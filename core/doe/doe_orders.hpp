// The orders of a design, what it starts from, and what is told of it.
#pragma once

#include "runtime/progress.hpp"

#include <cstdint>
#include <vector>

namespace clsp {

enum class DoeRule : std::uint32_t { kGerchbergSaxton = 0, kWeighted = 1, kAdaptive = 2, kPhaseFixed = 3 };

struct DoeOrder {
    std::int32_t m, n; // m to the right, n down
    double weight;     // wanted power, relative to the other orders
};

constexpr std::uint32_t kLargestDoeSide = 8192, kLargestDoeLevels = 256, kLargestDoeIterations = 100000;
constexpr std::uint64_t kMostDoeOrders = 1000000;

struct DoeDesignParameters {
    std::uint32_t width = 512, height = 512; // pixels of the cell
    std::uint32_t levels = 8;                // 0: continuous
    double pixel_pitch_m = 0.4e-6, wavelength_m = 940e-9;
    double beam_diameter_m = 0.0; // 0: not known
    std::vector<DoeOrder> orders;
    std::uint64_t seed = 0;
    DoeRule rule = DoeRule::kWeighted;
    double feedback = 0.0; // 0: the rule's own
    std::uint32_t iterations = 100, quantization_iterations = 60;
    std::uint32_t fix_phase_iteration = 12; // of kPhaseFixed
    std::uint32_t search_sweeps = 0;
    bool compensate_envelope = true, mirror_orders = false;
    ProgressFunction progress;
};

struct DoeDesignReport {
    double efficiency = 0, grid_efficiency = 0;
    double uniformity_rms = 0, uniformity_peak_to_peak = 0;
    double weakest = 0, strongest = 0; // power over weight, relative to the mean
    double zero_order = 0, zero_order_relative = 0;
    double largest_ghost = 0, largest_ghost_relative = 0;
    std::int32_t ghost_m = 0, ghost_n = 0;
    double other_orders = 0, beyond = 0;
    double seconds = 0;
    std::uint64_t search_changes = 0;
    std::uint32_t search_sweeps = 0;
};

struct DoeDesignStep {
    double efficiency, uniformity_rms;
};

// Throws unless the parameters are a design that can be made; adds mirrored orders.
DoeDesignParameters checked_doe_parameters(DoeDesignParameters parameters);

// Amplitude of an order behind square pixels that fill the cell, relative to point samples: sinc(m / width) sinc(n /
// height).
double doe_envelope(std::int32_t m, std::int32_t n, std::uint32_t width, std::uint32_t height);

// The nearest orders of directions (u, v), and how far off they are. Throws where two directions are one order.
struct SnappedOrders {
    std::vector<DoeOrder> orders; // weight 1
    std::vector<double> errors;   // in direction cosines
};
SnappedOrders snap_directions(const std::vector<double> &directions, std::uint32_t width, std::uint32_t height,
                              double pixel_pitch_m, double wavelength_m);

} // namespace clsp

#include "stages/sensor_response.hpp"

#include <algorithm>
#include <cmath>

namespace clsp {
namespace {

double full_of(const SensorParameters &p) {
    return double((1u << p.bits) - 1u);
}

double bent_of(const SensorParameters &p, double signal) {
    return signal * (1.0 - p.cubic_nonlinearity * std::pow(std::min(signal / full_of(p), 1.0), p.nonlinearity_power));
}

} // namespace

double dark_signal_dn(const SensorParameters &p) {
    if (p.dark_current_e_per_s == 0.0)
        return 0.0;
    const double doublings = (p.temperature_c - p.dark_current_reference_temperature_c) / p.dark_current_doubling_k;
    return p.conversion_gain_dn_per_e * p.dark_current_e_per_s * p.exposure_time_s * std::exp2(doublings);
}

double response_dn(const SensorParameters &p, double signal_dn) {
    const double full = full_of(p), bent = bent_of(p, std::max(signal_dn, 0.0));
    return p.gamma == 1.0 ? bent : full * std::pow(bent / full, p.gamma);
}

double signal_of_response_dn(const SensorParameters &p, double response_dn) {
    const double full = full_of(p), response = std::max(response_dn, 0.0);
    const double bent = p.gamma == 1.0 ? response : full * std::pow(response / full, 1.0 / p.gamma);
    if (p.cubic_nonlinearity == 0.0)
        return bent;
    // It rises everywhere, and is bent one way: Newton's steps come near from one side.
    double signal = bent;
    for (int step = 0; step < 50; ++step) {
        const double part = signal / full, off = bent_of(p, signal) - bent, power = p.nonlinearity_power;
        const double slope = 1.0 - (part < 1.0 ? (power + 1.0) * std::pow(part, power) : 1.0) * p.cubic_nonlinearity;
        if (std::abs(off) <= 1e-9 * full || slope <= 0.0)
            break;
        signal = std::max(signal - off / slope, 0.0);
    }
    return signal;
}

double mean_dark_dn(const SensorParameters &p) {
    const double jumps = p.telegraph_centered ? 0.0 : 0.5 * p.telegraph_fraction * p.telegraph_step_dn;
    return p.black_level_dn + response_dn(p, std::min(dark_signal_dn(p), p.saturation_dn)) + jumps;
}

} // namespace clsp

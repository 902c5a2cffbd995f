#include "exposure_range.hpp"

#include "effects.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace tools {

ExposureRange::ExposureRange(const Config &config, bool has_sensor, double dark_dn)
    : has_sensor_(has_sensor), black_level_(config.number("sensor.black_level_dn")),
      read_noise_(config.number("sensor.read_noise_dn")), offset_(black_level_ + dark_dn) {
    auto traits = clspeckle::make<ClspCameraTraits>();
    traits.bits = static_cast<std::uint32_t>(config.integer("sensor.bits"));
    traits.saturation_dn = config.number("sensor.saturation_dn");
    if (has_sensor)
        traits = traits_with(config.effects(), traits);
    top_code_ = std::exp2(traits.bits) - 1;
    largest_code_ = std::exp2(traits.bits) -
                    std::exp2(traits.bits - (traits.effective_bits ? traits.effective_bits : traits.bits));
    largest_signal_ = traits.saturation_dn;
    if (std::isfinite(largest_signal_)) {
        largest_signal_ *= 1 - traits.cubic_nonlinearity *
                                   std::pow(std::min(largest_signal_ / top_code_, 1.0), traits.nonlinearity_power);
        largest_signal_ = top_code_ * std::pow(largest_signal_ / top_code_, traits.gamma);
    }
    ambient_light_ = traits.ambient_dn;
}

double ExposureRange::room() const {
    return std::min(largest_code_ - offset_, largest_signal_) - ambient_light_;
}

std::string ExposureRange::why_no_room() const {
    return fmt::format("the code without light, {:g}{} nothing of the range, which ends at {:g}; lower {}", offset_,
                       ambient_light_ > 0 ? fmt::format(", and ambient light of {:g} dn leave", ambient_light_)
                                          : " leaves",
                       std::min(largest_code_, offset_ + largest_signal_), ambient_light_ > 0 ? "them" : "it");
}

double ExposureRange::auto_signal() const {
    const double signal = std::min(top_code_ / 2 - black_level_, largest_signal_ / 2);
    return signal > 0 && signal <= room() ? signal : room() / 2;
}

double ExposureRange::last_code() const {
    if (!ends_below_top())
        return largest_code_;
    return offset_ + std::max(largest_signal_ - 3 * read_noise_, largest_signal_ / 2);
}

} // namespace tools

#include "inference/candidate.hpp"

#include "effects/effects.hpp"
#include "inference/thresholds.hpp"
#include "runtime/error.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/core.h>
#include <optional>
#include <utility>

namespace clsp {
namespace {

constexpr double kDeviations95 = 1.96;

// What the catalogue's ranges in DN are meant for.
constexpr double kCatalogueBits = 10.0, kCatalogueReadNoiseDn = 4.0;
// 1 / sqrt(12): no read noise that a data sheet says is less than a code's own
constexpr double kRoundingDn = 0.28867513459481288;

struct StrengthScale {
    double weak, strong;
    bool geometric;
};

StrengthScale scale_of(const HypothesisParameter &parameter) {
    StrengthScale scale{parameter.weak, parameter.strong, false};
    if (scale.weak == scale.strong && parameter.minimum < 0.0 && parameter.maximum > 0.0) {
        scale.strong += kStrengths.room_around_zero * (parameter.maximum - parameter.minimum);
        return scale;
    }
    if (scale.weak == scale.strong) {
        scale.weak = std::max(parameter.minimum, parameter.weak / kStrengths.room);
        scale.strong = std::min(parameter.maximum, parameter.strong * kStrengths.room);
        scale.geometric = scale.weak > 0.0;
        return scale;
    }
    // Over more than a factor of three equal steps are equal ratios.
    const double low = std::min(scale.weak, scale.strong), high = std::max(scale.weak, scale.strong);
    scale.geometric = low > 0.0 && high / low >= 3.0;
    return scale;
}

} // namespace

double Candidate::value(std::size_t parameter, double strength, double sign) const {
    const HypothesisParameter &p = parameters[parameter];
    return std::clamp(mirrored(clamped(parameter, strength, sign), sign, parameter), p.minimum, p.maximum);
}

double Candidate::clamped(std::size_t parameter, double strength, double sign) const {
    const HypothesisParameter p = towards(sign, parameter);
    const StrengthScale scale = scale_of(p);
    const double value = scale.geometric ? scale.weak * std::pow(scale.strong / scale.weak, strength)
                                         : scale.weak + strength * (scale.strong - scale.weak);
    return std::clamp(p.whole ? std::round(value) : value, p.minimum, p.maximum);
}

double Candidate::strength(std::size_t parameter, double value, double sign) const {
    const HypothesisParameter p = towards(sign, parameter);
    const StrengthScale scale = scale_of(p);
    if (scale.weak == scale.strong)
        return 0.0;
    value = mirrored(value, sign, parameter);
    if (scale.geometric && p.whole)
        value = std::max(value, kStrengths.count_of_none);
    return scale.geometric ? std::log(value / scale.weak) / std::log(scale.strong / scale.weak)
                           : (value - scale.weak) / (scale.strong - scale.weak);
}

double Candidate::weakest(std::size_t parameter) const {
    const HypothesisParameter &p = parameters[parameter];
    const bool fades = p.weak != p.strong && !p.whole && scale_of(p).geometric;
    return fades ? kStrengths.faintest : kStrengths.weakest;
}

double Candidate::snapped(std::size_t parameter, double at, double sign) const {
    const HypothesisParameter p = towards(sign, parameter);
    const double held = this->clamped(parameter, at, sign);
    return p.whole || held == p.minimum || held == p.maximum ? strength(parameter, value(parameter, at, sign), sign)
                                                             : at;
}

double Candidate::difference(std::size_t parameter, double at, double sign) const {
    const HypothesisParameter &p = parameters[parameter];
    if (!p.whole)
        return at > 0.9 ? -kFit.difference : kFit.difference;
    const double here = value(parameter, at, sign);
    const double one = (p.weak < p.strong ? 1.0 : -1.0) *
                       (is_mirrored(sign, parameter, Direction::kSign) ? -1.0 : 1.0); // more of the effect
    const double more = strength(parameter, here + one, sign) - at, less = strength(parameter, here - one, sign) - at;
    return at > 0.9 || more == 0.0 ? less : more;
}

bool Candidate::is_varied(std::size_t parameter) const {
    const auto varies = [](const HypothesisParameter &p) { return p.weak != p.strong; };
    return varies(parameters[parameter]) ||
           (parameter == 0 && std::none_of(parameters.begin(), parameters.end(), varies));
}

bool Candidate::is_slight(std::size_t parameter, double value) const {
    const auto varied = std::find_if(parameters.begin(), parameters.end(),
                                     [](const HypothesisParameter &p) { return p.weak != p.strong; });
    if (varied - parameters.begin() != static_cast<std::ptrdiff_t>(parameter))
        return false;
    return strength(parameter, value, parameter == 0 ? sign_of(value) : 1.0) < kStrengths.slight;
}

Candidate::Direction Candidate::direction() const {
    const HypothesisParameter &p = parameters.front();
    if (p.minimum < 0.0 && p.maximum > 0.0 && p.weak * p.strong >= 0.0 && p.weak + p.strong != 0.0)
        return Direction::kSign;
    const bool around_one = p.minimum > 0.0 && std::abs(p.minimum * p.maximum - 1.0) <= kStrengths.around_one;
    const bool one_side = (p.weak - 1.0) * (p.strong - 1.0) >= 0.0 && (p.weak != 1.0 || p.strong != 1.0);
    return p.unit == "1" && around_one && one_side && !p.whole ? Direction::kRatio : Direction::kNone;
}

double Candidate::sign_of(double value) const {
    const HypothesisParameter &p = parameters.front();
    if (is_ratio(0))
        return (value - 1.0) * (p.weak + p.strong - 2.0) < 0.0 ? -1.0 : 1.0;
    return has_direction() && value * (p.weak + p.strong) < 0.0 ? -1.0 : 1.0;
}

double Candidate::mirrored(double value, double sign, std::size_t parameter) const {
    return is_mirrored(sign, parameter, Direction::kSign)    ? -value
           : is_mirrored(sign, parameter, Direction::kRatio) ? 1.0 / value
                                                             : value;
}

HypothesisParameter Candidate::towards(double sign, std::size_t parameter) const {
    HypothesisParameter p = parameters[parameter];
    if (is_mirrored(sign, parameter, Direction::kSign)) {
        std::swap(p.minimum, p.maximum);
        p.minimum = -p.minimum;
        p.maximum = -p.maximum;
    } else if (is_mirrored(sign, parameter, Direction::kRatio)) {
        std::swap(p.minimum, p.maximum);
        p.minimum = 1.0 / p.minimum;
        p.maximum = 1.0 / p.maximum;
    }
    return p;
}

std::vector<Candidate> candidates(const std::vector<Hypothesis> &hypotheses, const std::vector<std::string> &without) {
    std::vector<Candidate> result;
    for (const Effect &effect : effect_catalogue()) {
        Candidate candidate{effect.id, effect.stage, effect.summary, {}, false};
        for (const EffectParameter &p : effect.parameters)
            candidate.parameters.push_back({p.name, p.unit, p.minimum, p.maximum, p.weak, p.strong, p.whole});
        if (effect.even)
            candidate.parameters.front().minimum = 0.0;
        result.push_back(std::move(candidate));
    }
    for (const Hypothesis &hypothesis : hypotheses)
        result.push_back({hypothesis.id, hypothesis.stage, hypothesis.summary, hypothesis.parameters, false});
    for (const std::string &id : without) {
        const auto found = std::find_if(result.begin(), result.end(), [&](const Candidate &c) { return c.id == id; });
        if (found == result.end())
            throw Error(
                Status::kInvalidArgument,
                fmt::format("\"{}\" cannot be left out: there is no such effect; `clspeckle effects` lists them", id));
        result.erase(found);
    }
    return result;
}

void scale_to_camera(std::vector<Candidate> &candidates, const CaptureLayout &camera, double dark_noise_dn) {
    const double range = camera.dn_of_ten_bits();
    const double stated =
        dark_noise_dn > kStrengths.sheet_noise * camera.read_noise_dn ? dark_noise_dn : camera.read_noise_dn;
    const double noise = std::max(stated, kRoundingDn) / kCatalogueReadNoiseDn;
    for (Candidate &candidate : candidates) {
        if (!in_catalogue(candidate.id))
            continue;
        for (HypothesisParameter &p : candidate.parameters) {
            const auto change = [&p](const auto &of) {
                p.weak = std::clamp(of(p.weak), p.minimum, p.maximum);
                p.strong = std::clamp(of(p.strong), p.minimum, p.maximum);
            };
            if (p.name == "sigma_dn") {
                change([&](double value) { return value * noise; });
            } else if (p.unit.rfind("DN", 0) == 0) {
                change([&](double value) { return value * range; });
            } else if (p.unit == "bits") {
                p.maximum = std::min(p.maximum, static_cast<double>(camera.bits));
                change([&](double value) { return value + camera.bits - kCatalogueBits; });
            }
        }
    }
}

void hold_at_quantities(std::vector<Candidate> &candidates, const std::vector<Quantity> &quantities) {
    const auto told = [&](const char *name) -> std::optional<double> {
        const auto found = std::find_if(quantities.begin(), quantities.end(), [&](const Quantity &q) {
            return q.name == name && std::isfinite(q.value);
        });
        return found == quantities.end() ? std::nullopt : std::optional(found->value);
    };
    const auto hold = [&](Candidate &candidate) {
        for (const MeasuredParameter &measured : find_effect(candidate.id).measured_parameters) {
            const auto value = told(measured.quantity), error = measured.error ? told(measured.error) : 0.0;
            if (!value || !error)
                return false;
            for (HypothesisParameter &p : candidate.parameters)
                if (p.name == measured.parameter) {
                    p.weak = p.strong = std::clamp(*value, p.minimum, p.maximum);
                    p.minimum = p.weak - kDeviations95 * *error;
                    p.maximum = p.weak + kDeviations95 * *error;
                    p.measured = true;
                }
        }
        return true;
    };
    candidates.erase(std::remove_if(candidates.begin(), candidates.end(),
                                    [&](Candidate &c) { return in_catalogue(c.id) && !hold(c); }),
                     candidates.end());
}

bool before(const Candidate &a, const Candidate &b) {
    const auto usual = [](const Candidate &c) { return c.parameters.size() > 1 ? c.parameters[1].weak : 0.0; };
    return a.id != b.id ? a.id < b.id : usual(a) < usual(b);
}

std::vector<Candidate> with_alternatives(std::vector<Candidate> candidates) {
    for (const Effect &effect : effect_catalogue()) {
        // The catalogue's own comes first.
        const auto found =
            std::find_if(candidates.begin(), candidates.end(), [&](const Candidate &c) { return c.id == effect.id; });
        if (found == candidates.end())
            continue;
        const Candidate usual = *found;
        std::size_t told_by_fits = 0;
        for (const EffectForms &forms : effect.forms)
            for (const double value : forms.values) {
                Candidate other = usual;
                other.form = forms.told_by_fit ? ++told_by_fits : 0;
                for (HypothesisParameter &p : other.parameters)
                    if (p.name == forms.parameter)
                        p.weak = p.strong = value;
                candidates.push_back(std::move(other));
            }
    }
    return candidates;
}

} // namespace clsp

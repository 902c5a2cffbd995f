#include "inference/effect_model.hpp"

#include "effects/effects.hpp"
#include "inference/thresholds.hpp"
#include "statistics/distributions.hpp"

#include <algorithm>
#include <cmath>

namespace clsp {
namespace {

// OpenReading::kFrameBefore: what had remained in the frame before is there two frames later, f^2 of it.
void add_lag_readings(const std::vector<StatisticInfo> &list, const CaptureLayout &layout, double fraction,
                      const Eigen::VectorXd &change, Eigen::VectorXd &tolerance) {
    for (std::size_t k = 0; k < list.size(); ++k) {
        double &of_one = tolerance[static_cast<Eigen::Index>(k)];
        if (list[k].name == "temporal_correlation_1" || list[k].name == "temporal_correlation_2")
            of_one += fraction * fraction;
        for (const SequenceLayout &sequence : layout.sequences)
            if (sequence.name == list[k].sequence && sequence.moving)
                of_one += std::abs(change[static_cast<Eigen::Index>(k)]) / sequence.frame_count;
    }
}

// OpenReading::kPhotonLaw: Poisson's law is lopsided.
void add_photon_readings(const std::vector<StatisticInfo> &list, const Eigen::VectorXd &change,
                         Eigen::VectorXd &tolerance) {
    for (std::size_t k = 0; k < list.size(); ++k)
        if (list[k].name == "noise_skewness")
            tolerance[static_cast<Eigen::Index>(k)] += std::abs(change[static_cast<Eigen::Index>(k)]);
}

// Where dots lie.
bool is_of_positions(const std::string &name) {
    for (const char *of_positions : {"dot_shift_x", "dot_shift_y", "dot_radial_displacement", "dot_cubic_displacement",
                                     "dot_turn", "dot_anisotropy", "dot_shear", "dot_position_scatter"})
        if (name == of_positions)
            return true;
    return false;
}

// OpenReading::kWhatMoves: the camera's lens stretches the dots with the picture, the projector's only moves them.
// change: of the statistics, by a whole unit of strength.
void add_position_readings(const std::vector<StatisticInfo> &list, const EffectParameter &parameter, double value,
                           const Eigen::VectorXd &change, Eigen::VectorXd &tolerance) {
    const double strengths = value / (parameter.strong - parameter.weak);
    for (std::size_t k = 0; k < list.size(); ++k)
        if (!is_of_positions(list[k].name))
            tolerance[static_cast<Eigen::Index>(k)] += std::abs(strengths * change[static_cast<Eigen::Index>(k)]);
}

} // namespace

EffectSettings EffectModel::settings() const {
    EffectSettings result;
    for (const ModelEffect &effect : effects) {
        result.push_back({effect.candidate->id, {}});
        for (const HypothesisParameter &parameter : effect.candidate->parameters)
            result.back().values.push_back(parameter.weak); // of a choice; the others follow
    }
    for (const Strength &s : strengths)
        result[s.effect].values[s.parameter] =
            effects[s.effect].candidate->value(s.parameter, s.strength, effects[s.effect].sign);
    return result;
}

std::size_t EffectModel::slight_count(const Eigen::VectorXd &step) const {
    std::size_t count = 0;
    for (std::size_t k = 0; k < strengths.size(); ++k) {
        const Strength &s = strengths[k];
        const ModelEffect &effect = effects[s.effect];
        const double strength = s.strength + (step.size() ? step[static_cast<Eigen::Index>(k)] : 0.0);
        if (effect.candidate->is_slight(s.parameter, effect.candidate->value(s.parameter, strength, effect.sign)))
            ++count;
    }
    return count < effects.size() ? count : 0;
}

bool EffectModel::has(const Candidate &candidate) const {
    return std::any_of(effects.begin(), effects.end(),
                       [&](const ModelEffect &e) { return e.candidate->id == candidate.id; });
}

void EffectModel::add(const Candidate &candidate, double sign, double strength) {
    effects.push_back({&candidate, sign});
    for (std::size_t p = 0; p < candidate.parameters.size(); ++p)
        if (!candidate.is_choice(p))
            strengths.push_back({effects.size() - 1, p,
                                 candidate.is_varied(p) ? candidate.snapped(p, strength, sign)
                                                        : candidate.strength(p, candidate.usual(p, sign), sign)});
}

double EffectModel::unlikelihood(std::size_t effect) const {
    const Candidate &candidate = *effects[effect].candidate;
    const double sign = effects[effect].sign;
    double sum = 0.0;
    for (const Strength &s : strengths) {
        if (s.effect != effect || !candidate.is_varied(s.parameter))
            continue;
        const HypothesisParameter &p = candidate.parameters[s.parameter];
        const double usual = candidate.strength(s.parameter, candidate.usual(s.parameter, sign), sign);
        const double off = p.weak == p.strong ? s.strength - usual : std::max(0.0, s.strength - kStrengths.common);
        sum += std::pow(off / kStrengths.deviation, 2);
    }
    return sum;
}

EffectModel EffectModel::without(std::size_t effect) const {
    EffectModel result = *this;
    result.effects.erase(result.effects.begin() + static_cast<std::ptrdiff_t>(effect));
    result.strengths.clear();
    for (Strength s : strengths)
        if (s.effect != effect) {
            s.effect -= s.effect > effect ? 1 : 0;
            result.strengths.push_back(s);
        }
    return result;
}

EffectModel EffectModel::first(std::size_t count) const {
    EffectModel result = *this;
    while (result.effects.size() > count)
        result = result.without(count);
    return result;
}

Eigen::VectorXd EffectModel::distance_from(const EffectModel &other) const {
    Eigen::VectorXd result(static_cast<Eigen::Index>(strengths.size()));
    for (std::size_t p = 0; p < strengths.size(); ++p)
        result[static_cast<Eigen::Index>(p)] = strengths[p].strength - other.strengths[p].strength;
    return result;
}

double EffectModel::difference(Eigen::Index strength, double part) const {
    const Strength &s = strengths[static_cast<std::size_t>(strength)];
    const Candidate &candidate = *effects[s.effect].candidate;
    return candidate.difference(s.parameter, s.strength, effects[s.effect].sign) *
           (candidate.parameters[s.parameter].whole ? std::copysign(1.0, part) : part);
}

double move_one(EffectModel &model, Eigen::Index strength, double part) {
    const double step = model.difference(strength, part);
    Strength &s = model.strengths[static_cast<std::size_t>(strength)];
    const Candidate &candidate = *model.effects[s.effect].candidate;
    const double at = s.strength;
    const double sign = model.effects[s.effect].sign;
    const auto way = [&](double distance) { return candidate.snapped(s.parameter, at + distance, sign) - at; };
    double moved = way(step);
    if (std::abs(moved) < kFit.least_difference * std::abs(step)) {
        const double back = way(-step);
        moved = std::abs(back) > std::abs(moved) ? back : moved;
    }
    s.strength = at + moved;
    return moved != 0.0 ? moved : step != 0.0 ? step : 1.0; // what has one value only changes nothing
}

std::vector<Eigen::Index> stop_where_nothing_shows(const std::vector<Strength> &strengths,
                                                   const Eigen::MatrixXd &columns, Eigen::VectorXd &step) {
    std::vector<Eigen::Index> stopped;
    for (Eigen::Index p = 0; p < step.size(); ++p)
        if (strengths[static_cast<std::size_t>(p)].strength <= kStrengths.weakest && step[p] < 0.0 &&
            columns.col(p).norm() < kStrengths.least_slope) {
            step[p] = 0.0;
            stopped.push_back(p);
        }
    return stopped;
}

double move_strengths(EffectModel &model, const Eigen::VectorXd &step, double strongest) {
    double largest = 0.0;
    for (std::size_t p = 0; p < model.strengths.size(); ++p) {
        const double bounded = std::clamp(step[static_cast<Eigen::Index>(p)], -kFit.largest_step, kFit.largest_step);
        Strength &s = model.strengths[p];
        const ModelEffect &effect = model.effects[s.effect];
        const double end = std::max(strongest, s.reach);
        const double moved = std::clamp(s.strength + bounded, effect.candidate->weakest(s.parameter), end);
        s.strength = effect.candidate->snapped(s.parameter, moved, effect.sign);
        largest = std::max(largest, std::abs(bounded));
    }
    return largest;
}

std::vector<FittedParameter> fitted_parameters(const EffectModel &model, const Eigen::VectorXd &strengths,
                                               const Eigen::VectorXd &deviations, double replicates) {
    const double factor = student_two_sided_quantile(0.05, replicates - 1.0) * std::sqrt(1.0 + 1.0 / replicates);
    std::vector<FittedParameter> result;
    for (Eigen::Index p = 0; p < strengths.size(); ++p) {
        const Strength &s = model.strengths[static_cast<std::size_t>(p)];
        const ModelEffect &effect = model.effects[s.effect];
        const auto value = [&](double strength) { return effect.candidate->value(s.parameter, strength, effect.sign); };
        const double a = value(strengths[p] - factor * deviations[p]), b = value(strengths[p] + factor * deviations[p]);
        result.push_back({effect.candidate->id, effect.candidate->parameters[s.parameter].name, value(strengths[p]),
                          std::min(a, b), std::max(a, b)});
    }
    for (const ModelEffect &effect : model.effects)
        for (std::size_t p = 0; p < effect.candidate->parameters.size(); ++p)
            if (effect.candidate->is_choice(p)) {
                const HypothesisParameter &parameter = effect.candidate->parameters[p];
                result.push_back({effect.candidate->id, parameter.name, parameter.weak,
                                  parameter.measured ? parameter.minimum : parameter.weak,
                                  parameter.measured ? parameter.maximum : parameter.weak});
            }
    return result;
}

Eigen::VectorXd simulator_error(const std::vector<StatisticInfo> &list, const Eigen::VectorXd &change) {
    Eigen::VectorXd result = kModelError.of_effects * change;
    for (Eigen::Index k = 0; k < change.size(); ++k)
        if (list[static_cast<std::size_t>(k)].unit == "log")
            result[k] = std::copysign(kModelError.of_effects * (1.0 - std::exp(-std::abs(change[k]))), change[k]);
    return result;
}

Eigen::VectorXd strength_deviations(const GapModel &model, const Eigen::MatrixXd &strays,
                                    const Eigen::VectorXd &error) {
    const Covariance &covariance = model.full();
    Eigen::VectorXd variance = strays.colwise().squaredNorm().transpose() / (static_cast<double>(strays.rows()) - 1.0);
    variance += model.coefficients(covariance, kModelError.of_effects_in_intervals * error).cwiseAbs2();
    for (Eigen::Index k = 0; k < error.size(); ++k) {
        // Beside the simulator's error, what a definition's two readings differ by.
        const double readings = std::max(0.0, covariance.tolerance()[k] - std::abs(error[k]));
        const double tolerance = readings + kModelError.of_effects_in_intervals * std::abs(error[k]);
        if (tolerance > 0.0)
            variance += model.coefficients(covariance, tolerance * Eigen::VectorXd::Unit(error.size(), k)).cwiseAbs2();
    }
    Eigen::VectorXd result = variance.cwiseSqrt();
    for (Eigen::Index p = 0; p < result.size(); ++p)
        if (covariance.whiten(model.directions().col(p)).norm() < kFit.nothing_said)
            result[p] = kStrengths.unbounded;
    return result;
}

Eigen::VectorXd reading_tolerance(const std::vector<StatisticInfo> &list, const CaptureLayout &layout,
                                  const EffectSettings &effects, const std::vector<Strength> &columns,
                                  const Eigen::VectorXd &change, const Eigen::MatrixXd &jacobian) {
    Eigen::VectorXd result = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(list.size()));
    for (std::size_t p = 0; p < columns.size(); ++p) {
        if (columns[p].parameter != 0)
            continue;
        const EffectSetting &setting = effects[columns[p].effect];
        if (!in_catalogue(setting.id))
            continue; // a hypothesis, which defines itself
        const Effect &effect = find_effect(setting.id);
        const double value = setting.values.front();
        switch (effect.open_reading) {
        case OpenReading::kNone:
            break;
        case OpenReading::kFrameBefore:
            add_lag_readings(list, layout, value, change, result);
            break;
        case OpenReading::kPhotonLaw:
            add_photon_readings(list, change, result);
            break;
        case OpenReading::kWhatMoves:
            add_position_readings(list, effect.parameters.front(), value, jacobian.col(static_cast<Eigen::Index>(p)),
                                  result);
            break;
        }
    }
    return result;
}

void weigh(std::vector<RankedEffect> &ranking) {
    double best = 0.0, sum = 0.0;
    for (const RankedEffect &ranked : ranking)
        best = std::max(best, ranked.gain);
    for (RankedEffect &ranked : ranking) {
        ranked.probability = std::exp(-(best - ranked.gain) / (2.0 * kGrowth.temperature));
        sum += ranked.probability;
    }
    for (RankedEffect &ranked : ranking)
        ranked.probability /= sum;
    std::stable_sort(ranking.begin(), ranking.end(),
                     [](const RankedEffect &a, const RankedEffect &b) { return a.probability > b.probability; });
}

} // namespace clsp

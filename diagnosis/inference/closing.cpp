#include "inference/closing.hpp"

#include "inference/effect_model.hpp"
#include "inference/least_squares.hpp"
#include "inference/response.hpp"
#include "inference/thresholds.hpp"
#include "runtime/error.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/core.h>
#include <numeric>

namespace clsp {
namespace {

FoldStatistics minus(const FoldStatistics &a, const FoldStatistics &b) {
    return {a.first - b.first, a.second - b.second};
}

// One effect's answers to its strength, on top of the others.
struct Answer {
    const Candidate *candidate = nullptr;
    double sign = 1.0, strength = 0.5, gain = 0.0;
    Response first, second; // of either half
    bool fitted = false;
};

class Closing {
  public:
    Closing(ReplicateRunner &runner, FinishedFrames &finished, const std::vector<Candidate> &candidates,
            const FoldStatistics &difference, const GapModel &null, const ClosingOptions &options,
            const Progress &progress)
        : runner_(runner), finished_(finished), candidates_(candidates), difference_(difference), null_(&null),
          options_(options), progress_(progress) {}

    ClosingResult run();

  private:
    std::size_t sequences() const { return runner_.layout().sequences.size(); }
    const FoldStatistics &unaltered();
    FoldStatistics measured(const EffectSettings &effects);
    // What the effects change in the statistics, with common random numbers.
    FoldStatistics change(const EffectSettings &effects) { return minus(measured(effects), unaltered()); }
    Eigen::VectorXd whitened(const Eigen::VectorXd &v) const { return metric_->fold().whiten(v); }
    double chance() const;
    std::vector<Answer> screen(const EffectModel &model, std::vector<SurplusEffect> *surplus);
    void refine(Answer &answer, const EffectModel &model);
    double best_strength(const Answer &answer) const;
    ClosedGap fit(EffectModel &model, double from, double to);
    void tell(const std::string &what, double fraction) const {
        if (progress_)
            progress_(what, fraction);
    }

    ReplicateRunner &runner_;
    FinishedFrames &finished_;
    const std::vector<Candidate> &candidates_;
    const FoldStatistics &difference_;
    const GapModel *null_;
    ClosingOptions options_;
    Progress progress_;
    const GapModel *metric_ = nullptr;
    FoldStatistics rest_, change_; // of the model so far: what it leaves, what it changes
    std::vector<std::vector<std::uint16_t>> unaltered_codes_;
    FoldStatistics unaltered_;
};

// Frames that went through the same rounding without any effect: what all changes are counted from.
const FoldStatistics &Closing::unaltered() {
    if (unaltered_codes_.empty()) {
        for (std::size_t s = 0; s < sequences(); ++s)
            unaltered_codes_.push_back(finished_.codes(s, {}, options_.seed));
        const Calibration calibration = runner_.calibration_of(unaltered_codes_);
        const auto count = static_cast<Eigen::Index>(runner_.count());
        unaltered_ = {Eigen::VectorXd(count), Eigen::VectorXd(count)};
        for (std::size_t s = 0; s < sequences(); ++s)
            runner_.measure(s, unaltered_codes_[s].data(), calibration, unaltered_);
    }
    return unaltered_;
}

FoldStatistics Closing::measured(const EffectSettings &effects) {
    FoldStatistics result = unaltered();
    std::vector<std::vector<std::uint16_t>> codes(sequences());
    std::vector<bool> altered(sequences());
    bool dark_altered = false;
    for (std::size_t s = 0; s < sequences(); ++s) {
        for (const EffectSetting &effect : effects)
            altered[s] = altered[s] || finished_.concerns(effect.id, s);
        const bool dark = runner_.layout().sequences[s].scene == CaptureScene::kDark;
        dark_altered = dark_altered || (dark && altered[s]);
        if (runner_.checkpoint)
            runner_.checkpoint();
        if (altered[s])
            codes[s] = finished_.codes(s, effects, options_.seed);
        else if (dark)
            codes[s] = unaltered_codes_[s];
    }
    const Calibration calibration = runner_.calibration_of(codes);
    // Dark frames are the measure of all others.
    for (std::size_t s = 0; s < sequences(); ++s)
        if (altered[s] || dark_altered)
            runner_.measure(s, altered[s] ? codes[s].data() : unaltered_codes_[s].data(), calibration, result);
    return result;
}

// Mean squared whitened difference of a half by chance.
double Closing::chance() const {
    const auto &draws = metric_->replicates().draws;
    double sum = 0.0;
    for (const FoldStatistics &draw : draws)
        sum += whitened(draw.second - metric_->second_mean()).squaredNorm();
    return sum / static_cast<double>(draws.size());
}

std::vector<Answer> Closing::screen(const EffectModel &model, std::vector<SurplusEffect> *surplus) {
    const Eigen::VectorXd target = whitened(rest_.first);
    std::vector<Answer> result;
    for (const Candidate &candidate : candidates_) {
        if (model.has(candidate))
            continue;
        bool concerned = false;
        for (std::size_t s = 0; s < sequences(); ++s)
            concerned = concerned || finished_.concerns(candidate.id, s);
        if (!concerned)
            continue;
        tell("screening " + candidate.id, 0.0);
        Answer answer;
        answer.candidate = &candidate;
        answer.first = answer.second = Response(candidate.weakest(0));
        FoldStatistics moved; // by the first strength that changed something in the wanted direction, or the last one
        double square = 0.0, screened_at = 0.0;
        Eigen::VectorXd direction;
        for (const double strength : Candidate::kScreeningStrengths) {
            EffectModel with = model;
            with.add(candidate, 1.0, strength);
            FoldStatistics changed;
            if (!possible([&] { changed = minus(change(with.settings()), change_); }))
                continue;
            const Eigen::VectorXd towards = whitened(changed.first);
            if (!(towards.squaredNorm() > 0.0))
                continue;
            moved = std::move(changed);
            screened_at = strength;
            direction = towards;
            square = direction.squaredNorm();
            // Where it does nothing half way, it may do the opposite on either side.
            if (strength == Candidate::kScreeningStrengths[0] || direction.dot(target) > 0.0 ||
                candidate.has_direction())
                break;
        }
        if (!(square > 0.0))
            continue;
        const double coefficient = direction.dot(target) / square;
        answer.gain = coefficient * coefficient * square;
        if (coefficient > 0.0) {
            answer.first.add(candidate.snapped(0, screened_at), {moved.first, {}, {}});
            answer.second.add(candidate.snapped(0, screened_at), {moved.second, {}, {}});
        } else {
            if (candidate.has_direction()) {
                answer.sign = -1.0;
            } else {
                if (surplus && answer.gain > kGrowth.least_gain)
                    surplus->push_back({candidate.id, answer.gain});
                answer.gain = 0.0;
            }
        }
        result.push_back(std::move(answer));
    }
    std::stable_sort(result.begin(), result.end(), [](const Answer &a, const Answer &b) { return a.gain > b.gain; });
    keep_one_of_each(result, [](const Answer &answer) { return answer.candidate->id; });
    return result;
}

double Closing::best_strength(const Answer &answer) const {
    const Eigen::VectorXd target = whitened(rest_.first);
    double best = 1e300, at = 0.5;
    for (double u = answer.candidate->weakest(0); u <= kStrengths.strongest; u += kStrengths.grid_step) {
        const double square = (target - whitened(answer.first.at(u))).squaredNorm();
        if (square < best) {
            best = square;
            at = u;
        }
    }
    return at;
}

// Fitted on the first half, judged on the second.
void Closing::refine(Answer &answer, const EffectModel &model) {
    const auto simulate = [&](double strength) {
        EffectModel with = model;
        with.add(*answer.candidate, answer.sign, strength);
        const FoldStatistics moved = minus(change(with.settings()), change_);
        answer.first.add(strength, {moved.first, {}, {}});
        answer.second.add(strength, {moved.second, {}, {}});
    };
    for (const double asked : {0.0, 0.5, 1.0}) {
        const double strength = answer.candidate->snapped(0, asked, answer.sign);
        if (answer.first.empty() || answer.first.distance(strength) > kStrengths.near)
            simulate(strength);
    }
    for (int round = 0;; ++round) {
        answer.strength = answer.candidate->snapped(0, best_strength(answer), answer.sign);
        if (round == kComparison.fit_rounds || answer.first.distance(answer.strength) < kStrengths.near)
            break;
        simulate(answer.strength);
    }
    const Eigen::VectorXd target = whitened(rest_.second);
    answer.gain = target.squaredNorm() - (target - whitened(answer.second.at(answer.strength))).squaredNorm();
}

// All strengths together, by Gauss-Newton steps on the first half; then the test of what is left, with the scatter that
// the effects bring.
ClosedGap Closing::fit(EffectModel &model, double from, double to) {
    ClosedGap result;
    const auto count = static_cast<Eigen::Index>(runner_.count());
    const auto parameters = static_cast<Eigen::Index>(model.strengths.size());
    const auto distance = [&](const FoldStatistics &moved) {
        return whitened(difference_.first - moved.first).squaredNorm();
    };
    FoldStatistics moved = change(model.settings());
    result.jacobian.resize(count, parameters);
    for (int round = 0; round < kFit.rounds; ++round) {
        for (Eigen::Index p = 0; p < parameters; ++p) {
            tell("fitting " + model.id_of(p), from);
            EffectModel other = model;
            double step = move_one(other, p);
            FoldStatistics there;
            if (!possible([&] { there = change(other.settings()); })) {
                other = model;
                step = move_one(other, p, -1.0);
                there = change(other.settings());
            }
            result.jacobian.col(p) = (minus(there, moved).mean()) / step;
        }
        if (round + 1 == kFit.rounds)
            break;
        const Eigen::MatrixXd columns = whiten_columns(metric_->fold(), result.jacobian);
        Eigen::VectorXd step = solve_least_squares(columns, whitened(difference_.first - moved.first));
        stop_where_nothing_shows(model.strengths, columns, step);
        EffectModel next = model;
        const double largest = move_strengths(next, step);
        FoldStatistics there;
        if (largest < 0.5 * kStrengths.near || !possible([&] { there = change(next.settings()); }) ||
            distance(there) >= distance(moved))
            break;
        model = next;
        moved = there;
    }
    result.effects = model.settings();
    result.change = moved;
    std::string label;
    for (const EffectSetting &effect : result.effects)
        label += (label.empty() ? "" : " + ") + effect.id;
    EffectSettings scattering = options_.camera.effects;
    for (const EffectSetting &effect : result.effects)
        if (std::none_of(scattering.begin(), scattering.end(),
                         [&](const EffectSetting &other) { return other.id == effect.id; }))
            scattering.push_back(effect);
    Replicates replicates;
    // Effects that our simulator does not take at these values leave the scatter of the camera without them.
    if (!possible([&] {
            replicates = draw_differences(
                runner_, scattering, options_.camera.gain_dn, options_.model_replicates, options_.seed,
                [&](double part) { tell("drawing differences with " + label, from + (to - from) * part); });
        }))
        replicates = null_->replicates();
    for (FoldStatistics &draw : replicates.draws) {
        draw.first += moved.first;
        draw.second += moved.second;
    }
    const Eigen::VectorXd tolerance = simulator_error(runner_.list(), moved.mean()).cwiseAbs();
    result.model =
        std::make_shared<const GapModel>(runner_, replicates, options_.residual_level, result.jacobian, tolerance);
    result.residual = result.model->test(difference_);
    // A last, linear step with the scatter of cameras that have the effects; then how far the same step strays by
    // chance.
    const Covariance &fold = result.model->fold();
    Eigen::VectorXd step = result.model->coefficients(fold, difference_.first - result.model->first_mean())
                               .cwiseMax(-kFit.largest_step)
                               .cwiseMin(kFit.largest_step);
    stop_where_nothing_shows(model.strengths, whiten_columns(fold, result.jacobian), step);
    const EffectModel last = model;
    move_strengths(model, step);
    const Eigen::VectorXd change_of_last = result.jacobian * model.distance_from(last);
    result.change.first += change_of_last;
    result.change.second += change_of_last;
    result.effects = model.settings();
    const Eigen::MatrixXd strays = result.model->strays(runner_, GapModel::Fit::kFirst);
    Eigen::VectorXd strengths(parameters);
    for (Eigen::Index p = 0; p < parameters; ++p)
        strengths[p] = model.strengths[std::size_t(p)].strength;
    const Eigen::VectorXd deviations =
        strength_deviations(*result.model, strays, simulator_error(runner_.list(), moved.mean()));
    result.parameters =
        fitted_parameters(model, strengths, deviations.cwiseProduct(result.model->birge_ratios(difference_)),
                          static_cast<double>(strays.rows()));
    return result;
}

ClosingResult Closing::run() {
    ClosingResult result;
    result.models.reserve(options_.max_effects); // pointers into it stay
    metric_ = null_;
    rest_ = difference_;
    const auto count = static_cast<Eigen::Index>(runner_.count());
    change_ = {Eigen::VectorXd::Zero(count), Eigen::VectorXd::Zero(count)};
    EffectModel model;
    double progress = 0.0;
    while (model.effects.size() < options_.max_effects) {
        const double share = 0.5 * (1.0 - progress);
        tell("screening", progress);
        std::vector<Answer> answers = screen(model, model.effects.empty() ? &result.surplus : nullptr);
        answers.erase(std::remove_if(answers.begin(), answers.end(),
                                     [](const Answer &a) { return a.gain < 0.5 * kGrowth.least_gain; }),
                      answers.end());
        if (answers.size() > options_.refined)
            answers.resize(options_.refined);
        if (answers.empty())
            break;
        const double excess = whitened(rest_.second).squaredNorm() - chance();
        const double best_screened = answers.front().gain;
        double explained = 0.0;
        for (std::size_t i = 0; i < answers.size(); ++i) {
            Answer &answer = answers[i];
            if (explained > kScreening.nearly_all * excess &&
                answer.gain < kScreening.least_beside_that * best_screened)
                continue;
            tell("fitting " + answer.candidate->id, progress + 0.5 * share * double(i) / double(answers.size()));
            answer.fitted = possible([&] { refine(answer, model); });
            if (answer.fitted)
                explained = std::max(explained, answer.gain);
        }
        answers.erase(std::remove_if(answers.begin(), answers.end(), [](const Answer &a) { return !a.fitted; }),
                      answers.end());
        std::stable_sort(answers.begin(), answers.end(),
                         [](const Answer &a, const Answer &b) { return a.gain > b.gain; });
        if (answers.empty() || answers.front().gain < kGrowth.least_gain)
            break;
        // Where a residual remains, an effect must explain a share of what is beyond chance.
        if (!model.effects.empty() && answers.front().gain < kGrowth.least_share * excess)
            break;
        EffectModel with = model;
        with.add(*answers.front().candidate, answers.front().sign, answers.front().strength);
        ClosedGap closed = fit(with, progress + 0.5 * share, progress + share);
        progress += share;
        SearchStep step;
        step.added = answers.front().candidate->id;
        step.residual = closed.residual;
        for (const Answer &answer : answers) {
            RankedEffect ranked;
            ranked.effect = answer.candidate->id;
            ranked.gain = answer.gain;
            EffectModel alone;
            alone.add(*answer.candidate, answer.sign, answer.strength);
            ranked.values = alone.settings().front().values;
            ranked.distance_after = std::sqrt(std::max(0.0, (excess - answer.gain) / double(count)));
            step.ranking.push_back(std::move(ranked));
        }
        weigh(step.ranking);
        model = with;
        change_ = closed.change;
        rest_ = minus(difference_, change_);
        result.steps.push_back(std::move(step));
        result.models.push_back(std::move(closed));
        metric_ = result.models.back().model.get();
        if (!result.models.back().residual.detected)
            break;
    }
    std::sort(result.surplus.begin(), result.surplus.end(),
              [](const SurplusEffect &a, const SurplusEffect &b) { return a.gain > b.gain; });
    if (result.surplus.size() > kComparison.surplus_told)
        result.surplus.resize(kComparison.surplus_told);
    return result;
}

} // namespace

Replicates draw_differences(ReplicateRunner &runner, const EffectSettings &effects, const std::vector<double> &gain_dn,
                            std::uint32_t count, std::uint64_t seed,
                            const std::function<void(double fraction)> &progress) {
    const std::vector<bool> all(runner.layout().sequences.size(), true);
    Replicates result{effects, runner.calibrate(effects, all, nullptr), {}};
    result.levels.gain_dn = gain_dn;
    std::vector<std::uint64_t> seeds(2 * std::size_t{count});
    std::iota(seeds.begin(), seeds.end(), seed + 1);
    const std::vector<FoldStatistics> draws = runner.replicates(
        effects, result.levels, seeds, [&](std::size_t i) { progress(double(i) / double(seeds.size())); });
    for (std::size_t i = 0; i < seeds.size(); i += 2)
        result.draws.push_back(minus(draws[i], draws[i + 1]));
    return result;
}

ClosingResult close_gap(ReplicateRunner &runner, FinishedFrames &finished, const std::vector<Candidate> &candidates,
                        const FoldStatistics &difference, const GapModel &null, const ClosingOptions &options,
                        const Progress &progress) {
    return Closing(runner, finished, candidates, difference, null, options, progress).run();
}

} // namespace clsp

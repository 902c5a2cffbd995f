#include "measure/verdict.hpp"
#include "inference/thresholds.hpp"

#include <algorithm>
#include <cmath>

namespace clsp {
namespace {

constexpr double kLeastPValue = 1e-300;

} // namespace

double reported_p_value(double p) {
    return std::max(p, kLeastPValue);
}

bool explained(const Eigen::VectorXd &moved, const Eigen::VectorXd &z) {
    double sum = 0.0, count = 0.0;
    for (Eigen::Index k = 0; k < moved.size(); ++k)
        if (std::abs(moved[k]) > kNaming.own_statistics) {
            sum += z[k] * z[k];
            ++count;
        }
    return count > 0.0 && sum / count < kNaming.explained;
}

double most_moved(const Eigen::VectorXd &moved, const std::vector<bool> &statistics) {
    double most = 0.0;
    for (Eigen::Index k = 0; k < moved.size(); ++k)
        if (statistics[static_cast<std::size_t>(k)])
            most = std::max(most, std::abs(moved[k]));
    return most > kNaming.own_statistics ? most : 0.0;
}

std::vector<bool> slight_effects(const std::vector<SearchStep> &steps, const std::vector<FittedParameter> &parameters,
                                 const std::vector<Candidate> &candidates) {
    std::vector<bool> result;
    for (const SearchStep &step : steps) {
        const auto candidate =
            std::find_if(candidates.begin(), candidates.end(), [&](const Candidate &c) { return c.id == step.added; });
        bool slight = false;
        for (std::size_t p = 0; candidate != candidates.end() && p < candidate->parameters.size(); ++p)
            for (const FittedParameter &fitted : parameters)
                if (fitted.effect == step.added && fitted.name == candidate->parameters[p].name)
                    slight = slight || candidate->is_slight(p, fitted.value);
        result.push_back(slight);
    }
    if (std::find(result.begin(), result.end(), false) == result.end())
        result.assign(steps.size(), false);
    return result;
}

std::vector<bool> shows_nowhere(const std::vector<SearchStep> &steps, const std::vector<RungResult> &rungs) {
    std::vector<bool> result;
    for (const SearchStep &step : steps)
        result.push_back(std::none_of(rungs.begin(), rungs.end(), [&](const RungResult &rung) {
            return std::count(rung.effects.begin(), rung.effects.end(), step.added) > 0;
        }));
    if (std::find(result.begin(), result.end(), false) == result.end())
        result.assign(steps.size(), false);
    return result;
}

bool is_conditional(const std::string &effect, const std::vector<RungResult> &rungs) {
    return std::any_of(rungs.begin(), rungs.end(), [&](const RungResult &rung) {
        return rung.verdict == Verdict::kUnknown && std::count(rung.effects.begin(), rung.effects.end(), effect) > 0;
    });
}

void name_effects(const std::vector<SearchStep> &steps, const std::vector<bool> &passed_over, DiagnosisResult &result) {
    result.verdict = Verdict::kNamed;
    for (std::size_t i = 0; i < steps.size(); ++i) {
        const SearchStep &step = steps[i];
        if (i < passed_over.size() && passed_over[i])
            continue;
        result.effects.push_back(step.added);
        result.probability = std::min(result.probability, step.ranking.front().probability);
        if (step.ranking.front().probability >= 1.0 - kNaming.least_probability)
            continue;
        for (const RankedEffect &ranked : step.ranking)
            if (ranked.probability >= kNaming.least_probability) {
                result.verdict = Verdict::kAmbiguous;
                result.equivalent.push_back(ranked.effect);
            }
    }
}

} // namespace clsp

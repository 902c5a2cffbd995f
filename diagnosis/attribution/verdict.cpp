#include "attribution/verdict.hpp"

#include <algorithm>
#include <cmath>

namespace clsp {
namespace {

constexpr double kLeastPValue = 1e-300;
// Effects at least that probable are named among the equivalent ones.
constexpr double kLeastProbability = 0.05;
// An effect's own statistics are those that it moves by that many standard deviations.
constexpr double kOwnDeviations = 4.0;
// Beside an unknown cause an effect counts as found if its own statistics are explained: at most that mean square of z.
constexpr double kExplained = 3.0;

} // namespace

double reported_p_value(double p) { return std::max(p, kLeastPValue); }

bool explained(const Eigen::VectorXd &moved, const Eigen::VectorXd &z) {
    double sum = 0.0, count = 0.0;
    for (Eigen::Index k = 0; k < moved.size(); ++k)
        if (std::abs(moved[k]) > kOwnDeviations) {
            sum += z[k] * z[k];
            ++count;
        }
    return count > 0.0 && sum / count < kExplained;
}

void name_effects(const std::vector<SearchStep> &steps, DiagnosisResult &result) {
    result.verdict = Verdict::kNamed;
    for (const SearchStep &step : steps) {
        result.effects.push_back(step.added);
        result.probability = std::min(result.probability, step.ranking.front().probability);
        if (step.ranking.front().probability >= 1.0 - kLeastProbability)
            continue;
        for (const RankedEffect &ranked : step.ranking)
            if (ranked.probability >= kLeastProbability) {
                result.verdict = Verdict::kAmbiguous;
                result.equivalent.push_back(ranked.effect);
            }
    }
}

} // namespace clsp

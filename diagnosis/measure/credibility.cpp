#include "measure/credibility.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace clsp {

AreaMetric area_metric(double real, double mean, double deviation) {
    AreaMetric result;
    result.bias = std::abs(mean - real);
    result.area = result.bias;
    if (deviation > 0.0) {
        const double apart = result.bias / deviation;
        result.area = deviation * std::sqrt(2.0 / M_PI) * std::exp(-0.5 * apart * apart) +
                      result.bias * std::erf(apart / std::sqrt(2.0));
    }
    result.scatter = std::max(0.0, result.area - result.bias);
    return result;
}

std::vector<CredibilityRow> credibility(const DatasheetQuantities &measured) {
    std::vector<CredibilityRow> rows;
    for (const DatasheetQuantity &quantity : measured.quantities) {
        CredibilityRow row{quantity.sequence, quantity.name, quantity.unit, {}};
        bool told = !quantity.versions.empty() && std::isfinite(quantity.versions.front().mean);
        for (std::size_t v = 1; v < quantity.versions.size(); ++v) {
            const QuantityMean &simulated = quantity.versions[v];
            told = told && std::isfinite(simulated.mean);
            row.versions.push_back(area_metric(quantity.versions.front().mean, simulated.mean,
                                               std::isfinite(simulated.deviation) ? simulated.deviation : 0.0));
        }
        if (told && !row.versions.empty())
            rows.push_back(std::move(row));
    }
    return rows;
}

} // namespace clsp

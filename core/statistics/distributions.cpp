#include "statistics/distributions.hpp"

#if defined(__GNUC__)
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wconversion"
#pragma GCC diagnostic ignored "-Wshadow"
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif
#include <unsupported/Eigen/SpecialFunctions>
#if defined(__GNUC__)
#pragma GCC diagnostic pop
#endif

#include <algorithm>
#include <cmath>

namespace clsp {

double student_two_sided(double t, double degrees_of_freedom) {
    const double nu = degrees_of_freedom;
    const double value = Eigen::numext::betainc(0.5 * nu, 0.5, nu / (nu + t * t));
    // The incomplete beta function underflows to NaN for absurd t.
    return std::isfinite(value) ? std::clamp(value, 0.0, 1.0) : 0.0;
}

double student_two_sided_quantile(double probability, double degrees_of_freedom) {
    double low = 0.0, high = 1.0;
    while (student_two_sided(high, degrees_of_freedom) > probability && high < 1e9)
        high *= 2.0;
    for (int i = 0; i < 100; ++i) {
        const double middle = 0.5 * (low + high);
        (student_two_sided(middle, degrees_of_freedom) > probability ? low : high) = middle;
    }
    return high;
}

double without_skewness(double z, double skewness) {
    // z = x + (x^2 - 1) skewness / 6
    const double part = std::abs(skewness) / 6.0, size = std::abs(z);
    if (!(z * skewness > 0.0) || size <= 1.0 || part < 1e-6)
        return z;
    return std::copysign((std::sqrt(1.0 + 4.0 * part * (size + part)) - 1.0) / (2.0 * part), z);
}

double fisher_upper(double x, double numerator_freedom, double denominator_freedom) {
    if (!(x > 0.0))
        return 1.0;
    const double value = Eigen::numext::betainc(0.5 * denominator_freedom, 0.5 * numerator_freedom,
                                                denominator_freedom / (denominator_freedom + numerator_freedom * x));
    return std::isfinite(value) ? std::clamp(value, 0.0, 1.0) : 0.0;
}

double gamma_upper(double x, double mean, double variance) {
    if (!(x > 0.0))
        return 1.0;
    const double shape = mean * mean / variance;
    const double value = Eigen::numext::igammac(shape, x * shape / mean);
    return std::isfinite(value) ? std::clamp(value, 0.0, 1.0) : 0.0;
}

} // namespace clsp

#include "capture/exposure_series.hpp"

#include "statistics/distributions.hpp"

#include <Eigen/Dense>

#include <algorithm>
#include <cmath>
#include <set>

namespace clsp {
namespace {

// A line over the time, and a smooth curve that responses follow: cubic.
constexpr Eigen::Index kLine = 2, kCurve = 4;
// Two more than a curve has parameters show how the lamp scatters.
constexpr std::size_t kLeastExposures = std::size_t{kCurve} + 2;
constexpr double kNormal95 = 1.959963984540054;
// No lamp is taken to be steadier, relative.
constexpr double kLeastLightError = 1e-3;
// Light is off a line by this factor at most, as far as responses bend; else the lamp was set anew.
constexpr double kMostBent = 1.25;
// Of the converter's range: EMVA 1288 judges linearity below it.
constexpr double kSaturated = 0.95;
// Of the least light, what a shutter that opens longer than it says may give; else the light does not go as the time.
constexpr double kMostOffset = 0.5;

// A polynomial of the exposure time with so many terms, by least squares of relative differences.
struct TimeCurve {
    Eigen::VectorXd coefficients;
    double unit_ms;
    Eigen::VectorXd off; // of each flat: the curve over its light, less 1

    TimeCurve(const CaptureLayout &layout, const std::vector<double> &light, const std::vector<std::size_t> &flats,
              Eigen::Index terms)
        : unit_ms(0.0) {
        for (const std::size_t s : flats)
            unit_ms = std::max(unit_ms, *layout.sequences[s].exposure_ms);
        Eigen::MatrixXd design(flats.size(), terms);
        for (Eigen::Index k = 0; k < design.rows(); ++k) {
            const std::size_t s = flats[static_cast<std::size_t>(k)];
            for (Eigen::Index power = 0; power < terms; ++power)
                design(k, power) = std::pow(*layout.sequences[s].exposure_ms / unit_ms, double(power)) / light[s];
        }
        const Eigen::VectorXd ones = Eigen::VectorXd::Ones(design.rows());
        coefficients = design.colPivHouseholderQr().solve(ones);
        off = design * coefficients - ones;
    }
    double at(double time_ms) const {
        double sum = 0.0;
        for (Eigen::Index power = coefficients.size(); power-- > 0;)
            sum = sum * time_ms / unit_ms + coefficients[power];
        return sum;
    }
};

} // namespace

ExposureSeries exposure_series(const CaptureLayout &layout, const std::vector<double> &light_dn) {
    const double saturated_dn = kSaturated * (layout.maximum_code() - layout.black_level_dn);
    std::vector<std::size_t> flats;
    std::set<double> times_ms, f_numbers;
    for (std::size_t s = 0; s < layout.sequences.size(); ++s) {
        const SequenceLayout &sequence = layout.sequences[s];
        if (sequence.scene != CaptureScene::kFlat || !sequence.exposure_ms || light_dn[s] >= saturated_dn)
            continue;
        if (!(light_dn[s] > 0.0))
            return {};
        flats.push_back(s);
        times_ms.insert(*sequence.exposure_ms);
        f_numbers.insert(sequence.f_number);
    }
    if (times_ms.size() < kLeastExposures || f_numbers.size() > 1)
        return {};
    const TimeCurve line(layout, light_dn, flats, kLine);
    for (const std::size_t s : flats) {
        const double off = light_dn[s] / line.at(*layout.sequences[s].exposure_ms);
        if (!(off < kMostBent && off > 1.0 / kMostBent && std::abs(line.coefficients[0]) <= kMostOffset * light_dn[s]))
            return {};
    }
    const double freedom = double(flats.size()) - double(kCurve);
    const double scatter = std::sqrt(TimeCurve(layout, light_dn, flats, kCurve).off.squaredNorm() / freedom);
    // A scatter of few is uncertain itself: Student's law over the normal one.
    const double doubt = student_two_sided_quantile(0.05, freedom) / kNormal95;
    return {flats, std::hypot(kLeastLightError, doubt * scatter)};
}

void tie_light_to_exposures(const CaptureLayout &layout, std::vector<double> &light) {
    std::vector<std::size_t> flats;
    for (std::size_t s = 0; s < light.size(); ++s)
        if (layout.sequences[s].light_error > 0.0 && light[s] > 0.0)
            flats.push_back(s);
    if (flats.size() < kLeastExposures)
        return;
    const TimeCurve line(layout, light, flats, kLine);
    for (const std::size_t s : flats)
        if (const double tied = line.at(*layout.sequences[s].exposure_ms); tied > 0.0)
            light[s] = tied;
}

} // namespace clsp

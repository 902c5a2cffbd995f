#include "capture/exposure_series.hpp"

#include <Eigen/Dense>

#include <cmath>
#include <set>

namespace clsp {
namespace {

// A line has two parameters; the third exposure time tells whether it is one.
constexpr std::size_t kLeastExposures = 3;
// Light is off a line by this factor at most, as far as responses bend; else the lamp was set anew.
constexpr double kMostBent = 1.25;
// Of the converter's range: EMVA 1288 judges linearity below it.
constexpr double kSaturated = 0.95;
// Of the least light, what a shutter that opens longer than it says may give; else the light does not go as the time.
constexpr double kMostOffset = 0.5;

struct Line {
    double rate, offset;
    double at(double time_ms) const { return offset + rate * time_ms; }
};

// Least squares of relative differences.
Line line_of(const CaptureLayout &layout, const std::vector<double> &light, const std::vector<std::size_t> &flats) {
    Eigen::MatrixXd design(flats.size(), 2);
    for (std::size_t k = 0; k < flats.size(); ++k)
        design.row(static_cast<Eigen::Index>(k)) << *layout.sequences[flats[k]].exposure_ms / light[flats[k]],
            1.0 / light[flats[k]];
    const Eigen::Vector2d solution = design.colPivHouseholderQr().solve(Eigen::VectorXd::Ones(design.rows()));
    return {solution[0], solution[1]};
}

} // namespace

std::vector<std::size_t> exposure_series(const CaptureLayout &layout, const std::vector<double> &light_dn) {
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
    const Line line = line_of(layout, light_dn, flats);
    for (const std::size_t s : flats) {
        const double off = light_dn[s] / line.at(*layout.sequences[s].exposure_ms);
        if (!(off < kMostBent && off > 1.0 / kMostBent && std::abs(line.offset) <= kMostOffset * light_dn[s]))
            return {};
    }
    return flats;
}

void tie_light_to_exposures(const CaptureLayout &layout, std::vector<double> &light) {
    std::vector<std::size_t> flats;
    for (std::size_t s = 0; s < light.size(); ++s)
        if (layout.sequences[s].in_exposure_series && light[s] > 0.0)
            flats.push_back(s);
    if (flats.size() < kLeastExposures)
        return;
    const Line line = line_of(layout, light, flats);
    for (const std::size_t s : flats)
        if (const double tied = line.at(*layout.sequences[s].exposure_ms); tied > 0.0)
            light[s] = tied;
}

} // namespace clsp

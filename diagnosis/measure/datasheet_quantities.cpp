#include "measure/datasheet_quantities.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <utility>

namespace clsp {
namespace {

// Apart from the seeds of replicates, of the pool, and of the evidence.
constexpr std::uint64_t kDatasheetSeed = std::uint64_t{3} << 41;
// Of the full signal: beyond it clipping takes variance away (EMVA 1288).
constexpr double kTransferPart = 0.7;
// Levels that are nearer than that to each other, in parts of the higher one, are one.
constexpr double kOneLevel = 0.02;

// One capture: the quantities of each sequence, and what several tell together.
struct CaptureQuantities {
    std::vector<std::vector<Quantity>> sequences;
    PhotonTransfer transfer;
};

double value_of(const std::vector<Quantity> &quantities, const char *name) {
    const auto found =
        std::find_if(quantities.begin(), quantities.end(), [&](const Quantity &q) { return q.name == name; });
    return found == quantities.end() ? kNotTold : found->value;
}

bool is_even(CaptureScene scene) {
    return scene == CaptureScene::kDark || scene == CaptureScene::kFlat;
}

double unmasked_pixels(const CaptureLayout &layout, std::size_t sequence) {
    const std::vector<std::uint8_t> &mask = layout.sequences[sequence].mask;
    const auto masked = std::count(mask.begin(), mask.end(), std::uint8_t{0});
    return double(layout.pixel_count()) - double(masked);
}

// Photo response nonuniformity (EMVA 1288): what the pattern of a flat has beyond that of the dark, by its signal.
void add_nonuniformity(const CaptureLayout &layout, std::vector<std::vector<Quantity>> &sequences) {
    double dark = kNotTold;
    for (std::size_t s = 0; s < sequences.size(); ++s)
        if (layout.sequences[s].scene == CaptureScene::kDark && std::isnan(dark))
            dark = value_of(sequences[s], "fixed_pattern");
    for (std::size_t s = 0; s < sequences.size(); ++s) {
        if (layout.sequences[s].scene != CaptureScene::kFlat)
            continue;
        const double flat = value_of(sequences[s], "fixed_pattern"), signal = value_of(sequences[s], "mean_signal");
        const double gain_deviation = std::sqrt(std::max(0.0, flat * flat - dark * dark)) / signal;
        sequences[s].push_back(
            {"photo_response_nonuniformity", "%",
             std::isfinite(flat) && std::isfinite(dark) && signal > 0.0 ? 100.0 * gain_deviation : kNotTold});
    }
}

CaptureQuantities measured_capture(const ReplicateRunner &runner,
                                   const std::function<std::vector<std::uint16_t>(std::size_t)> &frames_of) {
    const CaptureLayout &layout = runner.layout();
    const std::size_t count = layout.sequences.size();
    CaptureQuantities result;
    result.sequences.resize(count);
    // The dark ones come first: they tell the black level that the others are measured by.
    std::vector<std::vector<std::uint16_t>> dark(count);
    for (std::size_t s = 0; s < count; ++s)
        if (layout.sequences[s].scene == CaptureScene::kDark)
            dark[s] = frames_of(s);
    const Calibration calibration = runner.calibration_of(dark);
    std::vector<TransferPoint> points;
    for (std::size_t s = 0; s < count; ++s) {
        const std::vector<std::uint16_t> codes = dark[s].empty() ? frames_of(s) : std::move(dark[s]);
        const std::uint32_t frames = layout.sequences[s].frame_count;
        result.sequences[s] = sequence_quantities(layout, s, codes.data(), frames, calibration, 1);
        const double noise = value_of(result.sequences[s], "temporal_noise");
        if (!is_even(layout.sequences[s].scene) || !std::isfinite(noise))
            continue;
        TransferPoint point;
        point.sequence = layout.sequences[s].name;
        point.signal_dn = layout.sequences[s].scene == CaptureScene::kDark
                              ? value_of(result.sequences[s], "dark_offset") - calibration.black_level_dn
                              : value_of(result.sequences[s], "mean_signal");
        point.variance_dn2 = noise * noise;
        point.variance_error_dn2 =
            point.variance_dn2 * std::sqrt(2.0 / (unmasked_pixels(layout, s) * double(frames - 1)));
        points.push_back(point);
    }
    add_nonuniformity(layout, result.sequences);
    const double full = std::ldexp(1.0, int(layout.bits)) - 1.0 - calibration.black_level_dn;
    result.transfer = fit_photon_transfer(std::move(points), full);
    return result;
}

QuantityMean mean_of(const std::vector<double> &values) {
    QuantityMean result;
    double mean = 0.0, square = 0.0;
    for (const double value : values)
        mean += value / double(values.size());
    for (const double value : values)
        square += (value - mean) * (value - mean);
    result.mean = mean; // NaN if one is
    if (values.size() > 1)
        result.deviation = std::sqrt(square / double(values.size() - 1));
    return result;
}

// By version: its captures.
using MeasuredVersions = std::vector<std::vector<CaptureQuantities>>;

std::vector<DatasheetQuantity> of_sequences(const CaptureLayout &layout, const MeasuredVersions &measured) {
    std::vector<DatasheetQuantity> result;
    const auto add = [&](const std::string &sequence, const char *name, const char *unit,
                         const auto &value_of_capture) {
        DatasheetQuantity quantity{sequence, name, unit, {}};
        for (const std::vector<CaptureQuantities> &version : measured) {
            std::vector<double> values;
            for (const CaptureQuantities &capture : version)
                values.push_back(value_of_capture(capture));
            quantity.versions.push_back(mean_of(values));
        }
        result.push_back(std::move(quantity));
    };
    for (std::size_t s = 0; s < layout.sequences.size(); ++s)
        for (std::size_t q = 0; q < measured[0][0].sequences[s].size(); ++q) {
            const Quantity &first = measured[0][0].sequences[s][q];
            add(layout.sequences[s].name, first.name.c_str(), first.unit.c_str(),
                [&](const CaptureQuantities &capture) { return capture.sequences[s][q].value; });
        }
    if (measured[0][0].transfer.points.empty())
        return result;
    const auto fitted = [](double PhotonTransfer::*member) {
        return [member](const CaptureQuantities &capture) {
            return capture.transfer.fitted ? capture.transfer.*member : kNotTold;
        };
    };
    add("", "system_gain", "DN/electron", fitted(&PhotonTransfer::gain_dn_per_electron));
    add("", "transfer_intercept", "DN^2", fitted(&PhotonTransfer::intercept_dn2));
    return result;
}

} // namespace

std::vector<DatasheetQuantity> camera_quantities(const ReplicateRunner &runner, const Capture &real) {
    const CaptureQuantities measured = measured_capture(runner, [&](std::size_t s) { return real.codes[s]; });
    return of_sequences(runner.layout(), {{measured}});
}

PhotonTransfer fit_photon_transfer(std::vector<TransferPoint> points, double full_signal_dn) {
    PhotonTransfer result;
    result.points = std::move(points);
    double w = 0.0, wx = 0.0, wy = 0.0, lowest = 0.0, highest = 0.0;
    bool any = false;
    const auto counts = [&](const TransferPoint &point) {
        return point.signal_dn <= kTransferPart * full_signal_dn && point.variance_error_dn2 > 0.0;
    };
    for (const TransferPoint &point : result.points) {
        if (!counts(point))
            continue;
        const double weight = 1.0 / (point.variance_error_dn2 * point.variance_error_dn2);
        ++result.fitted_points;
        w += weight;
        wx += weight * point.signal_dn;
        wy += weight * point.variance_dn2;
        lowest = any ? std::min(lowest, point.signal_dn) : point.signal_dn;
        highest = any ? std::max(highest, point.signal_dn) : point.signal_dn;
        any = true;
    }
    if (!any || highest - lowest <= kOneLevel * std::max(highest, 1.0))
        return result;
    double wxx = 0.0, wxy = 0.0;
    for (const TransferPoint &point : result.points) {
        if (!counts(point))
            continue;
        const double weight = 1.0 / (point.variance_error_dn2 * point.variance_error_dn2);
        wxx += weight * (point.signal_dn - wx / w) * (point.signal_dn - wx / w);
        wxy += weight * (point.signal_dn - wx / w) * (point.variance_dn2 - wy / w);
    }
    result.fitted = true;
    result.gain_dn_per_electron = wxy / wxx;
    result.gain_error = 1.0 / std::sqrt(wxx);
    result.intercept_dn2 = wy / w - result.gain_dn_per_electron * wx / w;
    result.intercept_error = std::sqrt(1.0 / w + wx / w * wx / w / wxx);
    return result;
}

DatasheetQuantities measure_datasheet(ReplicateRunner &runner, const Capture &real, const FittedModel &baseline,
                                      const FittedModel *final, std::uint64_t seed) {
    const FittedModel *models[] = {nullptr, &baseline, final};
    const std::size_t versions = final ? 3 : 2;
    const auto frames_of = [&](ReplicateRunner &of, std::size_t version, std::size_t capture, std::size_t s) {
        if (version == 0)
            return real.codes[s];
        const Replicates &replicates = models[version]->model.replicates();
        const std::uint64_t draw = seed + kDatasheetSeed + capture;
        return of.frames(replicates.effects, of.drawn_levels(replicates.levels, draw), s, draw,
                         of.layout().sequences[s].frame_count);
    };
    MeasuredVersions measured(versions);
    std::vector<std::pair<std::size_t, std::size_t>> draws;
    for (std::size_t v = 0; v < versions; ++v) {
        measured[v].resize(v == 0 ? 1 : kMeasuredCaptures);
        for (std::size_t k = 0; k < measured[v].size(); ++k)
            draws.emplace_back(v, k);
    }
    runner.side_by_side(draws.size(), [&](ReplicateRunner &own, std::size_t i) {
        const auto [version, capture] = draws[i];
        measured[version][capture] =
            measured_capture(own, [&, v = version, k = capture](std::size_t s) { return frames_of(own, v, k, s); });
    });

    DatasheetQuantities result;
    result.simulated_captures = kMeasuredCaptures;
    result.quantities = of_sequences(runner.layout(), measured);
    for (const std::vector<CaptureQuantities> &version : measured)
        if (!version.front().transfer.points.empty())
            result.transfer.push_back(version.front().transfer);
    return result;
}

} // namespace clsp

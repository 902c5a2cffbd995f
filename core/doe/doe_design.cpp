#include "doe/doe_design.hpp"

#include "doe/doe_device.hpp"
#include "runtime/checks.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <fmt/core.h>

namespace clsp {
namespace {

constexpr double kTurn = 2.0 * M_PI;

double seconds_since(std::chrono::steady_clock::time_point start) {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

// Powers of the orders behind a phase, and what goes elsewhere. The budget is that of the base band |m| < width / 2,
// |n| < height / 2, where the pixel's envelope leaves sinc^2 of each order's power; the rest of it lies beyond.
void measure_design(DoeDevice &device, DoeDesign &design) {
    const DoeDesignParameters &p = design.parameters;
    std::vector<cl_float2> field(device.pixels());
    for (std::size_t i = 0; i < field.size(); ++i) {
        const double phase = double(design.phase[i]);
        field[i] = {{static_cast<cl_float>(std::cos(phase)), static_cast<cl_float>(std::sin(phase))}};
    }
    device.write(device.field(), field);
    CommandChain chain(device.queue(), 0, nullptr);
    device.transform(chain, device.field(), FftDirection::kForward);
    chain.finish(nullptr);
    device.read(device.field(), field);

    std::vector<double> envelope_x(p.width), envelope_y(p.height);
    const auto signed_order = [](std::uint32_t bin, std::uint32_t side) {
        return 2 * bin < side ? static_cast<std::int32_t>(bin)
                              : static_cast<std::int32_t>(bin) - static_cast<std::int32_t>(side);
    };
    for (std::uint32_t x = 0; x < p.width; ++x)
        envelope_x[x] = std::pow(doe_envelope(signed_order(x, p.width), 0, p.width, p.height), 2);
    for (std::uint32_t y = 0; y < p.height; ++y)
        envelope_y[y] = std::pow(doe_envelope(0, signed_order(y, p.height), p.width, p.height), 2);
    std::vector<bool> is_wanted(device.pixels());
    for (const DoeOrder &order : p.orders)
        is_wanted[doe_bin(order, p.width, p.height)] = true;

    DoeDesignReport &report = design.report;
    const double scale = 1.0 / (double(device.pixels()) * double(device.pixels()));
    double total = 0.0, in_band = 0.0;
    design.powers.assign(p.orders.size(), 0.0);
    const auto grid_power = [&](std::size_t bin) {
        return (double(field[bin].s[0]) * double(field[bin].s[0]) + double(field[bin].s[1]) * double(field[bin].s[1])) *
               scale;
    };
    for (std::uint32_t y = 0; y < p.height; ++y)
        for (std::uint32_t x = 0; x < p.width; ++x) {
            const std::size_t bin = std::size_t{y} * p.width + x;
            const double grid = grid_power(bin), power = grid * envelope_x[x] * envelope_y[y];
            total += grid;
            in_band += power;
            if (bin == 0)
                report.zero_order = power;
            else if (!is_wanted[bin] && power > report.largest_ghost) {
                report.largest_ghost = power;
                report.ghost_m = signed_order(x, p.width);
                report.ghost_n = signed_order(y, p.height);
            }
        }
    for (std::size_t k = 0; k < p.orders.size(); ++k) {
        const std::uint32_t bin = doe_bin(p.orders[k], p.width, p.height);
        const double grid = grid_power(bin);
        design.powers[k] = grid * envelope_x[bin % p.width] * envelope_y[bin / p.width];
        report.efficiency += design.powers[k];
        report.grid_efficiency += grid;
    }
    double mean = 0.0, square = 0.0;
    report.weakest = kLargestNumber;
    for (std::size_t k = 0; k < p.orders.size(); ++k) {
        const double ratio = design.powers[k] / p.orders[k].weight;
        mean += ratio / double(p.orders.size());
        report.weakest = std::min(report.weakest, ratio);
        report.strongest = std::max(report.strongest, ratio);
    }
    const double dot = report.efficiency / double(p.orders.size());
    if (mean > 0.0) {
        for (std::size_t k = 0; k < p.orders.size(); ++k)
            square += std::pow(design.powers[k] / (p.orders[k].weight * mean) - 1.0, 2);
        report.uniformity_rms = std::sqrt(square / double(p.orders.size()));
        report.uniformity_peak_to_peak = (report.strongest - report.weakest) / (report.strongest + report.weakest);
        report.weakest /= mean;
        report.strongest /= mean;
        report.zero_order_relative = report.zero_order / dot;
        report.largest_ghost_relative = report.largest_ghost / dot;
    }
    report.other_orders = in_band - report.efficiency - (is_wanted[0] ? 0.0 : report.zero_order);
    report.beyond = total - in_band;
}

void check_phase(const DoeDesignParameters &p, const std::vector<float> &phase) {
    const std::size_t pixels = std::size_t{p.width} * p.height;
    if (phase.size() != pixels)
        throw Error(Status::kInvalidArgument, fmt::format("the phase has {} pixels, but width x height is {} x {}",
                                                          phase.size(), p.width, p.height));
    for (std::size_t i = 0; i < pixels; ++i) {
        const auto value = double(phase[i]);
        const auto name = [&] { return fmt::format("phase[{}][{}] (row, column)", i / p.width, i % p.width); };
        if (!(std::abs(value) <= 1e4))
            throw Error(Status::kInvalidData,
                        fmt::format("{} is {}; phases are radians, within +-10000", name(), value));
        if (p.levels == 0)
            continue;
        const double level = value * p.levels / kTurn;
        if (std::abs(level - std::nearbyint(level)) > 0.01)
            throw Error(
                Status::kInvalidData,
                fmt::format("{} is {}, none of the {} levels (multiples of 2 pi / {}); give the levels that the "
                            "design has, or 0 for a continuous one",
                            name(), value, p.levels, p.levels));
    }
}

} // namespace

std::shared_ptr<const DoeDesign> design_doe(const std::shared_ptr<Context> &context, DoeDesignParameters parameters) {
    const auto start = std::chrono::steady_clock::now();
    auto design = std::make_shared<DoeDesign>();
    design->parameters = checked_doe_parameters(std::move(parameters));
    const DoeDesignParameters &p = design->parameters;
    DoeDevice device(context, p.width, p.height);
    design->history = iterate_doe(device, p);

    std::vector<cl_float2> field(device.pixels());
    device.read(device.field(), field);
    design->phase.resize(field.size());
    if (p.levels == 0) {
        for (std::size_t i = 0; i < field.size(); ++i) {
            const double angle = std::atan2(double(field[i].s[1]), double(field[i].s[0]));
            design->phase[i] = static_cast<float>(angle < 0.0 ? angle + kTurn : angle);
        }
    } else {
        std::vector<std::uint8_t> levels(field.size());
        for (std::size_t i = 0; i < field.size(); ++i) {
            const double turns = std::atan2(double(field[i].s[1]), double(field[i].s[0])) / kTurn;
            const auto level = static_cast<std::int64_t>(std::nearbyint(turns * p.levels));
            levels[i] = static_cast<std::uint8_t>((level + p.levels) % p.levels);
        }
        if (p.search_sweeps > 0) {
            const DoeSearchResult search = search_doe(device, p, levels);
            design->report.search_changes = search.changes;
            design->report.search_sweeps = search.sweeps;
        }
        for (std::size_t i = 0; i < field.size(); ++i)
            design->phase[i] = static_cast<float>(kTurn * levels[i] / p.levels);
    }
    report_progress(p.progress, "measuring the orders", 0.98);
    measure_design(device, *design);
    design->history.push_back({design->report.efficiency, design->report.uniformity_rms});
    design->report.seconds = seconds_since(start);
    design->parameters.progress = nullptr;
    return design;
}

std::shared_ptr<const DoeDesign> evaluate_doe(const std::shared_ptr<Context> &context, DoeDesignParameters parameters,
                                              std::vector<float> phase) {
    const auto start = std::chrono::steady_clock::now();
    auto design = std::make_shared<DoeDesign>();
    design->parameters = checked_doe_parameters(std::move(parameters));
    check_phase(design->parameters, phase);
    design->phase = std::move(phase);
    DoeDevice device(context, design->parameters.width, design->parameters.height);
    measure_design(device, *design);
    design->report.seconds = seconds_since(start);
    design->parameters.progress = nullptr;
    return design;
}

} // namespace clsp

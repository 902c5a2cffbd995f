#include "doe/doe_element.hpp"

#include "runtime/checks.hpp"
#include "runtime/image_view.hpp"
#include "stages/dots.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/core.h>
#include <set>

namespace clsp {
namespace {


void check_design(const DoePatternParameters &p) {
    if (p.width < 1 || p.height < 1 || p.width > kMaxDoeSide || p.height > kMaxDoeSide)
        throw Error(Status::kInvalidArgument,
                    fmt::format("the design is {} x {} pixels (width x height); each side must be 1 to {}", p.width,
                                p.height, kMaxDoeSide));
    check_positive(p.pixel_pitch_m, "pixel_pitch_m");
    check_positive(p.wavelength_m, "wavelength_m");
    if (p.design_levels == 1 || p.design_levels > 65536)
        throw Error(Status::kInvalidArgument,
                    fmt::format("design_levels is {}, it must be 0 (any phase) or 2 to 65536", p.design_levels));
    if (p.evaluation == DoeEvaluation::kOrders && !p.periodic)
        throw Error(Status::kInvalidArgument, "evaluation is ORDERS, but the design does not repeat (periodic is 0), "
                                              "so it has no orders; use APERTURE or AUTO");
    if (p.oversampling < 1 || p.oversampling > 4)
        throw Error(Status::kInvalidArgument, fmt::format("oversampling is {}, it must be 1 to 4", p.oversampling));
    check_not_negative(p.doe_width_m, "doe_width_m");
    check_not_negative(p.doe_height_m, "doe_height_m");
    const double width_m = p.width * p.pixel_pitch_m, height_m = p.height * p.pixel_pitch_m;
    if (p.periodic && ((p.doe_width_m > 0 && p.doe_width_m < width_m * (1 - 1e-9)) ||
                       (p.doe_height_m > 0 && p.doe_height_m < height_m * (1 - 1e-9))))
        throw Error(
            Status::kInvalidArgument,
            fmt::format(
                "the DOE of {:g} x {:g} m is smaller than its own cell, {} x {} pixels of {:g} m; check doe_width_m, "
                "doe_height_m and pixel_pitch_m",
                p.doe_width_m, p.doe_height_m, p.width, p.height, p.pixel_pitch_m));
    if (!p.periodic && ((p.doe_width_m > 0 && std::abs(p.doe_width_m / width_m - 1) > 1e-6) ||
                        (p.doe_height_m > 0 && std::abs(p.doe_height_m / height_m - 1) > 1e-6)))
        throw Error(Status::kInvalidArgument,
                    fmt::format("the design is the whole aperture, {} x {} pixels of {:g} m, but doe_width_m x "
                                "doe_height_m is {:g} x {:g} m; "
                                "they must agree, or be 0",
                                p.width, p.height, p.pixel_pitch_m, p.doe_width_m, p.doe_height_m));
}

void check_defects(const DoePatternParameters &p) {
    const DoeDefects &d = p.defects;
    if (d.levels == 1 || d.levels > 65536)
        throw Error(Status::kInvalidArgument,
                    fmt::format("defects->levels is {}, it must be 0 (no limit) or 2 to 65536", d.levels));
    if (!(d.relative_depth_error >= -1 && d.relative_depth_error <= 1))
        throw Error(Status::kInvalidArgument,
                    fmt::format("defects->relative_depth_error is {}, it must be -1 to 1", d.relative_depth_error));
    if (!(d.rounding_sigma_m >= 0 && d.rounding_sigma_m <= 64 * p.pixel_pitch_m))
        throw Error(Status::kInvalidArgument,
                    fmt::format("defects->rounding_sigma_m is {}, it must be 0 to 64 pixels of {:g} m",
                                d.rounding_sigma_m, p.pixel_pitch_m));
    check_not_negative(d.etch_noise_rms_m, "defects->etch_noise_rms_m");
    if (!(d.refractive_index > 1 && d.refractive_index <= 10))
        throw Error(Status::kInvalidArgument,
                    fmt::format("defects->refractive_index is {}, it must be above 1 (air) and at most 10",
                                d.refractive_index));
    if (!(std::abs(d.dispersion_per_m) <= 1e7))
        throw Error(
            Status::kInvalidArgument,
            fmt::format("defects->dispersion_per_m is {}, it must be -1e7 to 1e7 per metre", d.dispersion_per_m));
    if (d.feature_samples < 1 || d.feature_samples > 16)
        throw Error(Status::kInvalidArgument,
                    fmt::format("defects->feature_samples is {}, it must be 1 to 16", d.feature_samples));
}

std::vector<SpectralLine> laser_lines(const DoePatternParameters &p) {
    if (p.line_count == 0)
        return {{p.wavelength_m, 1.0}};
    if (p.line_count > kMaxDoeLines)
        throw Error(Status::kInvalidArgument,
                    fmt::format("line_count is {}, at most {} lines are taken", p.line_count, kMaxDoeLines));
    if (!p.line_wavelengths_m)
        throw Error(Status::kInvalidArgument,
                    fmt::format("line_wavelengths_m is NULL, but line_count is {}", p.line_count));
    std::vector<SpectralLine> lines;
    double total = 0;
    for (std::uint32_t i = 0; i < p.line_count; ++i) {
        const double wavelength = p.line_wavelengths_m[i], power = p.line_powers ? p.line_powers[i] : 1.0;
        if (!(wavelength >= p.wavelength_m / 2 && wavelength <= p.wavelength_m * 2))
            throw Error(
                Status::kInvalidArgument,
                fmt::format("line_wavelengths_m[{}] is {}; it must be half to twice the design's wavelength {:g} m", i,
                            wavelength, p.wavelength_m));
        check_positive(power, fmt::format("line_powers[{}]", i).c_str());
        lines.push_back({wavelength, power});
        total += power;
    }
    for (SpectralLine &line : lines)
        line.share /= total;
    return lines;
}

// The phase must lie on the levels that the design says it has, up to one offset for all.
void check_levels(const std::vector<float> &phase, std::uint32_t levels, std::uint32_t width) {
    if (levels == 0)
        return;
    const double step = 2 * M_PI / levels;
    for (std::size_t i = 0; i < phase.size(); ++i) {
        const double steps = (double(phase[i]) - phase[0]) / step;
        if (std::abs(steps - std::round(steps)) * step > 2e-3)
            throw Error(Status::kInvalidData,
                        fmt::format("the design says that it has {} levels, but phase[{}][{}] (row, column) is {} rad, "
                                    "not a multiple of "
                                    "2 pi / {} from phase[0][0] = {}; correct design_levels, or set it to 0",
                                    levels, i / width, i % width, phase[i], levels, phase[0]));
    }
}

void take_dots(const DoePatternParameters &p, DoeElement &element) {
    if (p.dot_count == 0)
        return;
    if (p.dot_count > kMaxDots)
        throw Error(Status::kInvalidArgument,
                    fmt::format("dot_count is {}, at most {} dots are taken", p.dot_count, kMaxDots));
    if (p.periodic ? !p.dot_orders || p.dot_directions : !p.dot_directions || p.dot_orders)
        throw Error(Status::kInvalidArgument, p.periodic
                                                  ? "the dots of a design that repeats are given by dot_orders alone"
                                                  : "the dots of a whole aperture are given by dot_directions alone");
    std::set<std::array<double, 2>> seen;
    const char *name = p.periodic ? "dot_orders" : "dot_directions";
    for (std::uint64_t i = 0; i < p.dot_count; ++i) {
        const std::array<double, 2> dot =
            p.periodic ? std::array<double, 2>{double(p.dot_orders[2 * i]), double(p.dot_orders[2 * i + 1])}
                       : std::array<double, 2>{p.dot_directions[2 * i], p.dot_directions[2 * i + 1]};
        if (!seen.insert(dot).second)
            throw Error(Status::kInvalidArgument,
                        fmt::format("{}[{}] = ({:g}, {:g}) is there twice", name, i, dot[0], dot[1]));
        element.dots.push_back(dot);
        element.weights.push_back(
            p.dot_weights ? check_positive(p.dot_weights[i], fmt::format("dot_weights[{}]", i).c_str()) : 1.0);
        for (const SpectralLine &line : element.lines) {
            const auto [u, v] = element.direction(i, line.wavelength_m);
            if (!(u * u + v * v < 1))
                throw Error(Status::kInvalidArgument,
                            fmt::format("{}[{}] = ({:g}, {:g}) has the direction cosines ({:g}, {:g}) at {:g} m: "
                                        "beyond 90 degrees, no light goes "
                                        "there",
                                        name, i, dot[0], dot[1], u, v, line.wavelength_m));
        }
    }
}

} // namespace

double DoeElement::phase_scale(double wavelength_m) const {
    const DoeDefects &d = parameters.defects;
    const double n0 = d.refractive_index, n = n0 + d.dispersion_per_m * (wavelength_m - parameters.wavelength_m);
    return (1 + d.relative_depth_error) * parameters.wavelength_m / wavelength_m * (n - 1) / (n0 - 1);
}

double DoeElement::phase_noise(double wavelength_m) const {
    const DoeDefects &d = parameters.defects;
    const double n = d.refractive_index + d.dispersion_per_m * (wavelength_m - parameters.wavelength_m);
    return 2 * M_PI * (n - 1) * d.etch_noise_rms_m / wavelength_m;
}

std::array<double, 2> DoeElement::direction(std::size_t dot, double wavelength_m) const {
    const DoePatternParameters &p = parameters;
    if (p.periodic)
        return {dots[dot][0] * wavelength_m / (p.width * p.pixel_pitch_m),
                dots[dot][1] * wavelength_m / (p.height * p.pixel_pitch_m)};
    return {dots[dot][0] * wavelength_m / p.wavelength_m, dots[dot][1] * wavelength_m / p.wavelength_m};
}

DoeElement make_doe_element(const DoePatternParameters &p) {
    check_design(p);
    check_pattern_image(p, true);
    check_defects(p);
    DoeElement element;
    element.parameters = p;
    element.orders = p.evaluation == DoeEvaluation::kOrders || (p.evaluation == DoeEvaluation::kAuto && p.periodic);
    element.samples = p.defects.rounding_sigma_m > 0 ? p.defects.feature_samples : 1;
    if (element.sampled_width() > kMaxDoeSide || element.sampled_height() > kMaxDoeSide)
        throw Error(Status::kInvalidArgument, fmt::format("the design of {} x {} pixels at feature_samples {} has {} x "
                                                          "{} samples, at most {} along a side are taken; "
                                                          "lower feature_samples",
                                                          p.width, p.height, element.samples, element.sampled_width(),
                                                          element.sampled_height(), kMaxDoeSide));
    element.lines = laser_lines(p);
    for (const SpectralLine &line : element.lines) {
        element.mean_wavelength_m += line.share * line.wavelength_m;
        if (!(element.phase_scale(line.wavelength_m) >= 0) ||
            p.defects.refractive_index + p.defects.dispersion_per_m * (line.wavelength_m - p.wavelength_m) <= 1)
            throw Error(Status::kInvalidArgument,
                        fmt::format("with dispersion_per_m {} the refractive index at {:g} m is not above 1",
                                    p.defects.dispersion_per_m, line.wavelength_m));
    }
    take_dots(p, element);
    const auto good = [](float value) { return std::isfinite(value) && std::abs(value) <= 1e6f; };
    element.phase = copy_host_image({p.phase, p.width, p.height, p.phase_pitch_bytes, "phase", "phase_pitch_bytes"},
                                    good, "phases must be finite, in radians, and at most 1e6");
    check_levels(element.phase, p.design_levels, p.width);
    // All that a design can reach.
    const double reach = std::min(1.0, element.mean_wavelength_m / (2 * p.pixel_pitch_m));
    if (element.parameters.half_extent_x == 0)
        element.parameters.half_extent_x = reach;
    if (element.parameters.half_extent_y == 0)
        element.parameters.half_extent_y = reach;
    return element;
}

} // namespace clsp

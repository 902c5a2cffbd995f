#include "statistics/geometry.hpp"

#include "runtime/error.hpp"

#include <Eigen/Dense>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace clsp::statistics {

namespace {

FieldCoefficients field_terms(double x, double y) {
    const double squared = x * x + y * y;
    return {1.0, x, y, squared, squared * squared};
}

} // namespace

Geometry::Geometry(const CaptureLayout &layout, std::size_t sequence, std::uint32_t frame_count, bool whole) {
    if (layout.sequences.empty())
        throw Error(Status::kInvalidArgument, "statistics: the capture has no sequences; give at least one.");
    if (sequence >= layout.sequences.size())
        throw Error(Status::kInvalidArgument,
                    fmt::format("statistics: sequence {} was asked for, but the capture has {}; use 0 to {}.", sequence,
                                layout.sequences.size(), layout.sequences.size() - 1));
    const SequenceLayout &own = layout.sequences[sequence];
    if (layout.width < 8 || layout.height < 8)
        throw Error(Status::kInvalidArgument,
                    fmt::format("statistics of sequence '{}': frames are {} x {} pixels; at least 8 x 8 are needed.",
                                own.name, layout.width, layout.height));
    if (layout.bits < 1 || layout.bits > 16)
        throw Error(
            Status::kInvalidArgument,
            fmt::format("statistics of sequence '{}': codes of {} bits; 1 to 16 are possible.", own.name, layout.bits));
    if (frame_count == 0)
        throw Error(Status::kInvalidArgument,
                    fmt::format("statistics of sequence '{}': no frames; give at least one.", own.name));
    scene = own.scene;
    light_error = own.light_error;
    exposures_differ = scene == CaptureScene::kDark && exposure_count(layout, scene) > 1;
    moving = own.moving && is_laser(); // incoherent light and the dark look the same, moving or not
    width = layout.width;
    height = layout.height;
    pixels = width * height;
    frames = frame_count;
    maximum_code = layout.maximum_code();
    const double f_number = own.f_number > 0.0 ? own.f_number : layout.f_number;
    cutoff = layout.wavelength_m * f_number > 0.0 ? layout.pixel_pitch_m / (layout.wavelength_m * f_number) : 0.0;
    principal_point = layout.principal_point_px;
    corner_radius = layout.corner_radius_px();
    set_mask(own.mask);

    for (std::size_t x = 0; x < width; ++x)
        field_x.push_back((double(x) - principal_point[0]) / corner_radius);
    for (std::size_t y = 0; y < height; ++y)
        field_y.push_back((double(y) - principal_point[1]) / corner_radius);
    if (!whole)
        return;
    for (std::size_t y = 0; y < height; ++y)
        for (std::size_t x = 0; x < width; ++x)
            region_used[region_of(x, y)] += is_used(y * width + x);
    sum_field();
    if (scene == CaptureScene::kDots) {
        if (!layout.dots || layout.dots->positions_px.empty() || !(layout.dots->sigma_px > 0.0))
            throw Error(
                Status::kInvalidArgument,
                fmt::format(
                    "statistics of sequence '{}': its scene is dots, but the capture has no dots with a positive "
                    "sigma_px; give camera and dots, or take the sequence out.",
                    own.name));
        dots = make_dot_geometry(*this, *layout.dots);
    }
}

void Geometry::set_mask(const std::vector<std::uint8_t> &mask) {
    if (!mask.empty() && mask.size() != pixels)
        throw Error(Status::kInvalidArgument, fmt::format("statistics: a mask of {} pixels; frames have {} ({} x {}).",
                                                          mask.size(), pixels, width, height));
    row_used.assign(height, double(width));
    column_used.assign(width, double(height));
    used = pixels;
    const std::size_t bins_x = width / kBin, bins_y = height / kBin;
    bin_used.assign(bins_x * bins_y, float(kBin * kBin));
    const bool masked = std::find(mask.begin(), mask.end(), std::uint8_t{0}) != mask.end();
    if (masked) {
        weight.resize(pixels);
        row_used.assign(height, 0.0);
        column_used.assign(width, 0.0);
        bin_used.assign(bin_used.size(), 0.0f);
        used = 0;
        for (std::size_t y = 0; y < height; ++y)
            for (std::size_t x = 0; x < width; ++x) {
                const bool on = mask[y * width + x] != 0;
                weight[y * width + x] = on ? 1.0f : 0.0f;
                used += on;
                row_used[y] += on;
                column_used[x] += on;
                if (x / kBin < bins_x && y / kBin < bins_y)
                    bin_used[(y / kBin) * bins_x + x / kBin] += float(on);
            }
        if (used < 64)
            throw Error(
                Status::kInvalidArgument,
                fmt::format(
                    "statistics: the mask leaves {} pixels of {}; at least 64 are needed. 0 in a mask means ignore.",
                    used, pixels));
        for (int dy = 0; dy <= kMaximumLag; ++dy)
            for (int dx = -kMaximumLag; dx <= kMaximumLag; ++dx)
                pairs_.push_back(lag_sum(weight.data(), weight.data(), width, height, {dx, dy}));
    }
}

void Geometry::sum_field() {
    for (std::size_t y = 0; y < height; ++y) {
        std::array<std::array<double, kFieldTerms>, kFieldTerms> row{};
        for (std::size_t x = 0; x < width; ++x) {
            if (!is_used(y * width + x))
                continue;
            const FieldCoefficients value = field_terms(field_x[x], field_y[y]);
            for (std::size_t i = 0; i < kFieldTerms; ++i)
                for (std::size_t j = 0; j <= i; ++j)
                    row[i][j] += value[i] * value[j];
        }
        for (std::size_t i = 0; i < kFieldTerms; ++i)
            for (std::size_t j = 0; j <= i; ++j)
                field_gram[i][j] += row[i][j];
    }
}

double Geometry::pairs(Lag lag) const {
    const int dx = lag.dy < 0 ? -lag.dx : lag.dx, dy = std::abs(lag.dy);
    if (weight.empty())
        return double(std::max<std::ptrdiff_t>(0, std::ptrdiff_t(width) - std::abs(dx))) *
               double(std::max<std::ptrdiff_t>(0, std::ptrdiff_t(height) - dy));
    return pairs_[std::size_t(dy * (2 * kMaximumLag + 1) + dx + kMaximumLag)];
}

FieldCoefficients fit_field(const Geometry &geometry, const std::vector<float> &image, std::size_t terms) {
    FieldCoefficients right{};
    for (std::size_t y = 0; y < geometry.height; ++y) {
        FieldCoefficients row_right{};
        for (std::size_t x = 0; x < geometry.width; ++x) {
            const std::size_t pixel = y * geometry.width + x;
            if (!geometry.is_used(pixel))
                continue;
            const FieldCoefficients value = field_terms(geometry.field_x[x], geometry.field_y[y]);
            for (std::size_t i = 0; i < kFieldTerms; ++i)
                row_right[i] += value[i] * image[pixel];
        }
        for (std::size_t i = 0; i < kFieldTerms; ++i)
            right[i] += row_right[i];
    }
    const int count = int(std::min(terms, kFieldTerms));
    Eigen::MatrixXd part(count, count);
    for (int i = 0; i < count; ++i)
        for (int j = 0; j <= i; ++j)
            part(i, j) = part(j, i) = geometry.field_gram[std::size_t(i)][std::size_t(j)];
    const Eigen::LDLT<Eigen::MatrixXd> factors(part);
    FieldCoefficients field{};
    if (factors.info() != Eigen::Success || factors.rcond() < 1e-12)
        return field;
    const Eigen::VectorXd solution = factors.solve(Eigen::Map<const Eigen::VectorXd>(right.data(), count));
    for (int i = 0; i < count; ++i)
        field[std::size_t(i)] = solution[i];
    return field;
}

std::vector<float> without_field(const Geometry &geometry, const std::vector<float> &image,
                                 const FieldCoefficients &field) {
    std::vector<float> rest(geometry.pixels);
    for (std::size_t y = 0; y < geometry.height; ++y)
        for (std::size_t x = 0; x < geometry.width; ++x) {
            const std::size_t pixel = y * geometry.width + x;
            if (!geometry.is_used(pixel))
                continue;
            const FieldCoefficients value = field_terms(geometry.field_x[x], geometry.field_y[y]);
            double smooth = 0.0;
            for (std::size_t i = 0; i < kFieldTerms; ++i)
                smooth += field[i] * value[i];
            rest[pixel] = float(image[pixel] - smooth);
        }
    return rest;
}

} // namespace clsp::statistics

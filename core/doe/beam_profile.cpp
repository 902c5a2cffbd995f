#include "doe/beam_profile.hpp"

#include "runtime/checks.hpp"
#include "runtime/image_view.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <fmt/core.h>

namespace clsp {
namespace {

// A beam's support is this small a part of the transformed window, so that the far field is finely sampled: a
// Gaussian's sigma by 10 samples.
constexpr int kWindowSide = 2048, kSupportSide = 128;
// A Gaussian ends where its intensity is exp(-32) = 1e-14 of the peak.
constexpr double kGaussianHalfWidths = 8.0;
constexpr int kSubsamples = 4; // along each side: smooth edges of flat beams
// Far fields of beams with edges fall slowly (an Airy pattern's rings hold 1/theta of the light). What lies beyond the
// table is given back to the part that is kept.
constexpr double kSpotTail = 1e-7;
constexpr int kLargestSpotRadius = 256;
constexpr double kTableTotal = 4.29e9;         // below 2^32 by more than what rounding 513^2 entries can add
constexpr double kTwoSigmaShare = 0.954499736; // erf(sqrt(2))

double square(double x) {
    return x * x;
}

} // namespace

BeamProfile::BeamProfile(const BeamParameters &p) : parameters_(p) {
    if (!(p.m_squared >= 1 && p.m_squared <= 100))
        throw Error(Status::kInvalidArgument,
                    fmt::format("beam->m_squared is {}, it must be 1 (diffraction limited) to 100", p.m_squared));
    parameters_.image = nullptr;
    if (p.kind == BeamKind::kGaussian || p.kind == BeamKind::kSkewed) {
        check_positive(p.covariance_xx_m2, "beam->covariance_xx_m2");
        check_positive(p.covariance_yy_m2, "beam->covariance_yy_m2");
        const double determinant = p.covariance_xx_m2 * p.covariance_yy_m2 - square(p.covariance_xy_m2);
        if (!(determinant > 1e-9 * p.covariance_xx_m2 * p.covariance_yy_m2))
            throw Error(Status::kInvalidArgument,
                        fmt::format("the beam's covariance [[{0}, {1}], [{1}, {2}]] m^2 is not positive definite: xy^2 "
                                    "must be below xx yy",
                                    p.covariance_xx_m2, p.covariance_xy_m2, p.covariance_yy_m2));
        inverse_xx_ = p.covariance_yy_m2 / determinant;
        inverse_yy_ = p.covariance_xx_m2 / determinant;
        inverse_xy_ = -p.covariance_xy_m2 / determinant;
        half_x_ = kGaussianHalfWidths * std::sqrt(p.covariance_xx_m2);
        half_y_ = kGaussianHalfWidths * std::sqrt(p.covariance_yy_m2);
        for (const auto &[skew, name] : {std::pair{p.skew_x, "beam->skew_x"}, std::pair{p.skew_y, "beam->skew_y"}})
            if (p.kind == BeamKind::kSkewed && !(skew >= -20 && skew <= 20))
                throw Error(Status::kInvalidArgument, fmt::format("{} is {}, it must be -20 to 20", name, skew));
        return;
    }
    check_positive(p.width_m, "beam->width_m");
    check_positive(p.height_m, "beam->height_m");
    half_x_ = p.width_m / 2;
    half_y_ = p.height_m / 2;
    if (p.kind == BeamKind::kSuperGaussian) {
        if (!(p.order >= 1 && p.order <= 50))
            throw Error(Status::kInvalidArgument, fmt::format("beam->order is {}, it must be 1 to 50", p.order));
        const double reach = std::pow(16.0, 0.5 / p.order); // 2 r^(2 order) = 32
        half_x_ *= reach;
        half_y_ *= reach;
    }
    if (p.kind == BeamKind::kImage) {
        if (p.image_width < 2 || p.image_height < 2 || p.image_width > kMaxImageSide || p.image_height > kMaxImageSide)
            throw Error(Status::kInvalidArgument,
                        fmt::format("the beam's image is {} x {} pixels (width x height); each side must be 2 to {}",
                                    p.image_width, p.image_height, kMaxImageSide));
        const auto good = [](float value) { return value >= 0.0f && std::isfinite(value); };
        image_ = copy_host_image(
            {p.image, p.image_width, p.image_height, p.image_pitch_bytes, "beam->image", "beam->image_pitch_bytes"},
            good, "intensities must be finite and not negative");
        if (std::none_of(image_.begin(), image_.end(), [](float value) { return value > 0; }))
            throw Error(Status::kInvalidData, "beam->image is 0 everywhere; a beam has light somewhere");
    }
}

double BeamProfile::intensity(double x, double y) const {
    const BeamParameters &p = parameters_;
    const double rx = x / half_x_, ry = y / half_y_;
    if (std::abs(rx) > 1 || std::abs(ry) > 1)
        return 0;
    switch (p.kind) {
    case BeamKind::kFlatCircle:
        return square(rx) + square(ry) <= 1 ? 1 : 0;
    case BeamKind::kFlatSquare:
        return 1;
    case BeamKind::kSuperGaussian:
        return std::exp(-2 * std::pow(square(2 * x / p.width_m) + square(2 * y / p.height_m), p.order));
    case BeamKind::kImage: {
        const double tx = std::clamp((rx + 1) / 2 * p.image_width - 0.5, 0.0, p.image_width - 1.0);
        const double ty = std::clamp((ry + 1) / 2 * p.image_height - 0.5, 0.0, p.image_height - 1.0);
        const auto ix = std::min<std::uint32_t>(static_cast<std::uint32_t>(tx), p.image_width - 2);
        const auto iy = std::min<std::uint32_t>(static_cast<std::uint32_t>(ty), p.image_height - 2);
        const double ax = tx - ix, ay = ty - iy;
        const float *row = &image_[std::size_t{iy} * p.image_width + ix];
        return (row[0] * (1 - ax) + row[1] * ax) * (1 - ay) +
               (row[p.image_width] * (1 - ax) + row[p.image_width + 1] * ax) * ay;
    }
    default: {
        const double form = x * x * inverse_xx_ + 2 * x * y * inverse_xy_ + y * y * inverse_yy_;
        double value = std::exp(-form / 2);
        if (p.kind == BeamKind::kSkewed)
            value *= (1 + std::erf(p.skew_x * x / std::sqrt(2 * p.covariance_xx_m2))) *
                     (1 + std::erf(p.skew_y * y / std::sqrt(2 * p.covariance_yy_m2)));
        return value;
    }
    }
}

double BeamProfile::share_outside(double width_m, double height_m) const {
    constexpr int kSide = 512;
    double inside = 0, total = 0;
    for (int j = 0; j < kSide; ++j)
        for (int i = 0; i < kSide; ++i) {
            const double x = ((i + 0.5) / kSide * 2 - 1) * half_x_, y = ((j + 0.5) / kSide * 2 - 1) * half_y_;
            const double value = intensity(x, y);
            total += value;
            if (std::abs(x) <= width_m / 2 && std::abs(y) <= height_m / 2)
                inside += value;
        }
    return 1 - inside / total;
}

std::vector<float> BeamProfile::amplitudes(std::uint32_t side) const {
    std::vector<float> values(std::size_t{side} * side);
    for (std::uint32_t j = 0; j < side; ++j)
        for (std::uint32_t i = 0; i < side; ++i) {
            const double x = (2.0 * i / (side - 1) - 1) * half_x_, y = (2.0 * j / (side - 1) - 1) * half_y_;
            values[std::size_t{j} * side + i] = static_cast<float>(std::sqrt(intensity(x, y)));
        }
    return values;
}

std::vector<double> BeamProfile::content() const {
    const BeamParameters &p = parameters_;
    std::vector<double> values{double(p.kind),
                               p.covariance_xx_m2,
                               p.covariance_xy_m2,
                               p.covariance_yy_m2,
                               p.width_m,
                               p.height_m,
                               p.order,
                               p.skew_x,
                               p.skew_y,
                               p.m_squared,
                               double(p.image_width),
                               double(p.image_height)};
    values.insert(values.end(), image_.begin(), image_.end());
    return values;
}

SpotShape make_spot_shape(const BeamProfile &beam) {
    constexpr int n = kWindowSide, support = kSupportSide, radius = kLargestSpotRadius, width = 2 * radius + 1;
    const double step_x = 2 * beam.half_width_x_m() / support, step_y = 2 * beam.half_width_y_m() / support;
    std::vector<double> amplitude(std::size_t(support) * support);
    double energy = 0;
    for (int j = 0; j < support; ++j)
        for (int i = 0; i < support; ++i) {
            double sum = 0;
            for (int b = 0; b < kSubsamples; ++b)
                for (int a = 0; a < kSubsamples; ++a)
                    sum += std::sqrt(beam.intensity((i + (a + 0.5) / kSubsamples - support / 2.0) * step_x,
                                                    (j + (b + 0.5) / kSubsamples - support / 2.0) * step_y));
            amplitude[std::size_t(j) * support + i] = sum;
            energy += square(sum);
        }
    const double total = energy * double(n) * n; // Parseval: the sum of |FT|^2 over all n^2 directions
    // The transform as two matrix products: of n^2 directions only those around the axis are needed. Row k + radius of
    // the matrix is exp(-2 pi i k x / n).
    std::vector<std::complex<double>> waves(std::size_t(width) * support);
    for (int k = -radius; k <= radius; ++k)
        for (int x = 0; x < support; ++x)
            waves[std::size_t(k + radius) * support + x] = std::polar(1.0, -2 * M_PI * k * x / n);
    std::vector<std::complex<double>> rows(std::size_t(support) * width);
    for (int j = 0; j < support; ++j)
        for (int k = 0; k < width; ++k) {
            std::complex<double> sum = 0;
            for (int x = 0; x < support; ++x)
                sum += amplitude[std::size_t(j) * support + x] * waves[std::size_t(k) * support + x];
            rows[std::size_t(j) * width + k] = sum;
        }
    std::vector<double> power(std::size_t(width) * width);
    for (int ky = 0; ky <= radius; ++ky) { // a real beam's far field is symmetric about the axis
        std::vector<double> re(width, 0.0), im(width, 0.0);
        for (int j = 0; j < support; ++j) {
            const std::complex<double> wave = waves[std::size_t(ky + radius) * support + j];
            const std::complex<double> *row = &rows[std::size_t(j) * width];
            for (int k = 0; k < width; ++k) {
                re[k] += row[k].real() * wave.real() - row[k].imag() * wave.imag();
                im[k] += row[k].real() * wave.imag() + row[k].imag() * wave.real();
            }
        }
        for (int k = 0; k < width; ++k) {
            const double value = (square(re[k]) + square(im[k])) / total;
            power[std::size_t(radius + ky) * width + k] = value;
            power[std::size_t(radius - ky) * width + (width - 1 - k)] = value;
        }
    }
    std::vector<double> along_x(radius + 1, 0.0), along_y(radius + 1, 0.0); // marginals by |k|
    for (int ky = -radius; ky <= radius; ++ky)
        for (int kx = -radius; kx <= radius; ++kx) {
            const double value = power[std::size_t(ky + radius) * width + (kx + radius)];
            along_x[std::abs(kx)] += value;
            along_y[std::abs(ky)] += value;
        }
    // The whole half-width in samples that holds a share, and the exact one: within a sample the power is even.
    const auto reach = [](const std::vector<double> &marginal, double share) {
        double sum = 0;
        for (std::size_t k = 0; k < marginal.size(); ++k) {
            if (sum + marginal[k] >= share) {
                const double part = (share - sum) / marginal[k];
                return std::pair<int, double>(int(k), k == 0 ? part / 2 : double(k) - 0.5 + part);
            }
            sum += marginal[k];
        }
        return std::pair<int, double>(int(marginal.size()) - 1, double(marginal.size()) - 0.5);
    };
    SpotShape shape;
    shape.step_u_per_m = beam.m_squared() / (n * step_x);
    shape.step_v_per_m = beam.m_squared() / (n * step_y);
    shape.half_u_per_m = reach(along_x, kTwoSigmaShare).second * shape.step_u_per_m;
    shape.half_v_per_m = reach(along_y, kTwoSigmaShare).second * shape.step_v_per_m;
    const int rx = reach(along_x, 1 - kSpotTail).first, ry = reach(along_y, 1 - kSpotTail).first;
    shape.nodes_x = std::uint32_t(2 * rx + 2);
    shape.nodes_y = std::uint32_t(2 * ry + 2);
    double kept = 0;
    const auto cell = [&](std::uint32_t i, std::uint32_t j) {
        return power[std::size_t(int(j) - ry + radius) * width + std::size_t(int(i) - rx + radius)];
    };
    for (std::uint32_t j = 0; j + 1 < shape.nodes_y; ++j)
        for (std::uint32_t i = 0; i + 1 < shape.nodes_x; ++i)
            kept += cell(i, j);
    shape.table.assign(std::size_t{shape.nodes_x} * shape.nodes_y, 0);
    for (std::uint32_t j = 1; j < shape.nodes_y; ++j) {
        std::uint32_t row = 0;
        for (std::uint32_t i = 1; i < shape.nodes_x; ++i) {
            row += static_cast<std::uint32_t>(cell(i - 1, j - 1) / kept * kTableTotal + 0.5);
            shape.table[std::size_t{j} * shape.nodes_x + i] = shape.table[std::size_t{j - 1} * shape.nodes_x + i] + row;
        }
    }
    shape.unit = 1.0 / shape.table.back();
    return shape;
}

} // namespace clsp

#include "inference/illumination.hpp"

#include "inference/thresholds.hpp"
#include "statistics/distributions.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

namespace clsp {
namespace {

// Means over blocks of the image; NaN where the mask leaves less than half of one.
using Blocks = Eigen::ArrayXXd; // rows, columns

struct Grid {
    explicit Grid(const CaptureLayout &layout)
        : width(layout.width), height(layout.height),
          block(std::max(kIllumination.least_block_px,
                         std::min((std::max(width, height) + kIllumination.blocks - 1) / kIllumination.blocks,
                                  std::min(width, height) / kIllumination.least_blocks))),
          columns(width / block), rows(height / block), origin(layout.principal_point_px),
          unit(std::max(1.0, layout.farthest_corner_px())) {}
    std::size_t width, height, block, columns, rows;
    std::array<double, 2> origin;
    double unit;

    double x(Eigen::Index column) const { return ((double(column) + 0.5) * double(block) - 0.5 - origin[0]) / unit; }
    double y(Eigen::Index row) const { return ((double(row) + 0.5) * double(block) - 0.5 - origin[1]) / unit; }
};

Blocks block_means(const Grid &grid, const CaptureLayout &layout, std::size_t sequence,
                   const std::vector<std::uint16_t> &codes) {
    const std::vector<std::uint8_t> &mask = layout.sequences[sequence].mask;
    const std::size_t frames = layout.sequences[sequence].frame_count, pixels = layout.pixel_count();
    Blocks sum = Blocks::Zero(Eigen::Index(grid.rows), Eigen::Index(grid.columns)), used = sum;
    for (std::size_t y = 0; y < grid.rows * grid.block; ++y)
        for (std::size_t x = 0; x < grid.columns * grid.block; ++x) {
            const std::size_t pixel = y * grid.width + x;
            if (!mask.empty() && mask[pixel] == 0)
                continue;
            double of_pixel = 0.0;
            for (std::size_t t = 0; t < frames; ++t)
                of_pixel += codes[t * pixels + pixel];
            sum(Eigen::Index(y / grid.block), Eigen::Index(x / grid.block)) += of_pixel / double(frames);
            used(Eigen::Index(y / grid.block), Eigen::Index(x / grid.block)) += 1.0;
        }
    const double half = 0.5 * double(grid.block * grid.block);
    return (used >= half).select(sum / used.max(1.0), std::numeric_limits<double>::quiet_NaN());
}

// 1, then the terms of SmoothLight.
constexpr int kMostTerms = (kIllumination.high_degree + 1) * (kIllumination.high_degree + 2) / 2;
using TermsRow = Eigen::Matrix<double, 1, Eigen::Dynamic, Eigen::RowMajor, 1, kMostTerms>;
TermsRow terms(double x, double y, int degree) {
    TermsRow result((degree + 1) * (degree + 2) / 2);
    Eigen::Index k = 0;
    for (int d = 0; d <= degree; ++d)
        for (int j = 0; j <= d; ++j)
            result[k++] = std::pow(x, d - j) * std::pow(y, j);
    return result;
}

struct Fit {
    Eigen::VectorXd coefficients; // the first: on the axis
    Eigen::MatrixXd inverse;      // of the normal equations' matrix
    double square = 0.0;          // of the residuals
    double freedom = 0.0;
    Blocks residual;
};

Fit fit(const Grid &grid, const Blocks &light, int degree) {
    const Eigen::Index count = (degree + 1) * (degree + 2) / 2;
    Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(count, count);
    Eigen::VectorXd right = Eigen::VectorXd::Zero(count);
    double used = 0.0;
    for (Eigen::Index r = 0; r < light.rows(); ++r)
        for (Eigen::Index c = 0; c < light.cols(); ++c) {
            if (!std::isfinite(light(r, c)))
                continue;
            const TermsRow row = terms(grid.x(c), grid.y(r), degree);
            normal.noalias() += row.transpose() * row;
            right += row.transpose() * light(r, c);
            ++used;
        }
    Fit result;
    result.freedom = used - double(count);
    // TermsRow of a strip differ by orders of magnitude.
    const Eigen::VectorXd scale = normal.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
    const Eigen::MatrixXd scaled = normal.cwiseProduct(scale * scale.transpose());
    const Eigen::LDLT<Eigen::MatrixXd> factors(scaled);
    if (result.freedom < double(count) || factors.info() != Eigen::Success || factors.rcond() < 1e-12) {
        result.freedom = 0.0;
        return result;
    }
    const Eigen::VectorXd scaled_right = right.cwiseProduct(scale), solution = factors.solve(scaled_right);
    const Eigen::MatrixXd scaled_inverse = factors.solve(Eigen::MatrixXd::Identity(count, count));
    result.coefficients = solution.cwiseProduct(scale);
    result.inverse = scaled_inverse.cwiseProduct(scale * scale.transpose());
    result.residual = Blocks::Zero(light.rows(), light.cols());
    for (Eigen::Index r = 0; r < light.rows(); ++r)
        for (Eigen::Index c = 0; c < light.cols(); ++c)
            if (std::isfinite(light(r, c))) {
                result.residual(r, c) = light(r, c) - terms(grid.x(c), grid.y(r), degree).dot(result.coefficients);
                result.square += result.residual(r, c) * result.residual(r, c);
            }
    return result;
}

// Variance of a block about the fit. Rows or columns of pixels that differ from their neighbours move whole rows or
// columns of blocks, which the blocks' own scatter does not tell.
double variance_of(const Fit &fit) {
    const Eigen::ArrayXd rows = fit.residual.rowwise().mean(), columns = fit.residual.colwise().mean();
    const double of_rows = rows.square().mean() * double(fit.residual.cols());
    const double of_columns = columns.square().mean() * double(fit.residual.rows());
    return std::max({fit.square / fit.freedom, of_rows, of_columns, 1e-18});
}

// How probable it is that chance makes the terms of `more` that `fewer` has not.
double p_of_terms(const Fit &fewer, const Fit &more) {
    const double terms = double(more.coefficients.size() - fewer.coefficients.size());
    return fisher_upper((fewer.square - more.square) / (terms * variance_of(more)), terms, more.freedom);
}

struct FallOff {
    double loss = 0.0, error = 0.0;
};
// in_window: by the curvature that the window tells best, as a strip hardly tells that across it.
FallOff fall_off(const Fit &quadratic, double variance, bool in_window) {
    // 1, x, y, x^2, x y, y^2
    const double axis = quadratic.coefficients[0];
    Eigen::VectorXd part = Eigen::VectorXd::Zero(quadratic.coefficients.size());
    part[3] = part[5] = 0.5;
    if (in_window) {
        // The mean of least variance.
        const double x = quadratic.inverse(3, 3), y = quadratic.inverse(5, 5), both = quadratic.inverse(3, 5);
        part[3] = (y - both) / (x + y - 2.0 * both);
        part[5] = 1.0 - part[3];
    }
    return {-part.dot(quadratic.coefficients) / axis,
            std::sqrt(variance * part.dot(quadratic.inverse * part)) / std::abs(axis)};
}

// A kind of light: its sequences, and the light of the blocks over its mean.
struct Kind {
    const char *name;
    std::vector<std::size_t> sequences, measured_on;
    Blocks light;
    double level_dn = 0.0; // on the axis; the harmonic mean, as what is constant has a part of each one's of its own
};

// 1 + sx x + sy y - loss r^2: what lamp and laser share is the camera's.
struct Shared {
    Eigen::Vector2d slope = Eigen::Vector2d::Zero();
    double loss = 0.0;
};

Blocks without_shared(const Grid &grid, const Blocks &light, const Shared &shared) {
    Blocks result = light;
    for (Eigen::Index r = 0; r < light.rows(); ++r)
        for (Eigen::Index c = 0; c < light.cols(); ++c)
            result(r, c) /= std::max(0.05, 1.0 + shared.slope[0] * grid.x(c) + shared.slope[1] * grid.y(r) -
                                               shared.loss * (std::pow(grid.x(c), 2) + std::pow(grid.y(r), 2)));
    return result;
}

struct Slope {
    Eigen::Vector2d slope;
    Eigen::Matrix2d covariance;
    bool is_certain() const { return p_of(slope, covariance) <= kIllumination.certain; }
    static double p_of(const Eigen::Vector2d &difference, const Eigen::Matrix2d &covariance) {
        return gamma_upper(difference.dot(covariance.inverse() * difference), 2.0, 4.0);
    }
};
Slope slope_of(const Fit &quadratic, double variance) {
    const double axis = quadratic.coefficients[0];
    return {quadratic.coefficients.segment<2>(1) / axis,
            variance / (axis * axis) * quadratic.inverse.block<2, 2>(1, 1)};
}

// Light that rises to one side: two lights of a lab hardly do so alike.
Eigen::Vector2d shared_slope(const std::vector<Slope> &slopes) {
    if (slopes.size() < 2 || !slopes[0].is_certain() || !slopes[1].is_certain() ||
        Slope::p_of(slopes[0].slope - slopes[1].slope, slopes[0].covariance + slopes[1].covariance) <
            kIllumination.alike)
        return Eigen::Vector2d::Zero();
    const Eigen::Matrix2d of_a = slopes[0].covariance.inverse(), of_b = slopes[1].covariance.inverse();
    return (of_a + of_b).inverse() * (of_a * slopes[0].slope + of_b * slopes[1].slope);
}

double shared_loss(const std::vector<FallOff> &losses) {
    if (losses.size() == 1)
        return std::max(0.0, losses[0].loss);
    const FallOff &a = losses[0], &b = losses[1];
    if (std::abs(a.loss - b.loss) <= kIllumination.agree * std::hypot(a.error, b.error)) {
        const double of_a = 1.0 / (a.error * a.error), of_b = 1.0 / (b.error * b.error);
        return std::max(0.0, (of_a * a.loss + of_b * b.loss) / (of_a + of_b));
    }
    return std::max(0.0, std::min(a.loss, b.loss));
}

// What each light has beside what they share.
void describe_lights(const Grid &grid, const CaptureLayout &layout, const std::vector<Kind> &measured,
                     const Shared &shared, LabLights &result) {
    result.lights.clear();
    double least_uneven = std::numeric_limits<double>::infinity();
    for (const Kind &kind : measured) {
        const Blocks light = without_shared(grid, kind.light, shared);
        const Fit even = fit(grid, light, 0), quadratic = fit(grid, light, kIllumination.degree),
                  high = fit(grid, light, kIllumination.high_degree);
        const double variance = variance_of(high);
        LabLight found;
        found.name = kind.name;
        for (const std::size_t s : kind.sequences)
            found.sequences.push_back(layout.sequences[s].name);
        const Slope slope = slope_of(quadratic, variance);
        found.slope = {slope.slope[0], slope.slope[1]};
        found.slope_error = {std::sqrt(slope.covariance(0, 0)), std::sqrt(slope.covariance(1, 1))};
        const FallOff left = fall_off(quadratic, variance, layout.window.has_value());
        found.corner_loss = left.loss;
        found.corner_loss_error = left.error;
        const double p_quadratic = p_of_terms(even, quadratic), p_high = p_of_terms(quadratic, high);
        found.p_value = std::min(1.0, 2.0 * std::min(p_quadratic, p_high)); // of two looks
        if (found.p_value <= kIllumination.certain) {
            const Fit &best = 2.0 * p_high <= kIllumination.certain ? high : quadratic;
            found.light.origin_px = grid.origin;
            found.light.unit_px = grid.unit;
            found.light.level_dn = kind.level_dn;
            for (Eigen::Index k = 1; k < best.coefficients.size(); ++k)
                found.light.coefficients.push_back(best.coefficients[k] / best.coefficients[0]);
        }
        const double uneven = std::max(std::hypot(found.slope[0], found.slope[1]), std::abs(found.corner_loss));
        least_uneven = std::min(least_uneven, uneven);
        result.lights.push_back(std::move(found));
    }
    result.shared_corner_loss_error = least_uneven;
}

// Means of frames that scatter by more than their rows let expect.
std::optional<LampDrift> drift_of(const CaptureLayout &layout, std::size_t sequence,
                                  const std::vector<std::uint16_t> &codes, double black) {
    const SequenceLayout &of = layout.sequences[sequence];
    const std::size_t frames = of.frame_count, rows = layout.height, width = layout.width;
    if (frames < 2)
        return {};
    Eigen::ArrayXXd row_sum = Eigen::ArrayXXd::Zero(Eigen::Index(frames), Eigen::Index(rows));
    Eigen::ArrayXd used = Eigen::ArrayXd::Zero(Eigen::Index(rows));
    for (std::size_t y = 0; y < rows; ++y)
        for (std::size_t x = 0; x < width; ++x) {
            if (!of.mask.empty() && of.mask[y * width + x] == 0)
                continue;
            ++used[Eigen::Index(y)];
            for (std::size_t t = 0; t < frames; ++t)
                row_sum(Eigen::Index(t), Eigen::Index(y)) += codes[(t * rows + y) * width + x];
        }
    const double whole = used.sum();
    const Eigen::ArrayXd frame_mean = row_sum.rowwise().sum() / whole;
    const double mean = frame_mean.mean(), light = mean - black;
    if (!(light > 0.0))
        return {};
    // Rows' deviations from what row and frame have by themselves, as deviations of the frame's mean.
    double rows_square = 0.0, counted = 0.0;
    for (Eigen::Index y = 0; y < row_sum.cols(); ++y) {
        if (used[y] == 0.0)
            continue;
        const Eigen::ArrayXd of_row = row_sum.col(y) / used[y];
        rows_square += ((of_row - of_row.mean()) - (frame_mean - mean)).square().sum() * std::pow(used[y] / whole, 2);
        ++counted;
    }
    const double freedom = double(frames) - 1.0;
    const double expected = rows_square / freedom * counted / std::max(1.0, counted - 1.0);
    const double found = (frame_mean - mean).square().sum() / freedom;
    if (!(expected > 0.0) ||
        fisher_upper(found / expected, freedom, freedom * std::max(1.0, counted - 1.0)) > kIllumination.certain)
        return {};
    LampDrift result{of.name, std::sqrt(std::max(0.0, found - expected)) / light, {}, light};
    for (const double one : frame_mean)
        result.frame_light.push_back(static_cast<float>((one - black) / light));
    return result;
}

} // namespace

LabLights measure_lab_lights(const Capture &capture) {
    const CaptureLayout &layout = capture.layout;
    const Grid grid(layout);
    std::vector<Kind> kinds = {{"lamp", {}, {}, {}}, {"laser", {}, {}, {}}};
    Blocks dark = Blocks::Constant(Eigen::Index(grid.rows), Eigen::Index(grid.columns), layout.black_level_dn);
    Blocks dark_sum = Blocks::Zero(dark.rows(), dark.cols()), dark_count = dark_sum;
    for (std::size_t s = 0; s < layout.sequences.size(); ++s) {
        const CaptureScene scene = layout.sequences[s].scene;
        if (scene == CaptureScene::kDark) {
            const Blocks one = block_means(grid, layout, s, capture.codes[s]);
            dark_sum += one.isFinite().select(one, 0.0);
            dark_count += one.isFinite().cast<double>();
            continue;
        }
        Kind &kind = kinds[is_laser(scene) ? 1 : 0];
        kind.sequences.push_back(s);
        // Dots light the field here and there: a board tells more.
        if (scene != CaptureScene::kDots)
            kind.measured_on.push_back(s);
    }
    if ((dark_count > 0.0).any())
        dark = (dark_count > 0.0).select(dark_sum / dark_count, std::numeric_limits<double>::quiet_NaN());
    LabLights result;
    const double black = dark.isFinite().select(dark, 0.0).sum() / std::max(1.0, double(dark.isFinite().count()));
    for (const std::size_t s : kinds[0].sequences)
        if (std::optional<LampDrift> drift = drift_of(layout, s, capture.codes[s], black))
            result.drifts.push_back(std::move(*drift));
    std::vector<Kind> measured;
    std::vector<FallOff> losses;
    std::vector<Slope> slopes;
    for (Kind &kind : kinds) {
        // Block by block, as masks may differ; over the light on the axis, which they do not change.
        Blocks light = Blocks::Zero(dark.rows(), dark.cols()), weights = light;
        double levels = 0.0, weighed = 0.0;
        for (const std::size_t s : kind.measured_on) {
            Blocks one = block_means(grid, layout, s, capture.codes[s]) - dark;
            const Fit shape = fit(grid, one, kIllumination.degree);
            if (shape.freedom == 0.0 || !(shape.coefficients[0] > 0.0))
                continue;
            one /= shape.coefficients[0];
            const Fit smooth = fit(grid, one, kIllumination.high_degree);
            if (smooth.freedom == 0.0)
                continue;
            const double weight = 1.0 / variance_of(smooth);
            light += one.isFinite().select(weight * one, 0.0);
            weights += one.isFinite().select(Blocks::Constant(one.rows(), one.cols(), weight), 0.0);
            levels += weight / shape.coefficients[0];
            weighed += weight;
        }
        kind.level_dn = levels > 0.0 ? weighed / levels : 0.0;
        kind.light = (weights > 0.0).select(light / weights, std::numeric_limits<double>::quiet_NaN());
        const Fit quadratic = fit(grid, kind.light, kIllumination.degree),
                  high = fit(grid, kind.light, kIllumination.high_degree);
        if (quadratic.freedom == 0.0 || high.freedom == 0.0)
            continue;
        const double variance = variance_of(high);
        losses.push_back(fall_off(quadratic, variance, layout.window.has_value()));
        slopes.push_back(slope_of(quadratic, variance));
        measured.push_back(std::move(kind));
    }
    if (measured.empty())
        return result;
    result.lens_or_light = measured.size() == 1;
    Shared shared{shared_slope(slopes), shared_loss(losses)};
    result.shared_slope = {shared.slope[0], shared.slope[1]};
    describe_lights(grid, layout, measured, shared, result);
    // No more than the lights may share: then it is theirs, as what is left to the lens must be a lens's.
    if (measured.size() > 1 && shared.loss <= result.shared_corner_loss_error) {
        shared.loss = 0.0;
        describe_lights(grid, layout, measured, shared, result);
    }
    result.shared_corner_loss = shared.loss;
    return result;
}

void leave_uncalibrated(LabLights &found) {
    for (LabLight &light : found.lights)
        light.light = {};
    found.drifts.clear();
}

void set_illumination(const LabLights &found, CaptureLayout &layout) {
    for (const LabLight &light : found.lights)
        for (SequenceLayout &sequence : layout.sequences)
            if (std::find(light.sequences.begin(), light.sequences.end(), sequence.name) != light.sequences.end())
                sequence.illumination = light.light;
    for (const LampDrift &drift : found.drifts)
        for (SequenceLayout &sequence : layout.sequences)
            if (sequence.name == drift.sequence) {
                sequence.frame_light = drift.frame_light;
                sequence.frame_light_level_dn = drift.level_dn;
            }
}

} // namespace clsp

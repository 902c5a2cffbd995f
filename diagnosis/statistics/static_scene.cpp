// A scene under laser light in which nothing should move: how a pixel's variance over time goes with its mean, and
// whether the image as a whole moves.
#include "statistics/statistic_groups.hpp"

#include <Eigen/Dense>

#include <array>
#include <cmath>

namespace clsp::statistics {

namespace {

constexpr std::size_t kTerms = 4; // 1, M, M^2, |grad M|^2

// Variance over time on the mean M (over the sequence's), by least squares: shot noise is linear in M, boiling and
// airflow quadratic, vibration goes with the gradient. Dark pixels, whose variance scatters least, weigh most.
std::array<double, kTerms> regress_variance(const StatisticInput &in) {
    const Geometry &geometry = in.geometry;
    const std::size_t width = geometry.width;
    const std::vector<float> &mean = in.frames.mean;
    const double light = in.frames.light;
    Eigen::Matrix4d gram = Eigen::Matrix4d::Zero();
    Eigen::Vector4d right = Eigen::Vector4d::Zero();
    for (std::size_t y = 1; y + 1 < geometry.height; ++y) {
        Eigen::Matrix4d row_gram = Eigen::Matrix4d::Zero();
        Eigen::Vector4d row_right = Eigen::Vector4d::Zero();
        for (std::size_t x = 1; x + 1 < width; ++x) {
            const std::size_t i = y * width + x;
            if (!(geometry.is_used(i) && geometry.is_used(i - 1) && geometry.is_used(i + 1) &&
                  geometry.is_used(i - width) && geometry.is_used(i + width)))
                continue;
            const double level = mean[i] / light;
            const double right_slope = 0.5 * (mean[i + 1] - mean[i - 1]) / light,
                         down_slope = 0.5 * (mean[i + width] - mean[i - width]) / light;
            const double spread = 1.0 + std::max(level, 0.0), weight = 1.0 / (spread * spread * spread * spread);
            const double terms[kTerms] = {1.0, level, level * level,
                                          right_slope * right_slope + down_slope * down_slope};
            for (int a = 0; a < int(kTerms); ++a) {
                row_right[a] += weight * terms[a] * in.frames.variance[i];
                for (int b = 0; b <= a; ++b)
                    row_gram(a, b) += weight * terms[a] * terms[b];
            }
        }
        gram += row_gram;
        right += row_right;
    }
    const Eigen::LDLT<Eigen::MatrixXd> factors(Eigen::MatrixXd(gram.selfadjointView<Eigen::Lower>()));
    std::array<double, kTerms> result{};
    if (factors.info() != Eigen::Success || factors.rcond() < 1e-10)
        return result;
    const Eigen::VectorXd solution = factors.solve(Eigen::VectorXd(right));
    for (std::size_t k = 0; k < kTerms; ++k)
        result[k] = solution[int(k)];
    return result;
}

void put_variance_by_mean(const StatisticInput &in, Sink &sink) {
    constexpr std::array<double, 3> kEdges{0.3, 1.0, 2.5};
    std::array<double, kEdges.size() + 1> variance{}, count{};
    for (std::size_t i = 0; i < in.geometry.pixels; ++i) {
        if (!in.geometry.is_used(i))
            continue;
        const double level = in.frames.mean[i] / in.frames.light;
        std::size_t bin = 0;
        while (bin < kEdges.size() && level >= kEdges[bin])
            ++bin;
        variance[bin] += in.frames.variance[i];
        count[bin] += 1.0;
    }
    const char *names[] = {"below_0.3_mean", "0.3_to_1_mean", "1_to_2.5_mean", "above_2.5_mean"};
    for (std::size_t k = 0; k < variance.size(); ++k)
        sink.put(k == 0 ? "sensor" : "motion", "temporal_variance", names[k], "log",
                 count[k] > 0.0 ? log_ratio(variance[k] / count[k], in.frames.read_variance) : 0.0);
}

} // namespace

void measure_static_scene(const StatisticInput &in, Sink &sink) {
    if (!in.geometry.is_static_laser() || in.geometry.frames < 2)
        return;
    put_variance_by_mean(in, sink);
    const std::array<double, kTerms> terms = regress_variance(in);
    const double read = in.frames.read_variance;
    sink.put("sensor", "temporal_variance_linear", "asinh", std::asinh(terms[1] / read));
    sink.put("motion", "temporal_variance_square", "asinh", std::asinh(terms[2] / read));
    sink.put("motion", "temporal_variance_gradient", "asinh", std::asinh(terms[3] / read));
    const char *names[] = {"image_shift_x", "image_shift_y", "image_turn", "image_breathing"};
    for (std::size_t k = 0; k < 4; ++k) {
        const ResidualSums::Motion &motion = in.residual.motions[k];
        double square = 0.0;
        for (const double amount : motion.amount)
            square += amount * amount / double(in.geometry.frames);
        // Over what independent noise of the pixels would feign.
        const double log = log_ratio(square * motion.information, in.frames.pixel_variance);
        sink.put_square("motion", names[k], in.geometry.frames, std::exp(log), log);
    }
}

} // namespace clsp::statistics

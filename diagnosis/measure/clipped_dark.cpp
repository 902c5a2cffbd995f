#include "measure/clipped_dark.hpp"

#include "statistics/distributions.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <fmt/core.h>
#include <vector>

namespace clsp {
namespace {

constexpr double kLeastAbove = 0.1; // share of codes above 0 from which a Gaussian's place is told by its upper flank
constexpr std::size_t kLeastCodes = 3;
constexpr std::size_t kBlocks = 16; // parts of the image, whose estimates tell the error

double density(double z) {
    return std::exp(-0.5 * z * z) / std::sqrt(2.0 * M_PI);
}
double below(double z) {
    return 0.5 * std::erfc(-z * M_SQRT1_2);
}

struct Gaussian {
    double level = 0.0, deviation = 0.0;
    bool valid = false;
};

// Codes from top on are one class.
Gaussian fit_cut_gaussian(const std::vector<double> &histogram, std::size_t top) {
    double n = 0.0, above = 0.0;
    for (std::size_t c = 0; c < histogram.size(); ++c) {
        n += histogram[c];
        above += c > 0 ? histogram[c] : 0.0;
    }
    Gaussian fit;
    if (n == 0.0 || above < kLeastAbove * n || top < kLeastCodes)
        return fit;
    // Start: the upper flank of a Gaussian about 0.
    fit.deviation = std::max(0.5, 0.6 * double(top));
    fit.level = fit.deviation * (above / n - 0.5) * 2.0;
    const auto step = [&](const Gaussian &at, double &likelihood, double steps[2]) {
        double score[2] = {}, information[3] = {};
        likelihood = 0.0;
        for (std::size_t c = 0; c <= top; ++c) {
            double count = histogram[c];
            if (c == top)
                for (std::size_t k = top + 1; k < histogram.size(); ++k)
                    count += histogram[k];
            const double low = (double(c) - 0.5 - at.level) / at.deviation, high = low + 1.0 / at.deviation;
            const double p = std::max(1e-300, (c == top ? 1.0 : below(high)) - (c == 0 ? 0.0 : below(low)));
            const double low_density = c == 0 ? 0.0 : density(low), high_density = c == top ? 0.0 : density(high);
            const double by_level = (low_density - high_density) / at.deviation;
            const double by_deviation =
                ((c == 0 ? 0.0 : low * low_density) - (c == top ? 0.0 : high * high_density)) / at.deviation;
            likelihood += count * std::log(p);
            score[0] += count * by_level / p;
            score[1] += count * by_deviation / p;
            information[0] += n * by_level * by_level / p;
            information[1] += n * by_level * by_deviation / p;
            information[2] += n * by_deviation * by_deviation / p;
        }
        const double determinant = information[0] * information[2] - information[1] * information[1];
        steps[0] = steps[1] = 0.0;
        if (determinant > 0.0) {
            steps[0] = (information[2] * score[0] - information[1] * score[1]) / determinant;
            steps[1] = (information[0] * score[1] - information[1] * score[0]) / determinant;
        }
    };
    double likelihood = 0.0, steps[2];
    step(fit, likelihood, steps);
    for (int i = 0; i < 100; ++i) {
        Gaussian next = fit;
        double better = 0.0, following[2], part = 1.0;
        for (; part > 1e-6; part *= 0.5) {
            next.level = fit.level + part * steps[0];
            next.deviation = fit.deviation + part * steps[1];
            if (next.deviation < 0.05)
                continue;
            step(next, better, following);
            if (better >= likelihood)
                break;
        }
        if (part <= 1e-6)
            break;
        const double moved = std::abs(next.level - fit.level) + std::abs(next.deviation - fit.deviation);
        fit = next;
        likelihood = better;
        std::copy(following, following + 2, steps);
        if (moved < 1e-9 * fit.deviation)
            break;
    }
    fit.valid = true;
    return fit;
}

// Variance of the cut-off means of pixels whose levels scatter by fixed, with temporal noise about each.
double variance_of_cut_means(double level, double fixed, double temporal) {
    constexpr int kSteps = 100; // over 16 deviations
    double weight = 0.0, sum = 0.0, squares = 0.0;
    for (int i = 0; i <= kSteps; ++i) {
        const double u = 16.0 * double(i) / kSteps - 8.0, a = level + fixed * u, w = density(u);
        const double mean =
            temporal > 0.0 ? a * below(a / temporal) + temporal * density(a / temporal) : std::max(a, 0.0);
        weight += w;
        sum += w * mean;
        squares += w * mean * mean;
    }
    return squares / weight - sum / weight * (sum / weight);
}

// What of the variance is fixed: that whose pixels differ, after the cut, by so much.
double fixed_variance(const Gaussian &fit, double between) {
    if (between < 0.0) // by chance: of little fixed variance, that part of it is seen
        return between / std::pow(below(fit.level / fit.deviation), 2);
    double low = 0.0, high = fit.deviation * fit.deviation;
    for (int i = 0; i < 40; ++i) {
        const double middle = 0.5 * (low + high);
        const double rest = std::max(0.0, fit.deviation * fit.deviation - middle);
        (variance_of_cut_means(fit.level, std::sqrt(middle), std::sqrt(rest)) < between ? low : high) = middle;
    }
    return 0.5 * (low + high);
}

struct Estimate {
    bool valid = false;
    double level = 0.0, variance = 0.0, fixed = 0.0;
};

// Of the chosen pixels from begin to before end.
Estimate estimate(const Capture &capture, const FrameStack &stack, const std::vector<std::uint8_t> &chosen,
                  double upper_share, std::size_t begin, std::size_t end) {
    const std::size_t pixels = stack.shape.size();
    std::vector<double> histogram(2);
    double n = 0.0, sum = 0.0, squares = 0.0, within = 0.0;
    std::vector<double> first(end), second(end);
    for (std::size_t t = 0; t < stack.frames; ++t) {
        const std::uint16_t *codes = capture.codes[stack.sequence].data() + t * pixels;
        for (std::size_t i = begin; i < end; ++i) {
            if (!chosen[i])
                continue;
            if (codes[i] >= histogram.size())
                histogram.resize(std::size_t{codes[i]} + 1);
            histogram[codes[i]] += 1.0;
            first[i] += codes[i];
            second[i] += double(codes[i]) * codes[i];
        }
    }
    const auto frames = double(stack.frames);
    for (std::size_t i = begin; i < end; ++i)
        if (chosen[i]) {
            const double mean = first[i] / frames;
            n += 1.0;
            sum += mean;
            squares += mean * mean;
            within += (second[i] / frames - mean * mean) / (frames - 1.0);
        }
    Estimate result;
    if (n < 2.0 || stack.frames < 2)
        return result;
    double all = 0.0, passed = 0.0;
    for (const double count : histogram)
        all += count;
    std::size_t top = 0;
    while (top + 1 < histogram.size() && passed + histogram[top] <= (1.0 - upper_share) * all)
        passed += histogram[top++];
    const Gaussian fit = fit_cut_gaussian(histogram, top);
    if (!fit.valid)
        return result;
    const double between = (squares - sum * sum / n) / (n - 1.0) - within / n;
    result = {true, fit.level, fit.deviation * fit.deviation, fixed_variance(fit, between)};
    result.variance -= result.fixed;
    return result;
}

} // namespace

ClippedDark estimate_clipped_dark(const Capture &capture, const FrameStack &stack) {
    ClippedDark result;
    if (stack.frames < 2) {
        result.unknown = "a single dark frame does not tell noise from fixed patterns";
        return result;
    }
    // Hot pixels stand out of the mean frame; half of them are behind the cut, the others have no neighbors there.
    std::vector<double> sorted;
    for (std::size_t i = 0; i < stack.mean.size(); ++i)
        if (stack.unmasked[i])
            sorted.push_back(stack.mean[i]);
    if (sorted.empty()) {
        result.unknown = "the mask leaves no pixel";
        return result;
    }
    std::sort(sorted.begin(), sorted.end());
    const double median = sorted[sorted.size() / 2], upper = sorted[std::size_t(0.84 * double(sorted.size() - 1))];
    const double limit = median + 6.0 * std::max(upper - median, 0.1);
    std::vector<std::uint8_t> chosen = stack.unmasked;
    for (std::size_t i = 0; i < chosen.size(); ++i)
        chosen[i] = chosen[i] && stack.mean[i] <= limit;
    const Estimate whole = estimate(capture, stack, chosen, 0.02, 0, chosen.size()),
                   narrow = estimate(capture, stack, chosen, 0.1, 0, chosen.size());
    if (!whole.valid || !narrow.valid) {
        result.unknown = fmt::format("{:.1f} % of the dark codes are 0, so that too few are above it to place a "
                                     "Gaussian; raise the camera's black level",
                                     100.0 * stack.zero_share);
        return result;
    }
    // Blocks of rows; what the upper tenth of the codes says otherwise is the Gaussian's misfit.
    double sums[3] = {}, squares[3] = {}, blocks = 0.0;
    for (std::size_t b = 0; b < kBlocks; ++b) {
        const auto begin_of = [&](std::size_t block) {
            return stack.shape.height * block / kBlocks * stack.shape.width;
        };
        const Estimate one = estimate(capture, stack, chosen, 0.02, begin_of(b), begin_of(b + 1));
        if (!one.valid)
            continue;
        const double values[3] = {one.level, one.variance, one.fixed};
        blocks += 1.0;
        for (int k = 0; k < 3; ++k) {
            sums[k] += values[k];
            squares[k] += values[k] * values[k];
        }
    }
    if (blocks < 3.0) {
        result.unknown = "the dark frames clip at 0, and are too few or too small to tell what lies behind it";
        return result;
    }
    const auto error = [&](int k, double misfit) {
        const double variance = std::max(0.0, squares[k] - sums[k] * sums[k] / blocks) / (blocks - 1.0) / blocks;
        const double quantile = student_two_sided_quantile(0.05, blocks - 1.0) / student_two_sided_quantile(0.05, 1e9);
        return std::sqrt(variance * quantile * quantile + misfit * misfit);
    };
    result.level = whole.level;
    result.level_error = error(0, whole.level - narrow.level);
    result.variance = whole.variance;
    result.variance_error = error(1, whole.variance - narrow.variance);
    result.fixed_variance = whole.fixed;
    result.fixed_variance_error = error(2, whole.fixed - narrow.fixed);
    return result;
}

} // namespace clsp

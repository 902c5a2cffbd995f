// The overall system gain: of flats by photon transfer, or of a laser scene at rest.
#include "measure/emva_measurement.hpp"

#include "statistics/distributions.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <fmt/core.h>
#include <fmt/ranges.h>
#include <utility>
#include <vector>

namespace clsp {
namespace {

constexpr double kGainPart = 0.7;  // the standard's number, section 6.6
constexpr double kMostLost = 0.01; // of a flat's pixels at an end of the scale
constexpr double kGrows = 3.0;     // standard errors by which a gain is above 0
constexpr double kMisfit = 0.01;   // chance of the points' scatter, below which it widens the interval
constexpr double kLeastLag = 0.02; // of the noise
constexpr double kErrorOfMedian = 1.2533141; // over that of the mean: sqrt(pi / 2), of a normal law
constexpr std::size_t kBins = 32;  // of a resting scene's pixels, by their means
constexpr double kMostDrift = 0.3, kMostShared = 0.05; // of its variance

} // namespace

void EmvaMeasurement::measure_gain() {
    std::vector<EmvaSequence *> flats;
    std::string why;
    for (std::vector<EmvaSequence> *group : {&darks_, &flats_})
        for (EmvaSequence &sequence : *group) {
            const bool dark = group == &darks_;
            EmvaPoint point{sequence.layout->name,   sequence.level, sequence.variance,
                            sequence.variance_error, false,          ""};
            const FrameStack &stack = sequence.stack;
            const double lost = 1.0 - stack.counted_pixels / std::max(1.0, stack.unmasked_pixels);
            const EmvaSequence *its_dark = dark ? nullptr : dark_of(sequence);
            if (stack.frames < 2)
                point.unused = "a single frame has no noise over time";
            else if (!dark && sequence.variance == 0.0)
                point.unused = "its codes do not change: no camera records light without noise";
            else if (!sequence.usable)
                point.unused = sequence.clipped && !sequence.clipped->unknown.empty()
                                   ? sequence.clipped->unknown
                                   : "its frames contradict each other";
            else if (!dark && stack.top_share > kEmvaSaturated)
                point.unused = fmt::format("{:.0f} % of its codes are at the top", 100.0 * stack.top_share);
            else if (!dark && lost > kMostLost)
                point.unused = fmt::format("{:.2g} % of its pixels reach an end of the scale", 100.0 * lost);
            else if (its_dark && sequence.level <= its_dark->level)
                point.unused = fmt::format("no brighter than {}", its_dark->layout->name);
            else if (!dark && sequence.level - (its_dark ? its_dark->level : capture_.layout.black_level_dn) >
                                  kGainPart * saturation_limit_)
                point.unused = "above 70 % of saturation";
            point.used = point.unused.empty();
            if (!dark) {
                if (point.used)
                    flats.push_back(&sequence);
                else
                    why += fmt::format("{}{}: {}", why.empty() ? "" : "; ", point.sequence, point.unused);
            }
            result_.points.push_back(std::move(point));
        }
    result_.gain = unknown_emva_value(flats_.empty() ? "the capture has no flat frames" : why);
    if (!flats.empty())
        gain_of_flats(flats);
    if (!result_.gain.known())
        gain_at_rest();
}

// Where a part f of a frame is the frame before's, noise by successive frames is 1 - 3 f + 3 f^2 of what it would be,
// and two frames apart 1 - 2 f + 2 f^2. The factor that makes up for it, and its relative standard error; 1: there is
// none.
std::pair<double, double> EmvaMeasurement::lag_factor(const std::vector<EmvaSequence *> &flats) {
    const EmvaSequence &flat =
        **std::max_element(flats.begin(), flats.end(), [](const EmvaSequence *a, const EmvaSequence *b) {
            return a->stack.frames < b->stack.frames;
        });
    const EmvaSequence *dark = dark_of(flat);
    if (flat.stack.frames < 4 || !dark)
        return {1.0, 0.0};
    const FrameStack::Differences farther = differences(capture_, stack_frames(capture_, flat.stack.sequence), 2);
    const double photons = flat.variance - dark->variance, ratio = (farther.variance - dark->variance) / photons;
    const double error = std::hypot(flat.variance_error, farther.error) / photons;
    if (!(ratio - 1.0 > std::max(kLeastLag, 4.0 * error)))
        return {1.0, 0.0};
    double low = 0.0, high = 0.3;
    for (int i = 0; i < 50; ++i) {
        const double f = 0.5 * (low + high);
        ((1.0 - 2.0 * f + 2.0 * f * f) / (1.0 - 3.0 * f + 3.0 * f * f) < ratio ? low : high) = f;
    }
    note(flat.layout->name, fmt::format("noise two frames apart is {:.3g} times that of successive frames: {:.2g} of a "
                                        "frame remains in the next one "
                                        "(image lag), and the gain is that without it",
                                        ratio, low));
    // Lag that goes on for more frames differs by f^2.
    return {1.0 / (1.0 - 3.0 * low + 3.0 * low * low), std::hypot(3.0 * error, low * low)};
}

void EmvaMeasurement::gain_of_flats(std::vector<EmvaSequence *> &flats) {
    struct Point {
        const EmvaSequence *flat, *dark;
        double x, y, weight; // the gain is the sum of weight y
    };
    std::vector<Point> points;
    double n = 0.0, sum = 0.0, squares = 0.0, most = 0.0, least = std::numeric_limits<double>::max();
    const bool with_dark = dark_of(*flats.front()) != nullptr;
    for (const EmvaSequence *flat : flats) {
        const EmvaSequence *dark = dark_of(*flat);
        points.push_back({flat, dark, flat->level - (dark ? dark->level : 0.0),
                          flat->variance - (dark ? dark->variance : 0.0), 0.0});
        const double x = points.back().x;
        n += 1.0;
        sum += x;
        squares += x * x;
        most = std::max(most, x);
        least = std::min(least, x);
    }
    if (!with_dark && most - least < 0.1 * most) {
        result_.gain = unknown_emva_value(reason_without_dark() + ", and the flats are of one level");
        return;
    }
    // Section 6.6: a line through the origin, points alike. Without dark frames the origin is not known.
    const double center = with_dark ? 0.0 : sum / n, spread = squares - n * center * center;
    double gain = 0.0, offset = 0.0, variance = 0.0, chi = 0.0;
    for (Point &point : points) {
        point.weight = (point.x - center) / spread;
        gain += point.weight * point.y;
        variance += std::pow(point.weight * point.flat->variance_error, 2);
        offset += with_dark ? 0.0 : point.y / n;
    }
    offset -= with_dark ? 0.0 : gain * center;
    for (const EmvaSequence &dark : darks_) {
        double part = 0.0;
        for (const Point &point : points)
            part += point.dark == &dark ? point.weight : 0.0;
        // A shift of the dark level shifts all signals.
        variance += std::pow(part * dark.variance_error, 2) + std::pow(gain * part * dark.level_error, 2);
    }
    const Point *worst = nullptr;
    double farthest = 0.0, error = std::sqrt(variance);
    for (const Point &point : points) {
        const double z = (point.y - offset - gain * point.x) / point.flat->variance_error;
        chi += z * z;
        if (std::abs(z) >= farthest) {
            farthest = std::abs(z);
            worst = &point;
        }
    }
    const double degrees = n - (with_dark ? 1.0 : 2.0);
    if (degrees > 0.0 && gamma_upper(chi, degrees, 2.0 * degrees) < kMisfit) {
        // What each point is off then counts, whatever its noise (sandwich covariance).
        double sandwich = 0.0;
        for (const Point &point : points)
            sandwich += std::pow(point.weight * (point.y - offset - gain * point.x), 2) * n / degrees;
        error = std::max(error, std::sqrt(sandwich) * student_two_sided_quantile(0.05, degrees) / kEmva95);
        note("", fmt::format(
                     "the flats' variances scatter {:.2g} times as widely about one gain as their noise allows, most "
                     "of all {}, whose own gain is {:.4g} DN/e: the camera is not linear, or the flats are of "
                     "several cameras; the gain's interval is that of their scatter",
                     std::sqrt(chi / degrees), worst->flat->layout->name, (worst->y - offset) / worst->x));
    }
    if (!(gain > kGrows * error)) {
        result_.gain = unknown_emva_value(fmt::format(
            "the flats' variance does not grow with their mean beyond chance: {:.2g} +- {:.2g} DN/e", gain, error));
        return;
    }
    if (const auto [factor, doubt] = lag_factor(flats); factor > 1.0) {
        gain *= factor;
        error = std::hypot(factor * error, gain * doubt);
    }
    result_.method = !with_dark ? EmvaGainMethod::kFlatsWithoutDark
                     : n == 1.0 ? EmvaGainMethod::kOneFlat
                                : EmvaGainMethod::kFlats;
    result_.gain = emva_value(gain, error);
}

// Photon noise of a resting laser scene: pixels' variances by successive differences against their means. Speckle that
// drifts adds to it, the more the farther frames are apart. What moves in a few frames alone is in few pairs of them:
// the gain is the median of what the pairs say.
void EmvaMeasurement::gain_at_rest() {
    struct Slope {
        double gain = 0.0, error = 0.0, shared = 0.0, variance = 0.0;
    };
    const EmvaSequence *scene = nullptr;
    bool moving = false;
    for (const EmvaSequence &other : others_) {
        moving = moving || other.layout->moving;
        if (!other.layout->moving && other.stack.frames > 2 && other.stack.counted_pixels >= 100.0 * kBins &&
            (!scene || other.stack.frames > scene->stack.frames))
            scene = &other;
    }
    if (!scene) {
        if (moving && flats_.empty())
            result_.gain.unknown += ", and moving laser scenes cannot tell: their speckle is in every difference";
        return;
    }
    const FrameStack stack = stack_frames(capture_, scene->stack.sequence);
    std::vector<std::size_t> order;
    for (std::size_t i = 0; i < stack.shape.size(); ++i)
        if (stack.counts[i])
            order.push_back(i);
    std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return stack.mean[a] < stack.mean[b]; });
    // What neighbors share there is the read noise's.
    const EmvaSequence *const dark = dark_of(*scene);
    const double in_the_dark = dark ? dark->stack.successive.neighbors : 0.0;
    const auto slope_at = [&](std::size_t lag) {
        std::vector<std::array<double, kBins>> pairs;
        const FrameStack::Differences of =
            differences(capture_, stack, lag, [&](const std::vector<double> &difference) {
                pairs.emplace_back();
                for (std::size_t b = 0; b < kBins; ++b) {
                    const std::size_t from = order.size() * b / kBins, to = order.size() * (b + 1) / kBins;
                    double sum = 0.0;
                    for (std::size_t k = from; k < to; ++k)
                        sum += difference[order[k]] * difference[order[k]];
                    pairs.back()[b] = sum / double(to - from);
                }
            });
        std::array<double, kBins> weights{}, means{};
        double w = 0.0, wx = 0.0, wxx = 0.0;
        for (std::size_t b = 0; b < kBins; ++b) {
            const std::size_t from = order.size() * b / kBins, to = order.size() * (b + 1) / kBins;
            double mean = 0.0, sum = 0.0, squares = 0.0;
            const auto count = double(to - from);
            for (std::size_t k = from; k < to; ++k) {
                mean += stack.mean[order[k]] / count;
                sum += of.pixel[order[k]] / count;
            }
            for (std::size_t k = from; k < to; ++k)
                squares += std::pow(of.pixel[order[k]] - sum, 2);
            const double weight = count * (count - 1.0) / std::max(squares, 1e-300);
            weights[b] = weight;
            means[b] = mean;
            w += weight;
            wx += weight * mean;
            wxx += weight * mean * mean;
        }
        const double spread = wxx - wx * wx / w;
        std::vector<double> slopes;
        for (const std::array<double, kBins> &pair : pairs) {
            double slope = 0.0;
            for (std::size_t b = 0; b < kBins; ++b)
                slope += weights[b] * (means[b] - wx / w) * pair[b] / spread;
            slopes.push_back(slope);
        }
        std::sort(slopes.begin(), slopes.end());
        const double median = 0.5 * (slopes[(slopes.size() - 1) / 2] + slopes[slopes.size() / 2]);
        return Slope{median, kErrorOfMedian / std::sqrt(spread), (of.neighbors - in_the_dark) / of.variance,
                     of.variance};
    };
    const Slope near = slope_at(1), far = slope_at(2);
    const std::string &name = scene->layout->name;
    if (!(near.variance > 0.0 && far.variance > 0.0)) {
        result_.gain.unknown += fmt::format(", and {} has no noise: its frames are equal", name);
        return;
    }
    double gain = near.gain, error = near.error, model = 0.0;
    const double drift = far.gain - near.gain;
    if (drift > 3.0 * std::hypot(near.error, far.error)) {
        gain -= drift;
        model = drift;
        error = std::hypot(2.0 * near.error, far.error);
    }
    const double shared =
        model > 0.0 ? 2.0 * near.shared - far.shared * far.variance / near.variance : near.shared;
    if (!(gain > 0.0) || drift > kMostDrift * near.gain || shared > kMostShared) {
        result_.gain.unknown += fmt::format(
            ", and {} changes too much from frame to frame to show its photon noise: neighboring pixels share "
            "{:.0f} % of the change, and it grows by {:.0f} % from one to two frames' distance",
            name, 100.0 * near.shared, 100.0 * (far.variance / near.variance - 1.0));
        return;
    }
    if (model > 0.0)
        note(name, fmt::format(
                       "its speckle drifts: variance over mean is {:.4g} DN by successive frames, {:.4g} DN two frames "
                       "apart; the gain is that of no distance, and its interval as wide as the correction",
                       near.gain, far.gain));
    result_.method = EmvaGainMethod::kLaserAtRest;
    result_.gain = emva_value(gain, std::hypot(error, model / kEmva95));
}

} // namespace clsp

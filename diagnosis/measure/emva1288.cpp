#include "measure/emva1288.hpp"

#include "measure/clipped_dark.hpp"
#include "measure/frame_stack.hpp"
#include "statistics/distributions.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <fmt/core.h>
#include <fmt/ranges.h>
#include <optional>
#include <utility>

namespace clsp {
namespace {

constexpr double kNormal = 1.959964;         // of 95 %
constexpr double kQuantization = 1.0 / 12.0; // DN^2
// The standard's numbers: sections 6.6 and 6.7.
constexpr double kGainPart = 0.7, kLinearFrom = 0.05, kLinearTo = 0.95, kLeastVariance = 0.24;
constexpr double kMostLost = 0.01;  // of a flat's pixels at an end of the scale
constexpr double kSaturated = 0.5;  // of a flat's pixels at the top
constexpr double kSameExposure = 0.01, kSameLevel = 0.02;          // in parts of the larger
constexpr double kContradiction = 5.0, kLeastContradiction = 0.05; // standard errors, and parts of the variance
constexpr double kGrows = 3.0;                                     // standard errors by which a gain is above 0
constexpr double kMisfit = 0.01;   // chance of the points' scatter, below which it widens the interval
constexpr double kLeastLag = 0.02; // of the noise
constexpr double kSamePeak = 0.01; // of the largest variance
constexpr std::size_t kBins = 32;  // of a resting scene's pixels, by their means
constexpr double kMostDrift = 0.3, kMostShared = 0.05; // of its variance

EmvaValue unknown(std::string reason) {
    EmvaValue value;
    value.unknown = std::move(reason);
    return value;
}

EmvaValue value_of(double value, double error) {
    EmvaValue result;
    result.value = value;
    result.low = value - kNormal * error;
    result.high = value + kNormal * error;
    return result;
}

// Of two estimates that know nothing of each other; both above 0.
EmvaValue quotient(const EmvaValue &over, const EmvaValue &under) {
    if (!over.known())
        return over;
    if (!under.known())
        return under;
    EmvaValue result;
    result.value = over.value / under.value;
    const auto part = [](double a, double b) { return b > 0.0 ? (a - b) / b : 0.0; };
    const double down = std::hypot(part(over.low, over.value), part(under.high, under.value));
    const double up = std::hypot(part(over.high, over.value), part(under.low, under.value));
    result.low = result.value * std::max(0.0, 1.0 - down);
    result.high = over.value > 0.0 ? result.value * (1.0 + up) : over.high / under.value;
    return result;
}

EmvaValue mapped(const EmvaValue &value, double (*law)(double)) {
    EmvaValue result = value;
    result.value = law(value.value);
    result.low = law(value.low);
    result.high = law(value.high);
    return result;
}

// Of chi squared.
double chi_square_quantile(double upper, double degrees) {
    double low = 0.0, high = degrees + 20.0 * std::sqrt(2.0 * degrees) + 20.0;
    for (int i = 0; i < 100; ++i) {
        const double middle = 0.5 * (low + high);
        (gamma_upper(middle, degrees, 2.0 * degrees) > upper ? low : high) = middle;
    }
    return 0.5 * (low + high);
}

struct Sequence {
    const SequenceLayout *layout = nullptr;
    FrameStack stack;
    bool usable = true;
    // Dark: where nothing clips as measured, else what lies behind. Level and variance of single codes, DN.
    double level = 0.0, level_error = 0.0, variance = 0.0, variance_error = 0.0;
    double draw_error = 0.0; // dark: of the camera's level by these pixels
    std::optional<ClippedDark> clipped;
    SmoothTrend trend; // lit: of the mean frame
};

class EmvaMeasurement {
  public:
    explicit EmvaMeasurement(const Capture &capture) : capture_(capture) {}
    Emva1288 run();

  private:
    void read();
    void look_for_contradictions();
    bool halves_agree(Sequence &sequence);
    void measure_dark();
    void measure_gain();
    void gain_of_flats(std::vector<Sequence *> &flats);
    std::pair<double, double> lag_factor(const std::vector<Sequence *> &flats);
    void gain_at_rest();
    void measure_saturation();
    void measure_nonuniformity();
    void measure_linearity();
    void measure_dark_current();
    void measure_illumination();
    void derive();

    const Sequence *dark_of(const Sequence &flat) const;
    double signal(const Sequence &flat) const { return flat.level - dark_of(flat)->level; }
    void note(const std::string &sequence, std::string text) { result_.notes.push_back({sequence, std::move(text)}); }
    std::string reason_without_dark() const;

    const Capture &capture_;
    std::vector<Sequence> darks_, flats_, others_;
    std::string disorder_;          // of exposures; empty: none
    double saturation_limit_ = 0.0; // signal above dark, DN
    Emva1288 result_;
};

void EmvaMeasurement::read() {
    for (std::size_t s = 0; s < capture_.codes.size(); ++s) {
        Sequence sequence;
        sequence.layout = &capture_.layout.sequences[s];
        sequence.stack = stack_frames(capture_, s);
        const FrameStack &stack = sequence.stack;
        sequence.level = stack.level;
        sequence.variance = stack.successive.variance;
        sequence.variance_error = stack.successive.error;
        if (stack.frames > 1 && stack.counted_pixels > 0.0) {
            // Frames flicker together; pixels' noise is left in the mean.
            double squares = 0.0;
            for (const double mean : stack.frame_means)
                squares += (mean - stack.level) * (mean - stack.level);
            const double degrees = double(stack.frames) - 1.0;
            const double t = student_two_sided_quantile(0.05, degrees) / kNormal;
            sequence.level_error = std::sqrt(squares / degrees / double(stack.frames)) * (degrees > 4.0 ? t : 1.0);
            sequence.level_error = std::hypot(
                sequence.level_error, std::sqrt(sequence.variance / double(stack.frames) / stack.counted_pixels));
        }
        const CaptureScene scene = sequence.layout->scene;
        if (scene != CaptureScene::kDark) {
            sequence.trend = fit_trend(stack.shape, stack.mean, stack.counts);
        } else if (stack.zero_share > kMostZeros) {
            sequence.clipped = estimate_clipped_dark(capture_, stack);
        } else {
            const VarianceComponents parts = variance_components(stack.shape, stack.mean, stack.counts);
            sequence.draw_error = std::sqrt(std::max(0.0, parts.pixel) / std::max(1.0, stack.counted_pixels) +
                                            std::max(0.0, parts.row) / (parts.row_degrees + 1.0) +
                                            std::max(0.0, parts.column) / (parts.column_degrees + 1.0));
        }
        // A set may have hundreds of sequences: images of those that are looked at again are made again.
        sequence.stack.release_images();
        (scene == CaptureScene::kDark   ? darks_
         : scene == CaptureScene::kFlat ? flats_
                                        : others_)
            .push_back(std::move(sequence));
    }
}

// Frames of one camera have one noise: its halves agree, and no pair of frames shows another fixed pattern.
bool EmvaMeasurement::halves_agree(Sequence &sequence) {
    const std::vector<double> &pairs = sequence.stack.successive.pairs;
    // Codes that hardly change tell no noise: it depends on where the level lies between two of them.
    if (pairs.size() < 3 || sequence.variance < kLeastVariance)
        return true;
    const std::string &name = sequence.layout->name;
    const auto median_of = [&](std::size_t from, std::size_t to) {
        std::vector<double> sorted(pairs.begin() + std::ptrdiff_t(from), pairs.begin() + std::ptrdiff_t(to));
        std::nth_element(sorted.begin(), sorted.begin() + std::ptrdiff_t(sorted.size() / 2), sorted.end());
        return sorted[sorted.size() / 2];
    };
    // Of one pair: what the error of all is made of, at least; of a median of m pairs about 1.5 / sqrt(m) of it.
    const double one = sequence.variance_error * std::sqrt(double(pairs.size()) / 1.5);
    const std::size_t half = pairs.size() / 2, last = sequence.stack.frames - 1;
    const double first = median_of(0, half), second = median_of(pairs.size() - half, pairs.size());
    const double error = one * 1.5 * std::sqrt(2.0 / double(half));
    if (std::abs(first - second) > std::max(kContradiction * error, kLeastContradiction * std::min(first, second))) {
        note(name,
             fmt::format(
                 "frames 0 to {} have a variance over time of {:.4g} DN^2, frames {} to {} of {:.4g} DN^2, at means "
                 "of {:.5g} and {:.5g} DN: not one camera at one gain, so the sequence is not used; record it "
                 "again",
                 half, first, last - half, last, second, sequence.stack.frame_means.front(),
                 sequence.stack.frame_means.back()));
        return false;
    }
    const double median = median_of(0, pairs.size());
    std::vector<double> apart;
    for (const double pair : pairs)
        apart.push_back(std::abs(pair - median));
    std::nth_element(apart.begin(), apart.begin() + std::ptrdiff_t(half), apart.end());
    // Pairs of noise that is no Gaussian's scatter more than its pixels say.
    const double limit =
        std::max({kContradiction * one, kLeastContradiction * median, 2.0 * kContradiction * apart[half]});
    for (std::size_t t = 0; t < pairs.size(); ++t)
        if (pairs[t] > median + limit) {
            note(name,
                 fmt::format("frames {} and {} differ by {:.4g} DN^2, other neighboring frames by {:.4g}: the camera "
                             "or the scene changed between them, so the sequence is not used; record it again, or "
                             "split it there",
                             t, t + 1, pairs[t], median));
            return false;
        }
    return true;
}

void EmvaMeasurement::look_for_contradictions() {
    for (std::vector<Sequence> *group : {&darks_, &flats_})
        for (Sequence &sequence : *group)
            if (sequence.stack.frames > 1 && sequence.stack.counted_pixels > 0.0)
                sequence.usable = halves_agree(sequence);
    std::vector<const Sequence *> timed;
    for (const Sequence &flat : flats_) {
        if (flat.layout->exposure_ms)
            timed.push_back(&flat);
        for (const Sequence &dark : darks_)
            if (flat.stack.unmasked_level < dark.stack.unmasked_level - std::max(0.5, 4.0 * dark.level_error))
                note(flat.layout->name,
                     fmt::format(
                         "its mean, {:.5g} DN over {} frames, is below that of {}, {:.5g} DN over {} frames: a flat "
                         "cannot be darker than the dark; check which files belong to which scene",
                         flat.stack.unmasked_level, flat.stack.frames, dark.layout->name, dark.stack.unmasked_level,
                         dark.stack.frames));
    }
    std::stable_sort(timed.begin(), timed.end(), [](const Sequence *a, const Sequence *b) {
        return *a->layout->exposure_ms < *b->layout->exposure_ms;
    });
    const auto level = [](const Sequence *of) { return of->stack.unmasked_level; };
    const auto differ = [&](const Sequence *a, const Sequence *b) {
        return std::abs(level(a) - level(b)) > std::max({kSameLevel * std::max(level(a), level(b)), 1.0,
                                                         4.0 * std::hypot(a->level_error, b->level_error)});
    };
    for (std::size_t from = 0, to = 0; from < timed.size(); from = to) {
        const double exposure = *timed[from]->layout->exposure_ms;
        for (to = from + 1; to < timed.size() && *timed[to]->layout->exposure_ms <= (1.0 + kSameExposure) * exposure;)
            ++to;
        const auto [least, most] =
            std::minmax_element(timed.begin() + std::ptrdiff_t(from), timed.begin() + std::ptrdiff_t(to),
                                [&](auto a, auto b) { return level(a) < level(b); });
        if (differ(*least, *most))
            note((*most)->layout->name,
                 fmt::format(
                     "{} flats have {:g} ms, from {:.5g} DN of {} to {:.5g} DN of {}: the light was varied between "
                     "them, so they tell the gain but not the linearity",
                     to - from, exposure, level(*least), (*least)->layout->name, level(*most), (*most)->layout->name));
        if (to < timed.size() && level(timed[to]) < level(timed[to - 1]) && differ(timed[to], timed[to - 1])) {
            disorder_ = fmt::format("levels do not order as exposures do ({}, {})", timed[to - 1]->layout->name,
                                    timed[to]->layout->name);
            note(timed[to]->layout->name,
                 fmt::format(
                     "{:g} ms give {:.5g} DN, less than the {:.5g} DN of {} with {:g} ms: levels do not order as "
                     "exposures do; check exposure_ms and the lamp",
                     *timed[to]->layout->exposure_ms, level(timed[to]), level(timed[to - 1]),
                     timed[to - 1]->layout->name, exposure));
        }
    }
}

std::string EmvaMeasurement::reason_without_dark() const {
    if (darks_.empty())
        return "the capture has no dark frames";
    for (const Sequence &dark : darks_)
        if (dark.clipped && !dark.clipped->unknown.empty())
            return dark.clipped->unknown;
    return fmt::format("no dark sequence of two frames or more that agree (see the notes); {} has {} frame{}",
                       darks_.front().layout->name, darks_.front().stack.frames,
                       darks_.front().stack.frames == 1 ? "" : "s");
}

// The dark frames of the same exposure, or of the nearest one; else those with the most frames.
const Sequence *EmvaMeasurement::dark_of(const Sequence &flat) const {
    const Sequence *best = nullptr;
    const auto apart = [&](const Sequence &dark) {
        return flat.layout->exposure_ms && dark.layout->exposure_ms
                   ? std::abs(*flat.layout->exposure_ms - *dark.layout->exposure_ms)
                   : std::numeric_limits<double>::max();
    };
    for (const Sequence &dark : darks_)
        if (dark.usable && (!best || apart(dark) < apart(*best) ||
                            (apart(dark) == apart(*best) && dark.stack.frames > best->stack.frames)))
            best = &dark;
    return best;
}

void EmvaMeasurement::measure_dark() {
    for (Sequence &dark : darks_) {
        const FrameStack &stack = dark.stack;
        if (dark.clipped) {
            const ClippedDark &behind = *dark.clipped;
            dark.usable = dark.usable && behind.unknown.empty();
            dark.level = behind.level;
            dark.level_error = behind.level_error;
            dark.variance = behind.variance + kQuantization;
            dark.variance_error = behind.variance_error;
            if (behind.unknown.empty())
                note(dark.layout->name,
                     fmt::format("{:.1f} % of its codes are 0: level and noise are those of the Gaussian behind the "
                                 "clipping, {:.2f} and {:.2f} DN; as recorded they are {:.2f} and {:.2f} DN",
                                 100.0 * stack.zero_share, behind.level, std::sqrt(std::max(0.0, dark.variance)),
                                 stack.unmasked_level, std::sqrt(stack.stack_variance)));
            else
                note(dark.layout->name, behind.unknown);
        } else if (stack.frames < 2 || stack.counted_pixels < 2.0) {
            dark.usable = false;
        }
    }
    const Sequence *best = nullptr;
    for (const Sequence &dark : darks_)
        if (dark.usable && (!best || dark.stack.frames > best->stack.frames))
            best = &dark;
    if (!best) {
        const std::string reason = reason_without_dark();
        result_.dark_level = result_.dark_noise = unknown(reason);
        return;
    }
    result_.dark_level = value_of(best->level, std::hypot(best->level_error, best->draw_error));
    result_.dark_noise =
        best->variance > 0.0
            ? mapped(value_of(best->variance, best->variance_error),
                     [](double v) { return std::sqrt(std::max(0.0, v)); })
            : unknown(
                  "the dark codes never change, so that their noise is lost in the converter's rounding (it is below "
                  "0.3 DN or so), or the frames are copies of one; record with more gain");
}

void EmvaMeasurement::measure_saturation() {
    std::vector<const Sequence *> lit;
    for (const Sequence &flat : flats_)
        if (flat.stack.frames > 1 && dark_of(flat))
            lit.push_back(&flat);
    std::stable_sort(lit.begin(), lit.end(), [](const Sequence *a, const Sequence *b) {
        return a->stack.unmasked_level < b->stack.unmasked_level;
    });
    const double dark = lit.empty() ? capture_.layout.black_level_dn : dark_of(*lit.front())->level;
    saturation_limit_ = capture_.layout.maximum_code() - dark;
    if (lit.empty()) {
        result_.saturation = unknown(flats_.empty() ? "the capture has no flat frames" : reason_without_dark());
        return;
    }
    // The variance falls beyond saturation: its peak is the point (section 6.6).
    std::vector<double> variances, levels;
    for (const Sequence *flat : lit) {
        variances.push_back(flat->stack.stack_variance - flat->stack.fluctuation);
        levels.push_back(flat->stack.unmasked_level - dark);
    }
    const std::size_t last = lit.size() - 1;
    const auto peak = std::size_t(std::max_element(variances.begin(), variances.end()) - variances.begin());
    if (variances[last] >= 0.5 * variances[peak]) {
        result_.saturation = unknown(
            fmt::format("not reached: the variance over time does not fall toward the brightest flat, {} at {:.5g} DN",
                        lit[last]->layout->name, lit[last]->stack.unmasked_level));
        return;
    }
    if (peak == 0) {
        result_.saturation = unknown(fmt::format("every flat but {} is beyond it", lit.front()->layout->name));
        return;
    }
    // Known to the levels before and after those that are as noisy.
    std::size_t from = peak, to = peak;
    while (from > 0 && variances[from] >= (1.0 - kSamePeak) * variances[peak])
        --from;
    while (to < last && variances[to] >= (1.0 - kSamePeak) * variances[peak])
        ++to;
    result_.saturation.value = saturation_limit_ = levels[peak];
    result_.saturation.low = levels[from];
    result_.saturation.high = levels[to];
}

void EmvaMeasurement::measure_gain() {
    std::vector<Sequence *> flats;
    std::string why;
    for (std::vector<Sequence> *group : {&darks_, &flats_})
        for (Sequence &sequence : *group) {
            const bool dark = group == &darks_;
            EmvaPoint point{sequence.layout->name,   sequence.level, sequence.variance,
                            sequence.variance_error, false,          ""};
            const FrameStack &stack = sequence.stack;
            const double lost = 1.0 - stack.counted_pixels / std::max(1.0, stack.unmasked_pixels);
            const Sequence *its_dark = dark ? nullptr : dark_of(sequence);
            if (stack.frames < 2)
                point.unused = "a single frame has no noise over time";
            else if (!dark && sequence.variance == 0.0)
                point.unused = "its codes do not change: no camera records light without noise";
            else if (!sequence.usable)
                point.unused = sequence.clipped && !sequence.clipped->unknown.empty()
                                   ? sequence.clipped->unknown
                                   : "its frames contradict each other";
            else if (!dark && stack.top_share > kSaturated)
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
    result_.gain = unknown(flats_.empty() ? "the capture has no flat frames" : why);
    if (!flats.empty())
        gain_of_flats(flats);
    if (!result_.gain.known())
        gain_at_rest();
}

// Where a part f of a frame is the frame before's, noise by successive frames is 1 - 3 f + 3 f^2 of what it would be,
// and two frames apart 1 - 2 f + 2 f^2. The factor that makes up for it, and its relative standard error; 1: there is
// none.
std::pair<double, double> EmvaMeasurement::lag_factor(const std::vector<Sequence *> &flats) {
    const Sequence &flat = **std::max_element(flats.begin(), flats.end(), [](const Sequence *a, const Sequence *b) {
        return a->stack.frames < b->stack.frames;
    });
    const Sequence *dark = dark_of(flat);
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

void EmvaMeasurement::gain_of_flats(std::vector<Sequence *> &flats) {
    struct Point {
        const Sequence *flat, *dark;
        double x, y, weight; // the gain is the sum of weight y
    };
    std::vector<Point> points;
    double n = 0.0, sum = 0.0, squares = 0.0, most = 0.0, least = std::numeric_limits<double>::max();
    const bool with_dark = dark_of(*flats.front()) != nullptr;
    for (const Sequence *flat : flats) {
        const Sequence *dark = dark_of(*flat);
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
        result_.gain = unknown(reason_without_dark() + ", and the flats are of one level");
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
    for (const Sequence &dark : darks_) {
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
        error = std::max(error, std::sqrt(sandwich) * student_two_sided_quantile(0.05, degrees) / kNormal);
        note("", fmt::format(
                     "the flats' variances scatter {:.2g} times as widely about one gain as their noise allows, most "
                     "of all {}, whose own gain is {:.4g} DN/e: the camera is not linear, or the flats are of "
                     "several cameras; the gain's interval is that of their scatter",
                     std::sqrt(chi / degrees), worst->flat->layout->name, (worst->y - offset) / worst->x));
    }
    if (!(gain > kGrows * error)) {
        result_.gain = unknown(fmt::format(
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
    result_.gain = value_of(gain, error);
}

// Photon noise of a resting laser scene: pixels' variances by successive differences against their means. Speckle that
// drifts adds to it, the more the farther frames are apart.
void EmvaMeasurement::gain_at_rest() {
    struct Slope {
        double gain = 0.0, error = 0.0, shared = 0.0;
    };
    const Sequence *scene = nullptr;
    bool moving = false;
    for (const Sequence &other : others_) {
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
    const auto slope_of = [&](const FrameStack::Differences &of) {
        double w = 0.0, wx = 0.0, wy = 0.0, wxx = 0.0, wxy = 0.0;
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
            w += weight;
            wx += weight * mean;
            wy += weight * sum;
            wxx += weight * mean * mean;
            wxy += weight * mean * sum;
        }
        const double spread = wxx - wx * wx / w;
        return Slope{(wxy - wx * wy / w) / spread, 1.0 / std::sqrt(spread), of.neighbors / of.variance};
    };
    const FrameStack::Differences farther = differences(capture_, stack, 2);
    const Slope near = slope_of(stack.successive), far = slope_of(farther);
    const std::string &name = scene->layout->name;
    double gain = near.gain, error = near.error, model = 0.0;
    const double drift = far.gain - near.gain;
    if (drift > 3.0 * std::hypot(near.error, far.error)) {
        gain -= drift;
        model = drift;
        error = std::hypot(2.0 * near.error, far.error);
    }
    const double shared =
        model > 0.0 ? 2.0 * near.shared - far.shared * farther.variance / stack.successive.variance : near.shared;
    if (!(gain > 0.0) || drift > kMostDrift * near.gain || shared > kMostShared) {
        result_.gain.unknown += fmt::format(
            ", and {} changes too much from frame to frame to show its photon noise: neighboring pixels share "
            "{:.0f} % of the change, and it grows by {:.0f} % from one to two frames' distance",
            name, 100.0 * near.shared, 100.0 * (farther.variance / stack.successive.variance - 1.0));
        return;
    }
    if (model > 0.0)
        note(name, fmt::format(
                       "its speckle drifts: variance over mean is {:.4g} DN by successive frames, {:.4g} DN two frames "
                       "apart; the gain is that of no distance, and its interval as wide as the correction",
                       near.gain, far.gain));
    result_.method = EmvaGainMethod::kLaserAtRest;
    result_.gain = value_of(gain, std::hypot(error, model / kNormal));
}

namespace {

struct Spread {
    double variance = 0.0, low = 0.0, high = 0.0; // 95 %
};

// Of a mean square of that many degrees of freedom less what else is in it, whose standard error is known.
Spread spread_of(double variance, double square, double degrees, double other_error) {
    Spread result{variance, variance, variance};
    if (degrees < 1.0)
        return result;
    const double low = square * degrees / chi_square_quantile(0.025, degrees);
    const double high = square * degrees / chi_square_quantile(0.975, degrees);
    result.low -= std::hypot(square - low, kNormal * other_error);
    result.high += std::hypot(high - square, kNormal * other_error);
    return result;
}

EmvaValue deviation_of(const Spread &spread, double scale) {
    if (!(spread.high > 0.0))
        return unknown(spread.high < 0.0 ? "the temporal noise explains more than all of it"
                                         : "no pixel differs from a smooth field: no camera records without noise");
    EmvaValue result;
    result.value = scale * std::sqrt(std::max(0.0, spread.variance));
    result.low = scale * std::sqrt(std::max(0.0, spread.low));
    result.high = scale * std::sqrt(spread.high);
    return result;
}

// The variance of a mean frame less that of the temporal noise that is left in it, each for pixels, rows and columns.
EmvaNonuniformity pattern_of(const VarianceComponents &image, const VarianceComponents &noise, double noise_error,
                             double scale) {
    const Spread pixel{image.pixel - noise.pixel,
                       image.pixel - noise.pixel - kNormal * std::hypot(image.pixel_error, noise_error),
                       image.pixel - noise.pixel + kNormal * std::hypot(image.pixel_error, noise_error)};
    const Spread row = spread_of(image.row - noise.row, image.row_square, image.row_degrees,
                                 image.pixel_error / std::max(1.0, image.per_row));
    const Spread column = spread_of(image.column - noise.column, image.column_square, image.column_degrees,
                                    image.pixel_error / std::max(1.0, image.per_column));
    Spread total{pixel.variance + row.variance + column.variance, 0.0, 0.0};
    const auto reach = [&](auto side) {
        return std::sqrt(std::pow(side(pixel), 2) + std::pow(side(row), 2) + std::pow(side(column), 2));
    };
    total.low = total.variance - reach([](const Spread &s) { return s.variance - s.low; });
    total.high = total.variance + reach([](const Spread &s) { return s.high - s.variance; });
    return {deviation_of(total, scale), deviation_of(pixel, scale), deviation_of(row, scale),
            deviation_of(column, scale)};
}

EmvaNonuniformity unknown_pattern(const std::string &reason) {
    return {unknown(reason), unknown(reason), unknown(reason), unknown(reason)};
}

VarianceComponents part_of(const VarianceComponents &components, double part) {
    VarianceComponents result = components;
    result.pixel *= part;
    result.row *= part;
    result.column *= part;
    return result;
}

EmvaSpatial spatial_of(const std::string &name, const FrameStack &stack, const HighPass &filtered) {
    EmvaSpatial result;
    result.sequence = name;
    result.frames = double(stack.frames);
    const std::size_t width = stack.shape.width, height = stack.shape.height;
    std::vector<double> rows(height), columns(width), row_counts(height), column_counts(width);
    double sum = 0.0, squares = 0.0;
    for (std::size_t i = 0; i < stack.shape.size(); ++i)
        sum += stack.unmasked[i] ? filtered.image[i] : 0.0;
    const double mean = sum / std::max(1.0, stack.unmasked_pixels);
    for (std::size_t i = 0; i < stack.shape.size(); ++i) {
        if (!stack.unmasked[i])
            continue;
        rows[i / width] += filtered.image[i] - mean;
        row_counts[i / width] += 1.0;
        columns[i % width] += filtered.image[i] - mean;
        column_counts[i % width] += 1.0;
        squares += std::pow(filtered.image[i] - mean, 2);
    }
    const auto scatter = [&](const std::vector<double> &sums, const std::vector<double> &counts, double &lines) {
        double total = 0.0;
        for (std::size_t i = 0; i < sums.size(); ++i)
            if (counts[i] > 0.0) {
                total += std::pow(sums[i] / counts[i], 2);
                lines += 1.0;
            }
        return lines > 0.0 ? total / lines : 0.0;
    };
    result.mean = stack.unmasked_level;
    result.stack_variance = stack.stack_variance;
    result.measured_variance = squares / std::max(1.0, stack.unmasked_pixels - 1.0);
    result.row_average_variance = scatter(rows, row_counts, result.rows);
    result.column_average_variance = scatter(columns, column_counts, result.columns);
    const double m = std::max(1.0, result.rows), n = std::max(1.0, result.columns),
                 noise = stack.stack_variance / result.frames;
    result.variance = result.measured_variance - filtered.pixel_gain * noise;
    result.row_average_variance -= filtered.line_gain * noise / n;
    result.column_average_variance -= filtered.line_gain * noise / m;
    // Section 8.2: column + pixel / m, row + pixel / n, and column + row + pixel are these three.
    result.pixel_variance = (result.variance - result.row_average_variance - result.column_average_variance) /
                            std::max(1e-9, 1.0 - 1.0 / m - 1.0 / n);
    result.row_variance = result.row_average_variance - result.pixel_variance / n;
    result.column_variance = result.column_average_variance - result.pixel_variance / m;
    return result;
}

} // namespace

void EmvaMeasurement::measure_nonuniformity() {
    // The dark with the most frames, the flat whose mean frame has the least noise for its signal.
    const Sequence *dark = nullptr, *flat = nullptr;
    for (const Sequence &candidate : darks_)
        if (candidate.usable && (!dark || candidate.stack.frames > dark->stack.frames))
            dark = &candidate;
    const auto noise_of = [&](const Sequence &of) {
        return std::sqrt(of.variance / double(of.stack.frames)) / (dark ? of.level - dark->level : of.level);
    };
    for (std::size_t k = 0; k < flats_.size(); ++k) {
        const EmvaPoint &point = result_.points[darks_.size() + k];
        if (point.used && (!flat || noise_of(flats_[k]) < noise_of(*flat)))
            flat = &flats_[k];
    }
    const std::string without_dark = dark ? "" : reason_without_dark();
    FrameStack dark_stack;
    if (!dark) {
        result_.dsnu = result_.dsnu_e = unknown_pattern(without_dark);
    } else {
        const FrameStack &stack = dark_stack = stack_frames(capture_, dark->stack.sequence);
        result_.spatial_dark = spatial_of(dark->layout->name, stack, {stack.mean, 1.0, 1.0});
        result_.filtered_dark = spatial_of(dark->layout->name, stack, high_pass(stack.shape, stack.mean));
        if (dark->clipped) {
            const std::string reason = "the dark frames clip at 0; the total is that behind the clipping";
            result_.dsnu = unknown_pattern(reason);
            const double variance = dark->clipped->fixed_variance,
                         error = kNormal * dark->clipped->fixed_variance_error;
            result_.dsnu.total = deviation_of({variance, variance - error, variance + error}, 1.0);
        } else {
            std::vector<std::uint8_t> counts = stack.counts;
            result_.defect_share_dark =
                leave_out_defects(stack.shape, without_trend(stack.shape, stack.mean, counts), counts);
            // No lamp is in it: what is smooth is the sensor's.
            result_.dsnu = pattern_of(variance_components(stack.shape, stack.mean, counts),
                                      part_of(stack.successive.components, 1.0 / double(stack.frames)),
                                      stack.successive.error / double(stack.frames), 1.0);
        }
        for (const auto member : {&EmvaNonuniformity::total, &EmvaNonuniformity::pixel, &EmvaNonuniformity::row,
                                  &EmvaNonuniformity::column})
            result_.dsnu_e.*member = quotient(result_.dsnu.*member, result_.gain);
    }
    if (!flat || !dark) {
        std::string why = without_dark;
        if (dark && flats_.empty())
            why = "the capture has no flat frames";
        for (std::size_t k = 0; dark && k < flats_.size(); ++k) {
            const EmvaPoint &point = result_.points[darks_.size() + k];
            why += fmt::format("{}{}: {}", why.empty() ? "" : "; ", point.sequence, point.unused);
        }
        result_.prnu = unknown_pattern(why);
        return;
    }
    const FrameStack stack = stack_frames(capture_, flat->stack.sequence);
    result_.spatial_flat = spatial_of(flat->layout->name, stack, {stack.mean, 1.0, 1.0});
    result_.filtered_flat = spatial_of(flat->layout->name, stack, high_pass(stack.shape, stack.mean));
    std::vector<double> image = stack.mean;
    std::vector<std::uint8_t> counts = stack.counts;
    VarianceComponents noise = part_of(stack.successive.components, 1.0 / double(stack.frames));
    double noise_error = stack.successive.error / double(stack.frames);
    if (dark->clipped) {
        noise.pixel += dark->clipped->fixed_variance;
        noise_error = std::hypot(noise_error, dark->clipped->fixed_variance_error);
    } else {
        const VarianceComponents &own = dark_stack.successive.components;
        const auto frames = double(dark->stack.frames);
        for (std::size_t i = 0; i < image.size(); ++i) {
            image[i] -= dark_stack.mean[i];
            counts[i] = counts[i] && dark_stack.counts[i];
        }
        noise.pixel += own.pixel / frames;
        noise.row += own.row / frames;
        noise.column += own.column / frames;
        noise_error = std::hypot(noise_error, dark->stack.successive.error / frames);
    }
    // A few strong pixels must not bend the trend: it is fitted twice.
    result_.defect_share_flat = leave_out_defects(stack.shape, without_trend(stack.shape, image, counts), counts);
    image = without_trend(stack.shape, std::move(image), counts);
    result_.prnu = pattern_of(variance_components(stack.shape, image, counts, kPatternTrend), noise, noise_error,
                              100.0 / (flat->level - dark->level));
}

// Section 6.7: a line through the signals between 5 and 95 % of saturation that weighs relative deviations alike.
void EmvaMeasurement::measure_linearity() {
    const auto set = [&](const std::string &reason) {
        result_.linearity_min = result_.linearity_max = unknown(reason);
    };
    std::vector<const Sequence *> used;
    for (const Sequence &flat : flats_)
        if (flat.usable && flat.layout->exposure_ms && dark_of(flat) && flat.stack.counted_pixels > 0.0 &&
            flat.stack.top_share <= kSaturated) {
            const double signal = this->signal(flat);
            if (signal >= kLinearFrom * saturation_limit_ && signal <= kLinearTo * saturation_limit_)
                used.push_back(&flat);
        }
    std::stable_sort(used.begin(), used.end(), [](const Sequence *a, const Sequence *b) {
        return *a->layout->exposure_ms < *b->layout->exposure_ms;
    });
    if (flats_.empty())
        return set("the capture has no flat frames");
    if (darks_.empty() || !dark_of(flats_.front()))
        return set(reason_without_dark());
    if (!disorder_.empty())
        return set(disorder_);
    std::size_t exposures = used.empty() ? 0 : 1;
    for (std::size_t k = 1; k < used.size(); ++k) {
        const double shorter = *used[k - 1]->layout->exposure_ms, longer = *used[k]->layout->exposure_ms;
        if (longer - shorter > kSameExposure * longer)
            ++exposures;
        else if (std::abs(signal(*used[k]) - signal(*used[k - 1])) > kSameLevel * signal(*used[k]))
            return set(fmt::format("{} and {} have one exposure and two levels: the light was varied, and is not known",
                                   used[k - 1]->layout->name, used[k]->layout->name));
    }
    if (exposures < 3)
        return set(
            fmt::format("{} exposure time{} of flats between 5 and 95 % of saturation; three are needed, given as "
                        "exposure_ms",
                        exposures, exposures == 1 ? "" : "s"));
    const auto n = static_cast<Eigen::Index>(used.size());
    Eigen::MatrixXd design = Eigen::MatrixXd::Zero(n, 2);
    Eigen::VectorXd y = Eigen::VectorXd::Zero(n), weights = y, errors = y;
    // The light's fluctuation from frame to frame beyond the noise of pixels, rows and columns: of all pairs, as a
    // sequence of two frames hardly tells its own.
    double flicker = 0.0, pairs = 0.0;
    bool one_dark = true;
    const auto noise_of = [](const FrameStack &stack) {
        const VarianceComponents &parts = stack.successive.components;
        return parts.pixel / stack.counted_pixels + std::max(0.0, parts.row) / (parts.row_degrees + 1.0) +
               std::max(0.0, parts.column) / (parts.column_degrees + 1.0);
    };
    for (Eigen::Index k = 0; k < n; ++k) {
        const Sequence &flat = *used[std::size_t(k)];
        y[k] = signal(flat);
        weights[k] = 1.0 / y[k];
        design.row(k) << *flat.layout->exposure_ms, 1.0;
        one_dark = one_dark && dark_of(flat) == dark_of(*used.front());
        const std::vector<double> &means = flat.stack.frame_means;
        for (std::size_t t = 1; t < means.size(); ++t, pairs += 1.0)
            flicker += (0.5 * std::pow(means[t] - means[t - 1], 2) - noise_of(flat.stack)) / (y[k] * y[k]);
    }
    flicker = std::max(0.0, flicker / std::max(1.0, pairs));
    for (Eigen::Index k = 0; k < n; ++k) {
        const Sequence &flat = *used[std::size_t(k)];
        errors[k] = std::sqrt((noise_of(flat.stack) + flicker * y[k] * y[k]) / double(flat.stack.frames));
        if (!one_dark) // else the line's offset takes it
            errors[k] = std::hypot(errors[k], dark_of(flat)->level_error);
    }
    const Eigen::MatrixXd weighted = weights.asDiagonal() * design;
    const Eigen::MatrixXd inverse = (weighted.transpose() * weighted).inverse();
    const Eigen::Vector2d line = inverse * (weighted.transpose() * weights.cwiseProduct(y));
    const Eigen::VectorXd fitted = design * line;
    const Eigen::VectorXd deviation = 100.0 * (y - fitted).cwiseQuotient(fitted);
    const Eigen::MatrixXd rest =
        Eigen::MatrixXd::Identity(n, n) - design * inverse * weighted.transpose() * weights.asDiagonal();
    // The largest of several: each at the chance of one among them.
    const double quantile = student_two_sided_quantile(0.05 / double(n), std::max(1.0, pairs));
    const auto at = [&](Eigen::Index k) {
        const double error = 100.0 * rest.row(k).cwiseProduct(errors.transpose()).norm() / fitted[k];
        EmvaValue value;
        value.value = deviation[k];
        value.low = deviation[k] - quantile * error;
        value.high = deviation[k] + quantile * error;
        return value;
    };
    Eigen::Index lowest = 0, highest = 0;
    deviation.minCoeff(&lowest);
    deviation.maxCoeff(&highest);
    result_.linearity_min = at(lowest);
    result_.linearity_max = at(highest);
}

void EmvaMeasurement::measure_dark_current() {
    double n = 0.0, x = 0.0, y = 0.0, xx = 0.0, xy = 0.0, longest = 0.0, shortest = std::numeric_limits<double>::max();
    for (const Sequence &dark : darks_)
        if (dark.usable && dark.layout->exposure_ms) {
            const double t = *dark.layout->exposure_ms;
            n += 1.0;
            x += t;
            y += dark.level;
            xx += t * t;
            xy += t * dark.level;
            longest = std::max(longest, t);
            shortest = std::min(shortest, t);
        }
    if (n < 2.0 || longest - shortest <= kSameExposure * longest) {
        result_.dark_current = unknown("dark frames of two exposure times are needed, given as exposure_ms");
        return;
    }
    const double spread = xx - x * x / n, slope = (xy - x * y / n) / spread;
    double variance = 0.0, rest = 0.0;
    for (const Sequence &dark : darks_)
        if (dark.usable && dark.layout->exposure_ms) {
            const double t = *dark.layout->exposure_ms - x / n;
            variance += std::pow(t / spread * dark.level_error, 2);
            rest += std::pow(dark.level - y / n - slope * t, 2);
        }
    double error = std::sqrt(variance);
    if (n > 2.0) // levels wander from one sequence to the next, too
        error =
            std::max(error, std::sqrt(rest / (n - 2.0) / spread) * student_two_sided_quantile(0.05, n - 2.0) / kNormal);
    result_.dark_current = value_of(slope, error);
}

void EmvaMeasurement::measure_illumination() {
    for (const std::vector<Sequence> *group : {&flats_, &others_})
        for (const Sequence &lit : *group) {
            const Sequence *dark = dark_of(lit);
            const double offset = dark ? dark->level : capture_.layout.black_level_dn;
            const FrameStack &stack = lit.stack;
            const double light = stack.level - offset;
            if (stack.counted_pixels < 64.0 || !(light > 1.0))
                continue;
            EmvaIllumination one;
            one.sequence = lit.layout->name;
            for (std::size_t k = 0; k < one.percent.size(); ++k) {
                one.percent[k] = 100.0 * lit.trend.terms[k + 1] / light;
                one.error_percent[k] = 100.0 * lit.trend.errors[k + 1] / light;
            }
            result_.illumination.push_back(std::move(one));
        }
}

// Sections 2 and 6.6: what follows from the above.
void EmvaMeasurement::derive() {
    if (result_.dark_noise.known() && result_.gain.known()) {
        const double variance = result_.dark_noise.value * result_.dark_noise.value;
        if (variance < kLeastVariance) {
            result_.dark_noise_e = unknown(fmt::format(
                "a variance of {:.2g} DN^2 is mostly the quantization's; the noise is below {:.3g} e (0.49 DN)",
                variance, std::sqrt(kLeastVariance) / result_.gain.value));
        } else {
            const EmvaValue unquantized =
                mapped(result_.dark_noise, [](double s) { return std::sqrt(std::max(0.0, s * s - kQuantization)); });
            result_.dark_noise_e = quotient(unquantized, result_.gain);
        }
        EmvaValue noise = result_.dark_noise;
        for (double EmvaValue::*end : {&EmvaValue::value, &EmvaValue::low, &EmvaValue::high})
            noise.*end = std::max(noise.*end, std::sqrt(kLeastVariance));
        result_.sensitivity_threshold = mapped(quotient(noise, result_.gain), [](double e) { return e + 0.5; });
    } else {
        const std::string reason = result_.gain.known() ? result_.dark_noise.unknown : result_.gain.unknown;
        result_.dark_noise_e = result_.sensitivity_threshold = unknown(reason);
    }
    result_.saturation_e = quotient(result_.saturation, result_.gain);
    result_.snr_max = mapped(result_.saturation_e, [](double e) { return 10.0 * std::log10(std::max(e, 1e-3)); });
    result_.dynamic_range = mapped(quotient(result_.saturation_e, result_.sensitivity_threshold),
                                   [](double ratio) { return 20.0 * std::log10(std::max(ratio, 1e-3)); });
    if (result_.dark_current.known() && result_.gain.known()) {
        const double scale = 1000.0 / result_.gain.value;
        EmvaValue &current = result_.dark_current_e;
        current.value = result_.dark_current.value * scale;
        const double gain_error = (result_.gain.high - result_.gain.low) / 2.0 / result_.gain.value;
        const double half = std::hypot((result_.dark_current.high - result_.dark_current.low) / 2.0 * scale,
                                       current.value * gain_error);
        current.low = current.value - half;
        current.high = current.value + half;
    } else {
        result_.dark_current_e =
            unknown(result_.dark_current.known() ? result_.gain.unknown : result_.dark_current.unknown);
    }
}

Emva1288 EmvaMeasurement::run() {
    read();
    look_for_contradictions();
    measure_dark();
    measure_saturation();
    measure_gain();
    measure_nonuniformity();
    measure_linearity();
    measure_dark_current();
    measure_illumination();
    derive();
    return std::move(result_);
}

} // namespace

std::vector<NamedEmvaValue> named_values(const Emva1288 &e) {
    return {{"system_gain", "DN/e", "system gain K", &e.gain},
            {"dark_level", "DN", "dark level", &e.dark_level},
            {"dark_noise", "DN", "temporal dark noise", &e.dark_noise},
            {"dark_noise_e", "e", "temporal dark noise, without quantization", &e.dark_noise_e},
            {"dsnu", "DN", "DSNU", &e.dsnu.total},
            {"dsnu_pixel", "DN", "DSNU of pixels", &e.dsnu.pixel},
            {"dsnu_row", "DN", "DSNU of rows", &e.dsnu.row},
            {"dsnu_column", "DN", "DSNU of columns", &e.dsnu.column},
            {"dsnu_e", "e", "DSNU", &e.dsnu_e.total},
            {"dsnu_pixel_e", "e", "DSNU of pixels", &e.dsnu_e.pixel},
            {"dsnu_row_e", "e", "DSNU of rows", &e.dsnu_e.row},
            {"dsnu_column_e", "e", "DSNU of columns", &e.dsnu_e.column},
            {"prnu", "%", "PRNU", &e.prnu.total},
            {"prnu_pixel", "%", "PRNU of pixels", &e.prnu.pixel},
            {"prnu_row", "%", "PRNU of rows", &e.prnu.row},
            {"prnu_column", "%", "PRNU of columns", &e.prnu.column},
            {"linearity_error_min", "%", "least linearity error", &e.linearity_min},
            {"linearity_error_max", "%", "largest linearity error", &e.linearity_max},
            {"saturation", "DN", "saturation, above dark", &e.saturation},
            {"saturation_capacity", "e", "saturation capacity", &e.saturation_e},
            {"sensitivity_threshold", "e", "absolute sensitivity threshold", &e.sensitivity_threshold},
            {"snr_max", "dB", "largest signal-to-noise ratio", &e.snr_max},
            {"dynamic_range", "dB", "dynamic range", &e.dynamic_range},
            {"dark_current", "DN/ms", "dark current", &e.dark_current},
            {"dark_current_e", "e/s", "dark current", &e.dark_current_e}};
}

const char *method_name(EmvaGainMethod method) {
    switch (method) {
    case EmvaGainMethod::kFlats:
        return "flats";
    case EmvaGainMethod::kOneFlat:
        return "one_flat";
    case EmvaGainMethod::kFlatsWithoutDark:
        return "flats_without_dark";
    case EmvaGainMethod::kLaserAtRest:
        return "laser_at_rest";
    case EmvaGainMethod::kNone:
        break;
    }
    return "none";
}

Emva1288 measure_emva1288(const Capture &capture) {
    return EmvaMeasurement(capture).run();
}

} // namespace clsp

#include "capture/frame_changes.hpp"

#include "statistics/distributions.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <fmt/format.h>
#include <limits>
#include <numeric>
#include <optional>
#include <string>
#include <utility>

namespace clsp {

std::string without_frames(const std::vector<std::size_t> &odd, std::size_t count) {
    if (odd.size() * 2 == count && (odd.back() - odd.front()) == 2 * (odd.size() - 1))
        return fmt::format("codes[{}::2]", 1 - odd.front());
    constexpr std::size_t kMost = 12;
    return odd.size() <= kMost ? fmt::format("numpy.delete(codes, [{}], axis=0)", fmt::join(odd, ", "))
                               : "the other frames alone";
}

namespace {

using Series = std::vector<double>;

constexpr std::size_t kLeastFrames = 4;
constexpr double kAlike = 1e-3;      // neighbours that are more alike wander
constexpr double kLeastGap = 8.0;    // in scatters, however many frames there are
constexpr double kLeastLevel = 0.01; // changes that are told: of the level
constexpr double kLeastLevelDn = 0.25, kLeastContrast = 0.02, kLeastCorrelation = 0.02;
constexpr double kLeastNoise = 0.05; // of the noise
constexpr double kNoLight = 0.02;    // of the brightest frame's
constexpr double kLeastEnergy = 1.2; // factor on the mean squared difference of neighbouring frames
constexpr double kLeastShare = 0.5;  // of the light of the brightest frame, where contrasts are compared
// No scatter is believed to be smaller.
constexpr double kLevelScatterDn = 0.01, kEnergyScatter = 0.01, kRatioScatter = 1e-4;

// One number for each frame. energies: mean squared difference to the frame before, at the same level, from frame 1 on.
struct FrameSeries {
    Series levels, contrasts, correlations, energies;
};

// A light that flickers scales the frame, an offset that does is added to it; what is clipped does neither.
double energy_of(const FrameScan &frame, double dark_dn, bool lit) {
    const double n = double(frame.both);
    if (n == 0.0)
        return 0.0;
    const double before = double(frame.before), now = double(frame.now);
    const double sums[2] = {before - n * dark_dn, now - n * dark_dn};
    const auto product = [&](std::uint64_t raw, double a, double b) {
        return double(raw) - dark_dn * (a + b) + n * dark_dn * dark_dn;
    };
    const double scale = lit && sums[1] > kLeastLevelDn * n ? sums[0] / sums[1] : 1.0;
    const double step = (sums[0] - scale * sums[1]) / n;
    return (product(frame.before_square, before, before) - 2.0 * scale * product(frame.before_times_now, before, now) +
            scale * scale * product(frame.now_square, now, now)) /
               n -
           step * step;
}

FrameSeries measure(const SequenceScan &scan, double dark_dn, bool lit) {
    FrameSeries result;
    const double n = double(scan.pixels);
    for (std::size_t t = 0; t < scan.frames.size(); ++t) {
        const FrameScan &frame = scan.frames[t];
        const double level = double(frame.sum) / n;
        const double variance = std::max(0.0, double(frame.square) / n - level * level);
        result.levels.push_back(level);
        result.contrasts.push_back(std::sqrt(variance) / std::max(level - dark_dn, kLevelScatterDn));
        const double pairs = double(frame.pairs);
        const double covariance =
            pairs > 0.0 ? double(frame.products) / pairs - double(frame.lefts) / pairs * (double(frame.rights) / pairs)
                        : 0.0;
        result.correlations.push_back(variance > 0.0 ? covariance / variance : 0.0);
        if (t > 0)
            result.energies.push_back(energy_of(frame, dark_dn, lit));
    }
    return result;
}

double mean_of(const double *values, std::size_t count) {
    return std::accumulate(values, values + count, 0.0) / double(count);
}

double variance_of(const Series &values, double mean) {
    double squares = 0.0;
    for (const double value : values)
        squares += (value - mean) * (value - mean);
    return squares / double(values.size());
}

// P that frames which know nothing of each other are as alike as these neighbours are (von Neumann's ratio, as a
// correlation of n - 1 pairs).
double chance_of_wandering(const Series &values, double scatter) {
    const std::size_t n = values.size();
    double steps = 0.0;
    for (std::size_t t = 1; t < n; ++t)
        steps += (values[t] - values[t - 1]) * (values[t] - values[t - 1]);
    const double variance = variance_of(values, mean_of(values.data(), n));
    const double ratio =
        std::max(0.5 * steps / double(n - 1), scatter * scatter) / std::max(variance, scatter * scatter);
    const double r = std::clamp(1.0 - ratio, 0.0, 1.0 - 1e-9);
    return n < 5 ? 1.0 : 0.5 * student_two_sided(r * std::sqrt((double(n) - 3.0) / (1.0 - r * r)), double(n) - 3.0);
}

// The step that explains a series best, or that it wanders.
struct Change {
    bool drifts = false;
    std::size_t frame = 0; // of a step: the first one after it
    double before = 0.0, after = 0.0;
};

// Of the first and last quarter.
Change drift_of(const Series &values) {
    const std::size_t n = values.size(), quarter = std::max<std::size_t>(1, n / 4);
    return {true, 0, mean_of(values.data(), quarter), mean_of(values.data() + n - quarter, quarter)};
}

// Nothing where chance does as well, of frames that know nothing of each other. scatter: the least that they differ by.
std::optional<Change> find_change(const Series &values, double scatter) {
    const std::size_t n = values.size();
    Change best;
    double least = std::numeric_limits<double>::infinity();
    Series left;
    for (std::size_t k = 1; k < n; ++k) {
        const double before = mean_of(values.data(), k), after = mean_of(values.data() + k, n - k);
        Series rest = values;
        for (std::size_t t = 0; t < n; ++t)
            rest[t] -= t < k ? before : after;
        const double variance = variance_of(rest, 0.0);
        if (variance < least) {
            least = variance;
            best = {false, k, before, after};
            left = rest;
        }
    }
    const double k = double(best.frame), m = double(n) - k, degrees = double(n) - 2.0;
    const double deviation = std::sqrt(std::max(least * double(n) / degrees, scatter * scatter));
    const double t = (best.after - best.before) / (deviation * std::sqrt(1.0 / k + 1.0 / m));
    // A step leaves frames that do not wander.
    if ((double(n) - 1.0) * student_two_sided(t, degrees) < kChanceOfFrameChange &&
        chance_of_wandering(left, scatter) > kAlike)
        return best;
    if (chance_of_wandering(values, scatter) < kChanceOfFrameChange)
        return drift_of(values);
    return std::nullopt;
}

// P that frames which know nothing of each other follow a course as closely, on a mean and a factor of their own.
double chance_of_course(const Series &values, const Series &course, double scatter) {
    const std::size_t n = values.size();
    const double mean = mean_of(values.data(), n), middle = mean_of(course.data(), n), degrees = double(n) - 2.0;
    double product = 0.0, square = 0.0, squares = 0.0;
    for (std::size_t t = 0; t < n; ++t) {
        product += (values[t] - mean) * (course[t] - middle);
        square += (course[t] - middle) * (course[t] - middle);
    }
    const double slope = product / square;
    for (std::size_t t = 0; t < n; ++t) {
        const double rest = values[t] - mean - slope * (course[t] - middle);
        squares += rest * rest;
    }
    const double deviation = std::max(std::sqrt(squares / degrees), scatter);
    return student_two_sided(slope * std::sqrt(square) / deviation, degrees);
}

// A line, or what settles: few frames are enough for these, where neighbours that are alike tell nothing yet.
std::optional<Change> find_course(const Series &values, double scatter) {
    const std::size_t n = values.size();
    Series course(n);
    std::iota(course.begin(), course.end(), 0.0);
    if (chance_of_course(values, course, scatter) < 0.5 * kChanceOfFrameCourse)
        return drift_of(values);
    constexpr int kTimes = 7; // from one frame to eight
    for (int k = 0; k < kTimes; ++k) {
        const double frames = std::exp2(0.5 * k);
        for (std::size_t t = 0; t < n; ++t)
            course[t] = std::exp(-double(t) / frames);
        if (chance_of_course(values, course, scatter) < 0.5 / kTimes * kChanceOfFrameCourse)
            return drift_of(values);
    }
    return std::nullopt;
}

std::optional<Change> level_change(const Series &levels) {
    const auto change = find_change(levels, kLevelScatterDn);
    return change ? change : find_course(levels, kLevelScatterDn);
}

double gap_limit(std::size_t count) {
    return std::max(kLeastGap, student_two_sided_quantile(kChanceOfFrameChange, double(count) - 2.0));
}

// Two groups of levels with nothing between them: frames of the lower, frames of the upper one.
std::optional<std::array<std::vector<std::size_t>, 2>> find_groups(const Series &values, double scatter) {
    const std::size_t n = values.size();
    std::vector<std::size_t> order(n);
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return values[a] < values[b]; });
    std::size_t split = 1;
    for (std::size_t k = 1; k < n; ++k)
        if (values[order[k]] - values[order[k - 1]] > values[order[split]] - values[order[split - 1]])
            split = k;
    std::array<std::vector<std::size_t>, 2> groups{std::vector<std::size_t>(order.begin(), order.begin() + split),
                                                   std::vector<std::size_t>(order.begin() + split, order.end())};
    double squares = 0.0;
    for (std::vector<std::size_t> &group : groups) {
        double mean = 0.0;
        for (const std::size_t t : group)
            mean += values[t] / double(group.size());
        for (const std::size_t t : group)
            squares += (values[t] - mean) * (values[t] - mean);
        std::sort(group.begin(), group.end());
    }
    const double within = std::max(std::sqrt(squares / (double(n) - 2.0)), scatter);
    if (values[order[split]] - values[order[split - 1]] < gap_limit(n) * within)
        return std::nullopt;
    return groups;
}

// Frames from which on a series is at another level, two times and more, each time by far more than it scatters
// between: a smooth drift in so many pieces scatters by a third of its steps. Empty where it is no staircase.
std::vector<std::size_t> find_steps(const Series &values, double scatter) {
    constexpr std::size_t kMostSteps = 8, kLeastRun = 2;
    const std::size_t n = values.size();
    Series sums(n + 1), squares(n + 1);
    for (std::size_t t = 0; t < n; ++t) {
        const double value = values[t] - values[0];
        sums[t + 1] = sums[t] + value;
        squares[t + 1] = squares[t] + value * value;
    }
    const auto rest = [&](std::size_t from, std::size_t to) {
        const double sum = sums[to] - sums[from];
        return std::max(0.0, squares[to] - squares[from] - sum * sum / double(to - from));
    };
    std::vector<std::size_t> bounds{0, n};
    while (bounds.size() < std::min(kMostSteps, n / 3) + 2) {
        std::size_t split = 0;
        double gain = 0.0;
        for (std::size_t piece = 0; piece + 1 < bounds.size(); ++piece)
            for (std::size_t t = bounds[piece] + kLeastRun; t + kLeastRun <= bounds[piece + 1]; ++t)
                if (const double less =
                        rest(bounds[piece], bounds[piece + 1]) - rest(bounds[piece], t) - rest(t, bounds[piece + 1]);
                    less > gain) {
                    gain = less;
                    split = t;
                }
        if (split == 0)
            return {};
        bounds.insert(std::lower_bound(bounds.begin(), bounds.end(), split), split);
        if (bounds.size() < 4)
            continue;
        Series left = values;
        double squared = 0.0, least_step = std::numeric_limits<double>::infinity(), before = 0.0;
        for (std::size_t piece = 0; piece + 1 < bounds.size(); ++piece) {
            const std::size_t from = bounds[piece], to = bounds[piece + 1];
            const double level = mean_of(values.data() + from, to - from);
            for (std::size_t t = from; t < to; ++t)
                left[t] -= level;
            squared += rest(from, to);
            if (piece > 0)
                least_step = std::min(least_step, std::abs(level - before));
            before = level;
        }
        const double degrees = double(n) - double(bounds.size()) + 1.0;
        const double within = std::max(std::sqrt(squared / degrees), scatter);
        if (least_step > std::max(kLeastGap, student_two_sided_quantile(kChanceOfFrameChange, degrees)) * within &&
            chance_of_wandering(left, scatter) > kAlike)
            return {bounds.begin() + 1, bounds.end() - 1};
    }
    return {};
}

double mean_of_frames(const Series &values, const std::vector<std::size_t> &frames) {
    double sum = 0.0;
    for (const std::size_t t : frames)
        sum += values[t];
    return sum / double(frames.size());
}

// "3, 7, 8 and 12 more"
std::string list_of(const std::vector<std::size_t> &frames) {
    constexpr std::size_t kMost = 6;
    std::string text;
    for (std::size_t i = 0; i < std::min(frames.size(), kMost); ++i)
        text += fmt::format("{}{}", i ? ", " : "", frames[i]);
    return frames.size() > kMost ? fmt::format("{} and {} more", text, frames.size() - kMost) : text;
}

// ", by 0.42 pixels (0.41 to the right, -0.10 down)": what a step of the picture is, where it is one.
std::string step_of(const std::vector<PictureShift> &shifts, std::size_t frame) {
    if (frame >= shifts.size() || !(shifts[frame].sure || shifts[frame - 1].sure))
        return "";
    const double x = shifts[frame].x - shifts[frame - 1].x, y = shifts[frame].y - shifts[frame - 1].y;
    return fmt::format(", by {:.2f} pixels ({:.2f} to the right, {:.2f} down)", std::hypot(x, y), x, y);
}

double median_of(Series values) {
    std::nth_element(values.begin(), values.begin() + std::ptrdiff_t(values.size() / 2), values.end());
    return values[values.size() / 2];
}

// Frames from which on a resting scene is another one: the difference to the frame before stands out.
std::vector<std::size_t> find_breaks(const Series &energies, double scatter) {
    Series logs;
    for (const double energy : energies)
        if (energy > 0.0) // a frame that comes twice is told elsewhere
            logs.push_back(std::log(energy));
    if (logs.size() < kLeastFrames - 1)
        return {};
    const double usual = median_of(logs);
    Series away;
    for (const double value : logs)
        away.push_back(std::abs(value - usual));
    constexpr double kNormalMad = 1.4826; // a normal law's deviation in median absolute deviations
    const double limit = gap_limit(logs.size()) * std::max(kNormalMad * median_of(away), scatter);
    std::vector<std::size_t> breaks;
    for (std::size_t t = 0; t < energies.size(); ++t)
        if (energies[t] > 0.0 && std::log(energies[t]) - usual > std::max(limit, std::log(kLeastEnergy)))
            breaks.push_back(t + 1);
    return breaks;
}

// Deviation of the noise of frames. Their mean holds a part of each: of frames with unlike noise as well.
double noise_of_frames(const SequenceScan &scan, const std::vector<std::size_t> &frames) {
    const double n = double(scan.noise.frames.size());
    double all = 0.0, own = 0.0;
    for (const FrameNoise &frame : scan.noise.frames)
        all += frame.square / (1.0 - 1.0 / n);
    for (const std::size_t t : frames)
        own += (scan.noise.frames[t].square - all / (n * n)) / (1.0 - 2.0 / n) / double(frames.size());
    return std::sqrt(std::max(0.0, own));
}

std::vector<std::size_t> span_of(std::size_t first, std::size_t last) {
    std::vector<std::size_t> frames(last - first);
    std::iota(frames.begin(), frames.end(), first);
    return frames;
}

// Some frames have another noise than the others. Steps of all scenes at rest; drifts, and frames that alternate, of
// those whose frames know nothing of each other.
struct NoiseChange {
    std::vector<std::size_t> frames; // none: it drifts
    bool steps = false;
    double before = 0.0, after = 0.0; // of the step or drift; of the others and of these frames
};

std::optional<NoiseChange> noise_change(const SequenceScan &scan, bool independent) {
    const std::size_t n = scan.noise.frames.size();
    std::vector<std::uint64_t> hashes;
    for (const FrameScan &frame : scan.frames)
        hashes.push_back(frame.hash);
    std::sort(hashes.begin(), hashes.end());
    // Frames that come twice, which is told elsewhere, lie nearer to the mean.
    if (std::adjacent_find(hashes.begin(), hashes.end()) != hashes.end())
        return std::nullopt;
    if (n < kLeastFrames)
        return std::nullopt;
    Series noises;
    for (const FrameNoise &frame : scan.noise.frames) {
        if (!(frame.square > 0.0 && (noises.empty() || frame.step > 0.0)))
            return std::nullopt;
        noises.push_back(0.5 * std::log(frame.square));
    }
    const double scatter = std::max(kRatioScatter, std::sqrt(0.5 / scan.noise.pixels));
    // Rounding alone makes as much of a level that lies elsewhere between two codes.
    const double rounding = 0.25 * double(least_step(scan.codes)) * double(least_step(scan.codes));
    const auto counts = [&](double before, double after) {
        return std::abs(after - before) > kLeastNoise &&
               std::abs(std::exp(2.0 * after) - std::exp(2.0 * before)) > rounding;
    };
    // Another scene lies as far from the mean, but its frames do not differ more from each other.
    const auto of_noise = [&](std::size_t frame, double change) {
        Series parts[2];
        for (std::size_t t = 1; t < n; ++t)
            if (t != frame)
                parts[t > frame].push_back(0.5 * std::log(scan.noise.frames[t].step));
        return !parts[0].empty() && !parts[1].empty() && (median_of(parts[1]) - median_of(parts[0])) / change > 0.5;
    };
    if (const auto change = find_change(noises, scatter);
        change && (independent || !change->drifts) && counts(change->before, change->after) &&
        (change->drifts || of_noise(change->frame, change->after - change->before))) {
        const std::size_t quarter = std::max<std::size_t>(1, n / 4);
        const bool drifts = change->drifts;
        return NoiseChange{drifts ? std::vector<std::size_t>() : std::vector{change->frame}, !drifts,
                           noise_of_frames(scan, span_of(0, drifts ? quarter : change->frame)),
                           noise_of_frames(scan, span_of(drifts ? n - quarter : change->frame, n))};
    }
    const auto groups = independent ? find_groups(noises, scatter) : std::nullopt;
    if (!groups)
        return std::nullopt;
    const bool fewer_below = (*groups)[0].size() < (*groups)[1].size();
    const std::vector<std::size_t> &odd = (*groups)[fewer_below ? 0 : 1], &others = (*groups)[fewer_below ? 1 : 0];
    const double of_odd = mean_of_frames(noises, odd), of_others = mean_of_frames(noises, others);
    if (!counts(of_others, of_odd))
        return std::nullopt;
    return NoiseChange{odd, false, noise_of_frames(scan, others), noise_of_frames(scan, odd)};
}

} // namespace

std::vector<SequenceChange> frame_changes(const CaptureLayout &capture, std::size_t sequence, const SequenceScan &scan,
                                          double dark_level_dn) {
    const SequenceLayout &layout = capture.sequences[sequence];
    std::vector<SequenceChange> result;
    const auto say = [&](const char *kind, std::vector<std::size_t> frames, std::string text,
                         bool level_drifts = false) {
        result.push_back({{layout.name, std::move(text), kind, std::move(frames)}, level_drifts});
    };
    const bool lit = layout.scene != CaptureScene::kDark;
    if (layout.frame_count < kLeastFrames || scan.pixels == 0)
        return result;
    const FrameSeries seen = measure(scan, dark_level_dn, lit);

    const double light = *std::max_element(seen.levels.begin(), seen.levels.end()) - dark_level_dn;
    const double least_dn = lit ? std::max(kLeastLevel * light, kLeastLevelDn) : kLeastLevelDn;
    const char *const meant =
        lit ? "the light, the exposure or the scene changed" : "the offset or stray light changed";
    // Resting speckle may boil: its frames fluctuate together, and a small step of them is nothing. Others' do not.
    const bool independent = !is_laser(layout.scene) || layout.moving;
    const Series &levels = seen.levels;
    const auto groups = find_groups(levels, kLevelScatterDn);
    if (groups && mean_of_frames(levels, (*groups)[1]) - mean_of_frames(levels, (*groups)[0]) > least_dn) {
        const bool fewer_below = (*groups)[0].size() <= (*groups)[1].size();
        const std::vector<std::size_t> &odd = (*groups)[fewer_below ? 0 : 1], &others = (*groups)[fewer_below ? 1 : 0];
        const double odd_dn = mean_of_frames(levels, odd), others_dn = mean_of_frames(levels, others);
        const std::vector<std::size_t> &below = (*groups)[0];
        const bool no_light = lit && mean_of_frames(levels, below) - dark_level_dn < kNoLight * light;
        const bool at_end = odd.front() > others.back(), at_begin = odd.back() < others.front();
        if (no_light) {
            say(kFramesWithoutLight, below,
                fmt::format("{} of {} frames ({}) have no light, {:.1f} DN, the others {:.1f} DN: an emitter that "
                            "alternates, a strobe out of step, or lost frames; take {}",
                            below.size(), levels.size(), list_of(below), fewer_below ? odd_dn : others_dn,
                            fewer_below ? others_dn : odd_dn, without_frames(below, levels.size())));
        } else if (odd.size() > 1 && (at_end || at_begin)) {
            say("level_steps", {at_end ? odd.front() : others.front()},
                fmt::format("the level steps from {:.1f} to {:.1f} DN at frame {}: {}", at_end ? others_dn : odd_dn,
                            at_end ? odd_dn : others_dn, at_end ? odd.front() : others.front(), meant));
        } else {
            say("level_of_frames", odd,
                fmt::format("{} of {} frames ({}) have a level of {:.1f} DN, the others {:.1f} DN: {} between frames",
                            odd.size(), levels.size(), list_of(odd), odd_dn, others_dn, meant));
        }
    } else if (const std::vector<std::size_t> steps = find_steps(levels, kLevelScatterDn); !steps.empty()) {
        std::string text;
        double before = mean_of(levels.data(), steps[0]), most = 0.0;
        text = fmt::format("the level steps from {:.1f}", before);
        for (std::size_t k = 0; k < steps.size(); ++k) {
            const double after =
                mean_of(levels.data() + steps[k], (k + 1 < steps.size() ? steps[k + 1] : levels.size()) - steps[k]);
            text += fmt::format("{} to {:.1f} DN at frame {}", k ? "," : "", after, steps[k]);
            most = std::max(most, std::abs(after - before));
            before = after;
        }
        if (most > least_dn)
            say("level_steps", steps, text + ": " + meant);
    } else if (const auto change = level_change(levels);
               independent && change && std::abs(change->after - change->before) > least_dn) {
        if (change->drifts) {
            const std::size_t quarter = std::max<std::size_t>(1, levels.size() / 4);
            const auto span = [](std::size_t first, std::size_t last) {
                return first == last ? fmt::format("frame {}", first) : fmt::format("frames {} to {}", first, last);
            };
            say("level_drifts", {},
                fmt::format("the level drifts from {:.1f} DN in {} to {:.1f} DN in {}: {}", change->before,
                            span(0, quarter - 1), change->after, span(levels.size() - quarter, levels.size() - 1),
                            meant),
                true);
        } else {
            say("level_steps", {change->frame},
                fmt::format("the level steps from {:.1f} to {:.1f} DN at frame {}: {}", change->before, change->after,
                            change->frame, meant));
        }
    }
    if (!result.empty())
        return result; // what follows goes with the level

    // Resting speckle may boil.
    if (const auto noise = noise_change(scan, !is_laser(layout.scene))) {
        const char *const cause = lit ? "the light, the gain or the exposure changed"
                                      : "the gain, the exposure or the temperature changed, or something disturbs";
        if (noise->steps)
            say("noise_changes", noise->frames,
                fmt::format("the noise steps from {:.2f} to {:.2f} DN at frame {}: {}", noise->before, noise->after,
                            noise->frames.front(), cause));
        else if (noise->frames.empty())
            say("noise_changes", {},
                fmt::format("the noise drifts from {:.2f} to {:.2f} DN: {}", noise->before, noise->after, cause));
        else
            say("noise_changes", noise->frames,
                fmt::format("{} of {} frames ({}) have a noise of {:.2f} DN, the others {:.2f} DN: {} between frames",
                            noise->frames.size(), seen.levels.size(), list_of(noise->frames), noise->after,
                            noise->before, cause));
        return result;
    }

    if (!layout.moving && seen.energies.size() >= kLeastFrames - 1) {
        // Of so many squared differences of noise, with neighbours that share a frame.
        const std::vector<std::size_t> breaks =
            find_breaks(seen.energies, std::max(kEnergyScatter, std::sqrt(3.0 / double(scan.pixels))));
        if (!breaks.empty())
            say("scene_changes", breaks,
                fmt::format("what the frames show changes at frame {}: the difference to the frame "
                            "before is larger than the others; the scene or the camera moved{}",
                            list_of(breaks), step_of(scan.shifts, breaks.front())));
    }
    if (lit && independent) {
        // A first frame has none before it, of which a sensor's lag would leave something: it is not compared.
        Series contrasts(seen.contrasts.begin() + 1, seen.contrasts.end());
        const Series correlations(seen.correlations.begin() + 1, seen.correlations.end());
        for (double &contrast : contrasts)
            contrast = std::log(std::max(contrast, kRatioScatter));
        const double dimmest = *std::min_element(seen.levels.begin(), seen.levels.end()) - dark_level_dn;
        if (dimmest < kLeastShare * light)
            return result; // few speckles: contrasts have no law that Student's would be near
        const auto tell = [&](const Change &change, const char *what, double before, double after, const char *cause) {
            say("contrast_changes", change.drifts ? std::vector<std::size_t>() : std::vector{change.frame + 1},
                fmt::format("{} {} from {:.3f} to {:.3f}{}: {}", what, change.drifts ? "drifts" : "steps", before,
                            after, change.drifts ? "" : fmt::format(" at frame {}", change.frame + 1), cause));
        };
        if (const auto change = find_change(contrasts, kRatioScatter);
            change && std::abs(change->after - change->before) > kLeastContrast)
            tell(*change, "the contrast", std::exp(change->before), std::exp(change->after),
                 "the scene, the light or the focus changed");
        else if (const auto speckle = find_change(correlations, kRatioScatter);
                 speckle && std::abs(speckle->after - speckle->before) > kLeastCorrelation)
            tell(*speckle, "the correlation of neighbouring pixels", speckle->before, speckle->after,
                 "focus, aperture or scene changed");
    }
    return result;
}

std::optional<CaptureWarning> level_fluctuation(const CaptureLayout &capture, std::size_t sequence,
                                                const SequenceScan &scan, double dark_level_dn) {
    constexpr double kLeastSpread = 0.1;     // of the light
    constexpr double kSpeckleScatters = 8.0; // that a mean over speckle does not reach
    const SequenceLayout &layout = capture.sequences[sequence];
    if (layout.scene == CaptureScene::kDark || layout.frame_count < kLeastFrames || scan.pixels == 0)
        return std::nullopt;
    const FrameSeries seen = measure(scan, dark_level_dn, true);
    const auto [low, high] = std::minmax_element(seen.levels.begin(), seen.levels.end());
    const double light = *high - dark_level_dn, spread = *high - *low;
    double chance = 0.0;
    if (is_laser(layout.scene)) {
        // Independent speckles of the frame. Fresh ones scatter by the contrast; resting ones by what changed from
        // frame to frame, noise included, which may add up.
        const double diameter = capture.pixel_pitch_m / (capture.wavelength_m * capture.f_number);
        const double speckles = double(scan.pixels) * std::min(1.0, M_PI / 4.0 * diameter * diameter);
        const double variance =
            layout.moving
                ? std::pow(light * *std::max_element(seen.contrasts.begin(), seen.contrasts.end()), 2.0)
                : std::max(0.0, mean_of(seen.energies.data(), seen.energies.size())) * double(seen.levels.size());
        chance = kSpeckleScatters * std::sqrt(variance / speckles);
    }
    if (!(spread > std::max({kLeastSpread * light, kLeastLevelDn, chance})))
        return std::nullopt;
    const auto dimmest = std::size_t(low - seen.levels.begin()), brightest = std::size_t(high - seen.levels.begin());
    return CaptureWarning{
        layout.name,
        fmt::format("the level is between {:.1f} DN (frame {}) and {:.1f} DN (frame {}): the light, the "
                    "exposure or the scene changed between frames",
                    *low, dimmest, *high, brightest),
        "level_fluctuates",
        {dimmest, brightest}};
}

std::optional<CaptureWarning> picture_shift(const CaptureLayout &capture, std::size_t sequence,
                                            const SequenceScan &scan) {
    const SequenceLayout &layout = capture.sequences[sequence];
    std::vector<std::size_t> moved;
    for (std::size_t t = 0; t < scan.shifts.size(); ++t)
        if (scan.shifts[t].sure)
            moved.push_back(t);
    if (layout.frame_count < kLeastFrames || moved.empty())
        return std::nullopt;
    const auto by = [&](std::size_t t) {
        const PictureShift &shift = scan.shifts[t];
        return fmt::format("{:.2f} pixels ({:.2f} to the right, {:.2f} down)", std::hypot(shift.x, shift.y), shift.x,
                           shift.y);
    };
    const std::size_t farthest = *std::max_element(moved.begin(), moved.end(), [&](std::size_t a, std::size_t b) {
        return std::hypot(scan.shifts[a].x, scan.shifts[a].y) < std::hypot(scan.shifts[b].x, scan.shifts[b].y);
    });
    return CaptureWarning{
        layout.name,
        fmt::format("the picture moves, though \"motion\" is \"static\": from frame {} on {} of {} frames ({}) lie "
                    "elsewhere than frame 0, frame {} by {}{}. The board or the camera shakes or slides: fix both and "
                    "record again. A diagnosis explains what shakes by vibration or airflow alone",
                    moved.front(), moved.size(), scan.shifts.size(), list_of(moved), moved.front(), by(moved.front()),
                    farthest == moved.front() ? "" : fmt::format(", frame {} by {}", farthest, by(farthest))),
        "picture_moves", moved};
}

} // namespace clsp

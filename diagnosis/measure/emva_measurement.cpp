#include "measure/emva_measurement.hpp"

#include "statistics/distributions.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/core.h>
#include <utility>

namespace clsp {
namespace {

constexpr double kLeastVariance = 0.24;                            // DN^2: the standard's number, sections 6.6 and 6.7
constexpr double kContradiction = 5.0, kLeastContradiction = 0.05; // standard errors, and parts of the variance
constexpr double kSamePeak = 0.01;                                 // of the largest variance

EmvaValue mapped(const EmvaValue &value, double (*law)(double)) {
    EmvaValue result = value;
    result.value = law(value.value);
    result.low = law(value.low);
    result.high = law(value.high);
    return result;
}

} // namespace

EmvaValue unknown_emva_value(std::string reason) {
    EmvaValue value;
    value.unknown = std::move(reason);
    return value;
}

EmvaValue emva_value(double value, double error) {
    EmvaValue result;
    result.value = value;
    result.low = value - kEmva95 * error;
    result.high = value + kEmva95 * error;
    return result;
}

EmvaValue emva_quotient(const EmvaValue &over, const EmvaValue &under) {
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

void EmvaMeasurement::read() {
    for (std::size_t s = 0; s < capture_.codes.size(); ++s) {
        EmvaSequence sequence;
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
            const double t = student_two_sided_quantile(0.05, degrees) / kEmva95;
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
bool EmvaMeasurement::halves_agree(EmvaSequence &sequence) {
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
    for (std::vector<EmvaSequence> *group : {&darks_, &flats_})
        for (EmvaSequence &sequence : *group)
            if (sequence.stack.frames > 1 && sequence.stack.counted_pixels > 0.0)
                sequence.usable = halves_agree(sequence);
    std::vector<const EmvaSequence *> timed;
    for (const EmvaSequence &flat : flats_) {
        if (flat.layout->exposure_ms)
            timed.push_back(&flat);
        for (const EmvaSequence &dark : darks_)
            if (flat.stack.unmasked_level < dark.stack.unmasked_level - std::max(0.5, 4.0 * dark.level_error))
                note(flat.layout->name,
                     fmt::format(
                         "its mean, {:.5g} DN over {} frames, is below that of {}, {:.5g} DN over {} frames: a flat "
                         "cannot be darker than the dark; check which files belong to which scene",
                         flat.stack.unmasked_level, flat.stack.frames, dark.layout->name, dark.stack.unmasked_level,
                         dark.stack.frames));
    }
    std::stable_sort(timed.begin(), timed.end(), [](const EmvaSequence *a, const EmvaSequence *b) {
        return *a->layout->exposure_ms < *b->layout->exposure_ms;
    });
    const auto level = [](const EmvaSequence *of) { return of->stack.unmasked_level; };
    const auto differ = [&](const EmvaSequence *a, const EmvaSequence *b) {
        return std::abs(level(a) - level(b)) > std::max({kEmvaSameLevel * std::max(level(a), level(b)), 1.0,
                                                         4.0 * std::hypot(a->level_error, b->level_error)});
    };
    for (std::size_t from = 0, to = 0; from < timed.size(); from = to) {
        const double exposure = *timed[from]->layout->exposure_ms;
        for (to = from + 1;
             to < timed.size() && *timed[to]->layout->exposure_ms <= (1.0 + kEmvaSameExposure) * exposure;)
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
    for (const EmvaSequence &dark : darks_)
        if (dark.clipped && !dark.clipped->unknown.empty())
            return dark.clipped->unknown;
    return fmt::format("no dark sequence of two frames or more that agree (see the notes); {} has {} frame{}",
                       darks_.front().layout->name, darks_.front().stack.frames,
                       darks_.front().stack.frames == 1 ? "" : "s");
}

// The dark frames of the same exposure, or of the nearest one; else those with the most frames.
const EmvaSequence *EmvaMeasurement::dark_of(const EmvaSequence &flat) const {
    const EmvaSequence *best = nullptr;
    const auto apart = [&](const EmvaSequence &dark) {
        return flat.layout->exposure_ms && dark.layout->exposure_ms
                   ? std::abs(*flat.layout->exposure_ms - *dark.layout->exposure_ms)
                   : std::numeric_limits<double>::max();
    };
    for (const EmvaSequence &dark : darks_)
        if (dark.usable && (!best || apart(dark) < apart(*best) ||
                            (apart(dark) == apart(*best) && dark.stack.frames > best->stack.frames)))
            best = &dark;
    return best;
}

void EmvaMeasurement::measure_dark() {
    for (EmvaSequence &dark : darks_) {
        const FrameStack &stack = dark.stack;
        if (dark.clipped) {
            const ClippedDark &behind = *dark.clipped;
            dark.usable = dark.usable && behind.unknown.empty();
            dark.level = behind.level;
            dark.level_error = behind.level_error;
            dark.variance = behind.variance + kEmvaQuantization;
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
    const EmvaSequence *best = nullptr;
    for (const EmvaSequence &dark : darks_)
        if (dark.usable && (!best || dark.stack.frames > best->stack.frames))
            best = &dark;
    if (!best) {
        const std::string reason = reason_without_dark();
        result_.dark_level = result_.dark_noise = unknown_emva_value(reason);
        return;
    }
    result_.dark_level = emva_value(best->level, std::hypot(best->level_error, best->draw_error));
    result_.dark_noise =
        best->variance > 0.0
            ? mapped(emva_value(best->variance, best->variance_error),
                     [](double v) { return std::sqrt(std::max(0.0, v)); })
            : unknown_emva_value(
                  "the dark codes never change, so that their noise is lost in the converter's rounding (it is below "
                  "0.3 DN or so), or the frames are copies of one; record with more gain");
}

void EmvaMeasurement::measure_saturation() {
    std::vector<const EmvaSequence *> lit;
    for (const EmvaSequence &flat : flats_)
        if (flat.stack.frames > 1 && dark_of(flat))
            lit.push_back(&flat);
    std::stable_sort(lit.begin(), lit.end(), [](const EmvaSequence *a, const EmvaSequence *b) {
        return a->stack.unmasked_level < b->stack.unmasked_level;
    });
    const double dark = lit.empty() ? capture_.layout.black_level_dn : dark_of(*lit.front())->level;
    saturation_limit_ = capture_.layout.maximum_code() - dark;
    if (lit.empty()) {
        result_.saturation =
            unknown_emva_value(flats_.empty() ? "the capture has no flat frames" : reason_without_dark());
        return;
    }
    // The variance falls beyond saturation: its peak is the point (section 6.6).
    std::vector<double> variances, levels;
    for (const EmvaSequence *flat : lit) {
        variances.push_back(flat->stack.stack_variance - flat->stack.fluctuation);
        levels.push_back(flat->stack.unmasked_level - dark);
    }
    const std::size_t last = lit.size() - 1;
    const auto peak = std::size_t(std::max_element(variances.begin(), variances.end()) - variances.begin());
    if (variances[last] >= 0.5 * variances[peak]) {
        result_.saturation = unknown_emva_value(
            fmt::format("not reached: the variance over time does not fall toward the brightest flat, {} at {:.5g} DN",
                        lit[last]->layout->name, lit[last]->stack.unmasked_level));
        return;
    }
    if (peak == 0) {
        result_.saturation =
            unknown_emva_value(fmt::format("every flat but {} is beyond it", lit.front()->layout->name));
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

// Sections 2 and 6.6: what follows from the above.
void EmvaMeasurement::derive() {
    if (result_.dark_noise.known() && result_.gain.known()) {
        const double variance = result_.dark_noise.value * result_.dark_noise.value;
        if (variance < kLeastVariance) {
            result_.dark_noise_e = unknown_emva_value(fmt::format(
                "a variance of {:.2g} DN^2 is mostly the quantization's; the noise is below {:.3g} e (0.49 DN)",
                variance, std::sqrt(kLeastVariance) / result_.gain.value));
        } else {
            const EmvaValue unquantized = mapped(
                result_.dark_noise, [](double s) { return std::sqrt(std::max(0.0, s * s - kEmvaQuantization)); });
            result_.dark_noise_e = emva_quotient(unquantized, result_.gain);
        }
        EmvaValue noise = result_.dark_noise;
        for (double EmvaValue::*end : {&EmvaValue::value, &EmvaValue::low, &EmvaValue::high})
            noise.*end = std::max(noise.*end, std::sqrt(kLeastVariance));
        result_.sensitivity_threshold = mapped(emva_quotient(noise, result_.gain), [](double e) { return e + 0.5; });
    } else {
        const std::string reason = result_.gain.known() ? result_.dark_noise.unknown : result_.gain.unknown;
        result_.dark_noise_e = result_.sensitivity_threshold = unknown_emva_value(reason);
    }
    result_.saturation_e = emva_quotient(result_.saturation, result_.gain);
    result_.snr_max = mapped(result_.saturation_e, [](double e) { return 10.0 * std::log10(std::max(e, 1e-3)); });
    result_.dynamic_range = mapped(emva_quotient(result_.saturation_e, result_.sensitivity_threshold),
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
            unknown_emva_value(result_.dark_current.known() ? result_.gain.unknown : result_.dark_current.unknown);
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

} // namespace clsp

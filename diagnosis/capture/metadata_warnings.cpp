#include "capture/metadata_warnings.hpp"

#include "capture/code_warnings.hpp"
#include "capture/stored_sequence.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <string>

namespace clsp {
namespace {

// Pairs of frames that a change is measured on, at most.
constexpr std::uint32_t kMostPairs = 16;
// Below this contrast there is hardly any speckle to compare.
constexpr double kHardlySpeckle = 0.1;
// Speckle of independent frames differs by all of its variance. On dots the pattern's own variance stays, so that what
// is new is C^2 <I0^2> / ((1 + C^2) <I0^2> - <I0>^2), a third or more for contrasts C above 0.5. Boiling with a
// correlation of six frames changes 0.28.
constexpr double kNewBoard = 0.6, kNewDots = 0.25;
// Frames of a moving scene that share their speckle differ by noise only.
constexpr double kSameBoard = 0.1, kSameDots = 0.03;
// What changes by chance differs as much between neighbours as between distant frames; what drifts does not.
constexpr double kIndependent = 0.7;
// The data sheet's black level is good to a few DN.
constexpr double kBlackLevelDn = 8.0, kBlackLevelNoises = 3.0;
constexpr double kReadNoiseFactor = 2.0; // the data sheet's is good to about 15 %
// Lamp light falls off and carries noise; neither reaches this contrast.
constexpr double kSpeckledFlat = 0.4, kEvenBoard = 0.05;
constexpr double kDimNoises = 8.0; // in dimmer light the shot noise of a few electrons has that contrast, too
constexpr double kMostMasked = 0.9;
constexpr std::size_t kSampledDots = 256;
// Pixels that tell the light between dots, and how much more of it at the border, as a part of the mean light, is a
// dot's that is not listed.
constexpr std::size_t kLeastBetween = 64;
constexpr double kUnlistedLight = 0.25;
constexpr std::size_t kLeastDots = 12; // static speckle makes single dots bright or dark

// The deviation of a converter's codes where that of its input is `sigma`, and its mean lies `fraction` of a code above
// a whole one: it depends on the fraction below half a code.
double rounded_noise(double sigma, double fraction) {
    const auto below = [&](double code) { // probability of codes up to this one
        const double away = code + 0.5 - fraction;
        return sigma > 0.0 ? 0.5 * std::erfc(-away / (sigma * std::sqrt(2.0))) : (away >= 0.0 ? 1.0 : 0.0);
    };
    if (sigma > 2.0)
        return std::sqrt(sigma * sigma + 1.0 / 12.0);
    double mean = 0.0, square = 0.0;
    for (int code = -16; code <= 17; ++code) {
        const double part = below(code) - below(code - 1.0);
        mean += part * code;
        square += part * code * code;
    }
    return std::sqrt(std::max(0.0, square - mean * mean));
}

class Warnings {
  public:
    Warnings(const Capture &capture, const std::vector<SequenceScan> &scans,
             const std::vector<SequenceSummary> &summaries, const DarkLevel &dark,
             const std::vector<SequenceChange> &frame_changes)
        : capture_(capture), layout_(capture.layout), scans_(scans), summaries_(summaries), dark_(dark),
          frame_changes_(frame_changes), noise_(measured_noise(summaries)) {}

    std::vector<CaptureWarning> all() {
        std::vector<CaptureWarning> of_codes = code_warnings(layout_, scans_, summaries_, dark_, noise_);
        // Codes of another scale than the data sheet's have a black level and a noise that follow from it: the warning
        // of the codes has both as they are once the codes are taken back.
        const bool scaled = std::any_of(of_codes.begin(), of_codes.end(), [](const CaptureWarning &warning) {
            return warning.kind == "stretched_codes" || warning.kind == "upper_bits";
        });
        if (!scaled)
            dark_frames();
        for (const SequenceSummary &s : summaries_)
            sequence(s);
        exposures();
        motion();
        for (CaptureWarning &warning : of_codes)
            warnings_.push_back(std::move(warning));
        geometry();
        return std::move(warnings_);
    }

  private:
    void warn(const char *kind, const std::string &sequence, std::string text) {
        warnings_.push_back({sequence, std::move(text), kind});
    }
    void dark_frames();
    double contrast_without_noise(const SequenceSummary &s) const;
    void sequence(const SequenceSummary &s);
    void exposures();
    void motion();
    void geometry();
    void dots_are_lit(std::size_t sequence);
    void border_dots_are_listed(std::size_t sequence);

    const Capture &capture_;
    const CaptureLayout &layout_;
    const std::vector<SequenceScan> &scans_;
    const std::vector<SequenceSummary> &summaries_;
    const DarkLevel &dark_;
    const std::vector<SequenceChange> &frame_changes_;
    double noise_; // 0: not measured
    std::vector<CaptureWarning> warnings_;
};

void Warnings::dark_frames() {
    const double noise = noise_ > 0.0 ? noise_ : layout_.read_noise_dn;
    const double tolerance =
        std::max(kBlackLevelDn * std::max(1.0, layout_.dn_of_ten_bits()), kBlackLevelNoises * noise);
    for (const SequenceSummary &s : summaries_) {
        if (s.scene != CaptureScene::kDark || std::abs(s.level_above_dark_dn) <= tolerance)
            continue;
        const bool above = s.level_above_dark_dn > 0.0;
        warn("black_level", s.name,
             fmt::format(
                 "its mean, {:.2f} DN, is far {} /camera/black_level_dn, {:.2f} DN: {}; the frames' own level is "
                 "taken",
                 s.mean_dn, above ? "above" : "below", layout_.black_level_dn,
                 above ? "light may have come in, the exposure was long, or the number is that of another setting"
                       : "the number is that of another setting, or a black level was taken off the codes"));
    }
    if (noise_ > 0.0) {
        const bool less = kReadNoiseFactor * noise_ < rounded_noise(layout_.read_noise_dn, 0.0);
        if (less || noise_ > kReadNoiseFactor * rounded_noise(layout_.read_noise_dn, 0.5))
            warn("read_noise", "",
                 fmt::format(
                     "/camera/read_noise_dn is {:g}, but the dark frames' noise is {:.2f} DN; the measured noise is "
                     "taken. Is the number in electrons, or of another gain{}?",
                     layout_.read_noise_dn, noise_, less ? ", or were the frames denoised or compressed" : ""));
        return;
    }
    // Without dark frames the noise of any scene at rest is an upper bound.
    for (const SequenceSummary &s : summaries_)
        if (s.temporal_noise_dn && *s.temporal_noise_dn > 0.0 && !(s.moving && is_laser(s.scene)) &&
            kReadNoiseFactor * *s.temporal_noise_dn < rounded_noise(layout_.read_noise_dn, 0.0))
            warn("read_noise", s.name,
                 fmt::format(
                     "its noise in time is {:.2f} DN, less than /camera/read_noise_dn, {:g} DN, alone would give: "
                     "is the number in electrons, or of another gain? A dark sequence measures it",
                     *s.temporal_noise_dn, layout_.read_noise_dn));
}

// What a single frame's noise leaves of the contrast. All that changes in time is noise in dim light; in brighter light
// only the dark frames' noise is, as speckle in motion changes, too.
double Warnings::contrast_without_noise(const SequenceSummary &s) const {
    const double dark = noise_ > 0.0 ? noise_ : layout_.read_noise_dn;
    const double noise = s.level_above_dark_dn < kDimNoises * dark ? s.temporal_noise_dn.value_or(dark) : dark;
    const double ratio = noise / s.level_above_dark_dn;
    return std::sqrt(std::max(0.0, *s.contrast * *s.contrast - ratio * ratio));
}

void Warnings::sequence(const SequenceSummary &s) {
    if (s.moving && !is_laser(s.scene))
        warn("motion", s.name,
             fmt::format("\"motion\" is \"moving\", but {} shows no motion; it is taken as static",
                         s.scene == CaptureScene::kDark ? "the dark" : "even lamp light"));
    if (s.scene == CaptureScene::kFlat && s.contrast && contrast_without_noise(s) > kSpeckledFlat &&
        s.saturated_fraction < 0.01)
        warn("not_a_flat", s.name,
             fmt::format(
                 "its contrast is {:.2f}: even lamp light without speckle has far less. Is it a board or dots in "
                 "laser light?",
                 contrast_without_noise(s)));
    if (s.scene == CaptureScene::kBoard && s.contrast && *s.contrast < kEvenBoard && s.saturated_fraction < 0.01 &&
        s.masked_fraction < kMostMasked)
        warn("not_a_board", s.name,
             fmt::format("its contrast is {:.3f}, so that there is hardly any speckle. Is it lamp light (\"flat\")?",
                         *s.contrast));
    if (s.masked_fraction > kMostMasked)
        warn("mask", s.name,
             fmt::format("its mask leaves {:.2g} % of the pixels: few statistics can be measured on so little",
                         100.0 * (1.0 - s.masked_fraction)));
}

// More light takes more time, at one f-number and in one scene.
void Warnings::exposures() {
    for (std::size_t i = 0; i < summaries_.size(); ++i)
        for (std::size_t j = 0; j < summaries_.size(); ++j) {
            const SequenceSummary &a = summaries_[i], &b = summaries_[j];
            if (a.scene != b.scene || a.scene == CaptureScene::kDark || a.moving != b.moving ||
                a.f_number != b.f_number || !a.exposure_ms || !b.exposure_ms || *a.exposure_ms >= 0.8 * *b.exposure_ms)
                continue;
            if (a.level_above_dark_dn > 1.2 * b.level_above_dark_dn && a.level_above_dark_dn > 10.0)
                warn(
                    "exposures", b.name,
                    fmt::format(
                        "was exposed for {:g} ms, longer than {} with {:g} ms, but is darker ({:.1f} against {:.1f} DN "
                        "above dark): were files or exposure_ms exchanged, or the light changed?",
                        *b.exposure_ms, a.name, *a.exposure_ms, b.level_above_dark_dn, a.level_above_dark_dn));
        }
}

void Warnings::motion() {
    std::vector<std::string> changing, staying;
    for (std::size_t i = 0; i < summaries_.size(); ++i) {
        const SequenceSummary &s = summaries_[i];
        if (!is_laser(s.scene) || s.frame_count < 2 || s.saturated_fraction > 0.2)
            continue;
        // Frames of several levels differ, whatever the speckle does.
        if (std::any_of(frame_changes_.begin(), frame_changes_.end(), [&](const SequenceChange &change) {
                return change.sequence == s.name && !change.level_drifts;
            }))
            continue;
        const FrameChange change =
            frame_change(capture_, i, s.level_above_dark_dn, noise_ > 0.0 ? noise_ : layout_.read_noise_dn);
        if (!change.measured)
            continue;
        const bool board = s.scene == CaptureScene::kBoard;
        if (!s.moving && change.successive > (board ? kNewBoard : kNewDots) &&
            change.successive > kIndependent * change.distant) {
            changing.push_back(s.name);
            warn("motion", s.name,
                 "\"motion\" is \"static\", but each frame has speckle of its own, as of a scene that moves "
                 "between frames: "
                 "did it move, or is \"file\" or \"motion\" that of another sequence?");
        }
        if (s.moving && change.successive < (board ? kSameBoard : kSameDots)) {
            staying.push_back(s.name);
            warn("motion", s.name,
                 "\"motion\" is \"moving\", but all frames show the same speckle, as of a scene at rest: did "
                 "it stand still, "
                 "or is \"file\" or \"motion\" that of another sequence?");
        }
    }
    if (!changing.empty() && !staying.empty())
        warn("motion", "",
             fmt::format("{} and {} look as if the files or the words of motion had been exchanged",
                         fmt::join(changing, ", "), fmt::join(staying, ", ")));
}

void Warnings::geometry() {
    const std::array<double, 2> &point = layout_.principal_point_px;
    if (point[0] < -0.5 || point[0] > layout_.width - 0.5 || point[1] < -0.5 || point[1] > layout_.height - 0.5)
        warn("principal_point", "",
             fmt::format(
                 "/camera/principal_point_px, ({:g}, {:g}), lies outside of the image of {} x {} pixels: that is right "
                 "only for a part cut from a larger image",
                 point[0], point[1], layout_.width, layout_.height));
    if (!layout_.dots)
        return;
    const auto &positions = layout_.dots->positions_px;
    std::vector<double> nearest;
    const std::size_t step = std::max<std::size_t>(1, positions.size() / kSampledDots);
    for (std::size_t i = 0; i < positions.size(); i += step) {
        double square = 1e300;
        for (std::size_t j = 0; j < positions.size(); ++j) {
            const double x = positions[j][0] - positions[i][0], y = positions[j][1] - positions[i][1];
            if (j != i && (x != 0.0 || y != 0.0))
                square = std::min(square, x * x + y * y);
        }
        if (square < 1e300)
            nearest.push_back(std::sqrt(square));
    }
    if (!nearest.empty()) {
        std::nth_element(nearest.begin(), nearest.begin() + std::ptrdiff_t(nearest.size() / 2), nearest.end());
        const double pitch = nearest[nearest.size() / 2];
        // Two Gaussians less than two deviations apart have one maximum.
        if (2.0 * layout_.dots->sigma_px > pitch)
            warn("merged_dots", "",
                 fmt::format(
                     "/dots/sigma_px is {:g}, but neighbouring dots are {:.3g} px apart, so that they merge into one "
                     "another: sigma_px is the width exp(-1/2) of a single dot, in pixels",
                     layout_.dots->sigma_px, pitch));
    }
    for (std::size_t i = 0; i < summaries_.size(); ++i) {
        if (summaries_[i].scene != CaptureScene::kDots || summaries_[i].level_above_dark_dn < 1.0)
            continue;
        dots_are_lit(i);
        border_dots_are_listed(i);
    }
}

// The light must be where the dots are.
void Warnings::dots_are_lit(std::size_t sequence) {
    std::vector<std::size_t> pixels;
    for (const auto &p : layout_.dots->positions_px)
        if (p[0] > 0.5 && p[0] < layout_.width - 1.5 && p[1] > 0.5 && p[1] < layout_.height - 1.5)
            pixels.push_back(static_cast<std::size_t>(std::lround(p[1])) * layout_.width +
                             static_cast<std::size_t>(std::lround(p[0])));
    const double fill = 6.283185307179586 * layout_.dots->sigma_px * layout_.dots->sigma_px *
                        static_cast<double>(pixels.size()) / static_cast<double>(layout_.pixel_count());
    if (pixels.size() < kLeastDots || fill > 0.5)
        return;
    const SequenceSummary &s = summaries_[sequence];
    const std::vector<std::uint8_t> &mask = layout_.sequences[sequence].mask;
    double sum = 0.0, count = 0.0;
    for (const std::size_t pixel : pixels)
        if (mask.empty() || mask[pixel] != 0) {
            sum += scans_[sequence].sums[pixel];
            count += s.frame_count;
        }
    if (count < static_cast<double>(kLeastDots * s.frame_count))
        return;
    const double ratio = (sum / count - dark_.level_dn) / s.level_above_dark_dn;
    // The peak of a Gaussian dot over the mean is 1 / fill. Blur, glare and ambient light leave a tenth of that
    // excess and less.
    if (ratio < 1.0 + 0.03 * (1.0 / fill - 1.0))
        warn("dots_elsewhere", s.name,
             fmt::format("the light is not where /dots/positions_px says: at the dots it is {:.2f} times "
                         "the mean, {:.1f} is "
                         "expected. Are x and y exchanged, or the positions of another image?",
                         ratio, 1.0 / fill));
}

// Dots whose centres lie near the border or outside of the image are easily left out of a list. Their light is a gap.
void Warnings::border_dots_are_listed(std::size_t sequence) {
    const std::uint32_t width = layout_.width, height = layout_.height;
    const double sigma = layout_.dots->sigma_px;
    const auto strip = static_cast<std::uint32_t>(std::ceil(2.0 * sigma));
    if (2 * strip >= std::min(width, height))
        return;
    const auto clamped = [](double at, std::uint32_t side) {
        return static_cast<std::uint32_t>(std::clamp(at, 0.0, static_cast<double>(side)));
    };
    std::vector<std::uint8_t> near_dot(layout_.pixel_count(), 0);
    const double reach = kDotReach * sigma;
    for (const auto &p : layout_.dots->positions_px)
        for (std::uint32_t y = clamped(p[1] - reach, height); y < clamped(p[1] + reach + 1.0, height); ++y)
            for (std::uint32_t x = clamped(p[0] - reach, width); x < clamped(p[0] + reach + 1.0, width); ++x)
                if (std::hypot(x - p[0], y - p[1]) <= reach)
                    near_dot[std::size_t{y} * width + x] = 1;
    const SequenceSummary &s = summaries_[sequence];
    const std::vector<std::uint8_t> &mask = layout_.sequences[sequence].mask;
    double light[2] = {0.0, 0.0}; // between the dots within the image, at its border
    std::size_t counts[2] = {0, 0};
    for (std::uint32_t y = 0; y < height; ++y)
        for (std::uint32_t x = 0; x < width; ++x) {
            const std::size_t pixel = std::size_t{y} * width + x;
            if (near_dot[pixel] || (!mask.empty() && mask[pixel] == 0))
                continue;
            const bool at_border = std::min(std::min(x, width - 1 - x), std::min(y, height - 1 - y)) < strip;
            light[at_border] += scans_[sequence].sums[pixel];
            ++counts[at_border];
        }
    if (std::min(counts[0], counts[1]) < kLeastBetween)
        return;
    for (int k = 0; k < 2; ++k)
        light[k] =
            (light[k] / (static_cast<double>(counts[k]) * s.frame_count) - dark_.level_dn) / s.level_above_dark_dn;
    if (light[1] - light[0] > kUnlistedLight)
        warn("unlisted_dots", s.name,
             fmt::format(
                 "along the image's border there is light without a dot in /dots/positions_px: {:.2f} times the "
                 "mean, elsewhere between the dots {:.2f} times. List all dots whose light reaches the image, also "
                 "those centred outside of it, or mask the border",
                 light[1], light[0]));
}

} // namespace

double measured_noise(const std::vector<SequenceSummary> &summaries) {
    double variance = 0.0, count = 0.0;
    for (const SequenceSummary &s : summaries)
        if (s.scene == CaptureScene::kDark && s.temporal_noise_dn && *s.temporal_noise_dn > 0.0) {
            variance += *s.temporal_noise_dn * *s.temporal_noise_dn;
            ++count;
        }
    return count > 0.0 ? std::sqrt(variance / count) : 0.0;
}

FrameChange frame_change(const Capture &capture, std::size_t sequence, double level_above_dark_dn, double noise_dn) {
    FrameChange result;
    const SequenceLayout &s = capture.layout.sequences[sequence];
    const std::size_t pixels = capture.layout.pixel_count();
    if (s.frame_count < 2)
        return result;
    const double noise_square = noise_dn * noise_dn;
    double spatial = 0.0;
    std::vector<std::uint16_t> rooms[2];
    // Half the mean square of the difference of two frames, the difference of their means taken out: the variance that
    // is new.
    const auto half_square = [&](std::uint32_t a, std::uint32_t b) {
        const std::uint16_t *first = frame_of(capture, sequence, a, rooms[0]);
        const std::uint16_t *second = frame_of(capture, sequence, b, rooms[1]);
        double n = 0.0, sum = 0.0, square = 0.0, mean = 0.0, frame_square = 0.0;
        for (std::size_t i = 0; i < pixels; ++i) {
            if (!s.mask.empty() && s.mask[i] == 0)
                continue;
            const double x = first[i], difference = double(second[i]) - x;
            ++n;
            sum += difference;
            square += difference * difference;
            mean += x;
            frame_square += x * x;
        }
        spatial += std::max(0.0, frame_square / n - (mean / n) * (mean / n));
        return 0.5 * (square / n - (sum / n) * (sum / n));
    };
    const auto mean_over_pairs = [&](std::uint32_t lag) {
        const std::uint32_t all = s.frame_count - lag, pairs = std::min(all, kMostPairs);
        double sum = 0.0;
        for (std::uint32_t p = 0; p < pairs; ++p) {
            const auto frame = static_cast<std::uint32_t>(std::uint64_t{p} * all / pairs);
            sum += half_square(frame, frame + lag) / pairs;
        }
        spatial /= pairs;
        return sum;
    };
    const double successive = mean_over_pairs(1) - noise_square;
    const double speckle = spatial - noise_square;
    if (speckle < 9.0 * noise_square || std::sqrt(std::max(0.0, speckle)) < kHardlySpeckle * level_above_dark_dn ||
        speckle <= 1.0)
        return result;
    result.measured = true;
    result.successive = successive / speckle;
    result.distant =
        s.frame_count >= 4 ? (mean_over_pairs(s.frame_count / 2) - noise_square) / speckle : result.successive;
    return result;
}

std::vector<CaptureWarning> metadata_warnings(const Capture &capture, const std::vector<SequenceScan> &scans,
                                              const std::vector<SequenceSummary> &summaries, const DarkLevel &dark,
                                              const std::vector<SequenceChange> &frame_changes) {
    return Warnings(capture, scans, summaries, dark, frame_changes).all();
}

} // namespace clsp

#include "capture/transients.hpp"

#include <algorithm>
#include <cmath>

namespace clsp {
namespace {

constexpr std::uint32_t kLeastTransientFrames = 4, kFewTransientFrames = 8;
constexpr std::size_t kLeastJudged = 100;
constexpr double kJumpsApart = 8.0,
                 kFarApart = 24.0;          // deviations; in few frames a pixel that jumps at random may do so once
constexpr double kChanceOfTransient = 1e-6; // of one in a sequence
constexpr double kTail = 0.01;              // of the pixels, that tell how the most deviant ones are spread
constexpr double kRoundedScale = 0.3;       // of the codes' distance: the least deviation
constexpr std::size_t kOfLevel = 256;       // pixels that tell its usual noise
constexpr std::size_t kLevelSamples = 20000;
constexpr double kLeastJump = 0.7;      // of the limit
constexpr double kRestlessBeside = 2.0; // times the usual variance
// In how many pixels one jumps in one frame alone that jumps at random, times the frames.
constexpr double kJumps = 12.0;

// A pixel without its most deviant frame.
struct Rest {
    double mean = 0.0, variance = 0.0;
    PixelEnds::End end;
    double away() const { return std::abs(end.code - mean); }
};

Rest without(PixelEnds::End end, double sum, double square, double frames) {
    const double n = frames - 1.0, mean = (sum - end.code) / n;
    return {mean, std::max(0.0, (square - double(end.code) * end.code - n * mean * mean) / (n - 1.0)), end};
}

template <typename T> double quantile_of(std::vector<T> &values, double part) {
    const auto at = values.begin() + std::ptrdiff_t(std::min(part * double(values.size()), double(values.size() - 1)));
    std::nth_element(values.begin(), at, values.end());
    return double(*at);
}

} // namespace

void PixelEnds::add(std::uint32_t frame, std::size_t first, const std::uint16_t *codes, std::size_t count) {
    const auto now = static_cast<std::uint16_t>(frame);
    std::int16_t *most = most_.data() + first, *least = least_.data() + first;
    std::uint16_t *most_at = most_at_.data() + first, *least_at = least_at_.data() + first;
    for (std::size_t i = 0; i < count; ++i) {
        const auto code = static_cast<std::int16_t>(codes[i] ^ kSign);
        most_at[i] = code > most[i] ? now : most_at[i];
        most[i] = std::max(code, most[i]);
        least_at[i] = code < least[i] ? now : least_at[i];
        least[i] = std::min(code, least[i]);
    }
}

std::vector<Transient> find_transients(const PixelEnds &ends, const std::vector<std::uint32_t> &sums,
                                       const std::vector<std::uint64_t> &squares, std::uint32_t frames,
                                       const std::uint8_t *mask, std::uint32_t step_dn) {
    if (frames < kLeastTransientFrames)
        return {};
    const auto rest_of = [&](std::size_t i) {
        const double sum = sums[i], square = double(squares[i]);
        const Rest above = without(ends.most(i), sum, square, frames),
                   below = without(ends.least(i), sum, square, frames);
        return above.away() > below.away() ? above : below;
    };
    const std::size_t all =
        mask ? sums.size() - std::size_t(std::count(mask, mask + sums.size(), std::uint8_t{0})) : sums.size();
    if (all < kLeastJudged)
        return {};
    std::vector<Rest> sample; // of all columns
    const std::size_t step = all / kLevelSamples + 1;
    for (std::size_t i = 0, k = 0; i < sums.size(); ++i)
        if ((!mask || mask[i] != 0) && k++ % step == 0)
            sample.push_back(rest_of(i));
    // What noise is usual at a level, of groups of pixels of similar level: light has noise of its own. Beyond the
    // middle of the brightest group it grows with the level.
    std::sort(sample.begin(), sample.end(), [](const Rest &a, const Rest &b) { return a.mean < b.mean; });
    struct Level {
        double least = 0.0, middle = 0.0, variance = 0.0;
    };
    std::vector<Level> levels;
    const std::size_t groups = std::max<std::size_t>(1, sample.size() / kOfLevel);
    double usual = std::pow(kRoundedScale * step_dn, 2.0);
    for (std::size_t k = 0; k < groups; ++k) {
        const std::size_t from = k * sample.size() / groups, to = (k + 1) * sample.size() / groups;
        std::vector<double> variances;
        for (std::size_t s = from; s < to; ++s)
            variances.push_back(sample[s].variance);
        usual = std::max(usual, quantile_of(variances, 0.5));
        levels.push_back({sample[from].mean, sample[(from + to) / 2].mean, usual});
    }
    const auto usual_of = [&](const Rest &rest) {
        const auto next = std::upper_bound(levels.begin() + 1, levels.end(), rest.mean,
                                           [](double mean, const Level &level) { return mean < level.least; });
        const Level &level = *(next - 1);
        return level.variance *
               (next == levels.end() && level.middle > 0.0 ? std::max(1.0, rest.mean / level.middle) : 1.0);
    };
    const auto deviation_of = [&](const Rest &rest) {
        return rest.away() / std::sqrt(std::max(rest.variance, usual_of(rest)));
    };
    std::vector<double> deviations;
    for (const Rest &rest : sample)
        deviations.push_back(deviation_of(rest));
    // The tail of a normal law: the squares are spread as exponentials.
    const double begin = std::pow(quantile_of(deviations, 1.0 - kTail), 2.0),
                 middle = std::pow(quantile_of(deviations, 1.0 - 0.5 * kTail), 2.0);
    const double limit = std::max(
        frames < kFewTransientFrames ? kFarApart : kJumpsApart,
        std::sqrt(begin + (middle - begin) / std::log(2.0) * std::log(kTail * double(all) / kChanceOfTransient)));

    std::vector<Transient> found;
    const double degrees = frames - 2.0, jump = 0.1 * limit * limit + kJumpsApart * std::sqrt(2.0 * degrees);
    const double near = kLeastJump * limit * std::sqrt(levels[0].variance); // nothing jumps between such ends
    std::size_t jumps = 0;                                                  // pixels that jump in another frame, too
    for (std::size_t i = 0; i < sums.size(); ++i) {
        if ((mask && mask[i] == 0) || ends.most(i).code - ends.least(i).code < near)
            continue;
        const Rest rest = rest_of(i);
        if (deviation_of(rest) > limit)
            found.push_back({static_cast<std::uint32_t>(i), rest.end.frame, rest.end.code, rest.mean});
        const double noise = usual_of(rest);
        jumps += rest.variance > kRestlessBeside * noise && (rest.variance - noise) * degrees > jump * noise;
    }
    return kJumps * double(jumps) > double(frames) * double(found.size()) ? std::vector<Transient>() : found;
}

} // namespace clsp

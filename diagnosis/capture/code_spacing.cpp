#include "capture/code_spacing.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace clsp {
namespace {

constexpr double kRare = 0.005; // part of all codes that may lie anywhere: single wild pixels, embedded data
constexpr double kChanceBesideGaps = 0.1;
constexpr double kNoiseReach = 3.0;   // deviations of the noise
constexpr double kDoubled = 1.5; // how much more often than both neighbours
constexpr std::size_t kLeastDoubled = 3;
constexpr double kCountDeviations = 6.0; // of a count: one in 1e9

// Codes, counted in steps from the first one: those that a distance holds, or, of dense codes, one for each.
// step: the mean of so many single steps; of dense codes neither counts.
std::optional<CodeLattice> fit(const std::vector<std::uint16_t> &codes, double step, double single_steps, bool dense) {
    const double first = codes.front(), estimated = step * single_steps;
    std::vector<double> counts(codes.size());
    for (std::size_t i = 1; i < codes.size(); ++i) {
        const double gap = double(codes[i]) - codes[i - 1];
        counts[i] = counts[i - 1] + (dense ? 1.0 : std::max(1.0, std::round(gap / step)));
        if (!dense)
            step = (estimated + codes[i] - first) / (single_steps + counts[i]); // the farther, the better known
    }
    // The step that leaves least between the extremes, which is convex in it: lines of so many whole numbers differ by
    // less than one in each.
    double least = 0.0, most = 0.0;
    const auto width = [&](double of) {
        least = std::numeric_limits<double>::infinity();
        most = -least;
        for (std::size_t i = 0; i < codes.size(); ++i) {
            const double rest = codes[i] - of * counts[i];
            least = std::min(least, rest);
            most = std::max(most, rest);
        }
        return most - least;
    };
    const double middle = (codes.back() - first) / counts.back(), reach = 2.0 / counts.back();
    double low = middle - reach, high = middle + reach;
    for (int i = 0; i < 60; ++i) {
        const double a = low + (high - low) / 3.0, b = high - (high - low) / 3.0;
        (width(a) < width(b) ? high : low) = width(a) < width(b) ? b : a;
    }
    step = 0.5 * (low + high);
    // Whole steps are told as such where they fit as well.
    if (const double whole = std::round(step); width(whole) <= width(step) + 1e-9)
        step = whole;
    // Rounding, up, down or to the nearest, leaves less than one.
    if (width(step) > 1.0 + 1e-6)
        return std::nullopt;
    CodeLattice lattice{step, 0.5 * (least + most), codes.size(), codes.front(), codes.back()};
    lattice.offset = nearest_offset(lattice);
    return lattice;
}

// Whether codes that are missing were brought to a neighbour, which then occurs about twice as often as a density that
// noise blurs lets it: a converter or a table does so, and no gain. Of all missing codes together.
bool brought_to_neighbours(const std::vector<std::uint64_t> &histogram, const std::vector<std::uint16_t> &missing,
                           double noise_dn) {
    const double curved = std::exp(1.0 / (noise_dn * noise_dn)); // at a third of three steps on a Gaussian
    for (const int side : {-1, 1}) {
        double count = 0.0, usual = 0.0;
        for (const std::uint16_t code : missing) {
            const auto at = [&](int steps) {
                const auto c = std::ptrdiff_t(code) + side * steps;
                return c < 0 || c >= std::ptrdiff_t(histogram.size()) ? 0.0 : double(histogram[std::size_t(c)]);
            };
            const double far = at(2), across = at(-1);
            if (far <= 0.0 || across <= 0.0)
                continue;
            count += at(1);
            usual += std::exp((2.0 * std::log(far) + std::log(across)) / 3.0);
        }
        const double most = kDoubled * curved * usual;
        if (count - most > kCountDeviations * std::sqrt(count + kDoubled * most))
            return true;
    }
    return false;
}

} // namespace

double nearest_offset(const CodeLattice &lattice) {
    return lattice.offset - lattice.step * std::ceil(lattice.offset / lattice.step - 0.5);
}

std::vector<std::uint16_t> usual_codes(const std::vector<std::uint64_t> &histogram) {
    std::vector<std::uint16_t> codes;
    std::uint64_t all = 0;
    for (std::size_t c = 0; c < histogram.size(); ++c)
        if (histogram[c] > 0) {
            codes.push_back(static_cast<std::uint16_t>(c));
            all += histogram[c];
        }
    std::vector<std::uint16_t> by_count = codes;
    std::stable_sort(by_count.begin(), by_count.end(),
                     [&](std::uint16_t a, std::uint16_t b) { return histogram[a] < histogram[b]; });
    std::uint64_t left_out = 0, least = 0; // counts
    for (const std::uint16_t code : by_count) {
        left_out += histogram[code];
        if (double(left_out) > kRare * double(all))
            break;
        least = histogram[code] + 1;
    }
    codes.erase(std::remove_if(codes.begin(), codes.end(), [&](std::uint16_t code) { return histogram[code] < least; }),
                codes.end());
    return codes;
}

std::uint32_t least_step(const std::vector<std::uint16_t> &codes) {
    std::uint32_t least = 65536;
    for (std::size_t i = 1; i < codes.size(); ++i)
        least = std::min(least, std::uint32_t{codes[i]} - codes[i - 1]);
    return least > 65535 ? 1 : least;
}

std::optional<CodeLattice> find_lattice(const std::vector<std::uint16_t> &codes) {
    if (codes.size() < 3)
        return std::nullopt;
    std::vector<double> gaps;
    for (std::size_t i = 1; i < codes.size(); ++i)
        gaps.push_back(double(codes[i]) - codes[i - 1]);
    const double nearest = *std::min_element(gaps.begin(), gaps.end());
    if (nearest < 2.0)
        return std::nullopt;
    double sum = 0.0, count = 0.0; // of single steps, which rounding makes one of two neighbouring numbers
    for (const double gap : gaps)
        if (gap <= nearest + 1.0) {
            sum += gap;
            ++count;
        }
    const auto lattice = fit(codes, sum / count, count, false);
    if (!lattice || lattice->step < 2.0 - 1e-9)
        return std::nullopt;
    // Lines of whole numbers through n columns: n^3 and fewer.
    const double columns = (lattice->last - lattice->first) / lattice->step + 1.0;
    const double log_chance = 3.0 * std::log(columns) - (double(codes.size()) - 2.0) * std::log(lattice->step);
    return log_chance < std::log(kChanceOfFinding) ? lattice : std::nullopt;
}

unsigned common_shift(const std::vector<std::uint16_t> &codes, bool gaps) {
    unsigned bits = 0, shift = 0;
    for (const std::uint16_t code : codes)
        bits |= code;
    while (bits != 0 && (bits >> shift & 1u) == 0)
        ++shift;
    // The first code is a multiple of something; that the others are, too, is one in 2^shift for each. Gaps are beyond
    // chance themselves.
    const double most = gaps ? kChanceBesideGaps : kChanceOfFinding;
    while (shift > 0 && std::ldexp(1.0, -int(shift * (codes.size() - 1))) > most)
        --shift;
    return shift;
}

CodePile find_pile(const std::vector<std::uint64_t> &histogram) {
    constexpr std::size_t kBlocks = 16, kWidest = 256; // blocks of codes below, and codes in each
    std::size_t last = histogram.size();
    while (last > 0 && histogram[last - 1] == 0)
        --last;
    if (last-- == 0)
        return {};
    const double count = double(histogram[last]);
    for (std::size_t width = 1; width <= kWidest && last >= kBlocks * width; width *= 2) {
        std::size_t occupied = 0;
        double most = 0.0;
        for (std::size_t block = 1; block <= kBlocks; ++block) {
            const auto first = histogram.begin() + std::ptrdiff_t(last - block * width);
            const double sum = std::accumulate(first, first + std::ptrdiff_t(width), 0.0);
            occupied += sum > 0.0 ? 1 : 0;
            most = std::max(most, sum);
        }
        if (2 * occupied < kBlocks)
            continue; // light is rarer there
        most *= kDoubled;
        if (count - most > kCountDeviations * std::sqrt(count + kDoubled * most))
            return {static_cast<std::uint16_t>(last), histogram[last]};
        return {};
    }
    return {};
}

CodeGaps find_gaps(const std::vector<std::uint64_t> &histogram, double noise_dn) {
    CodeGaps result;
    if (noise_dn <= 0.0)
        return result;
    const double least = -std::log(kChanceOfFinding / double(histogram.size())); // of the expected number of a code
    const auto factor = [&](double distance) {
        return std::exp(-kNoiseReach * distance / noise_dn - 0.5 * distance * distance / (noise_dn * noise_dn));
    };
    std::vector<std::size_t> below(histogram.size()); // the nearest code that occurs
    std::size_t last = histogram.size();
    for (std::size_t c = 0; c < histogram.size(); ++c) {
        below[c] = last;
        if (histogram[c] > 0)
            last = c;
    }
    std::size_t above = histogram.size();
    for (std::size_t c = histogram.size(); c-- > 0;) {
        const std::size_t low = below[c], high = above;
        if (histogram[c] > 0)
            above = c;
        if (low == histogram.size() || high == histogram.size())
            continue;
        const double counts[2] = {double(histogram[low]), double(histogram[high])};
        const double more = std::max(counts[0], counts[1]);
        if (std::min(counts[0], counts[1]) < least ||
            std::max(counts[0] * factor(double(c - low)), counts[1] * factor(double(high - c))) < least)
            continue;
        ++result.judged;
        result.last = std::max(result.last, std::uint32_t(c));
        result.first = std::uint32_t(c);
        const double count = double(histogram[c]);
        if (histogram[c] == 0) {
            result.missing.push_back(static_cast<std::uint16_t>(c));
            continue;
        }
        result.occurring.push_back(static_cast<std::uint16_t>(c));
        // A peak of a density that noise blurs rises above its neighbours by no more than a Gaussian does.
        const double peak = kDoubled * more * std::exp(0.5 / (noise_dn * noise_dn));
        if (high - low == 2 && count - peak > kCountDeviations * std::sqrt(count + kDoubled * peak))
            result.doubled.push_back(static_cast<std::uint16_t>(c));
    }
    for (auto *codes : {&result.missing, &result.doubled, &result.occurring})
        std::reverse(codes->begin(), codes->end());
    if (result.doubled.size() < kLeastDoubled)
        result.doubled.clear();
    if (!result.missing.empty() && result.occurring.size() > 2)
        if (const auto lattice = fit(result.occurring, 0.0, 0.0, true);
            lattice && lattice->step < 2.0 && !brought_to_neighbours(histogram, result.missing, noise_dn))
            result.lattice = lattice;
    return result;
}

} // namespace clsp

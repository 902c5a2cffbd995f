#include "capture/code_warnings.hpp"

#include "capture/capture_validation.hpp"
#include "io/byte_order.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <optional>
#include <set>
#include <string>

namespace clsp {
namespace {

constexpr double kOnLattice = 0.98; // of all codes

// A lattice that few codes told, by those of all sequences; nothing where it is not theirs.
std::optional<CodeLattice> refined(const CodeLattice &lattice, const std::vector<std::uint16_t> &all) {
    constexpr std::size_t kMostCodes = 2000;
    std::vector<std::uint16_t> codes;
    for (std::size_t k = 0; k < all.size(); k += all.size() / kMostCodes + 1)
        codes.push_back(all[k]);
    if (codes.empty())
        return std::nullopt;
    // Its codes leave the step open by one part in their range; the range of all codes is to be right by a fifth of
    // one.
    const double length = lattice.last - lattice.first, range = double(codes.back()) - codes.front() + length;
    const double centre = 0.5 * (double(lattice.first) + lattice.last);
    const double at_centre = std::round((centre - lattice.offset) / lattice.step);
    std::size_t most = 0;
    double least = 0.0;
    CodeLattice best = lattice;
    const int steps = int(std::min(1e5, 5.0 * range / length)) + 1;
    for (int i = -steps; i <= steps; ++i) {
        const double step = lattice.step * (1.0 + i / (double(steps) * length));
        // The middle of its codes stays.
        for (double shift = -0.5; shift < 0.55; shift += 0.1) {
            const double offset = lattice.offset + at_centre * (lattice.step - step) + shift;
            std::size_t count = 0;
            double square = 0.0;
            for (const std::uint16_t code : codes) {
                const double place = (code - offset) / step, distance = std::abs(place - std::round(place)) * step;
                count += distance <= 0.55 ? 1 : 0; // half a code, and half a step of the offset
                square += distance * distance;
            }
            // Steps near to one have all codes near: the nearest tell.
            if (count > most || (count == most && square < least)) {
                most = count;
                least = square;
                best.step = step;
                best.offset = offset;
            }
        }
    }
    if (double(most) < kOnLattice * double(codes.size()))
        return std::nullopt;
    best.offset = nearest_offset(best);
    return best;
}

// What is taken off the codes before they are divided: nothing where that leaves each nearest to its own number.
double taken_off(const CodeLattice &lattice) {
    return lattice.step >= 2.0 && std::abs(lattice.offset) < 0.5 ? 0.0 : std::round(1e3 * lattice.offset) / 1e3;
}

double number_of(std::uint16_t code, const CodeLattice &lattice) {
    return std::nearbyint((code - taken_off(lattice)) / lattice.step);
}

// Whether a lattice brings two codes that were neighbours, with a missing code between them or none, to neighbours:
// each code that occurs has a number of its own then, and none is left out.
bool takes_back(const CodeGaps &gaps, const CodeLattice &lattice) {
    for (std::size_t k = 1; k < gaps.occurring.size(); ++k) {
        const std::uint16_t low = gaps.occurring[k - 1], high = gaps.occurring[k];
        const auto between = std::lower_bound(gaps.missing.begin(), gaps.missing.end(), low);
        const auto missing = std::lower_bound(between, gaps.missing.end(), high) - between;
        if (high - low - 1 == missing && number_of(high, lattice) != number_of(low, lattice) + 1.0)
            return false;
    }
    return true;
}

// Where all sequences end, if light is clipped there, and where they begin.
struct CodeRange {
    std::uint32_t least = 65535, largest = 0; // that occur
    std::uint16_t clipped = 0;                // 0: nothing is

    explicit CodeRange(const std::vector<SequenceScan> &scans) {
        for (const SequenceScan &scan : scans) {
            least = std::min(least, scan.minimum);
            largest = std::max(largest, scan.codes.empty() ? 0 : scan.maximum);
            clipped = std::max(clipped, scan.pile.count > 0 ? scan.pile.code : std::uint16_t{0});
        }
    }
};

bool keeps_apart(const std::vector<std::uint16_t> &codes, const CodeLattice &lattice) {
    for (std::size_t k = 1; k < codes.size(); ++k)
        if (codes[k] - codes[k - 1] == 1 && number_of(codes[k], lattice) != number_of(codes[k - 1], lattice) + 1.0)
            return false;
    return true;
}

// A lattice of a step between one and two, without an offset if that does; nothing if it does not take the codes back.
// codes: of all sequences.
std::optional<CodeLattice> told_apart(CodeLattice lattice, const std::vector<SequenceScan> &scans,
                                      const std::vector<std::uint16_t> &codes) {
    for (const double offset : {0.0, lattice.offset}) {
        lattice.offset = offset;
        if (keeps_apart(codes, lattice) && std::all_of(scans.begin(), scans.end(), [&](const SequenceScan &scan) {
                return takes_back(scan.gaps, lattice);
            }))
            return lattice;
    }
    return std::nullopt;
}

// What the codes tell of the dark, else what capture.json does.
struct Camera {
    const CaptureLayout &layout;
    double black_level_dn, noise_dn;

    Camera(const CaptureLayout &of, const DarkLevel &dark, double measured_noise_dn)
        : layout(of), black_level_dn(dark.level_dn), noise_dn(measured_noise_dn) {}

    // Once the codes are taken back.
    double black_level(const CodeLattice &lattice) const {
        return std::max(0.0, std::round(1e3 * (black_level_dn - taken_off(lattice)) / lattice.step) / 1e3);
    }
    double read_noise(const CodeLattice &lattice) const {
        const auto rounded = [](double noise) { return std::round(1e3 * noise) / 1e3; };
        if (noise_dn <= 0.0)
            return rounded(layout.read_noise_dn / lattice.step);
        // What the steps add where they are no whole numbers, and what the converter's rounding does.
        const bool whole = lattice.step == std::round(lattice.step);
        const double square = (noise_dn * noise_dn - (whole ? 0.0 : 1.0 / 12.0)) / (lattice.step * lattice.step);
        return rounded(std::sqrt(std::max(0.0, square - 1.0 / 12.0)));
    }
};

// A lattice tells numbers but for a constant. Where light is clipped below the largest code that is stored, the number
// is the converter's top code: the nearest 2^n - 1 that leaves no number below 0. At the largest code, storage clips.
CodeLattice with_top_code(CodeLattice lattice, const CodeRange &range, const Camera &camera) {
    // Cameras amplify about the black level, or near it, by a part of it; and it is a small part of the range.
    constexpr double kNearBlack = 0.125, kMostBlack = 0.125;
    if (range.clipped == 0 || range.clipped >= camera.layout.maximum_code())
        return lattice;
    const double number = number_of(range.clipped, lattice), least = number_of(std::uint16_t(range.least), lattice);
    std::optional<double> best;
    for (unsigned bits = kMinCaptureBits; bits <= kMaxCaptureBits; ++bits) {
        const double shift = std::ldexp(1.0, int(bits)) - 1.0 - number;
        if (least + shift >= 0.0 && (!best || std::abs(shift) < std::abs(*best)))
            best = shift;
    }
    if (!best)
        return lattice;
    const double offset = lattice.offset - lattice.step * *best;
    // A gain alone explains numbers from 0 on, and a full well ends below the top code. Another offset is then that of
    // a gain about the black level.
    const double black = (camera.black_level_dn - offset) / lattice.step, stays = offset / (1.0 - lattice.step);
    const bool about_black = std::abs(stays - black) <= kNearBlack * black && black <= kMostBlack * (number + *best);
    if (taken_off(lattice) != 0.0 || about_black)
        lattice.offset = offset;
    return lattice;
}

std::string upper_bits(const Camera &camera, unsigned shift) {
    const CaptureLayout &layout = camera.layout;
    const CodeLattice lattice{std::ldexp(1.0, int(shift)), 0.0, 0, 0, 0};
    const unsigned bits = layout.bits - shift;
    const std::string numbers = fmt::format("{}, black_level_dn to {:.6g} and read_noise_dn to {:.6g}", bits,
                                            camera.black_level(lattice), camera.read_noise(lattice));
    std::string text =
        fmt::format("all codes are multiples of {}: the converter has {} effective bits", 1u << shift, bits);
    if (bits < kMinCaptureBits)
        return text;
    if (layout.bits == kMaxCaptureBits)
        return text +
               fmt::format(", or the codes stand in the upper bits of their words. Then set /camera/msb_aligned to "
                           "true (or divide the codes by {}), bits to {}",
                           1u << shift, numbers);
    return text +
           fmt::format(
               ". Divide the codes by {} (leave them where /camera/msb_aligned is true already), and set bits to {}",
               1u << shift, numbers);
}

// The converter's bits: those whose full scale the step brings to the words', else the least that hold what occurs. A
// top code where light is clipped is no doubt.
unsigned bits_before(const CaptureLayout &layout, const CodeLattice &lattice, const CodeRange &range) {
    for (unsigned bits = kMinCaptureBits; bits <= layout.bits && range.clipped == 0; ++bits)
        if (std::abs(lattice.step * (std::ldexp(1.0, int(bits)) - 1.0) - layout.maximum_code()) < lattice.step)
            return bits;
    unsigned bits = kMinCaptureBits;
    while (bits < layout.bits && (range.largest - lattice.offset) / lattice.step > std::ldexp(1.0, int(bits)) - 0.5)
        ++bits;
    return bits;
}

// How to come back to the converter's codes.
std::string back(const Camera &camera, const CodeLattice &told, const CodeRange &range) {
    const CodeLattice lattice = with_top_code(told, range, camera);
    const double offset = taken_off(lattice);
    const std::string codes = offset == 0.0  ? "codes"
                              : offset < 0.0 ? fmt::format("(codes + {:.5g})", -offset)
                                             : fmt::format("(codes - {:.5g})", offset);
    return fmt::format("record without digital gain and scaling, or take it back: numpy.rint({} / "
                       "{:.6g}).astype(numpy.uint16), bits {}, black_level_dn {:.6g} and read_noise_dn {:.6g}",
                       codes, lattice.step, bits_before(camera.layout, lattice, range), camera.black_level(lattice),
                       camera.read_noise(lattice));
}

std::string stretched(const Camera &camera, const CodeLattice &lattice, const CodeRange &range) {
    const double step = lattice.step;
    std::string share = fmt::format("{:.0f} of {:.0f} codes", step - 1.0, step);
    if (std::abs(step - std::round(step)) > 0.1)
        share = fmt::format("{:.0f} of 100 codes", 100.0 * (1.0 - 1.0 / step));
    return fmt::format("{} never occur: from {} to {} codes are {:.5g} apart, so that codes of fewer bits were "
                       "stretched, most likely of {} bits; {}",
                       share, lattice.first, lattice.last, step,
                       bits_before(camera.layout, with_top_code(lattice, range, camera), range),
                       back(camera, lattice, range));
}

std::string gaps_text(const Camera &camera, const CodeGaps &gaps, const CodeRange &range) {
    const auto examples = [](const std::vector<std::uint16_t> &codes) {
        constexpr std::size_t kMost = 4;
        std::string text;
        for (std::size_t i = 0; i < std::min(codes.size(), kMost); ++i)
            text += fmt::format("{}{}", i ? ", " : "", codes[i]);
        return codes.size() > kMost ? text + " ..." : text;
    };
    if (gaps.lattice)
        return fmt::format(
            "{} of {} codes from {} to {} never occur ({}), each {:.4g}th one is left: a digital gain of "
            "{:.4g} stretched the codes; {}",
            gaps.missing.size(), gaps.judged, gaps.first, gaps.last, examples(gaps.missing), gaps.lattice->step,
            gaps.lattice->step, back(camera, *gaps.lattice, range));
    if (!gaps.missing.empty())
        return fmt::format("{} of {} codes from {} to {} never occur ({}), though their neighbours do, often: the "
                           "converter misses them, or the codes went through a table (gamma), a digital gain or lossy "
                           "compression; record raw codes",
                           gaps.missing.size(), gaps.judged, gaps.first, gaps.last, examples(gaps.missing));
    return fmt::format(
        "{} of {} codes from {} to {} occur about twice as often as their neighbours ({}): a digital gain "
        "below 1, or a table, brought several codes to one; record raw codes",
        gaps.doubled.size(), gaps.judged, gaps.first, gaps.last, examples(gaps.doubled));
}

// Of codes that are all apart from each other: multiples of a power of two, or stretched otherwise.
std::optional<CaptureWarning> on_lattice(const Camera &camera, const std::string &sequence,
                                         const std::vector<std::uint16_t> &codes, bool gaps, const CodeRange &range) {
    const unsigned shift = common_shift(codes, gaps);
    const auto lattice = find_lattice(codes);
    // Multiples of a number are on that of twice the number, too, with half of it as an offset. Words of 16 bits have
    // upper bits; in others a top code that is none of so many bits is that of a gain about another code than 0.
    const bool whole = !(lattice && lattice->step > std::ldexp(1.5, int(shift)));
    const bool ends_elsewhere = camera.layout.bits < kMaxCaptureBits && lattice &&
                                with_top_code(*lattice, range, camera).offset != lattice->offset;
    if (shift > 0 && whole && !ends_elsewhere)
        return CaptureWarning{sequence, upper_bits(camera, shift), "upper_bits"};
    if (!lattice)
        return std::nullopt;
    // Codes at the ends of steps, not at their beginnings, would be one too many.
    CodeLattice told = *lattice;
    const double last = (camera.layout.maximum_code() - told.offset) / told.step;
    if (told.offset < 0.0 && std::abs(last - std::exp2(std::round(std::log2(last)))) < 0.01)
        told.offset += told.step;
    return CaptureWarning{sequence, stretched(camera, told, range), "stretched_codes"};
}

// Sequences that are clipped at a code below the top one.
std::optional<CaptureWarning> clipped_below_top(const CaptureLayout &layout, const std::vector<SequenceScan> &scans) {
    std::vector<std::string> names;
    std::size_t most = scans.size();
    const auto part = [&](std::size_t s) {
        return double(scans[s].pile.count) / (double(scans[s].pixels) * double(scans[s].frames.size()));
    };
    for (std::size_t i = 0; i < scans.size(); ++i)
        if (scans[i].pile.count > 0 && scans[i].pile.code < layout.maximum_code()) {
            names.push_back(layout.sequences[i].name);
            if (most == scans.size() || part(i) > part(most))
                most = i;
        }
    if (most == scans.size())
        return std::nullopt;
    const bool one = names.size() == 1;
    return CaptureWarning{
        one ? names.front() : "",
        (one ? "" : fmt::format("in {}, of which {}: ", fmt::join(names, ", "), layout.sequences[most].name)) +
            fmt::format("{:.2g} % of the pixels have the code {}, far more than any just below, and none has a larger "
                        "one: codes are clipped there, below the top code, {}. Expose less, so that none reaches it: "
                        "only pixels at the top code are known as saturated",
                        100.0 * part(most), scans[most].pile.code, layout.maximum_code()),
        "clipped_below_top"};
}

} // namespace

std::optional<CaptureWarning> swapped_bytes(const CaptureLayout &layout, const std::vector<SequenceScan> &scans) {
    std::vector<image_io::detail::WholeNumbers> words(scans.size(), image_io::detail::WholeNumbers(2));
    for (std::size_t i = 0; i < scans.size(); ++i)
        for (const std::uint16_t code : scans[i].codes)
            words[i].add(code);
    const image_io::detail::SwappedWords swapped = image_io::detail::swapped_among(words);
    if (swapped.which.empty())
        return std::nullopt;
    std::string names;
    for (const std::size_t i : swapped.which)
        names += (names.empty() ? "" : ", ") + layout.sequences[i].name;
    const bool one = swapped.which.size() == 1, of_some = !one && swapped.which.size() < scans.size();
    return CaptureWarning{one ? names : "",
                          fmt::format("the codes{} {}. If so, save codes.byteswap() and set bits to {}; what "
                                      "`clspeckle capture init` found in them it finds again with --force",
                                      of_some ? " of " + names : "", image_io::detail::told_swapped(swapped.bits),
                                      swapped.bits),
                          kSwappedBytes};
}

std::vector<CaptureWarning> code_warnings(const CaptureLayout &layout, const std::vector<SequenceScan> &scans,
                                          const std::vector<SequenceSummary> &summaries, const DarkLevel &dark,
                                          double noise_dn) {
    const Camera camera(layout, dark, noise_dn);
    std::vector<CaptureWarning> warnings;
    std::set<std::uint16_t> together;
    const CodeRange range(scans);
    std::uint32_t largest_of_all = 0;
    bool lit = false, varied = false; // codes that are all the same say nothing
    for (std::size_t i = 0; i < scans.size(); ++i) {
        together.insert(scans[i].codes.begin(), scans[i].codes.end());
        largest_of_all = std::max(largest_of_all, std::uint32_t{scans[i].largest});
        lit = lit || (summaries[i].scene != CaptureScene::kDark && summaries[i].level_above_dark_dn > 0.0);
        varied = varied || summaries[i].minimum != summaries[i].maximum;
    }
    const std::vector<std::uint16_t> all(together.begin(), together.end());
    if (auto warning = on_lattice(camera, "", all, false, range)) {
        const std::uint32_t end = std::uint32_t{range.clipped} >> common_shift(all);
        const bool clips_elsewhere = warning->kind == "upper_bits" && (end & (end + 1)) != 0;
        warnings.push_back(std::move(*warning));
        if (auto clipped = clipped_below_top(layout, scans); clipped && clips_elsewhere)
            warnings.push_back(std::move(*clipped));
        return warnings;
    }
    // What several sequences show is told once, with the numbers of the one that shows most. Few codes may be multiples
    // of a number by the same table that others miss codes by.
    std::vector<CodeGaps> gaps;
    for (const SequenceScan &scan : scans) {
        gaps.push_back(scan.gaps);
        auto &lattice = gaps.back().lattice;
        if (lattice)
            lattice = refined(*lattice, all);
        if (lattice)
            lattice = told_apart(*lattice, scans, all);
    }
    std::vector<std::string> names;
    std::vector<CaptureWarning> alone;
    std::size_t most = scans.size();
    for (std::size_t i = 0; i < scans.size(); ++i) {
        const std::string &name = summaries[i].name;
        if (auto warning = on_lattice(camera, name, scans[i].codes, !gaps[i].missing.empty(), range)) {
            names.push_back(name);
            alone.push_back(std::move(*warning));
        } else if (!gaps[i].missing.empty() || !gaps[i].doubled.empty()) {
            names.push_back(name);
            const auto rank = [&](std::size_t s) {
                return std::pair(gaps[s].lattice.has_value(), gaps[s].missing.size() + gaps[s].doubled.size());
            };
            if (most == scans.size() || rank(i) > rank(most))
                most = i;
        }
    }
    if (most == scans.size()) {
        for (CaptureWarning &warning : alone)
            warnings.push_back(std::move(warning));
    } else {
        const bool one = names.size() == 1;
        warnings.push_back(
            {one ? names.front() : "",
             (one ? "" : fmt::format("in {}, of which {}: ", fmt::join(names, ", "), summaries[most].name)) +
                 gaps_text(camera, gaps[most], range),
             gaps[most].lattice           ? "stretched_codes"
             : gaps[most].missing.empty() ? "doubled_codes"
                                          : "missing_codes"});
    }
    // Light that stays in the lowest quarter of the range: with the right exposure the brightest speckle comes near the
    // top code.
    unsigned used = kMinCaptureBits;
    while (used < layout.bits && largest_of_all >> used != 0)
        ++used;
    if (lit && varied && used + 2 <= layout.bits)
        warnings.push_back({"",
                            fmt::format("no code is above {}, though /camera/bits is {}: if the converter has {} bits, "
                                        "set bits to {}, or saturation is overlooked; if not, expose more",
                                        largest_of_all, layout.bits, used, used),
                            "unused_bits"});
    else if (auto clipped = clipped_below_top(layout, scans); clipped && warnings.empty())
        warnings.push_back(std::move(*clipped));
    return warnings;
}

} // namespace clsp

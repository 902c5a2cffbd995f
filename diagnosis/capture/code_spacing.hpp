// Codes that never occur although they should: codes that were multiplied, brought through a table, or that a converter
// misses.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

namespace clsp {

// A finding that clean codes show more rarely is told.
constexpr double kChanceOfFinding = 1e-6;

// Codes = round(offset + step k) with whole numbers k.
struct CodeLattice {
    double step = 0.0, offset = 0.0; // |offset| <= step / 2
    std::size_t codes = 0;           // that occur
    std::uint32_t first = 0, last = 0;
};
double nearest_offset(const CodeLattice &lattice); // above -step / 2, and step / 2 at most

// The lattice of codes that are two and more apart; nothing where so few or so near ones lie so by chance (each code of
// a lattice of a real step halves that chance at least; how many lattices there are is allowed for).
// codes: those that occur, in order; no clipped ones.
std::optional<CodeLattice> find_lattice(const std::vector<std::uint16_t> &codes);
// The greatest power of two, as an exponent, whose multiples all codes are, by more than chance. gaps: noise would have
// reached those between.
unsigned common_shift(const std::vector<std::uint16_t> &codes, bool gaps = false);

// Codes that lie between others which occur often.
struct CodeGaps {
    std::size_t judged = 0;               // codes that noise would reach
    std::vector<std::uint16_t> occurring; // of them, in order
    std::vector<std::uint16_t> missing;   // of them
    std::vector<std::uint16_t> doubled;   // of them: twice as often as both neighbours
    std::uint32_t first = 0, last = 0;    // of those judged
    std::optional<CodeLattice> lattice;   // of a step between one and two that explains the missing ones
};

// histogram: by code, without those that clip. noise_dn: no more than each pixel's noise in time, which blurs the
// histogram: a code at a distance d from one that occurs n times occurs at least n exp(-3 d / noise - d^2 / 2 noise^2)
// times (what lies farther than three deviations away adds nothing). Judged are codes between two that occur often, of
// which one makes the chance to miss them smaller than one in a million, for all codes together.
CodeGaps find_gaps(const std::vector<std::uint64_t> &histogram, double noise_dn);

// The largest code, where it occurs more often than each of those just below it, as light has it that is clipped there.
// Noise behind the clipping spreads such codes.
struct CodePile {
    std::uint16_t code = 0;
    std::uint64_t count = 0; // 0: there is none
};
// histogram: as above.
CodePile find_pile(const std::vector<std::uint64_t> &histogram);

// Codes that occur, but for the rarest ones, which together make up half a percent.
std::vector<std::uint16_t> usual_codes(const std::vector<std::uint64_t> &histogram);
// What the nearest of them are apart; 1 of fewer than two.
std::uint32_t least_step(const std::vector<std::uint16_t> &codes);

} // namespace clsp

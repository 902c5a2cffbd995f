// Pixels of a sequence that are not like the others, and pixels of a colour mosaic.
#pragma once

#include "capture/capture.hpp"
#include "capture/transients.hpp"

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace clsp {

// Sums of a sequence by pixel, of all rows.
struct PixelSums {
    const CaptureLayout &layout;
    const SequenceLayout &sequence;
    const std::vector<std::uint32_t> &sums;
    const std::vector<std::uint64_t> &squares;
    std::uint32_t step_dn = 1;       // that codes are apart at least
    const PixelEnds *ends = nullptr; // of scenes at rest
};

enum class PixelOddity : std::uint8_t { bright, dark, stuck, restless };

struct OddPixel {
    std::uint32_t index = 0; // row * width + column
    PixelOddity how = PixelOddity::bright;
};

// Levels of the sites (row / side, column / side) % 2, in DN, where they differ by more than chance.
struct Mosaic {
    std::uint32_t side = 1; // of a site, in pixels: 2 where four neighbours have one filter
    std::array<double, 4> levels{};
    double contrast = 0.0; // the largest difference of halves, in DN
};

struct PixelOddities {
    std::vector<OddPixel> pixels;             // in order of their index
    std::vector<std::uint32_t> rows, columns; // whose middle lies apart from the other ones'
    std::vector<Mosaic> mosaic;               // one or none
    std::vector<Transient> transients;        // in order of their index; nothing else is odd of them for that frame
};

// Of dark frames and flats: pixels 8 robust deviations from a smooth surface (of degree 4), or with 25 times the usual
// variance in time. Of these and boards in motion: pixels that do not change, where no more than one in a million sets
// would have one. Lines: as pixels, by the middle of each; in laser light those that lie farther from the others than
// these from each other. Nothing where more than a tenth of the pixels would be odd.
PixelOddities find_oddities(const PixelSums &pixels);

// Odd pixels as whole rows, whole columns, and blocks, as few as cover what lies close together; the others are single.
struct OddPlaces {
    std::vector<PixelBlock> rows, columns, blocks;
    std::vector<OddPixel> single;
};
OddPlaces places_of(const std::vector<const PixelOddities *> &sequences, std::uint32_t width, std::uint32_t height);

} // namespace clsp

#include "capture/odd_places.hpp"

#include <algorithm>

namespace clsp {

bool is_odd(const SequenceScan &scan) {
    const PixelOddities *one = scan.oddities.get();
    return one && !(one->pixels.empty() && one->rows.empty() && one->columns.empty());
}

OddPlaces odd_places(const CaptureLayout &layout, const std::vector<SequenceScan> &scans) {
    std::vector<const PixelOddities *> all;
    for (const SequenceScan &scan : scans)
        if (is_odd(scan))
            all.push_back(scan.oddities.get());
    return places_of(all, layout.width, layout.height);
}

std::vector<PixelBlock> blocks_of(const OddPlaces &places) {
    std::vector<PixelBlock> blocks = places.rows;
    blocks.insert(blocks.end(), places.columns.begin(), places.columns.end());
    blocks.insert(blocks.end(), places.blocks.begin(), places.blocks.end());
    return blocks;
}

std::vector<std::uint8_t> beside_odd_blocks(const CaptureLayout &layout, const std::vector<SequenceScan> &scans) {
    std::vector<std::uint8_t> mask;
    for (const PixelBlock &block : blocks_of(odd_places(layout, scans))) {
        mask.resize(layout.pixel_count(), 1);
        for (std::size_t row = block.first_row; row <= block.last_row; ++row)
            std::fill_n(mask.begin() + std::ptrdiff_t(row * layout.width + block.first_column),
                        block.last_column - block.first_column + 1, std::uint8_t{0});
    }
    for (const SequenceScan &scan : scans)
        for (std::size_t k = 0; scan.oddities && k < scan.oddities->transients.size(); ++k) {
            mask.resize(layout.pixel_count(), 1);
            mask[scan.oddities->transients[k].index] = 0;
        }
    return mask;
}

} // namespace clsp

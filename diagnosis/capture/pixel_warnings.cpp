#include "capture/pixel_warnings.hpp"

#include "capture/odd_places.hpp"

#include <algorithm>
#include <array>
#include <fmt/format.h>
#include <map>
#include <numeric>
#include <optional>
#include <string>

namespace clsp {
namespace {

constexpr double kLeastMosaic = 0.02; // of the light
constexpr const char *kHow =
    "`clspeckle capture check FOLDER --write-mask FOLDER/odd.png` writes a mask of all of them, "
    "which \"mask\": \"odd.png\" in the sequences of capture.json leaves out";

// "row 47", "rows 0 to 3 and 47"
std::string ranges(const char *one, const char *several,
                   const std::vector<std::pair<std::uint32_t, std::uint32_t>> &all) {
    constexpr std::size_t kMost = 6;
    std::string text;
    for (std::size_t k = 0; k < std::min(all.size(), kMost); ++k) {
        const bool last = k > 0 && k + 1 == all.size();
        text += fmt::format("{}{}", k == 0 ? "" : last ? " and " : ", ", all[k].first);
        if (all[k].second > all[k].first)
            text += fmt::format(" to {}", all[k].second);
    }
    if (all.size() > kMost)
        text += fmt::format(" and {} more", all.size() - kMost);
    return fmt::format("{} {}", all.size() == 1 && all[0].first == all[0].second ? one : several, text);
}

std::string text_of(const OddPlaces &places) {
    std::vector<std::pair<std::uint32_t, std::uint32_t>> rows, columns;
    for (const PixelBlock &block : places.rows)
        rows.emplace_back(block.first_row, block.last_row);
    for (const PixelBlock &block : places.columns)
        columns.emplace_back(block.first_column, block.last_column);
    std::vector<std::string> parts;
    if (!rows.empty())
        parts.push_back(ranges("row", "rows", rows));
    if (!columns.empty())
        parts.push_back(ranges("column", "columns", columns));
    constexpr std::size_t kMost = 6;
    for (std::size_t k = 0; k < std::min(places.blocks.size(), kMost); ++k) {
        const PixelBlock &b = places.blocks[k];
        parts.push_back(fmt::format("pixels {} to {} of {}", b.first_column, b.last_column,
                                    ranges("row", "rows", {{b.first_row, b.last_row}})));
    }
    if (places.blocks.size() > kMost)
        parts.push_back(fmt::format("{} more blocks", places.blocks.size() - kMost));
    return fmt::format("{}", fmt::join(parts, ", "));
}

// Sites that differ are of the sensor: all sequences tell together which one is the brightest.
std::optional<CaptureWarning> mosaic_warning(const CaptureLayout &layout, const std::vector<SequenceScan> &scans,
                                             const DarkLevel &dark) {
    const auto light_of = [&](const Mosaic &mosaic) {
        return std::accumulate(mosaic.levels.begin(), mosaic.levels.end(), 0.0) / 4.0 - dark.level_dn;
    };
    std::vector<std::size_t> telling;
    for (std::size_t i = 0; i < scans.size(); ++i)
        if (scans[i].oddities && !scans[i].oddities->mosaic.empty())
            if (const Mosaic &one = scans[i].oddities->mosaic.front(); one.contrast >= kLeastMosaic * light_of(one))
                telling.push_back(i);
    if (telling.empty())
        return std::nullopt;
    const auto mosaic_of = [&](std::size_t i) -> const Mosaic & { return scans[i].oddities->mosaic.front(); };
    const auto contrast = [&](std::size_t i) { return mosaic_of(i).contrast / light_of(mosaic_of(i)); };
    const std::size_t most = *std::max_element(telling.begin(), telling.end(),
                                               [&](std::size_t i, std::size_t k) { return contrast(i) < contrast(k); });
    const Mosaic &mosaic = mosaic_of(most);
    const std::uint32_t period = 2 * mosaic.side;
    std::vector<std::string> names;
    std::array<double, 4> sites{}; // by the light of each sequence
    bool finer = false;
    for (const std::size_t i : telling) {
        if (mosaic_of(i).side != mosaic.side)
            continue;
        names.push_back(layout.sequences[i].name);
        for (std::size_t k = 0; k < sites.size(); ++k)
            sites[k] += (mosaic_of(i).levels[k] - dark.level_dn) / light_of(mosaic_of(i));
        finer = finer || period * layout.pixel_pitch_m > layout.wavelength_m * layout.sequences[i].f_number;
    }
    const bool has_laser = std::any_of(layout.sequences.begin(), layout.sequences.end(),
                                       [](const SequenceLayout &s) { return is_laser(s.scene); });
    const auto brightest = static_cast<std::uint32_t>(std::max_element(sites.begin(), sites.end()) - sites.begin());
    const bool one = names.size() == 1;
    return CaptureWarning{
        one ? names.front() : "",
        (one ? "" : fmt::format("in {}, of which {}: ", fmt::join(names, ", "), layout.sequences[most].name)) +
            fmt::format(
                "the four sites of {7} x {7} pixels have levels of {3:.1f}, {4:.1f}, {5:.1f} and {6:.1f} DN (top left, "
                "top right, bottom left, bottom right): the filters of a colour camera, or converters of their "
                "own for rows or columns. Take one site, codes[:, {0}::{7}, {1}::{7}], with width and height divided "
                "by {7} and pixel_pitch_um times {7}; places in pixels become (x - {1}) / {7} and (y - {0}) / {7}, "
                "sigma_px / {7}{2}",
                brightest / 2 * mosaic.side, brightest % 2 * mosaic.side,
                finer && has_laser ? ". Speckle is finer than such pixels, which is a warning of its own" : "",
                mosaic.levels[0], mosaic.levels[1], mosaic.levels[2], mosaic.levels[3], period),
        "mosaic"};
}

// Of one sequence, but for those in blocks that are odd anyhow.
std::optional<CaptureWarning> transients_warning(const CaptureLayout &layout, std::size_t sequence,
                                                 const SequenceScan &scan, const std::vector<PixelBlock> &blocks) {
    if (!scan.oddities)
        return std::nullopt;
    std::map<std::uint32_t, std::vector<Transient>> by_frame;
    CaptureWarning warning{layout.sequences[sequence].name, "", kTransientPixels, {}, {}};
    for (const Transient &one : scan.oddities->transients) {
        const std::uint32_t y = one.index / layout.width, x = one.index % layout.width;
        if (std::any_of(blocks.begin(), blocks.end(), [&](const PixelBlock &block) {
                return y >= block.first_row && y <= block.last_row && x >= block.first_column && x <= block.last_column;
            }))
            continue;
        by_frame[one.frame].push_back(one);
        warning.pixels.push_back({y, y, x, x});
    }
    if (by_frame.empty())
        return std::nullopt;
    constexpr std::size_t kMost = 4;
    std::vector<std::string> parts;
    for (const auto &[frame, pixels] : by_frame) {
        warning.frames.push_back(frame);
        if (parts.size() == kMost)
            continue;
        const auto [most_left, most_right] =
            std::minmax_element(pixels.begin(), pixels.end(), [&](const Transient &a, const Transient &b) {
                return a.index % layout.width < b.index % layout.width;
            });
        const std::uint32_t top = pixels.front().index / layout.width, bottom = pixels.back().index / layout.width,
                            left = most_left->index % layout.width, right = most_right->index % layout.width;
        parts.push_back(pixels.size() == 1
                            ? fmt::format("frame {} at column {}, row {} ({} DN, {:.0f} DN in the others)", frame, left,
                                          top, pixels[0].code, pixels[0].usual_dn)
                            : fmt::format("frame {} at {} pixels of {} and {}", frame, pixels.size(),
                                          ranges("column", "columns", {{left, right}}),
                                          ranges("row", "rows", {{top, bottom}})));
    }
    if (by_frame.size() > kMost)
        parts.push_back(fmt::format("{} more frames", by_frame.size() - kMost));
    const bool one = warning.pixels.size() == 1;
    warning.text = fmt::format("{} pixel{} unlike {} in one frame alone: {}: a cosmic ray, a bit error or lost data. "
                               "To leave {} out, {}",
                               warning.pixels.size(), one ? " is" : "s are", one ? "itself" : "themselves",
                               fmt::join(parts, ", "), one ? "it" : "them", kHow);
    return warning;
}

} // namespace

std::vector<CaptureWarning> pixel_warnings(const CaptureLayout &layout, const std::vector<SequenceScan> &scans,
                                           const DarkLevel &dark) {
    std::vector<CaptureWarning> warnings;
    std::vector<std::string> names;
    for (std::size_t i = 0; i < scans.size(); ++i)
        if (is_odd(scans[i]))
            names.push_back(layout.sequences[i].name);
    const OddPlaces places = odd_places(layout, scans);
    const std::vector<PixelBlock> blocks = blocks_of(places);
    const std::string where =
        names.size() == scans.size() ? "all sequences" : fmt::format("{}", fmt::join(names, ", "));
    if (!blocks.empty())
        warnings.push_back({"",
                            fmt::format("{} {} not like the other pixels (in {}): embedded data, pixels without light, "
                                        "or a defect, which other findings may follow from. Mask them first: {}",
                                        text_of(places),
                                        blocks.size() == 1 && places.blocks.empty() &&
                                                (blocks[0].first_row == blocks[0].last_row ||
                                                 blocks[0].first_column == blocks[0].last_column)
                                            ? "is"
                                            : "are",
                                        where, kHow),
                            "odd_block",
                            {},
                            blocks});
    if (!places.single.empty()) {
        std::size_t counts[4] = {};
        CaptureWarning warning{"", "", "odd_pixels", {}, {}};
        for (const OddPixel &pixel : places.single) {
            ++counts[std::size_t(pixel.how)];
            const std::uint32_t y = pixel.index / layout.width, x = pixel.index % layout.width;
            warning.pixels.push_back({y, y, x, x});
        }
        std::vector<std::string> parts;
        const char *const words[4] = {"brighter", "darker", "never changing", "noisier"};
        for (std::size_t k = 0; k < 4; ++k)
            if (counts[k] > 0)
                parts.push_back(fmt::format("{} {}", counts[k], words[k]));
        const std::uint32_t first = places.single.front().index;
        warning.text = fmt::format("{} single pixel{} ({:.2g} %) {} not like the others: {}, the first at column {}, "
                                   "row {} (in {}). A diagnosis "
                                   "explains some by hot_pixels, pixel_dull or telegraph_noise; to leave them out, {}",
                                   places.single.size(), places.single.size() == 1 ? "" : "s",
                                   100.0 * double(places.single.size()) / double(layout.pixel_count()),
                                   places.single.size() == 1 ? "is" : "are", fmt::join(parts, ", "),
                                   first % layout.width, first / layout.width, where, kHow);
        warnings.push_back(std::move(warning));
    }
    for (std::size_t i = 0; i < scans.size(); ++i)
        if (auto transients = transients_warning(layout, i, scans[i], blocks))
            warnings.push_back(std::move(*transients));
    if (auto mosaic = mosaic_warning(layout, scans, dark))
        warnings.push_back(std::move(*mosaic));
    return warnings;
}

} // namespace clsp

#include "capture/judged_part.hpp"

#include "capture/metadata_warnings.hpp"
#include "capture/stored_sequence.hpp"
#include "runtime/error.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <limits>

namespace clsp {
namespace {

constexpr std::uint32_t kAllFrames = std::numeric_limits<std::uint32_t>::max();
constexpr std::uint32_t kFewestFrames = 4; // of a sequence that has as many: two halves of two
// Of a window that is chosen: its short side, in steps that transforms like, and its pixels.
constexpr std::uint32_t kLeastRows = 64, kStep = 16;
constexpr std::uint64_t kLeastArea = 256 * kLeastRows;
constexpr std::uint32_t kLeastSide = 16;     // of one that is given
constexpr double kNearlyAll = 0.9;           // of what the best place has unmasked
constexpr std::uint64_t kLeastUnmasked = 64; // pixels; as the statistics ask for
// Dots that distortion or another wavelength may bring into the window: by that part of the image's corner radius.
constexpr double kDotMargin = 0.1;

std::uint64_t frames_of(const CaptureLayout &layout, std::uint32_t most) {
    std::uint64_t frames = 0;
    for (const SequenceLayout &sequence : layout.sequences)
        frames += std::min(sequence.frame_count, most);
    return frames;
}

// Frames of each sequence, so that all of an area keep to the budget: all, or an even number.
std::uint32_t affordable_frames(const CaptureLayout &layout, std::uint64_t area, std::uint64_t most_pixels) {
    if (frames_of(layout, kAllFrames) * area <= most_pixels)
        return kAllFrames;
    std::uint32_t frames = kFewestFrames;
    while (frames_of(layout, frames + 2) * area <= most_pixels)
        frames += 2;
    return frames;
}

// Sides of a strip of about that area.
PixelWindow strip(const CaptureLayout &layout, std::uint64_t area) {
    const bool wide = layout.width >= layout.height;
    const std::uint64_t longer = std::max(layout.width, layout.height), shorter = std::min(layout.width, layout.height);
    const auto stepped = [](std::uint64_t side) { return side - side % kStep; };
    const std::uint64_t across = std::min(shorter, std::max<std::uint64_t>(kLeastRows, stepped(area / longer)));
    const std::uint64_t along = std::min(longer, std::max<std::uint64_t>(kStep, stepped(area / across)));
    PixelWindow window;
    window.width = static_cast<std::uint32_t>(wide ? along : across);
    window.height = static_cast<std::uint32_t>(wide ? across : along);
    return window;
}

// Sums over rectangles of a mask.
class UnmaskedCounts {
  public:
    UnmaskedCounts(const CaptureLayout &layout, const std::vector<std::uint8_t> &mask)
        : columns_(layout.width + 1), sums_((std::size_t{layout.height} + 1) * columns_) {
        for (std::size_t y = 0; y < layout.height; ++y)
            for (std::size_t x = 0; x < layout.width; ++x)
                at(x + 1, y + 1) = at(x, y + 1) + at(x + 1, y) - at(x, y) + (mask[y * layout.width + x] != 0 ? 1u : 0u);
    }
    std::uint64_t in(const PixelWindow &w) const {
        return at(w.x + w.width, w.y + w.height) - at(w.x, w.y + w.height) - at(w.x + w.width, w.y) + at(w.x, w.y);
    }

  private:
    std::uint32_t &at(std::size_t x, std::size_t y) { return sums_[y * columns_ + x]; }
    std::uint32_t at(std::size_t x, std::size_t y) const { return sums_[y * columns_ + x]; }
    std::size_t columns_;
    std::vector<std::uint32_t> sums_;
};

// Pixels that a sequence with the fewest of them has in each window.
std::vector<std::uint64_t> least_unmasked(const CaptureLayout &layout, const std::vector<PixelWindow> &windows) {
    std::vector<std::uint64_t> least(windows.size());
    for (std::size_t i = 0; i < windows.size(); ++i)
        least[i] = std::uint64_t{windows[i].width} * windows[i].height;
    for (const SequenceLayout &sequence : layout.sequences) {
        if (sequence.mask.empty())
            continue;
        const UnmaskedCounts counts(layout, sequence.mask);
        for (std::size_t i = 0; i < windows.size(); ++i)
            least[i] = std::min(least[i], counts.in(windows[i]));
    }
    return least;
}

// Even, so that a mosaic of 2 x 2 keeps its phase.
std::uint32_t begin_about(double centre, std::uint32_t side, std::uint32_t whole) {
    const double begin = std::clamp(std::round(centre - 0.5 * (side - 1.0)), 0.0, double(whole - side));
    return static_cast<std::uint32_t>(begin) & ~1u;
}

// Where a window of that size has its place.
PixelWindow placed(const CaptureLayout &layout, const PixelWindow &size) {
    const auto &axis = layout.principal_point_px;
    PixelWindow centred = size;
    centred.x = begin_about(axis[0], size.width, layout.width);
    centred.y = begin_about(axis[1], size.height, layout.height);
    if (std::all_of(layout.sequences.begin(), layout.sequences.end(),
                    [](const SequenceLayout &s) { return s.mask.empty(); }))
        return centred;
    std::vector<PixelWindow> places = {centred};
    for (std::uint32_t y = 0; y + size.height <= layout.height; y += kStep)
        for (std::uint32_t x = 0; x + size.width <= layout.width; x += kStep)
            places.push_back({x, y, size.width, size.height});
    const auto away = [&](const PixelWindow &w) {
        return std::hypot(double(w.x) - double(centred.x), double(w.y) - double(centred.y));
    };
    std::stable_sort(places.begin(), places.end(),
                     [&](const PixelWindow &a, const PixelWindow &b) { return away(a) < away(b); });
    const std::vector<std::uint64_t> unmasked = least_unmasked(layout, places);
    const double enough = kNearlyAll * double(*std::max_element(unmasked.begin(), unmasked.end()));
    const auto best =
        std::find_if(unmasked.begin(), unmasked.end(), [&](auto count) { return double(count) >= enough; });
    return places[std::size_t(best - unmasked.begin())];
}

PixelWindow checked(const CaptureLayout &layout, const PixelWindow &w) {
    const auto refuse = [&](const std::string &what) {
        throw Error(Status::kInvalidArgument,
                    fmt::format("the window {},{},{},{} (x, y, width, height) {}", w.x, w.y, w.width, w.height, what));
    };
    if (w.x == 0 && w.y == 0 && w.width == layout.width && w.height == layout.height)
        return w;
    if (w.width < kLeastSide || w.height < kLeastSide)
        refuse(fmt::format("is too small: at least {0} x {0} pixels are needed for statistics", kLeastSide));
    if (std::uint64_t{w.x} + w.width > layout.width || std::uint64_t{w.y} + w.height > layout.height)
        refuse(fmt::format("reaches to column {} and row {}; the image has {} x {} pixels",
                           std::uint64_t{w.x} + w.width, std::uint64_t{w.y} + w.height, layout.width, layout.height));
    if (w.x % 2 != 0 || w.y % 2 != 0)
        refuse("begins at an odd column or row; give even ones, so that the sites of a 2 x 2 mosaic keep their places");
    return w;
}

std::vector<FrameRun> runs_of(std::uint32_t frames, std::uint32_t most) {
    if (frames <= most)
        return {{0, frames}};
    if (most < kFewestFrames)
        return {{(frames - most) / 2, most}};
    const std::uint32_t half = frames / 2, first = most / 2, second = most - first;
    return {{(half - first) / 2, first}, {half + (frames - half - second) / 2, second}};
}

} // namespace

std::uint32_t JudgedPart::Sequence::frames() const {
    std::uint32_t count = 0;
    for (const FrameRun &run : runs)
        count += run.count;
    return count;
}

bool JudgedPart::is_whole() const {
    return has_whole_image() && std::all_of(sequences.begin(), sequences.end(),
                                            [](const Sequence &s) { return s.frames() == s.frame_count; });
}

JudgedPart choose_part(const CaptureLayout &layout, const PartChoice &choice, std::uint64_t most_pixels) {
    JudgedPart part;
    part.image_width = layout.width;
    part.image_height = layout.height;
    const PixelWindow whole{0, 0, layout.width, layout.height};
    std::uint32_t frames = !choice.frames ? 0 : *choice.frames == 0 ? kAllFrames : *choice.frames;
    const auto affordable = [&](std::uint64_t area) { return affordable_frames(layout, area, most_pixels); };
    if (choice.window || choice.whole_image) {
        part.window = choice.window ? checked(layout, *choice.window) : whole;
        if (!choice.frames)
            frames = affordable(std::uint64_t{part.window.width} * part.window.height);
    } else {
        if (!choice.frames) // no fewer than are enough, unless there are too many sequences
            frames = std::max(
                affordable(layout.pixel_count()),
                std::min(kEnoughFrames, affordable(std::min<std::uint64_t>(kLeastArea, layout.pixel_count()))));
        const std::uint64_t area = std::max(kLeastArea, most_pixels / frames_of(layout, frames));
        part.window = area >= layout.pixel_count() ? whole : placed(layout, strip(layout, area));
    }
    const std::uint64_t unmasked = least_unmasked(layout, {part.window}).front();
    if (unmasked < kLeastUnmasked && !part.has_whole_image())
        throw Error(
            choice.window ? Status::kInvalidArgument : Status::kInvalidData,
            fmt::format("the window of {} x {} pixels at ({}, {}) has {} pixels that a sequence's mask leaves; at "
                        "least {} are needed: name another window, or take the sequence out",
                        part.window.width, part.window.height, part.window.x, part.window.y, unmasked, kLeastUnmasked));
    for (const SequenceLayout &sequence : layout.sequences)
        part.sequences.push_back({sequence.name, sequence.frame_count, runs_of(sequence.frame_count, frames)});
    return part;
}

Capture take_part(const Capture &capture, const std::vector<std::size_t> &numbers,
                  const std::vector<SequenceLayout> &sequences, const JudgedPart &part) {
    const PixelWindow &window = part.window;
    const std::size_t width = capture.layout.width;
    Capture result;
    CaptureLayout &layout = result.layout;
    layout = capture.layout;
    layout.sequences.clear();
    if (!part.has_whole_image()) {
        layout.width = window.width;
        layout.height = window.height;
        layout.window = ImageWindow{window.x, window.y, capture.layout.width, capture.layout.height};
        layout.principal_point_px = {capture.layout.principal_point_px[0] - window.x,
                                     capture.layout.principal_point_px[1] - window.y};
        if (layout.dots) {
            const double reach = kDotReach * layout.dots->sigma_px + kDotMargin * layout.corner_radius_px();
            std::vector<std::array<double, 2>> near;
            for (const auto &p : capture.layout.dots->positions_px) {
                const double x = p[0] - window.x, y = p[1] - window.y;
                if (x > -reach && x < window.width + reach && y > -reach && y < window.height + reach)
                    near.push_back({x, y});
            }
            layout.dots->positions_px = std::move(near);
        }
    }
    std::vector<std::uint16_t> room;
    for (std::size_t i = 0; i < numbers.size(); ++i) {
        SequenceLayout sequence = sequences[i];
        const JudgedPart::Sequence &used = part.sequences[i];
        sequence.frame_count = used.frames();
        const auto cut_rows = [&](const auto *from, auto &to) {
            for (std::uint32_t y = 0; y < window.height; ++y, from += width)
                to.insert(to.end(), from + window.x, from + window.x + window.width);
        };
        if (!sequence.mask.empty() && !part.has_whole_image()) {
            std::vector<std::uint8_t> mask;
            cut_rows(sequence.mask.data() + window.y * width, mask);
            sequence.mask = std::move(mask);
        }
        std::vector<std::uint16_t> codes;
        codes.reserve(sequence.frame_count * layout.pixel_count());
        for (const FrameRun &run : used.runs)
            for (std::uint32_t frame = run.first; frame < run.first + run.count; ++frame)
                cut_rows(rows_of(capture, numbers[i], frame, window.y, window.height, room), codes);
        layout.sequences.push_back(std::move(sequence));
        result.codes.push_back(std::move(codes));
    }
    return result;
}

std::string part_text(const JudgedPart &part) {
    std::string text;
    const PixelWindow &w = part.window;
    if (!part.has_whole_image())
        text += fmt::format("columns {} to {} and rows {} to {} of the {} x {} pixels", w.x, w.x + w.width - 1, w.y,
                            w.y + w.height - 1, part.image_width, part.image_height);
    std::vector<std::string> some;
    for (const JudgedPart::Sequence &s : part.sequences)
        if (s.frames() < s.frame_count)
            some.push_back(fmt::format("{} of {} frames of {}", s.frames(), s.frame_count, s.name));
    if (!some.empty())
        text += fmt::format("{}{}", part.has_whole_image() ? "" : ", and ", fmt::join(some, ", "));
    return text;
}

} // namespace clsp

#include "capture/sequence_scan.hpp"

#include "capture/pixel_oddities.hpp"
#include "capture/stored_sequence.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace clsp {
namespace {

constexpr std::size_t kBandPixels = std::size_t{1} << 24; // rows of so many pixels are summed at once

// One row. mask: nullptr, or 0 where a pixel does not count; before: the row in the frame before, or nullptr.
struct Row {
    const std::uint16_t *now, *before;
    const std::uint8_t *mask;
    std::size_t width;

    bool counts(std::size_t x) const { return !mask || mask[x] != 0; }
};

void add_extremes(const Row &row, std::uint16_t top, SequenceScan &scan) {
    std::uint32_t saturated = 0, zero = 0;
    std::uint16_t minimum = 65535, maximum = 0, largest = 0;
    for (std::size_t x = 0; x < row.width; ++x) {
        const std::uint16_t code = row.now[x];
        largest = std::max(largest, code);
        const bool counts = row.counts(x);
        saturated += counts && code == top;
        zero += counts && code == 0;
        minimum = std::min(minimum, counts ? code : std::uint16_t{65535});
        maximum = std::max(maximum, counts ? code : std::uint16_t{0});
    }
    scan.saturated += saturated;
    scan.zero += zero;
    scan.minimum = std::min(scan.minimum, std::uint32_t{minimum});
    scan.maximum = std::max(scan.maximum, std::uint32_t{maximum});
    scan.largest = std::max(scan.largest, largest);
}

void add_pixels(const Row &row, std::uint32_t *sums, std::uint64_t *squares, FrameScan &frame) {
    std::uint64_t sum = 0, square = 0;
    for (std::size_t x = 0; x < row.width; ++x) {
        const std::uint32_t code = row.now[x], counted = row.counts(x) ? code : 0;
        sum += counted;
        square += std::uint64_t{counted * counted};
        sums[x] += code;
        squares[x] += std::uint64_t{code * code};
    }
    frame.sum += sum;
    frame.square += square;
}

void add_histogram(const Row &row, std::vector<std::uint64_t> &histogram) {
    for (std::size_t x = 0; x < row.width; ++x)
        histogram[row.now[x]] += row.counts(x);
}

void add_pairs(const Row &row, FrameScan &frame) {
    std::uint64_t pairs = 0, lefts = 0, rights = 0, products = 0;
    for (std::size_t x = 0; x + 1 < row.width; ++x) {
        const bool counts = row.counts(x) && row.counts(x + 1);
        const std::uint32_t left = counts ? row.now[x] : 0, right = counts ? row.now[x + 1] : 0;
        pairs += counts;
        lefts += left;
        rights += right;
        products += std::uint64_t{left * right};
    }
    frame.pairs += pairs;
    frame.lefts += lefts;
    frame.rights += rights;
    frame.products += products;
}

void add_change(const Row &row, std::uint16_t top, FrameScan &frame) {
    std::uint64_t both = 0, sums[2] = {}, squares[2] = {}, products = 0;
    for (std::size_t x = 0; x < row.width; ++x) {
        const bool counts = row.counts(x) && row.before[x] != top && row.now[x] != top;
        const std::uint32_t before = counts ? row.before[x] : 0, now = counts ? row.now[x] : 0;
        both += counts;
        sums[0] += before;
        sums[1] += now;
        squares[0] += std::uint64_t{before * before};
        squares[1] += std::uint64_t{now * now};
        products += std::uint64_t{before * now};
    }
    frame.both += both;
    frame.before += sums[0];
    frame.now += sums[1];
    frame.before_square += squares[0];
    frame.now_square += squares[1];
    frame.before_times_now += products;
}

// Rows that come twice. Of a row that does not, how many of its pixels do.
class RowRepeats {
  public:
    RowRepeats(std::uint32_t rows, std::size_t width) : equal_(rows), twice_(rows), width_(width) {}

    void add(std::uint32_t frame, std::uint32_t row, const Row &codes) {
        if (std::equal(codes.now, codes.now + width_, codes.before)) {
            ++twice_[row];
            std::size_t steps = 0;
            for (std::size_t x = 1; x < width_; ++x)
                steps += codes.now[x] != codes.now[x - 1];
            // What is black or clipped is the same in all frames.
            if (4 * steps < width_)
                return;
            if (runs_.empty() || runs_.back().frame != frame || runs_.back().last_row + 1 != row) {
                if (runs_.size() == kMost && !is_torn(runs_.back()))
                    runs_.pop_back();
                if (runs_.size() == kMost)
                    return;
                runs_.push_back({frame, row, row});
            }
            runs_.back().last_row = row;
            return;
        }
        std::size_t equal = 0;
        for (std::size_t x = 0; x < width_; ++x)
            equal += codes.now[x] == codes.before[x];
        equal_[row] += equal;
    }

    // Of rows of a camera, whose noise makes most pixels differ from frame to frame. first_row: of the band.
    void append_torn(std::uint32_t frames, std::uint32_t first_row, std::uint32_t height,
                     std::vector<TornRows> &torn) const {
        for (const TornRows &run : runs_) {
            double same = 0.0, all = 0.0, twice = 0.0;
            for (std::uint32_t row = run.first_row; row <= run.last_row; ++row) {
                same += double(equal_[row]);
                all += double(width_) * (double(frames) - 1.0 - double(twice_[row]));
                twice += double(twice_[row]);
            }
            const double rows = double(run.last_row) - double(run.first_row) + 1.0;
            const bool rare = 3.0 * twice <= rows * (double(frames) - 1.0) && 2.0 * same < all;
            if (rare && is_torn(run) && rows < double(height) && torn.size() < kMost)
                torn.push_back({run.frame, run.first_row + first_row, run.last_row + first_row});
        }
    }

  private:
    static constexpr std::size_t kMost = 64;
    static constexpr std::uint32_t kLeastRows = 8;
    static bool is_torn(const TornRows &run) { return run.last_row - run.first_row + 1 >= kLeastRows; }

    std::vector<std::uint64_t> equal_;
    std::vector<std::uint32_t> twice_;
    std::vector<TornRows> runs_;
    std::size_t width_;
};

// The deviation in time of pixels with less noise than nine of ten have. squares: sums of squared deviations.
double noise_of_quiet_pixels(std::vector<float> &squares, std::uint32_t frames) {
    if (squares.empty())
        return 0.0;
    const auto tenth = squares.begin() + std::ptrdiff_t(squares.size() / 10);
    std::nth_element(squares.begin(), tenth, squares.end());
    return std::sqrt(std::max(0.0, double(*tenth) / (double(frames) - 1.0)));
}

// left: the mask of the pixels that count; empty: all do.
SequenceScan scan_pixels(const Capture &capture, std::size_t sequence, const std::vector<std::uint8_t> &left,
                         const std::function<void(double)> &progress) {
    const CaptureLayout &layout = capture.layout;
    const SequenceLayout &of = layout.sequences[sequence];
    const auto top = static_cast<std::uint16_t>(layout.maximum_code());
    const std::uint32_t frames = of.frame_count;
    const auto band = static_cast<std::uint32_t>(std::clamp<std::size_t>(kBandPixels / layout.width, 1, layout.height));
    SequenceScan scan;
    scan.frames.resize(frames);
    scan.pixels = layout.pixel_count() - std::size_t(std::count(left.begin(), left.end(), std::uint8_t{0}));
    double total = 0.0;
    std::vector<std::uint64_t> histogram(std::size_t{1} << 16);
    std::vector<float> variances; // in time, of the first band's pixels
    const bool rests = !(of.moving && is_laser(of.scene));
    FrameSample sample(layout, rests ? frames : 0);
    std::array<std::vector<std::uint16_t>, 2> rooms;
    for (std::uint32_t first = 0; first < layout.height; first += band) {
        const std::uint32_t rows = std::min(band, layout.height - first);
        const std::size_t pixels = std::size_t{rows} * layout.width;
        const std::uint8_t *mask = left.empty() ? nullptr : left.data() + std::size_t{first} * layout.width;
        std::vector<std::uint32_t> sums(pixels); // of 65535 frames at most
        std::vector<std::uint64_t> squares(pixels);
        PixelEnds ends(rests ? pixels : 0);
        RowRepeats repeats(rows, layout.width);
        const std::uint16_t *before = nullptr;
        for (std::uint32_t t = 0; t < frames; ++t) {
            const std::uint16_t *now = rows_of(capture, sequence, t, first, rows, rooms[t % 2]);
            FrameScan &frame = scan.frames[t];
            for (std::size_t at = 0; at < pixels; at += layout.width) {
                const Row row{now + at, before ? before + at : nullptr, mask ? mask + at : nullptr, layout.width};
                add_extremes(row, top, scan);
                add_pixels(row, sums.data() + at, squares.data() + at, frame);
                add_pairs(row, frame);
                add_histogram(row, histogram);
                if (rests)
                    ends.add(t, at, row.now, row.width);
                if (before)
                    repeats.add(t, static_cast<std::uint32_t>(at / layout.width), row);
                if (before && !of.moving)
                    add_change(row, top, frame);
            }
            sample.add(t, first, rows, now);
            frame.hash = fnv1a(now, pixels, frame.hash);
            before = now;
            if (progress)
                progress((double(first) * frames + double(rows) * (t + 1.0)) / (double(layout.height) * frames));
        }
        repeats.append_torn(frames, first, layout.height, scan.torn);
        if (of.scene == CaptureScene::kDots)
            scan.sums.insert(scan.sums.end(), sums.begin(), sums.end());
        for (std::size_t i = 0; i < pixels; ++i)
            if (!mask || mask[i] != 0)
                total += double(squares[i]) - double(sums[i]) * double(sums[i]) / double(frames);
        if (rows == layout.height)
            scan.oddities = std::make_shared<const PixelOddities>(find_oddities(
                {layout, of, sums, squares, least_step(usual_codes(histogram)), rests ? &ends : nullptr}));
        if (first == 0)
            for (std::size_t i = 0; i < pixels; ++i)
                if (!mask || mask[i] != 0)
                    variances.push_back(float(double(squares[i]) - double(sums[i]) * double(sums[i]) / double(frames)));
    }
    scan.pile = find_pile(histogram);
    histogram[0] = histogram[top] = 0; // what clips says nothing of its neighbours
    scan.codes = usual_codes(histogram);
    if (rests)
        scan.noise = sample.noise(left);
    if (rests && is_laser(of.scene))
        scan.shifts = sample.shifts(left);
    else if (rests)
        scan.correlations = sample.correlations(left);
    if (frames > 1 && rests)
        scan.gaps = find_gaps(histogram, noise_of_quiet_pixels(variances, frames));
    if (frames > 1)
        scan.temporal_variance = std::max(0.0, total / (double(frames) - 1.0) / double(scan.pixels));
    return scan;
}

} // namespace

SequenceScan scan_sequence(const Capture &capture, std::size_t sequence, const std::function<void(double)> &progress) {
    return scan_pixels(capture, sequence, capture.layout.sequences[sequence].mask, progress);
}

SequenceScan scan_masked(const Capture &capture, std::size_t sequence, const std::vector<std::uint8_t> &also) {
    std::vector<std::uint8_t> left = also;
    const std::vector<std::uint8_t> &own = capture.layout.sequences[sequence].mask;
    for (std::size_t i = 0; i < own.size(); ++i)
        left[i] = left[i] != 0 && own[i] != 0 ? 1 : 0;
    return scan_pixels(capture, sequence, left, {});
}

std::vector<SequenceScan> scan_capture(const Capture &capture) {
    std::vector<SequenceScan> scans;
    for (std::size_t s = 0; s < capture.layout.sequences.size(); ++s)
        scans.push_back(capture.is_stored(s) ? *capture.stored[s]->scan : scan_sequence(capture, s));
    return scans;
}

} // namespace clsp

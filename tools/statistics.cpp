#include "commands.hpp"

#include "context.hpp"
#include "errors.hpp"
#include "files.hpp"
#include "interrupt.hpp"
#include "io/formats.hpp"
#include "plane_checks.hpp"
#include "text.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

namespace tools {

namespace {

using clspeckle::Buffer;

constexpr double unknown = std::numeric_limits<double>::quiet_NaN();

struct Region {
    std::uint32_t x = 0, y = 0, width = 0, height = 0;
};

image_io::Plane crop(const image_io::Plane &plane, const Region &region) {
    if (region.width == plane.width && region.height == plane.height)
        return plane;
    image_io::Plane part;
    part.width = region.width;
    part.height = region.height;
    part.full_scale = plane.full_scale;
    part.sample = plane.sample;
    part.values.reserve(std::size_t{region.width} * region.height);
    for (std::uint32_t y = 0; y < region.height; ++y) {
        const auto from =
            plane.values.begin() + static_cast<std::ptrdiff_t>(std::size_t{region.y + y} * plane.width + region.x);
        part.values.insert(part.values.end(), from, from + region.width);
    }
    return part;
}

/** What is told about one frame. */
struct Row {
    std::string name;
    std::uint32_t width = 0;
    std::uint32_t height = 0;
    ClspMoments moments{};
    double top = unknown; ///< Top code, if there is one.
    double top_share = unknown;
    double zero_share = 0;
    double speckle_x = unknown; ///< Full width at half maximum of the autocovariance, in pixels.
    double speckle_y = unknown;
    std::vector<double> histogram_edges;
    std::vector<std::uint64_t> histogram;
};

/**
 * Where the curve first falls to one half, by a cubic through the four lags around (Catmull-Rom); the autocovariance is
 * even, which gives the value at lag -1. @param curve from lag 0, where it is 1. NaN if it stays above.
 */
double half_width(const std::vector<double> &curve) {
    for (std::size_t i = 0; i + 1 < curve.size(); ++i) {
        if (!(curve[i] >= 0.5 && curve[i + 1] < 0.5))
            continue;
        const double before = curve[i == 0 ? 1 : i - 1];
        const double after = i + 2 < curve.size() ? curve[i + 2] : 2 * curve[i + 1] - curve[i];
        const double slope0 = (curve[i + 1] - before) / 2;
        const double slope1 = (after - curve[i]) / 2;
        const auto value = [&](double t) {
            const double t2 = t * t;
            const double t3 = t2 * t;
            return (2 * t3 - 3 * t2 + 1) * curve[i] + (t3 - 2 * t2 + t) * slope0 + (3 * t2 - 2 * t3) * curve[i + 1] +
                   (t3 - t2) * slope1;
        };
        double low = 0;
        double high = 1;
        for (int step = 0; step < 60; ++step) {
            const double middle = (low + high) / 2;
            (value(middle) >= 0.5 ? low : high) = middle;
        }
        return static_cast<double>(i) + (low + high) / 2;
    }
    return unknown;
}

/** Per-pixel mean and variance over the frames (Welford), in double. */
class Temporal {
  public:
    void add(const image_io::Plane &plane, const std::string &name) {
        if (count_ == 0) {
            width_ = plane.width;
            height_ = plane.height;
            mean_.assign(plane.values.size(), 0.0);
            squares_.assign(plane.values.size(), 0.0);
            first_ = name;
        } else if (plane.width != width_ || plane.height != height_) {
            throw InputError(
                fmt::format("{}: --temporal needs frames of one size; this one has {} x {} pixels, {} has {} x {}",
                            name, plane.width, plane.height, first_, width_, height_));
        }
        ++count_;
        for (std::size_t i = 0; i < mean_.size(); ++i) {
            const double difference = plane.values[i] - mean_[i];
            mean_[i] += difference / static_cast<double>(count_);
            squares_[i] += difference * (plane.values[i] - mean_[i]);
        }
    }
    std::uint64_t count() const { return count_; }
    /** Mean over the pixels of each one's standard deviation, and the root of the mean variance, which is unbiased. */
    std::pair<double, double> deviations(const std::vector<std::uint8_t> &mask) const {
        double sum = 0;
        double variance = 0;
        std::uint64_t pixels = 0;
        for (std::size_t i = 0; i < squares_.size(); ++i) {
            if (!mask.empty() && mask[i] == 0)
                continue;
            const double pixel = squares_[i] / static_cast<double>(count_ - 1);
            sum += std::sqrt(pixel);
            variance += pixel;
            ++pixels;
        }
        return {sum / static_cast<double>(pixels), std::sqrt(variance / static_cast<double>(pixels))};
    }

  private:
    std::uint64_t count_ = 0;
    std::uint32_t width_ = 0;
    std::uint32_t height_ = 0;
    std::string first_;
    std::vector<double> mean_;
    std::vector<double> squares_;
};

/** Uploads frames and asks the device. */
class Analyzer {
  public:
    Analyzer(const StatisticsArguments &arguments)
        : arguments_(arguments), context_(make_context(arguments.device)), queue_(context_) {}

    Row analyze(const image_io::Plane &plane, const std::vector<std::uint8_t> &mask, const std::string &name) {
        Row row;
        row.name = name;
        row.width = plane.width;
        row.height = plane.height;
        const ClspImage image = upload(image_, plane.values, plane, CLSP_FORMAT_FLOAT32);
        const ClspImage mask_image = mask.empty() ? ClspImage{} : upload(mask_, mask, plane, CLSP_FORMAT_UINT8);
        const ClspImage *mask_view = mask.empty() ? nullptr : &mask_image;
        row.moments = clspeckle::statistics::moments(context_, queue_, image, mask_view);
        row.top = arguments_.bits > 0    ? static_cast<double>((std::uint64_t{1} << arguments_.bits) - 1)
                  : plane.full_scale > 0 ? plane.full_scale
                                         : unknown;
        count_ends(row, plane, mask);
        // A mask's outline would be part of the autocovariance.
        if (mask.empty())
            measure_speckle(row, image);
        if (arguments_.histogram_bins > 0)
            count_histogram(row, image, mask_view, plane);
        return row;
    }

  private:
    template <typename T>
    ClspImage upload(Buffer &buffer, const std::vector<T> &values, const image_io::Plane &plane, std::uint32_t format) {
        if (buffer.size_bytes() != values.size() * sizeof(T))
            buffer = Buffer(context_, values.size() * sizeof(T));
        buffer.write(queue_, values);
        return buffer.image(plane.width, plane.height, format);
    }

    static void count_ends(Row &row, const image_io::Plane &plane, const std::vector<std::uint8_t> &mask) {
        std::uint64_t top = 0;
        std::uint64_t zero = 0;
        for (std::size_t i = 0; i < plane.values.size(); ++i) {
            if (!mask.empty() && mask[i] == 0)
                continue;
            top += plane.values[i] >= row.top; // false for an unknown top
            zero += plane.values[i] <= 0;
        }
        const auto count = static_cast<double>(row.moments.count);
        if (!std::isnan(row.top))
            row.top_share = static_cast<double>(top) / count;
        row.zero_share = static_cast<double>(zero) / count;
    }

    void measure_speckle(Row &row, const ClspImage &image) {
        const std::uint32_t limit = std::min(row.width, row.height) - 1;
        if (limit < 2 || !(row.moments.standard_deviation > 0))
            return;
        for (std::uint32_t lag = std::min(16u, limit);; lag = std::min(4 * lag, limit)) {
            const std::vector<float> map = clspeckle::statistics::autocovariance(context_, queue_, image, lag);
            const std::size_t side = 2 * std::size_t{lag} + 1;
            std::vector<double> along_x;
            std::vector<double> along_y;
            for (std::size_t i = 0; i <= lag; ++i) {
                along_x.push_back(map[lag * side + lag + i]);
                along_y.push_back(map[(lag + i) * side + lag]);
            }
            row.speckle_x = 2 * half_width(along_x);
            row.speckle_y = 2 * half_width(along_y);
            const bool found = !std::isnan(row.speckle_x) && !std::isnan(row.speckle_y);
            if (found || lag == limit || lag >= 1024)
                return;
        }
    }

    void count_histogram(Row &row, const ClspImage &image, const ClspImage *mask, const image_io::Plane &plane) {
        const std::uint32_t bins = arguments_.histogram_bins;
        double low = row.moments.minimum;
        // The last bin must hold the maximum, and bins are open at their upper end.
        double high = std::nextafter(static_cast<float>(row.moments.maximum), std::numeric_limits<float>::infinity());
        if (!arguments_.histogram_range.empty()) {
            low = arguments_.histogram_range[0];
            high = arguments_.histogram_range[1];
        } else if (arguments_.bits > 0 && plane.full_scale > 0) {
            low = 0;
            high = row.top + 1;
        }
        row.histogram = clspeckle::statistics::histogram(context_, queue_, image, low, high, bins, mask);
        for (std::uint32_t i = 0; i <= bins; ++i)
            row.histogram_edges.push_back(low + (high - low) * i / bins);
    }

    const StatisticsArguments &arguments_;
    clspeckle::Context context_;
    clspeckle::Queue queue_;
    Buffer image_;
    Buffer mask_;
};

Json to_json(const Row &row) {
    Json json = {{"file", row.name},
                 {"width", row.width},
                 {"height", row.height},
                 {"count", row.moments.count},
                 {"mean", row.moments.mean},
                 {"standard_deviation", row.moments.standard_deviation},
                 {"contrast", or_null(row.moments.contrast)},
                 {"skewness", or_null(row.moments.skewness)},
                 {"excess_kurtosis", or_null(row.moments.excess_kurtosis)},
                 {"minimum", row.moments.minimum},
                 {"maximum", row.moments.maximum},
                 {"top_code", or_null(row.top)},
                 {"top_share", or_null(row.top_share)},
                 {"zero_share", row.zero_share},
                 {"speckle_width_px", or_null(row.speckle_x)},
                 {"speckle_height_px", or_null(row.speckle_y)}};
    if (!row.histogram.empty())
        json["histogram"] = {{"edges", row.histogram_edges},
                             {"below", row.histogram.front()},
                             {"counts", std::vector<std::uint64_t>(row.histogram.begin() + 1, row.histogram.end() - 1)},
                             {"above", row.histogram.back()}};
    return json;
}

std::string number_text(double value, int digits = 5) {
    return std::isfinite(value) ? fmt::format("{:.{}g}", value, digits) : "-";
}

std::string histogram_text(const Row &row) {
    const std::uint64_t most =
        std::max<std::uint64_t>(1, *std::max_element(row.histogram.begin(), row.histogram.end()));
    std::vector<std::vector<std::string>> rows = {{"from", "to", "pixels", ""}};
    const auto bar = [&](std::uint64_t count) { return std::string(static_cast<std::size_t>(50 * count / most), '#'); };
    const std::size_t bins = row.histogram.size() - 2;
    if (row.histogram.front() > 0)
        rows.push_back({"", number_text(row.histogram_edges.front()), std::to_string(row.histogram.front()),
                        bar(row.histogram.front())});
    for (std::size_t i = 0; i < bins; ++i)
        rows.push_back({number_text(row.histogram_edges[i]), number_text(row.histogram_edges[i + 1]),
                        std::to_string(row.histogram[i + 1]), bar(row.histogram[i + 1])});
    if (row.histogram.back() > 0)
        rows.push_back({number_text(row.histogram_edges.back()), "", std::to_string(row.histogram.back()),
                        bar(row.histogram.back())});
    return "\n" + row.name + "\n" + table(rows, "  ");
}

} // namespace

void run_statistics(const StatisticsArguments &arguments, Console &console) {
    std::vector<std::string> warnings;
    const auto flush = [&] {
        for (const std::string &warning : warnings)
            console.warn(warning);
        warnings.clear();
    };
    std::vector<std::string> files;
    for (const std::string &argument : arguments.files)
        for (std::string &file : expand(argument, Purpose::measurement))
            files.push_back(std::move(file));
    std::optional<image_io::Plane> mask_plane;
    if (!arguments.mask.empty()) {
        image_io::ReadRequest request;
        request.role = image_io::Role::mask;
        const auto reader = image_io::open_one(arguments.mask, request);
        mask_plane = image_io::read_gray(*reader, 0, warnings, image_io::Colors::refused);
        check_values(*mask_plane, arguments.mask, "mask", std::numeric_limits<double>::infinity());
        if (const std::string soft = image_io::told_soft(mask_plane->values); !soft.empty())
            warnings.push_back(arguments.mask + ": " + soft);
    }

    std::optional<Analyzer> analyzer;
    std::vector<Row> rows;
    Temporal temporal;
    std::vector<std::uint8_t> mask;
    for (const std::string &file : files) {
        const auto reader = image_io::open(file, request_of(arguments.channel, arguments.raw));
        const image_io::Info &info = reader->info();
        Region region{0, 0, info.width, info.height};
        if (!arguments.region.empty()) {
            const auto &r = arguments.region;
            region = {r[0], r[1], r[2], r[3]};
            if (region.width == 0 || region.height == 0)
                throw InputError("--region x,y,w,h: the width and the height must be above 0");
            if (std::uint64_t{region.x} + region.width > info.width ||
                std::uint64_t{region.y} + region.height > info.height)
                throw InputError(fmt::format("{}: the region {},{},{},{} leaves the image, which has {} x {} pixels",
                                             file, region.x, region.y, region.width, region.height, info.width,
                                             info.height));
        }
        mask.clear();
        if (mask_plane) {
            if (mask_plane->width != info.width || mask_plane->height != info.height)
                throw InputError(fmt::format("{}: the mask has {} x {} pixels, {} has {} x {}", arguments.mask,
                                             mask_plane->width, mask_plane->height, file, info.width, info.height));
            for (const float value : crop(*mask_plane, region).values)
                mask.push_back(value != 0.0f ? 1 : 0);
            if (std::find(mask.begin(), mask.end(), 1) == mask.end())
                throw InputError(fmt::format("{}: the mask leaves no pixel", arguments.mask));
        }
        for (std::uint64_t frame = 0; frame < info.frame_count; ++frame) {
            check_interrupt();
            const std::string name = info.frame_count > 1 ? fmt::format("{}[{}]", file, frame) : file;
            image_io::Plane plane = image_io::read_gray(*reader, frame, warnings);
            flush();
            for (std::size_t i = 0; i < plane.values.size(); ++i)
                if (!std::isfinite(plane.values[i]))
                    throw InputError(fmt::format("{}: pixel ({}, {}) is {}; statistics need finite values", name,
                                                 i % plane.width, i / plane.width, plane.values[i]));
            plane = crop(plane, region);
            if (!analyzer)
                analyzer.emplace(arguments);
            rows.push_back(analyzer->analyze(plane, mask, name));
            if (arguments.temporal)
                temporal.add(plane, name);
        }
    }
    if (arguments.temporal && temporal.count() < 2)
        throw InputError("--temporal needs two frames or more: a stack, or several files");

    if (console.json()) {
        Json root = {{"frames", Json::array()}};
        for (const Row &row : rows)
            root["frames"].push_back(to_json(row));
        if (arguments.temporal) {
            const auto [mean, rms] = temporal.deviations(mask);
            root["temporal"] = {
                {"frames", temporal.count()}, {"mean_standard_deviation", mean}, {"rms_standard_deviation", rms}};
        }
        root["warnings"] = console.warnings();
        console.result(root.dump(2, ' ', false, Json::error_handler_t::replace));
        return;
    }
    std::vector<std::vector<std::string>> lines = {
        {"file", "size", "mean", "std", "contrast", "skewness", "min", "max", "at top", "at 0", "speckle px"}};
    for (const Row &row : rows) {
        const bool measured = std::isfinite(row.speckle_x) && std::isfinite(row.speckle_y);
        lines.push_back({row.name, fmt::format("{}x{}", row.width, row.height), number_text(row.moments.mean),
                         number_text(row.moments.standard_deviation), number_text(row.moments.contrast, 4),
                         number_text(row.moments.skewness, 4), number_text(row.moments.minimum),
                         number_text(row.moments.maximum),
                         std::isnan(row.top_share) ? "-" : percent(row.top_share),
                         percent(row.zero_share),
                         measured ? fmt::format("{:.2f} x {:.2f}", row.speckle_x, row.speckle_y) : "-"});
    }
    console.result(table(lines));
    for (const Row &row : rows)
        if (!row.histogram.empty())
            console.result(histogram_text(row));
    if (arguments.temporal) {
        const auto [mean, rms] = temporal.deviations(mask);
        console.result(fmt::format(
            "\ntemporal standard deviation over {} frames: mean over the pixels {:.5g}, root mean square {:.5g}",
            temporal.count(), mean, rms));
    }
}

} // namespace tools

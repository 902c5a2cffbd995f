#include "statistics/sequence_level.hpp"

#include "runtime/error.hpp"
#include "statistics/geometry.hpp"
#include "statistics/sums.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace clsp {

namespace {

using statistics::Geometry;

// Sums over the frames of each pixel, and the mean of each frame's unmasked pixels.
struct Totals {
    std::vector<std::uint32_t> pixel;
    std::vector<double> frame_mean;
    double mean = 0.0;
};

Totals sum_codes(const Geometry &geometry, const std::uint16_t *codes) {
    Totals totals;
    totals.pixel.assign(geometry.pixels, 0);
    for (std::size_t t = 0; t < geometry.frames; ++t) {
        const std::uint16_t *frame = codes + t * geometry.pixels;
        std::uint64_t total = statistics::count_up(totals.pixel.data(), frame, geometry.pixels);
        if (geometry.is_masked())
            for (std::size_t i = 0; i < geometry.pixels; ++i)
                total -= geometry.weight[i] != 0.0f ? 0u : frame[i];
        totals.frame_mean.push_back(double(total) / double(geometry.used));
        totals.mean += totals.frame_mean.back() / double(geometry.frames);
    }
    return totals;
}

std::vector<float> mean_image(const Geometry &geometry, const Totals &totals) {
    std::vector<float> mean(geometry.pixels);
    for (std::size_t i = 0; i < geometry.pixels; ++i)
        mean[i] = float(double(totals.pixel[i]) / double(geometry.frames));
    return mean;
}

// Pixels that flicker or jump count at most as the noisiest of Gaussian ones would: eight deviations of a variance from
// frame_count - 1 degrees of freedom. What that cuts off a Gaussian camera's mean is less than 1e-3 of it, even of two
// frames.
double capped_mean(const std::vector<float> &variances, std::size_t frames) {
    double mean = 0.0;
    for (const float variance : variances)
        mean += double(variance) / double(variances.size());
    for (int step = 0; step < 12; ++step) {
        const double limit = mean * (1.0 + 8.0 * std::sqrt(2.0 / double(frames - 1))), last = mean;
        mean = 0.0;
        for (const float variance : variances)
            mean += std::min(double(variance), limit) / double(variances.size());
        if (mean == last) // and so would all further ones be
            break;
    }
    return mean;
}

// Variance over time of each unmasked pixel, with all that rows and columns do.
std::vector<float> plain_variances(const Geometry &geometry, const std::uint16_t *codes, const Totals &totals) {
    const std::vector<float> mean = mean_image(geometry, totals);
    std::vector<float> squares(geometry.pixels), rest(geometry.pixels), variances;
    for (std::size_t t = 0; t < geometry.frames; ++t) {
        const float offset = float(totals.frame_mean[t] - totals.mean);
        statistics::limited_rest(rest.data(), codes + t * geometry.pixels, mean.data(), offset,
                                 std::numeric_limits<float>::infinity(), geometry.pixels);
        statistics::add_squares(squares.data(), rest.data(), geometry.pixels);
    }
    variances.reserve(geometry.used);
    for (std::size_t i = 0; i < geometry.pixels; ++i)
        if (geometry.is_used(i))
            variances.push_back(squares[i] / float(geometry.frames - 1));
    return variances;
}

// Variance over time of each unmasked pixel, rows, columns and whole frames taken out, unbiased; deviations from the
// mean over time beyond the limit (DN) count as the limit.
std::vector<float> pixel_variances(const Geometry &geometry, const std::uint16_t *codes, const Totals &totals,
                                   float limit) {
    const std::size_t width = geometry.width, height = geometry.height, frames = geometry.frames;
    const std::vector<float> mean = mean_image(geometry, totals);
    std::vector<float> squares(geometry.pixels), rest(geometry.pixels);
    std::vector<float> rows(height), columns(width);
    for (std::size_t t = 0; t < frames; ++t) {
        const std::uint16_t *frame = codes + t * geometry.pixels;
        const float offset = float(totals.frame_mean[t] - totals.mean);
        // One jumping pixel is not to lend its jump to its row and column.
        statistics::limited_rest(rest.data(), frame, mean.data(), offset, limit, geometry.pixels);
        if (geometry.is_masked())
            statistics::multiply(rest.data(), rest.data(), geometry.weight.data(), geometry.pixels);
        std::fill(columns.begin(), columns.end(), 0.0f);
        double all = 0.0;
        for (std::size_t y = 0; y < height; ++y) {
            const float *row = rest.data() + y * width;
            const double total = statistics::sum(row, width);
            rows[y] = float(statistics::ratio(total, geometry.row_used[y]));
            all += total;
            statistics::add(columns.data(), row, width);
        }
        // The mean of all is taken out with the rows and again with the columns.
        const float mean_of_all = float(all / double(geometry.used));
        for (std::size_t x = 0; x < width; ++x)
            columns[x] = float(statistics::ratio(double(columns[x]), geometry.column_used[x])) - mean_of_all;
        for (std::size_t y = 0; y < height; ++y)
            statistics::add_squared_rest(squares.data() + y * width, rest.data() + y * width, columns.data(), rows[y],
                                         width);
    }
    // Means of rows and columns take their share of the degrees of freedom.
    double used_rows = 0.0, used_columns = 0.0;
    for (const double count : geometry.row_used)
        used_rows += count > 0.0;
    for (const double count : geometry.column_used)
        used_columns += count > 0.0;
    const double freedom = double(geometry.used) - used_rows - used_columns + 1.0;
    const double factor = double(geometry.used) / std::max(freedom, 1.0) / double(frames - 1);
    std::vector<float> variances;
    variances.reserve(geometry.used);
    for (std::size_t i = 0; i < geometry.pixels; ++i)
        if (geometry.is_used(i))
            variances.push_back(squares[i] * float(factor));
    return variances;
}

void check_codes(const std::uint16_t *codes) {
    if (!codes)
        throw Error(Status::kInvalidArgument,
                    "level of a sequence: codes is NULL; give frame_count * height * width codes.");
}

} // namespace

double sequence_mean_dn(const CaptureLayout &layout, std::size_t sequence, const std::uint16_t *codes,
                        std::uint32_t frame_count) {
    check_codes(codes);
    return sum_codes(Geometry(layout, sequence, frame_count, false), codes).mean;
}

SequenceLevel sequence_level(const CaptureLayout &layout, std::size_t sequence, const std::uint16_t *codes,
                             std::uint32_t frame_count) {
    check_codes(codes);
    const statistics::Geometry geometry(layout, sequence, frame_count, false);
    SequenceLevel level;
    const Totals totals = sum_codes(geometry, codes);
    level.mean_dn = totals.mean;
    if (frame_count < 2)
        return level;
    const double plain = capped_mean(plain_variances(geometry, codes, totals), geometry.frames);
    const std::vector<float> variances = pixel_variances(geometry, codes, totals, float(6.0 * std::sqrt(plain) + 1.0));
    level.temporal_noise_dn = std::sqrt(capped_mean(variances, geometry.frames));
    return level;
}

} // namespace clsp

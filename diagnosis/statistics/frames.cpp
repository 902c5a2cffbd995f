#include "statistics/frames.hpp"

#include "statistics/parallel_for.hpp"

#include <algorithm>
#include <cmath>
#include <mutex>

namespace clsp::statistics {

namespace {

// Sum of the unmasked codes of a frame, exact.
double code_sum(const Geometry &geometry, const std::uint16_t *codes) {
    std::uint64_t total = 0;
    for (std::size_t y = 0; y < geometry.height; ++y) {
        const std::uint16_t *row = codes + y * geometry.width;
        std::uint32_t row_total = 0; // below 2^16 columns of 16 bits
        if (geometry.is_masked()) {
            for (std::size_t x = 0; x < geometry.width; ++x)
                row_total += geometry.weight[y * geometry.width + x] != 0.0f ? row[x] : 0u;
        } else {
            for (std::size_t x = 0; x < geometry.width; ++x)
                row_total += row[x];
        }
        total += row_total;
    }
    return double(total);
}

// Two histograms by turns: a code that repeats does not wait for its own counter.
void count_codes(const Geometry &geometry, const std::uint16_t *codes, std::vector<std::uint64_t> &histogram,
                 std::mutex &mutex) {
    const std::uint32_t last = std::uint32_t(geometry.maximum_code);
    std::vector<std::uint32_t> even(last + 1), odd(last + 1);
    if (geometry.is_masked()) {
        for (std::size_t i = 0; i < geometry.pixels; ++i)
            even[std::min<std::uint32_t>(codes[i], last)] += geometry.weight[i] != 0.0f;
    } else {
        std::size_t i = 0;
        for (; i + 2 <= geometry.pixels; i += 2) {
            ++even[std::min<std::uint32_t>(codes[i], last)];
            ++odd[std::min<std::uint32_t>(codes[i + 1], last)];
        }
        if (i < geometry.pixels)
            ++even[std::min<std::uint32_t>(codes[i], last)];
    }
    const std::lock_guard<std::mutex> lock(mutex);
    for (std::size_t code = 0; code <= last; ++code)
        histogram[code] += std::uint64_t{even[code]} + odd[code];
}

// The code at which light clips: the highest that occurs, if no higher one can (a coarse converter's is below 2^bits - 1).
// maximum + 1 if nothing clips.
std::uint32_t clipping_code(const std::vector<std::uint64_t> &histogram) {
    const auto none = std::uint32_t(histogram.size());
    std::uint32_t highest = none - 1;
    while (highest > 0 && histogram[highest] == 0)
        --highest;
    std::uint32_t next = highest ? highest - 1 : 0;
    while (next > 0 && histogram[next] == 0)
        --next;
    return highest + (highest - next) >= none ? highest : none;
}

// Columns of a row in which any frame clips.
std::vector<std::size_t> clipped_columns(const Geometry &geometry, const std::uint16_t *codes, std::size_t y,
                                         std::uint32_t clipping) {
    const std::size_t width = geometry.width;
    std::vector<std::uint16_t> highest(width);
    for (std::size_t t = 0; t < geometry.frames; ++t) {
        const std::uint16_t *row = codes + t * geometry.pixels + y * width;
        for (std::size_t x = 0; x < width; ++x)
            highest[x] = std::max(highest[x], row[x]);
    }
    std::vector<std::size_t> result;
    for (std::size_t x = 0; x < width; ++x)
        if (highest[x] >= clipping)
            result.push_back(x);
    return result;
}

// One row of all frames: the mean over time, the residuals and their variance.
void make_row(const Geometry &geometry, const std::uint16_t *codes, float black, const std::vector<float> &scale,
              const std::vector<float> &offset, std::uint32_t clipping, std::size_t y, Frames &frames) {
    const std::size_t width = geometry.width, start = y * width;
    // Sums are taken about the mean signal: single precision then holds the noise of bright frames too.
    const float pivot = float(frames.mean_signal);
    std::vector<float> centred(width), squares(width);
    for (std::size_t t = 0; t < geometry.frames; ++t) {
        const std::uint16_t *row = codes + t * geometry.pixels + start;
        add_codes(centred.data(), row, {black, scale[t], offset[t] + pivot}, width);
    }
    const float share = 1.0f / float(geometry.frames);
    float *mean = frames.mean.data() + start;
    for (std::size_t x = 0; x < width; ++x) {
        centred[x] *= share;
        mean[x] = centred[x] + pivot;
    }
    // What clips does not flicker with its frame: scaled, a few bright grains would outweigh the noise of all others. Such a code says
    // nothing of a pixel's mean, unless there is nothing else, nor of its noise.
    std::vector<std::size_t> clipped;
    if (clipping < frames.histogram.size())
        clipped = clipped_columns(geometry, codes, y, clipping);
    for (const std::size_t x : clipped) {
        float total = 0.0f;
        std::size_t kept = 0;
        for (std::size_t t = 0; t < geometry.frames; ++t) {
            const std::uint16_t code = codes[t * geometry.pixels + start + x];
            if (code < clipping) {
                total += scale[t] * (float(code) - black) - offset[t] - pivot;
                ++kept;
            }
        }
        if (kept) {
            centred[x] = total / float(kept);
            mean[x] = centred[x] + pivot;
        }
    }
    const float *weight = geometry.is_masked() ? geometry.weight.data() + start : nullptr;
    if (geometry.frames > 1) {
        for (std::size_t t = 0; t < geometry.frames; ++t) {
            const std::uint16_t *row = codes + t * geometry.pixels + start;
            float *residual = frames.residual.data() + t * geometry.pixels + start;
            residual_codes(residual, row, {black, scale[t], offset[t] + pivot}, centred.data(), width);
            if (weight)
                multiply(residual, residual, weight, width);
            for (const std::size_t x : clipped)
                if (row[x] >= clipping)
                    residual[x] = 0.0f;
            add_squares(squares.data(), residual, width);
            frames.row_mean[t * geometry.height + y] = ratio(sum(residual, width), geometry.row_used[y]);
        }
        const float unbiased = 1.0f / float(geometry.frames - 1);
        for (std::size_t x = 0; x < width; ++x)
            frames.variance[start + x] = squares[x] * unbiased;
    }
    if (weight)
        for (std::size_t x = 0; x < width; ++x)
            mean[x] *= weight[x];
}

} // namespace

Frames make_frames(const Geometry &geometry, const std::uint16_t *codes, const Calibration &calibration,
                   unsigned threads, SpareBuffers<float> &spare) {
    Frames frames;
    const std::size_t count = geometry.frames;
    frames.histogram.assign(std::size_t(geometry.maximum_code) + 1, 0);
    frames.frame_mean.assign(count, 0.0);
    std::mutex mutex;
    parallel_for(count, threads, [&](std::size_t t) {
        const std::uint16_t *frame = codes + t * geometry.pixels;
        frames.frame_mean[t] = code_sum(geometry, frame) / double(geometry.used) - calibration.black_level_dn;
        count_codes(geometry, frame, frames.histogram, mutex);
    });
    for (const double mean : frames.frame_mean)
        frames.mean_signal += mean / double(count);
    frames.read_variance = std::max(calibration.read_noise_dn * calibration.read_noise_dn, 1.0 / 12.0);
    const double read_noise = std::sqrt(frames.read_variance);
    // Where there should be light but is none, relative statistics stay finite.
    frames.light = geometry.is_lit() ? std::max(frames.mean_signal, 0.5 * read_noise) : read_noise;

    // Flicker multiplies the frame; what else changes a frame's mean adds to it.
    std::vector<float> scale(count, 1.0f), offset(count, 0.0f);
    for (std::size_t t = 0; t < count; ++t) {
        if (geometry.is_static_laser() && frames.frame_mean[t] > 0.25 * frames.light)
            scale[t] = float(frames.mean_signal / frames.frame_mean[t]);
        else
            offset[t] = float(frames.frame_mean[t] - frames.mean_signal);
    }

    const std::uint32_t clipping = geometry.is_static_laser() && count > 1 ? clipping_code(frames.histogram)
                                                                           : std::uint32_t(frames.histogram.size());
    frames.mean.assign(geometry.pixels, 0.0f);
    if (count > 1) {
        frames.residual = spare.take(count * geometry.pixels);
        frames.row_mean.resize(count * geometry.height);
        frames.variance.assign(geometry.pixels, 0.0f);
    }
    const float black = float(calibration.black_level_dn);
    constexpr std::size_t kRows = 16; // of a task
    const std::size_t bands = (geometry.height + kRows - 1) / kRows;
    parallel_for(bands, threads, [&](std::size_t band) {
        for (std::size_t y = band * kRows; y < std::min((band + 1) * kRows, geometry.height); ++y)
            make_row(geometry, codes, black, scale, offset, clipping, y, frames);
    });
    frames.pixel_variance = frames.read_variance;
    if (count > 1) {
        frames.pixel_variance = 0.0;
        for (std::size_t y = 0; y < geometry.height; ++y)
            frames.pixel_variance +=
                sum(frames.variance.data() + y * geometry.width, geometry.width) / double(geometry.used);
    }
    return frames;
}

} // namespace clsp::statistics

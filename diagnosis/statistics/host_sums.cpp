// Sums over the pixels of every frame, on the host's threads.
#include "statistics/frame_sums.hpp"

#include "statistics/parallel_for.hpp"

#include <algorithm>
#include <cstdlib>
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
void count_frame(const Geometry &geometry, const std::uint16_t *codes, std::vector<std::uint64_t> &histogram,
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
void make_row(const Geometry &geometry, const std::uint16_t *codes, const ResidualScale &scales, std::size_t y,
              Frames &frames) {
    const std::size_t width = geometry.width, start = y * width;
    // Sums are taken about the mean signal: single precision then holds the noise of bright frames too.
    const float pivot = scales.pivot, black = scales.black;
    const std::vector<float> &scale = scales.scale, &offset = scales.offset;
    const std::uint32_t clipping = scales.clipping;
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
    // What clips does not flicker with its frame: scaled, a few bright speckles would outweigh the noise of all others.
    // Such a code says nothing of a pixel's mean, unless there is nothing else, nor of its noise.
    std::vector<std::size_t> clipped;
    if (scales.any_clip)
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

class HostSums final : public FrameSums {
  public:
    HostSums(unsigned threads, SpareBuffers<float> &spare) : threads_(threads), spare_(spare) {}

    std::vector<double> count_codes(const Geometry &geometry, const std::uint16_t *codes,
                                    std::vector<std::uint64_t> &histogram) override;
    void make_residuals(const Geometry &geometry, const ResidualScale &scale, Frames &frames) override;
    std::vector<ResidualFrameSums> sum_residuals(const Geometry &geometry, const Frames &frames,
                                                 const ResidualWeights &weights,
                                                 const std::vector<std::size_t> &lags) override;
    std::vector<SpeckleFrameSums> sum_speckle(const Geometry &geometry, const Frames &frames) override;
    std::vector<DotLagFrameSums> sum_dot_lags(const Geometry &geometry, const Frames &frames) override;
    std::vector<EdgeFrameSums> sum_edges(const Geometry &geometry) override;
    std::vector<std::vector<double>> frame_differences(const Geometry &geometry, const Frames &frames) override;
    std::vector<const float *> residual_images(const Geometry &geometry, const Frames &frames,
                                               const std::vector<std::size_t> &which) override;

  private:
    unsigned threads_;
    SpareBuffers<float> &spare_;
    const std::uint16_t *codes_ = nullptr;
};

std::vector<double> HostSums::count_codes(const Geometry &geometry, const std::uint16_t *codes,
                                          std::vector<std::uint64_t> &histogram) {
    codes_ = codes;
    std::vector<double> sums(geometry.frames);
    std::mutex mutex;
    parallel_for(geometry.frames, threads_, [&](std::size_t t) {
        const std::uint16_t *frame = codes + t * geometry.pixels;
        sums[t] = code_sum(geometry, frame);
        count_frame(geometry, frame, histogram, mutex);
    });
    return sums;
}

void HostSums::make_residuals(const Geometry &geometry, const ResidualScale &scale, Frames &frames) {
    const std::size_t count = geometry.frames;
    frames.mean.assign(geometry.pixels, 0.0f);
    if (count > 1) {
        frames.residual = spare_.take(count * geometry.pixels);
        frames.row_mean.resize(count * geometry.height);
        frames.variance.assign(geometry.pixels, 0.0f);
    }
    constexpr std::size_t kRows = 16; // of a task
    const std::size_t bands = (geometry.height + kRows - 1) / kRows;
    parallel_for(bands, threads_, [&](std::size_t band) {
        for (std::size_t y = band * kRows; y < std::min((band + 1) * kRows, geometry.height); ++y)
            make_row(geometry, codes_, scale, y, frames);
    });
}

std::vector<ResidualFrameSums> HostSums::sum_residuals(const Geometry &geometry, const Frames &frames,
                                                       const ResidualWeights &weights,
                                                       const std::vector<std::size_t> &lags) {
    const bool is_static_laser = geometry.is_static_laser(), is_moving = geometry.moving;
    std::vector<ResidualFrameSums> parts(geometry.frames);
    parallel_for(geometry.frames, threads_, [&](std::size_t t) {
        ResidualFrameSums &part = parts[t];
        const std::size_t width = geometry.width, height = geometry.height;
        const float *residual = frames.residual_of(geometry, t);
        std::vector<float> columns(width), weighted(width);
        part.temporal.assign(lags.size(), 0.0);
        for (std::size_t y = 0; y < height; ++y) {
            const std::size_t start = y * width;
            const float *row = residual + start;
            part.powers.add(row, width);
            add(columns.data(), row, width);
            const float *left = row;
            if (is_static_laser) {
                multiply(weighted.data(), row, weights.brightness.data() + start, width);
                left = weighted.data();
                for (std::size_t k = 0; k < weights.derivatives.size(); ++k)
                    part.motion[k] += dot(row, weights.derivatives[k].data() + start, width);
            }
            part.square += dot(left, row, width);
            for (std::size_t k = 0; k < lags.size(); ++k)
                if (t + lags[k] < geometry.frames)
                    part.temporal[k] += dot(left, frames.residual_of(geometry, t + lags[k]) + start, width);
        }
        for (std::size_t x = 0; x < width; ++x)
            part.column_variance += ratio(double(columns[x]) * columns[x], geometry.column_used[x]) / double(width);
        if (!is_moving)
            for (std::size_t k = 0; k < kNoiseLags.size(); ++k)
                part.noise[k] = lag_sum(residual, residual, width, height, kNoiseLags[k]);
    });
    return parts;
}

std::vector<SpeckleFrameSums> HostSums::sum_speckle(const Geometry &geometry, const Frames &frames) {
    std::vector<SpeckleFrameSums> parts(geometry.frames);
    parallel_for(geometry.frames, threads_,
                 [&](std::size_t t) { parts[t] = sum_speckle_image(geometry, frames.residual_of(geometry, t)); });
    return parts;
}

std::vector<DotLagFrameSums> HostSums::sum_dot_lags(const Geometry &geometry, const Frames &frames) {
    std::vector<DotLagFrameSums> parts(geometry.frames);
    parallel_for(geometry.frames, threads_, [&](std::size_t t) {
        const float *residual = frames.residual_of(geometry, t);
        for (std::size_t k = 0; k < kDotLags.size(); ++k)
            parts[t][k] = lag_sum(residual, residual, geometry.width, geometry.height, kDotLags[k]);
    });
    return parts;
}

std::vector<EdgeFrameSums> HostSums::sum_edges(const Geometry &geometry) {
    const std::size_t width = geometry.width, height = geometry.height;
    std::vector<EdgeFrameSums> parts(geometry.frames);
    parallel_for(geometry.frames, threads_, [&](std::size_t t) {
        const std::uint16_t *codes = codes_ + t * geometry.pixels;
        EdgeFrameSums &part = parts[t];
        part.columns.assign(width - 1, 0);
        part.rows.assign(height - 1, 0);
        std::vector<std::uint32_t> columns(width - 1);
        for (std::size_t y = 0; y < height; ++y) {
            const std::uint16_t *row = codes + y * width;
            const float *weight = geometry.is_masked() ? geometry.weight.data() + y * width : nullptr;
            if (weight) {
                for (std::size_t x = 0; x + 1 < width; ++x)
                    part.columns[x] +=
                        weight[x] * weight[x + 1] != 0.0f ? std::uint64_t(std::abs(int(row[x + 1]) - int(row[x]))) : 0u;
            } else {
                for (std::size_t x = 0; x + 1 < width; ++x)
                    columns[x] += std::uint32_t(std::abs(int(row[x + 1]) - int(row[x])));
            }
            if (y + 1 == height)
                break;
            std::uint32_t total = 0;
            if (weight) {
                for (std::size_t x = 0; x < width; ++x)
                    total += weight[x] * weight[x + width] != 0.0f
                                 ? std::uint32_t(std::abs(int(row[x + width]) - int(row[x])))
                                 : 0u;
            } else {
                for (std::size_t x = 0; x < width; ++x)
                    total += std::uint32_t(std::abs(int(row[x + width]) - int(row[x])));
            }
            part.rows[y] = total;
        }
        if (!geometry.is_masked())
            for (std::size_t x = 0; x + 1 < width; ++x)
                part.columns[x] = columns[x];
    });
    return parts;
}

std::vector<std::vector<double>> HostSums::frame_differences(const Geometry &geometry, const Frames &frames) {
    const std::size_t width = geometry.width;
    std::vector<std::vector<double>> parts(geometry.frames);
    parallel_for(geometry.frames, threads_, [&](std::size_t t) {
        for (std::size_t lag = 1; lag <= kFarthestRepeat && t + lag < geometry.frames; ++lag) {
            double aa = 0.0, ab = 0.0, bb = 0.0;
            for (std::size_t y = 0; y < geometry.height; y += kRepeatRows) {
                const float *a = frames.residual_of(geometry, t) + y * width,
                            *b = frames.residual_of(geometry, t + lag) + y * width;
                aa += dot(a, a, width);
                ab += dot(a, b, width);
                bb += dot(b, b, width);
            }
            parts[t].push_back(std::max(aa - 2.0 * ab + bb, 0.0));
        }
    });
    return parts;
}

std::vector<const float *> HostSums::residual_images(const Geometry &geometry, const Frames &frames,
                                                     const std::vector<std::size_t> &which) {
    std::vector<const float *> images;
    for (const std::size_t t : which)
        images.push_back(frames.residual_of(geometry, t));
    return images;
}

} // namespace

std::unique_ptr<FrameSums> make_host_sums(unsigned threads, SpareBuffers<float> &spare) {
    return std::make_unique<HostSums>(threads, spare);
}

} // namespace clsp::statistics

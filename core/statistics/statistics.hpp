// Statistics of an image on the device. All calls block. The definitions are in statistics.h of the C API.
#pragma once

#include "runtime/context.hpp"
#include "runtime/image_view.hpp"

#include <cstdint>
#include <memory>
#include <vector>

namespace clsp {

struct Moments {
    std::uint64_t count = 0;
    double mean = 0, standard_deviation = 0, contrast = 0, skewness = 0, excess_kurtosis = 0, minimum = 0, maximum = 0;
};

// mask: empty, every pixel counts.
Moments compute_moments(const std::shared_ptr<Context> &context, cl_command_queue queue, const ImageDescription &image,
                        const ImageDescription &mask);

// bins + 2 counts.
std::vector<std::uint64_t> compute_histogram(const std::shared_ptr<Context> &context, cl_command_queue queue,
                                             const ImageDescription &image, const ImageDescription &mask, double low,
                                             double high, std::uint32_t bins);

// (2 max_lag + 1)^2 values, row by row.
std::vector<float> compute_autocovariance(const std::shared_ptr<Context> &context, cl_command_queue queue,
                                          const ImageDescription &image, std::uint32_t max_lag);

} // namespace clsp

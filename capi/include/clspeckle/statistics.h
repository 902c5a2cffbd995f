/**
 * @file statistics.h
 * @brief First-order statistics, histogram and autocorrelation of an image, computed on the device. All calls block.
 */
#ifndef CLSPECKLE_STATISTICS_H
#define CLSPECKLE_STATISTICS_H

#include "types.h"

#ifdef __cplusplus
extern "C" {
#endif

/** First-order statistics of the pixels that count. */
typedef struct ClspMoments {
    uint32_t struct_size; /**< Size of the struct as the caller knows it. */
    uint32_t reserved;            /**< 0. */
    uint64_t count;               /**< Pixels that count (mask not 0). */
    double mean;                  /**< Sum over count. */
    double standard_deviation;    /**< Divided by count - 1; 0 for one pixel. */
    double contrast;              /**< standard_deviation / mean; NaN where the mean is 0. */
    double skewness;              /**< g1: third central moment over the 3/2 power of the second; NaN for a constant
                                       image. */
    double excess_kurtosis;       /**< g2: fourth central moment over the square of the second, less 3; NaN likewise. */
    double minimum;               /**< Smallest value. */
    double maximum;               /**< Largest value. */
} ClspMoments;

/**
 * @param image UINT8, UINT16 or FLOAT32; NaN and infinite pixels are an error (CLSP_ERROR_INVALID_DATA).
 * @param mask  UINT8 image of the same size, 0 = ignore; NULL: every pixel counts. At least one pixel must count.
 */
CLSP_API ClspStatus clspStatisticsMoments(ClspContext context, cl_command_queue queue, const ClspImage *image,
                                          const ClspImage *mask, ClspMoments *moments);

/**
 * Counts pixels in `bins` equal bins of [low, high); values outside are counted in the first and last bin's neighbours:
 * counts has bins + 2 elements, counts[0] below `low`, counts[bins + 1] at or above `high`.
 */
CLSP_API ClspStatus clspStatisticsHistogram(ClspContext context, cl_command_queue queue, const ClspImage *image,
                                            const ClspImage *mask, double low, double high, uint32_t bins,
                                            uint64_t *counts);

/**
 * Normalized (1 at lag 0) autocovariance of the image less its mean, not periodic (zero-padded, each lag divided by its
 * number of pairs). NaN throughout for a constant image. NaN and infinite pixels are an error
 * (CLSP_ERROR_INVALID_DATA).
 * @param max_lag  largest lag in pixels along each axis, below the smaller side of the image.
 * @param autocovariance host memory, (2 max_lag + 1) x (2 max_lag + 1) floats, lag (0, 0) in the centre.
 */
CLSP_API ClspStatus clspStatisticsAutocovariance(ClspContext context, cl_command_queue queue, const ClspImage *image,
                                                 uint32_t max_lag, float *autocovariance);

#ifdef __cplusplus
}
#endif

#endif /* CLSPECKLE_STATISTICS_H */

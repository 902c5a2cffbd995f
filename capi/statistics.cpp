#include "clspeckle/statistics.h"

#include "convert.hpp"
#include "handles.hpp"
#include "statistics/statistics.hpp"

using namespace clsp;
using namespace clsp::capi;

extern "C" {

CLSP_API ClspStatus clspStatisticsMoments(ClspContext context, cl_command_queue queue, const ClspImage *image,
                                          const ClspImage *mask, ClspMoments *moments) {
    return guarded("clspStatisticsMoments", [&] {
        const auto c = object(context);
        check_struct_size(required(moments, "moments").struct_size, kFirstSize<ClspMoments>, "moments");
        const Moments m = compute_moments(c, queue, description(image, "image"), optional_description(mask, "mask"));
        ClspMoments result{};
        result.count = m.count;
        result.mean = m.mean;
        result.standard_deviation = m.standard_deviation;
        result.contrast = m.contrast;
        result.skewness = m.skewness;
        result.excess_kurtosis = m.excess_kurtosis;
        result.minimum = m.minimum;
        result.maximum = m.maximum;
        write_struct(*moments, result, "moments");
    });
}

CLSP_API ClspStatus clspStatisticsHistogram(ClspContext context, cl_command_queue queue, const ClspImage *image,
                                            const ClspImage *mask, double low, double high, uint32_t bins,
                                            uint64_t *counts) {
    return guarded("clspStatisticsHistogram", [&] {
        const auto c = object(context);
        required(counts, "counts");
        const std::vector<std::uint64_t> result = compute_histogram(
            c, queue, description(image, "image"), optional_description(mask, "mask"), low, high, bins);
        std::copy(result.begin(), result.end(), counts);
    });
}

CLSP_API ClspStatus clspStatisticsAutocovariance(ClspContext context, cl_command_queue queue, const ClspImage *image,
                                                 uint32_t max_lag, float *autocovariance) {
    return guarded("clspStatisticsAutocovariance", [&] {
        const auto c = object(context);
        required(autocovariance, "autocovariance");
        const std::vector<float> result = compute_autocovariance(c, queue, description(image, "image"), max_lag);
        std::copy(result.begin(), result.end(), autocovariance);
    });
}

} // extern "C"

// Moments, histogram and autocovariance against the same sums on the host, and what bad arguments get.
#include "stage_support.hpp"

namespace {

class Statistics : public test::EnqueueTest {
  protected:
    static constexpr std::uint32_t width = 45, height = 31;

    static std::vector<float> noise(double offset = 0.0) {
        std::vector<float> image(width * height);
        std::uint64_t state = 42;
        for (float &value : image) {
            state = state * 6364136223846793005u + 1442695040888963407u; // Knuth's MMIX generator
            value = static_cast<float>(std::pow(static_cast<double>(state >> 40) * 0x1p-24, 2.0) + offset);
        }
        return image;
    }
    struct Moments {
        double mean = 0, deviation = 0, skewness = 0, kurtosis = 0;
    };
    template <typename T> static Moments host_moments(const std::vector<T> &values) {
        const double n = static_cast<double>(values.size());
        Moments result;
        for (T v : values)
            result.mean += v / n;
        double m2 = 0, m3 = 0, m4 = 0;
        for (T v : values) {
            const double d = v - result.mean;
            m2 += d * d / n;
            m3 += d * d * d / n;
            m4 += d * d * d * d / n;
        }
        result.deviation = std::sqrt(m2 * n / (n - 1));
        result.skewness = m3 / std::pow(m2, 1.5);
        result.kurtosis = m4 / (m2 * m2) - 3;
        return result;
    }
};

TEST_F(Statistics, MomentsAgreeWithTheHost) {
    for (double offset : {0.0, 1000.0}) {
        const auto image = noise(offset);
        auto uploaded = upload(image, width, height, CLSP_FORMAT_FLOAT32, 256, 12);
        const ClspMoments got = clspeckle::statistics::moments(context, queue, uploaded.view);
        const Moments expected = host_moments(image);
        EXPECT_EQ(image.size(), got.count);
        EXPECT_NEAR(expected.mean, got.mean, 1e-6 * expected.mean);
        EXPECT_NEAR(expected.deviation, got.standard_deviation, 1e-5 * expected.deviation);
        EXPECT_NEAR(expected.deviation / expected.mean, got.contrast, 1e-5 * expected.deviation / expected.mean);
        EXPECT_NEAR(expected.skewness, got.skewness, 1e-4);
        EXPECT_NEAR(expected.kurtosis, got.excess_kurtosis, 1e-4);
        EXPECT_EQ(*std::min_element(image.begin(), image.end()), got.minimum);
        EXPECT_EQ(*std::max_element(image.begin(), image.end()), got.maximum);
    }
}

TEST_F(Statistics, MaskAndIntegerFormats) {
    std::vector<std::uint16_t> words(width * height);
    std::vector<std::uint8_t> bytes(width * height), mask(width * height);
    std::vector<std::uint16_t> counted;
    for (std::size_t i = 0; i < words.size(); ++i) {
        words[i] = static_cast<std::uint16_t>(i * 40503);
        bytes[i] = static_cast<std::uint8_t>(i * 151);
        mask[i] = i % 3 == 0 ? 2 : 0;
        if (mask[i])
            counted.push_back(words[i]);
    }
    auto words_image = upload(words, width, height, CLSP_FORMAT_UINT16);
    auto bytes_image = upload(bytes, width, height, CLSP_FORMAT_UINT8);
    auto mask_image = upload(mask, width, height, CLSP_FORMAT_UINT8, 100, 3);
    const ClspMoments masked = clspeckle::statistics::moments(context, queue, words_image.view, &mask_image.view);
    const Moments expected = host_moments(counted);
    EXPECT_EQ(counted.size(), masked.count);
    EXPECT_NEAR(expected.mean, masked.mean, 1e-6 * expected.mean);
    EXPECT_NEAR(expected.deviation, masked.standard_deviation, 1e-5 * expected.deviation);
    EXPECT_NEAR(host_moments(bytes).mean, clspeckle::statistics::moments(context, queue, bytes_image.view).mean, 1e-4);

    // One pixel that counts: no deviation.
    std::fill(mask.begin(), mask.end(), std::uint8_t{0});
    mask[100] = 1;
    auto single = upload(mask, width, height, CLSP_FORMAT_UINT8);
    const ClspMoments one = clspeckle::statistics::moments(context, queue, words_image.view, &single.view);
    EXPECT_EQ(1u, one.count);
    EXPECT_EQ(words[100], one.mean);
    EXPECT_EQ(0.0, one.standard_deviation);
    mask[100] = 0;
    auto none = upload(mask, width, height, CLSP_FORMAT_UINT8);
    auto moments = clspeckle::make<ClspMoments>();
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "mask",
                      clspStatisticsMoments(context, queue, &words_image.view, &none.view, &moments));
}

TEST_F(Statistics, NaNWhereARatioHasNoValue) {
    auto zeros = floats(std::vector<float>(width * height, 0.0f), width, height);
    const ClspMoments got = clspeckle::statistics::moments(context, queue, zeros.view);
    EXPECT_EQ(0.0, got.mean);
    EXPECT_EQ(0.0, got.standard_deviation);
    EXPECT_TRUE(std::isnan(got.contrast));
    EXPECT_TRUE(std::isnan(got.skewness));
    EXPECT_TRUE(std::isnan(got.excess_kurtosis));
}

TEST_F(Statistics, HistogramCountsEveryPixelOnce) {
    std::vector<std::uint16_t> words(width * height);
    for (std::size_t i = 0; i < words.size(); ++i)
        words[i] = static_cast<std::uint16_t>(i % 100);
    auto image = upload(words, width, height, CLSP_FORMAT_UINT16);
    const auto counts = clspeckle::statistics::histogram(context, queue, image.view, 10, 90, 8);
    ASSERT_EQ(10u, counts.size());
    std::vector<std::uint64_t> expected(10, 0);
    for (std::uint16_t v : words)
        ++expected[v < 10 ? 0 : v >= 90 ? 9 : 1 + (v - 10) / 10];
    EXPECT_EQ(expected, counts);
    std::vector<std::uint8_t> mask(width * height, 0);
    mask[55] = mask[99] = 1;
    auto mask_image = upload(mask, width, height, CLSP_FORMAT_UINT8);
    const auto masked = clspeckle::statistics::histogram(context, queue, image.view, 10, 90, 8, &mask_image.view);
    EXPECT_EQ((std::vector<std::uint64_t>{0, 0, 0, 0, 0, 1, 0, 0, 0, 1}), masked);
}

TEST_F(Statistics, AutocovarianceAgreesWithTheHost) {
    const auto image = noise();
    const auto lag = std::int64_t{7};
    const auto got = clspeckle::statistics::autocovariance(context, queue, floats(image, width, height).view, 7);
    double mean = 0;
    for (float v : image)
        mean += v / (double(width) * height);
    const auto covariance = [&](std::int64_t dx, std::int64_t dy) {
        double sum = 0, pairs = 0;
        for (std::int64_t y = 0; y < height; ++y) {
            for (std::int64_t x = 0; x < width; ++x) {
                if (x + dx < 0 || x + dx >= width || y + dy < 0 || y + dy >= height)
                    continue;
                sum += (image[static_cast<std::size_t>(y * width + x)] - mean) *
                       (image[static_cast<std::size_t>((y + dy) * width + x + dx)] - mean);
                pairs += 1;
            }
        }
        return sum / pairs;
    };
    const double variance = covariance(0, 0);
    for (std::int64_t dy = -lag; dy <= lag; ++dy)
        for (std::int64_t dx = -lag; dx <= lag; ++dx)
            ASSERT_NEAR(covariance(dx, dy) / variance, got[static_cast<std::size_t>((dy + lag) * 15 + dx + lag)], 2e-5)
                << dx << ", " << dy;
    EXPECT_NEAR(1.0f, got[7 * 15 + 7], 1e-6f);
    auto flat = floats(std::vector<float>(width * height, 3.0f), width, height);
    for (float value : clspeckle::statistics::autocovariance(context, queue, flat.view, 1))
        EXPECT_TRUE(std::isnan(value));
}

TEST_F(Statistics, NotFinitePixelsAreAnError) {
    auto moments = clspeckle::make<ClspMoments>();
    std::vector<std::uint64_t> counts(6);
    std::vector<float> covariance(9);
    for (float bad : {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()}) {
        auto image = noise();
        image[17] = bad;
        auto uploaded = floats(image, width, height);
        EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_DATA, "NaN",
                          clspStatisticsMoments(context, queue, &uploaded.view, nullptr, &moments));
        EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_DATA, "NaN",
                          clspStatisticsHistogram(context, queue, &uploaded.view, nullptr, 0, 1, 4, counts.data()));
        EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_DATA, "NaN",
                          clspStatisticsAutocovariance(context, queue, &uploaded.view, 1, covariance.data()));
        std::vector<std::uint8_t> mask(width * height, 1);
        mask[17] = 0;
        auto mask_image = upload(mask, width, height, CLSP_FORMAT_UINT8);
        EXPECT_CLSP_OK(clspStatisticsMoments(context, queue, &uploaded.view, &mask_image.view, &moments));
    }
}

TEST_F(Statistics, RefuseBadArguments) {
    auto image = floats(noise(), width, height);
    auto mask = upload(std::vector<std::uint8_t>(width * height, 1), width, height, CLSP_FORMAT_UINT8);
    auto moments = clspeckle::make<ClspMoments>();
    std::vector<std::uint64_t> counts(6);
    std::vector<float> covariance(9);
    const test::Foreign foreign;

    const auto argument = CLSP_ERROR_INVALID_ARGUMENT;
    {
        const test::Failures fails("clspStatisticsHistogram");
        const auto run = [&](ClspContext c, cl_command_queue q, const ClspImage *view, double low, double high,
                             std::uint32_t bins, std::uint64_t *to) {
            return clspStatisticsHistogram(c, q, view, nullptr, low, high, bins, to);
        };
        fails(CLSP_ERROR_INVALID_HANDLE, "context", run(nullptr, queue, &image.view, 0, 1, 4, counts.data()));
        fails(argument, "queue", run(context, nullptr, &image.view, 0, 1, 4, counts.data()));
        fails(argument, "counts", run(context, queue, &image.view, 0, 1, 4, nullptr));
        fails(argument, "bins", run(context, queue, &image.view, 0, 1, 0, counts.data()));
        fails(argument, "bins", run(context, queue, &image.view, 0, 1, 0xffffffffu, counts.data()));
        fails(argument, "low", run(context, queue, &image.view, 1, 1, 4, counts.data()));
        fails(argument, "low", run(context, queue, &image.view, test::nan_value, 1, 4, counts.data()));
        fails(argument, "high", run(context, queue, &image.view, 0, test::infinity, 4, counts.data()));
        test::check_image_rules(
            "clspStatisticsHistogram", context, image.view, "image", CLSP_FORMAT_UINT32,
            [&](const ClspImage *view) { return run(context, queue, view, 0, 1, 4, counts.data()); });
    }
    {
        const test::Failures fails("clspStatisticsAutocovariance");
        const auto run = [&](ClspContext c, cl_command_queue q, const ClspImage *view, std::uint32_t lag, float *to) {
            return clspStatisticsAutocovariance(c, q, view, lag, to);
        };
        fails(CLSP_ERROR_INVALID_HANDLE, "context", run(nullptr, queue, &image.view, 1, covariance.data()));
        fails(argument, "queue", run(context, nullptr, &image.view, 1, covariance.data()));
        fails(argument, "autocovariance", run(context, queue, &image.view, 1, nullptr));
        for (std::uint32_t lag : {31u, 0x7fffffffu, 0xffffffffu})
            fails(argument, "max_lag", run(context, queue, &image.view, lag, covariance.data()));
        test::check_image_rules("clspStatisticsAutocovariance", context, image.view, "image", CLSP_FORMAT_UINT32,
                                [&](const ClspImage *view) { return run(context, queue, view, 1, covariance.data()); });
    }
    const test::Failures fails("clspStatisticsMoments");
    const auto run = [&](ClspContext c, cl_command_queue q, const ClspImage *view, const ClspImage *where,
                         ClspMoments *to) { return clspStatisticsMoments(c, q, view, where, to); };
    fails(CLSP_ERROR_INVALID_HANDLE, "context", run(nullptr, queue, &image.view, nullptr, &moments));
    fails(argument, "queue", run(context, nullptr, &image.view, nullptr, &moments));
    fails(CLSP_ERROR_WRONG_CONTEXT, "queue", run(context, foreign.queue, &image.view, nullptr, &moments));
    fails(argument, "image", run(context, queue, nullptr, nullptr, &moments));
    fails(argument, "moments", run(context, queue, &image.view, nullptr, nullptr));
    moments.struct_size = 4;
    fails(CLSP_ERROR_INVALID_STRUCT_SIZE, "struct_size", run(context, queue, &image.view, nullptr, &moments));
    moments.struct_size = sizeof(moments);
    test::check_image_rules("clspStatisticsMoments", context, image.view, "image", CLSP_FORMAT_UINT32,
                            [&](const ClspImage *view) { return run(context, queue, view, nullptr, &moments); });
    check_image(
        "clspStatisticsMoments", "mask", mask.view, CLSP_FORMAT_FLOAT32,
        [&](const ClspImage *view) { return run(context, queue, &image.view, view, &moments); }, true);
}

} // namespace

// The engine's filter of real images, against a direct convolution in double precision.
#include "runtime/context.hpp"
#include "runtime/error.hpp"
#include "stages/filter.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <vector>

namespace {

using namespace clsp;

class Filter : public ::testing::Test {
  protected:
    // One for all tests, gone before main() ends: drivers do not like to be used later.
    static inline std::shared_ptr<Context> shared_context;
    static void SetUpTestSuite() { shared_context = Context::create({}); }
    static void TearDownTestSuite() { shared_context.reset(); }
    static const std::shared_ptr<Context> &context() { return shared_context; }
    cl::CommandQueue queue{context()->cl_context(), context()->device()};

    static constexpr std::uint32_t width = 21, height = 16;
    static constexpr double scale = 1.5;

    struct Image {
        DeviceBuffer buffer;
        ImageView view;
    };
    // Every row in `pitch` floats, the first after `offset` floats.
    Image upload(const std::vector<float> &pixels, std::uint32_t pitch = width, std::uint32_t offset = 0) {
        std::vector<float> memory(offset + std::size_t{pitch} * height, -7.0f);
        for (std::uint32_t y = 0; y < height; ++y)
            for (std::uint32_t x = 0; x < width; ++x)
                memory[offset + y * pitch + x] = pixels[y * width + x];
        Image image{DeviceBuffer(context(), memory.size() * sizeof(float), memory.data()), {}};
        image.view = check_image(
            {image.buffer.get()(), offset * sizeof(float), pitch * sizeof(float), width, height, Format::kFloat32},
            "image", context()->cl_context()(), {width, height}, {Format::kFloat32});
        return image;
    }
    std::vector<float> download(const Image &image) {
        std::vector<float> memory(image.buffer.bytes() / sizeof(float)), pixels(width * height);
        queue.enqueueReadBuffer(image.buffer.get(), CL_TRUE, 0, image.buffer.bytes(), memory.data());
        for (std::uint32_t y = 0; y < height; ++y)
            for (std::uint32_t x = 0; x < width; ++x)
                pixels[y * width + x] = memory[image.view.offset + y * image.view.pitch + x];
        return pixels;
    }
    static std::vector<float> random(unsigned seed, float most = 1.0f) {
        std::mt19937 engine(seed);
        std::uniform_real_distribution<float> uniform(0.0f, most);
        std::vector<float> values(width * height);
        for (float &value : values)
            value = uniform(engine);
        return values;
    }
    // h * values on the filter's periodic grid, whose padding repeats the nearest edge pixel.
    static std::vector<double> convolved(const FftFilter &filter, const PointSpread &h,
                                         const std::vector<double> &values) {
        const int gw = static_cast<int>(filter.grid().grid_width), gh = static_cast<int>(filter.grid().grid_height);
        const auto pixel = [](int i, int pixels, int grid) {
            return i < pixels ? i : i - (pixels - 1) <= grid - i ? pixels - 1 : 0;
        };
        const auto offset = [](int i, int n) { return i < (n + 1) / 2 ? i : i - n; };
        double sum = 0.0;
        std::vector<double> spread(static_cast<std::size_t>(gw) * gh);
        for (int y = 0; y < gh; ++y)
            for (int x = 0; x < gw; ++x)
                sum += spread[y * gw + x] = h(offset(x, gw), offset(y, gh));
        std::vector<double> result(width * height, 0.0);
        for (int y = 0; y < int{height}; ++y)
            for (int x = 0; x < int{width}; ++x)
                for (int v = 0; v < gh; ++v)
                    for (int u = 0; u < gw; ++u)
                        result[y * width + x] += spread[((y - v + gh) % gh) * gw + (x - u + gw) % gw] / sum *
                                                 values[pixel(v, height, gh) * width + pixel(u, width, gw)];
        return result;
    }
    std::vector<float> run(FftFilter &filter, const std::vector<float> &image, double fraction,
                           const std::vector<float> &weight = {}) {
        const Image in = upload(image), out = upload(std::vector<float>(width * height, 0.0f));
        CommandChain chain(queue(), 0, nullptr);
        if (weight.empty()) {
            filter.enqueue(chain, "filter", in.view, out.view, fraction);
        } else {
            const Image w = upload(weight);
            filter.enqueue(chain, "filter", in.view, out.view, fraction, w.view);
            queue.finish();
        }
        return download(out);
    }
};

TEST_F(Filter, MatchesADirectConvolution) {
    const std::vector<float> image = random(1);
    const std::vector<double> exact(image.begin(), image.end());
    const struct {
        PointSpread spread;
        std::uint32_t guard;
    } cases[] = {{exponential_spread(scale), exponential_guard_px(scale, width, height)},
                 {gaussian_spread(2.0), gaussian_guard_px(2.0, width, height)},
                 // Odd and even numbers of rows and of the transform's columns.
                 {exponential_spread(scale), 9},
                 {gaussian_spread(2.0), 11},
                 // No preset, and no other symmetry than the one that is needed: a slanted line.
                 {[](double dx, double dy) { return dx == 2 * dy && std::abs(dy) <= 1 ? 1.0 : 0.0; }, 4}};
    for (const auto &c : cases) {
        FftFilter filter(context(), width, height, c.guard, c.spread);
        const auto spread = convolved(filter, c.spread, exact);
        for (const double fraction : {0.0, 0.3, 1.0}) {
            const auto got = run(filter, image, fraction);
            for (std::size_t i = 0; i < got.size(); ++i)
                EXPECT_NEAR((1 - fraction) * exact[i] + fraction * spread[i], got[i], 1e-6) << i;
        }
    }
}

TEST_F(Filter, WeightsSayHowMuchLeavesEachPixel) {
    const std::vector<float> image = random(2, 3.0f);
    std::vector<float> weight = random(3);
    weight[5] = 2.0f;                                     // as 1
    weight[50] = -1.0f;                                   // as 0
    weight[77] = std::numeric_limits<float>::quiet_NaN(); // as 0
    std::vector<double> leaves(image.size());
    std::vector<double> fraction(image.size());
    for (std::size_t i = 0; i < image.size(); ++i) {
        fraction[i] = std::isnan(weight[i]) ? 0.0 : std::min(std::max(double{weight[i]}, 0.0), 1.0);
        leaves[i] = fraction[i] * image[i];
    }
    const PointSpread h = exponential_spread(scale);
    FftFilter filter(context(), width, height, exponential_guard_px(scale, width, height), h);
    const auto arrives = convolved(filter, h, leaves);
    const auto got = run(filter, image, 0.0, weight);
    for (std::size_t i = 0; i < got.size(); ++i)
        EXPECT_NEAR((1 - fraction[i]) * image[i] + arrives[i], got[i], 3e-6) << i;
    // One fraction for all is the same as a fraction.
    const auto uniform = run(filter, image, 0.0, std::vector<float>(image.size(), 0.4f)), one = run(filter, image, 0.4);
    for (std::size_t i = 0; i < got.size(); ++i)
        EXPECT_NEAR(one[i], uniform[i], 3e-6) << i;
}

TEST_F(Filter, LightInTheMiddleIsKept) {
    // All of it lands within the image, but for what exp(-r) has beyond 8 pixels: 9 exp(-8) = 0.003 at most.
    std::vector<float> image(width * height, 0.0f);
    image[8 * width + 10] = 1.0f;
    FftFilter filter(context(), width, height, exponential_guard_px(1.0, width, height), exponential_spread(1.0));
    double sum = 0.0;
    for (const float value : run(filter, image, 0.0, std::vector<float>(image.size(), 0.6f))) {
        EXPECT_GE(value, 0.0f);
        sum += value;
    }
    EXPECT_NEAR(1.0, sum, 0.6 * 0.003);
}

TEST_F(Filter, FlatImagesStayFlat) {
    FftFilter filter(context(), width, height, 3, exponential_spread(40.0));
    for (const float value : run(filter, std::vector<float>(width * height, 5.0f), 1.0))
        EXPECT_NEAR(5.0f, value, 5e-6f);
}

TEST_F(Filter, BadPixelsSpreadNothingAndStay) {
    std::vector<float> image(width * height, 1.0f), clean = image;
    const std::vector<float> bad = {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity(),
                                    -2.0f};
    for (std::size_t i = 0; i < bad.size(); ++i) {
        image[40 * i + 30] = bad[i];
        clean[40 * i + 30] = 0.0f;
    }
    FftFilter filter(context(), width, height, 8, exponential_spread(scale));
    const auto got = run(filter, image, 0.5), expected = run(filter, clean, 0.5);
    for (std::size_t i = 0; i < got.size(); ++i) {
        if (image[i] == 1.0f)
            EXPECT_EQ(expected[i], got[i]) << i;
        else if (std::isnan(image[i]))
            EXPECT_TRUE(std::isnan(got[i]));
        else
            EXPECT_EQ(image[i], got[i]);
    }
}

TEST_F(Filter, InPlaceOffsetAndPitch) {
    const std::vector<float> image = random(4);
    FftFilter filter(context(), width, height, 8, exponential_spread(scale));
    const auto expected = run(filter, image, 0.5);
    const Image odd = upload(image, width + 5, 11);
    CommandChain chain(queue(), 0, nullptr);
    filter.enqueue(chain, "filter", odd.view, odd.view, 0.5);
    EXPECT_EQ(expected, download(odd));
    std::vector<float> memory(odd.buffer.bytes() / sizeof(float));
    queue.enqueueReadBuffer(odd.buffer.get(), CL_TRUE, 0, odd.buffer.bytes(), memory.data());
    std::size_t outside = 0;
    for (const float value : memory)
        outside += value == -7.0f;
    EXPECT_EQ(memory.size() - image.size(), outside) << "written beside the image";
}

TEST_F(Filter, RefusesBadParameters) {
    const auto fails = [&](auto make, const char *words) {
        try {
            make();
            ADD_FAILURE() << "accepted, expected a message with " << words;
        } catch (const Error &error) {
            EXPECT_EQ(Status::kInvalidArgument, error.status());
            EXPECT_NE(std::string::npos, std::string(error.what()).find(words)) << error.what();
        }
    };
    for (const double bad : {0.0, -1.0, std::nan(""), std::numeric_limits<double>::infinity()}) {
        fails([&] { exponential_spread(bad); }, "scale");
        fails([&] { gaussian_spread(bad); }, "standard deviation");
    }
    fails([&] { FftFilter(context(), width, height, 0, [](double, double) { return 0.0; }); }, "sum of a point spread");
    fails([&] { FftFilter(context(), width, height, 0, [](double, double) { return std::nan(""); }); },
          "sum of a point spread");
    fails([&] { FftFilter(context(), 0, height, 0, exponential_spread(1.0)); }, "image");
    FftFilter filter(context(), width, height, 0, exponential_spread(1.0));
    const Image image = upload(random(6));
    CommandChain chain(queue(), 0, nullptr);
    for (const double bad : {-0.1, 1.1, std::nan("")})
        fails([&] { filter.enqueue(chain, "filter", image.view, image.view, bad); }, "fraction");
    EXPECT_EQ(random(6), download(image)) << "a refused filter changed the image";
}

} // namespace

// Line transforms in lanes behind the Fft interface: two-dimensional transforms in place against sums in double
// precision.
#include "runtime/command_chain.hpp"
#include "runtime/context.hpp"
#include "runtime/device_buffer.hpp"
#include "fft/fft.hpp"
#include "fft/cpu/lanes.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <cstdint>
#include <random>
#include <thread>
#include <vector>

namespace {

using clsp::Context;
using clsp::FftDirection;
using Complex = std::complex<double>;
using Field = std::vector<std::complex<float>>;

constexpr double kPi = 3.14159265358979323846;

const std::shared_ptr<Context> &context() {
    static const std::shared_ptr<Context> context = Context::create({});
    return context;
}

Field noise(std::size_t count, unsigned seed) {
    std::mt19937 generator(seed);
    std::normal_distribution<float> normal;
    Field field(count);
    for (auto &value : field)
        value = {normal(generator), normal(generator)};
    return field;
}

// sum over one axis of exp(-+ 2 pi i j k / n).
std::vector<Complex> line_sums(const std::vector<Complex> &line, double sign) {
    const std::size_t n = line.size();
    std::vector<Complex> result(n);
    for (std::size_t k = 0; k < n; ++k)
        for (std::size_t j = 0; j < n; ++j)
            result[k] += line[j] * std::polar(1.0, sign * 2.0 * kPi * double(j * k % n) / double(n));
    return result;
}

std::vector<Complex> reference(const Field &field, std::uint32_t width, std::uint32_t height, double sign) {
    std::vector<Complex> values(field.begin(), field.end());
    std::vector<Complex> line(width);
    for (std::uint32_t y = 0; y < height; ++y) {
        line.assign(values.begin() + std::ptrdiff_t(y) * width, values.begin() + std::ptrdiff_t(y + 1) * width);
        const auto sums = line_sums(line, sign);
        std::copy(sums.begin(), sums.end(), values.begin() + std::ptrdiff_t(y) * width);
    }
    line.resize(height);
    for (std::uint32_t x = 0; x < width; ++x) {
        for (std::uint32_t y = 0; y < height; ++y)
            line[y] = values[std::size_t{y} * width + x];
        const auto sums = line_sums(line, sign);
        for (std::uint32_t y = 0; y < height; ++y)
            values[std::size_t{y} * width + x] = sums[y];
    }
    return values;
}

Field transformed(clsp::Fft &fft, const Field &field, FftDirection direction) {
    const clsp::DeviceBuffer buffer(context(), field.size() * sizeof field[0], field.data());
    cl::CommandQueue queue(context()->cl_context(), context()->device());
    clsp::CommandChain chain(queue(), 0, nullptr);
    fft.enqueue(chain, direction, "fft", buffer.get(), cl::Buffer());
    Field result(field.size());
    queue.enqueueReadBuffer(buffer.get(), CL_TRUE, 0, result.size() * sizeof result[0], result.data());
    return result;
}

double relative_error(const Field &got, const std::vector<Complex> &expected, double scale) {
    double error = 0.0, power = 0.0;
    for (std::size_t i = 0; i < got.size(); ++i) {
        error += std::norm(Complex(got[i]) - scale * expected[i]);
        power += std::norm(scale * expected[i]);
    }
    return std::sqrt(error / power);
}

struct Size {
    std::uint32_t width, height;
};
class LineTransforms : public testing::TestWithParam<Size> {};

// Lines that fill the vectors and lines that do not, one butterfly and several stages.
INSTANTIATE_TEST_SUITE_P(Sizes, LineTransforms,
                         testing::Values(Size{192, 160}, Size{160, 312}, Size{2, 2}, Size{3, 13}, Size{45, 28},
                                         Size{26, 33}, Size{64, 5}));

TEST_P(LineTransforms, AgreesWithSums) {
    const auto [width, height] = GetParam();
    const auto fft = clsp::make_line_transforms(*context(), width, height);
    if (!clsp::works_in_lanes(*context())) { // clFFT is forced, or the device is a GPU
        EXPECT_FALSE(fft);
        return;
    }
    ASSERT_TRUE(fft);
    const Field field = noise(std::size_t{width} * height, width + height);
    EXPECT_LT(
        relative_error(transformed(*fft, field, FftDirection::kForward), reference(field, width, height, -1.0), 1.0),
        4e-7);
    EXPECT_LT(relative_error(transformed(*fft, field, FftDirection::kInverse), reference(field, width, height, 1.0),
                             1.0 / double(field.size())),
              4e-7);
}

// Threads share a plan: each gets its own field's transform.
TEST(LineTransforms, ServesSeveralThreads) {
    const auto fft = clsp::fft_of(*context(), 48, 40);
    const auto work = [&](unsigned seed) {
        const Field field = noise(48 * 40, seed);
        const auto expected = reference(field, 48, 40, -1.0);
        for (int i = 0; i < 20; ++i)
            ASSERT_LT(relative_error(transformed(*fft, field, FftDirection::kForward), expected, 1.0), 1e-6);
    };
    std::thread other(work, 1u);
    work(2u);
    other.join();
}

TEST(LineTransforms, LeavesOtherSizesToClfft) {
    EXPECT_FALSE(clsp::make_line_transforms(*context(), 17, 16));
    EXPECT_FALSE(clsp::make_line_transforms(*context(), 16, 1));
    EXPECT_FALSE(clsp::make_line_transforms(*context(), 16384, 16));
}

} // namespace

// The benchmarks' C++ version of the CPU engine's passes (bench/native), against sums in double precision and
// against the engine.
#include "native/native_passes.hpp"
#include "test_support.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <cstdint>
#include <random>
#include <stdexcept>
#include <vector>

namespace {

using Complex = std::complex<double>;

constexpr double kPi = 3.14159265358979323846;
constexpr double kTolerance = 2e-6; // relative L2

struct Case {
    native::Order order;
    std::uint32_t width, height;
    double diameter;
};

std::string name_of(const ::testing::TestParamInfo<Case> &info) {
    return std::string(info.param.order == native::Order::kColumnsFirst ? "columns" : "rows") + "_" +
           std::to_string(info.param.width) + "x" + std::to_string(info.param.height) + "_" +
           std::to_string(std::lround(100.0 * info.param.diameter));
}

// In place, of any length: sum_j x[j] exp(sign 2 pi i j k / n) by the smallest factor.
void transform(std::vector<Complex> &x, double sign) {
    const std::size_t n = x.size();
    if (n == 1)
        return;
    std::size_t factor = 2;
    while (n % factor != 0)
        ++factor;
    const std::size_t m = n / factor;
    std::vector<std::vector<Complex>> parts(factor, std::vector<Complex>(m));
    for (std::size_t j = 0; j < n; ++j)
        parts[j % factor][j / factor] = x[j];
    for (auto &part : parts)
        transform(part, sign);
    for (std::size_t k = 0; k < n; ++k) {
        x[k] = 0.0;
        for (std::size_t q = 0; q < factor; ++q)
            x[k] += parts[q][k % m] * std::polar(1.0, sign * 2.0 * kPi * double(q * k % n) / double(n));
    }
}

void transform_plane(std::vector<Complex> &field, std::uint32_t width, std::uint32_t height, double sign) {
    std::vector<Complex> line(width);
    for (std::uint32_t y = 0; y < height; ++y) {
        std::copy_n(field.begin() + std::ptrdiff_t(y) * width, width, line.begin());
        transform(line, sign);
        std::copy(line.begin(), line.end(), field.begin() + std::ptrdiff_t(y) * width);
    }
    line.resize(height);
    for (std::uint32_t x = 0; x < width; ++x) {
        for (std::uint32_t y = 0; y < height; ++y)
            line[y] = field[std::size_t{y} * width + x];
        transform(line, sign);
        for (std::uint32_t y = 0; y < height; ++y)
            field[std::size_t{y} * width + x] = line[y];
    }
}

std::vector<double> reference(const float *phase, const float *ideal, const Case &c) {
    const std::size_t pixels = std::size_t{c.width} * c.height;
    std::vector<Complex> field(pixels);
    for (std::size_t i = 0; i < pixels; ++i)
        field[i] = std::polar(std::sqrt(double(ideal[i])), double(phase[i]));
    transform_plane(field, c.width, c.height, -1.0);
    const std::int64_t w = c.width, h = c.height;
    const double rim = 0.25 * c.diameter * c.diameter * double(w * w) * double(h * h); // frequencies on it are out
    for (std::int64_t y = 0; y < h; ++y)
        for (std::int64_t x = 0; x < w; ++x) {
            const std::int64_t kx = std::min(x, w - x), ky = std::min(y, h - y);
            field[std::size_t(y * w + x)] *=
                double(kx * kx * h * h + ky * ky * w * w) < (1.0 - 1e-12) * rim ? 1.0 / double(pixels) : 0.0;
        }
    transform_plane(field, c.width, c.height, 1.0);
    std::vector<double> intensity(pixels);
    for (std::size_t i = 0; i < pixels; ++i)
        intensity[i] = std::norm(field[i]);
    return intensity;
}

template <class T> double relative_difference(const float *got, const std::vector<T> &wanted) {
    double difference = 0.0, sum = 0.0;
    for (std::size_t i = 0; i < wanted.size(); ++i) {
        const double d = double(got[i]) - double(wanted[i]);
        difference += d * d;
        sum += double(wanted[i]) * double(wanted[i]);
    }
    return std::sqrt(difference / sum);
}

class NativePasses : public ::testing::TestWithParam<Case> {
  protected:
    NativePasses() {
        std::mt19937 generator(7);
        std::uniform_real_distribution<float> turns(-1.0f, 1.0f), light(0.0f, 1.0f);
        for (std::size_t i = 0; i < pixels; ++i) {
            phase[i] = float(2.0 * kPi) * turns(generator);
            ideal[i] = i % 11 == 0 ? 0.0f : light(generator);
            result[i] = -1.0f;
        }
    }

    const Case c = GetParam();
    const std::size_t pixels = std::size_t{c.width} * c.height;
    native::Pages phase = native::allocate_pages(pixels), ideal = native::allocate_pages(pixels),
                  result = native::allocate_pages(pixels);
};

TEST_P(NativePasses, AreTheSumsInDoublePrecision) {
    const std::vector<double> wanted = reference(phase.get(), ideal.get(), c);
    for (const unsigned threads : {1u, 3u}) {
        const auto passes = native::make_passes(c.order, c.width, c.height, c.diameter, threads);
        for (int frame = 0; frame < 2; ++frame) { // nothing may be left over from the first
            passes->intensity(phase.get(), ideal.get(), result.get());
            EXPECT_LT(relative_difference(result.get(), wanted), kTolerance) << threads << " threads, frame " << frame;
        }
    }
}

// Few sizes, as the engine compiles its kernels anew for each.
class NativePassesBesideTheEngine : public NativePasses {};
TEST_P(NativePassesBesideTheEngine, AreTheSame) {
    const clspeckle::Context &context = test::SharedContext::get();
    const clspeckle::Queue queue(context);
    auto phase_desc = clspeckle::make<ClspPhaseDesc>();
    phase_desc.width = c.width;
    phase_desc.height = c.height;
    phase_desc.seed = 7;
    phase_desc.field = CLSP_FIELD_UNIT_PHASOR;
    auto aperture_desc = clspeckle::make<ClspApertureDesc>();
    aperture_desc.width = c.width;
    aperture_desc.height = c.height;
    aperture_desc.relative_diameter = c.diameter;
    aperture_desc.degree_of_polarization = 1.0;
    const clspeckle::Phase surface(context, phase_desc);
    const clspeckle::Aperture aperture(context, aperture_desc);
    surface.enqueue_refresh(queue, 0);

    const clspeckle::Buffer irradiance(context, queue, std::vector<float>(ideal.get(), ideal.get() + pixels));
    const clspeckle::Buffer field(context, 2 * pixels * sizeof(float)), intensity(context, pixels * sizeof(float));
    surface.enqueue_field(queue, 0, field.image(c.width, c.height, CLSP_FORMAT_FLOAT32X2));
    aperture.enqueue_intensity(queue, surface, irradiance.image(c.width, c.height, CLSP_FORMAT_FLOAT32),
                               intensity.image(c.width, c.height, CLSP_FORMAT_FLOAT32));
    const auto z = field.read<float>(queue, 2 * pixels), wanted = intensity.read<float>(queue, pixels);
    for (std::size_t i = 0; i < pixels; ++i)
        phase[i] = float(std::atan2(double(z[2 * i + 1]), double(z[2 * i])));

    const auto passes = native::make_passes(c.order, c.width, c.height, c.diameter);
    passes->intensity(phase.get(), ideal.get(), result.get());
    EXPECT_LT(relative_difference(result.get(), wanted), kTolerance);
}

std::vector<Case> cases() {
    using native::Order;
    std::vector<Case> all;
    for (const double diameter : {0.1, 0.25, 0.5, 0.77, 1.0}) {
        for (const auto &[width, height] :
             {std::pair{64u, 64u}, {128u, 128u}, {64u, 96u}, {160u, 96u}, {256u, 256u}, {512u, 64u}})
            all.push_back({Order::kColumnsFirst, width, height, diameter});
        for (const auto &[width, height] : {std::pair{256u, 64u}, {256u, 256u}, {512u, 96u}})
            all.push_back({Order::kRowsFirst, width, height, diameter});
    }
    // Mixed radices, and groups that are not full.
    for (const Order order : {Order::kColumnsFirst, Order::kRowsFirst}) {
        all.push_back({order, 512, 512, 0.5});
        all.push_back({order, 1280, 720, 0.5});
        all.push_back({order, 1920, 1080, 0.3});
    }
    return all;
}
INSTANTIATE_TEST_SUITE_P(Sizes, NativePasses, ::testing::ValuesIn(cases()), name_of);

INSTANTIATE_TEST_SUITE_P(Sizes, NativePassesBesideTheEngine,
                         ::testing::Values(Case{native::Order::kColumnsFirst, 160, 96, 0.77},
                                           Case{native::Order::kColumnsFirst, 256, 256, 0.5},
                                           Case{native::Order::kRowsFirst, 256, 256, 0.5}),
                         name_of);

TEST(NativePassesRefuse, WhatTheyHaveNoPlanFor) {
    for (const native::Order order : {native::Order::kColumnsFirst, native::Order::kRowsFirst}) {
        EXPECT_THROW(native::make_passes(order, 1000, 512, 0.5), std::invalid_argument);
        EXPECT_THROW(native::make_passes(order, 512, 1000, 0.5), std::invalid_argument);
        EXPECT_THROW(native::make_passes(order, 512, 512, 0.0), std::invalid_argument);
        EXPECT_THROW(native::make_passes(order, 512, 512, 1.5), std::invalid_argument);
        EXPECT_THROW(native::make_passes(order, 512, 512, std::nan("")), std::invalid_argument);
    }
}

} // namespace

// The generated transforms of the engine for GPUs, alone: lines forward, and through a pupil and back,
// against sums in double precision, in groups of every kind.
#include "runtime/context.hpp"
#include "fft/gpu/codelets.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <numeric>
#include <random>
#include <string>
#include <vector>

namespace {

using clsp::Context;
using clsp::LinePlan;
using clsp::WorkGroupShape;
using Complex = std::complex<double>;

constexpr double kPi = 3.14159265358979323846;

Context &context() {
    static const std::shared_ptr<Context> context = Context::create({});
    return *context;
}

// A line after the other, in the order of points or of positions.
const char *const kKernels = R"(
#pragma OPENCL FP_CONTRACT OFF
#define ALWAYS_INLINE __attribute__((always_inline))
typedef float lanes_f;
#define SPREAD(value) (value)
CODELETS
#if FFT_ACROSS
#define LINE (get_local_id(0) % FFT_LINES)
#define T (get_local_id(0) / FFT_LINES)
#else
#define LINE (get_local_id(0) / FFT_ITEMS)
#define T (get_local_id(0) % FFT_ITEMS)
#endif
#define EACH(STAGE, stage, statement) \
    for (uint c = 0; c < STAGE##_COUNT; ++c) \
        if (stage##_takes(T + c * FFT_ITEMS)) \
            for (uint q = 0; q < STAGE##_RADIX; ++q) { \
                const uint p = stage##_point(T + c * FFT_ITEMS, q), i = c * STAGE##_RADIX + q; \
                statement; \
            }
#define BEGIN \
    lines += get_group_id(0) * FFT_LINES * FFT_LENGTH + LINE * FFT_LENGTH; \
    __local float *tile = tiles + LINE * FFT_LINE_STRIDE; \
    const uint t = T; \
    float re[FFT_POINTS], im[FFT_POINTS];
__kernel void forward(__global float2 *lines, __global const float2 *twiddles, __local float *tiles) {
    BEGIN
    EACH(FFT_FIRST, fft_first, re[i] = lines[p].x; im[i] = lines[p].y)
    fft_forward(t, re, im, tile, twiddles);
    EACH(FFT_LAST, fft_last, lines[p] = (float2)(re[i], im[i]))
}
// Positions p % 3 == 1 are stopped, and runs that never pass are not asked for.
__kernel void filter(__global float2 *lines, __global const float2 *twiddles, __local float *tiles) {
    BEGIN
    EACH(FFT_FIRST, fft_first, re[i] = lines[p].x; im[i] = lines[p].y)
    fft_forward(t, re, im, tile, twiddles);
    EACH(FFT_LAST, fft_last, if (FFT_LAST_NEVER >> q & 1u) re[i] = im[i] = NAN; else if (p % 3u == 1u) re[i] = im[i] = 0.0f)
    fft_inverse(t, re, im, tile, twiddles);
    // By way of the tile, into points that another work-item wrote. As floats: a member of a vector is stored with the others.
    __global float *parts = (__global float *)lines;
    EACH(FFT_FIRST, fft_first, tile[FFT_TILE_STRIDE * (fft_tile_at(p))] = re[i])
    barrier(CLK_LOCAL_MEM_FENCE);
    for (uint p = t; p < FFT_LENGTH; p += FFT_ITEMS)
        parts[2 * p] = tile[FFT_TILE_STRIDE * (fft_tile_at(p))];
    EACH(FFT_FIRST, fft_first, parts[2 * p + 1] = im[i])
}
)";

// sum_x v[x] exp(sign 2 pi i k x / n), as a plain sum.
std::vector<Complex> transform(const std::vector<Complex> &v, double sign) {
    const std::size_t n = v.size();
    std::vector<Complex> turns(n), result(n);
    for (std::size_t i = 0; i < n; ++i)
        turns[i] = std::polar(1.0, sign * 2.0 * kPi * double(i) / double(n));
    for (std::size_t k = 0; k < n; ++k)
        for (std::size_t x = 0; x < n; ++x)
            result[k] += v[x] * turns[k * x % n];
    return result;
}

double relative_error(const std::vector<Complex> &got, const std::vector<Complex> &expected) {
    double error = 0, power = 0;
    for (std::size_t i = 0; i < got.size(); ++i) {
        error += std::norm(got[i] - expected[i]);
        power += std::norm(expected[i]);
    }
    return std::sqrt(error / power);
}

// never: runs of the last stage that the pupil stops.
void check(std::uint32_t n, const WorkGroupShape &shape, std::uint32_t never) {
    SCOPED_TRACE(std::to_string(n) + " points, " + std::to_string(shape.lines) + " lines, " +
                 std::to_string(shape.items) + " work-items each, " + (shape.split ? "split, " : "") +
                 (shape.across ? "across" : "along") + ", without the runs " + std::to_string(never));
    const LinePlan plan = clsp::make_gpu_plan(n);
    std::vector<bool> passes(n, true);
    for (std::uint32_t p = 0; p < n; ++p)
        if (never >> p % plan.radices.back() & 1u)
            passes[plan.frequencies[p]] = false;
    const clsp::PassBand band = clsp::pass_band(plan, passes);
    EXPECT_EQ(never, band.never);
    EXPECT_EQ((1u << plan.radices.back()) - 1u - never, band.always);
    std::string source = kKernels;
    const std::string mark = "CODELETS";
    source.replace(source.find(mark), mark.size(), clsp::gpu_codelets(plan, shape, band));
    const cl::Program program(context().cl_context(), source);
    try {
        program.build({context().device()}, "-cl-std=CL1.2");
    } catch (const cl::Error &) {
        FAIL() << program.getBuildInfo<CL_PROGRAM_BUILD_LOG>(context().device());
    }
    const std::uint32_t groups = 2, lines = groups * shape.lines;
    std::mt19937 engine(n * 31 + shape.items);
    std::normal_distribution<float> normal;
    std::vector<float> values(std::size_t{2} * n * lines);
    for (float &value : values)
        value = normal(engine);
    std::vector<float> twiddles = clsp::gpu_twiddles(plan);
    twiddles.resize(std::max<std::size_t>(twiddles.size(), 2));
    const cl::CommandQueue queue(context().cl_context(), context().device());
    const auto run = [&](const char *name) {
        std::vector<float> result = values;
        const auto upload = [](std::vector<float> &from) {
            return cl::Buffer(context().cl_context(), CL_MEM_COPY_HOST_PTR, from.size() * sizeof(float), from.data());
        };
        const cl::Buffer buffer = upload(result), table = upload(twiddles);
        cl::Kernel kernel(program, name);
        kernel.setArg(0, buffer);
        kernel.setArg(1, table);
        kernel.setArg(2, cl::Local(clsp::gpu_tile_bytes(plan, shape)));
        queue.enqueueNDRangeKernel(kernel, cl::NullRange, cl::NDRange(groups * shape.work_items()),
                                   cl::NDRange(shape.work_items()));
        queue.enqueueReadBuffer(buffer, CL_TRUE, 0, result.size() * sizeof(float), result.data());
        return result;
    };
    const std::vector<float> forward = run("forward"), filtered = run("filter");
    for (std::uint32_t line = 0; line < lines; ++line) {
        const auto at = [&](const std::vector<float> &v, std::uint32_t p) {
            return Complex(v[2 * (std::size_t{line} * n + p)], v[2 * (std::size_t{line} * n + p) + 1]);
        };
        std::vector<Complex> points(n), got_spectrum(n), got_filtered(n);
        for (std::uint32_t p = 0; p < n; ++p) {
            points[p] = at(values, p);
            got_spectrum[plan.frequencies[p]] = at(forward, p);
            got_filtered[p] = at(filtered, p);
        }
        std::vector<Complex> expected = transform(points, -1.0);
        EXPECT_LT(relative_error(got_spectrum, expected), 4e-7) << "forward, line " << line;
        for (std::uint32_t p = 0; p < n; ++p)
            if (p % 3 == 1 || !passes[plan.frequencies[p]])
                expected[plan.frequencies[p]] = 0;
        EXPECT_LT(relative_error(got_filtered, transform(expected, 1.0)), 5e-7) << "filter, line " << line;
    }
}

class Group : public testing::TestWithParam<std::uint32_t> {};

// Every butterfly, alone and in company; work-items that divide the butterflies and such that leave some idle.
TEST_P(Group, AgreesWithTheSumInDoublePrecision) {
    const std::uint32_t n = GetParam();
    const LinePlan plan = clsp::make_gpu_plan(n);
    EXPECT_EQ(n, std::accumulate(plan.radices.begin(), plan.radices.end(), 1u, std::multiplies<>()));
    const std::uint32_t items = clsp::items_for(plan, 64, 32);
    ASSERT_GT(items, 0u);
    const bool even = n % 2 == 0;
    // A band around frequency 0, as a pupil has it: the middle runs are stopped.
    const std::uint32_t radix = plan.radices.back();
    std::uint32_t middle = 0;
    for (std::uint32_t q = 0; q < radix; ++q)
        if (4 * q > radix && 4 * q < 3 * radix)
            middle |= 1u << q;
    check(n, {4, items, even, true}, 0);
    check(n, {even ? 1u : 3u, std::max(1u, items - 1), !even, false}, middle);
    check(n, {2, items, !even, true}, middle);
}

INSTANTIATE_TEST_SUITE_P(Lengths, Group,
                         testing::Values(2u, 3u, 4u, 5u, 13u, 14u, 22u, 42u, 64u, 128u, 143u, 225u, 720u, 1080u));

TEST(PassBand, KnowsWhichRunsPass) {
    // 16 points in one stage: run q is frequency q. 48 = 6 * 8: run q is frequencies 6 q to 6 q + 5.
    std::vector<bool> passes(16, false);
    passes[0] = passes[1] = passes[15] = true;
    clsp::PassBand band = clsp::pass_band(clsp::make_gpu_plan(16), passes);
    EXPECT_EQ(0x8003u, band.always);
    EXPECT_EQ(0x7ffcu, band.never);
    const LinePlan plan = clsp::make_gpu_plan(48);
    ASSERT_EQ((std::vector<std::uint32_t>{6, 8}), plan.radices);
    passes.assign(48, false);
    for (std::uint32_t f = 0; f < 48; ++f)
        passes[f] = f < 10 || f > 39;
    band = clsp::pass_band(plan, passes);
    EXPECT_EQ(0x81u, band.always); // 0 to 5, 42 to 47
    EXPECT_EQ(0x3cu, band.never);  // 12 to 35
}

TEST(WorkGroupShapes, FitTheirDevices) {
    struct Case {
        std::uint32_t length, work_items;
        std::uint64_t local_bytes;
        std::uint32_t lines; // across, at least
    };
    // What GPUs have: 1024 work-items and 48 KB; 256 and 64 KB; 512 and 64 KB. What little ones have: 128 and 16 KB.
    const Case cases[] = {{512, 1024, 48 << 10, 8},  {1080, 1024, 48 << 10, 4}, {1080, 256, 64 << 10, 4},
                          {2048, 1024, 48 << 10, 4}, {2048, 256, 64 << 10, 4},  {4096, 1024, 48 << 10, 2},
                          {8192, 1024, 48 << 10, 1}, {1280, 512, 64 << 10, 4},  {512, 128, 16 << 10, 4},
                          {1080, 128, 16 << 10, 2},  {2, 1024, 48 << 10, 8},    {13, 64, 48 << 10, 8}};
    for (const Case &c : cases) {
        const LinePlan plan = clsp::make_gpu_plan(c.length);
        for (const bool across : {true, false}) {
            SCOPED_TRACE(std::to_string(c.length) + (across ? " across" : " along"));
            const auto shape = clsp::choose_shape(plan, {c.work_items, c.local_bytes}, across);
            ASSERT_TRUE(shape);
            EXPECT_EQ(across, shape->across);
            EXPECT_LE(shape->work_items(), c.work_items);
            EXPECT_LE(clsp::gpu_tile_bytes(plan, *shape), c.local_bytes);
            EXPECT_LE(clsp::points_per_item(plan, shape->items), 32u);
            EXPECT_GE(shape->lines, across ? c.lines : 1u);
        }
    }
    EXPECT_FALSE(clsp::choose_shape(clsp::make_gpu_plan(8192), {1024, 16 << 10}, true))
        << "a line is 32 KB at least";
    EXPECT_FALSE(clsp::choose_shape(clsp::make_gpu_plan(8192), {1024, 16 << 10}, false));
    // One work-item alone can hold everything.
    EXPECT_TRUE(clsp::choose_shape(clsp::make_gpu_plan(64), {1, 16 << 10}, true));
}

TEST(GpuPlan, HasFewStages) {
    using Radices = std::vector<std::uint32_t>;
    EXPECT_EQ((Radices{8, 16, 16}), clsp::make_gpu_plan(2048).radices);
    EXPECT_EQ((Radices{9, 10, 12}), clsp::make_gpu_plan(1080).radices);
    EXPECT_EQ((Radices{8, 9, 10}), clsp::make_gpu_plan(720).radices);
    EXPECT_EQ((Radices{13}), clsp::make_gpu_plan(13).radices);
    EXPECT_EQ((Radices{8, 9, 10, 11}), clsp::make_gpu_plan(7920).radices);
}

} // namespace

// The generated line transforms of the engine for CPUs, alone: forward, inverse and filtered lines against sums in
// double precision.
#include "runtime/context.hpp"
#include "runtime/error.hpp"
#include "fft/cpu/codelets.hpp"

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
using Complex = std::complex<double>;

constexpr double kPi = 3.14159265358979323846;

Context &context() {
    static const std::shared_ptr<Context> context = Context::create({});
    return *context;
}

// Every kernel takes one strip: LANES lines of FFT_LENGTH points, planar vectors as in a tile.
const char *const kKernels = R"(
#pragma OPENCL FP_CONTRACT OFF
#define JOIN_(a, b) a##b
#define JOIN(a, b) JOIN_(a, b)
typedef JOIN(float, LANES) lanes_f;
typedef JOIN(uint, LANES) lanes_u;
#define shuffle_lanes(a, b, places) shuffle2(a, b, (lanes_u)(places))
#define SPREAD(value) ((lanes_f)(value))
#define FFT_TILE __local
#define FFT_STRIPS 1
#define FFT_INPUT(strip, p, re, im) re = line[2u * (p)], im = line[2u * (p) + 1u]
#define FFT_OUTPUT(strip, p, re, im) line[2u * (p)] = re, line[2u * (p) + 1u] = im
#define FFT_PUPIL_PARAMETERS , __global const float *pupil
#define FFT_PUPIL_ARGUMENTS , pupil
#define FFT_PUPIL(p, re, im) { re *= SPREAD(pupil[p]); im *= SPREAD(pupil[p]); }
CODELETS
__kernel void forward(__global lanes_f *line, __global const float *twiddles, __global const uchar *ends, __local lanes_f *tiles) {
    fft_forward_first
    for (uint block = 0; block < FFT_BLOCKS; ++block)
        fft_forward_block(block, tiles, twiddles FFT_ENDS_ARGUMENT);
    for (uint p = 0; p < 2u * FFT_LENGTH; ++p)
        line[p] = tiles[p];
}
__kernel void inverse(__global lanes_f *line, __global const float *twiddles, __global const uchar *ends, __local lanes_f *tiles) {
    for (uint p = 0; p < 2u * FFT_LENGTH; ++p)
        tiles[p] = line[p];
    for (uint block = 0; block < FFT_BLOCKS; ++block)
        fft_inverse_block(block, tiles, twiddles FFT_ENDS_ARGUMENT);
    fft_inverse_last
}
__kernel void filter(__global lanes_f *line, __global const float *twiddles, __global const uchar *ends, __global const float *pupil,
                     __local lanes_f *tiles) {
    fft_forward_first
    for (uint block = 0; block < FFT_BLOCKS; ++block)
        fft_filter_block(block, tiles, twiddles FFT_ENDS_ARGUMENT, pupil);
    fft_inverse_last
}
__kernel void transposed(__global lanes_f *matrix) {
    lanes_f v[LANES];
    for (uint i = 0; i < LANES; ++i)
        v[i] = matrix[i];
    transpose_lanes(v);
    for (uint i = 0; i < LANES; ++i)
        matrix[i] = v[i];
}
)";

struct Lines {
    std::uint32_t length, lanes;
    std::vector<float> values; // [point][re, im][lane]

    Lines(std::uint32_t n, std::uint32_t l) : length(n), lanes(l), values(std::size_t{2} * n * l) {}
    Complex at(std::uint32_t point, std::uint32_t lane) const {
        const std::size_t i = std::size_t{2} * point * lanes + lane;
        return {values[i], values[i + lanes]};
    }
    void set(std::uint32_t point, std::uint32_t lane, Complex z) {
        const std::size_t i = std::size_t{2} * point * lanes + lane;
        values[i] = static_cast<float>(z.real());
        values[i + lanes] = static_cast<float>(z.imag());
    }
};

Lines random_lines(std::uint32_t length, std::uint32_t lanes) {
    std::mt19937 engine(length * 31 + lanes);
    std::normal_distribution<float> normal;
    Lines lines(length, lanes);
    for (float &value : lines.values)
        value = normal(engine);
    return lines;
}

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

class Codelets {
  public:
    // pruned: the kernels leave alone what does not count, as leave_alone() says.
    Codelets(const LinePlan &plan, std::uint32_t lanes, bool pruned = false)
        : plan_(plan), lanes_(lanes), queue_(context().cl_context(), context().device()) {
        std::string source = kKernels;
        const std::string mark = "CODELETS";
        source.replace(source.find(mark), mark.size(), clsp::cpu_codelets(plan, lanes));
        program_ = cl::Program(context().cl_context(), source);
        try {
            program_.build({context().device()},
                           ("-cl-std=CL1.2 -DLANES=" + std::to_string(lanes) + (pruned ? " -DFFT_ENDS" : "")).c_str());
        } catch (const cl::Error &) {
            ADD_FAILURE() << program_.getBuildInfo<CL_PROGRAM_BUILD_LOG>(context().device());
            throw;
        }
    }

    void leave_alone(std::vector<std::uint8_t> ends) { ends_ = std::move(ends); }

    Lines run(const char *name, Lines lines, std::vector<float> pupil = {}) const {
        cl::Kernel kernel(program_, name);
        const cl::Buffer buffer = upload(lines.values), twiddles = upload(plan_.twiddles), filter = upload(pupil),
                         ends = upload(ends_);
        cl_uint index = 0;
        kernel.setArg(index++, buffer);
        if (std::string(name) != "transposed") {
            kernel.setArg(index++, twiddles);
            kernel.setArg(index++, ends);
            if (!pupil.empty())
                kernel.setArg(index++, filter);
            kernel.setArg(index++, cl::Local((std::size_t{plan_.length} + 1) * 2 * lanes_ * sizeof(float)));
        }
        queue_.enqueueNDRangeKernel(kernel, cl::NullRange, cl::NDRange(1), cl::NDRange(1));
        queue_.enqueueReadBuffer(buffer, CL_TRUE, 0, lines.values.size() * sizeof(float), lines.values.data());
        return lines;
    }

  private:
    template <typename T> static cl::Buffer upload(std::vector<T> values) {
        values.resize(std::max<std::size_t>(values.size(), 1));
        return cl::Buffer(context().cl_context(), CL_MEM_COPY_HOST_PTR, values.size() * sizeof(T), values.data());
    }

    LinePlan plan_;
    std::uint32_t lanes_;
    std::vector<std::uint8_t> ends_;
    cl::CommandQueue queue_;
    cl::Program program_;
};

// Every butterfly, alone and in company; one to five stages.
const std::uint32_t kLengths[] = {2,  3,  4,  5,  7,   8,   11,  13,  14,  16,  21,
                                  35, 48, 64, 90, 128, 143, 189, 270, 512, 540, 1024};

class Line : public testing::TestWithParam<std::uint32_t> {};

TEST_P(Line, PlanTakesTheLengthApart) {
    const LinePlan plan = clsp::make_cpu_plan(GetParam());
    EXPECT_EQ(GetParam(), std::accumulate(plan.radices.begin(), plan.radices.end(), 1u, std::multiplies<>()));
    std::vector<std::uint32_t> sorted = plan.frequencies;
    std::sort(sorted.begin(), sorted.end());
    for (std::uint32_t i = 0; i < GetParam(); ++i)
        ASSERT_EQ(i, sorted[i]) << "every frequency stands at one position";
}

// Relative RMS over a line; single precision rounds each of up to ten levels of additions to 6e-8 / sqrt(3).
TEST_P(Line, AgreesWithTheSumInDoublePrecision) {
    const std::uint32_t n = GetParam();
    const LinePlan plan = clsp::make_cpu_plan(n);
    const std::size_t local = context().device().getInfo<CL_DEVICE_LOCAL_MEM_SIZE>();
    const bool eight_fit = (std::size_t{n} + 1) * 2 * 8 * sizeof(float) <= local; // not all do on GPUs
    for (const std::uint32_t lanes : {4u, 8u}) {
        if (lanes == 4 ? eight_fit && n > 100 : !eight_fit)
            continue;
        const Codelets codelets(plan, lanes);
        const Lines lines = random_lines(n, lanes);
        std::vector<float> pupil(n);
        for (std::uint32_t p = 0; p < n; ++p)
            pupil[p] = p % 3 == 1 ? 0.0f : 0.25f + static_cast<float>(p % 5);
        const Lines forward = codelets.run("forward", lines), inverse = codelets.run("inverse", lines),
                    filtered = codelets.run("filter", lines, pupil);
        double error_forward = 0, error_inverse = 0, error_filter = 0, power = 0, filter_power = 0;
        for (std::uint32_t lane = 0; lane < lanes; ++lane) {
            std::vector<Complex> v(n), reordered(n);
            for (std::uint32_t p = 0; p < n; ++p) {
                v[p] = lines.at(p, lane);
                reordered[plan.frequencies[p]] = lines.at(p, lane);
            }
            std::vector<Complex> spectrum = transform(v, -1.0);
            const std::vector<Complex> image = transform(reordered, 1.0);
            for (std::uint32_t p = 0; p < n; ++p) {
                error_forward += std::norm(forward.at(p, lane) - spectrum[plan.frequencies[p]]);
                error_inverse += std::norm(inverse.at(p, lane) - image[p]);
                power += std::norm(image[p]);
            }
            for (std::uint32_t p = 0; p < n; ++p)
                spectrum[plan.frequencies[p]] *= double(pupil[p]);
            const std::vector<Complex> back = transform(spectrum, 1.0);
            for (std::uint32_t p = 0; p < n; ++p) {
                error_filter += std::norm(filtered.at(p, lane) - back[p]);
                filter_power += std::norm(back[p]);
            }
        }
        EXPECT_LT(std::sqrt(error_forward / power), 3e-7) << n << " points, " << lanes << " lanes";
        EXPECT_LT(std::sqrt(error_inverse / power), 3e-7) << n << " points, " << lanes << " lanes";
        EXPECT_LT(std::sqrt(error_filter / filter_power), 4e-7) << n << " points, " << lanes << " lanes";
    }
}

// Of a low-pass only what it lets through is made and read: the same numbers there, whatever lies elsewhere.
TEST_P(Line, LeavesAloneWhatALowPassStops) {
    const std::uint32_t n = GetParam();
    const LinePlan plan = clsp::make_cpu_plan(n);
    constexpr std::uint32_t lanes = 4;
    const Codelets all(plan, lanes);
    Codelets some(plan, lanes, true);
    // Nothing, one frequency, and parts of the spectrum; the last is not symmetric.
    for (const double part : {-1.0, 0.0, 0.1, 0.25, 0.5, 0.75, 1.0, 2.0}) {
        const auto passes = [&](std::uint32_t p) {
            const double f = plan.frequencies[p];
            return part > 1.0 ? f > 0.55 * n && f < 0.8 * n : 2.0 * std::min(f, n - f) <= part * n;
        };
        const std::vector<std::uint8_t> ends = clsp::needed_ends(plan, passes);
        std::uint32_t spared = 0, counted = 0;
        Lines cut = random_lines(n, lanes), torn = cut;
        std::vector<float> pupil(n, 0.0f);
        for (std::uint32_t p = 0; p < n; ++p) {
            const bool read = clsp::within_ends(plan, ends, p);
            spared += !read;
            counted += passes(p);
            ASSERT_TRUE(read || !passes(p)) << p;
            for (std::uint32_t lane = 0; lane < lanes; ++lane) {
                cut.set(p, lane, passes(p) ? cut.at(p, lane) : 0.0);
                torn.set(p, lane, read ? cut.at(p, lane) : std::nan(""));
            }
            pupil[p] = passes(p) ? 0.5f + static_cast<float>(p % 3) : 0.0f;
        }
        if (part <= 0.25 && n >= 64) {
            EXPECT_GT(2 * spared, n - counted) << "half of what is stopped costs nothing";
        }
        if (part == 1.0) {
            EXPECT_EQ(0u, spared);
        }
        some.leave_alone(ends);
        const Lines field = random_lines(n, lanes), forward = some.run("forward", field),
                    whole = all.run("forward", field);
        double power = 0, back_error = 0, filter_error = 0;
        const Lines back = some.run("inverse", torn), expected = all.run("inverse", cut);
        const Lines filtered = some.run("filter", field, pupil), filter_expected = all.run("filter", field, pupil);
        for (std::uint32_t p = 0; p < n; ++p)
            for (std::uint32_t lane = 0; lane < lanes; ++lane) {
                if (passes(p)) {
                    EXPECT_LT(std::abs(forward.at(p, lane) - whole.at(p, lane)), 1e-6 * std::sqrt(double(n))) << p;
                }
                power += std::norm(expected.at(p, lane)) + std::norm(filter_expected.at(p, lane));
                back_error += std::norm(back.at(p, lane) - expected.at(p, lane));
                filter_error += std::norm(filtered.at(p, lane) - filter_expected.at(p, lane));
            }
        EXPECT_LE(std::sqrt(back_error), 3e-7 * std::sqrt(power)) << n << " points, part " << part;
        EXPECT_LE(std::sqrt(filter_error), 3e-7 * std::sqrt(power)) << n << " points, part " << part;
    }
}

INSTANTIATE_TEST_SUITE_P(Lengths, Line, testing::ValuesIn(kLengths));

TEST(Codelets, TransposeChangesLanesAndVectors) {
    for (const std::uint32_t lanes : {4u, 8u, 16u}) {
        const Codelets codelets(clsp::make_cpu_plan(2), lanes);
        Lines matrix(lanes, lanes); // twice as many values as needed
        for (std::uint32_t i = 0; i < lanes * lanes; ++i)
            matrix.values[i] = static_cast<float>(i);
        const Lines result = codelets.run("transposed", matrix);
        for (std::uint32_t i = 0; i < lanes; ++i)
            for (std::uint32_t l = 0; l < lanes; ++l)
                ASSERT_EQ(static_cast<float>(l * lanes + i), result.values[i * lanes + l]) << i << ' ' << l;
    }
}

TEST(Plan, RefusesWhatHasNoButterfly) {
    for (const std::uint32_t length : {0u, 1u, 17u, 34u, 4099u, 8193u, 16384u}) {
        EXPECT_FALSE(clsp::plan_exists(length)) << length;
        try {
            clsp::make_cpu_plan(length);
            ADD_FAILURE() << length << " was taken";
        } catch (const clsp::Error &error) {
            EXPECT_EQ(clsp::Status::kUnsupported, error.status());
            EXPECT_NE(std::string::npos, std::string(error.what()).find(std::to_string(length) + " points"));
        }
    }
    for (const std::uint32_t length : {2u, 13u, 1080u, 1920u, 4096u, 8192u})
        EXPECT_TRUE(clsp::plan_exists(length)) << length;
}

} // namespace

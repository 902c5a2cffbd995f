// The engine's warp of vectors between pixels, against the definition: the distorted place of p + s, less that of p.
#include "runtime/context.hpp"
#include "runtime/error.hpp"
#include "stages/lens.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace {

using namespace clsp;

class LensShift : public ::testing::Test {
  protected:
    // One for all tests, gone before main() ends: drivers do not like to be used later.
    static inline std::shared_ptr<Context> shared_context;
    static void SetUpTestSuite() { shared_context = Context::create({}); }
    static void TearDownTestSuite() { shared_context.reset(); }
    static const std::shared_ptr<Context> &context() { return shared_context; }
    cl::CommandQueue queue{context()->cl_context(), context()->device()};

    struct Image {
        DeviceBuffer buffer;
        ImageView view;
    };
    // Rows of `pitch` vectors, the first after one vector.
    Image image(const LensParameters &p, const std::vector<cl_float2> &vectors, std::uint32_t pitch) {
        std::vector<cl_float2> memory(1 + std::size_t{pitch} * p.height, cl_float2{{-7.0f, -7.0f}});
        for (std::uint32_t y = 0; y < p.height; ++y)
            for (std::uint32_t x = 0; x < p.width; ++x)
                memory[1 + y * pitch + x] = vectors[y * p.width + x];
        Image made{DeviceBuffer(context(), memory.size() * sizeof(cl_float2), memory.data()), {}};
        made.view = check_image({made.buffer.get()(), sizeof(cl_float2), pitch * sizeof(cl_float2), p.width, p.height,
                                 Format::kFloat32x2},
                                "image", context()->cl_context()(), {p.width, p.height}, {Format::kFloat32x2});
        return made;
    }
    std::vector<cl_float2> distort(Lens &lens, const std::vector<cl_float2> &vectors) {
        const LensParameters &p = lens.parameters();
        const Image ideal = image(p, vectors, p.width + 3);
        const Image distorted =
            image(p, std::vector<cl_float2>(vectors.size(), cl_float2{{9.0f, 9.0f}}), p.width + 1);
        CommandChain chain(queue(), 0, nullptr);
        lens.enqueue_distort_shift(chain, ideal.view, distorted.view);
        std::vector<cl_float2> memory(distorted.buffer.bytes() / sizeof(cl_float2)), result(vectors.size());
        queue.finish();
        queue.enqueueReadBuffer(distorted.buffer.get(), CL_TRUE, 0, distorted.buffer.bytes(), memory.data());
        for (std::uint32_t y = 0; y < p.height; ++y)
            for (std::uint32_t x = 0; x < p.width; ++x)
                result[y * p.width + x] = memory[1 + y * (p.width + 1) + x];
        return result;
    }
    static LensParameters parameters(std::uint32_t width, std::uint32_t height) {
        LensParameters p;
        p.width = width;
        p.height = height;
        return p;
    }
    struct Errors {
        double inside = 0.0, border = 0.0, change = 0.0;
    };
    // Of uniform vectors (u, v): the largest differences from the definition, and from what there was.
    Errors errors(const LensParameters &p, double u, double v) {
        Lens lens(context(), p);
        const std::vector<cl_float2> vectors(std::size_t{p.width} * p.height,
                                             cl_float2{{static_cast<float>(u), static_cast<float>(v)}});
        const std::vector<cl_float2> got = distort(lens, vectors);
        Errors errors;
        for (std::uint32_t y = 0; y < p.height; ++y)
            for (std::uint32_t x = 0; x < p.width; ++x) {
                const cl_float2 g = got[y * p.width + x];
                const auto source = *lens.distortion().undistort({double(x), double(y)});
                if (!(source.x >= -0.5 && source.y >= -0.5 && source.x < p.width - 0.5 && source.y < p.height - 0.5)) {
                    EXPECT_EQ(0.0f, std::abs(g.s[0]) + std::abs(g.s[1])) << x << ", " << y;
                    continue;
                }
                // To first order in s: its slope at 0.
                constexpr double e = 1e-4;
                const auto to = *lens.distortion().distort({source.x + e * u, source.y + e * v});
                const auto from = *lens.distortion().distort({source.x - e * u, source.y - e * v});
                const double error =
                    std::hypot(g.s[0] - (to.x - from.x) / (2.0 * e), g.s[1] - (to.y - from.y) / (2.0 * e));
                const bool border = x == 0 || y == 0 || x + 1 == p.width || y + 1 == p.height;
                (border ? errors.border : errors.inside) = std::max(border ? errors.border : errors.inside, error);
                errors.change = std::max(errors.change, std::hypot(g.s[0] - u, g.s[1] - v));
            }
        return errors;
    }
};

// Differences over two pixels err by D''' / 6 (D the displacement), one-sided ones by D'' / 2: for k1 with r = 1 after
// R pixels about k1 / R^2 = 1.2e-5 and 3 k1 / R = 0.004 of the vector, with R = 113 px and k1 = 0.15. Bounds: three
// times the first, for the other terms, and one and a half times the second.
TEST_F(LensShift, IsTheDifferenceOfDistortedPlaces) {
    LensParameters pincushion = parameters(192, 120);
    pincushion.k1 = 0.15;
    LensParameters all = parameters(192, 120);
    all.k1 = -0.1;
    all.k2 = 0.05;
    all.p1 = 0.01;
    all.p2 = -0.015;
    all.principal_point_given = true;
    all.principal_point_x_px = 80.3;
    all.principal_point_y_px = 66.6;
    LensParameters calibrated = all; // unequal units along x and y: the slope is no longer symmetric
    calibrated.radius_unit = RadiusUnit::kFocalLength;
    calibrated.focal_length_x_px = 150.0;
    calibrated.focal_length_y_px = 110.0;
    for (const LensParameters &p : {pincushion, all, calibrated})
        for (const auto &[u, v] : {std::pair{1.0, 0.0}, std::pair{0.0, 1.0}, std::pair{-6.0, 2.5}}) {
            const double length = std::hypot(u, v);
            const Errors found = errors(p, u, v);
            EXPECT_LT(found.inside / length, 4e-5) << u << ", " << v;
            EXPECT_LT(found.border / length, 0.006) << u << ", " << v;
            EXPECT_GT(found.change / length, 0.1) << u << ", " << v;
        }
}

TEST_F(LensShift, TakesTheNearestVectorAndKeepsZeros) {
    LensParameters p = parameters(40, 30);
    p.k1 = 0.3;
    Lens lens(context(), p);
    std::vector<cl_float2> vectors(40 * 30);
    for (std::uint32_t i = 0; i < vectors.size(); ++i)
        vectors[i] = cl_float2{{static_cast<float>(i), 0.0f}};
    const std::vector<cl_float2> got = distort(lens, vectors);
    for (std::uint32_t y = 0; y < 30; ++y)
        for (std::uint32_t x = 0; x < 40; ++x) {
            const auto source = *lens.distortion().undistort({double(x), double(y)});
            const double nearest = std::floor(source.y + 0.5) * 40 + std::floor(source.x + 0.5);
            const auto a = *lens.distortion().distort({source.x - 0.01, source.y});
            const auto b = *lens.distortion().distort({source.x + 0.01, source.y});
            EXPECT_NEAR(nearest * (b.x - a.x) / 0.02, got[y * 40 + x].s[0], 0.03 * nearest) << x << ", " << y;
        }
    for (const cl_float2 &zero : distort(lens, std::vector<cl_float2>(40 * 30)))
        EXPECT_EQ(0.0f, std::abs(zero.s[0]) + std::abs(zero.s[1]));
}

// One or two pixels along an axis: there is no difference to take, or one.
TEST_F(LensShift, ThinImages) {
    for (const auto &[width, height] : {std::pair{1u, 1u}, std::pair{1u, 9u}, std::pair{9u, 1u}, std::pair{2u, 2u}}) {
        LensParameters p = parameters(width, height);
        p.k1 = 0.05;
        Lens lens(context(), p);
        for (const cl_float2 &s : distort(lens, std::vector<cl_float2>(width * height, cl_float2{{1.0f, -2.0f}}))) {
            EXPECT_NEAR(1.0f, s.s[0], 0.25f);
            EXPECT_NEAR(-2.0f, s.s[1], 0.5f);
        }
    }
}

TEST_F(LensShift, RefusesBadImages) {
    LensParameters p = parameters(8, 6);
    p.k1 = 0.05;
    Lens lens(context(), p), plain(context(), parameters(8, 6));
    const std::vector<cl_float2> vectors(8 * 6);
    const Image a = image(p, vectors, 8), b = image(p, vectors, 8);
    const auto refused = [&](Lens &with, const ImageView &in, const ImageView &out) {
        try {
            with.check_distort_shift(in, out);
        } catch (const Error &error) {
            return error.status();
        }
        return Status::kSuccess;
    };
    EXPECT_EQ(Status::kSuccess, refused(lens, a.view, b.view));
    EXPECT_EQ(Status::kInvalidState, refused(plain, a.view, b.view));
    EXPECT_EQ(Status::kOverlap, refused(lens, a.view, a.view));
    ImageView floats = b.view;
    floats.format = Format::kFloat32;
    EXPECT_EQ(Status::kInvalidFormat, refused(lens, a.view, floats));
    EXPECT_EQ(Status::kInvalidFormat, refused(lens, floats, a.view));
}

} // namespace

// The engine's phase screens: their law in space and time. All seeds are fixed.
#include "runtime/context.hpp"
#include "runtime/error.hpp"
#include "stages/airflow.hpp"
#include "stages/philox.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

namespace {

using namespace clsp;

constexpr double kPi = 3.14159265358979323846;

class AirflowTest : public ::testing::Test {
  protected:
    // One for all tests, gone before main() ends: drivers do not like to be used later.
    static inline std::shared_ptr<Context> shared_context;
    static void SetUpTestSuite() { shared_context = Context::create({}); }
    static void TearDownTestSuite() { shared_context.reset(); }
    static const std::shared_ptr<Context> &context() { return shared_context; }
    cl::CommandQueue queue{context()->cl_context(), context()->device()};

    static AirflowParameters parameters() {
        AirflowParameters p;
        p.rms_rad = 0.5;
        p.scale_px = 6.0;
        p.correlation_frames = 3.0;
        p.seed = 20;
        return p;
    }
    // The screen in radians.
    std::vector<double> advance(Airflow &airflow, std::uint64_t frame, double frames = 1.0, std::uint32_t substep = 0) {
        CommandChain chain(queue(), 0, nullptr);
        airflow.enqueue_advance(chain, frame, frames, substep);
        std::vector<float> turns(airflow.grid().samples());
        queue.enqueueReadBuffer(airflow.screen(), CL_TRUE, 0, turns.size() * sizeof(float), turns.data());
        std::vector<double> radians(turns.size());
        for (std::size_t i = 0; i < turns.size(); ++i)
            radians[i] = 2.0 * kPi * turns[i];
        return radians;
    }
    // Mean product of a screen and another one that is shifted, periodically.
    static double product(const FieldGrid &grid, const std::vector<double> &a, const std::vector<double> &b,
                          std::uint32_t dx = 0, std::uint32_t dy = 0) {
        double sum = 0.0;
        for (std::uint32_t y = 0; y < grid.grid_height; ++y)
            for (std::uint32_t x = 0; x < grid.grid_width; ++x)
                sum += a[std::size_t{y} * grid.grid_width + x] *
                       b[std::size_t{(y + dy) % grid.grid_height} * grid.grid_width + (x + dx) % grid.grid_width];
        return sum / double(grid.samples());
    }
};

// 200 independent screens of 96 x 80 pixels, each with 96 x 80 / (pi 6^2 / 2) = 136 independent cells of the squared
// phase: the variance has a relative standard error of sqrt(2 / 27200) = 0.86 %, a correlation one of at most 0.86 %.
// Bounds are five of them: an rms that is off by 4 %, or a scale by 6 % (slope of exp(-d^2/L^2) in ln L at d = L:
// 0.74), would show.
TEST_F(AirflowTest, HasTheStatedVarianceAndSpatialCorrelation) {
    for (const std::uint32_t oversampling : {1u, 2u}) {
        Airflow airflow(context(), make_field_grid(96 / oversampling * oversampling, 80, 1, 0), parameters());
        AirflowParameters p = parameters();
        // With oversampling the same in half as many pixels of half the scale.
        p.scale_px /= oversampling;
        Airflow sampled(context(), make_field_grid(96 / oversampling, 80 / oversampling, oversampling, 0), p);
        Airflow &tested = oversampling == 1 ? airflow : sampled;
        double variance = 0.0, mean = 0.0, fourth = 0.0;
        constexpr int kScreens = 200;
        const std::vector<std::pair<std::uint32_t, std::uint32_t>> lags = {{3, 0}, {0, 3}, {6, 0}, {0, 6},
                                                                           {4, 4}, {9, 0}, {20, 0}};
        std::vector<double> products(lags.size(), 0.0);
        for (int i = 0; i < kScreens; ++i) {
            tested.reset();
            const auto screen = advance(tested, static_cast<std::uint64_t>(i));
            variance += product(tested.grid(), screen, screen) / kScreens;
            for (const double value : screen) {
                mean += value / (kScreens * double(screen.size()));
                fourth += value * value * value * value / (kScreens * double(screen.size()));
            }
            for (std::size_t k = 0; k < lags.size(); ++k)
                products[k] += product(tested.grid(), screen, screen, lags[k].first, lags[k].second) / kScreens;
        }
        EXPECT_NEAR(1.0, variance / 0.25, 5 * 0.0086) << oversampling;
        EXPECT_NEAR(0.0, mean / 0.5, 5 * 0.0086);
        // A Gaussian law; the standard error of the fourth moment is sqrt(96 / 27200) of the squared variance.
        EXPECT_NEAR(3.0, fourth / (0.25 * 0.25), 5 * 0.06);
        for (std::size_t k = 0; k < lags.size(); ++k) {
            const double d2 = lags[k].first * lags[k].first + lags[k].second * lags[k].second;
            EXPECT_NEAR(std::exp(-d2 / 36.0), products[k] / 0.25, 5 * 0.0086)
                << "lag " << lags[k].first << ", " << lags[k].second << ", oversampling " << oversampling;
        }
    }
}

// The first screen against a direct sum over all frequencies, in double: of even width (a transform of half of it) and
// of odd.
TEST_F(AirflowTest, IsTheSumOfItsFrequencies) {
    for (const auto &[width, height] :
         {std::pair{16u, 12u}, std::pair{18u, 11u}, std::pair{15u, 12u}, std::pair{21u, 9u}}) {
        for (const double scale : {0.3, 2.0, 40.0}) { // all frequencies, some, hardly more than the mean
            AirflowParameters p = parameters();
            p.scale_px = scale;
            Airflow airflow(context(), make_field_grid(width, height, 1, 0), p);
            ASSERT_EQ(airflow.grid().grid_width, width);
            ASSERT_EQ(airflow.grid().grid_height, height);
            const auto screen = advance(airflow, 5);
            const auto half_of = [&](std::uint32_t samples) {
                return static_cast<int>(
                    std::min(std::sqrt(2.0 * 17.7) * samples / (kPi * scale), double((samples - 1) / 2)));
            };
            const int half_width = half_of(width), half_height = half_of(height);
            const std::uint32_t box_height = 2u * static_cast<std::uint32_t>(half_height) + 1u,
                                quarter = quarter_rows(box_height);
            const auto gain = [&, w = width, h = height](int kx, int ky) {
                const double fx = double(kx) / w, fy = double(ky) / h;
                return std::exp(-0.5 * kPi * kPi * scale * scale * (fx * fx + fy * fy));
            };
            double power = 0.0;
            std::vector<double> sum(screen.size(), 0.0);
            for (int ky = -half_height; ky <= half_height; ++ky)
                for (int kx = -half_width; kx <= half_width; ++kx) {
                    const auto column = static_cast<std::uint32_t>(kx + half_width),
                               row = static_cast<std::uint32_t>(ky + half_height);
                    double parts[2];
                    for (std::uint32_t part = 0; part < 2; ++part) {
                        const auto block = host_block(p.seed, {column, row % quarter, 5, 0x31u + part});
                        const std::uint32_t pair = row / quarter / 2 * 2;
                        const double r = std::sqrt(-2.0 * std::log((block[pair] + 0.5) * 0x1p-32));
                        const double angle = 2.0 * kPi * block[pair + 1] * 0x1p-32;
                        parts[part] = r * (row / quarter % 2 == 0 ? std::cos(angle) : std::sin(angle));
                    }
                    const double g = gain(kx, ky);
                    power += g * g;
                    for (std::uint32_t y = 0; y < height; ++y)
                        for (std::uint32_t x = 0; x < width; ++x) {
                            const double angle = 2.0 * kPi * (double(kx) * x / width + double(ky) * y / height);
                            sum[y * width + x] += g * (parts[0] * std::cos(angle) - parts[1] * std::sin(angle));
                        }
                }
            double error = 0.0, square = 0.0;
            for (std::size_t i = 0; i < screen.size(); ++i) {
                const double expected = p.rms_rad * sum[i] / std::sqrt(power);
                error += (screen[i] - expected) * (screen[i] - expected);
                square += expected * expected;
            }
            EXPECT_LT(std::sqrt(error / square), 2e-6) << width << " x " << height << ", scale " << scale;
        }
    }
}

// 400 frames; successive products are correlated over (1 + r^2) / (1 - r^2) = 3.1 frames, so that there are 136 x 400
// / 3.1 = 17500 independent ones: a standard error of sqrt(2 / 17500) = 1.1 % at most. A correlation time that is off
// by 15 % (slope in ln tau at lag 3: 0.37) would show.
TEST_F(AirflowTest, HasTheStatedTemporalCorrelation) {
    Airflow airflow(context(), make_field_grid(96, 80, 1, 0), parameters());
    std::vector<std::vector<double>> screens;
    for (std::uint64_t frame = 0; frame < 400; ++frame)
        screens.push_back(advance(airflow, frame));
    double variance = 0.0;
    for (const auto &screen : screens)
        variance += product(airflow.grid(), screen, screen) / double(screens.size());
    EXPECT_NEAR(1.0, variance / 0.25, 5 * 0.011);
    for (const std::size_t lag : {1u, 2u, 3u, 6u, 20u}) {
        double sum = 0.0;
        for (std::size_t i = 0; i + lag < screens.size(); ++i)
            sum += product(airflow.grid(), screens[i], screens[i + lag]) / double(screens.size() - lag);
        EXPECT_NEAR(std::exp(-double(lag) / 3.0), sum / 0.25, 5 * 0.011) << "lag " << lag;
    }
}

// A frozen screen is carried along as it is, by parts of a pixel too: against the screen of the frame before, shifted
// by whole pixels.
TEST_F(AirflowTest, TheWindCarriesAFrozenScreen) {
    for (const std::uint32_t oversampling : {1u, 2u}) {
        AirflowParameters p = parameters();
        p.correlation_frames = std::numeric_limits<double>::infinity();
        p.wind_px = 1.5;
        Airflow airflow(context(), make_field_grid(96, 80, oversampling, 0), p);
        const auto first = advance(airflow, 0);
        advance(airflow, 1);
        const auto second = advance(airflow, 2); // 3 pixels to the right
        const std::uint32_t width = airflow.grid().grid_width, shift = 3 * oversampling;
        for (std::size_t i = 0; i < first.size(); ++i) {
            const std::size_t x = i % width, from = i - x + (x + width - shift) % width;
            ASSERT_NEAR(second[i], first[from], 2e-5) << i;
        }
        // Against the wind, and at once.
        EXPECT_EQ(second, advance(airflow, 2, 0.0));
        p.wind_px = -3.0;
        Airflow back(context(), make_field_grid(96, 80, oversampling, 0), p);
        advance(back, 0);
        const auto left = advance(back, 1);
        for (std::size_t i = 0; i < first.size(); ++i) {
            const std::size_t x = i % width, from = i - x + (x + shift) % width;
            ASSERT_NEAR(left[i], first[from], 2e-5) << i;
        }
    }
}

// Air that changes on its way: 400 frames as above, a correlation exp(-t / 3) where it has been carried to, and that
// times exp(-(v t / L)^2) where it was.
TEST_F(AirflowTest, TheWindCarriesWhatChanges) {
    AirflowParameters p = parameters();
    p.wind_px = 2.0;
    Airflow airflow(context(), make_field_grid(96, 80, 1, 0), p);
    std::vector<std::vector<double>> screens;
    for (std::uint64_t frame = 0; frame < 400; ++frame)
        screens.push_back(advance(airflow, frame));
    for (const std::size_t lag : {1u, 2u, 3u, 6u}) {
        double here = 0.0, there = 0.0;
        for (std::size_t i = 0; i + lag < screens.size(); ++i) {
            here += product(airflow.grid(), screens[i], screens[i + lag]) / double(screens.size() - lag);
            there += product(airflow.grid(), screens[i], screens[i + lag], std::uint32_t(2 * lag)) /
                     double(screens.size() - lag);
        }
        const double kept = std::exp(-double(lag) / 3.0), moved = 2.0 * double(lag) / 6.0;
        EXPECT_NEAR(kept, there / 0.25, 5 * 0.011) << "lag " << lag;
        EXPECT_NEAR(kept * std::exp(-moved * moved), here / 0.25, 5 * 0.011) << "lag " << lag;
    }
}

// Six frames at once are six frames: 60 pairs of screens have 8160 independent products, a standard error of 1.6 %.
TEST_F(AirflowTest, LongStepsAndShortOnes) {
    Airflow airflow(context(), make_field_grid(96, 80, 1, 0), parameters());
    double once = 0.0, often = 0.0;
    constexpr int kPairs = 60;
    for (std::uint64_t i = 0; i < kPairs; ++i) {
        airflow.reset();
        const auto first = advance(airflow, 100 * i);
        once += product(airflow.grid(), first, advance(airflow, 100 * i + 1, 1.5)) / kPairs;
        airflow.reset();
        const auto again = advance(airflow, 100 * i);
        ASSERT_EQ(first, again) << "the same seed and frame gave another screen";
        for (std::uint32_t substep = 0; substep < 6; ++substep) {
            CommandChain chain(queue(), 0, nullptr);
            airflow.enqueue_advance(chain, 100 * i + 1, 0.25, substep);
        }
        // No time: the screen as it is.
        often += product(airflow.grid(), first, advance(airflow, 100 * i + 1, 0.0)) / kPairs;
    }
    EXPECT_NEAR(std::exp(-0.5), once / 0.25, 5 * 0.016);
    EXPECT_NEAR(std::exp(-0.5), often / 0.25, 5 * 0.016);
}

TEST_F(AirflowTest, DrawsDifferByFrameSubstepAndSeed) {
    // Two independent screens have 136 independent products: a correlation with a standard error of 0.086.
    Airflow airflow(context(), make_field_grid(96, 80, 1, 0), parameters());
    AirflowParameters p = parameters();
    p.seed = 21;
    Airflow other(context(), make_field_grid(96, 80, 1, 0), p);
    const auto draw = [&](Airflow &a, std::uint64_t frame, std::uint32_t substep) {
        a.reset();
        return advance(a, frame, 1.0, substep);
    };
    const auto screen = draw(airflow, 5, 0);
    EXPECT_EQ(screen, draw(airflow, 5, 0));
    for (const auto &different :
         {draw(airflow, 6, 0), draw(airflow, 5 + (std::uint64_t{1} << 32), 0), draw(airflow, 5, 1), draw(other, 5, 0)})
        EXPECT_NEAR(0.0, product(airflow.grid(), screen, different) / 0.25, 5 * 0.086);
    // The amplitude is a factor.
    p = parameters();
    p.rms_rad *= 2;
    Airflow strong(context(), make_field_grid(96, 80, 1, 0), p);
    const auto doubled = draw(strong, 5, 0);
    for (std::size_t i = 0; i < screen.size(); ++i)
        EXPECT_NEAR(2 * screen[i], doubled[i], 1e-5) << i;
}

// Scales from far below a pixel to far above the image, odd and padded grids: the variance stays. The independent cells
// of a screen are as many as its samples at 0.1 px, and one at 1000 px: 3000 screens give it a relative standard error
// of 2.6 %.
TEST_F(AirflowTest, AnyScaleKeepsTheVariance) {
    for (const double scale : {0.1, 1000.0}) {
        AirflowParameters p = parameters();
        p.scale_px = scale;
        Airflow airflow(context(), make_field_grid(17, 19, 1, 0), p);
        double variance = 0.0;
        const int screens = scale < 1.0 ? 100 : 3000;
        for (int i = 0; i < screens; ++i) {
            airflow.reset();
            const auto screen = advance(airflow, static_cast<std::uint64_t>(i));
            variance += product(airflow.grid(), screen, screen) / screens;
        }
        EXPECT_NEAR(1.0, variance / 0.25, 5 * (scale < 1.0 ? 0.008 : 0.026)) << scale;
    }
}

TEST_F(AirflowTest, FramesAllocateNothing) {
    Airflow airflow(context(), make_field_grid(96, 80, 1, 0), parameters());
    advance(airflow, 0);
    const std::uint64_t before = context()->memory_use().allocated_bytes;
    for (std::uint64_t i = 1; i < 10; ++i)
        advance(airflow, i);
    EXPECT_EQ(before, context()->memory_use().allocated_bytes);
}

TEST_F(AirflowTest, RefusesBadParameters) {
    const FieldGrid grid = make_field_grid(16, 16, 1, 0);
    const auto fails = [&](auto change, const char *words) {
        AirflowParameters p = parameters();
        change(p);
        try {
            const Airflow airflow(context(), grid, p);
            ADD_FAILURE() << "accepted, expected a message with " << words;
        } catch (const Error &error) {
            EXPECT_EQ(Status::kInvalidArgument, error.status());
            EXPECT_NE(std::string::npos, std::string(error.what()).find(words)) << error.what();
        }
    };
    constexpr double kInfinity = std::numeric_limits<double>::infinity();
    for (const double bad : {0.0, -0.1, std::nan(""), kInfinity})
        fails([&](AirflowParameters &p) { p.rms_rad = bad; }, "rms_rad");
    for (const double bad : {0.0, -1.0, std::nan(""), kInfinity})
        fails([&](AirflowParameters &p) { p.scale_px = bad; }, "scale_px");
    for (const double bad : {0.0, -1.0, std::nan("")})
        fails([&](AirflowParameters &p) { p.correlation_frames = bad; }, "correlation_frames");
    for (const double bad : {2e6, -2e6, std::nan(""), std::numeric_limits<double>::infinity()})
        fails([&](AirflowParameters &p) { p.wind_px = bad; }, "wind_px");
    Airflow airflow(context(), grid, parameters());
    CommandChain chain(queue(), 0, nullptr);
    EXPECT_THROW(airflow.enqueue_advance(chain, std::uint64_t{1} << 48), Error);
    EXPECT_THROW(airflow.enqueue_advance(chain, 0, -1.0), Error);
    EXPECT_THROW(airflow.enqueue_advance(chain, 0, std::nan("")), Error);
    EXPECT_THROW(airflow.enqueue_advance(chain, 0, 1.0, 256), Error);
    EXPECT_FALSE(airflow.drawn());
    // A screen that stays.
    AirflowParameters p = parameters();
    p.correlation_frames = kInfinity;
    Airflow still(context(), grid, p);
    EXPECT_EQ(advance(still, 0), advance(still, 1));
}

} // namespace

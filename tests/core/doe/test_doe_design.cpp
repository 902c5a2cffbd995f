// Design of beam splitters through the C API: closed forms, progress and cancelling, determinism, what bad input gets.
#include "test_support.hpp"

#include <thread>

namespace {

using test::DeviceTest;

constexpr double kPi = 3.14159265358979323846;

double sinc2(double x) {
    return x == 0.0 ? 1.0 : std::pow(std::sin(kPi * x) / (kPi * x), 2);
}

// A row of orders -(count - 1) / 2 ... (count - 1) / 2.
std::vector<ClspDoeDesignOrder> fan(int count) {
    std::vector<ClspDoeDesignOrder> orders;
    for (int m = 0; m < count; ++m)
        orders.push_back({m - count / 2, 0, 1.0});
    return orders;
}

class DoeDesign : public DeviceTest {
  protected:
    std::vector<ClspDoeDesignOrder> orders = {{-3, 1, 1.0}, {2, 5, 1.0}, {4, -2, 2.0}, {0, -6, 1.0}, {7, 3, 0.5}};

    // 64 x 48 pixels of 2 um.
    ClspDoeDesignDesc desc(std::uint32_t levels = 8) {
        auto d = clspeckle::make<ClspDoeDesignDesc>();
        d.width = 64;
        d.height = 48;
        d.pixel_pitch_m = 2e-6;
        d.levels = levels;
        d.orders = orders.data();
        d.order_count = orders.size();
        d.iterations = 30;
        d.quantization_iterations = 20;
        return d;
    }
    ClspStatus create(const ClspDoeDesignDesc &d) {
        ClspDoeDesign handle = nullptr;
        const ClspStatus status = clspDoeDesignCreate(context, &d, &handle);
        if (status == CLSP_SUCCESS) {
            EXPECT_CLSP_OK(clspDoeDesignRelease(handle));
        } else {
            EXPECT_EQ(nullptr, handle);
        }
        return status;
    }
};

#define EXPECT_REFUSED(words, d)                                                                                       \
    do {                                                                                                               \
        test::poison_last_error("clspDoeDesignCreate");                                                                \
        EXPECT_TRUE(test::failed_as("clspDoeDesignCreate", create(d), CLSP_ERROR_INVALID_ARGUMENT, words)) << words;   \
    } while (false)

TEST_F(DoeDesign, StructsFollowTheRules) {
    test::check_init<ClspDoeDesignDesc>("clspDoeDesignDescInit", clspDoeDesignDescInit);
    ClspDoeDesignDesc defaults;
    EXPECT_CLSP_OK(clspDoeDesignDescInit(&defaults, sizeof defaults));
    EXPECT_EQ(CLSP_DOE_RULE_GSW, defaults.rule);
    EXPECT_EQ(8u, defaults.levels);
    EXPECT_EQ(0u, defaults.order_count);
    test::check_struct_size<ClspDoeDesignDesc>("clspDoeDesignCreate", desc(), [&](ClspDoeDesignDesc *d) {
        ClspDoeDesign handle = nullptr;
        const ClspStatus status = clspDoeDesignCreate(context, d, &handle);
        clspDoeDesignRelease(handle);
        return status;
    });
}

// Swanson's closed form: a blazed grating of L equal levels puts sinc^2(1 / L) into its first order.
TEST_F(DoeDesign, BlazedGratingOfLevelsHasTheClosedFormEfficiency) {
    for (const std::uint32_t levels : {3u, 4u, 5u, 8u, 16u}) {
        const std::vector<ClspDoeDesignOrder> first = {{1, 0, 1.0}};
        auto d = desc(levels);
        d.width = 4 * levels;
        d.height = 4;
        d.orders = first.data();
        d.order_count = 1;
        std::vector<float> phase(d.width * d.height);
        for (std::size_t i = 0; i < phase.size(); ++i)
            phase[i] = static_cast<float>(2 * kPi * double(i % d.width / 4) / levels);
        const auto grating = clspeckle::DoeDesign::evaluate(context, d, phase);
        EXPECT_NEAR(sinc2(1.0 / levels), grating.report().efficiency, 1e-6) << levels;
        // The design finds it without being told.
        d.width = 64;
        d.iterations = 60;
        EXPECT_NEAR(sinc2(1.0 / levels), clspeckle::DoeDesign(context, d).report().efficiency,
                    0.01 * sinc2(1.0 / levels))
            << levels;
    }
}

// Known best splitters of one dimension. Three beams of continuous phase: 0.9256 (Gori et al. 1998); five: 0.921
// (Romero and Dickey 2007). Binary, depth pi: two beams 8 / pi^2; three 0.664, five 0.774 (Dammann's gratings;
// Zhou and Liu 1995). The best of eight seeds, as splitters of few beams have local optima; within 1 % of the
// closed form, as pixels are coarse.
TEST_F(DoeDesign, FansReachTheKnownEfficiencies) {
    struct Case {
        int beams;
        std::uint32_t levels;
        double efficiency, uniformity;
    };
    for (const Case &c :
         {Case{3, 0, 0.9256, 1e-3}, Case{5, 0, 0.921, 1e-3}, Case{3, 2, 0.664, 0.01}, Case{5, 2, 0.774, 0.01}}) {
        const auto wanted = fan(c.beams);
        auto d = desc(c.levels);
        d.width = 128;
        d.height = 4;
        d.pixel_pitch_m = 1e-6;
        d.orders = wanted.data();
        d.order_count = wanted.size();
        d.iterations = 100;
        d.quantization_iterations = 60;
        d.search_sweeps = c.levels ? 20 : 0;
        double best = 0.0;
        for (d.seed = 0; d.seed < 8; ++d.seed) {
            const auto report = clspeckle::DoeDesign(context, d).report();
            if (report.uniformity_rms > c.uniformity)
                continue;
            best = std::max(best, report.efficiency);
            EXPECT_LT(report.efficiency, 1.005 * c.efficiency) << c.beams << " equal beams: no design can be better";
        }
        EXPECT_NEAR(c.efficiency, best, 0.01 * c.efficiency) << c.beams << " beams, levels " << c.levels;
    }
    // Two beams, binary: a square wave.
    const std::vector<ClspDoeDesignOrder> pair = {{-1, 0, 1.0}, {1, 0, 1.0}};
    auto d = desc(2);
    d.height = 4;
    d.orders = pair.data();
    d.order_count = 2;
    EXPECT_NEAR(8 / (kPi * kPi), clspeckle::DoeDesign(context, d).report().efficiency, 1e-3);
}

TEST_F(DoeDesign, BooksBalanceAndGettersAgree) {
    for (const std::uint32_t levels : {0u, 8u}) {
        const auto d = desc(levels);
        const clspeckle::DoeDesign design(context, d);
        const auto report = design.report();
        EXPECT_NEAR(1.0, report.efficiency + report.zero_order + report.other_orders + report.beyond, 1e-6);
        EXPECT_EQ(0u, report.zero_order_wanted);
        EXPECT_EQ(orders.size(), report.order_count);
        EXPECT_EQ(levels ? 50u : 30u, report.step_count);
        const auto got = design.orders();
        const auto powers = design.powers();
        double sum = 0.0;
        for (std::size_t k = 0; k < orders.size(); ++k) {
            EXPECT_EQ(orders[k].m, got[k].m);
            EXPECT_EQ(orders[k].n, got[k].n);
            EXPECT_EQ(orders[k].weight, got[k].weight);
            sum += powers[k];
        }
        EXPECT_NEAR(report.efficiency, sum, 1e-12);
        const auto history = design.history();
        EXPECT_EQ(report.efficiency, history.efficiency.back());
        EXPECT_EQ(report.uniformity_rms, history.uniformity_rms.back());
        EXPECT_LT(history.uniformity_rms.back(), 0.5 * history.uniformity_rms.front());
        EXPECT_LT(history.uniformity_rms.back(), 0.1);
        for (const float phase : design.phase(d.width * d.height)) {
            EXPECT_GE(phase, 0.0f);
            EXPECT_LT(phase, 6.2832f);
            if (levels) {
                const double step = double(phase) * levels / (2 * kPi);
                EXPECT_NEAR(std::round(step), step, 1e-5);
            }
        }
        // What was designed evaluates to the same.
        const auto again = clspeckle::DoeDesign::evaluate(context, d, design.phase(d.width * d.height)).report();
        EXPECT_EQ(report.efficiency, again.efficiency);
        EXPECT_EQ(report.largest_ghost, again.largest_ghost);
    }
}

TEST_F(DoeDesign, GettersRefuseAnotherCount) {
    const auto d = desc();
    const clspeckle::DoeDesign design(context, d);
    std::vector<float> phase(d.width * d.height);
    std::vector<double> numbers(200);
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "NULL", clspDoeDesignGetPhase(design, phase.size(), nullptr));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "count",
                      clspDoeDesignGetPhase(design, phase.size() - 1, phase.data()));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "count", clspDoeDesignGetOrders(design, 4, nullptr, numbers.data()));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "count",
                      clspDoeDesignGetHistory(design, 1, numbers.data(), nullptr));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "NULL", clspDoeDesignGetReport(design, nullptr));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "NULL", clspDoeDesignRetain(nullptr));
    EXPECT_CLSP_OK(clspDoeDesignGetOrders(design, orders.size(), nullptr, nullptr));
    EXPECT_CLSP_OK(clspDoeDesignRelease(nullptr));
    const clspeckle::DoeDesign copy = design;
    EXPECT_EQ(design.get(), copy.get());
}

TEST_F(DoeDesign, SameSeedSameDesignAlsoFromThreads) {
    auto d = desc();
    d.search_sweeps = 3;
    const auto first = clspeckle::DoeDesign(context, d).phase(d.width * d.height);
    std::vector<std::vector<float>> others(3);
    std::vector<std::thread> threads;
    for (auto &other : others)
        threads.emplace_back([&] { other = clspeckle::DoeDesign(context, d).phase(d.width * d.height); });
    for (auto &thread : threads)
        thread.join();
    for (const auto &other : others)
        EXPECT_EQ(first, other);
    d.seed = 1;
    EXPECT_NE(first, clspeckle::DoeDesign(context, d).phase(d.width * d.height));
}

TEST_F(DoeDesign, RulesEqualiseAndSearchRefines) {
    std::vector<ClspDoeDesignOrder> many;
    for (int n = -4; n <= 4; ++n)
        for (int m = -5; m <= 5; ++m)
            if ((m + 2 * n) % 3 != 0)
                many.push_back({m, n, 1.0});
    const auto error = [&](std::uint32_t rule, std::uint32_t levels, std::uint32_t sweeps) {
        auto d = desc(levels);
        d.orders = many.data();
        d.order_count = many.size();
        d.rule = rule;
        d.iterations = 60;
        d.search_sweeps = sweeps;
        return clspeckle::DoeDesign(context, d).report().uniformity_rms;
    };
    const double plain = error(CLSP_DOE_RULE_GS, 0, 0);
    EXPECT_GT(plain, 0.03);
    EXPECT_LT(error(CLSP_DOE_RULE_GSW, 0, 0), 0.2 * plain);
    EXPECT_LT(error(CLSP_DOE_RULE_NOGRETTE, 0, 0), 0.2 * plain);
    EXPECT_LT(error(CLSP_DOE_RULE_KIM, 0, 0), 0.2 * plain);
    EXPECT_LT(error(CLSP_DOE_RULE_GSW, 4, 10), 0.5 * error(CLSP_DOE_RULE_GSW, 4, 0));
}

// Two beams of powers 1 : 2, where full feedback swings.
TEST_F(DoeDesign, WeightsAreKept) {
    const std::vector<ClspDoeDesignOrder> pair = {{5, 2, 1.0}, {-4, 3, 2.0}};
    for (const std::uint32_t levels : {0u, 32u}) {
        auto d = desc(levels);
        d.orders = pair.data();
        d.order_count = 2;
        d.iterations = 80;
        const auto powers = clspeckle::DoeDesign(context, d).powers();
        EXPECT_NEAR(2.0, powers[1] / powers[0], 0.1) << levels;
    }
}

TEST_F(DoeDesign, BinaryDesignsHaveTwinsOrAreRefused) {
    auto d = desc(2);
    EXPECT_REFUSED("mirror", d);
    d.mirror_orders = 1;
    const clspeckle::DoeDesign design(context, d);
    EXPECT_EQ(2 * orders.size(), design.report().order_count);
    const auto got = design.orders();
    const auto powers = design.powers();
    for (std::size_t k = 0; k < orders.size(); ++k) {
        const std::size_t twin = orders.size() + k;
        EXPECT_EQ(-orders[k].m, got[twin].m);
        EXPECT_EQ(orders[k].weight, got[twin].weight);
        EXPECT_NEAR(powers[k], powers[twin], 1e-6 * powers[k]);
    }
    d.levels = 4;
    EXPECT_REFUSED("mirror_orders", d);
    // Twins of unequal weights cannot be.
    const std::vector<ClspDoeDesignOrder> unequal = {{3, 1, 1.0}, {-3, -1, 2.0}};
    d = desc(2);
    d.orders = unequal.data();
    d.order_count = 2;
    EXPECT_REFUSED("same weight", d);
}

std::int32_t count_calls(void *data, const char *what, double fraction) {
    auto &calls = *static_cast<std::vector<double> *>(data);
    EXPECT_NE('\0', *what);
    if (!calls.empty()) {
        EXPECT_GE(fraction, calls.back());
    }
    EXPECT_LE(fraction, 1.0);
    calls.push_back(fraction);
    return 1;
}

std::int32_t stop_at_half(void *data, const char *, double fraction) {
    *static_cast<double *>(data) = fraction;
    return fraction < 0.5;
}

TEST_F(DoeDesign, ProgressIsToldAndCancels) {
    auto d = desc();
    d.search_sweeps = 2;
    std::vector<double> calls;
    d.progress = count_calls;
    d.progress_data = &calls;
    EXPECT_CLSP_OK(create(d));
    EXPECT_GT(calls.size(), 50u);
    double last = 0.0;
    d.progress = stop_at_half;
    d.progress_data = &last;
    ClspDoeDesign handle = nullptr;
    EXPECT_CLSP_FAILS(CLSP_ERROR_CANCELLED, "stop", clspDoeDesignCreate(context, &d, &handle));
    EXPECT_EQ(nullptr, handle);
    EXPECT_GE(last, 0.5);
    // The C++ binding lets exceptions of the function through.
    d = desc();
    struct Stop {};
    EXPECT_THROW(clspeckle::DoeDesign(context, d, [](const std::string &, double) -> bool { throw Stop{}; }), Stop);
}

TEST_F(DoeDesign, NothingStaysInDeviceMemory) {
    create(desc());
    const std::uint64_t before = context.info().allocated_bytes;
    auto d = desc();
    d.search_sweeps = 1;
    create(d);
    double last = 0.0;
    d.progress = stop_at_half;
    d.progress_data = &last;
    create(d);
    EXPECT_EQ(before, context.info().allocated_bytes);
}

TEST_F(DoeDesign, BadDescriptionsAreRefused) {
    const auto changed = [&](void (*change)(ClspDoeDesignDesc &)) {
        auto d = desc();
        change(d);
        return d;
    };
    using D = ClspDoeDesignDesc;
    EXPECT_REFUSED("empty", changed([](D &d) { d.order_count = 0; }));
    EXPECT_REFUSED("orders is null", changed([](D &d) { d.orders = nullptr; }));
    EXPECT_REFUSED("at most", changed([](D &d) { d.order_count = CLSP_MAX_DOE_ORDERS + 1; }));
    EXPECT_REFUSED("width", changed([](D &d) { d.width = 0; }));
    EXPECT_REFUSED("width", changed([](D &d) { d.width = 8193; }));
    EXPECT_REFUSED("prime factor", changed([](D &d) { d.height = 17; }));
    EXPECT_REFUSED("levels", changed([](D &d) { d.levels = 1; }));
    EXPECT_REFUSED("levels", changed([](D &d) { d.levels = 257; }));
    EXPECT_REFUSED("or CLSP_DOE_RULE_KIM (3)", changed([](D &d) { d.rule = 4; }));
    EXPECT_REFUSED("feedback", changed([](D &d) { d.feedback = -0.1; }));
    EXPECT_REFUSED("feedback", changed([](D &d) {
                       d.rule = CLSP_DOE_RULE_NOGRETTE;
                       d.feedback = 1.0;
                   }));
    EXPECT_REFUSED("iterations", changed([](D &d) { d.iterations = 0; }));
    EXPECT_REFUSED("quantization_iterations", changed([](D &d) { d.quantization_iterations = 0; }));
    EXPECT_REFUSED("fix_phase_iteration", changed([](D &d) { d.fix_phase_iteration = 0; }));
    EXPECT_REFUSED("search_sweeps", changed([](D &d) {
                       d.levels = 0;
                       d.search_sweeps = 1;
                   }));
    EXPECT_REFUSED("compensate_envelope", changed([](D &d) { d.compensate_envelope = 2; }));
    EXPECT_REFUSED("reserved", changed([](D &d) { d.reserved = 1; }));
    for (const double bad : {0.0, -1e-6, test::nan_value, test::infinity}) {
        auto d = desc();
        d.pixel_pitch_m = bad;
        EXPECT_REFUSED("pixel_pitch_m", d);
        d = desc();
        d.wavelength_m = bad;
        EXPECT_REFUSED("wavelength_m", d);
        if (bad != 0.0) {
            d = desc();
            d.beam_diameter_m = bad;
            EXPECT_REFUSED("beam_diameter_m", d);
        }
        const std::vector<ClspDoeDesignOrder> weighted = {{1, 2, 1.0}, {2, 1, bad}};
        d = desc();
        d.orders = weighted.data();
        d.order_count = 2;
        EXPECT_REFUSED("weight of orders[1]", d);
    }
    ClspDoeDesign handle = nullptr;
    const auto d = desc();
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "NULL", clspDoeDesignCreate(nullptr, &d, &handle));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "NULL", clspDoeDesignCreate(context, nullptr, &handle));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "NULL", clspDoeDesignCreate(context, &d, nullptr));
}

TEST_F(DoeDesign, OrdersThatCannotBeAreRefused) {
    const auto with = [&](const std::vector<ClspDoeDesignOrder> &list, double pitch_m, double beam_m) {
        auto d = desc();
        d.orders = list.data();
        d.order_count = list.size();
        d.pixel_pitch_m = pitch_m;
        d.beam_diameter_m = beam_m;
        test::poison_last_error("clspDoeDesignCreate");
        return create(d);
    };
    const auto refused = [&](const char *words, ClspStatus status) {
        EXPECT_TRUE(test::failed_as("clspDoeDesignCreate", status, CLSP_ERROR_INVALID_ARGUMENT, words));
    };
    refused("twice", with({{1, 2, 1.0}, {3, 4, 1.0}, {1, 2, 0.5}}, 2e-6, 0.0));
    refused("weights go", with({{1, 2, 1.0}, {3, 4, 1e-7}}, 2e-6, 0.0));
    refused("outside", with({{32, 0, 1.0}}, 2e-6, 0.0));
    refused("outside", with({{0, -24, 1.0}}, 2e-6, 0.0));
    refused("outside", with({{-2147483647 - 1, 0, 1.0}}, 2e-6, 0.0));
    refused("90 degrees", with({{25, 0, 1.0}}, 0.3e-6, 0.0)); // u = 25 / 64 * 940 / 300 = 1.22
    // The cell is 128 um wide: neighbouring orders are 0.0073 apart, a beam of 150 um resolves 0.0076.
    refused("diffraction limit", with({{1, 2, 1.0}, {2, 2, 1.0}}, 2e-6, 150e-6));
    refused("longer than the beam", with({{1, 2, 1.0}}, 2e-6, 100e-6));
    EXPECT_CLSP_OK(with({{1, 2, 1.0}, {2, 2, 1.0}}, 2e-6, 300e-6));
}

TEST_F(DoeDesign, PhasesThatAreNoneAreRefused) {
    auto d = desc(4);
    std::vector<float> phase(d.width * d.height, 0.0f);
    ClspDoeDesign handle = nullptr;
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "NULL", clspDoeDesignEvaluate(context, &d, nullptr, 0, &handle));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "pitch",
                      clspDoeDesignEvaluate(context, &d, phase.data(), 4, &handle));
    for (const float bad :
         {0.3f, std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity(), 1e6f}) {
        phase[d.width + 2] = bad;
        EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_DATA, "phase[1][2]",
                          clspDoeDesignEvaluate(context, &d, phase.data(), 0, &handle));
    }
    phase[d.width + 2] = static_cast<float>(-kPi / 2);
    EXPECT_CLSP_OK(clspDoeDesignEvaluate(context, &d, phase.data(), 0, &handle));
    EXPECT_CLSP_OK(clspDoeDesignRelease(handle));
    EXPECT_THROW(clspeckle::DoeDesign::evaluate(context, d, std::vector<float>(5)), std::invalid_argument);
}

TEST_F(DoeDesign, DirectionsSnapToTheNearestOrders) {
    // Orders of 100 pixels of 1 um at 1000 nm are 0.01 apart.
    const auto snapped = clspeckle::DoeDesign::snap(100, 50, 1e-6, 1e-6, {0.104, -0.203, -0.0049, 0.0});
    EXPECT_EQ(10, snapped.orders[0].m);
    EXPECT_EQ(-10, snapped.orders[0].n);
    EXPECT_EQ(0, snapped.orders[1].m);
    EXPECT_EQ(1.0, snapped.orders[1].weight);
    EXPECT_NEAR(std::hypot(0.004, 0.003), snapped.errors[0], 1e-12);
    EXPECT_NEAR(0.0049, snapped.errors[1], 1e-12);
    ClspDoeDesignOrder got[2];
    const auto refused = [&](const char *words, std::vector<double> directions) {
        EXPECT_CLSP_FAILS(
            CLSP_ERROR_INVALID_ARGUMENT, words,
            clspDoeDesignSnapDirections(100, 50, 1e-6, 1e-6, directions.size() / 2, directions.data(), got, nullptr));
    };
    refused("beyond 90", {0.8, 0.7});
    refused("beyond 90", {test::nan_value, 0.0});
    refused("outside", {0.51, 0.0});
    refused("both", {0.1, 0.0, 0.101, 0.001});
    refused("count", {});
    const double one[2] = {0.1, 0.1};
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "NULL",
                      clspDoeDesignSnapDirections(100, 50, 1e-6, 1e-6, 1, nullptr, got, nullptr));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "NULL",
                      clspDoeDesignSnapDirections(100, 50, 1e-6, 1e-6, 1, one, nullptr, nullptr));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "width",
                      clspDoeDesignSnapDirections(0, 50, 1e-6, 1e-6, 1, one, got, nullptr));
}

// 5303 beams, as the camera of the thesis has, on a cell that a projector of 60 x 45 degrees could have: what is
// promised.
TEST_F(DoeDesign, FiveThousandBeams) {
    const clspeckle::DotLayout layout = clspeckle::dot_layout(clspeckle::make<ClspDotLayoutDesc>());
    std::vector<ClspDoeDesignOrder> wanted;
    for (std::size_t k = 0; k < layout.orders.size(); k += 2)
        wanted.push_back({layout.orders[k], layout.orders[k + 1], 1.0});
    ASSERT_EQ(5303u, wanted.size());
    auto d = clspeckle::make<ClspDoeDesignDesc>();
    d.orders = wanted.data();
    d.order_count = wanted.size();
    const auto report = clspeckle::DoeDesign(context, d).report();
    EXPECT_GT(report.efficiency, 0.70);
    EXPECT_LT(report.uniformity_rms, 0.05);
    EXPECT_LT(report.seconds, 120.0);
    EXPECT_LT(report.zero_order_relative, 1.0);
}

} // namespace

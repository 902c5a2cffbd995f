// Layouts of dots through the C API: count, field of view, distance, symmetry, neighbourhoods, what bad input gets.
#include "test_support.hpp"

namespace {

ClspDotLayoutDesc desc(std::uint64_t count = 400) {
    auto d = clspeckle::make<ClspDotLayoutDesc>();
    d.count = count;
    d.width = d.height = 192;
    return d;
}

double least_distance(const std::vector<double> &directions) {
    double least = 10.0;
    for (std::size_t i = 0; i < directions.size(); i += 2)
        for (std::size_t j = i + 2; j < directions.size(); j += 2)
            least = std::min(least, std::hypot(directions[i] - directions[j], directions[i + 1] - directions[j + 1]));
    return least;
}

TEST(DotLayout, StructsFollowTheRules) {
    test::check_init<ClspDotLayoutDesc>("clspDotLayoutDescInit", clspDotLayoutDescInit);
    ClspDotLayoutDesc defaults;
    EXPECT_CLSP_OK(clspDotLayoutDescInit(&defaults, sizeof defaults));
    EXPECT_EQ(5303u, defaults.count);
    EXPECT_EQ(1u, defaults.lattice);
    std::vector<double> directions(800);
    test::check_struct_size<ClspDotLayoutDesc>("clspDotLayoutCreate", desc(), [&](ClspDotLayoutDesc *d) {
        return clspDotLayoutCreate(d, directions.data(), nullptr, nullptr);
    });
    ClspDotLayoutInfo info{};
    const auto d = desc();
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_STRUCT_SIZE, "struct_size",
                      clspDotLayoutCreate(&d, directions.data(), nullptr, &info));
}

TEST(DotLayout, DotsLieInTheFieldOfViewApartAndOnTheOrders) {
    for (const std::uint32_t lattice : {1u, 0u})
        for (const std::uint32_t symmetric : {0u, 1u}) {
            auto d = desc(401);
            d.lattice = lattice;
            d.point_symmetric = symmetric;
            d.seed = 5;
            const clspeckle::DotLayout layout = clspeckle::dot_layout(d);
            ASSERT_EQ(802u, layout.directions.size());
            ASSERT_EQ(lattice ? 802u : 0u, layout.orders.size());
            const double step = d.wavelength_m / (d.pixel_pitch_m * d.width);
            for (std::size_t k = 0; k < layout.directions.size(); k += 2) {
                EXPECT_LE(std::abs(layout.directions[k]), std::sin(d.half_angle_x_rad));
                EXPECT_LE(std::abs(layout.directions[k + 1]), std::sin(d.half_angle_y_rad));
                if (lattice) {
                    EXPECT_NEAR(layout.orders[k] * step, layout.directions[k], 1e-12);
                    EXPECT_NEAR(layout.orders[k + 1] * step, layout.directions[k + 1], 1e-12);
                }
                if (symmetric) {
                    bool found = false;
                    for (std::size_t j = 0; j < layout.directions.size() && !found; j += 2)
                        found = layout.directions[j] == -layout.directions[k] &&
                                layout.directions[j + 1] == -layout.directions[k + 1];
                    EXPECT_TRUE(found) << "dot " << k / 2 << " has no mirror image";
                }
            }
            EXPECT_GE(least_distance(layout.directions), layout.info.min_distance * (1 - 1e-9));
            // Random sequential adsorption covers 0.547 of a plane; a chosen distance comes near that.
            EXPECT_GT(layout.info.min_distance, 0.6 * layout.info.mean_spacing);
            EXPECT_GE(layout.info.min_difference, d.min_difference);
        }
}

TEST(DotLayout, SameSeedSameLayout) {
    auto d = desc();
    const auto first = clspeckle::dot_layout(d).directions;
    EXPECT_EQ(first, clspeckle::dot_layout(d).directions);
    d.seed = 1;
    EXPECT_NE(first, clspeckle::dot_layout(d).directions);
}

// Dots that look alike are moved: without that, this layout has pairs below the wanted difference.
TEST(DotLayout, AlikeDotsAreMoved) {
    auto d = desc(600);
    d.neighborhood_radius = 0.08;
    d.min_difference = 0.0;
    const ClspDotLayoutInfo before = clspeckle::dot_layout(d).info;
    EXPECT_EQ(0u, before.moved_count);
    d.min_difference = before.min_difference + 0.1;
    d.min_distance = 0.8 * before.min_distance;
    d.tolerance = before.tolerance;
    d.row_half_height = before.row_half_height;
    const clspeckle::DotLayout after = clspeckle::dot_layout(d);
    EXPECT_GE(after.info.min_difference, d.min_difference);
    EXPECT_GE(least_distance(after.directions), d.min_distance * (1 - 1e-9));
    d.min_difference = 1.0; // no layout of so many dots is that different
    d.repair_rounds = 2;
    std::vector<double> directions(2 * d.count);
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "alike",
                      clspDotLayoutCreate(&d, directions.data(), nullptr, nullptr));
}

TEST(DotLayout, TheCamerasCounts) {
    for (const std::uint64_t count : {2509u, 5303u}) {
        auto d = clspeckle::make<ClspDotLayoutDesc>();
        d.count = count;
        const clspeckle::DotLayout layout = clspeckle::dot_layout(d);
        EXPECT_EQ(2 * count, layout.directions.size());
        EXPECT_GE(layout.info.min_difference, 0.25);
        EXPECT_GT(layout.info.mean_difference, 0.8);
    }
}

TEST(DotLayout, ProgressIsToldAndCancels) {
    auto d = desc();
    std::vector<double> calls;
    const auto note = [&](const std::string &what, double fraction) {
        EXPECT_FALSE(what.empty());
        if (!calls.empty()) {
            EXPECT_GE(fraction, calls.back());
        }
        EXPECT_LE(fraction, 1.0);
        calls.push_back(fraction);
        return true;
    };
    const clspeckle::DotLayout layout = clspeckle::dot_layout(d, note);
    EXPECT_GT(calls.size(), 10u);
    EXPECT_EQ(clspeckle::dot_layout(d).directions, layout.directions);
    // A layout that is never good enough can be left at any time.
    d.min_difference = 1.0;
    d.repair_rounds = 100000;
    try {
        clspeckle::dot_layout(d, [](const std::string &, double fraction) { return fraction < 0.7; });
        FAIL() << "the layout went on";
    } catch (const clspeckle::Error &error) {
        EXPECT_EQ(CLSP_ERROR_CANCELLED, error.status());
    }
    struct Stop {};
    EXPECT_THROW(clspeckle::dot_layout(d, [](const std::string &, double) -> bool { throw Stop{}; }), Stop);
}

TEST(DotLayout, BadDescriptionsAreRefused) {
    std::vector<double> directions(2 * CLSP_MAX_LAYOUT_DOTS);
    std::vector<std::int32_t> orders(directions.size());
    const auto refused = [&](const char *words, void (*change)(ClspDotLayoutDesc &)) {
        auto d = desc();
        change(d);
        EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, words,
                          clspDotLayoutCreate(&d, directions.data(), nullptr, nullptr));
    };
    using D = ClspDotLayoutDesc;
    refused("count", [](D &d) { d.count = 0; });
    refused("count", [](D &d) { d.count = CLSP_MAX_LAYOUT_DOTS + 1; });
    refused("lattice", [](D &d) { d.lattice = 2; });
    refused("point_symmetric", [](D &d) { d.point_symmetric = 2; });
    refused("half_angle_x_rad", [](D &d) { d.half_angle_x_rad = 0.0; });
    refused("half_angle_y_rad", [](D &d) { d.half_angle_y_rad = 1.6; });
    refused("half_angle_y_rad", [](D &d) { d.half_angle_y_rad = test::nan_value; });
    refused("beyond 90", [](D &d) { d.half_angle_x_rad = d.half_angle_y_rad = 0.9; });
    refused("take smaller pixels", [](D &d) { d.pixel_pitch_m = 2e-6; });
    refused("pixel_pitch_m", [](D &d) { d.pixel_pitch_m = -1.0; });
    refused("wavelength_m", [](D &d) { d.wavelength_m = test::infinity; });
    refused("cell", [](D &d) { d.width = 0; });
    refused("cell of more pixels", [](D &d) { d.count = 50000; });
    refused("find a place", [](D &d) { d.min_distance = 0.1; });
    refused("min_distance", [](D &d) { d.min_distance = -0.1; });
    refused("diffraction limit", [](D &d) {
        d.min_distance = 0.005;
        d.beam_diameter_m = 100e-6;
    });
    refused("diffraction limit", [](D &d) { d.beam_diameter_m = 20e-6; });
    refused("tolerance", [](D &d) { d.tolerance = 0.5; });
    refused("take a smaller radius", [](D &d) {
        d.lattice = 0;
        d.count = 8000;
        d.neighborhood_radius = 2.0;
    });
    refused("min_difference", [](D &d) { d.min_difference = 1.5; });
    auto d = desc();
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "NULL", clspDotLayoutCreate(&d, nullptr, nullptr, nullptr));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "NULL",
                      clspDotLayoutCreate(nullptr, directions.data(), nullptr, nullptr));
    d.lattice = 0;
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "orders",
                      clspDotLayoutCreate(&d, directions.data(), orders.data(), nullptr));
    d = desc();
    d.count = 0;
    EXPECT_THROW(clspeckle::dot_layout(d), clspeckle::Error);
}

TEST(DotLayout, OneDotAndTwo) {
    for (const std::uint64_t count : {1u, 2u}) {
        auto d = desc(count);
        d.min_difference = 0.0; // dots alone have no neighbours to tell them apart
        EXPECT_EQ(2 * count, clspeckle::dot_layout(d).directions.size());
    }
}

} // namespace

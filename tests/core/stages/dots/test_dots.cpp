// Ideal projected dots: one defect at a time against closed forms, what configure() keeps, and what bad arguments get.
#include "stage_support.hpp"

namespace {

class Dots : public test::StageTest<ClspDots> {
  protected:
    static constexpr std::uint32_t width = 70, height = 50;

    // Inside by more than the support of their profile, and off the pixel grid.
    const std::vector<double> positions = {20.3, 19.8, 47.6, 18.2, 33.9, 32.4};

    ClspDotsDesc valid() const override {
        auto desc = clspeckle::make<ClspDotsDesc>();
        desc.width = width;
        desc.height = height;
        desc.count = positions.size() / 2;
        desc.positions_px = positions.data();
        return desc;
    }
    std::vector<float> render(const clspeckle::Dots &dots, std::uint32_t w = width, std::uint32_t h = height) {
        return written(w, h, CLSP_FORMAT_FLOAT32, [&](const ClspImage &image) { dots.enqueue_render(queue, image); });
    }
    std::vector<float> render(const ClspDotsDesc &desc) {
        return render(clspeckle::Dots(context, desc), desc.width, desc.height);
    }
    static double sum(const std::vector<float> &image) {
        double total = 0;
        for (float value : image)
            total += static_cast<double>(value);
        return total;
    }
};

// Sums over pixels stand for integrals below: for sigma = 2 the aliasing error of a Gaussian is 2 exp(-2 pi^2 sigma^2)
// < 1e-33.
constexpr double two_pi = 2 * M_PI, sigma = 2.0;

TEST_F(Dots, InitFunctionWritesDefaults) {
    const ClspDotsDesc desc = checked_defaults();
    EXPECT_EQ(0u, desc.count);
    EXPECT_EQ(nullptr, desc.positions_px);
    EXPECT_EQ(nullptr, desc.sigmas_px);
    EXPECT_EQ(nullptr, desc.peaks);
    EXPECT_EQ(2.0, desc.sigma_px);
    EXPECT_EQ(1.0, desc.scale);
    for (double off : {desc.relative_wavelength_shift, desc.beam_skew, desc.beam_skew_angle_rad, desc.beam_flatness,
                       desc.zero_order_relative_intensity, desc.ghost_relative_intensity, desc.scatter_fraction})
        EXPECT_EQ(0.0, off);
    EXPECT_EQ(0u, desc.principal_point_given);
    EXPECT_EQ(0u, desc.ghost_offset_given);
}

TEST_F(Dots, SumOfGaussians) {
    auto desc = valid();
    desc.scale = 3;
    const auto got = render(desc);
    for (std::uint32_t y = 0; y < height; ++y) {
        for (std::uint32_t x = 0; x < width; ++x) {
            double expected = 0;
            for (std::size_t j = 0; j < positions.size(); j += 2) {
                const double dx = x - positions[j], dy = y - positions[j + 1];
                expected += 3 * std::exp(-(dx * dx + dy * dy) / (2 * sigma * sigma));
            }
            EXPECT_NEAR(expected, got[y * width + x], 3e-6) << x << ", " << y;
        }
    }
    EXPECT_NEAR(3 * 3 * two_pi * sigma * sigma, sum(got), 1e-5 * sum(got));
}

TEST_F(Dots, OneDotsOwnWidthAndPeak) {
    const double sigmas[] = {1.5, 2.0, 2.5}, peaks[] = {1.0, 0.0, 4.0};
    auto desc = valid();
    desc.sigmas_px = sigmas;
    desc.peaks = peaks;
    const auto got = render(desc);
    EXPECT_NEAR(two_pi * (1.5 * 1.5 + 4.0 * 2.5 * 2.5), sum(got), 1e-3);
    EXPECT_LT(got[18 * width + 48], 1e-6f) << "a dot of peak 0";
}

// Light, mean, variance and third central moment of weights w(a).
template <typename Visit> std::array<double, 4> moments_of(Visit visit) {
    double light = 0, first = 0, variance = 0, third = 0;
    visit([&](double a, double w) {
        light += w;
        first += w * a;
    });
    const double mean = first / light;
    visit([&](double a, double w) {
        variance += w * (a - mean) * (a - mean) / light;
        third += w * std::pow(a - mean, 3) / light;
    });
    return {light, mean, variance, third};
}

TEST_F(Dots, SkewKeepsLightAndHasItsSkewness) {
    // One dot against the moments of the profile along the axis, in sigmas, summed finely. Where the profile is clipped
    // it has a kink, and a sum over pixels differs from an integral by some 1e-4.
    auto desc = valid();
    const double centre[] = {35.3, 34.8};
    desc.positions_px = centre;
    desc.count = 1;
    desc.width = desc.height = 71;
    desc.sigma_px = 4;
    for (double skew : {-0.5, 0.2, 0.5, 1.2, 3.0}) {
        const auto profile = moments_of([&](auto add) {
            for (double a = -9; a < 9; a += 1e-3)
                add(a, std::exp(-a * a / 2) * std::max(0.0, 1 + skew / 6 * (a * a * a - 3 * a)));
        });
        const double expected = profile[3] / std::pow(profile[2], 1.5);
        EXPECT_GT(expected * skew, 0);
        EXPECT_NEAR(skew, expected, skew == 0.2 ? 0.01 : std::abs(skew) == 0.5 ? 0.08 : 2.0) << "what dots.h says";
        desc.beam_skew = skew;
        for (double angle : {0.0, 0.7, M_PI / 2}) {
            desc.beam_skew_angle_rad = angle;
            const auto image = render(desc);
            const auto got = moments_of([&](auto add) {
                for (int y = 0; y < 71; ++y)
                    for (int x = 0; x < 71; ++x)
                        add(((x - centre[0]) * std::cos(angle) + (y - centre[1]) * std::sin(angle)) / 4,
                            static_cast<double>(image[static_cast<std::size_t>(y * 71 + x)]));
            });
            EXPECT_NEAR(two_pi * 16, got[0], 1e-3 * got[0]) << skew << " at " << angle;
            EXPECT_NEAR(profile[1], got[1], 2e-3) << skew << " at " << angle;
            EXPECT_NEAR(profile[2], got[2], 5e-3) << skew << " at " << angle;
            EXPECT_NEAR(expected, got[3] / std::pow(got[2], 1.5), 5e-3) << skew << " at " << angle;
        }
    }
}

TEST_F(Dots, FlatTopIsASuperGaussian) {
    for (double f : {0.25, 0.5, 1.0}) {
        auto desc = valid();
        desc.sigma_px = 4;
        desc.width = desc.height = 61;
        const double centre[] = {30, 30};
        desc.count = 1;
        desc.positions_px = centre;
        desc.beam_flatness = f;
        const auto got = render(desc);
        const double p = 1 + 2 * f;
        EXPECT_EQ(1.0f, got[30 * 61 + 30]);
        EXPECT_NEAR(std::exp(-std::pow(9.0 / 16, p) / 2), got[30 * 61 + 33], 1e-6);
        EXPECT_NEAR(std::exp(-std::pow((25.0 + 4) / 16, p) / 2), got[32 * 61 + 25], 1e-6);
        // The light of dots.h; the edge of width sigma / p is sampled well enough for 1e-4.
        EXPECT_NEAR(std::pow(2, 1 / p) * std::tgamma(1 + 1 / p) / 2 * two_pi * 16, sum(got), 1e-4 * sum(got)) << f;
    }
}

TEST_F(Dots, WavelengthMovesDotsFromTheAxis) {
    auto desc = valid();
    desc.relative_wavelength_shift = 0.02;
    const double centre_x = (width - 1) / 2.0, centre_y = (height - 1) / 2.0;
    const auto moved = [&](double x, double y) {
        std::vector<double> result = positions;
        for (std::size_t j = 0; j < result.size(); j += 2) {
            result[j] = x + 1.02 * (result[j] - x);
            result[j + 1] = y + 1.02 * (result[j + 1] - y);
        }
        return result;
    };
    const auto near = [&](const std::vector<float> &a, const std::vector<float> &b) {
        double largest = 0;
        for (std::size_t i = 0; i < a.size(); ++i)
            largest = std::max(largest, std::abs(static_cast<double>(a[i]) - static_cast<double>(b[i])));
        EXPECT_LT(largest, 1e-6);
    };
    auto plain = valid();
    const auto about_centre = moved(centre_x, centre_y), about_corner = moved(3, -5);
    plain.positions_px = about_centre.data();
    near(render(plain), render(desc));
    desc.principal_point_given = 1;
    desc.principal_point_x_px = 3;
    desc.principal_point_y_px = -5;
    plain.positions_px = about_corner.data();
    near(render(plain), render(desc));
}

TEST_F(Dots, ZeroOrderIsOneMoreDotOnTheAxis) {
    const double peaks[] = {1.0, 2.0, 3.0}, sigmas[] = {1.0, 2.0, 1.5};
    auto desc = valid();
    desc.peaks = peaks;
    desc.sigmas_px = sigmas;
    desc.principal_point_given = 1;
    desc.principal_point_x_px = 10;
    desc.principal_point_y_px = 40;
    const auto without = render(desc);
    desc.zero_order_relative_intensity = 5;
    const auto with = render(desc);
    EXPECT_NEAR(without[40 * width + 10] + 5 * 2.0, with[40 * width + 10], 1e-5);
    EXPECT_NEAR(5 * 2.0 * two_pi * 1.5 * 1.5, sum(with) - sum(without), 1e-3);
}

TEST_F(Dots, GhostsLieBetweenTheDots) {
    // A lattice of 12 x 10 px, some of it outside, turned a little: the ghosts are in the middle of the cells.
    std::vector<double> lattice;
    for (int i = -2; i < 7; ++i)
        for (int j = -2; j < 7; ++j)
            lattice.insert(lattice.end(), {8 + 12.0 * i - 1.0 * j, 6 + 1.5 * i + 10.0 * j});
    auto desc = valid();
    desc.count = lattice.size() / 2;
    desc.positions_px = lattice.data();
    desc.sigma_px = 1.2;
    const auto without = render(desc);
    desc.ghost_relative_intensity = 0.25;
    const auto automatic = render(desc);
    desc.ghost_offset_given = 1;
    desc.ghost_offset_x_px = (12.0 - 1.0) / 2;
    desc.ghost_offset_y_px = (1.5 + 10.0) / 2;
    const auto given = render(desc);
    for (std::size_t i = 0; i < given.size(); ++i)
        EXPECT_NEAR(given[i], automatic[i], 1e-6) << i;
    // All cells are alike, so the ghosts hold a quarter of the dots' light wherever no edge is near; a mean over many
    // cells.
    EXPECT_NEAR(1.25, sum(given) / sum(without), 0.02);

    // Ghosts where they are told, as single dots.
    auto pair = valid();
    pair.ghost_relative_intensity = 0.5;
    pair.ghost_offset_given = 1;
    pair.ghost_offset_y_px = 9;
    auto by_hand = valid();
    std::vector<double> both = positions, peaks = {1, 1, 1, 0.5, 0.5, 0.5};
    for (std::size_t j = 0; j < positions.size(); j += 2)
        both.insert(both.end(), {positions[j], positions[j + 1] + 9});
    by_hand.positions_px = both.data();
    by_hand.count = 6;
    by_hand.peaks = peaks.data();
    EXPECT_EQ(render(by_hand), render(pair));
}

TEST_F(Dots, GhostsOfARowLieHalfwayAlongIt) {
    const double row[] = {10, 20, 24, 20, 38, 20, 52, 20};
    auto desc = valid();
    desc.positions_px = row;
    desc.count = 4;
    desc.ghost_relative_intensity = 0.5;
    const auto got = render(desc);
    EXPECT_NEAR(0.5, got[20 * width + 17], 0.01);
    EXPECT_NEAR(0.5, got[20 * width + 59], 0.01);
}

TEST_F(Dots, ScatteredLightKeepsTheSum) {
    for (double f : {0.25, 1.0}) {
        auto desc = valid();
        desc.zero_order_relative_intensity = 3;
        const auto without = render(desc);
        desc.scatter_fraction = f;
        const auto with = render(desc);
        const double mean = sum(without) / static_cast<double>(without.size());
        EXPECT_NEAR(sum(without), sum(with), 1e-6 * sum(with)) << f;
        for (std::size_t i = 0; i < with.size(); ++i)
            EXPECT_NEAR((1 - f) * without[i] + f * mean, with[i], 1e-6) << i;
    }
}

TEST_F(Dots, OutsideTheImage) {
    // One dot whose edge is seen, one far away, one absurdly far.
    const double outside[] = {-3.0, 20.0, 1e5, 20.0, -1e300, 1e300};
    auto desc = valid();
    desc.positions_px = outside;
    const auto got = render(desc);
    for (std::uint32_t x = 0; x < 12; ++x)
        EXPECT_NEAR(std::exp(-(x + 3.0) * (x + 3.0) / 8), got[20 * width + x], 1e-6) << x;
    const double far[] = {1e5, 20.0};
    desc.positions_px = far;
    desc.count = 1;
    desc.scatter_fraction = 0.5;
    for (float value : render(desc))
        EXPECT_EQ(0.0f, value);
}

TEST_F(Dots, PositionsAreExactFarFromTheOrigin) {
    // Single precision has steps of 1e-3 px at 16383: the position must not be rounded to them.
    auto desc = valid();
    desc.width = 16384;
    desc.height = 3;
    const double far[] = {16370.123456, 1.0};
    desc.positions_px = far;
    desc.count = 1;
    const auto got = render(desc);
    for (std::uint32_t x = 16360; x < 16384; ++x)
        EXPECT_NEAR(std::exp(-(x - far[0]) * (x - far[0]) / 8), got[16384 + x], 2e-7) << x;
}

TEST_F(Dots, OffsetAndPitchAndTheSameBytesEveryTime) {
    const clspeckle::Dots dots(context, valid());
    const auto expected = render(dots);
    auto out = make_image(width, height, CLSP_FORMAT_FLOAT32, 512, 64);
    dots.enqueue_render(queue, out.view);
    EXPECT_EQ(expected, download<float>(out));
    EXPECT_TRUE(margins_untouched(out));
    EXPECT_EQ(expected, render(clspeckle::Dots(context, valid())));
}

TEST_F(Dots, ConfigureKeepsDotsOrTakesOthersAllOrNothing) {
    const double sigmas[] = {1.5, 2.0, 2.5}, peaks[] = {1.0, 0.5, 4.0};
    auto desc = valid();
    desc.sigmas_px = sigmas;
    desc.peaks = peaks;
    const clspeckle::Dots dots(context, desc);
    const auto before = render(dots);

    auto kept = valid();
    kept.count = 0;
    kept.positions_px = nullptr;
    EXPECT_CLSP_OK(clspDotsConfigure(dots, &kept));
    EXPECT_EQ(before, render(dots));
    kept.scatter_fraction = 0.5;
    kept.beam_skew = 0.5;
    dots.configure(kept);
    auto whole = desc;
    whole.scatter_fraction = 0.5;
    whole.beam_skew = 0.5;
    const auto changed = render(whole);
    EXPECT_EQ(changed, render(dots));

    kept.scatter_fraction = 1.5;
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "scatter_fraction", clspDotsConfigure(dots, &kept));
    kept.scatter_fraction = 0;
    kept.sigmas_px = sigmas; // for no dots
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "count", clspDotsConfigure(dots, &kept));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "desc", clspDotsConfigure(dots, nullptr));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "dots", clspDotsConfigure(nullptr, &kept));
    test::check_struct_size<ClspDotsDesc>("clspDotsConfigure", whole,
                                          [&](ClspDotsDesc *d) { return clspDotsConfigure(dots, d); });
    EXPECT_EQ(changed, render(dots));

    auto larger = whole;
    ++larger.height;
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "another size", clspDotsConfigure(dots, &larger));
    EXPECT_EQ(changed, render(dots));

    // Other dots; what is in the queue already is not touched.
    auto image = make_image(width, height, CLSP_FORMAT_FLOAT32);
    dots.enqueue_render(queue, image.view);
    const double one[] = {5.0, 6.0};
    auto other = valid();
    other.count = 1;
    other.positions_px = one;
    dots.configure(other);
    EXPECT_EQ(changed, download<float>(image));
    const auto only = render(dots);
    EXPECT_NEAR(1.0, only[6 * width + 5], 1e-6);
    EXPECT_NEAR(two_pi * sigma * sigma, sum(only), 0.1) << "its edge is cut by the image's";
}

TEST_F(Dots, EnqueuingAllocatesAndBuildsNothing) {
    auto desc = valid();
    desc.beam_flatness = 0.3;
    desc.scatter_fraction = 0.1;
    const clspeckle::Dots dots(context, desc);
    auto image = make_image(width, height, CLSP_FORMAT_FLOAT32);
    const ClspContextInfo before = context.info();
    dots.enqueue_render(queue, image.view);
    queue.finish();
    const ClspContextInfo after = context.info();
    EXPECT_EQ(before.allocated_bytes, after.allocated_bytes);
    EXPECT_EQ(before.programs_built + before.programs_from_cache, after.programs_built + after.programs_from_cache);
}

TEST_F(Dots, CreateRefusesBadArguments) {
    using D = ClspDotsDesc;
    const auto refuses = check_create(valid());
    refuses("width", &D::width, test::bad_sides);
    refuses("height", &D::height, test::bad_sides);
    refuses("count", &D::count, {0, CLSP_MAX_DOTS + 1, ~std::uint64_t{0}});
    refuses("positions_px", &D::positions_px, {nullptr});
    refuses("reserved", &D::reserved, {1});
    refuses("principal_point_given", &D::principal_point_given, {2});
    refuses("ghost_offset_given", &D::ghost_offset_given, {2});
    refuses("sigma_px", &D::sigma_px, test::bad({0.0, -1.0, 0.009, 16385.0}));
    refuses("scale", &D::scale, test::bad({-1.0}));
    refuses("relative_wavelength_shift", &D::relative_wavelength_shift, test::bad({-1.0, 1.1}));
    refuses("beam_skew", &D::beam_skew, test::bad({-3.1, 3.1}));
    refuses("beam_skew_angle_rad", &D::beam_skew_angle_rad, test::bad());
    refuses("beam_flatness", &D::beam_flatness, test::bad({-0.1, 4.1}));
    refuses("zero_order_relative_intensity", &D::zero_order_relative_intensity, test::bad({-1.0}));
    refuses("ghost_relative_intensity", &D::ghost_relative_intensity, test::bad({-1.0}));
    refuses("scatter_fraction", &D::scatter_fraction, test::bad({-0.1, 1.1}));
    // A point without its flag is forgotten, not ignored; with it, it must be finite.
    refuses("principal_point_given is 0", &D::principal_point_x_px, {1.0, test::nan_value});
    refuses("principal_point_given is 0", &D::principal_point_y_px, {1.0, test::nan_value});
    refuses("ghost_offset_given is 0", &D::ghost_offset_x_px, {1.0, test::nan_value});
    refuses("ghost_offset_given is 0", &D::ghost_offset_y_px, {1.0, test::nan_value});
    for (double bad : test::bad()) {
        refuses("principal_point_x_px", [&](D &d) { d.principal_point_given = 1, d.principal_point_x_px = bad; });
        refuses("ghost_offset_y_px", [&](D &d) { d.ghost_offset_given = 1, d.ghost_offset_y_px = bad; });
        auto broken = positions;
        broken[3] = bad;
        refuses("y of dot 1", &D::positions_px, {broken.data()}, CLSP_ERROR_INVALID_DATA);
        broken = positions;
        broken[4] = bad;
        refuses("x of dot 2", &D::positions_px, {broken.data()}, CLSP_ERROR_INVALID_DATA);
    }
    for (double bad : test::bad({0.0, -1.0})) {
        const double sigmas[] = {1.0, bad, 1.0};
        refuses("sigmas_px[1]", &D::sigmas_px, {sigmas}, CLSP_ERROR_INVALID_DATA);
    }
    for (double bad : test::bad({-1.0})) {
        const double peaks[] = {1.0, 1.0, bad};
        refuses("peaks[2]", &D::peaks, {peaks}, CLSP_ERROR_INVALID_DATA);
    }
    refuses("ghost_offset", [](D &d) { d.count = 1, d.ghost_relative_intensity = 0.1; }); // one dot is no lattice
    const std::vector<double> many(2 * 2000, 100.0); // 2000 dots that each reach 1024 x 1024 tiles
    refuses(
        "tiles",
        [&](D &d) {
            d.width = d.height = 16384;
            d.count = 2000;
            d.positions_px = many.data();
            d.sigma_px = 16384;
        },
        CLSP_ERROR_UNSUPPORTED);
}

TEST_F(Dots, EnqueueRefusesBadArguments) {
    const clspeckle::Dots dots(context, valid());
    const auto out = make_image(width, height, CLSP_FORMAT_FLOAT32);
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "dots", enqueue(clspDotsEnqueueRender, nullptr, &out.view));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "irradiance", enqueue(clspDotsEnqueueRender, dots, nullptr));
    check_image("clspDotsEnqueueRender", "irradiance", out.view, CLSP_FORMAT_UINT8,
                [&](const ClspImage *image) { return enqueue(clspDotsEnqueueRender, dots, image); });
    check_enqueue(CLSP_NAMED(clspDotsEnqueueRender), dots, &out.view);
}

TEST_F(Dots, RetainAndRelease) {
    const ClspDotsDesc desc = valid();
    check_references("clspDotsConfigure", [&](ClspDots dots) { return clspDotsConfigure(dots, &desc); });
    const clspeckle::Dots adopted = clspeckle::Dots::adopt([&] {
        ClspDots made = nullptr;
        EXPECT_CLSP_OK(clspDotsCreate(context, &desc, &made));
        return made;
    }());
    EXPECT_TRUE(adopted);
}

} // namespace

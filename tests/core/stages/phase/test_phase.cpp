// The phase state: field grid, refresh by mask, field, saving and restoring, and what bad arguments get.
#include "stage_support.hpp"

#include <cmath>
#include <complex>
#include <cstddef>

namespace {

using Complex = std::complex<float>;

TEST(FieldGrid, SmallestSizesWithoutLargePrimeFactors) {
    struct Case {
        std::uint32_t width, height, oversampling, guard, grid_width, grid_height;
    };
    const Case cases[] = {{1, 1, 1, 0, 1, 1},
                          {1000, 1001, 1, 0, 1000, 1001}, // 7 * 11 * 13
                          {17, 19, 1, 0, 18, 20},
                          {848, 480, 1, 0, 858, 480},  // 848 = 16 * 53
                          {640, 480, 2, 3, 1287, 968}, // 1286 = 2 * 643, 966 = 2 * 3 * 7 * 23, 967 is prime
                          {16384, 4096, 1, 0, 16384, 4096}};
    for (const Case &c : cases) {
        const ClspFieldGrid grid = clspeckle::field_grid(c.width, c.height, c.oversampling, c.guard);
        EXPECT_EQ(c.grid_width, grid.grid_width) << c.width;
        EXPECT_EQ(c.grid_height, grid.grid_height) << c.height;
    }
}

TEST(FieldGrid, RefusesBadArguments) {
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "grid", clspFieldGridCompute(nullptr));
    using G = ClspFieldGrid;
    const test::Refusals<G> refuses("clspFieldGridCompute", {8, 8, 1, 0, 77, 88}, [](G *grid) {
        const ClspStatus status = clspFieldGridCompute(grid);
        EXPECT_EQ(77u, grid->grid_width) << "written in spite of an error";
        return status;
    });
    refuses("width", &G::width, test::bad_sides);
    refuses("height", &G::height, test::bad_sides);
    refuses("oversampling", &G::oversampling, {0, 9});
    refuses("guard", &G::guard_px, {0xffffffffu});
    refuses("guard", [](G &g) { g.oversampling = 8, g.guard_px = 0x80000000u; });
}

class Phase : public test::StageTest<ClspPhase> {
  protected:
    static constexpr std::uint32_t width = 20, height = 12;

    ClspPhaseDesc valid() const override {
        auto desc = clspeckle::make<ClspPhaseDesc>();
        desc.width = width;
        desc.height = height;
        desc.seed = 5;
        return desc;
    }
    std::vector<Complex> field(const clspeckle::Phase &phase, std::uint32_t polarization, std::uint32_t w = width,
                               std::uint32_t h = height) {
        return written<Complex>(w, h, CLSP_FORMAT_FLOAT32X2,
                                [&](const ClspImage &image) { phase.enqueue_field(queue, polarization, image); });
    }
};

TEST_F(Phase, DescInit) {
    const ClspPhaseDesc desc = checked_defaults();
    EXPECT_EQ(1u, desc.oversampling);
    EXPECT_EQ(0u, desc.guard_px);
    EXPECT_EQ(CLSP_FIELD_CIRCULAR_GAUSSIAN, desc.field);
    EXPECT_EQ(2u, desc.polarization_count);
    EXPECT_EQ(0u, desc.seed);
    EXPECT_EQ(CLSP_DYNAMICS_REPLACE, desc.dynamics);
    EXPECT_EQ(0u, desc.translate);
    test::check_init<ClspPhaseAdvance>("clspPhaseAdvanceInit", clspPhaseAdvanceInit);
    const auto advance = clspeckle::make<ClspPhaseAdvance>();
    EXPECT_EQ(0u, advance.substep);
    EXPECT_EQ(0.0, advance.uniform_path);
    EXPECT_EQ(1.0, advance.uniform_correlation);
}

TEST_F(Phase, CallerOfTheFirstReleaseGetsItsDefaults) {
    // Its description ended with the seed.
    static_assert(offsetof(ClspPhaseDesc, dynamics) == 40, "members are appended");
    auto desc = valid();
    desc.struct_size = 40;
    desc.dynamics = desc.translate = 0xffffffffu; // not the caller's memory
    const clspeckle::Phase old(context, desc), now(context, valid());
    EXPECT_EQ(now.state_size(), old.state_size());
    old.enqueue_refresh(queue, 3);
    now.enqueue_refresh(queue, 3);
    EXPECT_EQ(field(now, 1), field(old, 1));
}

TEST_F(Phase, StateSizes) {
    // Bytes per sample as phase.h documents them.
    const auto bytes = [&](std::uint32_t kind, std::uint32_t dynamics, std::uint32_t polarizations,
                           std::uint32_t translate) {
        auto desc = valid();
        desc.field = kind;
        desc.dynamics = dynamics;
        desc.polarization_count = polarizations;
        desc.translate = translate;
        return static_cast<double>(clspeckle::Phase(context, desc).state_size()) / (width * height);
    };
    EXPECT_EQ(8.0, bytes(CLSP_FIELD_UNIT_PHASOR, CLSP_DYNAMICS_REPLACE, 2, 0));
    EXPECT_EQ(8.0, bytes(CLSP_FIELD_CIRCULAR_GAUSSIAN, CLSP_DYNAMICS_REPLACE, 1, 0));
    EXPECT_EQ(16.0, bytes(CLSP_FIELD_CIRCULAR_GAUSSIAN, CLSP_DYNAMICS_REPLACE, 2, 0));
    EXPECT_EQ(20.0, bytes(CLSP_FIELD_CIRCULAR_GAUSSIAN, CLSP_DYNAMICS_CONTINUOUS, 1, 0));
    EXPECT_EQ(36.0, bytes(CLSP_FIELD_CIRCULAR_GAUSSIAN, CLSP_DYNAMICS_CONTINUOUS, 2, 0));
    EXPECT_EQ(44.0, bytes(CLSP_FIELD_CIRCULAR_GAUSSIAN, CLSP_DYNAMICS_CONTINUOUS, 2, 1));
}

TEST_F(Phase, AdvanceRefusesBadArguments) {
    auto desc = valid();
    desc.dynamics = CLSP_DYNAMICS_CONTINUOUS;
    desc.translate = 1;
    const clspeckle::Phase phase(context, desc);
    const auto path = floats(std::vector<float>(width * height, 0.1f), width, height);
    const auto correlation = floats(std::vector<float>(width * height, 0.9f), width, height);
    const auto shift = upload(std::vector<float>(2 * width * height, 0.0f), width, height, CLSP_FORMAT_FLOAT32X2);
    const auto mask = upload(std::vector<std::uint8_t>(width * height, 0), width, height, CLSP_FORMAT_UINT8);
    auto advance = clspeckle::make<ClspPhaseAdvance>();
    advance.path = path.view;
    advance.correlation = correlation.view;
    advance.shift = shift.view;
    advance.mask = mask.view;
    using A = ClspPhaseAdvance;
    const auto call = [&](ClspPhase p, const A *a, std::uint64_t frame_index = 1) {
        return enqueue(clspPhaseEnqueueAdvance, p, frame_index, a);
    };
    const test::Failures fails("clspPhaseEnqueueAdvance");
    fails(CLSP_ERROR_INVALID_STATE, "refresh", call(phase, &advance));
    phase.enqueue_refresh(queue, 0);
    fails(CLSP_ERROR_INVALID_HANDLE, "phase", call(nullptr, &advance));
    fails(CLSP_ERROR_INVALID_ARGUMENT, "advance", call(phase, nullptr));
    fails(CLSP_ERROR_INVALID_ARGUMENT, "frame_index", call(phase, &advance, std::uint64_t{1} << 48));
    check_enqueue(CLSP_NAMED(clspPhaseEnqueueAdvance), phase, 2, &advance);
    // With nothing to do there is still an event.
    const auto nothing = clspeckle::make<A>();
    check_enqueue(CLSP_NAMED(clspPhaseEnqueueAdvance), phase, 2, &nothing);
    const auto refusals = [&](const clspeckle::Phase &p, const A &base) {
        return test::Refusals<A>("clspPhaseEnqueueAdvance", base, [&](A *a) { return call(p, a); });
    };
    const auto of_all = refusals(phase, advance);
    of_all.check_struct_size();
    of_all.check_image(context, "path", &A::path, CLSP_FORMAT_FLOAT32X2);
    of_all.check_image(context, "correlation", &A::correlation, CLSP_FORMAT_UINT8);
    of_all.check_image(context, "shift", &A::shift, CLSP_FORMAT_FLOAT32);
    of_all.check_image(context, "mask", &A::mask, CLSP_FORMAT_FLOAT32);
    const auto refuses = refusals(phase, nothing);
    refuses("uniform_path", &A::uniform_path, {-1.0, test::nan_value});
    refuses("uniform_correlation", &A::uniform_correlation, test::bad({-0.1, 1.1}));
    refuses("substep", &A::substep, {128});
    refuses("both path", [&](A &a) { a.path = path.view, a.uniform_path = 1.0; });
    refuses("both correlation", [&](A &a) { a.correlation = correlation.view, a.uniform_correlation = 0.5; });
    const clspeckle::Phase kept_or_replaced(context, valid());
    kept_or_replaced.enqueue_refresh(queue, 0);
    refusals(kept_or_replaced, nothing)("dynamics continuous", &A::path, {path.view});
    refusals(kept_or_replaced, nothing)("dynamics continuous", &A::uniform_path, {test::infinity});
    refusals(kept_or_replaced, nothing)("translate", &A::shift, {shift.view});
    desc = valid();
    desc.field = CLSP_FIELD_UNIT_PHASOR;
    const clspeckle::Phase phasors(context, desc);
    phasors.enqueue_refresh(queue, 0);
    refusals(phasors, nothing)("unit phasor", &A::uniform_correlation, {0.5});
    refusals(phasors, nothing)("unit phasor", &A::correlation, {correlation.view});
    queue.finish();
    EXPECT_CLSP_OK(clspPhaseCheck(phase, queue));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "phase", clspPhaseCheck(nullptr, queue));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "queue", clspPhaseCheck(phase, nullptr));
}

TEST_F(Phase, AdvanceReportsBadPixels) {
    auto desc = valid();
    desc.dynamics = CLSP_DYNAMICS_CONTINUOUS;
    desc.oversampling = 2; // and a padded grid: a pixel counts once
    desc.guard_px = 1;
    const clspeckle::Phase phase(context, desc);
    phase.enqueue_refresh(queue, 0);
    std::vector<float> values(width * height, 0.0f);
    values[3 * width + 7] = std::nanf("");
    values[3 * width + 8] = -1.0f;
    values[width * height - 1] = -HUGE_VALF; // the corner, which the padding repeats
    values[5] = HUGE_VALF;                   // replaced, not bad
    const auto path = floats(values, width, height);
    auto advance = clspeckle::make<ClspPhaseAdvance>();
    advance.path = path.view;
    phase.enqueue_advance(queue, 1, advance);
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_DATA, "2 pixels", clspPhaseCheck(phase, queue));
    EXPECT_CLSP_OK(clspPhaseCheck(phase, queue));
    phase.enqueue_advance(queue, 2, advance);
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_DATA, "1 with one out of range", clspPhaseCheck(phase, queue));
    phase.enqueue_advance(queue, 3, advance);
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_DATA, "x = 7, y = 3", clspPhaseCheck(phase, queue));
}

TEST_F(Phase, UnitPhasorsHaveMagnitudeOneAndPolarizationsDiffer) {
    auto desc = valid();
    desc.field = CLSP_FIELD_UNIT_PHASOR;
    const clspeckle::Phase phase(context, desc);
    phase.enqueue_refresh(queue, 0);
    const auto first = field(phase, 0), second = field(phase, 1);
    for (std::size_t i = 0; i < first.size(); ++i)
        ASSERT_NEAR(1.0f, std::abs(first[i]), 3e-7f);
    EXPECT_NE(first, second);
    const clspeckle::Phase again(context, desc);
    again.enqueue_refresh(queue, 0);
    EXPECT_EQ(first, field(again, 0)) << "the same seed gives the same bits";
    desc.seed = 6;
    const clspeckle::Phase other(context, desc);
    other.enqueue_refresh(queue, 0);
    EXPECT_NE(first, field(other, 0));
}

TEST_F(Phase, GaussianFieldIsTheDocumentedFunctionOfPhilox) {
    const clspeckle::Phase phase(context, valid());
    phase.enqueue_refresh(queue, 3);
    const auto z = field(phase, 1);
    // Streams below 0x8000 are the library's, so the same words come from blocks with the counters of the mapping.
    const std::uint32_t quarter = (height + 3) / 4;
    std::vector<std::array<std::uint32_t, 4>> counters;
    for (std::uint32_t stream : {2u, 4u}) // phase and magnitude of polarization 1
        for (std::uint32_t y = 0; y < height; ++y)
            for (std::uint32_t x = 0; x < width; ++x)
                counters.push_back({x, y % quarter, 3, stream});
    const clspeckle::Buffer blocks(context, queue, counters);
    const std::uint32_t key[2] = {5, 0};
    clspeckle::philox::enqueue_blocks(context, queue, blocks, 0, key, counters.size(), 0, blocks, 0);
    const auto words = blocks.read<std::array<std::uint32_t, 4>>(queue, counters.size());
    for (std::uint32_t y = 0; y < height; ++y) {
        for (std::uint32_t x = 0; x < width; ++x) {
            const std::size_t i = y * width + x;
            const double phi = 2.0 * M_PI * words[i][y / quarter] * 0x1p-32;
            const double u = words[i + width * height][y / quarter] * 0x1p-32 + 0x1p-33;
            const std::complex<double> expected = std::polar(std::sqrt(-std::log(u)), phi);
            ASSERT_LT(std::abs(expected - std::complex<double>(z[i])), 1e-6) << x << ", " << y;
        }
    }
}

TEST_F(Phase, MaskedPixelsAloneGetNewValues) {
    const clspeckle::Phase phase(context, valid());
    std::vector<std::uint8_t> bits(width * height, 0);
    bits[3 * width + 7] = 1;
    bits[11 * width + 19] = 255;
    auto mask = upload(bits, width, height, CLSP_FORMAT_UINT8, 64, 5);
    phase.enqueue_refresh(queue, 0, &mask.view); // the first one draws everything all the same
    for (std::uint32_t polarization : {0u, 1u})
        for (const Complex &z : field(phase, polarization))
            ASSERT_GT(std::abs(z), 0.0f);
    const auto before = field(phase, 0), before_second = field(phase, 1);
    phase.enqueue_refresh(queue, 1, &mask.view);
    const auto after = field(phase, 0), after_second = field(phase, 1);
    const clspeckle::Phase all(context, valid());
    all.enqueue_refresh(queue, 1);
    const auto fresh = field(all, 0);
    for (std::size_t i = 0; i < bits.size(); ++i) {
        EXPECT_EQ(bits[i] ? fresh[i] : before[i], after[i]) << i;
        EXPECT_EQ(bits[i] != 0, before_second[i] != after_second[i]) << i;
    }
    const std::vector<std::uint8_t> zeros(width * height, 0);
    auto nothing = upload(zeros, width, height, CLSP_FORMAT_UINT8);
    phase.enqueue_refresh(queue, 2, &nothing.view);
    EXPECT_EQ(after, field(phase, 0));
    phase.enqueue_refresh(queue, 1);
    EXPECT_EQ(fresh, field(phase, 0));
}

TEST_F(Phase, OversampledAndPaddedSamplesFollowTheirPixel) {
    auto desc = valid();
    desc.width = 17; // padded from 34 to 35
    desc.height = 5;
    desc.oversampling = 2;
    const clspeckle::Phase phase(context, desc);
    const ClspFieldGrid grid = clspeckle::field_grid(17, 5, 2, 0);
    ASSERT_EQ(35u, grid.grid_width);
    ASSERT_EQ(10u, grid.grid_height);
    phase.enqueue_refresh(queue, 0);
    const auto before = field(phase, 0, 35, 10);
    std::vector<std::uint8_t> bits(17 * 5, 0);
    bits[2 * 17 + 16] = 1; // the last pixel of row 2: its samples, and the one padding sample beside them
    auto mask = upload(bits, 17, 5, CLSP_FORMAT_UINT8);
    phase.enqueue_refresh(queue, 1, &mask.view);
    const auto after = field(phase, 0, 35, 10);
    for (std::uint32_t y = 0; y < 10; ++y)
        for (std::uint32_t x = 0; x < 35; ++x)
            EXPECT_EQ(x >= 32 && y / 2 == 2, before[y * 35 + x] != after[y * 35 + x]) << x << ", " << y;
}

TEST_F(Phase, SavedStateComesBackBitForBit) {
    const clspeckle::Phase phase(context, valid());
    const std::uint64_t size = phase.state_size();
    ASSERT_GT(size, 0u);
    const clspeckle::Buffer state(context, size + 256);
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_STATE, "refresh", enqueue(clspPhaseEnqueueSave, phase, state, 0));
    phase.enqueue_refresh(queue, 9);
    const auto before = field(phase, 0), before_second = field(phase, 1);
    phase.enqueue_save(queue, state, 256);
    phase.enqueue_refresh(queue, 10);
    EXPECT_NE(before, field(phase, 0));
    phase.enqueue_restore(queue, state, 256);
    EXPECT_EQ(before, field(phase, 0));
    EXPECT_EQ(before_second, field(phase, 1));
    const clspeckle::Phase never_refreshed(context, valid());
    never_refreshed.enqueue_restore(queue, state, 256);
    EXPECT_EQ(before, field(never_refreshed, 0));
}

TEST_F(Phase, CreateRefusesBadArguments) {
    using D = ClspPhaseDesc;
    const auto refuses = check_create(valid());
    refuses("width", &D::width, test::bad_sides);
    refuses("height", &D::height, test::bad_sides);
    refuses(
        "grid", [](D &d) { d.width = d.height = 16384, d.oversampling = 8; }, CLSP_ERROR_UNSUPPORTED);
    refuses("oversampling", &D::oversampling, {0, 9});
    refuses("guard", &D::guard_px, {0xffffffffu});
    refuses("field is 2, expected CLSP_FIELD_CIRCULAR_GAUSSIAN (0) or CLSP_FIELD_UNIT_PHASOR (1)", &D::field, {2});
    refuses("polarization_count", &D::polarization_count, {0, 3});
    refuses("reserved", &D::reserved, {1});
    refuses("dynamics is 2, expected CLSP_DYNAMICS_REPLACE (0) or CLSP_DYNAMICS_CONTINUOUS (1)", &D::dynamics, {2});
    refuses("translate", &D::translate, {2});
    refuses("circular Gaussian", [](D &d) { d.dynamics = CLSP_DYNAMICS_CONTINUOUS, d.field = CLSP_FIELD_UNIT_PHASOR; });
}

TEST_F(Phase, EnqueueRefusesBadArguments) {
    const clspeckle::Phase phase(context, valid());
    const auto mask = upload(std::vector<std::uint8_t>(width * height, 1), width, height, CLSP_FORMAT_UINT8);
    const auto out = make_image(width, height, CLSP_FORMAT_FLOAT32X2);
    const clspeckle::Buffer state(context, phase.state_size());
    const test::Foreign foreign;
    constexpr std::uint64_t late = std::uint64_t{1} << 48;

    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_STATE, "refresh", enqueue(clspPhaseEnqueueField, phase, 0, &out.view));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "phase", enqueue(clspPhaseEnqueueRefresh, nullptr, 0, nullptr));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "frame_index",
                      enqueue(clspPhaseEnqueueRefresh, phase, late, nullptr));
    EXPECT_CLSP_OK(enqueue(clspPhaseEnqueueRefresh, phase, late - 1, nullptr));
    check_image(
        "clspPhaseEnqueueRefresh", "mask", mask.view, CLSP_FORMAT_UINT16,
        [&](const ClspImage *image) { return enqueue(clspPhaseEnqueueRefresh, phase, 0, image); }, true);
    check_enqueue(CLSP_NAMED(clspPhaseEnqueueRefresh), phase, 0, &mask.view);

    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "phase", enqueue(clspPhaseEnqueueField, nullptr, 0, &out.view));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "field", enqueue(clspPhaseEnqueueField, phase, 0, nullptr));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "polarization", enqueue(clspPhaseEnqueueField, phase, 2, &out.view));
    check_image("clspPhaseEnqueueField", "field", out.view, CLSP_FORMAT_FLOAT32,
                [&](const ClspImage *image) { return enqueue(clspPhaseEnqueueField, phase, 0, image); });
    check_enqueue(CLSP_NAMED(clspPhaseEnqueueField), phase, 1, &out.view);

    std::uint64_t ignored = 0;
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "phase", clspPhaseGetStateSize(nullptr, &ignored));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "size_bytes", clspPhaseGetStateSize(phase, nullptr));

    const auto of_state = [&](const char *name, auto function) {
        const test::Failures fails(name);
        fails(CLSP_ERROR_INVALID_HANDLE, "phase", enqueue(function, nullptr, state, 0));
        fails(CLSP_ERROR_INVALID_ARGUMENT, "mem", enqueue(function, phase, nullptr, 0));
        fails(CLSP_ERROR_BUFFER_TOO_SMALL, "mem", enqueue(function, phase, state, 4));
        fails(CLSP_ERROR_BUFFER_TOO_SMALL, "mem", enqueue(function, phase, state, ~std::uint64_t{0} - 3));
        fails(CLSP_ERROR_WRONG_CONTEXT, "mem", enqueue(function, phase, foreign.buffer, 0));
        check_enqueue(name, function, phase, state, 0);
    };
    of_state(CLSP_NAMED(clspPhaseEnqueueSave));
    of_state(CLSP_NAMED(clspPhaseEnqueueRestore));
}

TEST_F(Phase, RetainAndRelease) {
    check_references("clspPhaseEnqueueRefresh",
                     [&](ClspPhase phase) { return enqueue(clspPhaseEnqueueRefresh, phase, 0, nullptr); });
}

} // namespace

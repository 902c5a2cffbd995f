// The aperture: pupil, intensity, host workspace, and what bad arguments get.
#include "stage_support.hpp"

namespace {

class Aperture : public test::StageTest<ClspAperture> {
  protected:
    static constexpr std::uint32_t width = 24, height = 20;

    ClspApertureDesc valid() const override {
        auto desc = clspeckle::make<ClspApertureDesc>();
        desc.width = width;
        desc.height = height;
        desc.relative_diameter = 0.5;
        return desc;
    }
    clspeckle::Phase make_phase(const std::function<void(ClspPhaseDesc &)> &change = {}) {
        auto desc = clspeckle::make<ClspPhaseDesc>();
        desc.width = width;
        desc.height = height;
        if (change)
            change(desc);
        clspeckle::Phase phase(context, desc);
        phase.enqueue_refresh(queue, 0);
        return phase;
    }
    std::vector<float> pupil(const clspeckle::Aperture &aperture) {
        const ClspApertureInfo info = aperture.info();
        return written(info.grid_width, info.grid_height, CLSP_FORMAT_FLOAT32,
                       [&](const ClspImage &image) { aperture.enqueue_pupil(queue, image); });
    }
    std::vector<float> intensity(const clspeckle::Aperture &aperture, const clspeckle::Phase &phase,
                                 const Image &ideal) {
        return written(ideal.view.width, ideal.view.height, CLSP_FORMAT_FLOAT32,
                       [&](const ClspImage &image) { aperture.enqueue_intensity(queue, phase, ideal.view, image); });
    }
};

TEST_F(Aperture, DescInit) {
    const ClspApertureDesc desc = checked_defaults();
    EXPECT_EQ(1u, desc.oversampling);
    EXPECT_EQ(0u, desc.guard_px);
    EXPECT_EQ(CLSP_PUPIL_CIRCLE, desc.pupil);
    EXPECT_EQ(CLSP_NORMALIZATION_TRANSMISSION, desc.normalization);
    EXPECT_EQ(0u, desc.workspace_from_host);
    EXPECT_EQ(0.0, desc.relative_diameter);
    EXPECT_EQ(5.6, desc.f_number);
    EXPECT_EQ(2.9e-6, desc.pixel_pitch_m);
    EXPECT_EQ(940e-9, desc.wavelength_m);
    EXPECT_EQ(0.0, desc.soft_rim);
    EXPECT_EQ(1.0, desc.degree_of_polarization);
    EXPECT_EQ(nullptr, desc.pupil_image);
    EXPECT_EQ(0u, desc.pupil_pitch_bytes);
    EXPECT_EQ(nullptr, desc.pupil_image_imaginary);
}

TEST_F(Aperture, RelativeDiameterFollowsFromTheLens) {
    auto desc = valid();
    desc.relative_diameter = 0;
    desc.f_number = 8;
    const ClspApertureInfo info = clspeckle::Aperture(context, desc).info();
    EXPECT_NEAR(2.9e-6 / (940e-9 * 8), info.relative_diameter, 1e-12);
    EXPECT_EQ(24u, info.grid_width);
    EXPECT_EQ(20u, info.grid_height);
    EXPECT_GT(info.workspace_bytes, 0u);
    const std::string engine = info.fft_engine;
    EXPECT_TRUE(engine == "cpu" || engine == "gpu" || engine == "clfft") << engine;
    EXPECT_EQ(engine, info.fft_backend);
    EXPECT_EQ(engine != "clfft", std::string(info.fft_reason).empty()) << info.fft_reason;
}

TEST_F(Aperture, CirclePassesWhatLiesStrictlyInside) {
    for (const double d : {0.1, 0.5, 1.0}) {
        auto desc = valid();
        desc.relative_diameter = d;
        const clspeckle::Aperture aperture(context, desc);
        const auto p = pupil(aperture);
        std::uint32_t samples = 0;
        for (std::uint32_t y = 0; y < height; ++y) {
            for (std::uint32_t x = 0; x < width; ++x) {
                const int kx = x < width / 2 ? static_cast<int>(x) : static_cast<int>(x) - static_cast<int>(width);
                const int ky = y < height / 2 ? static_cast<int>(y) : static_cast<int>(y) - static_cast<int>(height);
                const double left = kx * kx * 400.0 + ky * ky * 576.0, right = d * d * 576.0 * 400.0 / 4;
                const float expected = left < (1 - 0x1p-40) * right ? 1.0f : 0.0f;
                EXPECT_EQ(expected, p[y * width + x]) << "D " << d << " at " << kx << ", " << ky;
                samples += expected > 0;
            }
        }
        EXPECT_EQ(samples, aperture.info().pupil_samples);
        EXPECT_NEAR(samples / double(width * height), aperture.info().mean_transmission, 1e-7);
    }
}

TEST_F(Aperture, SoftRimFallsMonotonically) {
    auto desc = valid();
    desc.relative_diameter = 1.0;
    desc.soft_rim = 0.5;
    const auto p = pupil(clspeckle::Aperture(context, desc));
    EXPECT_EQ(1.0f, p[0]);
    EXPECT_EQ(1.0f, p[6]);          // half of the radius of 12: the rim begins
    EXPECT_NEAR(0.5f, p[9], 1e-6f); // the middle of the raised cosine
    for (int x = 1; x < 12; ++x)
        EXPECT_LE(p[x], p[x - 1]) << x;
    EXPECT_EQ(0.0f, p[12]);
}

TEST_F(Aperture, PupilImageAndItsPitch) {
    auto desc = valid();
    desc.pupil = CLSP_PUPIL_IMAGE;
    desc.relative_diameter = 0.5;
    const std::vector<float> image = {0.25f, 0.25f, -1.0f, 0.25f, 0.25f, -1.0f}; // two samples a row, one of padding
    desc.pupil_image = image.data();
    desc.pupil_width = 2;
    desc.pupil_height = 2;
    desc.pupil_pitch_bytes = 3 * sizeof(float);
    const clspeckle::Aperture aperture(context, desc);
    const auto p = pupil(aperture);
    for (std::uint32_t y = 0; y < height; ++y) {
        for (std::uint32_t x = 0; x < width; ++x) {
            const double fx = (x < width / 2 ? x : double(x) - width) / width;
            const double fy = (y < height / 2 ? y : double(y) - height) / height;
            EXPECT_EQ(std::abs(fx) < 0.25 && std::abs(fy) < 0.25 ? 0.25f : 0.0f, p[y * width + x]) << fx << ", " << fy;
        }
    }
}

TEST_F(Aperture, FullPupilGivesTheIdealImageBackForUnitPhasors) {
    // A square pupil that passes all frequencies but those on its edge; with an odd size none lies there.
    auto desc = valid();
    desc.width = 21;
    desc.height = 15;
    desc.relative_diameter = 1.0;
    desc.pupil = CLSP_PUPIL_IMAGE;
    const float one = 1.0f;
    desc.pupil_image = &one;
    desc.pupil_width = desc.pupil_height = 1;
    const auto phase = make_phase([](ClspPhaseDesc &d) {
        d.width = 21;
        d.height = 15;
        d.field = CLSP_FIELD_UNIT_PHASOR;
    });
    const auto ideal = test::dots(21, 15);
    const clspeckle::Aperture aperture(context, desc);
    EXPECT_NEAR(1.0, aperture.info().mean_transmission, 1e-12);
    const auto got = intensity(aperture, phase, floats(ideal, 21, 15));
    for (std::size_t i = 0; i < ideal.size(); ++i)
        EXPECT_NEAR(ideal[i], got[i], 2e-6f) << i;
}

TEST_F(Aperture, PartialPolarizationIsTheWeightedSum) {
    const auto phase = make_phase();
    const auto ideal = floats(test::dots(width, height), width, height);
    const auto at = [&](double p) {
        auto desc = valid();
        desc.degree_of_polarization = p;
        return intensity(clspeckle::Aperture(context, desc), phase, ideal);
    };
    const auto first = at(1.0), half = at(0.5), none = at(0.0);
    for (std::size_t i = 0; i < first.size(); ++i) {
        const double second = 2.0 * none[i] - first[i]; // |V_2|^2
        EXPECT_NEAR(0.75 * first[i] + 0.25 * second, half[i], 1e-6) << i;
        EXPECT_GE(second, -1e-6) << i;
    }
}

TEST_F(Aperture, UnitMeanScalesByTheTransmission) {
    const auto phase = make_phase();
    const auto ideal = floats(test::dots(width, height), width, height);
    auto desc = valid();
    const clspeckle::Aperture dim(context, desc);
    desc.normalization = CLSP_NORMALIZATION_UNIT_MEAN;
    const clspeckle::Aperture bright(context, desc);
    EXPECT_EQ(dim.info().mean_transmission, bright.info().mean_transmission);
    const auto a = intensity(dim, phase, ideal), b = intensity(bright, phase, ideal);
    for (std::size_t i = 0; i < a.size(); ++i)
        EXPECT_NEAR(a[i] / dim.info().mean_transmission, b[i], 1e-5 * (1 + b[i])) << i;
}

TEST_F(Aperture, OversamplingDoesNotChangeTheLight) {
    for (std::uint32_t oversampling : {1u, 2u, 4u}) {
        auto desc = valid();
        desc.width = desc.height = 128;
        desc.oversampling = oversampling;
        // About pi D^2 / 4; a circle of radius 32 samples on the grid is off by less than 1 %.
        EXPECT_NEAR(M_PI * 0.25 / 4, clspeckle::Aperture(context, desc).info().mean_transmission, 0.002)
            << oversampling;
    }
}

TEST_F(Aperture, BadPixelsCountAsZero) {
    const auto phase = make_phase();
    auto ideal = test::dots(width, height);
    const clspeckle::Aperture aperture(context, valid());
    auto cleaned = ideal;
    for (std::size_t i : {0, 77, 200, 301})
        cleaned[i] = 0.0f;
    ideal[0] = std::numeric_limits<float>::quiet_NaN();
    ideal[77] = -1.0f;
    ideal[200] = std::numeric_limits<float>::infinity();
    ideal[301] = -std::numeric_limits<float>::infinity();
    EXPECT_EQ(intensity(aperture, phase, floats(cleaned, width, height)),
              intensity(aperture, phase, floats(ideal, width, height)));
}

TEST_F(Aperture, OffsetPitchAndInPlaceGiveTheSameBytes) {
    const auto phase = make_phase();
    const clspeckle::Aperture aperture(context, valid());
    const auto ideal = test::dots(width, height);
    const auto expected = intensity(aperture, phase, floats(ideal, width, height));
    auto in = upload(ideal, width, height, CLSP_FORMAT_FLOAT32, 256, 36);
    auto out = make_image(width, height, CLSP_FORMAT_FLOAT32, 128, 4096);
    aperture.enqueue_intensity(queue, phase, in.view, out.view);
    EXPECT_EQ(expected, download<float>(out));
    EXPECT_TRUE(margins_untouched(out));
    EXPECT_TRUE(margins_untouched(in));
    EXPECT_EQ(ideal, download<float>(in)) << "the input was changed";
    aperture.enqueue_intensity(queue, phase, in.view, in.view);
    EXPECT_EQ(expected, download<float>(in)) << "in place";
    EXPECT_TRUE(margins_untouched(in));
}

TEST_F(Aperture, PaddedGridKeepsTheImage) {
    auto desc = valid();
    desc.width = 17;
    desc.height = 19;
    desc.oversampling = 2;
    desc.guard_px = 2;
    const clspeckle::Aperture aperture(context, desc);
    EXPECT_EQ(39u, aperture.info().grid_width); // 38 = 2 * 19
    EXPECT_EQ(42u, aperture.info().grid_height);
    const auto phase = make_phase([](ClspPhaseDesc &d) {
        d.width = 17;
        d.height = 19;
        d.oversampling = 2;
        d.guard_px = 2;
    });
    const auto dark = intensity(aperture, phase, floats(std::vector<float>(17 * 19, 0.0f), 17, 19));
    for (float value : dark)
        EXPECT_EQ(0.0f, value);
    const auto bright = intensity(aperture, phase, floats(std::vector<float>(17 * 19, 1.0f), 17, 19));
    double mean = 0;
    for (float value : bright) {
        EXPECT_GE(value, 0.0f);
        mean += value / (17.0 * 19.0);
    }
    // About 17 * 19 * D^2 * pi / 4 = 60 independent speckles: a standard error of 0.13 of the mean; five of them.
    EXPECT_NEAR(1.0, mean / aperture.info().mean_transmission, 0.65);
}

TEST_F(Aperture, WorkspaceFromTheHost) {
    const auto phase = make_phase();
    const auto ideal = floats(test::dots(width, height), width, height);
    auto out = make_image(width, height, CLSP_FORMAT_FLOAT32);
    const auto expected = intensity(clspeckle::Aperture(context, valid()), phase, ideal);
    auto desc = valid();
    desc.workspace_from_host = 1;
    const std::uint64_t before = context.info().allocated_bytes;
    const clspeckle::Aperture aperture(context, desc);
    const std::uint64_t bytes = aperture.info().workspace_bytes;
    EXPECT_LT(context.info().allocated_bytes - before, bytes) << "the library allocated work memory all the same";
    const auto run = [&](const ClspImage &in, const ClspImage &result) {
        return enqueue(clspApertureEnqueueIntensity, aperture, phase, &in, &result);
    };
    const test::Failures frame_fails("clspApertureEnqueueIntensity");
    frame_fails(CLSP_ERROR_INVALID_STATE, "workspace", run(ideal.view, out.view));
    {
        const clspeckle::Buffer workspace(context, bytes + 8192);
        const test::Foreign foreign;
        const clspeckle::Aperture own_workspace(context, valid());
        const test::Failures fails("clspApertureSetWorkspace");
        const auto set = clspApertureSetWorkspace;
        fails(CLSP_ERROR_INVALID_HANDLE, "aperture", set(nullptr, workspace, 0, bytes));
        fails(CLSP_ERROR_INVALID_ARGUMENT, "mem", set(aperture, nullptr, 0, bytes));
        fails(CLSP_ERROR_INVALID_ARGUMENT, "offset", set(aperture, workspace, 64, bytes));
        fails(CLSP_ERROR_BUFFER_TOO_SMALL, "size_bytes", set(aperture, workspace, 0, bytes - 1));
        fails(CLSP_ERROR_BUFFER_TOO_SMALL, "mem|workspace", set(aperture, workspace, 8192, bytes + 1));
        fails(CLSP_ERROR_BUFFER_TOO_SMALL, "mem|workspace", set(aperture, workspace, ~std::uint64_t{0} - 4095, bytes));
        fails(CLSP_ERROR_WRONG_CONTEXT, "mem|workspace", set(aperture, foreign.buffer, 0, bytes));
        fails(CLSP_ERROR_INVALID_STATE, "workspace", set(own_workspace, workspace, 0, bytes));
        EXPECT_CLSP_OK(set(aperture, workspace, 4096, bytes));
        const ClspImage inside = workspace.image(width, height, CLSP_FORMAT_FLOAT32, 0, 4096 + 64);
        frame_fails(CLSP_ERROR_OVERLAP, "work", run(inside, out.view));
        frame_fails(CLSP_ERROR_OVERLAP, "work", run(ideal.view, inside));
        const ClspImage before_it = workspace.image(8, 8, CLSP_FORMAT_FLOAT32);
        frame_fails(CLSP_ERROR_INVALID_ARGUMENT, "irradiance", run(before_it, out.view)); // its size, not its place
    } // the library keeps the memory
    EXPECT_EQ(expected, intensity(aperture, phase, ideal));
}

TEST_F(Aperture, CreateRefusesBadArguments) {
    using D = ClspApertureDesc;
    const auto refuses = check_create(valid());
    refuses("width", &D::width, test::bad_sides);
    refuses("height", &D::height, test::bad_sides);
    refuses("oversampling", &D::oversampling, {0, 9});
    refuses("guard", &D::guard_px, {0xffffffffu});
    refuses("CLSP_PUPIL_CIRCLE (0), CLSP_PUPIL_IMAGE (1), CLSP_PUPIL_POLYGON (2) or CLSP_PUPIL_RING (3)", &D::pupil,
            {4});
    refuses("expected CLSP_NORMALIZATION_TRANSMISSION (0) or CLSP_NORMALIZATION_UNIT_MEAN (1)", &D::normalization, {2});
    refuses("workspace_from_host", &D::workspace_from_host, {2});
    refuses("relative_diameter", &D::relative_diameter, test::bad({-0.5}));
    for (double bad : {0.0, -1.0, test::nan_value, test::infinity}) {
        refuses("f_number", [&](D &d) { d.relative_diameter = 0, d.f_number = bad; });
        refuses("pixel_pitch_m", [&](D &d) { d.relative_diameter = 0, d.pixel_pitch_m = bad; });
        refuses("wavelength_m", [&](D &d) { d.relative_diameter = 0, d.wavelength_m = bad; });
    }
    // D above what the grid carries; the message says what to do.
    refuses("set oversampling to 2 or more", &D::relative_diameter, {1.01});
    refuses("no grid carries more than 8: use a larger f_number", &D::relative_diameter, {8.01});
    refuses("oversampling", [](D &d) { d.relative_diameter = 2.5, d.oversampling = 2; });
    refuses("oversampling", [](D &d) { d.relative_diameter = 0, d.f_number = 2.8; }); // D = 1.10
    refuses("soft_rim", &D::soft_rim, test::bad({-0.1, 1.1}));
    refuses("degree_of_polarization", &D::degree_of_polarization, test::bad({-0.1, 1.1}));
    refuses(
        "grid", [](D &d) { d.width = d.height = 16384, d.oversampling = 8; }, CLSP_ERROR_UNSUPPORTED);
    D desc = valid();
    const std::vector<float> image(6, 0.5f);
    desc.pupil = CLSP_PUPIL_IMAGE;
    desc.pupil_image = image.data();
    desc.pupil_width = 3;
    desc.pupil_height = 2;
    const auto refuses_image = check_create(desc);
    refuses_image("pupil_image", &D::pupil_image, {nullptr});
    refuses_image("pupil_image", &D::pupil, {CLSP_PUPIL_CIRCLE});
    refuses_image("pupil_pitch_bytes", &D::pupil_pitch_bytes,
                  {8, 13, std::uint64_t{1} << 40, std::uint64_t{1} << 63, ~std::uint64_t{3}});
    refuses_image("pupil", &D::pupil_width, {0u, 16385u});
    refuses_image("pupil", &D::pupil_height, {0u, 16385u});
    for (double bad : test::bad({-0.1, 1.1})) {
        std::vector<float> values(6, 0.5f);
        values[4] = static_cast<float>(bad);
        refuses_image("pupil_image", &D::pupil_image, {values.data()}, CLSP_ERROR_INVALID_DATA);
    }
    // With imaginary parts: each part is looked at, and the magnitude of both.
    std::vector<float> imaginary(6, 0.5f);
    refuses("pupil_image", &D::pupil_image_imaginary, {imaginary.data()});
    for (double bad : test::bad({-1.1, 0.9})) {
        imaginary[4] = static_cast<float>(bad);
        refuses_image("pupil_image_imaginary", &D::pupil_image_imaginary, {imaginary.data()}, CLSP_ERROR_INVALID_DATA);
        imaginary[4] = 0.5f;
    }
    desc.pupil_image_imaginary = imaginary.data();
    std::vector<float> negative(6, -0.5f);
    desc.pupil_image = negative.data();
    const clspeckle::Aperture takes(context, desc);
    EXPECT_GT(takes.info().pupil_samples, 0u);
}

TEST_F(Aperture, EnqueueRefusesBadArguments) {
    const clspeckle::Aperture aperture(context, valid());
    const auto phase = make_phase();
    auto ideal = floats(test::dots(width, height), width, height);
    auto out = make_image(width, height, CLSP_FORMAT_FLOAT32);
    const auto run = [&](ClspAperture a, ClspPhase p, const ClspImage *in, const ClspImage *result) {
        return enqueue(clspApertureEnqueueIntensity, a, p, in, result);
    };
    const test::Failures fails("clspApertureEnqueueIntensity");
    fails(CLSP_ERROR_INVALID_HANDLE, "aperture", run(nullptr, phase, &ideal.view, &out.view));
    fails(CLSP_ERROR_INVALID_HANDLE, "phase", run(aperture, nullptr, &ideal.view, &out.view));
    fails(CLSP_ERROR_INVALID_ARGUMENT, "irradiance", run(aperture, phase, nullptr, &out.view));
    fails(CLSP_ERROR_INVALID_ARGUMENT, "intensity", run(aperture, phase, &ideal.view, nullptr));
    check_image("clspApertureEnqueueIntensity", "irradiance", ideal.view, CLSP_FORMAT_UINT16,
                [&](const ClspImage *image) { return run(aperture, phase, image, &out.view); });
    check_image("clspApertureEnqueueIntensity", "intensity", out.view, CLSP_FORMAT_FLOAT32X2,
                [&](const ClspImage *image) { return run(aperture, phase, &ideal.view, image); });
    check_enqueue(CLSP_NAMED(clspApertureEnqueueIntensity), aperture, phase, &ideal.view, &out.view);
    // Overlap without being the same image: half a row further in one buffer.
    const clspeckle::Buffer both(context, 2 * width * height * sizeof(float));
    const ClspImage first = both.image(width, height, CLSP_FORMAT_FLOAT32);
    const ClspImage shifted = both.image(width, height, CLSP_FORMAT_FLOAT32, 0, width * sizeof(float) / 2);
    const ClspImage behind = both.image(width, height, CLSP_FORMAT_FLOAT32, 0, width * height * sizeof(float));
    fails(CLSP_ERROR_OVERLAP, "irradiance", run(aperture, phase, &first, &shifted));
    EXPECT_CLSP_OK(run(aperture, phase, &first, &behind));

    const auto refused_phase = [&](ClspStatus expected, const char *word, const clspeckle::Phase &wrong) {
        fails(expected, word, run(aperture, wrong, &ideal.view, &out.view));
    };
    const auto argument = CLSP_ERROR_INVALID_ARGUMENT;
    refused_phase(argument, "phase", make_phase([](ClspPhaseDesc &d) { d.width = 25; }));
    refused_phase(argument, "phase", make_phase([](ClspPhaseDesc &d) { d.height = 21; }));
    refused_phase(argument, "phase", make_phase([](ClspPhaseDesc &d) { d.oversampling = 2; }));
    refused_phase(argument, "phase", make_phase([](ClspPhaseDesc &d) { d.guard_px = 1; }));
    auto half = valid();
    half.degree_of_polarization = 0.5;
    const auto single = make_phase([](ClspPhaseDesc &d) { d.polarization_count = 1; });
    fails(argument, "polarization", run(clspeckle::Aperture(context, half), single, &ideal.view, &out.view));
    EXPECT_CLSP_OK(run(aperture, single, &ideal.view, &out.view));
    auto phase_desc = clspeckle::make<ClspPhaseDesc>();
    phase_desc.width = width;
    phase_desc.height = height;
    refused_phase(CLSP_ERROR_INVALID_STATE, "refresh", clspeckle::Phase(context, phase_desc));
    const test::HostContext host;
    refused_phase(CLSP_ERROR_WRONG_CONTEXT, "phase",
                  clspeckle::Phase(clspeckle::Context::from_host(host.context, host.device), phase_desc));

    auto pupil_image = make_image(width, height, CLSP_FORMAT_FLOAT32);
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "aperture",
                      enqueue(clspApertureEnqueuePupil, nullptr, &pupil_image.view));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "pupil", enqueue(clspApertureEnqueuePupil, aperture, nullptr));
    check_image("clspApertureEnqueuePupil", "pupil", pupil_image.view, CLSP_FORMAT_UINT8,
                [&](const ClspImage *image) { return enqueue(clspApertureEnqueuePupil, aperture, image); });
    check_enqueue(CLSP_NAMED(clspApertureEnqueuePupil), aperture, &pupil_image.view);

    auto info = clspeckle::make<ClspApertureInfo>();
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "aperture", clspApertureGetInfo(nullptr, &info));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "info", clspApertureGetInfo(aperture, nullptr));
    info.struct_size = 4;
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_STRUCT_SIZE, "struct_size", clspApertureGetInfo(aperture, &info));
}

TEST_F(Aperture, RetainAndRelease) {
    auto info = clspeckle::make<ClspApertureInfo>();
    check_references("clspApertureGetInfo",
                     [&](ClspAperture aperture) { return clspApertureGetInfo(aperture, &info); });
}

} // namespace

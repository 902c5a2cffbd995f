// The aperture: pupil, intensity, host workspace, and what bad arguments get.
#include "test_support.hpp"

namespace {

using test::DeviceTest;

class Aperture : public DeviceTest {
  protected:
    static constexpr std::uint32_t width = 24, height = 20;

    static ClspApertureDesc valid() {
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
        auto image = make_image(info.grid_width, info.grid_height, CLSP_FORMAT_FLOAT32);
        aperture.enqueue_pupil(queue, image.view);
        return download<float>(image);
    }
    std::vector<float> intensity(const clspeckle::Aperture &aperture, const clspeckle::Phase &phase,
                                 const Image &ideal) {
        auto image = make_image(ideal.view.width, ideal.view.height, CLSP_FORMAT_FLOAT32);
        aperture.enqueue_intensity(queue, phase, ideal.view, image.view);
        return download<float>(image);
    }
};

TEST_F(Aperture, DescInit) {
    test::check_init<ClspApertureDesc>("clspApertureDescInit", clspApertureDescInit);
    ClspApertureDesc desc;
    ASSERT_CLSP_OK(clspApertureDescInit(&desc, sizeof(desc)));
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
    if (std::string("fused") == info.fft_backend) {
        EXPECT_STREQ("", info.fft_reason);
    } else {
        EXPECT_STREQ("clFFT", info.fft_backend);
        EXPECT_STRNE("", info.fft_reason);
    }
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
    EXPECT_CLSP_FAILS(
        CLSP_ERROR_INVALID_STATE, "workspace",
        clspApertureEnqueueIntensity(aperture, queue, phase, &ideal.view, &out.view, 0, nullptr, nullptr));
    {
        const clspeckle::Buffer workspace(context, bytes + 8192);
        const test::Foreign foreign;
        EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "aperture",
                          clspApertureSetWorkspace(nullptr, workspace, 0, bytes));
        EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "mem", clspApertureSetWorkspace(aperture, nullptr, 0, bytes));
        EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "offset",
                          clspApertureSetWorkspace(aperture, workspace, 64, bytes));
        EXPECT_CLSP_FAILS(CLSP_ERROR_BUFFER_TOO_SMALL, "size_bytes",
                          clspApertureSetWorkspace(aperture, workspace, 0, bytes - 1));
        EXPECT_CLSP_FAILS(CLSP_ERROR_BUFFER_TOO_SMALL, "mem|workspace",
                          clspApertureSetWorkspace(aperture, workspace, 8192, bytes + 1));
        EXPECT_CLSP_FAILS(CLSP_ERROR_BUFFER_TOO_SMALL, "mem|workspace",
                          clspApertureSetWorkspace(aperture, workspace, ~std::uint64_t{0} - 4095, bytes));
        EXPECT_CLSP_FAILS(CLSP_ERROR_WRONG_CONTEXT, "mem|workspace",
                          clspApertureSetWorkspace(aperture, foreign.buffer, 0, bytes));
        EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_STATE, "workspace",
                          clspApertureSetWorkspace(clspeckle::Aperture(context, valid()), workspace, 0, bytes));
        EXPECT_CLSP_OK(clspApertureSetWorkspace(aperture, workspace, 4096, bytes));
        const ClspImage inside = workspace.image(width, height, CLSP_FORMAT_FLOAT32, 0, 4096 + 64);
        EXPECT_CLSP_FAILS(
            CLSP_ERROR_OVERLAP, "work",
            clspApertureEnqueueIntensity(aperture, queue, phase, &inside, &out.view, 0, nullptr, nullptr));
        EXPECT_CLSP_FAILS(
            CLSP_ERROR_OVERLAP, "work",
            clspApertureEnqueueIntensity(aperture, queue, phase, &ideal.view, &inside, 0, nullptr, nullptr));
        const ClspImage before_it = workspace.image(8, 8, CLSP_FORMAT_FLOAT32);
        EXPECT_CLSP_FAILS(
            CLSP_ERROR_INVALID_ARGUMENT, "irradiance", // the size is wrong, the place is not
            clspApertureEnqueueIntensity(aperture, queue, phase, &before_it, &out.view, 0, nullptr, nullptr));
    } // the library keeps the memory
    EXPECT_EQ(expected, intensity(aperture, phase, ideal));
}

TEST_F(Aperture, CreateRefusesBadArguments) {
    const ClspApertureDesc desc = valid();
    ClspAperture aperture = nullptr;
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "context", clspApertureCreate(nullptr, &desc, &aperture));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "desc", clspApertureCreate(context, nullptr, &aperture));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "aperture", clspApertureCreate(context, &desc, nullptr));
    test::check_struct_size<ClspApertureDesc>("clspApertureCreate", desc, [&](ClspApertureDesc *d) {
        ClspAperture made = nullptr;
        const ClspStatus status = clspApertureCreate(context, d, &made);
        clspApertureRelease(made);
        return status;
    });
    const auto fails_as = [&](ClspStatus expected, const char *word,
                              const std::function<void(ClspApertureDesc &)> &change) {
        ClspApertureDesc changed = desc;
        change(changed);
        EXPECT_CLSP_FAILS(expected, word, clspApertureCreate(context, &changed, &aperture));
        EXPECT_EQ(nullptr, aperture);
    };
    const auto fails = [&](const char *word, const std::function<void(ClspApertureDesc &)> &change) {
        fails_as(CLSP_ERROR_INVALID_ARGUMENT, word, change);
    };
    for (std::uint32_t side : {0u, 16385u, 0xffffffffu}) {
        fails("width", [&](ClspApertureDesc &d) { d.width = side; });
        fails("height", [&](ClspApertureDesc &d) { d.height = side; });
    }
    fails("oversampling", [](ClspApertureDesc &d) { d.oversampling = 0; });
    fails("oversampling", [](ClspApertureDesc &d) { d.oversampling = 9; });
    fails("guard", [](ClspApertureDesc &d) { d.guard_px = 0xffffffffu; });
    fails("CLSP_PUPIL_CIRCLE (0), CLSP_PUPIL_IMAGE (1), CLSP_PUPIL_POLYGON (2) or CLSP_PUPIL_RING (3)",
          [](ClspApertureDesc &d) { d.pupil = 4; });
    fails("expected CLSP_NORMALIZATION_TRANSMISSION (0) or CLSP_NORMALIZATION_UNIT_MEAN (1)",
          [](ClspApertureDesc &d) { d.normalization = 2; });
    fails("workspace_from_host", [](ClspApertureDesc &d) { d.workspace_from_host = 2; });
    for (double bad : {-0.5, test::nan_value, test::infinity, -test::infinity})
        fails("relative_diameter", [&](ClspApertureDesc &d) { d.relative_diameter = bad; });
    for (double bad : {0.0, -1.0, test::nan_value, test::infinity}) {
        const auto lens = [&](ClspApertureDesc &d) { d.relative_diameter = 0; };
        fails("f_number", [&](ClspApertureDesc &d) { lens(d), d.f_number = bad; });
        fails("pixel_pitch_m", [&](ClspApertureDesc &d) { lens(d), d.pixel_pitch_m = bad; });
        fails("wavelength_m", [&](ClspApertureDesc &d) { lens(d), d.wavelength_m = bad; });
    }
    // D above what the grid carries; the message says what to do.
    fails("oversampling", [](ClspApertureDesc &d) { d.relative_diameter = 1.01; });
    fails("oversampling", [](ClspApertureDesc &d) { d.relative_diameter = 2.5, d.oversampling = 2; });
    fails("oversampling", [](ClspApertureDesc &d) { d.relative_diameter = 0, d.f_number = 2.8; }); // D = 1.10
    for (double bad : {-0.1, 1.1, test::nan_value, test::infinity}) {
        fails("soft_rim", [&](ClspApertureDesc &d) { d.soft_rim = bad; });
        fails("degree_of_polarization", [&](ClspApertureDesc &d) { d.degree_of_polarization = bad; });
    }
    const std::vector<float> image(6, 0.5f);
    const auto with_image = [&](ClspApertureDesc &d) {
        d.pupil = CLSP_PUPIL_IMAGE;
        d.pupil_image = image.data();
        d.pupil_width = 3;
        d.pupil_height = 2;
    };
    fails("pupil_image", [&](ClspApertureDesc &d) { with_image(d), d.pupil_image = nullptr; });
    fails("pupil_image", [&](ClspApertureDesc &d) { with_image(d), d.pupil = CLSP_PUPIL_CIRCLE; });
    for (std::uint64_t huge : {std::uint64_t{1} << 40, std::uint64_t{1} << 63, ~std::uint64_t{3}})
        fails("pupil_pitch_bytes", [&](ClspApertureDesc &d) { with_image(d), d.pupil_pitch_bytes = huge; });
    fails_as(CLSP_ERROR_UNSUPPORTED, "grid",
             [](ClspApertureDesc &d) { d.width = d.height = 16384, d.oversampling = 8; });
    for (std::uint32_t side : {0u, 16385u}) {
        fails("pupil", [&](ClspApertureDesc &d) { with_image(d), d.pupil_width = side; });
        fails("pupil", [&](ClspApertureDesc &d) { with_image(d), d.pupil_height = side; });
    }
    fails("pupil_pitch_bytes", [&](ClspApertureDesc &d) { with_image(d), d.pupil_pitch_bytes = 8; });
    fails("pupil_pitch_bytes", [&](ClspApertureDesc &d) { with_image(d), d.pupil_pitch_bytes = 13; });
    for (float bad : {-0.1f, 1.1f, std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()}) {
        std::vector<float> values(6, 0.5f);
        values[4] = bad;
        fails_as(CLSP_ERROR_INVALID_DATA, "pupil_image",
                 [&](ClspApertureDesc &d) { with_image(d), d.pupil_image = values.data(); });
    }
}

TEST_F(Aperture, EnqueueRefusesBadArguments) {
    const clspeckle::Aperture aperture(context, valid());
    const auto phase = make_phase();
    auto ideal = floats(test::dots(width, height), width, height);
    auto out = make_image(width, height, CLSP_FORMAT_FLOAT32);
    const auto run = [&](const ClspImage *in, const ClspImage *result) {
        return clspApertureEnqueueIntensity(aperture, queue, phase, in, result, 0, nullptr, nullptr);
    };
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "aperture",
                      clspApertureEnqueueIntensity(nullptr, queue, phase, &ideal.view, &out.view, 0, nullptr, nullptr));
    EXPECT_CLSP_FAILS(
        CLSP_ERROR_INVALID_HANDLE, "phase",
        clspApertureEnqueueIntensity(aperture, queue, nullptr, &ideal.view, &out.view, 0, nullptr, nullptr));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "irradiance",
                      clspApertureEnqueueIntensity(aperture, queue, phase, nullptr, &out.view, 0, nullptr, nullptr));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "intensity",
                      clspApertureEnqueueIntensity(aperture, queue, phase, &ideal.view, nullptr, 0, nullptr, nullptr));
    const auto as_input = [&](const ClspImage *image) { return run(image, &out.view); };
    const auto as_output = [&](const ClspImage *image) { return run(&ideal.view, image); };
    test::check_image_rules("clspApertureEnqueueIntensity", context, ideal.view, "irradiance", CLSP_FORMAT_UINT16,
                            as_input);
    test::check_image_rules("clspApertureEnqueueIntensity", context, out.view, "intensity", CLSP_FORMAT_FLOAT32X2,
                            as_output);
    test::check_image_size_must_match("clspApertureEnqueueIntensity", context, ideal.view, "irradiance", as_input);
    test::check_image_size_must_match("clspApertureEnqueueIntensity", context, out.view, "intensity", as_output);
    test::check_enqueue_rules("clspApertureEnqueueIntensity", context,
                              [&](cl_command_queue q, cl_uint count, const cl_event *events, cl_event *event) {
                                  return clspApertureEnqueueIntensity(aperture, q, phase, &ideal.view, &out.view, count,
                                                                      events, event);
                              });
    // Overlap without being the same image: half a row further in one buffer.
    const clspeckle::Buffer both(context, 2 * width * height * sizeof(float));
    const ClspImage first = both.image(width, height, CLSP_FORMAT_FLOAT32);
    const ClspImage shifted = both.image(width, height, CLSP_FORMAT_FLOAT32, 0, width * sizeof(float) / 2);
    const ClspImage behind = both.image(width, height, CLSP_FORMAT_FLOAT32, 0, width * height * sizeof(float));
    EXPECT_CLSP_FAILS(CLSP_ERROR_OVERLAP, "irradiance",
                      clspApertureEnqueueIntensity(aperture, queue, phase, &first, &shifted, 0, nullptr, nullptr));
    EXPECT_CLSP_OK(run(&first, &behind));

    const auto refused_phase = [&](ClspStatus expected, const char *word, const clspeckle::Aperture &which,
                                   const clspeckle::Phase &wrong) {
        EXPECT_CLSP_FAILS(
            expected, word,
            clspApertureEnqueueIntensity(which, queue, wrong, &ideal.view, &out.view, 0, nullptr, nullptr));
    };
    refused_phase(CLSP_ERROR_INVALID_ARGUMENT, "phase", aperture, make_phase([](ClspPhaseDesc &d) { d.width = 25; }));
    refused_phase(CLSP_ERROR_INVALID_ARGUMENT, "phase", aperture, make_phase([](ClspPhaseDesc &d) { d.height = 21; }));
    refused_phase(CLSP_ERROR_INVALID_ARGUMENT, "phase", aperture,
                  make_phase([](ClspPhaseDesc &d) { d.oversampling = 2; }));
    refused_phase(CLSP_ERROR_INVALID_ARGUMENT, "phase", aperture, make_phase([](ClspPhaseDesc &d) { d.guard_px = 1; }));
    auto half = valid();
    half.degree_of_polarization = 0.5;
    refused_phase(CLSP_ERROR_INVALID_ARGUMENT, "polarization", clspeckle::Aperture(context, half),
                  make_phase([](ClspPhaseDesc &d) { d.polarization_count = 1; }));
    EXPECT_CLSP_OK(clspApertureEnqueueIntensity(aperture, queue,
                                                make_phase([](ClspPhaseDesc &d) { d.polarization_count = 1; }),
                                                &ideal.view, &out.view, 0, nullptr, nullptr));
    auto phase_desc = clspeckle::make<ClspPhaseDesc>();
    phase_desc.width = width;
    phase_desc.height = height;
    refused_phase(CLSP_ERROR_INVALID_STATE, "refresh", aperture, clspeckle::Phase(context, phase_desc));
    const test::HostContext host;
    refused_phase(CLSP_ERROR_WRONG_CONTEXT, "phase", aperture,
                  clspeckle::Phase(clspeckle::Context::from_host(host.context, host.device), phase_desc));

    auto pupil_image = make_image(width, height, CLSP_FORMAT_FLOAT32);
    const auto pupil_to = [&](const ClspImage *image) {
        return clspApertureEnqueuePupil(aperture, queue, image, 0, nullptr, nullptr);
    };
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "aperture",
                      clspApertureEnqueuePupil(nullptr, queue, &pupil_image.view, 0, nullptr, nullptr));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "pupil",
                      clspApertureEnqueuePupil(aperture, queue, nullptr, 0, nullptr, nullptr));
    test::check_image_rules("clspApertureEnqueuePupil", context, pupil_image.view, "pupil", CLSP_FORMAT_UINT8,
                            pupil_to);
    test::check_image_size_must_match("clspApertureEnqueuePupil", context, pupil_image.view, "pupil", pupil_to);
    test::check_enqueue_rules("clspApertureEnqueuePupil", context,
                              [&](cl_command_queue q, cl_uint count, const cl_event *events, cl_event *event) {
                                  return clspApertureEnqueuePupil(aperture, q, &pupil_image.view, count, events, event);
                              });

    auto info = clspeckle::make<ClspApertureInfo>();
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "aperture", clspApertureGetInfo(nullptr, &info));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "info", clspApertureGetInfo(aperture, nullptr));
    info.struct_size = 4;
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_STRUCT_SIZE, "struct_size", clspApertureGetInfo(aperture, &info));
}

TEST_F(Aperture, RetainAndRelease) {
    ClspAperture aperture = nullptr;
    const ClspApertureDesc desc = valid();
    auto info = clspeckle::make<ClspApertureInfo>();
    ASSERT_CLSP_OK(clspApertureCreate(context, &desc, &aperture));
    EXPECT_CLSP_OK(clspApertureRetain(aperture));
    EXPECT_CLSP_OK(clspApertureRelease(aperture));
    EXPECT_CLSP_OK(clspApertureGetInfo(aperture, &info));
    EXPECT_CLSP_OK(clspApertureRelease(aperture));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "aperture", clspApertureGetInfo(aperture, &info));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "aperture", clspApertureRetain(aperture));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "aperture", clspApertureRelease(aperture));
    EXPECT_CLSP_OK(clspApertureRelease(nullptr));
}

} // namespace

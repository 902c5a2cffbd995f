// The sensor: the equation of sensor.h, its outputs, and what bad arguments get.
#include "test_support.hpp"

namespace {

using test::DeviceTest;

class Sensor : public DeviceTest {
  protected:
    static constexpr std::uint32_t width = 32, height = 18;

    static ClspSensorDesc valid() {
        auto desc = clspeckle::make<ClspSensorDesc>();
        desc.width = width;
        desc.height = height;
        desc.read_noise_dn = 0;
        return desc;
    }
    template <typename T>
    std::vector<T> expose(const clspeckle::Sensor &sensor, const std::vector<float> &intensity, std::uint32_t format,
                          std::uint64_t frame_index = 0) {
        auto in = floats(intensity, width, height);
        auto out = make_image(width, height, format);
        sensor.enqueue_expose(queue, in.view, frame_index, out.view);
        return download<T>(out);
    }
    static std::vector<float> ramp() {
        std::vector<float> image(width * height);
        for (std::size_t i = 0; i < image.size(); ++i)
            image[i] = static_cast<float>(i) / 256.0f; // 0 to 2.25, exact in binary
        return image;
    }
};

TEST_F(Sensor, DescInit) {
    test::check_init<ClspSensorDesc>("clspSensorDescInit", clspSensorDescInit);
    ClspSensorDesc desc;
    ASSERT_CLSP_OK(clspSensorDescInit(&desc, sizeof(desc)));
    EXPECT_EQ(10u, desc.bits);
    EXPECT_EQ(0u, desc.seed);
    EXPECT_EQ(512.0, desc.exposure_gain_dn);
    EXPECT_EQ(test::infinity, desc.saturation_dn);
    EXPECT_EQ(64.0, desc.black_level_dn);
    EXPECT_EQ(4.0, desc.read_noise_dn);
    EXPECT_EQ(0.0, desc.hot_pixel_fraction);
    EXPECT_EQ(150.0, desc.hot_pixel_mean_dn);
    EXPECT_EQ(0.0, desc.cold_pixel_fraction);
    EXPECT_EQ(1.0, desc.float_full_scale);
    EXPECT_EQ(nullptr, desc.dark_frame_dn);
    EXPECT_EQ(0u, desc.dark_frame_pitch_bytes);
    EXPECT_EQ(1u, desc.quantize);
}

TEST_F(Sensor, CodesFollowTheEquation) {
    auto desc = valid();
    desc.exposure_gain_dn = 500;
    desc.saturation_dn = 700.25;
    desc.black_level_dn = 10.5;
    std::vector<float> dark(width * height + height * 3); // three floats of padding a row
    for (std::uint32_t y = 0; y < height; ++y)
        for (std::uint32_t x = 0; x < width + 3; ++x)
            dark[y * (width + 3) + x] = x < width ? static_cast<float>(x) * 0.25f - 2.0f : 1e9f;
    desc.dark_frame_dn = dark.data();
    desc.dark_frame_pitch_bytes = (width + 3) * sizeof(float);
    const clspeckle::Sensor sensor(context, desc);
    const auto intensity = ramp();
    const auto codes = expose<std::uint16_t>(sensor, intensity, CLSP_FORMAT_UINT16);
    for (std::size_t i = 0; i < codes.size(); ++i) {
        const double value = std::min(500.0 * intensity[i], 700.25) + 10.5 + (double(i % width) * 0.25 - 2.0);
        ASSERT_EQ(std::clamp(std::nearbyint(value), 0.0, 1023.0), codes[i]) << i << ": " << value;
    }
}

TEST_F(Sensor, IntensityThatIsNoneCountsAsZero) {
    auto intensity = ramp();
    intensity[3] = std::numeric_limits<float>::quiet_NaN();
    intensity[4] = -1.0f;
    intensity[5] = -std::numeric_limits<float>::infinity();
    intensity[6] = std::numeric_limits<float>::infinity();
    auto desc = valid();
    desc.saturation_dn = 300;
    const auto codes = expose<std::uint16_t>(clspeckle::Sensor(context, desc), intensity, CLSP_FORMAT_UINT16);
    EXPECT_EQ(64, codes[3]);
    EXPECT_EQ(64, codes[4]);
    EXPECT_EQ(64, codes[5]);
    EXPECT_EQ(364, codes[6]) << "saturated";
}

TEST_F(Sensor, EveryBitDepthClipsAtItsTopCode) {
    for (std::uint32_t bits = 8; bits <= 16; ++bits) {
        auto desc = valid();
        desc.bits = bits;
        desc.exposure_gain_dn = std::ldexp(1.0, static_cast<int>(bits)) / 2;
        desc.black_level_dn = -1;
        const auto codes = expose<std::uint16_t>(clspeckle::Sensor(context, desc), ramp(), CLSP_FORMAT_UINT16);
        EXPECT_EQ(0, codes[0]) << "below 0 is 0";
        EXPECT_EQ((1 << bits) - 1, codes.back()) << bits << " bits";
    }
}

TEST_F(Sensor, FloatAndByteOutputsAreTheSameCodes) {
    auto desc = valid();
    desc.bits = 8;
    desc.exposure_gain_dn = 100;
    desc.black_level_dn = 3;
    desc.float_full_scale = 51;
    const clspeckle::Sensor sensor(context, desc);
    const auto words = expose<std::uint16_t>(sensor, ramp(), CLSP_FORMAT_UINT16);
    const auto bytes = expose<std::uint8_t>(sensor, ramp(), CLSP_FORMAT_UINT8);
    const auto quantized = expose<float>(sensor, ramp(), CLSP_FORMAT_FLOAT32);
    desc.quantize = 0;
    const auto clipped = expose<float>(clspeckle::Sensor(context, desc), ramp(), CLSP_FORMAT_FLOAT32);
    const auto intensity = ramp();
    for (std::size_t i = 0; i < words.size(); ++i) {
        ASSERT_EQ(words[i], bytes[i]) << i;
        ASSERT_NEAR(words[i] / 255.0 * 51.0, quantized[i], 1e-5) << i;
        ASSERT_NEAR(std::clamp(100.0 * intensity[i] + 3.0, 0.0, 255.0) / 255.0 * 51.0, clipped[i], 1e-5) << i;
    }
}

TEST_F(Sensor, NoiseIsNewEachFrameAndReproducible) {
    auto desc = valid();
    desc.read_noise_dn = 15;
    desc.seed = 7;
    const clspeckle::Sensor sensor(context, desc), twin(context, desc);
    const std::vector<float> flat(width * height, 0.5f);
    const auto first = expose<std::uint16_t>(sensor, flat, CLSP_FORMAT_UINT16, 0);
    const auto second = expose<std::uint16_t>(sensor, flat, CLSP_FORMAT_UINT16, 1);
    EXPECT_NE(first, second);
    EXPECT_EQ(first, expose<std::uint16_t>(twin, flat, CLSP_FORMAT_UINT16, 0));
    EXPECT_EQ(second, expose<std::uint16_t>(twin, flat, CLSP_FORMAT_UINT16, 1));
    desc.seed = 8;
    EXPECT_NE(first, expose<std::uint16_t>(clspeckle::Sensor(context, desc), flat, CLSP_FORMAT_UINT16, 0));
    double mean = 0, square = 0;
    for (std::uint16_t code : first) {
        mean += code / 576.0;
        square += code * double(code) / 576.0;
    }
    // 576 samples: standard errors 15 / 24 of the mean, 15 / sqrt(1152) of the deviation; five of them, fixed seed.
    EXPECT_NEAR(0.5 * 512 + 64, mean, 5 * 15.0 / 24);
    EXPECT_NEAR(15.0, std::sqrt(square - mean * mean), 5 * 15.0 / std::sqrt(1152.0));
}

TEST_F(Sensor, HotAndColdPixels) {
    auto desc = valid();
    desc.bits = 16;
    desc.hot_pixel_fraction = 1;
    desc.hot_pixel_mean_dn = 100;
    const std::vector<float> flat(width * height, 1.0f);
    const auto hot = expose<std::uint16_t>(clspeckle::Sensor(context, desc), flat, CLSP_FORMAT_UINT16);
    double mean = 0;
    for (std::uint16_t code : hot) {
        EXPECT_GE(code, 576);
        mean += (code - 576.0) / 576.0;
    }
    EXPECT_NEAR(100.0, mean, 5 * 100.0 / 24); // exponential: deviation = mean, 576 samples, five standard errors

    desc.hot_pixel_fraction = 0;
    desc.cold_pixel_fraction = 1;
    for (std::uint16_t code : expose<std::uint16_t>(clspeckle::Sensor(context, desc), flat, CLSP_FORMAT_UINT16))
        EXPECT_EQ(64, code) << "a cold pixel shows the black level alone";

    desc.hot_pixel_fraction = 0.1;
    desc.cold_pixel_fraction = 0.1;
    const auto mixed = expose<std::uint16_t>(clspeckle::Sensor(context, desc), flat, CLSP_FORMAT_UINT16);
    const auto later = expose<std::uint16_t>(clspeckle::Sensor(context, desc), flat, CLSP_FORMAT_UINT16, 5);
    EXPECT_EQ(mixed, later) << "defects stay where they are";
    const auto normal = std::count(mixed.begin(), mixed.end(), 576);
    // Binomial(576, 0.81): 467 expected, deviation 9.4; five of them.
    EXPECT_NEAR(466.6, static_cast<double>(normal), 47.0);
}

TEST_F(Sensor, ExposureGainCanChange) {
    const clspeckle::Sensor sensor(context, valid());
    const std::vector<float> flat(width * height, 0.25f);
    EXPECT_EQ(192, expose<std::uint16_t>(sensor, flat, CLSP_FORMAT_UINT16)[0]);
    sensor.set_exposure_gain(100);
    EXPECT_EQ(89, expose<std::uint16_t>(sensor, flat, CLSP_FORMAT_UINT16)[0]);
    sensor.set_exposure_gain(0);
    EXPECT_EQ(64, expose<std::uint16_t>(sensor, flat, CLSP_FORMAT_UINT16)[0]);
    for (double bad : {-1.0, test::nan_value, test::infinity})
        EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "exposure_gain_dn", clspSensorSetExposureGain(sensor, bad));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "sensor", clspSensorSetExposureGain(nullptr, 1.0));
    EXPECT_EQ(64, expose<std::uint16_t>(sensor, flat, CLSP_FORMAT_UINT16)[0]) << "a refused gain changed something";
}

TEST_F(Sensor, OffsetPitchAndInPlaceGiveTheSameBytes) {
    auto desc = valid();
    desc.read_noise_dn = 3;
    const clspeckle::Sensor sensor(context, desc);
    const auto intensity = ramp();
    const auto codes = expose<std::uint16_t>(sensor, intensity, CLSP_FORMAT_UINT16);
    auto in = upload(intensity, width, height, CLSP_FORMAT_FLOAT32, 200, 12);
    auto out = make_image(width, height, CLSP_FORMAT_UINT16, 66, 2);
    sensor.enqueue_expose(queue, in.view, 0, out.view);
    EXPECT_EQ(codes, download<std::uint16_t>(out));
    EXPECT_TRUE(margins_untouched(out));
    const auto reals = expose<float>(sensor, intensity, CLSP_FORMAT_FLOAT32);
    sensor.enqueue_expose(queue, in.view, 0, in.view);
    EXPECT_EQ(reals, download<float>(in));
    EXPECT_TRUE(margins_untouched(in));
}

TEST_F(Sensor, CreateRefusesBadArguments) {
    const ClspSensorDesc desc = valid();
    ClspSensor sensor = nullptr;
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "context", clspSensorCreate(nullptr, &desc, &sensor));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "desc", clspSensorCreate(context, nullptr, &sensor));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "sensor", clspSensorCreate(context, &desc, nullptr));
    test::check_struct_size<ClspSensorDesc>("clspSensorCreate", desc, [&](ClspSensorDesc *d) {
        ClspSensor made = nullptr;
        const ClspStatus status = clspSensorCreate(context, d, &made);
        clspSensorRelease(made);
        return status;
    });
    const auto fails = [&](const char *word, const std::function<void(ClspSensorDesc &)> &change,
                           ClspStatus expected = CLSP_ERROR_INVALID_ARGUMENT) {
        ClspSensorDesc changed = desc;
        change(changed);
        EXPECT_CLSP_FAILS(expected, word, clspSensorCreate(context, &changed, &sensor));
        EXPECT_EQ(nullptr, sensor);
    };
    for (std::uint32_t side : {0u, 16385u, 0xffffffffu}) {
        fails("width", [&](ClspSensorDesc &d) { d.width = side; });
        fails("height", [&](ClspSensorDesc &d) { d.height = side; });
    }
    for (std::uint32_t bits : {0u, 7u, 17u, 0xffffffffu})
        fails("bits", [&](ClspSensorDesc &d) { d.bits = bits; });
    for (double bad : {-1.0, test::nan_value, test::infinity, -test::infinity}) {
        fails("exposure_gain_dn", [&](ClspSensorDesc &d) { d.exposure_gain_dn = bad; });
        fails("read_noise_dn", [&](ClspSensorDesc &d) { d.read_noise_dn = bad; });
        fails("hot_pixel_mean_dn", [&](ClspSensorDesc &d) { d.hot_pixel_mean_dn = bad; });
        fails("hot_pixel_fraction", [&](ClspSensorDesc &d) { d.hot_pixel_fraction = bad; });
        fails("cold_pixel_fraction", [&](ClspSensorDesc &d) { d.cold_pixel_fraction = bad; });
        fails("float_full_scale", [&](ClspSensorDesc &d) { d.float_full_scale = bad; });
    }
    fails("hot_pixel_fraction", [](ClspSensorDesc &d) { d.hot_pixel_fraction = 1.01; });
    fails("cold_pixel_fraction", [](ClspSensorDesc &d) { d.cold_pixel_fraction = 1.01; });
    fails("float_full_scale", [](ClspSensorDesc &d) { d.float_full_scale = 0; });
    for (double bad : {0.0, -1.0, test::nan_value, -test::infinity})
        fails("saturation_dn", [&](ClspSensorDesc &d) { d.saturation_dn = bad; });
    for (double bad : {test::nan_value, test::infinity, -test::infinity})
        fails("black_level_dn", [&](ClspSensorDesc &d) { d.black_level_dn = bad; });
    fails("quantize", [](ClspSensorDesc &d) { d.quantize = 2; });
    fails("reserved", [](ClspSensorDesc &d) { d.reserved = 1; });
    std::vector<float> dark(width * height, 0.0f);
    fails("dark_frame_pitch_bytes",
          [&](ClspSensorDesc &d) { d.dark_frame_dn = dark.data(), d.dark_frame_pitch_bytes = 4; });
    fails("dark_frame_pitch_bytes",
          [&](ClspSensorDesc &d) { d.dark_frame_dn = dark.data(), d.dark_frame_pitch_bytes = width * 4 + 2; });
    for (float bad : {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()}) {
        dark[width + 2] = bad;
        fails(
            "dark_frame_dn", [&](ClspSensorDesc &d) { d.dark_frame_dn = dark.data(); }, CLSP_ERROR_INVALID_DATA);
    }
}

TEST_F(Sensor, ExposeRefusesBadArguments) {
    const clspeckle::Sensor sensor(context, valid());
    auto in = floats(ramp(), width, height);
    auto out = make_image(width, height, CLSP_FORMAT_UINT16);
    const auto as_input = [&](const ClspImage *image) {
        return clspSensorEnqueueExpose(sensor, queue, image, 0, &out.view, 0, nullptr, nullptr);
    };
    const auto as_output = [&](const ClspImage *image) {
        return clspSensorEnqueueExpose(sensor, queue, &in.view, 0, image, 0, nullptr, nullptr);
    };
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "sensor",
                      clspSensorEnqueueExpose(nullptr, queue, &in.view, 0, &out.view, 0, nullptr, nullptr));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "intensity",
                      clspSensorEnqueueExpose(sensor, queue, nullptr, 0, &out.view, 0, nullptr, nullptr));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "output",
                      clspSensorEnqueueExpose(sensor, queue, &in.view, 0, nullptr, 0, nullptr, nullptr));
    EXPECT_CLSP_FAILS(
        CLSP_ERROR_INVALID_ARGUMENT, "frame_index",
        clspSensorEnqueueExpose(sensor, queue, &in.view, std::uint64_t{1} << 48, &out.view, 0, nullptr, nullptr));
    test::check_image_rules("clspSensorEnqueueExpose", context, in.view, "intensity", CLSP_FORMAT_UINT16, as_input);
    test::check_image_rules("clspSensorEnqueueExpose", context, out.view, "output", CLSP_FORMAT_UINT32, as_output);
    test::check_image_size_must_match("clspSensorEnqueueExpose", context, in.view, "intensity", as_input);
    test::check_image_size_must_match("clspSensorEnqueueExpose", context, out.view, "output", as_output);
    auto bytes = make_image(width, height, CLSP_FORMAT_UINT8); // ten bits do not fit
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_FORMAT, "output",
                      clspSensorEnqueueExpose(sensor, queue, &in.view, 0, &bytes.view, 0, nullptr, nullptr));
    ClspImage inside = in.view;
    inside.format = CLSP_FORMAT_UINT16;
    EXPECT_CLSP_FAILS(CLSP_ERROR_OVERLAP, "output",
                      clspSensorEnqueueExpose(sensor, queue, &in.view, 0, &inside, 0, nullptr, nullptr));
    test::check_enqueue_rules("clspSensorEnqueueExpose", context,
                              [&](cl_command_queue q, cl_uint count, const cl_event *events, cl_event *event) {
                                  return clspSensorEnqueueExpose(sensor, q, &in.view, 0, &out.view, count, events,
                                                                 event);
                              });
}

TEST_F(Sensor, RetainAndRelease) {
    ClspSensor sensor = nullptr;
    const ClspSensorDesc desc = valid();
    ASSERT_CLSP_OK(clspSensorCreate(context, &desc, &sensor));
    EXPECT_CLSP_OK(clspSensorRetain(sensor));
    EXPECT_CLSP_OK(clspSensorRelease(sensor));
    EXPECT_CLSP_OK(clspSensorSetExposureGain(sensor, 1.0));
    EXPECT_CLSP_OK(clspSensorRelease(sensor));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "sensor", clspSensorSetExposureGain(sensor, 1.0));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "sensor", clspSensorRetain(sensor));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "sensor", clspSensorRelease(sensor));
    EXPECT_CLSP_OK(clspSensorRelease(nullptr));
}

} // namespace

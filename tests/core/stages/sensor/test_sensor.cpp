// The sensor: the equation of sensor.h, its outputs, and what bad arguments get.
#include "stage_support.hpp"

#include <set>

namespace {

class Sensor : public test::StageTest<ClspSensor> {
  protected:
    static constexpr std::uint32_t width = 32, height = 18;

    ClspSensorDesc valid() const override {
        auto desc = clspeckle::make<ClspSensorDesc>();
        desc.width = width;
        desc.height = height;
        desc.read_noise_dn = 0;
        return desc;
    }
    template <typename T>
    std::vector<T> expose(const clspeckle::Sensor &sensor, const std::vector<float> &intensity, std::uint32_t format,
                          std::uint64_t frame_index = 0) {
        const auto in = floats(intensity, width, height);
        return written<T>(width, height, format,
                          [&](const ClspImage &out) { sensor.enqueue_expose(queue, in.view, frame_index, out); });
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
    for (double off : {desc.conversion_gain_dn_per_e, desc.photons_per_unit, desc.full_well_e, desc.crosstalk_fraction,
                       desc.prnu, desc.column_prnu, desc.row_prnu, desc.dark_current_e_per_s, desc.lag_fraction,
                       desc.dsnu_dn, desc.column_offset_dn, desc.row_noise_dn, desc.column_noise_dn,
                       desc.read_noise_spread, desc.row_offset_dn, desc.dull_pixel_fraction, desc.cubic_nonlinearity,
                       desc.periodic_offset_dn, desc.periodic_frequency_x, desc.periodic_frequency_y,
                       desc.telegraph_fraction, desc.telegraph_step_dn, desc.code_width_wave, desc.widest_code,
                       desc.read_noise_correlation})
        EXPECT_EQ(0.0, off);
    EXPECT_EQ(3u, desc.nonlinearity_power);
    for (double one : {desc.quantum_efficiency, desc.gamma, desc.mosaic_gain[0], desc.mosaic_gain[1],
                       desc.mosaic_gain[2], desc.mosaic_gain[3]})
        EXPECT_EQ(1.0, one);
    EXPECT_EQ(25.0, desc.temperature_c);
    EXPECT_EQ(25.0, desc.dark_current_reference_temperature_c);
    EXPECT_EQ(8.0, desc.dark_current_doubling_k);
    EXPECT_EQ(0.01, desc.exposure_time_s);
    EXPECT_EQ(0u, desc.shot_noise);
    EXPECT_EQ(0u, desc.effective_bits);
    EXPECT_EQ(0u, desc.telegraph_centered);
    EXPECT_EQ(4.0, desc.code_width_period);
    EXPECT_EQ(nullptr, desc.gain_map);
    EXPECT_EQ(0u, desc.gain_map_pitch_bytes);
}

// Devices that work in lanes have a kernel of their own (stages/sensor_lanes.h); CLSPECKLE_FFT=clfft takes the other.
TEST(SensorLanes, TheSameBitsAsTheKernelOfOtherDevices) {
    struct Size {
        std::uint32_t width, height;
    };
    constexpr std::size_t kMost = 83 * 41;
    std::vector<float> dark_frame(kMost);
    for (std::size_t i = 0; i < kMost; ++i)
        dark_frame[i] = 0.25f * static_cast<float>(i % 37) - 3.0f;
    std::vector<float> gain_map(kMost);
    for (std::size_t i = 0; i < kMost; ++i)
        gain_map[i] = 0.95f + 0.01f * static_cast<float>(i % 11);
    using Change = std::function<void(ClspSensorDesc &)>;
    const Change everything = [&](ClspSensorDesc &d) {
        d.gain_map = gain_map.data();
        d.conversion_gain_dn_per_e = 0.5;
        d.shot_noise = 1;
        d.full_well_e = 1500;
        d.crosstalk_fraction = 0.1;
        d.prnu = d.column_prnu = d.row_prnu = 0.02;
        d.mosaic_gain[0] = 0.9;
        d.mosaic_gain[1] = 0.8;
        d.mosaic_gain[2] = 1.1;
        d.dark_current_e_per_s = 300;
        d.lag_fraction = 0.2;
        d.gamma = 0.9;
        d.dsnu_dn = d.column_offset_dn = d.row_noise_dn = d.column_noise_dn = 2;
        d.read_noise_spread = 0.3;
        d.hot_pixel_fraction = d.cold_pixel_fraction = d.dull_pixel_fraction = 0.02;
        d.effective_bits = 8;
        d.row_offset_dn = d.periodic_offset_dn = 2;
        d.periodic_frequency_x = 0.13;
        d.cubic_nonlinearity = 0.04;
        d.nonlinearity_power = 2;
        d.read_noise_correlation = -0.2;
        d.telegraph_fraction = 0.1;
        d.telegraph_step_dn = 20;
        d.code_width_wave = 0.2;
    };
    const std::pair<const char *, Change> changes[] = {
        {"nothing", [](ClspSensorDesc &d) { d.read_noise_dn = 0; }},
        {"read noise", [](ClspSensorDesc &) {}},
        {"saturation", [](ClspSensorDesc &d) { d.saturation_dn = 300; }},
        {"shot noise", [](ClspSensorDesc &d) { d.conversion_gain_dn_per_e = 0.5, d.shot_noise = 1; }},
        {"few electrons", [](ClspSensorDesc &d) { d.conversion_gain_dn_per_e = 60, d.shot_noise = 1; }},
        {"crosstalk", [](ClspSensorDesc &d) { d.crosstalk_fraction = 0.3; }},
        {"mosaic", [](ClspSensorDesc &d) { d.mosaic_gain[0] = 0.5, d.mosaic_gain[1] = 0.7, d.mosaic_gain[3] = 1.2; }},
        {"prnu", [](ClspSensorDesc &d) { d.prnu = 0.1; }},
        {"column gain", [](ClspSensorDesc &d) { d.column_prnu = 0.1; }},
        {"row gain and cold pixels", [](ClspSensorDesc &d) { d.row_prnu = 0.1, d.cold_pixel_fraction = 0.1; }},
        {"cold pixels", [](ClspSensorDesc &d) { d.cold_pixel_fraction = 0.1; }},
        {"lag", [](ClspSensorDesc &d) { d.lag_fraction = 0.4; }},
        {"gamma", [](ClspSensorDesc &d) { d.gamma = 0.45; }},
        {"row noise alone", [](ClspSensorDesc &d) { d.read_noise_dn = 0, d.row_noise_dn = 3; }},
        {"column noise alone", [](ClspSensorDesc &d) { d.read_noise_dn = 0, d.column_noise_dn = 3; }},
        {"dark frame", [&](ClspSensorDesc &d) { d.dark_frame_dn = dark_frame.data(); }},
        {"gain map", [&](ClspSensorDesc &d) { d.gain_map = gain_map.data(); }},
        {"gain map and cold pixels",
         [&](ClspSensorDesc &d) { d.gain_map = gain_map.data(), d.cold_pixel_fraction = 0.1; }},
        {"not quantized", [](ClspSensorDesc &d) { d.quantize = 0; }},
        {"few bits", [](ClspSensorDesc &d) { d.effective_bits = 6; }},
        {"dark current", [](ClspSensorDesc &d) { d.conversion_gain_dn_per_e = 0.5, d.dark_current_e_per_s = 3000; }},
        {"row offsets", [](ClspSensorDesc &d) { d.row_offset_dn = 3; }},
        {"a wave",
         [](ClspSensorDesc &d) {
             d.periodic_offset_dn = 5, d.periodic_frequency_x = 0.213, d.periodic_frequency_y = -0.07;
         }},
        {"dull pixels", [](ClspSensorDesc &d) { d.dull_pixel_fraction = 0.1; }},
        {"cubic", [](ClspSensorDesc &d) { d.cubic_nonlinearity = 0.05; }},
        {"cubic upwards", [](ClspSensorDesc &d) { d.cubic_nonlinearity = -0.05; }},
        {"quadratic", [](ClspSensorDesc &d) { d.cubic_nonlinearity = 0.05, d.nonlinearity_power = 1; }},
        {"second power", [](ClspSensorDesc &d) { d.cubic_nonlinearity = 0.05, d.nonlinearity_power = 2; }},
        {"correlated noise", [](ClspSensorDesc &d) { d.read_noise_correlation = 0.3; }},
        {"correlated noise of a spread",
         [](ClspSensorDesc &d) { d.read_noise_correlation = -0.5, d.read_noise_spread = 0.3; }},
        {"telegraph noise", [](ClspSensorDesc &d) { d.telegraph_fraction = 0.1, d.telegraph_step_dn = 30; }},
        {"code widths", [](ClspSensorDesc &d) { d.code_width_wave = 0.3, d.widest_code = 2; }},
        {"everything", everything},
    };
    setenv("CLSPECKLE_FFT", "clfft", 1); // contexts read it when they are made
    const clspeckle::Context scalar;
    setenv("CLSPECKLE_FFT", "cpu", 1);
    const clspeckle::Context lanes;
    unsetenv("CLSPECKLE_FFT");
    for (const Size size : {Size{83, 41}, {5, 3}}) { // not whole vectors, not whole quarters
        const std::size_t pixels = std::size_t{size.width} * size.height;
        std::vector<float> intensity(pixels);
        for (std::size_t i = 0; i < pixels; ++i)
            intensity[i] = 3.0f * static_cast<float>(i * 7 % 101) / 101.0f - 0.05f;
        intensity[0] = std::numeric_limits<float>::quiet_NaN();
        intensity[1] = std::numeric_limits<float>::infinity();
        for (const auto &[name, change] : changes)
            for (const std::uint32_t format : {CLSP_FORMAT_UINT16, CLSP_FORMAT_FLOAT32, CLSP_FORMAT_UINT8}) {
                const bool every_format =
                    std::set<std::string>{"read noise", "few bits", "not quantized", "everything"}.count(name) > 0;
                if (format != CLSP_FORMAT_UINT16 && !every_format)
                    continue; // every variant of the other kernel takes long to compile
                const auto frames = [&, apply = change](const clspeckle::Context &context) {
                    auto desc = clspeckle::make<ClspSensorDesc>();
                    desc.width = size.width;
                    desc.height = size.height;
                    desc.seed = 11;
                    apply(desc);
                    if (format == CLSP_FORMAT_UINT8)
                        desc.bits = 8;
                    const clspeckle::Sensor sensor(context, desc);
                    const clspeckle::Queue queue(context);
                    const clspeckle::Buffer from(context, queue, intensity);
                    const clspeckle::Buffer to(context, pixels * sizeof(float));
                    std::vector<std::uint32_t> bits;
                    for (std::uint64_t frame = 0; frame < 3; ++frame) {
                        to.write(queue, std::vector<std::uint32_t>(pixels, 0));
                        sensor.enqueue_expose(queue, from.image(size.width, size.height, CLSP_FORMAT_FLOAT32),
                                              (frame << 40) + frame, to.image(size.width, size.height, format));
                        std::vector<std::uint32_t> now(pixels);
                        to.read(queue, now);
                        bits.insert(bits.end(), now.begin(), now.end());
                    }
                    return bits;
                };
                EXPECT_EQ(frames(scalar), frames(lanes))
                    << name << ", " << size.width << " x " << size.height << ", format " << format;
            }
    }
}

TEST_F(Sensor, AnOlderCallersStructHasTheNewMembersOff) {
    auto desc = valid();
    desc.read_noise_dn = 3;
    const auto codes = expose<std::uint16_t>(clspeckle::Sensor(context, desc), ramp(), CLSP_FORMAT_UINT16);
    ClspSensorDesc old = desc;
    old.struct_size = offsetof(ClspSensorDesc, conversion_gain_dn_per_e);
    EXPECT_EQ(112u, old.struct_size);
    std::memset(reinterpret_cast<unsigned char *>(&old) + old.struct_size, 0xA5, sizeof(old) - old.struct_size);
    EXPECT_EQ(codes, expose<std::uint16_t>(clspeckle::Sensor(context, old), ramp(), CLSP_FORMAT_UINT16));
    old.struct_size -= 8;
    ClspSensor sensor = nullptr;
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_STRUCT_SIZE, "struct_size", clspSensorCreate(context, &old, &sensor));
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

TEST_F(Sensor, GainMapMultipliesTheLightAndEveryOtherGain) {
    auto desc = valid();
    desc.exposure_gain_dn = 500;
    std::vector<float> gains(width * height + height * 3); // three floats of padding a row
    const auto gain = [](std::uint32_t x, std::uint32_t y) { return (x + y) % 2 ? 0.875f : 1.125f; };
    for (std::uint32_t y = 0; y < height; ++y)
        for (std::uint32_t x = 0; x < width + 3; ++x)
            gains[y * (width + 3) + x] = x < width ? gain(x, y) : -1.0f;
    desc.gain_map = gains.data();
    desc.gain_map_pitch_bytes = (width + 3) * sizeof(float);
    const auto intensity = ramp();
    const auto codes = expose<std::uint16_t>(clspeckle::Sensor(context, desc), intensity, CLSP_FORMAT_UINT16);
    for (std::size_t i = 0; i < codes.size(); ++i) {
        const double value = 500.0 * intensity[i] * gain(i % width, static_cast<std::uint32_t>(i / width)) + 64.0;
        ASSERT_NEAR(std::min(value, 1023.0), codes[i], 0.501) << i;
    }
    auto drawn = valid();
    drawn.exposure_gain_dn = 500;
    drawn.prnu = 0.05;
    drawn.cold_pixel_fraction = 0.1;
    const auto plain =
        expose<float>(clspeckle::Sensor(context, drawn), std::vector<float>(width * height, 0.5f), CLSP_FORMAT_FLOAT32);
    drawn.gain_map = desc.gain_map;
    drawn.gain_map_pitch_bytes = desc.gain_map_pitch_bytes;
    const auto both =
        expose<float>(clspeckle::Sensor(context, drawn), std::vector<float>(width * height, 0.5f), CLSP_FORMAT_FLOAT32);
    for (std::size_t i = 0; i < both.size(); ++i)
        ASSERT_NEAR((plain[i] * 1023 - 64) * gain(i % width, static_cast<std::uint32_t>(i / width)),
                    both[i] * 1023 - 64, 1.1)
            << i;
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

TEST_F(Sensor, ConfigureReplacesAllSettings) {
    auto desc = valid();
    desc.prnu = 0.05;
    desc.lag_fraction = 0.5;
    desc.exposure_gain_dn = 300;
    const clspeckle::Sensor sensor(context, valid()), other(context, desc);
    const auto intensity = ramp();
    const auto plain = expose<std::uint16_t>(sensor, intensity, CLSP_FORMAT_UINT16);
    sensor.configure(desc);
    const auto expected = expose<std::uint16_t>(other, intensity, CLSP_FORMAT_UINT16);
    EXPECT_EQ(expected, expose<std::uint16_t>(sensor, intensity, CLSP_FORMAT_UINT16));
    EXPECT_NE(expected, plain);
    ClspSensorDesc bad = desc;
    bad.prnu = -1;
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "prnu", clspSensorConfigure(sensor, &bad));
    bad = desc;
    bad.width += 1;
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "new sensor", clspSensorConfigure(sensor, &bad));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "desc", clspSensorConfigure(sensor, nullptr));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "sensor", clspSensorConfigure(nullptr, &desc));
    // After the refusals it is as it was, down to the lag.
    EXPECT_EQ(expose<std::uint16_t>(other, ramp(), CLSP_FORMAT_UINT16),
              expose<std::uint16_t>(sensor, ramp(), CLSP_FORMAT_UINT16));
    sensor.configure(valid());
    EXPECT_EQ(plain, expose<std::uint16_t>(sensor, intensity, CLSP_FORMAT_UINT16));
}

TEST_F(Sensor, LagRemembersTheFrameBeforeUntilReset) {
    auto desc = valid();
    desc.lag_fraction = 0.25;
    const clspeckle::Sensor sensor(context, desc);
    const std::vector<float> bright(width * height, 1.0f), dark(width * height, 0.0f);
    EXPECT_EQ(576, expose<std::uint16_t>(sensor, bright, CLSP_FORMAT_UINT16)[7]) << "the first frame has none before";
    EXPECT_EQ(64 + 128, expose<std::uint16_t>(sensor, dark, CLSP_FORMAT_UINT16)[7]);
    EXPECT_EQ(64 + 32, expose<std::uint16_t>(sensor, dark, CLSP_FORMAT_UINT16)[7]);
    sensor.reset_lag();
    EXPECT_EQ(64, expose<std::uint16_t>(sensor, dark, CLSP_FORMAT_UINT16)[7]);
    EXPECT_CLSP_OK(clspSensorResetLag(sensor));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "sensor", clspSensorResetLag(nullptr));
}

TEST_F(Sensor, CrosstalkNeedsAnOutputOfItsOwn) {
    auto desc = valid();
    desc.crosstalk_fraction = 0.1;
    const clspeckle::Sensor sensor(context, desc);
    auto in = floats(ramp(), width, height);
    EXPECT_CLSP_FAILS(CLSP_ERROR_OVERLAP, "crosstalk_fraction",
                      enqueue(clspSensorEnqueueExpose, sensor, &in.view, 0, &in.view));
    EXPECT_EQ(ramp(), download<float>(in)) << "a refused call wrote something";
    // A view with margins and pitch: neighbours are those of the image, not of the memory.
    auto wide = upload(ramp(), width, height, CLSP_FORMAT_FLOAT32, 200, 12);
    auto out = make_image(width, height, CLSP_FORMAT_UINT16, 66, 2);
    sensor.enqueue_expose(queue, wide.view, 0, out.view);
    EXPECT_EQ(expose<std::uint16_t>(sensor, ramp(), CLSP_FORMAT_UINT16), download<std::uint16_t>(out));
    EXPECT_TRUE(margins_untouched(out));
}

TEST_F(Sensor, IntensityThatIsNoneWithEverythingOn) {
    auto desc = valid();
    desc.conversion_gain_dn_per_e = 0.5;
    desc.shot_noise = 1;
    desc.prnu = 0.1;
    desc.cold_pixel_fraction = 0.1;
    desc.crosstalk_fraction = 0.2;
    desc.gamma = 0.8;
    desc.lag_fraction = 0.1;
    const clspeckle::Sensor sensor(context, desc);
    auto intensity = ramp();
    intensity[3] = std::numeric_limits<float>::quiet_NaN();
    intensity[40] = -std::numeric_limits<float>::infinity();
    intensity[200] = std::numeric_limits<float>::max();
    for (std::uint64_t frame = 0; frame < 3; ++frame)
        for (float value : expose<float>(sensor, intensity, CLSP_FORMAT_FLOAT32, frame))
            ASSERT_TRUE(value >= 0.0f && value <= 1.0f) << value;
}

TEST_F(Sensor, MosaicOfAColourFilter) {
    const std::array<std::array<double, 4>, 4> expected = {
        {{{0.5, 1, 1, 0.25}}, {{0.25, 1, 1, 0.5}}, {{1, 0.5, 0.25, 1}}, {{1, 0.25, 0.5, 1}}}};
    for (std::uint32_t bayer = CLSP_BAYER_RGGB; bayer <= CLSP_BAYER_GBRG; ++bayer)
        EXPECT_EQ(expected[bayer - 1], clspeckle::Sensor::mosaic_gain(bayer, 0.5, 1.0, 0.25)) << bayer;
    double gains[4] = {};
    for (std::uint32_t bad : {0u, 5u, 0xffffffffu})
        EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "CLSP_BAYER_GRBG (3) or CLSP_BAYER_GBRG (4)",
                          clspSensorMosaicFromBayer(bad, 1, 1, 1, gains));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "mosaic_gain", clspSensorMosaicFromBayer(1, 1, 1, 1, nullptr));
    for (double bad : {-1.0, test::nan_value, test::infinity}) {
        EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "red", clspSensorMosaicFromBayer(1, bad, 1, 1, gains));
        EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "green", clspSensorMosaicFromBayer(1, 1, bad, 1, gains));
        EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "blue", clspSensorMosaicFromBayer(1, 1, 1, bad, gains));
    }
}

TEST_F(Sensor, DemosaicGivesEachColourItsOwn) {
    auto desc = valid();
    const auto gains = clspeckle::Sensor::mosaic_gain(CLSP_BAYER_GRBG, 0.5, 1.0, 0.25);
    std::copy(gains.begin(), gains.end(), desc.mosaic_gain);
    desc.black_level_dn = 0;
    const clspeckle::Sensor sensor(context, desc);
    auto in = floats(std::vector<float>(width * height, 1.0f), width, height);
    auto raw = make_image(width, height, CLSP_FORMAT_UINT16, 70, 6);
    auto rgb = make_image(width, height, CLSP_FORMAT_FLOAT32X3, 400, 16);
    sensor.enqueue_expose(queue, in.view, 0, raw.view);
    sensor.enqueue_demosaic(queue, raw.view, CLSP_BAYER_GRBG, rgb.view);
    const auto pixels = download<float>(rgb);
    for (std::size_t i = 0; i < pixels.size(); i += 3) {
        ASSERT_EQ(256.0f, pixels[i]) << i;
        ASSERT_EQ(512.0f, pixels[i + 1]) << i;
        ASSERT_EQ(128.0f, pixels[i + 2]) << i;
    }
    EXPECT_TRUE(margins_untouched(rgb));

    auto packed = make_image(width, height, CLSP_FORMAT_FLOAT32X3);
    auto codes = make_image(width, height, CLSP_FORMAT_UINT16);
    const auto run = [&](ClspSensor s, const ClspImage *from, std::uint32_t bayer, const ClspImage *to) {
        return enqueue(clspSensorEnqueueDemosaic, s, from, bayer, to);
    };
    check_image("clspSensorEnqueueDemosaic", "raw", codes.view, CLSP_FORMAT_UINT32,
                [&](const ClspImage *image) { return run(sensor, image, CLSP_BAYER_GRBG, &packed.view); });
    check_image("clspSensorEnqueueDemosaic", "rgb", packed.view, CLSP_FORMAT_FLOAT32X4,
                [&](const ClspImage *image) { return run(sensor, &codes.view, CLSP_BAYER_GRBG, image); });
    const test::Failures fails("clspSensorEnqueueDemosaic");
    fails(CLSP_ERROR_INVALID_ARGUMENT, "raw", run(sensor, nullptr, 1, &packed.view));
    fails(CLSP_ERROR_INVALID_ARGUMENT, "rgb", run(sensor, &codes.view, 1, nullptr));
    ClspImage inside = packed.view;
    inside.format = CLSP_FORMAT_UINT16;
    fails(CLSP_ERROR_OVERLAP, "rgb", run(sensor, &inside, 1, &packed.view));
    for (std::uint32_t bad : {0u, 5u})
        fails(CLSP_ERROR_INVALID_ARGUMENT, "CLSP_BAYER_RGGB (1)", run(sensor, &codes.view, bad, &packed.view));
    fails(CLSP_ERROR_INVALID_HANDLE, "sensor", run(nullptr, &codes.view, 1, &packed.view));
    check_enqueue(CLSP_NAMED(clspSensorEnqueueDemosaic), sensor, &codes.view, CLSP_BAYER_RGGB, &packed.view);
}

TEST_F(Sensor, DarkFrameFromCaptures) {
    // Three frames of 2 x 2, a code of padding in each row, a row of padding in each frame.
    const std::vector<std::uint16_t> frames = {10, 20, 9999, 30, 65535, 9999, 9999, 9999, 9999, //
                                               11, 20, 9999, 30, 65535, 9999, 9999, 9999, 9999, //
                                               15, 20, 9999, 30, 65535, 9999, 9999, 9999, 9999};
    std::vector<float> dark(4, -1.0f);
    double noise = -1;
    ASSERT_CLSP_OK(clspSensorDarkFrameFromCaptures(frames.data(), 3, 2, 2, 6, 18, 5.0, dark.data(), &noise));
    EXPECT_EQ((std::vector<float>{7, 15, 25, 65530}), dark);
    EXPECT_DOUBLE_EQ(std::sqrt(7.0 / 4), noise) << "one pixel of variance 7 among four";
    const auto packed = clspeckle::Sensor::dark_frame_from_captures({1, 2, 3, 4}, 2, 1, 0.5);
    EXPECT_EQ((std::vector<float>{1.5f, 2.5f}), packed.dark_frame_dn);
    EXPECT_DOUBLE_EQ(std::sqrt(2.0), packed.temporal_noise_dn);
    EXPECT_EQ(0.0, clspeckle::Sensor::dark_frame_from_captures({1, 2}, 2, 1, 0).temporal_noise_dn);
    EXPECT_THROW(clspeckle::Sensor::dark_frame_from_captures({1, 2, 3}, 2, 1, 0), std::invalid_argument);

    const auto fails = [&](const char *word, const std::uint16_t *f, std::uint32_t count, std::uint32_t w,
                           std::uint32_t h, std::uint64_t row, std::uint64_t frame, double black, float *d, double *n) {
        EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, word,
                          clspSensorDarkFrameFromCaptures(f, count, w, h, row, frame, black, d, n));
    };
    const auto *f = frames.data();
    fails("frames", nullptr, 3, 2, 2, 6, 18, 0, dark.data(), &noise);
    fails("both NULL", f, 3, 2, 2, 6, 18, 0, nullptr, nullptr);
    fails("frame_count", f, 0, 2, 2, 6, 18, 0, dark.data(), &noise);
    fails("frame_count", f, 1, 2, 2, 6, 18, 0, dark.data(), &noise);
    fails("frame_count", f, 65536, 2, 2, 6, 18, 0, dark.data(), &noise);
    fails("width", f, 3, 0, 2, 6, 18, 0, dark.data(), &noise);
    fails("height", f, 3, 2, 16385, 6, 18, 0, dark.data(), &noise);
    fails("row_pitch_bytes", f, 3, 2, 2, 2, 18, 0, dark.data(), &noise);
    fails("row_pitch_bytes", f, 3, 2, 2, 7, 18, 0, dark.data(), &noise);
    fails("row_pitch_bytes", f, 3, 2, 2, ~std::uint64_t{0} - 1, 18, 0, dark.data(), &noise);
    fails("frame_pitch_bytes", f, 3, 2, 2, 6, 8, 0, dark.data(), &noise);
    fails("frame_pitch_bytes", f, 3, 2, 2, 6, 19, 0, dark.data(), &noise);
    for (double bad : {test::nan_value, test::infinity})
        fails("black_level_dn", f, 3, 2, 2, 6, 18, bad, dark.data(), &noise);
    EXPECT_CLSP_OK(clspSensorDarkFrameFromCaptures(f, 1, 2, 2, 6, 0, 0, dark.data(), nullptr));
    EXPECT_CLSP_OK(clspSensorDarkFrameFromCaptures(f, 3, 2, 2, 6, 18, 0, nullptr, &noise));
}

TEST_F(Sensor, Profile) {
    for (const char *name : {"OS04A10", "os04a10"}) {
        const ClspSensorDesc desc = clspeckle::Sensor::profile(name);
        EXPECT_EQ(sizeof(desc), desc.struct_size);
        EXPECT_EQ(2688u, desc.width);
        EXPECT_EQ(1520u, desc.height);
        EXPECT_EQ(10u, desc.bits);
        EXPECT_EQ(64.0, desc.black_level_dn);
        EXPECT_NEAR(0.015 * 1023, desc.read_noise_dn, 1e-9);
    }
    auto small = clspeckle::Sensor::profile("OS04A10");
    small.width = width;
    small.height = height;
    const clspeckle::Sensor sensor(context, small);
    EXPECT_EQ(width * height, expose<std::uint16_t>(sensor, ramp(), CLSP_FORMAT_UINT16).size());
    ClspSensorDesc desc;
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "\"OS04A10\"",
                      clspSensorDescFromProfile(&desc, sizeof(desc), "IMX999"));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "name", clspSensorDescFromProfile(&desc, sizeof(desc), nullptr));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "desc", clspSensorDescFromProfile(nullptr, sizeof(desc), "OS04A10"));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_STRUCT_SIZE, "struct_size", clspSensorDescFromProfile(&desc, 4, "OS04A10"));
}

TEST_F(Sensor, ImpossibleCamerasAreRefused) {
    ClspSensor sensor = nullptr;
    const auto fails = [&](const char *word, const std::function<void(ClspSensorDesc &)> &change) {
        ClspSensorDesc changed = valid();
        change(changed);
        EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, word, clspSensorCreate(context, &changed, &sensor));
        EXPECT_EQ(nullptr, sensor);
    };
    double ClspSensorDesc::*const not_negative[] = {&ClspSensorDesc::conversion_gain_dn_per_e,
                                                    &ClspSensorDesc::photons_per_unit,
                                                    &ClspSensorDesc::full_well_e,
                                                    &ClspSensorDesc::crosstalk_fraction,
                                                    &ClspSensorDesc::prnu,
                                                    &ClspSensorDesc::column_prnu,
                                                    &ClspSensorDesc::row_prnu,
                                                    &ClspSensorDesc::row_offset_dn,
                                                    &ClspSensorDesc::dull_pixel_fraction,
                                                    &ClspSensorDesc::periodic_offset_dn,
                                                    &ClspSensorDesc::periodic_frequency_x,
                                                    &ClspSensorDesc::periodic_frequency_y,
                                                    &ClspSensorDesc::telegraph_fraction,
                                                    &ClspSensorDesc::telegraph_step_dn,
                                                    &ClspSensorDesc::code_width_wave,
                                                    &ClspSensorDesc::code_width_period,
                                                    &ClspSensorDesc::widest_code,
                                                    &ClspSensorDesc::dark_current_e_per_s,
                                                    &ClspSensorDesc::exposure_time_s,
                                                    &ClspSensorDesc::lag_fraction,
                                                    &ClspSensorDesc::dsnu_dn,
                                                    &ClspSensorDesc::column_offset_dn,
                                                    &ClspSensorDesc::row_noise_dn,
                                                    &ClspSensorDesc::column_noise_dn,
                                                    &ClspSensorDesc::read_noise_spread,
                                                    &ClspSensorDesc::quantum_efficiency,
                                                    &ClspSensorDesc::gamma,
                                                    &ClspSensorDesc::dark_current_doubling_k};
    for (auto member : not_negative)
        for (double bad : {-1.0, test::nan_value, test::infinity, -test::infinity})
            fails("", [&](ClspSensorDesc &d) { d.*member = bad; });
    for (double bad : {test::nan_value, test::infinity, -1.01, 0.26})
        fails("cubic_nonlinearity", [&](ClspSensorDesc &d) { d.cubic_nonlinearity = bad; });
    for (std::uint32_t bad : {0u, 4u})
        fails("nonlinearity_power", [&](ClspSensorDesc &d) { d.nonlinearity_power = bad; });
    for (double bad : {test::nan_value, test::infinity, -0.51, 0.51})
        fails("read_noise_correlation", [&](ClspSensorDesc &d) { d.read_noise_correlation = bad; });
    fails("code_width_wave", [](ClspSensorDesc &d) { d.code_width_wave = 0.51; });
    for (double bad : {1.9, 16.1})
        fails("code_width_period", [&](ClspSensorDesc &d) { d.code_width_period = bad; });
    for (double bad : {test::nan_value, test::infinity, -274.0, 501.0}) {
        fails("temperature_c", [&](ClspSensorDesc &d) { d.temperature_c = bad; });
        fails("reference", [&](ClspSensorDesc &d) { d.dark_current_reference_temperature_c = bad; });
    }
    for (double bad : {-1.0, test::nan_value, test::infinity})
        fails("mosaic_gain[2]", [&](ClspSensorDesc &d) { d.mosaic_gain[2] = bad; });
    fails("mosaic_gain", [](ClspSensorDesc &d) { std::fill(d.mosaic_gain, d.mosaic_gain + 4, 0.0); });
    fails("shot_noise", [](ClspSensorDesc &d) { d.shot_noise = 2; });
    fails("telegraph_centered", [](ClspSensorDesc &d) { d.telegraph_centered = 2; });
    fails("reserved_telegraph", [](ClspSensorDesc &d) { d.reserved_telegraph = 1; });
    fails("conversion_gain_dn_per_e", [](ClspSensorDesc &d) { d.shot_noise = 1; });
    fails("conversion_gain_dn_per_e", [](ClspSensorDesc &d) { d.conversion_gain_dn_per_e = 1e-12; });
    fails("conversion_gain_dn_per_e", [](ClspSensorDesc &d) { d.full_well_e = 1000; });
    fails("conversion_gain_dn_per_e", [](ClspSensorDesc &d) { d.photons_per_unit = 1000; });
    fails("conversion_gain_dn_per_e", [](ClspSensorDesc &d) { d.dark_current_e_per_s = 1; });
    fails("black level", [](ClspSensorDesc &d) { d.conversion_gain_dn_per_e = 1, d.full_well_e = 64; });
    fails("saturation_dn",
          [](ClspSensorDesc &d) { d.conversion_gain_dn_per_e = 1, d.full_well_e = 640, d.saturation_dn = 600; });
    fails("exposure_gain_dn", [](ClspSensorDesc &d) {
        d.conversion_gain_dn_per_e = 1, d.photons_per_unit = 640, d.exposure_gain_dn = 600;
    });
    fails("dark current", [](ClspSensorDesc &d) {
        d.conversion_gain_dn_per_e = 1, d.full_well_e = 640, d.dark_current_e_per_s = 64000;
    });
    fails("dark signal", [](ClspSensorDesc &d) { // doubles 250 times over
        d.conversion_gain_dn_per_e = 1, d.dark_current_e_per_s = 1, d.dark_current_doubling_k = 0.1;
        d.temperature_c = 50;
    });
    for (std::uint32_t bad : {11u, 0xffffffffu})
        fails("effective_bits", [&](ClspSensorDesc &d) { d.effective_bits = bad; });
    fails("black_level_dn", [](ClspSensorDesc &d) { d.black_level_dn = 1023; });
    fails("quantum_efficiency", [](ClspSensorDesc &d) { d.quantum_efficiency = 0; });
    fails("quantum_efficiency", [](ClspSensorDesc &d) { d.quantum_efficiency = 1.01; });
    fails("gamma", [](ClspSensorDesc &d) { d.gamma = 0.09; });
    fails("gamma", [](ClspSensorDesc &d) { d.gamma = 10.5; });
    fails("lag_fraction", [](ClspSensorDesc &d) { d.lag_fraction = 1; });
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
    using D = ClspSensorDesc;
    const auto refuses = check_create(valid());
    refuses("width", &D::width, test::bad_sides);
    refuses("height", &D::height, test::bad_sides);
    refuses("bits", &D::bits, {0u, 7u, 17u, 0xffffffffu});
    refuses("exposure_gain_dn", &D::exposure_gain_dn, test::bad({-1.0}));
    refuses("read_noise_dn", &D::read_noise_dn, test::bad({-1.0}));
    refuses("hot_pixel_mean_dn", &D::hot_pixel_mean_dn, test::bad({-1.0}));
    refuses("hot_pixel_fraction", &D::hot_pixel_fraction, test::bad({-1.0, 1.01}));
    refuses("cold_pixel_fraction", &D::cold_pixel_fraction, test::bad({-1.0, 1.01}));
    refuses("float_full_scale", &D::float_full_scale, test::bad({-1.0, 0.0}));
    refuses("saturation_dn", &D::saturation_dn, {0.0, -1.0, test::nan_value, -test::infinity});
    refuses("black_level_dn", &D::black_level_dn, test::bad());
    refuses("quantize", &D::quantize, {2});
    refuses("reserved", &D::reserved, {1});
    std::vector<float> dark(width * height, 0.0f);
    D desc = valid();
    desc.dark_frame_dn = dark.data();
    const auto refuses_dark = check_create(desc);
    refuses_dark("dark_frame_pitch_bytes", &D::dark_frame_pitch_bytes, {4, width * 4 + 2});
    for (float bad : {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()}) {
        dark[width + 2] = bad;
        refuses_dark("dark_frame_dn", &D::dark_frame_dn, {dark.data()}, CLSP_ERROR_INVALID_DATA);
    }
    std::vector<float> gains(width * height, 1.0f);
    desc = valid();
    desc.gain_map = gains.data();
    const auto refuses_gain = check_create(desc);
    refuses_gain("gain_map_pitch_bytes", &D::gain_map_pitch_bytes, {4, width * 4 + 2});
    for (float bad : {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity(), -0.5f}) {
        gains[width + 2] = bad;
        refuses_gain("gain_map[1][2] (row, column) is", &D::gain_map, {gains.data()}, CLSP_ERROR_INVALID_DATA);
    }
    for (float mean : {0.0f, 0.89f, 1.11f, 400.0f}) {
        std::fill(gains.begin(), gains.end(), mean);
        refuses_gain("it must be 0.9 to 1.1", &D::gain_map, {gains.data()}, CLSP_ERROR_INVALID_DATA);
    }
}

TEST_F(Sensor, ExposeRefusesBadArguments) {
    const clspeckle::Sensor sensor(context, valid());
    const auto in = floats(ramp(), width, height);
    const auto out = make_image(width, height, CLSP_FORMAT_UINT16);
    const auto run = [&](ClspSensor s, const ClspImage *from, const ClspImage *to, std::uint64_t frame_index = 0) {
        return enqueue(clspSensorEnqueueExpose, s, from, frame_index, to);
    };
    const test::Failures fails("clspSensorEnqueueExpose");
    fails(CLSP_ERROR_INVALID_HANDLE, "sensor", run(nullptr, &in.view, &out.view));
    fails(CLSP_ERROR_INVALID_ARGUMENT, "intensity", run(sensor, nullptr, &out.view));
    fails(CLSP_ERROR_INVALID_ARGUMENT, "output", run(sensor, &in.view, nullptr));
    fails(CLSP_ERROR_INVALID_ARGUMENT, "frame_index", run(sensor, &in.view, &out.view, std::uint64_t{1} << 48));
    check_image("clspSensorEnqueueExpose", "intensity", in.view, CLSP_FORMAT_UINT16,
                [&](const ClspImage *image) { return run(sensor, image, &out.view); });
    check_image("clspSensorEnqueueExpose", "output", out.view, CLSP_FORMAT_UINT32,
                [&](const ClspImage *image) { return run(sensor, &in.view, image); });
    const auto bytes = make_image(width, height, CLSP_FORMAT_UINT8); // ten bits do not fit
    fails(CLSP_ERROR_INVALID_FORMAT, "output", run(sensor, &in.view, &bytes.view));
    ClspImage inside = in.view;
    inside.format = CLSP_FORMAT_UINT16;
    fails(CLSP_ERROR_OVERLAP, "output", run(sensor, &in.view, &inside));
    check_enqueue(CLSP_NAMED(clspSensorEnqueueExpose), sensor, &in.view, 0, &out.view);
}

TEST_F(Sensor, RetainAndRelease) {
    check_references("clspSensorSetExposureGain",
                     [](ClspSensor sensor) { return clspSensorSetExposureGain(sensor, 1.0); });
}

} // namespace

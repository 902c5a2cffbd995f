// Camera profiles through the C interface: what a file says is what getters, descriptions and frames have. Damaged
// files are tests/tools/test_cli_profile.py's.
#include "test_support.hpp"

#include <filesystem>
#include <fstream>
#include <sstream>

namespace {

constexpr std::uint32_t kWidth = 48, kHeight = 40;

constexpr const char *kText = R"({
 "format": "clspeckle-camera-profile", "version": 1,
 "camera": {"width": 48, "height": 40, "bits": 12, "pixel_pitch_m": 3e-6, "f_number": 4.0, "wavelength_m": 850e-9,
            "degree_of_polarization": 0.5, "field": "unit_phasor", "principal_point_px": [20.5, 19.0],
            "black_level_dn": 60.5, "read_noise_dn": 3.25, "oversampling": 2, "fill_factor": 0.25},
 "effects": [
  {"effect": "row_noise", "parameters": {"sigma_dn": 3.5}, "intervals": {"sigma_dn": [3.0, 4.0]}, "named": true,
   "conditional": false},
  {"effect": "hot_pixels", "parameters": {"fraction": 0.01, "mean_dn": 150.0}, "intervals": {}, "named": false,
   "conditional": true},
  {"effect": "zero_order", "parameters": {"relative_intensity": 8.0}, "intervals": {}, "named": true, "conditional": false}],
 "hypotheses": [{"effect": "haze", "parameters": {"fraction": 0.1}, "intervals": {"fraction": [0.05, 0.2]}, "named": true,
                 "conditional": false}],
 "lab": {
  "sequences": [
   {"name": "dark", "scene": "dark", "moving": false, "f_number": 4.0, "mean_dn": 60.5, "light_dn": 0.0, "gain_dn": 0.0},
   {"name": "board", "scene": "board", "moving": true, "f_number": 8.0, "exposure_ms": 20.0, "mean_dn": 260.5,
    "light_dn": 200.0, "gain_dn": 210.0}],
  "lights": [], "lamp_drifts": [], "lens_or_light": false},
 "provenance": {"capture": "bench", "clspeckle": "0.1.0", "verdict": "ambiguous", "equivalent": ["dsnu", "hot_pixels"],
                "residual_detected": false, "level": 0.02, "seed": 18446744073709551615}
})";

class Profile : public test::DeviceTest {
  protected:
    std::filesystem::path folder = std::filesystem::path(::testing::TempDir()) / "clspeckle_profile";
    std::string path = (folder / "camera.json").string();

    void SetUp() override {
        DeviceTest::SetUp();
        std::filesystem::create_directories(folder);
        std::ofstream(path) << kText;
    }
    void TearDown() override { std::filesystem::remove_all(folder); }

    clspeckle::Pipeline make_pipeline(const clspeckle::Profile &profile, bool with_sensor = true) {
        auto phase = clspeckle::make<ClspPhaseDesc>();
        auto aperture = clspeckle::make<ClspApertureDesc>();
        auto lens = clspeckle::make<ClspLensDesc>();
        auto sensor = clspeckle::make<ClspSensorDesc>();
        profile.describe(&phase, &aperture, &lens, &sensor, "board");
        return {context, clspeckle::Phase(context, phase), clspeckle::Aperture(context, aperture),
                with_sensor ? clspeckle::Sensor(context, sensor) : clspeckle::Sensor()};
    }
    void check_maps(const clspeckle::Profile &made, const clspeckle::Profile &read);
    std::vector<std::uint16_t> render(const clspeckle::Pipeline &pipeline) {
        const clspeckle::Buffer ones(context, queue, std::vector<float>(kWidth * kHeight, 1.0f));
        const clspeckle::Buffer output(context, kWidth * kHeight * sizeof(std::uint16_t));
        auto frame = clspeckle::make<ClspFrame>();
        frame.irradiance = ones.image(kWidth, kHeight, CLSP_FORMAT_FLOAT32);
        frame.refresh = CLSP_REFRESH_ALL;
        frame.output = output.image(kWidth, kHeight, CLSP_FORMAT_UINT16);
        pipeline.enqueue_frame(queue, frame);
        return output.read<std::uint16_t>(queue, kWidth * kHeight);
    }
};

// made: of a diagnosis of dark and flat frames; read: the same from the file that it was written to.
void Profile::check_maps(const clspeckle::Profile &made, const clspeckle::Profile &read) {
    constexpr std::uint32_t kBoth = CLSP_PROFILE_MAP_DARK | CLSP_PROFILE_MAP_GAIN;
    ASSERT_EQ(made.info().maps, kBoth);
    ASSERT_EQ(read.info().maps, kBoth);
    EXPECT_STREQ(made.map(CLSP_PROFILE_MAP_DARK).path, "") << "it is in no file yet";
    const ClspProfileMap about = read.map(CLSP_PROFILE_MAP_GAIN);
    EXPECT_EQ(about.map, CLSP_PROFILE_MAP_GAIN);
    EXPECT_EQ(about.frame_count, 8u);
    EXPECT_EQ(about.path, (folder / "camera.gain.npy").string());
    EXPECT_NEAR(read.map(CLSP_PROFILE_MAP_DARK).standard_error, std::sqrt((16.0 + 1.0 / 12.0) / 8.0), 0.05);
    const auto dark = read.map_values(CLSP_PROFILE_MAP_DARK), gain = read.map_values(CLSP_PROFILE_MAP_GAIN);
    EXPECT_EQ(dark, made.map_values(CLSP_PROFILE_MAP_DARK));
    for (const float value : gain)
        EXPECT_NEAR(value, 1.0f, 0.1f) << "a pattern of 2 %";

    // A pipeline with the profile is one whose sensor has the maps, and none of the effects that they hold.
    auto phase = clspeckle::make<ClspPhaseDesc>();
    auto aperture = clspeckle::make<ClspApertureDesc>();
    auto sensor = clspeckle::make<ClspSensorDesc>();
    read.describe(&phase, &aperture, nullptr, &sensor, "flat");
    const auto pipeline_of = [&](const ClspSensorDesc &desc) {
        return clspeckle::Pipeline(context, clspeckle::Phase(context, phase), clspeckle::Aperture(context, aperture),
                                   clspeckle::Sensor(context, desc));
    };
    ClspSensorDesc with_maps = sensor;
    with_maps.dark_frame_dn = dark.data();
    with_maps.gain_map = gain.data();
    const auto pipeline = pipeline_of(sensor), by_hand = pipeline_of(with_maps), drawn = pipeline_of(sensor);
    pipeline.set_effect("dsnu", {40.0}); // the map takes its place
    ASSERT_CLSP_OK(clspPipelineSetProfile(pipeline, read));
    EXPECT_EQ(render(pipeline), render(by_hand));
    ASSERT_CLSP_OK(clspPipelineSetProfile(pipeline, made)) << "the same maps again";
    pipeline.clear_effects();
    EXPECT_EQ(render(pipeline), render(by_hand)) << "maps stay";
    pipeline.set_effect("row_noise", {3.0});
    by_hand.set_effect("row_noise", {3.0});
    EXPECT_EQ(render(pipeline), render(by_hand)) << "beside the maps";
    const auto plain = render(drawn);
    ASSERT_CLSP_OK(clspPipelineSetProfileMaps(drawn, read, 0));
    EXPECT_NE(render(drawn), plain) << "patterns of the deviations";

    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "maps is 4", clspPipelineSetProfileMaps(drawn, read, 4));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "map is 3; the profile has CLSP_PROFILE_MAP_DARK",
                      clspProfileGetMap(read, 3, nullptr, nullptr));
    std::vector<float> own(kWidth * kHeight, 2.0f);
    with_maps.dark_frame_dn = own.data();
    const auto other = pipeline_of(with_maps);
    const auto before = render(other);
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "the sensor has a dark_frame_dn already",
                      clspPipelineSetProfile(other, read));
    EXPECT_EQ(render(other), before);
    ASSERT_CLSP_OK(clspPipelineSetProfileMaps(other, read, 0)) << "what the message says";
    ASSERT_CLSP_OK(clspPipelineSetProfileMaps(other, read, CLSP_PROFILE_MAP_GAIN));
    std::filesystem::remove(folder / "camera.dark.npy");
    EXPECT_CLSP_FAILS(CLSP_ERROR_IO, "the dark map of ", clspPipelineSetProfile(drawn, read));
    EXPECT_CLSP_FAILS(CLSP_ERROR_IO, "the dark map of ",
                      clspProfileWrite(read, (folder / "copy.json").string().c_str()));
    EXPECT_FALSE(std::filesystem::exists(folder / "copy.gain.npy")) << "all or nothing";
    ASSERT_CLSP_OK(clspPipelineSetProfileMaps(drawn, read, CLSP_PROFILE_MAP_GAIN));
    ASSERT_CLSP_OK(clspPipelineSetProfile(drawn, made)) << "its values are in memory";
}

TEST_F(Profile, GettersGiveWhatTheFileSays) {
    ClspProfile profile = nullptr;
    ASSERT_CLSP_OK(clspProfileOpen(path.c_str(), &profile));
    ASSERT_CLSP_OK(clspProfileRetain(profile));
    ASSERT_CLSP_OK(clspProfileRelease(profile));
    auto info = clspeckle::make<ClspProfileInfo>();
    ASSERT_CLSP_OK(clspProfileGetInfo(profile, &info));
    EXPECT_EQ(info.width, kWidth);
    EXPECT_EQ(info.height, kHeight);
    EXPECT_EQ(info.bits, 12u);
    EXPECT_EQ(info.field, CLSP_FIELD_UNIT_PHASOR);
    EXPECT_EQ(info.oversampling, 2u);
    EXPECT_EQ(info.effect_count, 3u);
    EXPECT_EQ(info.hypothesis_count, 1u);
    EXPECT_EQ(info.sequence_count, 2u);
    EXPECT_EQ(info.verdict, CLSP_VERDICT_AMBIGUOUS);
    EXPECT_EQ(info.residual_detected, 0u);
    EXPECT_EQ(info.seed, 18446744073709551615u);
    EXPECT_EQ(info.pixel_pitch_m, 3e-6);
    EXPECT_EQ(info.f_number, 4.0);
    EXPECT_EQ(info.wavelength_m, 850e-9);
    EXPECT_EQ(info.degree_of_polarization, 0.5);
    EXPECT_EQ(info.principal_point_x_px, 20.5);
    EXPECT_EQ(info.principal_point_y_px, 19.0);
    EXPECT_EQ(info.black_level_dn, 60.5);
    EXPECT_EQ(info.read_noise_dn, 3.25);
    EXPECT_EQ(info.fill_factor, 0.25);
    EXPECT_EQ(info.level, 0.02);
    EXPECT_EQ(info.maps, 0u);
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "map is 1; the profile has none",
                      clspProfileGetMap(profile, CLSP_PROFILE_MAP_DARK, nullptr, nullptr));
    EXPECT_STREQ(info.version, "0.1.0");
    EXPECT_STREQ(info.capture, "bench");

    auto effect = clspeckle::make<ClspProfileEffect>();
    ASSERT_CLSP_OK(clspProfileGetEffect(profile, 0, &effect));
    EXPECT_STREQ(effect.id, "row_noise");
    EXPECT_EQ(effect.parameter_count, 1u);
    EXPECT_EQ(effect.named, 1u);
    EXPECT_EQ(effect.conditional, 0u);
    EXPECT_EQ(effect.values[0], 3.5);
    EXPECT_EQ(effect.low[0], 3.0);
    EXPECT_EQ(effect.high[0], 4.0);
    ASSERT_CLSP_OK(clspProfileGetEffect(profile, 1, &effect));
    EXPECT_EQ(effect.parameter_count, 2u);
    EXPECT_EQ(effect.values[1], 150.0);
    EXPECT_EQ(effect.named, 0u);
    EXPECT_EQ(effect.conditional, 1u);
    EXPECT_TRUE(std::isnan(effect.low[0]) && std::isnan(effect.high[1])) << "no interval";
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "3 effects", clspProfileGetEffect(profile, 3, &effect));

    auto sequence = clspeckle::make<ClspProfileSequence>();
    ASSERT_CLSP_OK(clspProfileGetSequence(profile, 0, &sequence));
    EXPECT_EQ(sequence.exposure_ms, 0.0) << "not known";
    ASSERT_CLSP_OK(clspProfileGetSequence(profile, 1, &sequence));
    EXPECT_STREQ(sequence.name, "board");
    EXPECT_EQ(sequence.scene, CLSP_SCENE_BOARD);
    EXPECT_EQ(sequence.moving, 1u);
    EXPECT_EQ(sequence.f_number, 8.0);
    EXPECT_EQ(sequence.exposure_ms, 20.0);
    EXPECT_EQ(sequence.mean_dn, 260.5);
    EXPECT_EQ(sequence.light_dn, 200.0);
    EXPECT_EQ(sequence.gain_dn, 210.0);
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "2 sequences", clspProfileGetSequence(profile, 2, &sequence));

    std::uint64_t length = 0;
    ASSERT_CLSP_OK(clspProfileGetJson(profile, 0, nullptr, &length));
    std::vector<char> text(length);
    ASSERT_CLSP_OK(clspProfileGetJson(profile, length, text.data(), nullptr));
    const std::string other = (folder / "other.json").string();
    ASSERT_CLSP_OK(clspProfileWrite(profile, other.c_str()));
    std::ostringstream written;
    written << std::ifstream(other, std::ios::binary).rdbuf();
    EXPECT_EQ(written.str(), text.data());
    EXPECT_EQ(clspeckle::Profile::open(other).json(), text.data()) << "nothing is lost on the way";
    EXPECT_CLSP_FAILS(CLSP_ERROR_IO, "nowhere", clspProfileWrite(profile, (folder / "nowhere" / "x").string().c_str()));
    EXPECT_CLSP_FAILS(CLSP_ERROR_IO, "none.json", clspProfileOpen((folder / "none.json").string().c_str(), &profile));
    ASSERT_CLSP_OK(clspProfileRelease(profile));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "profile", clspProfileGetInfo(profile, &info));
}

TEST_F(Profile, DescribesStagesAndKeepsTheRest) {
    const auto profile = clspeckle::Profile::open(path);
    auto phase = clspeckle::make<ClspPhaseDesc>();
    auto aperture = clspeckle::make<ClspApertureDesc>();
    auto lens = clspeckle::make<ClspLensDesc>();
    auto sensor = clspeckle::make<ClspSensorDesc>();
    phase.seed = 5;
    aperture.soft_rim = 0.5;
    lens.glare_fraction = 0.25;
    sensor.prnu = 0.125;
    ASSERT_CLSP_OK(clspProfileDescribe(profile, nullptr, &phase, &aperture, &lens, &sensor));
    for (const std::uint32_t width : {phase.width, aperture.width, lens.width, sensor.width})
        EXPECT_EQ(width, kWidth);
    EXPECT_EQ(phase.seed, 5u);
    EXPECT_EQ(phase.polarization_count, 2u);
    EXPECT_EQ(phase.oversampling, 2u);
    EXPECT_EQ(phase.field, CLSP_FIELD_UNIT_PHASOR);
    EXPECT_EQ(aperture.soft_rim, 0.5);
    EXPECT_EQ(aperture.normalization, CLSP_NORMALIZATION_UNIT_MEAN);
    EXPECT_EQ(aperture.f_number, 4.0);
    EXPECT_EQ(aperture.fill_factor, 0.25);
    EXPECT_EQ(aperture.degree_of_polarization, 0.5);
    EXPECT_EQ(lens.glare_fraction, 0.25);
    EXPECT_EQ(lens.principal_point_given, 1u);
    EXPECT_EQ(lens.principal_point_x_px, 20.5);
    EXPECT_EQ(sensor.prnu, 0.125);
    EXPECT_EQ(sensor.bits, 12u);
    EXPECT_EQ(sensor.black_level_dn, 60.5);
    EXPECT_EQ(sensor.read_noise_dn, 3.25);
    EXPECT_EQ(sensor.exposure_gain_dn, clspeckle::make<ClspSensorDesc>().exposure_gain_dn) << "light is the lab's";
    ASSERT_CLSP_OK(clspProfileDescribe(profile, "board", nullptr, &aperture, nullptr, &sensor));
    EXPECT_EQ(aperture.f_number, 8.0) << "the sequence's own";
    EXPECT_EQ(sensor.exposure_gain_dn, 210.0);
    EXPECT_EQ(sensor.exposure_time_s, 0.02);
    sensor.bits = 8;
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "no sequence \"bord\"; name one of dark, board",
                      clspProfileDescribe(profile, "bord", nullptr, nullptr, nullptr, &sensor));
    EXPECT_EQ(sensor.bits, 8u) << "nothing is written";
    phase.struct_size = 1;
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_STRUCT_SIZE, "phase",
                      clspProfileDescribe(profile, nullptr, &phase, nullptr, nullptr, &sensor));
    EXPECT_EQ(sensor.bits, 8u);
}

TEST_F(Profile, PipelineHasItsEffects) {
    const auto profile = clspeckle::Profile::open(path);
    const auto pipeline = make_pipeline(profile), by_hand = make_pipeline(profile);
    const auto plain = render(pipeline);
    ASSERT_CLSP_OK(clspPipelineSetProfile(pipeline, profile));
    by_hand.set_effect("row_noise", {3.5});
    by_hand.set_effect("hot_pixels", {0.01, 150.0});
    EXPECT_EQ(render(pipeline), render(by_hand)) << "zero_order is left out where there are no dots";
    pipeline.clear_effects();
    EXPECT_EQ(render(pipeline), plain);
    EXPECT_NE(render(by_hand), plain);
}

TEST_F(Profile, OtherCamerasAreRefused) {
    const auto profile = clspeckle::Profile::open(path);
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "no sensor",
                      clspPipelineSetProfile(make_pipeline(profile, false), profile));
    std::string text = kText;
    for (const auto &[from, to, what] :
         {std::array<const char *, 3>{"\"bits\": 12", "\"bits\": 10", "bits is 12 of the pipeline, 10"},
          {"\"width\": 48", "\"width\": 64", "width is 48 of the pipeline, 64"},
          {"3e-6", "4e-6", "pixel_pitch_m is 3e-06 of the pipeline, 4e-06"},
          {"850e-9", "940e-9", "wavelength_m is 8.5e-07 of the pipeline, 9.4e-07"}}) {
        std::string other = text;
        other.replace(other.find(from), std::strlen(from), to);
        std::ofstream(path) << other;
        const auto pipeline = make_pipeline(profile);
        const auto plain = render(pipeline);
        EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, what,
                          clspPipelineSetProfile(pipeline, clspeckle::Profile::open(path)));
        EXPECT_EQ(render(pipeline), plain);
        const auto own = clspeckle::Profile::open(path); // "make the pipeline's stages of the profile"
        EXPECT_CLSP_OK(clspPipelineSetProfile(make_pipeline(own), own));
    }
}

// A camera with black level 64 and read noise 4, dark and flat; what it is worth is tests/tools/test_cli_profile.py's.
TEST_F(Profile, OfADiagnosisAndNotOfAComparison) {
    auto desc = clspeckle::make<ClspCaptureDesc>();
    desc.width = kWidth;
    desc.height = kHeight;
    clspeckle::Capture capture(desc);
    auto sensor = clspeckle::make<ClspSensorDesc>();
    sensor.width = kWidth;
    sensor.height = kHeight;
    sensor.exposure_gain_dn = 300.0;
    sensor.dsnu_dn = 3.0;
    sensor.prnu = 0.02;
    const clspeckle::Sensor camera(context, sensor);
    const clspeckle::Buffer output(context, kWidth * kHeight * sizeof(std::uint16_t));
    for (const bool flat : {false, true}) {
        const clspeckle::Buffer light(context, queue, std::vector<float>(kWidth * kHeight, flat ? 1.0f : 0.0f));
        std::vector<std::uint16_t> codes;
        for (std::uint64_t frame = 0; frame < 8; ++frame) {
            camera.enqueue_expose(queue, light.image(kWidth, kHeight, CLSP_FORMAT_FLOAT32), flat ? frame : 100 + frame,
                                  output.image(kWidth, kHeight, CLSP_FORMAT_UINT16));
            const auto one = output.read<std::uint16_t>(queue, kWidth * kHeight);
            codes.insert(codes.end(), one.begin(), one.end());
        }
        capture.add_sequence(flat ? "flat" : "dark", flat ? CLSP_SCENE_FLAT : CLSP_SCENE_DARK, false, codes);
    }
    clspeckle::DiagnoseOptions options;
    options.null_replicates = 12;
    options.seed = 3;
    const auto diagnosis = clspeckle::diagnose(context, capture, options);
    ClspProfile handle = nullptr;
    ASSERT_CLSP_OK(clspDiagnosisGetProfile(diagnosis, &handle));
    const auto profile = clspeckle::Profile::adopt(handle);
    const ClspProfileInfo info = profile.info();
    EXPECT_STREQ(info.capture, "") << "it was never in a folder";
    EXPECT_EQ(info.verdict, diagnosis.summary().verdict);
    EXPECT_EQ(info.seed, 3u);
    EXPECT_NEAR(info.black_level_dn, 64.0, 0.5);
    EXPECT_NEAR(info.read_noise_dn, 4.0, 0.1);
    ASSERT_EQ(info.sequence_count, 2u);
    EXPECT_NEAR(profile.sequences()[1].gain_dn, 300.0, 1.0);
    EXPECT_NO_THROW(profile.write(path));
    EXPECT_EQ(clspeckle::Profile::open(path).json(), diagnosis.profile().json());
    check_maps(profile, clspeckle::Profile::open(path));
    options.profile = profile;
    EXPECT_THROW(clspeckle::diagnose(context, capture, options), clspeckle::Error) << "it makes one";
    const auto comparison = clspeckle::compare(context, capture, capture, options);
    EXPECT_EQ(comparison.summary().verdict, CLSP_VERDICT_NONE);
    std::ofstream(path) << kText;
    options.profile = clspeckle::Profile::open(path);
    try {
        clspeckle::compare(context, capture, capture, options);
        ADD_FAILURE() << "no exception";
    } catch (const clspeckle::Error &error) {
        EXPECT_NE(error.message().find("another camera: bits is 10 of the real set, 12 of the profile"),
                  std::string::npos)
            << error.message();
    }
    ClspDiagnosis other = nullptr;
    auto desc_of_two = clspeckle::make<ClspDiagnoseDesc>();
    EXPECT_EQ(desc_of_two.profile, nullptr);
    desc_of_two.profile = reinterpret_cast<ClspProfile>(1);
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "profile is not a live handle",
                      clspCompare(context, capture, capture, &desc_of_two, &other));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_STATE, "comparison", clspDiagnosisGetProfile(comparison, &handle));
}

} // namespace

// The catalogue of effects: what it lists, that each changes what it should and nothing else, and that clearing puts
// everything back.
#include "test_support.hpp"

#include <cmath>
#include <cstddef>
#include <map>
#include <set>

namespace {

using test::DeviceTest;

constexpr std::uint32_t width = 48, height = 40;

// What the sim-to-real gap protocol fixes of the catalogue: ids, stages and parameter names.
const std::map<std::string, std::pair<std::string, std::vector<std::string>>> fixed_effects = {
    {"linewidth", {"laser", {"dephasing_rad"}}},
    {"power_flicker", {"laser", {"sigma"}}},
    {"wavelength_shift", {"laser", {"delta_nm"}}},
    {"beam_skew", {"laser", {"skew", "angle_rad"}}},
    {"beam_flat_top", {"laser", {"flatness"}}},
    {"zero_order", {"doe", {"relative_intensity"}}},
    {"ghost_dots", {"doe", {"relative_intensity", "lattice_direction"}}},
    {"scatter_background", {"doe", {"fraction"}}},
    {"depolarization", {"surface", {"degree_of_polarization"}}},
    {"low_roughness", {"surface", {"coherent_fraction"}}},
    {"subsurface_scattering", {"surface", {"length_px", "fraction"}}},
    {"motion_decorrelation", {"motion", {"lags", "correlation_law"}}},
    {"surface_boiling", {"motion", {"correlation_frames"}}},
    {"airflow", {"motion", {"rms_rad", "scale_px", "correlation_frames", "correlation_law"}}},
    {"vibration", {"motion", {"rms_px"}}},
    {"defocus", {"optics", {"waves"}}},
    {"vignetting", {"optics", {"corner_loss"}}},
    {"aperture_mismatch", {"optics", {"f_number_ratio"}}},
    {"pupil_obstruction", {"optics", {"radius_ratio"}}},
    {"glare", {"optics", {"fraction", "scale_px"}}},
    {"ambient_light", {"optics", {"level_dn"}}},
    {"lens_distortion", {"optics", {"k1"}}},
    {"pixel_integration", {"sensor", {"fill_factor"}}},
    {"crosstalk", {"sensor", {"fraction"}}},
    {"shot_noise", {"sensor", {"dn_per_electron"}}},
    {"prnu", {"sensor", {"sigma"}}},
    {"dsnu", {"sensor", {"sigma_dn"}}},
    {"column_fpn", {"sensor", {"sigma_dn"}}},
    {"hot_pixels", {"sensor", {"fraction", "mean_dn"}}},
    {"row_noise", {"sensor", {"sigma_dn"}}},
    {"gamma", {"sensor", {"gamma"}}},
    {"full_well", {"sensor", {"level_dn"}}},
    {"adc_bits", {"sensor", {"bits"}}},
    {"bayer_mismatch", {"sensor", {"delta", "green_diagonal"}}},
    {"image_lag", {"sensor", {"fraction"}}},
};

std::vector<ClspEffectInfo> catalogue() {
    std::uint32_t count = 0;
    EXPECT_CLSP_OK(clspEffectGetCount(&count));
    std::vector<ClspEffectInfo> effects(count);
    for (std::uint32_t i = 0; i < count; ++i)
        EXPECT_CLSP_OK(clspEffectGetInfo(i, &effects[i]));
    return effects;
}

template <std::size_t Size> void expect_whole(const char (&text)[Size]) {
    EXPECT_GT(std::strlen(text), 0u);
    EXPECT_LT(std::strlen(text), Size - 1) << "\"" << text << "\" may have been cut";
}

class Effects : public DeviceTest {
  protected:
    std::vector<double> positions;
    clspeckle::Phase phase;
    clspeckle::Aperture aperture;
    clspeckle::Sensor sensor;
    clspeckle::Dots dots;
    Image codes = make_image(width, height, CLSP_FORMAT_UINT16);

    Effects() {
        // Not a lattice that any symmetry leaves as it is.
        for (int j = 0; j < 5; ++j)
            for (int i = 0; i < 6; ++i) {
                positions.push_back(4.3 + 8.1 * i + 0.7 * (j % 2));
                positions.push_back(4.1 + 8.2 * j + 0.5 * (i % 3));
            }
        auto p = clspeckle::make<ClspPhaseDesc>();
        p.width = width;
        p.height = height;
        p.seed = 21;
        phase = clspeckle::Phase(context, p);
        auto a = clspeckle::make<ClspApertureDesc>();
        a.width = width;
        a.height = height;
        a.normalization = CLSP_NORMALIZATION_UNIT_MEAN;
        a.f_number = 8;
        aperture = clspeckle::Aperture(context, a);
        auto s = clspeckle::make<ClspSensorDesc>();
        s.width = width;
        s.height = height;
        s.seed = 22;
        s.exposure_gain_dn = 400;
        s.read_noise_dn = 2;
        sensor = clspeckle::Sensor(context, s);
        auto d = clspeckle::make<ClspDotsDesc>();
        d.width = width;
        d.height = height;
        d.positions_px = positions.data();
        d.count = positions.size() / 2;
        d.sigma_px = 1.8;
        dots = clspeckle::Dots(context, d);
    }
    ClspPipelineDesc desc() const {
        auto desc = clspeckle::make<ClspPipelineDesc>();
        desc.phase = phase;
        desc.aperture = aperture;
        desc.sensor = sensor;
        desc.dots = dots;
        desc.seed = 23;
        return desc;
    }
    struct Handle {
        ClspPipeline pipeline = nullptr;
        ~Handle() { clspPipelineRelease(pipeline); }
    };
    // A frame drawn anew, three of the same scene at rest, another one drawn anew.
    std::vector<std::vector<std::uint16_t>> frames(ClspPipeline pipeline) {
        std::vector<std::vector<std::uint16_t>> result;
        EXPECT_CLSP_OK(clspSensorResetLag(sensor));
        for (std::uint64_t index = 0; index < 5; ++index) {
            auto frame = clspeckle::make<ClspFrame>();
            frame.frame_index = index;
            frame.refresh = index % 4 == 0 ? CLSP_REFRESH_ALL : CLSP_REFRESH_MASK;
            frame.output = codes.view;
            EXPECT_CLSP_OK(clspPipelineEnqueueFrame(pipeline, queue, &frame, 0, nullptr, nullptr));
            result.push_back(download<std::uint16_t>(codes));
        }
        return result;
    }
};

TEST(EffectCatalogue, ListsWhatTheProtocolFixes) {
    const std::vector<ClspEffectInfo> all = catalogue();
    std::set<std::string> seen;
    for (const ClspEffectInfo &effect : all) {
        EXPECT_TRUE(seen.insert(effect.id).second) << effect.id << " twice";
        expect_whole(effect.id);
        expect_whole(effect.stage);
        expect_whole(effect.summary);
        expect_whole(effect.kernel);
        for (std::uint32_t i = 0; i < effect.parameter_count; ++i) {
            const ClspEffectParameter &p = effect.parameters[i];
            expect_whole(p.name);
            expect_whole(p.unit);
            EXPECT_LT(p.minimum, p.maximum) << effect.id;
            for (double value : {p.weak, p.strong}) {
                EXPECT_LE(p.minimum, value) << effect.id;
                EXPECT_GE(p.maximum, value) << effect.id;
            }
        }
    }
    for (const auto &[id, expected] : fixed_effects) {
        const auto effect =
            std::find_if(all.begin(), all.end(), [id = id](const ClspEffectInfo &e) { return id == e.id; });
        ASSERT_NE(all.end(), effect) << id;
        EXPECT_EQ(expected.first, effect->stage) << id;
        std::vector<std::string> names;
        for (std::uint32_t i = 0; i < effect->parameter_count; ++i)
            names.push_back(effect->parameters[i].name);
        EXPECT_EQ(expected.second, names) << id;
    }
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "count", clspEffectGetCount(nullptr));
    ClspEffectInfo info;
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "info", clspEffectGetInfo(0, nullptr));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "index", clspEffectGetInfo(10000, &info));
}

TEST(EffectCatalogue, ScenesAreThoseOfTheRecords) {
    std::uint32_t acts = 0, shows = 0;
    EXPECT_CLSP_OK(clspEffectGetScenes("vignetting", &acts, &shows));
    EXPECT_EQ(1u << CLSP_SCENE_FLAT | 1u << CLSP_SCENE_BOARD | 1u << CLSP_SCENE_DOTS, acts);
    EXPECT_EQ(acts, shows);
    EXPECT_CLSP_OK(clspEffectGetScenes("lens_distortion", &acts, nullptr));
    EXPECT_EQ(1u << CLSP_SCENE_DOTS, acts);
    EXPECT_CLSP_OK(clspEffectGetScenes("lens_distortion", nullptr, nullptr));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "there is no effect", clspEffectGetScenes("smear", &acts, &shows));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "id", clspEffectGetScenes(nullptr, &acts, &shows));
}

TEST(EffectCatalogue, TraitsAreWhatTheRecordsSet) {
    auto traits = clspeckle::make<ClspCameraTraits>();
    traits.bits = 12;
    traits.polarization_count = 1;
    const auto change = [&](const char *id, std::vector<double> values) {
        return clspEffectChangeTraits(id, values.data(), static_cast<std::uint32_t>(values.size()), &traits);
    };
    EXPECT_EQ(CLSP_SUCCESS, change("full_well", {900.0}));
    EXPECT_EQ(CLSP_SUCCESS, change("gamma", {0.8}));
    EXPECT_EQ(CLSP_SUCCESS, change("nonlinearity", {0.05}));
    EXPECT_EQ(CLSP_SUCCESS, change("adc_bits", {9.0}));
    EXPECT_EQ(CLSP_SUCCESS, change("ambient_light", {25.0}));
    EXPECT_EQ(CLSP_SUCCESS, change("depolarization", {0.3}));
    EXPECT_EQ(CLSP_SUCCESS, change("pixel_integration", {0.7}));
    EXPECT_EQ(CLSP_SUCCESS, change("wavelength_shift", {3.0})); // nothing of it is a trait
    EXPECT_EQ(900.0, traits.saturation_dn);
    EXPECT_EQ(0.8, traits.gamma);
    EXPECT_EQ(0.05, traits.cubic_nonlinearity);
    EXPECT_EQ(3u, traits.nonlinearity_power);
    EXPECT_EQ(9u, traits.effective_bits);
    EXPECT_EQ(25.0, traits.ambient_dn);
    EXPECT_EQ(2u, traits.polarization_count);
    EXPECT_EQ(0.7, traits.fill_factor);
    EXPECT_EQ(12u, traits.bits);

    // A caller of the first release knows no members behind ambient_dn.
    ClspCameraTraits first = traits;
    first.struct_size = offsetof(ClspCameraTraits, nonlinearity_power);
    first.nonlinearity_power = 77;
    const double quadratic[] = {0.1, 1.0};
    EXPECT_CLSP_OK(clspEffectChangeTraits("nonlinearity", quadratic, 2, &first));
    EXPECT_EQ(0.1, first.cubic_nonlinearity);
    EXPECT_EQ(77u, first.nonlinearity_power);
    first.struct_size = sizeof first;
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "traits.nonlinearity_power is 77; it is 1, 2 or 3",
                      clspEffectChangeTraits("nonlinearity", quadratic, 2, &first));
    first.nonlinearity_power = 3;
    first.reserved_nonlinearity = 5;
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "reserved_nonlinearity",
                      clspEffectChangeTraits("nonlinearity", quadratic, 2, &first));

    const ClspCameraTraits before = traits;
    const double bits = 14.0, exponent = 20.0, none = 1.0;
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "the sensor has 12",
                      clspEffectChangeTraits("adc_bits", &bits, 1, &traits));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "there is no effect",
                      clspEffectChangeTraits("smear", &none, 1, &traits));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "gamma", clspEffectChangeTraits("gamma", &exponent, 1, &traits));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "traits is NULL",
                      clspEffectChangeTraits("gamma", nullptr, 0, nullptr));
    EXPECT_EQ(0, std::memcmp(&before, &traits, sizeof traits));
    traits.bits = 17;
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "traits.bits is 17",
                      clspEffectChangeTraits("gamma", nullptr, 0, &traits));
    traits.bits = before.bits;
    traits.polarization_count = 3;
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "traits.polarization_count is 3",
                      clspEffectChangeTraits("gamma", nullptr, 0, &traits));
    traits.polarization_count = before.polarization_count;
    traits.struct_size = 4;
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_STRUCT_SIZE, "struct_size",
                      clspEffectChangeTraits("gamma", nullptr, 0, &traits));
    test::check_init("clspCameraTraitsInit", clspCameraTraitsInit);
}

TEST_F(Effects, EachChangesTheFramesAndClearingRestoresThem) {
    Handle plain;
    const ClspPipelineDesc d = desc();
    ASSERT_CLSP_OK(clspPipelineCreate(context, &d, &plain.pipeline));
    const auto before = frames(plain.pipeline);
    for (const ClspEffectInfo &effect : catalogue()) {
        SCOPED_TRACE(effect.id);
        std::vector<double> strong;
        for (std::uint32_t i = 0; i < effect.parameter_count; ++i)
            strong.push_back(effect.parameters[i].strong);
        ASSERT_CLSP_OK(clspPipelineSetEffect(plain.pipeline, effect.id, strong.data(), effect.parameter_count));
        const auto with = frames(plain.pipeline);
        EXPECT_EQ(with, frames(plain.pipeline)) << "the same frames twice";
        // What disturbs a scene at rest leaves frames drawn anew alone, and the other way round.
        const std::set<std::string> resting = {"surface_boiling", "airflow", "vibration"};
        if (resting.count(effect.id)) {
            EXPECT_EQ(before[0], with[0]);
            EXPECT_NE(before[2], with[2]);
            EXPECT_EQ(before[4], with[4]);
        } else if (effect.id == std::string("image_lag")) {
            // Nothing came before the first frame, and what came before the next three was the same.
            for (int index : {0, 1, 2, 3})
                EXPECT_EQ(before[index], with[index]);
            EXPECT_NE(before[4], with[4]);
        } else {
            EXPECT_NE(before[0], with[0]);
        }
        ASSERT_CLSP_OK(clspPipelineClearEffect(plain.pipeline, effect.id));
        EXPECT_EQ(before, frames(plain.pipeline)) << "after clearing";
    }
}

TEST_F(Effects, TheOrderOfTheCallsDoesNotMatter) {
    Handle one, two;
    const ClspPipelineDesc d = desc();
    ASSERT_CLSP_OK(clspPipelineCreate(context, &d, &one.pipeline));
    for (const char *id : {"defocus", "crosstalk", "zero_order", "linewidth"})
        ASSERT_CLSP_OK(clspPipelineSetEffect(one.pipeline, id, nullptr, 0));
    const auto expected = frames(one.pipeline);
    ASSERT_CLSP_OK(clspPipelineClearEffect(one.pipeline, nullptr));
    for (const char *id : {"linewidth", "zero_order", "crosstalk", "defocus"})
        ASSERT_CLSP_OK(clspPipelineSetEffect(one.pipeline, id, nullptr, 0));
    EXPECT_EQ(expected, frames(one.pipeline));
    // Taking one out of four leaves the other three.
    ASSERT_CLSP_OK(clspPipelineClearEffect(one.pipeline, "crosstalk"));
    const auto three = frames(one.pipeline);
    EXPECT_NE(expected, three);
    ASSERT_CLSP_OK(clspPipelineClearEffect(one.pipeline, nullptr));
    for (const char *id : {"defocus", "zero_order", "linewidth"})
        ASSERT_CLSP_OK(clspPipelineSetEffect(one.pipeline, id, nullptr, 0));
    EXPECT_EQ(three, frames(one.pipeline));
}

TEST_F(Effects, ValuesLeftOutAreTheMiddle) {
    Handle one;
    const ClspPipelineDesc d = desc();
    ASSERT_CLSP_OK(clspPipelineCreate(context, &d, &one.pipeline));
    ASSERT_CLSP_OK(clspPipelineSetEffect(one.pipeline, "glare", nullptr, 0));
    const auto expected = frames(one.pipeline);
    const double values[] = {0.125, 6.0};
    ASSERT_CLSP_OK(clspPipelineSetEffect(one.pipeline, "glare", values, 1));
    EXPECT_EQ(expected, frames(one.pipeline));
    ASSERT_CLSP_OK(clspPipelineSetEffect(one.pipeline, "glare", values, 2));
    EXPECT_EQ(expected, frames(one.pipeline));
}

TEST_F(Effects, WhatTheHostSetMeanwhileStays) {
    Handle one;
    const ClspPipelineDesc d = desc();
    ASSERT_CLSP_OK(clspPipelineCreate(context, &d, &one.pipeline));
    ASSERT_CLSP_OK(clspSensorSetExposureGain(sensor, 100));
    const auto expected = frames(one.pipeline);
    ASSERT_CLSP_OK(clspSensorSetExposureGain(sensor, 400));
    ASSERT_CLSP_OK(clspPipelineSetEffect(one.pipeline, "row_noise", nullptr, 0));
    ASSERT_CLSP_OK(clspSensorSetExposureGain(sensor, 100));
    ASSERT_CLSP_OK(clspPipelineClearEffect(one.pipeline, nullptr));
    EXPECT_EQ(expected, frames(one.pipeline));
}

TEST_F(Effects, AmbientLightIsALevelAtTheExposureOfTheCall) {
    Handle one;
    const ClspPipelineDesc d = desc();
    ASSERT_CLSP_OK(clspPipelineCreate(context, &d, &one.pipeline));
    const double level = 30;
    ASSERT_CLSP_OK(clspSensorSetExposureGain(sensor, 100));
    ASSERT_CLSP_OK(clspPipelineSetEffect(one.pipeline, "ambient_light", &level, 1));
    const auto expected = frames(one.pipeline);
    ASSERT_CLSP_OK(clspPipelineClearEffect(one.pipeline, nullptr));
    ASSERT_CLSP_OK(clspSensorSetExposureGain(sensor, 400));
    ASSERT_CLSP_OK(clspPipelineSetEffect(one.pipeline, "ambient_light", &level, 1));
    ASSERT_CLSP_OK(clspSensorSetExposureGain(sensor, 100));
    EXPECT_NE(expected, frames(one.pipeline)) << "light that is there is exposed like all light";
    ASSERT_CLSP_OK(clspPipelineSetEffect(one.pipeline, "ambient_light", &level, 1));
    EXPECT_EQ(expected, frames(one.pipeline)) << "set again";
    ASSERT_CLSP_OK(clspSensorSetExposureGain(sensor, 0));
    ASSERT_CLSP_OK(clspPipelineClearEffect(one.pipeline, "ambient_light"));
}

TEST_F(Effects, SeveralAtOnceAreThoseOfSeveralCalls) {
    Handle one, other;
    const ClspPipelineDesc d = desc();
    ASSERT_CLSP_OK(clspPipelineCreate(context, &d, &one.pipeline));
    ASSERT_CLSP_OK(clspPipelineSetEffect(one.pipeline, "vignetting", nullptr, 0));
    const auto before = frames(one.pipeline);
    const double glare[] = {0.2, 5.0}, wide = 0.1;
    ClspEffectSetting settings[] = {{"glare", glare, 1, 0}, {"crosstalk", nullptr, 0, 0}, {"defocus", &wide, 1, 0}};
    // One that is refused, and none is on; the last is refused by the stage, when others are made already.
    const auto fails = [&](const char *message, ClspStatus status = CLSP_ERROR_INVALID_ARGUMENT) {
        EXPECT_CLSP_FAILS(status, message, clspPipelineSetEffects(one.pipeline, 3, settings));
        EXPECT_EQ(before, frames(one.pipeline)) << message;
    };
    settings[2].id = "defocusing";
    fails("there is no effect \"defocusing\"");
    settings[2].id = nullptr;
    fails("effects[2].id is NULL");
    settings[2].id = "glare";
    fails("effects[2].id is glare, which stands before it already; give each effect once");
    settings[2].id = "aperture_mismatch";
    fails("oversampling");
    settings[2].id = "defocus";
    settings[1].count = 1;
    fails("values is NULL, but count is 1");
    settings[1].count = 0;
    settings[1].reserved = 7;
    fails("effects[1].reserved");
    settings[1].reserved = 0;
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "effects is NULL",
                      clspPipelineSetEffects(one.pipeline, 3, nullptr));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "pipeline", clspPipelineSetEffects(nullptr, 3, settings));
    ASSERT_CLSP_OK(clspPipelineSetEffects(one.pipeline, 0, nullptr));
    EXPECT_EQ(before, frames(one.pipeline));

    ASSERT_CLSP_OK(clspPipelineSetEffects(one.pipeline, 3, settings));
    const auto together = frames(one.pipeline);
    EXPECT_NE(before, together);
    ASSERT_CLSP_OK(clspPipelineClearEffect(one.pipeline, nullptr));
    for (const ClspEffectSetting &setting : settings)
        ASSERT_CLSP_OK(clspPipelineSetEffect(one.pipeline, setting.id, setting.values, setting.count));
    ASSERT_CLSP_OK(clspPipelineSetEffect(one.pipeline, "vignetting", nullptr, 0));
    EXPECT_EQ(together, frames(one.pipeline));
}

class RestoredField : public Effects {
  protected:
    // A phase of the caller's own field: a wave, another one in the second polarization.
    clspeckle::Phase with_field(std::uint32_t polarizations, bool translate = false) {
        auto p = clspeckle::make<ClspPhaseDesc>();
        p.width = width;
        p.height = height;
        p.polarization_count = polarizations;
        p.translate = translate;
        clspeckle::Phase made(context, p);
        made.enqueue_refresh(queue, 3);
        const clspeckle::Buffer state(context, made.state_size());
        made.enqueue_save(queue, state);
        auto values = state.read<float>(queue, made.state_size() / sizeof(float));
        const std::size_t samples = values.size() / (2 * polarizations + (translate ? 2 : 0));
        for (std::size_t i = 0; i < 2 * polarizations * samples; ++i)
            values[i] = static_cast<float>(std::cos(0.1 * static_cast<double>(i % (2 * samples)) +
                                                    static_cast<double>(i / (2 * samples))));
        state.write(queue, values);
        made.enqueue_restore(queue, state);
        queue.finish();
        return made;
    }
    // A saved state that is restored.
    void put_back(const clspeckle::Phase &of) {
        const clspeckle::Buffer state(context, of.state_size());
        of.enqueue_save(queue, state);
        of.enqueue_restore(queue, state);
        queue.finish();
    }
    clspeckle::Pipeline camera(const clspeckle::Phase &of) {
        auto a = clspeckle::make<ClspApertureDesc>();
        a.width = width;
        a.height = height;
        const clspeckle::Aperture own(context, a);
        auto d = desc();
        d.phase = of;
        d.aperture = own;
        return {context, d};
    }
    std::vector<std::uint16_t> still(const clspeckle::Pipeline &pipeline) {
        auto frame = clspeckle::make<ClspFrame>();
        frame.output = codes.view;
        pipeline.enqueue_frame(queue, frame);
        return download<std::uint16_t>(codes);
    }
};

TEST_F(RestoredField, StaysOrTheEffectIsRefused) {
    const clspeckle::Phase one = with_field(1);
    const clspeckle::Pipeline pipeline = camera(one);
    const auto before = still(pipeline);
    const auto refused = [&] {
        EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT,
                          "make the phase with polarization_count 2 and restore a field of so",
                          clspPipelineSetEffect(pipeline, "depolarization", nullptr, 0));
        const ClspEffectSetting several[] = {{"defocus", nullptr, 0, 0}, {"depolarization", nullptr, 0, 0}};
        EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT,
                          "2 polarizations are needed, and the phase holds a field that was restored, of 1",
                          clspPipelineSetEffects(pipeline, 2, several));
        EXPECT_EQ(before, still(pipeline));
    };
    refused();
    put_back(one);
    refused();
    // The rendering of another frame puts the state back, and what it is.
    auto other = clspeckle::make<ClspFrame>();
    other.output = codes.view;
    other.refresh = CLSP_REFRESH_ALL;
    pipeline.warm_up(queue, other);
    refused();
    // A random one is drawn again.
    one.enqueue_refresh(queue, 0);
    pipeline.set_effect("depolarization");
    EXPECT_EQ(one.state_size(), with_field(2).state_size());
    EXPECT_NE(before, still(pipeline));
}

TEST_F(RestoredField, OfTwoPolarizationsKeepsThemWithAnEffectAndWithout) {
    const clspeckle::Phase first = with_field(1);
    const auto without = still(camera(first));
    const clspeckle::Phase both = with_field(2);
    const clspeckle::Pipeline with = camera(both);
    with.set_effect("depolarization");
    const auto expected = still(with);
    EXPECT_NE(without, expected);

    for (const bool translate : {false, true}) {
        SCOPED_TRACE(translate);
        auto p = clspeckle::make<ClspPhaseDesc>();
        p.width = width;
        p.height = height;
        p.polarization_count = 1;
        p.translate = translate;
        const clspeckle::Phase single(context, p);
        const clspeckle::Pipeline pipeline = camera(single);
        const std::uint64_t size = single.state_size();
        pipeline.set_effect("depolarization");
        EXPECT_LT(size, single.state_size());
        {
            const clspeckle::Phase source = with_field(2, translate);
            ASSERT_EQ(source.state_size(), single.state_size());
            const clspeckle::Buffer state(context, single.state_size());
            source.enqueue_save(queue, state);
            single.enqueue_restore(queue, state);
            queue.finish();
        }
        EXPECT_EQ(expected, still(pipeline));
        put_back(single);
        pipeline.clear_effects();
        EXPECT_EQ(size, single.state_size());
        EXPECT_EQ(without, still(pipeline)) << "the first polarization";
        pipeline.set_effect("depolarization");
        EXPECT_EQ(expected, still(pipeline)) << "nothing has changed meanwhile";
        pipeline.clear_effects();
        put_back(single); // what is restored now has one
        EXPECT_EQ(without, still(pipeline));
        EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "of 1",
                          clspPipelineSetEffect(pipeline, "depolarization", nullptr, 0));
        EXPECT_EQ(without, still(pipeline));
        const clspeckle::Buffer state(context, size);
        single.enqueue_save(queue, state);
        const clspeckle::Phase again = with_field(1, translate);
        again.enqueue_restore(queue, state);
        queue.finish();
        EXPECT_EQ(without, still(camera(again)));
    }
}

TEST_F(Effects, WhatIsOffTakesNoMemory) {
    Handle one;
    const ClspPipelineDesc d = desc();
    ASSERT_CLSP_OK(clspPipelineCreate(context, &d, &one.pipeline));
    const auto use = [&] {
        ClspContextInfo info{};
        info.struct_size = sizeof info;
        EXPECT_CLSP_OK(clspContextGetInfo(context, &info));
        return info.allocated_bytes;
    };
    const std::uint64_t before = use();
    for (const ClspEffectInfo &effect : catalogue()) {
        SCOPED_TRACE(effect.id);
        ASSERT_CLSP_OK(clspPipelineSetEffect(one.pipeline, effect.id, nullptr, 0));
        ASSERT_CLSP_OK(clspPipelineClearEffect(one.pipeline, effect.id));
        EXPECT_EQ(use(), before);
    }
}

TEST_F(Effects, RefusesBadArgumentsAndChangesNothing) {
    Handle one;
    const ClspPipelineDesc d = desc();
    ASSERT_CLSP_OK(clspPipelineCreate(context, &d, &one.pipeline));
    ASSERT_CLSP_OK(clspPipelineSetEffect(one.pipeline, "crosstalk", nullptr, 0));
    const auto before = frames(one.pipeline);
    const double good = 0.1, bad = -1, nan = test::nan_value, three[] = {1, 1, 1};
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "pipeline", clspPipelineSetEffect(nullptr, "glare", nullptr, 0));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "id", clspPipelineSetEffect(one.pipeline, nullptr, nullptr, 0));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "defocus",
                      clspPipelineSetEffect(one.pipeline, "defocusing", nullptr, 0));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "fraction", clspPipelineSetEffect(one.pipeline, "glare", &bad, 1));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "fraction", clspPipelineSetEffect(one.pipeline, "glare", &nan, 1));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "2 parameters",
                      clspPipelineSetEffect(one.pipeline, "glare", three, 3));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "values", clspPipelineSetEffect(one.pipeline, "glare", nullptr, 1));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "defocusing", clspPipelineClearEffect(one.pipeline, "defocusing"));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "effect", clspPipelineClearEffect(one.pipeline, ""));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "pipeline", clspPipelineClearEffect(nullptr, nullptr));
    // In range, but not for this camera: the well is full below the noise, or the diameter beyond the grid.
    const double wide = 0.1;
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "oversampling",
                      clspPipelineSetEffect(one.pipeline, "aperture_mismatch", &wide, 1));
    EXPECT_EQ(before, frames(one.pipeline));

    // Effects of stages that the pipeline has not.
    auto bare = desc();
    bare.dots = nullptr;
    bare.sensor = nullptr;
    Handle without;
    ASSERT_CLSP_OK(clspPipelineCreate(context, &bare, &without.pipeline));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "dots",
                      clspPipelineSetEffect(without.pipeline, "zero_order", nullptr, 0));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "sensor",
                      clspPipelineSetEffect(without.pipeline, "prnu", &good, 1));
}

} // namespace

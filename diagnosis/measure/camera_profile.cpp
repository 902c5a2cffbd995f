#include "measure/camera_profile.hpp"

#include "capture/json_file.hpp"
#include "effects/effects.hpp"
#include "measure/verdict.hpp"
#include "runtime/hash.hpp"
#include "simulator/sequence_model.hpp"

#include <algorithm>

namespace clsp {
namespace {

// Speckle patterns over which a sequence's gain is averaged: each draws another share of the light.
constexpr std::uint64_t kGainPatterns = 16;

ProfileEffect profile_effect(const EffectSetting &setting, const DiagnosisResult &result) {
    ProfileEffect effect;
    effect.id = setting.id;
    effect.named = std::count(result.effects.begin(), result.effects.end(), setting.id) > 0;
    effect.conditional = is_conditional(setting.id, result.rungs);
    const auto candidate = std::find_if(result.candidates.begin(), result.candidates.end(),
                                        [&](const Candidate &c) { return c.id == setting.id; });
    for (std::size_t p = 0; p < setting.values.size(); ++p) {
        ProfileParameter parameter{candidate->parameters[p].name, setting.values[p], {}};
        for (const FittedParameter &fitted : result.parameters)
            if (fitted.effect == setting.id && fitted.name == parameter.name) {
                parameter.value = fitted.value;
                parameter.interval = {fitted.low, fitted.high};
            }
        effect.parameters.push_back(std::move(parameter));
    }
    return effect;
}

// As the simulator samples the widest pupil of the capture.
void set_sampling(const Capture &given, const EffectSettings &catalogue, CameraProfile &profile) {
    CaptureLayout layout = given.layout;
    SequenceLayout board;
    board.scene = CaptureScene::kBoard;
    board.f_number = layout.f_number;
    for (const SequenceLayout &sequence : layout.sequences)
        if (is_laser(sequence.scene) && sequence.f_number > 0.0)
            board.f_number = std::min(board.f_number, sequence.f_number);
    layout.sequences = {board};
    const ApertureParameters aperture = sequence_model(layout, {}, 0, catalogue).model.aperture;
    profile.oversampling = aperture.oversampling;
    PipelineModel changed;
    for (const EffectSetting &setting : catalogue)
        if (const Effect &effect = find_effect(setting.id); effect.sets == kSetsAperture)
            effect.apply(changed, setting.values.data());
    // What an effect sets, the profile has as that effect.
    profile.fill_factor = changed.aperture.fill_factor > 0.0 ? 0.0 : aperture.fill_factor;
}

std::optional<ProfileMap> profile_map(std::optional<PatternMap> &map, const char *name, FixedPattern pattern) {
    if (!map)
        return {};
    ProfileMap result;
    result.file = std::string("camera.") + name + ".npy"; // until it is written
    for (const Effect &effect : effect_catalogue())
        if (effect.fixed_pattern == pattern)
            result.holds.push_back(effect.id);
    result.sequences = std::move(map->sequences);
    result.frame_count = map->frame_count;
    result.standard_error = map->standard_error;
    result.pixel_part = map->pixel_part;
    result.row_part = map->row_part;
    result.column_part = map->column_part;
    result.hash = hash_of(map->values);
    result.values = std::make_shared<const std::vector<float>>(std::move(map->values));
    return result;
}

} // namespace

std::uint64_t hash_of(const std::vector<float> &values) {
    return fnv1a(reinterpret_cast<const std::uint8_t *>(values.data()), values.size() * sizeof(float));
}

bool CameraProfile::is_held(const std::string &effect, unsigned maps) const {
    const auto holds = [&](const std::optional<ProfileMap> &map) {
        return map && std::count(map->holds.begin(), map->holds.end(), effect) > 0;
    };
    return ((maps & kDarkMap) && holds(dark_map)) || ((maps & kGainMap) && holds(gain_map));
}

CameraProfile camera_profile(ReplicateRunner &runner, const Capture &given, const DiagnosisResult &result,
                             const EffectSettings &effects, const CalibratedLevels &levels, PatternMaps maps) {
    const CaptureLayout &layout = given.layout;
    CameraProfile profile;
    profile.width = layout.width;
    profile.height = layout.height;
    profile.bits = layout.bits;
    profile.pixel_pitch_m = rounded(layout.pixel_pitch_m);
    profile.f_number = layout.f_number;
    profile.wavelength_m = rounded(layout.wavelength_m);
    profile.degree_of_polarization = layout.degree_of_polarization;
    profile.field = layout.field;
    profile.principal_point_px = layout.principal_point_px;
    profile.black_level_dn = levels.black_level_dn;
    profile.read_noise_dn = levels.read_noise_dn;
    EffectSettings catalogue;
    for (const EffectSetting &setting : effects) {
        const bool known = in_catalogue(setting.id);
        (known ? profile.effects : profile.hypotheses).push_back(profile_effect(setting, result));
        if (known)
            catalogue.push_back(setting);
    }
    set_sampling(given, catalogue, profile);
    profile.dark_map = profile_map(maps.dark, "dark", FixedPattern::kOffset);
    profile.gain_map = profile_map(maps.gain, "gain", FixedPattern::kGain);
    profile.map_notes = std::move(maps.notes);

    const CalibrationResult &calibration =
        result.calibration_after.light.empty() ? result.calibration : result.calibration_after;
    for (std::size_t s = 0; s < calibration.light.size(); ++s) {
        const SequenceLight &light = calibration.light[s];
        const SequenceLayout &from = runner.layout().sequences[s];
        ProfileSequence sequence{from.name,        from.scene,    from.moving,    from.f_number,
                                 from.exposure_ms, light.mean_dn, light.light_dn, 0.0};
        if (!(sequence.f_number > 0.0))
            sequence.f_number = layout.f_number;
        if (from.scene != CaptureScene::kDark) {
            double units = 0.0; // of the ideal image, for each DN
            for (std::uint64_t i = 0; i < kGainPatterns; ++i)
                units += 1.0 / runner.levels(levels, effects, s, seed_of_draws(result.seed) + i, 1).gain_dn;
            sequence.gain_dn = kGainPatterns / units;
        }
        profile.sequences.push_back(std::move(sequence));
    }
    for (const LabLight &light : result.illumination.lights)
        profile.lights.push_back(
            {light.name, light.sequences, !light.light.coefficients.empty(), light.slope, light.corner_loss});
    for (const LampDrift &drift : result.illumination.drifts)
        profile.lamp_drifts.push_back({drift.sequence, drift.deviation});
    profile.lens_or_light = result.illumination.lens_or_light;

    profile.capture = given.name;
    profile.version = CLSP_PROJECT_VERSION;
    profile.verdict = result.verdict;
    profile.equivalent = result.equivalent;
    profile.residual_detected = result.residual_detected;
    profile.level = result.level;
    profile.seed = result.seed;
    return profile;
}

} // namespace clsp

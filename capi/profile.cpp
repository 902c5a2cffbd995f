#include "clspeckle/profile.h"

#include "capture/json_file.hpp"
#include "effects/effects.hpp"
#include "files.hpp"
#include "lists.hpp"
#include "profile_handle.hpp"
#include "report/profile_files.hpp"
#include "report/profile_json.hpp"
#include "status.hpp"
#include "structs.hpp"
#include "texts.hpp"

#include <algorithm>
#include <limits>
#include <utility>

using namespace clsp;
using namespace clsp::capi;

namespace {

const ProfileSequence &find_sequence(const CameraProfile &profile, const std::string &name) {
    std::string names;
    for (const ProfileSequence &sequence : profile.sequences) {
        if (sequence.name == name)
            return sequence;
        names += (names.empty() ? "" : ", ") + sequence.name;
    }
    throw Error(Status::kInvalidArgument,
                fmt::format("the profile has no sequence \"{}\"; name one of {}", name, names));
}

// Changes a description of any release.
template <typename Desc, typename Change> std::pair<Desc, Desc *> changed(Desc *user, const char *name, Change change) {
    if (!user)
        return {Desc{}, nullptr};
    Desc desc = read_struct(user, Desc{}, name);
    change(desc);
    return {desc, user};
}

template <typename Desc> void put(const std::pair<Desc, Desc *> &desc, const char *name) {
    if (desc.second)
        write_struct(*desc.second, desc.first, name);
}

// Effects were found on one camera, in its pixels and codes.
void check_camera(const PipelineModel &model, const CameraProfile &profile) {
    const auto refuse = [](const char *what, auto pipeline, auto profiles) {
        throw Error(
            Status::kInvalidArgument,
            fmt::format("the profile is of another camera: {} is {} of the pipeline, {} of the profile; make the "
                        "pipeline's stages of the profile, or diagnose a capture of this camera",
                        what, pipeline, profiles));
    };
    if (!model.sensor)
        throw Error(Status::kInvalidArgument,
                    "the pipeline has no sensor, which a profile's effects belong to; make it with one");
    const auto check = [&](const char *what, auto pipeline, auto profiles) {
        if (rounded(pipeline) != rounded(profiles)) // lengths may have been given in other units
            refuse(what, pipeline, profiles);
    };
    check("width", model.sensor->width, profile.width);
    check("height", model.sensor->height, profile.height);
    check("bits", model.sensor->bits, profile.bits);
    if (model.aperture.relative_diameter == 0.0) {
        check("pixel_pitch_m", model.aperture.pixel_pitch_m, profile.pixel_pitch_m);
        check("wavelength_m", model.aperture.wavelength_m, profile.wavelength_m);
    }
}

void set_profile(ClspPipeline pipeline, ClspProfile profile, unsigned maps) {
    const auto target = object(pipeline);
    const auto p = object(profile);
    const PipelineModel model = target->model();
    check_camera(model, *p);
    maps &= p->maps();
    Pipeline::PixelMaps pixels;
    const auto take = [&](ProfileMapKind kind, const std::optional<ProfileMap> &map, std::vector<float> &to) {
        if (!(maps & kind))
            return;
        to = *map_values(*p, kind);
        pixels.holds.insert(pixels.holds.end(), map->holds.begin(), map->holds.end());
    };
    take(kDarkMap, p->dark_map, pixels.dark_frame_dn);
    take(kGainMap, p->gain_map, pixels.gain_map);
    Pipeline::Effects effects;
    for (const ProfileEffect &effect : p->effects) {
        if ((!model.dots && (find_effect(effect.id).sets & kSetsDots)) || p->is_held(effect.id, maps))
            continue;
        std::vector<double> &values = effects[effect.id];
        for (const ProfileParameter &parameter : effect.parameters)
            values.push_back(parameter.value);
    }
    target->set_camera(effects, std::move(pixels));
}

} // namespace

extern "C" {

CLSP_API ClspStatus clspProfileOpen(const char *path, ClspProfile *profile) {
    return guarded("clspProfileOpen", [&] {
        required(profile, "profile");
        give(profile, std::make_shared<const CameraProfile>(read_profile(&required(path, "path"))));
    });
}

CLSP_REFERENCES(Profile)

CLSP_API ClspStatus clspProfileGetInfo(ClspProfile profile, ClspProfileInfo *info) {
    return guarded("clspProfileGetInfo", [&] {
        const auto p = object(profile);
        ClspProfileInfo result{};
        result.width = p->width;
        result.height = p->height;
        result.bits = p->bits;
        result.field = static_cast<std::uint32_t>(p->field);
        result.oversampling = p->oversampling;
        result.effect_count = count_of(p->effects.size());
        result.hypothesis_count = count_of(p->hypotheses.size());
        result.sequence_count = count_of(p->sequences.size());
        result.verdict = static_cast<std::uint32_t>(p->verdict);
        result.residual_detected = p->residual_detected ? 1 : 0;
        result.seed = p->seed;
        result.pixel_pitch_m = p->pixel_pitch_m;
        result.f_number = p->f_number;
        result.wavelength_m = p->wavelength_m;
        result.degree_of_polarization = p->degree_of_polarization;
        result.principal_point_x_px = p->principal_point_px[0];
        result.principal_point_y_px = p->principal_point_px[1];
        result.black_level_dn = p->black_level_dn;
        result.read_noise_dn = p->read_noise_dn;
        result.fill_factor = p->fill_factor;
        result.level = p->level;
        copy_text(result.version, p->version);
        copy_text(result.capture, p->capture);
        result.maps = p->maps();
        write_struct(required(info, "info"), result, "info");
    });
}

CLSP_API ClspStatus clspProfileGetEffect(ClspProfile profile, uint32_t index, ClspProfileEffect *effect) {
    return guarded("clspProfileGetEffect", [&] {
        const auto p = object(profile);
        const ProfileEffect &from = item(p->effects, index, "effects");
        ClspProfileEffect result{};
        copy_text(result.id, from.id);
        result.named = from.named ? 1 : 0;
        result.conditional = from.conditional ? 1 : 0;
        result.parameter_count = count_of(from.parameters.size());
        for (std::size_t i = 0; i < from.parameters.size(); ++i) {
            constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
            const auto &interval = from.parameters[i].interval;
            result.values[i] = from.parameters[i].value;
            result.low[i] = interval ? (*interval)[0] : kNone;
            result.high[i] = interval ? (*interval)[1] : kNone;
        }
        write_struct(required(effect, "effect"), result, "effect");
    });
}

CLSP_API ClspStatus clspProfileGetSequence(ClspProfile profile, uint32_t index, ClspProfileSequence *sequence) {
    return guarded("clspProfileGetSequence", [&] {
        const auto p = object(profile);
        const ProfileSequence &from = item(p->sequences, index, "sequences");
        ClspProfileSequence result{};
        result.scene = static_cast<std::uint32_t>(from.scene);
        result.moving = from.moving ? 1 : 0;
        result.f_number = from.f_number;
        result.exposure_ms = from.exposure_ms.value_or(0.0);
        result.mean_dn = from.mean_dn;
        result.light_dn = from.light_dn;
        result.gain_dn = from.gain_dn;
        copy_text(result.name, from.name);
        write_struct(required(sequence, "sequence"), result, "sequence");
    });
}

CLSP_API ClspStatus clspProfileGetJson(ClspProfile profile, uint64_t capacity, char *text, uint64_t *length) {
    return guarded("clspProfileGetJson",
                   [&] { give_text(profile_json(*object(profile)), capacity, text, length, "text"); });
}

CLSP_API ClspStatus clspProfileWrite(ClspProfile profile, const char *path) {
    return guarded("clspProfileWrite", [&] {
        const auto p = object(profile);
        write_profile(*p, file_to_write(&required(path, "path")));
    });
}

CLSP_API ClspStatus clspProfileGetMap(ClspProfile profile, uint32_t map, ClspProfileMap *info, float *values) {
    return guarded("clspProfileGetMap", [&] {
        const auto p = object(profile);
        if ((map != kDarkMap && map != kGainMap) || !(p->maps() & map))
            throw Error(Status::kInvalidArgument,
                        fmt::format("map is {}; the profile has {}", map,
                                    p->maps() == 0          ? "none"
                                    : p->maps() == kDarkMap ? "CLSP_PROFILE_MAP_DARK, 1"
                                    : p->maps() == kGainMap
                                        ? "CLSP_PROFILE_MAP_GAIN, 2"
                                        : "CLSP_PROFILE_MAP_DARK, 1, and CLSP_PROFILE_MAP_GAIN, 2"));
        const auto kind = static_cast<ProfileMapKind>(map);
        const ProfileMap &of = kind == kDarkMap ? *p->dark_map : *p->gain_map;
        if (values) {
            const auto from = map_values(*p, kind);
            std::copy(from->begin(), from->end(), values);
        }
        if (!info)
            return;
        ClspProfileMap result{};
        result.map = map;
        result.frame_count = of.frame_count;
        result.standard_error = of.standard_error;
        copy_text(result.path, p->path.empty() ? "" : map_path(*p, kind));
        write_struct(*info, result, "info");
    });
}

CLSP_API ClspStatus clspProfileDescribe(ClspProfile profile, const char *sequence, ClspPhaseDesc *phase,
                                        ClspApertureDesc *aperture, ClspLensDesc *lens, ClspSensorDesc *sensor) {
    return guarded("clspProfileDescribe", [&] {
        const auto p = object(profile);
        const ProfileSequence *of = sequence ? &find_sequence(*p, sequence) : nullptr;
        const auto sized = [&](auto &desc) {
            desc.width = p->width;
            desc.height = p->height;
        };
        const auto of_phase = changed(phase, "phase", [&](ClspPhaseDesc &d) {
            sized(d);
            d.oversampling = p->oversampling;
            d.field = static_cast<std::uint32_t>(p->field);
            d.polarization_count = p->degree_of_polarization < 1.0 ? 2 : 1;
        });
        const auto of_aperture = changed(aperture, "aperture", [&](ClspApertureDesc &d) {
            sized(d);
            d.oversampling = p->oversampling;
            d.normalization = CLSP_NORMALIZATION_UNIT_MEAN;
            d.relative_diameter = 0.0;
            d.f_number = of ? of->f_number : p->f_number;
            d.pixel_pitch_m = p->pixel_pitch_m;
            d.wavelength_m = p->wavelength_m;
            d.degree_of_polarization = p->degree_of_polarization;
            d.fill_factor = p->fill_factor;
        });
        const auto of_lens = changed(lens, "lens", [&](ClspLensDesc &d) {
            sized(d);
            d.principal_point_given = 1;
            d.principal_point_x_px = p->principal_point_px[0];
            d.principal_point_y_px = p->principal_point_px[1];
        });
        const auto of_sensor = changed(sensor, "sensor", [&](ClspSensorDesc &d) {
            sized(d);
            d.bits = p->bits;
            d.black_level_dn = p->black_level_dn;
            d.read_noise_dn = p->read_noise_dn;
            if (of && of->scene != CaptureScene::kDark)
                d.exposure_gain_dn = of->gain_dn;
            if (of && of->exposure_ms)
                d.exposure_time_s = 1e-3 * *of->exposure_ms;
        });
        put(of_phase, "phase");
        put(of_aperture, "aperture");
        put(of_lens, "lens");
        put(of_sensor, "sensor");
    });
}

CLSP_API ClspStatus clspPipelineSetProfile(ClspPipeline pipeline, ClspProfile profile) {
    return guarded("clspPipelineSetProfile", [&] { set_profile(pipeline, profile, kDarkMap | kGainMap); });
}

CLSP_API ClspStatus clspPipelineSetProfileMaps(ClspPipeline pipeline, ClspProfile profile, uint32_t maps) {
    return guarded("clspPipelineSetProfileMaps", [&] {
        if (maps & ~(kDarkMap | kGainMap))
            throw Error(Status::kInvalidArgument,
                        fmt::format("maps is {}, it must be a sum of CLSP_PROFILE_MAP_DARK, 1, and "
                                    "CLSP_PROFILE_MAP_GAIN, 2",
                                    maps));
        set_profile(pipeline, profile, maps);
    });
}

} // extern "C"

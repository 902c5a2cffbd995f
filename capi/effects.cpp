#include "clspeckle/effects.h"

#include "effects/effects.hpp"
#include "effects/pipeline_model.hpp"
#include "fields.hpp"
#include "handles.hpp"
#include "pipeline/pipeline.hpp"
#include "status.hpp"
#include "texts.hpp"

#include <fmt/core.h>
#include <utility>

using namespace clsp;
using namespace clsp::capi;

namespace {

// Of a model with a sensor whose gain is 1: light is in DN.
constexpr auto kTraits = [](auto field, auto &c, auto &m) {
    field(c.bits, m.sensor->bits);
    field(c.effective_bits, m.sensor->effective_bits);
    field(c.polarization_count, m.phase.polarization_count);
    field(c.fill_factor, m.aperture.fill_factor);
    field(c.saturation_dn, m.sensor->saturation_dn);
    field(c.gamma, m.sensor->gamma);
    field(c.cubic_nonlinearity, m.sensor->cubic_nonlinearity);
    field(c.nonlinearity_power, m.sensor->nonlinearity_power);
    field(c.ambient_dn, m.lens.ambient);
};

PipelineModel any_camera() {
    PipelineModel model;
    model.dots.emplace();
    model.sensor.emplace().exposure_gain_dn = 1.0;
    return model;
}

} // namespace

extern "C" {

CLSP_INIT(CameraTraits, traits, to_c<ClspCameraTraits>(kTraits, any_camera()))

CLSP_API ClspStatus clspEffectChangeTraits(const char *id, const double *values, uint32_t count,
                                           ClspCameraTraits *traits) {
    return guarded("clspEffectChangeTraits", [&] {
        const Effect &effect = find_effect(&required(id, "id"));
        PipelineModel model = any_camera();
        const ClspCameraTraits given = read_struct(traits, to_c<ClspCameraTraits>(kTraits, model), "traits");
        kTraits(FieldFromC{}, given, model);
        check_reserved(given.reserved_nonlinearity, "traits->reserved_nonlinearity");
        if (given.bits < 1 || given.bits > 16)
            throw Error(Status::kInvalidArgument, fmt::format("traits.bits is {}; a sensor has 1 to 16", given.bits));
        if (given.polarization_count < 1 || given.polarization_count > 2)
            throw Error(
                Status::kInvalidArgument,
                fmt::format("traits.polarization_count is {}; a phase has 1 or 2", given.polarization_count));
        if (given.nonlinearity_power < 1 || given.nonlinearity_power > 3)
            throw Error(Status::kInvalidArgument,
                        fmt::format("traits.nonlinearity_power is {}; it is 1, 2 or 3", given.nonlinearity_power));
        effect.apply(model, check_effect_values(effect, values, count).data());
        write_struct(*traits, to_c<ClspCameraTraits>(kTraits, model), "traits");
    });
}

CLSP_API ClspStatus clspEffectGetScenes(const char *id, uint32_t *acts, uint32_t *shows) {
    return guarded("clspEffectGetScenes", [&] {
        const Effect &effect = find_effect(&required(id, "id"));
        for (const auto &[to, from] : {std::pair{acts, effect.acts.scenes}, std::pair{shows, effect.shows.scenes}})
            if (to)
                *to = from;
    });
}

CLSP_API ClspStatus clspEffectGetCount(uint32_t *count) {
    return guarded("clspEffectGetCount", [&] {
        required(count, "count");
        *count = static_cast<std::uint32_t>(effect_catalogue().size());
    });
}

CLSP_API ClspStatus clspEffectGetInfo(uint32_t index, ClspEffectInfo *info) {
    return guarded("clspEffectGetInfo", [&] {
        required(info, "info");
        const std::vector<Effect> &catalogue = effect_catalogue();
        if (index >= catalogue.size())
            throw Error(Status::kInvalidArgument,
                        fmt::format("index is {}, there are {} effects (numbered from 0)", index, catalogue.size()));
        const Effect &effect = catalogue[index];
        ClspEffectInfo result{}; // tests/core/effects checks that no text is cut
        copy_text(result.id, effect.id);
        copy_text(result.stage, effect.stage);
        copy_text(result.summary, effect.summary);
        copy_text(result.kernel, effect.kernel);
        result.parameter_count = static_cast<std::uint32_t>(effect.parameters.size());
        for (std::size_t i = 0; i < effect.parameters.size() && i < CLSP_MAX_EFFECT_PARAMETERS; ++i) {
            const EffectParameter &from = effect.parameters[i];
            ClspEffectParameter &to = result.parameters[i];
            copy_text(to.name, from.name);
            copy_text(to.unit, from.unit);
            to.minimum = from.minimum;
            to.maximum = from.maximum;
            to.weak = from.weak;
            to.strong = from.strong;
            result.whole_parameters |= (from.whole ? 1u : 0u) << i;
        }
        *info = result;
    });
}

CLSP_API ClspStatus clspPipelineSetEffect(ClspPipeline pipeline, const char *id, const double *values, uint32_t count) {
    return guarded("clspPipelineSetEffect",
                   [&] { object(pipeline)->set_effect(&required(id, "id"), values, count); });
}

CLSP_API ClspStatus clspPipelineSetEffects(ClspPipeline pipeline, uint32_t count, const ClspEffectSetting *effects) {
    return guarded("clspPipelineSetEffects", [&] {
        const auto p = object(pipeline);
        if (count > 0)
            required(effects, "effects");
        Pipeline::Effects wanted;
        for (std::uint32_t i = 0; i < count; ++i) {
            const ClspEffectSetting &one = effects[i];
            const std::string name = fmt::format("effects[{}]", i);
            check_reserved(one.reserved, (name + ".reserved").c_str());
            const Effect &effect = find_effect(&required(one.id, (name + ".id").c_str()));
            if (!wanted.emplace(effect.id, check_effect_values(effect, one.values, one.count)).second)
                throw Error(Status::kInvalidArgument,
                            fmt::format("{}.id is {}, which stands before it already; give each effect once", name,
                                        effect.id));
        }
        if (count > 0)
            p->set_effects(wanted);
    });
}

CLSP_API ClspStatus clspPipelineClearEffect(ClspPipeline pipeline, const char *id) {
    return guarded("clspPipelineClearEffect", [&] {
        const auto p = object(pipeline);
        if (id)
            p->clear_effect(id);
        else
            p->clear_effects();
    });
}

} // extern "C"

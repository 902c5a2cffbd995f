#include "capture/applicability.hpp"

#include "capture/capture_check.hpp"

#include <algorithm>
#include <fmt/format.h>

namespace clsp {
namespace {

unsigned scene_bit(CaptureScene scene) {
    return 1u << static_cast<std::uint32_t>(scene);
}

// "a dots sequence", "a board or dots sequence in motion of at least 2 frames".
std::string needed(const EffectScenes &rule) {
    std::string scenes;
    for (const CaptureScene scene :
         {CaptureScene::kDark, CaptureScene::kFlat, CaptureScene::kBoard, CaptureScene::kDots})
        if (rule.scenes & scene_bit(scene))
            scenes += fmt::format("{}{}", scenes.empty() ? "" : " or ", scene_name(scene));
    const char *motion = rule.motion == SceneMotion::kMoving   ? "moving "
                         : rule.motion == SceneMotion::kStatic ? "static "
                                                               : "";
    return fmt::format("{} {}{} sequence{}{}", rule.exposures > 1 ? std::to_string(rule.exposures) : "a", motion,
                       scenes, rule.exposures > 1 ? "s of different exposure_ms" : "",
                       rule.frames > 1 ? fmt::format(" of at least {} frames", rule.frames) : "");
}

// Whatever its number of frames.
bool holds_for(const EffectScenes &where, const SequenceLayout &s) {
    // Motion is a matter of laser light: dark and flat are as good as static.
    const bool motion =
        where.motion == SceneMotion::kAny || !is_laser(s.scene) || s.moving == (where.motion == SceneMotion::kMoving);
    return (where.scenes & scene_bit(s.scene)) && motion;
}

} // namespace

bool acts_in(const Effect &effect, const SequenceLayout &sequence) {
    return holds_for(effect.acts, sequence);
}

bool acts_in(const Effect &effect, const SequenceLayout &sequence, FieldKind field, bool shaped_light) {
    if (effect.gaussian_only && field != FieldKind::kCircularGaussian)
        return false;
    return acts_in(effect, sequence) || (shaped_light && (effect.acts_shaped & scene_bit(sequence.scene)));
}

std::vector<EffectVisibility> effect_visibilities(const CaptureLayout &layout) {
    std::vector<EffectVisibility> result;
    for (const Effect &effect : effect_catalogue()) {
        EffectVisibility visibility{effect.id, effect.stage, {}, effect.symptom, {}};
        const EffectScenes &rule = effect.shows;
        bool short_one = false;
        std::size_t exposures = 1;
        for (const SequenceLayout &s : layout.sequences) {
            if (!holds_for(rule, s))
                continue;
            if (s.frame_count < rule.frames)
                short_one = true;
            else
                visibility.sequences.push_back(s.name);
            exposures = std::max(exposures, exposure_count(layout, s.scene));
        }
        if (exposures < rule.exposures)
            visibility.sequences.clear();
        if (visibility.sequences.empty())
            visibility.reason =
                fmt::format("needs {}{}", needed(rule), short_one ? "; there is one, but it has fewer frames" : "");
        result.push_back(std::move(visibility));
    }
    return result;
}

} // namespace clsp

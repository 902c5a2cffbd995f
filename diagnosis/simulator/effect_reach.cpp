#include "simulator/effect_reach.hpp"

#include "effects/effects.hpp"
#include "runtime/error.hpp"

#include <algorithm>
#include <fmt/core.h>
#include <initializer_list>
#include <string_view>

namespace clsp {
namespace {

bool is_one_of(const std::string &id, std::initializer_list<std::string_view> list) {
    return std::find(list.begin(), list.end(), id) != list.end();
}

} // namespace

EffectPart effect_part(const std::string &id) {
    if (is_one_of(id, {"power_flicker", "vignetting", "ambient_light"}))
        return EffectPart::kLight;
    return find_effect(id).sets == kSetsSensor ? EffectPart::kSensor : EffectPart::kOptics;
}

bool effect_reaches(const std::string &id, const SequenceLayout &sequence, FieldKind field, bool shaped_light) {
    const bool dark = sequence.scene == CaptureScene::kDark, flat = sequence.scene == CaptureScene::kFlat;
    const bool speckle = !dark && !flat; // laser light
    const bool dots = sequence.scene == CaptureScene::kDots;
    // What gives an offset or noise without any light, and what happens to codes.
    if (is_one_of(id, {"dsnu", "column_fpn", "hot_pixels", "row_noise", "adc_bits"}))
        return true;
    // What spreads or displaces light leaves a uniform image uniform (a surface ends nowhere near the image's border).
    if (is_one_of(id, {"lens_distortion", "subsurface_scattering"}))
        return dots || (shaped_light && !dark && (speckle || id == "lens_distortion"));
    if (id == "glare")
        return speckle || (shaped_light && flat);
    if (is_one_of(id,
                  {"wavelength_shift", "beam_skew", "beam_flat_top", "zero_order", "ghost_dots", "scatter_background"}))
        return dots;
    // A surface of unit phasors keeps its values or gets new ones; nothing in between is defined.
    if (id == "motion_decorrelation")
        return speckle && sequence.moving && field == FieldKind::kCircularGaussian;
    if (id == "surface_boiling")
        return speckle && !sequence.moving && field == FieldKind::kCircularGaussian;
    if (is_one_of(id, {"airflow", "vibration"}))
        return speckle && !sequence.moving;
    // The surface's field, the pupil and a pixel's area show in speckle alone.
    if (is_one_of(id, {"linewidth", "power_flicker", "depolarization", "low_roughness", "defocus", "aperture_mismatch",
                       "pupil_obstruction", "pixel_integration"}))
        return speckle;
    // The rest works on the signal, which the dark has not.
    static_cast<void>(find_effect(id));
    return !dark;
}

} // namespace clsp

// In which sequences each effect of the catalogue can show, from its physics.
#include "capture/capture_check.hpp"
#include "effects/effects.hpp"

#include <algorithm>
#include <fmt/format.h>
#include <map>

namespace clsp {
namespace {

enum : unsigned { kInDark = 1, kInFlat = 2, kInBoard = 4, kInDots = 8 };
constexpr unsigned kInSpeckle = kInBoard | kInDots;
constexpr unsigned kInLight = kInFlat | kInSpeckle;
constexpr unsigned kInAll = kInDark | kInLight;
enum class Moves { kAny, kStatic, kMoving };

struct Rule {
    unsigned scenes;
    Moves moves;
    std::uint32_t frames; // least number
    const char *symptom;
};

const std::map<std::string, Rule> &rules() {
    static const auto *table = new std::map<std::string, Rule>{
        {"linewidth", {kInSpeckle, Moves::kAny, 1, "speckle contrast falls, the size of the grain stays"}},
        {"power_flicker", {kInSpeckle, Moves::kAny, 2, "all laser light rises and falls together from frame to frame"}},
        {"wavelength_shift", {kInDots, Moves::kAny, 1, "dots move radially, in proportion to the radius"}},
        {"beam_skew", {kInDots, Moves::kAny, 1, "dots are lopsided"}},
        {"beam_flat_top", {kInDots, Moves::kAny, 1, "dots have flat tops and steep flanks"}},
        {"zero_order", {kInDots, Moves::kAny, 1, "a bright dot on the optical axis"}},
        {"ghost_dots", {kInDots, Moves::kAny, 1, "faint dots between the dots"}},
        {"scatter_background", {kInDots, Moves::kAny, 1, "even, speckled light between the dots"}},
        {"depolarization",
         {kInSpeckle, Moves::kAny, 1, "contrast falls towards 0.71, and the intensity law changes with it"}},
        {"low_roughness",
         {kInSpeckle, Moves::kAny, 1, "light that keeps its phase lowers the contrast and turns the law into Rice's"}},
        {"subsurface_scattering", {kInDots, Moves::kAny, 1, "dots have exponential tails; even light stays even"}},
        {"motion_decorrelation",
         {kInSpeckle, Moves::kMoving, 1, "contrast falls while the surface moves, and only then"}},
        {"surface_boiling",
         {kInSpeckle, Moves::kStatic, 2, "the speckle of a resting surface changes, everywhere on its own"}},
        {"airflow", {kInSpeckle, Moves::kStatic, 2, "the speckle of a resting surface shivers, in patches"}},
        {"vibration", {kInSpeckle, Moves::kStatic, 2, "the speckle of a resting surface shifts as a whole"}},
        {"defocus",
         {kInDots, Moves::kAny, 1, "dots widen, the grain stays; on an even board the grain's law does not change"}},
        {"vignetting", {kInLight, Moves::kAny, 1, "light falls off towards the corners"}},
        {"aperture_mismatch", {kInSpeckle, Moves::kAny, 1, "the grain has another size than the f-number says"}},
        {"pupil_obstruction", {kInSpeckle, Moves::kAny, 1, "the grain is finer, with rings in its autocorrelation"}},
        {"glare", {kInSpeckle, Moves::kAny, 1, "light between the dots, and less contrast on a board"}},
        {"ambient_light",
         {kInSpeckle, Moves::kAny, 1, "even light without speckle: less contrast, a floor between the dots"}},
        {"lens_distortion", {kInDots, Moves::kAny, 1, "dots move radially, as the cube of the radius"}},
        {"pixel_integration", {kInSpeckle, Moves::kAny, 1, "less contrast, and neighbouring pixels alike"}},
        {"crosstalk", {kInSpeckle, Moves::kAny, 1, "neighbouring pixels alike, in dots and grain"}},
        {"shot_noise", {kInLight, Moves::kStatic, 2, "temporal variance grows in proportion to the light"}},
        // Grain hides the patterns of pixels; between dots there is none.
        {"prnu", {kInFlat, Moves::kAny, 2, "a pattern that grows with the light and stays in the pixels"}},
        {"dsnu", {kInDark | kInFlat | kInDots, Moves::kAny, 2, "a pattern of offsets that stays in the pixels"}},
        {"column_fpn", {kInDark | kInFlat, Moves::kAny, 1, "stripes along the columns that stay"}},
        {"hot_pixels",
         {kInDark | kInFlat | kInDots, Moves::kAny, 1, "few pixels far above the others, also in the dark"}},
        {"row_noise", {kInAll, Moves::kStatic, 2, "stripes along the rows, others in each frame"}},
        {"gamma", {kInLight, Moves::kAny, 1, "the law of speckle bends; of even light only its noise and patterns do"}},
        {"full_well", {kInLight, Moves::kAny, 1, "bright speckle and dots pile up at a level below the top code"}},
        {"adc_bits", {kInAll, Moves::kAny, 1, "codes are missing: only multiples of a power of two occur"}},
        {"bayer_mismatch", {kInLight, Moves::kAny, 1, "the sites of the 2 x 2 mosaic differ"}},
        {"image_lag", {kInSpeckle, Moves::kMoving, 2, "the frame before shows through"}},
    };
    return *table;
}

unsigned scene_bit(CaptureScene scene) {
    return 1u << static_cast<std::uint32_t>(scene);
}

// "a dots sequence", "a board or dots sequence in motion of at least 2 frames".
std::string needed(const Rule &rule) {
    std::string scenes;
    for (const CaptureScene scene :
         {CaptureScene::kDark, CaptureScene::kFlat, CaptureScene::kBoard, CaptureScene::kDots})
        if (rule.scenes & scene_bit(scene))
            scenes += fmt::format("{}{}", scenes.empty() ? "" : " or ", scene_name(scene));
    const char *motion = rule.moves == Moves::kMoving ? "moving " : rule.moves == Moves::kStatic ? "static " : "";
    return fmt::format("a {}{} sequence{}", motion, scenes,
                       rule.frames > 1 ? fmt::format(" of at least {} frames", rule.frames) : "");
}

} // namespace

std::vector<EffectVisibility> effect_visibilities(const CaptureLayout &layout) {
    std::vector<EffectVisibility> result;
    for (const Effect &effect : effect_catalogue()) {
        EffectVisibility visibility{effect.id, effect.stage, {}, effect.summary, {}};
        const auto found = rules().find(effect.id);
        // An effect that this table does not know may show wherever there is light.
        const Rule rule = found == rules().end() ? Rule{kInLight, Moves::kAny, 1, effect.summary} : found->second;
        visibility.symptom = rule.symptom;
        bool short_one = false;
        for (const SequenceLayout &s : layout.sequences) {
            const bool speckle = is_laser(s.scene);
            // Motion is a matter of laser light: dark and flat are as good as static.
            const bool motion = rule.moves == Moves::kAny || s.moving == (rule.moves == Moves::kMoving) || !speckle;
            if (!(rule.scenes & scene_bit(s.scene)) || !motion)
                continue;
            if (s.frame_count < rule.frames)
                short_one = true;
            else
                visibility.sequences.push_back(s.name);
        }
        if (visibility.sequences.empty())
            visibility.reason =
                fmt::format("needs {}{}", needed(rule), short_one ? "; there is one, but it has fewer frames" : "");
        result.push_back(std::move(visibility));
    }
    return result;
}

} // namespace clsp

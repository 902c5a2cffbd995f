// The catalogue of effects that make a camera's picture differ from the ideal one. One effect is one record: its id,
// its parameters with units and ranges, its kernel, what it sets in the model, and all that a diagnosis asks of it.
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

namespace clsp {

struct PipelineModel;

struct EffectParameter {
    const char *name;
    const char *unit;
    double minimum, maximum; // what is accepted
    double weak, strong;     // what real cameras show, from barely visible to strong
    bool whole = false;      // counts or numbers something: only whole numbers differ
};

// Which parts of the model an effect sets.
enum : unsigned {
    kSetsPipeline = 1,
    kSetsPhase = 2,
    kSetsAperture = 4,
    kSetsLens = 8,
    kSetsDots = 16,
    kSetsSensor = 32,
};

// Scenes of a capture, as bits: 1 << CaptureScene.
enum : unsigned {
    kInDark = 1,
    kInFlat = 2,
    kInBoard = 4,
    kInDots = 8,
    kInSpeckle = kInBoard | kInDots,
    kInLight = kInFlat | kInSpeckle,
    kInAll = kInDark | kInLight,
};
enum class SceneMotion { kAny, kStatic, kMoving };

// Which sequences of a capture something holds for.
struct EffectScenes {
    unsigned scenes;
    SceneMotion motion = SceneMotion::kAny;
    std::uint32_t frames = 1;    // least number
    std::uint32_t exposures = 1; // least number of exposure times of one scene
};

// What simulating it takes, beside a frame without it.
struct EffectCost {
    unsigned patterns;        // so many speckle patterns in the place of one
    unsigned filters = 0;     // convolutions of a frame
    bool every_frame = false; // a pattern of a resting scene does not serve all its frames
};

// Values of a numbered or periodic parameter from which a search begins, too: what one of them changes says nothing of
// another.
struct EffectForms {
    const char *parameter;
    std::vector<double> values;
    bool told_by_fit; // screening does not tell the forms apart
};

// A parameter that no search finds, and the quantities of a capture that are it and its standard error, or nullptr
// where it is exact.
struct MeasuredParameter {
    const char *parameter, *quantity, *error;
};

// What an effect's definition leaves open, so that captures by another simulator may have it otherwise. A fit tolerates
// the difference.
enum class OpenReading {
    kNone,
    kFrameBefore, // whether the frame before holds what had remained in it, and whether a first frame had one before it
    kPhotonLaw,   // Poisson's law, or a Gaussian one of the same variance
    kWhatMoves,   // the picture with its dots, or the dots alone
};

// What a pixel has by the effect in every frame alike, so that a map of the pixels holds it: an offset or a relative
// gain.
enum class FixedPattern { kNone, kOffset, kGain };

// What it takes to put an effect into finished frames, beside each frame itself.
enum class FinishedNeed {
    kNothing,
    kSharedPicture, // what the frames of a sequence have in common
    kSecondPattern, // an independent pattern of the same scene
};

// An effect that a capture may not tell from this one, and the capture that would.
struct ConfusableEffect {
    const char *id, *capture;
};

struct Effect {
    const char *id;
    const char *stage; // laser, doe, surface, motion, optics or sensor
    const char *summary;
    const char *kernel; // file and function that carry it out
    unsigned sets;
    std::vector<EffectParameter> parameters;
    void (*apply)(PipelineModel &model, const double *values);
    EffectScenes acts;      // where it changes codes, whatever its parameters; none elsewhere
    EffectScenes shows;     // where statistics can tell it
    const char *symptom;    // what of a capture shows it, in words
    const char *unfinished; // why it cannot be put into any finished frames; "" if it can
    EffectCost cost;

    // What few effects have.
    bool whole_image = false;   // a factor or offset of the whole intensity image
    bool gaussian_only = false; // a field of unit phasors has nothing in between that it could be
    unsigned acts_shaped = 0;   // scenes where it acts only if a hypothesis makes the ideal image uneven
    bool even = false;          // no statistic shows its first parameter's sign: it is looked for from 0 on
    OpenReading open_reading = OpenReading::kNone;
    FixedPattern fixed_pattern = FixedPattern::kNone;
    FinishedNeed finished_need = FinishedNeed::kNothing;
    bool dims_corners = false; // as light that falls unevenly may
    std::vector<EffectForms> forms = {};
    std::vector<MeasuredParameter> measured_parameters = {};
    std::vector<ConfusableEffect> confusable_effects = {};

    Effect scales_light() const { return with(&Effect::whole_image, true); }
    Effect needs_gaussian_field() const { return with(&Effect::gaussian_only, true); }
    Effect also_acts_where_light_is_shaped(unsigned scenes) const { return with(&Effect::acts_shaped, scenes); }
    Effect is_fixed(FixedPattern pattern) const { return with(&Effect::fixed_pattern, pattern); }
    Effect needs_of_finished_frames(FinishedNeed need) const { return with(&Effect::finished_need, need); }
    Effect dims_the_corners() const { return with(&Effect::dims_corners, true); }
    Effect is_even() const { return with(&Effect::even, true); }
    Effect leaves_open(OpenReading reading) const { return with(&Effect::open_reading, reading); }
    Effect with_forms(const char *parameter, std::vector<double> values, bool told_by_fit = false) const {
        return with(&Effect::forms, {{parameter, std::move(values), told_by_fit}});
    }
    Effect measured_by(const char *parameter, const char *quantity, const char *error) const {
        Effect result = *this;
        result.measured_parameters.push_back({parameter, quantity, error});
        return result;
    }
    Effect told_from(const char *other, const char *capture) const {
        Effect result = *this;
        result.confusable_effects.push_back({other, capture});
        return result;
    }

    template <typename T> Effect with(T Effect::*member, T value) const {
        Effect result = *this;
        result.*member = std::move(value);
        return result;
    }
};

// In the order in which light meets them.
const std::vector<Effect> &effect_catalogue();
bool in_catalogue(const std::string &id);
// Throws kInvalidArgument, listing the ids, if there is none of that name.
const Effect &find_effect(const std::string &id);
// Values within the ranges; nullptr gives the middle between weak and strong.
std::vector<double> check_effect_values(const Effect &effect, const double *values, std::uint32_t count);

} // namespace clsp

#include "clspeckle/diagnosis.h"

#include "run/diagnose.hpp"
#include "capture/capture_validation.hpp"
#include "capture_handle.hpp"
#include "fields.hpp"
#include "files.hpp"
#include "handles.hpp"
#include "lists.hpp"
#include "pipeline/pipeline.hpp"
#include "profile_handle.hpp"
#include "progress.hpp"
#include "run/compare.hpp"
#include "report/report_html.hpp"
#include "report/report_json.hpp"
#include "simulator/opencl_hypothesis.hpp"
#include "simulator/sequence_model.hpp"
#include "status.hpp"
#include "structs.hpp"
#include "texts.hpp"

#include <algorithm>
#include <array>
#include <cstring>
#include <limits>
#include <memory>
#include <string_view>

using namespace clsp;
using namespace clsp::capi;

namespace clsp::capi {

CLSP_HANDLE(ClspDiagnosis, const DiagnosisResult, "diagnosis", kAnyThread)
CLSP_ENUM(HypothesisPoint, kCodes, CLSP_HYPOTHESIS_IRRADIANCE, CLSP_HYPOTHESIS_INTENSITY, CLSP_HYPOTHESIS_CODES)

} // namespace clsp::capi

namespace {

constexpr std::uint32_t kLeastReplicates = 12, kMostReplicates = 100000;
constexpr std::uint32_t kMostEffects = 64;
constexpr std::uint32_t kMostThreads = 1024;
constexpr double kLeastLevel = 1e-6, kMostLevel = 0.5;
constexpr std::uint32_t kMostWithout = 4096;
constexpr std::array<std::string_view, 6> kStages = {"laser", "doe", "surface", "motion", "optics", "sensor"};

ClspHypothesis hypothesis_defaults() {
    ClspHypothesis hypothesis{};
    hypothesis.struct_size = sizeof hypothesis;
    hypothesis.point = CLSP_HYPOTHESIS_INTENSITY;
    return hypothesis;
}

constexpr auto kOptionFields = [](auto field, auto &d, auto &p) {
    field(d.seed, p.seed);
    field(d.null_replicates, p.null_replicates);
    field(d.level, p.level);
    field(d.max_effects, p.max_effects);
    field(d.threads, p.threads);
    field(d.evidence, p.evidence, "desc->evidence");
};

void check_range(std::uint32_t value, std::uint32_t least, std::uint32_t most, const char *name) {
    if (value < least || value > most)
        throw Error(Status::kInvalidArgument, fmt::format("{} is {}, it must be {} to {}", name, value, least, most));
}

ClspDiagnoseDesc diagnose_defaults() {
    auto desc = to_c<ClspDiagnoseDesc>(kOptionFields, DiagnosisOptions());
    desc.frames = CLSP_FRAMES_AUTO;
    return desc;
}

PartChoice part_choice(const ClspDiagnoseDesc &d) {
    PartChoice choice;
    check_range(d.window, CLSP_WINDOW_AUTO, CLSP_WINDOW_GIVEN, "desc->window");
    choice.whole_image = d.window == CLSP_WINDOW_WHOLE;
    if (d.window == CLSP_WINDOW_GIVEN)
        choice.window = PixelWindow{d.window_x, d.window_y, d.window_width, d.window_height};
    else if ((d.window_x | d.window_y | d.window_width | d.window_height) != 0)
        throw Error(
            Status::kInvalidArgument,
            fmt::format("desc->window_x, _y, _width, _height are {}, {}, {}, {}, but desc->window is {}; set it "
                        "to CLSP_WINDOW_GIVEN, or leave them at 0",
                        d.window_x, d.window_y, d.window_width, d.window_height, d.window));
    if (d.frames != CLSP_FRAMES_AUTO)
        choice.frames = d.frames;
    return choice;
}

template <std::size_t Size> std::string fixed_text(const char (&from)[Size], const std::string &what) {
    const auto *end = static_cast<const char *>(std::memchr(from, '\0', Size));
    if (!end)
        throw Error(Status::kInvalidArgument, fmt::format("{} does not end with a 0 within its {} bytes", what, Size));
    return {from, end};
}

// Calls a hypothesis of the C interface.
void call_hypothesis(ClspHypothesisFunction function, void *user_data, const Hypothesis &hypothesis,
                     const HypothesisFrame &f) {
    const CaptureLayout &layout = *f.layout;
    const SequenceLayout &sequence = layout.sequences[f.sequence];
    ClspHypothesisFrame frame{};
    frame.struct_size = sizeof frame;
    frame.width = layout.width;
    frame.height = layout.height;
    frame.bits = layout.bits;
    frame.sequence = count_of(f.sequence);
    frame.scene = static_cast<std::uint32_t>(sequence.scene);
    frame.moving = sequence.moving ? 1 : 0;
    frame.frame_index = f.frame_index;
    frame.seed = f.seed;
    frame.parameter_count = count_of(hypothesis.parameters.size());
    frame.sequence_name = sequence.name.c_str();
    frame.values = f.values;
    frame.pixels = f.pixels;
    frame.f_number = sequence.f_number > 0.0 ? sequence.f_number : layout.f_number;
    frame.pixel_pitch_m = layout.pixel_pitch_m;
    frame.wavelength_m = layout.wavelength_m;
    if (const std::int32_t returned = function(user_data, &frame); returned != 0)
        throw Error(Status::kInvalidData, fmt::format("its function returned {}, not 0", returned));
}

Hypothesis checked_hypothesis(const ClspHypothesis *user, const std::string &where) {
    const ClspHypothesis h = read_struct(user, hypothesis_defaults(), where.c_str());
    check_reserved(h.reserved, (where + "->reserved").c_str());
    Hypothesis result;
    result.id = &required(h.id, (where + "->id").c_str());
    const bool letters = std::all_of(result.id.begin(), result.id.end(), [](unsigned char c) {
        return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' || c == '-' ||
               c == '.';
    });
    if (result.id.empty() || result.id.size() > sizeof(ClspDiagnosisRanked::effect) - 1 || !letters)
        throw Error(Status::kInvalidArgument,
                    fmt::format("{}->id is \"{}\", it must be 1 to {} letters, digits, '_', '-' and '.'", where,
                                result.id, sizeof(ClspDiagnosisRanked::effect) - 1));
    const std::string named = fmt::format("of the hypothesis \"{}\"", result.id);
    result.stage = &required(h.stage, ("the stage " + named).c_str());
    if (std::find(kStages.begin(), kStages.end(), result.stage) == kStages.end())
        throw Error(Status::kInvalidArgument,
                    fmt::format("the stage {} is \"{}\", it must be laser, doe, surface, motion, optics or sensor",
                                named, result.stage));
    if (h.summary)
        result.summary = h.summary;
    result.point = checked_enum<HypothesisPoint>(h.point, ("the point " + named).c_str());
    if (h.parameter_count < 1 || h.parameter_count > CLSP_MAX_EFFECT_PARAMETERS)
        throw Error(Status::kInvalidArgument,
                    fmt::format("parameter_count {} is {}, it must be 1 to {}: without a parameter there is nothing to "
                                "fit",
                                named, h.parameter_count, CLSP_MAX_EFFECT_PARAMETERS));
    required(h.parameters, ("the list of parameters " + named).c_str());
    for (std::uint32_t i = 0; i < h.parameter_count; ++i) {
        const ClspEffectParameter &p = h.parameters[i];
        const std::string which = fmt::format("parameters[{}] {}", i, named);
        result.parameters.push_back({fixed_text(p.name, "the name of " + which),
                                     fixed_text(p.unit, "the unit of " + which), p.minimum, p.maximum, p.weak,
                                     p.strong});
    }
    if (h.opencl_source) {
        if (h.apply)
            throw Error(Status::kInvalidArgument,
                        fmt::format("apply and opencl_source {} are both given; give one of them", named));
        result.opencl_source = h.opencl_source;
        check_opencl_hypothesis(result);
        return result;
    }
    if (!h.apply)
        throw Error(
            Status::kInvalidArgument,
            fmt::format("apply {} is NULL; give the function that changes the pixels, or opencl_source", named));
    Hypothesis description = result; // what `apply` needs of it
    result.apply = [function = h.apply, data = h.user_data, description](const HypothesisFrame &frame) {
        call_hypothesis(function, data, description, frame);
    };
    return result;
}

// All parameters: those that are not given take the middle between weak and strong.
std::vector<double> hypothesis_values(const Hypothesis &hypothesis, const double *values, std::uint32_t count) {
    if (count > hypothesis.parameters.size())
        throw Error(Status::kInvalidArgument,
                    fmt::format("count is {}, but the hypothesis \"{}\" has {} parameter{}", count, hypothesis.id,
                                hypothesis.parameters.size(), hypothesis.parameters.size() == 1 ? "" : "s"));
    std::vector<double> result;
    for (std::size_t i = 0; i < hypothesis.parameters.size(); ++i) {
        const HypothesisParameter &p = hypothesis.parameters[i];
        const double value = values && i < count ? values[i] : 0.5 * (p.weak + p.strong);
        if (!(value >= p.minimum && value <= p.maximum))
            throw Error(Status::kInvalidArgument,
                        fmt::format("{} of the hypothesis \"{}\" is {}, it must be {} to {}", p.name, hypothesis.id,
                                    value, p.minimum, p.maximum));
        result.push_back(value);
    }
    return result;
}

DiagnosisOptions diagnosis_options(const ClspDiagnoseDesc *user) {
    const ClspDiagnoseDesc d = user ? read_struct(user, diagnose_defaults(), "desc") : diagnose_defaults();
    check_range(d.null_replicates, kLeastReplicates, kMostReplicates, "desc->null_replicates");
    check_range(d.max_effects, 1, kMostEffects, "desc->max_effects");
    check_range(d.threads, 0, kMostThreads, "desc->threads");
    check_range(d.without_count, 0, kMostWithout, "desc->without_count");
    check_range(d.hypothesis_count, 0, CLSP_MAX_HYPOTHESES, "desc->hypothesis_count");
    if (!(d.level >= kLeastLevel && d.level <= kMostLevel)) // also NaN
        throw Error(Status::kInvalidArgument,
                    fmt::format("desc->level is {}, it must be {} to {}", d.level, kLeastLevel, kMostLevel));
    auto options = from_c<DiagnosisOptions>(kOptionFields, d);
    check_reserved(d.reserved, "desc->reserved");
    options.part = part_choice(d);
    if (d.tolerance_file)
        options.tolerance_file = d.tolerance_file;
    if (d.tolerance_file && options.tolerance_file.empty())
        throw Error(Status::kInvalidArgument, "desc->tolerance_file is empty; name a file, or leave it NULL");
    if (d.without_count > 0)
        required(d.without, "desc->without");
    for (std::uint32_t i = 0; i < d.without_count; ++i)
        options.without.emplace_back(&required(d.without[i], fmt::format("desc->without[{}]", i).c_str()));
    std::sort(options.without.begin(), options.without.end()); // leaving one out twice is leaving it out
    options.without.erase(std::unique(options.without.begin(), options.without.end()), options.without.end());
    if (d.hypothesis_count > 0)
        required(d.hypotheses, "desc->hypotheses");
    for (std::uint32_t i = 0; i < d.hypothesis_count; ++i)
        options.hypotheses.push_back(checked_hypothesis(d.hypotheses[i], fmt::format("desc->hypotheses[{}]", i)));
    if (d.profile)
        options.profile = object(d.profile);
    options.progress = progress_function(d.progress, d.progress_data);
    return options;
}

// The ranking of the report: that of the first step, then what later steps added.
std::vector<RankedEffect> whole_ranking(const DiagnosisResult &result) {
    std::vector<RankedEffect> ranking = result.ranking;
    for (const RankedEffect &found : result.found)
        if (std::none_of(result.ranking.begin(), result.ranking.end(),
                         [&](const RankedEffect &other) { return other.effect == found.effect; }))
            ranking.push_back(found);
    return ranking;
}

const Candidate *find_candidate(const DiagnosisResult &result, const std::string &id) {
    const auto found = std::find_if(result.candidates.begin(), result.candidates.end(),
                                    [&](const Candidate &candidate) { return candidate.id == id; });
    return found == result.candidates.end() ? nullptr : &*found;
}

} // namespace

extern "C" {

CLSP_INIT(Hypothesis, hypothesis, hypothesis_defaults())

CLSP_API ClspStatus clspPipelineSetHypothesis(ClspPipeline pipeline, const ClspHypothesis *hypothesis,
                                              const double *values, uint32_t count) {
    return guarded("clspPipelineSetHypothesis", [&] {
        const auto p = object(pipeline);
        const Hypothesis h = checked_hypothesis(hypothesis, "hypothesis");
        if (h.opencl_source.empty())
            throw Error(
                Status::kUnsupported,
                fmt::format("the hypothesis \"{}\" has a function of the host, for which a pipeline's frames do "
                            "not wait; give opencl_source",
                            h.id));
        check_hypotheses({h});
        const std::vector<double> numbers = hypothesis_values(h, values, count);
        const auto source = std::make_shared<OpenclHypothesis>(p->context(), h);
        p->set_own_effect(h.id, static_cast<OwnEffectPoint>(h.point),
                          [source, numbers](CommandChain &chain, const cl::Buffer &before, const cl::Buffer &after,
                                            const OwnEffectFrame &frame) {
                              const std::uint32_t scene = frame.dark   ? CLSP_SCENE_DARK
                                                          : frame.dots ? CLSP_SCENE_DOTS
                                                                       : CLSP_SCENE_FLAT;
                              // The upper half of the frame's number stands where a capture has that of its sequence.
                              source->enqueue(chain, before, after,
                                              {frame.width, frame.height, frame.bits,
                                               static_cast<std::uint32_t>(frame.frame_index >> 32), scene, false,
                                               static_cast<std::uint32_t>(frame.frame_index), frame.seed,
                                               frame.f_number, frame.pixel_pitch_m, frame.wavelength_m},
                                              numbers.data());
                          });
    });
}

CLSP_INIT(DiagnoseDesc, desc, diagnose_defaults())

CLSP_API ClspStatus clspDiagnose(ClspContext context, ClspCapture capture, const ClspDiagnoseDesc *desc,
                                 ClspDiagnosis *diagnosis) {
    return guarded("clspDiagnose", [&] {
        const auto device = object(context);
        const auto real = object(capture);
        required(diagnosis, "diagnosis");
        const DiagnosisOptions options = diagnosis_options(desc);
        if (options.profile)
            throw Error(Status::kInvalidArgument,
                        "desc->profile is not NULL; a diagnosis makes a profile, it takes none: leave it at NULL");
        validate_capture(*real);
        give(diagnosis, std::make_shared<const DiagnosisResult>(diagnose(device, *real, options)));
    });
}

CLSP_API ClspStatus clspCompare(ClspContext context, ClspCapture real, ClspCapture sim, const ClspDiagnoseDesc *desc,
                                ClspDiagnosis *diagnosis) {
    return guarded("clspCompare", [&] {
        const auto device = object(context);
        const auto camera = object(real);
        const auto simulator = object(sim);
        required(diagnosis, "diagnosis");
        const DiagnosisOptions options = diagnosis_options(desc);
        if (!options.hypotheses.empty())
            throw Error(
                Status::kInvalidArgument,
                fmt::format("desc->hypothesis_count is {}, a comparison takes none: hypotheses are functions on "
                            "frames that the library's own simulator draws",
                            options.hypotheses.size()));
        if (!options.tolerance_file.empty())
            throw Error(
                Status::kInvalidArgument,
                fmt::format("desc->tolerance_file is \"{}\", a comparison takes none: its sets are brought to one "
                            "light and one noise before they are measured",
                            options.tolerance_file));
        const auto validate = [](const Capture &capture, const char *what) {
            try {
                validate_capture(capture);
            } catch (const Error &error) {
                throw Error(error.status(), fmt::format("the {} capture: {}", what, error.what()));
            }
        };
        validate(*camera, "real");
        validate(*simulator, "simulated");
        give(diagnosis, std::make_shared<const DiagnosisResult>(compare(device, *camera, *simulator, options)));
    });
}

CLSP_REFERENCES(Diagnosis)

CLSP_API ClspStatus clspDiagnosisGetSummary(ClspDiagnosis diagnosis, ClspDiagnosisSummary *summary) {
    return guarded("clspDiagnosisGetSummary", [&] {
        const auto d = object(diagnosis);
        ClspDiagnosisSummary result{};
        switch (d->verdict) {
        case Verdict::kNone:
            result.verdict = CLSP_VERDICT_NONE;
            break;
        case Verdict::kNamed:
            result.verdict = CLSP_VERDICT_NAMED;
            break;
        case Verdict::kAmbiguous:
            result.verdict = CLSP_VERDICT_AMBIGUOUS;
            break;
        case Verdict::kUnknown:
            result.verdict = CLSP_VERDICT_UNKNOWN;
            break;
        }
        result.detected = d->detected ? 1 : 0;
        result.residual_detected = d->residual_detected ? 1 : 0;
        result.held_out = d->held_out ? 1 : 0;
        result.effect_count = count_of(d->effects.size());
        result.equivalent_count = count_of(d->equivalent.size());
        result.ranked_count = count_of(whole_ranking(*d).size());
        result.parameter_count = count_of(d->parameters.size());
        result.place_count = count_of(d->places.size());
        result.step_count = count_of(d->steps.size());
        result.note_count = count_of(d->notes.size());
        result.seed = d->seed;
        result.level = d->level;
        result.p_value = d->p_value;
        result.distance = d->distance;
        result.null_95 = d->null_95;
        result.probability = d->probability;
        result.distance_before = d->distance_before;
        result.distance_after = d->distance_after;
        result.fraction = d->fraction;
        result.fraction_95[0] = d->fraction_95[0];
        result.fraction_95[1] = d->fraction_95[1];
        result.residual_p_value = d->residual_p_value;
        result.seconds = d->seconds;
        const bool calibrated = !d->calibration.light.empty();
        result.black_level_dn = calibrated ? d->calibration.black_level_dn : std::numeric_limits<double>::quiet_NaN();
        result.read_noise_dn = calibrated ? d->calibration.read_noise_dn : std::numeric_limits<double>::quiet_NaN();
        result.judged = d->no_light_judged ? 0 : 1;
        write_struct(required(summary, "summary"), result, "summary");
    });
}

CLSP_API ClspStatus clspDiagnosisGetEffect(ClspDiagnosis diagnosis, uint32_t index, uint64_t capacity, char *id,
                                           uint64_t *length) {
    return guarded("clspDiagnosisGetEffect", [&] {
        const auto d = object(diagnosis);
        give_text(item(d->effects, index, "effects"), capacity, id, length, "id");
    });
}

CLSP_API ClspStatus clspDiagnosisGetEquivalent(ClspDiagnosis diagnosis, uint32_t index, uint64_t capacity, char *id,
                                               uint64_t *length) {
    return guarded("clspDiagnosisGetEquivalent", [&] {
        const auto d = object(diagnosis);
        give_text(item(d->equivalent, index, "equivalent effects"), capacity, id, length, "id");
    });
}

CLSP_API ClspStatus clspDiagnosisGetNote(ClspDiagnosis diagnosis, uint32_t index, uint64_t capacity, char *text,
                                         uint64_t *length) {
    return guarded("clspDiagnosisGetNote", [&] {
        const auto d = object(diagnosis);
        give_text(item(d->notes, index, "notes"), capacity, text, length, "text");
    });
}

CLSP_API ClspStatus clspDiagnosisGetRanked(ClspDiagnosis diagnosis, uint32_t index, ClspDiagnosisRanked *ranked) {
    return guarded("clspDiagnosisGetRanked", [&] {
        const auto d = object(diagnosis);
        const std::vector<RankedEffect> ranking = whole_ranking(*d);
        const RankedEffect &from = item(ranking, index, "ranked effects");
        ClspDiagnosisRanked result{};
        copy_text(result.effect, from.effect);
        if (const Candidate *candidate = find_candidate(*d, from.effect))
            copy_text(result.stage, candidate->stage);
        result.parameter_count = std::min(count_of(from.values.size()), CLSP_MAX_EFFECT_PARAMETERS);
        std::copy_n(from.values.begin(), result.parameter_count, result.values);
        result.simulated = from.simulated ? 1 : 0;
        result.probability = from.probability;
        result.distance_after = from.distance_after;
        result.gain = from.gain;
        write_struct(required(ranked, "ranked"), result, "ranked");
    });
}

CLSP_API ClspStatus clspDiagnosisGetParameter(ClspDiagnosis diagnosis, uint32_t index,
                                              ClspDiagnosisParameter *parameter) {
    return guarded("clspDiagnosisGetParameter", [&] {
        const auto d = object(diagnosis);
        const FittedParameter &from = item(d->parameters, index, "fitted parameters");
        ClspDiagnosisParameter result{};
        copy_text(result.effect, from.effect);
        copy_text(result.name, from.name);
        if (const Candidate *candidate = find_candidate(*d, from.effect))
            for (const HypothesisParameter &p : candidate->parameters)
                if (p.name == from.name)
                    copy_text(result.unit, p.unit);
        result.value = from.value;
        result.low = from.low;
        result.high = from.high;
        write_struct(required(parameter, "parameter"), result, "parameter");
    });
}

CLSP_API ClspStatus clspDiagnosisGetPlace(ClspDiagnosis diagnosis, uint32_t index, ClspDiagnosisPlace *place) {
    return guarded("clspDiagnosisGetPlace", [&] {
        const auto d = object(diagnosis);
        const GapPlace &from = item(d->places, index, "statistics");
        ClspDiagnosisPlace result{};
        copy_text(result.stage, from.statistic.stage);
        copy_text(result.sequence, from.statistic.sequence);
        copy_text(result.statistic, from.statistic.name);
        copy_text(result.region, from.statistic.region);
        copy_text(result.unit, from.statistic.unit);
        result.real = from.real;
        result.sim = from.sim;
        result.z = from.z;
        result.p_adjusted = from.p_adjusted;
        result.z_after = from.z_after;
        const StatisticShrinkage &shrink = from.shrink;
        constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
        const bool has_part = shrink.held_out && shrink.beyond_chance;
        result.distance_before = shrink.held_out ? shrink.before : kNone;
        result.distance_after = shrink.held_out ? shrink.after : kNone;
        result.fraction = has_part ? shrink.fraction : kNone;
        for (std::size_t i = 0; i < 2; ++i)
            result.fraction_95[i] = has_part ? shrink.fraction_95[i] : kNone;
        write_struct(required(place, "place"), result, "place");
    });
}

CLSP_API ClspStatus clspDiagnosisGetStep(ClspDiagnosis diagnosis, uint32_t index, ClspDiagnosisStep *step) {
    return guarded("clspDiagnosisGetStep", [&] {
        const auto d = object(diagnosis);
        const ShrinkStep &from = item(d->steps, index, "steps");
        ClspDiagnosisStep result{};
        copy_text(result.effect, from.effect);
        result.distance_after = from.distance_after;
        result.fraction = from.fraction;
        write_struct(required(step, "step"), result, "step");
    });
}

CLSP_API ClspStatus clspDiagnosisGetReportJson(ClspDiagnosis diagnosis, uint64_t capacity, char *text,
                                               uint64_t *length) {
    return guarded("clspDiagnosisGetReportJson", [&] {
        const auto d = object(diagnosis);
        give_text(report_json(*d), capacity, text, length, "text");
    });
}

CLSP_API ClspStatus clspDiagnosisWriteReport(ClspDiagnosis diagnosis, const char *path) {
    return guarded("clspDiagnosisWriteReport", [&] {
        const auto d = object(diagnosis);
        write_file(&required(path, "path"), report_json(*d) + "\n");
    });
}

CLSP_API ClspStatus clspDiagnosisWriteHtml(ClspDiagnosis diagnosis, const char *path) {
    return guarded("clspDiagnosisWriteHtml", [&] {
        const auto d = object(diagnosis);
        write_file(&required(path, "path"), report_html(*d));
    });
}

CLSP_API ClspStatus clspDiagnosisGetProfile(ClspDiagnosis diagnosis, ClspProfile *profile) {
    return guarded("clspDiagnosisGetProfile", [&] {
        const auto d = object(diagnosis);
        required(profile, "profile");
        if (!d->profile)
            throw Error(Status::kInvalidState, "a comparison has no camera profile: its frames are those of another "
                                               "simulator; diagnose the real capture for one");
        give(profile, d->profile);
    });
}

} // extern "C"

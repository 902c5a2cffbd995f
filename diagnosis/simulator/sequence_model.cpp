#include "simulator/sequence_model.hpp"

#include "capture/applicability.hpp"
#include "runtime/error.hpp"
#include "simulator/opencl_hypothesis.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/core.h>
#include <set>

namespace clsp {
namespace {

const Hypothesis *find_hypothesis(const std::vector<Hypothesis> &hypotheses, const std::string &id) {
    const auto found =
        std::find_if(hypotheses.begin(), hypotheses.end(), [&](const Hypothesis &h) { return h.id == id; });
    return found == hypotheses.end() ? nullptr : &*found;
}

void check_values(const Hypothesis &hypothesis, const std::vector<double> &values) {
    if (values.size() != hypothesis.parameters.size())
        throw Error(Status::kInvalidArgument,
                    fmt::format("the hypothesis {} got {} values, it has {} parameters; give one each", hypothesis.id,
                                values.size(), hypothesis.parameters.size()));
    for (std::size_t i = 0; i < values.size(); ++i) {
        const HypothesisParameter &parameter = hypothesis.parameters[i];
        if (!(values[i] >= parameter.minimum && values[i] <= parameter.maximum))
            throw Error(Status::kInvalidArgument,
                        fmt::format("{} of the hypothesis {} is {}, it must be {} to {}{}{}", parameter.name,
                                    hypothesis.id, values[i], parameter.minimum, parameter.maximum,
                                    parameter.unit.empty() ? "" : " ", parameter.unit == "1" ? "" : parameter.unit));
    }
}

// The baseline camera's parameters.
PipelineModel baseline(const CaptureLayout &layout, const SequenceLayout &sequence) {
    PipelineModel model;
    model.phase.width = model.aperture.width = model.lens.width = layout.width;
    model.phase.height = model.aperture.height = model.lens.height = layout.height;
    model.phase.field = layout.field;
    model.phase.polarization_count = layout.degree_of_polarization < 1.0 ? 2 : 1;
    model.aperture.pupil.normalization = Normalization::kUnitMean;
    model.aperture.f_number = sequence.f_number > 0.0 ? sequence.f_number : layout.f_number;
    model.aperture.pixel_pitch_m = layout.pixel_pitch_m;
    model.aperture.wavelength_m = layout.wavelength_m;
    model.aperture.degree_of_polarization = layout.degree_of_polarization;
    model.lens.principal_point_given = true;
    model.lens.principal_point_x_px = layout.principal_point_px[0];
    model.lens.principal_point_y_px = layout.principal_point_px[1];
    if (sequence.scene == CaptureScene::kDots) {
        DotsParameters dots;
        dots.width = layout.width;
        dots.height = layout.height;
        dots.count = layout.dots->positions_px.size();
        dots.positions_px = layout.dots->positions_px.data()->data();
        dots.sigma_px = layout.dots->sigma_px;
        dots.principal_point_px = layout.principal_point_px;
        model.dots = dots;
    }
    SensorParameters sensor;
    sensor.width = layout.width;
    sensor.height = layout.height;
    sensor.bits = layout.bits;
    sensor.exposure_gain_dn = 1.0; // light is in DN until a sequence's own gain is known
    if (sequence.exposure_ms)
        sensor.exposure_time_s = 1e-3 * *sequence.exposure_ms;
    model.sensor = sensor;
    return model;
}

// The square of the farthest corner's distance from the axis, of the layout's window over that of the image.
double corner_ratio_squared(const CaptureLayout &layout) {
    CaptureLayout alone = layout;
    alone.window.reset();
    const double ratio = alone.farthest_corner_px() / layout.farthest_corner_px();
    return ratio * ratio;
}

// Pupils wider than the frequency plane of one sample a pixel: the image is sampled at points all the same, the middle
// ones of an odd number of samples, as what lies between samples is not told by an intensity whose band is wider than
// theirs. What pixels integrate has that band; up to a diameter of 0.6 what one sample folds of it changes the
// speckle's variance by less than 0.16 %.
void widen_grid(PipelineModel &model) {
    constexpr double kFolds = 0.6;
    ApertureParameters &aperture = model.aperture;
    const double diameter = aperture.pixel_pitch_m / (aperture.wavelength_m * aperture.f_number);
    const bool integrates = aperture.fill_factor > 0.0;
    if (!(diameter > (integrates ? kFolds : 1.0)))
        return;
    const double band = integrates ? 2.0 * diameter : diameter;
    // Two samples hold what pixels integrate up to a diameter of 1, and are less than half the work of three.
    const double samples = integrates && diameter <= 1.0 ? 2.0 : 2.0 * std::ceil((band - 1.0) / 2.0) + 1.0;
    if (samples > kMaxOversampling)
        throw Error(
            Status::kInvalidArgument,
            fmt::format(
                "the pupil's diameter is {} cycles per pixel (pixel pitch over wavelength times f-number {}); at "
                "most {} can be simulated, check f_number, pixel_pitch and wavelength",
                diameter, aperture.f_number, kMaxOversampling));
    model.phase.oversampling = aperture.oversampling = static_cast<std::uint32_t>(samples);
    // Both have the ideal light at the pixel's centre, which widens dots by a staircase of variance 1/16.
    if (integrates && model.dots && diameter <= 1.0) {
        const double variance = model.dots->sigma_px * model.dots->sigma_px;
        model.dots->sigma_px = std::sqrt(std::max(variance - 1.0 / 16.0, 0.25 * variance));
    }
    constexpr double kPoint = 1e-4; // of a pixel's area
    if (aperture.fill_factor == 0.0)
        aperture.fill_factor = kPoint;
}

} // namespace

void check_hypotheses(const std::vector<Hypothesis> &hypotheses) {
    std::set<std::string> ids;
    for (const Hypothesis &h : hypotheses) {
        if (h.id.empty())
            throw Error(Status::kInvalidArgument, "a hypothesis has an empty id; give it a name");
        if (in_catalogue(h.id))
            throw Error(
                Status::kInvalidArgument,
                fmt::format("the hypothesis \"{}\" has the id of an effect of the catalogue; give it another", h.id));
        if (!ids.insert(h.id).second)
            throw Error(Status::kInvalidArgument,
                        fmt::format("two hypotheses have the id \"{}\"; give each its own", h.id));
        if (h.apply && !h.opencl_source.empty())
            throw Error(Status::kInvalidArgument,
                        fmt::format("the hypothesis \"{}\" has a function and OpenCL source; give one of them", h.id));
        if (!h.apply && h.opencl_source.empty())
            throw Error(Status::kInvalidArgument,
                        fmt::format("the hypothesis \"{}\" has neither a function to apply nor OpenCL source", h.id));
        if (!h.apply)
            check_opencl_hypothesis(h);
        if (h.point > HypothesisPoint::kCodes)
            throw Error(
                Status::kInvalidArgument,
                fmt::format("the point of the hypothesis \"{}\" is {}, it must be 0 (irradiance), 1 (intensity) or 2 "
                            "(codes)",
                            h.id, static_cast<std::uint32_t>(h.point)));
        for (const HypothesisParameter &p : h.parameters) {
            const bool finite = std::isfinite(p.minimum) && std::isfinite(p.maximum) && std::isfinite(p.weak) &&
                                std::isfinite(p.strong);
            const auto within = [&](double value) { return value >= p.minimum && value <= p.maximum; };
            if (p.name.empty() || !finite || !(p.minimum < p.maximum) || !within(p.weak) || !within(p.strong))
                throw Error(
                    Status::kInvalidArgument,
                    fmt::format(
                        "parameter \"{}\" of the hypothesis \"{}\" has minimum {}, maximum {}, weak {}, strong {}; "
                        "it needs a name, a minimum below the maximum, and weak and strong within minimum and maximum, "
                        "all finite",
                        p.name, h.id, p.minimum, p.maximum, p.weak, p.strong));
        }
    }
}

SequenceModel sequence_model(const CaptureLayout &layout, const std::vector<Hypothesis> &hypotheses,
                             std::size_t sequence, const std::vector<EffectSetting> &effects) {
    const SequenceLayout &of = layout.sequences.at(sequence);
    const bool dark = of.scene == CaptureScene::kDark;
    SequenceModel result;
    std::set<std::string> ids;
    for (const EffectSetting &setting : effects) {
        if (!ids.insert(setting.id).second)
            throw Error(Status::kInvalidArgument,
                        fmt::format("the effect {} was given twice; give it once", setting.id));
        const Hypothesis *hypothesis = find_hypothesis(hypotheses, setting.id);
        if (!hypothesis)
            continue;
        check_values(*hypothesis, setting.values);
        const ActiveHypothesis active{hypothesis, setting.values.data()};
        if (hypothesis->point == HypothesisPoint::kCodes) {
            result.on_codes.push_back(active);
        } else if (!dark && hypothesis->point == HypothesisPoint::kIntensity) {
            result.on_intensity.push_back(active);
        } else if (!dark) {
            result.on_irradiance.push_back(active);
            result.optical.push_back(setting);
        }
    }
    result.model = baseline(layout, of);
    // In the catalogue's order, as a pipeline does it.
    for (const Effect &effect : effect_catalogue()) {
        const auto setting =
            std::find_if(effects.begin(), effects.end(), [&](const EffectSetting &s) { return s.id == effect.id; });
        if (setting == effects.end())
            continue;
        ids.erase(effect.id);
        const std::vector<double> values =
            check_effect_values(effect, setting->values.empty() ? nullptr : setting->values.data(),
                                static_cast<std::uint32_t>(setting->values.size()));
        if (!acts_in(effect, of, layout.field, !result.on_irradiance.empty()))
            continue;
        effect.apply(result.model, values.data());
        if (!effect.whole_image && effect.sets != kSetsSensor)
            result.optical.push_back({effect.id, values});
    }
    for (const std::string &id : ids)
        if (!find_hypothesis(hypotheses, id))
            find_effect(id); // throws, and lists the catalogue
    PipelineModel &model = result.model;
    if (layout.window) {
        // r = 1 in the image's corner; the lens has it in the window's.
        const double squared = corner_ratio_squared(layout);
        model.lens.k1 *= squared;
        model.lens.vignetting_corner_loss *= squared;
    }
    result.power_flicker = std::exchange(model.pipeline.power_flicker, 0.0);
    result.corner_loss = std::exchange(model.lens.vignetting_corner_loss, 0.0);
    result.ambient_dn = std::exchange(model.lens.ambient, 0.0);
    result.uneven = !dark && !of.illumination.coefficients.empty();
    result.drifting = !dark && !of.frame_light.empty();
    widen_grid(model);
    const PipelineParameters &p = model.pipeline;
    const bool laser = is_laser(of.scene);
    result.frames_differ = (laser && (of.moving || std::isfinite(p.boiling_correlation_frames) ||
                                      p.airflow.rms_rad > 0.0 || p.vibration_rms_px > 0.0)) ||
                           !result.on_irradiance.empty();
    return result;
}

} // namespace clsp

#include "report/explanations.hpp"

#include "report/html_page.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <fmt/core.h>

namespace clsp {
namespace {

struct Words {
    const char *name, *text;
};

// A statistic whose name begins so; the longest beginning counts.
constexpr Words kStatistics[] = {
    {"row_noise", "how much the rows' means jump from frame to frame, over what independent pixels would give"},
    {"column_noise", "how much the columns' means jump from frame to frame, over what independent pixels would give"},
    {"frame_mean_fluctuation", "how much the brightness of whole frames fluctuates"},
    {"frame_mean_drift", "slope of the brightness over the sequence, against the fluctuation of the frames"},
    {"first_frame", "brightness of the first frame, against the fluctuation of the others"},
    {"temporal_correlation_", "correlation of a pixel's fluctuations some frames apart (the number in the name)"},
    {"noise_skewness", "lopsidedness of the temporal noise"},
    {"noise_kurtosis", "tails of the temporal noise: outliers make it large"},
    {"noise_correlation_", "correlation of the temporal noise of pixels at the distance in the name"},
    {"repeated_frames", "how alike the most alike frames are; a repeated frame makes it large"},
    {"codes_multiple_of_",
     "share of codes that are multiples of this number, beyond what evenly used codes would give"},
    {"codes_multiple_of_4_plus_1",
     "share of codes that are one above a multiple of 4, beyond what evenly used codes would give"},
    {"histogram_roughness", "raggedness of the histogram of codes: missing or preferred codes"},
    {"share_above_", "share of the pixels that are brighter than about this percentage of the full scale"},
    {"bright_end", "how bright the brightest pixels are: clipping lowers it"},
    {"block_edges_", "jumps at the edges of blocks of this many pixels, as image compression leaves them"},
    {"mosaic_rows", "difference of even and odd rows"},
    {"mosaic_columns", "difference of even and odd columns"},
    {"mosaic_checker", "difference of the two diagonals of the 2 x 2 mosaic"},
    {"gradient_x", "brightness gradient from left to right"},
    {"gradient_y", "brightness gradient from top to bottom"},
    {"radial_falloff", "brightness of the corners against the middle"},
    {"region_mean", "brightness of a region against the whole image"},
    {"temporal_variance", "temporal variance of the pixels"},
    {"temporal_variance_linear", "part of the temporal variance that grows with the signal, as shot noise does"},
    {"temporal_variance_square",
     "part of the temporal variance that grows with the square of the signal, as flicker and changing speckle do"},
    {"temporal_variance_gradient", "part of the temporal variance at steep edges, as an image that shakes has it"},
    {"image_shift_", "movement of the image from frame to frame along this axis"},
    {"image_turn", "rotation of the image from frame to frame"},
    {"image_breathing", "change of the image's scale from frame to frame"},
    {"fixed_pattern", "differences between pixels that stay in all frames, over the temporal noise"},
    {"fixed_pattern_columns", "share of whole columns in the fixed pattern"},
    {"fixed_pattern_rows", "share of whole rows in the fixed pattern"},
    {"fixed_pattern_blocks", "share of slow variations in the fixed pattern"},
    {"fixed_pattern_skewness", "lopsidedness of the fixed pattern, without pixels far out"},
    {"fixed_pattern_kurtosis", "tails of the fixed pattern, without pixels far out"},
    {"fixed_pattern_correlation_", "correlation of neighbouring pixels in the fixed pattern"},
    {"fixed_pattern_lines", "sharp peaks in the spectrum of the fixed pattern: a periodic pattern"},
    {"fixed_pattern_wave",
     "how far a wave stands out in the spectrum of the fixed pattern: 0 by chance, 4 once in 30,000"},
    {"signal_by_exposure",
     "brightness of a flat whose light goes as its exposure time: a bent response changes it from flat to flat"},
    {"dark_level", "level of a dark sequence against that of all, in read noise: dark current raises it"},
    {"hot_pixels_", "number of pixels that stick out brightly, by so many standard deviations"},
    {"cold_pixels_", "number of pixels that stick out darkly, by so many standard deviations"},
    {"contrast", "speckle contrast: standard deviation over mean of the light, sensor noise taken out; 1 for fully "
                 "developed speckle"},
    {"intensity_skewness", "lopsidedness of the law of brightness"},
    {"intensity_kurtosis", "tails of the law of brightness"},
    {"intensity_below_", "share of the pixels darker than about this percentage of the mean"},
    {"speckle_correlation_",
     "correlation of the brightness of pixels at this distance: size and shape of the speckle grains"},
    {"speckle_lopsided_", "asymmetry of the correlation along this axis, as a trail to one side leaves it"},
    {"speckle_binned_skewness", "lopsidedness of the brightness after averaging over several grains"},
    {"speckle_neighbour_correlation", "grain size in a zone of the image"},
    {"power_band_", "share of the brightness variations in a band of spatial frequency, from coarse to fine"},
    {"power_beyond_cutoff", "variations finer than the lens can pass"},
    {"power_direction", "horizontal against vertical spatial frequencies"},
    {"power_lines", "sharp peaks in the spatial spectrum: a periodic pattern"},
    {"row_means", "brightness differences of whole rows"},
    {"column_means", "brightness differences of whole columns"},
    {"dot_shift_", "common shift of all dots along this axis"},
    {"dot_radial_displacement",
     "dots farther out or in, in proportion to the distance from the axis, as a wavelength shift moves them"},
    {"dot_cubic_displacement",
     "dots farther out or in, with the cube of the distance from the axis, as lens distortion moves them"},
    {"dot_turn", "rotation of the dot pattern"},
    {"dot_anisotropy", "different scales of the dot pattern along the two axes"},
    {"dot_shear", "shear of the dot pattern"},
    {"dot_position_scatter", "scatter of the dots' positions about a smooth displacement"},
    {"dot_width", "width of the dots (standard deviation)"},
    {"dot_covariance_xy", "diagonal stretch of the dots"},
    {"dot_skewness_", "lopsidedness of the dots along this axis"},
    {"dot_kurtosis", "tails of the dots' profile: flat tops lower it"},
    {"dot_profile", "light in a ring around the dots (radii in standard deviations of the dot)"},
    {"dot_angular_", "angular structure of the light around the dots"},
    {"dot_flux", "light of the dots in a region"},
    {"dot_flux_falloff", "light of the dots in the corners against the middle"},
    {"dot_flux_spread", "differences in brightness between dots"},
    {"dot_peak", "brightness of the dots' centres"},
    {"light_between_dots", "light far from every dot, relative to the mean"},
    {"light_between_dots_spread", "structure of the light far from every dot"},
    {"peak_at_cell_centres", "extra light in the middle between dots: ghost dots"},
    {"peak_at_half_ways", "extra light half way between neighbouring dots: ghost dots"},
    {"peak_at_point_reflections", "extra light at the dots' point reflections about the axis: an internal reflection"},
    {"peak_at_mirror_images_", "extra light at the dots' mirror images: an internal reflection"},
    {"peak_on_axis", "extra dot on the axis: undiffracted light"},
    {"core_", "law of the speckled brightness in the dots' cores"},
    {"grain_correlation_", "size of the speckle grains within the dots"},
};

constexpr Words kQuantities[] = {
    {"dark_offset", "mean code in the dark"},
    {"mean_signal", "mean above the black level"},
    {"temporal_noise",
     "standard deviation of a pixel over time; rows, columns and whole frames taken out, defects capped"},
    {"row_noise", "row offsets that are new in each frame"},
    {"column_noise", "column offsets that are new in each frame"},
    {"frame_mean_deviation", "how whole frames differ in brightness"},
    {"image_shift_x", "root mean square motion of the image to the sides, noise taken out"},
    {"image_shift_y", "root mean square motion of the image up and down, noise taken out"},
    {"fixed_pattern", "differences between pixels that stay, temporal noise and smooth fields taken out (in the dark: "
                      "DSNU of EMVA 1288)"},
    {"row_fixed_pattern", "row offsets that stay"},
    {"column_fixed_pattern", "column offsets that stay"},
    {"wave_amplitude", "amplitude of a wave in what stays, if one stands out"},
    {"wave_frequency_x", "its cycles from pixel to pixel, to the right"},
    {"wave_frequency_y", "its cycles from pixel to pixel, downwards"},
    {"wave_frequency_error", "standard error of either"},
    {"photo_response_nonuniformity", "PRNU of EMVA 1288: what pixels differ by in the light beyond the dark"},
    {"corner_loss", "how much darker the corners are than the axis"},
    {"contrast", "speckle contrast: standard deviation over mean, read noise taken out"},
    {"intensity_skewness",
     "lopsidedness of the speckle's brightness: 2 for fully developed speckle, less where several "
     "patterns add"},
    {"grain_width_x", "full width at half maximum of the grains' autocorrelation, to the sides"},
    {"grain_width_y", "the same, up and down"},
    {"dot_width_x", "standard deviation of the dots, to the sides"},
    {"dot_width_y", "the same, up and down"},
    {"dot_shift_x", "common shift of all dots to the right"},
    {"dot_shift_y", "common shift of all dots down"},
    {"dot_magnification", "dots farther out, in proportion to their distance from the axis"},
    {"dot_cubic_displacement", "dots farther out in the corner, with the cube of the distance"},
    {"light_between_dots", "light far from all dots, over that of a dot's core"},
    {"light_on_axis", "light of a spot of a dot's width on the axis, beyond that between dots, over a dot's core: "
                      "undiffracted light, or a dot that lies there"},
    {"code_width_wave",
     "how much the widths of codes differ in turn, in codes, if they do (differential nonlinearity)"},
    {"code_width_period", "after how many codes their widths repeat"},
    {"widest_code", "the code that occurs most among them, beyond whole periods"},
    {"widest_code_error", "its standard error"},
    {"codes_missing", "codes that never occur where others beside them do"},
    {"codes_at_zero", "pixels at the lowest code"},
    {"codes_at_maximum", "pixels at the highest code"},
    {"system_gain", "slope of the photon transfer: variance over time against signal, of dark and flat sequences"},
    {"transfer_intercept", "variance over time that the photon transfer leaves without signal"},
};

constexpr Words kStages[] = {
    {"laser", "laser: line width, stability and shape of the beam"},
    {"doe", "diffractive element that makes the dots"},
    {"surface", "surface: how its roughness makes speckle"},
    {"motion", "motion: of the surface, the camera or the air"},
    {"optics", "lens: aperture, focus, distortion, stray light"},
    {"sensor", "sensor: pixels, noise, converter"},
};

constexpr Words kUnits[] = {
    {"1", "–"},
    {"log", "ln"},
    {"sqrt", "√"},
    {"cbrt", "∛"},
};

std::string with_spaces(std::string text) {
    std::replace(text.begin(), text.end(), '_', ' ');
    return text;
}

bool begins_with(const std::string &text, const std::string &start) {
    return text.compare(0, start.size(), start) == 0;
}

} // namespace

std::string explain_statistic(const std::string &name) {
    const Words *best = nullptr;
    for (const Words &words : kStatistics)
        if (begins_with(name, words.name) && (!best || std::string(words.name).size() > std::string(best->name).size()))
            best = &words;
    return best ? best->text : with_spaces(name);
}

std::string explain_quantity(const std::string &name) {
    for (const Words &words : kQuantities)
        if (name == words.name)
            return words.text;
    return with_spaces(name);
}

std::string explain_region(const std::string &region) {
    if (region == "all")
        return "whole image";
    if (region.size() == 4 && region[0] == 'r' && region[2] == 'c' && region[1] >= '0' && region[1] <= '2' &&
        region[3] >= '0' && region[3] <= '2') {
        if (region == "r1c1")
            return "middle";
        constexpr std::array<const char *, 3> rows{"upper", "middle", "lower"}, columns{"left", "centre", "right"};
        return std::string(rows[std::size_t(region[1] - '0')]) + " " + columns[std::size_t(region[3] - '0')];
    }
    if (begins_with(region, "ring") && region.size() == 5 && std::isdigit(static_cast<unsigned char>(region[4])))
        return fmt::format("ring {} from the axis outwards", region[4] - '0' + 1);
    return with_spaces(region);
}

std::string explain_unit(const std::string &unit) {
    for (const Words &words : kUnits)
        if (unit == words.name)
            return words.text;
    return unit;
}

std::string explain_stage(const std::string &stage) {
    for (const Words &words : kStages)
        if (stage == words.name)
            return words.text;
    return stage;
}

std::string explain_effect(const DiagnosisResult &result, const std::string &effect) {
    for (const Candidate &candidate : result.candidates)
        if (candidate.id == effect)
            return fmt::format("{} ({})", candidate.summary, candidate.stage);
    return {};
}

std::string explain_sequence(CaptureScene scene, bool moving) {
    const char *motion =
        moving ? "moved between frames: the speckle of each frame is new" : "at rest: the speckle stands still";
    switch (scene) {
    case CaptureScene::kDark:
        return "dark frames: no light reaches the sensor";
    case CaptureScene::kFlat:
        return "uniform lamp light, no speckle";
    case CaptureScene::kBoard:
        return fmt::format("a rough flat board in uniform laser light, {}", motion);
    case CaptureScene::kDots:
        break;
    }
    return fmt::format("the board under the laser's dot pattern, {}", motion);
}

std::string effect_with_values(const DiagnosisResult &result, const RankedEffect &ranked) {
    std::string text = ranked.effect;
    const auto candidate = std::find_if(result.candidates.begin(), result.candidates.end(),
                                        [&](const Candidate &c) { return c.id == ranked.effect; });
    for (std::size_t p = 0;
         candidate != result.candidates.end() && p < std::min(ranked.values.size(), candidate->parameters.size());
         ++p) {
        const HypothesisParameter &parameter = candidate->parameters[p];
        text += fmt::format("{} {} = {}{}{}", p ? "," : "", parameter.name, figure(ranked.values[p]),
                            parameter.unit.empty() || parameter.unit == "1" ? "" : " ",
                            parameter.unit == "1" ? "" : parameter.unit);
    }
    return text;
}

std::string joined(const std::vector<std::string> &items) {
    std::string result;
    for (std::size_t i = 0; i < items.size(); ++i)
        result += (i == 0 ? "" : i + 1 < items.size() ? ", " : " and ") + items[i];
    return result;
}

std::string explain_calibration(const CalibrationResult &calibration) {
    std::string text =
        fmt::format("Adjusted to the real frames, which is no gap: black level {:.2f} DN, read noise {:.2f} DN",
                    calibration.black_level_dn, calibration.read_noise_dn);
    std::string light;
    for (const SequenceLight &one : calibration.light)
        if (one.share > 0.0)
            light += fmt::format("{}{} {:.1f} DN", light.empty() ? "" : ", ", one.sequence, one.light_dn);
    return text + (light.empty() ? "." : "; light of " + light + ".");
}

std::string explain_illumination(const LabLights &found) {
    std::string text;
    for (const LabLight &light : found.lights)
        if (!light.light.coefficients.empty())
            text += fmt::format(
                " The {} is not even: {} % more light on the right, {} % below, {} % less in the corners than on "
                "the axis.",
                light.name, with_uncertainty(100.0 * light.slope[0], 100.0 * light.slope_error[0]),
                with_uncertainty(100.0 * light.slope[1], 100.0 * light.slope_error[1]),
                with_uncertainty(100.0 * light.corner_loss, 100.0 * light.corner_loss_error));
    for (const LampDrift &drift : found.drifts)
        text += fmt::format(" In {} the lamp varies by {:.2g} % from frame to frame.", drift.sequence,
                            100.0 * drift.deviation);
    return text.empty() ? text : "Light of the lab, which is no gap either:" + text;
}

std::string why_no_interval(const GapPlace &place, const DiagnosisResult &result) {
    if (result.steps.empty())
        return "no effect was added";
    if (!place.shrink.held_out)
        return result.comparison && place.statistic.name == "read_noise"
                   ? "it is of the calibration: no effect is fitted to it"
                   : "no frames are left that the fit has not seen: a sequence needs four";
    return place.shrink.beyond_chance ? "" : "its distance before is not beyond what chance gives with the effects";
}

std::string explain_reach(const DiagnosisResult &result) {
    std::string text;
    if (!result.left_out.empty())
        text += fmt::format("Not judged: {}. ", joined(result.left_out));
    if (!result.untested_effects.empty())
        text +=
            fmt::format("Not tested, since they cannot show in these sequences: {}. ", joined(result.untested_effects));
    if (!result.untested_topics.empty())
        text += fmt::format("Left open: {}. ", joined(result.untested_topics));
    return text.empty() ? "Every effect of the catalogue could have shown."
                        : text + "None of this is shown to be right.";
}

namespace {

std::string sentence_of_verdict(const DiagnosisResult &result) {
    switch (result.verdict) {
    case Verdict::kNone:
        return fmt::format(
            "No gap in what could be tested: with its light levels, black level and read noise adjusted, the "
            "simulator's "
            "frames cannot be told from the real ones{} by any of {} statistics, given so many frames. {}",
            result.judged.empty() ? "" : " of " + joined(result.judged), result.places.size(), explain_reach(result));
    case Verdict::kNamed:
        return fmt::format("There is a gap, and its cause is named: {}. With {} in the simulator its frames {}.",
                           joined(result.effects), result.effects.size() > 1 ? "these effects" : "this effect",
                           result.residual_detected ? "come nearer, though a difference remains"
                                                    : "can no longer be told from the real ones");
    case Verdict::kAmbiguous:
        return fmt::format("There is a gap, but these frames cannot tell which of several effects causes it: {} "
                           "explain it equally well{}. "
                           "The advice says which further recording would decide.",
                           joined(result.equivalent),
                           result.effects.empty() ? std::string()
                                                  : fmt::format(" (best so far: {})", joined(result.effects)));
    case Verdict::kUnknown:
        break;
    }
    std::string text =
        "There is a gap, and a significant part of it is explained by no effect that the simulator knows. ";
    if (!result.effects.empty())
        text += fmt::format("Found beside it: {}. ", joined(result.effects));
    return text + "The map of where it lies narrows the cause down.";
}

} // namespace

std::string verdict_sentence(const DiagnosisResult &result) {
    const std::string sentence = sentence_of_verdict(result);
    if (!result.no_light_judged)
        return sentence;
    return fmt::format("Nothing could be judged of light: every sequence that has some was left out ({}), as the notes "
                       "say. What follows is about dark frames alone. {}",
                       joined(result.left_out), sentence);
}

} // namespace clsp

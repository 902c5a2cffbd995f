#include "effects/effects.hpp"

#include "effects/pipeline_model.hpp"
#include "runtime/error.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/core.h>
#include <limits>

namespace clsp {
namespace {

using Model = PipelineModel;
using Values = const double *;

// A part of the model that not every pipeline has.
template <typename T> T &needed(std::optional<T> &part, const char *effect, const char *what) {
    if (!part)
        throw Error(Status::kInvalidArgument,
                    fmt::format("the effect {} needs a pipeline with {}; make it with one", effect, what));
    return *part;
}

DotsParameters &dots(Model &model, const char *effect) { return needed(model.dots, effect, "dots"); }
SensorParameters &sensor(Model &model, const char *effect) { return needed(model.sensor, effect, "a sensor"); }

// k = -2, -1, 0, 1, 2: the catalogue's "k in [-2, 2]" read as whole numbers, as lines of a laser have. With lines
// closer to each other the same light takes an s that is larger by up to 4 %.
constexpr std::uint32_t kLineCount = 5;
// An angle of any sign, from any start; radians.
constexpr double kAnyTurn = 6.28318530717958647692;
constexpr double kEighthTurn = 0.78539816339744830962; // the other four axes are these with the other sign

constexpr const char *kBeforeSpeckle =
    "it changes the light before the speckle forms, and finished frames hold no speckle for the changed light";
constexpr const char *kField = "it works on the field, and frames hold its intensity without the phase";

std::vector<Effect> make_catalogue() {
    return {
    // Laser.
    Effect{"linewidth", "laser",
     "several lines add in intensity; each turns with the surface's height, U_k = U exp(i k s h)",
     "stages/field.cl: field_illuminate (LINES)", kSetsPipeline,
     {{"dephasing_rad", "rad", 0.0, 1000.0, 0.5, 1.2}},
     [](Model &m, Values v) {
         m.pipeline.line_count = kLineCount;
         m.pipeline.dephasing_rad = v[0];
     },
     {kInSpeckle}, {kInSpeckle},
     "speckle contrast falls, the size of the grain stays",
     "each line has a speckle pattern of its own, and finished frames hold one that all lines share", {4}}
        .told_from("depolarization",
                   "board_moving behind a linear analyser: contrast returns to 1 only for depolarization")
        .told_from("motion_decorrelation",
                   "board_static: motion in the exposure leaves it alone, several lines do not"),
    Effect{"power_flicker", "laser", "one factor 1 + sigma n for each frame's laser light",
     "stages/aperture.cl: aperture_intensity", kSetsPipeline,
     {{"sigma", "1", 0.0, 1.0, 0.02, 0.1}},
     [](Model &m, Values v) { m.pipeline.power_flicker = v[0]; },
     {kInSpeckle}, {kInSpeckle, SceneMotion::kAny, 2},
     "all laser light rises and falls together from frame to frame", "", {1}}
        .scales_light()
        .told_from("surface_boiling", "board_static with more frames: flicker is common to all pixels"),
    Effect{"wavelength_shift", "laser", "dots move radially in the ratio of the wavelengths",
     "stages/dots.cl: dots_render", kSetsDots,
     {{"delta_nm", "nm", -200.0, 200.0, 4.0, 12.0}},
     [](Model &m, Values v) {
         dots(m, "wavelength_shift").relative_wavelength_shift = v[0] * 1e-9 / m.aperture.wavelength_m;
     },
     {kInDots}, {kInDots},
     "dots move radially, in proportion to the radius", kBeforeSpeckle, {1}}
        .told_from("lens_distortion", "dots that reach into the corners: r against r^3"),
    Effect{"beam_skew", "laser", "dots are lopsided along an axis (third Hermite term)",
     "stages/dots.cl: dots_render", kSetsDots,
     {{"skew", "1", -3.0, 3.0, 0.5, 1.2}, {"angle_rad", "rad", -kAnyTurn, kAnyTurn, 0.0, 0.0}},
     [](Model &m, Values v) {
         dots(m, "beam_skew").beam_skew = v[0];
         m.dots->beam_skew_angle_rad = v[1];
     },
     {kInDots}, {kInDots},
     "dots are lopsided", kBeforeSpeckle, {1}}
        .with_forms("angle_rad", {kEighthTurn, 2.0 * kEighthTurn, 3.0 * kEighthTurn}),
    Effect{"beam_flat_top", "laser", "super-Gaussian dots, exp(-(r^2)^(1 + 2 f) / 2)",
     "stages/dots.cl: dots_render", kSetsDots,
     {{"flatness", "1", 0.0, 4.0, 0.5, 1.0}},
     [](Model &m, Values v) { dots(m, "beam_flat_top").beam_flatness = v[0]; },
     {kInDots}, {kInDots},
     "dots have flat tops and steep flanks", kBeforeSpeckle, {1}},
    // Diffractive optical element.
    Effect{"zero_order", "doe", "the undiffracted beam: one more dot on the axis",
     "stages/dots.cl: dots_render", kSetsDots,
     {{"relative_intensity", "1", 0.0, 1e6, 4.0, 20.0}},
     [](Model &m, Values v) { dots(m, "zero_order").zero_order_relative_intensity = v[0]; },
     {kInDots}, {kInDots},
     "a bright dot on the optical axis", kBeforeSpeckle, {1}},
    Effect{"ghost_dots", "doe",
     "faint copies of the lattice half way along its vectors: both (0), to the right (1), down (2)",
     "stages/dots.cl: dots_render", kSetsDots,
     {{"relative_intensity", "1", 0.0, 1.0, 0.06, 0.25}, {"lattice_direction", "1", 0.0, 2.0, 0.0, 0.0, true}},
     [](Model &m, Values v) {
         dots(m, "ghost_dots").ghost_relative_intensity = v[0];
         m.dots->ghost_direction = static_cast<DotsParameters::GhostDirection>(std::lround(v[1]));
     },
     {kInDots}, {kInDots},
     "faint dots between the dots", kBeforeSpeckle, {1}}
        .with_forms("lattice_direction", {1.0, 2.0}),
    Effect{"scatter_background", "doe", "a fraction of the pattern's light is spread evenly",
     "stages/dots.cl: dots_render", kSetsDots,
     {{"fraction", "1", 0.0, 1.0, 0.06, 0.25}},
     [](Model &m, Values v) { dots(m, "scatter_background").scatter_fraction = v[0]; },
     {kInDots}, {kInDots},
     "even, speckled light between the dots", kBeforeSpeckle, {1}}
        .told_from("ambient_light", "dots with the laser off and the shutter open"),
    // Surface.
    Effect{"depolarization", "surface", "the returned light has another degree of polarization",
     "stages/aperture.cl: aperture_intensity", kSetsAperture | kSetsPhase,
     {{"degree_of_polarization", "1", 0.0, 1.0, 0.7, 0.0}},
     [](Model &m, Values v) {
         m.aperture.degree_of_polarization = v[0];
         m.phase.polarization_count = 2;
     },
     {kInSpeckle}, {kInSpeckle},
     "contrast falls towards 0.71, and the intensity law changes with it", "", {2}}
        .needs_of_finished_frames(FinishedNeed::kSecondPattern)
        .told_from("motion_decorrelation",
                   "board_static: motion in the exposure leaves it alone, depolarization does not"),
    Effect{"low_roughness", "surface", "part of the field keeps its phase: U = sqrt(I0) (sqrt(1 - c) z + sqrt(c))",
     "stages/field.cl: field_illuminate (COHERENT)", kSetsPipeline,
     {{"coherent_fraction", "1", 0.0, 1.0, 0.1, 0.5}},
     [](Model &m, Values v) { m.pipeline.coherent_fraction = v[0]; },
     {kInSpeckle}, {kInSpeckle},
     "light that keeps its phase lowers the contrast and turns the law into Rice's", kField, {1}},
    Effect{"subsurface_scattering", "surface",
     "a fraction of the light is spread by exp(-r / L) before the speckle forms",
     "stages/filter.cl", kSetsPipeline,
     {{"length_px", "px", 0.01, 1000.0, 1.5, 4.0}, {"fraction", "1", 0.0, 1.0, 0.6, 0.6}},
     [](Model &m, Values v) {
         m.pipeline.subsurface_length_px = v[0];
         m.pipeline.subsurface_fraction = v[1];
     },
     {kInDots}, {kInDots},
     "dots have exponential tails; even light stays even", kBeforeSpeckle, {1}}
        .also_acts_where_light_is_shaped(kInSpeckle),
    // Motion.
    Effect{"motion_decorrelation", "motion",
     "frames drawn anew change while the shutter is open: correlation exp(-l) (0) or exp(-l^2) (1) over a path l",
     "stages/phase.cl: phase_advance", kSetsPipeline,
     {{"lags", "1", 0.0, 16.0, 0.4, 2.5}, {"correlation_law", "1", 0.0, 1.0, 0.0, 0.0, true}},
     [](Model &m, Values v) {
         m.pipeline.exposure_path = v[0];
         m.pipeline.exposure_correlation = v[1] == 0.0 ? ExposureCorrelation::kField : ExposureCorrelation::kGaussian;
     },
     {kInSpeckle, SceneMotion::kMoving}, {kInSpeckle, SceneMotion::kMoving},
     "contrast falls while the surface moves, and only then",
     "an exposure holds patterns that change from one into the other, and finished frames hold none between them", {5}}
        .needs_gaussian_field()
        .with_forms("correlation_law", {1.0}, true),
    Effect{"surface_boiling", "motion",
     "the speckle of a resting scene changes: field correlation exp(-1 / tau) a frame",
     "stages/phase.cl: phase_advance", kSetsPipeline,
     {{"correlation_frames", "frames", 1e-3, 1e9, 60.0, 6.0}},
     [](Model &m, Values v) { m.pipeline.boiling_correlation_frames = v[0]; },
     {kInSpeckle, SceneMotion::kStatic}, {kInSpeckle, SceneMotion::kStatic, 2},
     "the speckle of a resting surface changes, everywhere on its own",
     "a static scene's frames hold one speckle pattern, and not what it changes into", {1, 0, true}}
        .needs_gaussian_field(),
    Effect{"airflow", "motion",
     "smooth phase screens before a resting scene: changing with time (0), or frozen and carried a scale in that time "
     "(1)",
     "stages/airflow.cl, stages/field.cl: field_illuminate (SCREEN)", kSetsPipeline,
     {{"rms_rad", "rad", 0.0, 100.0, 0.25, 0.8},
      {"scale_px", "px", 0.5, 1000.0, 6.0, 6.0},
      {"correlation_frames", "frames", 0.01, 1e6, 3.0, 3.0},
      {"correlation_law", "1", 0.0, 1.0, 0.0, 0.0, true}},
     [](Model &m, Values v) {
         m.pipeline.airflow.rms_rad = v[0];
         m.pipeline.airflow.scale_px = v[1];
         // A frozen screen that goes on by its scale in that time leaves a pixel with exp(-(t / correlation_frames)^2).
         m.pipeline.airflow.correlation_frames = v[3] == 0.0 ? v[2] : std::numeric_limits<double>::infinity();
         m.pipeline.airflow.wind_px = v[3] == 0.0 ? 0.0 : v[1] / v[2];
     },
     {kInSpeckle, SceneMotion::kStatic}, {kInSpeckle, SceneMotion::kStatic, 2},
     "the speckle of a resting surface shivers, in patches", kField, {1, 1, true}}
        .with_forms("correlation_law", {1.0}, true)
        .told_from("surface_boiling", "board_static behind a closed tube: air is still in it")
        .told_from("vibration", "board_static behind a closed tube: air is still in it"),
    Effect{"vibration", "motion", "the picture of a resting scene shifts by a part of a pixel in each frame",
     "fft/clfft/pupil.cl: apply_pupil (SHIFT)", kSetsPipeline,
     {{"rms_px", "px", 0.0, 100.0, 0.05, 0.3}},
     [](Model &m, Values v) { m.pipeline.vibration_rms_px = v[0]; },
     {kInSpeckle, SceneMotion::kStatic}, {kInSpeckle, SceneMotion::kStatic, 2},
     "the speckle of a resting surface shifts as a whole", "", {1}}
        .needs_of_finished_frames(FinishedNeed::kSharedPicture),
    // Optics.
    Effect{"defocus", "optics", "quadratic pupil phase, w waves at the rim",
     "fft/clfft/pupil.cl: apply_pupil (COMPLEX_PUPIL)",
     kSetsAperture,
     {{"waves", "waves", -100.0, 100.0, 0.6, 1.5}},
     [](Model &m, Values v) { m.aperture.pupil.defocus_waves = v[0]; },
     {kInSpeckle}, {kInDots},
     "dots widen, the grain stays; on an even board the grain's law does not change", kField, {1}}
        .is_even()
        .told_from("beam_flat_top",
                   "dots at two focus settings: defocus changes the dots' width, the beam's shape stays")
        .told_from("subsurface_scattering", "dots on a metallic diffuser: no light spreads below its surface"),
    Effect{"vignetting", "optics", "light falls off as 1 - a r^2, r = 1 in the corner",
     "stages/lens.cl: lens_finish", kSetsLens,
     {{"corner_loss", "1", 0.0, 1.0, 0.12, 0.45}},
     [](Model &m, Values v) { m.lens.vignetting_corner_loss = v[0]; },
     {kInLight}, {kInLight},
     "light falls off towards the corners", "", {1}}
        .scales_light()
        .dims_the_corners()
        .told_from("ghost_dots", "flat: it shows the lens's fall-off alone"),
    Effect{"aperture_mismatch", "optics", "the true f-number is another than the nominal one",
     "fft/clfft/pupil.cl: apply_pupil", kSetsAperture,
     {{"f_number_ratio", "1", 0.05, 20.0, 1.12, 1.45}},
     [](Model &m, Values v) {
         m.aperture.f_number *= v[0];
         m.aperture.relative_diameter /= v[0]; // 0 stays 0: from the f-number
     },
     {kInSpeckle}, {kInSpeckle},
     "the grain has another size than the f-number says", kField, {1}}
        .told_from("pixel_integration", "board_moving at two f-numbers: the pixel's area stays, the grain changes")
        .told_from("pupil_obstruction", "board_moving at two f-numbers, and the spectrum near the cut-off")
        .told_from("crosstalk", "board_moving at two f-numbers: crosstalk does not change with the aperture"),
    Effect{"pupil_obstruction", "optics", "the centre of the pupil is blocked",
     "fft/clfft/pupil.cl: apply_pupil", kSetsAperture,
     {{"radius_ratio", "1", 0.0, 0.99, 0.3, 0.6}},
     [](Model &m, Values v) { m.aperture.pupil.obstruction_ratio = v[0]; },
     {kInSpeckle}, {kInSpeckle},
     "the grain is finer, with rings in its autocorrelation", kField, {1}},
    Effect{"glare", "optics", "a fraction of the image light is spread over wide tails",
     "stages/filter.cl, stages/lens.cl: lens_finish",
     kSetsLens,
     {{"fraction", "1", 0.0, 1.0, 0.05, 0.2}, {"scale_px", "px", 0.1, 1000.0, 6.0, 6.0}},
     [](Model &m, Values v) {
         m.lens.glare_fraction = v[0];
         m.lens.glare_scale_px = v[1];
     },
     {kInSpeckle}, {kInSpeckle},
     "light between the dots, and less contrast on a board", "", {1, 1}}
        .also_acts_where_light_is_shaped(kInFlat)
        .told_from("scatter_background",
                   "board with a dark half: glare reaches into it, the element's scatter does not")
        .told_from("subsurface_scattering", "dots on a metallic diffuser: no light spreads below its surface"),
    Effect{"ambient_light", "optics", "constant light on everything but dark frames", "stages/lens.cl: lens_finish",
     kSetsLens,
     {{"level_dn", "DN", 0.0, 65535.0, 6.0, 40.0}},
     [](Model &m, Values v) {
         const double gain = sensor(m, "ambient_light").exposure_gain_dn;
         if (!(gain > 0.0))
             throw Error(Status::kInvalidArgument,
                         "the effect ambient_light is a level in DN, but the sensor's exposure_gain_dn is 0");
         m.lens.ambient = v[0] / gain;
     },
     {kInLight}, {kInSpeckle},
     "even light without speckle: less contrast, a floor between the dots", "", {1}}
        .scales_light()
        .told_from("low_roughness", "board with the laser off and the shutter open"),
    Effect{"lens_distortion", "optics", "radial, x -> x (1 + k1 r^2), r = 1 at the corner",
     "stages/lens.cl: lens_distort", kSetsLens,
     {{"k1", "1", -0.148, 1.0, 0.01, 0.05}},
     [](Model &m, Values v) {
         m.lens.radius_unit = RadiusUnit::kCorner;
         m.lens.k1 = v[0];
     },
     {kInDots}, {kInDots},
     "dots move radially, as the cube of the radius", "", {1}}
        .also_acts_where_light_is_shaped(kInLight)
        .leaves_open(OpenReading::kWhatMoves),
    // Sensor.
    Effect{"pixel_integration", "sensor", "a pixel integrates over its area instead of sampling a point",
     "stages/aperture.cl: aperture_intensity (PIXEL_TAPS)", kSetsAperture,
     {{"fill_factor", "1", 0.01, 1.0, 1.0, 1.0}},
     [](Model &m, Values v) { m.aperture.fill_factor = v[0]; },
     {kInSpeckle}, {kInSpeckle},
     "less contrast, and neighbouring pixels alike", "", {1}}
        .told_from("crosstalk",
                   "flat with shot noise at a high level: crosstalk correlates neither noise before nor after it as a "
                   "pixel's area does"),
    Effect{"crosstalk", "sensor", "a fraction of a pixel's signal goes to its four neighbours in equal parts",
     "stages/sensor.cl: sensor_expose (CROSSTALK)", kSetsSensor,
     {{"fraction", "1", 0.0, 1.0, 0.06, 0.25}},
     [](Model &m, Values v) { sensor(m, "crosstalk").crosstalk_fraction = v[0]; },
     {kInLight}, {kInSpeckle},
     "neighbouring pixels alike, in dots and grain", "", {1}},
    Effect{"shot_noise", "sensor", "Poisson noise of the signal",
     "stages/sensor_pixel.h: expose_pixel (SHOT_NOISE)", kSetsSensor,
     {{"dn_per_electron", "DN/e", 1e-6, 1e6, 0.08, 0.5}},
     [](Model &m, Values v) {
         sensor(m, "shot_noise").shot_noise = true;
         m.sensor->conversion_gain_dn_per_e = v[0];
     },
     {kInLight}, {kInLight, SceneMotion::kStatic, 2},
     "temporal variance grows in proportion to the light", "", {1}}
        .leaves_open(OpenReading::kPhotonLaw)
        .told_from("power_flicker", "flat: lamp light does not flicker with the laser"),
    Effect{"prnu", "sensor", "the pixels' gains vary", "stages/sensor_pixel.h: expose_pixel (PRNU)", kSetsSensor,
     {{"sigma", "1", 0.0, 1.0, 0.006, 0.03}},
     [](Model &m, Values v) { sensor(m, "prnu").prnu = v[0]; },
     {kInLight}, {kInFlat, SceneMotion::kAny, 2},
     "a pattern that grows with the light and stays in the pixels", "", {1}}
        .is_fixed(FixedPattern::kGain)
        .told_from("bayer_mismatch", "flat with more frames, for the 2 x 2 means"),
    Effect{"column_gain", "sensor", "the columns' gains vary, constant in time",
     "stages/sensor.cl: sensor_fixed_pattern", kSetsSensor,
     {{"sigma", "1", 0.0, 1.0, 0.002, 0.01}},
     [](Model &m, Values v) { sensor(m, "column_gain").column_prnu = v[0]; },
     {kInLight}, {kInFlat},
     "stripes along the columns that grow with the light and stay", "", {1}}
        .is_fixed(FixedPattern::kGain)
        .told_from("column_fpn", "dark, or flat at two levels of light: gains show in proportion to the light")
        .told_from("prnu", "flat with more frames, for the means of the columns"),
    Effect{"row_gain", "sensor", "the rows' gains vary, constant in time",
     "stages/sensor.cl: sensor_fixed_pattern", kSetsSensor,
     {{"sigma", "1", 0.0, 1.0, 0.002, 0.01}},
     [](Model &m, Values v) { sensor(m, "row_gain").row_prnu = v[0]; },
     {kInLight}, {kInFlat, SceneMotion::kAny, 2},
     "stripes along the rows that grow with the light and stay", "", {1}}
        .is_fixed(FixedPattern::kGain)
        .told_from("row_noise", "flat with more frames: gains stay, row noise is new in each frame")
        .told_from("prnu", "flat with more frames, for the means of the rows"),
    Effect{"dsnu", "sensor", "the pixels' offsets vary", "stages/sensor_pixel.h: expose_pixel (OFFSET)", kSetsSensor,
     {{"sigma_dn", "DN", 0.0, 65535.0, 1.0, 5.0}},
     [](Model &m, Values v) { sensor(m, "dsnu").dsnu_dn = v[0]; },
     {kInAll}, {kInDark | kInFlat | kInDots, SceneMotion::kAny, 2},
     "a pattern of offsets that stays in the pixels", "", {1}}
        .is_fixed(FixedPattern::kOffset)
        .told_from("hot_pixels", "dark with more frames and a longer exposure")
        .told_from("column_fpn", "dark with more frames"),
    Effect{"column_fpn", "sensor", "the columns' offsets vary, constant in time",
     "stages/sensor_pixel.h: expose_pixel (OFFSET)", kSetsSensor,
     {{"sigma_dn", "DN", 0.0, 65535.0, 0.8, 4.0}},
     [](Model &m, Values v) { sensor(m, "column_fpn").column_offset_dn = v[0]; },
     {kInAll}, {kInDark | kInFlat},
     "stripes along the columns that stay", "", {1}}
        .is_fixed(FixedPattern::kOffset),
    Effect{"row_fpn", "sensor", "the rows' offsets vary, constant in time",
     "stages/sensor_pixel.h: expose_pixel (OFFSET)", kSetsSensor,
     {{"sigma_dn", "DN", 0.0, 65535.0, 0.8, 4.0}},
     [](Model &m, Values v) { sensor(m, "row_fpn").row_offset_dn = v[0]; },
     {kInAll}, {kInDark | kInFlat},
     "stripes along the rows that stay", "", {1}}
        .is_fixed(FixedPattern::kOffset)
        .told_from("row_gain", "dark, or flat at two levels of light: gains show in proportion to the light")
        .told_from("row_noise", "dark with more frames: row noise is new in each frame"),
    Effect{"periodic_offset", "sensor", "a fixed wave of offsets, a sin(2 pi (u x + v y) + phase)",
     "stages/sensor.cl: sensor_fixed_pattern", kSetsSensor,
     {{"amplitude_dn", "DN", 0.0, 65535.0, 1.0, 5.0},
      {"frequency_x", "1/px", -0.5, 0.5, 0.1, 0.1},
      {"frequency_y", "1/px", -0.5, 0.5, 0.1, 0.1}},
     [](Model &m, Values v) {
         SensorParameters &s = sensor(m, "periodic_offset");
         s.periodic_offset_dn = v[0];
         s.periodic_frequency_x = v[1];
         s.periodic_frequency_y = v[2];
     },
     {kInAll}, {kInDark | kInFlat},
     "a pattern of waves that stays, also in the dark", "", {1}}
        .is_fixed(FixedPattern::kOffset)
        .measured_by("frequency_x", "wave_frequency_x", "wave_frequency_error")
        .measured_by("frequency_y", "wave_frequency_y", "wave_frequency_error"),
    Effect{"hot_pixels", "sensor", "few pixels with large offsets",
     "stages/sensor_pixel.h: expose_pixel (OFFSET)", kSetsSensor,
     {{"fraction", "1", 0.0, 1.0, 0.001, 0.01}, {"mean_dn", "DN", 0.0, 65535.0, 150.0, 150.0}},
     [](Model &m, Values v) {
         sensor(m, "hot_pixels").hot_pixel_fraction = v[0];
         m.sensor->hot_pixel_mean_dn = v[1];
     },
     {kInAll}, {kInDark | kInFlat | kInDots},
     "few pixels far above the others, also in the dark", "", {1}}
        .is_fixed(FixedPattern::kOffset),
    Effect{"pixel_dull", "sensor", "few pixels with a gain of 70 to 100 %",
     "stages/sensor.cl: sensor_fixed_pattern", kSetsSensor,
     {{"fraction", "1", 0.0, 1.0, 0.0002, 0.002}},
     [](Model &m, Values v) { sensor(m, "pixel_dull").dull_pixel_fraction = v[0]; },
     {kInLight}, {kInFlat},
     "few pixels below the others, the more so the more light there is", "", {1}}
        .is_fixed(FixedPattern::kGain),
    Effect{"telegraph_noise", "sensor",
     "some pixels jump by a step in half of the frames: up (0), or by half of it up or down (1)",
     "stages/sensor_pixel.h: expose_pixel (TELEGRAPH)", kSetsSensor,
     {{"fraction", "1", 0.0, 1.0, 0.01, 0.04},
      {"step_dn", "DN", 0.0, 65535.0, 30.0, 60.0},
      {"centered", "1", 0.0, 1.0, 0.0, 0.0, true}},
     [](Model &m, Values v) {
         SensorParameters &s = sensor(m, "telegraph_noise");
         s.telegraph_fraction = v[0];
         s.telegraph_step_dn = v[1];
         s.telegraph_centered = v[2] != 0.0;
     },
     {kInAll}, {kInDark | kInFlat, SceneMotion::kAny, 2},
     "some pixels have two levels and jump between them", "", {1}}
        .with_forms("centered", {1.0})
        .told_from("hot_pixels", "dark with more frames: hot pixels stay, telegraph pixels jump"),
    Effect{"dark_current", "sensor", "a dark signal grows with the exposure time; with shot_noise it has photon noise",
     "stages/sensor_pixel.h: expose_pixel (DARK_CURRENT)", kSetsSensor,
     {{"rate_dn_per_ms", "DN/ms", 0.0, 65535.0, 0.1, 1.0}},
     [](Model &m, Values v) {
         SensorParameters &s = sensor(m, "dark_current");
         if (s.conversion_gain_dn_per_e == 0.0)
             s.conversion_gain_dn_per_e = 1.0; // without shot_noise electrons make no difference
         s.dark_current_e_per_s = 1e3 * v[0] / s.conversion_gain_dn_per_e;
         s.dark_current_reference_temperature_c = s.temperature_c;
     },
     {kInAll}, {kInDark, SceneMotion::kAny, 1, 2},
     "dark frames are brighter after longer exposures",
     "the level of the dark is matched before frames are compared", {1}},
    Effect{"row_noise", "sensor", "the rows' offsets vary, new in each frame",
     "stages/sensor_pixel.h: expose_pixel (ROW_NOISE)", kSetsSensor,
     {{"sigma_dn", "DN", 0.0, 65535.0, 0.8, 4.0}},
     [](Model &m, Values v) { sensor(m, "row_noise").row_noise_dn = v[0]; },
     {kInAll}, {kInAll, SceneMotion::kStatic, 2},
     "stripes along the rows, others in each frame", "", {1}},
    Effect{"column_noise", "sensor", "the columns' offsets vary, new in each frame",
     "stages/sensor_pixel.h: expose_pixel (COLUMN_NOISE)", kSetsSensor,
     {{"sigma_dn", "DN", 0.0, 65535.0, 0.8, 4.0}},
     [](Model &m, Values v) { sensor(m, "column_noise").column_noise_dn = v[0]; },
     {kInAll}, {kInAll, SceneMotion::kStatic, 2},
     "stripes along the columns, others in each frame", "", {1}}
        .told_from("column_fpn", "dark with more frames: fixed offsets stay"),
    Effect{"correlated_read_noise", "sensor", "the read noise of neighbours in a row has a correlation",
     "stages/sensor_pixel.h: read_normals (READ_NOISE_CORRELATED)", kSetsSensor,
     {{"correlation", "1", -0.5, 0.5, 0.04, 0.2}},
     [](Model &m, Values v) { sensor(m, "correlated_read_noise").read_noise_correlation = v[0]; },
     {kInAll}, {kInAll, SceneMotion::kStatic, 2},
     "noise that goes on, or turns over, from pixel to pixel along the rows, also in the dark",
     "finished frames have their read noise, and nothing tells it from what else is in them", {1}}
        .told_from("crosstalk", "dark: crosstalk spreads light alone"),
    Effect{"gamma", "sensor", "signal = full (signal / full)^gamma, full = 2^bits - 1",
     "stages/sensor_pixel.h: expose_pixel (GAMMA)",
     kSetsSensor,
     {{"gamma", "1", 0.1, 10.0, 0.93, 0.75}},
     [](Model &m, Values v) { sensor(m, "gamma").gamma = v[0]; },
     {kInLight}, {kInLight},
     "the law of speckle bends; of even light only its noise and patterns do", "", {1}}
        .told_from("full_well",
                   "board_moving at several levels of light: the full well ends speckle at one level, a bent response "
                   "bends it at all")
        .told_from("depolarization",
                   "board_moving at several levels of light: a bent response changes the law of speckle by the level, "
                   "polarization does not"),
    Effect{"nonlinearity", "sensor",
     "s -> s (1 - c (s / full)^p), c is `cubic`, p `power`, full = 2^bits - 1; beyond full it bends no further",
     "stages/sensor_pixel.h: expose_pixel (CUBIC)", kSetsSensor,
     {{"cubic", "1", 0.0, 0.25, 0.01, 0.05}, {"power", "1", 1.0, 3.0, 3.0, 3.0, true}},
     [](Model &m, Values v) {
         SensorParameters &s = sensor(m, "nonlinearity");
         s.cubic_nonlinearity = v[0];
         s.nonlinearity_power = static_cast<std::uint32_t>(v[1]);
     },
     {kInLight}, {kInLight},
     "bright light gives less than in proportion, dim light does not", "", {1}}
        .with_forms("power", {1.0, 2.0}, true)
        .told_from("gamma", "board_moving at several levels of light: a power bends dim light, too"),
    Effect{"full_well", "sensor", "the signal clips below the converter's maximum",
     "stages/sensor_pixel.h: expose_pixel", kSetsSensor,
     {{"level_dn", "DN", 1.0, 1e6, 650.0, 380.0}},
     [](Model &m, Values v) { sensor(m, "full_well").saturation_dn = v[0]; },
     {kInLight}, {kInLight},
     "bright speckle and dots pile up at a level below the top code", "", {1}},
    Effect{"differential_nonlinearity", "sensor",
     "code n is 1 + a cos(2 pi (n - widest_code) / period_codes) wide",
     "stages/sensor_pixel.h: expose_pixel (CODE_WIDTHS)", kSetsSensor,
     {{"amplitude_lsb", "LSB", 0.0, 0.5, 0.1, 0.4},
      {"widest_code", "codes", 0.0, 16.0, 1.0, 1.0},
      {"period_codes", "codes", 2.0, 16.0, 4.0, 4.0, true}},
     [](Model &m, Values v) {
         SensorParameters &s = sensor(m, "differential_nonlinearity");
         s.code_width_wave = v[0];
         s.widest_code = v[1];
         s.code_width_period = v[2];
     },
     {kInAll}, {kInAll},
     "some codes occur more often than their neighbours, by the same share everywhere",
     "it moves the levels between codes, and finished frames hold codes already", {1}}
        .measured_by("widest_code", "widest_code", "widest_code_error")
        .measured_by("period_codes", "code_width_period", nullptr),
    Effect{"adc_bits", "sensor", "fewer effective bits: codes fall on multiples of 2^(bits - n)",
     "stages/sensor_pixel.h: expose_pixel (CODE_STEP)", kSetsSensor,
     {{"bits", "bits", 1.0, 16.0, 8.0, 6.0, true}},
     [](Model &m, Values v) {
         SensorParameters &s = sensor(m, "adc_bits");
         if (v[0] > s.bits)
             throw Error(Status::kInvalidArgument,
                         fmt::format("bits of the effect adc_bits is {}, but the sensor has {}", v[0], s.bits));
         s.effective_bits = static_cast<std::uint32_t>(std::lround(v[0]));
     },
     {kInAll}, {kInAll},
     "codes are missing: only multiples of a power of two occur", "", {1}},
    Effect{"bayer_mismatch", "sensor",
     "two sites of the 2x2 mosaic have gains 1 - d and 1 + d: top right and bottom left (0), the others (1)",
     "stages/sensor_pixel.h: expose_pixel (MOSAIC)", kSetsSensor,
     {{"delta", "1", -1.0, 1.0, 0.015, 0.06}, {"green_diagonal", "1", 0.0, 1.0, 0.0, 0.0, true}},
     [](Model &m, Values v) {
         auto &gain = sensor(m, "bayer_mismatch").mosaic_gain;
         const bool main_diagonal = std::lround(v[1]) == 1;
         gain[main_diagonal ? 0 : 1] *= 1.0 - v[0];
         gain[main_diagonal ? 3 : 2] *= 1.0 + v[0];
     },
     {kInLight}, {kInLight},
     "the sites of the 2 x 2 mosaic differ", "", {1}}
        .with_forms("green_diagonal", {1.0}),
    Effect{"image_lag", "sensor", "a fraction of the previous frame's signal remains",
     "stages/sensor_pixel.h: expose_pixel (LAG)", kSetsSensor,
     {{"fraction", "1", 0.0, 0.99, 0.03, 0.15}},
     [](Model &m, Values v) { sensor(m, "image_lag").lag_fraction = v[0]; },
     {kInLight}, {kInSpeckle, SceneMotion::kMoving, 2},
     "the frame before shows through", "", {1}}
        .leaves_open(OpenReading::kFrameBefore),
    };
}

} // namespace

const std::vector<Effect> &effect_catalogue() {
    // Never destroyed: calls may come late at exit.
    static const auto *catalogue = new std::vector<Effect>(make_catalogue());
    return *catalogue;
}

bool in_catalogue(const std::string &id) {
    const auto &catalogue = effect_catalogue();
    return std::any_of(catalogue.begin(), catalogue.end(), [&](const Effect &effect) { return id == effect.id; });
}

const Effect &find_effect(const std::string &id) {
    const auto &catalogue = effect_catalogue();
    const auto found =
        std::find_if(catalogue.begin(), catalogue.end(), [&](const Effect &effect) { return id == effect.id; });
    if (found != catalogue.end())
        return *found;
    std::string ids;
    for (const Effect &effect : catalogue)
        ids += fmt::format("{}{}", ids.empty() ? "" : ", ", effect.id);
    throw Error(Status::kInvalidArgument, fmt::format("there is no effect \"{}\"; the effects are {}", id, ids));
}

std::vector<double> check_effect_values(const Effect &effect, const double *values, std::uint32_t count) {
    std::vector<double> result;
    if (!values) {
        if (count != 0)
            throw Error(Status::kInvalidArgument, fmt::format("values is NULL, but count is {}", count));
        for (const EffectParameter &parameter : effect.parameters)
            result.push_back(0.5 * (parameter.weak + parameter.strong));
        return result;
    }
    if (count == 0 || count > effect.parameters.size())
        throw Error(Status::kInvalidArgument, fmt::format("count is {}, but the effect {} has {} parameter{}", count,
                                                          effect.id, effect.parameters.size(),
                                                          effect.parameters.size() == 1 ? "" : "s"));
    for (std::size_t i = 0; i < effect.parameters.size(); ++i) {
        const EffectParameter &parameter = effect.parameters[i];
        // What the caller leaves out is as in the middle of what cameras show.
        const double value = i < count ? values[i] : 0.5 * (parameter.weak + parameter.strong);
        if (!(value >= parameter.minimum && value <= parameter.maximum))
            throw Error(Status::kInvalidArgument,
                        fmt::format("{} of the effect {} is {}, it must be {} to {}{}", parameter.name, effect.id,
                                    value, parameter.minimum, parameter.maximum,
                                    std::string(parameter.unit) == "1" ? "" : " " + std::string(parameter.unit)));
        if (parameter.whole && value != std::round(value))
            throw Error(Status::kInvalidArgument, fmt::format("{} of the effect {} is {}, it must be a whole number",
                                                              parameter.name, effect.id, value));
        result.push_back(value);
    }
    return result;
}

} // namespace clsp

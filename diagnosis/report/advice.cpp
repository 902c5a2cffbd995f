#include "report/advice.hpp"

#include <algorithm>

namespace clsp {
namespace {

struct Pair {
    const char *first, *second, *capture;
};

// Physics of each pair: docs/diagnosis.md.
const Pair kPairs[] = {
    {"linewidth", "depolarization",
     "board_moving behind a linear analyser: contrast returns to 1 only for depolarization"},
    {"linewidth", "motion_decorrelation", "board_static: motion in the exposure leaves it alone, several lines do not"},
    {"depolarization", "motion_decorrelation",
     "board_static: motion in the exposure leaves it alone, depolarization does not"},
    {"aperture_mismatch", "pixel_integration",
     "board_moving at two f-numbers: the pixel's area stays, the grain changes"},
    {"aperture_mismatch", "pupil_obstruction", "board_moving at two f-numbers, and the spectrum near the cut-off"},
    {"aperture_mismatch", "crosstalk", "board_moving at two f-numbers: cross-talk does not change with the aperture"},
    {"pixel_integration", "crosstalk",
     "flat with shot noise at a high level: cross-talk correlates neither noise before nor after it as a pixel's area "
     "does"},
    {"defocus", "beam_flat_top", "dots at two focus settings: defocus changes the dots' width, the beam's shape stays"},
    {"defocus", "subsurface_scattering", "dots on a metallic diffuser: no light spreads below its surface"},
    {"glare", "scatter_background", "board with a dark half: glare reaches into it, the element's scatter does not"},
    {"glare", "subsurface_scattering", "dots on a metallic diffuser: no light spreads below its surface"},
    {"scatter_background", "ambient_light", "dots with the laser off and the shutter open"},
    {"ambient_light", "low_roughness", "board with the laser off and the shutter open"},
    {"power_flicker", "surface_boiling", "board_static with more frames: flicker is common to all pixels"},
    {"airflow", "surface_boiling", "board_static behind a closed tube: air is still in it"},
    {"airflow", "vibration", "board_static behind a closed tube: air is still in it"},
    {"wavelength_shift", "lens_distortion", "dots that reach into the corners: r against r^3"},
    {"vignetting", "ghost_dots", "flat: it shows the lens's fall-off alone"},
    {"prnu", "bayer_mismatch", "flat with more frames, for the 2 x 2 means"},
    {"dsnu", "hot_pixels", "dark with more frames and a longer exposure"},
    {"dsnu", "column_fpn", "dark with more frames"},
    {"gamma", "full_well",
     "board_moving at several levels of light: the full well ends speckle at one level, a bent response bends it at "
     "all"},
    {"gamma", "depolarization",
     "board_moving at several levels of light: a bent response changes the law of speckle by the level, polarization "
     "does not"},
    {"shot_noise", "power_flicker", "flat: lamp light does not flicker with the laser"},
};

} // namespace

std::vector<Advice> advice_for(const std::vector<std::string> &equivalent) {
    const auto has = [&](const char *id) { return std::find(equivalent.begin(), equivalent.end(), id) != equivalent.end(); };
    std::vector<Advice> result;
    for (const Pair &pair : kPairs)
        if (has(pair.first) && has(pair.second))
            result.push_back({{pair.first, pair.second}, pair.capture});
    return result;
}

} // namespace clsp

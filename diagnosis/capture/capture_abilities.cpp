// What a set of sequences can and cannot tell apart, with the physics.
#include "capture/capture_check.hpp"
#include "capture/exposure_series.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <optional>
#include <set>

namespace clsp {
namespace {

// What is there, in the terms of the questions.
struct Contents {
    bool dark = false, flat = false, board = false, dots = false;
    bool at_rest = false, in_motion = false; // speckle that rests, speckle that moves
    bool temporal = false;                   // two frames of anything
    bool temporal_at_rest = false;           // two frames of speckle at rest
    std::uint32_t frames_at_rest = 0;        // of the longest such sequence
    double flat_ratio = 1.0, laser_ratio = 1.0; // brightest over faintest of flat, and of one laser scene in motion
    bool dark_exposures = false, f_numbers = false;
    bool flat_exposures = false; // flats whose light goes as their exposure time
    double dot_radius_ratio = 1.0; // outermost over innermost dot
};

double ratio(const std::vector<double> &levels) {
    if (levels.size() < 2)
        return 1.0;
    const auto [low, high] = std::minmax_element(levels.begin(), levels.end());
    return *low > 0.0 ? *high / *low : 1.0;
}

Contents contents(const CaptureLayout &layout, const std::vector<SequenceSummary> &sequences) {
    Contents c;
    std::vector<double> light_dn, flat_levels, board_levels, dots_levels;
    std::set<double> f_numbers;
    for (const SequenceSummary &s : sequences) {
        const bool speckle = is_laser(s.scene);
        light_dn.push_back(s.level_above_dark_dn);
        c.dark |= s.scene == CaptureScene::kDark;
        c.flat |= s.scene == CaptureScene::kFlat;
        c.board |= s.scene == CaptureScene::kBoard;
        c.dots |= s.scene == CaptureScene::kDots;
        c.at_rest |= speckle && !s.moving;
        c.in_motion |= speckle && s.moving;
        c.temporal |= s.frame_count > 1;
        c.temporal_at_rest |= speckle && !s.moving && s.frame_count > 1;
        if (speckle && !s.moving)
            c.frames_at_rest = std::max(c.frames_at_rest, s.frame_count);
        if (s.scene == CaptureScene::kFlat)
            flat_levels.push_back(s.level_above_dark_dn);
        // Speckle at rest is one draw: its mean is off by chance, and so is its law.
        if (speckle && s.moving)
            (s.scene == CaptureScene::kBoard ? board_levels : dots_levels).push_back(s.level_above_dark_dn);
        if (speckle)
            f_numbers.insert(s.f_number);
    }
    c.flat_ratio = ratio(flat_levels);
    c.laser_ratio = std::max(ratio(board_levels), ratio(dots_levels));
    c.dark_exposures = exposure_count(layout, CaptureScene::kDark) > 1;
    c.f_numbers = f_numbers.size() > 1;
    c.flat_exposures = !exposure_series(layout, light_dn).flats.empty();
    if (layout.dots) {
        double inner = 1e300, outer = 0.0;
        for (const auto &p : layout.dots->positions_px) {
            const double r = std::hypot(p[0] - layout.principal_point_px[0], p[1] - layout.principal_point_px[1]);
            inner = std::min(inner, r);
            outer = std::max(outer, r);
        }
        c.dot_radius_ratio = outer / std::max(inner, 1.0);
    }
    return c;
}

} // namespace

std::vector<CaptureAbility> capture_abilities(const CaptureLayout &layout,
                                              const std::vector<SequenceSummary> &sequences) {
    const Contents c = contents(layout, sequences);
    std::vector<CaptureAbility> result;
    const auto add = [&](const char *topic, bool can, const std::string &reason, const char *advice) {
        result.push_back({topic, can, reason, can ? "" : advice});
    };
    add("offset and read noise", c.dark,
        c.dark ? "a covered lens shows the offsets and the noise of read-out alone"
               : "without a dark sequence the black level and the read noise are the data sheet's, good to a few DN "
                 "and about 15 %; offsets of "
                 "pixels, rows and columns mix with the light",
        "cover the lens: a dark sequence of 16 frames or more");
    add("absolute speckle contrast", c.dark && c.board,
        !c.board ? "contrast is that of an evenly lit, rough, facing board"
        : c.dark ? "standard deviation over mean above the measured dark level"
                 : "contrast is the standard deviation over the mean above dark: without a dark sequence an unknown "
                   "offset changes it, and an offset "
                   "with partial polarization can pass for another law",
        c.board ? "cover the lens: a dark sequence" : "a board under even laser light, and a dark sequence");
    add("black level or ambient light", c.dark && (c.board || c.dots),
        "light that is always there adds to all but the dark sequence; without that it looks like a higher black level",
        "a dark sequence with the lens covered, beside board or dots in the same room light");
    add("noise and change in time", c.temporal,
        c.temporal ? "frames of one scene can be compared"
                   : "single frames have no temporal statistics: noise and fixed patterns cannot be told apart",
        "several frames of each scene, 16 or more");
    add("boiling, vibration and air flow", c.temporal_at_rest,
        c.temporal_at_rest
            ? "the speckle of a resting surface must not change but for noise"
            : "these change the speckle of a scene at rest; where the surface moves, each frame is new anyhow",
        "a static board or dots sequence of 16 frames or more");
    add("flicker or boiling", c.frames_at_rest >= 4,
        "both make the temporal variance grow as the square of the mean; flicker is common to all pixels, boiling "
        "local. That takes some "
        "frames",
        "a static board or dots sequence of 16 frames or more");
    add("motion during the exposure", c.in_motion,
        c.in_motion ? "contrast in motion can be measured"
                    : "speckle decorrelates during the exposure only while the surface moves",
        "a moving board or dots sequence");
    add("laser lines or motion during the exposure", c.at_rest && c.in_motion,
        "both lower the contrast and leave the grain; lines do so at rest as well, motion does not",
        c.at_rest     ? "a moving sequence of the same board"
        : c.in_motion ? "a static sequence of the same board"
                      : "a static and a moving sequence of a board");
    add("laser lines or depolarization", c.board && c.dark,
        "both lower the contrast; they have other intensity laws, and polarization cannot lower it below 0.71. Weak "
        "ones can be told apart only "
        "behind an analyser, where contrast returns to 1 for polarization alone",
        "a board and a dark sequence; for weak effects also the board behind a linear analyser");
    add("pixel response (PRNU) or speckle that stays", c.flat,
        c.flat ? "light without speckle shows the pixels' gains"
               : "on a board both are a fixed grain; only light without speckle shows the pixels alone",
        "a flat sequence under an LED, 16 frames or more; or a board in many positions");
    add("vignetting or unequal dots", c.flat || c.board,
        c.flat || c.board ? "even light shows the fall-off of the lens"
                          : "the flux of dots over the field is that of lens and pattern together",
        "a flat sequence");
    // But for a series of exposures every sequence's own light is calibrated: a response that bends shows in what light
    // does within a sequence alone.
    constexpr double kSeveralLevels = 1.5;
    const bool flats_tell = c.flat_exposures && c.flat_ratio >= kSeveralLevels;
    add("shot noise, gamma and full well", flats_tell || c.laser_ratio >= kSeveralLevels,
        flats_tell ? fmt::format(
                         "flat levels span a factor of {:.1f} and go as exposure_ms: their means show a bent response, "
                         "their noise the photons'",
                         c.flat_ratio)
        : c.laser_ratio >= kSeveralLevels
            ? fmt::format("levels of one moving laser scene span a factor of {:.1f}: a bent response and a full well "
                          "change the law of speckle by the level, other causes do not; the variance follows the light",
                          c.laser_ratio)
        : c.flat_ratio >= kSeveralLevels
            ? fmt::format("flat levels span a factor of {:.1f}, and the noise of each is compared: that shows shot "
                          "noise. Their means show no bent response and no full well: light that does not go as "
                          "exposure_ms, of six times at least, is calibrated for each",
                          c.flat_ratio)
            : "at one level of light the slope of variance against mean, a bent response and a low full well are "
              "weakly determined: "
              "the calibrated gain takes up most of it",
        "one moving board at two or more levels of light, up to near saturation; or flats under one lamp at six or "
        "more exposure_ms");
    add("beam and diffractive element", c.dots,
        c.dots ? "shape, place and flux of dots can be measured"
               : "beam shape, zero order, ghosts and scatter show in the dot pattern only",
        "a dots sequence, and the ideal dots in capture.json");
    add("defocus or aperture", c.dots,
        c.dots ? "defocus widens dots and leaves the grain; a wrong f-number changes both"
               : "defocus leaves the grain of an even board as it is: it shows in "
                 "dots only",
        "a dots sequence");
    add("wavelength or distortion", c.dots && c.dot_radius_ratio >= 3.0,
        !c.dots ? "both move dots outwards, the wavelength as the radius, distortion as its cube"
        : c.dot_radius_ratio >= 3.0
            ? fmt::format("dots lie at radii that span a factor of {:.0f}: r against r^3", c.dot_radius_ratio)
            : "all dots lie at nearly the same radius: r and r^3 cannot be told apart",
        "a dots sequence with dots from the centre to the corners");
    add("aperture, pixel integration or crosstalk", c.f_numbers,
        c.f_numbers ? "the grain follows the f-number, the pixel does not"
                    : "all three change the grain and the contrast; at one f-number only the shape of the spectrum "
                      "tells them apart",
        "the same board at another f-number (f_number of the sequence)");
    add("offset or dark current", c.dark_exposures,
        c.dark_exposures ? "dark current raises the dark level with the exposure time, an offset stays"
                         : "at one exposure time both are a dark level",
        "dark sequences at two or more exposure times (exposure_ms)");
    return result;
}

} // namespace clsp

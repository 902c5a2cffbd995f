#include "measure/gap_stages.hpp"

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <string>

namespace clsp {
namespace {

// A sequence differs if one of its statistics is off by that many standard deviations and by that part of the worst
// one.
constexpr double kDeviations = 5.0, kPartOfWorst = 0.01;

struct Seen {
    bool recorded = false, differs = false;
};

// What differs in one kind of scene would differ in the other, too, if it were there, and does not: most of those
// statistics are as sharp there, and clearly off from what it would be. Fringes that many moving surfaces show drown in
// the speckle of one that rests, and light that rises to one side is off by 4 deviations there instead of 34.
constexpr double kClearlyOff = 3.0;
bool would_show(const CaptureLayout &layout, const std::vector<GapPlace> &places, bool moving, double least) {
    const auto sequence_of = [&](const GapPlace &place) {
        return std::find_if(layout.sequences.begin(), layout.sequences.end(),
                            [&](const SequenceLayout &s) { return s.name == place.statistic.sequence; });
    };
    int compared = 0, seen = 0;
    for (const GapPlace &place : places) {
        const auto sequence = sequence_of(place);
        if (std::abs(place.z) <= least || sequence == layout.sequences.end() || sequence->moving != moving)
            continue;
        for (const GapPlace &other : places) {
            const auto there = sequence_of(other);
            if (there == layout.sequences.end() || there->scene != sequence->scene || there->moving == moving ||
                other.statistic.name != place.statistic.name || other.statistic.region != place.statistic.region)
                continue;
            const double here = deviation_of(place), same = deviation_of(other);
            const double expected = place.z * (here > 0.0 && same > 0.0 ? here / same : 1.0);
            ++compared;
            seen += std::abs(expected) > kDeviations && std::abs(expected - other.z) > kClearlyOff ? 1 : 0;
        }
    }
    return compared == 0 || 2 * seen > compared;
}

// Clearly more of a statistic: by that part of the worst deviation.
constexpr double kClearPart = 0.2;
bool dots_show_more(const std::vector<GapPlace> &places, const char *name, double least) {
    return std::any_of(places.begin(), places.end(), [&](const GapPlace &place) {
        return place.statistic.name == name && place.z > kDeviations && place.z > least;
    });
}

// Light where the pattern has none. What happens at the surface or in the laser takes the light of a pattern nowhere
// else on average (but under the surface, which a board does not show).
bool light_falls_between_dots(const std::vector<GapPlace> &places, double worst) {
    return dots_show_more(places, "light_between_dots", kClearPart * worst);
}

// Spots where the pattern has none: a copy of the image. Where boards differ, too, which a copy of their speckle makes
// of less contrast, no pattern has made it. Of the check's sets (docs/results/gap-check.md) those with copies have
// 0.16 of the worst deviation there and more, those of other causes 0.09 at most.
constexpr double kPartOfSpots = 0.125;
bool spots_between_dots(const std::vector<GapPlace> &places, double worst) {
    return std::any_of(places.begin(), places.end(), [&](const GapPlace &place) {
        return place.statistic.name.rfind("peak_", 0) == 0 && place.statistic.name != "peak_on_axis" &&
               place.z > kDeviations && place.z > kPartOfSpots * worst;
    });
}

// Some dots have no light, which lies nowhere else either: the pattern lacks them. Their width is that of noise.
bool dots_are_missing(const std::vector<GapPlace> &places, double worst) {
    return dots_show_more(places, "core_below_10_percent", kClearPart * worst) &&
           !dots_show_more(places, "light_between_dots", 0.0);
}

// What lies between wider dots may be their tails.
bool dots_are_wider(const std::vector<GapPlace> &places, double worst) {
    return dots_show_more(places, "dot_width", kClearPart * worst) ||
           dots_show_more(places, "dot_width_x", kClearPart * worst) ||
           dots_show_more(places, "dot_width_y", kClearPart * worst);
}

// Resting light that changes as a whole: the frame's mean without its rows and columns; or, under a rolling shutter,
// its rows by that many times what its columns do. Whatever moves changes rows and columns alike.
constexpr double kRowsOverColumns = 5.0, kPartOfMean = 0.25;
bool light_changes(const CaptureLayout &layout, const std::vector<GapPlace> &places) {
    return std::any_of(layout.sequences.begin(), layout.sequences.end(), [&](const SequenceLayout &sequence) {
        if (sequence.moving || !is_laser(sequence.scene))
            return false;
        const auto find = [&](const char *name) {
            const auto found = std::find_if(places.begin(), places.end(), [&](const GapPlace &place) {
                return place.statistic.sequence == sequence.name && place.statistic.name == name;
            });
            return found == places.end() ? nullptr : &*found;
        };
        const GapPlace *const mean = find("frame_mean_fluctuation"), *const rows = find("row_noise"),
                              *const columns = find("column_noise");
        if (!rows || !columns)
            return false;
        if (rows->z > kDeviations && rows->real - rows->sim > kRowsOverColumns * std::abs(columns->real - columns->sim))
            return true;
        return mean && mean->z > kDeviations &&
               std::max(std::abs(rows->z), std::abs(columns->z)) < kPartOfMean * mean->z;
    });
}

bool is_one_of(const std::string &stage, std::initializer_list<const char *> stages) {
    return std::any_of(stages.begin(), stages.end(), [&](const char *s) { return stage == s; });
}

void set_stage(std::vector<GapPlace> &places, const char *stage, std::initializer_list<const char *> kept) {
    for (GapPlace &place : places)
        if (!is_one_of(place.statistic.stage, kept))
            place.statistic.stage = stage;
}

} // namespace

double deviation_of(const GapPlace &place) {
    return place.z != 0.0 ? std::abs((place.real - place.sim) / place.z) : 0.0;
}

void place_stages(const CaptureLayout &layout, std::vector<GapPlace> &places, const std::string &alike) {
    double worst = 0.0;
    for (const GapPlace &place : places)
        worst = std::max(worst, std::abs(place.z));
    const double least = std::max(kDeviations, kPartOfWorst * worst);
    Seen dark, flat, boards, dots, resting, moving;
    for (const SequenceLayout &sequence : layout.sequences) {
        const bool differs = std::any_of(places.begin(), places.end(), [&](const GapPlace &place) {
            return place.statistic.sequence == sequence.name && std::abs(place.z) > least;
        });
        const auto see = [&](Seen &group) {
            group.recorded = true;
            group.differs = group.differs || differs;
        };
        const bool speckle = is_laser(sequence.scene);
        see(sequence.scene == CaptureScene::kDark    ? dark
            : sequence.scene == CaptureScene::kFlat  ? flat
            : sequence.scene == CaptureScene::kBoard ? boards
                                                     : dots);
        if (speckle)
            see(sequence.moving ? moving : resting);
    }
    if (dark.differs)
        set_stage(places, "sensor", {});
    else if (flat.differs)
        set_stage(places, "sensor", {"sensor", "optics"});
    else if ((dark.recorded || flat.recorded) && light_changes(layout, places))
        set_stage(places, "laser", {});
    else if (resting.differs && moving.recorded && !moving.differs && would_show(layout, places, false, least))
        set_stage(places, "motion", {});
    else if (moving.differs && resting.recorded && !resting.differs && would_show(layout, places, true, least)) {
        // What a sensor remembers shows where something moves; one that repeats frames would repeat dark ones, too.
        for (GapPlace &place : places)
            if (place.statistic.stage != "sensor" || place.statistic.name == "repeated_frames")
                place.statistic.stage = "motion";
    } else if (dots.differs && boards.recorded && !boards.differs && dots_are_missing(places, worst))
        set_stage(places, "doe", {"laser"});
    else if (dots.differs && boards.recorded && !boards.differs)
        set_stage(places, "doe", {"doe", "laser", "optics"});
    else if (dots.differs && boards.differs &&
             (light_falls_between_dots(places, worst) || spots_between_dots(places, worst)))
        set_stage(places, "optics", {"sensor"});
    else if (!alike.empty())
        set_stage(places, alike.c_str(), {});
    // One cause at a time: no pattern falls on the boards, and none makes dots wider.
    if (boards.differs || (dots.differs && dots_are_wider(places, worst) && !dots_are_missing(places, worst)))
        for (GapPlace &place : places)
            if (place.statistic.stage == "doe")
                place.statistic.stage = "optics";
}

} // namespace clsp

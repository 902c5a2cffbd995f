#include "attribution/gap_stages.hpp"

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <string>

namespace clsp {
namespace {

// A sequence differs if one of its statistics is off by that many standard deviations and by that part of the worst one.
constexpr double kDeviations = 5.0, kPartOfWorst = 0.01;

struct Seen {
    bool recorded = false, differs = false;
};

bool is_one_of(const std::string &stage, std::initializer_list<const char *> stages) {
    return std::any_of(stages.begin(), stages.end(), [&](const char *s) { return stage == s; });
}

void set_stage(std::vector<GapPlace> &places, const char *stage, std::initializer_list<const char *> kept) {
    for (GapPlace &place : places)
        if (!is_one_of(place.statistic.stage, kept))
            place.statistic.stage = stage;
}

} // namespace

void place_stages(const CaptureLayout &layout, std::vector<GapPlace> &places) {
    double worst = 0.0;
    for (const GapPlace &place : places)
        worst = std::max(worst, std::abs(place.z));
    Seen dark, flat, boards, dots, resting, moving;
    for (const SequenceLayout &sequence : layout.sequences) {
        const bool differs = std::any_of(places.begin(), places.end(), [&](const GapPlace &place) {
            return place.statistic.sequence == sequence.name && std::abs(place.z) > std::max(kDeviations, kPartOfWorst * worst);
        });
        const auto see = [&](Seen &group) {
            group.recorded = true;
            group.differs = group.differs || differs;
        };
        const bool speckle = sequence.scene == CaptureScene::kBoard || sequence.scene == CaptureScene::kDots;
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
    else if (resting.differs && moving.recorded && !moving.differs)
        set_stage(places, "motion", {});
    else if (moving.differs && resting.recorded && !resting.differs)
        set_stage(places, "motion", {"motion", "sensor"});
    else if (dots.differs && boards.recorded && !boards.differs)
        set_stage(places, "doe", {"doe", "laser", "optics"});
}

} // namespace clsp

#include "inference/ladder.hpp"

#include "capture/applicability.hpp"
#include "capture/capture_check.hpp"

#include <algorithm>
#include <cmath>

namespace clsp {
namespace {

Capture part_of(const Capture &capture, unsigned scenes) {
    Capture part;
    part.layout = capture.layout;
    part.layout.sequences.clear();
    for (std::size_t s = 0; s < capture.codes.size(); ++s) {
        const SequenceLayout &sequence = capture.layout.sequences[s];
        if (!(scenes >> static_cast<unsigned>(sequence.scene) & 1u))
            continue;
        part.layout.sequences.push_back(sequence);
        part.codes.push_back(capture.codes[s]);
    }
    return part;
}

std::vector<const Candidate *> visible_in(const CaptureLayout &layout, const std::vector<Candidate> &candidates) {
    std::vector<const Candidate *> result;
    const std::vector<EffectVisibility> visibilities = effect_visibilities(layout);
    for (const Candidate &candidate : candidates) {
        const auto known = std::find_if(visibilities.begin(), visibilities.end(),
                                        [&](const EffectVisibility &v) { return v.id == candidate.id; });
        if (known == visibilities.end() || !known->sequences.empty())
            result.push_back(&candidate);
    }
    return result;
}

// What a rung leaves.
struct Left {
    StatisticInfo statistic;
    double deviation;
};

// By the statistics of another runner of the same capture.
Eigen::VectorXd unexplained_by(const std::vector<Left> &left, const ReplicateRunner &runner) {
    if (left.empty())
        return {};
    Eigen::VectorXd result = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(runner.count()));
    for (std::size_t i = 0; i < runner.count(); ++i)
        for (const Left &one : left) {
            const StatisticInfo &statistic = runner.list()[i];
            if (one.statistic.sequence == statistic.sequence && one.statistic.name == statistic.name &&
                one.statistic.region == statistic.region)
                result[static_cast<Eigen::Index>(i)] = one.deviation;
        }
    return result;
}

} // namespace

std::vector<Rung> rungs_of(const CaptureLayout &layout) {
    std::vector<Rung> result;
    for (const CaptureScene scene :
         {CaptureScene::kDark, CaptureScene::kFlat, CaptureScene::kBoard, CaptureScene::kDots}) {
        Rung rung{scene, {}};
        for (const SequenceLayout &sequence : layout.sequences)
            rung.sequences.push_back(sequence.scene == scene);
        if (std::count(rung.sequences.begin(), rung.sequences.end(), true))
            result.push_back(std::move(rung));
    }
    return result;
}

SearchStart climb(const std::shared_ptr<Context> &context, const Capture &capture,
                  const std::vector<Hypothesis> &hypotheses, const std::vector<Candidate> &candidates,
                  const ReplicateRunner &runner, unsigned threads, const SearchOptions &options,
                  const Progress &progress) {
    SearchStart start;
    std::vector<Left> left;
    SearchOptions of_rung = options;
    of_rung.level = options.residual_level; // what is no gap of the capture is no effect's either
    of_rung.whole = false;
    std::size_t below = 0;
    for (const unsigned scenes : {unsigned{kInDark}, unsigned{kInDark | kInFlat}}) {
        const Capture part = part_of(capture, scenes);
        if (part.codes.size() == below || part.codes.size() == capture.codes.size())
            continue;
        below = part.codes.size();
        ReplicateRunner own(context, part, hypotheses, threads);
        own.checkpoint = runner.checkpoint;
        const std::vector<const Candidate *> visible = visible_in(part.layout, candidates);
        start.unexplained = unexplained_by(left, own);
        SearchResult found = search(own, visible, start, of_rung, progress);
        start.work += found.work * own.capture_work() / runner.capture_work();
        const Eigen::VectorXd deviations = left_by(found.last(), options.residual_level);
        left.clear();
        for (Eigen::Index k = 0; k < deviations.size(); ++k)
            if (deviations[k] > 0.0)
                left.push_back({own.list()[static_cast<std::size_t>(k)], deviations[k]});
        if (found.models.empty())
            continue;
        start.model = std::move(found.model);
        start.steps = std::move(found.steps);
        // Where all is explained the strengths are right. A large gap above would draw them away, and few come back.
        start.model.hold(left.empty());
    }
    start.unexplained = unexplained_by(left, runner);
    return start;
}

} // namespace clsp

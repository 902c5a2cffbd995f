// The ladder: the light path backwards, a rung at a time. Dark frames tell few effects apart and simulate in no time,
// flats a few more; what they tell is there already when speckle and dots are looked at.
#pragma once

#include "capture/capture.hpp"
#include "inference/search.hpp"

#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace clsp {

// Which sequences of a layout belong to a rung; in the order of the ladder, those that have none left out.
struct Rung {
    CaptureScene scene;
    std::vector<bool> sequences;
};
std::vector<Rung> rungs_of(const CaptureLayout &layout);

// Where a search of all sequences begins: the effects that dark and flat frames show, and what these frames leave
// unexplained, by the statistics of `runner`. A search of its own for each of the two rungs that there are beside
// others; effects of a rung below are free to follow, as its frames stay part of the fit. candidates: outlive the
// result.
SearchStart climb(const std::shared_ptr<Context> &context, const Capture &capture,
                  const std::vector<Hypothesis> &hypotheses, const std::vector<Candidate> &candidates,
                  const ReplicateRunner &runner, unsigned threads, const SearchOptions &options,
                  const Progress &progress);

} // namespace clsp

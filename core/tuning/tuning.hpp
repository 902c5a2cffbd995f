// Measures which engine is the fastest on a device, and keeps that as a tuning record.
#pragma once

#include "fft/plan/tuning_record.hpp"
#include "runtime/context.hpp"
#include "runtime/progress.hpp"

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace clsp {

constexpr std::uint32_t kMostTunedFrames = 10000;
constexpr std::uint32_t kMostTunedSizes = 64;

struct TuneSize {
    std::uint32_t width, height; // of the image; the field grid follows from it
};

struct TuneParameters {
    std::vector<TuneSize> sizes;           // none: default_tune_sizes()
    std::uint32_t frames = 15;             // measured of each candidate
    double relative_diameter = 0.5;        // of the aperture
    std::optional<bool> work_group_shapes; // measure several shapes of work-groups; none: on all devices but CPUs
    bool keep = true;                      // in the record's file
    std::string path;                      // of that file; "": the context's
    ProgressFunction progress;
};

struct Tuning {
    TuningRecord measured; // what was measured now
    std::string path;      // where it was written; "": nowhere
};

const std::vector<TuneSize> &default_tune_sizes();

// Times of one candidate, in ms.
struct Times {
    double median = 0.0, spread = 0.0; // spread: 1.4826 times the median absolute deviation
    std::uint32_t count = 0;
};
Times times_of(std::vector<double> ms);

// The number of the candidate to take: the first that is not slower than the fastest by more than the noise of both
// medians, and at least by 2 %. Candidates come in the order in which they are preferred. `reason` says why.
std::size_t choose_candidate(const std::vector<TunedCandidate> &candidates, std::uint32_t frames, std::string &reason);

// Blocks. Throws kCancelled, with nothing written, when the progress function asks for it.
Tuning tune(const std::shared_ptr<Context> &context, const TuneParameters &parameters);

} // namespace clsp

// Diagnoses whose reports are tested: the frames and the evidence are real, verdicts and numbers are made by hand.
#ifndef CLSPECKLE_TESTS_SAMPLE_REPORTS_HPP
#define CLSPECKLE_TESTS_SAMPLE_REPORTS_HPP

#include "capture_support.hpp"
#include "measure/diagnosis_result.hpp"

#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace sample {

struct Sequence {
    const char *name;
    clsp::CaptureScene scene;
    bool moving;
    std::uint32_t frames;
};

struct Sample {
    std::unique_ptr<clsp::ReplicateRunner> runner;
    clsp::Capture real;
    clsp::FittedModel baseline, with_effects;
    clsp::DiagnosisResult result;
};

clsp::CaptureLayout layout(const std::vector<Sequence> &sequences);

// Frames with defocus; the model with effects has it, too.
Sample with_evidence(const std::shared_ptr<clsp::Context> &context, const std::vector<Sequence> &sequences,
                     bool with_model);

// By name: the reports of every kind of verdict and of poor captures.
std::vector<std::pair<std::string, clsp::DiagnosisResult>> reports(const std::shared_ptr<clsp::Context> &context);

} // namespace sample

#endif

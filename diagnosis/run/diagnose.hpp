// The whole diagnosis of a capture: gap, place, cause, shrinkage.
#pragma once

#include "measure/diagnosis_result.hpp"

namespace clsp {

// Throws Error with kCancelled when progress returns false.
DiagnosisResult diagnose(std::shared_ptr<Context> context, const Capture &capture, const DiagnosisOptions &options);

} // namespace clsp

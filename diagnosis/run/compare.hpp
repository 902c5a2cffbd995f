// A real capture set against one of any simulator: where they differ, and which effects, put on the simulated frames,
// would close how much.
#pragma once

#include "measure/comparison_result.hpp"
#include "run/diagnose.hpp"

#include <memory>

namespace clsp {

// The options' hypotheses must be empty. `sim` of the result's places is the simulated set. Throws as diagnose(), and
// kInvalidArgument for sets that cannot be compared.
DiagnosisResult compare(std::shared_ptr<Context> context, const Capture &real, const Capture &sim,
                        const DiagnosisOptions &options);

} // namespace clsp

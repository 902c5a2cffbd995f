// Hypotheses that are given as OpenCL source: a function of a pixel, run on the device.
#pragma once

#include "runtime/context.hpp"
#include "simulator/hypothesis.hpp"

#include <functional>
#include <memory>

namespace clsp {

// Throws kInvalidArgument unless the hypothesis has source that can be tried, and names of parameters that can stand in it.
void check_opencl_hypothesis(const Hypothesis &hypothesis);

// Compiles the source; what it does to a frame. Throws kBuild with the compiler's log. The function is for one thread at a
// time and waits for the device.
std::function<void(const HypothesisFrame &)> opencl_hypothesis(std::shared_ptr<Context> context,
                                                               const Hypothesis &hypothesis);

} // namespace clsp

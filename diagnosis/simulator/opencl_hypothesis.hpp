// Hypotheses that are given as OpenCL source: a function of a pixel, run on the device.
#pragma once

#include "runtime/command_chain.hpp"
#include "runtime/context.hpp"
#include "runtime/opencl.hpp"
#include "simulator/hypothesis.hpp"

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>

namespace clsp {

// Throws kInvalidArgument unless the hypothesis has source that can be tried, and names of parameters that can stand in
// it.
void check_opencl_hypothesis(const Hypothesis &hypothesis);

// A frame's place, as the source sees it.
struct HypothesisPlace {
    std::uint32_t width, height, bits, sequence, scene; // scene: as in the C interface
    bool moving;
    std::uint32_t frame_index;
    std::uint64_t seed;
    double f_number, pixel_pitch_m, wavelength_m;
};

// The compiled source. For one thread at a time.
class OpenclHypothesis {
  public:
    // Throws kBuild with the compiler's log.
    OpenclHypothesis(std::shared_ptr<Context> context, const Hypothesis &hypothesis);
    // before, after: height x width floats, row by row. values: one for each parameter.
    void enqueue(CommandChain &chain, const cl::Buffer &before, const cl::Buffer &after, const HypothesisPlace &place,
                 const double *values);

  private:
    cl::Kernel kernel_;
    std::uint32_t number_;
    std::size_t value_count_;
};

// Compiles the source; what it does to a frame. Throws kBuild with the compiler's log. The function is for one thread
// at a time and waits for the device.
std::function<void(const HypothesisFrame &)> opencl_hypothesis(std::shared_ptr<Context> context,
                                                               const Hypothesis &hypothesis);

} // namespace clsp

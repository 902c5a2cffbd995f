// Effects of the catalogue on frames that another simulator has finished, as far as that can be done: with the device
// code of lens and sensor, the frames' own signal as the light.
#pragma once

#include "capture/capture.hpp"
#include "runtime/context.hpp"
#include "simulator/simulator.hpp"

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace clsp {

// Why an effect cannot be put on finished frames; empty if it can.
std::string finished_frames_refusal(const std::string &effect, const CaptureLayout &layout);

// The frames of a static scene are parted into the mean over time, which is light and goes through lens and sensor, and
// the rest, which is noise and comes to it behind the sensor. Frames of a moving scene are light as they are; of the
// read noise in them what spreading or dimming takes away is added again. Every altered frame is rounded to codes anew,
// with triangular noise of two codes' width before (see HostNoise). So it is with no effect at all, so that differences
// of altered frames are free of it. Of static scenes as much of the frames' own noise is taken away.
class FinishedFrames {
  public:
    // capture: lives longer than this object; its layout's black level and read noise are those of its frames.
    FinishedFrames(std::shared_ptr<Context> context, const Capture &capture);
    ~FinishedFrames();

    // False where the effect leaves the frames as they are.
    bool concerns(const std::string &effect, std::size_t sequence) const;
    // All frames of a sequence with effects, at the light that they had. Parameters are what comes to what is in the
    // frames already. The same seed gives the same random numbers whatever the effects; fixed patterns are the same in
    // all sequences.
    std::vector<std::uint16_t> codes(std::size_t sequence, const std::vector<EffectSetting> &effects,
                                     std::uint64_t seed);

  private:
    struct Implementation;
    std::unique_ptr<Implementation> implementation_;
};

} // namespace clsp

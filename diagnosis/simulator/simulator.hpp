// Captures from the simulator: the baseline camera of a capture's layout, with any effects.
#pragma once

#include "capture/capture.hpp"
#include "runtime/context.hpp"
#include "simulator/hypothesis.hpp"
#include "simulator/settings.hpp"

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace clsp {

// Draws sequences. One object is used by one thread at a time; it keeps pipelines, buffers and the intensities of the
// sequences drawn last.
class Simulator {
  public:
    Simulator(std::shared_ptr<Context> context, const CaptureLayout &layout, std::vector<Hypothesis> hypotheses = {});
    ~Simulator();

    const CaptureLayout &layout() const;

    // Whether an effect can show in a sequence at all: an effect of dots not on a board, flicker of the laser not in
    // the dark ... Where it cannot, codes() takes no notice of it. Hypotheses on irradiance and intensity are not
    // applied in the dark. A field of unit phasors has no surface_boiling and no motion_decorrelation.
    bool concerns(const std::string &id, std::size_t sequence) const;

    // Those of the effects that codes() takes notice of, in an order that does not matter to it: lists that are the
    // same give the same frames.
    std::vector<EffectSetting> concerning(const std::vector<EffectSetting> &effects, std::size_t sequence) const;

    // Frames 0 ... frame_count - 1 of a sequence: frame_count * height * width codes. The same seed gives the same
    // surfaces, noise and fixed patterns whatever the effects (common random numbers). Fixed patterns of the sensor
    // (prnu, dsnu, column_fpn, hot_pixels) depend on the seed alone: they are the same in all sequences of a capture.
    // Speckle and temporal noise differ between sequences.
    void codes(std::size_t sequence, const std::vector<EffectSetting> &effects, const SimulationLevels &levels,
               std::uint64_t seed, std::uint32_t frame_count, std::uint16_t *codes);

    // Mean over pixels (unmasked) and frames of the intensity behind the lens, without ambient light; what gain_dn
    // multiplies.
    double mean_intensity(std::size_t sequence, const std::vector<EffectSetting> &effects, std::uint64_t seed,
                          std::uint32_t frame_count);

    // What is kept in memory at most, in bytes of intensities; 256 MB unless told. What does not fit is rendered again
    // each time.
    void set_cache_bytes(std::size_t bytes);

  private:
    struct Implementation;
    std::unique_ptr<Implementation> implementation_;
};

// All sequences of the simulator's layout with their frame counts. levels: one for each sequence.
Capture simulate_capture(Simulator &simulator, const std::vector<EffectSetting> &effects,
                         const std::vector<SimulationLevels> &levels, std::uint64_t seed);

} // namespace clsp

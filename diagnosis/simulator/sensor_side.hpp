// From a sequence's intensities to codes.
#pragma once

#include "simulator/optics.hpp"
#include "simulator/sequence_model.hpp"

#include <map>
#include <memory>
#include <vector>

namespace clsp {

class SensorSide {
  public:
    SensorSide(std::shared_ptr<Context> context, const CaptureLayout &layout);

    // True if the intensities go to the sensor as they are.
    static bool passes_light(const SequenceModel &model) {
        return model.power_flicker == 0.0 && model.corner_loss == 0.0 && model.ambient_dn == 0.0 && !model.uneven &&
               !model.drifting && model.on_intensity.empty();
    }
    // max(0, 1 + sigma n) for each frame, times the lamp's drift.
    std::vector<float> laser_factors(const SequenceModel &model, std::size_t sequence, std::uint64_t seed,
                                     std::uint32_t frame_count) const;
    // Of the light of lamp or laser, at each pixel: its unevenness times 1 - corner_loss r^2, as the kernel has it.
    std::vector<float> fall_off(const SequenceModel &model, std::size_t sequence);
    // frame_count images in light(): laser power, unevenness, ambient (in units of intensity) and fall-off.
    void enqueue_light(cl_command_queue queue, const SequenceModel &model, std::size_t sequence,
                       const std::vector<float> &factors,
                       double ambient, const DeviceBuffer &intensities, std::uint32_t frame_count);
    const DeviceBuffer &light() const { return light_; }
    // frame_count images of codes in codes(). one_light: all frames have the first image of `light`.
    void enqueue_expose(cl_command_queue queue, const SequenceModel &model, const SimulationLevels &levels,
                        std::size_t sequence, std::uint64_t seed, const DeviceBuffer &light, bool one_light,
                        std::uint32_t frame_count);
    const DeviceBuffer &codes() const { return codes_; }

  private:
    void configure(const SequenceModel &model, const SimulationLevels &levels, std::uint64_t seed);
    // What light is off from 1 at each pixel.
    struct Unevenness {
        std::vector<float> host;
        DeviceBuffer device;
    };
    const Unevenness &unevenness_of(std::size_t sequence);
    // Of lamp or laser, where the light with what is constant is off by 1; 0 where it is even.
    float uneven_part(const SequenceModel &model, std::size_t sequence) const {
        return model.uneven ? static_cast<float>(variation_of_source(layout_.sequences[sequence].illumination.level_dn,
                                                                     model.ambient_dn))
                            : 0.0f;
    }

    std::shared_ptr<Context> context_;
    CaptureLayout layout_;
    std::size_t pixels_;
    std::unique_ptr<Sensor> sensor_;
    DeviceBuffer light_, factors_, codes_;
    std::map<std::size_t, Unevenness> unevenness_; // by sequence, made on first use
    cl::Kernel finish_;
};

} // namespace clsp

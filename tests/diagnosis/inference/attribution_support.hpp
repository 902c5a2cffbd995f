// A small camera and captures of the simulator's own, for tests of the attribution.
#pragma once

#include "capture_support.hpp"
#include "inference/replicate_runner.hpp"
#include "simulator/simulator.hpp"

#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

namespace clsp::attribution_test {

// Seeds of captures lie above those of replicates.
constexpr std::uint64_t kCaptureSeed = 1u << 20;

inline std::shared_ptr<Context> context() {
    static const std::shared_ptr<Context> shared = Context::create({});
    return shared;
}

inline CaptureLayout small_layout() {
    CaptureLayout layout = camera_layout(64, 48);
    layout.f_number = 8.0;
    const auto add = [&](const char *name, CaptureScene scene, bool moving) {
        add_sequence(layout, name, scene, moving, 12);
    };
    add("dark", CaptureScene::kDark, false);
    add("flat", CaptureScene::kFlat, false);
    add("board_moving", CaptureScene::kBoard, true);
    return layout;
}

inline Capture simulated(const EffectSettings &effects, std::uint64_t seed,
                         const std::vector<Hypothesis> &hypotheses = {}, const CaptureLayout &layout = small_layout(),
                         double black_level_dn = 63.2, double read_noise_dn = 4.3) {
    Capture capture;
    capture.layout = layout;
    Simulator simulator(context(), capture.layout, hypotheses);
    for (std::size_t s = 0; s < capture.layout.sequences.size(); ++s) {
        const SequenceLayout &sequence = capture.layout.sequences[s];
        std::vector<std::uint16_t> codes(sequence.frame_count * capture.layout.pixel_count());
        const SimulationLevels levels{sequence.scene == CaptureScene::kFlat ? 300.0 : 120.0, black_level_dn,
                                      read_noise_dn};
        simulator.codes(s, effects, levels, seed, sequence.frame_count, codes.data());
        capture.codes.push_back(std::move(codes));
    }
    return capture;
}

} // namespace clsp::attribution_test

// What a diagnosis simulates is what a pipeline renders: the same effects, seeds and numbers of frames give the same
// codes. Factors of the whole image come to it in another order, whose rounding a code in thousands shows.
#include "diagnosis/simulator/gap_simulator_support.hpp"

#include "capture/applicability.hpp"
#include "capture/frame_changes.hpp"
#include "capture/pixel_oddities.hpp"
#include "effects/effects.hpp"
#include "pipeline/pipeline.hpp"
#include "simulator/optics.hpp"
#include "simulator/sequence_model.hpp"

#include <algorithm>
#include <cstdlib>

namespace clsp::gap_simulator_test {
namespace {

constexpr std::uint64_t kSeed = 7;
constexpr std::uint32_t kFrames = 4;

Codes rendered(const std::shared_ptr<Context> &context, const CaptureLayout &layout, std::size_t sequence,
               const SimulationLevels &levels, const std::vector<EffectSetting> &effects) {
    const SequenceLayout &of = layout.sequences[sequence];
    PipelineModel model = sequence_model(layout, {}, sequence, {}).model;
    model.phase.seed = model.pipeline.seed = model.sensor->seed = kSeed;
    model.sensor->exposure_gain_dn = levels.gain_dn;
    model.sensor->black_level_dn = levels.black_level_dn;
    model.sensor->read_noise_dn = levels.read_noise_dn;
    PipelineStages stages;
    stages.phase = std::make_shared<Phase>(context, model.phase);
    stages.aperture = std::make_shared<Aperture>(context, model.aperture);
    stages.lens = std::make_shared<Lens>(context, model.lens);
    stages.sensor = std::make_shared<Sensor>(context, *model.sensor);
    if (model.dots)
        stages.dots = std::make_shared<Dots>(context, *model.dots);
    PipelineOptions options;
    options.independent_exposures = true;
    Pipeline pipeline(context, stages, model.pipeline, options);
    for (const EffectSetting &effect : effects)
        pipeline.set_effect(effect.id, effect.values.data(), static_cast<std::uint32_t>(effect.values.size()));

    const std::size_t pixels = layout.pixel_count();
    const std::vector<float> ones(pixels, 1.0f);
    const DeviceBuffer light(context, pixels * sizeof(float), ones.data());
    const DeviceBuffer out(context, pixels * sizeof(std::uint16_t));
    cl::CommandQueue queue(context->cl_context(), context->device());
    Codes codes(kFrames * pixels);
    for (std::uint32_t i = 0; i < kFrames; ++i) {
        Frame frame;
        frame.illumination = of.scene == CaptureScene::kDark   ? Illumination::kDark
                             : of.scene == CaptureScene::kFlat ? Illumination::kIncoherent
                                                               : Illumination::kLaser;
        frame.refresh = of.moving ? Refresh::kAll : Refresh::kMask;
        frame.frame_index = frame_number(sequence, i);
        if (of.scene == CaptureScene::kFlat || of.scene == CaptureScene::kBoard)
            frame.irradiance = {light.get()(), 0, 0, layout.width, layout.height, Format::kFloat32};
        frame.output = {out.get()(), 0, 0, layout.width, layout.height, Format::kUint16};
        pipeline.enqueue_frame(queue(), frame, 0, nullptr, nullptr);
        queue.enqueueReadBuffer(out.get(), CL_TRUE, 0, pixels * sizeof(std::uint16_t), &codes[i * pixels]);
    }
    return codes;
}

// Codes that differ, of a thousand; 1000 if one differs by more than 1.
double differing_per_thousand(const Codes &a, const Codes &b) {
    std::size_t differing = 0;
    for (std::size_t i = 0; i < a.size(); ++i) {
        const int step = std::abs(int{a[i]} - int{b[i]});
        if (step > 1)
            return 1000.0;
        differing += step > 0;
    }
    return 1000.0 * double(differing) / double(a.size());
}

class FramesOfEffect : public GapSimulator, public ::testing::WithParamInterface<std::size_t> {};

TEST_P(FramesOfEffect, AreThoseOfAPipeline) {
    const CaptureLayout layout = small_layout();
    const Effect &effect = effect_catalogue()[GetParam()];
    EffectSetting setting{effect.id, {}};
    for (const EffectParameter &parameter : effect.parameters)
        setting.values.push_back(parameter.strong);
    Simulator simulator(context, layout);
    double changed = 0.0; // at most by the effect, so that two that ignore it do not pass
    for (std::size_t s = 0; s < kSequenceCount; ++s) {
        if (!acts_in(effect, layout.sequences[s], layout.field, false))
            continue;
        const Codes simulated = draw(simulator, s, {setting}, kLevels, kSeed, kFrames);
        EXPECT_LE(differing_per_thousand(simulated, rendered(context, layout, s, kLevels, {setting})), 1.0)
            << kNames[s];
        const Codes without = draw(simulator, s, {}, kLevels, kSeed, kFrames);
        changed = std::max(changed, differing_per_thousand(simulated, without));
    }
    EXPECT_GT(changed, 5.0);
}

// What frame_changes() looks for is nothing that an effect does: a diagnosis would call all its captures unknown.
TEST_P(FramesOfEffect, AreOfOneScene) {
    const Effect &effect = effect_catalogue()[GetParam()];
    EffectSetting setting{effect.id, {}};
    for (const EffectParameter &parameter : effect.parameters)
        setting.values.push_back(parameter.strong);
    CaptureLayout layout = small_layout();
    for (SequenceLayout &sequence : layout.sequences)
        sequence.frame_count = 24;
    Simulator simulator(context, layout);
    for (const std::uint64_t seed : {7u, 8u, 9u}) {
        const std::vector<SimulationLevels> levels(kSequenceCount, kLevels);
        const Capture capture = simulate_capture(simulator, {setting}, levels, seed);
        for (std::size_t s = 0; s < kSequenceCount; ++s) {
            const SequenceScan scan = scan_sequence(capture, s);
            for (const CaptureWarning &change : frame_changes(capture.layout, s, scan, kLevels.black_level_dn))
                ADD_FAILURE() << kNames[s] << ", seed " << seed << ": " << change.text;
            // Nor do effects make pixels of one frame, or noise that goes together, but in rows where they say so;
            // vibration alone moves the picture.
            EXPECT_TRUE(!scan.oddities || scan.oddities->transients.empty()) << kNames[s] << ", seed " << seed;
            const bool in_rows = effect.id == std::string("correlated_read_noise");
            for (const NoiseCorrelation *noise : {&scan.correlations.right, &scan.correlations.down})
                EXPECT_FALSE(noise->sure && std::abs(noise->value) > 0.1 &&
                             !(in_rows && noise == &scan.correlations.right))
                    << kNames[s] << ", " << noise->value;
            EXPECT_FALSE(scan.correlations.next.sure && scan.correlations.next.value > 0.25) << kNames[s];
            if (const auto shift = picture_shift(capture.layout, s, scan);
                shift && effect.id != std::string("vibration"))
                ADD_FAILURE() << kNames[s] << ", seed " << seed << ": " << shift->text;
        }
    }
}

INSTANTIATE_TEST_SUITE_P(Catalogue, FramesOfEffect, ::testing::Range(std::size_t{0}, effect_catalogue().size()),
                         [](const auto &of) { return std::string(effect_catalogue()[of.param].id); });

TEST_F(GapSimulator, FramesWithoutEffectsAreThoseOfAPipeline) {
    const CaptureLayout layout = small_layout();
    Simulator simulator(context, layout);
    for (std::size_t s = 0; s < kSequenceCount; ++s)
        EXPECT_EQ(draw(simulator, s, {}, kLevels, kSeed, kFrames), rendered(context, layout, s, kLevels, {}))
            << kNames[s];
}

} // namespace
} // namespace clsp::gap_simulator_test

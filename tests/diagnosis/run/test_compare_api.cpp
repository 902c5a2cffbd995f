// clspCompare and its C++ wrapper: refusals, and a comparison whose numbers come through. Captures of 64 x 48 pixels, 8
// frames.
#include "test_support.hpp"

#include <random>
#include <stdexcept>

namespace {

// Dark and flat of a camera with black level 64 and read noise 4; rows that jump by row_dn in each frame.
clspeckle::Capture make_capture(unsigned seed, double row_dn, std::uint32_t width = 64) {
    auto desc = clspeckle::make<ClspCaptureDesc>();
    desc.width = width;
    desc.height = 48;
    clspeckle::Capture capture(desc);
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    for (const bool flat : {false, true}) {
        std::vector<std::uint16_t> codes;
        for (std::uint32_t row = 0; row < 8 * 48; ++row) {
            const double offset = row_dn * normal(random);
            for (std::uint32_t x = 0; x < width; ++x)
                codes.push_back(static_cast<std::uint16_t>(
                    std::clamp(std::round(64.0 + (flat ? 300.0 : 0.0) + offset + 4.0 * normal(random)), 0.0, 1023.0)));
        }
        capture.add_sequence(flat ? "flat" : "dark", flat ? CLSP_SCENE_FLAT : CLSP_SCENE_DARK, false, codes);
    }
    return capture;
}

class Compare : public test::DeviceTest {
  protected:
    clspeckle::Capture real = make_capture(1, 3.0), sim = make_capture(2, 0.0);
    ClspDiagnoseDesc quick_desc() {
        auto desc = clspeckle::make<ClspDiagnoseDesc>();
        desc.null_replicates = 12;
        desc.max_effects = 1;
        return desc;
    }
};

TEST_F(Compare, RefusesBadArguments) {
    ClspDiagnosis made = nullptr;
    ClspDiagnoseDesc desc = quick_desc();
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "context", clspCompare(nullptr, real, sim, &desc, &made));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "capture", clspCompare(context, nullptr, sim, &desc, &made));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "capture", clspCompare(context, real, nullptr, &desc, &made));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "diagnosis is NULL",
                      clspCompare(context, real, sim, &desc, nullptr));
    desc.null_replicates = 3;
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "null_replicates is 3",
                      clspCompare(context, real, sim, &desc, &made));
    const clspeckle::Capture wide = make_capture(1, 0.0, 72);
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "64 x 48 pixels, those of the simulated set 72 x 48",
                      clspCompare(context, real, wide, nullptr, &made));
    auto empty_desc = clspeckle::make<ClspCaptureDesc>();
    empty_desc.width = 64;
    empty_desc.height = 48;
    const clspeckle::Capture empty(empty_desc);
    EXPECT_NE(clspCompare(context, real, empty, nullptr, &made), CLSP_SUCCESS);
    EXPECT_NE(std::string(test::last_error().message).find("the simulated capture: "), std::string::npos);
    clspeckle::DiagnoseOptions options;
    clspeckle::Hypothesis hypothesis;
    hypothesis.id = "own";
    hypothesis.stage = "sensor";
    hypothesis.parameters = {{"a", "1", 0.0, 1.0, 0.1, 0.2}};
    hypothesis.apply = [](const ClspHypothesisFrame &) {};
    options.hypotheses.push_back(hypothesis);
    EXPECT_THROW(clspeckle::compare(context, real, sim, options), clspeckle::Error);
    EXPECT_EQ(made, nullptr);
}

TEST_F(Compare, TellsWhatTheSimulatorLacks) {
    ClspDiagnoseDesc desc = quick_desc();
    ClspDiagnosis made = nullptr;
    ASSERT_CLSP_OK(clspCompare(context, real, sim, &desc, &made));
    const auto found = clspeckle::Diagnosis::adopt(made);
    const ClspDiagnosisSummary summary = found.summary();
    EXPECT_EQ(summary.detected, 1u);
    ASSERT_GT(summary.ranked_count, 0u);
    EXPECT_STREQ(found.ranking().front().effect, "row_noise");
    EXPECT_NEAR(found.ranking().front().values[0], 3.0, 0.6);
    EXPECT_GT(summary.fraction, 0.5);
    EXPECT_NE(found.report_json().find("\"compare\""), std::string::npos);
    clspeckle::DiagnoseOptions options;
    options.progress = [](const std::string &, double) -> bool { throw std::runtime_error("stop"); };
    EXPECT_THROW(clspeckle::compare(context, real, sim, options), std::runtime_error);
}

} // namespace

// The scenes of a capture as rungs, each judged before those above it.
#include "inference/ladder.hpp"

#include "diagnosis/inference/attribution_support.hpp"
#include "inference/candidate.hpp"

#include <cstdint>
#include <gtest/gtest.h>
#include <vector>

namespace {

using namespace clsp;
using namespace clsp::attribution_test;

TEST(Ladder, RungsAreThoseThatThereAre) {
    const std::vector<Rung> rungs = rungs_of(small_layout());
    ASSERT_EQ(rungs.size(), 3u);
    EXPECT_EQ(rungs[0].scene, CaptureScene::kDark);
    EXPECT_EQ(rungs[1].scene, CaptureScene::kFlat);
    EXPECT_EQ(rungs[2].scene, CaptureScene::kBoard);
    EXPECT_EQ(rungs[2].sequences, (std::vector<bool>{false, false, true}));
}

// What rungs told is held in the searches above, unless they leave something: then it may be wrong. In the second
// capture every third code of the flat is taken for the next one.
TEST(Ladder, WhatExplainedRungsToldIsHeld) {
    SearchOptions options;
    options.seed = 5;
    options.null_replicates = 24;
    const auto start_of = [&](const Capture &capture) {
        const ReplicateRunner runner(context(), capture, {}, 2);
        return climb(context(), capture, {}, candidates({}, {}), runner, 2, options, {});
    };
    Capture capture = simulated({{"dsnu", {3.0}}, {"row_noise", {2.0}}, {"prnu", {0.02}}}, kCaptureSeed + 36);
    const SearchStart explained = start_of(capture);
    EXPECT_EQ(explained.unexplained.size(), 0);
    ASSERT_EQ(explained.model.strengths.size(), 3u);
    for (const Strength &strength : explained.model.strengths)
        EXPECT_TRUE(strength.held);
    for (std::uint16_t &code : capture.codes[1])
        code = static_cast<std::uint16_t>(code + (code % 3 == 0));
    const SearchStart unexplained = start_of(capture);
    EXPECT_GT(unexplained.unexplained.size(), 0);
    ASSERT_FALSE(unexplained.model.strengths.empty());
    for (const Strength &strength : unexplained.model.strengths)
        EXPECT_FALSE(strength.held);
}

} // namespace

// What was simulated before is not simulated again, and is what it would be if it were.
#include "diagnosis/inference/attribution_support.hpp"
#include "inference/memo.hpp"

#include <gtest/gtest.h>

#include <set>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

namespace {

using namespace clsp;
using namespace clsp::attribution_test;

TEST(MemoKey, DiffersWhereAnythingDoes) {
    const std::vector<std::vector<EffectSetting>> lists = {
        {},
        {{"defocus", {0.5}}},
        {{"defocus", {0.5000000000000001}}},
        {{"defocus", {}}},
        {{"defocus", {0.5}}, {"prnu", {0.01}}},
        {{"defocus", {0.5, 0.01}}},
        {{"defocusprnu", {0.5}}},
    };
    std::set<std::string> keys;
    for (const char kind : {'a', 'b'})
        for (const auto &list : lists)
            keys.insert(MemoKey().add_kind(kind).add(list).add(1.0).bytes());
    keys.insert(MemoKey().add_kind('a').add(1.0).add(2.0).bytes());
    keys.insert(MemoKey().add_kind('a').add(2.0).add(1.0).bytes());
    EXPECT_EQ(keys.size(), 2 * lists.size() + 2);
    EXPECT_EQ(MemoKey().add_kind('a').add(lists[4]).bytes(), MemoKey().add_kind('a').add(lists[4]).bytes());
}

TEST(Memo, MakesOnceAndAnewWhenFull) {
    Memo memo(4096);
    int made = 0;
    const auto value = [&](double key) {
        return memo.value(MemoKey().add_kind('v').add(key), [&] {
            ++made;
            return std::vector<double>(8, 2.0 * key);
        });
    };
    EXPECT_EQ(value(1.0), std::vector<double>(8, 2.0));
    EXPECT_EQ(value(1.0), std::vector<double>(8, 2.0));
    EXPECT_EQ(made, 1);
    for (int key = 2; key < 100; ++key)
        EXPECT_EQ(value(key), std::vector<double>(8, 2.0 * key));
    EXPECT_EQ(made, 99);
    EXPECT_EQ(value(99.0), std::vector<double>(8, 198.0));
    EXPECT_EQ(made, 99) << "the last one is kept";
    EXPECT_EQ(value(1.0), std::vector<double>(8, 2.0));
    EXPECT_EQ(made, 100) << "100 times 200 bytes are more than 4096";
}

TEST(Memo, AFailureIsNotKept) {
    Memo memo(4096);
    EXPECT_THROW(memo.value(MemoKey().add_kind('v'), []() -> std::vector<double> { throw std::runtime_error("no"); }),
                 std::runtime_error);
    EXPECT_EQ(memo.value(MemoKey().add_kind('v'), [] { return std::vector<double>{3.0}; }), std::vector<double>{3.0});
}

TEST(Memo, ManyThreads) {
    Memo memo(1 << 14); // fills several times
    std::vector<std::thread> threads;
    std::vector<int> wrong(4, 0);
    for (int t = 0; t < 4; ++t)
        threads.emplace_back([&, t] {
            for (int i = 0; i < 2000; ++i) {
                const double key = (i * (t + 1)) % 97;
                wrong[std::size_t(t)] += memo.value(MemoKey().add_kind('v').add(key), [&] {
                    return std::vector<double>{key, -key};
                }) != std::vector<double>{key, -key};
            }
        });
    for (std::thread &thread : threads)
        thread.join();
    EXPECT_EQ(wrong, std::vector<int>(4, 0));
}

// What is asked for counts, by its patterns, and not what is known already or how many threads there are.
TEST(Work, CountsWholeCaptures) {
    const Capture real = simulated({}, kCaptureSeed);
    const std::vector<bool> all(real.layout.sequences.size(), true);
    double after[2];
    for (const unsigned threads : {1u, 2u}) {
        ReplicateRunner runner(context(), real, {}, threads);
        const CalibratedLevels levels = runner.calibrate({}, all, nullptr);
        EXPECT_EQ(runner.work(), 0.0); // calibrations are few
        runner.replicates({}, levels, {1, 2, 3}, {});
        EXPECT_DOUBLE_EQ(runner.work(), 3.0);
        runner.replicates({}, levels, {1, 2, 3}, {});
        EXPECT_DOUBLE_EQ(runner.work(), 6.0);
        // Two polarizations of the moving board: 2 12 + 2 12 + (2 12 + 24) for frames and patterns instead of 2 12 + 2
        // 12 + (2 12 + 12).
        runner.replicates({{"depolarization", {0.5}}}, levels, {4}, {});
        EXPECT_DOUBLE_EQ(runner.work(), 6.0 + 96.0 / 84.0);
        runner.halves({}, levels, {5, 6}, {false, true, false}, {});
        after[threads - 1] = runner.work();
        EXPECT_DOUBLE_EQ(after[threads - 1], 6.0 + 96.0 / 84.0 + 2 * 12.0 / 84.0);
    }
    EXPECT_EQ(after[0], after[1]);
}

// A worker's runner gives what the runner of all workers gives, and work that asks that one is refused.
TEST(ReplicateRunner, WorkSideBySideAsksItsOwn) {
    const Capture real = simulated({}, kCaptureSeed);
    const std::vector<bool> all(real.layout.sequences.size(), true);
    ReplicateRunner runner(context(), real, {}, 2);
    const CalibratedLevels levels = runner.calibrate({}, all, nullptr);
    std::vector<std::vector<Eigen::VectorXd>> halves(3);
    runner.side_by_side(halves.size(), [&](ReplicateRunner &own, std::size_t i) {
        own.side_by_side(1, [&](ReplicateRunner &inner, std::size_t) { EXPECT_EQ(&own, &inner); });
        halves[i] = own.halves({}, levels, {i, i + 1}, all, {});
    });
    ReplicateRunner other(context(), real, {}, 1);
    for (std::size_t i = 0; i < halves.size(); ++i)
        EXPECT_EQ(halves[i], other.halves({}, levels, {i, i + 1}, all, {}));
    EXPECT_THROW(
        runner.side_by_side(2, [&](ReplicateRunner &, std::size_t) { runner.halves({}, levels, {9}, all, {}); }),
        Error);
    EXPECT_EQ(halves[0], runner.halves({}, levels, {0, 1}, all, {})) << "all workers are free again";
}

// One runner that is asked for all of these, and for each of them one that was asked for nothing before.
TEST(Memo, ARunnerGivesTheSameAsOneThatKnowsNothing) {
    const Capture real = simulated({}, kCaptureSeed);
    const auto runner_of = [&] {
        return std::make_unique<ReplicateRunner>(context(), real, std::vector<Hypothesis>{}, 2);
    };
    const std::unique_ptr<ReplicateRunner> old = runner_of();
    const std::vector<bool> all(real.layout.sequences.size(), true);
    const std::vector<EffectSettings> models = {
        {},
        {{"linewidth", {0.5}}},                                 // the board alone
        {{"linewidth", {0.5}}, {"vignetting", {0.3}}},          // what is lit
        {{"vignetting", {0.3}}, {"linewidth", {0.5}}},          // the same
        {{"linewidth", {0.5}}, {"dsnu", {2.0}}},                // all
        {{"linewidth", {0.5}}, {"dsnu", {2.0}}, {"zero_order", {5.0}}}, // no dots: the same
        {{"adc_bits", {5.0}}},                                  // coarse steps are calibrated in another way
    };
    std::vector<FoldStatistics> replicates;
    for (const EffectSettings &effects : models) {
        const std::unique_ptr<ReplicateRunner> fresh = runner_of();
        const CalibratedLevels levels = old->calibrate(effects, all, nullptr),
                               expected = fresh->calibrate(effects, all, nullptr);
        EXPECT_EQ(levels.black_level_dn, expected.black_level_dn);
        EXPECT_EQ(levels.read_noise_dn, expected.read_noise_dn);
        EXPECT_EQ(levels.signal_share, expected.signal_share);
        const auto a = old->replicates(effects, levels, {1, 2}, {}), b = fresh->replicates(effects, levels, {1, 2}, {});
        const auto half = old->halves(effects, levels, {1, 2}, all, {});
        ASSERT_EQ(a.size(), 2u);
        for (std::size_t i = 0; i < 2; ++i) {
            EXPECT_EQ(a[i].first, b[i].first);
            EXPECT_EQ(a[i].second, b[i].second);
        }
        EXPECT_EQ(half, fresh->halves(effects, levels, {1, 2}, all, {}));
        EXPECT_NE(a[0].first, a[1].first);
        replicates.push_back(a[0]);
    }
    for (std::size_t i = 0; i < models.size(); ++i)
        for (std::size_t j = 0; j < i; ++j)
            EXPECT_EQ(replicates[i].first == replicates[j].first, (i == 3 && j == 2) || (i == 5 && j == 4)) << i << j;
}

} // namespace

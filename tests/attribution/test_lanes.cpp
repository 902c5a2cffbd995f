// Lanes side by side: all are run, the caller's checkpoints are the caller's, and what a lane throws arrives.
#include "attribution/lanes.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

namespace clsp {
namespace {

using Checkpoint = std::function<void()>;

TEST(Lanes, AllRunOnceAndTheFirstIsTheCallers) {
    for (const std::size_t count : {0u, 1u, 2u, 7u}) {
        std::vector<int> runs(count, 0);
        std::vector<std::thread::id> threads(count);
        int checkpoints = 0;
        run_lanes(
            count, [&] { ++checkpoints; },
            [&](std::size_t lane, const Checkpoint &checkpoint) {
                ++runs[lane];
                threads[lane] = std::this_thread::get_id();
                checkpoint();
                checkpoint();
            });
        EXPECT_EQ(std::vector<int>(count, 1), runs);
        EXPECT_EQ(count > 0 ? 2 : 0, checkpoints) << "of lane 0 alone";
        for (std::size_t lane = 0; lane < count; ++lane)
            EXPECT_EQ(lane == 0, threads[lane] == std::this_thread::get_id()) << lane;
    }
    run_lanes(2, {}, [](std::size_t, const Checkpoint &checkpoint) { checkpoint(); });
}

TEST(Lanes, TheyRunSideBySide) {
    std::atomic<int> here{0};
    run_lanes(3, {}, [&](std::size_t, const Checkpoint &) {
        ++here;
        while (here < 3) // would never end one after the other
            std::this_thread::yield();
    });
    EXPECT_EQ(3, here);
}

TEST(Lanes, TheFirstFailureByNumberArrives) {
    for (int repetition = 0; repetition < 20; ++repetition) {
        std::string message;
        std::vector<int> ended(4, 0);
        try {
            run_lanes(4, {}, [&](std::size_t lane, const Checkpoint &) {
                ended[lane] = 1;
                if (lane == 1 || lane == 3)
                    throw std::runtime_error("lane " + std::to_string(lane));
            });
        } catch (const std::runtime_error &error) {
            message = error.what();
        }
        EXPECT_EQ("lane 1", message);
        EXPECT_EQ(std::vector<int>(4, 1), ended);
    }
}

TEST(Lanes, TheCallersCancellationEndsTheOthers) {
    EXPECT_THROW(run_lanes(
                     3, [] { throw std::domain_error("cancelled"); },
                     [&](std::size_t, const Checkpoint &checkpoint) {
                         for (;;) {
                             checkpoint();
                             std::this_thread::yield();
                         }
                     }),
                 std::domain_error);
}

} // namespace
} // namespace clsp

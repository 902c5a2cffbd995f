// Tasks beside the simulation: all are done, no more at once than may, and what they throw arrives.
#include "attribution/measurement_tasks.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <stdexcept>
#include <thread>
#include <vector>

namespace clsp {
namespace {

struct Counter {
    std::atomic<int> now{0}, most{0};
    void work() {
        const int running = ++now;
        int seen = most;
        while (running > seen && !most.compare_exchange_weak(seen, running)) {
        }
        std::this_thread::sleep_for(std::chrono::milliseconds(5));
        --now;
    }
};

TEST(MeasurementTasks, AllAreDoneAndNoMoreAtOnceThanMay) {
    for (const unsigned threads : {0u, 1u, 2u, 3u, 4u, 7u, 64u}) {
        std::vector<int> done(20, 0);
        Counter counter;
        MeasurementTasks tasks(threads);
        for (int &slot : done)
            tasks.start([&counter, &slot] {
                counter.work();
                ++slot;
            });
        tasks.finish();
        EXPECT_EQ(std::vector<int>(20, 1), done) << threads;
        const int most = static_cast<int>(std::clamp(threads, 1u, 4u));
        EXPECT_LE(counter.most, most) << threads;
        EXPECT_LE(tasks.threads_each() * static_cast<unsigned>(most), std::max(threads, 1u)) << threads;
        if (threads >= 2)
            EXPECT_GE(counter.most, 2) << threads;
    }
}

TEST(MeasurementTasks, OneThreadIsTheCallers) {
    MeasurementTasks tasks(1);
    std::thread::id where;
    tasks.start([&] { where = std::this_thread::get_id(); });
    EXPECT_EQ(std::this_thread::get_id(), where);
}

TEST(MeasurementTasks, WhatATaskThrowsArrives) {
    for (const unsigned threads : {1u, 2u, 8u}) {
        MeasurementTasks tasks(threads);
        EXPECT_THROW(
            {
                tasks.start([] { throw std::runtime_error("no"); });
                for (int i = 0; i < 8; ++i)
                    tasks.start([] {});
                tasks.finish();
            },
            std::runtime_error)
            << threads;
        EXPECT_NO_THROW(tasks.finish());
    }
}

// What tasks write to may go once the object has gone, also where its user was cancelled.
TEST(MeasurementTasks, TheDestructorWaits) {
    std::atomic<int> done{0};
    {
        MeasurementTasks tasks(4);
        for (int i = 0; i < 4; ++i)
            tasks.start([&] {
                std::this_thread::sleep_for(std::chrono::milliseconds(20));
                ++done;
                throw std::runtime_error("nobody asks");
            });
    }
    EXPECT_EQ(4, done);
}

} // namespace
} // namespace clsp

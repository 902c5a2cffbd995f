// Workers side by side: all are run, the caller's checkpoints are the caller's, and what a worker throws arrives.
#include "statistics/workers.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

namespace clsp {
namespace {

TEST(Workers, AllRunOnceAndTheFirstIsTheCallers) {
    for (const std::size_t count : {0u, 1u, 2u, 7u}) {
        std::vector<int> runs(count, 0);
        std::vector<std::thread::id> threads(count);
        int checkpoints = 0;
        run_workers(
            count, [&] { ++checkpoints; },
            [&](const WorkerThread &self) {
                ++runs[self.number];
                threads[self.number] = std::this_thread::get_id();
                self.checkpoint();
                self.checkpoint();
            });
        EXPECT_EQ(std::vector<int>(count, 1), runs);
        EXPECT_EQ(count > 0 ? 2 : 0, checkpoints) << "of worker 0 alone";
        for (std::size_t worker = 0; worker < count; ++worker)
            EXPECT_EQ(worker == 0, threads[worker] == std::this_thread::get_id()) << worker;
    }
    run_workers(2, {}, [](const WorkerThread &self) { self.checkpoint(); });
}

TEST(Workers, TheyRunSideBySide) {
    std::atomic<int> here{0};
    run_workers(3, {}, [&](const WorkerThread &) {
        ++here;
        while (here < 3) // would never end one after the other
            std::this_thread::yield();
    });
    EXPECT_EQ(3, here);
}

TEST(Workers, TheFirstFailureByNumberArrives) {
    for (int repetition = 0; repetition < 20; ++repetition) {
        std::string message;
        std::vector<int> ended(4, 0);
        try {
            run_workers(4, {}, [&](const WorkerThread &self) {
                ended[self.number] = 1;
                if (self.number == 1 || self.number == 3)
                    throw std::runtime_error("worker " + std::to_string(self.number));
            });
        } catch (const std::runtime_error &error) {
            message = error.what();
        }
        EXPECT_EQ("worker 1", message);
        EXPECT_EQ(std::vector<int>(4, 1), ended);
    }
}

TEST(Workers, TheCallersCancellationEndsTheOthers) {
    EXPECT_THROW(run_workers(
                     3, [] { throw std::domain_error("cancelled"); },
                     [&](const WorkerThread &self) {
                         for (;;) {
                             self.checkpoint();
                             std::this_thread::yield();
                         }
                     }),
                 std::domain_error);
}

TEST(Workers, AnyWorkersFailureEndsTheOthers) {
    for (const std::size_t failing : {0u, 1u, 2u})
        EXPECT_THROW(run_workers(3, {},
                                 [&](const WorkerThread &self) {
                                     if (self.number == failing)
                                         throw std::domain_error("broken");
                                     for (;;) {
                                         self.checkpoint();
                                         std::this_thread::yield();
                                     }
                                 }),
                     std::domain_error)
            << failing;
}

TEST(OpenTasks, EachRunsOnceWithoutHelp) {
    OpenTasks open;
    std::vector<std::atomic<int>> runs(50);
    const std::function<void()> none;
    const WorkerThread self{0, none};
    open.run(self, 50, [&](const WorkerThread &, std::size_t i) { ++runs[i]; }); // nobody helps
    open.run(self, 0, [&](const WorkerThread &, std::size_t) { FAIL(); });
    for (const auto &count : runs)
        EXPECT_EQ(1, count);
}

// Workers one to three have no work of their own: none of the tasks would end without their help.
TEST(OpenTasks, WorkersWithoutWorkHelp) {
    OpenTasks open;
    std::atomic<int> together{0}, runs{0};
    std::atomic<bool> begun{false};
    std::vector<std::atomic<int>> by_worker(4);
    run_workers(4, {}, [&](const WorkerThread &self) {
        open.work(self, [&] {
            while (self.number != 0 && !begun) // those that come before anybody has work would go again
                std::this_thread::yield();
            if (self.number == 0)
                open.run(self, 40, [&](const WorkerThread &by, std::size_t i) {
                    begun = true;
                    ++runs;
                    ++by_worker[by.number];
                    if (i == 0 || i >= 37)
                        for (++together; together < 4;)
                            std::this_thread::yield();
                });
        });
    });
    EXPECT_EQ(40, runs);
    for (const auto &count : by_worker)
        EXPECT_GE(count, 1);
}

// Every worker lays its tasks open, one after the other, and nothing is lost or done twice.
TEST(OpenTasks, ManyWorkersAndManyTasks) {
    for (int repetition = 0; repetition < 20; ++repetition) {
        OpenTasks open;
        std::vector<std::atomic<int>> runs(4 * 30 * 3);
        run_workers(4, {}, [&](const WorkerThread &self) {
            open.work(self, [&] {
                for (std::size_t batch = 0; batch < 30; ++batch) {
                    std::atomic<int> ended{0};
                    open.run(self, self.number == 3 ? 0 : 3, [&](const WorkerThread &, std::size_t i) {
                        ++runs[(self.number * 30 + batch) * 3 + i];
                        ++ended;
                    });
                    EXPECT_EQ(self.number == 3 ? 0 : 3, ended) << "run() returned before its tasks had";
                }
            });
        });
        for (std::size_t i = 0; i < runs.size(); ++i)
            EXPECT_EQ(i < 3 * 30 * 3 ? 1 : 0, runs[i]) << i;
    }
}

// What a helper throws is the owner's to catch; the helper goes on.
TEST(OpenTasks, AFailureIsTheOwners) {
    for (std::size_t failing = 0; failing < 6; ++failing) {
        OpenTasks open;
        std::string message;
        run_workers(3, {}, [&](const WorkerThread &self) {
            open.work(self, [&] {
                if (self.number != 0)
                    return;
                try {
                    open.run(self, 6, [&](const WorkerThread &, std::size_t i) {
                        if (i == failing)
                            throw std::runtime_error("task " + std::to_string(i));
                    });
                } catch (const std::runtime_error &error) {
                    message = error.what();
                }
            });
        });
        EXPECT_EQ("task " + std::to_string(failing), message);
    }
}

TEST(OpenTasks, CancellationReachesThoseThatHelp) {
    OpenTasks open;
    std::atomic<int> working{0};
    EXPECT_THROW(run_workers(
                     3, [] { throw std::domain_error("cancelled"); },
                     [&](const WorkerThread &self) {
                         open.work(self, [&] {
                             for (++working; self.number == 0 && working < 3;)
                                 std::this_thread::yield();
                             while (self.number !=
                                    0) { // the caller's worker has nothing to do, and is told all the same
                                 self.checkpoint();
                                 std::this_thread::yield();
                             }
                         });
                     }),
                 std::domain_error);
}

} // namespace
} // namespace clsp

// Arrays that are handed on: never to two at once, large enough, and no more kept than lanes could use.
#include "statistics/spare_buffers.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <thread>
#include <utility>
#include <vector>

namespace {

using Buffers = clsp::SpareBuffers<std::uint32_t>;

TEST(SpareBuffers, AreHandedOn) {
    Buffers buffers;
    const std::uint32_t *first = nullptr;
    {
        Buffers::Buffer buffer = buffers.take(100);
        first = buffer.data();
        EXPECT_EQ(buffer.size(), 100u);
        Buffers::Buffer moved = std::move(buffer);
        EXPECT_EQ(moved.data(), first);
        EXPECT_TRUE(buffer.empty()); // NOLINT: what was moved from holds nothing
    }
    Buffers::Buffer smaller = buffers.take(60);
    EXPECT_EQ(smaller.data(), first);
    EXPECT_EQ(smaller.size(), 60u);
    EXPECT_NE(buffers.take(60).data(), first) << "it is in use";
    smaller = {};
    Buffers::Buffer larger = buffers.take(101);
    EXPECT_NE(larger.data(), first) << "it is too small";
    larger.data()[100] = 1;
    EXPECT_TRUE(buffers.take(0).empty());
}

TEST(SpareBuffers, TheSmallestThatIsLargeEnough) {
    Buffers buffers;
    const std::uint32_t *large = nullptr, *small = nullptr;
    {
        const Buffers::Buffer a = buffers.take(1000), b = buffers.take(10);
        large = a.data();
        small = b.data();
    }
    const Buffers::Buffer ten = buffers.take(10), thousand = buffers.take(11);
    EXPECT_EQ(ten.data(), small);
    EXPECT_EQ(thousand.data(), large);
}

TEST(SpareBuffers, NeverToTwoAtOnce) {
    Buffers buffers;
    std::vector<std::thread> threads;
    std::vector<int> wrong(12, 0); // more than are kept
    for (std::size_t t = 0; t < wrong.size(); ++t)
        threads.emplace_back([&, t] {
            for (std::uint32_t i = 0; i < 500; ++i) {
                const std::size_t count = 1 + (i * 7 + t) % 50;
                Buffers::Buffer buffer = buffers.take(count);
                const std::uint32_t mark = std::uint32_t(t) * 1000 + i;
                for (std::size_t k = 0; k < count; ++k)
                    buffer.data()[k] = mark;
                std::this_thread::yield();
                for (std::size_t k = 0; k < count; ++k)
                    wrong[t] += buffer.data()[k] != mark;
            }
        });
    for (std::thread &thread : threads)
        thread.join();
    EXPECT_EQ(wrong, std::vector<int>(12, 0));
}

} // namespace

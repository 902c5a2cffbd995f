// Sums over image rows, in float over short runs and in double beyond: sixteen partial sums, so that compilers
// vectorize without being allowed to reorder, and the result does not depend on alignment or threads.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>

namespace clsp::statistics {

// 0 where there is nothing to divide by.
inline double ratio(double a, double b) {
    return b > 0.0 ? a / b : 0.0;
}

constexpr std::size_t kLanes = 16;

inline double lane_total(const float (&lanes)[kLanes]) {
    double total = 0.0;
    for (const float lane : lanes)
        total += lane;
    return total;
}

inline double sum(const float *a, std::size_t count) {
    float lanes[kLanes] = {};
    std::size_t i = 0;
    for (; i + kLanes <= count; i += kLanes)
        for (std::size_t k = 0; k < kLanes; ++k)
            lanes[k] += a[i + k];
    double total = 0.0;
    for (; i < count; ++i)
        total += a[i];
    return total + lane_total(lanes);
}

inline double dot(const float *a, const float *b, std::size_t count) {
    float lanes[kLanes] = {};
    std::size_t i = 0;
    for (; i + kLanes <= count; i += kLanes)
        for (std::size_t k = 0; k < kLanes; ++k)
            lanes[k] += a[i + k] * b[i + k];
    double total = 0.0;
    for (; i < count; ++i)
        total += double(a[i]) * b[i];
    return total + lane_total(lanes);
}

// Sum of a b (a - b): zero on average unless the pattern is lopsided along the direction from a to b.
inline double lopsided(const float *a, const float *b, std::size_t count) {
    float lanes[kLanes] = {};
    std::size_t i = 0;
    for (; i + kLanes <= count; i += kLanes)
        for (std::size_t k = 0; k < kLanes; ++k)
            lanes[k] += a[i + k] * b[i + k] * (a[i + k] - b[i + k]);
    double total = 0.0;
    for (; i < count; ++i)
        total += double(a[i]) * b[i] * (a[i] - b[i]);
    return total + lane_total(lanes);
}

struct Powers {
    double sum = 0.0, square = 0.0, cube = 0.0, fourth = 0.0;
    void add(const float *a, std::size_t count) {
        float s1[kLanes] = {}, s2[kLanes] = {}, s3[kLanes] = {}, s4[kLanes] = {};
        std::size_t i = 0;
        for (; i + kLanes <= count; i += kLanes)
            for (std::size_t k = 0; k < kLanes; ++k) {
                const float value = a[i + k], squared = value * value;
                s1[k] += value;
                s2[k] += squared;
                s3[k] += squared * value;
                s4[k] += squared * squared;
            }
        for (; i < count; ++i) {
            const double value = a[i], squared = value * value;
            sum += value;
            square += squared;
            cube += squared * value;
            fourth += squared * squared;
        }
        sum += lane_total(s1);
        square += lane_total(s2);
        cube += lane_total(s3);
        fourth += lane_total(s4);
    }
    void add(const Powers &other) {
        sum += other.sum;
        square += other.square;
        cube += other.cube;
        fourth += other.fourth;
    }
};

struct Lag {
    int dx = 0, dy = 0;
};

// Sum of a(x, y) b(x + dx, y + dy) over the pixel pairs inside the image.
inline double lag_sum(const float *a, const float *b, std::size_t width, std::size_t height, Lag lag) {
    const std::size_t shift_x = std::size_t(lag.dx < 0 ? -lag.dx : lag.dx),
                      shift_y = std::size_t(lag.dy < 0 ? -lag.dy : lag.dy);
    if (shift_x >= width || shift_y >= height)
        return 0.0;
    const std::size_t ax = lag.dx < 0 ? shift_x : 0, bx = lag.dx < 0 ? 0 : shift_x;
    const std::size_t ay = lag.dy < 0 ? shift_y : 0, by = lag.dy < 0 ? 0 : shift_y;
    double total = 0.0;
    for (std::size_t y = 0; y + shift_y < height; ++y)
        total += dot(a + (y + ay) * width + ax, b + (y + by) * width + bx, width - shift_x);
    return total;
}

// Runs task(0) ... task(count - 1), each once, on up to `threads` threads. A task writes to its own slots only: the
// outcome is the same for any number of threads. The first exception of a task is thrown on.
void parallel_for(std::size_t count, unsigned threads, const std::function<void(std::size_t)> &task);

} // namespace clsp::statistics

// Sums over image rows, in float over short runs and in double beyond: sixteen partial sums, so that compilers
// vectorize without being allowed to reorder, and the result does not depend on alignment, threads, or how wide the
// processor's vectors are.
#pragma once

#include <cstddef>
#include <cstdint>

namespace clsp::statistics {

// Of the partial sums, also in diagnosis/frame_sums.cl.
inline constexpr std::size_t kLanes = 16;

// 0 where there is nothing to divide by.
inline double ratio(double a, double b) {
    return b > 0.0 ? a / b : 0.0;
}

double sum(const float *a, std::size_t count);
double dot(const float *a, const float *b, std::size_t count);
// Sum of a b (a - b): zero on average unless the pattern is lopsided along the direction from a to b.
double lopsided(const float *a, const float *b, std::size_t count);
// into += a.
void add(float *into, const float *a, std::size_t count);
// into += a a.
void add_squares(float *into, const float *a, std::size_t count);
void multiply(float *product, const float *a, const float *b, std::size_t count);

// What a code says once a frame is put on the scale of all frames: factor (code - black) - shift.
struct CodeScale {
    float black, factor, shift;
};
// into += codes on that scale.
void add_codes(float *into, const std::uint16_t *codes, const CodeScale &scale, std::size_t count);
// Codes on that scale without their mean.
void residual_codes(float *residual, const std::uint16_t *codes, const CodeScale &scale, const float *mean,
                    std::size_t count);

// The codes themselves: into += codes, and their sum.
std::uint64_t count_up(std::uint32_t *into, const std::uint16_t *codes, std::size_t count);
// rest = codes - mean - offset, within +-limit.
void limited_rest(float *rest, const std::uint16_t *codes, const float *mean, float offset, float limit,
                  std::size_t count);
// into += (a - b - offset)^2.
void add_squared_rest(float *into, const float *a, const float *b, float offset, std::size_t count);

struct Powers {
    double sum = 0.0, square = 0.0, cube = 0.0, fourth = 0.0;
    void add(const float *a, std::size_t count);
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
double lag_sum(const float *a, const float *b, std::size_t width, std::size_t height, Lag lag);

} // namespace clsp::statistics

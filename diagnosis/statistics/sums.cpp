#include "statistics/sums.hpp"

// Each function on rows is compiled for three widths of vectors, of which the processor's own is taken. No width may
// contract a product and a sum into one rounding: all give the same bits (CMakeLists.txt says -ffp-contract=off).
#if defined(__x86_64__) && defined(__GNUC__)
#define CLSP_BODY inline __attribute__((always_inline))
#define CLSP_WIDTHS(type, name, parameters, arguments)                                                                 \
    __attribute__((target("avx512f,avx512bw,avx512vl"))) static type name##_512 parameters {                           \
        return name##_body arguments;                                                                                  \
    }                                                                                                                  \
    __attribute__((target("avx2"))) static type name##_256 parameters { return name##_body arguments; }                \
    type name parameters {                                                                                             \
        return vector_bits() == 512   ? name##_512 arguments                                                           \
               : vector_bits() == 256 ? name##_256 arguments                                                           \
                                      : name##_body arguments;                                                         \
    }
#else
#define CLSP_BODY inline
#define CLSP_WIDTHS(type, name, parameters, arguments)                                                                 \
    type name parameters { return name##_body arguments; }
#endif

namespace clsp::statistics {
namespace {

#if defined(__x86_64__) && defined(__GNUC__)
int vector_bits() {
    static const int bits = __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512vl") ? 512
                            : __builtin_cpu_supports("avx2")                                       ? 256
                                                                                                   : 128;
    return bits;
}
#endif


CLSP_BODY double lane_total(const float (&lanes)[kLanes]) {
    double total = 0.0;
    for (const float lane : lanes)
        total += lane;
    return total;
}

CLSP_BODY double sum_body(const float *a, std::size_t count) {
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

CLSP_BODY double dot_body(const float *a, const float *b, std::size_t count) {
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

CLSP_BODY double lopsided_body(const float *a, const float *b, std::size_t count) {
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

CLSP_BODY Powers powers_body(const float *a, std::size_t count) {
    Powers powers;
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
        powers.sum += value;
        powers.square += squared;
        powers.cube += squared * value;
        powers.fourth += squared * squared;
    }
    powers.sum += lane_total(s1);
    powers.square += lane_total(s2);
    powers.cube += lane_total(s3);
    powers.fourth += lane_total(s4);
    return powers;
}

CLSP_BODY double lag_sum_body(const float *a, const float *b, std::size_t width, std::size_t height, Lag lag) {
    const std::size_t shift_x = std::size_t(lag.dx < 0 ? -lag.dx : lag.dx),
                      shift_y = std::size_t(lag.dy < 0 ? -lag.dy : lag.dy);
    if (shift_x >= width || shift_y >= height)
        return 0.0;
    const std::size_t ax = lag.dx < 0 ? shift_x : 0, bx = lag.dx < 0 ? 0 : shift_x;
    const std::size_t ay = lag.dy < 0 ? shift_y : 0, by = lag.dy < 0 ? 0 : shift_y;
    double total = 0.0;
    for (std::size_t y = 0; y + shift_y < height; ++y)
        total += dot_body(a + (y + ay) * width + ax, b + (y + by) * width + bx, width - shift_x);
    return total;
}

CLSP_BODY void add_body(float *__restrict into, const float *__restrict a, std::size_t count) {
    for (std::size_t i = 0; i < count; ++i)
        into[i] += a[i];
}

CLSP_BODY void add_squares_body(float *__restrict into, const float *__restrict a, std::size_t count) {
    for (std::size_t i = 0; i < count; ++i)
        into[i] += a[i] * a[i];
}

CLSP_BODY void multiply_body(float *product, const float *a, const float *b, std::size_t count) {
    for (std::size_t i = 0; i < count; ++i)
        product[i] = a[i] * b[i];
}

CLSP_BODY void add_codes_body(float *__restrict into, const std::uint16_t *__restrict codes, const CodeScale &scale,
                              std::size_t count) {
    const CodeScale s = scale;
    for (std::size_t i = 0; i < count; ++i)
        into[i] += s.factor * (float(codes[i]) - s.black) - s.shift;
}

CLSP_BODY void residual_codes_body(float *__restrict residual, const std::uint16_t *__restrict codes,
                                   const CodeScale &scale, const float *__restrict mean, std::size_t count) {
    const CodeScale s = scale;
    for (std::size_t i = 0; i < count; ++i)
        residual[i] = s.factor * (float(codes[i]) - s.black) - s.shift - mean[i];
}

CLSP_BODY std::uint64_t count_up_body(std::uint32_t *__restrict into, const std::uint16_t *__restrict codes,
                                      std::size_t count) {
    // As many codes as a sum of 32 bits holds.
    constexpr std::size_t kRun = 65536;
    std::uint64_t total = 0;
    for (std::size_t begin = 0; begin < count; begin += kRun) {
        const std::size_t end = count - begin < kRun ? count : begin + kRun;
        std::uint32_t part = 0;
        for (std::size_t i = begin; i < end; ++i) {
            into[i] += codes[i];
            part += codes[i];
        }
        total += part;
    }
    return total;
}

CLSP_BODY void limited_rest_body(float *__restrict rest, const std::uint16_t *__restrict codes,
                                 const float *__restrict mean, float offset, float limit, std::size_t count) {
    for (std::size_t i = 0; i < count; ++i) {
        const float value = float(codes[i]) - mean[i] - offset;
        const float above = value < -limit ? -limit : value;
        rest[i] = above > limit ? limit : above;
    }
}

CLSP_BODY void add_squared_rest_body(float *__restrict into, const float *__restrict a, const float *__restrict b,
                                     float offset, std::size_t count) {
    for (std::size_t i = 0; i < count; ++i) {
        const float value = a[i] - offset - b[i];
        into[i] += value * value;
    }
}

CLSP_WIDTHS(Powers, powers, (const float *a, std::size_t count), (a, count))

} // namespace

CLSP_WIDTHS(double, sum, (const float *a, std::size_t count), (a, count))
CLSP_WIDTHS(double, dot, (const float *a, const float *b, std::size_t count), (a, b, count))
CLSP_WIDTHS(double, lopsided, (const float *a, const float *b, std::size_t count), (a, b, count))
CLSP_WIDTHS(double, lag_sum, (const float *a, const float *b, std::size_t width, std::size_t height, Lag lag),
            (a, b, width, height, lag))
CLSP_WIDTHS(void, add, (float *into, const float *a, std::size_t count), (into, a, count))
CLSP_WIDTHS(void, add_squares, (float *into, const float *a, std::size_t count), (into, a, count))
CLSP_WIDTHS(void, multiply, (float *product, const float *a, const float *b, std::size_t count), (product, a, b, count))
CLSP_WIDTHS(void, add_codes, (float *into, const std::uint16_t *codes, const CodeScale &scale, std::size_t count),
            (into, codes, scale, count))
CLSP_WIDTHS(void, residual_codes,
            (float *residual, const std::uint16_t *codes, const CodeScale &scale, const float *mean, std::size_t count),
            (residual, codes, scale, mean, count))

CLSP_WIDTHS(std::uint64_t, count_up, (std::uint32_t *into, const std::uint16_t *codes, std::size_t count),
            (into, codes, count))
CLSP_WIDTHS(void, limited_rest,
            (float *rest, const std::uint16_t *codes, const float *mean, float offset, float limit, std::size_t count),
            (rest, codes, mean, offset, limit, count))
CLSP_WIDTHS(void, add_squared_rest,
            (float *into, const float *a, const float *b, float offset, std::size_t count), (into, a, b, offset, count))

void Powers::add(const float *a, std::size_t count) {
    add(powers(a, count));
}

} // namespace clsp::statistics

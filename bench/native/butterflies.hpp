// Transforms of a few points in registers, forward: y[k] = sum_q x[q] exp(-2 pi i q k / N). For the inverse, real and
// imaginary parts change names before and behind.
#pragma once

#include "native/lanes.hpp"

#include <cmath>
#include <initializer_list>

namespace native {

namespace detail {

// cos and sin of 2 pi e / n, at compile time. |angle| up to pi / 4 in the series.
constexpr double cosine_series(double a) {
    double term = 1.0, sum = 1.0;
    for (int i = 1; i < 12; ++i)
        sum += term *= -a * a / ((2 * i - 1) * (2 * i));
    return sum;
}
constexpr double sine_series(double a) {
    double term = a, sum = a;
    for (int i = 1; i < 12; ++i)
        sum += term *= -a * a / ((2 * i) * (2 * i + 1));
    return sum;
}
constexpr double cosine(unsigned e, unsigned n) {
    e %= n;
    if (2 * e > n)
        e = n - e;
    if (4 * e > n)
        return -cosine(n - 2 * e, 2 * n); // cos(pi - a)
    return 8 * e > n ? sine_series(2.0 * M_PI * (double(n) - 4.0 * e) / (4.0 * n)) : cosine_series(2.0 * M_PI * e / n);
}
constexpr double sine(unsigned e, unsigned n) {
    return cosine(4 * (e % n) + 3 * n, 4 * n);
} // cos(a - pi / 2)

template <unsigned N> struct Roots {
    float re[N] = {}, im[N] = {}; // exp(-2 pi i e / N)
    constexpr Roots() {
        for (unsigned e = 0; e < N; ++e) {
            re[e] = float(cosine(e, N));
            im[e] = float(-sine(e, N));
        }
    }
};
template <unsigned N> constexpr Roots<N> roots{};

constexpr bool coprime(unsigned a, unsigned b) {
    while (b != 0) {
        const unsigned rest = a % b;
        a = b;
        b = rest;
    }
    return a == 1;
}

// The smaller of two factors of a composite.
constexpr unsigned factor(unsigned n) {
    for (const unsigned f : {4u, 3u, 2u})
        if (n % f == 0 && n > f)
            return f;
    return 1;
}

} // namespace detail

// a exp(-2 pi i e / N).
template <unsigned N> NATIVE_INLINE Complex rotate(Complex a, unsigned e) {
    e %= N;
    if (e == 0)
        return a;
    if (4 * e == N)
        return {a.im, -a.re};
    if (2 * e == N)
        return {-a.re, -a.im};
    if (4 * e == 3 * N)
        return {-a.im, a.re};
    constexpr float half = 0.70710678118654752f;
    if (8 * e == N)
        return {(a.re + a.im) * half, (a.im - a.re) * half};
    if (8 * e == 3 * N)
        return {(a.im - a.re) * half, -((a.re + a.im) * half)};
    return times(a, detail::roots<N>.re[e], detail::roots<N>.im[e]);
}

template <unsigned N> struct Butterfly {
    static NATIVE_INLINE void forward(Complex (&x)[N]) {
        constexpr unsigned A = detail::factor(N), B = N / A;
        static_assert(A > 1, "no butterfly of this many points");
        Complex t[B][A];
        // Coprime factors need no rotations in between: points are put in another order instead.
        constexpr bool prime_factors = detail::coprime(A, B);
#pragma GCC unroll 16
        for (unsigned b = 0; b < B; ++b) {
#pragma GCC unroll 16
            for (unsigned a = 0; a < A; ++a)
                t[b][a] = x[prime_factors ? (a * B + b * A) % N : a * B + b];
            Butterfly<A>::forward(t[b]);
            if constexpr (!prime_factors)
#pragma GCC unroll 16
                for (unsigned a = 1; a < A; ++a)
                    t[b][a] = rotate<N>(t[b][a], a * b);
        }
#pragma GCC unroll 16
        for (unsigned a = 0; a < A; ++a) {
            Complex u[B];
#pragma GCC unroll 16
            for (unsigned b = 0; b < B; ++b)
                u[b] = t[b][a];
            Butterfly<B>::forward(u);
            if constexpr (prime_factors) {
#pragma GCC unroll 16
                for (unsigned k = 0; k < N; ++k)
                    if (k % A == a)
                        x[k] = u[k % B];
            } else {
#pragma GCC unroll 16
                for (unsigned b = 0; b < B; ++b)
                    x[a + A * b] = u[b];
            }
        }
    }
};

template <> struct Butterfly<2> {
    static NATIVE_INLINE void forward(Complex (&x)[2]) {
        const Complex a = x[0], b = x[1];
        x[0] = a + b;
        x[1] = a - b;
    }
};

template <> struct Butterfly<3> {
    static NATIVE_INLINE void forward(Complex (&x)[3]) {
        constexpr float s = 0.86602540378443865f;
        const Complex sum = x[1] + x[2], difference = x[1] - x[2];
        const Complex middle{x[0].re - 0.5f * sum.re, x[0].im - 0.5f * sum.im};
        x[0] = x[0] + sum;
        x[1] = {middle.re + s * difference.im, middle.im - s * difference.re};
        x[2] = {middle.re - s * difference.im, middle.im + s * difference.re};
    }
};

template <> struct Butterfly<4> {
    static NATIVE_INLINE void forward(Complex (&x)[4]) {
        const Complex a = x[0] + x[2], b = x[0] - x[2], c = x[1] + x[3], d = x[1] - x[3];
        x[0] = a + c;
        x[1] = {b.re + d.im, b.im - d.re};
        x[2] = a - c;
        x[3] = {b.re - d.im, b.im + d.re};
    }
};

template <> struct Butterfly<5> {
    static NATIVE_INLINE void forward(Complex (&x)[5]) {
        constexpr float c1 = 0.30901699437494742f, c2 = -0.80901699437494742f, s1 = 0.95105651629515357f,
                        s2 = 0.58778525229247313f;
        const Complex a = x[1] + x[4], b = x[1] - x[4], c = x[2] + x[3], d = x[2] - x[3];
        const Complex even1{x[0].re + c1 * a.re + c2 * c.re, x[0].im + c1 * a.im + c2 * c.im};
        const Complex even2{x[0].re + c2 * a.re + c1 * c.re, x[0].im + c2 * a.im + c1 * c.im};
        const Complex odd1{s1 * b.re + s2 * d.re, s1 * b.im + s2 * d.im};
        const Complex odd2{s2 * b.re - s1 * d.re, s2 * b.im - s1 * d.im};
        x[0] = x[0] + a + c;
        x[1] = {even1.re + odd1.im, even1.im - odd1.re};
        x[4] = {even1.re - odd1.im, even1.im + odd1.re};
        x[2] = {even2.re + odd2.im, even2.im - odd2.re};
        x[3] = {even2.re - odd2.im, even2.im + odd2.re};
    }
};

// The factor of odd points' rotations is multiplied in where they are added: 44 additions and 8 fused multiplications.
template <> struct Butterfly<8> {
    static NATIVE_INLINE void forward(Complex (&x)[8]) {
        constexpr float half = 0.70710678118654752f;
        Complex even[4] = {x[0] + x[4], x[1] + x[5], x[2] + x[6], x[3] + x[7]};
        const Complex b0 = x[0] - x[4], b1 = x[1] - x[5], b2 = x[2] - x[6], b3 = x[3] - x[7];
        Butterfly<4>::forward(even);
        const Complex c0{b0.re + b2.im, b0.im - b2.re}, c1{b0.re - b2.im, b0.im + b2.re};
        const Lanes p = b1.re - b3.re, q = b1.im + b3.im, u = b1.im - b3.im, v = b1.re + b3.re;
        const Complex sum{p + q, u - v}, difference{u + v, q - p};
        x[0] = even[0];
        x[2] = even[1];
        x[4] = even[2];
        x[6] = even[3];
        x[1] = {c0.re + half * sum.re, c0.im + half * sum.im};
        x[5] = {c0.re - half * sum.re, c0.im - half * sum.im};
        x[3] = {c1.re + half * difference.im, c1.im - half * difference.re};
        x[7] = {c1.re - half * difference.im, c1.im + half * difference.re};
    }
};

} // namespace native

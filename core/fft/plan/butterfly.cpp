#include "fft/plan/butterfly.hpp"

#include <cmath>
#include <fmt/core.h>

namespace clsp {
namespace {

std::string constant(double c) {
    return fmt::format("SPREAD({:a}f)", static_cast<float>(c));
}

} // namespace

Butterfly::Values Butterfly::transform(const Values &x) {
    const std::size_t n = x.size();
    if (n == 1)
        return x;
    if (n == 2)
        return {sum(x[0], x[1]), difference(x[0], x[1])};
    if (n == 4)
        return transform_4(x);
    if (n == 16) // two turns by an eighth fewer than by twos
        return transform_composite(x, 4);
    for (const std::size_t radix : {2u, 3u})
        if (n % radix == 0 && n > radix)
            return transform_composite(x, radix);
    return transform_prime(x);
}

Butterfly::Value Butterfly::twiddled(const Value &x, const std::string &re, const std::string &im) {
    const std::string w_re = name(re), w_im = name(im);
    return product(x, w_re, w_im, inverse_);
}

std::string Butterfly::name(const std::string &expression) {
    std::string result = fmt::format("{}{}", prefix_, count_++);
    text_ += fmt::format("{}const lanes_f {} = {};\n", indent_, result, expression);
    return result;
}

Butterfly::Value Butterfly::sum(const Value &a, const Value &b) {
    if (a.is_zero() || b.is_zero())
        return a.is_zero() ? b : a;
    return value(a.re + " + " + b.re, a.im + " + " + b.im);
}

Butterfly::Value Butterfly::difference(const Value &a, const Value &b) {
    if (b.is_zero())
        return a;
    return a.is_zero() ? value("-" + b.re, "-" + b.im) : value(a.re + " - " + b.re, a.im + " - " + b.im);
}

// a - i b, or a + i b.
Butterfly::Value Butterfly::sum_turned(const Value &a, const Value &b, bool backwards) {
    if (b.is_zero())
        return a;
    if (a.is_zero())
        return backwards ? value("-" + b.im, b.re) : value(b.im, "-" + b.re);
    return backwards ? value(a.re + " - " + b.im, a.im + " + " + b.re)
                     : value(a.re + " + " + b.im, a.im + " - " + b.re);
}

// (a.re + i a.im)(re + i im), or with the conjugate of the second.
Butterfly::Value Butterfly::product(const Value &a, const std::string &re, const std::string &im, bool conjugate) {
    if (a.is_zero())
        return a;
    return conjugate ? value(fmt::format("fma({}, {}, {} * {})", a.im, im, a.re, re),
                             fmt::format("fma(-{}, {}, {} * {})", a.re, im, a.im, re))
                     : value(fmt::format("fma(-{}, {}, {} * {})", a.im, im, a.re, re),
                             fmt::format("fma({}, {}, {} * {})", a.re, im, a.im, re));
}

// a exp(-+ 2 pi i e / n).
Butterfly::Value Butterfly::rotated(const Value &a, std::size_t e, std::size_t n) {
    e %= n;
    if (inverse_ && e != 0)
        e = n - e;
    if (e == 0 || a.is_zero())
        return a;
    if (4 * e % n == 0) {
        const std::size_t quarter = 4 * e / n;
        return quarter == 1   ? value(a.im, "-" + a.re)
               : quarter == 2 ? value("-" + a.re, "-" + a.im)
                              : value("-" + a.im, a.re);
    }
    if (8 * e % n == 0) {
        const std::string c = constant(std::sqrt(0.5));
        const std::string plus = name(fmt::format("({} + {}) * {}", a.re, a.im, c)),
                          minus = name(fmt::format("({} - {}) * {}", a.im, a.re, c));
        switch (8 * e / n) {
        case 1:
            return {plus, minus};
        case 3:
            return value(minus, "-" + plus);
        case 5:
            return value("-" + plus, "-" + minus);
        default:
            return value("-" + minus, plus);
        }
    }
    const double angle = -2.0 * M_PI * double(e) / double(n);
    return product(a, constant(std::cos(angle)), constant(std::sin(angle)), false);
}

Butterfly::Values Butterfly::transform_4(const Values &x) {
    const Value a = sum(x[0], x[2]), b = difference(x[0], x[2]), c = sum(x[1], x[3]), d = difference(x[1], x[3]);
    return {sum(a, c), sum_turned(b, d, inverse_), difference(a, c), sum_turned(b, d, !inverse_)};
}

// c a + b.
Butterfly::Value Butterfly::scaled_sum(const Value &a, const std::string &c, const Value &b) {
    if (a.is_zero())
        return b;
    return b.is_zero()
               ? value(fmt::format("{} * {}", a.re, c), fmt::format("{} * {}", a.im, c))
               : value(fmt::format("fma({}, {}, {})", a.re, c, b.re), fmt::format("fma({}, {}, {})", a.im, c, b.im));
}

// n = radix * m, by decimation in frequency.
Butterfly::Values Butterfly::transform_composite(const Values &x, std::size_t radix) {
    const std::size_t n = x.size(), m = n / radix;
    std::vector<Values> blocks(radix, Values(m));
    for (std::size_t j = 0; j < m; ++j) {
        Values column(radix);
        for (std::size_t q = 0; q < radix; ++q)
            column[q] = x[j + q * m];
        column = transform(column);
        for (std::size_t k = 0; k < radix; ++k)
            blocks[k][j] = rotated(column[k], j * k, n);
    }
    Values result(n);
    for (std::size_t k = 0; k < radix; ++k) {
        const Values block = transform(blocks[k]);
        for (std::size_t f = 0; f < m; ++f)
            result[k + radix * f] = block[f];
    }
    return result;
}

// An odd prime: points j and n - j enter as their sum and their difference, with a cosine and a sine.
Butterfly::Values Butterfly::transform_prime(const Values &x) {
    const std::size_t n = x.size(), half = (n - 1) / 2;
    Values sums, differences;
    for (std::size_t j = 1; j <= half; ++j) {
        sums.push_back(sum(x[j], x[n - j]));
        differences.push_back(difference(x[j], x[n - j]));
    }
    Values result(n);
    result[0] = x[0];
    for (const Value &s : sums)
        result[0] = sum(result[0], s);
    for (std::size_t k = 1; k <= half; ++k) {
        Value even = x[0], odd;
        for (std::size_t j = 1; j <= half; ++j) {
            const double angle = 2.0 * M_PI * double(j * k % n) / double(n);
            const std::string c = constant(std::cos(angle)), s = constant(std::sin(angle));
            even = scaled_sum(sums[j - 1], c, even);
            odd = scaled_sum(differences[j - 1], s, odd);
        }
        result[k] = sum_turned(even, odd, inverse_);
        result[n - k] = sum_turned(even, odd, !inverse_);
    }
    return result;
}

std::vector<LineStage> stages_of(const LinePlan &plan) {
    std::vector<LineStage> stages;
    std::uint32_t block = plan.length, twiddles = 0;
    for (const std::uint32_t radix : plan.radices) {
        const std::uint32_t m = block / radix;
        stages.push_back({radix, m, twiddles});
        if (m > 1)
            twiddles += 2 * m * (radix - 1);
        block = m;
    }
    return stages;
}

} // namespace clsp

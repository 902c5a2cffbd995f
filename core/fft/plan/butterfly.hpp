// OpenCL source of one butterfly, which the transforms of both engines are put together from.
#pragma once

#include "fft/plan/line_plan.hpp"

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace clsp {

// Straight-line code. Every value gets a name of its own; the compiler finds the registers. Values are of the type
// lanes_f, constants SPREAD(c), both the including kernel's: a vector of several lines, or one line's number.
class Butterfly {
  public:
    struct Value {
        std::string re, im; // both empty: zero, which costs nothing
        bool is_zero() const { return re.empty(); }
    };
    using Values = std::vector<Value>;

    // Names begin with `prefix`, so that several butterflies can stand side by side.
    Butterfly(std::string indent, bool inverse, std::string prefix = "t")
        : indent_(std::move(indent)), inverse_(inverse), prefix_(std::move(prefix)) {}

    const std::string &text() const { return text_; }

    // sum_q x[q] exp(-+ 2 pi i q k / n), k = 0 .. n - 1; + for the inverse.
    Values transform(const Values &x);

    // x times the twiddle factor whose parts the expressions give, or its conjugate for the inverse.
    Value twiddled(const Value &x, const std::string &re, const std::string &im);

  private:
    std::string name(const std::string &expression);
    Value value(const std::string &re, const std::string &im) { return {name(re), name(im)}; }
    Value sum(const Value &a, const Value &b);
    Value difference(const Value &a, const Value &b);
    Value sum_turned(const Value &a, const Value &b, bool backwards);
    Value product(const Value &a, const std::string &re, const std::string &im, bool conjugate);
    Value scaled_sum(const Value &a, const std::string &c, const Value &b);
    Value rotated(const Value &a, std::size_t e, std::size_t n);
    Values transform_4(const Values &x);
    Values transform_composite(const Values &x, std::size_t radix);
    Values transform_prime(const Values &x);

    std::string indent_;
    bool inverse_;
    std::string prefix_;
    std::string text_;
    int count_ = 0;
};

// One stage of a plan.
struct LineStage {
    std::uint32_t radix, m;
    std::uint32_t twiddles; // where its table begins, in floats
};
std::vector<LineStage> stages_of(const LinePlan &plan);

} // namespace clsp

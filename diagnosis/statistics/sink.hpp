// Where the statistics go: their names when a sequence's list is made, their values when frames are measured. One code
// writes both, so that list and values cannot fall apart.
#pragma once

#include "statistics/statistic.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>
#include <utility>
#include <vector>

namespace clsp::statistics {

class Sink {
  public:
    Sink(std::string sequence, std::vector<StatisticInfo> *list, double *values)
        : sequence_(std::move(sequence)), list_(list), values_(values) {}

    void put(const char *stage, const std::string &name, const std::string &region, const char *unit, double value) {
        if (list_)
            list_->push_back({stage, sequence_, name, region, unit, 0.0});
        if (values_)
            values_[count_] = std::isfinite(value) ? value : 0.0;
        ++count_;
    }
    void put(const char *stage, const std::string &name, const char *unit, double value, double least_deviation = 0.0) {
        put(stage, name, "all", unit, value);
        if (list_)
            list_->back().least_deviation = least_deviation;
    }

    // A square over frames, which has about as many degrees of freedom. The logarithm of a chi-square of few has a tail
    // towards 0 far beyond a Gaussian one's, and the square itself one to the other side; its cube root has neither
    // (Wilson and Hilferty 1931), whatever its scale. log: what tells it with many frames.
    void put_square(const char *stage, const std::string &name, std::size_t frames, double square, double log) {
        if (frames < kFewFrames)
            put(stage, name, "cbrt", std::cbrt(square));
        else
            put(stage, name, "log", log);
    }

    // The root of a count of rare things; half is the standard deviation of a large one.
    void put_count(const char *stage, const std::string &name, double count) {
        put(stage, name, "sqrt", std::sqrt(count + 0.375), 0.25);
    }

    // The root of a share of all values, of which each `together` rise or fall at once.
    void put_share(const char *stage, const std::string &name, double share, double together, double total) {
        put(stage, name, "sqrt", std::sqrt(share), 0.25 * std::sqrt(together / total));
    }

    std::size_t count() const { return count_; }

  private:
    std::string sequence_;
    std::vector<StatisticInfo> *list_;
    double *values_;
    std::size_t count_ = 0;
};

// log(a / b) of two variances or mean squares. The floor keeps equal frames finite; it lies far below any noise of a
// camera, whose rounding alone has a variance of 1/12 DN^2.
inline double log_ratio(double a, double b, double floor = 1e-6) {
    return std::log((std::max(a, 0.0) + floor) / (std::max(b, 0.0) + floor));
}

} // namespace clsp::statistics

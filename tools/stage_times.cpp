#include "stage_times.hpp"

#include "text.hpp"

#include <algorithm>
#include <fmt/format.h>
#include <numeric>

namespace tools {

double StageTimes::mean() const {
    return milliseconds.empty() ? 0.0
                                : std::accumulate(milliseconds.begin(), milliseconds.end(), 0.0) /
                                      static_cast<double>(milliseconds.size());
}

double StageTimes::median() const {
    if (milliseconds.empty())
        return 0.0;
    std::vector<double> sorted = milliseconds;
    std::sort(sorted.begin(), sorted.end());
    const std::size_t half = sorted.size() / 2;
    return sorted.size() % 2 ? sorted[half] : (sorted[half - 1] + sorted[half]) / 2;
}

double StageTimes::least() const {
    return milliseconds.empty() ? 0.0 : *std::min_element(milliseconds.begin(), milliseconds.end());
}

double StageTimes::most() const {
    return milliseconds.empty() ? 0.0 : *std::max_element(milliseconds.begin(), milliseconds.end());
}

void FrameTimes::add(const std::vector<ClspStageTiming> &timings) {
    double total = 0;
    for (const ClspStageTiming &timing : timings) {
        auto found =
            std::find_if(stages.begin(), stages.end(), [&](const StageTimes &s) { return s.name == timing.stage; });
        if (found == stages.end()) {
            stages.push_back({timing.stage, {}});
            found = stages.end() - 1;
        }
        found->milliseconds.push_back(timing.milliseconds);
        total += timing.milliseconds;
    }
    all.milliseconds.push_back(total);
}

std::string FrameTimes::table() const {
    std::vector<std::vector<std::string>> rows = {{"stage", "mean ms", "median", "least", "most", "frames"}};
    const auto add_row = [&](const StageTimes &stage) {
        rows.push_back({stage.name, fmt::format("{:.4f}", stage.mean()), fmt::format("{:.4f}", stage.median()),
                        fmt::format("{:.4f}", stage.least()), fmt::format("{:.4f}", stage.most()),
                        std::to_string(stage.milliseconds.size())});
    };
    for (const StageTimes &stage : stages)
        add_row(stage);
    add_row(all);
    return "\n" + tools::table(rows, "  ") + "\n";
}

} // namespace tools

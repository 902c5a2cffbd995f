#include "statistics/statistic_groups.hpp"

#include <cmath>

namespace clsp::statistics {

namespace {

// Sum of |differences| across each edge between columns and between rows, mean over frames, and how many pairs of
// unmasked pixels there are.
struct EdgeSums {
    std::vector<double> columns, rows, column_pairs, row_pairs;
};

EdgeSums sum_edges(const StatisticInput &in) {
    const Geometry &geometry = in.geometry;
    const std::size_t width = geometry.width, height = geometry.height;
    EdgeSums sums;
    sums.columns.assign(width - 1, 0.0);
    sums.rows.assign(height - 1, 0.0);
    for (const EdgeFrameSums &part : in.sums.sum_edges(geometry)) {
        for (std::size_t x = 0; x + 1 < width; ++x)
            sums.columns[x] += double(part.columns[x]) / double(geometry.frames);
        for (std::size_t y = 0; y + 1 < height; ++y)
            sums.rows[y] += double(part.rows[y]) / double(geometry.frames);
    }
    sums.column_pairs.assign(width - 1, double(height));
    sums.row_pairs.assign(height - 1, double(width));
    if (geometry.is_masked()) {
        const float *weight = geometry.weight.data();
        for (std::size_t x = 0; x + 1 < width; ++x) {
            sums.column_pairs[x] = 0.0;
            for (std::size_t y = 0; y < height; ++y)
                sums.column_pairs[x] += double(weight[y * width + x] * weight[y * width + x + 1]);
        }
        for (std::size_t y = 0; y + 1 < height; ++y)
            sums.row_pairs[y] = dot(weight + y * width, weight + (y + 1) * width, width);
    }
    return sums;
}

double edge_excess(const std::vector<double> &sums, const std::vector<double> &pairs, std::size_t period) {
    double on = 0.0, on_pairs = 0.0, off = 0.0, off_pairs = 0.0;
    for (std::size_t i = 0; i < sums.size(); ++i) {
        const bool is_edge = (i + 1) % period == 0;
        (is_edge ? on : off) += sums[i];
        (is_edge ? on_pairs : off_pairs) += pairs[i];
    }
    return log_ratio(ratio(on, on_pairs), ratio(off, off_pairs), 1e-3); // floor in DN
}

} // namespace

void measure_blocks(const StatisticInput &in, Sink &sink) {
    const EdgeSums sums = sum_edges(in);
    for (const std::size_t period : {std::size_t{4}, std::size_t{8}, std::size_t{16}}) {
        const double value = 0.5 * (edge_excess(sums.columns, sums.column_pairs, period) +
                                    edge_excess(sums.rows, sums.row_pairs, period));
        sink.put("sensor", "block_edges_" + std::to_string(period), "log", value);
    }
}

} // namespace clsp::statistics

// The groups of statistics. Each writes its own to the sink, always the same ones for the same geometry.
#pragma once

#include "statistics/residual_sums.hpp"
#include "statistics/sink.hpp"

namespace clsp::statistics {

struct StatisticInput {
    const Geometry &geometry;
    const Frames &frames;
    const ResidualSums &residual;
    FrameSums &sums;
    const std::uint16_t *codes;
    double black_level_dn;
    const std::vector<float> *dark_frame; // nullptr: there is none
    unsigned threads;
};

void measure_temporal_noise(const StatisticInput &in, Sink &sink); // rows, columns, frames; correlations; drift
void measure_repetition(const StatisticInput &in, Sink &sink);     // frames that come twice
void measure_code_lattice(const StatisticInput &in, Sink &sink);   // multiples of 2, 4, 8; rough histograms
void measure_blocks(const StatisticInput &in, Sink &sink);         // edges between blocks of 4, 8, 16 pixels
void measure_fixed_pattern(const StatisticInput &in, Sink &sink);  // dark, flat
void measure_field(const StatisticInput &in, Sink &sink);          // fall-off, gradient, regions; 2 x 2 mosaic
void measure_levels(const StatisticInput &in, Sink &sink); // bright end of the histogram: clipping, bent response
void measure_intensity_law(const StatisticInput &in, Sink &sink); // board
void measure_speckle(const StatisticInput &in, Sink &sink); // board: correlation, spectrum, contrast over the field
void measure_static_scene(const StatisticInput &in,
                          Sink &sink);                   // static board, dots: what changes over time, and where
void measure_dots(const StatisticInput &in, Sink &sink); // dots

} // namespace clsp::statistics

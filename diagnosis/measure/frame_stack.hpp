// What the frames of one sequence say, pixel by pixel: the mean frame, and the temporal noise by differences of
// successive frames, in which fixed patterns cancel.
#pragma once

#include "capture/capture.hpp"
#include "measure/variance_components.hpp"

#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

namespace clsp {

struct FrameStack {
    std::size_t sequence = 0, frames = 0;
    ImageShape shape;
    std::vector<std::uint8_t> unmasked, counts; // counts: unmasked, and in no frame at an end of the scale
    double unmasked_pixels = 0.0, counted_pixels = 0.0;
    double zero_share = 0.0, top_share = 0.0; // of unmasked codes, at 0 and at the top
    std::vector<double> mean;                 // by pixel
    std::vector<double> frame_means;          // of counted pixels
    double level = 0.0, unmasked_level = 0.0;
    double stack_variance = 0.0; // over all frames, mean of unmasked pixels
    double fluctuation = 0.0;    // what of it all unmasked pixels share

    // Of two frames or more. Half the squared difference of frames, lag apart; of a difference what the level and the
    // offset of the light do is taken away: its regression on the mean frame.
    struct Differences {
        std::vector<double> pixel;          // mean over pairs
        std::vector<double> pairs;          // mean over counted pixels
        VarianceComponents components;      // means over pairs
        double variance = 0.0, error = 0.0; // mean, its standard error
        double neighbors = 0.0;             // half the product of differences of neighbors in a row, mean
    };
    Differences successive;

    // Frees what there is by pixel.
    void release_images() {
        mean = successive.pixel = {};
        counts = unmasked = {};
    }
};

FrameStack stack_frames(const Capture &capture, std::size_t sequence);
// see: is shown what remains of each pair's difference over the root of 2, by pixel, in the order of time.
FrameStack::Differences differences(const Capture &capture, const FrameStack &stack, std::size_t lag,
                                    const std::function<void(const std::vector<double> &)> &see = {});

} // namespace clsp

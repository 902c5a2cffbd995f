#include "measure/frame_stack.hpp"

#include <algorithm>
#include <cmath>

namespace clsp {
namespace {

const std::uint16_t *frame_of(const Capture &capture, const FrameStack &stack, std::size_t frame) {
    return capture.codes[stack.sequence].data() + frame * stack.shape.size();
}

} // namespace

FrameStack stack_frames(const Capture &capture, std::size_t sequence) {
    const CaptureLayout &layout = capture.layout;
    FrameStack stack;
    stack.sequence = sequence;
    stack.frames = layout.sequences[sequence].frame_count;
    stack.shape = {layout.width, layout.height};
    const std::size_t pixels = stack.shape.size();
    const auto top = static_cast<std::uint16_t>(layout.maximum_code());
    stack.unmasked.assign(pixels, 1);
    if (!layout.sequences[sequence].mask.empty())
        for (std::size_t i = 0; i < pixels; ++i)
            stack.unmasked[i] = layout.sequences[sequence].mask[i] != 0;
    stack.counts = stack.unmasked;
    std::vector<std::uint64_t> sums(pixels), squares(pixels);
    double zeros = 0.0, tops = 0.0;
    std::vector<double> levels;
    for (std::size_t t = 0; t < stack.frames; ++t) {
        const std::uint16_t *codes = frame_of(capture, stack, t);
        levels.push_back(0.0);
        for (std::size_t i = 0; i < pixels; ++i) {
            sums[i] += codes[i];
            squares[i] += std::uint64_t{codes[i]} * codes[i];
            levels.back() += stack.unmasked[i] ? codes[i] : 0.0;
            if (!stack.unmasked[i] || (codes[i] != 0 && codes[i] != top))
                continue;
            (codes[i] == 0 ? zeros : tops) += 1.0;
            stack.counts[i] = 0;
        }
    }
    const auto n = double(stack.frames);
    stack.mean.resize(pixels);
    for (std::size_t i = 0; i < pixels; ++i) {
        stack.mean[i] = double(sums[i]) / n;
        if (!stack.unmasked[i])
            continue;
        stack.unmasked_pixels += 1.0;
        stack.unmasked_level += stack.mean[i];
        if (n > 1.0)
            stack.stack_variance += (double(squares[i]) - n * stack.mean[i] * stack.mean[i]) / (n - 1.0);
        if (stack.counts[i]) {
            stack.counted_pixels += 1.0;
            stack.level += stack.mean[i];
        }
    }
    if (stack.unmasked_pixels > 0.0) {
        stack.zero_share = zeros / (n * stack.unmasked_pixels);
        stack.top_share = tops / (n * stack.unmasked_pixels);
        stack.unmasked_level /= stack.unmasked_pixels;
        stack.stack_variance /= stack.unmasked_pixels;
        for (const double level : levels)
            stack.fluctuation +=
                std::pow(level / stack.unmasked_pixels - stack.unmasked_level, 2) / std::max(1.0, n - 1.0);
    }
    if (stack.counted_pixels == 0.0)
        return stack;
    stack.level /= stack.counted_pixels;
    for (std::size_t t = 0; t < stack.frames; ++t) {
        const std::uint16_t *codes = frame_of(capture, stack, t);
        double sum = 0.0;
        for (std::size_t i = 0; i < pixels; ++i)
            sum += stack.counts[i] ? codes[i] : 0.0;
        stack.frame_means.push_back(sum / stack.counted_pixels);
    }
    if (stack.frames > 1)
        stack.successive = differences(capture, stack, 1);
    return stack;
}

FrameStack::Differences differences(const Capture &capture, const FrameStack &stack, std::size_t lag,
                                    const std::function<void(const std::vector<double> &)> &see) {
    const std::size_t pixels = stack.shape.size();
    FrameStack::Differences result;
    result.pixel.assign(pixels, 0.0);
    const std::size_t pairs = stack.frames - lag;
    double scatter = 0.0; // of the pixels' means about the level
    for (std::size_t i = 0; i < pixels; ++i)
        scatter += stack.counts[i] ? (stack.mean[i] - stack.level) * (stack.mean[i] - stack.level) : 0.0;
    std::vector<double> half(pixels); // differences over sqrt(2)
    double neighbors = 0.0, adjacent = 0.0;
    for (std::size_t t = 0; t < pairs; ++t) {
        const std::uint16_t *before = frame_of(capture, stack, t), *after = frame_of(capture, stack, t + lag);
        double sum = 0.0, product = 0.0;
        for (std::size_t i = 0; i < pixels; ++i)
            if (stack.counts[i]) {
                half[i] = (double(after[i]) - double(before[i])) * M_SQRT1_2;
                sum += half[i];
                product += half[i] * (stack.mean[i] - stack.level);
            }
        const double step = sum / stack.counted_pixels, slope = scatter > 0.0 ? product / scatter : 0.0;
        double squares = 0.0;
        for (std::size_t i = 0; i < pixels; ++i)
            if (stack.counts[i]) {
                half[i] -= step + slope * (stack.mean[i] - stack.level);
                squares += half[i] * half[i];
                result.pixel[i] += half[i] * half[i] / double(pairs);
                if (i % stack.shape.width > 0 && stack.counts[i - 1]) {
                    neighbors += half[i] * half[i - 1];
                    adjacent += 1.0;
                }
            }
        if (see)
            see(half);
        result.pairs.push_back(squares / std::max(1.0, stack.counted_pixels - 2.0));
        const VarianceComponents one = variance_components(stack.shape, half, stack.counts);
        VarianceComponents &all = result.components;
        all.pixel += one.pixel / double(pairs);
        all.row += one.row / double(pairs);
        all.column += one.column / double(pairs);
        all.row_degrees = one.row_degrees;
        all.column_degrees = one.column_degrees;
        result.variance += result.pairs.back() / double(pairs);
    }
    result.neighbors = adjacent > 0.0 ? neighbors / adjacent : 0.0;
    // Of pixels' means by those of their neighbors, so that a smooth change of the noise across the image is none.
    double differing = 0.0;
    for (std::size_t i = 1; i < pixels; ++i)
        if (i % stack.shape.width > 0 && stack.counts[i] && stack.counts[i - 1])
            differing += 0.5 * (result.pixel[i] - result.pixel[i - 1]) * (result.pixel[i] - result.pixel[i - 1]);
    // Successive differences share a frame: over independent ones (3 L - 4) / (2 L - 2), von Neumann's result.
    const double shared =
        stack.frames > 2 ? (3.0 * double(stack.frames) - 4.0) / (2.0 * double(stack.frames) - 2.0) : 1.0;
    const auto of_lines = [&](double variance, double degrees) {
        return degrees > 0.0 ? 2.0 * variance * variance / degrees * shared / double(pairs) : 0.0;
    };
    const VarianceComponents &parts = result.components;
    result.error = std::sqrt((adjacent > 0.0 ? differing / (adjacent / double(pairs)) / stack.counted_pixels : 0.0) +
                             of_lines(parts.row, parts.row_degrees) + of_lines(parts.column, parts.column_degrees));
    return result;
}

} // namespace clsp

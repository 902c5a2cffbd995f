/**
 * @file stack_shape.hpp
 * @brief Stacks of frames whose sides may have been written in another order.
 */
#ifndef CLSPECKLE_IO_STACK_SHAPE_HPP
#define CLSPECKLE_IO_STACK_SHAPE_HPP

#include <cstdint>

namespace image_io::detail {

/** Whether frames look like height x width x frames: many, high and narrow. Python's `of_frames_behind` has the same
 * rule. */
inline bool may_lie_behind(std::uint64_t frames, std::uint64_t height, std::uint64_t width) {
    return frames > width && height > 2 * width;
}

} // namespace image_io::detail

#endif // CLSPECKLE_IO_STACK_SHAPE_HPP

#include "stages/field_grid.hpp"

#include "runtime/error.hpp"
#include "runtime/image_view.hpp"

#include <fmt/core.h>

namespace clsp {

std::uint32_t fft_size_at_least(std::uint32_t least) {
    for (std::uint32_t n = least;; ++n) {
        std::uint32_t rest = n;
        for (const std::uint32_t radix : {2u, 3u, 5u, 7u, 11u, 13u})
            while (rest % radix == 0)
                rest /= radix;
        if (rest == 1)
            return n;
    }
}

FieldGrid make_field_grid(std::uint32_t width, std::uint32_t height, std::uint32_t oversampling,
                          std::uint32_t guard_px) {
    check_image_size(width, height, "the image");
    if (oversampling < 1 || oversampling > kMaxOversampling)
        throw Error(Status::kInvalidArgument,
                    fmt::format("oversampling is {}, it must be 1 to {}", oversampling, kMaxOversampling));
    if (guard_px > kMaxImageSide)
        throw Error(Status::kInvalidArgument,
                    fmt::format("guard_px is {}, it must be 0 to {}", guard_px, kMaxImageSide));
    FieldGrid grid{width, height, oversampling, guard_px, 0, 0};
    grid.grid_width = fft_size_at_least(oversampling * (width + guard_px));
    grid.grid_height = fft_size_at_least(oversampling * (height + guard_px));
    if (grid.grid_width > kMaxImageSide || grid.grid_height > kMaxImageSide || grid.samples() > kMaxGridSamples)
        throw Error(Status::kUnsupported,
                    fmt::format("the field grid would be {} x {} samples ({} x {} pixels, oversampling {}, guard {}); "
                                "each side may have at most "
                                "{}, and the grid {} in all; use a smaller image or less oversampling",
                                grid.grid_width, grid.grid_height, width, height, oversampling, guard_px, kMaxImageSide,
                                kMaxGridSamples));
    return grid;
}

} // namespace clsp

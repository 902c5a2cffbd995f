#include "doe/pattern_image.hpp"

#include "runtime/checks.hpp"
#include "runtime/image_view.hpp"

#include <fmt/core.h>
#include <utility>

namespace clsp {

void check_pattern_image(const PatternImage &image, bool zero_extent) {
    check_positive(image.power_w, "power_w");
    if (image.image_width < 2 || image.image_height < 2 || image.image_width > kMaxImageSide ||
        image.image_height > kMaxImageSide)
        throw Error(Status::kInvalidArgument,
                    fmt::format("the image is {} x {} texels (width x height); each side must be 2 to {}",
                                image.image_width, image.image_height, kMaxImageSide));
    for (const auto &[extent, name] :
         {std::pair{image.half_extent_x, "half_extent_x"}, std::pair{image.half_extent_y, "half_extent_y"}})
        if (!(extent >= 0 && extent <= 1) || (extent == 0 && !zero_extent))
            throw Error(Status::kInvalidArgument,
                        fmt::format("{} is {}; it is a direction cosine, above 0 to 1{}", name, extent,
                                    zero_extent ? ", or 0 for all that the design can reach" : ""));
}

} // namespace clsp

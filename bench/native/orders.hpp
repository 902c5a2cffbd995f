// Makers of the two orders.
#pragma once

#include "native/native_passes.hpp"

namespace native {

std::unique_ptr<Passes> make_column_first(std::uint32_t width, std::uint32_t height, double relative_diameter,
                                          unsigned threads);
std::unique_ptr<Passes> make_row_first(std::uint32_t width, std::uint32_t height, double relative_diameter,
                                       unsigned threads);

} // namespace native

// Pictures of the report as PNG in text.
#pragma once

#include "measure/picture.hpp"

#include <cstdint>
#include <string>
#include <vector>

namespace clsp {

std::vector<std::uint8_t> encode_png(const Picture &picture);
std::string base64(const std::vector<std::uint8_t> &bytes);

} // namespace clsp

/**
 * @file json.hpp
 * @brief JSON, as the program names it.
 */
#ifndef CLSPECKLE_TOOLS_JSON_HPP
#define CLSPECKLE_TOOLS_JSON_HPP

#include "io/json_file.hpp"

namespace tools {

using Json = image_io::Json;
using image_io::JsonDocument;
using image_io::read_json;
using image_io::shown;

} // namespace tools

#endif // CLSPECKLE_TOOLS_JSON_HPP

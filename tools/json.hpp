/**
 * @file json.hpp
 * @brief JSON, as the program names it.
 */
#ifndef CLSPECKLE_TOOLS_JSON_HPP
#define CLSPECKLE_TOOLS_JSON_HPP

#include "io/json_file.hpp"

#include <cmath>

namespace tools {

using Json = image_io::Json;

/** A document to be read again. Throws InputError for a text in it that is no UTF-8, as JSON must be: that is the name
 * of a file. @param indent spaces of a level. */
std::string json_document(const Json &root, int indent);
using image_io::JsonDocument;
using image_io::read_json;
using image_io::shown;

/** null where a number is not finite. */
inline Json or_null(double value) {
    return std::isfinite(value) ? Json(value) : Json();
}

} // namespace tools

#endif // CLSPECKLE_TOOLS_JSON_HPP

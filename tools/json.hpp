/**
 * @file json.hpp
 * @brief JSON, its members in the order of the file.
 */
#ifndef CLSPECKLE_TOOLS_JSON_HPP
#define CLSPECKLE_TOOLS_JSON_HPP

#include <nlohmann/json.hpp>

#include <string>

namespace tools {

using Json = nlohmann::ordered_json;

/** Reads a JSON file; throws InputError with the file's name and the place of the fault. */
Json read_json(const std::string &path);

} // namespace tools

#endif // CLSPECKLE_TOOLS_JSON_HPP

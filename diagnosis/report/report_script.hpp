// JavaScript of the report: Vega's modules and what starts them.
#pragma once

#include <cstddef>
#include <string>

namespace clsp {

struct EmbeddedScript {
    const char *name, *text;
};

// Vega's modules, each behind those that it needs; made by cmake/EmbedScripts.cmake.
extern const EmbeddedScript kVegaModules[];
extern const std::size_t kVegaModuleCount;

// The text of a script element that draws every script.vega-specification of the page.
std::string report_script();

} // namespace clsp

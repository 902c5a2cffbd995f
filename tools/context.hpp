/**
 * @file context.hpp
 * @brief What the library needs of the program: a context that warns on the console, progress that is drawn there.
 */
#ifndef CLSPECKLE_TOOLS_CONTEXT_HPP
#define CLSPECKLE_TOOLS_CONTEXT_HPP

#include "console.hpp"

#include <clspeckle/clspeckle.hpp>

#include <string>

namespace tools {

/** A context on the device that a selector names; empty: the best one. */
clspeckle::Context make_context(const std::string &device);

/** A progress function that draws the bar and stops the call once the user has asked for it. */
clspeckle::Progress progress_on(Console &console);

} // namespace tools

#endif // CLSPECKLE_TOOLS_CONTEXT_HPP

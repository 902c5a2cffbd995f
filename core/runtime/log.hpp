// What the library has to say beside errors: it goes to the context's log function.
#pragma once

#include <cstdint>
#include <functional>
#include <string>

namespace clsp {

// The numbers are those of the C API (runtime.h).
enum class LogLevel : std::uint32_t { kWarning = 1, kInfo = 2 };

using LogFunction = std::function<void(LogLevel, const std::string &)>;

// What CLSPECKLE_LOG asks for: "warning" or "info" to standard error, or nothing (empty). Throws kInvalidArgument for
// other words.
LogFunction environment_log();

} // namespace clsp

#include "runtime/log.hpp"

#include "runtime/error.hpp"

#include <cstdio>
#include <cstdlib>
#include <fmt/core.h>

namespace clsp {

LogFunction environment_log() {
    const char *variable = ::secure_getenv("CLSPECKLE_LOG");
    const std::string wanted = variable ? variable : "";
    if (wanted.empty() || wanted == "off")
        return {};
    if (wanted != "warning" && wanted != "info")
        throw Error(
            Status::kInvalidArgument,
            fmt::format("the environment variable CLSPECKLE_LOG is \"{}\"; set it to off, warning or info, or unset it",
                        wanted));
    const LogLevel most = wanted == "info" ? LogLevel::kInfo : LogLevel::kWarning;
    return [most](LogLevel level, const std::string &message) {
        if (level > most)
            return;
        const std::string line =
            fmt::format("clspeckle: {}: {}\n", level == LogLevel::kWarning ? "warning" : "info", message);
        std::fputs(line.c_str(), stderr);
    };
}

} // namespace clsp

#include "context.hpp"

#include "interrupt.hpp"

#include <cstdlib>

namespace tools {

namespace {

extern "C" void show_warning(void *, std::uint32_t level, const char *message) {
    if (Console *console = Console::current(); console && level == CLSP_LOG_WARNING)
        console->warn(message);
}

} // namespace

clspeckle::Context make_context(const std::string &device) {
    auto desc = clspeckle::make<ClspContextDesc>();
    desc.device = device.empty() ? nullptr : device.c_str();
    // Otherwise the library prints, and more than warnings if it is told to.
    if (const char *log = ::secure_getenv("CLSPECKLE_LOG"); !log || !*log)
        desc.log = show_warning;
    return clspeckle::Context(desc);
}

clspeckle::Progress progress_on(Console &console) {
    return [&console](const std::string &what, double fraction) {
        check_interrupt();
        console.progress(fraction, what);
        return true;
    };
}

} // namespace tools

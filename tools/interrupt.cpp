#include "interrupt.hpp"

#include "errors.hpp"

#include <unistd.h>

#include <atomic>
#include <csignal>
#include <thread>

namespace tools {

namespace {

std::atomic<bool> stopping{false};

void request_stop(int) {
    stopping = true;
}

} // namespace

void handle_signals() {
    struct sigaction action {};
    action.sa_handler = request_stop;
    // A second Ctrl-C ends the program at once.
    action.sa_flags = static_cast<int>(SA_RESETHAND);
    ::sigaction(SIGINT, &action, nullptr);
    ::sigaction(SIGTERM, &action, nullptr);
    // Ctrl-C goes to all processes of the terminal, also to the linker that a driver runs, whose failure makes PoCL end
    // this program. What is blocked stays blocked in processes that are started: every thread blocks the signals but
    // one, which does nothing else.
    sigset_t stops;
    ::sigemptyset(&stops);
    ::sigaddset(&stops, SIGINT);
    ::sigaddset(&stops, SIGTERM);
    ::pthread_sigmask(SIG_BLOCK, &stops, nullptr);
    std::thread([stops] {
        ::pthread_sigmask(SIG_UNBLOCK, &stops, nullptr);
        for (;;)
            ::pause();
    }).detach();
    // A file that grows over the user's limit is then an error that can be reported and cleaned up after.
    std::signal(SIGXFSZ, SIG_IGN);
}

bool stop_requested() {
    return stopping;
}

void check_interrupt() {
    if (stopping)
        throw Interrupted();
}

} // namespace tools

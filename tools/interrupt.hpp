/**
 * @file interrupt.hpp
 * @brief Ctrl-C and SIGTERM: asked for by a signal, seen where the work can stop.
 */
#ifndef CLSPECKLE_TOOLS_INTERRUPT_HPP
#define CLSPECKLE_TOOLS_INTERRUPT_HPP

namespace tools {

/** Lets Ctrl-C and SIGTERM ask the program to stop; before any other thread is started. */
void handle_signals();

/** Whether the user has asked the program to stop. */
bool stop_requested();

/** Throws Interrupted once the user has asked the program to stop. */
void check_interrupt();

} // namespace tools

#endif // CLSPECKLE_TOOLS_INTERRUPT_HPP

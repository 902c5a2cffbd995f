#include "console.hpp"

#include "errors.hpp"

#include <fmt/format.h>

#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstring>

namespace tools {

namespace {

Console *current_console = nullptr;

} // namespace

std::string harmless(std::string text) {
    for (char &c : text)
        if ((static_cast<unsigned char>(c) < 32 && c != '\n' && c != '\t') || c == 127)
            c = '?';
    return text;
}

Console *Console::current() {
    return current_console;
}

Console::Console(bool json, bool quiet)
    : json_(json), quiet_(quiet), bar_(!quiet && ::isatty(STDERR_FILENO) == 1), started_(now()) {
    current_console = this;
    if (!json_)
        return;
    std::fflush(stdout);
    const int copy = ::dup(STDOUT_FILENO);
    std::FILE *own = copy >= 0 ? ::fdopen(copy, "w") : nullptr;
    if (!own)
        throw OutputError("standard output cannot be written");
    out_ = own;
    ::dup2(STDERR_FILENO, STDOUT_FILENO);
}

Console::~Console() {
    current_console = nullptr;
    clear_progress();
    if (out_ != stdout) {
        std::fflush(stdout);
        std::fflush(out_);
        ::dup2(::fileno(out_), STDOUT_FILENO);
        std::fclose(out_);
    }
}

void Console::print(const std::string &text) {
    if (json_ || quiet_)
        return;
    clear_progress();
    put(harmless(text));
}

void Console::put(const std::string &text) {
    if (std::fputs((text + "\n").c_str(), out_) < 0)
        write_error_ = errno;
}

void Console::warn(const std::string &text) {
    if (std::find(warnings_.begin(), warnings_.end(), text) != warnings_.end())
        return;
    warnings_.push_back(text);
    clear_progress();
    std::fputs(("clspeckle: warning: " + harmless(text) + "\n").c_str(), stderr);
}

void Console::result(const std::string &text) {
    clear_progress();
    put(text);
}

void Console::finish() {
    clear_progress();
    if (std::fflush(out_) != 0 || std::ferror(out_))
        throw OutputError(
            fmt::format("standard output cannot be written: {}", std::strerror(write_error_ ? write_error_ : errno)));
}

void Console::progress(std::uint64_t done, std::uint64_t total) {
    if (total < 2)
        return;
    const double fraction = static_cast<double>(done) / static_cast<double>(total);
    const std::string left = time_left(fraction);
    const double elapsed = now() - started_;
    if (due(done >= total))
        draw(fraction, fmt::format(" {}/{} frames, {:.1f}/s{}", done, total,
                                   elapsed > 0 ? static_cast<double>(done) / elapsed : 0.0, left));
}

void Console::progress(double fraction, const std::string &what) {
    fraction = std::clamp(fraction, 0.0, 1.0);
    const std::string left = time_left(fraction);
    if (due(false))
        draw(fraction, fmt::format(" {:3.0f} %{}: {}", 100 * fraction, left, what));
}

/** How long the rest takes if it goes on like that; empty before anything can be told. */
std::string Console::time_left(double fraction) {
    if (fraction < fraction_)
        started_ = now();
    fraction_ = fraction;
    const double elapsed = now() - started_;
    return elapsed > 1 && fraction > 0 ? ", " + duration(elapsed * (1 - fraction) / fraction) + " left" : "";
}

/** Whether the bar is to be drawn now: not more than ten times a second. */
bool Console::due(bool last) {
    if (!bar_ || (bar_shown_ && !last && now() - drawn_ < 0.1))
        return false;
    drawn_ = now();
    return true;
}

void Console::draw(double fraction, const std::string &text) {
    winsize size{};
    const int columns = ::ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 0 ? size.ws_col : 80;
    const std::string shown = text.substr(0, static_cast<std::size_t>(std::max(columns - 8, 0)));
    const int cells = std::clamp(columns - static_cast<int>(shown.size()) - 3, 5, 50);
    const int full = static_cast<int>(static_cast<double>(cells) * fraction);
    std::fputs(fmt::format("\r[{:=<{}}{: <{}}]{}\x1b[K", "", full, "", cells - full, shown).c_str(), stderr);
    std::fflush(stderr);
    bar_shown_ = true;
}

void Console::clear_progress() {
    if (!bar_shown_)
        return;
    std::fputs("\r\x1b[K", stderr);
    std::fflush(stderr);
    bar_shown_ = false;
}

std::string duration(double seconds) {
    const auto minutes = static_cast<std::uint64_t>(std::lround(std::max(seconds, 0.0) / 60));
    if (seconds < 100)
        return fmt::format("{:.0f} s", seconds);
    return minutes < 100 ? fmt::format("{} min", minutes) : fmt::format("{} h {} min", minutes / 60, minutes % 60);
}

double now() {
    return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

} // namespace tools

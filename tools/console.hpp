/**
 * @file console.hpp
 * @brief What goes to the terminal: results and summaries on standard output, everything else on standard error.
 */
#ifndef CLSPECKLE_TOOLS_CONSOLE_HPP
#define CLSPECKLE_TOOLS_CONSOLE_HPP

#include <cstdint>
#include <cstdio>
#include <string>
#include <vector>

namespace tools {

/** A text that may quote a file, without what a terminal obeys: control characters but line ends and tabs become "?".
 */
std::string harmless(std::string text);

/**
 * With --json standard output belongs to one JSON document: whatever a driver prints there meanwhile goes to standard
 * error.
 */
class Console {
  public:
    Console(bool json, bool quiet);
    ~Console();
    Console(const Console &) = delete;
    Console &operator=(const Console &) = delete;

    bool json() const { return json_; }
    bool quiet() const { return quiet_; }
    /** Lines for eyes: on standard output, nothing with --quiet or --json. */
    void print(const std::string &text);
    /** A line on standard error that --quiet does not silence. Repeated ones are shown once. */
    void warn(const std::string &text);
    const std::vector<std::string> &warnings() const { return warnings_; }
    /** The program's one console, for what the library logs; nullptr before and after it. */
    static Console *current();
    /** The document of --json, or any result that --quiet must not silence. */
    void result(const std::string &text);
    /** Throws OutputError if standard output could not take everything. */
    void finish();

    /** Draws or redraws the progress bar: on a terminal only, and not with --quiet. */
    void progress(std::uint64_t done, std::uint64_t total);
    /** The same of work that is not counted in frames; a smaller fraction than before begins other work. @param
     * fraction 0 to 1. @param what is being done. */
    void progress(double fraction, const std::string &what);

  private:
    bool due(bool last);
    std::string time_left(double fraction);
    void draw(double fraction, const std::string &text);
    void clear_progress();
    void put(const std::string &text); // a line
    bool json_;
    bool quiet_;
    bool bar_;
    bool bar_shown_ = false;
    std::FILE *out_ = stdout;
    int write_error_ = 0; // of an earlier result, as errno
    std::vector<std::string> warnings_;
    double started_ = 0;
    double drawn_ = 0;
    double fraction_ = 0;
};

/** A time in words: "40 s", "12 min", "3 h 5 min". */
std::string duration(double seconds);

/** Seconds on a steady clock. */
double now();

} // namespace tools

#endif // CLSPECKLE_TOOLS_CONSOLE_HPP

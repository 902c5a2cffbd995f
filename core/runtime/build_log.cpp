#include "runtime/build_log.hpp"

#include <algorithm>
#include <cctype>
#include <cstdlib>
#include <cstring>
#include <fmt/core.h>
#include <sstream>

namespace clsp {
namespace {

// "file:line" of a line of the text, from 1; the one behind the last is where compilers miss a bracket. "" where there
// is none or no directive comes before it.
std::string place_of(const std::string &program_text, unsigned long number) {
    constexpr const char *kDirective = "#line ";
    std::istringstream lines(program_text);
    std::string line, file;
    unsigned long in_file = 1;
    for (unsigned long i = 1; i < number; ++i) {
        if (!std::getline(lines, line))
            return {};
        if (line.rfind(kDirective, 0) != 0) {
            ++in_file;
            continue;
        }
        in_file = std::strtoul(line.c_str() + std::strlen(kDirective), nullptr, 10);
        const std::size_t first = line.find('"'), last = line.rfind('"');
        if (first < last) // without a name the file stays
            file = line.substr(first + 1, last - first - 1);
    }
    return file.empty() ? file : fmt::format("{}:{}", file, in_file);
}

} // namespace

std::string with_files_and_lines(const std::string &build_log, const std::string &program_text) {
    constexpr const char *kProgram = "<kernel>:";
    std::string result;
    std::size_t done = 0;
    for (std::size_t at; (at = build_log.find(kProgram, done)) != std::string::npos;) {
        const std::size_t digits = at + std::strlen(kProgram);
        const std::size_t end = std::min(build_log.find_first_not_of("0123456789", digits), build_log.size());
        const std::string number = build_log.substr(digits, end - digits);
        const std::string place = place_of(program_text, std::strtoul(number.c_str(), nullptr, 10)); // none: 0
        result += build_log.substr(done, at - done);
        result += place.empty() ? build_log.substr(at, end - at) : place;
        done = end;
    }
    return result + build_log.substr(done);
}

bool names_an_error(const std::string &build_log) {
    std::string lower = build_log;
    std::transform(lower.begin(), lower.end(), lower.begin(), [](unsigned char c) { return std::tolower(c); });
    return lower.find("error") != std::string::npos;
}

} // namespace clsp

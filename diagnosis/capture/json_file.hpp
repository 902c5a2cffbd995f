// JSON that users write: read with messages that name file, key, what was there and what was expected.
#pragma once

#include "io/json_file.hpp"

#include <array>
#include <cstdint>
#include <initializer_list>
#include <string>

namespace clsp {

using Json = image_io::Json;
using image_io::JsonDocument;
using image_io::shown;

// Throws kIo if the file cannot be read, kInvalidArgument if it is refused (io/json_file.hpp).
JsonDocument read_json_file(const std::string &path);

// To as many digits that 2.9e-6 m is 2.9 um and back.
double rounded(double value);

// Walks through such a file; every message has the file, the field and what it should be. Fields are named by their
// path, "/camera/bits".
class JsonChecks {
  public:
    explicit JsonChecks(std::string path) : path_(std::move(path)) {}

    [[noreturn]] void refuse(const std::string &field, const std::string &what) const;
    const Json &member(const Json &parent, const char *key, const std::string &where, const char *expected) const;
    // expected: an example of it.
    const Json &object(const Json &parent, const char *key, const std::string &where,
                       const std::string &expected) const;
    double number(const Json &parent, const char *key, const std::string &where, const char *expected) const;
    double number(const Json &value, const std::string &field, const char *expected) const;
    std::uint32_t integer(const Json &parent, const char *key, const std::string &where, const char *expected) const;
    std::string text(const Json &parent, const char *key, const std::string &where, const char *expected) const;
    // The number of a word in a list.
    std::uint32_t word(const Json &parent, const char *key, const std::string &where,
                       std::initializer_list<const char *> words) const;
    std::array<double, 2> point(const Json &value, const std::string &field) const;
    const std::string &path() const { return path_; }

  private:
    std::string path_;
};

} // namespace clsp

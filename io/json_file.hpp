/**
 * @file json_file.hpp
 * @brief The one reader of JSON files. What they may ask for is bounded: bytes, levels, values, the length of a key.
 */
#ifndef CLSPECKLE_IO_JSON_FILE_HPP
#define CLSPECKLE_IO_JSON_FILE_HPP

#include "io/image_io.hpp"

#include <nlohmann/json.hpp>

#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>

namespace image_io {

/** Members are in the order of the file. */
using Json = nlohmann::ordered_json;

constexpr std::uint64_t most_json_bytes = std::uint64_t{64} << 20; ///< A million dots take 40 MB ...
constexpr std::size_t most_json_values = std::size_t{4} << 20;     ///< ... and three million values.
constexpr std::size_t most_json_levels = 100;                      ///< Far from what the stack holds.
constexpr std::size_t most_json_key_bytes = 1024;

/** A file that can be read, but is refused for what it holds. */
class JsonError : public ReadError {
  public:
    using ReadError::ReadError;
};

/** What a JSON file holds. Json's own destructor allocates, which ends the program where memory has run out; this one
 * takes the values apart without. */
class JsonDocument {
  public:
    JsonDocument() = default;
    explicit JsonDocument(Json root) : root_(std::move(root)) {}
    ~JsonDocument();
    JsonDocument(JsonDocument &&other) noexcept { root_.swap(other.root_); }
    JsonDocument &operator=(JsonDocument &&other) noexcept {
        root_.swap(other.root_);
        return *this;
    }

    const Json &root() const { return root_; }

  private:
    Json root_;
};

/** The bytes of a JSON file. Throws ReadError, or JsonError where there are too many. */
std::string read_json_text(const std::string &path);
/**
 * Throws JsonError for what is no JSON in UTF-8 (with or without a byte order mark), goes beyond the bounds above, or
 * gives a key twice: JSON leaves open which one counts. @param path for messages.
 */
JsonDocument parse_json(const std::string &text, const std::string &path);
/** Both. */
JsonDocument read_json(const std::string &path);

/** A value as a message shows it: short, and nothing that a terminal would obey. */
std::string shown(const Json &value);

} // namespace image_io

#endif // CLSPECKLE_IO_JSON_FILE_HPP

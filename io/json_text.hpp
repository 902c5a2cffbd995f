/**
 * @file json_text.hpp
 * @brief JSON that is written. Unlike the parser's type (io/json_file.hpp) it survives an allocation that fails: its
 * destructor takes no memory, and an exception leaves nothing half-made behind.
 */
#ifndef CLSPECKLE_IO_JSON_TEXT_HPP
#define CLSPECKLE_IO_JSON_TEXT_HPP

#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <string>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

namespace image_io {

/** A value; members of objects stay in the order in which they came. */
class JsonText {
  public:
    JsonText() = default; // null
    // By assignment: in libstdc++ 12 a variant that holds these types destroys what it has not made where its copy
    // constructor throws.
    JsonText(const JsonText &other) { value_ = other.value_; }
    JsonText(JsonText &&other) noexcept = default;
    JsonText &operator=(JsonText other) noexcept {
        value_.swap(other.value_);
        return *this;
    }
    ~JsonText() = default;
    JsonText(std::nullptr_t) {}
    JsonText(const char *text) : value_(std::string(text)) {}
    JsonText(std::string text) : value_(std::move(text)) {}
    template <typename T, std::enable_if_t<std::is_arithmetic_v<T>, int> = 0> JsonText(T number) {
        if constexpr (std::is_same_v<T, bool>)
            value_ = number;
        else if constexpr (std::is_floating_point_v<T>)
            value_ = static_cast<double>(number);
        else if constexpr (std::is_signed_v<T>)
            value_ = static_cast<std::int64_t>(number);
        else
            value_ = static_cast<std::uint64_t>(number);
    }
    /** A list of a container's elements. */
    template <typename List, typename = typename List::value_type, typename = decltype(std::declval<List>().begin())>
    JsonText(const List &list) : value_(Array(list.begin(), list.end())) {}
    /** An object where all are lists of a text and a value, else a list. */
    JsonText(std::initializer_list<JsonText> values);

    static JsonText array(std::initializer_list<JsonText> values = {});
    static JsonText object();

    /** The member, which is made if there is none; null becomes an object. */
    JsonText &operator[](const std::string &key);
    /** Null becomes a list. */
    void push_back(JsonText value);
    const JsonText &back() const { return std::get<Array>(value_).back(); }
    JsonText &back() { return std::get<Array>(value_).back(); }
    const JsonText &operator[](std::size_t index) const { return std::get<Array>(value_).at(index); }
    std::size_t size() const { return std::get<Array>(value_).size(); }
    bool empty() const { return size() == 0; }

    /** What is not UTF-8 becomes U+FFFD; what is no number, null. @param indent spaces of a level; -1: one line. */
    std::string text(int indent = -1) const;

  private:
    using Array = std::vector<JsonText>;
    using Object = std::vector<std::pair<std::string, JsonText>>;

    void append(std::string &text, int indent, int level) const;

    std::variant<std::nullptr_t, bool, std::int64_t, std::uint64_t, double, std::string, Array, Object> value_ =
        nullptr;
};

/** Text between quotation marks, as JSON has it. */
std::string json_string(const std::string &text);

} // namespace image_io

#endif // CLSPECKLE_IO_JSON_TEXT_HPP

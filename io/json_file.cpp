#include "io/json_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <vector>

namespace image_io {
namespace {

/** Takes a value apart from its leaves on: an empty list or object goes without an allocation. The levels are bounded.
 */
void take_apart(Json &value) noexcept {
    if (value.is_array()) {
        auto &list = value.get_ref<Json::array_t &>();
        for (Json &entry : list)
            take_apart(entry);
        list.clear();
    } else if (value.is_object()) {
        auto &members = value.get_ref<Json::object_t &>();
        for (auto &member : members)
            take_apart(member.second);
        members.clear();
    }
}

/** In one line; bytes that are no text (another encoding) are not shown. */
std::string legible(const std::string &text) {
    std::string result;
    for (const char c : text) {
        if (c != '\n' && c != '\r' && c != '\t' && c != ' ')
            result += static_cast<unsigned char>(c) < 32 || static_cast<unsigned char>(c) > 126 ? '?' : c;
        else if (!result.empty() && result.back() != ' ')
            result += ' ';
    }
    return result;
}

/** A long text without its middle. */
std::string shortened(const std::string &text, std::size_t most) {
    return text.size() <= most ? text : text.substr(0, most / 2) + " ... " + text.substr(text.size() - most / 2);
}

/** What the parser says, without its own number of the error. It quotes what was read. */
std::string reason_of(const Json::exception &error) {
    const std::string what = error.what();
    const std::size_t bracket = what.find("] ");
    return legible(shortened(bracket == std::string::npos ? what : what.substr(bracket + 2), 300));
}

constexpr const char *no_text = "; the file is no text in UTF-8: save it in that encoding";

/** Where to look and for what. @param byte where the parser noticed, from 1. */
std::string advice_on_syntax(const std::string &text, std::size_t byte, const std::string &reason) {
    if (reason.find("ill-formed UTF-8") != std::string::npos)
        return no_text;
    if (reason.find("end of input") != std::string::npos ||
        (reason.find("missing closing quote") != std::string::npos && byte >= text.size()))
        return "; the file ends before it is complete: copy it again, or close what is open with ] or }";
    const std::size_t at = std::min(byte > 0 ? byte - 1 : 0, text.size());
    const auto around = [&](std::size_t before, std::size_t after) {
        const std::size_t begin = at - std::min(before, at);
        return text.substr(begin, at + after - begin);
    };
    const std::string near = around(10, 10);
    if (near.find("NaN") != std::string::npos || near.find("Infinity") != std::string::npos)
        return " (JSON has neither NaN nor Infinity; leave what is not known out)";
    // What is wrong lies before what no longer fits it.
    return fmt::format("; correct it there, at ... {} ...: keys and texts are in double quotes, a comma is between "
                       "two entries and none behind the last, and there are no comments",
                       legible(around(40, 10)));
}

/** Takes what the parser finds, which itself does not recurse. Lists and objects are made when they end, of their exact
 * size: time is linear, and nothing is copied. */
class Builder {
  public:
    using number_integer_t = Json::number_integer_t;
    using number_unsigned_t = Json::number_unsigned_t;
    using number_float_t = Json::number_float_t;
    using string_t = Json::string_t;
    using binary_t = Json::binary_t;

    Builder(const std::string &text, const std::string &path) : text_(text), path_(path) {}
    ~Builder() {
        for (Json &value : values_)
            take_apart(value);
    }
    Builder(const Builder &) = delete;
    Builder &operator=(const Builder &) = delete;

    JsonDocument document() { return JsonDocument(std::move(values_.front())); }

    bool null() { return add(nullptr); }
    bool boolean(bool value) { return add(value); }
    bool number_integer(number_integer_t value) { return add(value); }
    bool number_unsigned(number_unsigned_t value) { return add(value); }
    bool number_float(number_float_t value, const string_t & /*text*/) { return add(value); }
    bool string(string_t &value) { return add(std::move(value)); }
    bool binary(binary_t & /*value*/) { return false; } // none in text
    bool start_object(std::size_t /*size*/) { return open(); }
    bool start_array(std::size_t /*size*/) { return open(); }
    bool key(string_t &name) {
        if (name.size() > most_json_key_bytes)
            refuse(fmt::format("has a key of {} bytes, {} ...; at most {} are taken", name.size(),
                               legible(name.substr(0, 40)), most_json_key_bytes));
        keys_.push_back(std::move(name));
        return true;
    }
    bool end_object() {
        const Level level = levels_.back();
        check_keys(level);
        Json object = Json::object();
        auto &members = object.get_ref<Json::object_t &>();
        members.reserve(values_.size() - level.first_value);
        for (std::size_t i = level.first_value, k = level.first_key; i < values_.size(); ++i, ++k)
            members.emplace_back(std::move(keys_[k]), std::move(values_[i]));
        keys_.resize(level.first_key);
        close(level, object);
        return true;
    }
    bool end_array() {
        const Level level = levels_.back();
        Json array = Json::array();
        auto &list = array.get_ref<Json::array_t &>();
        list.reserve(values_.size() - level.first_value);
        for (std::size_t i = level.first_value; i < values_.size(); ++i)
            list.push_back(std::move(values_[i]));
        close(level, array);
        return true;
    }
    bool parse_error(std::size_t byte, const std::string & /*token*/, const Json::exception &error) {
        const std::string reason = reason_of(error);
        if (dynamic_cast<const Json::out_of_range *>(&error))
            refuse(fmt::format("is not valid JSON: {}; expected a number below 1.8e308: correct it, or leave it out",
                               reason));
        refuse(fmt::format("is not valid JSON: {}{}", reason, advice_on_syntax(text_, byte, reason)));
    }

  private:
    struct Level {
        std::size_t first_value, first_key;
    };

    [[noreturn]] void refuse(const std::string &reason) const { throw JsonError(path_, reason); }

    template <typename T> bool add(T &&value) {
        if (++count_ > most_json_values)
            refuse(
                fmt::format("holds more than {} values; at most so many are taken: split the file", most_json_values));
        values_.emplace_back(std::forward<T>(value));
        return true;
    }
    bool open() {
        if (levels_.size() == most_json_levels)
            refuse(fmt::format("is nested more than {} levels deep; expected a file as clSpeckle writes it",
                               most_json_levels));
        add(nullptr); // its place
        levels_.push_back({values_.size(), keys_.size()});
        return true;
    }
    /** Puts a list or an object, whose values have been moved into it, in its place. */
    void close(const Level &level, Json &made) noexcept {
        values_.erase(values_.begin() + std::ptrdiff_t(level.first_value), values_.end());
        values_.back().swap(made);
        levels_.pop_back();
    }
    void check_keys(const Level &level) const {
        std::vector<const std::string *> sorted;
        sorted.reserve(keys_.size() - level.first_key);
        for (std::size_t k = level.first_key; k < keys_.size(); ++k)
            sorted.push_back(&keys_[k]);
        std::sort(sorted.begin(), sorted.end(), [](const std::string *a, const std::string *b) { return *a < *b; });
        const auto twice = std::adjacent_find(sorted.begin(), sorted.end(),
                                              [](const std::string *a, const std::string *b) { return *a == *b; });
        if (twice != sorted.end())
            refuse(fmt::format("the key \"{}{}\" is given twice; keep one of them", place(), legible(**twice)));
    }
    /** The keys that lead to the innermost object. */
    std::string place() const {
        std::string result;
        for (std::size_t l = 0; l + 1 < levels_.size(); ++l)
            if (levels_[l + 1].first_key > levels_[l].first_key) // a list has no keys
                result += legible(keys_[levels_[l + 1].first_key - 1]) + ".";
        return result;
    }

    const std::string &text_, &path_;
    std::vector<Json> values_;      ///< Of the lists and objects that are open, and before them.
    std::vector<std::string> keys_; ///< Of the objects that are open.
    std::vector<Level> levels_;
    std::size_t count_ = 0;
};

} // namespace

JsonDocument::~JsonDocument() {
    take_apart(root_);
}

std::string read_json_text(const std::string &path) {
    detail::InputFile file(path);
    if (file.size() > most_json_bytes)
        throw JsonError(path, fmt::format("has {} bytes; a JSON file may have {}", file.size(), most_json_bytes));
    std::string text(static_cast<std::size_t>(file.size()), '\0');
    file.read(text.data(), text.size());
    return text;
}

JsonDocument parse_json(const std::string &text, const std::string &path) {
    // The parser takes it for the end.
    if (const std::size_t zero = text.find('\0'); zero != std::string::npos)
        throw JsonError(path, fmt::format("is not valid JSON: byte {} is 0{}", zero, no_text));
    Builder builder(text, path);
    Json::sax_parse(text, &builder); // throws where it does not take all
    return builder.document();
}

JsonDocument read_json(const std::string &path) {
    return parse_json(read_json_text(path), path);
}

std::string shown(const Json &value) {
    constexpr std::size_t most = 60;
    if (value.is_structured() && value.size() > most)
        return fmt::format("{} of {} entries", value.is_array() ? "a list" : "an object", value.size());
    const std::string text = value.dump(-1, ' ', true, Json::error_handler_t::replace);
    return text.size() > most ? text.substr(0, most - 3) + "..." : text;
}

} // namespace image_io

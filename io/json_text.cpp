#include "io/json_text.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/core.h>
#include <nlohmann/json.hpp>

namespace image_io {

JsonText::JsonText(std::initializer_list<JsonText> values) {
    const auto is_member = [](const JsonText &value) {
        const Array *list = std::get_if<Array>(&value.value_);
        return list && list->size() == 2 && std::holds_alternative<std::string>(list->front().value_);
    };
    if (!std::all_of(values.begin(), values.end(), is_member)) {
        value_ = Array(values);
        return;
    }
    Object object;
    object.reserve(values.size());
    for (const JsonText &value : values)
        object.emplace_back(std::get<std::string>(value[0].value_), value[1]);
    value_ = std::move(object);
}

JsonText JsonText::array(std::initializer_list<JsonText> values) {
    JsonText result;
    result.value_ = Array(values);
    return result;
}

JsonText JsonText::object() {
    JsonText result;
    result.value_ = Object();
    return result;
}

JsonText &JsonText::operator[](const std::string &key) {
    if (std::holds_alternative<std::nullptr_t>(value_))
        value_ = Object();
    Object &object = std::get<Object>(value_);
    const auto found =
        std::find_if(object.begin(), object.end(), [&](const auto &member) { return member.first == key; });
    return found != object.end() ? found->second : object.emplace_back(key, JsonText()).second;
}

void JsonText::push_back(JsonText value) {
    if (std::holds_alternative<std::nullptr_t>(value_))
        value_ = Array();
    std::get<Array>(value_).push_back(std::move(value));
}

std::string JsonText::text(int indent) const {
    std::string result;
    append(result, indent, 0);
    return result;
}

void JsonText::append(std::string &text, int indent, int level) const {
    const auto new_line = [&](int levels) {
        if (indent >= 0)
            text.append(1, '\n').append(static_cast<std::size_t>(indent * levels), ' ');
    };
    const auto entries = [&](char open, const auto &list, char close, const auto &one) {
        text += open;
        for (std::size_t i = 0; i < list.size(); ++i) {
            if (i > 0)
                text += ',';
            new_line(level + 1);
            one(list[i]);
        }
        if (!list.empty())
            new_line(level);
        text += close;
    };
    const auto number = [&](double value) {
        const std::string digits = fmt::format("{}", value);
        text += digits;
        if (digits.find_first_not_of("-0123456789") == std::string::npos)
            text += ".0"; // readers tell whole numbers from others
    };
    std::visit(
        [&](const auto &value) {
            using T = std::decay_t<decltype(value)>;
            if constexpr (std::is_same_v<T, std::nullptr_t>)
                text += "null";
            else if constexpr (std::is_same_v<T, double>)
                std::isfinite(value) ? number(value) : void(text += "null");
            else if constexpr (std::is_same_v<T, std::string>)
                text += json_string(value);
            else if constexpr (std::is_same_v<T, Array>)
                entries('[', value, ']', [&](const JsonText &entry) { entry.append(text, indent, level + 1); });
            else if constexpr (std::is_same_v<T, Object>)
                entries('{', value, '}', [&](const auto &member) {
                    text.append(json_string(member.first)).append(indent >= 0 ? ": " : ":");
                    member.second.append(text, indent, level + 1);
                });
            else
                text += fmt::format("{}", value);
        },
        value_);
}

std::string json_string(const std::string &text) {
    return nlohmann::json(text).dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

} // namespace image_io

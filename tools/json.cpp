#include "json.hpp"

#include "errors.hpp"

#include <fmt/format.h>

namespace tools {

namespace {

void check_texts(const Json &value, const std::string &place) {
    if (value.is_structured()) {
        for (const auto &[key, member] : value.items())
            check_texts(member, place + "/" + key);
    } else if (value.is_string()) {
        try {
            (void)value.dump();
        } catch (const Json::type_error &) {
            throw InputError(fmt::format("{} would be {}, which is no text in UTF-8, as JSON must be: rename that file",
                                         place, value.dump(-1, ' ', true, Json::error_handler_t::replace)));
        }
    }
}

} // namespace

std::string json_document(const Json &root, int indent) {
    check_texts(root, "");
    return root.dump(indent);
}

} // namespace tools

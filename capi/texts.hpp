// Texts that go to the caller's memory: cut to fit, always with a final 0.
#pragma once

#include "runtime/error.hpp"

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <fmt/core.h>
#include <string>
#include <string_view>

namespace clsp::capi {

// Into an array of a C struct; zeros behind it.
template <std::size_t Size> void copy_text(char (&to)[Size], std::string_view from) {
    const std::size_t length = std::min(from.size(), Size - 1);
    std::memcpy(to, from.data(), length);
    std::memset(to + length, 0, Size - length);
}

// Into memory of the caller's; *length gets the size of the whole.
inline void give_text(std::string_view value, std::uint64_t capacity, char *text, std::uint64_t *length,
                      const char *name) {
    if (capacity > 0) {
        if (!text)
            throw Error(Status::kInvalidArgument, fmt::format("{} is NULL although capacity is not 0", name));
        const std::size_t copied = std::min<std::size_t>(value.size(), capacity - 1);
        std::memcpy(text, value.data(), copied);
        text[copied] = '\0';
    }
    if (length)
        *length = value.size() + 1;
}

} // namespace clsp::capi

// Texts that go to the caller's memory.
#pragma once

#include "runtime/error.hpp"

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <fmt/core.h>
#include <string>

namespace clsp::capi {

// As much of `value` as fits, always with a final 0; *length gets the size of the whole.
inline void give_text(const std::string &value, std::uint64_t capacity, char *text, std::uint64_t *length,
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

// The enumerations of the C interface. A caller's number becomes one of core's enumerations here and nowhere else, so
// that those always have one of their values, and core has no words for others.
#pragma once

#include "clspeckle/clspeckle.h"
#include "runtime/error.hpp"

#include <cstddef>
#include <cstdint>
#include <fmt/core.h>
#include <iterator>
#include <string>
#include <string_view>

namespace clsp::capi {

// The C names of an enumeration's values.
template <typename Enum> struct EnumNames;

template <std::size_t count> constexpr bool consecutive(const std::uint32_t (&values)[count]) {
    for (std::size_t i = 1; i < count; ++i)
        if (values[i] != values[0] + i)
            return false;
    return true;
}

// An enumeration of core, its last value, and the C names of all its values in order.
#define CLSP_ENUM(Enum, last, ...)                                                                                     \
    template <> struct EnumNames<Enum> {                                                                               \
        static constexpr std::uint32_t kValues[] = {__VA_ARGS__};                                                      \
        static constexpr std::string_view kNames = #__VA_ARGS__;                                                       \
        static_assert(consecutive(kValues) &&                                                                          \
                          kValues[std::size(kValues) - 1] == static_cast<std::uint32_t>(Enum::last),                   \
                      #Enum " and its C names must agree");                                                            \
    };

// "CLSP_A (0), CLSP_B (1) or CLSP_C (2)" of "CLSP_A, CLSP_B, CLSP_C".
inline std::string numbered_names(std::string_view names, std::uint32_t number) {
    std::string result;
    for (;; ++number) {
        const std::size_t comma = names.find(", ");
        const bool last = comma == std::string_view::npos;
        if (!result.empty())
            result += last ? " or " : ", ";
        result += fmt::format("{} ({})", names.substr(0, comma), number);
        if (last)
            return result;
        names.remove_prefix(comma + 2);
    }
}

// The value that a caller's number stands for.
template <typename Enum>
Enum checked_enum(std::uint32_t value, const char *name, Status status = Status::kInvalidArgument) {
    using Names = EnumNames<Enum>;
    if (value < *std::begin(Names::kValues) || value > *std::rbegin(Names::kValues))
        throw Error(status, fmt::format("{} is {}, expected {}", name, value,
                                        numbered_names(Names::kNames, *std::begin(Names::kValues))));
    return static_cast<Enum>(value);
}

} // namespace clsp::capi

// Equality of parameter structs from one list of their members.
#pragma once

#include <tuple>

// After a struct: the names of all its members, in their order. A list that misses one does not compile, so a new
// parameter cannot be left out of comparisons.
#define CLSP_EQUALITY(Struct, ...)                                                                                     \
    inline auto fields_of(const Struct &value) {                                                                       \
        const auto &[__VA_ARGS__] = value;                                                                             \
        return std::tie(__VA_ARGS__);                                                                                  \
    }                                                                                                                  \
    inline bool operator==(const Struct &a, const Struct &b) { return fields_of(a) == fields_of(b); }                  \
    inline bool operator!=(const Struct &a, const Struct &b) { return !(a == b); }

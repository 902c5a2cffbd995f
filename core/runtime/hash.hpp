// FNV-1a of 64 bits: a key of what is also compared in full.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <type_traits>

namespace clsp {

constexpr std::uint64_t kFnvBasis = 0xcbf29ce484222325u;

// Each value is added whole, whatever its size. hash: of what comes before.
template <typename T> std::uint64_t fnv1a(const T *values, std::size_t count, std::uint64_t hash = kFnvBasis) {
    for (std::size_t i = 0; i < count; ++i)
        hash = (hash ^ static_cast<std::make_unsigned_t<T>>(values[i])) * 0x100000001b3u;
    return hash;
}
inline std::uint64_t fnv1a(const std::string &text, std::uint64_t hash = kFnvBasis) {
    return fnv1a(text.data(), text.size(), hash);
}

} // namespace clsp

// Lists that the C interface gives out entry by entry.
#pragma once

#include "runtime/error.hpp"

#include <cstddef>
#include <cstdint>
#include <fmt/core.h>
#include <vector>

namespace clsp::capi {

template <typename T> const T &item(const std::vector<T> &list, std::uint32_t index, const char *what) {
    if (index >= list.size())
        throw Error(Status::kInvalidArgument,
                    list.empty()
                        ? fmt::format("index is {}, there are no {}", index, what)
                        : fmt::format("index is {}, there are {} {} (numbered from 0)", index, list.size(), what));
    return list[index];
}

inline std::uint32_t count_of(std::size_t size) {
    return static_cast<std::uint32_t>(size);
}

} // namespace clsp::capi

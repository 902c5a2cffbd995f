// Structs that can grow: reading an older or newer caller's struct, writing one.
#pragma once

#include "clspeckle/clspeckle.h"
#include "runtime/error.hpp"
#include "status.hpp"

#include <algorithm>
#include <cstddef>
#include <cstring>
#include <fmt/core.h>
#include <string>

namespace clsp::capi {

// Size of each struct in the first release that had it: the least that a caller may have. A struct that gets a
// member keeps its old size here, as a number.
template <typename T> inline constexpr std::uint32_t kFirstSize = sizeof(T);
template <> inline constexpr std::uint32_t kFirstSize<ClspApertureDesc> = 104;
template <> inline constexpr std::uint32_t kFirstSize<ClspApertureInfo> = 72;
template <> inline constexpr std::uint32_t kFirstSize<ClspCameraTraits> = 56;
template <> inline constexpr std::uint32_t kFirstSize<ClspContextDesc> = 48;
template <> inline constexpr std::uint32_t kFirstSize<ClspDiagnoseDesc> = 104;
template <> inline constexpr std::uint32_t kFirstSize<ClspDiagnosisPlace> = 256;
template <> inline constexpr std::uint32_t kFirstSize<ClspDiagnosisSummary> = 152;
template <> inline constexpr std::uint32_t kFirstSize<ClspDoePatternDesc> = 200;
template <> inline constexpr std::uint32_t kFirstSize<ClspDotLayoutDesc> = 120;
template <> inline constexpr std::uint32_t kFirstSize<ClspFrame> = 144;
template <> inline constexpr std::uint32_t kFirstSize<ClspHypothesis> = 64;
template <> inline constexpr std::uint32_t kFirstSize<ClspPatternDesc> = 160;
template <> inline constexpr std::uint32_t kFirstSize<ClspPhaseDesc> = 40;
template <> inline constexpr std::uint32_t kFirstSize<ClspPipelineDesc> = 40;
template <> inline constexpr std::uint32_t kFirstSize<ClspSensorDesc> = 112;

inline void check_struct_size(std::uint32_t size, std::uint32_t first, const char *name) {
    if (size < first)
        throw Error(
            Status::kInvalidStructSize,
            fmt::format(
                "{}->struct_size is {}, expected at least {}; set it by the struct's Init function or to sizeof", name,
                size, first));
    constexpr std::uint32_t kLargest = 1u << 16;
    if (size > kLargest)
        throw Error(Status::kInvalidStructSize,
                    fmt::format("{}->struct_size is {}, which no version of it has", name, size));
}

// What the caller's struct says, over the defaults for what it is too old to say.
template <typename T> T read_struct(const T *user, const T &defaults, const char *name) {
    if (!user)
        throw Error(Status::kInvalidArgument, fmt::format("{} is NULL", name));
    const std::uint32_t size = user->struct_size;
    check_struct_size(size, kFirstSize<T>, name);
    const auto *bytes = reinterpret_cast<const unsigned char *>(user);
    for (std::uint32_t i = sizeof(T); i < size; ++i)
        if (bytes[i] != 0)
            throw Error(
                Status::kInvalidStructSize,
                fmt::format(
                    "{} is from a newer release and uses a member (at byte {}) that this library does not know; "
                    "update the library",
                    name, i));
    T result = defaults;
    std::memcpy(static_cast<void *>(&result), bytes, std::min<std::size_t>(size, sizeof(T)));
    return result;
}

// Writes as much of `value` as the caller's struct has room for; its struct_size stays.
template <typename T> void write_struct(T &user, T value, const char *name) {
    const std::uint32_t size = user.struct_size;
    check_struct_size(size, kFirstSize<T>, name);
    value.struct_size = size;
    std::memcpy(static_cast<void *>(&user), &value, std::min<std::size_t>(size, sizeof(T)));
}

// The body of every Init function: defaults, and zeros in what a newer caller's struct has more.
template <typename T> void init_struct(T *user, std::uint32_t struct_size, const T &defaults, const char *name) {
    if (!user)
        throw Error(Status::kInvalidArgument, fmt::format("{} is NULL", name));
    check_struct_size(struct_size, kFirstSize<T>, name);
    std::memset(static_cast<void *>(user), 0, struct_size);
    user->struct_size = struct_size;
    write_struct(*user, defaults, name);
}

// clsp<Name>Init(), within extern "C".
#define CLSP_INIT(Name, value, defaults)                                                                               \
    CLSP_API ClspStatus clsp##Name##Init(Clsp##Name *value, uint32_t struct_size) {                                    \
        return clsp::capi::guarded("clsp" #Name "Init",                                                                \
                                   [&] { clsp::capi::init_struct(value, struct_size, defaults, #value); });            \
    }

// A member that has no meaning yet.
inline void check_reserved(std::uint32_t value, const char *name) {
    if (value != 0)
        throw Error(Status::kInvalidArgument, fmt::format("{} is {}, it must be 0", name, value));
}

// A member that is 0 or 1.
inline bool checked_flag(std::uint32_t value, const char *name) {
    if (value > 1)
        throw Error(Status::kInvalidArgument, fmt::format("{} is {}, it must be 0 or 1", name, value));
    return value == 1;
}

} // namespace clsp::capi

// What a context shares with other APIs: textures of GL, memory that comes as a file descriptor.
#pragma once

#include "runtime/command_chain.hpp"
#include "runtime/context.hpp"
#include "runtime/opencl.hpp"

#include <cstdint>
#include <string>

namespace clsp {

// The numbers are those of CLSP_EXTERNAL_MEMORY_*; capi asserts that they agree.
constexpr std::uint32_t kOpaqueFd = 1, kDmaBuf = 2;
enum class SharedKind : std::uint32_t { kGl = 0, kExternal = 1 };

// A reason says why there is none of it, and is empty if there is.
struct Interop {
    std::string cl_images_reason, gl_textures_reason, external_memory_reason;
    std::uint32_t external_memory = 0; // sum of the types
};
Interop interop(const Context &context);

// Throws kInvalidArgument if it is no cl_mem, kWrongContext if it belongs to another cl_context.
void check_mem(const Context &context, cl_mem mem, const std::string &name);

// Throws kUnsupported, with the reason, where the device has no images.
void require_cl_images(const Context &context);

// A new reference each. Throw kUnsupported, with the reason, where the context has no such thing.
cl_mem make_from_gl_texture(const Context &context, cl_mem_flags flags, std::uint32_t target, std::int32_t level,
                            std::uint32_t texture);
cl_mem make_from_fd(const Context &context, std::uint32_t type, std::int32_t fd, std::uint64_t size_bytes);

// acquire: else released.
void enqueue_shared(const Context &context, CommandChain &chain, SharedKind kind, bool acquire, std::uint32_t count,
                    const cl_mem *mems);

} // namespace clsp

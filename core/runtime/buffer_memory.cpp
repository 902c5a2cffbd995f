#include "runtime/buffer_memory.hpp"

#include "runtime/context.hpp"

#include <cstdlib>
#include <cstring>
#include <memory>

#if defined(__linux__)
#include <sys/mman.h>
#endif

namespace clsp {
namespace {

#if defined(__linux__)
constexpr std::size_t kLargePage = std::size_t{2} << 20;
// Buffers begin at different places of their large pages, one after the other: the same pixel of an image and of its
// phases would share a cache's few sets otherwise. Three small pages and some cache lines apart.
constexpr std::size_t kStagger = 12544, kStaggers = 16;

struct Free {
    void operator()(void *memory) const { std::free(memory); }
};

// Nothing where there is no such memory.
std::unique_ptr<void, Free> large_pages(std::size_t bytes) {
    void *memory = nullptr;
    if (posix_memalign(&memory, kLargePage, bytes) != 0)
        return {};
    // A wish: small pages serve as well. What does not fill a last page stays in small ones.
    madvise(memory, bytes / kLargePage * kLargePage, MADV_HUGEPAGE);
    return std::unique_ptr<void, Free>(memory);
}

// Commands keep a buffer beyond its release, and PoCL says when it is gone.
void CL_CALLBACK free_memory(cl_mem, void *memory) {
    std::free(memory);
}
#endif

} // namespace

cl::Buffer allocate_buffer(const Context &context, std::size_t bytes, const void *host_data) {
#if defined(__linux__)
    if (context.is_pocl_cpu() && bytes >= kLargePage) {
        if (auto memory = large_pages(bytes + kStaggers * kStagger)) {
            char *const begin = static_cast<char *>(memory.get()) + context.next_large_buffer() % kStaggers * kStagger;
            if (host_data)
                std::memcpy(begin, host_data, bytes);
            cl::Buffer buffer(context.cl_context(), CL_MEM_READ_WRITE | CL_MEM_USE_HOST_PTR, bytes, begin);
            buffer.setDestructorCallback(free_memory, memory.get());
            memory.release();
            return buffer;
        }
    }
#endif
    return cl::Buffer(context.cl_context(), CL_MEM_READ_WRITE | (host_data ? CL_MEM_COPY_HOST_PTR : 0), bytes,
                      const_cast<void *>(host_data));
}

} // namespace clsp

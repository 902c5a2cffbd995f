#include "clspeckle/interop.h"

#include "convert.hpp"
#include "handles.hpp"
#include "runtime/interop.hpp"
#include "stages/cl_image.hpp"
#include "texts.hpp"

using namespace clsp;
using namespace clsp::capi;

namespace clsp::capi {

CLSP_ENUM(SharedKind, kExternal, CLSP_SHARED_GL, CLSP_SHARED_EXTERNAL)
static_assert(kOpaqueFd == CLSP_EXTERNAL_MEMORY_OPAQUE_FD && kDmaBuf == CLSP_EXTERNAL_MEMORY_DMA_BUF,
              "the engine's types are those of interop.h");

} // namespace clsp::capi

namespace {

void shared(ClspContext context, cl_command_queue queue, std::uint32_t kind, bool acquire, std::uint32_t count,
            const cl_mem *mems, std::uint32_t num_waits, const cl_event *waits, cl_event *event) {
    const auto c = object(context);
    const auto shared_kind = checked_enum<SharedKind>(kind, "kind");
    enqueue(*c, queue, num_waits, waits, event,
            [&](CommandChain &chain) { enqueue_shared(*c, chain, shared_kind, acquire, count, mems); });
}

} // namespace

extern "C" {

CLSP_API ClspStatus clspContextGetInteropInfo(ClspContext context, ClspInteropInfo *info) {
    return guarded("clspContextGetInteropInfo", [&] {
        const Interop found = interop(*object(context));
        ClspInteropInfo result{};
        result.cl_images = found.cl_images_reason.empty();
        result.gl_textures = found.gl_textures_reason.empty();
        result.external_memory = found.external_memory;
        copy_text(result.cl_images_reason, found.cl_images_reason);
        copy_text(result.gl_textures_reason, found.gl_textures_reason);
        copy_text(result.external_memory_reason, found.external_memory_reason);
        write_struct(required(info, "info"), result, "info");
    });
}

CLSP_API ClspStatus clspClImageEnqueueImport(ClspContext context, cl_command_queue queue, cl_mem cl_image,
                                             uint32_t first_channel, const ClspImage *image,
                                             uint32_t num_events_in_wait_list, const cl_event *event_wait_list,
                                             cl_event *event) {
    return guarded("clspClImageEnqueueImport", [&] {
        const auto c = object(context);
        enqueue(*c, queue, num_events_in_wait_list, event_wait_list, event, [&](CommandChain &chain) {
            enqueue_cl_image_import(*c, chain, cl_image, first_channel, description(image, "image"));
        });
    });
}

CLSP_API ClspStatus clspClImageEnqueueExport(ClspContext context, cl_command_queue queue, const ClspImage *image,
                                             cl_mem cl_image, uint32_t num_events_in_wait_list,
                                             const cl_event *event_wait_list, cl_event *event) {
    return guarded("clspClImageEnqueueExport", [&] {
        const auto c = object(context);
        enqueue(*c, queue, num_events_in_wait_list, event_wait_list, event, [&](CommandChain &chain) {
            enqueue_cl_image_export(*c, chain, description(image, "image"), cl_image);
        });
    });
}

CLSP_API ClspStatus clspClImageCreateFromGl(ClspContext context, uint64_t flags, uint32_t target, int32_t level,
                                            uint32_t texture, cl_mem *cl_image) {
    return guarded("clspClImageCreateFromGl", [&] {
        const auto c = object(context);
        required(cl_image, "cl_image");
        *cl_image = make_from_gl_texture(*c, flags, target, level, texture);
    });
}

CLSP_API ClspStatus clspBufferCreateFromFd(ClspContext context, uint32_t type, int32_t fd, uint64_t size_bytes,
                                           cl_mem *mem) {
    return guarded("clspBufferCreateFromFd", [&] {
        const auto c = object(context);
        required(mem, "mem");
        *mem = make_from_fd(*c, type, fd, size_bytes);
    });
}

CLSP_API ClspStatus clspSharedEnqueueAcquire(ClspContext context, cl_command_queue queue, uint32_t kind, uint32_t count,
                                             const cl_mem *mems, uint32_t num_events_in_wait_list,
                                             const cl_event *event_wait_list, cl_event *event) {
    return guarded("clspSharedEnqueueAcquire", [&] {
        shared(context, queue, kind, true, count, mems, num_events_in_wait_list, event_wait_list, event);
    });
}

CLSP_API ClspStatus clspSharedEnqueueRelease(ClspContext context, cl_command_queue queue, uint32_t kind, uint32_t count,
                                             const cl_mem *mems, uint32_t num_events_in_wait_list,
                                             const cl_event *event_wait_list, cl_event *event) {
    return guarded("clspSharedEnqueueRelease", [&] {
        shared(context, queue, kind, false, count, mems, num_events_in_wait_list, event_wait_list, event);
    });
}

} // extern "C"

// From the C structs to the engine's.
#pragma once

#include "clspeckle/clspeckle.h"
#include "runtime/command_chain.hpp"
#include "runtime/context.hpp"
#include "runtime/image_view.hpp"
#include "stages/pattern.hpp"
#include "status.hpp"
#include "structs.hpp"

namespace clsp::capi {

static_assert(static_cast<std::uint32_t>(Format::kFloat32x4) == CLSP_FORMAT_FLOAT32X4,
              "Format and CLSP_FORMAT_* must agree");
static_assert(static_cast<std::uint32_t>(Format::kUint8) == CLSP_FORMAT_UINT8, "Format and CLSP_FORMAT_* must agree");

inline ImageDescription description(const ClspImage &image) {
    check_reserved(image.reserved, "ClspImage::reserved");
    return {image.mem,   image.offset_bytes, image.pitch_bytes,
            image.width, image.height,       static_cast<Format>(image.format)};
}

inline ImageDescription description(const ClspImage *image, const char *name) {
    return description(required(image, name));
}

// Empty where the pointer is NULL or has no buffer.
inline ImageDescription optional_description(const ClspImage *image) {
    return image && image->mem ? description(*image) : ImageDescription{};
}

Geometry geometry(const ClspGeometry *user);

// An Enqueue call: queue and wait list checked, the commands of `body(chain)`, the caller's event.
template <typename Body>
void enqueue(const Context &context, cl_command_queue queue, cl_uint num_waits, const cl_event *waits, cl_event *event,
             Body body) {
    context.check_queue(queue);
    check_wait_list(context.cl_context()(), num_waits, waits);
    CommandChain chain(queue, num_waits, waits);
    body(chain);
    chain.finish(event);
}

} // namespace clsp::capi

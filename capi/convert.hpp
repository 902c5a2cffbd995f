// From the C structs to the engine's.
#pragma once

#include "clspeckle/clspeckle.h"
#include "enums.hpp"
#include "runtime/command_chain.hpp"
#include "runtime/context.hpp"
#include "runtime/image_view.hpp"
#include "stages/pattern.hpp"
#include "stages/phase.hpp"
#include "status.hpp"
#include "structs.hpp"

#include <string>

namespace clsp::capi {

CLSP_ENUM(Format, kFloat32x4, CLSP_FORMAT_NONE, CLSP_FORMAT_UINT8, CLSP_FORMAT_UINT16, CLSP_FORMAT_UINT32,
          CLSP_FORMAT_FLOAT32, CLSP_FORMAT_FLOAT32X2, CLSP_FORMAT_FLOAT32X3, CLSP_FORMAT_FLOAT32X4)
CLSP_ENUM(DepthKind, kAlongRay, CLSP_DEPTH_ALONG_AXIS, CLSP_DEPTH_ALONG_RAY)
CLSP_ENUM(FieldKind, kUnitPhasor, CLSP_FIELD_CIRCULAR_GAUSSIAN, CLSP_FIELD_UNIT_PHASOR)

inline ImageDescription description(const ClspImage &image, const std::string &name) {
    check_reserved(image.reserved, (name + ".reserved").c_str());
    return {image.mem,
            image.offset_bytes,
            image.pitch_bytes,
            image.width,
            image.height,
            checked_enum<Format>(image.format, (name + ".format").c_str(), Status::kInvalidFormat)};
}

inline ImageDescription description(const ClspImage *image, const char *name) {
    return description(required(image, name), name);
}

// Empty where there is no image, or one without a buffer.
inline ImageDescription optional_description(const ClspImage &image, const std::string &name) {
    return image.mem ? description(image, name) : ImageDescription{};
}

inline ImageDescription optional_description(const ClspImage *image, const char *name) {
    return image ? optional_description(*image, name) : ImageDescription{};
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

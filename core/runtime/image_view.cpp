#include "runtime/image_view.hpp"

#include "runtime/error.hpp"

#include <algorithm>
#include <fmt/core.h>

namespace clsp {

std::uint32_t component_bytes(Format format) {
    switch (format) {
    case Format::kUint8:
        return 1;
    case Format::kUint16:
        return 2;
    default:
        return 4;
    }
}

std::uint32_t component_count(Format format) {
    switch (format) {
    case Format::kFloat32x2:
        return 2;
    case Format::kFloat32x3:
        return 3;
    case Format::kFloat32x4:
        return 4;
    default:
        return 1;
    }
}

std::string format_name(Format format) {
    switch (format) {
    case Format::kNone:
        break;
    case Format::kUint8:
        return "uint8";
    case Format::kUint16:
        return "uint16";
    case Format::kUint32:
        return "uint32";
    case Format::kFloat32:
        return "float32";
    case Format::kFloat32x2:
        return "float32x2";
    case Format::kFloat32x3:
        return "float32x3";
    case Format::kFloat32x4:
        return "float32x4";
    }
    return "none";
}

void check_image_size(std::uint32_t width, std::uint32_t height, const char *what) {
    if (width == 0 || height == 0 || width > kMaxImageSide || height > kMaxImageSide)
        throw Error(Status::kInvalidArgument,
                    fmt::format("{} is {} x {} pixels (width x height); each side must be 1 to {}", what, width, height,
                                kMaxImageSide));
}

namespace {

struct MemoryInfo {
    std::uint64_t bytes;
    cl_mem parent;
    std::uint64_t offset_in_parent;
};

MemoryInfo inspect(cl_mem mem, const char *name, ::cl_context context) {
    ::cl_context mem_context = nullptr;
    cl_mem_object_type type = 0;
    std::size_t bytes = 0, offset = 0;
    cl_mem parent = nullptr;
    const cl_int asked = clGetMemObjectInfo(mem, CL_MEM_CONTEXT, sizeof mem_context, &mem_context, nullptr);
    if (asked == CL_INVALID_MEM_OBJECT)
        throw Error(Status::kInvalidArgument, fmt::format("{} is not a valid cl_mem", name), asked);
    check_opencl(asked, "clGetMemObjectInfo");
    if (mem_context != context)
        throw Error(Status::kWrongContext,
                    fmt::format("{} belongs to another cl_context than the clSpeckle context", name));
    check_opencl(clGetMemObjectInfo(mem, CL_MEM_TYPE, sizeof type, &type, nullptr), "clGetMemObjectInfo");
    if (type != CL_MEM_OBJECT_BUFFER)
        throw Error(Status::kInvalidArgument,
                    fmt::format("{} is a cl_image; copy it into a buffer first (interop.h)", name));
    check_opencl(clGetMemObjectInfo(mem, CL_MEM_SIZE, sizeof bytes, &bytes, nullptr), "clGetMemObjectInfo");
    check_opencl(clGetMemObjectInfo(mem, CL_MEM_ASSOCIATED_MEMOBJECT, sizeof parent, &parent, nullptr),
                 "clGetMemObjectInfo");
    if (parent)
        check_opencl(clGetMemObjectInfo(mem, CL_MEM_OFFSET, sizeof offset, &offset, nullptr), "clGetMemObjectInfo");
    return {bytes, parent ? parent : mem, parent ? offset : 0};
}

} // namespace

void check_buffer(cl_mem mem, const char *name, ::cl_context context, std::uint64_t offset, std::uint64_t bytes) {
    if (!mem)
        throw Error(Status::kInvalidArgument, fmt::format("{} is NULL", name));
    const MemoryInfo memory = inspect(mem, name, context);
    if (offset > memory.bytes || bytes > memory.bytes - offset)
        throw Error(Status::kBufferTooSmall,
                    fmt::format("{} needs {} bytes from offset {}, but the buffer has {} bytes", name, bytes, offset,
                                memory.bytes));
}

ImageView check_image(const ImageDescription &image, const char *name, ::cl_context context, ImageSize size,
                      std::initializer_list<Format> formats) {
    if (!image.mem)
        throw Error(Status::kInvalidArgument, fmt::format("{}.mem is NULL; a buffer is needed", name));
    if (std::find(formats.begin(), formats.end(), image.format) == formats.end()) {
        std::string expected;
        for (const Format format : formats)
            expected += (expected.empty() ? "" : " or ") + format_name(format);
        throw Error(Status::kInvalidFormat,
                    fmt::format("{}.format is {}, expected {}", name, format_name(image.format), expected));
    }
    check_image_size(image.width, image.height, name);
    if (size.width != 0 && (image.width != size.width || image.height != size.height))
        throw Error(Status::kInvalidArgument, fmt::format("{} is {} x {} pixels (width x height), expected {} x {}",
                                                          name, image.width, image.height, size.width, size.height));
    const std::uint64_t component = component_bytes(image.format);
    const std::uint64_t row = component * component_count(image.format) * image.width;
    if (image.offset_bytes % component != 0 || image.pitch_bytes % component != 0)
        throw Error(
            Status::kInvalidArgument,
            fmt::format(
                "{}: offset_bytes ({}) and pitch_bytes ({}) must be multiples of {}, the size of a component of {}",
                name, image.offset_bytes, image.pitch_bytes, component, format_name(image.format)));
    const std::uint64_t pitch = image.pitch_bytes ? image.pitch_bytes : row;
    if (pitch < row)
        throw Error(Status::kBufferTooSmall, fmt::format("{}.pitch_bytes is {}, but a row of {} pixels takes {} bytes",
                                                         name, pitch, image.width, row));
    if (pitch / component > 0xffffffffu)
        throw Error(Status::kInvalidArgument, fmt::format("{}.pitch_bytes is {}, too large", name, pitch));
    const MemoryInfo memory = inspect(image.mem, name, context);
    const std::uint64_t needed = pitch * (image.height - 1) + row;
    if (image.offset_bytes > memory.bytes || needed > memory.bytes - image.offset_bytes)
        throw Error(
            Status::kBufferTooSmall,
            fmt::format(
                "{} needs {} bytes from offset {} ({} x {} pixels, {} bytes a row), but the buffer has {} bytes", name,
                needed, image.offset_bytes, image.width, image.height, pitch, memory.bytes));
    ImageView view;
    view.mem = image.mem;
    view.offset = image.offset_bytes / component;
    view.pitch = static_cast<cl_uint>(pitch / component);
    view.width = image.width;
    view.height = image.height;
    view.format = image.format;
    view.parent = memory.parent;
    view.first_byte = memory.offset_in_parent + image.offset_bytes;
    view.end_byte = view.first_byte + needed;
    return view;
}

bool overlap(const ImageView &a, const ImageView &b) {
    if (!a || !b || a.parent != b.parent || a.first_byte >= b.end_byte || b.first_byte >= a.end_byte)
        return false;
    // Images side by side in one atlas: their rows interleave without sharing a byte.
    const auto row_bytes = [](const ImageView &v) {
        return std::uint64_t{v.width} * component_count(v.format) * component_bytes(v.format);
    };
    const auto pitch_bytes = [](const ImageView &v) { return std::uint64_t{v.pitch} * component_bytes(v.format); };
    const std::uint64_t pitch = pitch_bytes(a);
    if (pitch != pitch_bytes(b))
        return true;
    const std::uint64_t column_a = a.first_byte % pitch, column_b = b.first_byte % pitch;
    const std::uint64_t end_a = column_a + row_bytes(a), end_b = column_b + row_bytes(b);
    return end_a > pitch || end_b > pitch || (column_a < end_b && column_b < end_a);
}

bool same_pixels(const ImageView &a, const ImageView &b) {
    return a.parent == b.parent && a.first_byte == b.first_byte && a.pitch == b.pitch && a.width == b.width &&
           a.height == b.height && a.format == b.format;
}

void check_writable(const ImageView &view, const char *name) {
    cl_mem_flags flags = 0;
    check_opencl(clGetMemObjectInfo(view.mem, CL_MEM_FLAGS, sizeof flags, &flags, nullptr), "clGetMemObjectInfo");
    if (flags & CL_MEM_READ_ONLY)
        throw Error(
            Status::kInvalidArgument,
            fmt::format("{} is written, but its buffer was made with CL_MEM_READ_ONLY; make it with CL_MEM_READ_WRITE",
                        name));
}

void refuse_overlap(const ImageView &output, const char *output_name, const ImageView &input, const char *input_name) {
    if (overlap(output, input))
        throw Error(Status::kOverlap,
                    fmt::format("{} and {} share memory; they must not overlap", output_name, input_name));
}

} // namespace clsp

#include "stages/cl_image.hpp"

#include "runtime/error.hpp"
#include "runtime/interop.hpp"
#include "runtime/kernel_arguments.hpp"

#include <fmt/core.h>
#include <map>
#include <mutex>
#include <string>

namespace clsp {
namespace {

// Kernels of a context by their options. Their arguments are state: whoever sets and launches them holds the mutex.
struct ClImageKernels {
    explicit ClImageKernels(const Context &) {}
    std::mutex mutex;
    std::map<std::string, cl::Kernel> kernels;
};

struct ClImage {
    std::uint32_t channels;
    cl_channel_type type;
    std::size_t width, height;
    // The buffer that it was made from, as bytes of the outermost one; no bytes of the image itself if made from none.
    cl_mem root;
    std::size_t first_byte, end_byte;
};

template <typename T> T image_info(cl_mem mem, cl_image_info what) {
    T value{};
    check_opencl(clGetImageInfo(mem, what, sizeof value, &value, nullptr), "clGetImageInfo");
    return value;
}

template <typename T> T memory_info(cl_mem mem, cl_mem_info what) {
    T value{};
    check_opencl(clGetMemObjectInfo(mem, what, sizeof value, &value, nullptr), "clGetMemObjectInfo");
    return value;
}

std::uint32_t channels_of(cl_channel_order order) {
    switch (order) {
    case CL_R:
        return 1;
    case CL_RG:
        return 2;
    case CL_RGBA:
    case CL_BGRA:
        return 4;
    default:
        throw Error(
            Status::kInvalidFormat,
            fmt::format("cl_image has the channel order {:#x}, expected CL_R, CL_RG, CL_RGBA or CL_BGRA{}", order,
                        order == CL_DEPTH ? "; a z-buffer (CL_DEPTH) holds no metres: render the distance into a "
                                            "CL_R texture of CL_FLOAT"
                                          : ""));
    }
}

// refused: the access that the kernel may not be refused.
ClImage inspect(const Context &context, cl_mem mem, cl_mem_flags refused) {
    require_cl_images(context);
    if (!mem)
        throw Error(Status::kInvalidArgument, "cl_image is NULL; a 2D image is needed (clCreateImage)");
    check_mem(context, mem, "cl_image");
    const auto kind = memory_info<cl_mem_object_type>(mem, CL_MEM_TYPE);
    if (kind == CL_MEM_OBJECT_BUFFER)
        throw Error(Status::kInvalidArgument,
                    "cl_image is a buffer; frames take buffers as they are, without this copy");
    if (kind != CL_MEM_OBJECT_IMAGE2D)
        throw Error(Status::kInvalidArgument,
                    fmt::format("cl_image has the type {:#x}, expected CL_MEM_OBJECT_IMAGE2D; copy the slice or level "
                                "that is meant into a 2D image (clEnqueueCopyImage)",
                                kind));
    if (memory_info<cl_mem_flags>(mem, CL_MEM_FLAGS) & refused)
        throw Error(Status::kInvalidArgument,
                    refused == CL_MEM_WRITE_ONLY
                        ? "cl_image is read, but was made with CL_MEM_WRITE_ONLY; make it with CL_MEM_READ_WRITE"
                        : "cl_image is written, but was made with CL_MEM_READ_ONLY; make it with CL_MEM_READ_WRITE");
    const auto format = image_info<cl_image_format>(mem, CL_IMAGE_FORMAT);
    ClImage result{channels_of(format.image_channel_order),
                   format.image_channel_data_type,
                   image_info<std::size_t>(mem, CL_IMAGE_WIDTH),
                   image_info<std::size_t>(mem, CL_IMAGE_HEIGHT),
                   mem,
                   0,
                   0};
    // An image may be made from an image, that from a sub-buffer, and that from a buffer.
    while (const auto parent = memory_info<cl_mem>(result.root, CL_MEM_ASSOCIATED_MEMOBJECT)) {
        if (memory_info<cl_mem_object_type>(result.root, CL_MEM_TYPE) == CL_MEM_OBJECT_BUFFER) {
            const auto offset = memory_info<std::size_t>(result.root, CL_MEM_OFFSET);
            result.first_byte += offset;
            result.end_byte += offset;
        } else {
            result.end_byte = memory_info<std::size_t>(parent, CL_MEM_SIZE);
        }
        result.root = parent;
    }
    return result;
}

ImageView checked_view(const Context &context, const ClImage &cl_image, const ImageDescription &image) {
    const ImageView view = check_image(image, "image", context.cl_context()(), {0, 0},
                                       {Format::kUint8, Format::kUint16, Format::kUint32, Format::kFloat32,
                                        Format::kFloat32x2, Format::kFloat32x3, Format::kFloat32x4});
    if (view.width != cl_image.width || view.height != cl_image.height)
        throw Error(
            Status::kInvalidArgument,
            fmt::format("image is {} x {} pixels (width x height), but cl_image is {} x {}; they must be the same",
                        view.width, view.height, cl_image.width, cl_image.height));
    if (cl_image.root == view.parent && cl_image.first_byte < view.end_byte && view.first_byte < cl_image.end_byte)
        throw Error(Status::kOverlap,
                    "cl_image was made from the buffer of image; the frame takes that buffer as it is, "
                    "without this copy");
    return view;
}

// What the kernel's build says of the formats: names of the component, whether texels are integers, the largest code.
struct Conversion {
    const char *component;
    bool integers;
    std::uint32_t codes;
};

Conversion conversion(cl_channel_type type, Format format, bool import) {
    const std::uint32_t bits = 8 * component_bytes(format);
    if (format != Format::kUint8 && format != Format::kUint16 && format != Format::kUint32) {
        if (type == CL_FLOAT || type == CL_HALF_FLOAT)
            return {"float", false, 0};
        const bool normalized =
            type == CL_UNORM_INT8 || type == CL_UNORM_INT16 || type == CL_SNORM_INT8 || type == CL_SNORM_INT16;
        if (import && normalized)
            return {"float", false, 0};
        throw Error(Status::kInvalidFormat,
                    fmt::format("cl_image has the data type {:#x}, which does not go {} {}: use CL_FLOAT or "
                                "CL_HALF_FLOAT{}",
                                type, import ? "into" : "with", format_name(format),
                                import ? ", CL_UNORM_.. or CL_SNORM_.." : ""));
    }
    const char *component = bits == 8 ? "uchar" : bits == 16 ? "ushort" : "uint";
    const std::uint32_t texel_bits = type == CL_UNSIGNED_INT8    ? 8
                                     : type == CL_UNSIGNED_INT16 ? 16
                                     : type == CL_UNSIGNED_INT32 ? 32
                                                                 : 0;
    if (texel_bits && (import ? texel_bits <= bits : texel_bits >= bits))
        return {component, true, 0};
    if ((type == CL_UNORM_INT8 && bits == 8) || (type == CL_UNORM_INT16 && bits == 16))
        return {component, false, (1u << bits) - 1};
    throw Error(Status::kInvalidFormat,
                fmt::format("cl_image has the data type {:#x}, which does not go {} {}: use CL_UNSIGNED_INT{}{}", type,
                            import ? "into" : "with", format_name(format), bits,
                            bits == 32 ? "" : fmt::format(" or CL_UNORM_INT{}", bits)));
}

// Launches `name` over the view, with the arguments that `set` gives it.
template <typename Set>
void launch(Context &context, CommandChain &chain, const char *name, const Conversion &conversion,
            const ImageView &view, Set set) {
    const std::string options =
        fmt::format("-DCOMPONENT={} -DCOMPONENTS={} -DINTEGERS={:d} -DCODES={}", conversion.component,
                    component_count(view.format), conversion.integers, conversion.codes);
    auto &part = context.part<ClImageKernels>();
    const std::lock_guard<std::mutex> lock(part.mutex);
    cl::Kernel &kernel = part.kernels[name + options];
    if (!kernel())
        kernel = context.kernel("stages/cl_image.cl", name, options);
    KernelArguments arguments(kernel);
    set(arguments);
    chain.run("cl_image", kernel, view.width, view.height);
}

} // namespace

void enqueue_cl_image_import(Context &context, CommandChain &chain, cl_mem cl_image, std::uint32_t first_channel,
                             const ImageDescription &image) {
    const ClImage from = inspect(context, cl_image, CL_MEM_WRITE_ONLY);
    const ImageView to = checked_view(context, from, image);
    check_writable(to, "image");
    const std::uint32_t components = component_count(to.format);
    if (first_channel >= from.channels || components > from.channels - first_channel)
        throw Error(Status::kInvalidFormat,
                    fmt::format("first_channel is {} and image has {} components, but cl_image has {} channels",
                                first_channel, components, from.channels));
    launch(context, chain, "cl_image_import", conversion(from.type, to.format, true), to,
           [&](KernelArguments &arguments) { arguments.add(cl_image).add(cl_uint{first_channel}).add(to); });
}

void enqueue_cl_image_export(Context &context, CommandChain &chain, const ImageDescription &image, cl_mem cl_image) {
    const ClImage to = inspect(context, cl_image, CL_MEM_READ_ONLY);
    const ImageView from = checked_view(context, to, image);
    if (component_count(from.format) > to.channels)
        throw Error(Status::kInvalidFormat, fmt::format("image has {} components, but cl_image has {} channels",
                                                        component_count(from.format), to.channels));
    launch(context, chain, "cl_image_export", conversion(to.type, from.format, false), from,
           [&](KernelArguments &arguments) { arguments.add(from).add(cl_image); });
}

} // namespace clsp

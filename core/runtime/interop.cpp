#include "runtime/interop.hpp"

#include "runtime/error.hpp"

#include <algorithm>
#include <atomic>
#include <dlfcn.h>
#include <fcntl.h>
#include <fmt/core.h>
#include <initializer_list>
#include <sstream>
#include <vector>

namespace clsp {
namespace {

// Of headers that a build need not have (cl_gl.h, cl_ext.h of 2021).
constexpr cl_context_properties kGlContext = 0x2008;  // CL_GL_CONTEXT_KHR
constexpr cl_device_info kDeviceImportTypes = 0x204F; // CL_DEVICE_EXTERNAL_MEMORY_IMPORT_HANDLE_TYPES_KHR
constexpr cl_ulong kHandleOpaqueFd = 0x2060;          // CL_EXTERNAL_MEMORY_HANDLE_OPAQUE_FD_KHR
constexpr cl_ulong kHandleDmaBuf = 0x2067;            // CL_EXTERNAL_MEMORY_HANDLE_DMA_BUF_KHR
constexpr cl_ulong kDeviceHandleList = 0x2051;        // CL_MEM_DEVICE_HANDLE_LIST_KHR
constexpr std::uint32_t kGlTexture2d = 0x0DE1;        // GL_TEXTURE_2D
constexpr std::uint32_t kGlTextureRectangle = 0x84F5; // GL_TEXTURE_RECTANGLE
constexpr cl_int kInvalidGlObject = -60;              // CL_INVALID_GL_OBJECT
constexpr cl_int kInvalidMipLevel = -62;              // CL_INVALID_MIP_LEVEL
constexpr cl_int kInvalidImageFormat = CL_INVALID_IMAGE_FORMAT_DESCRIPTOR;

using CreateFromGlTexture = cl_mem(CL_API_CALL *)(::cl_context, cl_mem_flags, cl_uint, cl_int, cl_uint, cl_int *);
using CreateBufferWithProperties = cl_mem(CL_API_CALL *)(::cl_context, const cl_ulong *, cl_mem_flags, std::size_t,
                                                         void *, cl_int *);
using EnqueueShared = cl_int(CL_API_CALL *)(cl_command_queue, cl_uint, const cl_mem *, cl_uint, const cl_event *,
                                            cl_event *);

// Of a context, by kind and by whether they acquire: nullptr until a call has seen that the context has them.
struct SharedFunctions {
    explicit SharedFunctions(const Context &) {}
    std::atomic<EnqueueShared> found[2][2]{};
};

bool has_extension(const cl::Device &device, const char *name) {
    std::istringstream names(device.getInfo<CL_DEVICE_EXTENSIONS>());
    for (std::string one; names >> one;)
        if (one == name)
            return true;
    return false;
}

bool has_gl_context(::cl_context context) {
    // PoCL 3.1 crashes where it is asked for properties that are not there without a place for their size.
    std::size_t bytes = 0;
    check_opencl(clGetContextInfo(context, CL_CONTEXT_PROPERTIES, 0, nullptr, &bytes), "clGetContextInfo");
    std::vector<cl_context_properties> properties(bytes / sizeof(cl_context_properties));
    check_opencl(clGetContextInfo(context, CL_CONTEXT_PROPERTIES, bytes, properties.data(), &bytes),
                 "clGetContextInfo");
    for (std::size_t i = 0; i + 1 < properties.size() && properties[i] != 0; i += 2)
        if (properties[i] == kGlContext && properties[i + 1] != 0)
            return true;
    return false;
}

std::string cl_images_reason(const Context &context) {
    if (context.device().getInfo<CL_DEVICE_IMAGE_SUPPORT>())
        return {};
    return fmt::format("{} has no images (CL_DEVICE_IMAGE_SUPPORT); pass buffers", context.device_name());
}

std::string gl_textures_reason(const Context &context) {
    if (const std::string reason = cl_images_reason(context); !reason.empty())
        return reason;
    if (!has_extension(context.device(), "cl_khr_gl_sharing"))
        return fmt::format("{} has no cl_khr_gl_sharing; read the texture back into host memory",
                           context.device_name());
    if (!has_gl_context(context.cl_context()()))
        return "the cl_context was made without a GL context; make one by clCreateContext() with CL_GL_CONTEXT_KHR and "
               "CL_GLX_DISPLAY_KHR or CL_EGL_DISPLAY_KHR, and make the clSpeckle context of it";
    return {};
}

std::uint32_t importable(const Context &context) {
    if (!has_extension(context.device(), "cl_khr_external_memory"))
        return 0;
    std::size_t bytes = 0;
    if (clGetDeviceInfo(context.device()(), kDeviceImportTypes, 0, nullptr, &bytes) != CL_SUCCESS)
        return 0;
    std::vector<cl_uint> types(bytes / sizeof(cl_uint));
    check_opencl(
        clGetDeviceInfo(context.device()(), kDeviceImportTypes, types.size() * sizeof(cl_uint), types.data(), nullptr),
        "clGetDeviceInfo");
    const auto has = [&](cl_ulong type) { return std::find(types.begin(), types.end(), type) != types.end(); };
    return (has(kHandleOpaqueFd) ? kOpaqueFd : 0) | (has(kHandleDmaBuf) ? kDmaBuf : 0);
}

// A function of the driver, or one of the loader that calls it.
template <typename Function> Function driver_function(const Context &context, const char *name) {
    void *found = clGetExtensionFunctionAddressForPlatform(context.device().getInfo<CL_DEVICE_PLATFORM>(), name);
    if (!found)
        found = dlsym(RTLD_DEFAULT, name);
    if (!found)
        throw Error(Status::kUnsupported,
                    fmt::format("neither the driver of {} nor the OpenCL loader has {}; update them",
                                context.platform_name(), name));
    return reinterpret_cast<Function>(found);
}

void require(const std::string &reason) {
    if (!reason.empty())
        throw Error(Status::kUnsupported, reason);
}

} // namespace

Interop interop(const Context &context) {
    Interop result;
    result.cl_images_reason = cl_images_reason(context);
    result.gl_textures_reason = gl_textures_reason(context);
    result.external_memory = importable(context);
    if (!result.external_memory)
        result.external_memory_reason = fmt::format(
            "{} imports neither opaque file descriptors nor dma-bufs (cl_khr_external_memory); copy through "
            "host memory",
            context.device_name());
    return result;
}

void check_mem(const Context &context, cl_mem mem, const std::string &name) {
    ::cl_context owner = nullptr;
    const cl_int code = clGetMemObjectInfo(mem, CL_MEM_CONTEXT, sizeof owner, &owner, nullptr);
    if (code == CL_INVALID_MEM_OBJECT)
        throw Error(Status::kInvalidArgument, name + " is not a valid cl_mem", code);
    check_opencl(code, "clGetMemObjectInfo");
    if (owner != context.cl_context()())
        throw Error(Status::kWrongContext, name + " belongs to another cl_context than the clSpeckle context");
}

void require_cl_images(const Context &context) {
    require(cl_images_reason(context));
}

cl_mem make_from_gl_texture(const Context &context, cl_mem_flags flags, std::uint32_t target, std::int32_t level,
                            std::uint32_t texture) {
    require(gl_textures_reason(context));
    if (flags != CL_MEM_READ_ONLY && flags != CL_MEM_WRITE_ONLY && flags != CL_MEM_READ_WRITE)
        throw Error(
            Status::kInvalidArgument,
            fmt::format("flags is {:#x}, expected CL_MEM_READ_ONLY, CL_MEM_WRITE_ONLY or CL_MEM_READ_WRITE", flags));
    if (target != kGlTexture2d && target != kGlTextureRectangle)
        throw Error(
            Status::kInvalidArgument,
            fmt::format("target is {:#x}, expected GL_TEXTURE_2D (0xde1) or GL_TEXTURE_RECTANGLE (0x84f5)", target));
    if (level < 0)
        throw Error(Status::kInvalidArgument, fmt::format("level is {}, it must not be negative", level));
    if (texture == 0)
        throw Error(Status::kInvalidArgument, "texture is 0, which names none; give what glGenTextures() gave");
    cl_int code = CL_SUCCESS;
    const cl_mem made = driver_function<CreateFromGlTexture>(context, "clCreateFromGLTexture")(
        context.cl_context()(), flags, target, level, texture, &code);
    if (code == kInvalidGlObject || code == kInvalidMipLevel || code == kInvalidImageFormat)
        throw Error(
            Status::kInvalidArgument,
            fmt::format(
                "texture {} has no image of level {} that OpenCL can use ({}): it must belong to the GL context "
                "of the cl_context, be complete, and have a format such as GL_R32F, GL_RGBA32F or GL_R16UI",
                texture, level, opencl_code_name(code)),
            code);
    check_opencl(code, "clCreateFromGLTexture");
    return made;
}

cl_mem make_from_fd(const Context &context, std::uint32_t type, std::int32_t fd, std::uint64_t size_bytes) {
    if (type != kOpaqueFd && type != kDmaBuf)
        throw Error(Status::kInvalidArgument,
                    fmt::format("type is {}, expected {} (an opaque file descriptor) or {} (a dma-buf)", type,
                                kOpaqueFd, kDmaBuf));
    const Interop has = interop(context);
    require(has.external_memory_reason);
    if (!(has.external_memory & type))
        throw Error(Status::kUnsupported,
                    fmt::format("{} imports no {}; export the memory as {}", context.device_name(),
                                type == kOpaqueFd ? "opaque file descriptors" : "dma-bufs",
                                type == kOpaqueFd ? "a dma-buf" : "an opaque file descriptor"));
    if (fcntl(fd, F_GETFD) == -1)
        throw Error(Status::kInvalidArgument, fmt::format("fd is {}, which is no open file descriptor", fd));
    if (size_bytes == 0)
        throw Error(Status::kInvalidArgument, "size_bytes is 0; give the size that the other API allocated");
    const cl_ulong properties[] = {type == kOpaqueFd ? kHandleOpaqueFd : kHandleDmaBuf,
                                   static_cast<cl_ulong>(fd),
                                   kDeviceHandleList, // other devices of the cl_context need not import it
                                   reinterpret_cast<cl_ulong>(context.device()()),
                                   0,
                                   0};
    cl_int code = CL_SUCCESS;
    const cl_mem made = driver_function<CreateBufferWithProperties>(context, "clCreateBufferWithProperties")(
        context.cl_context()(), properties, CL_MEM_READ_WRITE, size_bytes, nullptr, &code);
    if (code == CL_INVALID_VALUE || code == CL_INVALID_PROPERTY || code == CL_INVALID_BUFFER_SIZE)
        throw Error(Status::kInvalidArgument,
                    fmt::format("the driver does not take fd {} as {} of {} bytes ({}): it must be an export of that "
                                "type from this device, and size_bytes the size that the other API allocated",
                                fd, type == kOpaqueFd ? "an opaque file descriptor" : "a dma-buf", size_bytes,
                                opencl_code_name(code)),
                    code);
    check_opencl(code, "clCreateBufferWithProperties");
    return made;
}

void enqueue_shared(const Context &context, CommandChain &chain, SharedKind kind, bool acquire, std::uint32_t count,
                    const cl_mem *mems) {
    const bool gl = kind == SharedKind::kGl;
    const char *name = gl        ? (acquire ? "clEnqueueAcquireGLObjects" : "clEnqueueReleaseGLObjects")
                       : acquire ? "clEnqueueAcquireExternalMemObjectsKHR"
                                 : "clEnqueueReleaseExternalMemObjectsKHR";
    std::atomic<EnqueueShared> &found = context.part<SharedFunctions>().found[gl][acquire];
    if (!found) {
        require(gl ? gl_textures_reason(context) : interop(context).external_memory_reason);
        found = driver_function<EnqueueShared>(context, name);
    }
    const EnqueueShared function = found;
    if (count == 0 || !mems)
        throw Error(Status::kInvalidArgument, "count is 0 or mems is NULL; give at least one object");
    for (std::uint32_t i = 0; i < count; ++i) {
        const std::string one = fmt::format("mems[{}]", i);
        if (!mems[i])
            throw Error(Status::kInvalidArgument, one + " is NULL");
        check_mem(context, mems[i], one);
    }
    chain.run_foreign("shared", [&](cl_uint num_waits, const cl_event *waits, cl_event *event) {
        const cl_int code = function(chain.queue(), count, mems, num_waits, waits, event);
        if (code == kInvalidGlObject || code == CL_INVALID_MEM_OBJECT)
            throw Error(Status::kInvalidArgument,
                        fmt::format("{} failed with {}: one of mems was not made {}", name, opencl_code_name(code),
                                    gl ? "of an object of GL" : "of a file descriptor"),
                        code);
        check_opencl(code, name);
    });
}

} // namespace clsp

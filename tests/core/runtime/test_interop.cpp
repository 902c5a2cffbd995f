// GL textures and memory of other APIs: this program stands between the library and the driver, whose own it hides. Its
// GL textures are cl_images; its file descriptors are mapped into the process, as a driver for a CPU would do it.
#include "test_support.hpp"

#include <dlfcn.h>
#include <fcntl.h>
#include <map>
#include <optional>
#include <set>
#include <sstream>
#include <sys/mman.h>
#include <unistd.h>

namespace driver {

// What it says that it has.
bool images = true, gl_sharing = false, gl_context = false, functions = true;
std::vector<cl_uint> import_types; // empty: no cl_khr_external_memory
cl_mem buffer_of_image = nullptr;  // instead of none
std::optional<cl_channel_order> order;
cl_int refuses = CL_SUCCESS; // a buffer or a texture

std::set<cl_mem> from_gl, from_fd, acquired;
std::vector<std::string> log; // of what was asked of it
int lookups = 0;              // of its extensions and functions
std::vector<void *> mapped;

void reset() {
    images = functions = true;
    gl_sharing = gl_context = false;
    import_types.clear();
    buffer_of_image = nullptr;
    order.reset();
    refuses = CL_SUCCESS;
    from_gl.clear();
    from_fd.clear();
    acquired.clear();
    log.clear();
    lookups = 0;
}

template <typename Function> Function *real(Function *, const char *name) {
    return reinterpret_cast<Function *>(dlsym(RTLD_NEXT, name));
}
#define REAL(name) ::driver::real(static_cast<decltype(name) *>(nullptr), #name)

// What a query answers with.
template <typename T> cl_int answer(const std::vector<T> &values, size_t size, void *value, size_t *size_ret) {
    const size_t bytes = values.size() * sizeof(T);
    if (size_ret)
        *size_ret = bytes;
    if (value && size < bytes)
        return CL_INVALID_VALUE;
    if (value)
        std::memcpy(value, values.data(), bytes);
    return CL_SUCCESS;
}

constexpr cl_uint texture_float = 7, texture_codes = 8, width = 32, height = 24;

cl_mem create_from_gl(cl_context context, cl_mem_flags flags, cl_uint target, cl_int level, cl_uint texture,
                      cl_int *code) {
    log.push_back("texture " + std::to_string(texture) + " of " + std::to_string(target));
    if (refuses != CL_SUCCESS || level != 0 || (texture != texture_float && texture != texture_codes)) {
        *code = refuses != CL_SUCCESS ? refuses : -60; // CL_INVALID_GL_OBJECT
        return nullptr;
    }
    const cl_image_format format =
        texture == texture_float ? cl_image_format{CL_R, CL_FLOAT} : cl_image_format{CL_R, CL_UNSIGNED_INT16};
    cl_image_desc desc{};
    desc.image_type = CL_MEM_OBJECT_IMAGE2D;
    desc.image_width = width;
    desc.image_height = height;
    const cl_mem made = clCreateImage(context, flags, &format, &desc, nullptr, code);
    from_gl.insert(made);
    return made;
}

cl_mem create_from_fd(cl_context context, const cl_ulong *properties, cl_mem_flags flags, size_t size, void *host,
                      cl_int *code) {
    // A type, its file descriptor, and the one device.
    const bool whole = (properties[0] == 0x2060 || properties[0] == 0x2067) && properties[2] == 0x2051 &&
                       properties[3] == reinterpret_cast<cl_ulong>(test::SharedContext::get().info().cl_device) &&
                       properties[4] == 0 && properties[5] == 0;
    *code = !whole || host ? CL_INVALID_VALUE : refuses;
    if (*code != CL_SUCCESS)
        return nullptr;
    const int fd = static_cast<int>(properties[1]);
    log.push_back((properties[0] == 0x2067 ? "dma-buf" : "opaque fd") + std::string(" of ") + std::to_string(size));
    void *memory = mmap(nullptr, size, PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
    if (memory == MAP_FAILED) {
        *code = CL_INVALID_VALUE;
        return nullptr;
    }
    close(fd); // the driver's now
    mapped.push_back(memory);
    const cl_mem made = clCreateBuffer(context, flags | CL_MEM_USE_HOST_PTR, size, memory, code);
    from_fd.insert(made);
    return made;
}

cl_int hand_over(bool acquire, const std::set<cl_mem> &own, cl_int error, cl_command_queue queue, cl_uint count,
                 const cl_mem *mems, cl_uint num_waits, const cl_event *waits, cl_event *event) {
    for (cl_uint i = 0; i < count; ++i)
        if (!own.count(mems[i]))
            return error;
    for (cl_uint i = 0; i < count; ++i) {
        EXPECT_NE(acquire, acquired.count(mems[i]) == 1) << "acquired twice, or released without";
        acquire ? (void)acquired.insert(mems[i]) : (void)acquired.erase(mems[i]);
    }
    log.push_back((acquire ? "acquire " : "release ") + std::to_string(count));
    return clEnqueueMarkerWithWaitList(queue, num_waits, waits, event);
}
cl_int acquire_gl(cl_command_queue queue, cl_uint count, const cl_mem *mems, cl_uint num_waits, const cl_event *waits,
                  cl_event *event) {
    return hand_over(true, from_gl, -60, queue, count, mems, num_waits, waits, event);
}
cl_int release_gl(cl_command_queue queue, cl_uint count, const cl_mem *mems, cl_uint num_waits, const cl_event *waits,
                  cl_event *event) {
    return hand_over(false, from_gl, -60, queue, count, mems, num_waits, waits, event);
}
cl_int acquire_fd(cl_command_queue queue, cl_uint count, const cl_mem *mems, cl_uint num_waits, const cl_event *waits,
                  cl_event *event) {
    return hand_over(true, from_fd, CL_INVALID_MEM_OBJECT, queue, count, mems, num_waits, waits, event);
}
cl_int release_fd(cl_command_queue queue, cl_uint count, const cl_mem *mems, cl_uint num_waits, const cl_event *waits,
                  cl_event *event) {
    return hand_over(false, from_fd, CL_INVALID_MEM_OBJECT, queue, count, mems, num_waits, waits, event);
}

const std::map<std::string, void *> table = {
    {"clCreateFromGLTexture", reinterpret_cast<void *>(create_from_gl)},
    {"clCreateBufferWithProperties", reinterpret_cast<void *>(create_from_fd)},
    {"clEnqueueAcquireGLObjects", reinterpret_cast<void *>(acquire_gl)},
    {"clEnqueueReleaseGLObjects", reinterpret_cast<void *>(release_gl)},
    {"clEnqueueAcquireExternalMemObjectsKHR", reinterpret_cast<void *>(acquire_fd)},
    {"clEnqueueReleaseExternalMemObjectsKHR", reinterpret_cast<void *>(release_fd)},
};

} // namespace driver

// In the place of the driver's, which they call.
extern "C" {

cl_int clGetDeviceInfo(cl_device_id device, cl_device_info what, size_t size, void *value, size_t *size_ret) {
    if (what == CL_DEVICE_IMAGE_SUPPORT && !driver::images)
        return driver::answer(std::vector<cl_bool>{CL_FALSE}, size, value, size_ret);
    if (what == 0x204F)
        return driver::import_types.empty() ? CL_INVALID_VALUE
                                            : driver::answer(driver::import_types, size, value, size_ret);
    if (what == CL_DEVICE_EXTENSIONS) { // the device's, but for what this driver has of its own
        ++driver::lookups;
        std::vector<char> own(1 << 16);
        const cl_int code = REAL(clGetDeviceInfo)(device, what, own.size(), own.data(), nullptr);
        if (code != CL_SUCCESS)
            return code;
        std::string text;
        std::istringstream names(own.data());
        for (std::string name; names >> name;)
            if (name != "cl_khr_gl_sharing" && name.rfind("cl_khr_external_memory", 0) != 0)
                text += name + ' ';
        text += std::string("cl_khr_gl_sharing_not ") + (driver::gl_sharing ? "cl_khr_gl_sharing " : "") +
                (driver::import_types.empty() ? "" : "cl_khr_external_memory");
        return driver::answer(std::vector<char>(text.c_str(), text.c_str() + text.size() + 1), size, value, size_ret);
    }
    return REAL(clGetDeviceInfo)(device, what, size, value, size_ret);
}

cl_int clGetContextInfo(cl_context context, cl_context_info what, size_t size, void *value, size_t *size_ret) {
    if (what == CL_CONTEXT_PROPERTIES && driver::gl_context)
        return driver::answer(std::vector<cl_context_properties>{CL_CONTEXT_PLATFORM, 1, 0x2008, 42, 0x200A, 43, 0},
                              size, value, size_ret);
    return REAL(clGetContextInfo)(context, what, size, value, size_ret);
}

cl_int clGetMemObjectInfo(cl_mem mem, cl_mem_info what, size_t size, void *value, size_t *size_ret) {
    if (what == CL_MEM_ASSOCIATED_MEMOBJECT && driver::buffer_of_image && driver::from_gl.count(mem))
        return driver::answer(std::vector<cl_mem>{driver::buffer_of_image}, size, value, size_ret);
    return REAL(clGetMemObjectInfo)(mem, what, size, value, size_ret);
}

cl_int clGetImageInfo(cl_mem mem, cl_image_info what, size_t size, void *value, size_t *size_ret) {
    if (what == CL_IMAGE_FORMAT && driver::order)
        return driver::answer(std::vector<cl_image_format>{{*driver::order, CL_FLOAT}}, size, value, size_ret);
    return REAL(clGetImageInfo)(mem, what, size, value, size_ret);
}

void *clGetExtensionFunctionAddressForPlatform(cl_platform_id, const char *name) {
    ++driver::lookups;
    const auto found = driver::table.find(name);
    return driver::functions && found != driver::table.end() ? found->second : nullptr;
}

} // extern "C"

namespace {

using driver::height;
using driver::width;
constexpr std::uint32_t pixels = width * height;
constexpr std::uint32_t gl_texture_2d = 0x0DE1;

class Interop : public test::DeviceTest {
  protected:
    void SetUp() override { driver::reset(); }
    void TearDown() override {
        queue.finish();
        driver::reset();
    }

    clspeckle::Pipeline make_pipeline() {
        auto phase = clspeckle::make<ClspPhaseDesc>();
        auto aperture = clspeckle::make<ClspApertureDesc>();
        auto sensor = clspeckle::make<ClspSensorDesc>();
        phase.width = aperture.width = sensor.width = width;
        phase.height = aperture.height = sensor.height = height;
        return {context, clspeckle::Phase(context, phase), clspeckle::Aperture(context, aperture),
                clspeckle::Sensor(context, sensor)};
    }
    std::vector<std::uint16_t> buffers_frame(const std::vector<float> &ideal) {
        const Image in = floats(ideal, width, height), out = make_image(width, height, CLSP_FORMAT_UINT16);
        auto frame = clspeckle::make<ClspFrame>();
        frame.irradiance = in.view;
        frame.output = out.view;
        make_pipeline().enqueue_frame(queue, frame);
        return download<std::uint16_t>(out);
    }
    // A context that has called no driver yet, of the cl_context of all.
    clspeckle::Context fresh() const {
        auto desc = clspeckle::make<ClspContextDesc>();
        desc.cl_context_handle = context.info().cl_context_handle;
        desc.cl_device = context.info().cl_device;
        return clspeckle::Context(desc);
    }
    ClspStatus create_gl(std::uint64_t flags, std::uint32_t target, std::int32_t level, std::uint32_t texture) {
        cl_mem made = nullptr;
        const ClspStatus status = clspClImageCreateFromGl(context, flags, target, level, texture, &made);
        EXPECT_EQ(nullptr, made);
        return status;
    }
};

TEST_F(Interop, InfoSaysWhatThereIsAndWhyNot) {
    ClspInteropInfo info = context.interop_info(); // of a driver that has neither
    EXPECT_EQ(1u, info.cl_images);
    EXPECT_STREQ("", info.cl_images_reason);
    EXPECT_EQ(0u, info.gl_textures);
    EXPECT_NE(nullptr, std::strstr(info.gl_textures_reason, "has no cl_khr_gl_sharing"));
    EXPECT_EQ(0u, info.external_memory);
    EXPECT_NE(nullptr, std::strstr(info.external_memory_reason, "cl_khr_external_memory"));

    driver::gl_sharing = true;
    info = context.interop_info();
    EXPECT_EQ(0u, info.gl_textures);
    EXPECT_NE(nullptr, std::strstr(info.gl_textures_reason, "made without a GL context"));
    driver::gl_context = true;
    driver::import_types = {0x2063, 0x2067};
    info = context.interop_info();
    EXPECT_EQ(1u, info.gl_textures);
    EXPECT_STREQ("", info.gl_textures_reason);
    EXPECT_EQ(CLSP_EXTERNAL_MEMORY_DMA_BUF, info.external_memory);
    EXPECT_STREQ("", info.external_memory_reason);
    driver::import_types = {0x2060, 0x2067};
    EXPECT_EQ(CLSP_EXTERNAL_MEMORY_OPAQUE_FD | CLSP_EXTERNAL_MEMORY_DMA_BUF, context.interop_info().external_memory);
    driver::images = false;
    info = context.interop_info();
    EXPECT_EQ(0u, info.cl_images + info.gl_textures) << "textures are images";

    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "context", clspContextGetInteropInfo(nullptr, &info));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "info", clspContextGetInteropInfo(context, nullptr));
    info.struct_size = 8;
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_STRUCT_SIZE, "struct_size", clspContextGetInteropInfo(context, &info));
}

TEST_F(Interop, AFrameBetweenAcquireAndRelease) {
    driver::gl_sharing = driver::gl_context = true;
    const std::vector<float> ideal = test::dots(width, height);
    const std::vector<std::uint16_t> expected = buffers_frame(ideal);
    const auto source = clspeckle::ClImage::from_gl(context, CL_MEM_READ_ONLY, gl_texture_2d, 0, driver::texture_float);
    const auto target = clspeckle::ClImage::from_gl(context, CL_MEM_WRITE_ONLY, 0x84F5, 0, driver::texture_codes);
    const std::size_t origin[3] = {0, 0, 0}, region[3] = {width, height, 1};
    ASSERT_EQ(CL_SUCCESS,
              clEnqueueWriteImage(queue, source, CL_TRUE, origin, region, 0, 0, ideal.data(), 0, nullptr, nullptr));

    const clspeckle::Pipeline pipeline = make_pipeline();
    const Image in = make_image(width, height, CLSP_FORMAT_FLOAT32),
                out = make_image(width, height, CLSP_FORMAT_UINT16);
    auto frame = clspeckle::make<ClspFrame>();
    frame.irradiance = in.view;
    frame.output = out.view;
    for (const std::uint32_t flags : {0u, test::out_of_order(context)}) {
        const clspeckle::Queue work(context, flags);
        cl_int code = CL_SUCCESS;
        const auto drawn = clspeckle::Event::adopt(clCreateUserEvent(context.info().cl_context_handle, &code));
        clspeckle::Event acquired, imported, rendered, exported, released;
        clspeckle::shared::enqueue_acquire(context, work, CLSP_SHARED_GL, {source, target}, {drawn}, &acquired);
        source.enqueue_import(context, work, 0, in.view, {acquired}, &imported);
        pipeline.enqueue_frame(work, frame, {imported}, &rendered);
        target.enqueue_export(context, work, out.view, {rendered}, &exported);
        clspeckle::shared::enqueue_release(context, work, CLSP_SHARED_GL, {source, target}, {exported}, &released);
        cl_int status = CL_COMPLETE;
        clGetEventInfo(released, CL_EVENT_COMMAND_EXECUTION_STATUS, sizeof status, &status, nullptr);
        EXPECT_NE(CL_COMPLETE, status) << "GL has not drawn yet";
        clSetUserEventStatus(drawn, CL_COMPLETE);
        released.wait();
        std::vector<std::uint16_t> codes(pixels);
        ASSERT_EQ(CL_SUCCESS,
                  clEnqueueReadImage(work, target, CL_TRUE, origin, region, 0, 0, codes.data(), 0, nullptr, nullptr));
        EXPECT_EQ(expected, codes);
    }
    EXPECT_TRUE(driver::acquired.empty());
    EXPECT_EQ((std::vector<std::string>{"texture 7 of 3553", "texture 8 of 34037", "acquire 2", "release 2",
                                        "acquire 2", "release 2"}),
              driver::log);
}

// The other API's memory is the frame's: its bytes come and go without a copy.
TEST_F(Interop, AFrameInMemoryOfAnotherApi) {
    driver::import_types = {0x2060, 0x2067};
    const std::vector<float> ideal = test::dots(width, height);
    const std::vector<std::uint16_t> expected = buffers_frame(ideal);
    constexpr std::size_t in_bytes = pixels * sizeof(float), bytes = in_bytes + pixels * sizeof(std::uint16_t);
    for (const std::uint32_t type : {CLSP_EXTERNAL_MEMORY_OPAQUE_FD, CLSP_EXTERNAL_MEMORY_DMA_BUF}) {
        const int fd = memfd_create("memory", 0);
        ASSERT_EQ(0, ftruncate(fd, bytes));
        auto *memory = static_cast<unsigned char *>(mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0));
        ASSERT_NE(MAP_FAILED, static_cast<void *>(memory));
        std::memcpy(memory, ideal.data(), in_bytes);
        {
            const auto buffer = clspeckle::Buffer::from_fd(context, type, fd, bytes);
            EXPECT_EQ(-1, fcntl(fd, F_GETFD)) << "the driver's";
            auto frame = clspeckle::make<ClspFrame>();
            frame.irradiance = buffer.image(width, height, CLSP_FORMAT_FLOAT32);
            frame.output = buffer.image(width, height, CLSP_FORMAT_UINT16, 0, in_bytes);
            clspeckle::Event released;
            clspeckle::shared::enqueue_acquire(context, queue, CLSP_SHARED_EXTERNAL, {buffer});
            make_pipeline().enqueue_frame(queue, frame);
            clspeckle::shared::enqueue_release(context, queue, CLSP_SHARED_EXTERNAL, {buffer}, {}, &released);
            released.wait();
            EXPECT_EQ(0, std::memcmp(memory + in_bytes, expected.data(), pixels * sizeof(std::uint16_t)));
        }
        munmap(memory, bytes);
    }
    EXPECT_EQ((std::vector<std::string>{"opaque fd of 4608", "acquire 1", "release 1", "dma-buf of 4608", "acquire 1",
                                        "release 1"}),
              driver::log);
}

TEST_F(Interop, FunctionsAreLookedUpOnceAContext) {
    driver::gl_sharing = driver::gl_context = true;
    driver::import_types = {0x2060};
    const auto texture =
        clspeckle::ClImage::from_gl(context, CL_MEM_READ_ONLY, gl_texture_2d, 0, driver::texture_float);
    const int fd = memfd_create("memory", 0);
    ASSERT_EQ(0, ftruncate(fd, 4096));
    const auto buffer = clspeckle::Buffer::from_fd(context, CLSP_EXTERNAL_MEMORY_OPAQUE_FD, fd, 4096);
    const clspeckle::Context once = fresh();
    const auto frame = [&] {
        for (const auto &[kind, mem] : {std::pair<std::uint32_t, cl_mem>{CLSP_SHARED_GL, texture},
                                        std::pair<std::uint32_t, cl_mem>{CLSP_SHARED_EXTERNAL, buffer}}) {
            clspeckle::shared::enqueue_acquire(once, queue, kind, {mem});
            clspeckle::shared::enqueue_release(once, queue, kind, {mem});
        }
    };
    driver::lookups = 0;
    frame();
    EXPECT_GE(driver::lookups, 8) << "extensions and function of each";
    driver::lookups = 0;
    frame();
    frame();
    EXPECT_EQ(0, driver::lookups);
}

TEST_F(Interop, WhatIsNotThereIsToldInWords) {
    const clspeckle::Context bare = fresh();
    const Image image = make_image(width, height, CLSP_FORMAT_FLOAT32);
    cl_mem mem = image.buffer, made = nullptr;
    const auto acquire = [&](std::uint32_t kind) {
        return clspSharedEnqueueAcquire(bare, queue, kind, 1, &mem, 0, nullptr, nullptr);
    };
    // A driver that has neither.
    test::poison_last_error("clspClImageCreateFromGl");
    EXPECT_TRUE(test::failed_as("clspClImageCreateFromGl",
                                create_gl(CL_MEM_READ_ONLY, gl_texture_2d, 0, driver::texture_float),
                                CLSP_ERROR_UNSUPPORTED, "has no cl_khr_gl_sharing"));
    EXPECT_EQ(CLSP_ERROR_UNSUPPORTED, acquire(CLSP_SHARED_GL));
    EXPECT_CLSP_FAILS(CLSP_ERROR_UNSUPPORTED, "imports neither",
                      clspBufferCreateFromFd(bare, CLSP_EXTERNAL_MEMORY_DMA_BUF, 0, 64, &made));
    EXPECT_EQ(CLSP_ERROR_UNSUPPORTED, acquire(CLSP_SHARED_EXTERNAL));
    // No GL context, no images, one type alone, a driver that lists what it has not.
    driver::gl_sharing = true;
    EXPECT_CLSP_FAILS(
        CLSP_ERROR_UNSUPPORTED, "made without a GL context",
        clspClImageCreateFromGl(bare, CL_MEM_READ_ONLY, gl_texture_2d, 0, driver::texture_float, &made));
    driver::gl_context = true;
    driver::import_types = {0x2060};
    EXPECT_CLSP_FAILS(CLSP_ERROR_UNSUPPORTED, "imports no dma-bufs; export the memory as an opaque",
                      clspBufferCreateFromFd(bare, CLSP_EXTERNAL_MEMORY_DMA_BUF, 0, 64, &made));
    driver::functions = false;
    EXPECT_CLSP_FAILS(CLSP_ERROR_UNSUPPORTED, "clEnqueueReleaseExternalMemObjectsKHR; update",
                      clspSharedEnqueueRelease(bare, queue, CLSP_SHARED_EXTERNAL, 1, &mem, 0, nullptr, nullptr));
    driver::images = false;
    EXPECT_CLSP_FAILS(CLSP_ERROR_UNSUPPORTED, "has no images (CL_DEVICE_IMAGE_SUPPORT); pass buffers",
                      clspClImageEnqueueImport(bare, queue, mem, 0, &image.view, 0, nullptr, nullptr));
    EXPECT_CLSP_FAILS(CLSP_ERROR_UNSUPPORTED, "has no images (CL_DEVICE_IMAGE_SUPPORT); pass buffers",
                      clspClImageEnqueueExport(bare, queue, &image.view, mem, 0, nullptr, nullptr));
    EXPECT_EQ(nullptr, made);
}

TEST_F(Interop, RefuseBadArguments) {
    driver::gl_sharing = driver::gl_context = true;
    driver::import_types = {0x2060, 0x2067};
    const Image image = make_image(width, height, CLSP_FORMAT_FLOAT32);
    cl_mem made = nullptr;
    const test::Foreign foreign;
    const cl_mem plain = image.buffer, none = nullptr, strange[] = {plain, foreign.buffer};
    const auto texture =
        clspeckle::ClImage::from_gl(context, CL_MEM_READ_WRITE, gl_texture_2d, 0, driver::texture_float);
    const auto refused = [&](const std::string &words, std::uint64_t flags, std::uint32_t target, std::int32_t level,
                             std::uint32_t name, ClspStatus status = CLSP_ERROR_INVALID_ARGUMENT) {
        test::poison_last_error("clspClImageCreateFromGl");
        EXPECT_TRUE(test::failed_as("clspClImageCreateFromGl", create_gl(flags, target, level, name), status, words))
            << words;
    };
    refused("flags is 0x8", CL_MEM_USE_HOST_PTR, gl_texture_2d, 0, 7);
    refused("flags is 0x0", 0, gl_texture_2d, 0, 7);
    refused("expected GL_TEXTURE_2D", CL_MEM_READ_ONLY, 0x806F, 0, 7);
    refused("level is -1", CL_MEM_READ_ONLY, gl_texture_2d, -1, 7);
    refused("texture is 0", CL_MEM_READ_ONLY, gl_texture_2d, 0, 0);
    refused("texture 9 has no image of level 0", CL_MEM_READ_ONLY, gl_texture_2d, 0, 9);
    refused("GL_R32F", CL_MEM_READ_ONLY, gl_texture_2d, 3, 7);
    driver::refuses = CL_OUT_OF_RESOURCES;
    refused("clCreateFromGLTexture failed with CL_OUT_OF_RESOURCES", CL_MEM_READ_ONLY, gl_texture_2d, 0, 7,
            CLSP_ERROR_OPENCL);
    EXPECT_CLSP_FAILS(CLSP_ERROR_OPENCL, "clCreateBufferWithProperties failed with CL_OUT_OF_RESOURCES",
                      clspBufferCreateFromFd(context, CLSP_EXTERNAL_MEMORY_OPAQUE_FD, 0, 64, &made));
    driver::refuses = CL_SUCCESS;
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "cl_image",
                      clspClImageCreateFromGl(context, CL_MEM_READ_ONLY, gl_texture_2d, 0, 7, nullptr));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "context",
                      clspClImageCreateFromGl(nullptr, CL_MEM_READ_ONLY, gl_texture_2d, 0, 7, &made));

    for (const std::uint32_t type : {0u, 3u, 4u})
        EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "type is", clspBufferCreateFromFd(context, type, 0, 64, &made));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "fd is -1",
                      clspBufferCreateFromFd(context, CLSP_EXTERNAL_MEMORY_DMA_BUF, -1, 64, &made));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "fd is 1000000, which is no open file descriptor",
                      clspBufferCreateFromFd(context, CLSP_EXTERNAL_MEMORY_DMA_BUF, 1000000, 64, &made));
    const int fd = memfd_create("memory", 0);
    for (const auto &[code, words] : {std::pair<cl_int, const char *>{CL_INVALID_VALUE, "CL_INVALID_VALUE"},
                                      {CL_INVALID_PROPERTY, "CL_INVALID_PROPERTY"},
                                      {CL_INVALID_BUFFER_SIZE, "CL_INVALID_BUFFER_SIZE"}}) {
        driver::refuses = code;
        EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, std::string("as a dma-buf of 64 bytes (") + words + "): it must",
                          clspBufferCreateFromFd(context, CLSP_EXTERNAL_MEMORY_DMA_BUF, fd, 64, &made));
    }
    driver::refuses = CL_SUCCESS;
    EXPECT_EQ(0, close(fd)) << "still the caller's";
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "size_bytes is 0",
                      clspBufferCreateFromFd(context, CLSP_EXTERNAL_MEMORY_DMA_BUF, 0, 0, &made));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "mem",
                      clspBufferCreateFromFd(context, CLSP_EXTERNAL_MEMORY_DMA_BUF, 0, 64, nullptr));
    EXPECT_EQ(nullptr, made);

    for (const auto function : {clspSharedEnqueueAcquire, clspSharedEnqueueRelease}) {
        const std::string name =
            function == clspSharedEnqueueAcquire ? "clspSharedEnqueueAcquire" : "clspSharedEnqueueRelease";
        const auto fails = [&](ClspStatus status, const std::string &words, std::uint32_t kind, std::uint32_t count,
                               const cl_mem *mems) {
            test::poison_last_error(name);
            EXPECT_TRUE(
                test::failed_as(name, function(context, queue, kind, count, mems, 0, nullptr, nullptr), status, words))
                << words;
        };
        fails(CLSP_ERROR_INVALID_ARGUMENT, "CLSP_SHARED_EXTERNAL (1)", 2, 1, &plain);
        fails(CLSP_ERROR_INVALID_ARGUMENT, "at least one object", CLSP_SHARED_GL, 0, &plain);
        fails(CLSP_ERROR_INVALID_ARGUMENT, "mems is NULL", CLSP_SHARED_EXTERNAL, 1, nullptr);
        fails(CLSP_ERROR_INVALID_ARGUMENT, "mems[0] is NULL", CLSP_SHARED_GL, 1, &none);
        for (const std::uint32_t kind : {CLSP_SHARED_GL, CLSP_SHARED_EXTERNAL})
            fails(CLSP_ERROR_WRONG_CONTEXT, "mems[1] belongs to another cl_context", kind, 2, strange);
        fails(CLSP_ERROR_INVALID_ARGUMENT, "not made of an object of GL", CLSP_SHARED_GL, 1, &plain);
        fails(CLSP_ERROR_INVALID_ARGUMENT, "not made of a file descriptor", CLSP_SHARED_EXTERNAL, 1, &plain);
    }
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "queue",
                      clspSharedEnqueueAcquire(context, nullptr, CLSP_SHARED_GL, 1, &plain, 0, nullptr, nullptr));

    // A cl_image over the image's own buffer, and a z-buffer.
    driver::buffer_of_image = image.buffer;
    EXPECT_CLSP_FAILS(CLSP_ERROR_OVERLAP, "takes that buffer as it is",
                      clspClImageEnqueueImport(context, queue, texture, 0, &image.view, 0, nullptr, nullptr));
    // Halves of one buffer: the cl_image's, and the image in that half, in the other, and in the whole buffer.
    const std::size_t half = 4 * pixels;
    const clspeckle::Buffer whole(context, 2 * half);
    const auto part = [&](std::size_t offset) {
        const cl_buffer_region region{offset, half};
        cl_int code = CL_SUCCESS;
        return clspeckle::Buffer::adopt(clCreateSubBuffer(whole, 0, CL_BUFFER_CREATE_TYPE_REGION, &region, &code),
                                        half);
    };
    const clspeckle::Buffer first = part(0), again = part(0), second = part(half);
    driver::buffer_of_image = first;
    for (const clspeckle::Buffer *const buffer : {&first, &again, &whole}) {
        const ClspImage view = buffer->image(width, height, CLSP_FORMAT_FLOAT32);
        EXPECT_CLSP_FAILS(CLSP_ERROR_OVERLAP, "takes that buffer as it is",
                          clspClImageEnqueueImport(context, queue, texture, 0, &view, 0, nullptr, nullptr));
        EXPECT_CLSP_FAILS(CLSP_ERROR_OVERLAP, "takes that buffer as it is",
                          clspClImageEnqueueExport(context, queue, &view, texture, 0, nullptr, nullptr));
    }
    const ClspImage apart = second.image(width, height, CLSP_FORMAT_FLOAT32);
    EXPECT_CLSP_OK(clspClImageEnqueueImport(context, queue, texture, 0, &apart, 0, nullptr, nullptr));
    driver::buffer_of_image = nullptr;
    driver::order = CL_DEPTH;
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_FORMAT, "render the distance into a CL_R texture of CL_FLOAT",
                      clspClImageEnqueueImport(context, queue, texture, 0, &image.view, 0, nullptr, nullptr));
}

} // namespace

// What the GoogleTest programs share: one context per program, images that place themselves in device memory, and
// checks of a call's status together with the message that it left.
#ifndef CLSPECKLE_TEST_SUPPORT_HPP
#define CLSPECKLE_TEST_SUPPORT_HPP

#include <clspeckle/clspeckle.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <functional>
#include <limits>
#include <memory>
#include <string>
#include <vector>

namespace test {

constexpr double nan_value = std::numeric_limits<double>::quiet_NaN();
constexpr double infinity = std::numeric_limits<double>::infinity();

inline std::string lower(std::string text) {
    for (char &c : text)
        c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    return text;
}

inline ClspErrorInfo last_error() {
    ClspErrorInfo info{};
    info.struct_size = sizeof(info);
    clspGetLastError(&info);
    return info;
}

inline std::string describe(ClspStatus status) {
    const ClspErrorInfo info = last_error();
    return std::string(clspStatusString(status)) + " (" + info.function + ": " + info.message + ")";
}

inline ::testing::AssertionResult succeeded(const char *, ClspStatus status) {
    if (status == CLSP_SUCCESS)
        return ::testing::AssertionSuccess();
    return ::testing::AssertionFailure() << describe(status) << last_error().build_log;
}

// The name of the function in "clspSomething(...)", or in "enqueue(clspSomething, ...)".
inline std::string function_of(const std::string &expression) {
    const std::size_t begin = expression.find("clsp");
    return expression.substr(begin, expression.find_first_of("(,", begin) - begin);
}

// The flag for out-of-order queues; 0 on devices that have none (Mesa's rusticl).
inline std::uint32_t out_of_order(const clspeckle::Context &context) {
    cl_command_queue_properties has = 0;
    clGetDeviceInfo(context.info().cl_device, CL_DEVICE_QUEUE_PROPERTIES, sizeof has, &has, nullptr);
    return has & CL_QUEUE_OUT_OF_ORDER_EXEC_MODE_ENABLE ? CLSP_QUEUE_OUT_OF_ORDER : 0u;
}

// Leaves an error of another function behind, so that a call that reports nothing cannot pass by an older message.
inline void poison_last_error(const std::string &function) {
    if (function == "clspStatisticsMoments")
        clspDeviceList(0, nullptr, nullptr);
    else
        clspStatisticsMoments(nullptr, nullptr, nullptr, nullptr, nullptr);
}

// Checks status, function name, and that the message holds one of the '|'-separated words (in any case).
inline ::testing::AssertionResult failed_as(const std::string &function, ClspStatus got, ClspStatus expected,
                                            const std::string &words) {
    if (got != expected)
        return ::testing::AssertionFailure() << "gave " << (got == CLSP_SUCCESS ? "CLSP_SUCCESS" : describe(got))
                                             << ", expected " << clspStatusString(expected);
    const ClspErrorInfo info = last_error();
    if (info.status != got)
        return ::testing::AssertionFailure() << "the last error has status " << clspStatusString(info.status);
    if (info.function != function)
        return ::testing::AssertionFailure()
               << "the last error is that of " << info.function << ", expected " << function;
    const std::string message = lower(info.message);
    for (std::size_t begin = 0; begin <= words.size();) {
        const std::size_t end = std::min(words.find('|', begin), words.size());
        if (message.find(lower(words.substr(begin, end - begin))) != std::string::npos)
            return ::testing::AssertionSuccess();
        begin = end + 1;
    }
    return ::testing::AssertionFailure() << "the message does not name \"" << words << "\": " << info.message;
}

#define EXPECT_CLSP_OK(...) EXPECT_TRUE(::test::succeeded(#__VA_ARGS__, (__VA_ARGS__)))
#define ASSERT_CLSP_OK(...) ASSERT_TRUE(::test::succeeded(#__VA_ARGS__, (__VA_ARGS__)))

// EXPECT_CLSP_FAILS(status, "word|other word", clspCall(...))
#define EXPECT_CLSP_FAILS(status, words, ...)                                                                          \
    do {                                                                                                               \
        ::test::poison_last_error(::test::function_of(#__VA_ARGS__));                                                  \
        const ClspStatus clsp_status_ = (__VA_ARGS__);                                                                 \
        EXPECT_TRUE(::test::failed_as(::test::function_of(#__VA_ARGS__), clsp_status_, (status), (words)))             \
            << #__VA_ARGS__;                                                                                           \
    } while (false)

// One context for all tests of a program; compiled programs and FFT plans stay warm. It is released before main() ends.
class SharedContext : public ::testing::Environment {
  public:
    static clspeckle::Context &get() {
        if (!context_)
            context_ = std::make_unique<clspeckle::Context>();
        return *context_;
    }
    void TearDown() override { context_.reset(); }

  private:
    static inline std::unique_ptr<clspeckle::Context> context_;
};
inline const ::testing::Environment *const shared_context = ::testing::AddGlobalTestEnvironment(new SharedContext);

// A context and an in-order queue.
class DeviceTest : public ::testing::Test {
  protected:
    clspeckle::Context &context = SharedContext::get();
    clspeckle::Queue queue{context};

    // An image in its own buffer, `margin_bytes` before it and after it, `pitch_bytes` from row to row (0: packed).
    struct Image {
        clspeckle::Buffer buffer;
        ClspImage view{};
    };

    template <typename T>
    Image upload(const std::vector<T> &pixels, std::uint32_t width, std::uint32_t height, std::uint32_t format,
                 std::uint64_t pitch_bytes = 0, std::uint64_t margin_bytes = 0) {
        const std::size_t row = width * clspeckle::pixel_bytes(format);
        const std::size_t pitch = pitch_bytes ? pitch_bytes : row;
        std::vector<unsigned char> bytes(2 * margin_bytes + pitch * height, filler);
        for (std::uint32_t y = 0; y < height && !pixels.empty(); ++y)
            std::memcpy(bytes.data() + margin_bytes + y * pitch,
                        reinterpret_cast<const unsigned char *>(pixels.data()) + y * row, row);
        Image result;
        result.buffer = clspeckle::Buffer(context, queue, bytes);
        result.view = result.buffer.image(width, height, format, pitch_bytes, margin_bytes);
        return result;
    }
    Image make_image(std::uint32_t width, std::uint32_t height, std::uint32_t format, std::uint64_t pitch_bytes = 0,
                     std::uint64_t margin_bytes = 0) {
        return upload(std::vector<unsigned char>(), width, height, format, pitch_bytes, margin_bytes);
    }
    Image floats(const std::vector<float> &pixels, std::uint32_t width, std::uint32_t height) {
        return upload(pixels, width, height, CLSP_FORMAT_FLOAT32);
    }

    // The pixels, tightly packed.
    template <typename T> std::vector<T> download(const Image &image) {
        const std::size_t row = image.view.width * clspeckle::pixel_bytes(image.view.format);
        const std::size_t pitch = image.view.pitch_bytes ? image.view.pitch_bytes : row;
        const auto bytes = image.buffer.read<unsigned char>(queue, image.buffer.size_bytes());
        std::vector<T> pixels(row * image.view.height / sizeof(T));
        for (std::uint32_t y = 0; y < image.view.height; ++y)
            std::memcpy(reinterpret_cast<unsigned char *>(pixels.data()) + y * row,
                        bytes.data() + image.view.offset_bytes + y * pitch, row);
        return pixels;
    }
    // True if every byte outside of the pixels still has the value that upload() gave it.
    bool margins_untouched(const Image &image) {
        const std::size_t row = image.view.width * clspeckle::pixel_bytes(image.view.format);
        const std::size_t pitch = image.view.pitch_bytes ? image.view.pitch_bytes : row;
        const auto bytes = image.buffer.read<unsigned char>(queue, image.buffer.size_bytes());
        for (std::size_t i = 0; i < bytes.size(); ++i) {
            const bool inside = i >= image.view.offset_bytes &&
                                i < image.view.offset_bytes + pitch * image.view.height &&
                                (i - image.view.offset_bytes) % pitch < row;
            if (!inside && bytes[i] != filler)
                return false;
        }
        return true;
    }

    static constexpr unsigned char filler = 0xA5;
};

// Gaussian dots, 16 pixels apart, peak 1.
inline std::vector<float> dots(std::uint32_t width, std::uint32_t height) {
    std::vector<float> image(static_cast<std::size_t>(width) * height);
    for (std::uint32_t y = 0; y < height; ++y) {
        for (std::uint32_t x = 0; x < width; ++x) {
            const double dx = x % 16 - 7.5, dy = y % 16 - 7.5;
            image[static_cast<std::size_t>(y) * width + x] = static_cast<float>(std::exp(-(dx * dx + dy * dy) / 4.5));
        }
    }
    return image;
}

// A cl_context of the host's own on the device of the shared context. Contexts that clSpeckle makes may share one
// cl_context, so whoever needs a foreign one makes it himself.
class HostContext {
  public:
    HostContext() {
        device = SharedContext::get().info().cl_device;
        cl_platform_id platform = nullptr;
        clGetDeviceInfo(device, CL_DEVICE_PLATFORM, sizeof(platform), &platform, nullptr);
        const cl_context_properties properties[] = {CL_CONTEXT_PLATFORM,
                                                    reinterpret_cast<cl_context_properties>(platform), 0};
        cl_int code = CL_SUCCESS;
        context = clCreateContext(properties, 1, &device, nullptr, nullptr, &code);
        if (code != CL_SUCCESS)
            throw std::runtime_error("clCreateContext failed");
    }
    HostContext(const HostContext &) = delete;
    HostContext &operator=(const HostContext &) = delete;
    ~HostContext() { clReleaseContext(context); }

    cl_command_queue queue(cl_command_queue_properties properties = 0) const {
        cl_int code = CL_SUCCESS;
        cl_command_queue result = clCreateCommandQueue(context, device, properties, &code);
        if (code != CL_SUCCESS)
            throw std::runtime_error("clCreateCommandQueue failed");
        return result;
    }
    cl_mem buffer(std::size_t bytes) const {
        cl_int code = CL_SUCCESS;
        cl_mem result = clCreateBuffer(context, CL_MEM_READ_WRITE, bytes, nullptr, &code);
        if (code != CL_SUCCESS)
            throw std::runtime_error("clCreateBuffer failed");
        return result;
    }
    cl_event user_event() const {
        cl_int code = CL_SUCCESS;
        cl_event result = clCreateUserEvent(context, &code);
        if (code != CL_SUCCESS)
            throw std::runtime_error("clCreateUserEvent failed");
        return result;
    }

    cl_context context = nullptr;
    cl_device_id device = nullptr;
};

// Objects of another cl_context, which must be refused.
struct Foreign {
    HostContext host;
    clspeckle::Queue queue = clspeckle::Queue::adopt(host.queue());
    clspeckle::Buffer buffer = clspeckle::Buffer::adopt(host.buffer(1 << 20), 1 << 20);
    clspeckle::Event event = clspeckle::Event::adopt(host.user_event());

    ~Foreign() { clSetUserEventStatus(event, CL_COMPLETE); }
};

/**
 * The rules of struct_size for a struct that a function reads: 0 and too small are refused, a longer one passes while
 * its tail is zero, and is refused otherwise.
 * @param call runs the function on a pointer to the struct; returns its status.
 */
template <typename Struct>
void check_struct_size(const std::string &function, const Struct &valid,
                       const std::function<ClspStatus(Struct *)> &call) {
    struct alignas(16) Longer {
        unsigned char bytes[sizeof(Struct) + 64];
    };
    const auto run = [&](std::uint32_t struct_size, std::size_t dirty) {
        Longer longer{};
        std::memcpy(longer.bytes, &valid, sizeof(Struct));
        std::memcpy(longer.bytes, &struct_size, sizeof(struct_size));
        if (dirty)
            longer.bytes[dirty] = 1;
        poison_last_error(function);
        return call(reinterpret_cast<Struct *>(longer.bytes));
    };
    const std::uint32_t size = sizeof(Struct);
    EXPECT_TRUE(succeeded("", run(size, 0))) << function;
    EXPECT_TRUE(succeeded("", run(size + 64, 0))) << function << " with a longer struct";
    for (std::uint32_t wrong : {0u, 4u, 16u, 0xffffffffu}) // the last one must not make the library read that far
        EXPECT_TRUE(failed_as(function, run(wrong, 0), CLSP_ERROR_INVALID_STRUCT_SIZE, "struct_size"))
            << function << " with struct_size " << wrong;
    for (std::size_t dirty : {sizeof(Struct), sizeof(Struct) + 63})
        EXPECT_TRUE(failed_as(function, run(size + 64, dirty), CLSP_ERROR_INVALID_STRUCT_SIZE, "newer release"))
            << function << " with byte " << dirty << " of a longer struct not zero";
}

/**
 * What every Enqueue call says to a wrong queue, wait list or event.
 * @param call runs the function on a queue and a wait list; returns its status.
 */
inline void
check_enqueue_rules(const std::string &function, const clspeckle::Context &context,
                    const std::function<ClspStatus(cl_command_queue, cl_uint, const cl_event *, cl_event *)> &call) {
    const clspeckle::Queue queue(context);
    const Foreign foreign;
    const auto fails = [&](ClspStatus expected, const std::string &words, cl_command_queue q, cl_uint count,
                           const cl_event *events) {
        poison_last_error(function);
        EXPECT_TRUE(failed_as(function, call(q, count, events, nullptr), expected, words)) << function;
    };
    const cl_event none = nullptr, other = foreign.event;
    fails(CLSP_ERROR_INVALID_ARGUMENT, "queue", nullptr, 0, nullptr);
    fails(CLSP_ERROR_WRONG_CONTEXT, "queue", foreign.queue, 0, nullptr);
    fails(CLSP_ERROR_INVALID_ARGUMENT, "event_wait_list", queue, 1, nullptr);
    fails(CLSP_ERROR_INVALID_ARGUMENT, "num_events_in_wait_list", queue, 0, &other);
    fails(CLSP_ERROR_INVALID_ARGUMENT, "event_wait_list", queue, 1, &none);
    fails(CLSP_ERROR_WRONG_CONTEXT, "event_wait_list", queue, 1, &other);

    // The event: given when asked for, complete after the queue is finished, one after the other through a wait list.
    for (std::uint32_t flags : {0u, out_of_order(context), CLSP_QUEUE_PROFILING}) {
        const clspeckle::Queue working(context, flags);
        cl_event first = nullptr, second = nullptr;
        ASSERT_TRUE(succeeded("", call(working, 0, nullptr, &first))) << function;
        ASSERT_NE(nullptr, first);
        ASSERT_TRUE(succeeded("", call(working, 1, &first, &second))) << function;
        ASSERT_NE(nullptr, second);
        EXPECT_CLSP_OK(clspQueueFinish(working));
        for (cl_event event : {first, second}) {
            cl_int status = -1;
            clGetEventInfo(event, CL_EVENT_COMMAND_EXECUTION_STATUS, sizeof(status), &status, nullptr);
            EXPECT_EQ(CL_COMPLETE, status) << function;
            EXPECT_CLSP_OK(clspEventRelease(event));
        }
        EXPECT_TRUE(succeeded("", call(working, 0, nullptr, nullptr))) << function;
        EXPECT_CLSP_OK(clspQueueFinish(working));
    }
}

/**
 * What a function says to a wrong image.
 * @param valid an image that it takes; its buffer is exactly as large as it must be.
 * @param name  what the message calls it.
 * @param wrong_format a format that the function does not take there.
 * @param call runs the function on an image; returns its status.
 * @param optional a NULL mem means "no image".
 */
inline void check_image_rules(const std::string &function, const clspeckle::Context &context, const ClspImage &valid,
                              const std::string &name, std::uint32_t wrong_format,
                              const std::function<ClspStatus(const ClspImage *)> &call, bool optional = false) {
    const auto fails = [&](ClspStatus expected, const std::string &words, const ClspImage *image) {
        poison_last_error(function);
        const ClspStatus status = call(image);
        EXPECT_TRUE(failed_as(function, status, expected, words)) << function << ", image " << name;
    };
    const auto changed = [&](const std::function<void(ClspImage &)> &change) {
        ClspImage image = valid;
        change(image);
        return image;
    };
    const std::uint64_t component = valid.format == CLSP_FORMAT_UINT8 ? 1 : valid.format == CLSP_FORMAT_UINT16 ? 2 : 4;
    const std::uint64_t row = valid.width * clspeckle::pixel_bytes(valid.format);
    ClspImage image = changed([](ClspImage &i) { i.mem = nullptr; });
    if (!optional)
        fails(CLSP_ERROR_INVALID_ARGUMENT, name, &image);
    for (std::uint32_t format : {wrong_format, std::uint32_t{CLSP_FORMAT_NONE}, 8u, 0xffffffffu}) {
        image = changed([&](ClspImage &i) { i.format = format; });
        fails(CLSP_ERROR_INVALID_FORMAT, name, &image);
        if (format > CLSP_FORMAT_FLOAT32X4)
            fails(CLSP_ERROR_INVALID_FORMAT, "CLSP_FORMAT_FLOAT32X3 (6) or CLSP_FORMAT_FLOAT32X4 (7)", &image);
    }
    for (std::uint32_t side : {0u, 16385u, 0x80000000u, 0xffffffffu}) {
        image = changed([&](ClspImage &i) { i.width = side; });
        fails(CLSP_ERROR_INVALID_ARGUMENT, name, &image);
        image = changed([&](ClspImage &i) { i.height = side; });
        fails(CLSP_ERROR_INVALID_ARGUMENT, name, &image);
    }
    image = changed([&](ClspImage &i) { i.pitch_bytes = row - component; });
    fails(CLSP_ERROR_BUFFER_TOO_SMALL, "pitch", &image);
    image = changed([&](ClspImage &i) { i.pitch_bytes = row + component; });
    fails(CLSP_ERROR_BUFFER_TOO_SMALL, name, &image);
    image = changed([&](ClspImage &i) { i.pitch_bytes = ~std::uint64_t{0} - component + 1; });
    poison_last_error(function);
    EXPECT_NE(CLSP_SUCCESS, call(&image)) << function << ", image " << name << ", pitch near 2^64";
    image = changed([&](ClspImage &i) { i.offset_bytes = component; });
    fails(CLSP_ERROR_BUFFER_TOO_SMALL, name, &image);
    image = changed([&](ClspImage &i) { i.offset_bytes = ~std::uint64_t{0} - component + 1; });
    fails(CLSP_ERROR_BUFFER_TOO_SMALL, name, &image);
    if (component > 1) {
        image = changed([&](ClspImage &i) { i.offset_bytes = 1; });
        fails(CLSP_ERROR_INVALID_ARGUMENT, "offset", &image);
        image = changed([&](ClspImage &i) { i.pitch_bytes = row + 1; });
        fails(CLSP_ERROR_INVALID_ARGUMENT, "pitch", &image);
    }
    image = changed([](ClspImage &i) { i.reserved = 1; });
    fails(CLSP_ERROR_INVALID_ARGUMENT, "reserved", &image);
    {
        const clspeckle::Buffer small(context, row * valid.height - 1);
        image = changed([&](ClspImage &i) { i.mem = small; });
        fails(CLSP_ERROR_BUFFER_TOO_SMALL, name, &image);
    }
    {
        const Foreign foreign;
        image = changed([&](ClspImage &i) { i.mem = foreign.buffer; });
        fails(CLSP_ERROR_WRONG_CONTEXT, name, &image);
    }
}

/** The same with sizes: an image that is one pixel wider or lower than the others. */
inline void check_image_size_must_match(const std::string &function, const clspeckle::Context &context,
                                        const ClspImage &valid, const std::string &name,
                                        const std::function<ClspStatus(const ClspImage *)> &call) {
    const clspeckle::Buffer large(context,
                                  (valid.width + 1) * (valid.height + 1) * clspeckle::pixel_bytes(valid.format));
    for (int axis = 0; axis < 4; ++axis) {
        ClspImage image = large.image(valid.width + (axis == 0) - (axis == 2), valid.height + (axis == 1) - (axis == 3),
                                      valid.format);
        poison_last_error(function);
        EXPECT_TRUE(failed_as(function, call(&image), CLSP_ERROR_INVALID_ARGUMENT, name))
            << function << ", image " << name << " of another size";
    }
}

// The rules of an init function: NULL and small sizes are refused, defaults are written over what was there, nothing
// behind the struct is touched, and what a longer struct has is cleared.
template <typename Struct> void check_init(const std::string &function, ClspStatus (*init)(Struct *, std::uint32_t)) {
    EXPECT_TRUE(failed_as(function, (poison_last_error(function), init(nullptr, sizeof(Struct))),
                          CLSP_ERROR_INVALID_ARGUMENT, "NULL"));
    struct alignas(16) Longer {
        unsigned char bytes[sizeof(Struct) + 64];
    };
    for (std::uint32_t wrong : {0u, 4u, 16u, 0xffffffffu}) {
        Longer memory;
        std::memset(&memory, 0xEE, sizeof(memory));
        poison_last_error(function);
        EXPECT_TRUE(failed_as(function, init(reinterpret_cast<Struct *>(memory.bytes), wrong),
                              CLSP_ERROR_INVALID_STRUCT_SIZE, "struct_size"));
    }
    Longer once, twice, longer;
    std::memset(&once, 0xEE, sizeof(once));
    std::memset(&twice, 0x11, sizeof(twice));
    std::memset(&longer, 0xEE, sizeof(longer));
    EXPECT_TRUE(succeeded("", init(reinterpret_cast<Struct *>(once.bytes), sizeof(Struct))));
    EXPECT_TRUE(succeeded("", init(reinterpret_cast<Struct *>(twice.bytes), sizeof(Struct))));
    EXPECT_TRUE(succeeded("", init(reinterpret_cast<Struct *>(longer.bytes), sizeof(Struct) + 64)));
    EXPECT_EQ(0, std::memcmp(once.bytes, twice.bytes, sizeof(Struct))) << function << " leaves bytes unset";
    EXPECT_EQ(sizeof(Struct), reinterpret_cast<Struct *>(once.bytes)->struct_size);
    EXPECT_EQ(sizeof(Struct) + 64, reinterpret_cast<Struct *>(longer.bytes)->struct_size);
    for (std::size_t i = sizeof(Struct); i < sizeof(Struct) + 64; ++i) {
        EXPECT_EQ(0xEE, once.bytes[i]) << function << " wrote behind the struct";
        EXPECT_EQ(0, longer.bytes[i]) << function << " left the tail of a longer struct unset";
    }
}

// A folder for one test, removed at its end.
class TemporaryFolder {
  public:
    TemporaryFolder() {
        std::string name = (std::filesystem::temp_directory_path() / "clspeckle-test-XXXXXX").string();
        if (!mkdtemp(name.data()))
            throw std::runtime_error("no temporary folder could be made");
        path_ = name;
    }
    TemporaryFolder(const TemporaryFolder &) = delete;
    TemporaryFolder &operator=(const TemporaryFolder &) = delete;
    ~TemporaryFolder() {
        std::error_code ignored;
        std::filesystem::remove_all(path_, ignored);
    }
    const std::filesystem::path &path() const { return path_; }

  private:
    std::filesystem::path path_;
};

} // namespace test

#endif // CLSPECKLE_TEST_SUPPORT_HPP

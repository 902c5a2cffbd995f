/**
 * @file clspeckle.hpp
 * @brief The C++17 binding of clSpeckle: RAII and exceptions over the C interface, header only.
 *
 * Every class owns one reference of the C handle of its name, and every method calls the C function of its name
 * (`Phase::enqueue_refresh` is clspPhaseEnqueueRefresh(), `Pipeline::timings` is clspPipelineGetTimings()), so shapes,
 * units, ranges and thread rules are those of the C headers. What C reports by status is thrown as clspeckle::Error.
 *
 * Descriptions are the C structs; make<ClspApertureDesc>() gives one with its defaults and struct_size filled in.
 *
 * A queue is passed as `cl_command_queue`, memory as `cl_mem`: a host's own OpenCL objects go in as they are, and
 * nobody takes them over. Queue, Buffer and Event convert to them. `borrow` wraps a host's object without owning it,
 * `adopt` takes over one reference.
 *
 * Wait lists are vectors of `cl_event` (`{a, b}` works, also with Event); the event comes last and may be left out.
 *
 * Threads: a Context may be used from any number of threads at once. Any other object may be used from one thread at a
 * time; different objects from different threads at the same time. Copies of a handle share one object.
 */
#ifndef CLSPECKLE_CLSPECKLE_HPP
#define CLSPECKLE_CLSPECKLE_HPP

#include <clspeckle/clspeckle.h>
#include <clspeckle/init.hpp>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <exception>
#include <functional>
#include <map>
#include <optional>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

namespace clspeckle {

/** A failed call: what() is "function: message (status)". */
class Error : public std::runtime_error {
  public:
    /** What a call that failed says: the members have it. */
    Error(ClspStatus status, std::int32_t opencl_code, std::string function, std::string message, std::string build_log)
        : std::runtime_error(function + ": " + message + " (" + clspStatusString(status) + ")"), status_(status),
          opencl_code_(opencl_code), function_(std::move(function)), message_(std::move(message)),
          build_log_(std::move(build_log)) {}

    /** CLSP_ERROR_*. */
    ClspStatus status() const noexcept { return status_; }
    /** The OpenCL or clFFT error code behind it, 0 if none. */
    std::int32_t opencl_code() const noexcept { return opencl_code_; }
    /** Name of the C function that failed. */
    const std::string &function() const noexcept { return function_; }
    /** What was wrong, what was expected, what to do. */
    const std::string &message() const noexcept { return message_; }
    /** The compiler's output after CLSP_ERROR_BUILD, else empty. */
    const std::string &build_log() const noexcept { return build_log_; }

  private:
    ClspStatus status_;
    std::int32_t opencl_code_;
    std::string function_;
    std::string message_;
    std::string build_log_;
};

/** Throws the calling thread's last error if `status` is one. For code that mixes C calls in. */
inline void check(ClspStatus status) {
    if (status == CLSP_SUCCESS)
        return;
    ClspErrorInfo info{};
    info.struct_size = sizeof(info);
    if (clspGetLastError(&info) == CLSP_SUCCESS && info.status == status)
        throw Error(status, info.opencl_code, info.function, info.message, info.build_log);
    throw Error(status, 0, "clspeckle", "no details are known", "");
}

/** Told what is being done and the fraction that is done; false cancels: the call throws CLSP_ERROR_CANCELLED. On the
 * thread of the call; what it throws leaves the call. */
using Progress = std::function<bool(const std::string &what, double fraction)>;

namespace detail {

/** A caller's function, and the first exception of any of them, on its way through C. */
template <typename Function> struct Carried {
    const Function *function;
    std::exception_ptr *thrown;
};

extern "C" inline std::int32_t clspeckle_detail_progress(void *data, const char *what, double fraction) {
    const auto *carried = static_cast<const Carried<Progress> *>(data);
    try {
        return (*carried->function)(what, fraction) ? 1 : 0;
    } catch (...) {
        *carried->thrown = std::current_exception();
        return 0;
    }
}

/** Makes call(desc) with `progress` in the place of desc.progress, if it is not empty. */
template <typename Desc, typename Call> void call_with_progress(Desc desc, const Progress &progress, Call call) {
    std::exception_ptr thrown;
    Carried<Progress> carried{&progress, &thrown};
    if (progress) {
        desc.progress = clspeckle_detail_progress;
        desc.progress_data = &carried;
    }
    const ClspStatus status = call(&desc);
    if (thrown && status != CLSP_SUCCESS)
        std::rethrow_exception(thrown);
    check(status);
}

/** A text of the library: get(arguments, capacity, text, length) gives its size, then the text. */
template <typename Get, typename... Arguments> std::string text_of(Get get, const Arguments &...arguments) {
    std::uint64_t length = 0;
    std::string text(std::size_t{1} << 16, '\0'); // what is longer is asked for twice
    check(get(arguments..., text.size(), &text[0], &length));
    if (length > text.size()) {
        text.resize(static_cast<std::size_t>(length));
        check(get(arguments..., text.size(), &text[0], nullptr));
    }
    text.resize(std::min(text.size(), text.find('\0')));
    return text;
}

/** One reference of a counted handle. */
template <typename Class, typename Handle, ClspStatus (*Retain)(Handle), ClspStatus (*Release)(Handle)> class Shared {
  public:
    Shared() noexcept = default;
    Shared(const Shared &other) : handle_(other.handle_) {
        if (handle_)
            check(Retain(handle_));
    }
    Shared(Shared &&other) noexcept : handle_(std::exchange(other.handle_, nullptr)) {}
    Shared &operator=(const Shared &other) {
        Shared copy(other);
        std::swap(handle_, copy.handle_);
        return *this;
    }
    Shared &operator=(Shared &&other) noexcept {
        if (this != &other) {
            reset();
            handle_ = std::exchange(other.handle_, nullptr);
        }
        return *this;
    }
    ~Shared() { reset(); }

    /** Takes over one reference of a C handle. */
    static Class adopt(Handle handle) noexcept {
        Class made;
        made.handle_ = handle;
        return made;
    }
    /** The C handle, still owned by this object; nullptr after a move. */
    Handle get() const noexcept { return handle_; }
    operator Handle() const noexcept { return handle_; }
    explicit operator bool() const noexcept { return handle_ != nullptr; }
    /** Gives the reference up to the caller. */
    Handle release() noexcept { return std::exchange(handle_, nullptr); }
    /** Drops the reference. */
    void reset() noexcept {
        if (handle_)
            (void)Release(std::exchange(handle_, nullptr));
    }

  protected:
    explicit Shared(Handle handle) noexcept : handle_(handle) {}
    Handle handle_ = nullptr;
};

/** An OpenCL object that is owned (one reference, dropped at the end) or borrowed (never touched). */
template <typename Object, ClspStatus (*Release)(Object)> class Unique {
  public:
    Unique() noexcept = default;
    Unique(const Unique &) = delete;
    Unique &operator=(const Unique &) = delete;
    Unique(Unique &&other) noexcept
        : object_(std::exchange(other.object_, nullptr)), owned_(std::exchange(other.owned_, false)) {}
    Unique &operator=(Unique &&other) noexcept {
        if (this != &other) {
            reset();
            object_ = std::exchange(other.object_, nullptr);
            owned_ = std::exchange(other.owned_, false);
        }
        return *this;
    }
    ~Unique() { reset(); }

    /** The OpenCL object; this object keeps what it owns. */
    Object get() const noexcept { return object_; }
    operator Object() const noexcept { return object_; }
    explicit operator bool() const noexcept { return object_ != nullptr; }
    /** True if the reference is dropped with this object. */
    bool owned() const noexcept { return owned_; }
    /** Gives the object up to the caller, with the reference if it was owned. */
    Object release() noexcept {
        owned_ = false;
        return std::exchange(object_, nullptr);
    }
    /** Drops the reference if it is owned. */
    void reset() noexcept {
        if (object_ && owned_)
            (void)Release(object_);
        object_ = nullptr;
        owned_ = false;
    }

  protected:
    Unique(Object object, bool owned) noexcept : object_(object), owned_(owned) {}
    Object object_ = nullptr;
    bool owned_ = false;
};

template <typename T> constexpr void require_plain() {
    static_assert(std::is_trivially_copyable<T>::value, "device memory holds plain numbers and structs");
}

} // namespace detail

/** A C struct with its defaults and struct_size, for example `auto desc = clspeckle::make<ClspApertureDesc>();`. */
template <typename Struct> Struct make() {
    Struct result{};
    detail::init(result);
    return result;
}

/** Bytes of one pixel of CLSP_FORMAT_*; 0 for an unknown format. */
constexpr std::size_t pixel_bytes(std::uint32_t format) noexcept {
    switch (format) {
    case CLSP_FORMAT_UINT8:
        return 1;
    case CLSP_FORMAT_UINT16:
        return 2;
    case CLSP_FORMAT_UINT32:
    case CLSP_FORMAT_FLOAT32:
        return 4;
    case CLSP_FORMAT_FLOAT32X2:
        return 8;
    case CLSP_FORMAT_FLOAT32X3:
        return 12;
    case CLSP_FORMAT_FLOAT32X4:
        return 16;
    default:
        return 0;
    }
}

/**
 * A view of an image in device memory; owns nothing. `mem` may be a Buffer or the host's own cl_mem.
 * @param format CLSP_FORMAT_*.
 * @param pitch_bytes from row to row, 0: tightly packed.
 * @param offset_bytes where the first pixel lies.
 */
inline ClspImage image(cl_mem mem, std::uint32_t width, std::uint32_t height, std::uint32_t format,
                       std::uint64_t pitch_bytes = 0, std::uint64_t offset_bytes = 0) noexcept {
    ClspImage view{};
    view.mem = mem;
    view.offset_bytes = offset_bytes;
    view.pitch_bytes = pitch_bytes;
    view.width = width;
    view.height = height;
    view.format = format;
    return view;
}

/** The loaded library's release and ABI number. */
struct Version {
    /** Of the library: semantic version, and the number of its binary interface. */
    std::uint32_t major; /**< Of the release. */
    std::uint32_t minor; /**< Of the release. */
    std::uint32_t patch; /**< Of the release. */
    std::uint32_t abi;   /**< Of the binary interface. */
};
/** clspGetVersion(). */
inline Version version() {
    Version v{};
    check(clspGetVersion(&v.major, &v.minor, &v.patch, &v.abi));
    return v;
}

/** Every device of every platform, best first; empty if there is none. May be called from any thread. */
inline std::vector<ClspDeviceInfo> devices() {
    std::uint32_t count = 0;
    check(clspDeviceList(0, nullptr, &count));
    std::vector<ClspDeviceInfo> result(count);
    if (result.empty())
        return result;
    for (ClspDeviceInfo &info : result)
        info.struct_size = sizeof(info);
    check(clspDeviceList(count, result.data(), &count));
    if (count < result.size())
        result.resize(count);
    return result;
}

/** In words: which platforms and devices were seen, which one would be taken, why others were refused, how to get one.
 *  May be called from any thread. @param selector as ClspContextDesc::device; empty for the default choice. */
inline std::string explain_devices(const std::string &selector = {}) {
    return detail::text_of(clspDeviceExplain, selector.empty() ? nullptr : selector.c_str());
}

/** clspFieldGridCompute(): the FFT's size for an image. */
inline ClspFieldGrid field_grid(std::uint32_t width, std::uint32_t height, std::uint32_t oversampling = 1,
                                std::uint32_t guard_px = 0) {
    ClspFieldGrid grid{};
    grid.width = width;
    grid.height = height;
    grid.oversampling = oversampling;
    grid.guard_px = guard_px;
    check(clspFieldGridCompute(&grid));
    return grid;
}

/** A device, its programs and FFT plans. May be used from any number of threads at once. */
class Context : public detail::Shared<Context, ClspContext, clspContextRetain, clspContextRelease> {
  public:
    /** The best device, or the one that CLSPECKLE_DEVICE names. */
    Context() { check(clspContextCreate(nullptr, &handle_)); }
    /** clspContextCreate(). */
    explicit Context(const ClspContextDesc &desc) { check(clspContextCreate(&desc, &handle_)); }
    /** A context on the host's own cl_context, which is retained while this one lives. */
    static Context from_host(cl_context host_context, cl_device_id host_device) {
        auto desc = make<ClspContextDesc>();
        desc.cl_context_handle = host_context;
        desc.cl_device = host_device;
        return Context(desc);
    }
    /** Takes over one reference of a C handle. */
    static Context adopt(ClspContext handle) noexcept { return Context(handle, 0); }

    /** clspContextGetInfo(). */
    ClspContextInfo info() const {
        auto result = make<ClspContextInfo>();
        check(clspContextGetInfo(handle_, &result));
        return result;
    }
    /** clspContextGetInteropInfo(): what it can share with other APIs. */
    ClspInteropInfo interop_info() const {
        auto result = make<ClspInteropInfo>();
        check(clspContextGetInteropInfo(handle_, &result));
        return result;
    }

  private:
    Context(ClspContext handle, int) noexcept : Shared(handle) {}
};

/** An event. One object may be used from one thread at a time. */
class Event : public detail::Unique<cl_event, clspEventRelease> {
  public:
    Event() noexcept = default;
    /** Takes over one reference of the host's event. */
    static Event adopt(cl_event event) noexcept { return Event(event, true); }
    /** Wraps the host's event, which must outlive the wrapper. */
    static Event borrow(cl_event event) noexcept { return Event(event, false); }

    /** Blocks until it is complete; throws if its command failed. */
    void wait() const { check(clspEventWait(1, &object_)); }

  private:
    Event(cl_event event, bool owned) noexcept : Unique(event, owned) {}
};

/** Waits for all of them. */
inline void wait(const std::vector<cl_event> &events) {
    if (!events.empty())
        check(clspEventWait(static_cast<std::uint32_t>(events.size()), events.data()));
}

namespace detail {

/** Makes call(arguments, wait list, event); *event, if the caller wants it, is written once the call has succeeded. */
template <typename Call, typename... Arguments>
void enqueue(const std::vector<cl_event> &wait_list, Event *event, Call call, const Arguments &...arguments) {
    cl_event made = nullptr;
    check(call(arguments..., static_cast<std::uint32_t>(wait_list.size()),
               wait_list.empty() ? nullptr : wait_list.data(), event ? &made : nullptr));
    if (event)
        *event = Event::adopt(made);
}

} // namespace detail

/** A command queue, our own or a borrowed one. OpenCL allows enqueuing from any thread; the destructor does not wait.
 */
class Queue : public detail::Unique<cl_command_queue, clspQueueRelease> {
  public:
    Queue() noexcept = default;
    /** @param flags CLSP_QUEUE_PROFILING, CLSP_QUEUE_OUT_OF_ORDER or 0. */
    explicit Queue(const Context &context, std::uint32_t flags = 0) {
        check(clspQueueCreate(context, flags, &object_));
        owned_ = true;
    }
    /** Takes over one reference of the host's queue. */
    static Queue adopt(cl_command_queue queue) noexcept { return Queue(queue, true); }
    /** Wraps the host's queue, which must outlive the wrapper. */
    static Queue borrow(cl_command_queue queue) noexcept { return Queue(queue, false); }

    /** Waits until everything in the queue is done. */
    void finish() const { check(clspQueueFinish(object_)); }

  private:
    Queue(cl_command_queue queue, bool owned) noexcept : Unique(queue, owned) {}
};

/** Device memory, our own or borrowed. */
class Buffer : public detail::Unique<cl_mem, clspBufferRelease> {
  public:
    Buffer() noexcept = default;
    /** Allocates `size_bytes` > 0 of uninitialised device memory. */
    Buffer(const Context &context, std::uint64_t size_bytes) : size_bytes_(size_bytes) {
        check(clspBufferCreate(context, size_bytes, &object_));
        owned_ = true;
    }
    /** Memory with a copy of `values`. Blocks. */
    template <typename T>
    Buffer(const Context &context, cl_command_queue queue, const std::vector<T> &values)
        : Buffer(context, values.size() * sizeof(T)) {
        write(queue, values);
    }
    /** Takes the other's memory over. */
    Buffer(Buffer &&other) noexcept
        : Unique(std::move(other)), size_bytes_(std::exchange(other.size_bytes_, std::uint64_t{0})) {}
    /** Takes the other's memory over. */
    Buffer &operator=(Buffer &&other) noexcept {
        if (this != &other) {
            Unique::operator=(std::move(other));
            size_bytes_ = std::exchange(other.size_bytes_, std::uint64_t{0});
        }
        return *this;
    }
    /** Takes over one reference of the host's memory. */
    static Buffer adopt(cl_mem mem, std::uint64_t size_bytes) noexcept { return Buffer(mem, size_bytes, true); }
    /** Wraps the host's memory, which must outlive the wrapper. */
    static Buffer borrow(cl_mem mem, std::uint64_t size_bytes) noexcept { return Buffer(mem, size_bytes, false); }

    /** clspBufferCreateFromFd(): memory of another API. @param type CLSP_EXTERNAL_MEMORY_*. */
    static Buffer from_fd(const Context &context, std::uint32_t type, int fd, std::uint64_t size_bytes) {
        cl_mem made = nullptr;
        check(clspBufferCreateFromFd(context, type, fd, size_bytes, &made));
        return Buffer(made, size_bytes, true);
    }

    /** Of the memory, as it was made. */
    std::uint64_t size_bytes() const noexcept { return size_bytes_; }

    /** A view of this memory as an image, see clspeckle::image(). */
    ClspImage image(std::uint32_t width, std::uint32_t height, std::uint32_t format, std::uint64_t pitch_bytes = 0,
                    std::uint64_t offset_bytes = 0) const noexcept {
        return clspeckle::image(object_, width, height, format, pitch_bytes, offset_bytes);
    }

    /** Blocking copy from host memory. */
    void write(cl_command_queue queue, const void *data, std::uint64_t size_bytes,
               std::uint64_t offset_bytes = 0) const {
        check(clspBufferWrite(queue, data, size_bytes, object_, offset_bytes));
    }
    /** Writes all values from the offset on. Waits. */
    template <typename T>
    void write(cl_command_queue queue, const std::vector<T> &values, std::uint64_t offset_bytes = 0) const {
        detail::require_plain<T>();
        write(queue, values.data(), values.size() * sizeof(T), offset_bytes);
    }
    /** Blocking copy to host memory. */
    void read(cl_command_queue queue, void *data, std::uint64_t size_bytes, std::uint64_t offset_bytes = 0) const {
        check(clspBufferRead(queue, object_, offset_bytes, size_bytes, data));
    }
    /** Fills `values`, whose size says how much to read. Blocks. */
    template <typename T>
    void read(cl_command_queue queue, std::vector<T> &values, std::uint64_t offset_bytes = 0) const {
        detail::require_plain<T>();
        read(queue, values.data(), values.size() * sizeof(T), offset_bytes);
    }
    /** Reads `count` elements from `offset_bytes`. Blocks. */
    template <typename T>
    std::vector<T> read(cl_command_queue queue, std::size_t count, std::uint64_t offset_bytes = 0) const {
        std::vector<T> values(count);
        read(queue, values, offset_bytes);
        return values;
    }
    /** Asynchronous copies; `data` must stay valid until the event is complete. */
    void enqueue_write(cl_command_queue queue, const void *data, std::uint64_t size_bytes,
                       std::uint64_t offset_bytes = 0, const std::vector<cl_event> &wait_list = {},
                       Event *event = nullptr) const {
        detail::enqueue(wait_list, event, clspBufferEnqueueWrite, queue, data, size_bytes, object_, offset_bytes);
    }
    /** clspBufferEnqueueRead(). */
    void enqueue_read(cl_command_queue queue, void *data, std::uint64_t size_bytes, std::uint64_t offset_bytes = 0,
                      const std::vector<cl_event> &wait_list = {}, Event *event = nullptr) const {
        detail::enqueue(wait_list, event, clspBufferEnqueueRead, queue, object_, offset_bytes, size_bytes, data);
    }

  private:
    Buffer(cl_mem mem, std::uint64_t size_bytes, bool owned) noexcept : Unique(mem, owned), size_bytes_(size_bytes) {}
    std::uint64_t size_bytes_ = 0;
};

/** A 2D image object of OpenCL, see interop.h; frames read and write buffers. */
class ClImage : public detail::Unique<cl_mem, clspBufferRelease> {
  public:
    ClImage() noexcept = default;
    /** clspClImageCreateFromGl(). */
    static ClImage from_gl(const Context &context, cl_mem_flags flags, std::uint32_t target, std::int32_t level,
                           std::uint32_t texture) {
        cl_mem made = nullptr;
        check(clspClImageCreateFromGl(context, flags, target, level, texture, &made));
        return ClImage(made, true);
    }
    /** Takes over one reference of the host's cl_image. */
    static ClImage adopt(cl_mem cl_image) noexcept { return ClImage(cl_image, true); }
    /** Wraps the host's cl_image, which must outlive the wrapper. */
    static ClImage borrow(cl_mem cl_image) noexcept { return ClImage(cl_image, false); }

    /** Copies its channels from `first_channel` on into an image in a buffer. */
    void enqueue_import(const Context &context, cl_command_queue queue, std::uint32_t first_channel,
                        const ClspImage &image, const std::vector<cl_event> &wait_list = {},
                        Event *event = nullptr) const {
        detail::enqueue(wait_list, event, clspClImageEnqueueImport, context, queue, object_, first_channel, &image);
    }
    /** Copies an image in a buffer into it. */
    void enqueue_export(const Context &context, cl_command_queue queue, const ClspImage &image,
                        const std::vector<cl_event> &wait_list = {}, Event *event = nullptr) const {
        detail::enqueue(wait_list, event, clspClImageEnqueueExport, context, queue, &image, object_);
    }

  private:
    ClImage(cl_mem cl_image, bool owned) noexcept : Unique(cl_image, owned) {}
};

/** Objects shared with other APIs, see interop.h. */
namespace shared {

/** Takes them over from the other API. @param kind CLSP_SHARED_*. */
inline void enqueue_acquire(const Context &context, cl_command_queue queue, std::uint32_t kind,
                            const std::vector<cl_mem> &mems, const std::vector<cl_event> &wait_list = {},
                            Event *event = nullptr) {
    detail::enqueue(wait_list, event, clspSharedEnqueueAcquire, context, queue, kind,
                    static_cast<std::uint32_t>(mems.size()), mems.data());
}
/** Gives them back. @param kind CLSP_SHARED_*. */
inline void enqueue_release(const Context &context, cl_command_queue queue, std::uint32_t kind,
                            const std::vector<cl_mem> &mems, const std::vector<cl_event> &wait_list = {},
                            Event *event = nullptr) {
    detail::enqueue(wait_list, event, clspSharedEnqueueRelease, context, queue, kind,
                    static_cast<std::uint32_t>(mems.size()), mems.data());
}

} // namespace shared

/** Philox4x32-10, see philox.h. */
namespace philox {

/** Runs Philox on `count` counters of four uint32. @param local_size work-group size; 0 leaves it to the device. */
inline void enqueue_blocks(const Context &context, cl_command_queue queue, cl_mem counters,
                           std::uint64_t counters_offset_bytes, const std::uint32_t (&key)[2], std::uint64_t count,
                           std::uint64_t local_size, cl_mem blocks, std::uint64_t blocks_offset_bytes,
                           const std::vector<cl_event> &wait_list = {}, Event *event = nullptr) {
    detail::enqueue(wait_list, event, clspPhiloxEnqueueBlocks, context, queue, counters, counters_offset_bytes, key,
                    count, local_size, blocks, blocks_offset_bytes);
}

/** Fills an image with random numbers. */
inline void enqueue_fill(const Context &context, cl_command_queue queue, const ClspPhiloxDesc &desc,
                         const ClspImage &image, const std::vector<cl_event> &wait_list = {}, Event *event = nullptr) {
    detail::enqueue(wait_list, event, clspPhiloxEnqueueFill, context, queue, &desc, &image);
}

} // namespace philox

/** The projected pattern, see pattern.h. */
class Pattern : public detail::Shared<Pattern, ClspPattern, clspPatternRetain, clspPatternRelease> {
  public:
    Pattern() noexcept = default;
    /** clspPatternCreate(). */
    Pattern(const Context &context, const ClspPatternDesc &desc) { check(clspPatternCreate(context, &desc, &handle_)); }

    /** Moves the laser. @param laser_from_geometry [R|t], 3 x 4 row-major. */
    void set_pose(const double (&laser_from_geometry)[12]) const {
        check(clspPatternSetPose(handle_, laser_from_geometry));
    }
    /** clspPatternEnqueueLookup(). */
    void enqueue_lookup(cl_command_queue queue, const ClspGeometry &geometry, const ClspImage &irradiance,
                        const std::vector<cl_event> &wait_list = {}, Event *event = nullptr) const {
        detail::enqueue(wait_list, event, clspPatternEnqueueLookup, handle_, queue, &geometry, &irradiance);
    }
};

/** The pattern of a diffractive element, or ideal dots as texels, see doe.h. */
class DoePattern : public detail::Shared<DoePattern, ClspDoePattern, clspDoePatternRetain, clspDoePatternRelease> {
  public:
    DoePattern() noexcept = default;
    /** Computes; blocks. `progress` takes the place of desc.progress if it is not empty. */
    DoePattern(const Context &context, const ClspDoePatternDesc &desc, const Progress &progress = {}) {
        detail::call_with_progress(
            desc, progress, [&](const ClspDoePatternDesc *d) { return clspDoePatternCreate(context, d, &handle_); });
    }
    /** clspSpotPatternCreate(). */
    DoePattern(const Context &context, const ClspSpotPatternDesc &desc) {
        check(clspSpotPatternCreate(context, &desc, &handle_));
    }

    /** clspDoePatternGetInfo(). */
    ClspDoePatternInfo info() const {
        ClspDoePatternInfo info{};
        info.struct_size = sizeof info;
        check(clspDoePatternGetInfo(handle_, &info));
        return info;
    }
    /** image_height x image_width radiant intensities in W/sr. */
    std::vector<float> texels() const {
        const ClspDoePatternInfo i = info();
        std::vector<float> values(std::size_t{i.image_width} * i.image_height);
        check(clspDoePatternGetTexels(handle_, values.size(), values.data()));
        return values;
    }
    /** Share of each wanted dot. */
    std::vector<double> dot_shares() const {
        std::vector<double> values(info().dot_count);
        check(clspDoePatternGetDotShares(handle_, values.size(), values.data()));
        return values;
    }
};

/** Ideal projected dots, see dots.h. */
class Dots : public detail::Shared<Dots, ClspDots, clspDotsRetain, clspDotsRelease> {
  public:
    Dots() noexcept = default;
    /** clspDotsCreate(). */
    Dots(const Context &context, const ClspDotsDesc &desc) { check(clspDotsCreate(context, &desc, &handle_)); }

    /** Changes the pattern; with count 0 and no pointers the dots stay. All or nothing. */
    void configure(const ClspDotsDesc &desc) const { check(clspDotsConfigure(handle_, &desc)); }
    /** clspDotsEnqueueRender(). */
    void enqueue_render(cl_command_queue queue, const ClspImage &irradiance,
                        const std::vector<cl_event> &wait_list = {}, Event *event = nullptr) const {
        detail::enqueue(wait_list, event, clspDotsEnqueueRender, handle_, queue, &irradiance);
    }
};

/** What clspDepthGetDots() tells of a frame. */
struct DepthResult {
    std::vector<ClspDepthDot> dots; /**< Row by row. */
    /** Of the frame: how many dots were found, known and measured. */
    ClspDepthSummary summary{};
};

/** Depth from frames of dots, see depth.h. */
class Depth : public detail::Shared<Depth, ClspDepth, clspDepthRetain, clspDepthRelease> {
  public:
    Depth() noexcept = default;
    /** clspDepthCreate(). */
    Depth(const Context &context, const ClspDepthDesc &desc) { check(clspDepthCreate(context, &desc, &handle_)); }

    /** clspDepthEnqueueDetect(). */
    void enqueue_detect(cl_command_queue queue, const ClspImage &image, const std::vector<cl_event> &wait_list = {},
                        Event *event = nullptr) const {
        detail::enqueue(wait_list, event, clspDepthEnqueueDetect, handle_, queue, &image);
    }
    /** Of the last frame; blocks. */
    DepthResult dots(cl_command_queue queue) const {
        DepthResult result;
        std::uint64_t count = 0;
        check(clspDepthGetDots(handle_, queue, 0, nullptr, &count, nullptr));
        result.dots.resize(count);
        result.summary.struct_size = sizeof(result.summary);
        check(
            clspDepthGetDots(handle_, queue, count, count > 0 ? result.dots.data() : nullptr, &count, &result.summary));
        return result;
    }
    /** What became of each dot of the pattern; after dots(). */
    std::vector<ClspDepthPatternDot> pattern_dots() const {
        std::uint64_t count = 0;
        check(clspDepthGetPatternDots(handle_, 0, nullptr, &count));
        std::vector<ClspDepthPatternDot> dots(count);
        check(clspDepthGetPatternDots(handle_, count, count > 0 ? dots.data() : nullptr, &count));
        return dots;
    }
    /** A reason in words. */
    static std::string reason(std::uint32_t number) { return clspDepthReasonString(number); }
    /** One bit of the warnings in words. */
    static std::string warning(std::uint32_t bit) { return clspDepthWarningString(bit); }
};

/** The surface's random field, see phase.h. */
class Phase : public detail::Shared<Phase, ClspPhase, clspPhaseRetain, clspPhaseRelease> {
  public:
    Phase() noexcept = default;
    /** clspPhaseCreate(). */
    Phase(const Context &context, const ClspPhaseDesc &desc) {
        clspeckle::check(clspPhaseCreate(context, &desc, &handle_));
    }

    /** Draws new values where `mask` is not 0, everywhere without one. */
    void enqueue_refresh(cl_command_queue queue, std::uint64_t frame_index, const ClspImage *mask = nullptr,
                         const std::vector<cl_event> &wait_list = {}, Event *event = nullptr) const {
        detail::enqueue(wait_list, event, clspPhaseEnqueueRefresh, handle_, queue, frame_index, mask);
    }
    /** Carries the field on along the path, the time and the shift of its surface. */
    void enqueue_advance(cl_command_queue queue, std::uint64_t frame_index, const ClspPhaseAdvance &advance,
                         const std::vector<cl_event> &wait_list = {}, Event *event = nullptr) const {
        detail::enqueue(wait_list, event, clspPhaseEnqueueAdvance, handle_, queue, frame_index, &advance);
    }
    /** Waits, and throws CLSP_ERROR_INVALID_DATA if advances since the last check held bad pixels. */
    void check(cl_command_queue queue) const { clspeckle::check(clspPhaseCheck(handle_, queue)); }
    /** clspPhaseEnqueueField(). */
    void enqueue_field(cl_command_queue queue, std::uint32_t polarization, const ClspImage &field,
                       const std::vector<cl_event> &wait_list = {}, Event *event = nullptr) const {
        detail::enqueue(wait_list, event, clspPhaseEnqueueField, handle_, queue, polarization, &field);
    }
    /** clspPhaseGetStateSize(). */
    std::uint64_t state_size() const {
        std::uint64_t size_bytes = 0;
        clspeckle::check(clspPhaseGetStateSize(handle_, &size_bytes));
        return size_bytes;
    }
    /** clspPhaseEnqueueSave(). */
    void enqueue_save(cl_command_queue queue, cl_mem mem, std::uint64_t offset_bytes = 0,
                      const std::vector<cl_event> &wait_list = {}, Event *event = nullptr) const {
        detail::enqueue(wait_list, event, clspPhaseEnqueueSave, handle_, queue, mem, offset_bytes);
    }
    /** clspPhaseEnqueueRestore(). */
    void enqueue_restore(cl_command_queue queue, cl_mem mem, std::uint64_t offset_bytes = 0,
                         const std::vector<cl_event> &wait_list = {}, Event *event = nullptr) const {
        detail::enqueue(wait_list, event, clspPhaseEnqueueRestore, handle_, queue, mem, offset_bytes);
    }
};

/** What surfaces are made of, see material.h. */
class MaterialTable
    : public detail::Shared<MaterialTable, ClspMaterialTable, clspMaterialTableRetain, clspMaterialTableRelease> {
  public:
    MaterialTable() noexcept = default;
    /** @param materials entry i is material id i; make<ClspMaterial>() gives the defaults. */
    MaterialTable(const Context &context, const std::vector<ClspMaterial> &materials) {
        check(
            clspMaterialTableCreate(context, materials.data(), static_cast<std::uint32_t>(materials.size()), &handle_));
    }
};

/** How far surfaces have moved since the last frame, see motion.h. */
class Motion : public detail::Shared<Motion, ClspMotion, clspMotionRetain, clspMotionRelease> {
  public:
    Motion() noexcept = default;
    /** clspMotionCreate(). */
    Motion(const Context &context, const ClspMotionDesc &desc) {
        clspeckle::check(clspMotionCreate(context, &desc, &handle_));
    }

    /** clspMotionEnqueueCompute(). */
    void enqueue_compute(cl_command_queue queue, const ClspMotionInput &input, const ClspMotionOutput &output,
                         const std::vector<cl_event> &wait_list = {}, Event *event = nullptr) const {
        detail::enqueue(wait_list, event, clspMotionEnqueueCompute, handle_, queue, &input, &output);
    }
    /** Waits, and throws CLSP_ERROR_INVALID_DATA if calls since the last check held bad pixels. */
    void check(cl_command_queue queue) const { clspeckle::check(clspMotionCheck(handle_, queue)); }
};

/** The lens's aperture, see aperture.h. */
class Aperture : public detail::Shared<Aperture, ClspAperture, clspApertureRetain, clspApertureRelease> {
  public:
    Aperture() noexcept = default;
    /** clspApertureCreate(). */
    Aperture(const Context &context, const ClspApertureDesc &desc) {
        check(clspApertureCreate(context, &desc, &handle_));
    }

    /** clspApertureGetInfo(). */
    ClspApertureInfo info() const {
        auto result = make<ClspApertureInfo>();
        check(clspApertureGetInfo(handle_, &result));
        return result;
    }
    /** Gives work memory; the library retains it. */
    void set_workspace(cl_mem mem, std::uint64_t offset_bytes, std::uint64_t size_bytes) const {
        check(clspApertureSetWorkspace(handle_, mem, offset_bytes, size_bytes));
    }
    /** clspApertureEnqueuePupil(). */
    void enqueue_pupil(cl_command_queue queue, const ClspImage &pupil, const std::vector<cl_event> &wait_list = {},
                       Event *event = nullptr) const {
        detail::enqueue(wait_list, event, clspApertureEnqueuePupil, handle_, queue, &pupil);
    }
    /** clspApertureEnqueueIntensity(). */
    void enqueue_intensity(cl_command_queue queue, const Phase &phase, const ClspImage &irradiance,
                           const ClspImage &intensity, const std::vector<cl_event> &wait_list = {},
                           Event *event = nullptr) const {
        detail::enqueue(wait_list, event, clspApertureEnqueueIntensity, handle_, queue, phase, &irradiance, &intensity);
    }
};

/** What a lens does beside diffraction, see lens.h. */
class Lens : public detail::Shared<Lens, ClspLens, clspLensRetain, clspLensRelease> {
  public:
    Lens() noexcept = default;
    /** clspLensCreate(). */
    Lens(const Context &context, const ClspLensDesc &desc) { check(clspLensCreate(context, &desc, &handle_)); }

    /** clspLensConfigure(). */
    void configure(const ClspLensDesc &desc) const { check(clspLensConfigure(handle_, &desc)); }
    /** @param interpolation CLSP_INTERPOLATION_*. */
    void enqueue_distort(cl_command_queue queue, std::uint32_t interpolation, const ClspImage &ideal,
                         const ClspImage &distorted, const std::vector<cl_event> &wait_list = {},
                         Event *event = nullptr) const {
        detail::enqueue(wait_list, event, clspLensEnqueueDistort, handle_, queue, interpolation, &ideal, &distorted);
    }
    /** clspLensEnqueueFinish(). */
    void enqueue_finish(cl_command_queue queue, const ClspImage &light, bool is_dark, const ClspImage &output,
                        const std::vector<cl_event> &wait_list = {}, Event *event = nullptr) const {
        detail::enqueue(wait_list, event, clspLensEnqueueFinish, handle_, queue, &light, is_dark ? 1u : 0u, &output);
    }
    /** @param ideal_px x, y, x, y... @return likewise, (NaN, NaN) for points that the lens does not image. */
    std::vector<double> distort_points(const std::vector<double> &ideal_px) const {
        std::vector<double> result(ideal_px.size() / 2 * 2);
        check(clspLensDistortPoints(handle_, ideal_px.data(), result.size() / 2, result.data()));
        return result;
    }
    /** @param distorted_px x, y, x, y... @return likewise, (NaN, NaN) where nothing is imaged. */
    std::vector<double> undistort_points(const std::vector<double> &distorted_px) const {
        std::vector<double> result(distorted_px.size() / 2 * 2);
        check(clspLensUndistortPoints(handle_, distorted_px.data(), result.size() / 2, result.data()));
        return result;
    }
};

/** From intensity to codes, see sensor.h. */
class Sensor : public detail::Shared<Sensor, ClspSensor, clspSensorRetain, clspSensorRelease> {
  public:
    Sensor() noexcept = default;
    /** clspSensorCreate(). */
    Sensor(const Context &context, const ClspSensorDesc &desc) { check(clspSensorCreate(context, &desc, &handle_)); }

    /** The settings of a known camera. */
    static ClspSensorDesc profile(const std::string &name) {
        ClspSensorDesc desc{};
        check(clspSensorDescFromProfile(&desc, sizeof(desc), name.c_str()));
        return desc;
    }
    /** ClspSensorDesc::mosaic_gain of a colour filter. @param bayer one of CLSP_BAYER_*. */
    static std::array<double, 4> mosaic_gain(std::uint32_t bayer, double red, double green, double blue) {
        std::array<double, 4> gains{};
        check(clspSensorMosaicFromBayer(bayer, red, green, blue, gains.data()));
        return gains;
    }
    /** What captures in the dark tell of a camera. */
    struct DarkFrame {
        std::vector<float> dark_frame_dn; /**< height x width, for ClspSensorDesc::dark_frame_dn. */
        double temporal_noise_dn = 0.0;   /**< For ClspSensorDesc::read_noise_dn; 0 for a single frame. */
    };
    /** @param frames frame after frame, tightly packed. */
    static DarkFrame dark_frame_from_captures(const std::vector<std::uint16_t> &frames, std::uint32_t width,
                                              std::uint32_t height, double black_level_dn) {
        const std::size_t pixels = std::size_t{width} * height;
        const std::size_t count = pixels == 0 ? 0 : frames.size() / pixels;
        if (count == 0 || count * pixels != frames.size())
            throw std::invalid_argument("frames must hold one or more whole frames of width x height codes");
        DarkFrame result;
        result.dark_frame_dn.resize(pixels);
        check(clspSensorDarkFrameFromCaptures(frames.data(), static_cast<std::uint32_t>(count), width, height, 0, 0,
                                              black_level_dn, result.dark_frame_dn.data(),
                                              count > 1 ? &result.temporal_noise_dn : nullptr));
        return result;
    }

    /** clspSensorSetExposureGain(). */
    void set_exposure_gain(double exposure_gain_dn) const {
        check(clspSensorSetExposureGain(handle_, exposure_gain_dn));
    }
    /** Replaces all settings by those of another description of the same size. */
    void configure(const ClspSensorDesc &desc) const { check(clspSensorConfigure(handle_, &desc)); }
    /** clspSensorResetLag(). */
    void reset_lag() const { check(clspSensorResetLag(handle_)); }
    /** clspSensorEnqueueExpose(). */
    void enqueue_expose(cl_command_queue queue, const ClspImage &intensity, std::uint64_t frame_index,
                        const ClspImage &output, const std::vector<cl_event> &wait_list = {},
                        Event *event = nullptr) const {
        detail::enqueue(wait_list, event, clspSensorEnqueueExpose, handle_, queue, &intensity, frame_index, &output);
    }
    /** clspSensorEnqueueDemosaic(). */
    void enqueue_demosaic(cl_command_queue queue, const ClspImage &raw, std::uint32_t bayer, const ClspImage &rgb,
                          const std::vector<cl_event> &wait_list = {}, Event *event = nullptr) const {
        detail::enqueue(wait_list, event, clspSensorEnqueueDemosaic, handle_, queue, &raw, bayer, &rgb);
    }
};

/** The catalogue of effects, in the order in which light meets them; see effects.h. May be called from any thread. */
inline std::vector<ClspEffectInfo> effects() {
    std::uint32_t count = 0;
    check(clspEffectGetCount(&count));
    std::vector<ClspEffectInfo> result(count);
    for (std::uint32_t i = 0; i < count; ++i)
        check(clspEffectGetInfo(i, &result[i]));
    return result;
}

/** clspEffectGetScenes(): where an effect acts; bits 1 << CLSP_SCENE_*. */
inline std::uint32_t effect_scenes(const std::string &id) {
    std::uint32_t acts = 0;
    check(clspEffectGetScenes(id.c_str(), &acts, nullptr));
    return acts;
}

/** clspEffectChangeTraits(). */
inline void change_traits(ClspCameraTraits &traits, const std::string &id, const std::vector<double> &values) {
    check(clspEffectChangeTraits(id.c_str(), values.data(), static_cast<std::uint32_t>(values.size()), &traits));
}

namespace detail {

/** Entries of a list that a handle gives out one by one. */
template <typename Handle, typename Struct>
std::vector<Struct> list_of(ClspStatus (*get)(Handle, std::uint32_t, Struct *), Handle handle, std::uint32_t count) {
    std::vector<Struct> result(count);
    for (std::uint32_t i = 0; i < count; ++i) {
        init(result[i]);
        check(get(handle, i, &result[i]));
    }
    return result;
}

} // namespace detail

/** A camera as a diagnosis found it, see profile.h; made by Diagnosis::profile() or open(). May be used by any number
 * of threads at once. */
class Profile : public detail::Shared<Profile, ClspProfile, clspProfileRetain, clspProfileRelease> {
  public:
    Profile() noexcept = default;
    /** Reads a file that write() wrote. */
    static Profile open(const std::string &path) {
        ClspProfile handle = nullptr;
        check(clspProfileOpen(path.c_str(), &handle));
        return adopt(handle);
    }

    /** clspProfileGetInfo(). */
    ClspProfileInfo info() const {
        auto result = make<ClspProfileInfo>();
        check(clspProfileGetInfo(handle_, &result));
        return result;
    }
    /** Of the catalogue, in the order in which they were found. */
    std::vector<ClspProfileEffect> effects() const {
        return detail::list_of(clspProfileGetEffect, handle_, info().effect_count);
    }
    /** The light of the capture's sequences. */
    std::vector<ClspProfileSequence> sequences() const {
        return detail::list_of(clspProfileGetSequence, handle_, info().sequence_count);
    }
    /** clspProfileGetJson(). */
    std::string json() const { return detail::text_of(clspProfileGetJson, handle_); }
    /** The profile, and its maps beside it. */
    void write(const std::string &path) const { check(clspProfileWrite(handle_, path.c_str())); }
    /** What is known of a map that the profile has. @param map CLSP_PROFILE_MAP_DARK or CLSP_PROFILE_MAP_GAIN. */
    ClspProfileMap map(std::uint32_t map) const {
        auto result = make<ClspProfileMap>();
        check(clspProfileGetMap(handle_, map, &result, nullptr));
        return result;
    }
    /** Its values, height x width. */
    std::vector<float> map_values(std::uint32_t map) const {
        const ClspProfileInfo camera = info();
        std::vector<float> result(std::size_t{camera.width} * camera.height);
        check(clspProfileGetMap(handle_, map, nullptr, result.data()));
        return result;
    }
    /** Writes the camera's settings into descriptions, which keep all else; null: not wanted.
     *  @param sequence whose gain, exposure time and f-number are written, too; empty: the gain stays. */
    void describe(ClspPhaseDesc *phase, ClspApertureDesc *aperture, ClspLensDesc *lens, ClspSensorDesc *sensor,
                  const std::string &sequence = {}) const {
        check(
            clspProfileDescribe(handle_, sequence.empty() ? nullptr : sequence.c_str(), phase, aperture, lens, sensor));
    }
};

/** A whole frame as one command, see pipeline.h. */
class Pipeline : public detail::Shared<Pipeline, ClspPipeline, clspPipelineRetain, clspPipelineRelease> {
  public:
    Pipeline() noexcept = default;
    /** clspPipelineCreate(). */
    Pipeline(const Context &context, const ClspPipelineDesc &desc) {
        clspeckle::check(clspPipelineCreate(context, &desc, &handle_));
    }
    /** Frames bring an ideal image. An empty sensor gives the FLOAT32 intensity. */
    Pipeline(const Context &context, const Phase &phase, const Aperture &aperture, const Sensor &sensor = {})
        : Pipeline(context, Pattern(), phase, aperture, sensor) {}
    /** Frames bring the geometry. */
    Pipeline(const Context &context, const Pattern &pattern, const Phase &phase, const Aperture &aperture,
             const Sensor &sensor = {}) {
        auto desc = make<ClspPipelineDesc>();
        desc.pattern = pattern;
        desc.phase = phase;
        desc.aperture = aperture;
        desc.sensor = sensor;
        clspeckle::check(clspPipelineCreate(context, &desc, &handle_));
    }

    /** clspPipelineEnqueueFrame(). */
    void enqueue_frame(cl_command_queue queue, const ClspFrame &frame, const std::vector<cl_event> &wait_list = {},
                       Event *event = nullptr) const {
        detail::enqueue(wait_list, event, clspPipelineEnqueueFrame, handle_, queue, &frame);
    }
    /** Renders frames one after the other; if one of them is refused, none is enqueued. */
    void enqueue_frames(cl_command_queue queue, const std::vector<ClspFrame> &frames,
                        const std::vector<cl_event> &wait_list = {}, Event *event = nullptr) const {
        detail::enqueue(wait_list, event, clspPipelineEnqueueFrames, handle_, queue,
                        static_cast<std::uint32_t>(frames.size()), frames.data());
    }
    /** Renders a frame like the ones to come and waits: programs and FFT plans are warm after it. Writes the frame's
     *  output; leaves the phase state as it was. */
    void warm_up(cl_command_queue queue, const ClspFrame &frame) const {
        clspeckle::check(clspPipelineWarmUp(handle_, queue, &frame));
    }
    /** Switches an effect on, or changes its parameters; later frames have it. Not for the per-frame path.
     *  @param values its parameters in order; those left out take the middle between weak and strong. */
    void set_effect(const std::string &id, const std::vector<double> &values = {}) const {
        clspeckle::check(clspPipelineSetEffect(handle_, id.c_str(), values.empty() ? nullptr : values.data(),
                                               static_cast<std::uint32_t>(values.size())));
    }
    /** Several set_effect() in one, each stage made anew once; after an error none is on that was not.
     *  @param effects values by id. */
    void set_effects(const std::map<std::string, std::vector<double>> &effects) const {
        std::vector<ClspEffectSetting> settings;
        for (const auto &[id, values] : effects)
            settings.push_back({id.c_str(), values.empty() ? nullptr : values.data(),
                                static_cast<std::uint32_t>(values.size()), 0});
        clspeckle::check(
            clspPipelineSetEffects(handle_, static_cast<std::uint32_t>(settings.size()), settings.data()));
    }
    /** Switches a profile's effects on, and gives the sensor its maps; not for the per-frame path. */
    void set_profile(const Profile &profile) const { clspeckle::check(clspPipelineSetProfile(handle_, profile)); }
    /** @param maps CLSP_PROFILE_MAP_*, added up: which maps; 0: all fixed patterns are drawn anew. */
    void set_profile(const Profile &profile, std::uint32_t maps) const {
        clspeckle::check(clspPipelineSetProfileMaps(handle_, profile, maps));
    }
    /** Switches an effect off; one that is off stays off. */
    void clear_effect(const std::string &id) const { clspeckle::check(clspPipelineClearEffect(handle_, id.c_str())); }
    /** Switches all effects off. */
    void clear_effects() const { clspeckle::check(clspPipelineClearEffect(handle_, nullptr)); }
    /** Waits, and throws CLSP_ERROR_INVALID_DATA if frames since the last check held bad pixels. */
    void check(cl_command_queue queue) const { clspeckle::check(clspPipelineCheck(handle_, queue)); }
    /** Device time per stage of the last frame; the queue needs CLSP_QUEUE_PROFILING. */
    std::vector<ClspStageTiming> timings() const {
        std::uint32_t count = 0;
        clspeckle::check(clspPipelineGetTimings(handle_, 0, nullptr, &count));
        std::vector<ClspStageTiming> result(count);
        if (count > 0)
            clspeckle::check(clspPipelineGetTimings(handle_, count, result.data(), &count));
        return result;
    }
};

/**
 * One frame from host memory to host memory, see clspSimulate(): `simulate(ideal, 640, 480, 7)`. Blocks. May be called
 * from any number of threads at once.
 * @param irradiance height x width values, finite, >= 0.
 * @param aperture,sensor null: the defaults; their width and height may stay 0.
 * @param context empty: the best device, for this call.
 * @return height x width codes.
 */
inline std::vector<std::uint16_t> simulate(const std::vector<float> &irradiance, std::uint32_t width,
                                           std::uint32_t height, std::uint64_t seed = 0, std::uint64_t frame_index = 0,
                                           const ClspApertureDesc *aperture = nullptr,
                                           const ClspSensorDesc *sensor = nullptr, ClspContext context = nullptr) {
    if (irradiance.size() != std::size_t{width} * height)
        throw std::invalid_argument("irradiance has " + std::to_string(irradiance.size()) + " values, expected " +
                                    std::to_string(width) + " x " + std::to_string(height));
    std::vector<std::uint16_t> codes(irradiance.size());
    check(clspSimulate(context, width, height, irradiance.data(), aperture, sensor, seed, frame_index, codes.data()));
    return codes;
}

/** What a real camera recorded, see capture.h. */
class Capture : public detail::Shared<Capture, ClspCapture, clspCaptureRetain, clspCaptureRelease> {
  public:
    Capture() noexcept = default;
    /** Without sequences yet. */
    explicit Capture(const ClspCaptureDesc &desc) { check(clspCaptureCreate(&desc, &handle_)); }
    /** Reads the set in a folder. */
    static Capture open(const std::string &path, const Progress &progress = {}) {
        Capture capture;
        std::exception_ptr thrown;
        detail::Carried<Progress> carried{&progress, &thrown};
        const ClspStatus status = progress
                                      ? clspCaptureOpenWithProgress(path.c_str(), detail::clspeckle_detail_progress,
                                                                    &carried, &capture.handle_)
                                      : clspCaptureOpen(path.c_str(), &capture.handle_);
        if (thrown && status != CLSP_SUCCESS)
            std::rethrow_exception(thrown);
        check(status);
        return capture;
    }

    /** clspCaptureAddSequence(). */
    void add_sequence(const ClspCaptureSequence &sequence) const { check(clspCaptureAddSequence(handle_, &sequence)); }
    /** @param scene CLSP_SCENE_*. @param codes whole frames of height x width. */
    void add_sequence(const std::string &name, std::uint32_t scene, bool moving,
                      const std::vector<std::uint16_t> &codes, double exposure_ms = 0.0, double f_number = 0.0) const {
        const ClspCaptureDesc camera = desc();
        const std::size_t pixels = std::size_t{camera.width} * camera.height;
        if (codes.empty() || codes.size() % pixels != 0)
            throw std::invalid_argument("codes must hold one or more whole frames of width x height codes");
        auto sequence = make<ClspCaptureSequence>();
        sequence.name = name.c_str();
        sequence.scene = scene;
        sequence.moving = moving ? 1 : 0;
        sequence.frame_count = static_cast<std::uint32_t>(codes.size() / pixels);
        sequence.codes = codes.data();
        sequence.exposure_ms = exposure_ms;
        sequence.f_number = f_number;
        add_sequence(sequence);
    }
    /** @param positions_px x, y, x, y...; empty: no dots. */
    void set_dots(double sigma_px, const std::vector<double> &positions_px) const {
        check(clspCaptureSetDots(handle_, sigma_px, positions_px.size() / 2,
                                 positions_px.empty() ? nullptr : positions_px.data()));
    }
    /** clspCaptureValidate(). */
    void validate() const { check(clspCaptureValidate(handle_)); }
    /** clspCaptureWrite(). */
    void write(const std::string &path, bool overwrite = false) const {
        check(clspCaptureWrite(handle_, path.c_str(), overwrite ? 1u : 0u));
    }
    /** clspCaptureGetDesc(). */
    ClspCaptureDesc desc() const {
        auto result = make<ClspCaptureDesc>();
        check(clspCaptureGetDesc(handle_, &result));
        return result;
    }
    /** x, y, x, y... @param sigma_px their width. */
    std::vector<double> dots(double *sigma_px = nullptr) const {
        std::uint64_t count = 0;
        check(clspCaptureGetDots(handle_, sigma_px, 0, nullptr, &count));
        std::vector<double> result(static_cast<std::size_t>(2 * count));
        check(clspCaptureGetDots(handle_, nullptr, count, result.empty() ? nullptr : result.data(), nullptr));
        return result;
    }
    /** clspCaptureGetSequenceCount(). */
    std::uint32_t sequence_count() const {
        std::uint32_t count = 0;
        check(clspCaptureGetSequenceCount(handle_, &count));
        return count;
    }
    /** clspCaptureGetSequence(). */
    ClspCaptureSequenceInfo sequence(std::uint32_t index) const {
        auto result = make<ClspCaptureSequenceInfo>();
        check(clspCaptureGetSequence(handle_, index, &result));
        return result;
    }
    /** frame_count x height x width. */
    std::vector<std::uint16_t> codes(std::uint32_t index) const {
        const ClspCaptureDesc camera = desc();
        std::vector<std::uint16_t> result(std::size_t{sequence(index).frame_count} * camera.width * camera.height);
        check(clspCaptureGetCodes(handle_, index, result.size(), result.data()));
        return result;
    }
    /** height x width. */
    std::vector<std::uint8_t> mask(std::uint32_t index) const {
        const ClspCaptureDesc camera = desc();
        std::vector<std::uint8_t> result(std::size_t{camera.width} * camera.height);
        check(clspCaptureGetMask(handle_, index, result.size(), result.data()));
        return result;
    }
    /** What is in it and what it can tell apart, as JSON. */
    std::string summary_json() const { return detail::text_of(clspCaptureGetSummaryJson, handle_); }
    /** EMVA 1288's numbers as JSON, and as XML with the element names of the Python package emva1288. */
    std::string emva1288_json() const { return detail::text_of(clspCaptureGetEmva1288Json, handle_); }
    /** clspCaptureGetEmva1288Xml(). */
    std::string emva1288_xml() const { return detail::text_of(clspCaptureGetEmva1288Xml, handle_); }
};

/** What a diagnosis found, see diagnosis.h; made by diagnose(). May be read from any number of threads at once. */
class Diagnosis : public detail::Shared<Diagnosis, ClspDiagnosis, clspDiagnosisRetain, clspDiagnosisRelease> {
  public:
    Diagnosis() noexcept = default;

    /** clspDiagnosisGetSummary(). */
    ClspDiagnosisSummary summary() const {
        auto result = make<ClspDiagnosisSummary>();
        check(clspDiagnosisGetSummary(handle_, &result));
        return result;
    }
    /** Ids of the effects found, in the order in which they were found. */
    std::vector<std::string> effects() const { return texts<clspDiagnosisGetEffect>(summary().effect_count); }
    /** Ids of effects that explain the gap equally well. */
    std::vector<std::string> equivalents() const {
        return texts<clspDiagnosisGetEquivalent>(summary().equivalent_count);
    }
    /** What could not be judged, and why. */
    std::vector<std::string> notes() const { return texts<clspDiagnosisGetNote>(summary().note_count); }
    /** Best first; behind them the effects found later. */
    std::vector<ClspDiagnosisRanked> ranking() const {
        return detail::list_of(clspDiagnosisGetRanked, handle_, summary().ranked_count);
    }
    /** Fitted parameters of the effects found. */
    std::vector<ClspDiagnosisParameter> parameters() const {
        return detail::list_of(clspDiagnosisGetParameter, handle_, summary().parameter_count);
    }
    /** All statistics, worst first. */
    std::vector<ClspDiagnosisPlace> places() const {
        return detail::list_of(clspDiagnosisGetPlace, handle_, summary().place_count);
    }
    /** The waterfall. */
    std::vector<ClspDiagnosisStep> steps() const {
        return detail::list_of(clspDiagnosisGetStep, handle_, summary().step_count);
    }
    /** clspDiagnosisGetReportJson(). */
    std::string report_json() const { return detail::text_of(clspDiagnosisGetReportJson, handle_); }
    /** Writes the JSON report. */
    void write_report(const std::string &path) const { check(clspDiagnosisWriteReport(handle_, path.c_str())); }
    /** Writes the report for eyes, one HTML file. */
    void write_html(const std::string &path) const { check(clspDiagnosisWriteHtml(handle_, path.c_str())); }
    /** The camera that was found, with the effects of the last model; not of a comparison. */
    Profile profile() const {
        ClspProfile handle = nullptr;
        check(clspDiagnosisGetProfile(handle_, &handle));
        return Profile::adopt(handle);
    }

  private:
    template <ClspStatus (*Get)(ClspDiagnosis, std::uint32_t, std::uint64_t, char *, std::uint64_t *)>
    std::vector<std::string> texts(std::uint32_t count) const {
        std::vector<std::string> result(count);
        for (std::uint32_t i = 0; i < count; ++i)
            result[i] = detail::text_of(Get, handle_, i);
        return result;
    }
};

/** A parameter of a hypothesis, from weak to strong within minimum and maximum. */
struct HypothesisParameter {
    std::string name;       /**< At most 31 bytes. */
    std::string unit = "1"; /**< At most 15 bytes. */
    double minimum = 0.0; /**< The least that is accepted. */
    double maximum = 1.0; /**< The greatest that is accepted. */
    double weak = 0.0;    /**< As cameras barely show it. */
    double strong = 1.0;  /**< As cameras show it strongly. */
};

/** An effect of the caller's own, see ClspHypothesis. */
struct Hypothesis {
    std::string id;      /**< See ClspHypothesis. */
    std::string stage;   /**< See ClspHypothesis. */
    std::string summary; /**< See ClspHypothesis. */
    std::uint32_t point = CLSP_HYPOTHESIS_INTENSITY; /**< CLSP_HYPOTHESIS_*. */
    /** At least one. */
    std::vector<HypothesisParameter> parameters;
    /** Changes frame.pixels in place, on the thread of diagnose(). What it throws leaves diagnose(). */
    std::function<void(const ClspHypothesisFrame &frame)> apply;
    /** Instead of `apply`: OpenCL source with a function of a pixel, see ClspHypothesis. Empty: none. */
    std::string opencl_source{};
};

/** What diagnose() is asked for; see ClspDiagnoseDesc for ranges. */
struct DiagnoseOptions {
    /** See ClspDiagnoseDesc, as for all members. */
    std::uint64_t seed = 0;
    /** Simulated captures without effects. */
    std::uint32_t null_replicates = make<ClspDiagnoseDesc>().null_replicates;
    /** In one explanation at most. */
    std::uint32_t max_effects = make<ClspDiagnoseDesc>().max_effects;
    /** Of the host; 0: as many as the machine has. */
    std::uint32_t threads = 0;
    /** Probability of seeing a gap where there is none. */
    double level = make<ClspDiagnoseDesc>().level;
    bool evidence = true;     /**< Pictures and curves for Diagnosis::write_html() are collected. */
    bool whole_image = false; /**< The whole image is judged, however large. */
    /** x, y, width, height of what is judged; without whole_image. */
    std::optional<std::array<std::uint32_t, 4>> window;
    std::optional<std::uint32_t> frames; /**< Of each sequence at most; 0: all. */
    std::string tolerance_file; /**< What is accepted of the simulator's error, as JSON; empty: none. */
    /** Ids of effects that are no candidates. */
    std::vector<std::string> without;
    /** Effects of the caller's own. */
    std::vector<Hypothesis> hypotheses;
    Profile profile; /**< Of compare(): the camera that both sets are of; none: one without effects. */
    /** May be empty. */
    Progress progress;
};

namespace detail {

extern "C" inline std::int32_t clspeckle_detail_apply(void *data, const ClspHypothesisFrame *frame) {
    const auto *carried = static_cast<const Carried<std::function<void(const ClspHypothesisFrame &)>> *>(data);
    try {
        (*carried->function)(*frame);
        return 0;
    } catch (...) {
        *carried->thrown = std::current_exception();
        return 1;
    }
}

template <std::size_t Size> void copy_text(char (&to)[Size], const std::string &from) {
    if (from.size() >= Size)
        throw std::invalid_argument("\"" + from + "\" is longer than the " + std::to_string(Size - 1) +
                                    " bytes that there are");
    std::memcpy(to, from.c_str(), from.size() + 1);
}

/** A hypothesis without its function, as the C interface takes it; `from` and `parameters` must outlive it. */
inline ClspHypothesis described(const Hypothesis &from, std::vector<ClspEffectParameter> &parameters) {
    for (const HypothesisParameter &p : from.parameters) {
        ClspEffectParameter parameter{};
        copy_text(parameter.name, p.name);
        copy_text(parameter.unit, p.unit);
        parameter.minimum = p.minimum;
        parameter.maximum = p.maximum;
        parameter.weak = p.weak;
        parameter.strong = p.strong;
        parameters.push_back(parameter);
    }
    ClspHypothesis to{};
    init(to);
    to.point = from.point;
    to.id = from.id.c_str();
    to.stage = from.stage.c_str();
    to.summary = from.summary.c_str();
    to.parameters = parameters.data();
    to.parameter_count = static_cast<std::uint32_t>(parameters.size());
    to.opencl_source = from.opencl_source.empty() ? nullptr : from.opencl_source.c_str();
    return to;
}

/** Calls call(desc, handle) with the options as the C interface takes them. */
template <typename Call> Diagnosis diagnose_with(const DiagnoseOptions &options, Call call) {
    std::exception_ptr thrown;
    const std::size_t count = options.hypotheses.size();
    std::vector<ClspHypothesis> hypotheses(count);
    std::vector<const ClspHypothesis *> pointers;
    std::vector<std::vector<ClspEffectParameter>> parameters(count);
    std::vector<detail::Carried<std::function<void(const ClspHypothesisFrame &)>>> functions(count);
    for (std::size_t i = 0; i < count; ++i) {
        const Hypothesis &from = options.hypotheses[i];
        ClspHypothesis &to = hypotheses[i];
        to = detail::described(from, parameters[i]);
        functions[i] = {&from.apply, &thrown};
        to.apply = from.apply ? detail::clspeckle_detail_apply : nullptr;
        to.user_data = &functions[i];
        pointers.push_back(&to);
    }
    std::vector<const char *> without;
    for (const std::string &id : options.without)
        without.push_back(id.c_str());
    detail::Carried<Progress> progress{&options.progress, &thrown};
    auto desc = make<ClspDiagnoseDesc>();
    desc.seed = options.seed;
    desc.null_replicates = options.null_replicates;
    desc.max_effects = options.max_effects;
    desc.threads = options.threads;
    desc.level = options.level;
    desc.evidence = options.evidence ? 1 : 0;
    desc.profile = options.profile;
    desc.window = options.whole_image ? CLSP_WINDOW_WHOLE : CLSP_WINDOW_AUTO;
    if (options.window) {
        desc.window = CLSP_WINDOW_GIVEN;
        desc.window_x = (*options.window)[0];
        desc.window_y = (*options.window)[1];
        desc.window_width = (*options.window)[2];
        desc.window_height = (*options.window)[3];
    }
    desc.frames = options.frames.value_or(CLSP_FRAMES_AUTO);
    desc.tolerance_file = options.tolerance_file.empty() ? nullptr : options.tolerance_file.c_str();
    desc.without = without.data();
    desc.without_count = static_cast<std::uint32_t>(without.size());
    desc.hypotheses = pointers.data();
    desc.hypothesis_count = static_cast<std::uint32_t>(count);
    if (options.progress) {
        desc.progress = detail::clspeckle_detail_progress;
        desc.progress_data = &progress;
    }
    ClspDiagnosis handle = nullptr;
    const ClspStatus status = call(&desc, &handle);
    if (thrown && status != CLSP_SUCCESS)
        std::rethrow_exception(thrown);
    check(status);
    return Diagnosis::adopt(handle);
}

} // namespace detail

/** Switches an effect of the caller's own, which has OpenCL source, on in a pipeline; Pipeline::clear_effect() takes
 *  its id. Not for the per-frame path. @param values its parameters in order; those left out take the middle between
 *  weak and strong. */
inline void set_effect(const Pipeline &pipeline, const Hypothesis &hypothesis, const std::vector<double> &values = {}) {
    std::vector<ClspEffectParameter> parameters;
    ClspHypothesis described = detail::described(hypothesis, parameters);
    if (hypothesis.apply) // refused in words
        described.apply = [](void *, const ClspHypothesisFrame *) -> std::int32_t { return 1; };
    check(clspPipelineSetHypothesis(pipeline, &described, values.empty() ? nullptr : values.data(),
                                    static_cast<std::uint32_t>(values.size())));
}

/** clspDiagnose(). Blocks; may be called from any thread. */
inline Diagnosis diagnose(const Context &context, const Capture &capture, const DiagnoseOptions &options = {}) {
    return detail::diagnose_with(options, [&](const ClspDiagnoseDesc *desc, ClspDiagnosis *diagnosis) {
        return clspDiagnose(context, capture, desc, diagnosis);
    });
}

/** clspCompare(): `real` against frames of any simulator. Takes no hypotheses. Blocks; may be called from any thread.
 */
inline Diagnosis compare(const Context &context, const Capture &real, const Capture &sim,
                         const DiagnoseOptions &options = {}) {
    return detail::diagnose_with(options, [&](const ClspDiagnoseDesc *desc, ClspDiagnosis *diagnosis) {
        return clspCompare(context, real, sim, desc, diagnosis);
    });
}

/** Phase of a diffractive beam splitter, see doe_design.h. May be read from any number of threads at once. */
class DoeDesign : public detail::Shared<DoeDesign, ClspDoeDesign, clspDoeDesignRetain, clspDoeDesignRelease> {
  public:
    DoeDesign() noexcept = default;
    /** Designs; blocks. `progress` takes the place of desc.progress if it is not empty. */
    DoeDesign(const Context &context, const ClspDoeDesignDesc &desc, const Progress &progress = {}) {
        detail::call_with_progress(
            desc, progress, [&](const ClspDoeDesignDesc *d) { return clspDoeDesignCreate(context, d, &handle_); });
    }
    /** The report of a phase that exists already: desc.height x desc.width radians. */
    static DoeDesign evaluate(const Context &context, const ClspDoeDesignDesc &desc, const std::vector<float> &phase) {
        if (phase.size() != std::size_t{desc.width} * desc.height)
            throw std::invalid_argument("phase has " + std::to_string(phase.size()) + " pixels, the cell has " +
                                        std::to_string(desc.width) + " x " + std::to_string(desc.height));
        ClspDoeDesign handle = nullptr;
        check(clspDoeDesignEvaluate(context, &desc, phase.data(), 0, &handle));
        return adopt(handle);
    }

    /** clspDoeDesignGetReport(). */
    ClspDoeDesignReport report() const {
        auto result = make<ClspDoeDesignReport>();
        check(clspDoeDesignGetReport(handle_, &result));
        return result;
    }
    /** Row by row, in radians. @param pixels width x height of the cell. */
    std::vector<float> phase(std::size_t pixels) const {
        std::vector<float> result(pixels);
        check(clspDoeDesignGetPhase(handle_, result.size(), result.data()));
        return result;
    }
    /** clspDoeDesignGetOrders(). */
    std::vector<ClspDoeDesignOrder> orders() const {
        std::vector<ClspDoeDesignOrder> result(static_cast<std::size_t>(report().order_count));
        check(clspDoeDesignGetOrders(handle_, result.size(), result.data(), nullptr));
        return result;
    }
    /** What power each of orders() gets. */
    std::vector<double> powers() const {
        std::vector<double> result(static_cast<std::size_t>(report().order_count));
        check(clspDoeDesignGetOrders(handle_, result.size(), nullptr, result.data()));
        return result;
    }
    /** One value an iteration. */
    struct History {
        std::vector<double> efficiency;     /**< See clspDoeDesignGetHistory(). */
        std::vector<double> uniformity_rms; /**< See clspDoeDesignGetHistory(). */
    };
    /** After each iteration; the last step is the finished design. */
    History history() const {
        History result;
        result.efficiency.resize(static_cast<std::size_t>(report().step_count));
        result.uniformity_rms.resize(result.efficiency.size());
        check(clspDoeDesignGetHistory(handle_, result.efficiency.size(), result.efficiency.data(),
                                      result.uniformity_rms.data()));
        return result;
    }
    /** Orders nearest to directions. */
    struct Snapped {
        /** One for each direction. */
        std::vector<ClspDoeDesignOrder> orders;
        std::vector<double> errors; /**< In direction cosines. */
    };
    /** The orders that are nearest to directions: u0, v0, u1, v1 ... */
    static Snapped snap(std::uint32_t width, std::uint32_t height, double pixel_pitch_m, double wavelength_m,
                        const std::vector<double> &directions) {
        Snapped result;
        result.orders.resize(directions.size() / 2);
        result.errors.resize(directions.size() / 2);
        check(clspDoeDesignSnapDirections(width, height, pixel_pitch_m, wavelength_m, result.orders.size(),
                                          directions.data(), result.orders.data(), result.errors.data()));
        return result;
    }
};

/** A semi-random layout of dots, see dot_layout.h. */
struct DotLayout {
    std::vector<double> directions;   /**< u0, v0, u1, v1 ... */
    std::vector<std::int32_t> orders; /**< m0, n0, m1, n1 ...; empty without a lattice. */
    /** How far apart and how distinct its dots are. */
    ClspDotLayoutInfo info;
};

/** clspDotLayoutCreate(). May be called from any thread. `progress` takes the place of desc.progress if it is not
 * empty. */
inline DotLayout dot_layout(const ClspDotLayoutDesc &desc, const Progress &progress = {}) {
    DotLayout result{{}, {}, make<ClspDotLayoutInfo>()};
    if (desc.count <= CLSP_MAX_LAYOUT_DOTS) { // else the call says so
        result.directions.resize(static_cast<std::size_t>(2 * desc.count));
        result.orders.resize(desc.lattice ? result.directions.size() : 0);
    }
    double none = 0.0; // an empty vector has no memory, which is not what is wrong then
    detail::call_with_progress(desc, progress, [&](const ClspDotLayoutDesc *d) {
        return clspDotLayoutCreate(d, result.directions.empty() ? &none : result.directions.data(),
                                   result.orders.empty() ? nullptr : result.orders.data(), &result.info);
    });
    return result;
}

/** Which engine is the fastest on a device, see tuning.h. May be read from any number of threads at once. */
class Tuning : public detail::Shared<Tuning, ClspTuning, clspTuningRetain, clspTuningRelease> {
  public:
    Tuning() noexcept = default;
    /** Measures; blocks. `progress` takes the place of desc.progress if it is not empty. */
    Tuning(const Context &context, const ClspTuningDesc &desc, const Progress &progress = {}) {
        detail::call_with_progress(desc, progress,
                                   [&](const ClspTuningDesc *d) { return clspTuningRun(context, d, &handle_); });
    }

    /** What was measured: a tuning record with this run's sizes alone. */
    std::string json() const { return detail::text_of(clspTuningGetJson, handle_); }
    /** The file that was written, "" if none. */
    std::string path() const { return detail::text_of(clspTuningGetPath, handle_); }
    /** The engine that an aperture of this context would have first for an image, and why. */
    static std::string explain(const Context &context, std::uint32_t width, std::uint32_t height) {
        return detail::text_of(clspTuningExplain, context, width, height);
    }
    /** The file of the user's record, "" where there is none. */
    static std::string record_path(const Context &context) { return detail::text_of(clspTuningGetRecordPath, context); }
};

/** First-order statistics, histogram and autocovariance, see statistics.h. All of them block. */
namespace statistics {

/** @param mask UINT8 image, 0 = ignore; nullptr: every pixel counts. */
inline ClspMoments moments(const Context &context, cl_command_queue queue, const ClspImage &image,
                           const ClspImage *mask = nullptr) {
    auto result = make<ClspMoments>();
    check(clspStatisticsMoments(context, queue, &image, mask, &result));
    return result;
}

/** bins + 2 counts: below `low`, the bins of [low, high), at or above `high`. */
inline std::vector<std::uint64_t> histogram(const Context &context, cl_command_queue queue, const ClspImage &image,
                                            double low, double high, std::uint32_t bins,
                                            const ClspImage *mask = nullptr) {
    std::vector<std::uint64_t> counts(static_cast<std::size_t>(bins) + 2);
    check(clspStatisticsHistogram(context, queue, &image, mask, low, high, bins, counts.data()));
    return counts;
}

/** (2 max_lag + 1)^2 values, lag (0, 0) in the centre. */
inline std::vector<float> autocovariance(const Context &context, cl_command_queue queue, const ClspImage &image,
                                         std::uint32_t max_lag) {
    const std::size_t side = 2 * static_cast<std::size_t>(max_lag) + 1;
    std::vector<float> result(side * side);
    check(clspStatisticsAutocovariance(context, queue, &image, max_lag, result.data()));
    return result;
}

} // namespace statistics
} // namespace clspeckle

#endif // CLSPECKLE_CLSPECKLE_HPP

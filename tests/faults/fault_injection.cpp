#include "fault_injection.hpp"

#include <CL/cl.h>
#include <CL/cl_icd.h>
#include <clFFT.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstdarg>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <dlfcn.h>
#include <fcntl.h>
#include <link.h>
#include <new>
#include <pthread.h>
#include <string>
#include <sys/file.h>
#include <sys/mman.h>
#include <sys/random.h>
#include <sys/stat.h>
#include <type_traits>
#include <unistd.h>
#include <vector>

namespace faults {
namespace {

std::atomic<bool> g_armed{false};
Kind g_kind = Kind::kOpenCl;
std::uint64_t g_n = 0;
bool g_lasting = false;
std::atomic<std::uint64_t> g_calls{0};
std::atomic<const char *> g_failed{nullptr};
std::atomic<std::int64_t> g_live{0}, g_blocks{0};

// Threads that a driver starts, and whatever runs inside a call of it, are not our own.
thread_local bool t_own = false;
thread_local int t_inside = 0;

bool is_own() {
    return t_own && t_inside == 0;
}

// Whether this call is the one, or a later one.
bool fails(Kind kind, const char *name) {
    if (!g_armed.load(std::memory_order_relaxed) || kind != g_kind || !is_own())
        return false;
    const std::uint64_t number = ++g_calls;
    if (g_n == 0 || number < g_n || (number > g_n && !g_lasting))
        return false;
    const char *none = nullptr;
    g_failed.compare_exchange_strong(none, name);
    return true;
}

template <typename Function> Function *next(const char *name) {
    return reinterpret_cast<Function *>(dlsym(RTLD_NEXT, name));
}

template <typename... Arguments> clfftStatus clfft_call(const char *name, bool may_fail, Arguments... arguments) {
    if (may_fail && fails(Kind::kOpenCl, name))
        return CLFFT_OUT_OF_RESOURCES;
    const Aside aside;
    return next<clfftStatus(Arguments...)>(name)(arguments...);
}

enum class Role { kPlain, kCreate, kRetain, kRelease };

// One entry of the table. Everything is deduced from its type.
template <auto Entry> struct Wrap;
template <typename Result, typename... Arguments, Result(CL_API_CALL *cl_icd_dispatch::*Entry)(Arguments...)>
struct Wrap<Entry> {
    static inline Result(CL_API_CALL *original)(Arguments...) = nullptr;
    static inline const char *name = "";
    static inline Role role = Role::kPlain;

    static Result CL_API_CALL call(Arguments... arguments) {
        if (role != Role::kRelease && fails(Kind::kOpenCl, name)) {
            constexpr cl_int kError = CL_OUT_OF_RESOURCES;
            if constexpr (std::is_same_v<Result, cl_int>) {
                return kError;
            } else {
                ((set_error(arguments, kError)), ...);
                return nullptr;
            }
        }
        ++t_inside;
        const Result result = original(arguments...);
        --t_inside;
        // Whoever comes by the table is no driver.
        if constexpr (std::is_same_v<Result, cl_int>) {
            if (result != CL_SUCCESS)
                return result;
            g_live += role == Role::kRetain ? 1 : role == Role::kRelease ? -1 : 0;
        } else {
            if (!result)
                return result;
            g_live += role == Role::kCreate ? 1 : 0;
        }
        ((count_event(arguments)), ...);
        return result;
    }
    template <typename T> static void set_error(T argument, cl_int error) {
        if constexpr (std::is_same_v<T, cl_int *>)
            if (argument)
                *argument = error;
    }
    template <typename T> static void count_event(T argument) {
        if constexpr (std::is_same_v<T, cl_event *>)
            if (argument)
                ++g_live;
    }
    static void put(cl_icd_dispatch *table, const char *called, Role as) {
        name = called;
        role = as;
        original = table->*Entry;
        table->*Entry = &call;
    }
};

#define CLSP_PUT(entry, as) Wrap<&cl_icd_dispatch::entry>::put(table, #entry, Role::as)

void put_all(cl_icd_dispatch *table) {
    CLSP_PUT(clGetPlatformInfo, kPlain);
    CLSP_PUT(clGetDeviceIDs, kPlain);
    CLSP_PUT(clGetDeviceInfo, kPlain);
    CLSP_PUT(clCreateContext, kCreate);
    CLSP_PUT(clRetainContext, kRetain);
    CLSP_PUT(clReleaseContext, kRelease);
    CLSP_PUT(clGetContextInfo, kPlain);
    CLSP_PUT(clCreateCommandQueue, kCreate);
    CLSP_PUT(clRetainCommandQueue, kRetain);
    CLSP_PUT(clReleaseCommandQueue, kRelease);
    CLSP_PUT(clGetCommandQueueInfo, kPlain);
    CLSP_PUT(clCreateBuffer, kCreate);
    CLSP_PUT(clCreateSubBuffer, kCreate);
    CLSP_PUT(clCreateImage, kCreate);
    CLSP_PUT(clGetImageInfo, kPlain);
    CLSP_PUT(clRetainMemObject, kRetain);
    CLSP_PUT(clReleaseMemObject, kRelease);
    CLSP_PUT(clGetMemObjectInfo, kPlain);
    CLSP_PUT(clSetMemObjectDestructorCallback, kPlain);
    CLSP_PUT(clCreateProgramWithSource, kCreate);
    CLSP_PUT(clCreateProgramWithBinary, kCreate);
    CLSP_PUT(clRetainProgram, kRetain);
    CLSP_PUT(clReleaseProgram, kRelease);
    CLSP_PUT(clBuildProgram, kPlain);
    CLSP_PUT(clGetProgramInfo, kPlain);
    CLSP_PUT(clGetProgramBuildInfo, kPlain);
    CLSP_PUT(clCreateKernel, kCreate);
    CLSP_PUT(clRetainKernel, kRetain);
    CLSP_PUT(clReleaseKernel, kRelease);
    CLSP_PUT(clSetKernelArg, kPlain);
    CLSP_PUT(clGetKernelInfo, kPlain);
    CLSP_PUT(clGetKernelWorkGroupInfo, kPlain);
    CLSP_PUT(clWaitForEvents, kPlain);
    CLSP_PUT(clGetEventInfo, kPlain);
    CLSP_PUT(clRetainEvent, kRetain);
    CLSP_PUT(clReleaseEvent, kRelease);
    CLSP_PUT(clSetEventCallback, kPlain);
    CLSP_PUT(clGetEventProfilingInfo, kPlain);
    CLSP_PUT(clFinish, kPlain);
    CLSP_PUT(clEnqueueReadBuffer, kPlain);
    CLSP_PUT(clEnqueueWriteBuffer, kPlain);
    CLSP_PUT(clEnqueueReadImage, kPlain);
    CLSP_PUT(clEnqueueWriteImage, kPlain);
    CLSP_PUT(clEnqueueCopyBuffer, kPlain);
    CLSP_PUT(clEnqueueCopyBufferRect, kPlain);
    CLSP_PUT(clEnqueueFillBuffer, kPlain);
    CLSP_PUT(clEnqueueMapBuffer, kPlain);
    CLSP_PUT(clEnqueueUnmapMemObject, kPlain);
    CLSP_PUT(clEnqueueNDRangeKernel, kPlain);
    CLSP_PUT(clEnqueueMarkerWithWaitList, kPlain);
}

void *start_thread(void *given);

struct Thread {
    void *(*body)(void *);
    void *argument;
    bool own;
};

void *start_thread(void *given) {
    const Thread thread = *static_cast<Thread *>(given);
    std::free(given);
    t_own = thread.own;
    return thread.body(thread.argument);
}

// The test's own code may allocate what it likes.
bool is_of_test(const void *caller) {
    static const auto range = [] {
        struct Range {
            std::uintptr_t begin = 0, end = 0;
        } result;
        dl_iterate_phdr(
            [](dl_phdr_info *info, std::size_t, void *out) {
                for (int i = 0; i < info->dlpi_phnum; ++i)
                    if (info->dlpi_phdr[i].p_type == PT_LOAD && (info->dlpi_phdr[i].p_flags & PF_X)) {
                        auto &found = *static_cast<Range *>(out);
                        found.begin = info->dlpi_addr + info->dlpi_phdr[i].p_vaddr;
                        found.end = found.begin + info->dlpi_phdr[i].p_memsz;
                    }
                return 1; // the program is the first one
            },
            &result);
        return result;
    }();
    const auto at = reinterpret_cast<std::uintptr_t>(caller);
    return at >= range.begin && at < range.end;
}

#if defined(__has_feature)
#if __has_feature(address_sanitizer)
#define CLSP_BARE_BLOCKS 1 // the sanitizer watches the ends of blocks, and what is left of them
#endif
#endif

#ifdef CLSP_BARE_BLOCKS
void *allocate(std::size_t size, std::size_t alignment, const void *caller) {
    if (is_own() && !is_of_test(caller) && fails(Kind::kAllocation, "operator new"))
        return nullptr;
    if (size > SIZE_MAX / 2)
        return nullptr;
    return alignment > alignof(std::max_align_t)
               ? std::aligned_alloc(alignment, (size + alignment - 1) / alignment * alignment)
               : std::malloc(size);
}

void give_back(void *block) {
    std::free(block);
}
#else
// Before each block, so that who frees it need not be who took it.
struct alignas(std::max_align_t) Header {
    void *start;
    bool counted;
};

void *allocate(std::size_t size, std::size_t alignment, const void *caller) {
    const bool own = is_own() && !is_of_test(caller);
    if (own && fails(Kind::kAllocation, "operator new"))
        return nullptr;
    const std::size_t front = std::max(alignment, sizeof(Header));
    if (size > SIZE_MAX / 2)
        return nullptr;
    const std::size_t whole = (front + size + front - 1) / front * front;
    void *start =
        front > alignof(std::max_align_t) && alignment ? std::aligned_alloc(front, whole) : std::malloc(whole);
    if (!start)
        return nullptr;
    auto *block = static_cast<unsigned char *>(start) + front;
    new (block - sizeof(Header)) Header{start, own};
    g_blocks += own;
    return block;
}

void give_back(void *block) {
    if (!block)
        return;
    const auto *header = reinterpret_cast<const Header *>(static_cast<unsigned char *>(block) - sizeof(Header));
    g_blocks -= header->counted;
    std::free(header->start);
}
#endif

void *or_throw(void *pointer) {
    if (!pointer)
        throw std::bad_alloc();
    return pointer;
}

template <typename Result> Result file_error(Result result, int error) {
    errno = error;
    return result;
}

} // namespace

void install() {
    t_own = true;
    cl_uint count = 0;
    next<decltype(clGetPlatformIDs)>("clGetPlatformIDs")(0, nullptr, &count);
    std::vector<cl_platform_id> platforms(count);
    if (count)
        next<decltype(clGetPlatformIDs)>("clGetPlatformIDs")(count, platforms.data(), nullptr);
    if (platforms.empty())
        std::abort();
    // An object begins with the pointer to its driver's table.
    auto *table = *reinterpret_cast<cl_icd_dispatch **>(platforms.front());
    const auto page = static_cast<std::uintptr_t>(sysconf(_SC_PAGESIZE));
    const std::uintptr_t begin = reinterpret_cast<std::uintptr_t>(table) / page * page;
    const std::uintptr_t end = reinterpret_cast<std::uintptr_t>(table + 1);
    if (mprotect(reinterpret_cast<void *>(begin), end - begin, PROT_READ | PROT_WRITE) != 0)
        std::abort();
    put_all(table);
}

void arm(Kind kind, std::uint64_t n, bool lasting) {
    g_armed = false;
    g_kind = kind;
    g_n = n;
    g_lasting = lasting;
    g_calls = 0;
    g_failed = nullptr;
    g_armed = true;
}
void disarm() {
    g_armed = false;
}
std::uint64_t calls() {
    return g_calls;
}
bool has_failed() {
    return g_failed.load() != nullptr;
}
const char *failed() {
    const char *name = g_failed;
    return name ? name : "nothing";
}
std::int64_t live_objects() {
    return g_live;
}
std::int64_t live_blocks() {
    return g_blocks;
}
Aside::Aside() {
    ++t_inside;
}
Aside::~Aside() {
    --t_inside;
}

} // namespace faults

// What the program defines comes before what libraries define.

extern "C" {

CL_API_ENTRY cl_int CL_API_CALL clGetPlatformIDs(cl_uint count, cl_platform_id *platforms, cl_uint *found) {
    if (faults::fails(faults::Kind::kOpenCl, "clGetPlatformIDs"))
        return CL_OUT_OF_HOST_MEMORY;
    ++faults::t_inside;
    const cl_int result = faults::next<decltype(clGetPlatformIDs)>("clGetPlatformIDs")(count, platforms, found);
    --faults::t_inside;
    return result;
}

// clFFT's calls fail as a driver's do: what fails inside of them leaks, and ends the program where it throws in a
// destructor.
clfftStatus clfftSetup(const clfftSetupData *data) {
    return faults::clfft_call("clfftSetup", true, data);
}
clfftStatus clfftCreateDefaultPlan(clfftPlanHandle *plan, cl_context context, const clfftDim dim,
                                   const size_t *lengths) {
    return faults::clfft_call("clfftCreateDefaultPlan", true, plan, context, dim, lengths);
}
clfftStatus clfftBakePlan(clfftPlanHandle plan, cl_uint count, cl_command_queue *queues,
                          void(CL_CALLBACK *notify)(clfftPlanHandle, void *), void *data) {
    return faults::clfft_call("clfftBakePlan", true, plan, count, queues, notify, data);
}
clfftStatus clfftDestroyPlan(clfftPlanHandle *plan) {
    return faults::clfft_call("clfftDestroyPlan", false, plan);
}
clfftStatus clfftEnqueueTransform(clfftPlanHandle plan, clfftDirection direction, cl_uint count,
                                  cl_command_queue *queues, cl_uint wait_count, const cl_event *waits, cl_event *events,
                                  cl_mem *inputs, cl_mem *outputs, cl_mem scratch) {
    return faults::clfft_call("clfftEnqueueTransform", true, plan, direction, count, queues, wait_count, waits,
                              events, inputs, outputs, scratch);
}

int pthread_create(pthread_t *thread, const pthread_attr_t *attributes, void *(*body)(void *), void *argument) {
    auto *given = static_cast<faults::Thread *>(std::malloc(sizeof(faults::Thread)));
    *given = {body, argument, faults::is_own()};
    return faults::next<decltype(pthread_create)>("pthread_create")(thread, attributes, faults::start_thread, given);
}

FILE *fopen(const char *path, const char *mode) {
    if (faults::fails(faults::Kind::kFile, "fopen"))
        return faults::file_error<FILE *>(nullptr, EMFILE);
    return faults::next<FILE *(const char *, const char *)>("fopen")(path, mode);
}
FILE *fopen64(const char *path, const char *mode) {
    if (faults::fails(faults::Kind::kFile, "fopen64"))
        return faults::file_error<FILE *>(nullptr, EMFILE);
    return faults::next<FILE *(const char *, const char *)>("fopen64")(path, mode);
}
int open(const char *path, int flags, ...) {
    va_list list;
    va_start(list, flags);
    const mode_t mode = (flags & O_CREAT) ? va_arg(list, mode_t) : 0;
    va_end(list);
    if (faults::fails(faults::Kind::kFile, "open"))
        return faults::file_error(-1, EMFILE);
    return faults::next<int(const char *, int, ...)>("open")(path, flags, mode);
}
int openat(int folder, const char *path, int flags, ...) {
    va_list list;
    va_start(list, flags);
    const mode_t mode = (flags & O_CREAT) ? va_arg(list, mode_t) : 0;
    va_end(list);
    if (faults::fails(faults::Kind::kFile, "openat"))
        return faults::file_error(-1, EMFILE);
    return faults::next<int(int, const char *, int, ...)>("openat")(folder, path, flags, mode);
}
FILE *fdopen(int file, const char *mode) noexcept {
    if (faults::fails(faults::Kind::kFile, "fdopen"))
        return faults::file_error<FILE *>(nullptr, ENOMEM);
    return faults::next<FILE *(int, const char *)>("fdopen")(file, mode);
}
int fflush(FILE *file) {
    if (file != stdout && file != stderr && faults::fails(faults::Kind::kFile, "fflush"))
        return faults::file_error(EOF, ENOSPC);
    return faults::next<int(FILE *)>("fflush")(file);
}
int fclose(FILE *file) {
    // It is closed, as after any error of close().
    const bool fails = faults::fails(faults::Kind::kFile, "fclose");
    const int result = faults::next<int(FILE *)>("fclose")(file);
    return fails ? faults::file_error(EOF, EIO) : result;
}
int fstat(int file, struct stat *status) noexcept {
    if (faults::fails(faults::Kind::kFile, "fstat"))
        return faults::file_error(-1, EIO);
    return faults::next<int(int, struct stat *)>("fstat")(file, status);
}
int stat(const char *path, struct stat *status) noexcept {
    if (faults::fails(faults::Kind::kFile, "stat"))
        return faults::file_error(-1, EIO);
    return faults::next<int(const char *, struct stat *)>("stat")(path, status);
}
int lstat(const char *path, struct stat *status) noexcept {
    if (faults::fails(faults::Kind::kFile, "lstat"))
        return faults::file_error(-1, EIO);
    return faults::next<int(const char *, struct stat *)>("lstat")(path, status);
}
int mkdir(const char *path, mode_t mode) noexcept {
    if (faults::fails(faults::Kind::kFile, "mkdir"))
        return faults::file_error(-1, ENOSPC);
    return faults::next<int(const char *, mode_t)>("mkdir")(path, mode);
}
int fchmod(int file, mode_t mode) noexcept {
    if (faults::fails(faults::Kind::kFile, "fchmod"))
        return faults::file_error(-1, EPERM);
    return faults::next<int(int, mode_t)>("fchmod")(file, mode);
}
int flock(int file, int operation) noexcept {
    if (faults::fails(faults::Kind::kFile, "flock"))
        return faults::file_error(-1, ENOLCK);
    return faults::next<int(int, int)>("flock")(file, operation);
}
ssize_t getrandom(void *to, size_t size, unsigned flags) {
    if (faults::fails(faults::Kind::kFile, "getrandom"))
        return faults::file_error<ssize_t>(-1, ENOSYS);
    return faults::next<ssize_t(void *, size_t, unsigned)>("getrandom")(to, size, flags);
}
int rename(const char *from, const char *to) {
    if (faults::fails(faults::Kind::kFile, "rename"))
        return faults::file_error(-1, EIO);
    return faults::next<int(const char *, const char *)>("rename")(from, to);
}
ssize_t read(int file, void *to, size_t size) {
    if (faults::fails(faults::Kind::kFile, "read"))
        return faults::file_error<ssize_t>(-1, EIO);
    return faults::next<ssize_t(int, void *, size_t)>("read")(file, to, size);
}
ssize_t write(int file, const void *from, size_t size) {
    if (file > 2 && faults::fails(faults::Kind::kFile, "write"))
        return faults::file_error<ssize_t>(-1, ENOSPC);
    return faults::next<ssize_t(int, const void *, size_t)>("write")(file, from, size);
}
size_t fread(void *to, size_t size, size_t count, FILE *file) {
    if (faults::fails(faults::Kind::kFile, "fread"))
        return faults::file_error<size_t>(0, EIO);
    return faults::next<size_t(void *, size_t, size_t, FILE *)>("fread")(to, size, count, file);
}
size_t fwrite(const void *from, size_t size, size_t count, FILE *file) {
    if (file != stdout && file != stderr && faults::fails(faults::Kind::kFile, "fwrite"))
        return faults::file_error<size_t>(0, ENOSPC);
    return faults::next<size_t(const void *, size_t, size_t, FILE *)>("fwrite")(from, size, count, file);
}

} // extern "C"

void *operator new(std::size_t size) {
    return faults::or_throw(faults::allocate(size, 0, __builtin_return_address(0)));
}
void *operator new[](std::size_t size) {
    return faults::or_throw(faults::allocate(size, 0, __builtin_return_address(0)));
}
void *operator new(std::size_t size, const std::nothrow_t &) noexcept {
    return faults::allocate(size, 0, __builtin_return_address(0));
}
void *operator new[](std::size_t size, const std::nothrow_t &) noexcept {
    return faults::allocate(size, 0, __builtin_return_address(0));
}
void *operator new(std::size_t size, std::align_val_t alignment) {
    return faults::or_throw(faults::allocate(size, static_cast<std::size_t>(alignment), __builtin_return_address(0)));
}
void *operator new[](std::size_t size, std::align_val_t alignment) {
    return faults::or_throw(faults::allocate(size, static_cast<std::size_t>(alignment), __builtin_return_address(0)));
}
void operator delete(void *pointer) noexcept {
    faults::give_back(pointer);
}
void operator delete[](void *pointer) noexcept {
    faults::give_back(pointer);
}
void operator delete(void *pointer, std::size_t) noexcept {
    faults::give_back(pointer);
}
void operator delete[](void *pointer, std::size_t) noexcept {
    faults::give_back(pointer);
}
void operator delete(void *pointer, std::align_val_t) noexcept {
    faults::give_back(pointer);
}
void operator delete[](void *pointer, std::align_val_t) noexcept {
    faults::give_back(pointer);
}
void operator delete(void *pointer, std::size_t, std::align_val_t) noexcept {
    faults::give_back(pointer);
}
void operator delete[](void *pointer, std::size_t, std::align_val_t) noexcept {
    faults::give_back(pointer);
}
void operator delete(void *pointer, const std::nothrow_t &) noexcept {
    faults::give_back(pointer);
}
void operator delete[](void *pointer, const std::nothrow_t &) noexcept {
    faults::give_back(pointer);
}

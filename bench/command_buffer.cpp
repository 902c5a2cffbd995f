// What a frame would gain from cl_khr_command_buffer: its kernels recorded once and replayed, beside the frame as it is
// enqueued. The program stands between the library and clEnqueueNDRangeKernel() to record; everything else is the
// public interface.
//
//     clspeckle-command-buffer [FRAMES]      medians of as many frames, 200 by default
#include <clspeckle/clspeckle.hpp>

#include <CL/cl_ext.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <dlfcn.h>
#include <exception>
#include <string>
#include <vector>

#ifdef cl_khr_command_buffer

namespace {

cl_command_buffer_khr recording = nullptr;
clCommandNDRangeKernelKHR_fn record = nullptr;
int recorded = 0;

} // namespace

extern "C" cl_int clEnqueueNDRangeKernel(cl_command_queue queue, cl_kernel kernel, cl_uint dimensions,
                                         const size_t *offset, const size_t *global, const size_t *local,
                                         cl_uint num_waits, const cl_event *waits, cl_event *event) {
    static const auto real =
        reinterpret_cast<decltype(&clEnqueueNDRangeKernel)>(dlsym(RTLD_NEXT, "clEnqueueNDRangeKernel"));
    if (!recording)
        return real(queue, kernel, dimensions, offset, global, local, num_waits, waits, event);
    ++recorded;
    return record(recording, nullptr, nullptr, kernel, dimensions, offset, global, local, 0, nullptr, nullptr, nullptr);
}

namespace {

void check(cl_int code, const char *call) {
    if (code != CL_SUCCESS)
        throw std::runtime_error(std::string(call) + " failed with OpenCL code " + std::to_string(code));
}

template <typename Function> Function extension(cl_platform_id platform, const char *name) {
    return reinterpret_cast<Function>(clGetExtensionFunctionAddressForPlatform(platform, name));
}

struct Times {
    double enqueue_us, frame_us;
};

// Medians: until the call returns, and until the queue is empty.
template <typename Enqueue> Times measure(const clspeckle::Queue &queue, int frames, Enqueue enqueue) {
    using Clock = std::chrono::steady_clock;
    std::vector<double> calls, whole;
    for (int i = 0; i < frames; ++i) {
        const Clock::time_point begin = Clock::now();
        enqueue();
        const Clock::time_point returned = Clock::now();
        queue.finish();
        calls.push_back(std::chrono::duration<double, std::micro>(returned - begin).count());
        whole.push_back(std::chrono::duration<double, std::micro>(Clock::now() - begin).count());
    }
    for (std::vector<double> *values : {&calls, &whole})
        std::nth_element(values->begin(), values->begin() + frames / 2, values->end());
    return {calls[static_cast<std::size_t>(frames) / 2], whole[static_cast<std::size_t>(frames) / 2]};
}

void run(const clspeckle::Context &context, std::uint32_t width, std::uint32_t height, int frames) {
    cl_platform_id platform = nullptr;
    check(clGetDeviceInfo(context.info().cl_device, CL_DEVICE_PLATFORM, sizeof platform, &platform, nullptr),
          "clGetDeviceInfo");
    const clspeckle::Queue queue(context);
    const std::size_t pixels = std::size_t{width} * height;
    const clspeckle::Buffer irradiance(context, queue, std::vector<float>(pixels, 1.0f)), output(context, 2 * pixels);
    auto phase = clspeckle::make<ClspPhaseDesc>();
    auto aperture = clspeckle::make<ClspApertureDesc>();
    auto sensor = clspeckle::make<ClspSensorDesc>();
    phase.width = aperture.width = sensor.width = width;
    phase.height = aperture.height = sensor.height = height;
    const clspeckle::Pipeline pipeline(context, clspeckle::Phase(context, phase),
                                       clspeckle::Aperture(context, aperture), clspeckle::Sensor(context, sensor));
    auto frame = clspeckle::make<ClspFrame>();
    frame.irradiance = irradiance.image(width, height, CLSP_FORMAT_FLOAT32);
    frame.output = output.image(width, height, CLSP_FORMAT_UINT16);
    const auto enqueue = [&] { pipeline.enqueue_frame(queue, frame); };
    enqueue(); // draws the surface
    frame.frame_index = 1;
    enqueue();
    const auto expected = output.read<std::uint16_t>(queue, pixels);

    const cl_command_queue raw = queue;
    cl_int code = CL_SUCCESS;
    record = extension<clCommandNDRangeKernelKHR_fn>(platform, "clCommandNDRangeKernelKHR");
    const auto replay = extension<clEnqueueCommandBufferKHR_fn>(platform, "clEnqueueCommandBufferKHR");
    const auto create = extension<clCreateCommandBufferKHR_fn>(platform, "clCreateCommandBufferKHR");
    const auto finalize = extension<clFinalizeCommandBufferKHR_fn>(platform, "clFinalizeCommandBufferKHR");
    const auto release = extension<clReleaseCommandBufferKHR_fn>(platform, "clReleaseCommandBufferKHR");
    if (!record || !replay || !create || !finalize || !release)
        throw std::runtime_error("the driver lists cl_khr_command_buffer, but lacks a function of it");
    const cl_command_buffer_khr buffer = create(1, &raw, nullptr, &code);
    check(code, "clCreateCommandBufferKHR");
    recorded = 0;
    recording = buffer;
    enqueue();
    recording = nullptr;
    check(finalize(buffer), "clFinalizeCommandBufferKHR");
    output.write(queue, std::vector<std::uint16_t>(pixels, 0));
    const auto enqueue_buffer = [&] {
        check(replay(0, nullptr, buffer, 0, nullptr, nullptr), "clEnqueueCommandBufferKHR");
    };
    enqueue_buffer();
    const bool same = output.read<std::uint16_t>(queue, pixels) == expected;
    const Times usual = measure(queue, frames, enqueue), replayed = measure(queue, frames, enqueue_buffer);
    check(release(buffer), "clReleaseCommandBufferKHR");
    std::printf(
        "%4u x %4u: %d kernels; enqueued in %.0f us, replayed in %.0f us; whole frame %.0f us, replayed %.0f us; %s\n",
        width, height, recorded, usual.enqueue_us, replayed.enqueue_us, usual.frame_us, replayed.frame_us,
        same ? "the same bytes" : "OTHER BYTES");
}

} // namespace

int main(int argc, char **argv) {
    const int frames = argc > 1 ? std::max(1, std::atoi(argv[1])) : 200;
    try {
        const clspeckle::Context context;
        const cl_device_id device = context.info().cl_device;
        std::string extensions(1 << 16, '\0');
        check(clGetDeviceInfo(device, CL_DEVICE_EXTENSIONS, extensions.size(), &extensions[0], nullptr),
              "clGetDeviceInfo");
        const auto has = [&](const char *name) { return extensions.find(name) != std::string::npos; };
        std::printf("%s: %s, %s\n", context.info().device_name,
                    has("cl_khr_command_buffer") ? "cl_khr_command_buffer" : "no cl_khr_command_buffer",
                    has("cl_khr_command_buffer_mutable_dispatch") ? "mutable dispatch" : "no mutable dispatch");
        if (!has("cl_khr_command_buffer"))
            return 0;
        for (const auto &[width, height] : {std::pair{64u, 64u}, {320u, 240u}, {640u, 480u}, {1920u, 1080u}})
            run(context, width, height, frames);
    } catch (const std::exception &error) {
        std::fprintf(stderr, "%s\n", error.what());
        return 1;
    }
}

#else

int main() {
    std::puts("built with headers that do not know cl_khr_command_buffer");
}

#endif

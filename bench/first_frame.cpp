// From the start of a process to its first frame in memory. Run it twice with empty caches to see a first and a warm
// start:
//
//     clspeckle-first-frame [WIDTH HEIGHT] [auto|off|on]     the disk cache of compiled programs
#include <clspeckle/clspeckle.hpp>

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <vector>

namespace {

using Clock = std::chrono::steady_clock;

void run(std::uint32_t width, std::uint32_t height, std::uint32_t disk_cache) {
    const Clock::time_point start = Clock::now();
    const auto milliseconds = [&] { return std::chrono::duration<double, std::milli>(Clock::now() - start).count(); };
    auto context_desc = clspeckle::make<ClspContextDesc>();
    context_desc.disk_cache = disk_cache;
    const clspeckle::Context context(context_desc);
    const clspeckle::Queue queue(context);
    const double context_ms = milliseconds();
    const clspeckle::Buffer irradiance(context, queue, std::vector<float>(std::size_t{width} * height, 1.0f));
    const clspeckle::Buffer output(context, sizeof(std::uint16_t) * width * height);
    auto phase_desc = clspeckle::make<ClspPhaseDesc>();
    auto aperture_desc = clspeckle::make<ClspApertureDesc>();
    auto sensor_desc = clspeckle::make<ClspSensorDesc>();
    phase_desc.width = aperture_desc.width = sensor_desc.width = width;
    phase_desc.height = aperture_desc.height = sensor_desc.height = height;
    const clspeckle::Pipeline pipeline(context, clspeckle::Phase(context, phase_desc),
                                       clspeckle::Aperture(context, aperture_desc),
                                       clspeckle::Sensor(context, sensor_desc));
    const double pipeline_ms = milliseconds();
    auto frame = clspeckle::make<ClspFrame>();
    frame.irradiance = irradiance.image(width, height, CLSP_FORMAT_FLOAT32);
    frame.output = output.image(width, height, CLSP_FORMAT_UINT16);
    const auto render = [&] {
        pipeline.enqueue_frame(queue, frame);
        ++frame.frame_index;
        return output.read<std::uint16_t>(queue, std::size_t{width} * height);
    };
    render();
    const double first_ms = milliseconds();
    render();
    std::printf(
        "%u x %u: context %.1f ms, pipeline %.1f ms, first frame %.1f ms; in all %.1f ms; second frame %.1f ms\n",
        width, height, context_ms, pipeline_ms - context_ms, first_ms - pipeline_ms, first_ms,
        milliseconds() - first_ms);
}

} // namespace

int main(int argc, char **argv) {
    std::uint32_t width = 640, height = 480, disk_cache = CLSP_DISK_CACHE_AUTO;
    if (argc >= 3 && argv[1][0] >= '0' && argv[1][0] <= '9') {
        width = static_cast<std::uint32_t>(std::atoi(argv[1]));
        height = static_cast<std::uint32_t>(std::atoi(argv[2]));
        argc -= 2;
        argv += 2;
    }
    if (argc > 1) {
        if (std::strcmp(argv[1], "on") == 0) {
            disk_cache = CLSP_DISK_CACHE_ON;
        } else if (std::strcmp(argv[1], "off") == 0) {
            disk_cache = CLSP_DISK_CACHE_OFF;
        } else if (std::strcmp(argv[1], "auto") != 0) {
            std::fprintf(stderr, "clspeckle-first-frame [WIDTH HEIGHT] [auto|off|on]: what is \"%s\"?\n", argv[1]);
            return 2;
        }
    }
    try {
        run(width, height, disk_cache);
    } catch (const std::exception &error) {
        std::fprintf(stderr, "%s\n", error.what());
        return 1;
    }
}

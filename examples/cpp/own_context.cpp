// For an engine that has OpenCL already: its context, its queues, its memory and its events stay its own.
//
// Depth, refresh mask and output live as sub-rectangles of buffers that the engine manages (offset and pitch). The
// engine "renders" depth on its own queue and passes the event on; clSpeckle waits for it on the device, not on the
// host. A box moves to the right before a wall, so the pixels that it covers or uncovers get new speckle.
//
//     own_context [prefix]        writes <prefix>_0.pgm to <prefix>_3.pgm, by default engine_0.pgm to engine_3.pgm
#include <clspeckle/clspeckle.hpp>

#include <cmath>
#include <cstdio>
#include <cstring>
#include <exception>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>
#include <vector>

namespace {

constexpr std::uint32_t width = 320, height = 240, frames = 4;
// Rows of the engine's textures are 2 KiB apart and the picture begins 4 KiB into them.
constexpr std::size_t pitch = 2048, offset = 4096, texture_bytes = offset + pitch * height;

void check_cl(cl_int code, const char *what) {
    if (code != CL_SUCCESS)
        throw std::runtime_error(std::string(what) + " failed with OpenCL code " + std::to_string(code));
}

// The engine: plain OpenCL, released in the reverse order.
struct Engine {
    cl_platform_id platform = nullptr;
    cl_device_id device = nullptr;
    cl_context context = nullptr;
    cl_command_queue upload = nullptr, compute = nullptr;
    cl_mem depth = nullptr, mask = nullptr, output = nullptr;

    Engine() {
        // clSpeckle's list says which devices it runs on; an engine with its own choice skips this.
        for (const ClspDeviceInfo &info : clspeckle::devices()) {
            if (info.usable) {
                platform = info.platform_id;
                device = info.device_id;
                break;
            }
        }
        if (!device)
            throw std::runtime_error(clspeckle::explain_devices());
        const cl_context_properties properties[] = {CL_CONTEXT_PLATFORM,
                                                    reinterpret_cast<cl_context_properties>(platform), 0};
        cl_int code = CL_SUCCESS;
        context = clCreateContext(properties, 1, &device, nullptr, nullptr, &code);
        check_cl(code, "clCreateContext");
        upload = clCreateCommandQueue(context, device, 0, &code);
        check_cl(code, "clCreateCommandQueue");
        compute = clCreateCommandQueue(context, device, CL_QUEUE_OUT_OF_ORDER_EXEC_MODE_ENABLE, &code);
        check_cl(code, "clCreateCommandQueue");
        for (cl_mem *mem : {&depth, &mask, &output}) {
            *mem = clCreateBuffer(context, CL_MEM_READ_WRITE, texture_bytes, nullptr, &code);
            check_cl(code, "clCreateBuffer");
        }
    }
    Engine(const Engine &) = delete;
    Engine &operator=(const Engine &) = delete;
    ~Engine() {
        for (cl_mem mem : {output, mask, depth})
            clReleaseMemObject(mem);
        clReleaseCommandQueue(compute);
        clReleaseCommandQueue(upload);
        clReleaseContext(context);
    }
};

bool in_box(std::uint32_t x, std::uint32_t y, std::uint32_t frame) {
    const std::uint32_t left = 100 + 8 * frame;
    return x >= left && x < left + 80 && y >= 90 && y < 180;
}

// A wall at 1.5 m, a box at 1.1 m.
void draw_depth(std::vector<unsigned char> &texture, std::uint32_t frame) {
    for (std::uint32_t y = 0; y < height; ++y) {
        for (std::uint32_t x = 0; x < width; ++x) {
            const float depth_m = in_box(x, y, frame) ? 1.1f : 1.5f;
            std::memcpy(&texture[offset + y * pitch + x * sizeof(float)], &depth_m, sizeof(float));
        }
    }
}

void draw_mask(std::vector<unsigned char> &texture, std::uint32_t frame) {
    for (std::uint32_t y = 0; y < height; ++y) {
        for (std::uint32_t x = 0; x < width; ++x)
            texture[offset + y * pitch + x] = frame > 0 && (in_box(x, y, frame) || in_box(x, y, frame - 1)) ? 255 : 0;
    }
}

// Dots on a plane at unit distance, 64 x 48 of them.
std::vector<float> draw_pattern(std::uint32_t pattern_width, std::uint32_t pattern_height) {
    std::vector<float> texels(pattern_width * pattern_height);
    for (std::uint32_t y = 0; y < pattern_height; ++y) {
        for (std::uint32_t x = 0; x < pattern_width; ++x) {
            const double dx = x % 16 - 7.5, dy = y % 16 - 7.5;
            texels[y * pattern_width + x] = static_cast<float>(std::exp(-(dx * dx + dy * dy) / (2.0 * 1.5 * 1.5)));
        }
    }
    return texels;
}

void write_pgm(const std::string &path, const std::vector<unsigned char> &texture) {
    const std::string temporary = path + ".part";
    std::ofstream file(temporary, std::ios::binary);
    file << "P5\n" << width << ' ' << height << "\n1023\n";
    for (std::uint32_t y = 0; y < height; ++y) {
        for (std::uint32_t x = 0; x < width; ++x) {
            std::uint16_t code = 0;
            std::memcpy(&code, &texture[offset + y * pitch + x * sizeof(code)], sizeof(code));
            file.put(static_cast<char>(code >> 8)).put(static_cast<char>(code & 0xff));
        }
    }
    file.close();
    if (!file) {
        std::remove(temporary.c_str());
        throw std::runtime_error("cannot write " + path);
    }
    std::filesystem::rename(temporary, path);
}

void run(const std::string &prefix) {
    const Engine engine;
    const auto context = clspeckle::Context::from_host(engine.context, engine.device);

    auto pattern_desc = clspeckle::make<ClspPatternDesc>();
    pattern_desc.width = 1024;
    pattern_desc.height = 768;
    const std::vector<float> texels = draw_pattern(pattern_desc.width, pattern_desc.height);
    pattern_desc.texels = texels.data(); // copied by the call
    pattern_desc.half_extent_y = 0.375;
    pattern_desc.power_scale = 6.0;
    pattern_desc.laser_from_geometry[3] = -0.05; // the laser sits 5 cm to the right of the camera

    auto phase_desc = clspeckle::make<ClspPhaseDesc>();
    auto aperture_desc = clspeckle::make<ClspApertureDesc>();
    auto sensor_desc = clspeckle::make<ClspSensorDesc>();
    phase_desc.width = aperture_desc.width = sensor_desc.width = width;
    phase_desc.height = aperture_desc.height = sensor_desc.height = height;
    phase_desc.polarization_count = 1;
    aperture_desc.f_number = 4.0;
    aperture_desc.normalization = CLSP_NORMALIZATION_UNIT_MEAN;
    const clspeckle::Pipeline pipeline(
        context, clspeckle::Pattern(context, pattern_desc), clspeckle::Phase(context, phase_desc),
        clspeckle::Aperture(context, aperture_desc), clspeckle::Sensor(context, sensor_desc));

    auto geometry = clspeckle::make<ClspGeometry>();
    geometry.depth = clspeckle::image(engine.depth, width, height, CLSP_FORMAT_FLOAT32, pitch, offset);
    geometry.fx_px = geometry.fy_px = 320.0;
    geometry.cx_px = (width - 1) / 2.0;
    geometry.cy_px = (height - 1) / 2.0;
    auto frame = clspeckle::make<ClspFrame>();
    frame.geometry = &geometry;
    frame.refresh_mask = clspeckle::image(engine.mask, width, height, CLSP_FORMAT_UINT8, pitch, offset);
    frame.output = clspeckle::image(engine.output, width, height, CLSP_FORMAT_UINT16, pitch, offset);

    const unsigned char untouched = 0xA5;
    std::vector<unsigned char> depth(texture_bytes), mask(texture_bytes), output(texture_bytes, untouched);
    draw_depth(depth, 0);
    for (cl_mem mem : {engine.depth, engine.mask})
        check_cl(clEnqueueWriteBuffer(engine.upload, mem, CL_TRUE, 0, depth.size(), depth.data(), 0, nullptr, nullptr),
                 "clEnqueueWriteBuffer");
    check_cl(clEnqueueWriteBuffer(engine.upload, engine.output, CL_TRUE, 0, output.size(), output.data(), 0, nullptr,
                                  nullptr),
             "clEnqueueWriteBuffer");
    pipeline.warm_up(engine.compute, frame); // while the level loads, not in its first frame
    for (std::uint32_t i = 0; i < frames; ++i) {
        draw_depth(depth, i);
        draw_mask(mask, i);
        cl_event uploaded[2] = {nullptr, nullptr};
        check_cl(clEnqueueWriteBuffer(engine.upload, engine.depth, CL_FALSE, 0, depth.size(), depth.data(), 0, nullptr,
                                      &uploaded[0]),
                 "clEnqueueWriteBuffer");
        const auto depth_ready = clspeckle::Event::adopt(uploaded[0]);
        check_cl(clEnqueueWriteBuffer(engine.upload, engine.mask, CL_FALSE, 0, mask.size(), mask.data(), 0, nullptr,
                                      &uploaded[1]),
                 "clEnqueueWriteBuffer");
        const auto mask_ready = clspeckle::Event::adopt(uploaded[1]);
        // Commands of one queue may wait for another queue only once that one has been flushed.
        check_cl(clFlush(engine.upload), "clFlush");

        clspeckle::Event rendered;
        frame.frame_index = i;
        pipeline.enqueue_frame(engine.compute, frame, {depth_ready, mask_ready}, &rendered);

        // The engine goes on with the result in its own way, here by reading it back once `rendered` is complete.
        const cl_event done = rendered;
        check_cl(clEnqueueReadBuffer(engine.compute, engine.output, CL_TRUE, 0, output.size(), output.data(), 1, &done,
                                     nullptr),
                 "clEnqueueReadBuffer");
        for (std::size_t k = 0; k < output.size(); ++k) {
            const bool inside = k >= offset && (k - offset) % pitch < width * sizeof(std::uint16_t);
            if (!inside && output[k] != untouched)
                throw std::runtime_error("byte " + std::to_string(k) + " outside of the picture was written");
        }
        write_pgm(prefix + '_' + std::to_string(i) + ".pgm", output);
    }
    pipeline.check(engine.compute);
}

} // namespace

int main(int argc, char **argv) {
    const std::string prefix = argc > 1 ? argv[1] : "engine";
    try {
        run(prefix);
    } catch (const clspeckle::Error &error) {
        std::fprintf(stderr, "%s\n%s", error.what(), error.build_log().c_str());
        return 1;
    } catch (const std::exception &error) {
        std::fprintf(stderr, "%s\n", error.what());
        return 1;
    }
    std::printf("wrote %s_0.pgm to %s_%u.pgm\n", prefix.c_str(), prefix.c_str(), frames - 1);
}

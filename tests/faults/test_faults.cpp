// What a program does through the C API, again and again, each time with another call that fails: an OpenCL call, an
// allocation, a file; once or from then on. The call must answer with a status and words, or have the result of a run
// without faults; nothing is left behind, and the next run is right.
#include "fault_injection.hpp"
#include "test_support.hpp"

#include <clspeckle/clspeckle.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <ostream>
#include <random>
#include <string>
#include <unistd.h>
#include <vector>

namespace {

namespace fs = std::filesystem;
using faults::Kind;

constexpr std::uint32_t side = 16, pixels = side * side;

using Bytes = std::vector<unsigned char>;

template <typename T> void put(Bytes &to, const std::vector<T> &values) {
    const auto *begin = reinterpret_cast<const unsigned char *>(values.data());
    to.insert(to.end(), begin, begin + values.size() * sizeof(T));
}
void put(Bytes &to, const std::string &text) {
    to.insert(to.end(), text.begin(), text.end());
}

// What a run had: bytes, and whether it was told that a sequence of frames cannot go on as it was.
struct Outcome {
    Bytes bytes;
    bool broken_off = false;
};

clspeckle::Buffer light(const clspeckle::Context &context, const clspeckle::Queue &queue) {
    std::vector<float> values(pixels);
    for (std::uint32_t i = 0; i < pixels; ++i)
        values[i] = 0.2f + 0.01f * static_cast<float>(i % 37);
    return clspeckle::Buffer(context, queue, values);
}

constexpr std::uint64_t moving_frames = 4, whole_frame = 3; // the last one renews all

// A surface that boils, and lives while the shutter is open, behind air that flows, before a sensor that lags. A frame
// that fails is tried once more; a refusal to go on is obeyed. anew: the frame that renews all before its time.
Outcome render_moving_anew(std::uint64_t anew, const clspeckle::Context &context) {
    const clspeckle::Queue queue(context);
    auto phase = clspeckle::make<ClspPhaseDesc>();
    auto aperture = clspeckle::make<ClspApertureDesc>();
    auto sensor = clspeckle::make<ClspSensorDesc>();
    auto desc = clspeckle::make<ClspPipelineDesc>();
    phase.width = aperture.width = sensor.width = side;
    phase.height = aperture.height = sensor.height = side;
    sensor.lag_fraction = 0.1;
    desc.boiling_correlation_frames = 3.0;
    desc.airflow_rms_rad = 0.5;
    desc.exposure_path = 0.5;
    desc.sub_exposures = 2;
    const clspeckle::Phase surface(context, phase);
    const clspeckle::Aperture lens(context, aperture);
    const clspeckle::Sensor camera(context, sensor);
    desc.phase = surface;
    desc.aperture = lens;
    desc.sensor = camera;
    const clspeckle::Pipeline pipeline(context, desc);
    const clspeckle::Buffer ideal = light(context, queue), codes(context, pixels * 2);
    auto frame = clspeckle::make<ClspFrame>();
    frame.irradiance = ideal.image(side, side, CLSP_FORMAT_FLOAT32);
    frame.output = codes.image(side, side, CLSP_FORMAT_UINT16);
    Outcome outcome;
    for (; frame.frame_index < moving_frames; ++frame.frame_index) {
        frame.refresh =
            frame.frame_index == whole_frame || frame.frame_index == anew ? CLSP_REFRESH_ALL : CLSP_REFRESH_MASK;
        clspeckle::Event done;
        const auto enqueue = [&] { pipeline.enqueue_frame(queue, frame, {}, &done); };
        try {
            enqueue();
        } catch (const clspeckle::Error &) {
            try {
                enqueue();
            } catch (const clspeckle::Error &again) {
                if (again.status() != CLSP_ERROR_INVALID_STATE)
                    throw;
                outcome.broken_off = true;
                frame.refresh = CLSP_REFRESH_ALL;
                enqueue();
            }
        }
        done.wait();
        put(outcome.bytes, codes.read<std::uint16_t>(queue, pixels));
    }
    pipeline.check(queue);
    return outcome;
}

Outcome render_moving(const clspeckle::Context &context) {
    return render_moving_anew(whole_frame, context);
}

// What the frames are where one of them begins anew.
std::vector<Bytes> moving_begun_anew(const clspeckle::Context &context) {
    std::vector<Bytes> runs;
    for (std::uint64_t anew = 0; anew < moving_frames; ++anew)
        runs.push_back(render_moving_anew(anew, context).bytes);
    return runs;
}

constexpr std::uint64_t lagging_frames = 3;

// A sensor that lags behind a still surface, and one without a pipeline: a frame that fails is tried once more, and the
// next has the right one before it. Then the same frames in one call, after which a failure begins them anew.
Outcome lag_anew(bool anew, const clspeckle::Context &context) {
    const clspeckle::Queue queue(context);
    auto phase = clspeckle::make<ClspPhaseDesc>();
    auto aperture = clspeckle::make<ClspApertureDesc>();
    auto sensor = clspeckle::make<ClspSensorDesc>();
    phase.width = aperture.width = sensor.width = side;
    phase.height = aperture.height = sensor.height = side;
    sensor.lag_fraction = 0.5;
    const clspeckle::Sensor camera(context, sensor), alone(context, sensor);
    auto desc = clspeckle::make<ClspPipelineDesc>();
    const clspeckle::Phase surface(context, phase);
    const clspeckle::Aperture lens(context, aperture);
    desc.phase = surface;
    desc.aperture = lens;
    desc.sensor = camera;
    const clspeckle::Pipeline pipeline(context, desc);
    const clspeckle::Buffer ideal = light(context, queue);
    std::vector<clspeckle::Buffer> codes;
    std::vector<ClspFrame> frames(lagging_frames, clspeckle::make<ClspFrame>());
    for (std::uint64_t i = 0; i < lagging_frames; ++i) {
        codes.emplace_back(context, pixels * 2);
        frames[i].frame_index = i;
        frames[i].irradiance = ideal.image(side, side, CLSP_FORMAT_FLOAT32);
        frames[i].output = codes[i].image(side, side, CLSP_FORMAT_UINT16);
        // Surfaces that differ, so that frames do.
        frames[i].refresh = CLSP_REFRESH_ALL;
    }
    Outcome outcome;
    const auto twice = [&](const auto &work) {
        try {
            work();
        } catch (const clspeckle::Error &) {
            work();
        }
    };
    for (const ClspFrame &frame : frames) {
        clspeckle::Event done, seen;
        twice([&] { pipeline.enqueue_frame(queue, frame, {}, &done); });
        done.wait();
        put(outcome.bytes, codes[frame.frame_index].read<std::uint16_t>(queue, pixels));
        twice([&] { alone.enqueue_expose(queue, frame.irradiance, frame.frame_index, frame.output, {}, &seen); });
        seen.wait();
        put(outcome.bytes, codes[frame.frame_index].read<std::uint16_t>(queue, pixels));
    }
    if (anew)
        camera.reset_lag();
    clspeckle::Event done;
    const auto all = [&] { pipeline.enqueue_frames(queue, frames, {}, &done); };
    try {
        all();
    } catch (const clspeckle::Error &) {
        outcome.broken_off = true;
        all();
    }
    done.wait();
    for (const clspeckle::Buffer &one : codes)
        put(outcome.bytes, one.read<std::uint16_t>(queue, pixels));
    return outcome;
}
Outcome render_lagging(const clspeckle::Context &context) {
    return lag_anew(false, context);
}
std::vector<Bytes> lag_begun_anew(const clspeckle::Context &context) {
    return {lag_anew(true, context).bytes};
}

// A pattern thrown on a wall, an effect switched on, several frames in one call, and their statistics.
Outcome render_pattern(const clspeckle::Context &context) {
    const clspeckle::Queue queue(context, test::out_of_order(context));
    const std::vector<float> texels(5 * 7, 1.0f);
    auto pattern_desc = clspeckle::make<ClspPatternDesc>();
    pattern_desc.width = 5;
    pattern_desc.height = 7;
    pattern_desc.texels = texels.data();
    auto phase = clspeckle::make<ClspPhaseDesc>();
    auto aperture = clspeckle::make<ClspApertureDesc>();
    auto sensor = clspeckle::make<ClspSensorDesc>();
    phase.width = aperture.width = sensor.width = side;
    phase.height = aperture.height = sensor.height = side;
    const clspeckle::Pipeline pipeline(context, clspeckle::Pattern(context, pattern_desc),
                                       clspeckle::Phase(context, phase), clspeckle::Aperture(context, aperture),
                                       clspeckle::Sensor(context, sensor));
    pipeline.set_effect("row_noise");
    const clspeckle::Buffer depth(context, queue, std::vector<float>(pixels, 1.5f)), codes(context, pixels * 2);
    auto geometry = clspeckle::make<ClspGeometry>();
    geometry.depth = depth.image(side, side, CLSP_FORMAT_FLOAT32);
    geometry.fx_px = geometry.fy_px = 30;
    geometry.cx_px = geometry.cy_px = 7.5;
    auto frame = clspeckle::make<ClspFrame>();
    frame.geometry = &geometry;
    frame.refresh = CLSP_REFRESH_ALL;
    frame.output = codes.image(side, side, CLSP_FORMAT_UINT16);
    std::vector<ClspFrame> frames(2, frame);
    frames[1].frame_index = 1;
    pipeline.warm_up(queue, frame);
    clspeckle::Event done;
    pipeline.enqueue_frames(queue, frames, {}, &done);
    done.wait();
    Outcome outcome;
    put(outcome.bytes, codes.read<std::uint16_t>(queue, pixels));
    const ClspMoments moments = clspeckle::statistics::moments(context, queue, frame.output);
    put(outcome.bytes, std::vector<double>{moments.mean, moments.standard_deviation});
    put(outcome.bytes, clspeckle::statistics::histogram(context, queue, frame.output, 0, 1024, 8));
    return outcome;
}

// Light from a cl_image, codes into another one.
Outcome cl_images(const clspeckle::Context &context) {
    const auto own = [](cl_int code, const char *call) {
        if (code != CL_SUCCESS)
            throw clspeckle::Error(CLSP_ERROR_OPENCL, code, call, "the test's own call failed", "");
    };
    const auto make = [&](cl_channel_type type) {
        const cl_image_format format{CL_R, type};
        cl_image_desc desc{};
        desc.image_type = CL_MEM_OBJECT_IMAGE2D;
        desc.image_width = desc.image_height = side;
        cl_int code = CL_SUCCESS;
        auto made = clspeckle::ClImage::adopt(
            clCreateImage(context.info().cl_context_handle, CL_MEM_READ_WRITE, &format, &desc, nullptr, &code));
        own(code, "clCreateImage");
        return made;
    };
    Outcome outcome;
    put(outcome.bytes, std::string(context.interop_info().gl_textures_reason));
    const clspeckle::Queue queue(context);
    const clspeckle::ClImage picture = make(CL_FLOAT), codes = make(CL_UNSIGNED_INT16);
    const std::vector<float> values(pixels, 0.5f);
    const std::size_t origin[3] = {0, 0, 0}, region[3] = {side, side, 1};
    own(clEnqueueWriteImage(queue, picture, CL_TRUE, origin, region, 0, 0, values.data(), 0, nullptr, nullptr),
        "clEnqueueWriteImage");
    auto phase = clspeckle::make<ClspPhaseDesc>();
    auto aperture = clspeckle::make<ClspApertureDesc>();
    auto sensor = clspeckle::make<ClspSensorDesc>();
    phase.width = aperture.width = sensor.width = side;
    phase.height = aperture.height = sensor.height = side;
    const clspeckle::Pipeline pipeline(context, clspeckle::Phase(context, phase),
                                       clspeckle::Aperture(context, aperture), clspeckle::Sensor(context, sensor));
    const clspeckle::Buffer ideal(context, pixels * 4), output(context, pixels * 2);
    auto frame = clspeckle::make<ClspFrame>();
    frame.irradiance = ideal.image(side, side, CLSP_FORMAT_FLOAT32);
    frame.output = output.image(side, side, CLSP_FORMAT_UINT16);
    clspeckle::Event done;
    picture.enqueue_import(context, queue, 0, frame.irradiance);
    pipeline.enqueue_frame(queue, frame);
    codes.enqueue_export(context, queue, frame.output, {}, &done);
    done.wait();
    std::vector<std::uint16_t> texels(pixels);
    own(clEnqueueReadImage(queue, codes, CL_TRUE, origin, region, 0, 0, texels.data(), 0, nullptr, nullptr),
        "clEnqueueReadImage");
    put(outcome.bytes, texels);
    pipeline.check(queue);
    return outcome;
}

// A folder of this process's own, removed with it.
const std::string &own_folder() {
    static const std::string path =
        (fs::temp_directory_path() / ("clspeckle-faults-" + std::to_string(::getpid()))).string();
    static const struct Cleaner {
        ~Cleaner() { fs::remove_all(path); }
    } cleaner;
    const faults::Aside aside;
    fs::create_directories(path);
    return path;
}

// Another one on the same device, which has nothing in memory yet; its programs are on disk.
clspeckle::Context fresh(const clspeckle::Context &context) {
    auto desc = clspeckle::make<ClspContextDesc>();
    const ClspContextInfo info = context.info();
    desc.cl_context_handle = info.cl_context_handle;
    desc.cl_device = info.cl_device;
    desc.disk_cache = CLSP_DISK_CACHE_ON;
    const std::string folder = own_folder() + "/programs";
    desc.cache_dir = folder.c_str();
    return clspeckle::Context(desc);
}

std::vector<float> doe_texels(const clspeckle::Context &context, std::uint32_t evaluation, const char *cache_dir) {
    std::vector<float> phase(6 * 4);
    for (std::size_t i = 0; i < phase.size(); ++i)
        phase[i] = static_cast<float>(i * i % 7);
    auto desc = clspeckle::make<ClspDoePatternDesc>();
    desc.width = 6;
    desc.height = 4;
    desc.phase = phase.data();
    desc.pixel_pitch_m = 2e-6;
    desc.image_width = 9;
    desc.image_height = 7;
    desc.half_extent_x = desc.half_extent_y = 0.15;
    desc.evaluation = evaluation;
    desc.cache_dir = cache_dir;
    auto beam = clspeckle::make<ClspBeamProfile>();
    beam.kind = CLSP_BEAM_FLAT_SQUARE;
    beam.width_m = 12e-6;
    beam.height_m = 8e-6;
    if (evaluation == CLSP_DOE_EVALUATION_APERTURE)
        desc.beam = &beam;
    return clspeckle::DoePattern(context, desc).texels();
}

// Both evaluations, and spots.
Outcome doe(const clspeckle::Context &shared) {
    const clspeckle::Context context = fresh(shared);
    Outcome outcome;
    put(outcome.bytes, doe_texels(context, CLSP_DOE_EVALUATION_ORDERS, nullptr));
    put(outcome.bytes, doe_texels(context, CLSP_DOE_EVALUATION_APERTURE, nullptr));
    auto spots = clspeckle::make<ClspSpotPatternDesc>();
    const std::vector<double> directions = {0.0, 0.1, 0.2, -0.1};
    spots.count = 2;
    spots.directions = directions.data();
    spots.image_width = 33;
    spots.image_height = 21;
    put(outcome.bytes, clspeckle::DoePattern(context, spots).texels());
    return outcome;
}

// Computed and written to disk, and read from there.
Outcome doe_cached(const clspeckle::Context &shared) {
    const std::string folder = own_folder() + "/patterns";
    {
        const faults::Aside aside;
        fs::create_directories(folder);
        for (const fs::directory_entry &entry : fs::directory_iterator(folder))
            fs::remove(entry);
    }
    Outcome outcome;
    for (int run = 0; run < 2; ++run)
        put(outcome.bytes, doe_texels(fresh(shared), CLSP_DOE_EVALUATION_ORDERS, folder.c_str()));
    return outcome;
}

Outcome doe_design(const clspeckle::Context &context) {
    Outcome outcome;
    const std::vector<ClspDoeDesignOrder> orders = {{-1, 1, 1.0}, {1, -1, 1.0}, {0, 0, 1.0}};
    auto design = clspeckle::make<ClspDoeDesignDesc>();
    design.width = 6;
    design.height = 5;
    design.pixel_pitch_m = 2e-6;
    design.orders = orders.data();
    design.order_count = orders.size();
    design.iterations = 2;
    put(outcome.bytes, std::vector<double>{clspeckle::DoeDesign(context, design).report().efficiency});
    return outcome;
}

Outcome depth(const clspeckle::Context &context) {
    const clspeckle::Queue queue(context);
    constexpr std::uint32_t wide = 32;
    std::vector<float> values(wide * wide, 10.0f);
    const double centers[][2] = {{8.3, 9.1}, {20.2, 11.7}, {15.1, 24.6}};
    std::vector<double> directions;
    for (const auto &c : centers) {
        for (std::uint32_t i = 0; i < values.size(); ++i)
            values[i] += static_cast<float>(
                220.0 * std::exp(-(std::pow(i % wide - c[0], 2) + std::pow(double(i / wide) - c[1], 2)) / 4.5));
        directions.insert(directions.end(), {(c[0] - 15.5) / 60.0 - 0.05, (c[1] - 15.5) / 60.0});
    }
    const clspeckle::Buffer image(context, queue, values);
    auto desc = clspeckle::make<ClspDepthDesc>();
    desc.width = desc.height = wide;
    desc.max_dots = 16;
    desc.directions = directions.data();
    desc.direction_count = directions.size() / 2;
    desc.laser_from_camera[3] = -0.05;
    desc.fx_px = desc.fy_px = 60;
    desc.cx_px = desc.cy_px = 15.5;
    const clspeckle::Depth depth(context, desc);
    depth.enqueue_detect(queue, image.image(wide, wide, CLSP_FORMAT_FLOAT32));
    Outcome outcome;
    put(outcome.bytes, depth.dots(queue).dots);
    return outcome;
}

// Stage by stage, without a pipeline; and one frame in one call.
Outcome stages(const clspeckle::Context &context) {
    const clspeckle::Queue queue(context);
    const clspeckle::Buffer ideal = light(context, queue), intensity(context, pixels * 4),
                            distorted(context, pixels * 4), codes(context, pixels * 2), colors(context, pixels * 12),
                            mask(context, queue, std::vector<std::uint8_t>(pixels, 1)), uniform(context, pixels * 4);
    const auto floats = [](const clspeckle::Buffer &buffer) { return buffer.image(side, side, CLSP_FORMAT_FLOAT32); };
    const ClspImage bytes = mask.image(side, side, CLSP_FORMAT_UINT8),
                    numbers = codes.image(side, side, CLSP_FORMAT_UINT16);
    clspeckle::philox::enqueue_fill(context, queue, clspeckle::make<ClspPhiloxDesc>(), floats(uniform));
    auto phase_desc = clspeckle::make<ClspPhaseDesc>();
    auto aperture_desc = clspeckle::make<ClspApertureDesc>();
    auto lens_desc = clspeckle::make<ClspLensDesc>();
    auto sensor_desc = clspeckle::make<ClspSensorDesc>();
    phase_desc.width = aperture_desc.width = lens_desc.width = sensor_desc.width = side;
    phase_desc.height = aperture_desc.height = lens_desc.height = sensor_desc.height = side;
    phase_desc.dynamics = CLSP_DYNAMICS_CONTINUOUS;
    aperture_desc.degree_of_polarization = 0.5;
    lens_desc.k1 = 0.1;
    lens_desc.vignetting_corner_loss = 0.3;
    sensor_desc.prnu = 0.05;
    sensor_desc.hot_pixel_fraction = 0.05;
    const clspeckle::Phase phase(context, phase_desc);
    const clspeckle::Aperture aperture(context, aperture_desc);
    const clspeckle::Lens lens(context, lens_desc);
    const clspeckle::Sensor sensor(context, sensor_desc);
    const clspeckle::Buffer state(context, phase.state_size());
    phase.enqueue_refresh(queue, 0);
    phase.enqueue_save(queue, state);
    auto advance = clspeckle::make<ClspPhaseAdvance>();
    advance.uniform_path = 0.3;
    phase.enqueue_advance(queue, 1, advance);
    phase.enqueue_restore(queue, state);
    phase.enqueue_refresh(queue, 2, &bytes);
    lens.enqueue_distort(queue, CLSP_INTERPOLATION_LINEAR, floats(ideal), floats(distorted));
    aperture.enqueue_intensity(queue, phase, floats(distorted), floats(intensity));
    lens.enqueue_finish(queue, floats(intensity), false, floats(intensity));
    sensor.enqueue_expose(queue, floats(intensity), 0, numbers);
    sensor.enqueue_demosaic(queue, numbers, CLSP_BAYER_RGGB, colors.image(side, side, CLSP_FORMAT_FLOAT32X3));
    queue.finish();
    phase.check(queue);
    Outcome outcome;
    put(outcome.bytes, uniform.read<float>(queue, pixels));
    put(outcome.bytes, codes.read<std::uint16_t>(queue, pixels));
    put(outcome.bytes, colors.read<float>(queue, 3 * pixels));
    put(outcome.bytes,
        clspeckle::simulate(std::vector<float>(pixels, 0.4f), side, side, 7, 0, nullptr, nullptr, context));
    return outcome;
}

// Dots on two materials that move, behind a lens that distorts.
Outcome render_scene(const clspeckle::Context &context) {
    const clspeckle::Queue queue(context);
    const std::vector<double> positions{4.3, 4.1, 12.2, 3.7, 4.0, 11.9};
    std::vector<ClspMaterial> materials(2, clspeckle::make<ClspMaterial>());
    materials[1].correlation_time_s = 0.1;
    const clspeckle::MaterialTable table(context, materials);
    auto dots_desc = clspeckle::make<ClspDotsDesc>();
    auto phase_desc = clspeckle::make<ClspPhaseDesc>();
    auto aperture_desc = clspeckle::make<ClspApertureDesc>();
    auto lens_desc = clspeckle::make<ClspLensDesc>();
    auto sensor_desc = clspeckle::make<ClspSensorDesc>();
    auto motion_desc = clspeckle::make<ClspMotionDesc>();
    for (auto *size : {&dots_desc.width, &dots_desc.height, &phase_desc.width, &phase_desc.height, &aperture_desc.width,
                       &aperture_desc.height, &lens_desc.width, &lens_desc.height, &sensor_desc.width,
                       &sensor_desc.height, &motion_desc.width, &motion_desc.height})
        *size = side;
    dots_desc.positions_px = positions.data();
    dots_desc.count = 3;
    phase_desc.dynamics = CLSP_DYNAMICS_CONTINUOUS;
    phase_desc.translate = motion_desc.translate = 1;
    lens_desc.k1 = 0.1;
    motion_desc.materials = table;
    motion_desc.fx_px = motion_desc.fy_px = 40;
    motion_desc.cx_px = motion_desc.cy_px = 7.5;
    const clspeckle::Dots dots(context, dots_desc);
    const clspeckle::Phase phase(context, phase_desc);
    const clspeckle::Aperture aperture(context, aperture_desc);
    const clspeckle::Lens lens(context, lens_desc);
    const clspeckle::Sensor sensor(context, sensor_desc);
    const clspeckle::Motion motion(context, motion_desc);
    auto desc = clspeckle::make<ClspPipelineDesc>();
    desc.dots = dots;
    desc.phase = phase;
    desc.aperture = aperture;
    desc.lens = lens;
    desc.sensor = sensor;
    desc.materials = table;
    desc.motion = motion;
    desc.shutter_fraction = 0.5;
    desc.sub_exposures = 2;
    const clspeckle::Pipeline pipeline(context, desc);
    const clspeckle::Buffer depth(context, queue, std::vector<float>(pixels, 1.0f)),
        vectors(context, queue, std::vector<float>(2 * pixels, 0.6f)),
        ids(context, queue, std::vector<std::uint8_t>(pixels, 1)), codes(context, pixels * 2);
    auto input = clspeckle::make<ClspMotionInput>();
    input.depth = input.previous_depth = depth.image(side, side, CLSP_FORMAT_FLOAT32);
    input.motion = vectors.image(side, side, CLSP_FORMAT_FLOAT32X2);
    input.material = ids.image(side, side, CLSP_FORMAT_UINT8);
    input.frame_time_s = 1.0 / 30;
    auto frame = clspeckle::make<ClspFrame>();
    frame.output = codes.image(side, side, CLSP_FORMAT_UINT16);
    frame.material = input.material;
    frame.refresh = CLSP_REFRESH_ALL;
    pipeline.enqueue_frame(queue, frame);
    frame.refresh = CLSP_REFRESH_MASK;
    frame.motion = &input;
    frame.frame_index = 1;
    pipeline.enqueue_frame(queue, frame);
    Outcome outcome;
    put(outcome.bytes, codes.read<std::uint16_t>(queue, pixels));
    pipeline.check(queue);
    return outcome;
}

Outcome statistics(const clspeckle::Context &context) {
    const clspeckle::Queue queue(context);
    const clspeckle::Buffer values = light(context, queue), mask(context, queue, std::vector<std::uint8_t>(pixels, 1));
    const ClspImage image = values.image(side, side, CLSP_FORMAT_FLOAT32),
                    counts = mask.image(side, side, CLSP_FORMAT_UINT8);
    Outcome outcome;
    for (const ClspImage *chosen : {static_cast<const ClspImage *>(nullptr), &counts}) {
        const ClspMoments moments = clspeckle::statistics::moments(context, queue, image, chosen);
        put(outcome.bytes, std::vector<double>{moments.mean, moments.standard_deviation});
        put(outcome.bytes, clspeckle::statistics::histogram(context, queue, image, 0, 1, 8, chosen));
    }
    put(outcome.bytes, clspeckle::statistics::autocovariance(context, queue, image, 3));
    return outcome;
}

// What is measured differs from run to run; what is kept is a record or nothing.
Outcome tune(const clspeckle::Context &context) {
    const std::string record = own_folder() + "/tuning.json";
    {
        const faults::Aside aside;
        fs::remove(record);
    }
    const ClspTuningSize size{256, 256};
    auto desc = clspeckle::make<ClspTuningDesc>();
    desc.frames = 1;
    desc.sizes = &size;
    desc.size_count = 1;
    desc.path = record.c_str();
    const auto is_whole = [&] {
        const faults::Aside aside;
        std::ifstream stream(record);
        const std::string text{std::istreambuf_iterator<char>(stream), {}};
        return text.empty() ||
               (text.find("\"records\"") != std::string::npos && text.compare(text.size() - 2, 2, "}\n") == 0);
    };
    Outcome outcome;
    try {
        const clspeckle::Tuning tuning(context, desc);
        put(outcome.bytes, tuning.path());
    } catch (...) {
        EXPECT_TRUE(is_whole());
        throw;
    }
    EXPECT_TRUE(is_whole());
    return outcome;
}

clspeckle::Capture dark_set() {
    auto camera = clspeckle::make<ClspCaptureDesc>();
    camera.width = camera.height = side;
    const clspeckle::Capture capture(camera);
    std::mt19937 engine(3); // its sequence is the standard's, so that the set is the same everywhere
    std::vector<std::uint16_t> codes(4 * pixels);
    for (std::uint16_t &code : codes)
        code = static_cast<std::uint16_t>(64 + engine() % 15);
    capture.add_sequence("dark", CLSP_SCENE_DARK, false, codes);
    return capture;
}

clspeckle::Diagnosis diagnosed(const clspeckle::Context &context, bool evidence) {
    clspeckle::DiagnoseOptions options;
    options.null_replicates = 12;
    options.max_effects = 1;
    options.evidence = evidence;
    options.threads = 1;
    return clspeckle::diagnose(context, dark_set(), options);
}

Outcome diagnose(const clspeckle::Context &context) {
    const clspeckle::Diagnosis found = diagnosed(context, false);
    Outcome outcome;
    put(outcome.bytes, found.report_json());
    put(outcome.bytes, found.profile().json());
    return outcome;
}

// What a diagnosis and a capture tell, as JSON and as a page.
Outcome reports(const clspeckle::Context &context) {
    static const clspeckle::Diagnosis found = diagnosed(context, true);
    static const clspeckle::Capture capture = dark_set();
    const fs::path page = own_folder() + "/report.html";
    {
        const faults::Aside aside;
        fs::remove(page);
    }
    Outcome outcome;
    put(outcome.bytes, found.report_json());
    put(outcome.bytes, found.profile().json());
    put(outcome.bytes, capture.summary_json());
    put(outcome.bytes, capture.emva1288_json());
    try {
        found.write_html(page.string());
    } catch (...) {
        const faults::Aside aside;
        EXPECT_FALSE(fs::exists(page)) << "half a page";
        throw;
    }
    return outcome;
}

// A set and a profile, written and read.
Outcome files(const clspeckle::Context &) {
    const fs::path folder = own_folder() + "/sets";
    const std::string profile = (folder / "camera.json").string();
    {
        const faults::Aside aside;
        fs::remove_all(folder);
        fs::create_directories(folder);
        std::ofstream(profile) << R"({"format": "clspeckle-camera-profile", "version": 1})";
    }
    Outcome outcome;
    try {
        const clspeckle::Capture made = dark_set();
        made.write((folder / "set").string());
        const clspeckle::Capture capture = clspeckle::Capture::open((folder / "set").string());
        put(outcome.bytes, capture.codes(0));
        put(outcome.bytes, capture.summary_json());
        try {
            clspeckle::Profile::open(profile);
        } catch (const clspeckle::Error &error) {
            if (error.status() != CLSP_ERROR_INVALID_DATA && error.status() != CLSP_ERROR_INVALID_ARGUMENT)
                throw;
            put(outcome.bytes, error.message());
        }
    } catch (...) {
        const faults::Aside aside;
        // What is there is whole: the last file that is written is capture.json, and it names the others.
        if (fs::exists(folder / "set" / "capture.json")) {
            EXPECT_EQ(4u * pixels, clspeckle::Capture::open((folder / "set").string()).codes(0).size());
        }
        throw;
    }
    return outcome;
}

// From nothing: device, context, programs from a cache on disk, one frame.
Outcome cold(const clspeckle::Context &) {
    const std::string folder = own_folder() + "/cold";
    auto desc = clspeckle::make<ClspContextDesc>();
    desc.disk_cache = CLSP_DISK_CACHE_ON;
    desc.cache_dir = folder.c_str();
    return render_pattern(clspeckle::Context(desc));
}

// What was under way, for a crash.
char g_doing[200] = "";
extern "C" void tell(int signal) {
    const ssize_t ignored = ::write(2, g_doing, std::strlen(g_doing));
    static_cast<void>(ignored);
    std::signal(signal, SIG_DFL);
    std::raise(signal);
}

struct Scenario {
    const char *name;
    Outcome (*work)(const clspeckle::Context &);
    // Faults of each kind at most, spread over all calls.
    std::uint64_t opencl, allocations, files;
    // What a run that was told to begin anew may have.
    std::vector<Bytes> (*begun_anew)(const clspeckle::Context &) = nullptr;
};

class Faults : public ::testing::TestWithParam<Scenario> {};

const char *name_of(Kind kind) {
    return kind == Kind::kOpenCl ? "OpenCL call" : kind == Kind::kAllocation ? "allocation" : "file call";
}

// What a call may answer where something of this kind failed in it.
bool is_answer(Kind kind, ClspStatus status) {
    switch (kind) {
    case Kind::kOpenCl:
        return status == CLSP_ERROR_OPENCL || status == CLSP_ERROR_BUILD || status == CLSP_ERROR_OUT_OF_MEMORY ||
               status == CLSP_ERROR_NO_DEVICE;
    case Kind::kAllocation:
        return status == CLSP_ERROR_OUT_OF_MEMORY;
    default:
        return status == CLSP_ERROR_IO;
    }
}

// What a run may leave behind, but for memory: objects of OpenCL, open files, files that are written.
struct Left {
    std::int64_t objects = 0;
    std::size_t descriptors = 0, temporary = 0;
    bool operator==(const Left &other) const {
        return objects == other.objects && descriptors == other.descriptors && temporary == other.temporary;
    }
};
std::ostream &operator<<(std::ostream &to, const Left &left) {
    return to << left.objects << " OpenCL objects, " << left.descriptors << " open files, " << left.temporary
              << " temporary files";
}
Left left_behind() {
    const faults::Aside aside;
    Left left;
    left.objects = faults::live_objects();
    left.descriptors =
        static_cast<std::size_t>(std::distance(fs::directory_iterator("/proc/self/fd"), fs::directory_iterator()));
    for (const fs::directory_entry &entry : fs::recursive_directory_iterator(own_folder()))
        left.temporary += entry.path().string().find(".part") != std::string::npos;
    return left;
}

// Of the library's own memory, but for the last error's two texts, which keep the room that they once needed.
std::int64_t blocks_in_use() {
    clspDeviceList(0, nullptr, nullptr);
    return faults::live_blocks();
}
constexpr std::int64_t blocks_of_last_error = 2;

std::uint64_t g_injected = 0;

TEST_P(Faults, AreToldAndLeaveNothing) {
    const Scenario &scenario = GetParam();
    const clspeckle::Context context; // its programs are built once, and must not be spoilt by a build that fails
    const auto run = [&] { return scenario.work(context); };
    run();
    const Outcome expected = run();
    const std::vector<Bytes> begun_anew = scenario.begun_anew ? scenario.begun_anew(context) : std::vector<Bytes>();
    const Left left = left_behind();
    std::uint64_t injected = 0, told = 0, silent = 0;
    for (const Kind kind : {Kind::kOpenCl, Kind::kAllocation, Kind::kFile}) {
        const std::uint64_t most = kind == Kind::kOpenCl       ? scenario.opencl
                                   : kind == Kind::kAllocation ? scenario.allocations
                                                               : scenario.files;
        faults::arm(kind, 0);
        run();
        faults::disarm();
        const std::uint64_t calls = faults::calls();
        const std::int64_t blocks = blocks_in_use();
        const std::uint64_t count = std::min(calls, most);
        for (std::uint64_t i = 0; i < count; ++i)
            for (const bool lasting : {false, true}) {
                const std::uint64_t n = 1 + i * calls / count;
                std::snprintf(g_doing, sizeof g_doing, "%s: %s %llu of %llu%s\n", scenario.name, name_of(kind),
                              static_cast<unsigned long long>(n), static_cast<unsigned long long>(calls),
                              lasting ? " and all after it" : "");
                SCOPED_TRACE(g_doing);
                faults::arm(kind, n, lasting);
                try {
                    const Outcome outcome = run();
                    faults::disarm();
                    const bool is_begun_anew =
                        outcome.broken_off &&
                        std::find(begun_anew.begin(), begun_anew.end(), outcome.bytes) != begun_anew.end();
                    EXPECT_TRUE(is_begun_anew || expected.bytes == outcome.bytes)
                        << "other bytes in silence after " << faults::failed() << ", from byte "
                        << std::mismatch(outcome.bytes.begin(), outcome.bytes.end(), expected.bytes.begin(),
                                         expected.bytes.end())
                                   .first -
                               outcome.bytes.begin();
                    ++silent;
                } catch (const clspeckle::Error &error) {
                    faults::disarm();
                    EXPECT_NE("", error.message()) << faults::failed();
                    EXPECT_TRUE(is_answer(kind, error.status()))
                        << faults::failed() << ": " << clspStatusString(error.status()) << ": " << error.message();
                    ++told;
                } catch (const std::bad_alloc &) {
                    faults::disarm();
                    ++told; // the binding's own strings
                }
                injected += faults::has_failed();
                EXPECT_EQ(left, left_behind()) << "after " << faults::failed();
            }
        const Outcome after = run();
        EXPECT_EQ(expected.bytes, after.bytes) << "after faults of " << name_of(kind);
        EXPECT_EQ(left, left_behind());
        EXPECT_LE(blocks_in_use(), blocks + blocks_of_last_error) << "memory left after faults of " << name_of(kind);
    }
    std::printf("%s: %llu faults, %llu told, %llu without effect\n", scenario.name,
                static_cast<unsigned long long>(injected), static_cast<unsigned long long>(told),
                static_cast<unsigned long long>(silent));
    EXPECT_GT(injected, 20u);
    g_injected += injected;
}

INSTANTIATE_TEST_SUITE_P(
    All, Faults,
    ::testing::Values(Scenario{"moving", render_moving, 400, 200, 20, moving_begun_anew},
                      Scenario{"lagging", render_lagging, 400, 100, 20, lag_begun_anew},
                      Scenario{"pattern", render_pattern, 300, 150, 20}, Scenario{"scene", render_scene, 200, 100, 20},
                      Scenario{"stages", stages, 200, 100, 20}, Scenario{"cl_images", cl_images, 200, 100, 20},
                      Scenario{"doe", doe, 60, 40, 20}, Scenario{"doe_cached", doe_cached, 60, 30, 60},
                      Scenario{"doe_design", doe_design, 200, 100, 20}, Scenario{"depth", depth, 200, 100, 20},
                      Scenario{"statistics", statistics, 200, 100, 20}, Scenario{"tune", tune, 10, 10, 15},
                      Scenario{"diagnose", diagnose, 20, 20, 5}, Scenario{"reports", reports, 0, 300, 40},
                      Scenario{"files", files, 0, 300, 200}, Scenario{"cold", cold, 40, 40, 40}),
    [](const auto &scenario) { return std::string(scenario.param.name); });

// After all scenarios, where none was left out.
class Count : public ::testing::Environment {
  public:
    void TearDown() override {
        const ::testing::UnitTest &test = *::testing::UnitTest::GetInstance();
        std::printf("%llu faults in all\n", static_cast<unsigned long long>(g_injected));
        if (test.test_to_run_count() == test.total_test_count()) {
            EXPECT_GE(g_injected, 3000u);
        }
    }
};
const ::testing::Environment *const g_count = ::testing::AddGlobalTestEnvironment(new Count);

} // namespace

int main(int argc, char **argv) {
    faults::install();
    for (const int signal : {SIGSEGV, SIGABRT, SIGFPE, SIGBUS})
        std::signal(signal, tell);
    ::testing::InitGoogleTest(&argc, argv);
    return RUN_ALL_TESTS();
}

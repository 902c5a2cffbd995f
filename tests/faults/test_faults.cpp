// What a program does through the C API, again and again, each time with another call that fails: an OpenCL call, an
// allocation, a file; once or from then on. The call must answer with a status and words, or have the result of a run without
// faults; nothing is left behind, and the next run is right.
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

// A surface that boils behind air that flows, before a sensor that lags, from a frame on. A frame that fails is tried once more;
// a refusal to go on is obeyed.
Outcome render_from(std::uint64_t first, std::uint32_t first_refresh, const clspeckle::Context &context) {
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
    for (frame.frame_index = first; frame.frame_index < moving_frames; ++frame.frame_index) {
        frame.refresh = frame.frame_index == whole_frame ? CLSP_REFRESH_ALL
                        : frame.frame_index == first     ? first_refresh
                                                         : CLSP_REFRESH_MASK;
        clspeckle::Event done;
        const auto enqueue = [&] { pipeline.enqueue_frame(queue, frame, {}, &done); };
        try {
            enqueue();
        } catch (const clspeckle::Error &) {
            // Air and lag begin anew with it, where they had begun to move.
            outcome.broken_off = frame.refresh == CLSP_REFRESH_ALL;
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
    return render_from(0, CLSP_REFRESH_MASK, context);
}

// What the frames are where one of them begins anew: from there on those of a pipeline that had none before.
std::vector<Bytes> moving_begun_anew(const clspeckle::Context &context) {
    const Bytes all = render_moving(context).bytes;
    std::vector<Bytes> runs;
    for (std::uint64_t first = 0; first < moving_frames; ++first) {
        const Bytes rest = render_from(first, CLSP_REFRESH_ALL, context).bytes;
        runs.emplace_back(all.begin(), all.end() - static_cast<std::ptrdiff_t>(rest.size()));
        runs.back().insert(runs.back().end(), rest.begin(), rest.end());
    }
    return runs;
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
    const clspeckle::Pipeline pipeline(context, clspeckle::Pattern(context, pattern_desc), clspeckle::Phase(context, phase),
                                       clspeckle::Aperture(context, aperture), clspeckle::Sensor(context, sensor));
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
    own(clEnqueueWriteImage(queue, picture, CL_TRUE, origin, region, 0, 0, values.data(), 0, nullptr, nullptr), "clEnqueueWriteImage");
    auto phase = clspeckle::make<ClspPhaseDesc>();
    auto aperture = clspeckle::make<ClspApertureDesc>();
    auto sensor = clspeckle::make<ClspSensorDesc>();
    phase.width = aperture.width = sensor.width = side;
    phase.height = aperture.height = sensor.height = side;
    const clspeckle::Pipeline pipeline(context, clspeckle::Phase(context, phase), clspeckle::Aperture(context, aperture),
                                       clspeckle::Sensor(context, sensor));
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
    own(clEnqueueReadImage(queue, codes, CL_TRUE, origin, region, 0, 0, texels.data(), 0, nullptr, nullptr), "clEnqueueReadImage");
    put(outcome.bytes, texels);
    pipeline.check(queue);
    return outcome;
}

Outcome doe(const clspeckle::Context &context) {
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
    Outcome outcome;
    put(outcome.bytes, clspeckle::DoePattern(context, desc).texels());
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
    const fs::path page = fs::temp_directory_path() / ("clspeckle-report-" + std::to_string(::getpid()) + ".html");
    fs::remove(page);
    Outcome outcome;
    put(outcome.bytes, found.report_json());
    put(outcome.bytes, found.profile().json());
    put(outcome.bytes, capture.summary_json());
    put(outcome.bytes, capture.emva1288_json());
    try {
        found.write_html(page.string());
    } catch (...) {
        faults::disarm();
        EXPECT_FALSE(fs::exists(page)) << "half a page";
        throw;
    }
    fs::remove(page);
    return outcome;
}

// A set and a profile, written and read.
Outcome files(const clspeckle::Context &) {
    const fs::path folder = fs::temp_directory_path() / ("clspeckle-faults-" + std::to_string(::getpid()));
    fs::remove_all(folder);
    fs::create_directories(folder);
    Outcome outcome;
    const auto run = [&] {
        const clspeckle::Capture made = dark_set();
        made.write((folder / "set").string());
        const clspeckle::Capture capture = clspeckle::Capture::open((folder / "set").string());
        put(outcome.bytes, capture.codes(0));
        put(outcome.bytes, capture.summary_json());
        const std::string profile = (folder / "camera.json").string();
        std::ofstream(profile) << R"({"format": "clspeckle-camera-profile", "version": 1})";
        try {
            clspeckle::Profile::open(profile);
        } catch (const clspeckle::Error &error) {
            if (error.status() != CLSP_ERROR_INVALID_DATA && error.status() != CLSP_ERROR_INVALID_ARGUMENT)
                throw;
            put(outcome.bytes, error.message());
        }
    };
    try {
        run();
    } catch (...) {
        faults::disarm();
        // What is there is whole: the last file that is written is capture.json, and it names the others.
        if (fs::exists(folder / "set" / "capture.json")) {
            EXPECT_EQ(4u * pixels, clspeckle::Capture::open((folder / "set").string()).codes(0).size());
        }
        for (const fs::directory_entry &entry : fs::recursive_directory_iterator(folder)) {
            EXPECT_EQ(std::string::npos, entry.path().string().find(".part")) << "left behind: " << entry.path();
        }
        fs::remove_all(folder);
        throw;
    }
    fs::remove_all(folder);
    return outcome;
}

// From nothing: device, context, programs from a cache on disk, one frame.
Outcome cold(const clspeckle::Context &) {
    static const std::string folder = (fs::temp_directory_path() / ("clspeckle-cache-" + std::to_string(::getpid()))).string();
    static const struct Cleaner {
        ~Cleaner() { fs::remove_all(folder); }
    } cleaner;
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

TEST_P(Faults, AreToldAndLeaveNothing) {
    const Scenario &scenario = GetParam();
    const clspeckle::Context context; // its programs are built once, and must not be spoilt by a build that fails
    const auto run = [&] { return scenario.work(context); };
    run();
    const Outcome expected = run();
    const std::vector<Bytes> begun_anew = scenario.begun_anew ? scenario.begun_anew(context) : std::vector<Bytes>();
    const std::int64_t live = faults::live_objects();
    std::uint64_t injected = 0, told = 0, silent = 0;
    for (const Kind kind : {Kind::kOpenCl, Kind::kAllocation, Kind::kFile}) {
        const std::uint64_t most = kind == Kind::kOpenCl       ? scenario.opencl
                                   : kind == Kind::kAllocation ? scenario.allocations
                                                               : scenario.files;
        faults::arm(kind, 0);
        run();
        faults::disarm();
        const std::uint64_t calls = faults::calls();
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
                        << std::mismatch(outcome.bytes.begin(), outcome.bytes.end(), expected.bytes.begin()).first -
                               outcome.bytes.begin();
                    ++silent;
                } catch (const clspeckle::Error &error) {
                    faults::disarm();
                    EXPECT_NE("", error.message()) << faults::failed();
                    EXPECT_NE(CLSP_ERROR_INVALID_ARGUMENT, error.status()) << error.message();
                    ++told;
                } catch (const std::bad_alloc &) {
                    faults::disarm();
                    ++told; // the binding's own strings
                }
                injected += faults::has_failed();
                EXPECT_EQ(live, faults::live_objects()) << "objects left after " << faults::failed();
            }
        const Outcome after = run();
        EXPECT_EQ(expected.bytes, after.bytes) << "after faults of " << name_of(kind);
        EXPECT_EQ(live, faults::live_objects());
    }
    std::printf("%s: %llu faults, %llu told, %llu without effect\n", scenario.name,
                static_cast<unsigned long long>(injected), static_cast<unsigned long long>(told),
                static_cast<unsigned long long>(silent));
    EXPECT_GT(injected, 20u);
}

INSTANTIATE_TEST_SUITE_P(All, Faults,
                         ::testing::Values(Scenario{"moving", render_moving, 400, 200, 20, moving_begun_anew},
                                           Scenario{"pattern", render_pattern, 300, 150, 20}, Scenario{"cl_images", cl_images, 200, 100, 20},
                                           Scenario{"doe", doe, 200, 100, 20}, Scenario{"depth", depth, 200, 100, 20},
                                           Scenario{"diagnose", diagnose, 20, 20, 5}, Scenario{"reports", reports, 0, 300, 40},
                                           Scenario{"files", files, 0, 300, 200}, Scenario{"cold", cold, 40, 40, 40}),
                         [](const auto &scenario) { return std::string(scenario.param.name); });

} // namespace

int main(int argc, char **argv) {
    faults::install();
    for (const int signal : {SIGSEGV, SIGABRT, SIGFPE, SIGBUS})
        std::signal(signal, tell);
    ::testing::InitGoogleTest(&argc, argv);
    return RUN_ALL_TESTS();
}

// Frames in flight: while the device renders one frame, the host brings the ideal image of the next one and fetches the
// one before. Two slots take turns; each has a pipeline, a queue and memory of its own. Speckle and noise are drawn
// from seed and frame number alone, so the frames are the same bits as one slot's.
//
// What carries over from frame to frame (phases that a mask refreshes, motion, an image lag) stays in one pipeline:
// such scenes need one slot, and clspPipelineEnqueueFrames() to have several frames enqueued at once.
//
//     frames_in_flight [WIDTH HEIGHT FRAMES]        by default 640 480 200; prints frames a second with 1 and 2 slots
#include <clspeckle/clspeckle.hpp>

#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <deque>
#include <exception>
#include <stdexcept>
#include <string>
#include <vector>

namespace {

void check_cl(cl_int code, const char *what) {
    if (code != CL_SUCCESS)
        throw std::runtime_error(std::string(what) + " failed with OpenCL code " + std::to_string(code));
}

// What one frame in flight needs.
class Slot {
  public:
    Slot(const clspeckle::Context &context, std::uint32_t width, std::uint32_t height)
        : queue_(context), irradiance_(context, queue_, std::vector<float>(std::size_t{width} * height)),
          output_(context, sizeof(std::uint16_t) * width * height) {
        auto phase = clspeckle::make<ClspPhaseDesc>();
        auto aperture = clspeckle::make<ClspApertureDesc>();
        auto sensor = clspeckle::make<ClspSensorDesc>();
        phase.width = aperture.width = sensor.width = width;
        phase.height = aperture.height = sensor.height = height;
        phase.seed = sensor.seed = 2024; // the same in all slots
        aperture.normalization = CLSP_NORMALIZATION_UNIT_MEAN;
        pipeline_ = clspeckle::Pipeline(context, clspeckle::Phase(context, phase),
                                        clspeckle::Aperture(context, aperture), clspeckle::Sensor(context, sensor));
        frame_ = clspeckle::make<ClspFrame>();
        frame_.refresh = CLSP_REFRESH_ALL; // the scene moves: every frame has new speckle
        frame_.irradiance = irradiance_.image(width, height, CLSP_FORMAT_FLOAT32);
        frame_.output = output_.image(width, height, CLSP_FORMAT_UINT16);
        pipeline_.warm_up(queue_, frame_);
    }

    Slot(const Slot &) = delete;
    Slot &operator=(const Slot &) = delete;
    // Whatever went wrong: nothing may be in flight when the memory goes.
    ~Slot() { clFinish(queue_.get()); }

    // Enqueues everything and returns at once. ideal and codes must stay until wait().
    void start(std::uint64_t frame_index, const std::vector<float> &ideal, std::vector<std::uint16_t> &codes) {
        check_cl(clEnqueueWriteBuffer(queue_.get(), irradiance_.get(), CL_FALSE, 0, ideal.size() * sizeof(float),
                                      ideal.data(), 0, nullptr, nullptr),
                 "clEnqueueWriteBuffer");
        frame_.frame_index = frame_index;
        pipeline_.enqueue_frame(queue_, frame_);
        cl_event event = nullptr;
        check_cl(clEnqueueReadBuffer(queue_.get(), output_.get(), CL_FALSE, 0, codes.size() * sizeof(std::uint16_t),
                                     codes.data(), 0, nullptr, &event),
                 "clEnqueueReadBuffer");
        read_ = clspeckle::Event::adopt(event);
        check_cl(clFlush(queue_.get()), "clFlush"); // or the device may wait until somebody asks
    }
    void wait() const { read_.wait(); }
    void finish() const { pipeline_.check(queue_); }

  private:
    clspeckle::Queue queue_;
    clspeckle::Buffer irradiance_, output_;
    clspeckle::Pipeline pipeline_;
    ClspFrame frame_{};
    clspeckle::Event read_;
};

// Stands for the engine's renderer: bands that move.
void draw(std::vector<float> &ideal, std::uint32_t width, std::uint64_t frame_index) {
    for (std::size_t i = 0; i < ideal.size(); ++i)
        ideal[i] = ((i % width + 4 * frame_index) / 16) % 2 ? 1.0f : 0.25f;
}

// Stands for whoever uses the frames.
std::uint64_t digest(std::uint64_t before, const std::vector<std::uint16_t> &codes) {
    for (const std::uint16_t code : codes)
        before = (before ^ code) * 1099511628211u; // FNV-1a
    return before;
}

struct Run {
    double frames_per_second;
    std::uint64_t digest;
};

Run render(const clspeckle::Context &context, std::uint32_t width, std::uint32_t height, std::uint64_t frames,
           std::size_t slot_count) {
    const std::size_t pixels = std::size_t{width} * height;
    std::vector<std::vector<float>> ideal(slot_count, std::vector<float>(pixels));
    std::vector<std::vector<std::uint16_t>> codes(slot_count, std::vector<std::uint16_t>(pixels));
    std::deque<Slot> slots; // goes before the memory that it reads and writes
    for (std::size_t s = 0; s < slot_count; ++s)
        slots.emplace_back(context, width, height);
    Run result{0.0, 14695981039346656037u};
    const auto begin = std::chrono::steady_clock::now();
    for (std::uint64_t i = 0; i < frames + slot_count; ++i) {
        const std::size_t s = i % slot_count;
        if (i >= slot_count) { // the frame that this slot holds: one slot waits for it at once
            slots[s].wait();
            result.digest = digest(result.digest, codes[s]);
        }
        if (i < frames) {
            draw(ideal[s], width, i);
            slots[s].start(i, ideal[s], codes[s]);
        }
    }
    result.frames_per_second =
        double(frames) / std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    for (const Slot &slot : slots)
        slot.finish();
    return result;
}

std::uint32_t number(const char *text, const char *what, std::uint32_t largest) {
    char *end = nullptr;
    const long value = std::strtol(text, &end, 10);
    if (*text == '\0' || *end != '\0' || value < 1 || value > static_cast<long>(largest))
        throw std::runtime_error(std::string(what) + " is a number from 1 to " + std::to_string(largest) + ", not \"" +
                                 text + "\"");
    return static_cast<std::uint32_t>(value);
}

int run(int argc, char **argv) {
    if (argc != 1 && argc != 4)
        throw std::runtime_error("usage: frames_in_flight [WIDTH HEIGHT FRAMES]");
    const std::uint32_t width = argc > 1 ? number(argv[1], "WIDTH", 8192) : 640,
                        height = argc > 1 ? number(argv[2], "HEIGHT", 8192) : 480,
                        frames = argc > 1 ? number(argv[3], "FRAMES", 1000000) : 200;
    const clspeckle::Context context;
    const Run one = render(context, width, height, frames, 1), two = render(context, width, height, frames, 2);
    std::printf(
        "%u frames of %u x %u\n1 slot   %8.1f frames a second\n2 slots  %8.1f frames a second, %.2f times as many\n",
        frames, width, height, one.frames_per_second, two.frames_per_second,
        two.frames_per_second / one.frames_per_second);
    if (one.digest != two.digest) {
        std::fprintf(stderr, "the frames differ\n");
        return 1;
    }
    std::printf("the same frames, digest %016llx\n", static_cast<unsigned long long>(one.digest));
    return 0;
}

} // namespace

int main(int argc, char **argv) {
    try {
        return run(argc, argv);
    } catch (const clspeckle::Error &error) {
        std::fprintf(stderr, "%s\n%s", error.what(), error.build_log().c_str());
    } catch (const std::exception &error) {
        std::fprintf(stderr, "%s\n", error.what());
    }
    return 1;
}

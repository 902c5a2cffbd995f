// Eight threads at once, in one context and in contexts of their own: the same bytes as one thread, and every thread
// sees its own errors. ThreadSanitizer runs this program too (tests/sanitizers).
#include "test_support.hpp"

#include <atomic>
#include <thread>

namespace {

constexpr std::size_t thread_count = 8;
constexpr std::uint64_t frame_count = 6;

// Sizes repeat, so that threads share FFT plans as well as make their own.
std::uint32_t side_of(std::size_t thread) {
    return 32 + 16 * static_cast<std::uint32_t>(thread % 3);
}

// All frames of one thread's pipeline, one after the other.
std::vector<std::uint16_t> render(const clspeckle::Context &context, std::size_t thread) {
    const std::uint32_t side = side_of(thread);
    const clspeckle::Queue queue(context, thread % 2 ? CLSP_QUEUE_OUT_OF_ORDER : 0);
    auto phase_desc = clspeckle::make<ClspPhaseDesc>();
    auto aperture_desc = clspeckle::make<ClspApertureDesc>();
    auto sensor_desc = clspeckle::make<ClspSensorDesc>();
    phase_desc.width = aperture_desc.width = sensor_desc.width = side;
    phase_desc.height = aperture_desc.height = sensor_desc.height = side;
    phase_desc.seed = sensor_desc.seed = thread;
    aperture_desc.degree_of_polarization = 0.5;
    const clspeckle::Pipeline pipeline(context, clspeckle::Phase(context, phase_desc),
                                       clspeckle::Aperture(context, aperture_desc),
                                       clspeckle::Sensor(context, sensor_desc));
    const clspeckle::Buffer ideal(context, queue, test::dots(side, side));
    const std::size_t pixels = static_cast<std::size_t>(side) * side;
    const clspeckle::Buffer codes(context, pixels * sizeof(std::uint16_t));
    auto frame = clspeckle::make<ClspFrame>();
    frame.irradiance = ideal.image(side, side, CLSP_FORMAT_FLOAT32);
    frame.output = codes.image(side, side, CLSP_FORMAT_UINT16);
    frame.refresh = CLSP_REFRESH_ALL;
    std::vector<std::uint16_t> all;
    for (frame.frame_index = 0; frame.frame_index < frame_count; ++frame.frame_index) {
        clspeckle::Event done;
        pipeline.enqueue_frame(queue, frame, {}, &done);
        done.wait();
        const auto one = codes.read<std::uint16_t>(queue, pixels);
        all.insert(all.end(), one.begin(), one.end());
    }
    pipeline.check(queue);
    return all;
}

// Runs body(thread) on all threads from the same moment on; an exception on any of them is a failure.
template <typename Body> void at_once(Body body) {
    std::atomic<std::size_t> waiting{0};
    std::vector<std::thread> threads;
    std::vector<std::string> errors(thread_count);
    for (std::size_t thread = 0; thread < thread_count; ++thread) {
        threads.emplace_back([&, thread] {
            ++waiting;
            while (waiting < thread_count)
                std::this_thread::yield();
            try {
                body(thread);
            } catch (const std::exception &error) {
                errors[thread] = error.what();
            }
        });
    }
    for (std::thread &thread : threads)
        thread.join();
    for (std::size_t thread = 0; thread < thread_count; ++thread)
        EXPECT_EQ("", errors[thread]) << "thread " << thread;
}

// The threads come first: programs and plans are then made by all of them at once, not found ready.
TEST(Concurrency, OneContextForEightPipelines) {
    std::vector<std::vector<std::uint16_t>> together(thread_count);
    {
        const clspeckle::Context context;
        at_once([&](std::size_t thread) { together[thread] = render(context, thread); });
    }
    const clspeckle::Context context;
    for (std::size_t thread = 0; thread < thread_count; ++thread) {
        ASSERT_EQ(frame_count * side_of(thread) * side_of(thread), together[thread].size());
        EXPECT_EQ(render(context, thread), together[thread]) << "thread " << thread;
    }
}

TEST(Concurrency, EightContexts) {
    std::vector<std::vector<std::uint16_t>> together(thread_count);
    at_once([&](std::size_t thread) { together[thread] = render(clspeckle::Context(), thread); });
    const clspeckle::Context context;
    for (std::size_t thread = 0; thread < thread_count; ++thread)
        EXPECT_EQ(render(context, thread), together[thread]) << "thread " << thread;
}

TEST(Concurrency, LastErrorStaysWithItsThread) {
    const clspeckle::Context context;
    at_once([&](std::size_t thread) {
        for (int i = 0; i < 200; ++i) {
            auto desc = clspeckle::make<ClspSensorDesc>();
            desc.width = desc.height = 8;
            desc.bits = 100 + static_cast<std::uint32_t>(thread) * 1000 + static_cast<std::uint32_t>(i);
            ClspSensor sensor = nullptr;
            ASSERT_EQ(CLSP_ERROR_INVALID_ARGUMENT, clspSensorCreate(context, &desc, &sensor));
            std::this_thread::yield();
            const ClspErrorInfo info = test::last_error();
            ASSERT_STREQ("clspSensorCreate", info.function);
            ASSERT_NE(nullptr, std::strstr(info.message, std::to_string(desc.bits).c_str())) << info.message;
        }
    });
}

// Handles made, retained and released everywhere at once.
TEST(Concurrency, HandlesComeAndGo) {
    const clspeckle::Context context;
    auto desc = clspeckle::make<ClspSensorDesc>();
    desc.width = desc.height = 8;
    const clspeckle::Sensor shared(context, desc);
    at_once([&](std::size_t) {
        for (int i = 0; i < 50; ++i) {
            const clspeckle::Sensor own(context, desc);
            const clspeckle::Sensor another = own, retained = shared;
            const clspeckle::Context copy = context;
            clspeckle::check(clspSensorSetExposureGain(own, 1.0 + i));
            (void)copy.info();
        }
    });
    EXPECT_EQ(CLSP_SUCCESS, clspSensorRelease(clspeckle::Sensor(shared).release()));
    shared.set_exposure_gain(1);
}

} // namespace

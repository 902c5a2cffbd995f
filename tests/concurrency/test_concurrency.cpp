// Eight threads at once, in one context and in contexts of their own: the same bytes as one thread, and every thread
// sees its own errors. ThreadSanitizer runs this program too (tests/sanitizers).
#include "test_support.hpp"

#include <atomic>
#include <chrono>
#include <limits>
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
    const clspeckle::Queue queue(context, thread % 2 ? test::out_of_order(context) : 0);
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

// Intel's runtime for CPUs returns from a write of a few bytes before another queue sees them.
TEST(Concurrency, WhatOneQueueHasWrittenAnotherOneSees) {
    const clspeckle::Context context;
    const clspeckle::Queue writing(context), framing(context, CLSP_QUEUE_PROFILING);
    for (int round = 0; round < 10; ++round) {
        constexpr std::uint32_t width = 16, height = 8;
        auto p = clspeckle::make<ClspPhaseDesc>();
        auto a = clspeckle::make<ClspApertureDesc>();
        p.width = a.width = width;
        p.height = a.height = height;
        const clspeckle::Pipeline pipeline(context, clspeckle::Phase(context, p), clspeckle::Aperture(context, a));
        const clspeckle::Buffer ideal(context, writing, std::vector<float>(width * height, 1.0f));
        const clspeckle::Buffer light(context, width * height * sizeof(float));
        auto frame = clspeckle::make<ClspFrame>();
        frame.irradiance = ideal.image(width, height, CLSP_FORMAT_FLOAT32);
        frame.output = light.image(width, height, CLSP_FORMAT_FLOAT32);
        pipeline.enqueue_frame(framing, frame);
        EXPECT_NO_THROW(pipeline.check(framing));
        ideal.write(writing, std::vector<float>{-1.0f});
        pipeline.enqueue_frame(framing, frame);
        EXPECT_THROW(pipeline.check(framing), clspeckle::Error) << round;
    }
}

// A check on one queue sets the counts to nothing: a bad pixel that another queue finds behind it is not lost.
TEST(Concurrency, WhatOneQueueHasCheckedAnotherOneCountsAnew) {
    const clspeckle::Context context;
    const clspeckle::Queue checking(context), moving(context);
    constexpr std::uint32_t width = 16, height = 8;
    auto p = clspeckle::make<ClspPhaseDesc>();
    p.width = width;
    p.height = height;
    p.dynamics = CLSP_DYNAMICS_CONTINUOUS;
    const clspeckle::Phase phase(context, p);
    phase.enqueue_refresh(moving, 0);
    std::vector<float> path(width * height, 0.0f);
    path[5] = std::numeric_limits<float>::quiet_NaN();
    const clspeckle::Buffer paths(context, moving, path);
    auto advance = clspeckle::make<ClspPhaseAdvance>();
    advance.path = paths.image(width, height, CLSP_FORMAT_FLOAT32);
    for (std::uint64_t frame = 1; frame <= 100; ++frame) {
        phase.enqueue_advance(moving, frame, advance);
        moving.finish();
        EXPECT_THROW(phase.check(checking), clspeckle::Error) << frame;
    }
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

// A pipeline whose parts a test keeps.
struct Stages {
    clspeckle::Context context;
    clspeckle::Queue queue{context};
    clspeckle::Phase phase;
    clspeckle::Aperture aperture;
    clspeckle::Sensor sensor;
    clspeckle::Buffer light, codes;

    Stages() : light(context, queue, test::dots(kSide, kSide)), codes(context, kSide * kSide * sizeof(std::uint16_t)) {
        auto phase_desc = clspeckle::make<ClspPhaseDesc>();
        auto aperture_desc = clspeckle::make<ClspApertureDesc>();
        auto sensor_desc = clspeckle::make<ClspSensorDesc>();
        phase_desc.width = aperture_desc.width = sensor_desc.width = kSide;
        phase_desc.height = aperture_desc.height = sensor_desc.height = kSide;
        phase = clspeckle::Phase(context, phase_desc);
        aperture = clspeckle::Aperture(context, aperture_desc);
        sensor = clspeckle::Sensor(context, sensor_desc);
    }
    clspeckle::Pipeline pipeline() const { return {context, phase, aperture, sensor}; }
    ClspFrame frame() const {
        auto frame = clspeckle::make<ClspFrame>();
        frame.irradiance = light.image(kSide, kSide, CLSP_FORMAT_FLOAT32);
        frame.output = codes.image(kSide, kSide, CLSP_FORMAT_UINT16);
        frame.refresh = CLSP_REFRESH_ALL;
        return frame;
    }

    static constexpr std::uint32_t kSide = 32;
};

// While one thread waits in a call, another is told so: for the handle, for its parts, and for what shares a part.
TEST(Concurrency, ASecondThreadIsRefused) {
    const Stages stages;
    const clspeckle::Pipeline pipeline = stages.pipeline(), sharing = stages.pipeline();
    const Stages others;
    const clspeckle::Pipeline other = others.pipeline();
    ClspFrame frame = stages.frame(), other_frame = others.frame();
    pipeline.enqueue_frame(stages.queue, frame);
    cl_int code = CL_SUCCESS;
    const clspeckle::Event gate =
        clspeckle::Event::adopt(clCreateUserEvent(stages.context.info().cl_context_handle, &code));
    ASSERT_EQ(CL_SUCCESS, code);
    pipeline.enqueue_frame(stages.queue, frame, {gate});
    ClspStatus waited = CLSP_ERROR_INTERNAL;
    std::thread waiting([&] {
        do // ends with the gate; before, it is now and then the second itself
            waited = clspPipelineCheck(pipeline, stages.queue);
        while (waited == CLSP_ERROR_INVALID_STATE);
    });
    const auto late = std::chrono::steady_clock::now() + std::chrono::seconds(20);
    while (clspPipelineClearEffect(pipeline, nullptr) == CLSP_SUCCESS && std::chrono::steady_clock::now() < late)
        std::this_thread::yield();
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_STATE, "pipeline is in use by another call",
                      clspPipelineClearEffect(pipeline, nullptr));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_STATE, "sensor is in use", clspSensorSetExposureGain(stages.sensor, 2.0));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_STATE, "phase is in use",
                      clspPipelineEnqueueFrame(sharing, stages.queue, &frame, 0, nullptr, nullptr));
    ClspAperture kept = stages.aperture;
    EXPECT_CLSP_OK(clspApertureRetain(kept)); // references are anyone's
    EXPECT_CLSP_OK(clspApertureRelease(kept));
    EXPECT_CLSP_OK(clspPipelineEnqueueFrame(other, others.queue, &other_frame, 0, nullptr, nullptr));
    EXPECT_EQ(CL_SUCCESS, clSetUserEventStatus(gate, CL_COMPLETE));
    waiting.join();
    EXPECT_EQ(CLSP_SUCCESS, waited);
    EXPECT_CLSP_OK(clspPipelineClearEffect(pipeline, nullptr));
    EXPECT_CLSP_OK(clspPipelineEnqueueFrame(sharing, stages.queue, &frame, 0, nullptr, nullptr));
    stages.queue.finish();
    others.queue.finish();
}

// Eight threads and one pipeline: each call is done or refused, and no frame is half another's.
TEST(Concurrency, OnePipelineForEightThreads) {
    const Stages stages;
    const clspeckle::Pipeline pipeline = stages.pipeline();
    ClspFrame frame = stages.frame();
    pipeline.enqueue_frame(stages.queue, frame);
    const auto want = stages.codes.read<std::uint16_t>(stages.queue, Stages::kSide * Stages::kSide);
    std::atomic<int> done{0}, refused{0};
    at_once([&](std::size_t) {
        for (int i = 0; i < 50; ++i) {
            const ClspStatus status = clspPipelineEnqueueFrame(pipeline, stages.queue, &frame, 0, nullptr, nullptr);
            if (status != CLSP_ERROR_INVALID_STATE)
                clspeckle::check(status);
            ++(status == CLSP_SUCCESS ? done : refused);
        }
    });
    EXPECT_EQ(50 * static_cast<int>(thread_count), done + refused);
    EXPECT_GT(done, 0);
    EXPECT_EQ(want, stages.codes.read<std::uint16_t>(stages.queue, Stages::kSide * Stages::kSide));
}

// Captures have many readers, or one that changes them; so it is in a callback of the same thread.
TEST(Concurrency, ACaptureIsNotChangedWhileItIsRead) {
    auto desc = clspeckle::make<ClspCaptureDesc>();
    desc.width = desc.height = 32;
    desc.bits = 10;
    desc.pixel_pitch_m = 3e-6;
    desc.f_number = 4;
    desc.wavelength_m = 940e-9;
    desc.black_level_dn = 64;
    desc.read_noise_dn = 2;
    const clspeckle::Capture capture(desc);
    std::vector<std::uint16_t> codes(4 * 32 * 32);
    for (std::size_t i = 0; i < codes.size(); ++i)
        codes[i] = static_cast<std::uint16_t>(60 + i * 7919 % 9);
    auto sequence = clspeckle::make<ClspCaptureSequence>();
    sequence.name = "dark";
    sequence.scene = CLSP_SCENE_DARK;
    sequence.frame_count = 4;
    sequence.codes = codes.data();
    ASSERT_CLSP_OK(clspCaptureAddSequence(capture, &sequence));
    struct Seen {
        ClspCapture capture;
        ClspStatus changed = CLSP_SUCCESS, changed_elsewhere = CLSP_SUCCESS, read_elsewhere = CLSP_ERROR_INTERNAL;
    } seen{capture};
    auto diagnose = clspeckle::make<ClspDiagnoseDesc>();
    diagnose.progress_data = &seen;
    diagnose.progress = [](void *data, const char *, double) -> std::int32_t {
        Seen &s = *static_cast<Seen *>(data);
        s.changed = clspCaptureSetDots(s.capture, 1.0, 0, nullptr);
        std::thread([&] {
            s.changed_elsewhere = clspCaptureSetDots(s.capture, 1.0, 0, nullptr);
            s.read_elsewhere = clspCaptureValidate(s.capture);
        }).join();
        return 0;
    };
    const clspeckle::Context context;
    ClspDiagnosis made = nullptr;
    EXPECT_CLSP_FAILS(CLSP_ERROR_CANCELLED, "cancelled", clspDiagnose(context, capture, &diagnose, &made));
    EXPECT_EQ(CLSP_ERROR_INVALID_STATE, seen.changed);
    EXPECT_EQ(CLSP_ERROR_INVALID_STATE, seen.changed_elsewhere);
    EXPECT_EQ(CLSP_SUCCESS, seen.read_elsewhere);
    EXPECT_CLSP_OK(clspCaptureSetDots(capture, 1.0, 0, nullptr));
}

} // namespace

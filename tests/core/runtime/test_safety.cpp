// Numbers and handles that no sane program passes: refused, not followed.
#include "test_support.hpp"

#include <clspeckle/clspeckle.hpp>
#include <gtest/gtest.h>

#include <string>
#include <sys/wait.h>
#include <unistd.h>
#include <vector>

namespace {

ClspSensorDesc small_sensor() {
    auto desc = clspeckle::make<ClspSensorDesc>();
    desc.width = 8;
    desc.height = 8;
    return desc;
}

TEST(Safety, AReleasedHandleIsNeverTakenForALaterOne) {
    const clspeckle::Context context;
    const ClspSensorDesc desc = small_sensor();
    ClspSensor first = nullptr;
    ASSERT_EQ(CLSP_SUCCESS, clspSensorCreate(context, &desc, &first));
    ASSERT_EQ(CLSP_SUCCESS, clspSensorRelease(first));
    for (int i = 0; i < 100; ++i) {
        const clspeckle::Sensor later(context, desc);
        EXPECT_NE(first, later.get());
        EXPECT_EQ(CLSP_ERROR_INVALID_HANDLE, clspSensorSetExposureGain(first, 1.0));
        EXPECT_EQ(CLSP_ERROR_INVALID_HANDLE, clspSensorRelease(first));
        EXPECT_EQ(CLSP_SUCCESS, clspSensorSetExposureGain(later, 1.0));
    }
}

TEST(Safety, HugeStructSizesAreRefused) {
    // Were they believed, the init function would clear 4 GiB from here on.
    auto frame = clspeckle::make<ClspFrame>();
    EXPECT_EQ(CLSP_ERROR_INVALID_STRUCT_SIZE, clspFrameInit(&frame, 0xffffffffu));
    auto desc = clspeckle::make<ClspPhaseDesc>();
    EXPECT_EQ(CLSP_ERROR_INVALID_STRUCT_SIZE, clspPhaseDescInit(&desc, 0xffffffffu));
    std::uint32_t count = 0;
    ClspDeviceInfo device{};
    device.struct_size = 0xfffffff0u;
    EXPECT_EQ(CLSP_ERROR_INVALID_STRUCT_SIZE, clspDeviceList(1, &device, &count));
}

TEST(Safety, HugeHostPitchesAreRefused) {
    const clspeckle::Context context;
    const std::vector<float> pixels(64, 0.0f);
    ClspSensorDesc sensor_desc = small_sensor();
    sensor_desc.dark_frame_dn = pixels.data();
    sensor_desc.dark_frame_pitch_bytes = std::uint64_t{1} << 62;
    ClspSensor sensor = nullptr;
    EXPECT_EQ(CLSP_ERROR_INVALID_ARGUMENT, clspSensorCreate(context, &sensor_desc, &sensor));
    auto pattern_desc = clspeckle::make<ClspPatternDesc>();
    pattern_desc.width = pattern_desc.height = 8;
    pattern_desc.texels = pixels.data();
    pattern_desc.texels_pitch_bytes = std::uint64_t{1} << 62;
    ClspPattern pattern = nullptr;
    EXPECT_EQ(CLSP_ERROR_INVALID_ARGUMENT, clspPatternCreate(context, &pattern_desc, &pattern));
}

TEST(Safety, ImagesInTheWorkMemoryAreRefused) {
    constexpr std::uint32_t kSide = 32;
    const clspeckle::Context context;
    const clspeckle::Queue queue(context);
    auto phase_desc = clspeckle::make<ClspPhaseDesc>();
    phase_desc.width = phase_desc.height = kSide;
    auto aperture_desc = clspeckle::make<ClspApertureDesc>();
    aperture_desc.width = aperture_desc.height = kSide;
    aperture_desc.workspace_from_host = 1;
    const clspeckle::Phase phase(context, phase_desc);
    const clspeckle::Aperture aperture(context, aperture_desc);
    const std::uint64_t workspace_bytes = aperture.info().workspace_bytes, image_bytes = kSide * kSide * sizeof(float);
    const clspeckle::Buffer memory(context, workspace_bytes + 2 * image_bytes);
    aperture.set_workspace(memory, 0, workspace_bytes);
    phase.enqueue_refresh(queue, 0);
    const auto at = [&](std::uint64_t offset) { return memory.image(kSide, kSide, CLSP_FORMAT_FLOAT32, 0, offset); };
    const ClspImage inside = at(workspace_bytes - 4), input = at(workspace_bytes),
                    output = at(workspace_bytes + image_bytes);
    const std::vector<float> flat(kSide * kSide, 1.0f);
    memory.write(queue, flat, workspace_bytes);
    EXPECT_EQ(CLSP_ERROR_OVERLAP,
              clspApertureEnqueueIntensity(aperture, queue, phase, &inside, &output, 0, nullptr, nullptr));
    EXPECT_EQ(CLSP_ERROR_OVERLAP,
              clspApertureEnqueueIntensity(aperture, queue, phase, &input, &inside, 0, nullptr, nullptr));
    EXPECT_EQ(CLSP_SUCCESS, clspApertureEnqueueIntensity(aperture, queue, phase, &input, &output, 0, nullptr, nullptr));
    queue.finish();
}

TEST(Safety, ReadOnlyBuffersAreNotWritten) {
    const clspeckle::Context context;
    const clspeckle::Queue queue(context);
    const clspeckle::Sensor sensor(context, small_sensor());
    const clspeckle::Buffer intensity(context, queue, std::vector<float>(64, 1.0f));
    cl_int code = CL_SUCCESS;
    cl_mem raw =
        clCreateBuffer(context.info().cl_context_handle, CL_MEM_READ_ONLY, 64 * sizeof(std::uint16_t), nullptr, &code);
    ASSERT_EQ(CL_SUCCESS, code);
    const clspeckle::Buffer codes = clspeckle::Buffer::adopt(raw, 64 * sizeof(std::uint16_t));
    const ClspImage in = intensity.image(8, 8, CLSP_FORMAT_FLOAT32), out = codes.image(8, 8, CLSP_FORMAT_UINT16);
    EXPECT_EQ(CLSP_ERROR_INVALID_ARGUMENT, clspSensorEnqueueExpose(sensor, queue, &in, 0, &out, 0, nullptr, nullptr));
}

// An OpenCL runtime does not survive a fork. The child is told so, and may drop what it inherited; the parent goes on.
TEST(Safety, AForkedChildIsRefused) {
    const clspeckle::Context context;
    const clspeckle::Queue queue(context);
    const clspeckle::Sensor sensor(context, small_sensor());
    clspeckle::Buffer buffer(context, 64);
    const pid_t child = ::fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
        ClspContext another = nullptr;
        cl_mem memory = nullptr;
        std::uint32_t count = 0;
        const bool refused = clspContextCreate(nullptr, &another) == CLSP_ERROR_INVALID_STATE &&
                             clspDeviceList(0, nullptr, &count) == CLSP_ERROR_INVALID_STATE &&
                             clspSensorSetExposureGain(sensor, 1.0) == CLSP_ERROR_INVALID_STATE &&
                             clspQueueFinish(queue) == CLSP_ERROR_INVALID_STATE &&
                             clspBufferCreate(context, 16, &memory) == CLSP_ERROR_INVALID_STATE &&
                             std::string(test::last_error().message).find("forked") != std::string::npos;
        buffer = {};
        _exit(refused && clspSensorRelease(sensor) == CLSP_SUCCESS ? 0 : 1);
    }
    int status = 0;
    ASSERT_EQ(child, ::waitpid(child, &status, 0));
    EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0);
    buffer.write(queue, std::vector<std::uint32_t>(16, 7));
    EXPECT_EQ(std::vector<std::uint32_t>(16, 7), buffer.read<std::uint32_t>(queue, 16));
    EXPECT_EQ(CLSP_SUCCESS, clspSensorSetExposureGain(sensor, 1.0));
}

} // namespace

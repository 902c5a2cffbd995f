// cl_images in and out: every format, a frame from them beside one from buffers, and what is refused.
#include "test_support.hpp"

#include <atomic>
#include <iterator>
#include <thread>

namespace {

constexpr std::uint32_t width = 37, height = 21, pixels = width * height;
// Values that half floats hold, too.
float value_of(std::size_t i) {
    return static_cast<float>(i % 2000) / 1024.0f;
}

// A cl_image of the host's own.
struct Picture {
    Picture(cl_context context, cl_channel_order order, cl_channel_type type, cl_mem_flags flags = CL_MEM_READ_WRITE,
            cl_mem_object_type kind = CL_MEM_OBJECT_IMAGE2D, std::uint32_t columns = width,
            std::uint32_t rows = height) {
        const cl_image_format format{order, type};
        cl_image_desc desc{};
        desc.image_type = kind;
        desc.image_width = columns;
        desc.image_height = rows;
        desc.image_depth = kind == CL_MEM_OBJECT_IMAGE3D ? 2 : 1;
        cl_int code = CL_SUCCESS;
        image = clspeckle::ClImage::adopt(clCreateImage(context, flags, &format, &desc, nullptr, &code));
        if (code != CL_SUCCESS)
            throw std::runtime_error("clCreateImage failed with " + std::to_string(code));
        region[0] = columns;
        region[1] = rows;
    }
    template <typename T> void write(cl_command_queue queue, const std::vector<T> &texels) const {
        ASSERT_EQ(CL_SUCCESS,
                  clEnqueueWriteImage(queue, image, CL_TRUE, origin, region, 0, 0, texels.data(), 0, nullptr, nullptr));
    }
    template <typename T> std::vector<T> read(cl_command_queue queue, std::size_t channels) const {
        std::vector<T> texels(channels * region[0] * region[1]);
        EXPECT_EQ(CL_SUCCESS,
                  clEnqueueReadImage(queue, image, CL_TRUE, origin, region, 0, 0, texels.data(), 0, nullptr, nullptr));
        return texels;
    }
    clspeckle::ClImage image;
    std::size_t origin[3] = {0, 0, 0}, region[3] = {width, height, 1};
};

class ClImages : public test::DeviceTest {
  protected:
    cl_context host = context.info().cl_context_handle;

    bool has(cl_channel_order order, cl_channel_type type) const {
        cl_uint count = 0;
        clGetSupportedImageFormats(host, CL_MEM_READ_WRITE, CL_MEM_OBJECT_IMAGE2D, 0, nullptr, &count);
        std::vector<cl_image_format> formats(count);
        clGetSupportedImageFormats(host, CL_MEM_READ_WRITE, CL_MEM_OBJECT_IMAGE2D, count, formats.data(), nullptr);
        return std::any_of(formats.begin(), formats.end(), [&](const cl_image_format &format) {
            return format.image_channel_order == order && format.image_channel_data_type == type;
        });
    }
    // Those that the device has with one channel.
    std::vector<cl_channel_type> offered(std::vector<cl_channel_type> types) const {
        types.erase(std::remove_if(types.begin(), types.end(), [&](cl_channel_type type) { return !has(CL_R, type); }),
                    types.end());
        return types;
    }
    ClspStatus import(cl_mem cl_image, std::uint32_t channel, const ClspImage &image) {
        return clspClImageEnqueueImport(context, queue, cl_image, channel, &image, 0, nullptr, nullptr);
    }
    ClspStatus export_(const ClspImage &image, cl_mem cl_image) {
        return clspClImageEnqueueExport(context, queue, &image, cl_image, 0, nullptr, nullptr);
    }

    // Texels of integers (or of floats) with `channels`; each run of components imported, and all exported again.
    template <typename Texel, typename Pixel>
    void goes_both_ways(cl_channel_order order, cl_channel_type type, std::uint32_t format, std::uint32_t channels,
                        double scale = 1.0) {
        if (!has(order, type))
            return;
        SCOPED_TRACE("order " + std::to_string(order) + ", type " + std::to_string(type) + ", format " +
                     std::to_string(format));
        std::vector<Texel> texels(std::size_t{channels} * pixels);
        for (std::size_t i = 0; i < texels.size(); ++i)
            texels[i] = std::is_same_v<Texel, float> ? static_cast<Texel>(value_of(i)) : static_cast<Texel>(i * 40503u);
        const Picture source(host, order, type);
        source.write(queue, texels);
        const auto components = static_cast<std::uint32_t>(clspeckle::pixel_bytes(format) / sizeof(Pixel));
        const std::uint64_t pitch = width * clspeckle::pixel_bytes(format) + 12;
        const int order_of_channels[4] = {order == CL_BGRA ? 2 : 0, 1, order == CL_BGRA ? 0 : 2, 3};
        for (std::uint32_t first = 0; first + components <= channels; ++first) {
            const Image image = make_image(width, height, format, pitch, 24);
            ASSERT_CLSP_OK(import(source.image, first, image.view));
            const auto got = download<Pixel>(image);
            std::size_t wrong = 0;
            for (std::size_t i = 0; i < pixels; ++i)
                for (std::uint32_t k = 0; k < components; ++k) {
                    const Texel texel = texels[channels * i + static_cast<std::size_t>(order_of_channels[first + k])];
                    wrong += std::abs(static_cast<double>(got[components * i + k]) -
                                      static_cast<double>(texel) / scale) > (scale == 1.0 ? 0.0 : 1e-7);
                }
            EXPECT_EQ(0u, wrong) << "from channel " << first;
            EXPECT_TRUE(margins_untouched(image));
            ++imports;
            if (first > 0 || scale != 1.0)
                continue; // light in UNORM is refused
            const Picture target(host, order, type);
            ASSERT_CLSP_OK(export_(image.view, target.image));
            const auto texels_back = target.template read<Texel>(queue, channels);
            wrong = 0;
            const bool unorm = type == CL_UNORM_INT8 || type == CL_UNORM_INT16;
            for (std::size_t i = 0; i < pixels; ++i)
                for (std::uint32_t k = 0; k < channels; ++k) {
                    const auto at = channels * i + static_cast<std::size_t>(order_of_channels[k]);
                    const Texel expected = k < components ? texels[at]
                                           : k < 3        ? Texel(0)
                                           : unorm        ? static_cast<Texel>(-1)
                                                          : Texel(1);
                    wrong += texels_back[at] != expected;
                }
            EXPECT_EQ(0u, wrong) << "back";
            ++exports;
        }
    }
    int imports = 0, exports = 0;
};

TEST_F(ClImages, EveryFormatGoesInAndOut) {
    for (const auto &[order, channels] : {std::pair{CL_R, 1u}, {CL_RG, 2u}, {CL_RGBA, 4u}, {CL_BGRA, 4u}}) {
        goes_both_ways<std::uint8_t, std::uint8_t>(order, CL_UNSIGNED_INT8, CLSP_FORMAT_UINT8, channels);
        goes_both_ways<std::uint16_t, std::uint16_t>(order, CL_UNSIGNED_INT16, CLSP_FORMAT_UINT16, channels);
        goes_both_ways<std::uint32_t, std::uint32_t>(order, CL_UNSIGNED_INT32, CLSP_FORMAT_UINT32, channels);
        goes_both_ways<std::uint8_t, std::uint8_t>(order, CL_UNORM_INT8, CLSP_FORMAT_UINT8, channels);
        goes_both_ways<std::uint16_t, std::uint16_t>(order, CL_UNORM_INT16, CLSP_FORMAT_UINT16, channels);
        for (const std::uint32_t format :
             {CLSP_FORMAT_FLOAT32, CLSP_FORMAT_FLOAT32X2, CLSP_FORMAT_FLOAT32X3, CLSP_FORMAT_FLOAT32X4}) {
            goes_both_ways<float, float>(order, CL_FLOAT, format, channels);
            goes_both_ways<std::uint8_t, float>(order, CL_UNORM_INT8, format, channels, 255.0);
            goes_both_ways<std::uint16_t, float>(order, CL_UNORM_INT16, format, channels, 65535.0);
        }
    }
    EXPECT_GE(imports, 30);
    EXPECT_GE(exports, 15);
}

// The target may be wider, in both directions; signed fractions and half floats have no type of C.
TEST_F(ClImages, WiderIntegersHalvesAndNormals) {
    std::vector<std::uint8_t> bytes(pixels);
    for (std::size_t i = 0; i < pixels; ++i)
        bytes[i] = static_cast<std::uint8_t>(i * 7);
    const Picture ids(host, CL_R, CL_UNSIGNED_INT8);
    ids.write(queue, bytes);
    const Image wide = make_image(width, height, CLSP_FORMAT_UINT32);
    ASSERT_CLSP_OK(import(ids.image, 0, wide.view));
    EXPECT_EQ(std::vector<std::uint32_t>(bytes.begin(), bytes.end()), download<std::uint32_t>(wide));
    const Picture codes(host, CL_R, CL_UNSIGNED_INT16);
    ASSERT_CLSP_OK(export_(upload(bytes, width, height, CLSP_FORMAT_UINT8).view, codes.image));
    EXPECT_EQ(std::vector<std::uint16_t>(bytes.begin(), bytes.end()), codes.read<std::uint16_t>(queue, 1));

    std::vector<float> light(pixels);
    for (std::size_t i = 0; i < pixels; ++i)
        light[i] = value_of(i);
    const Image image = floats(light, width, height), back = make_image(width, height, CLSP_FORMAT_FLOAT32);
    const Picture half(host, CL_RGBA, CL_HALF_FLOAT); // PoCL 3.1 spoils halves of one channel
    ASSERT_CLSP_OK(export_(image.view, half.image));
    ASSERT_CLSP_OK(import(half.image, 0, back.view));
    EXPECT_EQ(light, download<float>(back));
    EXPECT_EQ(0x3800, half.read<std::uint16_t>(queue, 4)[4 * 512]) << "1/2 as a half float";

    if (!has(CL_RGBA, CL_SNORM_INT8))
        return;
    const Picture normals(host, CL_RGBA, CL_SNORM_INT8);
    std::vector<std::int8_t> packed(4 * pixels);
    for (std::size_t i = 0; i < packed.size(); ++i)
        packed[i] = static_cast<std::int8_t>(i % 255 - 127);
    normals.write(queue, packed);
    const Image normal = make_image(width, height, CLSP_FORMAT_FLOAT32X3);
    ASSERT_CLSP_OK(import(normals.image, 0, normal.view));
    const auto unpacked = download<float>(normal);
    for (std::size_t i = 0; i < pixels; ++i)
        for (std::size_t k = 0; k < 3; ++k)
            ASSERT_NEAR(packed[4 * i + k] / 127.0, unpacked[3 * i + k], 1e-7);
}

// What an engine does each frame: depth and normals in one texture, albedo in another, codes out, on an out-of-order
// queue, all in flight before the first command may begin.
TEST_F(ClImages, AFrameIsTheBuffersFrame) {
    std::vector<float> surface(4 * pixels), depth(pixels), normal(4 * pixels);
    std::vector<std::uint8_t> albedo(4 * pixels);
    for (std::size_t i = 0; i < pixels; ++i) {
        depth[i] = surface[4 * i + 3] = 1.0f + value_of(i) / 8.0f;
        const float slope = 0.3f * value_of(i) / 2.0f;
        const float parts[3] = {slope, 0.0f, -std::sqrt(1.0f - slope * slope)};
        std::copy(parts, parts + 3, &normal[4 * i]);
        std::copy(parts, parts + 3, &surface[4 * i]);
        albedo[4 * i + 1] = static_cast<std::uint8_t>(64 + i % 128);
    }
    std::vector<float> reflectance(pixels);
    for (std::size_t i = 0; i < pixels; ++i)
        reflectance[i] = albedo[4 * i + 1] / 255.0f;
    const std::vector<float> texels(64 * 48, 1.0f);

    const auto make_pipeline = [&] {
        auto pattern = clspeckle::make<ClspPatternDesc>();
        pattern.width = 64;
        pattern.height = 48;
        pattern.texels = texels.data();
        auto phase = clspeckle::make<ClspPhaseDesc>();
        auto aperture = clspeckle::make<ClspApertureDesc>();
        auto sensor = clspeckle::make<ClspSensorDesc>();
        phase.width = aperture.width = sensor.width = width;
        phase.height = aperture.height = sensor.height = height;
        return clspeckle::Pipeline(context, clspeckle::Pattern(context, pattern), clspeckle::Phase(context, phase),
                                   clspeckle::Aperture(context, aperture), clspeckle::Sensor(context, sensor));
    };
    auto geometry = clspeckle::make<ClspGeometry>();
    geometry.fx_px = geometry.fy_px = 40.0;
    geometry.cx_px = (width - 1) / 2.0;
    geometry.cy_px = (height - 1) / 2.0;
    auto frame = clspeckle::make<ClspFrame>();
    frame.geometry = &geometry;
    constexpr std::uint64_t frames = 3;

    std::vector<std::vector<std::uint16_t>> expected;
    {
        const Image d = floats(depth, width, height), n = upload(normal, width, height, CLSP_FORMAT_FLOAT32X4),
                    a = floats(reflectance, width, height), out = make_image(width, height, CLSP_FORMAT_UINT16);
        geometry.depth = d.view;
        geometry.normal = n.view;
        geometry.albedo = a.view;
        frame.output = out.view;
        const clspeckle::Pipeline pipeline = make_pipeline();
        for (frame.frame_index = 0; frame.frame_index < frames; ++frame.frame_index) {
            pipeline.enqueue_frame(queue, frame);
            expected.push_back(download<std::uint16_t>(out));
        }
        EXPECT_GT(*std::max_element(expected[0].begin(), expected[0].end()), 64 + 50) << "a picture, not darkness";
    }

    const Picture surface_texture(host, CL_RGBA, CL_FLOAT), albedo_texture(host, CL_RGBA, CL_UNORM_INT8),
        codes(host, CL_R, CL_UNSIGNED_INT16, CL_MEM_WRITE_ONLY);
    const Image d = make_image(width, height, CLSP_FORMAT_FLOAT32),
                n = make_image(width, height, CLSP_FORMAT_FLOAT32X3),
                a = make_image(width, height, CLSP_FORMAT_FLOAT32), out = make_image(width, height, CLSP_FORMAT_UINT16);
    geometry.depth = d.view;
    geometry.normal = n.view;
    geometry.albedo = a.view;
    frame.output = out.view;
    const clspeckle::Pipeline pipeline = make_pipeline();
    const clspeckle::Queue work(context, test::out_of_order(context));
    ClspContextInfo warm{};
    for (frame.frame_index = 0; frame.frame_index < frames; ++frame.frame_index) {
        cl_int code = CL_SUCCESS;
        const auto gate = clspeckle::Event::adopt(clCreateUserEvent(host, &code));
        cl_event begin = gate, written[2] = {};
        ASSERT_EQ(CL_SUCCESS,
                  clEnqueueWriteImage(work, surface_texture.image, CL_FALSE, surface_texture.origin,
                                      surface_texture.region, 0, 0, surface.data(), 1, &begin, &written[0]));
        ASSERT_EQ(CL_SUCCESS, clEnqueueWriteImage(work, albedo_texture.image, CL_FALSE, albedo_texture.origin,
                                                  albedo_texture.region, 0, 0, albedo.data(), 1, &begin, &written[1]));
        const auto surface_ready = clspeckle::Event::adopt(written[0]),
                   albedo_ready = clspeckle::Event::adopt(written[1]);
        clspeckle::Event depth_ready, normal_ready, reflectance_ready, rendered, exported;
        surface_texture.image.enqueue_import(context, work, 3, d.view, {surface_ready}, &depth_ready);
        surface_texture.image.enqueue_import(context, work, 0, n.view, {surface_ready}, &normal_ready);
        albedo_texture.image.enqueue_import(context, work, 1, a.view, {albedo_ready}, &reflectance_ready);
        pipeline.enqueue_frame(work, frame, {depth_ready, normal_ready, reflectance_ready}, &rendered);
        codes.image.enqueue_export(context, work, out.view, {rendered}, &exported);
        // Enqueued, and nothing has run.
        cl_int status = CL_COMPLETE;
        clGetEventInfo(exported, CL_EVENT_COMMAND_EXECUTION_STATUS, sizeof status, &status, nullptr);
        EXPECT_NE(CL_COMPLETE, status);
        clSetUserEventStatus(gate, CL_COMPLETE);
        exported.wait();
        EXPECT_EQ(expected[frame.frame_index], codes.read<std::uint16_t>(queue, 1)) << "frame " << frame.frame_index;
        const ClspContextInfo now = context.info();
        if (frame.frame_index > 0) {
            EXPECT_EQ(warm.programs_built, now.programs_built);
            EXPECT_EQ(warm.allocation_count, now.allocation_count);
        }
        warm = now;
    }
    pipeline.check(work);
}

TEST_F(ClImages, ThreadsShareAContext) {
    constexpr int threads = 4, rounds = 50;
    std::atomic<int> wrong{0};
    std::vector<std::thread> pool;
    for (int t = 0; t < threads; ++t)
        pool.emplace_back([&, t] {
            const clspeckle::Queue own(context);
            const std::vector<float> texels(pixels, static_cast<float>(t));
            const Picture picture(host, CL_R, CL_FLOAT);
            picture.write(own, texels);
            const clspeckle::Buffer buffer(context, pixels * sizeof(float));
            for (int i = 0; i < rounds; ++i) {
                picture.image.enqueue_import(context, own, 0, buffer.image(width, height, CLSP_FORMAT_FLOAT32));
                wrong += buffer.read<float>(own, pixels) != texels;
            }
        });
    for (std::thread &thread : pool)
        thread.join();
    EXPECT_EQ(0, wrong);
}

TEST_F(ClImages, RefuseBadArguments) {
    const Image image = make_image(width, height, CLSP_FORMAT_FLOAT32),
                codes = make_image(width, height, CLSP_FORMAT_UINT16),
                normal = make_image(width, height, CLSP_FORMAT_FLOAT32X3);
    const Picture picture(host, CL_RGBA, CL_FLOAT), red(host, CL_R, CL_FLOAT);
    const test::Foreign foreign;
    // Both functions, in one place.
    const auto both = [&](ClspStatus status, const std::string &words, cl_mem cl_image, const ClspImage &view) {
        EXPECT_CLSP_FAILS(status, words,
                          clspClImageEnqueueImport(context, queue, cl_image, 0, &view, 0, nullptr, nullptr));
        EXPECT_CLSP_FAILS(status, words,
                          clspClImageEnqueueExport(context, queue, &view, cl_image, 0, nullptr, nullptr));
    };
    both(CLSP_ERROR_INVALID_ARGUMENT, "cl_image is null", nullptr, image.view);
    both(CLSP_ERROR_INVALID_ARGUMENT, "cl_image is a buffer", image.buffer, image.view);
    both(CLSP_ERROR_WRONG_CONTEXT, "cl_image belongs to another", Picture(foreign.host.context, CL_R, CL_FLOAT).image,
         image.view);
    both(CLSP_ERROR_INVALID_ARGUMENT, "CL_MEM_OBJECT_IMAGE2D",
         Picture(host, CL_RGBA, CL_FLOAT, CL_MEM_READ_WRITE, CL_MEM_OBJECT_IMAGE3D).image, image.view);
    both(CLSP_ERROR_INVALID_ARGUMENT, "37 x 22",
         Picture(host, CL_R, CL_FLOAT, CL_MEM_READ_WRITE, CL_MEM_OBJECT_IMAGE2D, width, height + 1).image, image.view);
    if (has(CL_A, CL_FLOAT))
        both(CLSP_ERROR_INVALID_FORMAT, "expected CL_R, CL_RG, CL_RGBA or CL_BGRA", Picture(host, CL_A, CL_FLOAT).image,
             image.view);
    both(CLSP_ERROR_INVALID_ARGUMENT, "image.mem is NULL", picture.image, ClspImage{});
    both(CLSP_ERROR_INVALID_ARGUMENT, "cl_image; copy it into a buffer", picture.image,
         clspeckle::image(red.image, width, height, CLSP_FORMAT_FLOAT32));
    both(CLSP_ERROR_WRONG_CONTEXT, "image belongs", picture.image,
         foreign.buffer.image(width, height, CLSP_FORMAT_FLOAT32));
    ClspImage bad = image.view;
    bad.format = CLSP_FORMAT_NONE;
    both(CLSP_ERROR_INVALID_FORMAT, "image.format", picture.image, bad);
    bad.format = 99;
    both(CLSP_ERROR_INVALID_FORMAT, "image.format", picture.image, bad);
    bad = image.view;
    bad.reserved = 1;
    both(CLSP_ERROR_INVALID_ARGUMENT, "image.reserved", picture.image, bad);
    bad = image.view;
    bad.offset_bytes = 4;
    both(CLSP_ERROR_BUFFER_TOO_SMALL, "image needs", picture.image, bad);
    // Formats that do not go together; the message has one that does.
    for (const cl_channel_type type :
         offered({CL_FLOAT, CL_HALF_FLOAT, CL_UNORM_INT8, CL_SNORM_INT8, CL_UNSIGNED_INT32, CL_SIGNED_INT16}))
        EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_FORMAT, "into uint16: use CL_UNSIGNED_INT16 or CL_UNORM_INT16",
                          clspClImageEnqueueImport(context, queue, Picture(host, CL_R, type).image, 0, &codes.view, 0,
                                                   nullptr, nullptr));
    for (const cl_channel_type type :
         offered({CL_FLOAT, CL_HALF_FLOAT, CL_UNORM_INT8, CL_SNORM_INT8, CL_UNSIGNED_INT8, CL_SIGNED_INT16}))
        EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_FORMAT, "with uint16: use CL_UNSIGNED_INT16 or CL_UNORM_INT16",
                          clspClImageEnqueueExport(context, queue, &codes.view, Picture(host, CL_R, type).image, 0,
                                                   nullptr, nullptr));
    for (const cl_channel_type type : offered({CL_UNSIGNED_INT8, CL_SIGNED_INT16}))
        EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_FORMAT, "into float32: use CL_FLOAT or CL_HALF_FLOAT, CL_UNORM",
                          clspClImageEnqueueImport(context, queue, Picture(host, CL_R, type).image, 0, &image.view, 0,
                                                   nullptr, nullptr));
    for (const cl_channel_type type : offered({CL_UNSIGNED_INT16, CL_UNORM_INT8, CL_SNORM_INT16}))
        EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_FORMAT, "with float32: use CL_FLOAT or CL_HALF_FLOAT",
                          clspClImageEnqueueExport(context, queue, &image.view, Picture(host, CL_R, type).image, 0,
                                                   nullptr, nullptr));
    // Channels.
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_FORMAT, "first_channel is 1",
                      clspClImageEnqueueImport(context, queue, red.image, 1, &image.view, 0, nullptr, nullptr));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_FORMAT, "first_channel is 4294967295",
                      clspClImageEnqueueImport(context, queue, picture.image, ~0u, &image.view, 0, nullptr, nullptr));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_FORMAT, "3 components",
                      clspClImageEnqueueImport(context, queue, picture.image, 2, &normal.view, 0, nullptr, nullptr));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_FORMAT, "3 components",
                      clspClImageEnqueueExport(context, queue, &normal.view, red.image, 0, nullptr, nullptr));
    // Access.
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "made with CL_MEM_WRITE_ONLY",
                      clspClImageEnqueueImport(context, queue, Picture(host, CL_R, CL_FLOAT, CL_MEM_WRITE_ONLY).image,
                                               0, &image.view, 0, nullptr, nullptr));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "made with CL_MEM_READ_ONLY",
                      clspClImageEnqueueExport(context, queue, &image.view,
                                               Picture(host, CL_R, CL_FLOAT, CL_MEM_READ_ONLY).image, 0, nullptr,
                                               nullptr));
    cl_int code = CL_SUCCESS;
    const auto constant =
        clspeckle::Buffer::adopt(clCreateBuffer(host, CL_MEM_READ_ONLY, 4 * pixels, nullptr, &code), 4 * pixels);
    const ClspImage constant_view = constant.image(width, height, CLSP_FORMAT_FLOAT32);
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "image is written",
                      clspClImageEnqueueImport(context, queue, red.image, 0, &constant_view, 0, nullptr, nullptr));
    // Handles, queues, events.
    const cl_event none = nullptr, other = foreign.event;
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "context",
                      clspClImageEnqueueImport(nullptr, queue, red.image, 0, &image.view, 0, nullptr, nullptr));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "image is NULL",
                      clspClImageEnqueueImport(context, queue, red.image, 0, nullptr, 0, nullptr, nullptr));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "queue",
                      clspClImageEnqueueExport(context, nullptr, &image.view, red.image, 0, nullptr, nullptr));
    EXPECT_CLSP_FAILS(CLSP_ERROR_WRONG_CONTEXT, "queue",
                      clspClImageEnqueueExport(context, foreign.queue, &image.view, red.image, 0, nullptr, nullptr));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "event_wait_list",
                      clspClImageEnqueueExport(context, queue, &image.view, red.image, 1, &none, nullptr));
    EXPECT_CLSP_FAILS(CLSP_ERROR_WRONG_CONTEXT, "event_wait_list",
                      clspClImageEnqueueExport(context, queue, &image.view, red.image, 1, &other, nullptr));
}

} // namespace

// Devices that work in lanes have a lookup of their own (stages/pattern_lanes.cl): the same bits as the kernel of other
// devices.
#include "runtime/context.hpp"
#include "fft/cpu/lanes.hpp"
#include "stages/pattern.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <memory>
#include <random>
#include <vector>

namespace {

using namespace clsp;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN(), kInfinity = std::numeric_limits<float>::infinity();
constexpr std::uint32_t kTexelsWidth = 37, kTexelsHeight = 23;
constexpr double kHalfExtent = 0.4;

// What a lookup writes, the bytes around it, and what it counts.
struct Looked {
    std::vector<cl_uint> words;
    BadPixels bad;
};

// The stages as one kind of device has them.
class Side {
  public:
    explicit Side(const char *engine) {
        setenv("CLSPECKLE_FFT", engine, 1); // contexts read it when they are made
        context_ = Context::create({});
        unsetenv("CLSPECKLE_FFT");
        queue_ = cl::CommandQueue(context_->cl_context(), context_->device());
    }
    const std::shared_ptr<Context> &context() const { return context_; }

    // An image of `size` in memory that is a margin, the rows with what lies between them, and a margin.
    ImageDescription describe(const std::vector<unsigned char> &memory, ImageSize size, Format format,
                              std::size_t margin, std::size_t pitch) {
        buffers_.emplace_back(context_, memory.size(), memory.data());
        return {buffers_.back().get()(), margin, pitch, size.width, size.height, format};
    }
    Looked look_up(Pattern &pattern, const Geometry &geometry, ImageSize size) {
        const std::size_t margin = 12, pitch = size.width * sizeof(float) + 20;
        const std::vector<unsigned char> memory(2 * margin + pitch * size.height, 0xA5);
        const ImageDescription out = describe(memory, size, Format::kFloat32, margin, pitch);
        CommandChain chain(queue_(), 0, nullptr);
        pattern.enqueue_lookup(chain, geometry,
                               check_image(out, "irradiance", context_->cl_context()(), size, {Format::kFloat32}));
        Looked looked;
        looked.words.resize(memory.size() / sizeof(cl_uint));
        queue_.enqueueReadBuffer(buffers_.back().get(), CL_TRUE, 0, memory.size(), looked.words.data());
        looked.bad = pattern.bad_pixels().take(queue_());
        buffers_.clear();
        return looked;
    }

  private:
    std::shared_ptr<Context> context_;
    cl::CommandQueue queue_;
    std::vector<DeviceBuffer> buffers_;
};

// An input of both sides; format kNone: none. Every row ends elsewhere in a vector than the one before.
struct Input {
    Format format = Format::kNone;
    std::size_t margin = 0, pitch = 0;
    std::vector<unsigned char> memory;

    Input() = default;
    template <typename T>
    Input(const std::vector<T> &pixels, ImageSize size, Format image_format) : format(image_format) {
        const std::size_t row = pixels.size() / size.height * sizeof(T);
        margin = 5 * sizeof(T);
        pitch = row + 3 * sizeof(T);
        memory.assign(2 * margin + pitch * size.height, 0xFF); // NaN
        for (std::size_t y = 0; y < size.height; ++y)
            std::memcpy(&memory[margin + y * pitch], reinterpret_cast<const unsigned char *>(pixels.data()) + y * row,
                        row);
    }
};

struct Scene {
    ImageSize size;
    Input position3, position4, depth, normal3, normal4, albedo, visibility, visibility8;
};

// Points in front of the laser, beside the pattern, at its border and behind; here and there none, and a normal that is
// none.
Scene make_scene(ImageSize size, unsigned seed) {
    std::mt19937 engine(seed);
    const auto uniform = [&](float least, float most) {
        return std::uniform_real_distribution<float>(least, most)(engine);
    };
    std::vector<float> position3, position4, depth, normal3, normal4, albedo, visibility;
    std::vector<std::uint8_t> visibility8;
    const float holes[] = {kNan, kInfinity, -kInfinity, 0.0f, -1.0f};
    for (std::size_t i = 0; i < std::size_t{size.width} * size.height; ++i) {
        float p[3] = {uniform(-0.7f, 0.7f), uniform(-0.6f, 0.6f), uniform(-0.2f, 1.6f)};
        if (i % 7 == 3)
            p[0] = float(kHalfExtent) * p[2];
        if (i % 11 == 5)
            p[i % 3] = holes[i % 5];
        if (i / 64 % 5 == 4)
            p[2] = -1.0f; // whole vectors that see nothing
        float n[3] = {uniform(-1, 1), uniform(-1, 1), uniform(-1, 0.5f)};
        if (i % 13 == 7)
            n[i % 3] = kNan;
        for (int k = 0; k < 3; ++k) {
            position3.push_back(p[k]);
            position4.push_back(p[k]);
            normal3.push_back(n[k]);
            normal4.push_back(n[k]);
        }
        position4.push_back(kNan);
        normal4.push_back(kNan);
        depth.push_back(i % 9 == 4 ? holes[i % 5] : uniform(0.3f, 2.0f));
        albedo.push_back(uniform(0, 1));
        visibility.push_back(uniform(0, 1));
        visibility8.push_back(std::uint8_t(i * 37 % 256));
    }
    return {size,
            {position3, size, Format::kFloat32x3},
            {position4, size, Format::kFloat32x4},
            {depth, size, Format::kFloat32},
            {normal3, size, Format::kFloat32x3},
            {normal4, size, Format::kFloat32x4},
            {albedo, size, Format::kFloat32},
            {visibility, size, Format::kFloat32},
            {visibility8, size, Format::kUint8}};
}

// Which images a frame has, nullptr: none.
struct Inputs {
    const Input *position = nullptr, *depth = nullptr, *normal = nullptr, *albedo = nullptr, *visibility = nullptr;
    DepthKind depth_kind = DepthKind::kAlongAxis;
};

class PatternLanes : public ::testing::Test {
  protected:
    static void SetUpTestSuite() {
        scalar = std::make_unique<Side>("clfft");
        lanes = std::make_unique<Side>("cpu");
        std::mt19937 engine(61);
        texels.resize(kTexelsWidth * kTexelsHeight);
        for (float &texel : texels)
            texel = std::uniform_real_distribution<float>(0, 3)(engine);
    }
    void SetUp() override {
        if (scalar->context()->device().getInfo<CL_DEVICE_TYPE>() != CL_DEVICE_TYPE_CPU)
            GTEST_SKIP() << "lanes are for CPUs; dot products of other devices may round otherwise";
    }
    static void TearDownTestSuite() { // drivers do not like to be used after main()
        scalar.reset();
        lanes.reset();
    }

    static Pattern make_pattern(const Side &side, Projection projection, PatternQuantity quantity) {
        PatternParameters p;
        p.projection = projection;
        p.quantity = quantity;
        p.width = kTexelsWidth;
        p.height = kTexelsHeight;
        p.texels = texels.data();
        p.half_extent_x = p.half_extent_y = kHalfExtent;
        p.power_scale = 1.7;
        // A turn about y, with a baseline.
        const double c = std::cos(0.2), s = std::sin(0.2);
        p.laser_from_geometry = {c, 0, s, 0.05, 0, 1, 0, -0.02, -s, 0, c, 0.01};
        return {side.context(), p};
    }
    static Looked look_up(Side &side, Pattern &pattern, ImageSize size, const Inputs &inputs) {
        const auto image = [&](const Input *input) {
            return input ? side.describe(input->memory, size, input->format, input->margin, input->pitch)
                         : ImageDescription{};
        };
        Geometry g;
        g.depth_kind = inputs.depth_kind;
        g.position = image(inputs.position);
        g.depth = image(inputs.depth);
        g.normal = image(inputs.normal);
        g.albedo = image(inputs.albedo);
        g.visibility = image(inputs.visibility);
        g.fx_px = 41.0;
        g.fy_px = 37.0;
        g.cx_px = 0.45 * size.width;
        g.cy_px = 0.55 * size.height;
        return side.look_up(pattern, g, size);
    }
    // How many pixels have light.
    static std::size_t expect_same(const Looked &expected, const Looked &got) {
        EXPECT_EQ(expected.words, got.words);
        EXPECT_EQ(expected.bad.not_finite, got.bad.not_finite);
        EXPECT_EQ(expected.bad.negative, got.bad.negative);
        EXPECT_EQ(expected.bad.first_index, got.bad.first_index);
        return static_cast<std::size_t>(std::count_if(expected.words.begin(), expected.words.end(),
                                                      [](cl_uint word) { return word != 0 && word >> 31 == 0; }));
    }

    static void compare_options(int every);

    static inline std::unique_ptr<Side> scalar, lanes;
    static inline std::vector<float> texels;
};

TEST_F(PatternLanes, TheSidesAreTwo) {
    EXPECT_FALSE(works_in_lanes(*scalar->context()));
    EXPECT_TRUE(works_in_lanes(*lanes->context()));
}

// Where the numbers of its options add up to a multiple of `every`: with 3, any two options meet with all values, and
// each is a kernel to compile.
void PatternLanes::compare_options(int every) {
    const Scene scene = make_scene({83, 9}, 62); // no whole vectors
    const Input *const normals[] = {nullptr, &scene.normal3, &scene.normal4};
    const Input *const albedos[] = {nullptr, &scene.albedo};
    const Input *const visibilities[] = {nullptr, &scene.visibility, &scene.visibility8};
    const Inputs geometries[] = {{&scene.position3},
                                 {&scene.position4},
                                 {nullptr, &scene.depth},
                                 {nullptr, &scene.depth, nullptr, nullptr, nullptr, DepthKind::kAlongRay}};
    for (int stage = 0; stage < 4; ++stage) {
        const Projection projection = stage % 2 ? Projection::kDirectionCosines : Projection::kTangentPlane;
        const PatternQuantity quantity =
            stage / 2 ? PatternQuantity::kPlaneIrradiance : PatternQuantity::kRadiantIntensity;
        Pattern one = make_pattern(*scalar, projection, quantity), other = make_pattern(*lanes, projection, quantity);
        for (int index = 0; index < 4 * 3 * 2 * 3; ++index) {
            const int geometry = index % 4, normal = index / 4 % 3, albedo = index / 12 % 2, visibility = index / 24;
            if ((stage + geometry + normal + albedo + visibility) % every != 0)
                continue;
            Inputs inputs = geometries[geometry];
            inputs.normal = normals[normal];
            inputs.albedo = albedos[albedo];
            inputs.visibility = visibilities[visibility];
            SCOPED_TRACE(::testing::Message() << "stage " << stage << ", geometry " << geometry << ", normal " << normal
                                              << ", albedo " << albedo << ", visibility " << visibility);
            const Looked expected = look_up(*scalar, one, scene.size, inputs);
            const std::size_t lit = expect_same(expected, look_up(*lanes, other, scene.size, inputs));
            EXPECT_GT(lit, 40u);
            EXPECT_LT(lit, std::size_t{83} * 9 - 40);
            if (HasFailure())
                return;
        }
    }
}

TEST_F(PatternLanes, TheSameBits) {
    compare_options(3);
}

TEST_F(PatternLanes, TheSameBitsWithAllOptions) {
    compare_options(1);
}

TEST_F(PatternLanes, TheSameBitsAtAllWidths) {
    Pattern one = make_pattern(*scalar, Projection::kTangentPlane, PatternQuantity::kRadiantIntensity);
    Pattern other = make_pattern(*lanes, Projection::kTangentPlane, PatternQuantity::kRadiantIntensity);
    // (PoCL compiles the other kernel anew for many of them.)
    for (const std::uint32_t width : {1u, 7u, 16u, 33u, 128u, 300u}) {
        const Scene scene = make_scene({width, 3}, 63 + width);
        SCOPED_TRACE(width);
        for (const bool four : {false, true}) {
            const Inputs inputs{four ? &scene.position4 : &scene.position3, nullptr,
                                four ? &scene.normal4 : &scene.normal3, &scene.albedo, &scene.visibility8};
            expect_same(look_up(*scalar, one, scene.size, inputs), look_up(*lanes, other, scene.size, inputs));
        }
        const Inputs inputs{nullptr, &scene.depth, nullptr, &scene.albedo, &scene.visibility};
        expect_same(look_up(*scalar, one, scene.size, inputs), look_up(*lanes, other, scene.size, inputs));
    }
}

TEST_F(PatternLanes, BadPixelsAreCountedTheSame) {
    const ImageSize size{45, 4};
    Scene scene = make_scene(size, 64);
    Pattern one = make_pattern(*scalar, Projection::kTangentPlane, PatternQuantity::kRadiantIntensity);
    Pattern other = make_pattern(*lanes, Projection::kTangentPlane, PatternQuantity::kRadiantIntensity);
    const auto with = [&](std::initializer_list<std::pair<std::size_t, float>> values) {
        std::vector<float> pixels(std::size_t{size.width} * size.height, 0.5f);
        for (const auto &[index, value] : values)
            pixels[index] = value;
        return Input(pixels, size, Format::kFloat32);
    };
    // In a row's whole vectors and in what is left of it, where there is a surface and where there is none.
    const Input albedo =
        with({{17, -1.0f}, {18, kNan}, {44, kInfinity}, {45, -0.0f}, {90, -kInfinity}, {133, -1e-30f}, {179, kNan}});
    const Input visibility = with({{5, -2.0f}, {18, kInfinity}, {100, 3.0f}, {178, kNan}});
    struct Case {
        const Input *albedo, *visibility;
        std::uint32_t not_finite, negative, first_index;
    };
    for (const Case &c : {Case{&albedo, &scene.visibility8, 4, 2, 17},
                          {&albedo, &visibility, 6, 3, 5},
                          {&scene.albedo, &visibility, 2, 1, 5}}) {
        const Inputs inputs{&scene.position3, nullptr, nullptr, c.albedo, c.visibility};
        const Looked expected = look_up(*scalar, one, size, inputs);
        EXPECT_EQ(c.not_finite, expected.bad.not_finite);
        EXPECT_EQ(c.negative, expected.bad.negative);
        EXPECT_EQ(c.first_index, expected.bad.first_index);
        expect_same(expected, look_up(*lanes, other, size, inputs));
    }
}

} // namespace

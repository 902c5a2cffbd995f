// Philox4x32-10: known answers, the image mapping, and what bad arguments get.
#include "stage_support.hpp"

namespace {

using Block = std::array<std::uint32_t, 4>;

// Salmon et al., "Parallel random numbers: as easy as 1, 2, 3", written from the paper's definition.
Block philox4x32_10(Block counter, std::uint32_t key0, std::uint32_t key1) {
    for (int round = 0; round < 10; ++round) {
        const std::uint64_t a = std::uint64_t{0xD2511F53} * counter[0], b = std::uint64_t{0xCD9E8D57} * counter[2];
        counter = {static_cast<std::uint32_t>(b >> 32) ^ counter[1] ^ key0, static_cast<std::uint32_t>(b),
                   static_cast<std::uint32_t>(a >> 32) ^ counter[3] ^ key1, static_cast<std::uint32_t>(a)};
        key0 += 0x9E3779B9;
        key1 += 0xBB67AE85;
    }
    return counter;
}

// The vectors of philox4x32 with 10 rounds in Random123's kat_vectors.
struct KnownAnswer {
    Block counter;
    std::uint32_t key[2];
    Block block;
};
const KnownAnswer known_answers[] = {
    {{0, 0, 0, 0}, {0, 0}, {0x6627e8d5, 0xe169c58d, 0xbc57ac4c, 0x9b00dbd8}},
    {{0xffffffff, 0xffffffff, 0xffffffff, 0xffffffff},
     {0xffffffff, 0xffffffff},
     {0x408f276d, 0x41c83b0e, 0xa20bc7c6, 0x6d5451fd}},
    {{0x243f6a88, 0x85a308d3, 0x13198a2e, 0x03707344},
     {0xa4093822, 0x299f31d0},
     {0xd16cfe09, 0x94fdcceb, 0x5001e420, 0x24126ea1}},
};

class Philox : public test::EnqueueTest {
  protected:
    ClspPhiloxDesc bits() const {
        auto desc = clspeckle::make<ClspPhiloxDesc>();
        desc.distribution = CLSP_DISTRIBUTION_BITS;
        return desc;
    }
};

TEST_F(Philox, KnownAnswers) {
    for (const KnownAnswer &known : known_answers) {
        EXPECT_EQ(known.block, philox4x32_10(known.counter, known.key[0], known.key[1]));
        for (std::uint64_t local_size : {0, 1}) {
            const clspeckle::Buffer counters(context, queue, std::vector<Block>{known.counter});
            ASSERT_CLSP_OK(
                enqueue(clspPhiloxEnqueueBlocks, context, counters, 0, known.key, 1, local_size, counters, 0));
            EXPECT_EQ(known.block, counters.read<Block>(queue, 1)[0]);
        }
    }
}

TEST_F(Philox, SameIntegersForAnyWorkGroupSize) {
    constexpr std::size_t count = 1000; // no multiple of any group size below
    std::vector<Block> counters(count);
    for (std::uint32_t i = 0; i < count; ++i)
        counters[i] = {i, ~i, i * i, 17};
    const std::uint32_t key[2] = {0xdeadbeef, 0x12345678};
    const clspeckle::Buffer in(context, queue, counters);
    for (std::uint64_t local_size : {0, 1, 3, 16, 64, 256}) {
        const clspeckle::Buffer out(context, count * sizeof(Block) + 64);
        ASSERT_CLSP_OK(enqueue(clspPhiloxEnqueueBlocks, context, in, 0, key, count, local_size, out, 32));
        const auto blocks = out.read<Block>(queue, count, 32);
        for (std::size_t i = 0; i < count; ++i)
            ASSERT_EQ(philox4x32_10(counters[i], key[0], key[1]), blocks[i])
                << "local_size " << local_size << ", " << i;
    }
    auto desc = bits();
    desc.seed = 99;
    std::vector<std::uint32_t> first;
    for (std::uint32_t local_size : {0u, 1u, 5u, 64u}) {
        desc.local_size = local_size;
        auto image = make_image(37, 23, CLSP_FORMAT_UINT32);
        ASSERT_CLSP_OK(enqueue(clspPhiloxEnqueueFill, context, &desc, &image.view));
        const auto words = download<std::uint32_t>(image);
        if (first.empty())
            first = words;
        EXPECT_EQ(first, words) << "local_size " << local_size;
    }
}

TEST_F(Philox, ImageMappingIsTheDocumentedOne) {
    for (const std::uint32_t height : {1u, 3u, 4u, 7u, 10u}) {
        constexpr std::uint32_t width = 9;
        auto desc = bits();
        desc.seed = 0x0123456789abcdef;
        desc.frame_index = 0x0000fedc12345678;
        desc.stream = 0x9abc;
        auto image = make_image(width, height, CLSP_FORMAT_UINT32, 64, 128);
        ASSERT_CLSP_OK(enqueue(clspPhiloxEnqueueFill, context, &desc, &image.view));
        const auto words = download<std::uint32_t>(image);
        EXPECT_TRUE(margins_untouched(image));
        const std::uint32_t quarter = (height + 3) / 4;
        for (std::uint32_t y = 0; y < height; ++y) {
            for (std::uint32_t x = 0; x < width; ++x) {
                const Block block =
                    philox4x32_10({x, y % quarter, 0x12345678, 0x9abc | 0xfedcu << 16}, 0x89abcdef, 0x01234567);
                ASSERT_EQ(block[y / quarter], words[y * width + x]) << x << ", " << y << " of height " << height;
            }
        }
    }
}

TEST_F(Philox, UniformsAndNormalsFollowTheBits) {
    constexpr std::uint32_t width = 64, height = 64;
    auto desc = bits();
    auto words_image = make_image(width, height, CLSP_FORMAT_UINT32);
    auto floats_image = make_image(width, height, CLSP_FORMAT_FLOAT32);
    ASSERT_CLSP_OK(enqueue(clspPhiloxEnqueueFill, context, &desc, &words_image.view));
    const auto words = download<std::uint32_t>(words_image);

    desc.distribution = CLSP_DISTRIBUTION_UNIFORM;
    ASSERT_CLSP_OK(enqueue(clspPhiloxEnqueueFill, context, &desc, &floats_image.view));
    const auto uniforms = download<float>(floats_image);
    for (std::size_t i = 0; i < words.size(); ++i)
        ASSERT_EQ(std::fma(static_cast<float>(words[i]), 0x1p-32f, 0x1p-33f), uniforms[i]) << i;

    desc.distribution = CLSP_DISTRIBUTION_NORMAL;
    ASSERT_CLSP_OK(enqueue(clspPhiloxEnqueueFill, context, &desc, &floats_image.view));
    const auto normals = download<float>(floats_image);
    constexpr std::uint32_t quarter = height / 4;
    double mean = 0, square = 0;
    for (std::uint32_t y = 0; y < height; ++y) {
        for (std::uint32_t x = 0; x < width; ++x) {
            const std::uint32_t j = y / quarter, row = y % quarter, pair = j & ~1u;
            const double u = words[(row + pair * quarter) * width + x] * 0x1p-32 + 0x1p-33;
            const double angle = 2.0 * M_PI * words[(row + (pair + 1) * quarter) * width + x] * 0x1p-32;
            const double expected = std::sqrt(-2.0 * std::log(u)) * (j % 2 == 0 ? std::cos(angle) : std::sin(angle));
            const double got = normals[y * width + x];
            ASSERT_NEAR(expected, got, 2e-6) << x << ", " << y;
            mean += got;
            square += got * got;
        }
    }
    // 4096 samples: the mean has a standard error of 1/64, the variance one of sqrt(2)/64; five of them, fixed seed.
    EXPECT_NEAR(0.0, mean / 4096, 5.0 / 64);
    EXPECT_NEAR(1.0, square / 4096, 5.0 * std::sqrt(2.0) / 64);
}

TEST_F(Philox, DescInit) {
    test::check_init<ClspPhiloxDesc>("clspPhiloxDescInit", clspPhiloxDescInit);
    const auto desc = clspeckle::make<ClspPhiloxDesc>();
    EXPECT_EQ(CLSP_DISTRIBUTION_UNIFORM, desc.distribution);
    EXPECT_EQ(0u, desc.seed);
    EXPECT_EQ(0u, desc.frame_index);
    EXPECT_EQ(0x8000u, desc.stream);
    EXPECT_EQ(0u, desc.local_size);
}

TEST_F(Philox, FillRefusesBadArguments) {
    auto image = make_image(8, 8, CLSP_FORMAT_UINT32);
    const auto valid = bits();
    const auto fill = [&](const ClspPhiloxDesc *desc, const ClspImage *view) {
        return enqueue(clspPhiloxEnqueueFill, context, desc, view);
    };
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "context",
                      enqueue(clspPhiloxEnqueueFill, nullptr, &valid, &image.view));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "desc",
                      enqueue(clspPhiloxEnqueueFill, context, nullptr, &image.view));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "image", enqueue(clspPhiloxEnqueueFill, context, &valid, nullptr));
    const test::Refusals<ClspPhiloxDesc> refuses("clspPhiloxEnqueueFill", valid,
                                                 [&](ClspPhiloxDesc *desc) { return fill(desc, &image.view); });
    refuses.check_struct_size();
    test::check_image_rules("clspPhiloxEnqueueFill", context, image.view, "image", CLSP_FORMAT_FLOAT32,
                            [&](const ClspImage *view) { return fill(&valid, view); });
    using D = ClspPhiloxDesc;
    refuses("CLSP_DISTRIBUTION_UNIFORM (1) or CLSP_DISTRIBUTION_NORMAL (2)", &D::distribution, {3});
    // Floats do not go into UINT32.
    refuses("image", &D::distribution, {CLSP_DISTRIBUTION_NORMAL}, CLSP_ERROR_INVALID_FORMAT);
    refuses("frame_index", &D::frame_index, {std::uint64_t{1} << 48});
    refuses("stream", &D::stream, {0x10000});
    refuses("local_size", &D::local_size, {0x40000000});
    check_enqueue(CLSP_NAMED(clspPhiloxEnqueueFill), context, &valid, &image.view);
}

TEST_F(Philox, BlocksRefuseBadArguments) {
    const std::uint32_t key[2] = {1, 2};
    const clspeckle::Buffer in(context, 64), out(context, 64); // four blocks each
    const test::Foreign foreign;
    const auto run = [&](cl_mem counters, std::uint64_t in_offset, std::uint64_t count, std::uint64_t local_size,
                         cl_mem blocks, std::uint64_t out_offset) {
        return enqueue(clspPhiloxEnqueueBlocks, context, counters, in_offset, key, count, local_size, blocks,
                       out_offset);
    };
    const test::Failures fails("clspPhiloxEnqueueBlocks");
    EXPECT_CLSP_OK(run(in, 0, 4, 0, out, 0));
    EXPECT_CLSP_OK(run(in, 0, 4, 0, in, 0)) << "in place";
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "context",
                      enqueue(clspPhiloxEnqueueBlocks, nullptr, in, 0, key, 1, 0, out, 0));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "key",
                      enqueue(clspPhiloxEnqueueBlocks, context, in, 0, nullptr, 1, 0, out, 0));
    fails(CLSP_ERROR_INVALID_ARGUMENT, "counters", run(nullptr, 0, 4, 0, out, 0));
    fails(CLSP_ERROR_INVALID_ARGUMENT, "blocks", run(in, 0, 4, 0, nullptr, 0));
    fails(CLSP_ERROR_INVALID_ARGUMENT, "count", run(in, 0, 0, 0, out, 0));
    fails(CLSP_ERROR_BUFFER_TOO_SMALL, "counters", run(in, 0, 5, 0, out, 0));
    fails(CLSP_ERROR_BUFFER_TOO_SMALL, "counters", run(in, 16, 4, 0, out, 0));
    fails(CLSP_ERROR_BUFFER_TOO_SMALL, "blocks", run(in, 0, 4, 0, out, 4));
    for (int bit : {60, 61, 62, 63}) { // count * 16 would wrap around to a small number
        const ClspStatus got = run(in, 0, (std::uint64_t{1} << bit) + 1, 0, out, 0);
        EXPECT_TRUE(got == CLSP_ERROR_BUFFER_TOO_SMALL || got == CLSP_ERROR_INVALID_ARGUMENT) << clspStatusString(got);
    }
    fails(CLSP_ERROR_INVALID_ARGUMENT, "offset", run(in, 2, 1, 0, out, 0));
    fails(CLSP_ERROR_INVALID_ARGUMENT, "offset", run(in, 0, 1, 0, out, 2));
    fails(CLSP_ERROR_INVALID_ARGUMENT, "local_size", run(in, 0, 4, std::uint64_t{1} << 40, out, 0));
    fails(CLSP_ERROR_WRONG_CONTEXT, "counters", run(foreign.buffer, 0, 4, 0, out, 0));
    fails(CLSP_ERROR_WRONG_CONTEXT, "blocks", run(in, 0, 4, 0, foreign.buffer, 0));
    check_enqueue(CLSP_NAMED(clspPhiloxEnqueueBlocks), context, in, 0, key, 4, 0, out, 0);
}

} // namespace

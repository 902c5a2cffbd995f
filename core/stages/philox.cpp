#include "stages/philox.hpp"

#include "runtime/error.hpp"
#include "runtime/kernel_arguments.hpp"

#include <cmath>
#include <fmt/core.h>

namespace clsp {
namespace {

void check_local_size(Context &context, std::uint64_t local_size) {
    const std::size_t largest = context.device().getInfo<CL_DEVICE_MAX_WORK_GROUP_SIZE>();
    if (local_size > largest)
        throw Error(
            Status::kInvalidArgument,
            fmt::format("local_size is {}, but {} takes at most {} work-items in a group; 0 leaves it to the device",
                        local_size, context.device_name(), largest));
}

} // namespace

void check_frame_index(std::uint64_t frame_index) {
    if (frame_index > kMaxFrameIndex)
        throw Error(Status::kInvalidArgument, fmt::format("frame_index is {}, it must be below 2^48", frame_index));
}

std::array<std::uint32_t, 4> host_block(std::uint64_t seed, std::array<std::uint32_t, 4> counter) {
    auto k0 = static_cast<std::uint32_t>(seed), k1 = static_cast<std::uint32_t>(seed >> 32);
    for (int round = 0; round < 10; ++round) {
        const std::uint64_t p0 = std::uint64_t{0xD2511F53u} * counter[0], p1 = std::uint64_t{0xCD9E8D57u} * counter[2];
        counter = {static_cast<std::uint32_t>(p1 >> 32) ^ counter[1] ^ k0, static_cast<std::uint32_t>(p1),
                   static_cast<std::uint32_t>(p0 >> 32) ^ counter[3] ^ k1, static_cast<std::uint32_t>(p0)};
        k0 += 0x9E3779B9u;
        k1 += 0xBB67AE85u;
    }
    return counter;
}

std::array<double, 2> host_normals(std::uint64_t seed, std::uint64_t frame_index, std::uint32_t stream) {
    const std::array<std::uint32_t, 4> counter =
        host_block(seed, {0, 0, frame_low(frame_index), stream | frame_high(frame_index) << 16});
    const double u = (counter[0] + 0.5) * 0x1p-32, angle = 2.0 * M_PI * counter[1] * 0x1p-32;
    const double r = std::sqrt(-2.0 * std::log(u));
    return {r * std::cos(angle), r * std::sin(angle)};
}

void enqueue_philox_blocks(Context &context, CommandChain &chain, cl_mem counters, std::uint64_t counters_offset_bytes,
                           const std::uint32_t key[2], std::uint64_t count, std::uint64_t local_size, cl_mem blocks,
                           std::uint64_t blocks_offset_bytes) {
    constexpr std::uint64_t kBlockBytes = 16;
    if (!key)
        throw Error(Status::kInvalidArgument, "key is NULL; it is an array of two uint32");
    if (count == 0 || count > 0xffffffffu)
        throw Error(Status::kInvalidArgument, fmt::format("count is {}, it must be 1 to 2^32 - 1", count));
    if (counters_offset_bytes % 4 != 0 || blocks_offset_bytes % 4 != 0)
        throw Error(Status::kInvalidArgument,
                    fmt::format("counters_offset_bytes ({}) and blocks_offset_bytes ({}) must be multiples of 4",
                                counters_offset_bytes, blocks_offset_bytes));
    check_local_size(context, local_size);
    check_buffer(counters, "counters", context.cl_context()(), counters_offset_bytes, count * kBlockBytes);
    check_buffer(blocks, "blocks", context.cl_context()(), blocks_offset_bytes, count * kBlockBytes);
    const bool same = counters == blocks && counters_offset_bytes == blocks_offset_bytes;
    if (!same && counters == blocks && counters_offset_bytes < blocks_offset_bytes + count * kBlockBytes &&
        blocks_offset_bytes < counters_offset_bytes + count * kBlockBytes)
        throw Error(Status::kOverlap,
                    "counters and blocks overlap without being the same; use one place for both, or two apart");
    cl::Kernel kernel = context.kernel("stages/philox.cl", "philox_blocks", "-DDISTRIBUTION=0");
    KernelArguments(kernel)
        .add(counters)
        .add(cl_ulong{counters_offset_bytes / 4})
        .add(cl_uint2{{key[0], key[1]}})
        .add(cl_ulong{count})
        .add(blocks)
        .add(cl_ulong{blocks_offset_bytes / 4});
    chain.run("philox", kernel, count, 1, 1, local_size);
}

void enqueue_philox_fill(Context &context, CommandChain &chain, const PhiloxParameters &parameters,
                         const ImageDescription &image) {
    if (parameters.stream < 0x8000 || parameters.stream > 0xffff)
        throw Error(
            Status::kInvalidArgument,
            fmt::format("stream is {:#x}; streams for the host are 0x8000 to 0xffff, lower ones are the library's own",
                        parameters.stream));
    check_frame_index(parameters.frame_index);
    check_local_size(context, parameters.local_size);
    const ImageView view =
        check_image(image, "image", context.cl_context()(), {0, 0},
                    {parameters.distribution == Distribution::kBits ? Format::kUint32 : Format::kFloat32});
    const std::uint32_t quarter = quarter_rows(view.height);
    cl::Kernel kernel =
        context.kernel("stages/philox.cl", "philox_fill",
                       fmt::format("-DDISTRIBUTION={}", static_cast<std::uint32_t>(parameters.distribution)));
    KernelArguments(kernel)
        .add(view)
        .add(cl_uint{view.width})
        .add(cl_uint{view.height})
        .add(cl_uint{quarter})
        .add(philox_key(parameters.seed))
        .add(frame_low(parameters.frame_index))
        .add(frame_high(parameters.frame_index))
        .add(cl_uint{parameters.stream});
    chain.run("philox", kernel, view.width, quarter, 1, parameters.local_size);
}

} // namespace clsp

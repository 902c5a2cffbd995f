#include "clspeckle/philox.h"

#include "convert.hpp"
#include "handles.hpp"
#include "stages/philox.hpp"

using namespace clsp;
using namespace clsp::capi;

namespace clsp::capi {

CLSP_ENUM(Distribution, kNormal, CLSP_DISTRIBUTION_BITS, CLSP_DISTRIBUTION_UNIFORM, CLSP_DISTRIBUTION_NORMAL)

} // namespace clsp::capi

namespace {

ClspPhiloxDesc philox_defaults() {
    const PhiloxParameters p;
    ClspPhiloxDesc desc{};
    desc.struct_size = sizeof desc;
    desc.distribution = static_cast<std::uint32_t>(p.distribution);
    desc.seed = p.seed;
    desc.frame_index = p.frame_index;
    desc.stream = p.stream;
    desc.local_size = p.local_size;
    return desc;
}

} // namespace

extern "C" {

CLSP_API ClspStatus clspPhiloxEnqueueBlocks(ClspContext context, cl_command_queue queue, cl_mem counters,
                                            uint64_t counters_offset_bytes, const uint32_t key[2], uint64_t count,
                                            uint64_t local_size, cl_mem blocks, uint64_t blocks_offset_bytes,
                                            uint32_t num_events_in_wait_list, const cl_event *event_wait_list,
                                            cl_event *event) {
    return guarded("clspPhiloxEnqueueBlocks", [&] {
        const auto c = object(context);
        enqueue(*c, queue, num_events_in_wait_list, event_wait_list, event, [&](CommandChain &chain) {
            enqueue_philox_blocks(*c, chain, counters, counters_offset_bytes, key, count, local_size, blocks,
                                  blocks_offset_bytes);
        });
    });
}

CLSP_INIT(PhiloxDesc, desc, philox_defaults())

CLSP_API ClspStatus clspPhiloxEnqueueFill(ClspContext context, cl_command_queue queue, const ClspPhiloxDesc *desc,
                                          const ClspImage *image, uint32_t num_events_in_wait_list,
                                          const cl_event *event_wait_list, cl_event *event) {
    return guarded("clspPhiloxEnqueueFill", [&] {
        const auto c = object(context);
        const ClspPhiloxDesc d = read_struct(desc, philox_defaults(), "desc");
        PhiloxParameters p;
        p.distribution = checked_enum<Distribution>(d.distribution, "desc->distribution");
        p.seed = d.seed;
        p.frame_index = d.frame_index;
        p.stream = d.stream;
        p.local_size = d.local_size;
        enqueue(*c, queue, num_events_in_wait_list, event_wait_list, event,
                [&](CommandChain &chain) { enqueue_philox_fill(*c, chain, p, description(image, "image")); });
    });
}

} // extern "C"

// Philox on its own: blocks from counters, and images of bits, uniforms and normals.
#include "philox.h"

__kernel void philox_blocks(__global const uint *counters, ulong counters_offset, uint2 key, ulong count,
                            __global uint *blocks, ulong blocks_offset) {
    const ulong i = get_global_id(0);
    if (i >= count)
        return;
    const uint4 counter = vload4(i, counters + counters_offset);
    vstore4(philox4x32_10(counter, key), i, blocks + blocks_offset);
}

// One work-item a block: four pixels, one in each quarter of the rows.
__kernel void philox_fill(__global uint *image, ulong offset, uint pitch, uint width, uint height, uint quarter,
                          uint2 key, uint frame_low, uint frame_high, uint stream) {
    const uint x = get_global_id(0), row = get_global_id(1);
    if (x >= width || row >= quarter)
        return;
    uint4 block = image_block(x, row, frame_low, frame_high, stream, key);
#if DISTRIBUTION == 1
    block = as_uint4((float4)(uniform_from_word(block.x), uniform_from_word(block.y), uniform_from_word(block.z),
                              uniform_from_word(block.w)));
#elif DISTRIBUTION == 2
    block = as_uint4(normals_from_block(block));
#endif
    for (uint j = 0; j < 4; ++j) {
        const uint y = row + j * quarter;
        if (y < height)
            image[offset + (ulong)y * pitch + x] = word_of(block, j);
    }
}

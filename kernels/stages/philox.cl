// Philox on its own: blocks from counters, and images of bits, uniforms and normals.
#include "common/philox.h"

__kernel void philox_blocks(__global const uint *counters, ulong counters_offset, uint2 key, ulong count,
                            __global uint *blocks, ulong blocks_offset) {
    const ulong i = get_global_id(0);
    if (i >= count)
        return;
    __global const uint *from = counters + counters_offset + 4 * i;
    const words4 counter = {from[0], from[1], from[2], from[3]};
    const words4 block = philox4x32_10(counter, key);
    __global uint *to = blocks + blocks_offset + 4 * i;
    to[0] = block.w0;
    to[1] = block.w1;
    to[2] = block.w2;
    to[3] = block.w3;
}

// One work-item a block: four pixels, one in each quarter of the rows.
__kernel void philox_fill(__global uint *image, ulong offset, uint pitch, uint width, uint height, uint quarter,
                          uint2 key, uint frame_low, uint frame_high, uint stream) {
    const uint x = get_global_id(0), row = get_global_id(1);
    if (x >= width || row >= quarter)
        return;
    const words4 block = image_block(x, row, frame_low, frame_high, stream, key);
#if DISTRIBUTION == 2
    const normals4 normals = normals_from_block(block);
    const float n[4] = {normals.n0, normals.n1, normals.n2, normals.n3};
#endif
    for (uint j = 0; j < 4; ++j) {
        const uint y = row + j * quarter;
        if (y >= height)
            continue;
#if DISTRIBUTION == 0
        image[offset + (ulong)y * pitch + x] = word_of(block, j);
#elif DISTRIBUTION == 1
        image[offset + (ulong)y * pitch + x] = as_uint(uniform_from_word(word_of(block, j)));
#else
        image[offset + (ulong)y * pitch + x] = as_uint(n[j]);
#endif
    }
}

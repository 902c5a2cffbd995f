// surface_heights with explicit vectors for CPU devices: the same bits as surface_heights.cl. A work-item draws row y
// mod Q of the grid, and with it the rows Q, 2 Q and 3 Q below (Q: a quarter of the rows), LANES columns at once.
#include "common/philox.h"
#include "common/lanes.h"

__kernel void surface_heights_lanes(uint grid_width, uint grid_height, uint quarter, uint2 key, uint epoch_low,
                                    uint epoch_high, __global float *heights) {
    const uint row = get_global_id(0);
    if (row >= quarter)
        return;
    for (uint x = 0; x < grid_width; x += LANES) {
        lanes_words4 blocks;
        lanes_f normals[4];
        image_blocks(x, row, epoch_low, epoch_high, STREAM_SURFACE_HEIGHT, key, &blocks);
        normals_from_blocks(&blocks, normals);
        for (uint j = 0; j < 4; ++j)
            if (row + j * quarter < grid_height)
                store_some(normals[j], heights + (ulong)(row + j * quarter) * grid_width + x,
                           min((uint)LANES, grid_width - x));
    }
}

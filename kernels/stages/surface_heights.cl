// The surface's heights on the field grid in standard deviations: what several lines of a laser see differently
// (field_sample.h).
#include "common/philox.h"

// One work-item a Philox block: four samples, one in each quarter of the rows. epoch: the frame that drew the surface.
__kernel void surface_heights(uint grid_width, uint grid_height, uint quarter, uint2 key, uint epoch_low,
                              uint epoch_high, __global float *heights) {
    const uint x = get_global_id(0), row = get_global_id(1);
    if (x >= grid_width || row >= quarter)
        return;
    const normals4 normals = normals_from_block(image_block(x, row, epoch_low, epoch_high, STREAM_SURFACE_HEIGHT, key));
    for (uint j = 0; j < 4; ++j)
        if (row + j * quarter < grid_height)
            heights[(ulong)(row + j * quarter) * grid_width + x] = normal_of(normals, j);
}

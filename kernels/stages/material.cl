// A number for each pixel from a table over material ids.
#include "common/common.h"

// Ids outside the table take the first entry; the field stage reports them.
__kernel void material_lookup(__global const uchar *material, ulong material_offset, uint material_pitch,
                              uint material_count, __global const float *table, __global float *values, uint width,
                              uint height) {
    const uint x = get_global_id(0), y = get_global_id(1);
    if (x >= width || y >= height)
        return;
    const uint id = material[material_offset + (ulong)y * material_pitch + x];
    values[(ulong)y * width + x] = table[id < material_count ? id : 0u];
}

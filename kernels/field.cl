// The field that leaves the surface towards the lens, sample by sample.
//   MATERIALS, COHERENT, LINES, SCREEN  as in field_sample.h
#include "field_sample.h"

__kernel void field_illuminate(FIELD_PARAMETERS, __global complex_float *field, __global uint *bad) {
    const uint x = get_global_id(0), y = get_global_id(1);
    if (x >= grid_width || y >= grid_height)
        return;
    field[(ulong)y * grid_width + x] = field_sample(FIELD_ARGUMENTS(oversampling), bad, x, y);
}

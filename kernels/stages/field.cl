// The field that leaves the surface towards the lens, sample by sample.
//   MATERIALS, COHERENT, LINES, SCREEN, PADDED  as in field_sample.h
#include "stages/field_sample.h"

__kernel void field_illuminate(FIELD_PARAMETERS, __global complex_float *field, __global uint *bad) {
    const uint x = get_global_id(0), y = get_global_id(1);
    if (x >= grid_width || y >= grid_height)
        return;
    uint wrong = 0;
    const field_input_t input = field_input(FIELD_ARGUMENTS(oversampling), x, y);
    field[(ulong)y * grid_width + x] = field_value(FIELD_ARGUMENTS(oversampling), input, &wrong, x, y);
    if (wrong)
        field_report(FIELD_ARGUMENTS(oversampling), bad, x, y);
}

// From an image to the tightly packed floats that an effect of the user's own works on, and back. PIXEL: the image's
// type.
#include "common/common.h"

__kernel void own_effect_gather(__global const PIXEL *image, ulong offset, uint pitch, __global float *pixels,
                                uint width, uint height) {
    const uint x = get_global_id(0), y = get_global_id(1);
    if (x < width && y < height)
        pixels[y * width + x] = (float)image[offset + (ulong)y * pitch + x];
}

// top: of codes, which are rounded to 0 ... top; NaN is 0. 0: floats stay as they are.
__kernel void own_effect_scatter(__global const float *pixels, float top, __global PIXEL *image, ulong offset,
                                 uint pitch, uint width, uint height) {
    const uint x = get_global_id(0), y = get_global_id(1);
    if (x >= width || y >= height)
        return;
    const float value = pixels[y * width + x];
    image[offset + (ulong)y * pitch + x] = (PIXEL)(top > 0.0f ? rint(fmin(fmax(value, 0.0f), top)) : value);
}

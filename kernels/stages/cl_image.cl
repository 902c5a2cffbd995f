// cl_images into images in buffers and back. The build names the type of a COMPONENT, the number of COMPONENTS of a
// pixel, whether the cl_image's texels are INTEGERS, and CODES: the largest code, where a cl_image holds codes as
// fractions of it (UNORM), else 0.
#include "common/common.h"

#if INTEGERS
typedef uint channel_t;
typedef uint4 texel_t;
#define READ_TEXEL read_imageui
#define WRITE_TEXEL write_imageui
#else
typedef float channel_t;
typedef float4 texel_t;
#define READ_TEXEL read_imagef
#define WRITE_TEXEL write_imagef
#endif

__kernel void cl_image_import(__read_only image2d_t image, uint first_channel, __global COMPONENT *to, ulong offset,
                              uint pitch) {
    const sampler_t nearest = CLK_NORMALIZED_COORDS_FALSE | CLK_ADDRESS_CLAMP_TO_EDGE | CLK_FILTER_NEAREST;
    const uint x = get_global_id(0), y = get_global_id(1);
    const texel_t texel = READ_TEXEL(image, nearest, (int2)((int)x, (int)y));
    const channel_t channels[4] = {texel.x, texel.y, texel.z, texel.w};
    __global COMPONENT *pixel = to + offset + (ulong)y * pitch + COMPONENTS * x;
    for (uint i = 0; i < COMPONENTS; ++i) {
#if CODES
        pixel[i] = (COMPONENT)rint(channels[first_channel + i] * CODES);
#else
        pixel[i] = (COMPONENT)channels[first_channel + i];
#endif
    }
}

__kernel void cl_image_export(__global const COMPONENT *from, ulong offset, uint pitch, __write_only image2d_t image) {
    const uint x = get_global_id(0), y = get_global_id(1);
    __global const COMPONENT *pixel = from + offset + (ulong)y * pitch + COMPONENTS * x;
    channel_t channels[4] = {0, 0, 0, 1};
    for (uint i = 0; i < COMPONENTS; ++i) {
#if CODES
        channels[i] = (channel_t)pixel[i] / CODES;
#else
        channels[i] = (channel_t)pixel[i];
#endif
    }
    WRITE_TEXEL(image, (int2)((int)x, (int)y), (texel_t)(channels[0], channels[1], channels[2], channels[3]));
}

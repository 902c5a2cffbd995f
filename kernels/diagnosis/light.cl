// Light between the lens and the sensor, for all frames of a sequence at once: laser power, ambient light, fall-off.
#include "common/common.h"
#include "stages/vignetting.h"

// out = (factor u intensity + ambient) v,   v = 1 - corner_loss r^2,  r^2 = |position|^2 / unit^2; factor: one for
// each frame; u = max(0, 1 + uneven_part uneven), of lamp or laser at a pixel.
// optics: principal point (x, y), 1 / unit^2, corner loss. frame_stride: floats from one frame's intensity to the next
// one's, 0 where all frames have the same. The frames lie one behind the other, densely. One work-item a pixel; the
// third dimension is the frame. The launch is as large as the frames (CommandChain::run without a local width). No
// other buffer is `out`.
__kernel void light_finish(__global const float *restrict intensity, ulong frame_stride,
                           __global const float *restrict factor, __global const float *restrict uneven,
                           float uneven_part, float ambient, float4 optics, __global float *restrict out, uint width,
                           uint height) {
    const uint x = get_global_id(0), y = get_global_id(1), frame = get_global_id(2);
    const ulong pixel = (ulong)y * width + x;
    const float px = convert_float(x) - optics.x, py = convert_float(y) - optics.y;
    float source = factor[frame];
    if (uneven_part > 0.0f)
        source *= fmax(0.0f, fma(uneven_part, uneven[pixel], 1.0f));
    out[(ulong)frame * width * height + pixel] =
        fma(source, intensity[frame * frame_stride + pixel], ambient) * vignetting(px, py, optics);
}

// What a lens does beside diffraction: distortion, glare, ambient light, vignetting. The equations are in lens.h of the
// C API.
#include "common/common.h"
#include "stages/vignetting.h"

#if DISTORT_SHIFT

// Vectors between pixels, (x, y) in pixels, as the lens shows them: the nearest one to each pixel's source, times the
// inverse of J, the slope of the map u from distorted pixels to ideal ones, since u(q) + s = u(q + J^-1 s) to first
// order. J is taken from differences of the displacement u(q) - q: central, one-sided at the border. Where the source
// lies outside there is no shift.
__kernel void lens_distort_shift(__global const float *ideal, ulong ideal_offset, uint ideal_pitch,
                                 __global const float *displacement, __global float *distorted, ulong distorted_offset,
                                 uint distorted_pitch, uint width, uint height) {
    const uint x = get_global_id(0), y = get_global_id(1);
    if (x >= width || y >= height)
        return;
    __global const float *at = displacement + 2u * ((ulong)y * width + x);
    __global float *out = distorted + distorted_offset + (ulong)y * distorted_pitch + 2u * x;
    const int source_x = (int)x + (int)floor(at[0] + 0.5f), source_y = (int)y + (int)floor(at[1] + 0.5f);
    if (source_x < 0 || source_y < 0 || source_x >= (int)width || source_y >= (int)height) {
        out[0] = out[1] = 0.0f;
        return;
    }
    __global const float *in = ideal + ideal_offset + (ulong)source_y * ideal_pitch + 2 * source_x;
    const float shift_x = in[0], shift_y = in[1];
    const uint left = x > 0u ? 1u : 0u, right = x + 1u < width ? 1u : 0u;
    const uint above = y > 0u ? width : 0u, below = y + 1u < height ? width : 0u;
    // An image one pixel wide has no slope along x; likewise along y.
    const float per_x = left + right == 2u ? 0.5f : 1.0f, per_y = above != 0u && below != 0u ? 0.5f : 1.0f;
    const float xx = fma(per_x, at[2 * (int)right] - at[-2 * (int)left], 1.0f);
    const float yx = per_x * (at[2 * (int)right + 1] - at[-2 * (int)left + 1]);
    const float xy = per_y * (at[2 * (int)below] - at[-2 * (int)above]);
    const float yy = fma(per_y, at[2 * (int)below + 1] - at[-2 * (int)above + 1], 1.0f);
    const float determinant = fma(xx, yy, -xy * yx);
    // The map is one to one where the lens was accepted; differences over a pixel may say otherwise only next to a
    // fold.
    if (!(determinant > 0.0f)) {
        out[0] = shift_x;
        out[1] = shift_y;
        return;
    }
    out[0] = fma(yy, shift_x, -xy * shift_y) / determinant;
    out[1] = fma(xx, shift_y, -yx * shift_x) / determinant;
}

#elif DISTORT

#define INTERPOLATION_NEAREST 0
#define INTERPOLATION_LINEAR 1
#define INTERPOLATION_CUBIC 2

// component_t comes from the options (-DCOMPONENT=float): the type of a component; COMPONENTS of them make a pixel. A
// source outside the image gives OUTSIDE.
typedef COMPONENT component_t;

#if INTERPOLATION == INTERPOLATION_CUBIC
typedef struct {
    float w0, w1, w2, w3;
} weights4;

// Keys' cubic convolution with a = -1/2 (Catmull-Rom), the taps at -1, 0, 1, 2; f in [0, 1).
static inline weights4 cubic_weights(float f) {
    const weights4 w = {f * fma(f, fma(-0.5f, f, 1.0f), -0.5f), fma(f * f, fma(1.5f, f, -2.5f), 1.0f),
                        f * fma(f, fma(-1.5f, f, 2.0f), 0.5f), f * f * fma(0.5f, f, -0.5f)};
    return w;
}
#endif

static inline int clamped(int i, uint count) { return clamp(i, 0, (int)count - 1); }

// displacement: from each pixel of the distorted image to its source in the ideal one, in pixels: floats hold it, where
// they would not hold the position of a pixel far from the origin.
__kernel void lens_distort(__global const component_t *ideal, ulong ideal_offset, uint ideal_pitch,
                           __global const float *displacement, __global component_t *distorted, ulong distorted_offset,
                           uint distorted_pitch, uint width, uint height) {
    const uint x = get_global_id(0), y = get_global_id(1);
    if (x >= width || y >= height)
        return;
#if HAS_MAP
    const ulong i = 2u * ((ulong)y * width + x);
    const float dx = displacement[i], dy = displacement[i + 1u];
#else
    const float dx = 0.0f, dy = 0.0f;
#endif
    __global component_t *out = distorted + distorted_offset + (ulong)y * distorted_pitch + COMPONENTS * x;
    __global const component_t *in = ideal + ideal_offset;
    // Nearest: halves go up, as they do at the image's border, which reaches from -1/2 to width - 1/2.
    const float step_x = floor(dx + 0.5f), step_y = floor(dy + 0.5f);
    const int nearest_x = (int)x + (int)step_x, nearest_y = (int)y + (int)step_y;
    if (nearest_x < 0 || nearest_y < 0 || nearest_x >= (int)width || nearest_y >= (int)height) {
        for (int c = 0; c < COMPONENTS; ++c)
            out[c] = OUTSIDE;
        return;
    }
#if INTERPOLATION == INTERPOLATION_NEAREST
    for (int c = 0; c < COMPONENTS; ++c)
        out[c] = in[(ulong)nearest_y * ideal_pitch + COMPONENTS * nearest_x + c];
#else
    const float base_x = floor(dx), base_y = floor(dy);
    const float fx = dx - base_x, fy = dy - base_y;
    const int x0 = (int)x + (int)base_x, y0 = (int)y + (int)base_y;
#if INTERPOLATION == INTERPOLATION_LINEAR
    const int xs[2] = {clamped(x0, width), clamped(x0 + 1, width)};
    __global const component_t *upper = in + (ulong)clamped(y0, height) * ideal_pitch;
    __global const component_t *lower = in + (ulong)clamped(y0 + 1, height) * ideal_pitch;
    for (int c = 0; c < COMPONENTS; ++c) {
        const float above = mix(upper[COMPONENTS * xs[0] + c], upper[COMPONENTS * xs[1] + c], fx);
        const float below = mix(lower[COMPONENTS * xs[0] + c], lower[COMPONENTS * xs[1] + c], fx);
        out[c] = mix(above, below, fy);
    }
#else
    const weights4 wx = cubic_weights(fx), wy = cubic_weights(fy);
    const int c0 = COMPONENTS * clamped(x0 - 1, width), c1 = COMPONENTS * clamped(x0, width);
    const int c2 = COMPONENTS * clamped(x0 + 1, width), c3 = COMPONENTS * clamped(x0 + 2, width);
    __global const component_t *r0 = in + (ulong)clamped(y0 - 1, height) * ideal_pitch;
    __global const component_t *r1 = in + (ulong)clamped(y0, height) * ideal_pitch;
    __global const component_t *r2 = in + (ulong)clamped(y0 + 1, height) * ideal_pitch;
    __global const component_t *r3 = in + (ulong)clamped(y0 + 2, height) * ideal_pitch;
#define ALONG(row) fma(wx.w0, row[c0 + c], fma(wx.w1, row[c1 + c], fma(wx.w2, row[c2 + c], wx.w3 * row[c3 + c])))
#define LEAST(row) fmin(fmin(row[c0 + c], row[c1 + c]), fmin(row[c2 + c], row[c3 + c]))
    for (int c = 0; c < COMPONENTS; ++c) {
        float sum = fma(wy.w0, ALONG(r0), fma(wy.w1, ALONG(r1), fma(wy.w2, ALONG(r2), wy.w3 * ALONG(r3))));
        // The cubic's undershoot must not make light negative. A NaN stays one.
        if (sum < 0.0f)
            sum = fmax(sum, fmin(0.0f, fmin(fmin(LEAST(r0), LEAST(r1)), fmin(LEAST(r2), LEAST(r3)))));
        out[c] = sum;
    }
#endif
#endif
}

#else

// out = (ambient + (1 - g) light + g glare) v(x, y): v = (1 - corner_loss r^2), r^2 = |position|^2 / unit^2, times
// cos^4 = 1 / (1 + (x/fx)^2 + (y/fy)^2)^2. optics: principal point (x, y), 1 / unit^2, corner loss; inverse_focal: 1 /
// fx, 1 / fy. light and output may be the same pixels.
__kernel void lens_finish(__global const float *light, ulong light_offset, uint light_pitch,
#if GLARE
                          __global const float *spread, uint spread_width, float glare_fraction,
#endif
                          float ambient, float4 optics, float2 inverse_focal, __global float *output,
                          ulong output_offset, uint output_pitch, uint width, uint height) {
    const uint x = get_global_id(0), y = get_global_id(1);
    if (x >= width || y >= height)
        return;
    float value = light[light_offset + (ulong)y * light_pitch + x];
#if GLARE
    // The transform's rounding must not make light negative.
    const float glare = spread[(ulong)y * spread_width + x];
    value = value >= 0.0f ? fmax(fma(1.0f - glare_fraction, value, glare_fraction * glare), 0.0f) : value;
#endif
    value += ambient;
#if VIGNETTING || COS4
    const float px = convert_float(x) - optics.x, py = convert_float(y) - optics.y;
#endif
#if VIGNETTING
    value *= vignetting(px, py, optics);
#endif
#if COS4
    const float tx = px * inverse_focal.x, ty = py * inverse_focal.y;
    const float q = 1.0f + fma(tx, tx, ty * ty);
    value /= q * q;
#endif
    output[output_offset + (ulong)y * output_pitch + x] = value;
}

#endif

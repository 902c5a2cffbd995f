// The projected pattern, looked up per pixel. The equations are in pattern.h of the C API.
#include "common/common.h"

#if HAS_POSITION
#define GEOMETRY_PARAMETERS                                                                                            \
    __global const float *position, ulong position_offset, uint position_pitch, uint position_stride
#define GEOMETRY position, position_offset, position_pitch, position_stride
#else
#define GEOMETRY_PARAMETERS __global const float *depth, ulong depth_offset, uint depth_pitch, float4 intrinsics
#define GEOMETRY depth, depth_offset, depth_pitch, intrinsics
#endif

// A pixel's point in the geometry frame; false where there is no surface.
static inline bool point_at(uint x, uint y, GEOMETRY_PARAMETERS, float3 *point) {
#if HAS_POSITION
    __global const float *p = position + position_offset + (ulong)y * position_pitch + x * position_stride;
    *point = (float3)(p[0], p[1], p[2]);
    return isfinite(p[0]) && isfinite(p[1]) && isfinite(p[2]);
#else
    // intrinsics: fx, fy, cx, cy.
    const float3 ray = (float3)((convert_float(x) - intrinsics.z) / intrinsics.x,
                                (convert_float(y) - intrinsics.w) / intrinsics.y, 1.0f);
    const float d_camera = depth[depth_offset + (ulong)y * depth_pitch + x];
#if DEPTH_ALONG_RAY
    *point = ray * (d_camera / sqrt(dot(ray, ray)));
#else
    *point = ray * d_camera;
#endif
    return d_camera > 0.0f && d_camera <= FLT_MAX;
#endif
}

static inline float3 in_laser_frame(float16 pose, float3 point) {
    return (float3)(dot(pose.s012, point) + pose.s3, dot(pose.s456, point) + pose.s7, dot(pose.s89a, point) + pose.sb);
}

// Where light that goes to a point of the laser's frame leaves the pattern, in texels, 0 at the first texel's centre.
static inline float2 texel_of(float3 laser_point, float inverse_d, float4 extent, int width, int height) {
#if DIRECTION_COSINES
    const float2 direction = laser_point.xy * inverse_d;
#else
    const float2 direction = laser_point.xy / laser_point.z;
#endif
    // Texel centres lie half a texel inside the edge.
    return (float2)((direction.x / extent.x + 1.0f) * 0.5f * convert_float(width) - 0.5f,
                    (direction.y / extent.y + 1.0f) * 0.5f * convert_float(height) - 0.5f);
}

#if AREA_FILTER
#define LEAST_FOOTPRINT 0.0625f

// The integral of linear interpolation between texels up to x, as a combination of the sums before three edges:
// (1-f)^2/2 S[i] + (1/2 + f - f^2) S[i+1] + f^2/2 S[i+2], i the texel below x, f what remains. sign: -1 at the
// beginning of an interval.
static inline void integral_weights(float x, int count, float sign, int edges[3], float weights[3]) {
    const float cx = clamp(x, -1.0f, convert_float(count));
    const float whole = floor(cx);
    const float f = cx - whole;
    for (int k = 0; k < 3; ++k)
        edges[k] = clamp((int)whole + k, 0, count);
    weights[0] = sign * 0.5f * (1.0f - f) * (1.0f - f);
    weights[1] = sign * (0.5f + f - f * f);
    weights[2] = sign * 0.5f * f * f;
}

// The mean over a rectangle of wx by wy texels around (x, y).
static inline float area_mean(__global const uint *sums, float unit, int width, int height, float x, float y, float wx,
                              float wy) {
    // Outside, or not a number.
    if (!(x + 0.5f * wx > -1.0f && y + 0.5f * wy > -1.0f && x - 0.5f * wx < convert_float(width) &&
          y - 0.5f * wy < convert_float(height)))
        return 0.0f;
    int ex[6], ey[6];
    float ax[6], ay[6];
    // The area is that between the edges as rounded, not wx wy.
    const float x0 = x - 0.5f * wx, x1 = x + 0.5f * wx, y0 = y - 0.5f * wy, y1 = y + 0.5f * wy;
    integral_weights(x0, width, -1.0f, ex, ax);
    integral_weights(x1, width, 1.0f, ex + 3, ax + 3);
    integral_weights(y0, height, -1.0f, ey, ay);
    integral_weights(y1, height, 1.0f, ey + 3, ay + 3);
    // Weights of an axis sum to 0, so that sums may be counted from the first edge on: small, exact integers.
    const int pitch = width + 1;
    __global const uint *first = sums + (ulong)ey[0] * (uint)pitch;
    uint base[6];
    for (int i = 0; i < 6; ++i)
        base[i] = first[ex[i]] - first[ex[0]];
    float sum = 0.0f;
    for (int j = 1; j < 6; ++j) {
        __global const uint *line = sums + (ulong)ey[j] * (uint)pitch;
        const uint start = line[ex[0]];
        float row = 0.0f;
        for (int i = 1; i < 6; ++i)
            row = fma(ax[i], convert_float(line[ex[i]] - start - base[i]), row);
        sum = fma(ay[j], row, sum);
    }
    return fmax(0.0f, sum) * unit / ((x1 - x0) * (y1 - y0));
}

// The step of the pattern coordinates to the nearer of two neighbouring pixels; (0, 0) if neither shows a surface.
static inline float2 nearer_step(uint x, uint y, int dx, int dy, uint width, uint height, float2 here,
                                 GEOMETRY_PARAMETERS, float16 pose, float4 extent, int texels_width,
                                 int texels_height) {
    float2 best = (float2)(0.0f, 0.0f);
    float least = FLT_MAX;
    for (int side = -1; side <= 1; side += 2) {
        const int nx = (int)x + side * dx, ny = (int)y + side * dy;
        float3 point;
        if (nx < 0 || ny < 0 || nx >= (int)width || ny >= (int)height ||
            !point_at((uint)nx, (uint)ny, GEOMETRY, &point))
            continue;
        const float3 laser_point = in_laser_frame(pose, point);
        if (!(laser_point.z > 0.0f))
            continue;
        const float2 there =
            texel_of(laser_point, 1.0f / sqrt(dot(laser_point, laser_point)), extent, texels_width, texels_height);
        const float2 step = (there - here) * convert_float(side);
        const float length2 = dot(step, step);
        if (length2 < least) {
            least = length2;
            best = step;
        }
    }
    return best;
}

// The mean over a pixel's footprint, in FILTER_TAPS x FILTER_TAPS rectangles along its own axes.
static inline float footprint_mean(__global const uint *sums, float unit, int width, int height, float2 centre,
                                   float2 along_x, float2 along_y) {
    const float wx = fmax(LEAST_FOOTPRINT, hypot(along_x.x, along_y.x) / FILTER_TAPS);
    const float wy = fmax(LEAST_FOOTPRINT, hypot(along_x.y, along_y.y) / FILTER_TAPS);
    float sum = 0.0f;
    for (int b = 0; b < FILTER_TAPS; ++b)
        for (int a = 0; a < FILTER_TAPS; ++a) {
            const float2 at = centre + along_x * ((convert_float(a) + 0.5f) / FILTER_TAPS - 0.5f) +
                              along_y * ((convert_float(b) + 0.5f) / FILTER_TAPS - 0.5f);
            sum += area_mean(sums, unit, width, height, at.x, at.y, wx, wy);
        }
    return sum / (FILTER_TAPS * FILTER_TAPS);
}
#else
// A bilinear lookup in float arithmetic: texture units interpolate with 8 bits and differ between devices. (x, y) in
// texels, 0 at the first texel's centre.
static inline float bilinear(__global const float *texels, int width, int height, float x, float y) {
    // Outside, or not a number: nothing, and no conversion that overflows.
    if (!(x >= -0.5f && y >= -0.5f && x <= (float)width - 0.5f && y <= (float)height - 0.5f))
        return 0.0f;
    const float cx = clamp(x, 0.0f, (float)(width - 1)), cy = clamp(y, 0.0f, (float)(height - 1));
    const int x0 = min((int)cx, width - 2), y0 = min((int)cy, height - 2);
    const float ax = cx - (float)x0, ay = cy - (float)y0;
    __global const float *row = texels + (ulong)y0 * width + x0;
    return mix(mix(row[0], row[1], ax), mix(row[width], row[width + 1], ax), ay);
}
#endif

// pose: the rows of [R|t], laser from geometry, in s0..s11. extent: half_extent_x, half_extent_y, power_scale, and with
// AREA_FILTER the unit of the summed-area table that takes the texels' place.
#if AREA_FILTER
#define TEXEL uint
#else
#define TEXEL float
#endif
__kernel void pattern_lookup(__global const TEXEL *texels, int texels_width, int texels_height, float4 extent,
                             float16 pose, uint width, uint height, GEOMETRY_PARAMETERS,
#if HAS_NORMAL
                             __global const float *normal, ulong normal_offset, uint normal_pitch, uint normal_stride,
#endif
#if HAS_ALBEDO
                             __global const float *albedo, ulong albedo_offset, uint albedo_pitch,
#endif
#if VISIBILITY_FORMAT == FORMAT_UINT8
                             __global const uchar *visibility, ulong visibility_offset, uint visibility_pitch,
#elif VISIBILITY_FORMAT == FORMAT_FLOAT32
                             __global const float *visibility, ulong visibility_offset, uint visibility_pitch,
#endif
                             __global float *irradiance, ulong irradiance_offset, uint irradiance_pitch,
                             __global uint *bad) {
    const uint x = get_global_id(0), y = get_global_id(1);
    if (x >= width || y >= height)
        return;
    const uint index = y * width + x;

    float3 point;
    const bool surface = point_at(x, y, GEOMETRY, &point);

#if HAS_ALBEDO
    const float a = sanitized(albedo[albedo_offset + (ulong)y * albedo_pitch + x], bad, index);
#else
    const float a = 1.0f;
#endif
#if VISIBILITY_FORMAT == FORMAT_UINT8
    const float v = convert_float(visibility[visibility_offset + (ulong)y * visibility_pitch + x]) / 255.0f;
#elif VISIBILITY_FORMAT == FORMAT_FLOAT32
    const float v = sanitized(visibility[visibility_offset + (ulong)y * visibility_pitch + x], bad, index);
#else
    const float v = 1.0f;
#endif

    float value = 0.0f;
    const float3 laser_point = in_laser_frame(pose, point);
    if (surface && laser_point.z > 0.0f) {
        const float d2 = dot(laser_point, laser_point);
        const float inverse_d = 1.0f / sqrt(d2);
        const float axis_cosine = laser_point.z * inverse_d;
        const float2 texel = texel_of(laser_point, inverse_d, extent, texels_width, texels_height);
#if AREA_FILTER
        const float2 along_x =
            nearer_step(x, y, 1, 0, width, height, texel, GEOMETRY, pose, extent, texels_width, texels_height);
        const float2 along_y =
            nearer_step(x, y, 0, 1, width, height, texel, GEOMETRY, pose, extent, texels_width, texels_height);
        float intensity =
            extent.z * footprint_mean(texels, extent.w, texels_width, texels_height, texel, along_x, along_y);
#else
        float intensity = extent.z * bilinear(texels, texels_width, texels_height, texel.x, texel.y);
#endif
#if PLANE_IRRADIANCE
        // A plane at unit distance sees radiant intensity J as J cos^3: 1/d^2 is cos^2, the slant is cos.
        intensity /= axis_cosine * axis_cosine * axis_cosine;
#endif
#if HAS_NORMAL
        __global const float *q = normal + normal_offset + (ulong)y * normal_pitch + x * normal_stride;
        const float3 n = (float3)(q[0], q[1], q[2]);
        const float3 laser_normal = (float3)(dot(pose.s012, n), dot(pose.s456, n), dot(pose.s89a, n));
        // A normal that is not a number counts as turned away.
        const float cosine = fmax(0.0f, -dot(laser_point, laser_normal) * inverse_d);
#else
        const float cosine = 1.0f;
#endif
        value = intensity * cosine * inverse_d * inverse_d * v * a * M_1_PI_F;
    }
    irradiance[irradiance_offset + (ulong)y * irradiance_pitch + x] = value;
}

// The projected pattern, looked up per pixel. The equations are in pattern.h of the C API.
#include "common.h"

// A bilinear lookup in float arithmetic: texture units interpolate with 8 bits and differ between devices. (x, y) in texels, 0 at the first texel's centre.
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

// pose: the rows of [R|t], laser from geometry, in s0..s11. extent: half_extent_x, half_extent_y, power_scale.
__kernel void pattern_lookup(__global const float *texels, int texels_width, int texels_height, float4 extent, float16 pose,
                             uint width, uint height,
#if HAS_POSITION
                             __global const float *position, ulong position_offset, uint position_pitch,
                             uint position_stride,
#else
                             __global const float *depth, ulong depth_offset, uint depth_pitch, float4 intrinsics,
#endif
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

#if HAS_POSITION
    __global const float *p = position + position_offset + (ulong)y * position_pitch + x * position_stride;
    const float3 point = (float3)(p[0], p[1], p[2]);
    const bool surface = isfinite(point.x) && isfinite(point.y) && isfinite(point.z);
#else
    // intrinsics: fx, fy, cx, cy.
    const float3 ray = (float3)((convert_float(x) - intrinsics.z) / intrinsics.x,
                                (convert_float(y) - intrinsics.w) / intrinsics.y, 1.0f);
    const float d_camera = depth[depth_offset + (ulong)y * depth_pitch + x];
    const bool surface = d_camera > 0.0f && d_camera <= FLT_MAX;
#if DEPTH_ALONG_RAY
    const float3 point = ray * (d_camera / sqrt(dot(ray, ray)));
#else
    const float3 point = ray * d_camera;
#endif
#endif

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
    const float3 laser_point = (float3)(dot(pose.s012, point) + pose.s3, dot(pose.s456, point) + pose.s7,
                                        dot(pose.s89a, point) + pose.sb);
    if (surface && laser_point.z > 0.0f) {
        const float d2 = dot(laser_point, laser_point);
        const float inverse_d = 1.0f / sqrt(d2);
        const float axis_cosine = laser_point.z * inverse_d;
#if DIRECTION_COSINES
        const float2 direction = laser_point.xy * inverse_d;
#else
        const float2 direction = laser_point.xy / laser_point.z;
#endif
        // Texel centres lie half a texel inside the edge.
        const float tx = (direction.x / extent.x + 1.0f) * 0.5f * convert_float(texels_width) - 0.5f;
        const float ty = (direction.y / extent.y + 1.0f) * 0.5f * convert_float(texels_height) - 0.5f;
        float intensity = extent.z * bilinear(texels, texels_width, texels_height, tx, ty);
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

// How far each pixel's surface point has moved since the last frame. The equations are in motion.h of the C API.
//   MODE 0: the point's previous position, 1: one rigid transform, 2: one for each material, 3: motion vectors and the
//   previous frame.
//   HAS_HISTORY 1: the previous frame's own depth or position, to find what was hidden.
#include "common/common.h"

typedef struct {
    float x, y, z;
} point_t;

static inline float dot_of(point_t a, point_t b) { return fma(a.x, b.x, fma(a.y, b.y, a.z * b.z)); }
static inline int is_finite_point(point_t p) { return isfinite(p.x) && isfinite(p.y) && isfinite(p.z); }

// exp(-x) for x >= 0 by fma() and bits alone (Cephes' polynomial), the same on every device.
static inline float exp_of_minus(float x) {
    if (!(x < 87.0f))
        return 0.0f;
    const float n = rint(x * 1.44269504f);
    // ln 2 in two parts: the first has few bits, so its product with n is exact.
    const float f = fma(n, -2.12194440e-4f, fma(n, 0.693359375f, -x));
    float p = fma(f, 1.9875691500e-4f, 1.3981999507e-3f);
    p = fma(f, p, 8.3334519073e-3f);
    p = fma(f, p, 4.1665795894e-2f);
    p = fma(f, p, 1.6666665459e-1f);
    p = fma(f, p, 5.0000001201e-1f);
    return fma(f * f, p, f + 1.0f) * as_float((127 - (int)n) << 23);
}

// The angle in [0, pi] whose sine and cosine go like s >= 0 and c (Cephes' polynomial for the arc tangent).
static inline float angle_of(float s, float c) {
    const float a = fabs(c);
    const bool steep = s > a;
    const float low = steep ? a : s, high = steep ? s : a;
    if (!(high > 0.0f))
        return 0.0f;
    float x = low / high, base = 0.0f;
    if (x > 0.414213562f) { // tan(pi/8)
        x = (x - 1.0f) / (x + 1.0f);
        base = 0.785398163f;
    }
    const float z = x * x;
    float p = fma(z, 8.05374449538e-2f, -1.38776856032e-1f);
    p = fma(z, p, 1.99777106478e-1f);
    p = fma(z, p, -3.33329491539e-1f);
    float angle = base + fma(p * z, x, x);
    angle = steep ? 1.57079633f - angle : angle;
    return c < 0.0f ? 3.14159265f - angle : angle;
}

static inline point_t load_point(__global const float *image, ulong offset, uint pitch, uint stride, uint x, uint y) {
    __global const float *p = image + offset + (ulong)y * pitch + x * stride;
    const point_t point = {p[0], p[1], p[2]};
    return point;
}

// intrinsics: fx, fy, cx, cy. The point at a depth in the direction of a pixel; NaN where there is no surface.
static inline point_t point_at(float depth, float x, float y, float4 intrinsics, int depth_along_ray) {
    const float rx = (x - intrinsics.z) / intrinsics.x, ry = (y - intrinsics.w) / intrinsics.y;
    float z = depth > 0.0f && depth <= FLT_MAX ? depth : NAN;
    if (depth_along_ray)
        z /= sqrt(fma(rx, rx, fma(ry, ry, 1.0f)));
    const point_t point = {rx * z, ry * z, z};
    return point;
}

#if HAS_POSITION
#define POINT_PARAMETERS                                                                                               \
    __global const float *position, ulong position_offset, uint position_pitch, uint position_stride
#define POINT_AT(x, y) load_point(position, position_offset, position_pitch, position_stride, x, y)
#else
#define POINT_PARAMETERS __global const float *depth, ulong depth_offset, uint depth_pitch
#define POINT_AT(x, y)                                                                                                 \
    point_at(depth[depth_offset + (ulong)(y)*depth_pitch + (x)], convert_float(x), convert_float(y), intrinsics,       \
             DEPTH_ALONG_RAY)
#endif
#if HISTORY_POSITION
#define HISTORY_PARAMETERS __global const float *history, ulong history_offset, uint history_pitch, uint history_stride
#define HISTORY_AT(x, y) load_point(history, history_offset, history_pitch, history_stride, x, y)
#else
#define HISTORY_PARAMETERS __global const float *history, ulong history_offset, uint history_pitch
#define HISTORY_AT(x, y)                                                                                               \
    point_at(history[history_offset + (ulong)(y)*history_pitch + (x)], convert_float(x), convert_float(y), intrinsics, \
             DEPTH_ALONG_RAY)
#endif

// table: five floats a material: 1 / lateral length, 1 / axial length, 1 / rotation angle, 1 / correlation time, 0.
// bodies: R - I in s0..s8, t in s9..sb, the angle of R in sc; [R|t] takes points from this frame to the previous one.
__kernel void motion_compute(uint width, uint height, float4 intrinsics, float frame_time, float threshold,
                             float tolerance, POINT_PARAMETERS,
#if HAS_MATERIAL
                             __global const uchar *material, ulong material_offset, uint material_pitch,
#endif
                             __global const float *table, uint material_count,
#if MODE == 1
                             float16 body,
#elif MODE == 2
                             __global const float *bodies,
#elif MODE == 3
                             __global const float *motion, ulong motion_offset, uint motion_pitch,
#endif
#if MODE == 0
                             __global const float *previous, ulong previous_offset, uint previous_pitch,
                             uint previous_stride,
#endif
#if HAS_HISTORY
                             HISTORY_PARAMETERS,
#endif
#if HISTORY_MATERIAL
                             __global const uchar *old_material, ulong old_material_offset, uint old_material_pitch,
#endif
#if HAS_NORMALS
                             __global const float *normal, ulong normal_offset, uint normal_pitch, uint normal_stride,
                             __global const float *old_normal, ulong old_normal_offset, uint old_normal_pitch,
                             uint old_normal_stride,
#endif
#if OUT_PATH
                             __global float *path_image, ulong path_offset, uint path_pitch,
#endif
#if OUT_CORRELATION
                             __global float *correlation_image, ulong correlation_offset, uint correlation_pitch,
#endif
#if OUT_SHIFT
                             __global float *shift_image, ulong shift_offset, uint shift_pitch,
#endif
#if OUT_DISPLACEMENT
                             __global float *displacement_image, ulong displacement_offset, uint displacement_pitch,
#endif
#if OUT_MASK
                             __global uchar *mask_image, ulong mask_offset, uint mask_pitch,
#endif
                             __global uint *bad, __global uint *bad_material) {
    const uint x = get_global_id(0), y = get_global_id(1);
    if (x >= width || y >= height)
        return;
    const uint index = y * width + x;
    const point_t now = POINT_AT(x, y);
    const bool surface = is_finite_point(now) && now.z > 0.0f;
    float path = 0.0f, correlation = 1.0f, shift_x = 0.0f, shift_y = 0.0f;
    float lateral = 0.0f, axial = 0.0f, rotation = 0.0f;
    if (surface) {
        bool moved = false; // or hidden before: nothing is known of its past
        bool wrong = false; // something that should be a number is not
        uint id = 0;
#if HAS_MATERIAL
        const uint given = material[material_offset + (ulong)y * material_pitch + x];
        if (given < material_count)
            id = given;
        else
            report_bad(bad_material, -1.0f, index);
#endif
        __global const float *entry = table + 5u * id;
        point_t delta = {0.0f, 0.0f, 0.0f}; // now minus before
#if MODE == 0
        const point_t before = load_point(previous, previous_offset, previous_pitch, previous_stride, x, y);
        wrong = !is_finite_point(before);
        delta.x = now.x - before.x;
        delta.y = now.y - before.y;
        delta.z = now.z - before.z;
#elif MODE == 1 || MODE == 2
#if MODE == 2
        __global const float *b = bodies + 16u * id;
        const float16 body = (float16)(b[0], b[1], b[2], b[3], b[4], b[5], b[6], b[7], b[8], b[9], b[10], b[11], b[12],
                                       0.0f, 0.0f, 0.0f);
#endif
        // X - (R X + t), with R - I so that small motions keep their digits.
        delta.x = -fma(body.s0, now.x, fma(body.s1, now.y, fma(body.s2, now.z, body.s9)));
        delta.y = -fma(body.s3, now.x, fma(body.s4, now.y, fma(body.s5, now.z, body.sa)));
        delta.z = -fma(body.s6, now.x, fma(body.s7, now.y, fma(body.s8, now.z, body.sb)));
        rotation = body.sc;
#endif
#if MODE == 3
        __global const float *m = motion + motion_offset + (ulong)y * motion_pitch + 2u * x;
        shift_x = m[0];
        shift_y = m[1];
        wrong = !(isfinite(shift_x) && isfinite(shift_y));
#elif OUT_SHIFT || HAS_HISTORY
        // Projection before minus projection now: f (X'/Z' - X/Z) with X' = X - delta, written so that no digits
        // cancel.
        const float z_before = now.z - delta.z;
        const float scale = 1.0f / (now.z * z_before);
        if (z_before > 0.0f) {
            shift_x = intrinsics.x * (now.x * delta.z - now.z * delta.x) * scale;
            shift_y = intrinsics.y * (now.y * delta.z - now.z * delta.y) * scale;
        } else if (!wrong) {
            moved = true; // behind the camera
        }
#endif
#if HAS_HISTORY
        const float u = convert_float(x) + shift_x, v = convert_float(y) + shift_y;
        int old_x = 0, old_y = 0; // the nearest pixel of the previous frame
        // The comparisons are false for NaN, and no conversion overflows.
        if (u >= -0.5f && v >= -0.5f && u < convert_float(width) - 0.5f && v < convert_float(height) - 0.5f) {
            old_x = clamp((int)rint(u), 0, (int)width - 1);
            old_y = clamp((int)rint(v), 0, (int)height - 1);
        } else {
            moved = true;
        }
        const point_t nearest = HISTORY_AT((uint)old_x, (uint)old_y);
#if MODE == 3
        const float expected = now.z;
#else
        const float expected = now.z - delta.z;
#endif
        if (!(fabs(nearest.z - expected) <= tolerance * fabs(expected)))
            moved = true; // another surface, or none
#if HISTORY_MATERIAL
        if (old_material[old_material_offset + (ulong)old_y * old_material_pitch + old_x] != given)
            moved = true;
#endif
#if MODE == 3
        // The depth where the point was, between the four pixels around if they show the same surface: 1/Z is linear
        // over a plane's image.
        float depth_before = nearest.z;
        const float low_u = floor(u), low_v = floor(v), part_u = u - low_u, part_v = v - low_v;
        if (!moved && !wrong && (part_u != 0.0f || part_v != 0.0f) && low_u >= 0.0f && low_v >= 0.0f &&
            low_u < convert_float(width - 1) && low_v < convert_float(height - 1)) {
            const uint x0 = convert_uint(low_u), y0 = convert_uint(low_v);
            const float z00 = HISTORY_AT(x0, y0).z, z10 = HISTORY_AT(x0 + 1, y0).z;
            const float z01 = HISTORY_AT(x0, y0 + 1).z, z11 = HISTORY_AT(x0 + 1, y0 + 1).z;
            const float d00 = nearest.z - z00, d10 = nearest.z - z10, d01 = nearest.z - z01, d11 = nearest.z - z11;
            const float room = tolerance * fabs(nearest.z);
            if (fabs(d00) <= room && fabs(d10) <= room && fabs(d01) <= room && fabs(d11) <= room) {
                const float upper = fma(part_u, d10 / z10, (1.0f - part_u) * (d00 / z00));
                const float lower = fma(part_u, d11 / z11, (1.0f - part_u) * (d01 / z01));
                depth_before = nearest.z / (1.0f + fma(part_v, lower, (1.0f - part_v) * upper));
            }
        }
        // x Z - x' Z' of the directions x = (pixel - c) / f, written so that no digits cancel; nothing where pixel and
        // depth stay.
        delta.z = now.z - depth_before;
        delta.x = ((convert_float(x) - intrinsics.z) * delta.z - shift_x * depth_before) / intrinsics.x;
        delta.y = ((convert_float(y) - intrinsics.w) * delta.z - shift_y * depth_before) / intrinsics.y;
#endif
#endif
#if HAS_NORMALS
        if (!moved && !wrong) {
            const point_t n = load_point(normal, normal_offset, normal_pitch, normal_stride, x, y);
#if MODE == 3
            const point_t o = load_point(old_normal, old_normal_offset, old_normal_pitch, old_normal_stride,
                                         (uint)old_x, (uint)old_y);
#else
            const point_t o = load_point(old_normal, old_normal_offset, old_normal_pitch, old_normal_stride, x, y);
#endif
            const point_t cross_product = {n.y * o.z - n.z * o.y, n.z * o.x - n.x * o.z, n.x * o.y - n.y * o.x};
            const float sine = sqrt(dot_of(cross_product, cross_product)), cosine = dot_of(n, o);
            // Of no length, NaN or infinite.
            wrong = !(fabs(cosine) + sine > 0.0f && fabs(cosine) + sine <= FLT_MAX);
            rotation = angle_of(sine, cosine);
        }
#endif
#if MODE == 3 && ROLL
        if (!moved && !wrong) {
            // The motion of a surface that turns by a about the viewing axis has the curl 2 sin a. Differences are
            // taken over neighbors on the same surface.
            float slope[2] = {0.0f, 0.0f}; // d motion_y / dx, d motion_x / dy
            for (uint axis = 0; axis < 2; ++axis) {
                float ends[2] = {axis == 0 ? shift_y : shift_x, axis == 0 ? shift_y : shift_x};
                float distance = 0.0f;
                for (uint side = 0; side < 2; ++side) {
                    const int nx = (int)x + (axis == 0 ? 2 * (int)side - 1 : 0),
                              ny = (int)y + (axis == 1 ? 2 * (int)side - 1 : 0);
                    if (nx < 0 || ny < 0 || nx >= (int)width || ny >= (int)height)
                        continue;
                    const point_t there = POINT_AT((uint)nx, (uint)ny);
                    const float value =
                        motion[motion_offset + (ulong)ny * motion_pitch + 2u * (uint)nx + (axis == 0 ? 1u : 0u)];
                    bool same = fabs(there.z - now.z) <= tolerance * fabs(now.z) && isfinite(value);
#if HAS_MATERIAL
                    same = same && material[material_offset + (ulong)ny * material_pitch + nx] == given;
#endif
                    if (same) {
                        ends[side] = value;
                        distance += 1.0f;
                    }
                }
                if (distance > 0.0f)
                    slope[axis] = (ends[1] - ends[0]) / distance;
            }
            const float sine = fmin(0.5f * fabs(slope[0] - slope[1]), 1.0f);
            const float roll = angle_of(sine, sqrt((1.0f - sine) * (1.0f + sine)));
            rotation = sqrt(fma(rotation, rotation, roll * roll));
        }
#endif
        // Along the direction of view and across it.
        const float distance = sqrt(dot_of(now, now));
        const float along = dot_of(delta, now) / distance, ratio = along / distance;
        const point_t across = {delta.x - ratio * now.x, delta.y - ratio * now.y, delta.z - ratio * now.z};
        axial = along;
        lateral = sqrt(dot_of(across, across));
        const float p0 = lateral * entry[0], p1 = axial * entry[1], p2 = rotation * entry[2];
        path = sqrt(fma(p0, p0, fma(p1, p1, p2 * p2)));
        if (wrong)
            report_bad(bad, NAN, index);
        if (wrong || moved || !(path >= 0.0f)) {
            path = INFINITY;
            shift_x = shift_y = 0.0f;
            lateral = axial = rotation = NAN;
        }
        correlation = isinf(entry[3]) ? 0.0f : exp_of_minus(frame_time * entry[3]);
    }
#if OUT_PATH
    path_image[path_offset + (ulong)y * path_pitch + x] = path;
#endif
#if OUT_CORRELATION
    correlation_image[correlation_offset + (ulong)y * correlation_pitch + x] = correlation;
#endif
#if OUT_SHIFT
    __global float *s = shift_image + shift_offset + (ulong)y * shift_pitch + 2u * x;
    s[0] = shift_x;
    s[1] = shift_y;
#endif
#if OUT_DISPLACEMENT
    __global float *d = displacement_image + displacement_offset + (ulong)y * displacement_pitch + 3u * x;
    d[0] = lateral;
    d[1] = axial;
    d[2] = rotation;
#endif
#if OUT_MASK
    mask_image[mask_offset + (ulong)y * mask_pitch + x] = path > threshold || 1.0f - correlation > threshold ? 1 : 0;
#endif
}

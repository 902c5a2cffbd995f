// pattern_lookup with explicit vectors for CPU devices, without the area filter: the same bits as pattern.cl, by the
// same operations in the same order. A work-item has a row of pixels, LANES columns at once. Lanes that show nothing
// compute along, and are 0 at the end.
//   DIRECTION_COSINES, PLANE_IRRADIANCE, HAS_POSITION, DEPTH_ALONG_RAY, HAS_NORMAL, HAS_ALBEDO, VISIBILITY_FORMAT as in
//   pattern.cl
#include "common/lanes.h"

typedef struct {
    lanes_f x, y, z;
} lanes_3;

static inline lanes_f dots_of(lanes_f ax, lanes_f ay, lanes_f az, const lanes_3 *b) {
    return ax * b->x + ay * b->y + az * b->z;
}

// pose times a vector, without its translation.
static inline void turned(float16 pose, const lanes_3 *v, lanes_3 *result) {
    result->x = dots_of(SPREAD(pose.s0), SPREAD(pose.s1), SPREAD(pose.s2), v);
    result->y = dots_of(SPREAD(pose.s4), SPREAD(pose.s5), SPREAD(pose.s6), v);
    result->z = dots_of(SPREAD(pose.s8), SPREAD(pose.s9), SPREAD(pose.sa), v);
}

#if HAS_POSITION || HAS_NORMAL
// Vectors that lie in memory as x, y, z, x, y, z ..
static inline void load_threes(__global const float *from, lanes_3 *v) {
    const lanes_f a = load_lanes_f(from), b = load_lanes_f(from + LANES), c = load_lanes_f(from + 2 * LANES);
#if LANES == 16
    v->x = (lanes_f)(a.s0369, a.scf, b.s258b, b.se, c.s147a, c.sd);
    v->y = (lanes_f)(a.s147a, a.sd, b.s0369, b.scf, c.s258b, c.se);
    v->z = (lanes_f)(a.s258b, a.se, b.s147a, b.sd, c.s0369, c.scf);
#elif LANES == 8
    v->x = (lanes_f)(a.s036, b.s147, c.s25);
    v->y = (lanes_f)(a.s147, b.s25, c.s036);
    v->z = (lanes_f)(a.s25, b.s036, c.s147);
#else
    v->x = (lanes_f)(a.s03, b.s2, c.s1);
    v->y = (lanes_f)(a.s1, b.s03, c.s2);
    v->z = (lanes_f)(a.s2, b.s1, c.s03);
#endif
}

// count of LANES vectors of 3 or 4 numbers (stride), of which the fourth says nothing.
static inline void load_vectors(__global const float *from, uint stride, uint count, lanes_3 *v) {
    if (count == LANES && stride == 3) {
        load_threes(from, v);
        return;
    }
    if (count == LANES) {
        lanes_complex low, high; // x, z, x, z .. and y, w, y, w ..
        load_interleaved(from, &low);
        load_interleaved(from + 2 * LANES, &high);
        v->x = (lanes_f)(low.re.even, high.re.even);
        v->y = (lanes_f)(low.im.even, high.im.even);
        v->z = (lanes_f)(low.re.odd, high.re.odd);
        return;
    }
    float x[LANES], y[LANES], z[LANES];
    for (uint lane = 0; lane < LANES; ++lane) {
        x[lane] = lane < count ? from[lane * stride] : 0.0f;
        y[lane] = lane < count ? from[lane * stride + 1] : 0.0f;
        z[lane] = lane < count ? from[lane * stride + 2] : 0.0f;
    }
    v->x = vload_lanes(0, x);
    v->y = vload_lanes(0, y);
    v->z = vload_lanes(0, z);
}
#endif

static inline lanes_i are_finite(lanes_f a) { return fabs(a) <= FLT_MAX; }

#if HAS_ALBEDO || VISIBILITY_FORMAT == FORMAT_FLOAT32
// sanitized().
static inline lanes_f sanitized_lanes(lanes_f values, __global uint *bad, uint index) {
    if (!holds_anywhere(~((values >= 0.0f) & (values <= FLT_MAX))))
        return values;
    float each[LANES];
    vstore_lanes(values, 0, each);
    for (uint lane = 0; lane < LANES; ++lane)
        each[lane] = sanitized(each[lane], bad, index + lane);
    return vload_lanes(0, each);
}
#endif

#if VISIBILITY_FORMAT == FORMAT_UINT8
// count of LANES bytes.
static inline lanes_f load_some_bytes(__global const uchar *from, uint count) {
    uchar bytes[LANES];
    for (uint lane = 0; lane < LANES; ++lane)
        bytes[lane] = lane < count ? from[lane] : 0;
    return convert_lanes_f(vload_lanes(0, bytes));
}
#endif

// bilinear(), 0 in lanes that are not lit or lie outside of the pattern.
static inline lanes_f bilinears(__global const float *texels, int width, int height, lanes_f x, lanes_f y,
                                lanes_i lit) {
    const lanes_i inside = lit & (x >= -0.5f) & (y >= -0.5f) & (x <= (float)width - 0.5f) & (y <= (float)height - 0.5f);
    if (!holds_anywhere(inside))
        return SPREAD(0.0f);
    // Of lanes outside the first texels are read, and dropped.
    const lanes_f last_x = SPREAD((float)(width - 1)), last_y = SPREAD((float)(height - 1));
    const lanes_f right = select(SPREAD(0.0f), x, inside & (x > 0.0f)),
                  down = select(SPREAD(0.0f), y, inside & (y > 0.0f));
    const lanes_f cx = select(right, last_x, right > last_x), cy = select(down, last_y, down > last_y);
    const lanes_i x0 = min(convert_lanes_i(cx), (lanes_i)(width - 2)),
                  y0 = min(convert_lanes_i(cy), (lanes_i)(height - 2));
    const lanes_f ax = cx - convert_lanes_f(x0), ay = cy - convert_lanes_f(y0);
    // A pattern has 2^28 texels at most.
    int first[LANES];
    vstore_lanes(y0 * width + x0, 0, first);
    float above[2 * LANES], below[2 * LANES];
#pragma unroll
    for (int lane = 0; lane < LANES; ++lane) {
        __global const float *row = texels + first[lane];
        vstore2(vload2(0, row), lane, above);
        vstore2(vload2(0, row + width), lane, below);
    }
    const lanes_f a = vload_lanes(0, above), b = vload_lanes(1, above), c = vload_lanes(0, below),
                  d = vload_lanes(1, below);
    const lanes_f a0 = (lanes_f)(a.even, b.even), a1 = (lanes_f)(a.odd, b.odd);
    const lanes_f b0 = (lanes_f)(c.even, d.even), b1 = (lanes_f)(c.odd, d.odd);
    const lanes_f top = a0 + (a1 - a0) * ax, bottom = b0 + (b1 - b0) * ax;
    return select(SPREAD(0.0f), top + (bottom - top) * ay, inside);
}

// Vectors whose points are all found before the first is looked up: where a texel lies is one long chain of roots and
// quotients, and what is read there another; side by side they fill the time in which each waits for itself.
#define STRIPS 8

// What the lookup needs to know of LANES pixels.
typedef struct {
    lanes_i lit; // whether there is a surface before the laser
    lanes_f texel_x, texel_y, inverse_d;
#if PLANE_IRRADIANCE
    lanes_f axis_cosine;
#endif
#if HAS_NORMAL
    lanes_f cosine;
#endif
} strip_t;

#if HAS_POSITION
#define GEOMETRY_PARAMETERS                                                                                            \
    __global const float *position, ulong position_offset, uint position_pitch, uint position_stride
#else
#define GEOMETRY_PARAMETERS __global const float *depth, ulong depth_offset, uint depth_pitch, float4 intrinsics
#endif

__kernel void pattern_lookup_lanes(__global const float *texels, int texels_width, int texels_height, float4 extent,
                                   float16 pose, uint width, uint height, GEOMETRY_PARAMETERS,
#if HAS_NORMAL
                                   __global const float *normal, ulong normal_offset, uint normal_pitch,
                                   uint normal_stride,
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
    const uint y = get_global_id(0);
    if (y >= height)
        return;
#if !HAS_POSITION
    const float ray_y = (convert_float(y) - intrinsics.w) / intrinsics.y;
#endif
    for (uint block = 0; block < width; block += STRIPS * LANES) {
        const uint end = min(block + STRIPS * LANES, width);
        strip_t strips[STRIPS];
        for (uint x = block, k = 0; x < end; x += LANES, ++k) {
            const uint count = min((uint)LANES, width - x);
            lanes_3 point, at; // `at`: in the laser's frame
#if HAS_POSITION
            load_vectors(position + position_offset + (ulong)y * position_pitch + x * position_stride, position_stride,
                         count, &point);
            const lanes_i surface = are_finite(point.x) & are_finite(point.y) & are_finite(point.z);
#else
            const lanes_f depths = load_some(depth + depth_offset + (ulong)y * depth_pitch + x, count);
            const lanes_f ray_x = (convert_lanes_f(x + lane_numbers()) - intrinsics.z) / intrinsics.x;
#if DEPTH_ALONG_RAY
            const lanes_f along_axis = depths / sqrt(ray_x * ray_x + ray_y * ray_y + 1.0f);
#else
            const lanes_f along_axis = depths;
#endif
            point.x = ray_x * along_axis;
            point.y = ray_y * along_axis;
            point.z = along_axis;
            const lanes_i surface = (depths > 0.0f) & (depths <= FLT_MAX);
#endif
            turned(pose, &point, &at);
            at.x += pose.s3;
            at.y += pose.s7;
            at.z += pose.sb;
            strip_t *strip = &strips[k];
            strip->lit = surface & (at.z > 0.0f);
            strip->inverse_d = 1.0f / sqrt(dots_of(at.x, at.y, at.z, &at));
#if DIRECTION_COSINES
            const lanes_f direction_x = at.x * strip->inverse_d, direction_y = at.y * strip->inverse_d;
#else
            const lanes_f direction_x = at.x / at.z, direction_y = at.y / at.z;
#endif
            strip->texel_x = (direction_x / extent.x + 1.0f) * 0.5f * convert_float(texels_width) - 0.5f;
            strip->texel_y = (direction_y / extent.y + 1.0f) * 0.5f * convert_float(texels_height) - 0.5f;
#if PLANE_IRRADIANCE
            strip->axis_cosine = at.z * strip->inverse_d;
#endif
#if HAS_NORMAL
            lanes_3 n, laser_normal;
            load_vectors(normal + normal_offset + (ulong)y * normal_pitch + x * normal_stride, normal_stride, count,
                         &n);
            turned(pose, &n, &laser_normal);
            const lanes_f cosine = -dots_of(at.x, at.y, at.z, &laser_normal) * strip->inverse_d;
            strip->cosine =
                select(SPREAD(0.0f), cosine, cosine > 0.0f); // a normal that is not a number counts as turned away
#endif
        }
        for (uint x = block, k = 0; x < end; x += LANES, ++k) {
            const uint count = min((uint)LANES, width - x);
            const strip_t *strip = &strips[k];
            lanes_f value =
                extent.z * bilinears(texels, texels_width, texels_height, strip->texel_x, strip->texel_y, strip->lit);
#if PLANE_IRRADIANCE
            value /= strip->axis_cosine * strip->axis_cosine * strip->axis_cosine;
#endif
#if HAS_NORMAL
            value *= strip->cosine;
#endif
            value = value * strip->inverse_d * strip->inverse_d;
            // Albedo and visibility are checked where there is no surface, too.
#if HAS_ALBEDO
            const lanes_f a = sanitized_lanes(load_some(albedo + albedo_offset + (ulong)y * albedo_pitch + x, count),
                                              bad, y * width + x);
#endif
#if VISIBILITY_FORMAT == FORMAT_UINT8
            value *= load_some_bytes(visibility + visibility_offset + (ulong)y * visibility_pitch + x, count) / 255.0f;
#elif VISIBILITY_FORMAT == FORMAT_FLOAT32
            value *= sanitized_lanes(load_some(visibility + visibility_offset + (ulong)y * visibility_pitch + x, count),
                                     bad, y * width + x);
#endif
#if HAS_ALBEDO
            value *= a;
#endif
            store_some(select(SPREAD(0.0f), value * M_1_PI_F, strip->lit),
                       irradiance + irradiance_offset + (ulong)y * irradiance_pitch + x, count);
        }
    }
}

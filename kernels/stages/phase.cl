// The surface's random field: refresh, advance along the path, export. The state's layout is in phase_state.h, the
// equations are in phase.h of the C API. PHASE_TRANSLATE 1: the state moves with the surface and holds the rest of the
// shift.
#include "common/field_grid.h"
#include "stages/phase_state.h"
#if ADVANCE
#include "stages/phase_advance.h"
#endif

// |z|^2 is exponential with mean 1 (Goodman): |z| = sqrt(-ln u).
static inline complex_float gaussian_from_words(words4 phase, words4 magnitude, uint j) {
    const float r = sqrt(minus_log(uniform_from_word(word_of(magnitude, j))));
    const complex_float p = phasor_from_word(word_of(phase, j));
    const complex_float z = {r * p.re, r * p.im};
    return z;
}

// One work-item a Philox block: four samples, one in each quarter of the grid's rows; the third dimension is the
// polarization.
__kernel void phase_refresh(__global state_word *state, uint grid_width, uint grid_height, uint quarter, uint2 key,
                            uint frame_low, uint frame_high, ulong rest_offset
#if HAS_MASK
                            ,
                            __global const uchar *mask, ulong mask_offset, uint mask_pitch, uint width, uint height,
                            uint oversampling
#endif
) {
    const uint x = get_global_id(0), row = get_global_id(1), polarization = get_global_id(2);
    if (x >= grid_width || row >= quarter)
        return;
#if HAS_MASK
    const uint pixel_x = pixel_of_sample(x, oversampling, width, grid_width);
    uint selected = 0;
    for (uint j = 0; j < 4; ++j) {
        const uint y = row + j * quarter;
        if (y < grid_height) {
            const uint pixel_y = pixel_of_sample(y, oversampling, height, grid_height);
            selected |= (mask[mask_offset + (ulong)pixel_y * mask_pitch + pixel_x] != 0 ? 1u : 0u) << j;
        }
    }
    if (selected == 0)
        return;
#else
    const uint selected = 15u;
#endif
    const ulong samples = (ulong)grid_width * grid_height, first = polarization * samples;
    const words4 phase = image_block(x, row, frame_low, frame_high, STREAM_PHASE + polarization, key);
#if !FIELD_UNIT_PHASOR
    const words4 magnitude = image_block(x, row, frame_low, frame_high, STREAM_MAGNITUDE + polarization, key);
#endif
#if PHASE_CONTINUOUS
    const words4 next_phase = image_block(x, row, frame_low, frame_high, STREAM_NEXT_PHASE + polarization, key);
    const words4 next_magnitude = image_block(x, row, frame_low, frame_high, STREAM_NEXT_MAGNITUDE + polarization, key);
    const words4 start = image_block(x, row, frame_low, frame_high, STREAM_PATH_START, key);
#endif
    for (uint j = 0; j < 4; ++j) {
        const uint y = row + j * quarter;
        if (y >= grid_height || !(selected >> j & 1u))
            continue;
        const ulong i = (ulong)y * grid_width + x;
#if FIELD_UNIT_PHASOR
        state[first + i] = word_of(phase, j);
#else
        store_complex(state + knot_offset(samples, first, 0), i, gaussian_from_words(phase, magnitude, j));
#endif
#if PHASE_CONTINUOUS
        store_complex(state + knot_offset(samples, first, 1), i, gaussian_from_words(next_phase, next_magnitude, j));
        if (polarization == 0)
            store_path(state, i, word_of(start, j));
#endif
#if PHASE_TRANSLATE && !HAS_MASK
        // (The rest of a shift belongs to the motion, not to the grain: a masked sample keeps it.)
        if (polarization == 0) {
            __global float *rest = (__global float *)(state + rest_offset);
            rest[2 * i] = 0.0f;
            rest[2 * i + 1] = 0.0f;
        }
#endif
    }
}

#if HAS_SHIFT
// Where the state of a sample comes from.
typedef struct {
    int x, y;
    float rest_x, rest_y; // what is left of the shift, in samples
    int known;            // 0: nowhere in the image
} origin_t;

// The point that lies at sample (x, y) lay at (x, y) + shift. What was left there of earlier shifts comes on top; the
// sum is carried out in whole samples. inside_width, inside_height: the samples of the image without the padding; what
// comes from outside of them brings the rest of the nearest one, so that a surface that moves as one has one rest.
// Padding that moves is new.
static inline origin_t origin_of(int x, int y, float shift_x, float shift_y, __global const float *rest,
                                 uint grid_width, int inside_width, int inside_height) {
    origin_t origin = {x, y, 0.0f, 0.0f, 0};
    // The comparisons are false for NaN, and no conversion overflows.
    if (!(fabs(shift_x) <= 32767.0f && fabs(shift_y) <= 32767.0f))
        return origin;
    const int near_x = clamp(x + (int)rint(shift_x), 0, inside_width - 1);
    const int near_y = clamp(y + (int)rint(shift_y), 0, inside_height - 1);
    const ulong near = (ulong)near_y * grid_width + near_x;
    const float sum_x = shift_x + rest[2 * near], sum_y = shift_y + rest[2 * near + 1];
    const float whole_x = rint(sum_x), whole_y = rint(sum_y);
    origin.rest_x = sum_x - whole_x;
    origin.rest_y = sum_y - whole_y;
    origin.known = 1;
    if (whole_x != 0.0f || whole_y != 0.0f) {
        origin.x = x + (int)whole_x;
        origin.y = y + (int)whole_y;
        origin.known = x < inside_width && y < inside_height && origin.x >= 0 && origin.y >= 0 &&
                       origin.x < inside_width && origin.y < inside_height;
    }
    return origin;
}
#endif

#if ADVANCE && HAS_SHIFT
// Which sample gets the state of a place: the first one, in the order of rows, of those that come from there and are
// not new anyway.
__kernel void phase_claim(__global uint *owner, uint grid_width, uint grid_height, uint width, uint height,
                          uint oversampling, float knots_per_path, __global const state_word *source, ulong rest_offset,
                          PATH_PARAMETER CORRELATION_PARAMETER MASK_PARAMETER __global const float *shift,
                          ulong shift_offset, uint shift_pitch) {
    const uint x = get_global_id(0), y = get_global_id(1);
    if (x >= grid_width || y >= grid_height)
        return;
    const uint pixel_x = pixel_of_sample(x, oversampling, width, grid_width);
    const uint pixel_y = pixel_of_sample(y, oversampling, height, grid_height);
    bool claims = true;
#if HAS_PATH
    const float knots = knots_per_path * path[path_offset + (ulong)pixel_y * path_pitch + pixel_x];
    claims = knots >= 0.0f && knots < 2.0f;
#endif
#if HAS_CORRELATION
    const float r = correlation[correlation_offset + (ulong)pixel_y * correlation_pitch + pixel_x];
    claims = claims && r >= 0.0f && r <= 1.0f;
#endif
#if HAS_MASK
    claims = claims && mask[mask_offset + (ulong)pixel_y * mask_pitch + pixel_x] == 0;
#endif
    const ulong at = shift_offset + (ulong)pixel_y * shift_pitch + 2u * pixel_x;
    const float scale = convert_float(oversampling);
    __global const float *rest = (__global const float *)(source + rest_offset);
    const origin_t origin = origin_of((int)x, (int)y, scale * shift[at], scale * shift[at + 1], rest, grid_width,
                                      (int)(oversampling * width), (int)(oversampling * height));
    if (claims && origin.known)
        atomic_min(&owner[(ulong)origin.y * grid_width + origin.x], y * grid_width + x);
}
#endif

#if ADVANCE
// Carries the field on by a path, a time and a shift (phase_advance_lanes.cl: without a shift, on CPU devices). One
// work-item a Philox block, all polarizations. Samples with nothing to do are not touched, except that with a shift
// every sample is copied from `source`.
__kernel void phase_advance(PHASE_ADVANCE_PARAMETERS
#if HAS_SHIFT
                            __global const state_word *source, __global const uint *owner, __global const float *shift,
                            ulong shift_offset, uint shift_pitch,
#endif
                            MASK_PARAMETER __global uint *bad) {
    const uint x = get_global_id(0), row = get_global_id(1);
    if (x >= grid_width || row >= quarter)
        return;
    const ulong samples = (ulong)grid_width * grid_height;
    const uint pixel_x = pixel_of_sample(x, oversampling, width, grid_width);
#if !HAS_SHIFT && (HAS_PATH || HAS_CORRELATION || HAS_MASK)
    // Most of a scene rests: four samples with nothing to do are left before anything else is looked at.
    uint busy = 0;
    for (uint j = 0; j < 4; ++j) {
        const uint y = min(row + j * quarter, grid_height - 1u);
        const uint pixel_y = pixel_of_sample(y, oversampling, height, grid_height);
#if HAS_PATH
        busy |= path[path_offset + (ulong)pixel_y * path_pitch + pixel_x] != 0.0f;
#else
        busy |= uniform_path != 0.0f;
#endif
#if HAS_CORRELATION
        busy |= correlation[correlation_offset + (ulong)pixel_y * correlation_pitch + pixel_x] != 1.0f;
#else
        busy |= uniform_correlation != 1.0f;
#endif
#if HAS_MASK
        busy |= mask[mask_offset + (ulong)pixel_y * mask_pitch + pixel_x] != 0;
#endif
    }
    if (!busy)
        return;
#endif
    // What happens to each of the four samples.
    uint step[4], moved[4], t[4];
    float keep[4];
    ulong from[4];
#if HAS_SHIFT
    __global const float *rest = (__global const float *)(source + rest_offset);
    float rest_x[4], rest_y[4];
    const int inside_width = (int)(oversampling * width), inside_height = (int)(oversampling * height);
    const float scale = convert_float(oversampling);
#endif
    uint any_replaced = 0, any_crossed = 0, any_boiled = 0, any_moved = 0;
    for (uint j = 0; j < 4; ++j) {
        const uint y = row + j * quarter;
        step[j] = KEEP;
        moved[j] = 0;
        t[j] = 0;
        keep[j] = 1.0f;
        from[j] = 0;
        if (y >= grid_height)
            continue;
        const ulong i = (ulong)y * grid_width + x;
        const uint pixel_y = pixel_of_sample(y, oversampling, height, grid_height);
        // Several samples and the padding share a pixel: what is wrong with it is counted once.
        const bool counts = x == oversampling * pixel_x && y == oversampling * pixel_y;
        const uint pixel = pixel_y * width + pixel_x;
        from[j] = i;
        bool replaced = false;
#if HAS_MASK
        replaced = mask[mask_offset + (ulong)pixel_y * mask_pitch + pixel_x] != 0;
#endif
#if HAS_CORRELATION
        float r = correlation[correlation_offset + (ulong)pixel_y * correlation_pitch + pixel_x];
        if (!(r >= 0.0f && r <= 1.0f)) {
            if (counts)
                report_bad(bad, r, pixel);
            r = 1.0f;
            replaced = true;
        }
#else
        const float r = uniform_correlation;
#endif
#if PHASE_CONTINUOUS
#if HAS_PATH
        float p = path[path_offset + (ulong)pixel_y * path_pitch + pixel_x];
        if (!(p >= 0.0f)) {
            if (counts)
                report_bad(bad, p, pixel);
            p = 0.0f;
            replaced = true;
        }
#else
        const float p = uniform_path;
#endif
        // A later part of an exposure (negative): what is new was drawn by the first part.
        const float knots = knots_per_path >= 0.0f ? knots_per_path * p : p <= FLT_MAX ? -knots_per_path * p : 0.0f;
        // Two knots on, nothing is left of either: also the way to say that a sample is new (infinity).
        replaced |= knots >= 2.0f;
#endif
#if HAS_SHIFT
        const ulong at = shift_offset + (ulong)pixel_y * shift_pitch + 2u * pixel_x;
        const float shift_x = scale * shift[at], shift_y = scale * shift[at + 1];
        const origin_t origin =
            origin_of((int)x, (int)y, shift_x, shift_y, rest, grid_width, inside_width, inside_height);
        if (counts && !(isfinite(shift_x) && isfinite(shift_y)))
            report_bad(bad, isfinite(shift_x) ? shift_y : shift_x, pixel);
        replaced |= !origin.known;
        rest_x[j] = origin.rest_x;
        rest_y[j] = origin.rest_y;
        // A surface that grows or turns has samples with the same origin. They would repeat a grain: only the first one
        // keeps it.
        if (!replaced)
            replaced = owner[(ulong)origin.y * grid_width + origin.x] != (uint)i;
        if (!replaced)
            from[j] = (ulong)origin.y * grid_width + origin.x;
        moved[j] = from[j] != i || origin.rest_x != rest[2 * i] || origin.rest_y != rest[2 * i + 1];
#endif
#if PHASE_CONTINUOUS
        if (replaced) {
            step[j] = REPLACE;
#if HAS_SHIFT
        } else {
            t[j] = load_path(source, from[j]);
#else
        } else if (knots > 0.0f) {
            t[j] = load_path(state, i);
#endif
            const ulong end = (ulong)t[j] + convert_ulong_rte(knots * 0x1p32f);
            step[j] = (uint)(end >> 32); // how many knots are passed: 0, 1 or 2
            moved[j] |= (uint)end != t[j];
            t[j] = (uint)end;
        }
#else
        step[j] = replaced ? REPLACE : KEEP;
#endif
        any_replaced |= step[j] >= CROSS_TWO;
        any_crossed |= step[j] != KEEP;
        if (step[j] != REPLACE && r < 1.0f) {
            keep[j] = r;
            any_boiled = 1;
        }
        any_moved |= moved[j];
    }
    if (!HAS_SHIFT && !(any_crossed | any_boiled | any_moved))
        return;
    const uint stream = substep << 8;
    words4 phase = {0, 0, 0, 0};
#if !FIELD_UNIT_PHASOR
    words4 magnitude = {0, 0, 0, 0};
#endif
#if BOILS
    words4 boil_phase = {0, 0, 0, 0}, boil_magnitude = {0, 0, 0, 0};
#endif
#if PHASE_CONTINUOUS
    words4 start = {0, 0, 0, 0}, next_phase = {0, 0, 0, 0}, next_magnitude = {0, 0, 0, 0};
#if BOILS
    words4 next_boil_phase = {0, 0, 0, 0}, next_boil_magnitude = {0, 0, 0, 0};
#endif
    if (any_replaced)
        start = image_block(x, row, frame_low, frame_high, stream | STREAM_PATH_START, key);
#endif
    for (uint polarization = 0; polarization < polarization_count; ++polarization) {
        const ulong first = polarization * samples;
        if (any_replaced) {
            phase = image_block(x, row, frame_low, frame_high, stream | (STREAM_PHASE + polarization), key);
#if !FIELD_UNIT_PHASOR
            magnitude = image_block(x, row, frame_low, frame_high, stream | (STREAM_MAGNITUDE + polarization), key);
#endif
        }
#if BOILS
        if (any_boiled) {
            boil_phase = image_block(x, row, frame_low, frame_high, stream | (STREAM_BOIL_PHASE + polarization), key);
            boil_magnitude =
                image_block(x, row, frame_low, frame_high, stream | (STREAM_BOIL_MAGNITUDE + polarization), key);
#if PHASE_CONTINUOUS
            next_boil_phase =
                image_block(x, row, frame_low, frame_high, stream | (STREAM_BOIL_PHASE + 2u + polarization), key);
            next_boil_magnitude =
                image_block(x, row, frame_low, frame_high, stream | (STREAM_BOIL_MAGNITUDE + 2u + polarization), key);
#endif
        }
#endif
#if PHASE_CONTINUOUS
        if (any_crossed) {
            next_phase = image_block(x, row, frame_low, frame_high, stream | (STREAM_NEXT_PHASE + polarization), key);
            next_magnitude =
                image_block(x, row, frame_low, frame_high, stream | (STREAM_NEXT_MAGNITUDE + polarization), key);
        }
#endif
        for (uint j = 0; j < 4; ++j) {
            const uint y = row + j * quarter;
            if (y >= grid_height)
                continue;
            const ulong i = (ulong)y * grid_width + x;
#if HAS_SHIFT
            __global const state_word *before = source;
#else
            __global const state_word *before = state;
            if (step[j] == KEEP && keep[j] == 1.0f)
                continue;
#endif
#if FIELD_UNIT_PHASOR
            state[first + i] = step[j] == REPLACE ? word_of(phase, j) : before[first + from[j]];
#else
            complex_float a, b;
            // A: fresh, the old B, or the old A.
            if (step[j] >= CROSS_TWO)
                a = gaussian_from_words(phase, magnitude, j);
            else
                a = load_complex(before + knot_offset(samples, first, step[j] == CROSS_ONE ? 1 : 0), from[j]);
#if PHASE_CONTINUOUS
            if (step[j] != KEEP)
                b = gaussian_from_words(next_phase, next_magnitude, j);
            else
                b = load_complex(before + knot_offset(samples, first, 1), from[j]);
#endif
#if BOILS
            if (keep[j] < 1.0f) {
                // z' = r z + sqrt(1 - r^2) w keeps E|z|^2 = 1.
                const float r = keep[j], q = sqrt((1.0f - r) * (1.0f + r));
                const complex_float w = gaussian_from_words(boil_phase, boil_magnitude, j);
                a.re = fma(q, w.re, r * a.re);
                a.im = fma(q, w.im, r * a.im);
#if PHASE_CONTINUOUS
                const complex_float v = gaussian_from_words(next_boil_phase, next_boil_magnitude, j);
                b.re = fma(q, v.re, r * b.re);
                b.im = fma(q, v.im, r * b.im);
#endif
            }
#endif
            store_complex(state + knot_offset(samples, first, 0), i, a);
#if PHASE_CONTINUOUS
            store_complex(state + knot_offset(samples, first, 1), i, b);
#endif
#endif
        }
    }
    for (uint j = 0; j < 4; ++j) {
        const uint y = row + j * quarter;
        if (y >= grid_height)
            continue;
        const ulong i = (ulong)y * grid_width + x;
#if PHASE_CONTINUOUS
#if !HAS_SHIFT
        if (moved[j] || step[j] != KEEP)
#endif
            store_path(state, i, step[j] == REPLACE ? word_of(start, j) : t[j]);
#endif
#if HAS_SHIFT
        __global float *new_rest = (__global float *)(state + rest_offset);
        new_rest[2 * i] = rest_x[j];
        new_rest[2 * i + 1] = rest_y[j];
#endif
    }
}
#endif

// z of one polarization, for inspection. first: polarization * samples.
__kernel void phase_field(PHASE_STATE_PARAMETERS, uint grid_width, uint grid_height, __global float *field,
                          ulong field_offset, uint field_pitch) {
    const uint x = get_global_id(0), y = get_global_id(1);
    if (x >= grid_width || y >= grid_height)
        return;
    const complex_float z = PHASE_STATE_FIELD((ulong)y * grid_width + x);
    __global float *out = field + field_offset + (ulong)y * field_pitch + 2u * x;
    out[0] = z.re;
    out[1] = z.im;
}

// phase_advance of a Gaussian field without a shift, with explicit vectors for CPU devices: the same bits as phase.cl.
// A work-item has row y mod Q of the grid, and with it the rows Q, 2 Q and 3 Q below (Q: a quarter of the rows), LANES
// columns at once.
//   PHASE_CONTINUOUS, HAS_PATH, HAS_CORRELATION, HAS_MASK, BOILS as in phase.cl
#include "common/field_grid.h"
#include "stages/phase_state.h"
#include "stages/phase_advance.h"
#include "common/lanes.h"

// Samples side by side: x, x + 1 .. of a row of pixels.
typedef struct {
    uint x, count;                         // of the first sample, and how many there are
    uint width, grid_width, oversampling;  // of the grid
} strip_t;

static inline uint pixel_of_lane(const strip_t *strip, uint lane) {
    return pixel_of_sample(strip->x + lane, strip->oversampling, strip->width, strip->grid_width);
}

// What the pixels of a row say; `otherwise` in lanes that have no sample.
static inline lanes_f load_pixels(const strip_t *strip, __global const float *row, float otherwise) {
    if (strip->oversampling == 1 && strip->x + LANES <= strip->width)
        return load_lanes_f(row + strip->x);
    float values[LANES];
    for (uint lane = 0; lane < LANES; ++lane)
        values[lane] = lane < strip->count ? row[pixel_of_lane(strip, lane)] : otherwise;
    return vload_lanes(0, values);
}

#if HAS_MASK
static inline lanes_i load_mask(const strip_t *strip, __global const uchar *row) {
    int values[LANES];
    for (uint lane = 0; lane < LANES; ++lane)
        values[lane] = lane < strip->count && row[pixel_of_lane(strip, lane)] != 0 ? -1 : 0;
    return vload_lanes(0, values);
}
#endif

#if HAS_PATH || HAS_CORRELATION
// Several samples and the padding share a pixel: what is wrong with it is counted once.
static inline void report_lanes(const strip_t *strip, __global uint *bad, lanes_f values, lanes_i are_bad, uint y,
                                uint pixel_y) {
    if (!holds_anywhere(are_bad) || y != strip->oversampling * pixel_y)
        return;
    float each[LANES];
    int is_bad[LANES];
    vstore_lanes(values, 0, each);
    vstore_lanes(are_bad, 0, is_bad);
    for (uint lane = 0; lane < strip->count; ++lane) {
        const uint pixel_x = pixel_of_lane(strip, lane);
        if (is_bad[lane] && strip->x + lane == strip->oversampling * pixel_x)
            report_bad(bad, each[lane], pixel_y * strip->width + pixel_x);
    }
}
#endif

// b where chosen, else a.
static inline void choose(lanes_complex *a, const lanes_complex *b, lanes_i chosen) {
    a->re = select(a->re, b->re, chosen);
    a->im = select(a->im, b->im, chosen);
}

// z' = r z + sqrt(1 - r^2) w keeps E|z|^2 = 1; where r is 1, z stays.
static inline void boil(lanes_complex *z, const lanes_complex *w, lanes_f r) {
    const lanes_f q = sqrt((1.0f - r) * (1.0f + r));
    const lanes_complex boiled = {fma(q, w->re, r * z->re), fma(q, w->im, r * z->im)};
    choose(z, &boiled, r < 1.0f);
}

__kernel void phase_advance_lanes(PHASE_ADVANCE_PARAMETERS MASK_PARAMETER __global uint *bad) {
    const uint row = get_global_id(0), stream = substep << 8;
    if (row >= quarter)
        return;
    const ulong samples = (ulong)grid_width * grid_height;
    for (uint x = 0; x < grid_width; x += LANES) {
        const strip_t strip = {x, min((uint)LANES, grid_width - x), width, grid_width, oversampling};
        // What happens to the samples of the four rows.
        lanes_u step[4], t[4];
        lanes_f keep[4];
        lanes_i moved[4];
        lanes_i replaced_any = 0, crossed_any = 0, boiled_any = 0, moved_any = 0;
        for (uint j = 0; j < 4; ++j) {
            const uint y = row + j * quarter;
            step[j] = KEEP;
            t[j] = 0;
            keep[j] = 1.0f;
            moved[j] = 0;
            if (y >= grid_height)
                continue;
            const uint pixel_y = pixel_of_sample(y, oversampling, height, grid_height);
            lanes_i replaced = 0;
#if HAS_MASK
            replaced = load_mask(&strip, mask + mask_offset + (ulong)pixel_y * mask_pitch);
#endif
            lanes_f r = uniform_correlation;
#if HAS_CORRELATION
            r = load_pixels(&strip, correlation + correlation_offset + (ulong)pixel_y * correlation_pitch, 1.0f);
            const lanes_i bad_r = ~((r >= 0.0f) & (r <= 1.0f));
            report_lanes(&strip, bad, r, bad_r, y, pixel_y);
            r = select(r, SPREAD(1.0f), bad_r);
            replaced |= bad_r;
#endif
#if PHASE_CONTINUOUS
            lanes_f p = uniform_path;
#if HAS_PATH
            p = load_pixels(&strip, path + path_offset + (ulong)pixel_y * path_pitch, 0.0f);
            const lanes_i bad_p = ~(p >= 0.0f);
            report_lanes(&strip, bad, p, bad_p, y, pixel_y);
            p = select(p, SPREAD(0.0f), bad_p);
            replaced |= bad_p;
#endif
            // A later part of an exposure (negative): what is new was drawn by the first part.
            lanes_f knots = knots_per_path * p;
            if (knots_per_path < 0.0f)
                knots = select(SPREAD(0.0f), -knots, p <= FLT_MAX);
            replaced |= knots >= 2.0f;
            // t + knots in units of 2^-32: how many knots are passed is whole, what is left is t.
            const lanes_f whole = select(SPREAD(0.0f), SPREAD(1.0f), knots >= 1.0f);
            const lanes_f part = select(SPREAD(0.0f), knots - whole, (knots > 0.0f) & ~replaced) * 0x1p32f;
            const lanes_u words = convert_lanes_u(select(part, (part + 0x1p23f) - 0x1p23f, part < 0x1p23f));
            const lanes_u begin =
                load_some_words((__global const uint *)state + (ulong)y * grid_width + x, strip.count);
            const lanes_u end = begin + words;
            const lanes_u passed = convert_lanes_u(whole) + select((lanes_u)(0u), (lanes_u)(1u), end < begin);
            step[j] = select(passed, (lanes_u)(REPLACE), as_lanes_u(replaced));
            moved[j] = (end != begin) & ~replaced;
            t[j] = end;
#else
            step[j] = select((lanes_u)(KEEP), (lanes_u)(REPLACE), as_lanes_u(replaced));
#endif
            keep[j] = select(r, SPREAD(1.0f), replaced);
            replaced_any |= step[j] >= CROSS_TWO;
            crossed_any |= step[j] != KEEP;
            boiled_any |= keep[j] < 1.0f;
            moved_any |= moved[j];
        }
        if (!holds_anywhere(crossed_any | boiled_any | moved_any))
            continue;
        const bool draws = holds_anywhere(replaced_any), crosses = holds_anywhere(crossed_any),
                   boils = holds_anywhere(boiled_any);
        lanes_words4 phase, magnitude;
#if BOILS
        lanes_words4 boil_phase, boil_magnitude;
#endif
#if PHASE_CONTINUOUS
        lanes_words4 start, next_phase, next_magnitude;
#if BOILS
        lanes_words4 next_boil_phase, next_boil_magnitude;
#endif
        if (draws)
            image_blocks(x, row, frame_low, frame_high, stream | STREAM_PATH_START, key, &start);
#endif
        for (uint polarization = 0; polarization < polarization_count; ++polarization) {
            const ulong first = polarization * samples;
            if (draws) {
                image_blocks(x, row, frame_low, frame_high, stream | (STREAM_PHASE + polarization), key, &phase);
                image_blocks(x, row, frame_low, frame_high, stream | (STREAM_MAGNITUDE + polarization), key,
                             &magnitude);
            }
#if BOILS
            if (boils) {
                image_blocks(x, row, frame_low, frame_high, stream | (STREAM_BOIL_PHASE + polarization), key,
                             &boil_phase);
                image_blocks(x, row, frame_low, frame_high, stream | (STREAM_BOIL_MAGNITUDE + polarization), key,
                             &boil_magnitude);
#if PHASE_CONTINUOUS
                image_blocks(x, row, frame_low, frame_high, stream | (STREAM_BOIL_PHASE + 2u + polarization), key,
                             &next_boil_phase);
                image_blocks(x, row, frame_low, frame_high, stream | (STREAM_BOIL_MAGNITUDE + 2u + polarization), key,
                             &next_boil_magnitude);
#endif
            }
#endif
#if PHASE_CONTINUOUS
            if (crosses) {
                image_blocks(x, row, frame_low, frame_high, stream | (STREAM_NEXT_PHASE + polarization), key,
                             &next_phase);
                image_blocks(x, row, frame_low, frame_high, stream | (STREAM_NEXT_MAGNITUDE + polarization), key,
                             &next_magnitude);
            }
#endif
            for (uint j = 0; j < 4; ++j) {
                const uint y = row + j * quarter;
                if (y >= grid_height || !holds_anywhere((step[j] != KEEP) | (keep[j] < 1.0f)))
                    continue;
                __global float *knot_a = state + knot_offset(samples, first, 0) + 2 * ((ulong)y * grid_width + x);
                lanes_complex a, drawn;
                load_some_interleaved(knot_a, strip.count, &a);
                // A: fresh, the old B, or the old A.
#if PHASE_CONTINUOUS
                __global float *knot_b = state + knot_offset(samples, first, 1) + 2 * ((ulong)y * grid_width + x);
                lanes_complex b;
                load_some_interleaved(knot_b, strip.count, &b);
                choose(&a, &b, step[j] == CROSS_ONE);
#endif
                if (draws) {
                    gaussians_from_words(words_of(&phase, j), words_of(&magnitude, j), &drawn);
                    choose(&a, &drawn, step[j] >= CROSS_TWO);
                }
#if PHASE_CONTINUOUS
                if (crosses) {
                    gaussians_from_words(words_of(&next_phase, j), words_of(&next_magnitude, j), &drawn);
                    choose(&b, &drawn, step[j] != KEEP);
                }
#endif
#if BOILS
                if (boils) {
                    gaussians_from_words(words_of(&boil_phase, j), words_of(&boil_magnitude, j), &drawn);
                    boil(&a, &drawn, keep[j]);
#if PHASE_CONTINUOUS
                    gaussians_from_words(words_of(&next_boil_phase, j), words_of(&next_boil_magnitude, j), &drawn);
                    boil(&b, &drawn, keep[j]);
#endif
                }
#endif
                store_some_interleaved(&a, knot_a, strip.count);
#if PHASE_CONTINUOUS
                store_some_interleaved(&b, knot_b, strip.count);
#endif
            }
        }
#if PHASE_CONTINUOUS
        for (uint j = 0; j < 4; ++j) {
            const uint y = row + j * quarter;
            if (y >= grid_height || !holds_anywhere(moved[j] | (step[j] != KEEP)))
                continue;
            // (Where nothing moved, t is what it was.)
            const lanes_u path_end = draws ? select(t[j], words_of(&start, j), step[j] == REPLACE) : t[j];
            store_some_words(path_end, (__global uint *)state + (ulong)y * grid_width + x, strip.count);
        }
#endif
    }
}

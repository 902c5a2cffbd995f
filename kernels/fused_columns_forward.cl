// Pass A of the fused speckle engine: the field of STRIPS times LANES columns at once (what field_sample.h does, the same bits), its transform along the
// columns, and of that only the lines that the pupil lets through.
//   MATERIALS, COHERENT, LINES, SCREEN as in field_sample.h; FIELD_UNIT_PHASOR, PHASE_CONTINUOUS as in phase_state.h
//   OVERSAMPLING n
//   STRIPS n      strips of LANES columns side by side: rows are far apart in memory, and what a row brings should be used up
//   POLARIZATIONS 2  both at once: the lines of the second lie behind those of the first
//   PREFETCH n    rows that are asked for ahead; 0 for none
//
// Kept lines lie in groups of LANES, in the order in which the transform leaves them: point x of group g is a pair of vectors (re, im) at
// lines[2 (g grid_width + x)], lane l the l-th line of the group.
#include "field_sample.h"
#include "fused_lanes.h"

#define FFT_TILE __local
#define FFT_STRIPS (STRIPS * POLARIZATIONS)
#define FFT_INPUT(strip, p, re, im) illuminate(&sources[strip], p, &worst[strip], &re, &im)
#define FFT_ENDS
#define FFT_INPUT_LOOP _Pragma("unroll")
#define FFT_OUTPUT(strip, p, re, im)

typedef struct {
    __global const state_word *state;
    ulong samples, first;
    uint grid_width, grid_height, polarization;
    __global const float *irradiance;
    uint irradiance_pitch, width, height;
#if MATERIALS
    __global const uchar *material;
    uint material_pitch, material_count;
    __global const float *table;
    __global uint *bad_material;
#elif COHERENT
    float random_amplitude, coherent_amplitude;
#endif
#if LINES
    float line_turns;
    __global const float *heights;
#endif
#if SCREEN
    __global const float *screen;
#endif
    __global uint *bad;
    uint x, count; // the first column, and how many there are
    uint columns[LANES]; // the pixel column of each
    int whole;     // LANES columns
    int direct;    // their pixels lie side by side
} source_t;

// True if what is wrong with the pixel of sample (x, y) is counted here: several samples, the padding and the second polarization share it.
static int counts(const source_t *s, uint lane, uint y, uint pixel_x, uint pixel_y) {
    return s->polarization == 0 && lane < s->count && s->x + lane == OVERSAMPLING * pixel_x && y == OVERSAMPLING * pixel_y;
}

// What lies above in the order of bits is no irradiance: infinite, NaN or negative.
#define LARGEST_BITS 0x7f7fffffu

// The irradiance of LANES pixels in row pixel_y, not checked.
static inline lanes_f load_irradiance(const source_t *s, uint pixel_y) {
    __global const float *row = s->irradiance + (ulong)pixel_y * s->irradiance_pitch;
    if (s->direct)
        return load_lanes_f(row + s->x);
    float values[LANES];
    for (uint lane = 0; lane < LANES; ++lane)
        values[lane] = row[s->columns[lane]];
    return vload_lanes(0, values);
}

// Counts what is wrong with a strip's pixels, once it is known that something is.
static void report_strip(const source_t *s) {
    for (uint y = 0; y < s->grid_height; ++y) {
        const uint pixel_y = pixel_of_sample(y, OVERSAMPLING, s->height, s->grid_height);
        float values[LANES];
        vstore_lanes(load_irradiance(s, pixel_y), 0, values);
        for (uint lane = 0; lane < LANES; ++lane)
            if (!(values[lane] >= 0.0f && values[lane] <= FLT_MAX)) {
                const uint pixel_x = s->columns[lane];
                if (counts(s, lane, y, pixel_x, pixel_y))
                    report_bad(s->bad, values[lane], pixel_y * s->width + pixel_x);
            }
    }
}

// LANES words from `from` on, of the last strip only those that there are.
static inline lanes_u load_words(const source_t *s, __global const uint *from) {
    if (s->whole)
        return load_lanes_u(from);
    uint values[LANES];
    for (uint lane = 0; lane < LANES; ++lane)
        values[lane] = lane < s->count ? from[lane] : 0u;
    return vload_lanes(0, values);
}

static inline void load_numbers(const source_t *s, __global const float *from, lanes_complex *z) {
    if (s->whole) {
        load_interleaved(from, z);
        return;
    }
    float re[LANES], im[LANES];
    for (uint lane = 0; lane < LANES; ++lane) {
        re[lane] = lane < s->count ? from[2u * lane] : 0.0f;
        im[lane] = lane < s->count ? from[2u * lane + 1u] : 0.0f;
    }
    z->re = vload_lanes(0, re);
    z->im = vload_lanes(0, im);
}

#if PREFETCH
// Into the second-level cache: rows whose distance is a power of two share few sets of the first.
#define prefetch_line(address) __builtin_prefetch((const void *)(size_t)(address), 0, 2)

// What unit_fields() reads.
static inline void prefetch_state(const source_t *s, ulong i) {
#if FIELD_UNIT_PHASOR
    prefetch_line(s->state + s->first + i);
#else
    for (uint knot = 0; knot <= PHASE_CONTINUOUS; ++knot) {
        __global const state_word *z = s->state + knot_offset(s->samples, s->first, knot) + 2 * i;
        prefetch_line(z);
        prefetch_line(z + LANES);
    }
#if PHASE_CONTINUOUS
    prefetch_line(s->state + i);
#endif
#endif
}
#endif

// unit_field() of LANES samples from sample i on.
static inline void unit_fields(const source_t *s, ulong i, lanes_complex *z) {
#if FIELD_UNIT_PHASOR
    phasors_from_words(load_words(s, s->state + s->first + i), z);
#elif PHASE_CONTINUOUS
    lanes_complex turn, a, b;
    phasors_from_words(load_words(s, (__global const uint *)s->state + i) >> 2, &turn);
    load_numbers(s, s->state + knot_offset(s->samples, s->first, 0) + 2 * i, &a);
    load_numbers(s, s->state + knot_offset(s->samples, s->first, 1) + 2 * i, &b);
    z->re = fma(turn.im, b.re, turn.re * a.re);
    z->im = fma(turn.im, b.im, turn.re * a.im);
#else
    load_numbers(s, s->state + knot_offset(s->samples, s->first, 0) + 2 * i, z);
#endif
}

// worst: the largest bits of an irradiance so far.
static inline void illuminate(const source_t *s, uint y, lanes_u *worst, lanes_f *re, lanes_f *im) {
    const uint pixel_y = pixel_of_sample(y, OVERSAMPLING, s->height, s->grid_height);
    const ulong i = (ulong)y * s->grid_width + s->x;
#if PREFETCH
    // Steps from row to row are too long for the hardware to foresee.
    prefetch_line(s->irradiance + (ulong)(pixel_y + PREFETCH) * s->irradiance_pitch + s->x);
    prefetch_state(s, i + PREFETCH * s->grid_width);
#if LINES
    prefetch_line(s->heights + i + PREFETCH * s->grid_width);
#endif
#endif
    // What is no irradiance counts as 0; a minus before a zero is dropped.
    lanes_f i0 = load_irradiance(s, pixel_y) + 0.0f;
    const lanes_u bits = as_lanes_u(i0);
    *worst = max(*worst, bits);
    i0 = bits <= LARGEST_BITS ? i0 : SPREAD(0.0f);
    lanes_complex z;
    unit_fields(s, i, &z);
    lanes_f amplitude = sqrt(i0);
#if MATERIALS
    float random[LANES], coherent[LANES], share[LANES];
    for (uint lane = 0; lane < LANES; ++lane) {
        const uint pixel_x = s->columns[lane];
        uint id = s->material[(ulong)pixel_y * s->material_pitch + pixel_x];
        if (id >= s->material_count) {
            if (counts(s, lane, y, pixel_x, pixel_y))
                report_bad(s->bad_material, -1.0f, pixel_y * s->width + pixel_x);
            id = 0;
        }
        __global const float *entry = s->table + 4u * id;
        random[lane] = entry[0];
        coherent[lane] = entry[1];
        share[lane] = entry[2u + s->polarization];
    }
    const lanes_f r = vload_lanes(0, random);
    z.re = r * z.re + vload_lanes(0, coherent);
    z.im = r * z.im;
    amplitude *= vload_lanes(0, share);
#elif COHERENT
    z.re = s->random_amplitude * z.re + s->coherent_amplitude;
    z.im = s->random_amplitude * z.im;
#endif
    lanes_complex u = {amplitude * z.re, amplitude * z.im};
#if LINES || SCREEN
    lanes_f turns = SPREAD(0.0f);
#if LINES
    turns += s->line_turns * as_lanes_f(load_words(s, (__global const uint *)(s->heights + i)));
#endif
#if SCREEN
    turns += as_lanes_f(load_words(s, (__global const uint *)(s->screen + i)));
#endif
    lanes_complex p;
    phasors_from_turns(turns, &p);
    const lanes_complex turned = {u.re * p.re - u.im * p.im, u.re * p.im + u.im * p.re};
    u = turned;
#endif
    *re = u.re;
    *im = u.im;
}

#include "fused_codelets.h"

// positions: of each kept line in the transform, `groups` of LANES, the last one filled up with FFT_LENGTH, where the tile holds 0.
// blocks: for each block of the transform three numbers, of which the first counts the groups that are complete behind it.
// ends: of the transform (fused_ends() of the host), so that kept lines are among what is made.
__kernel void fused_columns_forward(FIELD_PARAMETERS,
                                    __global lanes_f *lines, __global uint *bad, __global const float *twiddles,
                                    __global const uint *positions, uint groups, __global const uint *blocks, __global const uchar *ends,
                                    __local lanes_f *tiles) {
    if (get_global_id(0) * STRIPS * LANES >= grid_width)
        return;
    source_t sources[FFT_STRIPS];
    lanes_u worst[FFT_STRIPS];
    for (uint strip = 0; strip < FFT_STRIPS; ++strip) {
        source_t source;
        source.state = state;
        source.samples = samples;
        source.first = first + strip / STRIPS * samples;
        source.grid_width = grid_width;
        source.grid_height = grid_height;
        source.polarization = polarization + strip / STRIPS;
        source.irradiance = irradiance + irradiance_offset;
        source.irradiance_pitch = irradiance_pitch;
        source.width = width;
        source.height = height;
#if MATERIALS
        source.material = material + material_offset;
        source.material_pitch = material_pitch;
        source.material_count = material_count;
        source.table = table;
        source.bad_material = bad_material;
#elif COHERENT
        source.random_amplitude = random_amplitude;
        source.coherent_amplitude = coherent_amplitude;
#endif
#if LINES
        source.line_turns = line_turns;
        source.heights = heights;
#endif
#if SCREEN
        source.screen = screen;
#endif
        source.bad = bad;
        source.x = (get_global_id(0) * STRIPS + strip % STRIPS) * LANES;
        source.count = source.x < grid_width ? min((uint)LANES, grid_width - source.x) : 0u;
        source.whole = source.count == LANES;
        source.direct = OVERSAMPLING == 1 && source.x + LANES <= width;
        // Lanes beyond the grid repeat its last column.
        for (uint lane = 0; lane < LANES; ++lane)
            source.columns[lane] = pixel_of_sample(min(source.x + lane, grid_width - 1u), OVERSAMPLING, width, grid_width);
        sources[strip] = source;
        worst[strip] = (lanes_u)(0u);
    }

    fft_forward_first
    for (uint strip = 0; strip < FFT_STRIPS; ++strip) {
        if (sources[strip].count == 0)
            continue;
        if (any(worst[strip] > LARGEST_BITS))
            report_strip(&sources[strip]);
        __global lanes_f *strip_lines = lines + 2 * (ulong)(strip / STRIPS * groups) * grid_width;
        const uint x = sources[strip].x, count = sources[strip].count;
        __local lanes_f *tile = tiles + strip * FFT_TILE_VECTORS;
        tile[2u * FFT_LENGTH] = tile[2u * FFT_LENGTH + 1u] = SPREAD(0.0f);
        uint group = 0;
        for (uint block = 0; block < FFT_BLOCKS; ++block) {
            fft_forward_block(block, tile, twiddles FFT_ENDS_ARGUMENT);
            for (; group < blocks[3u * block]; ++group) {
                __global const uint *places = positions + group * LANES;
                __global lanes_f *out = strip_lines + 2 * ((ulong)group * grid_width + x);
                // One part after the other: both at once are more than there are registers.
                for (uint part = 0; part < 2; ++part) {
                    lanes_f v[LANES];
#pragma unroll
                    for (uint l = 0; l < LANES; ++l)
                        v[l] = tile[2u * places[l] + part];
                    transpose_lanes(v);
                    if (count == LANES) {
#pragma unroll
                        for (uint l = 0; l < LANES; ++l)
                            out[2u * l + part] = v[l];
                    } else {
#pragma unroll
                        for (uint l = 0; l < LANES; ++l)
                            if (l < count)
                                out[2u * l + part] = v[l];
                    }
                }
            }
        }
    }
}

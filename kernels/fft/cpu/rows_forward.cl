// The first pass of the engine for CPUs: the field of LANES rows at once (what field_sample.h does, the same bits), its
// transform along the rows, and of that only the lines that the pupil lets through.
//   MATERIALS, COHERENT, LINES, SCREEN as in field_sample.h; FIELD_UNIT_PHASOR, PHASE_CONTINUOUS as in phase_state.h
//   OVERSAMPLING n
//   POLARIZATIONS 2  both, one after the other: the lines of the second lie behind those of the first; the image is
//                    read once
//   PREFETCH n       how many samples of each row are asked for ahead; 0 for none. PREFETCH_LOCALITY: into which cache,
//                    as __builtin_prefetch() has it
//   STREAM_LINES 1   the pupil columns go past the caches
//
// Pupil columns lie in column blocks of LANES, in the order in which the transform leaves them: point y of block b is a
// pair of vectors (re, im) at lines[2 (b grid_height + y)], lane l the l-th column of the block.
#include "stages/field_sample.h"
#include "common/lanes.h"

// Memory has neighbours along a row, a vector of the transform those of different rows: points go into the tile in
// squares of LANES by LANES that are transposed on the way, and the first stage takes them from there.
#define FFT_TILE __local
#define FFT_STRIPS 1
#define FFT_INPUT(strip, p, re, im) re = tiles[2u * (p)], im = tiles[2u * (p) + 1u]
#define FFT_ENDS
#define FFT_INPUT_LOOP _Pragma("unroll")
#define FFT_OUTPUT(strip, p, re, im)
// The amplitudes of LANES rows from the ideal image wait behind the tile for the second polarization: of samples x, x +
// 1 .. in a row.
#define AMPLITUDES(x, row) tiles[FFT_TILE_VECTORS + (x) + (row)]

#if STREAM_LINES
#define store_line(values, to) __builtin_nontemporal_store(values, to)
#else
#define store_line(values, to) (*(to) = (values))
#endif

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
    uint y, rows; // the first row, and how many there are
} source_t;

// LANES samples of a row side by side, at its end the `count` that there are.
typedef struct {
    uint x, count;
    uint columns[LANES]; // the pixel column of each
    int direct;          // their pixels lie side by side
} span_t;

// The field of a span of LANES rows: for each part a vector of each row.
typedef struct {
    lanes_f of[2][LANES];
} fields_t;

// True if what is wrong with the pixel of sample (x, y) is counted here: several samples and the padding share it.
static int counts(uint x, uint y, uint pixel_x, uint pixel_y) {
    return x == OVERSAMPLING * pixel_x && y == OVERSAMPLING * pixel_y;
}

// What lies above in the order of bits is no irradiance: infinite, NaN or negative.
#define LARGEST_BITS 0x7f7fffffu

// The amplitudes that the irradiance of a span's pixels in row pixel_y gives. worst: the largest bits of an irradiance
// so far.
static inline lanes_f load_amplitudes(const source_t *s, const span_t *span, uint pixel_y, lanes_u *worst) {
    __global const float *row = s->irradiance + (ulong)pixel_y * s->irradiance_pitch;
    lanes_f i0;
    if (span->direct) {
        i0 = load_lanes_f(row + span->x);
    } else {
        float values[LANES];
        for (uint lane = 0; lane < LANES; ++lane)
            values[lane] = row[span->columns[lane]];
        i0 = vload_lanes(0, values);
    }
    // What is no irradiance counts as 0; a minus before a zero is dropped.
    i0 += 0.0f;
    const lanes_u bits = as_lanes_u(i0);
    *worst = max(*worst, bits);
    return sqrt(bits <= LARGEST_BITS ? i0 : SPREAD(0.0f));
}

// Counts what is wrong with the pixels of these rows, once it is known that something is.
static void report_rows(const source_t *s) {
    for (uint y = s->y; y < s->y + s->rows; ++y) {
        const uint pixel_y = pixel_of_sample(y, OVERSAMPLING, s->height, s->grid_height);
        for (uint x = 0; x < s->grid_width; ++x) {
            const uint pixel_x = pixel_of_sample(x, OVERSAMPLING, s->width, s->grid_width);
            const float value = s->irradiance[(ulong)pixel_y * s->irradiance_pitch + pixel_x];
            if (!(value >= 0.0f && value <= FLT_MAX) && counts(x, y, pixel_x, pixel_y))
                report_bad(s->bad, value, pixel_y * s->width + pixel_x);
        }
    }
}

#if PREFETCH
// What unit_fields() reads.
static inline void prefetch_state(const source_t *s, ulong i) {
#if FIELD_UNIT_PHASOR
    prefetch_line(s->state + s->first + i, PREFETCH_LOCALITY);
#else
    for (uint knot = 0; knot <= PHASE_CONTINUOUS; ++knot) {
        __global const state_word *z = s->state + knot_offset(s->samples, s->first, knot) + 2 * i;
        prefetch_line(z, PREFETCH_LOCALITY);
        prefetch_line(z + LANES, PREFETCH_LOCALITY);
    }
#if PHASE_CONTINUOUS
    prefetch_line(s->state + i, PREFETCH_LOCALITY);
#endif
#endif
}
#endif

// unit_field() of LANES samples from sample i on.
static inline void unit_fields(const source_t *s, const span_t *span, ulong i, lanes_complex *z) {
#if FIELD_UNIT_PHASOR
    phasors_from_words(load_some_words(s->state + s->first + i, span->count), z);
#elif PHASE_CONTINUOUS
    lanes_complex turn, a, b;
    phasors_from_words(load_some_words((__global const uint *)s->state + i, span->count) >> 2, &turn);
    load_some_interleaved(s->state + knot_offset(s->samples, s->first, 0) + 2 * i, span->count, &a);
    load_some_interleaved(s->state + knot_offset(s->samples, s->first, 1) + 2 * i, span->count, &b);
    z->re = fma(turn.im, b.re, turn.re * a.re);
    z->im = fma(turn.im, b.im, turn.re * a.im);
#else
    load_some_interleaved(s->state + knot_offset(s->samples, s->first, 0) + 2 * i, span->count, z);
#endif
}

#if PREFETCH
// What the field of LANES samples from x on in row y is made of: so many rows side by side are more than the hardware
// foresees.
static inline void prefetch_samples(const source_t *s, uint x, uint y, uint pixel_y, int irradiance) {
    const ulong i = (ulong)y * s->grid_width + x;
    if (irradiance)
        prefetch_line(s->irradiance + (ulong)pixel_y * s->irradiance_pitch + x / OVERSAMPLING, PREFETCH_LOCALITY);
    prefetch_state(s, i);
#if LINES
    prefetch_line(s->heights + i, PREFETCH_LOCALITY);
#endif
#if SCREEN
    prefetch_line(s->screen + i, PREFETCH_LOCALITY);
#endif
}

// How the rows begin that come behind block `block` of polarization k's transform: those of the second polarization, or
// of the work-item that follows. A part of the rows with each block.
static inline void prefetch_starts(const source_t *s, uint k, uint block, uint blocks) {
    source_t next = *s;
    if (k + 1 < POLARIZATIONS) {
        next.first += s->samples;
    } else {
        next.first -= k * s->samples;
        next.y += LANES;
    }
    for (uint row = block * LANES / blocks; row < (block + 1) * LANES / blocks; ++row) {
        const uint y = min(next.y + row, s->grid_height - 1u);
        for (uint x = 0; x < PREFETCH && x < s->grid_width; x += LANES)
            prefetch_samples(&next, x, y, pixel_of_sample(y, OVERSAMPLING, s->height, s->grid_height),
                             k + 1 == POLARIZATIONS);
    }
}
#endif

// The field of a span of row y, which is part of the pixels' row pixel_y; to vector `row` of both parts.
static inline void illuminate(const source_t *s, const span_t *span, uint y, uint pixel_y, lanes_f amplitude, uint row,
                              fields_t *fields) {
    const ulong i = (ulong)y * s->grid_width + span->x;
    lanes_complex z;
    unit_fields(s, span, i, &z);
#if MATERIALS
    float random[LANES], coherent[LANES], share[LANES];
    for (uint lane = 0; lane < LANES; ++lane) {
        const uint pixel_x = span->columns[lane];
        uint id = s->material[(ulong)pixel_y * s->material_pitch + pixel_x];
        if (id >= s->material_count) {
            if (s->polarization == 0 && lane < span->count && counts(span->x + lane, y, pixel_x, pixel_y))
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
    turns += s->line_turns * as_lanes_f(load_some_words((__global const uint *)(s->heights + i), span->count));
#endif
#if SCREEN
    turns += as_lanes_f(load_some_words((__global const uint *)(s->screen + i), span->count));
#endif
    lanes_complex p;
    phasors_from_turns(turns, &p);
    const lanes_complex turned = {u.re * p.re - u.im * p.im, u.re * p.im + u.im * p.re};
    u = turned;
#endif
    fields->of[0][row] = u.re;
    fields->of[1][row] = u.im;
}

#include "fft/cpu/codelets.h"

// LANES points of the rows, from x on, into the tile. first: no amplitudes wait yet.
static inline ALWAYS_INLINE void load_points(const source_t *s, uint x, int first, lanes_u *worst,
                                             __local lanes_f *tiles) {
    span_t span;
    span.x = x;
    span.count = min((uint)LANES, FFT_LENGTH - x);
    span.direct = OVERSAMPLING == 1 && x + LANES <= s->width;
    if (!span.direct || MATERIALS)
        for (uint lane = 0; lane < LANES; ++lane)
            span.columns[lane] = pixel_of_sample(min(x + lane, FFT_LENGTH - 1u), OVERSAMPLING, s->width, s->grid_width);
    fields_t fields;
    lanes_f amplitude = SPREAD(0.0f);
    uint last_row = ~0u;
    for (uint row = 0; row < s->rows; ++row) {
        const uint y = s->y + row, pixel_y = pixel_of_sample(y, OVERSAMPLING, s->height, s->grid_height);
#if PREFETCH
        prefetch_samples(s, x + PREFETCH, y, pixel_y, first);
#endif
        // Samples of a pixel share its amplitude.
        if (!first)
            amplitude = AMPLITUDES(x, row);
        else if (OVERSAMPLING == 1 || pixel_y != last_row)
            amplitude = load_amplitudes(s, &span, pixel_y, worst);
#if POLARIZATIONS == 2
        if (first)
            AMPLITUDES(x, row) = amplitude;
#endif
        last_row = pixel_y;
        illuminate(s, &span, y, pixel_y, amplitude, row, &fields);
    }
    for (uint row = s->rows; row < LANES; ++row)
        fields.of[0][row] = fields.of[1][row] = SPREAD(0.0f);
    for (uint part = 0; part < 2; ++part) {
        lanes_f v[LANES];
#pragma unroll
        for (uint l = 0; l < LANES; ++l)
            v[l] = fields.of[part][l];
        transpose_lanes(v);
        __local lanes_f *to = tiles + 2u * x + part;
        if (span.count == LANES) {
#pragma unroll
            for (uint l = 0; l < LANES; ++l)
                to[2u * l] = v[l];
        } else {
#pragma unroll
            for (uint l = 0; l < LANES; ++l)
                if (l < span.count)
                    to[2u * l] = v[l];
        }
    }
}

// positions: of each pupil column in the transform, `column_blocks` of LANES, the last one filled up with FFT_LENGTH,
// where the tile holds 0. blocks: for each block of the transform three numbers, of which the first counts the column
// blocks that are complete behind it. ends: of the transform (needed_ends() of the host), so that pupil columns are
// among what is made.
__kernel void cpu_rows_forward(FIELD_PARAMETERS, __global lanes_f *lines, __global uint *bad,
                               __global const float *twiddles, __global const uint *positions, uint column_blocks,
                               __global const uint *blocks, __global const uchar *ends, __local lanes_f *tiles) {
    const uint y = get_global_id(0) * LANES;
    if (y >= grid_height)
        return;
    source_t source;
    source.state = state;
    source.samples = samples;
    source.first = first;
    source.grid_width = grid_width;
    source.grid_height = grid_height;
    source.polarization = polarization;
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
    source.y = y;
    source.rows = min((uint)LANES, grid_height - y);
    lanes_u worst = (lanes_u)(0u);
    tiles[2u * FFT_LENGTH] = tiles[2u * FFT_LENGTH + 1u] = SPREAD(0.0f);
    for (uint k = 0; k < POLARIZATIONS; ++k) {
        if (k == 0)
            for (uint x = 0; x < FFT_LENGTH; x += LANES)
                load_points(&source, x, 1, &worst, tiles);
        else
            for (uint x = 0; x < FFT_LENGTH; x += LANES)
                load_points(&source, x, 0, &worst, tiles);
        fft_forward_first
        uint column_block = 0;
        for (uint block = 0; block < FFT_BLOCKS; ++block) {
#if PREFETCH
            prefetch_starts(&source, k, block, FFT_BLOCKS);
#endif
            fft_forward_block(block, tiles, twiddles FFT_ENDS_ARGUMENT);
            for (; column_block < blocks[3u * block]; ++column_block) {
                __global const uint *places = positions + column_block * LANES;
                __global lanes_f *out = lines + 2 * ((ulong)column_block * grid_height + y);
                // One part after the other: both at once are more than there are registers.
                for (uint part = 0; part < 2; ++part) {
                    lanes_f v[LANES];
#pragma unroll
                    for (uint l = 0; l < LANES; ++l)
                        v[l] = tiles[2u * places[l] + part];
                    transpose_lanes(v);
                    if (source.rows == LANES) {
#pragma unroll
                        for (uint l = 0; l < LANES; ++l)
                            store_line(v[l], &out[2u * l + part]);
                    } else {
#pragma unroll
                        for (uint l = 0; l < LANES; ++l)
                            if (l < source.rows)
                                store_line(v[l], &out[2u * l + part]);
                    }
                }
            }
        }
        lines += 2 * (ulong)column_blocks * grid_height;
        source.first += samples;
        ++source.polarization;
    }
    if (holds_anywhere(worst > LARGEST_BITS) && polarization == 0)
        report_rows(&source);
#if STREAM_LINES
    __sync_synchronize(); // such stores wait for nobody: here they end before the kernel does
#endif
}

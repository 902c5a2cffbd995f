// One axis of a two-dimensional transform in place, natural order in and out, on LANES lines at once: what the passes
// of the engine for CPUs are made of, for fields that exist as such (filters, screens).
//   ALONG_ROWS 0   columns x .. x + LANES - 1
//   ALONG_ROWS 1   rows y .. y + LANES - 1
//   INVERSE 0      exp(-2 pi i ..)
//   INVERSE 1      exp(+2 pi i ..), the result times `scale`
#include "common/lanes.h"

// The first and the last stage work in the tile like the others: lines are loaded and stored in another order than
// either takes.
#define FFT_TILE __local
#define FFT_STRIPS 1
#define FFT_INPUT(strip, p, re, im) re = tiles[2u * (p)], im = tiles[2u * (p) + 1u]
#define FFT_OUTPUT(strip, p, re, im) tiles[2u * (p)] = re, tiles[2u * (p) + 1u] = im

#include "fft/cpu/codelets.h"

// count: of the numbers that there are; the others are 0 and are not stored.
static inline void load_numbers(__global const float *from, uint count, lanes_complex *z) {
    if (count == LANES) {
        load_interleaved(from, z);
        return;
    }
    float re[LANES], im[LANES];
    for (uint lane = 0; lane < LANES; ++lane) {
        re[lane] = lane < count ? from[2u * lane] : 0.0f;
        im[lane] = lane < count ? from[2u * lane + 1u] : 0.0f;
    }
    z->re = vload_lanes(0, re);
    z->im = vload_lanes(0, im);
}

static inline void store_numbers(lanes_f re, lanes_f im, uint count, __global float *to) {
    float real[LANES], imaginary[LANES];
    vstore_lanes(re, 0, real);
    vstore_lanes(im, 0, imaginary);
    for (uint lane = 0; lane < count; ++lane) {
        to[2u * lane] = real[lane];
        to[2u * lane + 1u] = imaginary[lane];
    }
}

// places: where point x of a line goes in the tile, or comes from; a null pointer: in order.
#if ALONG_ROWS

static inline void load_lines(__global const float *field, uint width, uint rows, __global const uint *places,
                              FFT_TILE lanes_f *tile) {
    for (uint x = 0; x < FFT_LENGTH; x += LANES) {
        const uint count = min((uint)LANES, FFT_LENGTH - x);
        lanes_f re[LANES], im[LANES];
        for (uint row = 0; row < LANES; ++row) {
            lanes_complex z = {SPREAD(0.0f), SPREAD(0.0f)};
            if (row < rows)
                load_numbers(field + 2u * ((ulong)row * width + x), count, &z);
            re[row] = z.re;
            im[row] = z.im;
        }
        transpose_lanes(re);
        transpose_lanes(im);
        for (uint i = 0; i < count; ++i) {
            const uint p = places ? places[x + i] : x + i;
            tile[2u * p] = re[i];
            tile[2u * p + 1u] = im[i];
        }
    }
}

static inline void store_lines(FFT_TILE const lanes_f *tile, __global const uint *places, lanes_f scale, uint width,
                               uint rows, __global float *field) {
    for (uint x = 0; x < FFT_LENGTH; x += LANES) {
        const uint count = min((uint)LANES, FFT_LENGTH - x);
        lanes_f re[LANES], im[LANES];
        for (uint i = 0; i < LANES; ++i) {
            re[i] = im[i] = SPREAD(0.0f);
            if (i < count) {
                const uint p = places ? places[x + i] : x + i;
                re[i] = scale * tile[2u * p];
                im[i] = scale * tile[2u * p + 1u];
            }
        }
        transpose_lanes(re);
        transpose_lanes(im);
        for (uint row = 0; row < rows; ++row)
            store_numbers(re[row], im[row], count, field + 2u * ((ulong)row * width + x));
    }
}

#define FIRST_NUMBER(line) (ulong)(line) * width

#else

static inline void load_lines(__global const float *field, uint width, uint columns, __global const uint *places,
                              FFT_TILE lanes_f *tile) {
    for (uint y = 0; y < FFT_LENGTH; ++y) {
        lanes_complex z;
        load_numbers(field + 2u * (ulong)y * width, columns, &z);
        const uint p = places ? places[y] : y;
        tile[2u * p] = z.re;
        tile[2u * p + 1u] = z.im;
    }
}

static inline void store_lines(FFT_TILE const lanes_f *tile, __global const uint *places, lanes_f scale, uint width,
                               uint columns, __global float *field) {
    for (uint y = 0; y < FFT_LENGTH; ++y) {
        const uint p = places ? places[y] : y;
        store_numbers(scale * tile[2u * p], scale * tile[2u * p + 1u], columns, field + 2u * (ulong)y * width);
    }
}

#define FIRST_NUMBER(line) (line)

#endif

// field: rows of `width` complex numbers. line_count: of all lines. positions: where each frequency stands in a
// transformed line.
__kernel void line_transform(__global float *field, uint width, uint line_count, float scale,
                             __global const float *twiddles, __global const uint *positions, __local lanes_f *tiles) {
    const uint line = get_global_id(0) * LANES;
    if (line >= line_count)
        return;
    const uint count = min((uint)LANES, line_count - line);
    field += 2u * FIRST_NUMBER(line);
#if INVERSE
    load_lines(field, width, count, positions, tiles);
    for (uint block = 0; block < FFT_BLOCKS; ++block)
        fft_inverse_block(block, tiles, twiddles);
    fft_inverse_last
    store_lines(tiles, (__global const uint *)0, SPREAD(scale), width, count, field);
#else
    load_lines(field, width, count, (__global const uint *)0, tiles);
    fft_forward_first
    for (uint block = 0; block < FFT_BLOCKS; ++block)
        fft_forward_block(block, tiles, twiddles);
    store_lines(tiles, positions, SPREAD(scale), width, count, field);
#endif
}

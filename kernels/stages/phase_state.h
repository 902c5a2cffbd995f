// The state of the surface's random field, sample by sample. FIELD_UNIT_PHASOR 1: the phase word itself (phase = 2 pi
// word / 2^32). 0: complex numbers, circular Gaussian with E|z|^2 = 1. PHASE_CONTINUOUS 1 (Gaussian only): two such
// numbers, the knots A and B, and a path coordinate t in [0, 1), z = cos(pi t / 2) A + sin(pi t / 2) B (phase.h of the
// C API).
//
// Words of 4 bytes, `samples` the size of the field grid:
//   PHASE_CONTINUOUS 0: for each polarization samples x (re, im), or samples x word.
//   PHASE_CONTINUOUS 1: samples x t, in units of 2^-32; then for each polarization samples x (re, im) of A, the same of
//   B.
//   Behind that, in a state that moves with the surface: samples x (x, y), the part of a shift that is not carried out
//   yet, in samples.
#ifndef CLSP_PHASE_STATE_H
#define CLSP_PHASE_STATE_H

#include "common/philox.h"

#if FIELD_UNIT_PHASOR
typedef uint state_word;
#else
typedef float state_word;
#endif

// Where the complex numbers of a knot begin (A: 0, B: 1). first: polarization * samples.
static inline ALWAYS_INLINE ulong knot_offset(ulong samples, ulong first, uint knot) {
#if PHASE_CONTINUOUS
    return samples + 4 * first + 2 * samples * knot;
#else
    return 2 * first;
#endif
}

// t is kept as an integer: a float that happens to have its bits could be flushed to zero or changed on the way.
static inline ALWAYS_INLINE uint load_path(__global const state_word *words, ulong i) {
    return ((__global const uint *)words)[i];
}

static inline ALWAYS_INLINE void store_path(__global state_word *words, ulong i, uint t) {
    ((__global uint *)words)[i] = t;
}

static inline ALWAYS_INLINE complex_float load_complex(__global const state_word *words, ulong i) {
    const complex_float z = {words[2 * i], words[2 * i + 1]};
    return z;
}

static inline ALWAYS_INLINE void store_complex(__global state_word *words, ulong i, complex_float z) {
    words[2 * i] = z.re;
    words[2 * i + 1] = z.im;
}

// z of sample i of one polarization. first: polarization * samples.
static inline ALWAYS_INLINE complex_float unit_field(__global const state_word *state, ulong samples, ulong first,
                                                     ulong i) {
#if FIELD_UNIT_PHASOR
    return phasor_from_word((state + first)[i]);
#elif PHASE_CONTINUOUS
    // A quarter of a turn from A to B: exp(2 pi i (t / 4)).
    const complex_float turn = phasor_from_word(load_path(state, i) >> 2);
    const complex_float a = load_complex(state + knot_offset(samples, first, 0), i);
    const complex_float b = load_complex(state + knot_offset(samples, first, 1), i);
    const complex_float z = {fma(turn.im, b.re, turn.re * a.re), fma(turn.im, b.im, turn.re * a.im)};
    return z;
#else
    const float2 v = ((__global const float2 *)state + first)[i]; // both parts in one read
    const complex_float z = {v.x, v.y};
    return z;
#endif
}

// For kernels that read the field of one polarization: their first parameters, and z of sample i.
#define PHASE_STATE_PARAMETERS __global const state_word *state, ulong state_samples, ulong state_first
#define PHASE_STATE_FIELD(i) unit_field(state, state_samples, state_first, i)

#endif

// Phases in turns, and products of complex numbers.
#ifndef CLSP_PHASOR_H
#define CLSP_PHASOR_H

#include "common/philox.h"

// exp(2 pi i turns) of |turns| up to some thousands.
static inline ALWAYS_INLINE complex_float phasor_from_turns(float turns) {
    const float fraction = turns - rint(turns);
    return phasor_from_word((uint)(int)(fraction * 0x1p31f) << 1);
}

static inline ALWAYS_INLINE complex_float product(complex_float a, complex_float b) {
    const complex_float c = {a.re * b.re - a.im * b.im, a.re * b.im + a.im * b.re};
    return c;
}

#endif

// What the kernels that carry the field on have in common: what becomes of a sample, and images that may be there or
// not.
//   HAS_PATH, HAS_CORRELATION, HAS_MASK
#ifndef CLSP_PHASE_ADVANCE_H
#define CLSP_PHASE_ADVANCE_H

// How many knots are passed, or that the sample is new.
#define KEEP 0u
#define CROSS_ONE 1u
#define CROSS_TWO 2u
#define REPLACE 3u

#if HAS_PATH
#define PATH_PARAMETER __global const float *path, ulong path_offset, uint path_pitch,
#else
#define PATH_PARAMETER
#endif
#if HAS_CORRELATION
#define CORRELATION_PARAMETER __global const float *correlation, ulong correlation_offset, uint correlation_pitch,
#else
#define CORRELATION_PARAMETER
#endif
#if HAS_MASK
#define MASK_PARAMETER __global const uchar *mask, ulong mask_offset, uint mask_pitch,
#else
#define MASK_PARAMETER
#endif

// Of both kernels; what a shift needs comes between correlation and mask.
#define PHASE_ADVANCE_PARAMETERS                                                                                       \
    __global state_word *state, uint grid_width, uint grid_height, uint quarter, uint polarization_count, uint2 key,   \
        uint frame_low, uint frame_high, uint substep, uint width, uint height, uint oversampling,                     \
        float knots_per_path, float uniform_path, float uniform_correlation, ulong rest_offset,                        \
        PATH_PARAMETER CORRELATION_PARAMETER

#endif

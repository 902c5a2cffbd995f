// What every kernel file shares. OpenCL C 1.2.
#ifndef CLSP_COMMON_H
#define CLSP_COMMON_H

// Results must not depend on whether a compiler contracts a*b+c: where one rounding is meant, fma() is written.
#pragma OPENCL FP_CONTRACT OFF

// Formats of ClspImage (types.h).
#define FORMAT_UINT8 1
#define FORMAT_UINT16 2
#define FORMAT_UINT32 3
#define FORMAT_FLOAT32 4

// Bad pixels, counted per stage: [0] NaN or infinite, [1] negative, [2] the smallest linear index y * width + x of any.
static inline void report_bad(__global uint *bad, float value, uint index) {
    atomic_inc(&bad[isfinite(value) ? 1 : 0]);
    atomic_min(&bad[2], index);
}

// A value that must be finite and not negative; anything else is reported and taken as 0, so that one bad pixel does
// not spread over the whole frame through the Fourier transform.
static inline float sanitized(float value, __global uint *bad, uint index) {
    if (value >= 0.0f && value <= FLT_MAX)
        return value;
    report_bad(bad, value, index);
    return 0.0f;
}

#endif

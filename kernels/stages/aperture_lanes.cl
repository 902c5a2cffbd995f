// aperture_intensity over pixels' areas from the samples' powers, with explicit vectors for CPU devices: the taps along
// y, then those along x. A work-item makes a row of pixels. It is PIXEL_TAPS + PIXEL_TAPS sums for a pixel where
// aperture.cl has PIXEL_TAPS * PIXEL_TAPS.
//   ACCUMULATE, PIXEL_TAPS as in aperture.cl
#include "common/lanes.h"

// column_sums: room for grid_width + PIXEL_TAPS + LANES numbers.
__kernel void aperture_pixels_lanes(__global const float *powers, uint grid_width, uint grid_height, uint oversampling,
                                    float weight, __global const float *taps,
#if ACCUMULATE
                                    __global const float *before, ulong before_offset, uint before_pitch,
#endif
                                    __global float *intensity, ulong intensity_offset, uint intensity_pitch, uint width,
                                    uint height, __local float *column_sums) {
    const uint y = get_global_id(0);
    if (y >= height)
        return;
    // The taps are centred on the pixel; the field is periodic, and no narrower than they.
    const uint first = (PIXEL_TAPS - oversampling) / 2u;
    ulong lines[PIXEL_TAPS];
    float tap[PIXEL_TAPS];
    uint row = (y * oversampling + grid_height - first) % grid_height;
    for (uint j = 0; j < PIXEL_TAPS; ++j) {
        lines[j] = (ulong)row * grid_width;
        tap[j] = taps[j];
        row = row + 1u == grid_height ? 0u : row + 1u;
    }
    for (uint x = 0; x < grid_width; x += LANES) {
        const uint count = min((uint)LANES, grid_width - x);
        lanes_f sum = SPREAD(0.0f);
        for (uint j = 0; j < PIXEL_TAPS; ++j)
            sum = fma(SPREAD(tap[j]), load_some(powers + lines[j] + x, count), sum);
        store_local_f(sum, column_sums + first + x); // beyond the line's end the next loops write
    }
    for (uint i = 0; i < first; ++i)
        column_sums[i] = column_sums[grid_width + i];
    for (uint i = first; i < PIXEL_TAPS; ++i)
        column_sums[grid_width + i] = column_sums[i];
    for (uint x = 0; x < width; x += LANES) {
        const uint count = min((uint)LANES, width - x);
        lanes_f sum = SPREAD(0.0f);
        if (oversampling == 1) {
            for (uint i = 0; i < PIXEL_TAPS; ++i)
                sum = fma(SPREAD(tap[i]), load_local_f(column_sums + x + i), sum);
        } else {
            float sums[LANES];
            for (uint lane = 0; lane < LANES; ++lane) {
                sums[lane] = 0.0f;
                for (uint i = 0; i < PIXEL_TAPS && lane < count; ++i)
                    sums[lane] = fma(tap[i], column_sums[(x + lane) * oversampling + i], sums[lane]);
            }
            sum = vload_lanes(0, sums);
        }
        // The taps stand for an integral, whose value cannot fall below 0; theirs can, by a rounding's worth at dark
        // places.
        sum = fmax(sum, SPREAD(0.0f)) * SPREAD(weight);
#if ACCUMULATE
        sum += load_some(before + before_offset + (ulong)y * before_pitch + x, count);
#endif
        store_some(sum, intensity + intensity_offset + (ulong)y * intensity_pitch + x, count);
    }
}

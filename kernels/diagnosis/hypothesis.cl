// A hypothesis that was given as OpenCL source, over a frame. What includes this has hypothesis_values and
// HYPOTHESIS_VALUES before it, and the caller's text behind it.
#include "diagnosis/hypothesis.h"

float hypothesis(hypothesis_frame frame, hypothesis_values values, uint x, uint y);

__kernel void hypothesis_apply(__global const float *pixels, __global float *changed, uint width, uint height,
                               uint bits, uint sequence, uint scene, uint moving, uint frame_index, ulong seed,
                               uint number, float f_number, float pixel_pitch_m, float wavelength_m, float4 values) {
    const uint x = get_global_id(0), y = get_global_id(1);
    if (x >= width || y >= height)
        return;
    const hypothesis_frame frame = {pixels, width,  height,   bits,          sequence,    scene, moving, frame_index,
                                    seed,   number, f_number, pixel_pitch_m, wavelength_m};
    const hypothesis_values of_hypothesis = HYPOTHESIS_VALUES(values);
    changed[y * width + x] = hypothesis(frame, of_hypothesis, x, y);
}

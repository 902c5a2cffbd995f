// What the OpenCL source of a hypothesis sees: a frame, and random numbers. docs/method/diagnosis.md tells users of it.
#ifndef CLSP_HYPOTHESIS_H
#define CLSP_HYPOTHESIS_H

#include "common/philox.h"

// As in the C interface (capture.h).
#define CLSP_SCENE_DARK 0u
#define CLSP_SCENE_FLAT 1u
#define CLSP_SCENE_BOARD 2u
#define CLSP_SCENE_DOTS 3u

typedef struct {
    __global const float *pixels; // height x width, row by row, as they were before this hypothesis
    uint width, height, bits;
    uint sequence, scene, moving, frame_index;
    ulong seed;  // of the simulated capture
    uint number; // 16 bits of the hypothesis: each has random numbers of its own
    float f_number, pixel_pitch_m, wavelength_m;
} hypothesis_frame;

// The pixel as it was; beyond the border the nearest one inside.
static inline float hypothesis_pixel(hypothesis_frame frame, int x, int y) {
    const uint column = (uint)clamp(x, 0, (int)frame.width - 1), row = (uint)clamp(y, 0, (int)frame.height - 1);
    return frame.pixels[row * frame.width + column];
}

// Columns and rows have 16 bits each; what is above them tells hypotheses apart.
static inline float hypothesis_normal_of(hypothesis_frame frame, uint x, uint y, uint frame_low, uint frame_high,
                                         uint stream) {
    const uint2 key = {(uint)frame.seed, (uint)(frame.seed >> 32)};
    return normals_from_block(image_block(x, (y & 0xffffu) | frame.number << 16, frame_low, frame_high, stream, key))
        .n0;
}

// A standard normal number of the pixel (x, y); another one in every frame and sequence, and for every draw, 0 to 15.
static inline float hypothesis_normal(hypothesis_frame frame, uint x, uint y, uint draw) {
    return hypothesis_normal_of(frame, x, y, frame.frame_index, frame.sequence, STREAM_HYPOTHESIS + (draw & 15u));
}

// The same one in all frames of a capture: a pattern that belongs to the camera.
static inline float hypothesis_fixed_normal(hypothesis_frame frame, uint x, uint y, uint draw) {
    return hypothesis_normal_of(frame, x, y, 0u, 0u, STREAM_HYPOTHESIS_FIXED + (draw & 15u));
}

#endif

// One sample of the field that leaves the surface towards the lens: U = sqrt(I0) z, with what the surface, the laser's
// lines and the air do to it. The equations are in aperture.h and pipeline.h of the C API.
//   MATERIALS 1  a table says for each pixel's material how much of the light stays coherent and how it is polarized
//   COHERENT 1   the same coherent fraction everywhere (MATERIALS 0)
//   LINES 1      one of several laser lines: the phase turns by k s h, h the surface's height
//   SCREEN 1     a phase screen in front of the surface (airflow)
//   PADDED 1     the field grid is larger than the image's samples
#ifndef CLSP_FIELD_SAMPLE_H
#define CLSP_FIELD_SAMPLE_H

#include "common/field_grid.h"
#include "stages/phase_state.h"
#include "common/phasor.h"

// What kernels that make the field are given for it, and how they hand it on: with the oversampling as they know it,
// best a constant.
#if MATERIALS
#define FIELD_SURFACE_PARAMETERS                                                                                       \
    , __global const uchar *material, ulong material_offset, uint material_pitch, uint material_count,                 \
        __global const float *table, __global uint *bad_material
#define FIELD_SURFACE_ARGUMENTS , material, material_offset, material_pitch, material_count, table, bad_material
#elif COHERENT
#define FIELD_SURFACE_PARAMETERS , float random_amplitude, float coherent_amplitude
#define FIELD_SURFACE_ARGUMENTS , random_amplitude, coherent_amplitude
#else
#define FIELD_SURFACE_PARAMETERS
#define FIELD_SURFACE_ARGUMENTS
#endif
#if LINES
#define FIELD_LINE_PARAMETERS , float line_turns, __global const float *heights
#define FIELD_LINE_ARGUMENTS , line_turns, heights
#else
#define FIELD_LINE_PARAMETERS
#define FIELD_LINE_ARGUMENTS
#endif
#if SCREEN
#define FIELD_SCREEN_PARAMETERS , __global const float *screen
#define FIELD_SCREEN_ARGUMENTS , screen
#else
#define FIELD_SCREEN_PARAMETERS
#define FIELD_SCREEN_ARGUMENTS
#endif
#define FIELD_PARAMETERS                                                                                               \
    __global const state_word *state, ulong samples, ulong first, uint grid_width, uint grid_height,                   \
        uint polarization, __global const float *irradiance, ulong irradiance_offset, uint irradiance_pitch,           \
        uint width, uint height,                                                                                       \
        uint oversampling FIELD_SURFACE_PARAMETERS FIELD_LINE_PARAMETERS FIELD_SCREEN_PARAMETERS
#define FIELD_ARGUMENTS(samples_per_pixel)                                                                             \
    state, samples, first, grid_width, grid_height, polarization, irradiance, irradiance_offset, irradiance_pitch,     \
        width, height, samples_per_pixel FIELD_SURFACE_ARGUMENTS FIELD_LINE_ARGUMENTS FIELD_SCREEN_ARGUMENTS

// Without padding every sample belongs to the pixel that it lies in.
#if PADDED
#define FIELD_PIXEL_X(x) pixel_of_sample((uint)(x), oversampling, width, grid_width)
#define FIELD_PIXEL_Y(y) pixel_of_sample(y, oversampling, height, grid_height)
#else
#define FIELD_PIXEL_X(x) ((x) / oversampling)
#define FIELD_PIXEL_Y(y) ((y) / oversampling)
#endif

// What is read for a sample, as it is.
typedef struct {
    float irradiance;
    complex_float z;
#if MATERIALS
    uint material;
#endif
} field_input_t;

static inline ALWAYS_INLINE field_input_t field_input(FIELD_PARAMETERS, size_t x, uint y) {
    const size_t pixel_x = FIELD_PIXEL_X(x);
    const uint pixel_y = FIELD_PIXEL_Y(y);
    field_input_t input;
    input.irradiance = (irradiance + (irradiance_offset + (ulong)pixel_y * irradiance_pitch))[pixel_x];
    input.z = unit_field(state, samples, first, (ulong)y * grid_width + x);
#if MATERIALS
    input.material = material[material_offset + (ulong)pixel_y * material_pitch + pixel_x];
#endif
    return input;
}

// Neither negative nor infinite nor NaN: the bits of those are larger, once -0 is 0.
static inline ALWAYS_INLINE bool is_irradiance(float value) { return as_uint(value + 0.0f) < 0x7f800000u; }

// Its square root, to 3 ulp from 1e-35 on; below that it falls short. A root that rounds right is a branch on GPUs, and
// so a wait between two reads.
static inline ALWAYS_INLINE float root_of(float irradiance) { return irradiance * rsqrt(fmax(irradiance, 1e-37f)); }

// U of sample (x, y). *wrong becomes 1 if a pixel was no irradiance, or its material not in the table: field_report()
// then tells.
static inline ALWAYS_INLINE complex_float field_value(FIELD_PARAMETERS, field_input_t input, uint *wrong, size_t x,
                                                      uint y) {
    *wrong |= is_irradiance(input.irradiance) ? 0u : 1u;
    float amplitude = root_of(is_irradiance(input.irradiance) ? input.irradiance : 0.0f);
    complex_float z = input.z;
#if MATERIALS
    *wrong |= input.material < material_count ? 0u : 1u;
    // Rows of the table: random and coherent amplitude, amplitudes of the two polarizations.
    __global const float *entry = table + 4u * (input.material < material_count ? input.material : 0u);
    z.re = entry[0] * z.re + entry[1];
    z.im = entry[0] * z.im;
    amplitude *= entry[2u + polarization];
#elif COHERENT
    z.re = random_amplitude * z.re + coherent_amplitude;
    z.im = random_amplitude * z.im;
#endif
    complex_float u = {amplitude * z.re, amplitude * z.im};
#if LINES || SCREEN
    const ulong i = (ulong)y * grid_width + x;
    float turns = 0.0f;
#if LINES
    turns += line_turns * heights[i]; // surface_heights.cl
#endif
#if SCREEN
    turns += screen[i];
#endif
    u = product(u, phasor_from_turns(turns));
#endif
    return u;
}

// Counts what is wrong with the pixel of sample (x, y). bad: where pixels that are no irradiance are counted.
static inline ALWAYS_INLINE void field_report(FIELD_PARAMETERS, __global uint *bad, uint x, uint y) {
    const uint pixel_x = FIELD_PIXEL_X(x), pixel_y = FIELD_PIXEL_Y(y);
    // Several samples, the padding and the second polarization share a pixel: what is wrong with it is counted once.
    if (polarization != 0 || x != oversampling * pixel_x || y != oversampling * pixel_y)
        return;
    const uint index = pixel_y * width + pixel_x;
    const float i0 = irradiance[irradiance_offset + (ulong)pixel_y * irradiance_pitch + pixel_x];
    if (!is_irradiance(i0))
        report_bad(bad, i0, index);
#if MATERIALS
    if (material[material_offset + (ulong)pixel_y * material_pitch + pixel_x] >= material_count)
        report_bad(bad_material, -1.0f, index);
#endif
}

#endif

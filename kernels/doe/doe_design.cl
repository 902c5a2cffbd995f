// Iterative Fourier transform algorithm for beam splitters: the steps between the Fourier transforms, and the map of
// what each change of one pixel would do. Orders are few and pixels many; sums over orders are left in `partials` sums
// that every reader adds in the same order, so that a result does not depend on how work-groups are scheduled.
#include "common/common.h"

// The field of the far plane before the orders are put in.
__kernel void doe_design_clear(__global float2 *field, uint count) {
    const uint i = get_global_id(0);
    if (i < count)
        field[i] = (float2)(0.0f, 0.0f);
}

// What the orders have become: unit phasor, amplitude relative to the wanted one, and per work-item the sums of that
// amplitude, of its square, of its fourth power and of the powers behind the pixels' envelope; in `turned` its product
// with the one before.
__kernel void doe_design_measure(__global const float2 *field, __global const uint *bins, __global const float *wanted,
                                 uint count, __global const float *envelope_power, float scale, uint keep_phase,
                                 __global float2 *phasors, __global float *relative, __global float4 *partial,
                                 __global float *turned) {
    const uint item = get_global_id(0), items = get_global_size(0);
    float4 sum = (float4)(0.0f, 0.0f, 0.0f, 0.0f);
    float product = 0.0f;
    for (uint k = item; k < count; k += items) {
        const float re = field[bins[k]].x * scale, im = field[bins[k]].y * scale;
        const float amplitude = sqrt(re * re + im * im);
        if (!keep_phase)
            phasors[k] = amplitude > 0.0f ? (float2)(re / amplitude, im / amplitude) : (float2)(1.0f, 0.0f);
        const float ratio = amplitude / wanted[k];
        product += ratio * relative[k];
        relative[k] = ratio;
        sum.x += ratio;
        sum.y += ratio * ratio;
        sum.z += ratio * ratio * ratio * ratio;
        sum.w += amplitude * amplitude * envelope_power[k];
    }
    partial[item] = sum;
    turned[item] = product;
}

// The weights' next values. ratio: amplitude over wanted amplitude, relative to its mean over the orders.
//   1 weighted (Di Leonardo et al. 2007), also 3: w <- w ratio^-feedback
//   2 adaptive (Nogrette et al. 2014): w^2 <- w^2 / (1 - feedback (1 - power / mean power))
__kernel void doe_design_weigh(__global const float *relative, __global const float4 *partial, uint partials,
                               uint count, uint rule, float feedback, __global float *weights) {
    const uint k = get_global_id(0);
    if (k >= count)
        return;
    float sum = 0.0f, squares = 0.0f;
    for (uint i = 0; i < partials; ++i) {
        sum += partial[i].x;
        squares += partial[i].y;
    }
    const float ratio = fmax(relative[k] * (float)count / sum, 1e-6f);
    if (rule == 2)
        weights[k] /= sqrt(fmax(1.0f - feedback * (1.0f - relative[k] * relative[k] * (float)count / squares), 1e-3f));
    else if (rule != 0)
        weights[k] *= pow(ratio, -feedback);
}

// Per work-item: the power that the weighted orders would have.
__kernel void doe_design_sum(__global const float *weights, __global const float *wanted, uint count,
                             __global float4 *partial) {
    const uint item = get_global_id(0), items = get_global_size(0);
    float sum = 0.0f;
    for (uint k = item; k < count; k += items) {
        const float amplitude = weights[k] * wanted[k];
        sum += amplitude * amplitude;
    }
    partial[item] = (float4)(sum, 0.0f, 0.0f, 0.0f);
}

// The wanted field of the far plane, scaled so that the field behind the element has a mean square of 1. The weights
// come with it.
__kernel void doe_design_scatter(__global float *weights, __global const float *wanted, __global const float2 *phasors,
                                 __global const uint *bins, __global const float4 *partial, uint partials, uint count,
                                 float pixels, __global float2 *field) {
    const uint k = get_global_id(0);
    if (k >= count)
        return;
    float sum = 0.0f;
    for (uint i = 0; i < partials; ++i)
        sum += partial[i].x;
    const float weight = weights[k] * sqrt((float)count / sum); // keeps the weights from drifting out of float's range
    weights[k] = weight;
    const float amplitude = weight * wanted[k] * pixels * rsqrt((float)count);
    field[bins[k]] = (float2)(amplitude * phasors[k].x, amplitude * phasors[k].y);
}

// The nearest field that the element can have. levels 0: any phase. levels 2: real, +1 or -1, approached through
// clip(gain re, -1, 1). Else: phases within `fraction` of half a step of a level take it, the others stay (Wyrowski
// 1990).
__kernel void doe_design_project(__global float2 *field, uint count, uint levels, float fraction, float gain) {
    const uint i = get_global_id(0);
    if (i >= count)
        return;
    const float re = field[i].x, im = field[i].y;
    float2 t;
    if (levels == 2) {
        t = (float2)(fraction >= 1.0f ? (re < 0.0f ? -1.0f : 1.0f) : clamp(gain * re, -1.0f, 1.0f), 0.0f);
    } else {
        const float amplitude = sqrt(re * re + im * im);
        t = amplitude > 0.0f ? (float2)(re / amplitude, im / amplitude) : (float2)(1.0f, 0.0f);
        if (levels != 0 && fraction > 0.0f) {
            const float step = atan2pi(im, re) * 0.5f * (float)levels, level = rint(step);
            if (fraction >= 1.0f || fabs(step - level) < 0.5f * fraction) {
                const float turns = 2.0f * level / (float)levels;
                t = (float2)(cospi(turns), sinpi(turns));
            }
        }
    }
    field[i] = t;
}

// Direct binary search (Seldowitz et al. 1987), every pixel's step to a neighbouring level at once. The orders'
// amplitudes A_k hold the pixel's envelope, S_k are their wanted powers, and the cost is C = sum (|A_k|^2 - S_k)^2 /
// S_k. A step d of one pixel of N adds d s_k e_k to A_k, s_k being envelope / N and e_k the order's phasor at the
// pixel. The change of C is then
//   Re[d first] + Re[d^2 second] + constant,  |d|^2 = P for every step,
//   first    = sum 4 (|A_k|^2 - S_k + P s_k^2) s_k conj(A_k) e_k / S_k,   second = sum 2 s_k^2 conj(A_k)^2 e_k^2 / S_k,
//   constant = sum [P s_k^2 (4 |A_k|^2 - 2 S_k) + P^2 s_k^4] / S_k:
// two Fourier transforms give it for all pixels. Writes the best level and its change of C; the pixel's own level and 0
// if none is better.
__kernel void doe_design_search(__global const uchar *level, __global const float2 *first,
                                __global const float2 *second, uint count, uint levels, float constant_change,
                                __global uchar *best_level, __global float *change) {
    const uint i = get_global_id(0);
    if (i >= count)
        return;
    const uint now = level[i];
    const float turn = 2.0f / (float)levels;
    uint best = now;
    float least = 0.0f;
    for (uint c = 0; c < 2; ++c) {
        const uint next = c == 0 ? (now + 1u) % levels : (now + levels - 1u) % levels;
        const float re = cospi(turn * (float)next) - cospi(turn * (float)now),
                    im = sinpi(turn * (float)next) - sinpi(turn * (float)now);
        const float value = re * first[i].x - im * first[i].y + (re * re - im * im) * second[i].x -
                            2.0f * re * im * second[i].y + constant_change;
        if (value < least) {
            least = value;
            best = next;
        }
    }
    best_level[i] = (uchar)best;
    change[i] = least;
}

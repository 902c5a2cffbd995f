// The pattern of a diffractive optical element. The equations are in doe.h of the C API.
#include "common/philox.h"

// sin(pi x) / (pi x).
static inline float sinc(float x) {
    return fabs(x) < 1e-4f ? 1.0f : sinpi(x) / (M_PI_F * x);
}

// The phase as manufactured, at `samples` x `samples` points for each pixel. levels 0: as it is;
// else multiples of 2 pi / levels above zero_level, which is taken off: the least phase, wherever a cell that repeats
// begins.
__kernel void doe_height(__global const float *phase, uint width, uint height, uint samples, uint levels,
                         float zero_level, __global float *result) {
    const uint x = get_global_id(0), y = get_global_id(1);
    if (x >= width * samples || y >= height * samples)
        return;
    float value = phase[(ulong)(y / samples) * width + x / samples];
    if (levels != 0u) {
        const float step = 2.0f * M_PI_F / convert_float(levels);
        float turn = (value - zero_level) / (2.0f * M_PI_F);
        turn -= floor(turn);
        float level = floor(turn * convert_float(levels) + 0.5f);
        if (level >= convert_float(levels))
            level = 0.0f;
        value = level * step;
    }
    result[(ulong)y * (width * samples) + x] = value;
}

// A Gaussian blur along one axis: taps 0 .. radius, which together with their mirror images sum to 1. wrap: the design
// repeats.
__kernel void doe_blur(__global const float *from, uint width, uint height, uint along_y, uint wrap,
                       __global const float *taps, uint radius, __global float *to) {
    const uint x = get_global_id(0), y = get_global_id(1);
    if (x >= width || y >= height)
        return;
    const int length = along_y ? (int)height : (int)width, position = along_y ? (int)y : (int)x;
    float sum = taps[0] * from[(ulong)y * width + x];
    for (int k = 1; k <= (int)radius; ++k)
        for (int side = -1; side <= 1; side += 2) {
            int at = position + side * k;
            at = wrap ? (at % length + length) % length : clamp(at, 0, length - 1);
            const ulong index = along_y ? (ulong)at * width + x : (ulong)y * width + (uint)at;
            sum = fma(taps[k], from[index], sum);
        }
    to[(ulong)y * width + x] = sum;
}

// The field behind the element. offset: the sample of the design at the field's first one; a design that repeats is
// taken modulo its size, any other is dark outside. beam (APERTURE only): amplitudes on side x side points over
// beam_scale.s01 samples about the field's centre; the element ends at beam_scale.s23. noise: RMS of each pixel's own
// phase error. shift: the field is turned by exp(-2 pi i (a x / width + b y / height)), (a, b) = shift.
__kernel void doe_field(__global const float *design, uint design_width, uint design_height, uint samples, int offset_x,
                        int offset_y, uint repeats, float phase_scale,
#if HAS_BEAM
                        __global const float *beam, uint side, float4 beam_scale, float noise, uint2 key, float2 shift,
#endif
                        uint width, uint height, __global float *field) {
    const uint x = get_global_id(0), y = get_global_id(1);
    if (x >= width || y >= height)
        return;
    int dx = (int)x + offset_x, dy = (int)y + offset_y;
    float amplitude = 1.0f;
    if (repeats) {
        dx = (dx % (int)design_width + (int)design_width) % (int)design_width;
        dy = (dy % (int)design_height + (int)design_height) % (int)design_height;
    } else if (dx < 0 || dy < 0 || dx >= (int)design_width || dy >= (int)design_height) {
        amplitude = 0.0f;
        dx = dy = 0;
    }
    float angle = phase_scale * design[(ulong)dy * design_width + (uint)dx];
#if HAS_BEAM
    // Points of the beam's table, corners on its edges.
    const float bx =
        ((convert_float(x) + 0.5f - 0.5f * convert_float(width)) / beam_scale.x + 0.5f) * convert_float(side - 1u);
    const float by =
        ((convert_float(y) + 0.5f - 0.5f * convert_float(height)) / beam_scale.y + 0.5f) * convert_float(side - 1u);
    const float limit_x = 0.5f * beam_scale.z, limit_y = 0.5f * beam_scale.w; // half the DOE, in samples
    const float px = fabs(convert_float(x) + 0.5f - 0.5f * convert_float(width));
    const float py = fabs(convert_float(y) + 0.5f - 0.5f * convert_float(height));
    if (bx >= 0.0f && by >= 0.0f && bx <= convert_float(side - 1u) && by <= convert_float(side - 1u) && px <= limit_x &&
        py <= limit_y) {
        const uint ix = min((uint)bx, side - 2u), iy = min((uint)by, side - 2u);
        const float ax = bx - convert_float(ix), ay = by - convert_float(iy);
        __global const float *row = beam + iy * side + ix;
        amplitude *= mix(mix(row[0], row[1], ax), mix(row[side], row[side + 1u], ax), ay);
    } else {
        amplitude = 0.0f;
    }
    if (noise > 0.0f) {
        // One number for each pixel of the element, of the first normal of its own block.
        const words4 block = image_block(x / samples, y / samples, 0u, 0u, STREAM_ETCH_NOISE, key);
        angle = fma(noise, normals_from_block(block).n0, angle);
    }
    angle -=
        2.0f * M_PI_F *
        fma(shift.x, convert_float(x) / convert_float(width), shift.y * (convert_float(y) / convert_float(height)));
#endif
    const ulong index = (ulong)y * width + x;
    field[2ul * index] = amplitude * cos(angle);
    field[2ul * index + 1ul] = amplitude * sin(angle);
}

// |c|^2 times `scale` of every bin.
__kernel void doe_order_power(__global const float *field, uint width, uint height, float scale,
                              __global float *power) {
    const uint x = get_global_id(0), y = get_global_id(1);
    if (x >= width || y >= height)
        return;
    const ulong index = (ulong)y * width + x;
    const float re = field[2ul * index], im = field[2ul * index + 1ul];
    power[index] = scale * fma(re, re, im * im);
}

// The integral of a piecewise constant law up to x, as a combination of the sums at the nodes below and above; sign: -1
// at the beginning of an interval.
static inline void node_weights(float x, int nodes, float sign, int at[2], float weights[2]) {
    const float cx = clamp(x, 0.0f, convert_float(nodes - 1));
    at[0] = min((int)cx, nodes - 2);
    at[1] = at[0] + 1;
    const float f = cx - convert_float(at[0]);
    weights[0] = sign * (1.0f - f);
    weights[1] = sign * f;
}

// What a spot has between nodes x0 and x1, y0 and y1, in the table's units. Weights of an axis sum to 0, so that sums
// may be counted from the first node on: exact integers, of which nothing negative comes.
static inline float spot_part(__global const uint *table, int nodes_x, int nodes_y, float x0, float x1, float y0,
                              float y1) {
    int ex[4], ey[4];
    float ax[4], ay[4];
    node_weights(x0, nodes_x, -1.0f, ex, ax);
    node_weights(x1, nodes_x, 1.0f, ex + 2, ax + 2);
    node_weights(y0, nodes_y, -1.0f, ey, ay);
    node_weights(y1, nodes_y, 1.0f, ey + 2, ay + 2);
    __global const uint *first = table + ey[0] * nodes_x;
    uint base[4];
    for (int i = 0; i < 4; ++i)
        base[i] = first[ex[i]] - first[ex[0]];
    float sum = 0.0f;
    for (int j = 1; j < 4; ++j) {
        __global const uint *line = table + ey[j] * nodes_x;
        const uint start = line[ex[0]];
        float row = 0.0f;
        for (int i = 1; i < 4; ++i)
            row = fma(ax[i], convert_float(line[ex[i]] - start - base[i]), row);
        sum = fma(ay[j], row, sum);
    }
    return fmax(0.0f, sum);
}

static inline int modulo(int k, int n) { return (k % n + n) % n; }

// Adds the orders' spots to the texels. In units of texels: axis = where order (0, 0) lies, spacing = from order to
// order, node = from node to node of the spot's table (s0 to s5). envelope: order m is damped by sinc^2(m / columns),
// and all orders count; without it only those within the sampling limit. From row first_row on.
__kernel void doe_add_orders(__global const float *power, int columns, int rows, __global const uint *table,
                             int nodes_x, int nodes_y, float8 scale, float weight, uint envelope, uint first_row,
                             uint width, uint height, __global float *texels) {
    const uint i = get_global_id(0), j = first_row + get_global_id(1);
    if (i >= width || j >= height)
        return;
    const float axis_x = scale.s0, axis_y = scale.s1, spacing_x = scale.s2, spacing_y = scale.s3, node_x = scale.s4,
                node_y = scale.s5;
    const float middle_x = 0.5f * convert_float(nodes_x - 1), middle_y = 0.5f * convert_float(nodes_y - 1);
    const float reach_x = middle_x * node_x, reach_y = middle_y * node_y;
    const float x0 = convert_float(i), y0 = convert_float(j);
    int m0 = (int)ceil((x0 - reach_x - axis_x) / spacing_x),
        m1 = (int)floor((x0 + 1.0f + reach_x - axis_x) / spacing_x);
    int n0 = (int)ceil((y0 - reach_y - axis_y) / spacing_y),
        n1 = (int)floor((y0 + 1.0f + reach_y - axis_y) / spacing_y);
    if (!envelope) {
        m0 = max(m0, -(columns / 2));
        m1 = min(m1, (columns - 1) / 2);
        n0 = max(n0, -(rows / 2));
        n1 = min(n1, (rows - 1) / 2);
    }
    float sum = 0.0f;
    for (int n = n0; n <= n1; ++n) {
        const float cy = fma(convert_float(n), spacing_y, axis_y);
        const float ya = (y0 - cy) / node_y + middle_y, yb = (y0 + 1.0f - cy) / node_y + middle_y;
        const float fy = envelope ? sinc(convert_float(n) / convert_float(rows)) : 1.0f;
        __global const float *line = power + (ulong)modulo(n, rows) * (uint)columns;
        for (int m = m0; m <= m1; ++m) {
            const float cx = fma(convert_float(m), spacing_x, axis_x);
            const float xa = (x0 - cx) / node_x + middle_x, xb = (x0 + 1.0f - cx) / node_x + middle_x;
            const float fx = envelope ? sinc(convert_float(m) / convert_float(columns)) : 1.0f;
            const float part = spot_part(table, nodes_x, nodes_y, xa, xb, ya, yb);
            sum = fma(line[modulo(m, columns)] * fx * fx * fy * fy, part, sum);
        }
    }
    const ulong index = (ulong)j * width + i;
    texels[index] = fma(weight, sum, texels[index]);
}

// Adds the samples of an aperture's transform to the texels. Bin k lies at k + shift (in bins), holds what is within
// +-half_width of it, and repeats with the period of the transform under the pixel's envelope. scale: bins per texel
// along x and y; bin 0 is in the image's centre.
__kernel void doe_add_samples(__global const float *field, int columns, int rows, float2 scale, float2 shift,
                              float half_width, float weight, float2 envelope_scale, uint envelope, uint width,
                              uint height, __global float *texels) {
    const uint i = get_global_id(0), j = get_global_id(1);
    if (i >= width || j >= height)
        return;
    // Edges in bins.
    const float half_x = 0.5f * convert_float(width), half_y = 0.5f * convert_float(height);
    const float x0 = (convert_float(i) - half_x) * scale.x, x1 = (convert_float(i + 1u) - half_x) * scale.x;
    const float y0 = (convert_float(j) - half_y) * scale.y, y1 = (convert_float(j + 1u) - half_y) * scale.y;
    int m0 = (int)ceil(x0 - half_width - shift.x), m1 = (int)floor(x1 + half_width - shift.x);
    int n0 = (int)ceil(y0 - half_width - shift.y), n1 = (int)floor(y1 + half_width - shift.y);
    if (!envelope) {
        m0 = max(m0, -(columns / 2));
        m1 = min(m1, (columns - 1) / 2);
        n0 = max(n0, -(rows / 2));
        n1 = min(n1, (rows - 1) / 2);
    }
    const float inverse = 0.5f / half_width;
    float sum = 0.0f;
    for (int n = n0; n <= n1; ++n) {
        const float cy = convert_float(n) + shift.y;
        const float fy = envelope ? sinc(cy * envelope_scale.y) : 1.0f;
        const float wy = fmax(0.0f, fmin(y1, cy + half_width) - fmax(y0, cy - half_width)) * inverse * fy * fy;
        __global const float *line = field + 2ul * (ulong)modulo(n, rows) * (uint)columns;
        float row = 0.0f;
        for (int m = m0; m <= m1; ++m) {
            const float cx = convert_float(m) + shift.x;
            const float fx = envelope ? sinc(cx * envelope_scale.x) : 1.0f;
            const float wx = fmax(0.0f, fmin(x1, cx + half_width) - fmax(x0, cx - half_width)) * inverse * fx * fx;
            const int at = 2 * modulo(m, columns);
            row = fma(wx, fma(line[at], line[at], line[at + 1] * line[at + 1]), row);
        }
        sum = fma(wy, row, sum);
    }
    const ulong index = (ulong)j * width + i;
    texels[index] = fma(weight, sum, texels[index]);
}

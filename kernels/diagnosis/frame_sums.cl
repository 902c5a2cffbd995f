// Sums over the pixels of every frame of a captured sequence, for the diagnosis (diagnosis/statistics/device_sums.cpp).
// Each row is summed by sixteen work-items, in single precision, work-item k taking the pixels k, k + 16, ...; the
// first one adds the sixteen up in double precision, and what is left of the row: the order, and so the bits, of the
// host's sums (sums.cpp).
#include "common/common.h"
#pragma OPENCL EXTENSION cl_khr_fp64 : enable

#define LANES 16
#define ROWS 4
#define WORK_GROUP_SIZE __attribute__((reqd_work_group_size(LANES * ROWS, 1, 1)))

// The lanes of one row of the work-group, one after the other.
static inline double lane_total(__local const float *lanes) {
    double total = 0.0;
    for (uint k = 0; k < LANES; ++k)
        total += lanes[k];
    return total;
}

// How often each code occurs, and the sum of each row of each frame. histogram: zeros; masked pixels do not count.
__kernel WORK_GROUP_SIZE void frame_sums_count(__global const ushort *codes, __global const float *weight,
                                               uint is_masked, uint width, uint height, uint last,
                                               __global uint *histogram, __global uint *row_sums) {
    __local uint partial[ROWS][LANES];
    const uint lane = get_local_id(0) % LANES, row = get_local_id(0) / LANES, y = get_global_id(0) / LANES,
               frame = get_global_id(1);
    uint sum = 0;
    if (y < height) {
        __global const ushort *of_row = codes + ((ulong)frame * height + y) * width;
        for (uint x = lane; x < width; x += LANES) {
            if (is_masked && weight[y * width + x] == 0.0f)
                continue;
            sum += of_row[x];
            atomic_inc(&histogram[min((uint)of_row[x], last)]);
        }
    }
    partial[row][lane] = sum;
    barrier(CLK_LOCAL_MEM_FENCE);
    if (lane == 0 && y < height) {
        uint total = 0;
        for (uint k = 0; k < LANES; ++k)
            total += partial[row][k];
        row_sums[frame * height + y] = total;
    }
}

// One pixel of all frames: its mean over time, residuals and their variance (make_row() of host_sums.cpp). shifts:
// offsets + pivot.
__kernel void frame_sums_residuals(__global const ushort *codes, __global const float *weight, uint is_masked,
                                   uint pixels, uint frames, float black, float pivot, __global const float *scales,
                                   __global const float *offsets, __global const float *shifts, uint clipping,
                                   uint any_clip, float share, float unbiased, __global float *residual,
                                   __global float *mean, __global float *variance) {
    const uint i = get_global_id(0);
    if (i >= pixels)
        return;
    float centred = 0.0f;
    uint highest = 0;
    for (uint t = 0; t < frames; ++t) {
        const uint code = codes[(ulong)t * pixels + i];
        highest = max(highest, code);
        centred += scales[t] * ((float)code - black) - shifts[t];
    }
    centred *= share;
    float at = centred + pivot;
    const bool clips = any_clip && highest >= clipping;
    if (clips) {
        float total = 0.0f;
        uint kept = 0;
        for (uint t = 0; t < frames; ++t) {
            const uint code = codes[(ulong)t * pixels + i];
            if (code < clipping) {
                total += scales[t] * ((float)code - black) - offsets[t] - pivot;
                ++kept;
            }
        }
        if (kept) {
            // Rounded once, where a device's own division of floats may not be.
            centred = (float)((double)total / (double)kept);
            at = centred + pivot;
        }
    }
    const float used = is_masked ? weight[i] : 1.0f;
    if (frames > 1) {
        float squares = 0.0f;
        for (uint t = 0; t < frames; ++t) {
            const uint code = codes[(ulong)t * pixels + i];
            float value = scales[t] * ((float)code - black) - shifts[t] - centred;
            if (is_masked)
                value *= used;
            if (clips && code >= clipping)
                value = 0.0f;
            squares += value * value;
            residual[(ulong)t * pixels + i] = value;
        }
        variance[i] = squares * unbiased;
    }
    mean[i] = is_masked ? at * used : at;
}

// Of each row of each image the sums of its values, their squares, cubes and fourth powers.
__kernel WORK_GROUP_SIZE void frame_sums_powers(__global const float *images, uint pixels, uint width, uint rows,
                                          __global double4 *powers) {
    __local float partial[4][ROWS][LANES];
    const uint lane = get_local_id(0) % LANES, row = get_local_id(0) / LANES, y = get_global_id(0) / LANES,
               image = get_global_id(1);
    __global const float *values = images + (ulong)image * pixels + (ulong)y * width;
    const uint whole = width / LANES * LANES;
    float s1 = 0.0f, s2 = 0.0f, s3 = 0.0f, s4 = 0.0f;
    if (y < rows)
        for (uint x = lane; x < whole; x += LANES) {
            const float value = values[x], squared = value * value;
            s1 += value;
            s2 += squared;
            s3 += squared * value;
            s4 += squared * squared;
        }
    partial[0][row][lane] = s1;
    partial[1][row][lane] = s2;
    partial[2][row][lane] = s3;
    partial[3][row][lane] = s4;
    barrier(CLK_LOCAL_MEM_FENCE);
    if (lane != 0 || y >= rows)
        return;
    double4 total = (double4)(0.0);
    for (uint x = whole; x < width; ++x) {
        const double value = values[x], squared = value * value;
        total += (double4)(value, squared, squared * value, squared * squared);
    }
    powers[(ulong)image * rows + y] = total + (double4)(lane_total(partial[0][row]), lane_total(partial[1][row]),
                                                        lane_total(partial[2][row]), lane_total(partial[3][row]));
}

// One of the host's RowProduct (device_sums.cpp): in frame t the rows a of image a + t a_step, from (ax, ay) on, times
// the rows b.
typedef struct {
    uint a, a_step, b, b_step;
    uint weight; // image that a is multiplied with first, plus 1; 0: none
    uint ax, ay, bx, by, width, rows, row_step, frames;
    uint lopsided; // a b (a - b) instead of a b
} row_product;

__kernel WORK_GROUP_SIZE void frame_sums_products(__global const float *images, uint pixels, uint pitch,
                                            __global const row_product *products, uint most_rows,
                                            __global double *values) {
    __local float partial[ROWS][LANES];
    const uint lane = get_local_id(0) % LANES, row = get_local_id(0) / LANES, y = get_global_id(0) / LANES;
    const uint frame = get_global_id(1), number = get_global_id(2), most_frames = get_global_size(1);
    const row_product product = products[number];
    const bool is_there = frame < product.frames && y < product.rows;
    const ulong line = (ulong)y * product.row_step;
    const ulong at_a = (line + product.ay) * pitch + product.ax;
    __global const float *a = images + (ulong)(product.a + frame * product.a_step) * pixels + at_a;
    __global const float *b = images + (ulong)(product.b + frame * product.b_step) * pixels +
                              (line + product.by) * pitch + product.bx;
    __global const float *weight = images + (ulong)(product.weight ? product.weight - 1 : 0) * pixels + at_a;
    const uint whole = product.width / LANES * LANES;
    float sum = 0.0f;
    if (is_there) {
        if (product.lopsided) {
            for (uint x = lane; x < whole; x += LANES)
                sum += a[x] * b[x] * (a[x] - b[x]);
        } else if (product.weight) {
            for (uint x = lane; x < whole; x += LANES)
                sum += a[x] * weight[x] * b[x];
        } else {
            for (uint x = lane; x < whole; x += LANES)
                sum += a[x] * b[x];
        }
    }
    partial[row][lane] = sum;
    barrier(CLK_LOCAL_MEM_FENCE);
    if (lane != 0 || !is_there)
        return;
    double total = 0.0;
    for (uint x = whole; x < product.width; ++x) {
        if (product.lopsided)
            total += (double)a[x] * b[x] * (a[x] - b[x]);
        else if (product.weight)
            total += (double)(a[x] * weight[x]) * b[x];
        else
            total += (double)a[x] * b[x];
    }
    values[((ulong)number * most_frames + frame) * most_rows + y] = total + lane_total(partial[row]);
}

// Sums of each column of each image.
__kernel void frame_sums_columns(__global const float *images, uint width, uint height, __global float *columns) {
    const uint x = get_global_id(0), image = get_global_id(1);
    if (x >= width)
        return;
    __global const float *values = images + (ulong)image * width * height;
    float total = 0.0f;
    for (uint y = 0; y < height; ++y)
        total += values[(ulong)y * width + x];
    columns[image * width + x] = total;
}

// Sums of BIN x BIN pixels, columns first.
__kernel void frame_sums_bins(__global const float *images, uint pixels, uint width, uint bins_x, uint bins_y,
                              __global float *bins) {
    const uint bx = get_global_id(0), by = get_global_id(1), image = get_global_id(2);
    if (bx >= bins_x || by >= bins_y)
        return;
    __global const float *values = images + (ulong)image * pixels;
    float total = 0.0f;
    for (uint k = 0; k < BIN; ++k) {
        float column = 0.0f;
        for (uint y = 0; y < BIN; ++y)
            column += values[(ulong)(by * BIN + y) * width + bx * BIN + k];
        total += column;
    }
    bins[((ulong)image * bins_y + by) * bins_x + bx] = total;
}

// Sums of absolute differences of neighbours, both unmasked: of each column to the one at its right, of each row to the
// one below.
__kernel void frame_sums_edge_columns(__global const ushort *codes, __global const float *weight, uint is_masked,
                                      uint width, uint height, __global uint *columns) {
    const uint x = get_global_id(0), frame = get_global_id(1);
    if (x + 1 >= width)
        return;
    uint total = 0;
    for (uint y = 0; y < height; ++y) {
        const uint i = y * width + x;
        if (is_masked && weight[i] * weight[i + 1] == 0.0f)
            continue;
        __global const ushort *code = codes + (ulong)frame * width * height + i;
        total += abs_diff(code[1], code[0]);
    }
    columns[frame * (width - 1) + x] = total;
}
__kernel WORK_GROUP_SIZE void frame_sums_edge_rows(__global const ushort *codes, __global const float *weight,
                                                   uint is_masked, uint width, uint height, __global uint *rows) {
    __local uint partial[ROWS][LANES];
    const uint lane = get_local_id(0) % LANES, row = get_local_id(0) / LANES, y = get_global_id(0) / LANES,
               frame = get_global_id(1);
    uint sum = 0;
    if (y + 1 < height)
        for (uint x = lane; x < width; x += LANES) {
            const uint i = y * width + x;
            if (is_masked && weight[i] * weight[i + width] == 0.0f)
                continue;
            __global const ushort *code = codes + (ulong)frame * width * height + i;
            sum += abs_diff(code[width], code[0]);
        }
    partial[row][lane] = sum;
    barrier(CLK_LOCAL_MEM_FENCE);
    if (lane != 0 || y + 1 >= height)
        return;
    uint total = 0;
    for (uint k = 0; k < LANES; ++k)
        total += partial[row][k];
    rows[frame * (height - 1) + y] = total;
}

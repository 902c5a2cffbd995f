// Dots of a frame: found by a matched filter, their centres by least squares, all dots at once. The equations are in
// depth.h of the C API. WINDOW: half the side of a dot's window in pixels.
#include "common/pixel.h"

#define SIDE (2 * WINDOW + 1)
#define PIXELS (SIDE * SIDE)
#define PARAMETERS 7   // amplitude, x, y, p_xx, p_xy, p_yy, background
#define STATE 8        // floats per dot between passes: the parameters, and 1 if they are a fit's
#define RESULT 20      // floats per dot that the host reads
#define EXCLUDED 3e38f // in place of a pixel that does not count

// Of dot_detector.cpp.
#define FLAG_SATURATED 1u
#define FLAG_BORDER 2u
#define FLAG_MERGED 4u
#define FLAG_FIT_FAILED 8u
#define FLAG_FIXED_SHAPE 16u

static inline float pixel_at(__global const pixel_t *image, ulong offset, uint pitch, int x, int y) {
    const float value = convert_float(image[offset + (ulong)y * pitch + x]);
    return isfinite(value) ? value : 0.0f;
}

// counters: dots found, then what report_bad() counts.
__kernel void dot_detector_reset(__global uint *counters) {
    const uint i = get_global_id(0);
    if (i < 4)
        counters[i] = i == 3 ? 0xffffffffu : 0u;
}

// Along a row: the sum with Gaussian weights, and the plain sum. Beyond the border the last pixel counts on.
__kernel void dot_detector_rows(__global const pixel_t *image, ulong image_offset, uint image_pitch, int width,
                                int height, __global const float *weights, int radius, __global float *weighted,
                                __global float *plain, __global uint *counters) {
    const int x = get_global_id(0), y = get_global_id(1);
    if (x >= width || y >= height)
        return;
    const float own = convert_float(image[image_offset + (ulong)y * image_pitch + x]);
    if (!isfinite(own))
        report_bad(counters + 1, own, y * width + x);
    float sum = 0.0f, total = 0.0f;
    for (int k = -radius; k <= radius; ++k) {
        const float value = pixel_at(image, image_offset, image_pitch, clamp(x + k, 0, width - 1), y);
        sum = fma(weights[k + radius], value, sum);
        total += value;
    }
    weighted[(ulong)y * width + x] = sum;
    plain[(ulong)y * width + x] = total;
}

// The amplitude of the expected dot on an even background that fits best around each pixel: with g the dot, n pixels
// and energy S = sum g^2 - (sum g)^2 / n, A = (sum g I - mean(g) sum I) / S.
__kernel void dot_detector_columns(__global const float *weighted, __global const float *plain, int width, int height,
                                   __global const float *weights, int radius, float mean_weight, float inverse_energy,
                                   __global float *response) {
    const int x = get_global_id(0), y = get_global_id(1);
    if (x >= width || y >= height)
        return;
    float sum = 0.0f, total = 0.0f;
    for (int k = -radius; k <= radius; ++k) {
        const ulong at = (ulong)clamp(y + k, 0, height - 1) * width + x;
        sum = fma(weights[k + radius], weighted[at], sum);
        total += plain[at];
    }
    response[(ulong)y * width + x] = fma(-mean_weight, total, sum) * inverse_energy;
}

// Local maxima of the response that stand out of the noise and look like a dot. map: 0, or 1 + number of the dot at
// that pixel. noise: variance at black, variance per unit of light, black level, threshold in standard deviations.
// shape: least amplitude, least correlation, sqrt of the energy, mean weight; precision: 1 / sigma^2.
__kernel void dot_detector_maxima(__global const pixel_t *image, ulong image_offset, uint image_pitch, int width,
                                  int height, __global const float *response, int radius, int separation, float4 noise,
                                  float4 shape, float precision, uint capacity, __global uint *counters,
                                  __global uint *map, __global int *places, __global float *state,
                                  __global float *results) {
    const int x = get_global_id(0), y = get_global_id(1);
    if (x >= width || y >= height)
        return;
    const ulong index = (ulong)y * width + x;
    map[index] = 0;
    const float amplitude = response[index];
    if (!(amplitude > shape.x && amplitude > 0.0f))
        return;
    for (int v = max(y - separation, 0); v <= min(y + separation, height - 1); ++v)
        for (int u = max(x - separation, 0); u <= min(x + separation, width - 1); ++u) {
            const float other = response[(ulong)v * width + u];
            // Of equal ones the first counts.
            if (other > amplitude || (other == amplitude && (v < y || (v == y && u < x))))
                return;
        }
    const float inverse_count = 1.0f / convert_float((2 * radius + 1) * (2 * radius + 1));
    float mean = 0.0f, square = 0.0f;
    for (int v = -radius; v <= radius; ++v)
        for (int u = -radius; u <= radius; ++u)
            mean += pixel_at(image, image_offset, image_pitch, clamp(x + u, 0, width - 1), clamp(y + v, 0, height - 1));
    mean *= inverse_count;
    for (int v = -radius; v <= radius; ++v)
        for (int u = -radius; u <= radius; ++u) {
            const float d =
                pixel_at(image, image_offset, image_pitch, clamp(x + u, 0, width - 1), clamp(y + v, 0, height - 1)) -
                mean;
            square = fma(d, d, square);
        }
    // A constant region has nothing but rounding errors.
    const float deviation = sqrt(square);
    if (!(deviation > 1e-5f * fabs(mean)) || amplitude * shape.z < shape.y * deviation)
        return;
    const float background = fma(-amplitude, shape.w, mean);
    const float variance = fma(noise.y, fmax(background - noise.z, 0.0f), noise.x);
    if (amplitude * shape.z < noise.w * sqrt(variance))
        return;
    const uint slot = atomic_inc(&counters[0]);
    if (slot >= capacity)
        return;
    map[index] = slot + 1;
    places[2 * slot] = x;
    places[2 * slot + 1] = y;
    __global float *s = state + (ulong)slot * STATE;
    s[0] = amplitude;
    s[1] = s[2] = 0.0f;
    s[3] = s[5] = precision;
    s[4] = 0.0f;
    s[6] = background;
    s[7] = 0.0f;
    results[(ulong)slot * RESULT + 15] = amplitude * shape.z / deviation;
}

// A dot of parameters p at (u, v) from the pixel that they count from, without its background.
static inline float dot_at(const float *p, float u, float v) {
    const float dx = u - p[1], dy = v - p[2];
    return p[0] * exp(-0.5f * (p[3] * dx * dx + 2.0f * p[4] * dx * dy + p[5] * dy * dy));
}

// The Cholesky factor of a positive definite matrix, in its lower triangle. False if it is not.
static inline bool factorize(float *m) {
    for (int i = 0; i < PARAMETERS; ++i)
        for (int j = 0; j <= i; ++j) {
            float sum = m[i * PARAMETERS + j];
            for (int k = 0; k < j; ++k)
                sum = fma(-m[i * PARAMETERS + k], m[j * PARAMETERS + k], sum);
            if (i == j) {
                if (!(sum > 1e-12f))
                    return false;
                m[i * PARAMETERS + i] = sqrt(sum);
            } else {
                m[i * PARAMETERS + j] = sum / m[j * PARAMETERS + j];
            }
        }
    return true;
}

static inline void solve(const float *factor, float *b) {
    for (int i = 0; i < PARAMETERS; ++i) {
        for (int k = 0; k < i; ++k)
            b[i] = fma(-factor[i * PARAMETERS + k], b[k], b[i]);
        b[i] /= factor[i * PARAMETERS + i];
    }
    for (int i = PARAMETERS - 1; i >= 0; --i) {
        for (int k = i + 1; k < PARAMETERS; ++k)
            b[i] = fma(-factor[k * PARAMETERS + i], b[k], b[i]);
        b[i] /= factor[i * PARAMETERS + i];
    }
}

// What the dot changes by with each parameter, at (dx, dy) from its centre. fixed: the shape stays. Returns its light.
static inline float slopes(const float *p, float dx, float dy, bool fixed, float *j) {
    const float e = exp(-0.5f * (p[3] * dx * dx + 2.0f * p[4] * dx * dy + p[5] * dy * dy)), model = p[0] * e;
    j[0] = e;
    j[1] = model * fma(p[3], dx, p[4] * dy);
    j[2] = model * fma(p[5], dy, p[4] * dx);
    j[3] = fixed ? 0.0f : -0.5f * model * dx * dx;
    j[4] = fixed ? 0.0f : -model * dx * dy;
    j[5] = fixed ? 0.0f : -0.5f * model * dy * dy;
    j[6] = 1.0f;
    return model;
}

// Weighted sum of squares of data less the model. normal, gradient: J^T W J and J^T W r, where they are wanted.
// variance: at background 0 and per unit, relative to the former. fixed: the shape stays.
static float residuals(const float *data, const float *p, const float *weight_of, float2 variance, bool fixed,
                       bool derivatives, float *normal, float *gradient) {
    if (derivatives)
        for (int i = 0; i < PARAMETERS; ++i) {
            gradient[i] = 0.0f;
            for (int j = 0; j < PARAMETERS; ++j)
                normal[i * PARAMETERS + j] = 0.0f;
        }
    float cost = 0.0f;
    for (int k = 0; k < PIXELS; ++k) {
        if (data[k] == EXCLUDED)
            continue;
        const float dx = convert_float(k % SIDE - WINDOW) - p[1], dy = convert_float(k / SIDE - WINDOW) - p[2];
        const float e = exp(-0.5f * (p[3] * dx * dx + 2.0f * p[4] * dx * dy + p[5] * dy * dy)), model = p[0] * e;
        const float r = data[k] - model - p[6];
        // The noise is that of the light of weight_of, a model of before, so that steps are compared by the same
        // weights.
        const float ux = convert_float(k % SIDE - WINDOW) - weight_of[1],
                    uy = convert_float(k / SIDE - WINDOW) - weight_of[2];
        const float light =
            variance.y > 0.0f
                ? weight_of[6] + weight_of[0] * exp(-0.5f * (weight_of[3] * ux * ux + 2.0f * weight_of[4] * ux * uy +
                                                             weight_of[5] * uy * uy))
                : 0.0f;
        const float weight = 1.0f / fma(variance.y, fmax(light, 0.0f), variance.x);
        cost = fma(weight * r, r, cost);
        if (!derivatives)
            continue;
        float j[PARAMETERS];
        slopes(p, dx, dy, fixed, j);
        for (int a = 0; a < PARAMETERS; ++a) {
            gradient[a] = fma(weight * j[a], r, gradient[a]);
            for (int b = 0; b <= a; ++b)
                normal[a * PARAMETERS + b] = fma(weight * j[a], j[b], normal[a * PARAMETERS + b]);
        }
    }
    if (derivatives && fixed)
        for (int a = 3; a < 6; ++a)
            normal[a * PARAMETERS + a] = 1.0f; // a step of 0
    return cost;
}

// Levenberg and Marquardt's method on data in units of the dot's first amplitude, until steps are below the tolerance.
// True if it converged.
static bool fit(const float *data, float *p, float2 variance, bool fixed, float tolerance, uint *iterations) {
    float normal[PARAMETERS * PARAMETERS], damped[PARAMETERS * PARAMETERS], gradient[PARAMETERS], step[PARAMETERS],
        weight_of[PARAMETERS];
    float lambda = 1e-3f;
    for (uint i = 0; i < MAX_ITERATIONS; ++i) {
        for (int a = 0; a < PARAMETERS; ++a)
            weight_of[a] = p[a];
        const float cost = residuals(data, p, weight_of, variance, fixed, true, normal, gradient);
        *iterations += 1;
        bool moved = false;
        for (int attempt = 0; attempt < 8 && !moved; ++attempt) {
            for (int a = 0; a < PARAMETERS; ++a) {
                step[a] = gradient[a];
                for (int b = 0; b <= a; ++b)
                    damped[a * PARAMETERS + b] = normal[a * PARAMETERS + b] * (a == b ? 1.0f + lambda : 1.0f);
            }
            if (factorize(damped)) {
                solve(damped, step);
                float next[PARAMETERS];
                for (int a = 0; a < PARAMETERS; ++a)
                    next[a] = p[a] + step[a];
                const bool sensible = next[3] > 0.0f && next[5] > 0.0f && next[3] * next[5] > next[4] * next[4];
                const float tried =
                    sensible ? residuals(data, next, weight_of, variance, fixed, false, normal, gradient) : INFINITY;
                // Rounding may keep the cost from falling any further.
                if (tried <= cost * (1.0f + 1e-6f)) {
                    moved = true;
                    for (int a = 0; a < PARAMETERS; ++a)
                        p[a] = next[a];
                }
            }
            lambda = moved ? fmax(lambda * 0.1f, 1e-7f) : lambda * 10.0f;
        }
        if (!moved)
            return fabs(step[1]) + fabs(step[2]) < 1e-2f; // no better place: at the minimum but for rounding
        if (fabs(step[1]) + fabs(step[2]) < tolerance && fabs(step[0]) + fabs(step[6]) < tolerance)
            return true;
    }
    return false;
}

// Covariance xx, xy, yy that speckle of squared contrast times correlation area 1 px^2 gives the centre. Of a dot of
// the expected shape: speckle varies the expected light, not what it made of it.
static float3 speckle_covariance(const float *data, const float *fitted, float round_precision, float2 variance,
                                 bool fixed) {
    const float p[PARAMETERS] = {fitted[0], fitted[1], fitted[2], round_precision, 0.0f, round_precision, fitted[6]};
    float normal[PARAMETERS * PARAMETERS], gradient[PARAMETERS];
    float inverse_x[PARAMETERS] = {0.0f, 1.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f};
    float inverse_y[PARAMETERS] = {0.0f, 0.0f, 1.0f, 0.0f, 0.0f, 0.0f, 0.0f};
    residuals(data, p, p, variance, fixed, true, normal, gradient);
    if (!factorize(normal))
        return (float3)(NAN);
    solve(normal, inverse_x);
    solve(normal, inverse_y);
    float3 sum = (float3)(0.0f);
    for (int k = 0; k < PIXELS; ++k) {
        if (data[k] == EXCLUDED)
            continue;
        float j[PARAMETERS];
        const float light =
            slopes(p, convert_float(k % SIDE - WINDOW) - p[1], convert_float(k / SIDE - WINDOW) - p[2], fixed, j);
        float x = 0.0f, y = 0.0f;
        for (int a = 0; a < PARAMETERS; ++a) {
            x = fma(inverse_x[a], j[a], x);
            y = fma(inverse_y[a], j[a], y);
        }
        const float weight = light / fma(variance.y, fmax(light + p[6], 0.0f), variance.x);
        sum += weight * weight * (float3)(x * x, x * y, y * y);
    }
    return sum;
}

// The standard deviation of the Gaussian along its longer axis.
static inline float widest(const float *p) {
    const float determinant = p[3] * p[5] - p[4] * p[4], half_trace = 0.5f * (p[3] + p[5]);
    return rsqrt(fmax(half_trace - sqrt(fmax(half_trace * half_trace - determinant, 0.0f)), 1e-12f));
}

// True for what may be a dot near its pixel.
static inline bool is_dot(const float *p, float sigma) {
    const float determinant = p[3] * p[5] - p[4] * p[4], half_trace = 0.5f * (p[3] + p[5]);
    const float narrowest = rsqrt(half_trace + sqrt(fmax(half_trace * half_trace - determinant, 0.0f)));
    return p[0] > 0.0f && fabs(p[1]) <= 1.0f + sigma && fabs(p[2]) <= 1.0f + sigma && narrowest > 0.3f * sigma &&
           widest(p) < 4.0f * sigma;
}

// A Gaussian-weighted centroid of the light above the background, (x, y) from the window's centre: the weight moves
// with it, and the step is doubled, as a Gaussian dot under a weight of its own width shows half of its distance.
static float2 centroid(const float *data, float background, float precision) {
    float cx = 0.0f, cy = 0.0f;
    for (int i = 0; i < 10; ++i) {
        float sum = 0.0f, sx = 0.0f, sy = 0.0f;
        for (int k = 0; k < PIXELS; ++k) {
            if (data[k] == EXCLUDED)
                continue;
            const float dx = convert_float(k % SIDE - WINDOW) - cx, dy = convert_float(k / SIDE - WINDOW) - cy;
            const float w = exp(-0.5f * precision * (dx * dx + dy * dy)) * (data[k] - background);
            sum += w;
            sx = fma(w, dx, sx);
            sy = fma(w, dy, sy);
        }
        if (!(sum > 0.0f))
            return (float2)(NAN, NAN);
        cx += 2.0f * sx / sum;
        cy += 2.0f * sy / sum;
        if (!(fabs(cx) <= WINDOW && fabs(cy) <= WINDOW))
            return (float2)(NAN, NAN);
    }
    return (float2)(cx, cy);
}

// The mean of the window's outermost pixels.
static float ring_mean(const float *data) {
    float sum = 0.0f;
    int count = 0;
    for (int k = 0; k < PIXELS; ++k) {
        const int u = k % SIDE, v = k / SIDE;
        if (data[k] != EXCLUDED && (u == 0 || v == 0 || u == SIDE - 1 || v == SIDE - 1)) {
            sum += data[k];
            ++count;
        }
    }
    return count > 0 ? sum / count : 0.0f;
}

// One pass: every dot is fitted to the frame less the other dots as the pass before saw them.
// noise: variance at black, variance per unit of light, black level, 1 if the noise is known.
// limits: expected sigma, saturation, relative sigma of merged dots, squared contrast times correlation area of
// speckle.
__kernel void dot_detector_fit(__global const pixel_t *image, ulong image_offset, uint image_pitch, int width,
                               int height, __global const uint *map, __global const int *places,
                               __global const uint *counters, uint capacity, float4 noise, float4 limits,
                               __global const float *before, __global float *after, __global float *results,
                               uint last) {
    const uint dot = get_global_id(0);
    if (dot >= min(counters[0], capacity))
        return;
    const int px = places[2 * dot], py = places[2 * dot + 1];
    const float sigma = limits.x;
    uint flags = 0, used = 0, iterations = 0;
    float start[STATE];
    for (int i = 0; i < STATE; ++i)
        start[i] = before[(ulong)dot * STATE + i];
    const float unit = start[0], inverse_unit = 1.0f / unit, base = start[6];

    float data[PIXELS];
    for (int k = 0; k < PIXELS; ++k) {
        const int u = k % SIDE - WINDOW, v = k / SIDE - WINDOW, x = px + u, y = py + v;
        data[k] = EXCLUDED;
        if (x < 0 || y < 0 || x >= width || y >= height) {
            flags |= FLAG_BORDER;
            continue;
        }
        const float value = pixel_at(image, image_offset, image_pitch, x, y);
        if (value >= limits.y) {
            if (convert_float(u * u + v * v) <= 6.25f * sigma * sigma)
                flags |= FLAG_SATURATED;
            continue;
        }
        data[k] = value;
        ++used;
    }
    bool alone = true;
    // Their light matters as far as their windows reach. In the order of the pixels, whatever the order in which dots
    // were counted.
    for (int y = max(py - 2 * WINDOW, 0); y <= min(py + 2 * WINDOW, height - 1); ++y)
        for (int x = max(px - 2 * WINDOW, 0); x <= min(px + 2 * WINDOW, width - 1); ++x) {
            const uint other = map[(ulong)y * width + x];
            if (other == 0 || other == dot + 1)
                continue;
            alone = false;
            float q[STATE];
            for (int i = 0; i < STATE; ++i)
                q[i] = before[(ulong)(other - 1) * STATE + i];
            const float ox = convert_float(x - px), oy = convert_float(y - py);
            const float dx = ox + q[1] - start[1], dy = oy + q[2] - start[2];
            if (dx * dx + dy * dy < 12.25f * sigma * sigma) // nearer than 3.5 sigma the passes do not converge
                flags |= FLAG_MERGED;
            for (int k = 0; k < PIXELS; ++k)
                if (data[k] != EXCLUDED)
                    data[k] -= dot_at(q, convert_float(k % SIDE - WINDOW) - ox, convert_float(k / SIDE - WINDOW) - oy);
        }
    __global float *s = after + (ulong)dot * STATE;
    for (int i = 0; i < STATE; ++i)
        s[i] = start[i];
    if (alone && start[7] == 1.0f && !last) // nothing new since its fit
        return;
    for (int k = 0; k < PIXELS; ++k)
        if (data[k] != EXCLUDED)
            data[k] = (data[k] - base) * inverse_unit;

    // In units of the amplitude: variance(v) = at_base + per_unit v, v above the base.
    const float at_black = noise.w > 0.0f ? noise.x : 1.0f, slope = noise.w > 0.0f ? noise.y : 0.0f;
    const float at_base = fma(slope, fmax(base - noise.z, 0.0f), at_black);
    const float2 variance = (float2)(1.0f, slope * unit / at_base);

    const float tolerance = last ? 2e-5f : 1e-3f, round_precision = 1.0f / (sigma * sigma);
    float p[PARAMETERS] = {1.0f, start[1], start[2], start[3], start[4], start[5], 0.0f};
    bool good = used > PARAMETERS && fit(data, p, variance, false, tolerance, &iterations) && is_dot(p, sigma);
    bool fixed = false;
    if (!good && used > PARAMETERS) { // speckle: place, amplitude and background of a round dot
        fixed = true;
        p[0] = 1.0f;
        p[1] = p[2] = p[4] = p[6] = 0.0f;
        p[3] = p[5] = round_precision;
        good = fit(data, p, variance, true, tolerance, &iterations) && is_dot(p, sigma);
        if (good)
            flags |= FLAG_FIXED_SHAPE;
    }
    if (good) {
        s[0] = p[0] * unit;
        for (int i = 1; i < 6; ++i)
            s[i] = p[i];
        s[6] = fma(p[6], unit, base);
        s[7] = 1.0f;
    } else {
        flags |= FLAG_FIT_FAILED;
    }
    if (!last)
        return;

    const float determinant = p[3] * p[5] - p[4] * p[4];
    if (good && widest(p) > limits.z * sigma)
        flags |= FLAG_MERGED;
    const float2 centre = centroid(data, ring_mean(data), round_precision);
    __global float *result = results + (ulong)dot * RESULT;
    float xx = NAN, xy = NAN, yy = NAN, aa = NAN, misfit = NAN;
    float normal[PARAMETERS * PARAMETERS], gradient[PARAMETERS];
    if (good) {
        const float cost = residuals(data, p, p, variance, fixed, true, normal, gradient);
        const float freedom = convert_float(used - (fixed ? PARAMETERS - 3 : PARAMETERS));
        // Over the degrees of freedom: the variance at the base, in units of the amplitude.
        const float scatter = cost / freedom;
        const float expected = at_base * inverse_unit * inverse_unit;
        misfit = noise.w > 0.0f ? scatter / expected : 1.0f;
        float scale = scatter;
        if (noise.w > 0.0f) // known noise, unless the model misfits by far more than noise can
            scale = misfit > 1.0f + 4.0f * sqrt(2.0f / freedom) ? scatter : expected;
        if (factorize(normal)) {
            float column[PARAMETERS] = {0.0f, 1.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f};
            solve(normal, column);
            xx = column[1] * scale;
            xy = column[2] * scale;
            for (int i = 0; i < PARAMETERS; ++i)
                column[i] = i == 2 ? 1.0f : 0.0f;
            solve(normal, column);
            yy = column[2] * scale;
            for (int i = 0; i < PARAMETERS; ++i)
                column[i] = i == 0 ? 1.0f : 0.0f;
            solve(normal, column);
            aa = column[0] * scale * unit * unit;
            if (limits.w > 0.0f) {
                const float3 speckle = limits.w * speckle_covariance(data, p, round_precision, variance, fixed);
                xx += speckle.x;
                xy += speckle.y;
                yy += speckle.z;
            }
            if (!(xx > 0.0f && yy > 0.0f))
                flags |= FLAG_FIT_FAILED;
        } else {
            flags |= FLAG_FIT_FAILED;
        }
    }
    // Covariance of the Gaussian: the inverse of its precision.
    result[0] = s[1];
    result[1] = s[2];
    result[2] = s[0];
    result[3] = s[6];
    result[4] = good ? p[5] / determinant : NAN;
    result[5] = good ? -p[4] / determinant : NAN;
    result[6] = good ? p[3] / determinant : NAN;
    result[7] = xx;
    result[8] = xy;
    result[9] = yy;
    result[10] = aa;
    result[11] = misfit;
    result[12] = centre.x;
    result[13] = centre.y;
    result[14] = convert_float(iterations);
    result[16] = convert_float(flags);
}

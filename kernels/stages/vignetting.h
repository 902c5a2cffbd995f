// Vignetting: what the lens lets through at a pixel (px, py) from the principal point.
#ifndef CLSP_VIGNETTING_H
#define CLSP_VIGNETTING_H

// 1 - corner_loss r^2, r^2 = |position|^2 / unit^2. optics: principal point (x, y), 1 / unit^2, corner loss.
static inline float vignetting(float px, float py, float4 optics) {
    return fmax(fma(-optics.w, fma(px, px, py * py) * optics.z, 1.0f), 0.0f);
}

#endif

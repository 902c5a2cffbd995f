// From the field grid (oversampled, padded, periodic) to image pixels.
#ifndef CLSP_FIELD_GRID_H
#define CLSP_FIELD_GRID_H

// The pixel whose value a grid sample takes along one axis. Samples beyond the image belong to the padding: they take
// the nearest edge pixel, counted around the periodic border, so that no dark rim arises.
static inline uint pixel_of_sample(uint sample, uint oversampling, uint pixels, uint grid) {
    const uint inside = oversampling * pixels;
    if (sample < inside)
        return sample / oversampling;
    return sample - (inside - 1u) <= grid - sample ? pixels - 1u : 0u;
}

#endif

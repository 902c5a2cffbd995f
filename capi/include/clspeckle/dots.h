/**
 * @file dots.h
 * @brief Ideal projected dots in the image plane, with the defects of the laser and of the diffractive optical element
 *        (DOE).
 *
 * With dots at x_j (pixel centres are integers), of width sigma_j and peak b_j, the image is
 *     I0(x) = scale * sum_j b_j g((x - x_j) / sigma_j),       g(r) = exp(-|r|^2 / 2)
 * taken at pixel centres: dots with sigma below about 0.5 px lose or gain light with their place between the pixels.
 *
 * Each defect changes one thing. It is off by default, and costs nothing then:
 *  - Wavelength shift: a grating deflects in proportion to the wavelength. With d = relative_wavelength_shift (shift
 *    over wavelength) every dot moves radially from the optical axis c, x_j -> c + (1 + d) (x_j - c).
 *  - Skewed beam: g(r) = exp(-|r|^2 / 2) max(0, 1 + s/6 He3(a)) / F with He3(a) = a^3 - 3 a, the third Hermite term of
 *    the Gram-Charlier series, and a = r_x cos(angle) + r_y sin(angle). Without the clip at 0 centroid, width and light
 *    of a dot would stay as they are and the skewness along the axis would be s. The clip takes effect at a < a0 = -2
 *    cosh(acosh(3/s)/3) (s > 0; mirrored for s < 0) and adds light, which F = Phi(-a0) + s/6 (a0^2 - 1) phi(a0) takes
 *    out again (Phi, phi: the normal law and its density), so that a Gaussian dot keeps its light. It costs skewness:
 *    0.43 is left of s = 0.5, 0.71 of 1, 0.80 of 1.2.
 *  - Flat-topped beam: g(r) = exp(-(|r|^2)^p / 2), p = 1 + 2 f: a super-Gaussian of the same peak; its light is
 *    2^(1/p) Gamma(1 + 1/p) / 2 of the Gaussian's. In a beam that is also skewed it takes the place of exp(-|r|^2 / 2).
 *  - Zero order: the undiffracted beam, one more dot at c. Its peak is zero_order_relative_intensity times the mean of
 *    the b_j, its width the mean of the sigma_j.
 *  - Ghost dots: a faint copy of every dot, ghost_relative_intensity times as bright, ghost_offset away (before the
 *    wavelength shift). By default it is half the diagonal of the lattice's cell, (v + w) / 2: v is the median (x and y
 *    apart) of the vectors from a dot to its nearest neighbour to the right (dx > 0, |dy| <= dx), w likewise downwards
 *    (dy > 0, |dx| < dy). At most 1024 dots are asked. A pattern of one row or column has one vector, and ghosts
 *    halfway along it.
 *  - Scattered background: the fraction f of the light that reaches the image is spread evenly over it,
 *    I0 -> (1 - f) I0 + f mean(I0), with the mean of the rendered pixels, so that the image keeps its sum.
 *
 * A dot is summed where it is above 1e-7 of its peak, and in the rest of each tile of 16 x 16 px that it reaches; the
 * tails that are left out hold less than 1e-6 of its light. Arithmetic is single precision, good to 1e-6 of the image's
 * largest value. The order of summation is fixed: the same dots give the same image every time.
 */
#ifndef CLSPECKLE_DOTS_H
#define CLSPECKLE_DOTS_H

#include "types.h"

#ifdef __cplusplus
extern "C" {
#endif

#define CLSP_MAX_DOTS 1000000u /**< Dots that a pattern may have. */

/** How a dot pattern is made. */
typedef struct ClspDotsDesc {
    uint32_t struct_size;           /**< Size of the struct as the caller knows it. */
    uint32_t width;                 /**< Image width in pixels, 1 to 16384. */
    uint32_t height;                /**< Image height in pixels, 1 to 16384. */
    /** 0 (default): the optical axis meets the image at its centre, ((width - 1) / 2, (height - 1) / 2); 1: at
     *  principal_point. */
    uint32_t principal_point_given;
    uint64_t count;                 /**< Number of dots, 1 to CLSP_MAX_DOTS. */
    const double *positions_px;     /**< Host memory, count times x, y; copied. Finite; dots may lie outside of the
                                         image. */
    const double *sigmas_px;        /**< Host memory, count widths, each 0.01 to 16384; copied. NULL (default): sigma_px
                                         for all. */
    const double *peaks;            /**< Host memory, count peaks, each 0 to 1e30; copied. NULL (default): 1 for all. */
    double sigma_px;                /**< Width of the dots where sigmas_px is NULL, 0.01 to 16384; default 2. */
    double scale;                   /**< Factor on all peaks, 0 to 1e30; default 1. */
    double principal_point_x_px;    /**< c, where the axis meets the image; finite. 0 (default) unless
                                         principal_point_given is 1. */
    double principal_point_y_px;    /**< Likewise. */
    double relative_wavelength_shift;     /**< d, above -1, at most 1; default 0. */
    double beam_skew;                     /**< s, -3 to 3; beyond, the polynomial is below 0 in the middle of the dot.
                                               Default 0. */
    double beam_skew_angle_rad;           /**< Direction of the skew, from x (right) to y (down); finite. Default 0:
                                               along x. */
    double beam_flatness;                 /**< f, 0 (default, Gaussian) to 4 (nearly a disc). */
    double zero_order_relative_intensity; /**< 0 (default: none) to 1e30. */
    double ghost_relative_intensity;      /**< 0 (default: none) to 1e30. */
    uint32_t ghost_offset_given;          /**< 0 (default): from the lattice; 1: see ghost_offset. */
    uint32_t reserved;                    /**< 0. */
    double ghost_offset_x_px;             /**< Finite. 0 (default) unless ghost_offset_given is 1. */
    double ghost_offset_y_px;             /**< Likewise. */
    double scatter_fraction;              /**< f, 0 (default: none) to 1. */
} ClspDotsDesc;

/** Writes the defaults (no dots) into *desc. @param struct_size sizeof(ClspDotsDesc). */
CLSP_API ClspStatus clspDotsDescInit(ClspDotsDesc *desc, uint32_t struct_size);
/**
 * Makes a dot pattern; *dots gets one reference. Copies everything from host memory and builds the program.
 * Fails with CLSP_ERROR_INVALID_DATA for positions, sigmas or peaks out of range, and with CLSP_ERROR_UNSUPPORTED if
 * there are so many wide dots that the lists of what reaches each tile would take more than 512 MiB.
 */
CLSP_API ClspStatus clspDotsCreate(ClspContext context, const ClspDotsDesc *desc, ClspDots *dots);
/** Adds a reference. */
CLSP_API ClspStatus clspDotsRetain(ClspDots dots);
/** Drops a reference; with the last one the dots are gone, once what was enqueued is done. NULL is allowed. */
CLSP_API ClspStatus clspDotsRelease(ClspDots dots);

/**
 * Changes the pattern; later Enqueue calls use it, and what is enqueued already is not touched. If the call fails,
 * everything stays as it was.
 * @param desc a whole description; width and height must be those of before. With count 0 and the three pointers NULL,
 *        the dots stay, with a sigma and a peak of their own if they had.
 */
CLSP_API ClspStatus clspDotsConfigure(ClspDots dots, const ClspDotsDesc *desc);

/**
 * Renders the dots.
 * @param irradiance FLOAT32 image of width x height, fully written.
 */
CLSP_API ClspStatus clspDotsEnqueueRender(ClspDots dots, cl_command_queue queue, const ClspImage *irradiance,
                                          uint32_t num_events_in_wait_list, const cl_event *event_wait_list,
                                          cl_event *event);

#ifdef __cplusplus
}
#endif

#endif /* CLSPECKLE_DOTS_H */

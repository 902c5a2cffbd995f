/**
 * @file doe.h
 * @brief The pattern of a diffractive optical element (DOE): from its phase and the laser's beam to texels for
 *        pattern.h.
 *
 * Far field of beam b and transmission t = exp(i phase), u and v direction cosines in the laser's frame (x right, y
 * down):
 *     U(u, v) = integral b(x, y) t(x, y) exp(-2 pi i (u x + v y) / lambda) dx dy,     dP / (du dv) = |U|^2 / lambda^2,
 * and, as a solid angle is du dv / cos(theta), the radiant intensity is J = cos(theta) dP / (du dv) (thesis 2.6;
 * Goodman, Introduction to Fourier Optics). What leaves at u^2 + v^2 >= 1 does not propagate. A DOE pixel is a square
 * of the pitch p, whose transform is the envelope sinc(p u / lambda) sinc(p v / lambda), sinc(x) = sin(pi x) / (pi x).
 *
 * Evaluations:
 *  - ORDERS (designs that repeat): order (m, n) of a cell of Px x Py lies at (m lambda / Px, n lambda / Py) and has the
 *    power |c|^2 sinc^2 sinc^2 with c bin (m, n) of the cell's Fourier transform over its number of pixels. Each order
 *    is a spot, whose shape is the beam's far field. Spots are summed as powers, so the beam must cover so much of the
 *    cell that they do not overlap.
 *  - APERTURE: the beam times the phase over the whole aperture is transformed, at `oversampling` times as many
 *    directions as it has pixels; every sample is a small rectangle whose power is shared among the texels that it
 *    covers.
 * Both keep the energy: the sum of the texels' powers is the power that leaves inside the image, to 1e-6.
 *
 * Defects (ClspDoeDefects, and lines of other wavelengths), lambda_0 the design's wavelength, n the refractive index:
 *  - depth error and wavelength: phase -> (1 + relative_depth_error) (lambda_0 / lambda) (n(lambda) - 1) / (n(lambda_0)
 *    - 1) phase.
 *  - levels L: the phase above its least value is rounded to multiples of 2 pi / L (L = 2 is a binary design: 0 or pi).
 *  - rounding_sigma_m: the depths are blurred by a Gaussian (each pixel is sampled `feature_samples` times along each
 *    side).
 *  - etch_noise_rms_m, sigma: every pixel's depth has an independent normal error: a phase error of RMS
 *    s = 2 pi (n - 1) sigma / lambda. The share 1 - exp(-s^2) of the light is scattered evenly under the pixel's
 *    envelope.
 */
#ifndef CLSPECKLE_DOE_H
#define CLSPECKLE_DOE_H

#include "types.h"

#ifdef __cplusplus
extern "C" {
#endif

#define CLSP_BEAM_GAUSSIAN 0u       /**< From the covariance of its intensity. */
#define CLSP_BEAM_FLAT_CIRCLE 1u    /**< Even within an ellipse of width_m x height_m. */
#define CLSP_BEAM_FLAT_SQUARE 2u    /**< Even within a rectangle of width_m x height_m. */
#define CLSP_BEAM_SUPER_GAUSSIAN 3u /**< exp(-2 r^(2 order)), r^2 = (2 x / width)^2 + (2 y / height)^2; order 1 is a
                                         Gaussian. */
#define CLSP_BEAM_SKEWED 4u         /**< The Gaussian times (1 + erf(skew_x x / (sqrt(2) sigma_x))), and likewise along
                                         y. */
#define CLSP_BEAM_IMAGE 5u          /**< An image of the intensity that covers width_m x height_m, bilinear between its
                                         pixels. */

/** The laser's beam at the DOE. Its power is ClspDoePatternDesc::power_w, whatever the profile's values. */
typedef struct ClspBeamProfile {
    uint32_t struct_size;      /**< Size of the struct as the caller knows it. */
    uint32_t kind;             /**< CLSP_BEAM_*; default GAUSSIAN. */
    double covariance_xx_m2;   /**< Of the intensity, for GAUSSIAN and SKEWED: sigma_x^2; default (0.25 mm)^2 (a 1/e^2
                                    diameter of 1 mm). */
    double covariance_xy_m2;   /**< Likewise; default 0. The matrix must be positive definite. */
    double covariance_yy_m2;   /**< Likewise; default (0.25 mm)^2. */
    double width_m;            /**< For the other kinds: full width, see CLSP_BEAM_*; default 1 mm. */
    double height_m;           /**< Likewise; default 1 mm. */
    double order;              /**< SUPER_GAUSSIAN: 1 to 50; default 4. */
    double skew_x;             /**< SKEWED: shape parameter of the skew-normal law along x, -20 to 20; default 0. */
    double skew_y;             /**< Likewise along y. */
    double m_squared;          /**< Beam quality M^2, 1 (default) to 100: the far field is that much wider. ORDERS only
                                    where above 1. */
    uint32_t image_width;      /**< IMAGE: 2 to 16384. */
    uint32_t image_height;     /**< Likewise. */
    const float *image;        /**< IMAGE: host memory, intensities, finite, >= 0, not all 0; copied. */
    uint64_t image_pitch_bytes; /**< From row to row; 0 (default) means tightly packed. */
} ClspBeamProfile;

/** Writes the defaults into *beam. @param struct_size sizeof(ClspBeamProfile). */
CLSP_API ClspStatus clspBeamProfileInit(ClspBeamProfile *beam, uint32_t struct_size);

/** What manufacture does to a design. All off by default. */
typedef struct ClspDoeDefects {
    uint32_t struct_size;        /**< Size of the struct as the caller knows it. */
    uint32_t levels;             /**< Levels that manufacture has, 2 to 65536; 0 (default): no limit. */
    double relative_depth_error; /**< e, -1 to 1: all depths are (1 + e) times as deep. Default 0. */
    double rounding_sigma_m;     /**< Rounding of features, 0 (default) to 64 pixels. */
    double etch_noise_rms_m;     /**< RMS error of a pixel's depth, 0 (default) or more. */
    double refractive_index;     /**< n at the design's wavelength, above 1 to 10; default 1.4507 (fused silica, 940 nm,
                                      Malitson 1965). */
    double dispersion_per_m;     /**< dn / d lambda; default 0. Fused silica at 940 nm: -13.3e3. */
    uint64_t seed;               /**< Of the etch noise in APERTURE. Default 0. */
    uint32_t feature_samples;    /**< Samples of a pixel along each side while features are rounded, 1 to 16; default
                                      4. */
    uint32_t reserved;           /**< 0. */
} ClspDoeDefects;

/** Writes the defaults into *defects. @param struct_size sizeof(ClspDoeDefects). */
CLSP_API ClspStatus clspDoeDefectsInit(ClspDoeDefects *defects, uint32_t struct_size);

#define CLSP_DOE_EVALUATION_AUTO 0u     /**< ORDERS for a design that repeats, else APERTURE. */
#define CLSP_DOE_EVALUATION_ORDERS 1u   /**< Spots at the orders of a cell. */
#define CLSP_DOE_EVALUATION_APERTURE 2u /**< The transform of the whole aperture. */

#define CLSP_MAX_DOE_SAMPLES 8192u /**< Samples of a design along a side, feature_samples and the whole aperture
                                        included. */
#define CLSP_MAX_DOE_LINES 16u  /**< Laser lines. */

/** A DOE, the beam, and the image of the pattern that is wanted. */
typedef struct ClspDoePatternDesc {
    uint32_t struct_size;          /**< Size of the struct as the caller knows it. */
    uint32_t width;                /**< Design width in pixels, 1 to CLSP_MAX_DOE_SAMPLES. */
    uint32_t height;               /**< Likewise. */
    uint32_t periodic;             /**< 1 (default): the design is a cell that repeats over the DOE; 0: it is the whole
                                        aperture. */
    const float *phase;            /**< Host memory, height x width, radians at wavelength_m, row 0 first; copied.
                                        Finite. */
    uint64_t phase_pitch_bytes;    /**< From row to row; 0 (default) means tightly packed. */
    double pixel_pitch_m;          /**< Of the DOE; must be given. */
    double wavelength_m;           /**< That the design is made for; default 940e-9. */
    uint64_t dot_count;            /**< Number of wanted dots, for the power budget; 0 (default): not known. */
    const int32_t *dot_orders;     /**< count times m, n: wanted orders of a periodic design, each once. */
    const double *dot_directions;  /**< count times u, v at wavelength_m: wanted directions of a whole aperture. */
    const double *dot_weights;     /**< count wanted powers (any unit), above 0; NULL (default): all equal. */
    const ClspBeamProfile *beam;   /**< NULL (default): the defaults of ClspBeamProfile. */
    const ClspDoeDefects *defects; /**< NULL (default): none. */
    uint32_t design_levels;        /**< Levels that the design says it has, which its phase must then lie on; 0
                                        (default): any phase. */
    uint32_t evaluation;           /**< CLSP_DOE_EVALUATION_*; default AUTO. */
    uint32_t line_count;           /**< Laser lines, 0 (default): one at wavelength_m; at most CLSP_MAX_DOE_LINES. */
    uint32_t oversampling;         /**< APERTURE: directions per pixel along each axis, 1 to 4; default 2 (Nyquist for
                                        the intensity). */
    const double *line_wavelengths_m; /**< line_count wavelengths, half to twice wavelength_m. */
    const double *line_powers;     /**< line_count powers (any unit), above 0; NULL (default): all equal. */
    double doe_width_m;            /**< Size of the DOE; 0 (default): a whole aperture's own size, else without
                                        limit. */
    double doe_height_m;           /**< Likewise. */
    double power_w;                /**< Of the beam; default 1. */
    uint32_t image_width;          /**< Texels, 2 to 16384; default 2048. */
    uint32_t image_height;         /**< Likewise. */
    double half_extent_x;          /**< The image covers [-half_extent_x, half_extent_x] in u, up to 1; 0 (default):
                                        min(1, lambda / 2p). */
    double half_extent_y;          /**< Likewise in v. */
    uint32_t pixel_envelope;       /**< 1 (default): pixels are squares; 0: the phase is smooth between their centres
                                        (no envelope, no orders beyond the sampling limit). */
    uint32_t reserved;             /**< 0. */
    uint64_t max_memory_bytes;     /**< Device memory that may be taken; 0 (default): what the device has. */
    const char *cache_dir;         /**< Folder in which patterns are kept between runs; NULL (default): memory only. */
    ClspProgressFunction progress; /**< Told how far the pattern is; NULL (default): nobody is told. */
    void *progress_data;           /**< Handed to `progress`; default NULL. */
} ClspDoePatternDesc;

/** Writes the defaults into *desc. @param struct_size sizeof(ClspDoePatternDesc). */
CLSP_API ClspStatus clspDoePatternDescInit(ClspDoePatternDesc *desc, uint32_t struct_size);

/**
 * Computes a pattern, or takes it from the context's cache (256 MiB, least recently used goes) or from cache_dir;
 * *pattern gets one reference. Blocks. The key of the caches is everything that the pattern depends on, the device
 * included. A file of cache_dir that is damaged is ignored and written anew; one that cannot be written is not an
 * error. Device memory: 4 bytes for each texel; 16 bytes for each sample of the design in ORDERS; 8 bytes for each
 * sample of the aperture and 4 (8) for each of the design in APERTURE; and as much as the Fourier transform asks for.
 * @return CLSP_ERROR_INVALID_ARGUMENT where the description contradicts itself: a beam or a cell larger than the DOE,
 *         spots that overlap, wanted directions beyond 90 degrees. CLSP_ERROR_INVALID_DATA for phases that are not
 *         finite or not on design_levels. CLSP_ERROR_OUT_OF_MEMORY, naming the need, if it does not fit.
 *         CLSP_ERROR_CANCELLED when the progress function returned 0.
 */
CLSP_API ClspStatus clspDoePatternCreate(ClspContext context, const ClspDoePatternDesc *desc, ClspDoePattern *pattern);

/** Ideal dots: the beam's far field at given directions, thesis 3.3. */
typedef struct ClspSpotPatternDesc {
    uint32_t struct_size;        /**< Size of the struct as the caller knows it. */
    uint32_t reserved;           /**< 0. */
    uint64_t count;              /**< Number of dots, 1 to CLSP_MAX_DOTS. */
    const double *directions;    /**< Host memory, count times u, v, u^2 + v^2 < 1; copied. */
    const double *powers;        /**< count powers (any unit), >= 0, not all 0; NULL (default): all equal. */
    const ClspBeamProfile *beam; /**< Gives the dots their shape; NULL (default): the defaults of ClspBeamProfile. */
    double wavelength_m;         /**< Default 940e-9. */
    double power_w;              /**< Of all dots together; default 1. */
    uint32_t image_width;        /**< Texels, 2 to 16384; default 2048. */
    uint32_t image_height;       /**< Likewise. */
    double half_extent_x;        /**< The image covers [-half_extent_x, half_extent_x] in u, up to 1; default 0.5. */
    double half_extent_y;        /**< Likewise in v. */
} ClspSpotPatternDesc;

/** Writes the defaults (no dots) into *desc. @param struct_size sizeof(ClspSpotPatternDesc). */
CLSP_API ClspStatus clspSpotPatternDescInit(ClspSpotPatternDesc *desc, uint32_t struct_size);
/** Computes the pattern of ideal dots: texels like a DOE's, so that the lookup costs the same. *pattern gets one
 *  reference. Blocks. */
CLSP_API ClspStatus clspSpotPatternCreate(ClspContext context, const ClspSpotPatternDesc *desc,
                                          ClspDoePattern *pattern);

/** Adds a reference. */
CLSP_API ClspStatus clspDoePatternRetain(ClspDoePattern pattern);
/** Drops a reference. NULL is allowed. */
CLSP_API ClspStatus clspDoePatternRelease(ClspDoePattern pattern);

#define CLSP_DOE_SOURCE_COMPUTED 0u /**< By this call. */
#define CLSP_DOE_SOURCE_MEMORY 1u   /**< From the context's cache. */
#define CLSP_DOE_SOURCE_DISK 2u     /**< From cache_dir. */

/** What is known of a pattern. Shares are of the power that passes the DOE. */
typedef struct ClspDoePatternInfo {
    uint32_t struct_size;  /**< Size of the struct as the caller knows it. */
    uint32_t source;       /**< CLSP_DOE_SOURCE_*. */
    uint32_t image_width;  /**< Texels. */
    uint32_t image_height; /**< Likewise. */
    double half_extent_x;  /**< The image covers [-half_extent_x, half_extent_x] in u. */
    double half_extent_y;  /**< Likewise in v. */
    double power_w;        /**< Of the beam. */
    /** Share in the wanted dots. ORDERS: exact. APERTURE: in the texels within twice the spot's half-angle, and at
     *  least 1.5 texels, of a wanted direction: the power budget of an image whose texels are wider than that depends
     *  on them. */
    double dots;
    double zero_order;     /**< Share in order (0, 0), unless it is wanted. */
    /** Share in other orders, those outside of the image and beyond 90 degrees included (ORDERS); around the twins -(u,
     *  v) of wanted dots that are not wanted themselves (APERTURE). */
    double ghosts;
    double scatter;        /**< Share of etch noise (ORDERS); all the rest, also what misses the image (APERTURE). */
    double inside_image;   /**< Share that the texels hold. */
    double uniformity_rms; /**< RMS of power / wanted power over the dots, over its mean, minus 1; 0 without wanted
                                dots. */
    double divergence_x_rad; /**< Half-angle along x that holds 95.45 % of a spot's light (1/e^2 of a Gaussian), mean
                                  wavelength. */
    double divergence_y_rad; /**< Likewise along y. */
    double m_squared;      /**< Of the beam, as given. */
    double order_spacing_x; /**< Between orders in u, at the mean wavelength; 0 if the design does not repeat. */
    double order_spacing_y; /**< Likewise in v. */
    uint64_t dot_count;    /**< Wanted dots. */
    uint64_t device_memory_bytes; /**< Taken while it was computed. */
} ClspDoePatternInfo;

/** Copies what is known into *info, whose struct_size the caller has set. */
CLSP_API ClspStatus clspDoePatternGetInfo(ClspDoePattern pattern, ClspDoePatternInfo *info);
/**
 * Copies the texels: radiant intensity in W/sr, for a ClspPatternDesc with CLSP_PROJECTION_DIRECTION_COSINES and
 * CLSP_QUANTITY_RADIANT_INTENSITY. @param count must be image_width x image_height.
 */
CLSP_API ClspStatus clspDoePatternGetTexels(ClspDoePattern pattern, uint64_t count, float *texels);
/** Copies the share of each wanted dot, in the order in which they were given. @param count must be dot_count. */
CLSP_API ClspStatus clspDoePatternGetDotShares(ClspDoePattern pattern, uint64_t count, double *shares);

#ifdef __cplusplus
}
#endif

#endif /* CLSPECKLE_DOE_H */

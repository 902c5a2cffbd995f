/**
 * @file aperture.h
 * @brief The lens's aperture: field, FFT, pupil, inverse FFT, intensity, both polarizations.
 *
 *     U_k = sqrt(I0) z_k              on the field grid (each sample takes I0 of its pixel; padding that of the nearest
 *                                     edge pixel)
 *     V_k = IFFT2( FFT2(U_k) P )      P the amplitude of the pupil, radius D/2 cycles per pixel (CLSP_NORMALIZATION_*)
 *     I   = (1 + p)/2 |V_1|^2 + (1 - p)/2 |V_2|^2                                         (thesis eq. 32 and 40)
 * and with oversampling the mean of I over the samples of each pixel (integration over a fully filled pixel).
 *
 * D = pixel_pitch_m / (wavelength_m * f_number) is the relative diameter, in cycles per pixel. The grid carries
 * frequencies up to oversampling / 2 cycles per pixel and axis, so D <= oversampling is needed; the intensity has twice
 * the field's bandwidth, so it is free of aliasing for D <= oversampling / 2.
 *
 * The circular pupil passes kx^2 GH^2 + ky^2 GW^2 < (1 - 2^-40) (D/s)^2 GW^2 GH^2 / 4 (decided in integers; GW x GH
 * grid, s oversampling): frequencies exactly on the rim are out, as in thesis eq. 24, so the pupil is symmetric.
 */
#ifndef CLSPECKLE_APERTURE_H
#define CLSPECKLE_APERTURE_H

#include "types.h"

#ifdef __cplusplus
extern "C" {
#endif

#define CLSP_PUPIL_CIRCLE 0u  /**< A circle of diameter D, with a soft rim if wanted. */
#define CLSP_PUPIL_IMAGE 1u   /**< Amplitude transmissions from an image. */
#define CLSP_PUPIL_POLYGON 2u /**< A diaphragm of blades: a polygon whose corners lie on the rim (thesis Fig. 8). */
#define CLSP_PUPIL_RING 3u    /**< A circle with its centre blocked. */

/** P is the transmission t, 0 to 1, times the oversampling: a smaller aperture passes less light (~ D^2), and the
 *  oversampling, a matter of sampling only, changes nothing. (z has unit variance on every sample, so its power per
 *  cycle falls as 1 / oversampling^2.) */
#define CLSP_NORMALIZATION_TRANSMISSION 0u
/** P is scaled so that the mean of |P|^2 over the grid's frequencies is 1: mean of I = mean of I0. */
#define CLSP_NORMALIZATION_UNIT_MEAN 1u

/** How an aperture is made. Give relative_diameter, or f_number, pixel_pitch_m and wavelength_m. */
typedef struct ClspApertureDesc {
    uint32_t struct_size; /**< Size of the struct as the caller knows it. */
    uint32_t width;                  /**< Image width in pixels. */
    uint32_t height;                 /**< Image height in pixels. */
    uint32_t oversampling;           /**< Default 1. */
    uint32_t guard_px;               /**< Default 0. */
    uint32_t pupil;                  /**< CLSP_PUPIL_*; default CIRCLE. */
    uint32_t normalization;          /**< CLSP_NORMALIZATION_*; default TRANSMISSION. */
    uint32_t workspace_from_host;    /**< 1: the host gives the work memory by clspApertureSetWorkspace(). Default 0. */
    double relative_diameter;        /**< D in cycles per pixel, > 0; 0 (default): from the three below. */
    double f_number;                 /**< > 0; default 5.6. */
    double pixel_pitch_m;            /**< > 0; default 2.9e-6. */
    double wavelength_m;             /**< > 0; default 940e-9. */
    double soft_rim;                 /**< Part of the way from the axis to the boundary, 0 to 1, over which the
                                          transmission falls to 0 by a raised cosine; default 0. */
    double degree_of_polarization;   /**< p, 0 to 1; default 1. */
    const float *pupil_image;        /**< With CLSP_PUPIL_IMAGE: host memory, pupil_height x pupil_width amplitude
                                          transmissions in [0, 1]; copied. The image covers the square of side D around
                                          the axis, edges on its boundary: looked up bilinearly inside (the edge samples
                                          reach to the boundary), 0 on the boundary and outside. */
    uint32_t pupil_width;            /**< 1 to 16384. */
    uint32_t pupil_height;           /**< 1 to 16384. */
    uint64_t pupil_pitch_bytes;      /**< From row to row; 0 (default) means tightly packed. */
    uint32_t blade_count;            /**< With CLSP_PUPIL_POLYGON: 3 to 32 blades; default 6. */
    uint32_t reserved_blades;        /**< 0. */
    double blade_rotation_rad;       /**< Turns the polygon; 0 (default): a corner points along +x. */
    double blade_curvature;          /**< Blades are arcs through two corners with this curvature times the rim's: 0
                                          (default) straight, 1 the rim itself. */
    double obstruction_ratio;        /**< Radius of the blocked centre over the pupil's, 0 (default) to below 1; any
                                          shape, above 0 with CLSP_PUPIL_RING. */
    double defocus_waves;            /**< w: pupil phase 2 pi w rho^2, rho = 1 at the rim; default 0. */
    /** Aberrations: Noll's Zernike polynomials 4 to 15, RMS waves over the full circular pupil; default 0. */
    double zernike_waves[12];
    /** Light-sensitive part of a pixel's area, above 0 to 1: the intensity is integrated over a centred square of that
     *  area, exactly within the band that D leaves (weights over oversampling + 4 or + 6 samples along each axis). 0
     *  (default): the mean over the pixel's own samples, which without oversampling is a point. Right where D <=
     *  oversampling / 2: beyond, the samples are aliased already. */
    double fill_factor;
    /** Imaginary parts of the amplitude transmissions, whose real parts are pupil_image: as many pixels in rows of the
     *  same pitch; copied. Parts are -1 to 1, magnitudes 0 to 1; looked up as complex numbers. NULL (default):
     *  pupil_image is real. */
    const float *pupil_image_imaginary;
} ClspApertureDesc;

/** Writes the defaults into *desc. @param struct_size sizeof(ClspApertureDesc). */
CLSP_API ClspStatus clspApertureDescInit(ClspApertureDesc *desc, uint32_t struct_size);
/** Makes an aperture; *aperture gets one reference. Computes the pupil, bakes the FFT plan (seconds, the first time on
 *  some devices) and allocates the work memory. */
CLSP_API ClspStatus clspApertureCreate(ClspContext context, const ClspApertureDesc *desc, ClspAperture *aperture);
/** Adds a reference. */
CLSP_API ClspStatus clspApertureRetain(ClspAperture aperture);
/** Drops a reference; with the last one the aperture is gone, once what was enqueued is done. NULL is allowed. */
CLSP_API ClspStatus clspApertureRelease(ClspAperture aperture);

/** What an aperture turned out to be. */
typedef struct ClspApertureInfo {
    uint32_t struct_size; /**< Size of the struct as the caller knows it. */
    uint32_t grid_width;          /**< Size of the FFT; larger than oversampling * width where padding was needed. */
    uint32_t grid_height;         /**< Likewise. */
    uint32_t pupil_samples;       /**< Grid frequencies with a transmission above 0. */
    double relative_diameter;     /**< D in cycles per pixel. */
    double mean_transmission;     /**< Mean of |P|^2 over the grid's frequencies with CLSP_NORMALIZATION_TRANSMISSION:
                                       E[I] / I0 of a flat image, about pi D^2 / 4 for a circle. */
    uint64_t workspace_bytes;     /**< Work memory that a frame needs. */
    char fft_backend[32];         /**< The same as fft_engine. */
    char fft_reason[192];         /**< Why it is "clfft": CLSPECKLE_FFT, a tuning record, the device, the size of the
                                       grid; "" if it is not. */
    char fft_engine[32];          /**< "cpu", "gpu" or "clfft", the names of CLSPECKLE_FFT. */
    uint32_t column_lines;        /**< With "gpu": columns in a work-group; else 0. */
    uint32_t column_work_items;   /**< With "gpu": work-items for each column; else 0. */
    uint32_t row_lines;           /**< With "gpu": rows in a work-group; else 0. */
    uint32_t row_work_items;      /**< With "gpu": work-items for each row; else 0. */
    char fft_source[256];         /**< Whose choice it was: CLSPECKLE_FFT, a tuning record with its size (tuning.h), a
                                       default. Cut to fit. */
} ClspApertureInfo;

/** Fills in *info; its struct_size must be set. */
CLSP_API ClspStatus clspApertureGetInfo(ClspAperture aperture, ClspApertureInfo *info);

/** Gives the work memory (workspace_from_host = 1): at least workspace_bytes from offset_bytes, which must be a
 *  multiple of 4096. It is retained, and its content is undefined after each frame: the host may share it between
 *  apertures that never run at once. No image of a frame may overlap it. */
CLSP_API ClspStatus clspApertureSetWorkspace(ClspAperture aperture, cl_mem mem, uint64_t offset_bytes,
                                             uint64_t size_bytes);

/** Writes P, FFT order (frequency 0 first), after normalization. @param pupil image of grid_width x grid_height;
 *  FLOAT32, or with defocus, aberrations or a complex image FLOAT32X2 (re, im). */
CLSP_API ClspStatus clspApertureEnqueuePupil(ClspAperture aperture, cl_command_queue queue, const ClspImage *pupil,
                                             uint32_t num_events_in_wait_list, const cl_event *event_wait_list,
                                             cl_event *event);

/**
 * Speckles an image.
 * @param phase same width, height, oversampling and guard_px; two polarizations if p < 1. Must have been refreshed
 *                   once.
 * @param irradiance FLOAT32 ideal image I0. NaN, infinite and negative pixels count as 0 (clspPipelineCheck() reports
 *                   them).
 * @param intensity  FLOAT32 image I, fully written; may be the irradiance itself, else must not overlap it.
 */
CLSP_API ClspStatus clspApertureEnqueueIntensity(ClspAperture aperture, cl_command_queue queue, ClspPhase phase,
                                                 const ClspImage *irradiance, const ClspImage *intensity,
                                                 uint32_t num_events_in_wait_list, const cl_event *event_wait_list,
                                                 cl_event *event);

#ifdef __cplusplus
}
#endif

#endif /* CLSPECKLE_APERTURE_H */

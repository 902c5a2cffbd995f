/**
 * @file depth.h
 * @brief Depth from a frame of laser dots: detection with sub-pixel centres, identification, triangulation.
 *
 * **Detection** (on the device, all dots at once). With g the expected dot, exp(-|x|^2 / (2 dot_sigma_px^2)) in a
 * window of n pixels, and S = sum g^2 - (sum g)^2 / n, the dot on an even background that fits best around a pixel has
 * the amplitude
 *     A = (sum g I - mean(g) sum I) / S,       of standard deviation (noise / sqrt(S)),
 * and the correlation with the frame A sqrt(S) / sqrt(sum (I - mean I)^2). A local maximum of A is a dot if A is at
 * least min_amplitude_dn and threshold_sigmas standard deviations, and the correlation at least min_correlation. Then
 * in a window of 2 ceil(3 dot_sigma_px) + 1 pixels
 *     I(x) = background + amplitude exp(-(x - centre)^T C^-1 (x - centre) / 2)
 * is fitted by Levenberg and Marquardt's method (7 parameters), weighted with 1 / variance, four times, each time with
 * the other dots as the fits before saw them subtracted. Where that fails, as speckle makes it, a round dot of
 * dot_sigma_px is fitted (4 parameters). The variance of a pixel is read_noise_dn^2 + dn_per_electron max(I -
 * black_level_dn, 0), and 1/12 for codes (rounding). The covariance of a centre is that of weighted least squares,
 * which is the Cramer-Rao bound; where the noise is unknown, or the fit's residuals exceed it significantly (chi^2 by 4
 * standard deviations), the residuals' variance takes the noise's place. With the lens known (relative_diameter), what
 * speckle adds to it is added: docs/method/dots.md. A second centre is the Gaussian-weighted centroid of the light
 * above the mean of the window's rim.
 *
 * **Geometry.** A camera without distortion (fx, fy, cx, cy; correct centres or frames of a real lens first), a laser
 * at X_L = R X_C + t. Dot j leaves the laser in a known direction; in the camera's frame its points are (m z + b, z),
 * and its image moves along a straight line with the inverse depth q = 1 / z:
 *     x_j(q) = (fx m_x + cx, fy m_y + cy) + q (fx b_x, fy b_y).
 *
 * **Identification.** Candidates of a detected dot are the dots of the pattern whose line between near_m and far_m
 * passes it within epipolar_tolerance_px (and 3 standard deviations of its centre). For each candidate the 12 nearest
 * detected dots testify: does one of their candidates lie on a surface through this one, at a place of its line that
 * differs by at most 0.7 px + g times their distance? g is what a slope of 70 degrees at near_m makes, at most 0.3.
 * Their likelihood ratios against chance, the distance from the line, and the chance that a dot is spurious (2 %) give
 * the probability of each candidate; three rounds, in which neighbours count by their own probabilities. A dot is
 * placed if its best candidate has at least min_confidence; if two detected dots claim one dot of the pattern, the
 * likelier keeps it. Patterns must not repeat along the lines: in a regular lattice whose rows lie along them many
 * candidates are equally likely, and such dots are called ambiguous, not guessed.
 *
 * **Triangulation.** q is that of the point of the line that is nearest in units of the centre's covariance; depth_m =
 * 1 / q, depth_sd_m = sd(q) / q^2, the position lies on the laser's ray. The distance from the line, epipolar_error_px,
 * is zero for a right geometry: a large median over the frame is a warning. Errors of the geometry along the lines (a
 * longer baseline, a turn in the plane of baseline and ray) do not show there.
 */
#ifndef CLSPECKLE_DEPTH_H
#define CLSPECKLE_DEPTH_H

#include "types.h"

#ifdef __cplusplus
extern "C" {
#endif

#define CLSP_MAX_DIRECTIONS 1000000u /**< Dots that a pattern may have. */
#define CLSP_NO_DOT 0xffffffffu      /**< No index of a dot. */

/** @name Bits of ClspDepthDot::flags */
/** @{ */
#define CLSP_DOT_SATURATED 1u  /**< Pixels within 2.5 dot_sigma_px are at saturation_dn or above; they are left out of
                                    the fit. */
#define CLSP_DOT_BORDER 2u     /**< The window is cut by the image's border. */
#define CLSP_DOT_MERGED 4u     /**< Another dot within 3.5 dot_sigma_px, or wider than 1.6 dot_sigma_px. */
#define CLSP_DOT_FIT_FAILED 8u /**< No fit; the centre is that of the pixel, or of the last pass. */
#define CLSP_DOT_FIXED_SHAPE 16u /**< No ellipse fits; fitted as a round dot of dot_sigma_px: place, amplitude and
                                      background. */
/** @} */

/** @name Why a dot was not placed */
/** @{ */
#define CLSP_DEPTH_REASON_PLACED 0u       /**< It was. */
#define CLSP_DEPTH_REASON_FIT_FAILED 1u   /**< It has no centre. */
#define CLSP_DEPTH_REASON_NO_CANDIDATE 2u /**< No dot of the pattern can appear there between near_m and far_m. */
#define CLSP_DEPTH_REASON_UNSUPPORTED 3u  /**< Its neighbours speak against all of its candidates. */
#define CLSP_DEPTH_REASON_AMBIGUOUS 4u    /**< Several candidates are about as likely. */
#define CLSP_DEPTH_REASON_CONFLICT 5u     /**< A likelier detected dot has its place. */
#define CLSP_DEPTH_REASON_OUT_OF_VIEW 6u  /**< Of a dot of the pattern: the camera cannot see it between near_m and
                                               far_m. */
#define CLSP_DEPTH_REASON_NOT_SEEN 7u     /**< Of a dot of the pattern: no detected dot is it. */
/** @} */

/** @name Bits of ClspDepthSummary::warnings */
/** @{ */
#define CLSP_DEPTH_WARNING_NO_DOTS 1u     /**< The frame has no dots. */
#define CLSP_DEPTH_WARNING_FEW_PLACED 2u  /**< Fewer than half of the dots with a centre were placed. */
#define CLSP_DEPTH_WARNING_EPIPOLAR 4u    /**< Of at least 16 placed dots the median epipolar error is above 0.05 px +
                                               twice what the centres' covariances explain. */
#define CLSP_DEPTH_WARNING_SATURATED 8u   /**< More than a tenth of the dots are saturated. */
#define CLSP_DEPTH_WARNING_MERGED 16u     /**< More than a fifth of the dots are merged. */
/** @} */

/** How frames become depth. Values of the frame ("dn") are codes, or whatever unit a FLOAT32 frame has. */
typedef struct ClspDepthDesc {
    uint32_t struct_size;          /**< Size of the struct as the caller knows it. */
    uint32_t width;                /**< Of the frames in pixels, at least 2 ceil(3 dot_sigma_px) + 1, at most 16384. */
    uint32_t height;               /**< Likewise. */
    uint32_t max_dots;             /**< Room for detected dots, 1 to 1000000; default 65536. */
    uint32_t projection;           /**< CLSP_PROJECTION_* (pattern.h) of the directions; default TANGENT_PLANE. */
    uint32_t reserved;             /**< 0. */
    uint64_t direction_count;      /**< Dots of the pattern, at most CLSP_MAX_DIRECTIONS; 0 (default): detection alone,
                                        no geometry. */
    const double *directions;      /**< Host memory, direction_count times x, y in the laser's frame; copied. NULL with
                                        0. */
    double laser_from_camera[12];  /**< [R|t], 3 x 4 row-major, R a rotation, t in metres; default identity, which tells
                                        no depth. */
    double fx_px;                  /**< Focal length in pixels, > 0. No default where there are directions. */
    double fy_px;                  /**< Likewise. */
    double cx_px;                  /**< Principal point; pixel centres are integers. */
    double cy_px;                  /**< Likewise. */
    double near_m;                 /**< Least depth (z in the camera's frame), > 0; default 0.2. */
    double far_m;                  /**< Largest depth, above near_m; default 10. */
    double dot_sigma_px;           /**< Expected width of the dots, 0.5 to 5; default 1.5. A third more or less does
                                        little harm. */
    double min_amplitude_dn;       /**< Dots below it are not looked at, >= 0; default 0. */
    double threshold_sigmas;       /**< Of the noise, >= 0; default 5. Without effect while the noise is unknown. */
    double min_correlation;        /**< With the expected dot, 0 to below 1; default 0.6. */
    double read_noise_dn;          /**< Of the noise in the dark, >= 0; with dn_per_electron 0, too (default):
                                        unknown. */
    double dn_per_electron;        /**< Of the shot noise, >= 0; default 0: none. */
    double black_level_dn;         /**< Value without light; default 0. */
    double saturation_dn;          /**< Pixels at or above are saturated, >= 0; default 0: none is. */
    double epipolar_tolerance_px;  /**< Largest distance from a line that the geometry's errors may cause, above 0 to
                                        20; default 1. */
    double min_confidence;         /**< Least probability of a dot that is placed, 0.5 to below 1; default 0.9. */
    double relative_diameter;      /**< D of the lens (aperture.h) in cycles per pixel, 0.001 to 1000, for the
                                        covariance that speckle gives to centres; 0 (default): not known, covariances
                                        are the noise's. */
    double speckle_contrast;       /**< 0 to 1, default 1, of light before pixels average it: sqrt((1 + p^2) / 2) for
                                        the degree of polarization p, less where speckle moves during the exposure. */
} ClspDepthDesc;

/** A detected dot. The layout is frozen: it never grows. */
typedef struct ClspDepthDot {
    double x_px;                 /**< Centre by the fit. */
    double y_px;                 /**< Likewise. */
    double covariance_px2[3];    /**< Of the centre: xx, xy, yy. NaN if the fit failed. */
    double centroid_x_px;        /**< Centre by the weighted centroid; NaN without light above the background. */
    double centroid_y_px;        /**< Likewise. */
    double amplitude_dn;         /**< Of the Gaussian, above its background. */
    double amplitude_sd_dn;      /**< Its standard deviation by noise. NaN if the fit failed. */
    double background_dn;        /**< Under the dot. */
    double shape_px2[3];         /**< Covariance of the Gaussian, xx, xy, yy: sigma^2 of a round dot, 0, sigma^2. NaN if
                                      the fit failed. */
    double correlation;          /**< With the expected dot, before the fit. */
    double misfit;               /**< chi^2 over its degrees of freedom; 1 where the noise is unknown, NaN if the fit
                                      failed. */
    double depth_m;              /**< z in the camera's frame; NaN unless placed, as all that follows to
                                      position_sd_m. */
    double depth_sd_m;           /**< From the centre's covariance. */
    double position_m[3];        /**< In the camera's frame. */
    double position_sd_m[3];     /**< Fully correlated: the position errs along the laser's ray. */
    double epipolar_error_px;    /**< Signed distance from the line of dot_index; NaN if that is CLSP_NO_DOT. */
    double epipolar_sd_px;       /**< What the centre's covariance explains of it. */
    double confidence;           /**< Probability of dot_index; 0 if that is CLSP_NO_DOT. */
    uint32_t flags;              /**< CLSP_DOT_*. */
    uint32_t reason;             /**< CLSP_DEPTH_REASON_*. */
    uint32_t dot_index;          /**< Of the pattern's dots, the likeliest, also if not placed; CLSP_NO_DOT: no
                                      candidate. */
    uint32_t candidate_count;    /**< Dots of the pattern that could be this one. */
    uint32_t iterations;         /**< Of the last fit. */
    uint32_t reserved;           /**< 0. */
} ClspDepthDot;

/** What became of a dot of the pattern. The layout is frozen: it never grows. */
typedef struct ClspDepthPatternDot {
    uint32_t reason;         /**< CLSP_DEPTH_REASON_PLACED, AMBIGUOUS, OUT_OF_VIEW or NOT_SEEN. */
    uint32_t detected_index; /**< Index of the detected dot; CLSP_NO_DOT unless placed. */
} ClspDepthPatternDot;

/** A frame's result in numbers. */
typedef struct ClspDepthSummary {
    uint32_t struct_size;             /**< Size of the struct as the caller knows it. */
    uint32_t warnings;                /**< Sum of CLSP_DEPTH_WARNING_*. */
    uint64_t detected_count;          /**< Detected dots. */
    uint64_t fitted_count;            /**< Those with a centre. */
    uint64_t placed_count;            /**< Those with a depth. */
    uint64_t saturated_count;         /**< Those with saturated pixels. */
    uint64_t merged_count;            /**< Those that are merged. */
    uint64_t pattern_in_view_count;   /**< Dots of the pattern that the camera could see between near_m and far_m. */
    double median_epipolar_error_px;  /**< Of the magnitude, over placed dots; NaN without any. */
    double expected_epipolar_error_px; /**< The same as the centres' covariances say. */
    double median_sigma_px;           /**< Width of fitted dots, geometric mean of both axes; NaN without any. */
    double median_centre_sd_px;       /**< Of fitted dots, along an axis; NaN without any. */
} ClspDepthSummary;

/** Writes the defaults into *desc. @param struct_size sizeof(ClspDepthDesc). */
CLSP_API ClspStatus clspDepthDescInit(ClspDepthDesc *desc, uint32_t struct_size);
/** Makes an object for frames of one size; *depth gets one reference. Copies the directions, takes the device memory
 *  (16 bytes per pixel and 152 per dot of max_dots) and builds the programs. Fails with CLSP_ERROR_INVALID_DATA for
 *  directions that are none, and with CLSP_ERROR_INVALID_ARGUMENT for a laser in the camera's place. */
CLSP_API ClspStatus clspDepthCreate(ClspContext context, const ClspDepthDesc *desc, ClspDepth *depth);
/** Adds a reference. */
CLSP_API ClspStatus clspDepthRetain(ClspDepth depth);
/** Drops a reference; with the last one the object is gone, once what was enqueued is done. NULL is allowed. */
CLSP_API ClspStatus clspDepthRelease(ClspDepth depth);

/**
 * Detects the dots of a frame. The result stays on the device until clspDepthGetDots() asks for it, or the next frame.
 * @param image UINT8, UINT16 or FLOAT32 of width x height; only read.
 */
CLSP_API ClspStatus clspDepthEnqueueDetect(ClspDepth depth, cl_command_queue queue, const ClspImage *image,
                                           uint32_t num_events_in_wait_list, const cl_event *event_wait_list,
                                           cl_event *event);

/**
 * The dots of the last frame, row by row, each with its depth or the reason why it has none. Blocks: waits for the
 * queue, then identifies and triangulates on the host, once per frame; further calls copy.
 * @param queue    that of clspDepthEnqueueDetect(), or one that has waited for its event.
 * @param capacity elements of `dots`; 0 to ask only for the number.
 * @param dots     array of `capacity` elements; NULL if capacity is 0. If there are more dots, the first ones.
 * @param count    number of detected dots (may exceed capacity).
 * @param summary  with its struct_size set; NULL if not wanted.
 * Fails with CLSP_ERROR_INVALID_STATE before the first frame, CLSP_ERROR_INVALID_DATA for a frame with NaN or infinite
 * pixels, and CLSP_ERROR_UNSUPPORTED for more dots than max_dots.
 */
CLSP_API ClspStatus clspDepthGetDots(ClspDepth depth, cl_command_queue queue, uint64_t capacity, ClspDepthDot *dots,
                                     uint64_t *count, ClspDepthSummary *summary);
/**
 * What became of each dot of the pattern, in the order of the directions; after clspDepthGetDots(), else
 * CLSP_ERROR_INVALID_STATE.
 * @param count number of the pattern's dots (may exceed capacity).
 */
CLSP_API ClspStatus clspDepthGetPatternDots(ClspDepth depth, uint64_t capacity, ClspDepthPatternDot *dots,
                                            uint64_t *count);

/** A reason in words, for example "no dot of the pattern can appear there". Never NULL; "unknown reason" for other
 *  numbers. */
CLSP_API const char *clspDepthReasonString(uint32_t reason);
/** One warning (one bit) in words, with what to do. Never NULL; "unknown warning" for other numbers. */
CLSP_API const char *clspDepthWarningString(uint32_t warning);

#ifdef __cplusplus
}
#endif

#endif /* CLSPECKLE_DEPTH_H */

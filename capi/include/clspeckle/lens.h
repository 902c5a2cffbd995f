/**
 * @file lens.h
 * @brief What a lens does beside diffraction (aperture.h): distortion, glare, ambient light, vignetting.
 *
 * Two commands. Before the speckle forms, enqueueDistort warps the ideal image (or the geometry, the same way); after
 * the aperture, enqueueFinish does the rest on the light that reaches the sensor.
 *
 * Points. With (cx, cy) the principal point, x = (px - cx)/ux, y = (py - cy)/uy and r^2 = x^2 + y^2, an ideal point
 * (px, py) is imaged at (cx + ux x', cy + uy y') (Brown and Conrady; p1, p2 as in OpenCV):
 *
 *     x' = x (1 + k1 r^2 + k2 r^4 + k3 r^6) + 2 p1 x y + p2 (r^2 + 2 x^2)
 *     y' = y (1 + k1 r^2 + k2 r^4 + k3 r^6) + p1 (r^2 + 2 y^2) + 2 p2 x y
 *
 * CLSP_LENS_RADIUS_CORNER: ux = uy = the distance of the farthest corner pixel's centre from (cx, cy), so r = 1 there.
 * CLSP_LENS_RADIUS_FOCAL_LENGTH: ux = focal_length_x_px, uy = focal_length_y_px, OpenCV's convention (cx, cy as its
 * principal point).
 *
 * Images. A pixel q of the distorted image takes the ideal image at the point that is imaged at q, by
 * CLSP_INTERPOLATION_*: radiance is kept, not flux. Sources more than half a pixel outside the ideal image give 0; for
 * FLOAT32X3 and FLOAT32X4 (points, normals) NaN, "no surface".
 *
 * Light. With L the light behind the aperture and h(d) = exp(-|d| / glare_scale_px), scaled to sum 1 over the pixels:
 *
 *     out = v ( (1 - g) L + g (h * L) + ambient )
 *     v   = (1 - vignetting_corner_loss r^2) cos^4
 *     cos^4 = 1 / (1 + ((px - cx)/focal_length_x_px)^2 + ((py - cy)/focal_length_y_px)^2)^2   (if cos4_falloff; else 1)
 * with g = glare_fraction and r = 1 at the farthest corner, whatever radius_unit is. For the glare the image goes on
 * beyond its borders with its edge pixels, so that flat light stays flat.
 */
#ifndef CLSPECKLE_LENS_H
#define CLSPECKLE_LENS_H

#include "types.h"

#ifdef __cplusplus
extern "C" {
#endif

#define CLSP_LENS_RADIUS_CORNER 0u       /**< r = 1 at the farthest corner pixel's centre. */
#define CLSP_LENS_RADIUS_FOCAL_LENGTH 1u /**< r in focal lengths, as in OpenCV's camera model. */

#define CLSP_INTERPOLATION_NEAREST 0u /**< The nearest pixel's value. Masks, materials, motion, positions, depth. */
/** Bilinear. FLOAT32 formats only. */
#define CLSP_INTERPOLATION_LINEAR 1u
/** Bicubic (Keys, a = -1/2): sharper than bilinear. FLOAT32 formats only. Where all 16 pixels are at least 0, so is the
 *  result: undershoot is cut. */
#define CLSP_INTERPOLATION_CUBIC 2u

/** How a lens is made. The defaults change nothing. */
typedef struct ClspLensDesc {
    uint32_t struct_size; /**< Size of the struct as the caller knows it. */
    uint32_t width;                /**< Image width in pixels, 1 to 16384. */
    uint32_t height;               /**< Image height in pixels, 1 to 16384. */
    uint32_t radius_unit;          /**< CLSP_LENS_RADIUS_*: the unit of r in the distortion; default CORNER. */
    uint32_t cos4_falloff;         /**< 1: the cos^4 law, which needs the focal lengths. Default 0. */
    uint32_t principal_point_given; /**< 0 (default): the optical axis meets the image at its centre, ((width - 1) / 2,
                                         (height - 1) / 2); 1: see principal_point. */
    double principal_point_x_px;   /**< cx, where the optical axis meets the image, -65536 to 65536. 0 (default) unless
                                        principal_point_given is 1. */
    double principal_point_y_px;   /**< cy, likewise. */
    double focal_length_x_px;      /**< Focal length over pixel width; default 0: not given. */
    double focal_length_y_px;      /**< Focal length over pixel height; default 0: not given. */
    double k1;                     /**< Radial, r^2; above 0 points move outwards (pincushion). Default 0. */
    double k2;                     /**< Radial, r^4; default 0. */
    double k3;                     /**< Radial, r^6; default 0. */
    double p1;                     /**< Tangential; default 0. */
    double p2;                     /**< Tangential; default 0. */
    double vignetting_corner_loss; /**< 0 to 1; default 0. */
    double glare_fraction;         /**< Part of the light that is spread, 0 to 1; default 0. */
    double glare_scale_px;         /**< > 0 to 16384; default 6. */
    double ambient;                /**< Constant light, in units of intensity, >= 0; default 0. */
} ClspLensDesc;

/** Writes the defaults into *desc. @param struct_size sizeof(ClspLensDesc). */
CLSP_API ClspStatus clspLensDescInit(ClspLensDesc *desc, uint32_t struct_size);
/** Makes a lens; *lens gets one reference. Computes the map of the distortion, which must not fold over within the
 *  image (CLSP_ERROR_INVALID_ARGUMENT), and for glare bakes an FFT plan and waits for the device. */
CLSP_API ClspStatus clspLensCreate(ClspContext context, const ClspLensDesc *desc, ClspLens *lens);
/** Adds a reference. */
CLSP_API ClspStatus clspLensRetain(ClspLens lens);
/** Drops a reference; with the last one the lens is gone, once what was enqueued is done. NULL is allowed. */
CLSP_API ClspStatus clspLensRelease(ClspLens lens);

/** Changes the lens, its size included; later calls use the new one. Does what clspLensCreate() does; after an error
 *  the lens is what it was. */
CLSP_API ClspStatus clspLensConfigure(ClspLens lens, const ClspLensDesc *desc);

/**
 * Warps an image as the lens does.
 * @param interpolation CLSP_INTERPOLATION_*; UINT8, UINT16 and UINT32 images take NEAREST only.
 * @param ideal     image of any format.
 * @param distorted image of the same size and format, fully written; must not overlap the ideal one.
 */
CLSP_API ClspStatus clspLensEnqueueDistort(ClspLens lens, cl_command_queue queue, uint32_t interpolation,
                                           const ClspImage *ideal, const ClspImage *distorted,
                                           uint32_t num_events_in_wait_list, const cl_event *event_wait_list,
                                           cl_event *event);

/**
 * Glare, ambient light, vignetting.
 * @param light   FLOAT32 light behind the aperture. NaN, infinite and negative pixels spread no glare.
 * @param is_dark 1: a dark frame, without ambient light; else 0.
 * @param output  FLOAT32, fully written; may be the light itself, else must not overlap it.
 */
CLSP_API ClspStatus clspLensEnqueueFinish(ClspLens lens, cl_command_queue queue, const ClspImage *light,
                                          uint32_t is_dark, const ClspImage *output, uint32_t num_events_in_wait_list,
                                          const cl_event *event_wait_list, cl_event *event);

/**
 * Where ideal points are imaged, computed on the host in double precision.
 * @param ideal_px     count pairs (x, y), finite.
 * @param count        may be 0.
 * @param distorted_px count pairs; may be ideal_px. Points that the lens does not image, because they lie beyond the
 *                     radius where the distortion turns back, become (NaN, NaN).
 */
CLSP_API ClspStatus clspLensDistortPoints(ClspLens lens, const double *ideal_px, uint64_t count, double *distorted_px);
/**
 * The ideal points behind image points, the inverse of clspLensDistortPoints() to 1e-9 px. Every point of the image has
 * one.
 * @param distorted_px count pairs (x, y), finite.
 * @param count        may be 0.
 * @param ideal_px     count pairs; may be distorted_px. Points where nothing is imaged become (NaN, NaN).
 */
CLSP_API ClspStatus clspLensUndistortPoints(ClspLens lens, const double *distorted_px, uint64_t count,
                                            double *ideal_px);

#ifdef __cplusplus
}
#endif

#endif /* CLSPECKLE_LENS_H */

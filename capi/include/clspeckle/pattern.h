/**
 * @file pattern.h
 * @brief The projected pattern: looked up per pixel as a texture, with 1/d^2, surface cosine, baseline and shadow.
 *
 * For a pixel with position X, unit normal N and albedo a in the geometry frame: X_L = R X + t in the laser frame (the
 * laser at the origin, looking along +z, x to the right, y down), d = |X_L|, w = X_L / d. Nothing arrives where X_L.z
 * <= 0. Pattern coordinates are (X_L.x / X_L.z, X_L.y / X_L.z) (tangent plane) or (w.x, w.y) (direction cosines); the
 * pattern image covers [-half_extent_x, half_extent_x] x [-half_extent_y, half_extent_y], texel edges on the boundary:
 * looked up bilinearly inside (the edge texels reach to the boundary), 0 outside. With J the radiant intensity found
 * there,
 *     irradiance on the surface  E = power_scale * J * max(0, -w . R N) / d^2 * visibility
 *     value of the ideal image   I0 = E * albedo / pi                          (the radiance of a Lambertian surface)
 * Thesis section 3.3; the cosine is Lambert's law.
 *
 * Filters. BILINEAR takes J at the pixel's centre: right where dots are several pixels wide. Where a pixel covers more
 * than a texel, or a dot falls between pixels, light is lost or gained. AREA takes the mean of the same bilinear
 * pattern over the pixel's footprint. That is a rectangle in pattern coordinates, whose sides are the steps to the
 * neighbouring pixels' coordinates, but at least 1/16 texel. Of the two neighbours along each axis the nearer one
 * counts, so that edges of objects do not widen it. The footprints of a surface tile the pattern, so every dot keeps
 * its light at any distance. AREA reads a summed-area table of integers (a unit is 2.3e-10 of the whole pattern;
 * differences are exact) and interpolates it quadratically (the integral of a bilinear function). It takes 36 reads per
 * tap, whatever the footprint's size; mip levels would cost fewer, but blur across and along alike, and do not tile.
 * The rectangle's sides are those of the pattern's axes: with the image turned by an angle r against the pattern, dots
 * much smaller than a pixel keep their light to about 2 r^2; filter_taps > 1 divides the footprint along the image's
 * own axes. Beyond the pattern's edge AREA falls to 0 within half a texel.
 */
#ifndef CLSPECKLE_PATTERN_H
#define CLSPECKLE_PATTERN_H

#include "types.h"

#ifdef __cplusplus
extern "C" {
#endif

#define CLSP_PROJECTION_TANGENT_PLANE 0u      /**< x/z, y/z: a cross-section at unit distance. */
#define CLSP_PROJECTION_DIRECTION_COSINES 1u  /**< x/d, y/d: natural for gratings. */

#define CLSP_QUANTITY_RADIANT_INTENSITY 0u    /**< Pattern values are W/sr (up to a factor). */
/** Pattern values are irradiance on a plane at unit distance, as an image of the pattern on a wall shows: the radiant
 *  intensity is that value divided by the cube of the cosine to the laser's axis. */
#define CLSP_QUANTITY_PLANE_IRRADIANCE 1u

#define CLSP_FILTER_BILINEAR 0u /**< The pattern at the pixel's centre. */
#define CLSP_FILTER_AREA 1u     /**< The pattern's mean over the pixel's footprint. */

#define CLSP_DEPTH_ALONG_AXIS 0u  /**< Depth is the z coordinate in the camera frame. */
#define CLSP_DEPTH_ALONG_RAY 1u   /**< Depth is the distance from the camera centre. */

/** How a pattern is made. */
typedef struct ClspPatternDesc {
    uint32_t struct_size; /**< Size of the struct as the caller knows it. */
    uint32_t projection;          /**< CLSP_PROJECTION_*; default TANGENT_PLANE. */
    uint32_t quantity;            /**< CLSP_QUANTITY_*; default RADIANT_INTENSITY. */
    uint32_t width;               /**< Pattern image width in texels, 2 to 16384. */
    uint32_t height;              /**< Pattern image height in texels, 2 to 16384. */
    uint32_t reserved;            /**< 0. */
    const float *texels;          /**< Host memory, height x width, row 0 first; copied. Finite, >= 0. */
    uint64_t texels_pitch_bytes;  /**< From row to row; 0 (default) means tightly packed. */
    double half_extent_x;         /**< In pattern coordinates; default 0.5. */
    double half_extent_y;         /**< In pattern coordinates; default 0.5. */
    double power_scale;           /**< Factor on the pattern values; default 1. */
    double laser_from_geometry[12]; /**< [R|t], 3 x 4 row-major, R a rotation, t in metres; default identity. */
    uint32_t filter;              /**< CLSP_FILTER_*; default BILINEAR. */
    uint32_t filter_taps;         /**< AREA: rectangles of the footprint along each axis of the image, 1 (default) to
                                       4. */
} ClspPatternDesc;

/** Writes the defaults into *desc. @param struct_size sizeof(ClspPatternDesc). */
CLSP_API ClspStatus clspPatternDescInit(ClspPatternDesc *desc, uint32_t struct_size);
/** Makes a pattern; *pattern gets one reference. Copies the texels to the device. Fails with CLSP_ERROR_INVALID_DATA
 *  for texels that are NaN, infinite or negative. */
CLSP_API ClspStatus clspPatternCreate(ClspContext context, const ClspPatternDesc *desc, ClspPattern *pattern);
/** Adds a reference. */
CLSP_API ClspStatus clspPatternRetain(ClspPattern pattern);
/** Drops a reference; with the last one the pattern is gone, once what was enqueued is done. NULL is allowed. */
CLSP_API ClspStatus clspPatternRelease(ClspPattern pattern);

/** Moves the laser; later Enqueue calls use the new pose. @param laser_from_geometry 12 doubles, see
 *  ClspPatternDesc. */
CLSP_API ClspStatus clspPatternSetPose(ClspPattern pattern, const double laser_from_geometry[12]);

/** What a renderer knows about every pixel. Give `position`, or `depth` with the intrinsics. All images have the same
 *  size. */
typedef struct ClspGeometry {
    uint32_t struct_size; /**< Size of the struct as the caller knows it. */
    uint32_t depth_kind;     /**< CLSP_DEPTH_*; default ALONG_AXIS. */
    ClspImage position;      /**< FLOAT32X3 or X4, metres. NaN or infinite: no surface here, nothing is returned. */
    ClspImage depth;         /**< FLOAT32, metres; the geometry frame is then the camera frame. <= 0, NaN, infinite: no
                                  surface. */
    ClspImage normal;        /**< FLOAT32X3 or X4, unit length, towards the camera; optional: without it the surface
                                  faces the laser. */
    ClspImage albedo;        /**< FLOAT32 in [0, 1]; optional: 1. NaN or negative values count as invalid data and as
                                  0. */
    ClspImage visibility;    /**< FLOAT32 in [0, 1] or UINT8 (0 to 255): does the laser see the point; optional: 1. */
    double fx_px;            /**< Focal length in pixels, for depth. */
    double fy_px;            /**< Likewise, vertically. */
    double cx_px;            /**< Principal point, for depth. */
    double cy_px;            /**< Likewise, vertically. */
} ClspGeometry;

/** Writes the defaults (no images) into *geometry. @param struct_size sizeof(ClspGeometry). */
CLSP_API ClspStatus clspGeometryInit(ClspGeometry *geometry, uint32_t struct_size);

/**
 * Computes the ideal infrared image.
 * @param irradiance FLOAT32 image of the size of the geometry, fully written; must not overlap an input.
 */
CLSP_API ClspStatus clspPatternEnqueueLookup(ClspPattern pattern, cl_command_queue queue, const ClspGeometry *geometry,
                                             const ClspImage *irradiance, uint32_t num_events_in_wait_list,
                                             const cl_event *event_wait_list, cl_event *event);

#ifdef __cplusplus
}
#endif

#endif /* CLSPECKLE_PATTERN_H */

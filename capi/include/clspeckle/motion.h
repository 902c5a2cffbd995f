/**
 * @file motion.h
 * @brief How far each pixel's surface point has moved since the last frame, in units of its speckle's correlation
 *        lengths.
 *
 * X is the position of the surface point at a pixel in the camera's frame (x to the right, y down, z forward), X' the
 * position of the same point in the camera's frame of the previous frame. Laser and camera are one device, so a moving
 * device and a moving scene are the same. With v = X / |X| the direction of view, delta = X - X' and a the angle by
 * which the surface turned,
 *     axial = delta . v      lateral = |delta - axial v|
 *     path = sqrt((lateral / lateral_correlation_length_m)^2 + (axial / axial_correlation_length_m)^2 +
 *                 (a / rotation_correlation_angle_rad)^2)     with the lengths of the pixel's material (material.h;
 *                                                             thesis 3.2.4 to 3.2.6)
 *     correlation = exp(-frame_time_s / correlation_time_s)      (thesis 3.2.8); 0 where correlation_time_s is 0
 *     shift = pixel of X' minus pixel of X
 * which is what clspPhaseEnqueueAdvance() takes. A path of infinity means that the point is new: it was hidden, outside
 * of the image or behind the camera, or its past is not a number. The thesis's rule (3.3) is the mask: path >
 * replace_threshold, or 1 - correlation > replace_threshold.
 *
 * The previous position is found in one of three ways:
 *  (a) previous_position: X' of the same surface point, for each pixel. previous_normal likewise.
 *  (b) previous_from_current: X' = R X + t, for all pixels (a static scene and a moving device) or for each material
 *      (rigid bodies). The angle is that of R. previous_depth or previous_position (and previous_material) may come
 *      along as the previous frame's own images: where the one at the point's previous pixel shows another surface, the
 *      point was hidden.
 *  (c) motion and the previous frame's own previous_depth or previous_position (previous_normal, previous_material):
 *      looked up at pixel + motion. The same check tells what was hidden. X and X' lie in the directions of pixel and
 *      pixel + motion; the depth of X' is interpolated between the pixels of the same surface.
 * In (a) and (c) the angle is that between the normals, 0 without them, and does not see a surface that turns about its
 * own normal; with roll_from_motion (c) takes that from the curl of the motion vectors, in quadrature.
 */
#ifndef CLSPECKLE_MOTION_H
#define CLSPECKLE_MOTION_H

#include "material.h"
#include "pattern.h"
#include "types.h"

#ifdef __cplusplus
extern "C" {
#endif

#define CLSP_MOTION_CORRELATE 0u  /**< A pipeline carries the phase on along the path. */
#define CLSP_MOTION_REPLACE 1u    /**< A pipeline draws the phase anew where the mask says so (thesis 3.3). */

/** How a motion is made. */
typedef struct ClspMotionDesc {
    uint32_t struct_size; /**< Size of the struct as the caller knows it. */
    uint32_t width;               /**< Image width in pixels, 1 to 16384. */
    uint32_t height;              /**< Image height in pixels, 1 to 16384. */
    uint32_t rule;                /**< CLSP_MOTION_*, for pipelines; default CORRELATE. */
    uint32_t translate;           /**< 1: a pipeline moves the phase, which must have `translate` too, with the surface;
                                       default 0. */
    uint32_t depth_kind;          /**< CLSP_DEPTH_* of depth and previous_depth; default ALONG_AXIS. */
    ClspMaterialTable materials;  /**< NULL (default): one material, that of clspMaterialInit(). Retained. */
    double fx_px;                 /**< Focal length in pixels; 0 (default): not known, enough for (a) and (b) with
                                       positions alone. */
    double fy_px;                 /**< Likewise, vertically. */
    double cx_px;                 /**< Principal point; default 0. */
    double cy_px;                 /**< Likewise, vertically. */
    double replace_threshold;     /**< For the mask, >= 0; default 0.01. */
    double occlusion_tolerance;   /**< Relative difference of depth above which two points are on different surfaces, >=
                                       0; default 0.02. */
} ClspMotionDesc;

/** Writes the defaults into *desc. @param struct_size sizeof(ClspMotionDesc). */
CLSP_API ClspStatus clspMotionDescInit(ClspMotionDesc *desc, uint32_t struct_size);
/** Makes a motion; *motion gets one reference. Fails with CLSP_ERROR_WRONG_CONTEXT for materials of another context. */
CLSP_API ClspStatus clspMotionCreate(ClspContext context, const ClspMotionDesc *desc, ClspMotion *motion);
/** Adds a reference. */
CLSP_API ClspStatus clspMotionRetain(ClspMotion motion);
/** Drops a reference; with the last one the motion is gone, once what was enqueued is done. NULL is allowed. */
CLSP_API ClspStatus clspMotionRelease(ClspMotion motion);

/** What the renderer knows about two frames. All images have the size of the motion; those that are left out have mem
 *  NULL. */
typedef struct ClspMotionInput {
    uint32_t struct_size; /**< Size of the struct as the caller knows it. */
    uint32_t transform_count;             /**< Transforms in previous_from_current: 0, 1 (all pixels) or as many as
                                               materials. */
    const double *previous_from_current;  /**< Host memory, transform_count x [R|t], 3 x 4 row-major, t in metres;
                                               copied. */
    double frame_time_s;                  /**< Time since the previous frame, >= 0; default 0. */
    uint32_t roll_from_motion;            /**< 1: rotation about the direction of view from the curl of the motion
                                               vectors; default 0. */
    uint32_t reserved;                    /**< 0. */
    ClspImage position;           /**< FLOAT32X3 or X4, metres, camera frame. NaN, infinite or z <= 0: no surface. This
                                       or depth. */
    ClspImage depth;              /**< FLOAT32, metres. <= 0, NaN or infinite: no surface. */
    ClspImage normal;             /**< FLOAT32X3 or X4, camera frame, any length but 0; used with previous_normal. */
    ClspImage material;           /**< UINT8, entries of the table; without it all is of the first one. */
    ClspImage motion;             /**< FLOAT32X2 (x, y), pixels: previous pixel minus current pixel of the same surface
                                       point. */
    ClspImage previous_position;  /**< FLOAT32X3 or X4: of the same point (a), or the previous frame's own (b, c). */
    ClspImage previous_depth;     /**< FLOAT32: the previous frame's own (b, c). */
    ClspImage previous_normal;    /**< FLOAT32X3 or X4, previous camera frame: of the same point (a), or the previous
                                       frame's own (c). */
    ClspImage previous_material;  /**< UINT8: the previous frame's own (b, c). */
} ClspMotionInput;

/** Writes the defaults (no images) into *input. @param struct_size sizeof(ClspMotionInput). */
CLSP_API ClspStatus clspMotionInputInit(ClspMotionInput *input, uint32_t struct_size);

/** Where to write; at least one image, none may overlap another one or an input. Pixels without a surface get 0, 1, (0,
 *  0), (0, 0, 0) and 0. */
typedef struct ClspMotionOutput {
    uint32_t struct_size; /**< Size of the struct as the caller knows it. */
    uint32_t reserved;       /**< 0. */
    ClspImage path;          /**< FLOAT32, correlation lengths; infinity: the point is new. */
    ClspImage correlation;   /**< FLOAT32, 0 to 1. */
    ClspImage shift;         /**< FLOAT32X2 (x, y), pixels; 0 where the point is new. */
    ClspImage displacement;  /**< FLOAT32X3: lateral in metres, axial in metres (> 0: away), angle in radians; NaN where
                                  new. */
    ClspImage mask;          /**< UINT8: 1 where the thesis's rule draws a new phase. */
} ClspMotionOutput;

/** Writes the defaults (no images) into *output. @param struct_size sizeof(ClspMotionOutput). */
CLSP_API ClspStatus clspMotionOutputInit(ClspMotionOutput *output, uint32_t struct_size);

/** Computes the outputs that are given. Surface points with a past that is not a number, and material ids outside of
 *  the table, count as bad pixels, see clspMotionCheck(). */
CLSP_API ClspStatus clspMotionEnqueueCompute(ClspMotion motion, cl_command_queue queue, const ClspMotionInput *input,
                                             const ClspMotionOutput *output, uint32_t num_events_in_wait_list,
                                             const cl_event *event_wait_list, cl_event *event);

/** Waits for the queue and reports the bad pixels of all calls since the last check: CLSP_SUCCESS if there were none,
 *  else CLSP_ERROR_INVALID_DATA with their number and the first one's place. */
CLSP_API ClspStatus clspMotionCheck(ClspMotion motion, cl_command_queue queue);

#ifdef __cplusplus
}
#endif

#endif /* CLSPECKLE_MOTION_H */

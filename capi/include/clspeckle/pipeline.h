/**
 * @file pipeline.h
 * @brief A whole frame as one enqueued command: the laser's light (pattern, dots or an ideal image), motion, phase,
 *        aperture, lens, sensor.
 *
 * In the order of the light; each step is there only if something asks for it:
 *
 *     I0           from the pattern and the geometry, from dots, or the frame's irradiance
 *     distortion   I0, material, motion, mask as the lens shows them (lens.h); a shift s becomes J^-1 s, J the slope of
 *                  the map from distorted to ideal pixels
 *     sub-surface  a fraction f of I0 is spread by h(r) ~ exp(-r / L), sum of h over the pixels 1; with materials f is
 *                  that of each pixel: I0 <- (1 - f) I0 + h * (f I0)
 *     phase        refreshed, or carried on along the motion (phase.h, motion.h); without motion
 *                  z <- r z + sqrt(1 - r^2) w with r = exp(-1 / boiling_correlation_frames)
 *     field        U_k = sqrt(I0) (sqrt(1 - c) z + sqrt(c) / oversampling) exp(i k s h) exp(i a) (the pupil's
 *                  amplitudes carry the oversampling as a factor, for white noise; a constant field must not get it):
 *                  coherent fraction c (low roughness), a line of the laser at k with the surface's height h (standard
 *                  normal, Philox stream 0x30, at the frame index of the last full refresh) and s = dephasing_rad, the
 *                  airflow's phase a. Lines lie evenly in [-2, 2] and carry light in proportion to exp(-k^2 / 2). Each
 *                  sample of the field grid has one height; oversampling brings more of them into a grain. A saved
 *                  phase does not hold the heights
 *     aperture     both polarizations, summed over the lines and the sub-exposures; with materials the weights
 *                  (1 + p)/2 and (1 - p)/2 are those of each pixel, on |U|^2
 *     light        times max(0, 1 + power_flicker n), n standard normal, one for a frame (stream 0x33); shifted by
 *                  vibration_rms_px (n_x, n_y) (stream 0x34), by a phase ramp over the pupil
 *     lens         glare, ambient light, vignetting (lens.h)
 *     sensor       sensor.h
 *
 * Airflow, vibration and boiling disturb a scene at rest: frames with CLSP_REFRESH_ALL have none. An exposure_path L is
 * for those: while the shutter is open the field's correlation falls, as R of phase.h with CLSP_DYNAMICS_CONTINUOUS,
 * else as exp(-path), or, if exposure_correlation says so, as exp(-path^2), that of a Gaussian spot of light carried
 * over a surface. The frame is the mean of sub-exposures, whose steps are such that the contrast is that of the
 * continuous exposure (Goodman, Statistical Optics, 6.2):
 *     C^2 = 2 / L^2 int_0^L (L - l) rho(l)^2 dl
 * Where a motion stage says how far each pixel's surface went, shutter_fraction of that path is gone during the
 * exposure.
 */
#ifndef CLSPECKLE_PIPELINE_H
#define CLSPECKLE_PIPELINE_H

#include "aperture.h"
#include "dots.h"
#include "lens.h"
#include "material.h"
#include "motion.h"
#include "pattern.h"
#include "phase.h"
#include "sensor.h"
#include "types.h"

#ifdef __cplusplus
extern "C" {
#endif

#define CLSP_EXPOSURE_CORRELATION_FIELD 0u    /**< The field's own: R of phase.h with CLSP_DYNAMICS_CONTINUOUS, else
                                                   exp(-path). */
#define CLSP_EXPOSURE_CORRELATION_GAUSSIAN 1u /**< exp(-path^2), path up to 32: the weighted sum of a few independent
                                                   patterns that is the same light (Karhunen and Loeve; Goodman,
                                                   Statistical Optics, 6.2). sub_exposures must be 0. */

/** Which stages a pipeline runs; it retains them. All must come from the same context and have the same image size.
 *  Stages may be shared by several pipelines, which then count as one handle for the thread rule, and whose frames must
 *  run one after the other. */
typedef struct ClspPipelineDesc {
    uint32_t struct_size; /**< Size of the struct as the caller knows it. */
    uint32_t reserved;      /**< 0. */
    ClspPattern pattern;    /**< NULL: frames bring an ideal image. */
    ClspPhase phase;        /**< Required. */
    ClspAperture aperture;  /**< Required; same grid as the phase. */
    ClspSensor sensor;      /**< NULL: the output is the FLOAT32 intensity. */
    ClspDots dots;          /**< Ideal dots instead of a pattern; NULL: none. */
    ClspMaterialTable materials; /**< Roughness, polarization and sub-surface fraction by material; NULL: none. Frames
                                      then bring material ids. */
    ClspMotion motion;      /**< NULL: frames bring no motion. */
    ClspLens lens;          /**< NULL: an ideal one. */
    uint64_t seed;          /**< Of flicker, vibration, surface heights and airflow; default 0. */
    uint32_t line_count;    /**< Lines of the laser, 1 (default) to 63. */
    uint32_t sub_exposures; /**< Parts of an exposure, at most 127; 0 (default): as many as exposure_path takes, one
                                 without. */
    double dephasing_rad;   /**< s, the standard deviation over the surface of the phase by which a line at k = 1
                                 differs from that at 0; default 0. */
    double power_flicker;   /**< Relative standard deviation of the laser's power from frame to frame; default 0. */
    double coherent_fraction;    /**< c, 0 (default) to 1; with materials, which say it themselves, 0. */
    double subsurface_length_px; /**< L, in pixels; needed above 0 with a fraction. Default 0. */
    double subsurface_fraction;  /**< f, 0 (default) to 1; with materials, which say it themselves, 0. */
    double exposure_path;   /**< L, path of the surface in correlation lengths while the shutter is open, in frames with
                                 CLSP_REFRESH_ALL; default 0. Needs a circular Gaussian field. */
    double boiling_correlation_frames; /**< Frames after which a resting surface's field correlation is 1/e, > 0;
                                            default infinity: it never changes. */
    double airflow_rms_rad;      /**< Standard deviation of the phase screen; default 0. */
    double airflow_scale_px;     /**< Distance at which its correlation is 1/e; default 6. */
    double airflow_correlation_frames; /**< Frames after which its correlation is 1/e, where the wind has carried it;
                                            default 3. */
    double vibration_rms_px;     /**< Standard deviation of the picture's shift along each axis; default 0. */
    double shutter_fraction;     /**< Part of the time between two frames that the shutter is open, 0 (default) to 1: so
                                      much of a frame's motion (its path, with CLSP_MOTION_CORRELATE) happens in the
                                      exposure, over sub_exposures (automatic: 8). That many patterns are averaged at
                                      most, so a path of more than half as many correlation lengths needs more of them.
                                      What is new in a frame is drawn once for its exposure. The light itself does not
                                      blur. */
    uint32_t exposure_correlation; /**< CLSP_EXPOSURE_CORRELATION_*, with an exposure_path; default FIELD. */
    uint32_t reserved_exposure;    /**< 0. */
    double airflow_wind_px;        /**< How far the wind carries the phase screen in a frame, in pixels to the right,
                                        -1e6 to 1e6; default 0. Frozen air has an infinite airflow_correlation_frames,
                                        too. The screen is periodic on the field grid, and comes back after its
                                        width. */
} ClspPipelineDesc;

/** Writes the defaults into *desc. @param struct_size sizeof(ClspPipelineDesc). */
CLSP_API ClspStatus clspPipelineDescInit(ClspPipelineDesc *desc, uint32_t struct_size);
/** Makes a pipeline; *pipeline gets one reference. Checks that the stages fit together and allocates the image between
 *  them. Fails with CLSP_ERROR_WRONG_CONTEXT for a stage of another context. */
CLSP_API ClspStatus clspPipelineCreate(ClspContext context, const ClspPipelineDesc *desc, ClspPipeline *pipeline);
/** Adds a reference. */
CLSP_API ClspStatus clspPipelineRetain(ClspPipeline pipeline);
/** Drops a reference; with the last one the pipeline is gone, once what was enqueued is done. NULL is allowed. */
CLSP_API ClspStatus clspPipelineRelease(ClspPipeline pipeline);

#define CLSP_REFRESH_MASK 0u  /**< New phases where refresh_mask is not 0; nowhere if there is no mask. */
#define CLSP_REFRESH_ALL 1u   /**< New phases everywhere: independent of all frames with another frame_index. */

#define CLSP_ILLUMINATION_LASER 0u       /**< The laser's light: speckle. */
#define CLSP_ILLUMINATION_INCOHERENT 1u  /**< Incoherent light (an LED, a lamp) from the frame's irradiance: no speckle,
                                              imaged without diffraction but with the lens's distortion; the pupil's
                                              mean transmission counts. The pipeline's pattern or dots are off. Surfaces
                                              move, live and are refreshed as in a frame of the laser, here and in the
                                              dark. */
#define CLSP_ILLUMINATION_DARK 2u        /**< No light at all, ambient light neither: a covered lens. */

/** One frame. */
typedef struct ClspFrame {
    uint32_t struct_size; /**< Size of the struct as the caller knows it. */
    uint32_t refresh;              /**< CLSP_REFRESH_*; default MASK. The first frame always draws all phases. */
    uint64_t frame_index;          /**< Counter of the noise and of refreshed phases, below 2^48; default 0. Frames that
                                        move or live (motion, boiling, airflow) must each have another one: the same
                                        index draws the same numbers. */
    const ClspGeometry *geometry;  /**< With a pattern. */
    ClspImage irradiance;          /**< Without a pattern: FLOAT32 ideal image. */
    ClspImage refresh_mask;        /**< UINT8; optional. */
    ClspImage output;              /**< UINT16, UINT8 or FLOAT32 as ClspSensor takes; FLOAT32 without a sensor. Must not
                                        overlap an input. */
    const ClspMotionInput *motion; /**< How the scene moved since the last frame, with a motion stage; NULL: it
                                        rests. */
    ClspImage material;            /**< UINT8 material ids; needed with a material table. Also of a motion stage with a
                                        table, where its input brings none. */
    uint32_t illumination;         /**< CLSP_ILLUMINATION_*; default LASER. */
    uint32_t reserved;             /**< 0. */
} ClspFrame;

/** Writes the defaults (no images, frame 0) into *frame. @param struct_size sizeof(ClspFrame). */
CLSP_API ClspStatus clspFrameInit(ClspFrame *frame, uint32_t struct_size);

/** Renders a frame. The queue may be in-order or out-of-order; frames of one pipeline must run one after the other (an
 *  in-order queue, or a wait on the last frame's event). A frame that is refused leaves all as it was, and so does one
 *  that fails (a device error) where surface and air carry nothing from frame to frame: it can be tried again. Several
 *  frames of one call that fail lose the sensor's lag, too: it begins anew with them.
 *  @return CLSP_ERROR_INVALID_STATE after a frame that failed when it had begun to move them, until a frame has
 *          CLSP_REFRESH_ALL. */
CLSP_API ClspStatus clspPipelineEnqueueFrame(ClspPipeline pipeline, cl_command_queue queue, const ClspFrame *frame,
                                             uint32_t num_events_in_wait_list, const cl_event *event_wait_list,
                                             cl_event *event);

/** Renders several frames, one after the other: as many calls of clspPipelineEnqueueFrame(), of which each waits for
 *  the one before on any queue. All are checked before the first is enqueued: if one is refused, none is, and the
 *  message says which.
 *  @param count elements of `frames`, above 0. @param frames all with the same struct_size. @param event of the last
 *               frame. */
CLSP_API ClspStatus clspPipelineEnqueueFrames(ClspPipeline pipeline, cl_command_queue queue, uint32_t count,
                                              const ClspFrame *frames, uint32_t num_events_in_wait_list,
                                              const cl_event *event_wait_list, cl_event *event);

/** Renders a frame like the ones to come and waits: programs are built, kernels specialised, FFT plans warm, so that
 *  the next such frame is enqueued without a delay. Writes the frame's output; leaves the phase state as it was; the
 *  sensor's lag and the airflow begin anew. */
CLSP_API ClspStatus clspPipelineWarmUp(ClspPipeline pipeline, cl_command_queue queue, const ClspFrame *frame);

/** Waits for the queue and reports bad pixels (NaN, infinite or negative irradiance or albedo, which were taken as 0)
 *  of all frames since the last check: CLSP_SUCCESS if none, else CLSP_ERROR_INVALID_DATA with their number and the
 *  first one's place. */
CLSP_API ClspStatus clspPipelineCheck(ClspPipeline pipeline, cl_command_queue queue);

/**
 * One frame in one call, from host memory to host memory: makes aperture, surface (phase.h's defaults) and sensor,
 * renders, frees all. Blocks. The result depends on the arguments alone, and is that of a pipeline's first frame. For a
 * sequence make a pipeline: this pays the set-up each time. May be called from any number of threads at once, also with
 * one context.
 * @param context NULL: the best device, or the one that CLSPECKLE_DEVICE names. Programs stay in a context, so several
 *                calls with one are faster.
 * @param width,height pixels, 1 to 16384.
 * @param irradiance height x width floats, tightly packed: the ideal image, finite, >= 0.
 * @param aperture NULL: the defaults. Its width and height are 0 or those of the image; workspace_from_host is 0.
 * @param sensor NULL: the defaults. Width and height likewise; a seed of 0 stands for `seed`.
 * @param seed of the speckle and of all that the sensor draws.
 * @param frame_index counter of the speckle and of the noise, below 2^48: another one, another frame.
 * @param codes height x width codes, tightly packed; left as it is if the call fails.
 * @return CLSP_ERROR_INVALID_DATA for pixels that are NaN, infinite or negative: the message has their number and the
 *         first one's place.
 */
CLSP_API ClspStatus clspSimulate(ClspContext context, uint32_t width, uint32_t height, const float *irradiance,
                                 const ClspApertureDesc *aperture, const ClspSensorDesc *sensor, uint64_t seed,
                                 uint64_t frame_index, uint16_t *codes);

/** Device time of one stage of the last frame. Layout frozen. */
typedef struct ClspStageTiming {
    char stage[32];       /**< "pattern", "dots", "motion", "distortion", "subsurface", "airflow", "phase", "field",
                               "fft", "pupil", "inverse_fft", "intensity", "lens", "own_effect", "sensor". With the
                               engines "cpu" and "gpu" (ClspApertureInfo::fft_engine) "fft" holds the field, and
                               "inverse_fft" the intensity, and also the sensor of a frame of laser light, if neither
                               crosstalk, oversampling, a fill factor nor the lens's glare, vignetting or ambient light
                               stands between. */
    double milliseconds;  /**< Sum over the stage's commands. */
} ClspStageTiming;

/**
 * Waits for the last frame and gives its time per stage, in order. The frame's queue must have profiling on
 * (CLSP_QUEUE_PROFILING or CL_QUEUE_PROFILING_ENABLE), else CLSP_ERROR_INVALID_STATE.
 * @param capacity elements in `timings`. @param count stages that there are.
 */
CLSP_API ClspStatus clspPipelineGetTimings(ClspPipeline pipeline, uint32_t capacity, ClspStageTiming *timings,
                                           uint32_t *count);

#ifdef __cplusplus
}
#endif

#endif /* CLSPECKLE_PIPELINE_H */

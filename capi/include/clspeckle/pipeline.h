/**
 * @file pipeline.h
 * @brief A whole frame as one enqueued command: pattern (optional), phase refresh, aperture, sensor (optional).
 */
#ifndef CLSPECKLE_PIPELINE_H
#define CLSPECKLE_PIPELINE_H

#include "aperture.h"
#include "pattern.h"
#include "phase.h"
#include "sensor.h"
#include "types.h"

#ifdef __cplusplus
extern "C" {
#endif

/** Which stages a pipeline runs; it retains them. All must come from the same context and have the same image size. Stages may be shared
 *  by several pipelines, which then count as one handle for the thread rule, and whose frames must run one after the other. */
typedef struct ClspPipelineDesc {
    uint32_t struct_size; /**< Size of the struct as the caller knows it. */
    uint32_t reserved;      /**< 0. */
    ClspPattern pattern;    /**< NULL: frames bring an ideal image. */
    ClspPhase phase;        /**< Required. */
    ClspAperture aperture;  /**< Required; same grid as the phase. */
    ClspSensor sensor;      /**< NULL: the output is the FLOAT32 intensity. */
} ClspPipelineDesc;

/** Writes the defaults into *desc. @param struct_size sizeof(ClspPipelineDesc). */
CLSP_API ClspStatus clspPipelineDescInit(ClspPipelineDesc *desc, uint32_t struct_size);
/** Makes a pipeline; *pipeline gets one reference. Checks that the stages fit together and allocates the image between them. Fails with CLSP_ERROR_WRONG_CONTEXT for a stage of another context. */
CLSP_API ClspStatus clspPipelineCreate(ClspContext context, const ClspPipelineDesc *desc, ClspPipeline *pipeline);
/** Adds a reference. */
CLSP_API ClspStatus clspPipelineRetain(ClspPipeline pipeline);
/** Drops a reference; with the last one the pipeline is gone, once what was enqueued is done. NULL is allowed. */
CLSP_API ClspStatus clspPipelineRelease(ClspPipeline pipeline);

#define CLSP_REFRESH_MASK 0u  /**< New phases where refresh_mask is not 0; nowhere if there is no mask. */
#define CLSP_REFRESH_ALL 1u   /**< New phases everywhere: independent of all frames with another frame_index. */

/** One frame. */
typedef struct ClspFrame {
    uint32_t struct_size; /**< Size of the struct as the caller knows it. */
    uint32_t refresh;              /**< CLSP_REFRESH_*; default MASK. The first frame always draws all phases. */
    uint64_t frame_index;          /**< Counter of the noise and of refreshed phases, below 2^48; default 0. */
    const ClspGeometry *geometry;  /**< With a pattern. */
    ClspImage irradiance;          /**< Without a pattern: FLOAT32 ideal image. */
    ClspImage refresh_mask;        /**< UINT8; optional. */
    ClspImage output;              /**< UINT16, UINT8 or FLOAT32 as ClspSensor takes; FLOAT32 without a sensor. Must not overlap an input. */
} ClspFrame;

/** Writes the defaults (no images, frame 0) into *frame. @param struct_size sizeof(ClspFrame). */
CLSP_API ClspStatus clspFrameInit(ClspFrame *frame, uint32_t struct_size);

/** Renders a frame. The queue may be in-order or out-of-order; frames of one pipeline must run one after the other (an in-order
 *  queue, or a wait on the last frame's event). */
CLSP_API ClspStatus clspPipelineEnqueueFrame(ClspPipeline pipeline, cl_command_queue queue, const ClspFrame *frame,
                                             uint32_t num_events_in_wait_list, const cl_event *event_wait_list,
                                             cl_event *event);

/** Renders a frame like the ones to come and waits: programs are built, kernels specialised, FFT plans warm, so that the next such
 *  frame is enqueued without a delay. Writes the frame's output; leaves the phase state as it was. */
CLSP_API ClspStatus clspPipelineWarmUp(ClspPipeline pipeline, cl_command_queue queue, const ClspFrame *frame);

/** Waits for the queue and reports bad pixels (NaN, infinite or negative irradiance or albedo, which were taken as 0) of all
 *  frames since the last check: CLSP_SUCCESS if none, else CLSP_ERROR_INVALID_DATA with their number and the first one's place. */
CLSP_API ClspStatus clspPipelineCheck(ClspPipeline pipeline, cl_command_queue queue);

/** Device time of one stage of the last frame. Layout frozen. */
typedef struct ClspStageTiming {
    char stage[32];       /**< "pattern", "phase", "field", "fft", "pupil", "inverse_fft", "intensity", "sensor". */
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

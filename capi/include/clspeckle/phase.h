/**
 * @file phase.h
 * @brief The surface's random field: persistent, refreshed where a mask says so.
 *
 * The field lives on the field grid: `oversampling` samples per pixel and axis, padded to a size that the FFT takes
 * (clspFieldGridCompute()). Each sample holds z, E|z|^2 = 1: exp(i phi) with phi uniform (`unit phasor`, the thesis's choice)
 * or a circular complex Gaussian number (`circular Gaussian`, the limit of very many scatterers per pixel; contrast 1 for any
 * aperture). A refreshed sample takes phi from Philox stream 1 + polarization and, if Gaussian, |z| = sqrt(-ln u) with u from stream
 * 3 + polarization, at the frame index of the refresh. A sample follows the mask of its pixel; padding follows the nearest edge
 * pixel, counted around the (periodic) border; the middle of an odd padding follows the last pixel.
 */
#ifndef CLSPECKLE_PHASE_H
#define CLSPECKLE_PHASE_H

#include "types.h"

#ifdef __cplusplus
extern "C" {
#endif

/** Size of the field grid of an image. Layout frozen. */
typedef struct ClspFieldGrid {
    uint32_t width;         /**< Image width in pixels, 1 to 16384. */
    uint32_t height;        /**< Image height in pixels, 1 to 16384. */
    uint32_t oversampling;  /**< Field samples per pixel along each axis, 1 to 8. */
    uint32_t guard_px;      /**< At least this many pixels of padding, against light that wraps around the border. */
    uint32_t grid_width;    /**< Out: smallest n >= oversampling * (width + guard_px) with no prime factor above 13. */
    uint32_t grid_height;   /**< Out: likewise. */
} ClspFieldGrid;

/** Fills in grid_width and grid_height from the other four members. CLSP_ERROR_UNSUPPORTED if a side of the grid would exceed 16384
 *  samples, or the whole grid 2^26 (8192 x 8192). */
CLSP_API ClspStatus clspFieldGridCompute(ClspFieldGrid *grid);

#define CLSP_FIELD_CIRCULAR_GAUSSIAN 0u  /**< Very many scatterers per pixel: fully developed at any aperture. */
#define CLSP_FIELD_UNIT_PHASOR 1u        /**< One scatterer per sample, as in the thesis. */

/** How a phase state is made. */
typedef struct ClspPhaseDesc {
    uint32_t struct_size; /**< Size of the struct as the caller knows it. */
    uint32_t width;               /**< Image width in pixels. */
    uint32_t height;              /**< Image height in pixels. */
    uint32_t oversampling;        /**< Default 1. */
    uint32_t guard_px;            /**< Default 0. */
    uint32_t field;               /**< CLSP_FIELD_*; default CIRCULAR_GAUSSIAN. */
    uint32_t polarization_count;  /**< 1 or 2; 2 is needed for a degree of polarization below 1. Default 2. */
    uint32_t reserved;            /**< 0. */
    uint64_t seed;                /**< Default 0. */
} ClspPhaseDesc;

/** Writes the defaults into *desc. @param struct_size sizeof(ClspPhaseDesc). */
CLSP_API ClspStatus clspPhaseDescInit(ClspPhaseDesc *desc, uint32_t struct_size);
/** Makes a phase; *phase gets one reference. Allocates the state; it holds no values until the first refresh or restore. Compiles the kernels. */
CLSP_API ClspStatus clspPhaseCreate(ClspContext context, const ClspPhaseDesc *desc, ClspPhase *phase);
/** Adds a reference. */
CLSP_API ClspStatus clspPhaseRetain(ClspPhase phase);
/** Drops a reference; with the last one the phase is gone, once what was enqueued is done. NULL is allowed. */
CLSP_API ClspStatus clspPhaseRelease(ClspPhase phase);

/**
 * Draws new values.
 * @param frame_index counter of the new values, below 2^48; the same counter gives the same values.
 * @param mask UINT8 image of the size of the image: pixels that are not 0 are drawn anew. NULL: all of them. The first refresh after
 *             creation always draws everything, whatever the mask says.
 */
CLSP_API ClspStatus clspPhaseEnqueueRefresh(ClspPhase phase, cl_command_queue queue, uint64_t frame_index,
                                            const ClspImage *mask, uint32_t num_events_in_wait_list,
                                            const cl_event *event_wait_list, cl_event *event);

/**
 * Writes z of one polarization.
 * @param field FLOAT32X2 (re, im) image of grid_width x grid_height.
 */
CLSP_API ClspStatus clspPhaseEnqueueField(ClspPhase phase, cl_command_queue queue, uint32_t polarization,
                                          const ClspImage *field, uint32_t num_events_in_wait_list,
                                          const cl_event *event_wait_list, cl_event *event);

/** Size of the saved state in bytes. */
CLSP_API ClspStatus clspPhaseGetStateSize(ClspPhase phase, uint64_t *size_bytes);
/** Copies the state to `mem` at `offset_bytes`. Fails with CLSP_ERROR_INVALID_STATE before the first refresh. */
CLSP_API ClspStatus clspPhaseEnqueueSave(ClspPhase phase, cl_command_queue queue, cl_mem mem, uint64_t offset_bytes,
                                         uint32_t num_events_in_wait_list, const cl_event *event_wait_list,
                                         cl_event *event);
/** Copies a saved state back, bit for bit; it must come from a phase of the same size, field and polarization_count. */
CLSP_API ClspStatus clspPhaseEnqueueRestore(ClspPhase phase, cl_command_queue queue, cl_mem mem, uint64_t offset_bytes,
                                            uint32_t num_events_in_wait_list, const cl_event *event_wait_list,
                                            cl_event *event);

#ifdef __cplusplus
}
#endif

#endif /* CLSPECKLE_PHASE_H */

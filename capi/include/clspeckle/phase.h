/**
 * @file phase.h
 * @brief The surface's random field: persistent, refreshed where a mask says so, carried on where the surface moves or
 *        lives.
 *
 * The field lives on the field grid: `oversampling` samples per pixel and axis, padded to a size that the FFT takes
 * (clspFieldGridCompute()). Each sample holds z, E|z|^2 = 1: exp(i phi) with phi uniform (`unit phasor`, the thesis's
 * choice) or a circular complex Gaussian number (`circular Gaussian`, the limit of very many scatterers per pixel;
 * contrast 1 for any aperture). A refreshed sample takes phi from Philox stream 1 + polarization and, if Gaussian, |z|
 * = sqrt(-ln u) with u from stream 3 + polarization, at the frame index of the refresh. A sample follows the mask of
 * its pixel; padding follows the nearest edge pixel, counted around the (periodic) border; the middle of an odd padding
 * follows the last pixel.
 *
 * Dynamics. REPLACE: a sample is kept or replaced, as in the thesis (3.3). CONTINUOUS (circular Gaussian only): the
 * field is a process along the path that the surface has moved, however that path is cut into frames. A sample holds
 * two circular Gaussian numbers A and B for each polarization and a coordinate t in [0, 1) for all of them,
 *     z = cos(pi t / 2) A + sin(pi t / 2) B,
 * and a path p (in correlation lengths: material.h, motion.h) moves it by d = 0.9386677 p knots: t += d; where t passes
 * 1, A becomes B, B is drawn anew and t -= 1. t starts uniform, so the field's correlation over d knots is
 *     R(d) = (1 - d/2) cos(pi d/2) + sin(pi d/2) / pi   for d <= 2,   0 beyond;   1/e at a path of 1
 * (docs/method/motion.md). In either dynamics of a circular Gaussian field a correlation r in [0, 1] lets it live:
 * z' = r z + sqrt(1 - r^2) w with a new w (A and B each, if there are two). Over both the correlation is R(d) r; that
 * of the intensity behind the aperture is its square.
 *
 * Streams: A is drawn like z above; B takes its phase from 0x20 + polarization and its magnitude from 0x22 +
 * polarization, t from 0x24; w from 0x26 and 0x2a + polarization (A), 0x28 and 0x2c + polarization (B). An advance adds
 * 256 times its substep to the stream.
 *
 * Bytes of state per sample: unit phasor 4 per polarization; circular Gaussian 8 per polarization, CONTINUOUS 16 per
 * polarization and 4; with `translate` 8 more, and besides the state a second one of the same size to move it into and
 * 4 bytes.
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

/** Fills in grid_width and grid_height from the other four members. CLSP_ERROR_UNSUPPORTED if a side of the grid would
 *  exceed 16384 samples, or the whole grid 2^26 (8192 x 8192). */
CLSP_API ClspStatus clspFieldGridCompute(ClspFieldGrid *grid);

#define CLSP_FIELD_CIRCULAR_GAUSSIAN 0u  /**< Very many scatterers per pixel: fully developed at any aperture. */
#define CLSP_FIELD_UNIT_PHASOR 1u        /**< One scatterer per sample, as in the thesis. */

#define CLSP_DYNAMICS_REPLACE 0u     /**< A sample is kept or replaced. */
#define CLSP_DYNAMICS_CONTINUOUS 1u  /**< A sample follows the path of its surface gradually. */

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
    uint32_t dynamics;            /**< CLSP_DYNAMICS_*; default REPLACE. CONTINUOUS needs a circular Gaussian field. */
    uint32_t translate;           /**< 1: the state can move with the surface (ClspPhaseAdvance::shift). Default 0. */
} ClspPhaseDesc;

/** Writes the defaults into *desc. @param struct_size sizeof(ClspPhaseDesc). */
CLSP_API ClspStatus clspPhaseDescInit(ClspPhaseDesc *desc, uint32_t struct_size);
/** Makes a phase; *phase gets one reference. Allocates the state; it holds no values until the first refresh or
 *  restore. Compiles the kernels. */
CLSP_API ClspStatus clspPhaseCreate(ClspContext context, const ClspPhaseDesc *desc, ClspPhase *phase);
/** Adds a reference. */
CLSP_API ClspStatus clspPhaseRetain(ClspPhase phase);
/** Drops a reference; with the last one the phase is gone, once what was enqueued is done. NULL is allowed. */
CLSP_API ClspStatus clspPhaseRelease(ClspPhase phase);

/**
 * Draws new values.
 * @param frame_index counter of the new values, below 2^48; the same counter gives the same values.
 * @param mask UINT8 image of the size of the image: pixels that are not 0 are drawn anew. NULL: all of them. The first
 *             refresh after creation always draws everything, whatever the mask says.
 */
CLSP_API ClspStatus clspPhaseEnqueueRefresh(ClspPhase phase, cl_command_queue queue, uint64_t frame_index,
                                            const ClspImage *mask, uint32_t num_events_in_wait_list,
                                            const cl_event *event_wait_list, cl_event *event);

/** What happened to the surface since the last advance. All images have the size of the phase's; each may be left out
 *  (mem NULL). */
typedef struct ClspPhaseAdvance {
    uint32_t struct_size; /**< Size of the struct as the caller knows it. */
    uint32_t substep;           /**< Tells several advances with one frame_index apart, 0 to 127; default 0. */
    double uniform_path;        /**< Without a path image: path of all pixels, >= 0, infinity: all are replaced; default
                                     0. */
    double uniform_correlation; /**< Without a correlation image: that of all pixels, 0 to 1; default 1. */
    /** FLOAT32 >= 0, in correlation lengths; infinity (in fact 2.13 and more): the sample is replaced. Needs dynamics
     *  CONTINUOUS. */
    ClspImage path;
    /** FLOAT32 0 to 1: what time has left of the field's correlation, exp(-dt / correlation time). Needs a circular
     *  Gaussian field. */
    ClspImage correlation;
    /** FLOAT32X2 (x, y) in pixels: where the surface point that lies at the pixel was, minus where it is (a renderer's
     *  motion vector to the previous frame). The state moves with the surface by whole samples of the field grid; the
     *  rest is kept with the sample and added to its next shift. A sample that comes from outside of the image is
     *  replaced, and so are the padding and all but one of those that come from the same place. Needs `translate`. */
    ClspImage shift;
    ClspImage mask; /**< UINT8: where it is not 0 the sample is replaced. */
} ClspPhaseAdvance;

/** Writes the defaults (nothing happened) into *advance. @param struct_size sizeof(ClspPhaseAdvance). */
CLSP_API ClspStatus clspPhaseAdvanceInit(ClspPhaseAdvance *advance, uint32_t struct_size);

/**
 * Carries the field on: first it moves (shift), then it follows the path, then it lives (correlation). A replaced
 * sample is drawn as by a refresh with this frame_index (and substep). NaN or negative paths, correlations outside [0,
 * 1] and shifts that are not finite replace their pixel and count as bad pixels, see clspPhaseCheck(). Where nothing
 * happens, nothing is written.
 * @param frame_index counter of the new values, below 2^48. With the substep it must differ from that of every refresh
 *                    and advance before, or numbers are drawn twice.
 * Fails with CLSP_ERROR_INVALID_STATE before the first refresh.
 */
CLSP_API ClspStatus clspPhaseEnqueueAdvance(ClspPhase phase, cl_command_queue queue, uint64_t frame_index,
                                            const ClspPhaseAdvance *advance, uint32_t num_events_in_wait_list,
                                            const cl_event *event_wait_list, cl_event *event);

/** Waits for the queue and reports the bad pixels of all advances since the last check: CLSP_SUCCESS if there were
 *  none, else CLSP_ERROR_INVALID_DATA with their number and the first one's place. */
CLSP_API ClspStatus clspPhaseCheck(ClspPhase phase, cl_command_queue queue);

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
/** Copies a saved state back, bit for bit; it must come from a phase of the same size, field, polarization_count,
 *  dynamics and translate. An application may also make one: with CIRCULAR_GAUSSIAN, REPLACE and without `translate` it
 *  is z itself, for each polarization grid_height x grid_width pairs of floats (re, im). Frames without a refresh image
 *  that field. Light of a mean of 1 has a mean square of 1 where samples are independent; a smooth field passes the
 *  pupil whole, and is divided by the oversampling for it. */
CLSP_API ClspStatus clspPhaseEnqueueRestore(ClspPhase phase, cl_command_queue queue, cl_mem mem, uint64_t offset_bytes,
                                            uint32_t num_events_in_wait_list, const cl_event *event_wait_list,
                                            cl_event *event);

#ifdef __cplusplus
}
#endif

#endif /* CLSPECKLE_PHASE_H */

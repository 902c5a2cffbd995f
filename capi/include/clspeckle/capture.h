/**
 * @file capture.h
 * @brief Capture sets: what a real camera recorded, sequence by sequence, for the diagnosis of the gap between camera
 *        and simulator.
 *
 * A set holds any number of sequences of raw codes of one camera: dark frames, an even light without speckle (flat), a
 * rough board under even laser light, the board under the dot pattern; at rest or moving. Any subset will do: the
 * summary says what can be told from it. On disk it is a folder with a capture.json and an .npy stack for each sequence
 * (docs/guide/captures.md).
 *
 * Pixel centres are integers, x to the right, y down. Nothing here needs an OpenCL device.
 *
 * Thread rule: a capture that is complete may be read (getters, write, validate, summary, diagnosis) by any number of
 * threads at once. While one thread adds a sequence or sets the dots, no other thread may use that capture.
 */
#ifndef CLSPECKLE_CAPTURE_H
#define CLSPECKLE_CAPTURE_H

#include "types.h"

#ifdef __cplusplus
extern "C" {
#endif

/** @name What a sequence shows */
/** @{ */
#define CLSP_SCENE_DARK 0u  /**< No light reaches the sensor. */
#define CLSP_SCENE_FLAT 1u  /**< Even incoherent light (an LED): no speckle. */
#define CLSP_SCENE_BOARD 2u /**< A flat, rough, facing surface under even laser light. */
#define CLSP_SCENE_DOTS 3u  /**< The same surface under the dot pattern. */
/** @} */

#define CLSP_MAX_CAPTURE_NAME 64u /**< Bytes of a sequence's name with its final 0. */

/** The camera, and what the simulator's baseline is to be. */
typedef struct ClspCaptureDesc {
    uint32_t struct_size;           /**< Size of the struct as the caller knows it. */
    uint32_t width;                 /**< Columns, 8 to 16384. */
    uint32_t height;                /**< Rows, 8 to 16384. */
    uint32_t bits;                  /**< Of a code, 8 to 16; default 10. */
    uint32_t field;                 /**< CLSP_FIELD_* of the baseline; default circular Gaussian. */
    uint32_t principal_point_given; /**< 0 (default): the optical axis meets the image at ((width - 1) / 2, (height - 1)
                                         / 2); 1: at principal_point. */
    double pixel_pitch_m;           /**< Distance between pixel centres, 1e-8 to 1e-3 m; default 2.9e-6. */
    double f_number;                /**< 0.1 to 1000; default 5.6. */
    double wavelength_m;            /**< 1e-7 to 2e-5 m; default 940e-9. */
    double degree_of_polarization;  /**< Of the returned light in the baseline, 0 to 1; default 1. */
    double black_level_dn;          /**< The data sheet's, good to a few DN; 0 to below 2^bits - 1, default 64. */
    double read_noise_dn;           /**< The data sheet's standard deviation, good to about 15 %; >= 0, default 4. */
    double principal_point_x_px;    /**< Finite. 0 (default) unless principal_point_given is 1. */
    double principal_point_y_px;    /**< Likewise. */
} ClspCaptureDesc;

/** One sequence as it is added. */
typedef struct ClspCaptureSequence {
    uint32_t struct_size;  /**< Size of the struct as the caller knows it. */
    uint32_t scene;        /**< CLSP_SCENE_*; default DARK. */
    uint32_t moving;       /**< 0 (default): nothing moves, the speckle is the same in every frame; 1: each frame has
                                speckle independent of the last. */
    uint32_t frame_count;  /**< 1 to 65535. All sequences of a capture hold at most 4 GiB of codes. */
    const char *name;      /**< 1 to 63 letters, digits, '_', '-' and '.', not beginning with '.' or '-'; no two alike,
                                capital letters apart. */
    const uint16_t *codes; /**< Host memory, frame_count x height x width raw codes; copied. */
    const uint8_t *mask;   /**< Host memory, height x width, 0: the pixel does not count; copied. NULL (default): all
                                count. */
    double f_number;       /**< Of this sequence; 0 (default): the camera's. */
    double exposure_ms;    /**< Exposure time in ms; 0 (default): not known. */
} ClspCaptureSequence;

/** What a sequence of a capture is. */
typedef struct ClspCaptureSequenceInfo {
    uint32_t struct_size;  /**< Size of the struct as the caller knows it. */
    uint32_t scene;        /**< CLSP_SCENE_*. */
    uint32_t moving;       /**< 0 or 1. */
    uint32_t frame_count;  /**< Frames. */
    uint32_t has_mask;     /**< 1 if there is a mask. */
    uint32_t reserved;     /**< 0. */
    double f_number;       /**< Its own, or the camera's. */
    double exposure_ms;    /**< 0: not known. */
    char name[CLSP_MAX_CAPTURE_NAME]; /**< Its name. */
} ClspCaptureSequenceInfo;

/** Writes the defaults into *desc. @param struct_size sizeof(ClspCaptureDesc). */
CLSP_API ClspStatus clspCaptureDescInit(ClspCaptureDesc *desc, uint32_t struct_size);
/** Writes the defaults (no codes) into *sequence. @param struct_size sizeof(ClspCaptureSequence). */
CLSP_API ClspStatus clspCaptureSequenceInit(ClspCaptureSequence *sequence, uint32_t struct_size);

/** Makes a capture without sequences; *capture gets one reference. */
CLSP_API ClspStatus clspCaptureCreate(const ClspCaptureDesc *desc, ClspCapture *capture);
/**
 * Reads a capture set; *capture gets one reference. Everything is checked; messages name file, frame and field. Codes
 * of more than 256 MB stay in their files, which must not change while the capture is used: what reads them fails with
 * CLSP_ERROR_IO otherwise.
 * @param path the folder, or its capture.json; UTF-8 as the system takes it.
 * @return CLSP_ERROR_IO for what cannot be read, CLSP_ERROR_INVALID_ARGUMENT for what capture.json says,
 *         CLSP_ERROR_INVALID_DATA for what the arrays hold. What is odd but usable stands in the summary's warnings.
 */
CLSP_API ClspStatus clspCaptureOpen(const char *path, ClspCapture *capture);
/** clspCaptureOpen() that tells how far it is. @param progress NULL: nobody is told. @param progress_data handed to
 *  `progress`. */
CLSP_API ClspStatus clspCaptureOpenWithProgress(const char *path, ClspProgressFunction progress, void *progress_data,
                                                ClspCapture *capture);
/** Adds a reference. */
CLSP_API ClspStatus clspCaptureRetain(ClspCapture capture);
/** Drops a reference; with the last one the capture is gone. NULL is allowed. */
CLSP_API ClspStatus clspCaptureRelease(ClspCapture capture);

/** Adds a sequence behind the others; copies everything. If it fails (CLSP_ERROR_INVALID_DATA for codes above 2^bits -
 *  1, with the place of the first one), the capture is as it was. */
CLSP_API ClspStatus clspCaptureAddSequence(ClspCapture capture, const ClspCaptureSequence *sequence);
/**
 * Sets the ideal dots, which sequences with CLSP_SCENE_DOTS need. If it fails, the capture is as it was.
 * @param sigma_px width of a dot, exp(-r^2 / (2 sigma^2)), 0.01 to 16384.
 * @param positions_px host memory, count times x, y, finite; at least one dot must lie in the image. NULL with count 0:
 *                     no dots.
 * @param count at most CLSP_MAX_DOTS.
 */
CLSP_API ClspStatus clspCaptureSetDots(ClspCapture capture, double sigma_px, uint64_t count,
                                       const double *positions_px);
/** Whether the capture is complete and in order: at least one sequence, dots where a sequence needs them, every code in
 *  range. */
CLSP_API ClspStatus clspCaptureValidate(ClspCapture capture);
/**
 * Validates, and writes capture.json, an .npy stack for each sequence and a PNG for each mask. The folder appears only
 * when it is complete.
 * @param overwrite 0: an existing folder is refused; 1: it is replaced if it holds nothing but a written capture set.
 */
CLSP_API ClspStatus clspCaptureWrite(ClspCapture capture, const char *path, uint32_t overwrite);

/** The camera. principal_point is always written. @param desc with its struct_size set. */
CLSP_API ClspStatus clspCaptureGetDesc(ClspCapture capture, ClspCaptureDesc *desc);
/**
 * The ideal dots.
 * @param sigma_px their width, 0 without dots; may be NULL.
 * @param capacity dots that positions_px has room for; 0 to ask only for the number.
 * @param positions_px x, y of each; NULL if capacity is 0.
 * @param count dots that there are; may be NULL.
 */
CLSP_API ClspStatus clspCaptureGetDots(ClspCapture capture, double *sigma_px, uint64_t capacity, double *positions_px,
                                       uint64_t *count);
/** How many sequences there are. */
CLSP_API ClspStatus clspCaptureGetSequenceCount(ClspCapture capture, uint32_t *count);
/** What sequence `index` is, 0 to count - 1. @param info with its struct_size set. */
CLSP_API ClspStatus clspCaptureGetSequence(ClspCapture capture, uint32_t index, ClspCaptureSequenceInfo *info);
/** Copies the codes of a sequence. @param capacity codes that there is room for, at least frame_count x height x
 *  width. */
CLSP_API ClspStatus clspCaptureGetCodes(ClspCapture capture, uint32_t index, uint64_t capacity, uint16_t *codes);
/** Copies the mask of a sequence; 255 everywhere if it has none. @param capacity bytes that there is room for, at least
 *  height x width. */
CLSP_API ClspStatus clspCaptureGetMask(ClspCapture capture, uint32_t index, uint64_t capacity, uint8_t *mask);
/**
 * What is in the capture, and what it can and cannot tell apart, as a JSON object (docs/guide/captures.md lists its
 * keys): "sequences" with levels, noise and saturation, "abilities" and "effects" with reasons in words, "warnings".
 * Validates first.
 * @param capacity size of `text` in bytes; the text is cut to fit and always ends with 0.
 * @param length   size of the whole text with its final 0; may be NULL.
 */
CLSP_API ClspStatus clspCaptureGetSummaryJson(ClspCapture capture, uint64_t capacity, char *text, uint64_t *length);
/**
 * EMVA 1288's numbers of the dark and flat frames (of a resting laser scene: the gain) as a JSON object
 * (docs/method/emva1288.md lists its keys), with 95 % intervals, or why they are not known. Validates first.
 * @param capacity size of `text` in bytes; the text is cut to fit and always ends with 0.
 * @param length   size of the whole text with its final 0; may be NULL.
 */
CLSP_API ClspStatus clspCaptureGetEmva1288Json(ClspCapture capture, uint64_t capacity, char *text, uint64_t *length);
/** The same numbers as XML, with the element names of the Python package emva1288. Arguments as of
 *  clspCaptureGetEmva1288Json. */
CLSP_API ClspStatus clspCaptureGetEmva1288Xml(ClspCapture capture, uint64_t capacity, char *text, uint64_t *length);

#ifdef __cplusplus
}
#endif

#endif /* CLSPECKLE_CAPTURE_H */

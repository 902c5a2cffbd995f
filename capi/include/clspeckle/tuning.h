/**
 * @file tuning.h
 * @brief Which engine makes an aperture's transforms the fastest on a device: measured, kept, followed.
 *
 * The candidates are the engines clfft, cpu and gpu; of the last one on devices that
 * are no CPUs several sizes (docs/guide/runtime.md). clspTuningRun() measures all of them for some sizes and keeps the
 * times and the choice in a JSON file, the tuning record. Apertures that are made by contexts created later follow it:
 *
 *   1. CLSPECKLE_FFT, where it forces an engine;
 *   2. the user's record, for this device and driver: CLSPECKLE_TUNING, else tuning.json in the cache folder
 *      (ClspContextDesc::cache_dir);
 *   3. a record that came with the library, for devices of this name;
 *   4. cpu on CPUs, gpu on GPUs, clfft elsewhere.
 *
 * CLSPECKLE_TUNING=off leaves 2 and 3 out. Of a record the size itself counts, else the one with the nearest area. What
 * an engine cannot do goes to the next; ClspApertureInfo and the log (ClspContextDesc::log) say which was taken and
 * why. A record that cannot be read whole is ignored with one warning, and renewed by the next clspTuningRun().
 *
 * Thread rule: clspTuningRun() blocks, and whatever else the device does meanwhile spoils the measurement. The progress
 * function is called on the thread that called. A tuning is complete and never changes: any number of threads may read
 * it at once.
 */
#ifndef CLSPECKLE_TUNING_H
#define CLSPECKLE_TUNING_H

#include "types.h"

#ifdef __cplusplus
extern "C" {
#endif

#define CLSP_MAX_TUNING_SIZES 64u     /**< Sizes of one run. */
#define CLSP_MAX_TUNING_FRAMES 10000u /**< Measurements of each candidate. */

/** Of an image, in pixels. The layout of this struct is frozen: it never grows. */
typedef struct ClspTuningSize {
    uint32_t width;  /**< 1 to 16384. */
    uint32_t height; /**< 1 to 16384. */
} ClspTuningSize;

/** What to measure. */
typedef struct ClspTuningDesc {
    uint32_t struct_size; /**< Size of the struct as the caller knows it. */
    uint32_t frames;      /**< Measurements of each candidate, 1 to CLSP_MAX_TUNING_FRAMES; default 15. Each lasts 2 ms
                               or one frame, whichever is longer. */
    const ClspTuningSize *sizes; /**< Images without oversampling; NULL (default) with size_count 0: 640 x 480, 512 x
                                      512, 1024 x 1024, 1920 x 1080 and 2048 x 2048. */
    uint32_t size_count;      /**< Of `sizes`, at most CLSP_MAX_TUNING_SIZES; default 0. */
    uint32_t keep;            /**< 1 (default): sizes go into the record, in the place of what it says of them. 0:
                                   nothing is written. */
    double relative_diameter; /**< D of the aperture in cycles per pixel, above 0 to 1; default 0.5. */
    const char *path;         /**< The record's file; made or added to, but never made from a file that is none. NULL
                                   (default): the one that contexts read. */
    ClspProgressFunction progress; /**< Told how far the run is; NULL (default): nobody is told. */
    void *progress_data;      /**< Handed to `progress`; default NULL. */
} ClspTuningDesc;

/** Writes the defaults into *desc. @param struct_size sizeof(ClspTuningDesc). */
CLSP_API ClspStatus clspTuningDescInit(ClspTuningDesc *desc, uint32_t struct_size);

/**
 * Measures; *tuning gets one reference. Blocks: seconds for each size, more while programs are compiled for the first
 * time. Candidates take turns, the first frames do not count, medians do. The fastest is chosen, or the device's
 * default engine where that is slower by no more than the noise and 2 %. A candidate whose picture is not clFFT's
 * (relative L2 difference above 1e-5) is never chosen.
 * @param desc NULL for all defaults.
 * @return CLSP_ERROR_CANCELLED when the progress function returned 0: nothing was written; CLSP_ERROR_IO where the
 *         record cannot be written, CLSP_ERROR_INVALID_DATA where `path` is another kind of file: both before anything
 *         is measured.
 */
CLSP_API ClspStatus clspTuningRun(ClspContext context, const ClspTuningDesc *desc, ClspTuning *tuning);
/** Adds a reference. */
CLSP_API ClspStatus clspTuningRetain(ClspTuning tuning);
/** Drops a reference; with the last one the tuning is gone. NULL is allowed. */
CLSP_API ClspStatus clspTuningRelease(ClspTuning tuning);

/**
 * What was measured, as JSON: the format of a tuning record with this run's sizes alone (docs/guide/runtime.md).
 * @param capacity size of `text` in bytes; the text is cut to fit and always ends with 0.
 * @param text     NULL if capacity is 0.
 * @param length   size of the whole text with its final 0; may be NULL.
 */
CLSP_API ClspStatus clspTuningGetJson(ClspTuning tuning, uint64_t capacity, char *text, uint64_t *length);
/** The file that was written, "" if none. @param capacity, path, length as for clspTuningGetJson(). */
CLSP_API ClspStatus clspTuningGetPath(ClspTuning tuning, uint64_t capacity, char *path, uint64_t *length);

/**
 * The engine that an aperture of this context would have first, and why: "cpu: the default for CPUs". Whether the
 * device has room for it shows when the aperture is made (ClspApertureInfo). Reads the user's record, once for each
 * context.
 * @param width, height of the image, without oversampling and padding.
 * @param capacity, text, length as for clspTuningGetJson().
 */
CLSP_API ClspStatus clspTuningExplain(ClspContext context, uint32_t width, uint32_t height, uint64_t capacity,
                                      char *text, uint64_t *length);
/** The file of the user's record, "" where there is none (CLSPECKLE_TUNING=off, no cache folder). It need not exist.
 *  @param capacity, path, length as for clspTuningGetJson(). */
CLSP_API ClspStatus clspTuningGetRecordPath(ClspContext context, uint64_t capacity, char *path, uint64_t *length);

#ifdef __cplusplus
}
#endif

#endif /* CLSPECKLE_TUNING_H */

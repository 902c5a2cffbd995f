/**
 * @file profile.h
 * @brief Camera profiles: a camera as a diagnosis found it, to be rendered again.
 *
 * clspDiagnosisGetProfile() (diagnosis.h) makes one of a diagnosis, clspProfileWrite() writes it as a JSON file,
 * clspProfileOpen() reads such a file (docs/reference/profile.md lists its keys). A profile holds the simulator's
 * settings, every effect of the diagnosis's last model with its parameters, maps of the camera's own pixels where the
 * capture tells them, and apart from them the lab's conditions, which are no part of the camera: the light of each
 * sequence. Maps are files beside the profile's, and are read when they are used. A pipeline becomes that camera in two
 * steps: clspProfileDescribe() before its stages are made, clspPipelineSetProfile() afterwards. Nothing but the last
 * one needs an OpenCL device.
 *
 * Thread rule: a profile never changes: any number of threads may use it at once. clspPipelineSetProfile() counts as a
 * call on the pipeline.
 */
#ifndef CLSPECKLE_PROFILE_H
#define CLSPECKLE_PROFILE_H

#include "aperture.h"
#include "capture.h"
#include "effects.h"
#include "lens.h"
#include "phase.h"
#include "sensor.h"
#include "types.h"

#ifdef __cplusplus
extern "C" {
#endif

/** @name Maps of a camera's pixels, to be added up */
/** @{ */
#define CLSP_PROFILE_MAP_DARK 1u /**< Offsets in DN above the black level: ClspSensorDesc::dark_frame_dn. */
#define CLSP_PROFILE_MAP_GAIN 2u /**< Gains over the image's mean: ClspSensorDesc::gain_map. */
/** @} */

/** The camera, and where the profile is from. */
typedef struct ClspProfileInfo {
    uint32_t struct_size;          /**< Size of the struct as the caller knows it. */
    uint32_t width;                /**< Columns of an image, 8 to 16384. */
    uint32_t height;               /**< Rows, 8 to 16384. */
    uint32_t bits;                 /**< Of a code, 8 to 16. */
    uint32_t field;                /**< CLSP_FIELD_*. */
    uint32_t oversampling;         /**< Samples of the field for each pixel along an axis, 1 to 8. */
    uint32_t effect_count;         /**< Of clspProfileGetEffect(). */
    uint32_t hypothesis_count;     /**< The user's own effects, which no pipeline has; the JSON lists them. */
    uint32_t sequence_count;       /**< Of clspProfileGetSequence(). */
    uint32_t verdict;              /**< CLSP_VERDICT_* of the diagnosis. */
    uint32_t residual_detected;    /**< 1: a gap remained with the effects. */
    uint32_t reserved;             /**< 0. */
    uint64_t seed;                 /**< Of the diagnosis. */
    double pixel_pitch_m;          /**< Distance between pixel centres, m. */
    double f_number;               /**< Nominal. */
    double wavelength_m;           /**< Of the laser, m. */
    double degree_of_polarization; /**< Of the returned light, 0 to 1. */
    double principal_point_x_px;   /**< Where the optical axis meets the image. */
    double principal_point_y_px;   /**< Likewise. */
    double black_level_dn;         /**< Calibrated on the capture. */
    double read_noise_dn;          /**< Likewise. */
    double fill_factor;            /**< As of ClspApertureDesc. */
    double level;                  /**< Of false alarms, of the diagnosis. */
    char version[16];              /**< Of clSpeckle, that wrote it. */
    char capture[256];             /**< The capture set's name; empty if it has none. */
    uint32_t maps;                 /**< CLSP_PROFILE_MAP_* that it has, added up. */
    uint32_t reserved_maps;        /**< 0. */
} ClspProfileInfo;

/** An effect of the camera. */
typedef struct ClspProfileEffect {
    uint32_t struct_size;     /**< Size of the struct as the caller knows it. */
    uint32_t parameter_count; /**< 1 to CLSP_MAX_EFFECT_PARAMETERS. */
    uint32_t named;           /**< 1: the verdict names it; 0: it was fitted beside effects that it names. */
    uint32_t conditional;     /**< 1: it rests on a scene in which something unknown remains. */
    char id[32];              /**< Of the catalogue. */
    double values[CLSP_MAX_EFFECT_PARAMETERS]; /**< In the order of the catalogue. */
    double low[CLSP_MAX_EFFECT_PARAMETERS];    /**< 95 % intervals, lower ends; NaN of parameters that were not
                                                    fitted. */
    double high[CLSP_MAX_EFFECT_PARAMETERS];   /**< Upper ends; NaN likewise. */
} ClspProfileEffect;

/** The light of one sequence of the capture: a condition of the lab. */
typedef struct ClspProfileSequence {
    uint32_t struct_size; /**< Size of the struct as the caller knows it. */
    uint32_t scene;       /**< CLSP_SCENE_*. */
    uint32_t moving;      /**< 0 or 1. */
    uint32_t reserved;    /**< 0. */
    double f_number;      /**< Nominal, of this sequence. */
    double exposure_ms;   /**< 0: not known. */
    double mean_dn;       /**< Of the camera's frames. */
    double light_dn;      /**< Above black, of the simulator's; 0 in the dark. */
    double gain_dn;       /**< DN per unit of an ideal image that is 1 on flat and board and at a dot's peak; 0 in the
                               dark. */
    char name[CLSP_MAX_CAPTURE_NAME]; /**< Its name. */
} ClspProfileSequence;

/** A map of the camera's pixels. */
typedef struct ClspProfileMap {
    uint32_t struct_size;  /**< Size of the struct as the caller knows it. */
    uint32_t map;          /**< CLSP_PROFILE_MAP_DARK or CLSP_PROFILE_MAP_GAIN. */
    uint32_t frame_count;  /**< How many frames it is of. */
    uint32_t reserved;     /**< 0. */
    double standard_error; /**< Noise over time that was left in the mean of so many frames, of a pixel: DN, or
                                relative. */
    char path[4096];       /**< Of its file; empty of a profile that was not read from one. */
} ClspProfileMap;

/**
 * Reads a profile; *profile gets one reference. Everything is checked: keys, effects and the ranges of their
 * parameters.
 * @return CLSP_ERROR_IO for a file that cannot be read, CLSP_ERROR_INVALID_ARGUMENT for one that is no profile, or one
 *         of a later format; the message names file, key, value and what was expected.
 */
CLSP_API ClspStatus clspProfileOpen(const char *path, ClspProfile *profile);
/** Adds a reference. */
CLSP_API ClspStatus clspProfileRetain(ClspProfile profile);
/** Drops a reference; with the last one the profile is gone. NULL is allowed. */
CLSP_API ClspStatus clspProfileRelease(ClspProfile profile);
/** The camera. @param info with its struct_size set. */
CLSP_API ClspStatus clspProfileGetInfo(ClspProfile profile, ClspProfileInfo *info);
/** Effect `index`, 0 to effect_count - 1. @param effect with its struct_size set. */
CLSP_API ClspStatus clspProfileGetEffect(ClspProfile profile, uint32_t index, ClspProfileEffect *effect);
/** Sequence `index`, 0 to sequence_count - 1. @param sequence with its struct_size set. */
CLSP_API ClspStatus clspProfileGetSequence(ClspProfile profile, uint32_t index, ClspProfileSequence *sequence);
/**
 * The profile as a JSON object, UTF-8: what clspProfileWrite() writes.
 * @param capacity size of `text` in bytes; the text is cut to fit and always ends with 0.
 * @param text     NULL if capacity is 0.
 * @param length   size of the whole text with its final 0; may be NULL.
 */
CLSP_API ClspStatus clspProfileGetJson(ClspProfile profile, uint64_t capacity, char *text, uint64_t *length);
/** Writes it to a file, and its maps to files beside it: NAME.json, NAME.dark.npy, NAME.gain.npy. They appear, or
 *  replace older ones, only when all are complete. @return CLSP_ERROR_IO if one cannot be written; errors of
 *  clspProfileGetMap(). */
CLSP_API ClspStatus clspProfileWrite(ClspProfile profile, const char *path);
/**
 * A map that the profile has, with its values.
 * @param map    CLSP_PROFILE_MAP_DARK or CLSP_PROFILE_MAP_GAIN.
 * @param info   with its struct_size set; may be NULL.
 * @param values height x width floats, tightly packed; may be NULL, and no file is read then.
 * @return CLSP_ERROR_INVALID_ARGUMENT for a map that it has not, CLSP_ERROR_IO for a file that cannot be read,
 *         CLSP_ERROR_INVALID_DATA for one that is not as it was written; the message says what to do.
 */
CLSP_API ClspStatus clspProfileGetMap(ClspProfile profile, uint32_t map, ClspProfileMap *info, float *values);

/**
 * Writes the camera's settings into descriptions of stages, which keep all else: size, bits, sampling, f-number, pixel
 * pitch, wavelength, polarization (normalized to the mean, by which gains are meant), optical axis, black level, read
 * noise. Effects are none of them.
 * @param sequence name of one of the profile's, whose gain, exposure time and f-number are written, too; NULL: the gain
 *                 stays.
 * @param phase, aperture, lens, sensor made by their Init functions; NULL: not wanted.
 * @return CLSP_ERROR_INVALID_ARGUMENT for a sequence that is not there; nothing is written then.
 */
CLSP_API ClspStatus clspProfileDescribe(ClspProfile profile, const char *sequence, ClspPhaseDesc *phase,
                                        ClspApertureDesc *aperture, ClspLensDesc *lens, ClspSensorDesc *sensor);
/**
 * Switches the profile's effects on, beside those that are on already, as clspPipelineSetEffect() does each: not for
 * the per-frame path, and at the sensor's exposure of the moment. Effects on dots are left out of a pipeline that draws
 * none, as its frames bring their own pattern. The profile's maps become the sensor's, in the place of the effects that
 * they hold; they stay when effects are cleared. After an error everything is as it was.
 * @return CLSP_ERROR_INVALID_ARGUMENT for a pipeline of another camera: size, bits, pixel pitch or wavelength differ,
 *         there is no sensor, or it has a dark frame or gain map of its own; errors of clspProfileGetMap().
 */
CLSP_API ClspStatus clspPipelineSetProfile(ClspPipeline pipeline, ClspProfile profile);
/** The same with some of the profile's maps. @param maps CLSP_PROFILE_MAP_*, added up; those that the profile has not
 *  are left out. 0: none; all fixed patterns are drawn anew from their deviations. Maps that an earlier profile brought
 *  go. */
CLSP_API ClspStatus clspPipelineSetProfileMaps(ClspPipeline pipeline, ClspProfile profile, uint32_t maps);

#ifdef __cplusplus
}
#endif

#endif /* CLSPECKLE_PROFILE_H */

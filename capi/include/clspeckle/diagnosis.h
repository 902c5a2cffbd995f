/**
 * @file diagnosis.h
 * @brief The gap between a real camera and the simulator: whether there is one, where it lies, what causes it, how far
 *        it shrinks.
 *
 * clspDiagnose() compares a capture (capture.h) with frames of the simulator that are calibrated and measured alike,
 * and fits the effects of the catalogue (effects.h) and the caller's own hypotheses. docs/method/diagnosis.md explains
 * the method, docs/reference/gap-report.md every number of the report and its scale.
 *
 * Thread rule: clspDiagnose() blocks; any number of threads may diagnose at the same time, also the same capture. Its
 * callbacks are called on the thread that called it, one at a time. A diagnosis is complete and never changes: any
 * number of threads may read it at once.
 */
#ifndef CLSPECKLE_DIAGNOSIS_H
#define CLSPECKLE_DIAGNOSIS_H

#include "capture.h"
#include "effects.h"
#include "types.h"

#ifdef __cplusplus
extern "C" {
#endif

/** @name Verdicts */
/** @{ */
#define CLSP_VERDICT_NONE 0u      /**< No gap at the stated level, in what could be tested: the notes say what could not
                                       be. */
#define CLSP_VERDICT_NAMED 1u     /**< One effect, or the smallest set of effects that is needed, explains the gap. */
#define CLSP_VERDICT_AMBIGUOUS 2u /**< Two or more effects explain it equally well: the equivalents. */
#define CLSP_VERDICT_UNKNOWN 3u   /**< A significant part of the gap is explained by no effect that was a candidate. */
/** @} */

/** @name Where a hypothesis acts */
/** @{ */
#define CLSP_HYPOTHESIS_IRRADIANCE 0u /**< On the ideal image, before the speckle forms; never negative. Not in the
                                           dark. */
#define CLSP_HYPOTHESIS_INTENSITY 1u  /**< Behind the lens, before the sensor; 1 is the mean of flat and board. Not in
                                           the dark. */
#define CLSP_HYPOTHESIS_CODES 2u      /**< On the sensor's codes, which are rounded to 0 ... 2^bits - 1 after the
                                           call. */
/** @} */

/** @name Which part of the image is judged */
/** @{ */
#define CLSP_WINDOW_AUTO 0u  /**< All of a small capture; of a large one a strip through the optical axis
                                  (docs/method/diagnosis.md). */
#define CLSP_WINDOW_WHOLE 1u /**< The whole image, however large. */
#define CLSP_WINDOW_GIVEN 2u /**< The caller's window. */
/** @} */
#define CLSP_FRAMES_AUTO 0xffffffffu /**< Of each sequence as many frames as a diagnosis within minutes can take. */

#define CLSP_MAX_HYPOTHESES 64u /**< Hypotheses of one diagnosis. */

/** One frame that a hypothesis changes. Filled by the library. */
typedef struct ClspHypothesisFrame {
    uint32_t struct_size;      /**< Size of the struct as the library knows it. */
    uint32_t width;            /**< Columns, of the window that is judged. */
    uint32_t height;           /**< Rows, likewise. */
    uint32_t bits;             /**< Of a code. */
    uint32_t sequence;         /**< Number of the sequence in the capture. */
    uint32_t scene;            /**< CLSP_SCENE_*. */
    uint32_t moving;           /**< 0 or 1. */
    uint32_t frame_index;      /**< From 0, within the sequence. */
    uint64_t seed;             /**< Of the simulated capture. What is random must depend on seed, sequence and
                                    frame_index alone; a pattern that belongs to the camera on seed alone. */
    uint32_t parameter_count;  /**< Of `values`. */
    uint32_t reserved;         /**< 0. */
    const char *sequence_name; /**< The sequence's name. */
    const double *values;      /**< The hypothesis's parameters, in order. */
    float *pixels;             /**< height x width, row by row; changed in place. */
    double f_number;           /**< Of the sequence. */
    double pixel_pitch_m;      /**< The camera's, in metres. */
    double wavelength_m;       /**< The laser's, in metres. */
} ClspHypothesisFrame;

/** Changes frame->pixels. Called on the thread of clspDiagnose().
 *  @return 0; anything else ends the diagnosis with CLSP_ERROR_INVALID_DATA. */
typedef int32_t (*ClspHypothesisFunction)(void *user_data, const ClspHypothesisFrame *frame);

/** An effect of the caller's own: `apply`, or `opencl_source`. Everything is copied; `apply` and `user_data` must be
 *  good until clspDiagnose() returns.
 *
 *  OpenCL source defines
 *
 *      float hypothesis(hypothesis_frame frame, hypothesis_values values, uint x, uint y)
 *
 *  which gives the new value of a pixel. It runs on the device, several frames at once; parameters are members of
 *  `values`, in single precision, and their names must be identifiers and no words of OpenCL C's own; the text must
 *  stand alone (no &#35;include). `frame` has pixels (as they were, row by row), width, height, bits, sequence, scene
 *  (CLSP_SCENE_*), moving, frame_index, seed, f_number, pixel_pitch_m and wavelength_m. hypothesis_pixel(frame, x, y)
 *  reads the pixel, beyond the border the nearest one inside; hypothesis_normal(frame, x, y, draw) is a standard normal
 *  number of that place, frame and sequence, hypothesis_fixed_normal(frame, x, y, draw) one that is the same in all
 *  frames of a capture; draw is 0 to 15. */
typedef struct ClspHypothesis {
    uint32_t struct_size;     /**< Size of the struct as the caller knows it. */
    uint32_t point;           /**< CLSP_HYPOTHESIS_*; default INTENSITY. */
    const char *id;           /**< 1 to 31 letters, digits, '_', '-' and '.'; neither the catalogue's nor another
                                   hypothesis's. */
    const char *stage;        /**< "laser", "doe", "surface", "motion", "optics" or "sensor". */
    const char *summary;      /**< What happens; NULL (default): no text. */
    const ClspEffectParameter *parameters; /**< Weak and strong lie within minimum and maximum; all parameters move
                                                together. Both directions are looked for where the first's range lies on
                                                both sides of 0 with weak and strong on one, and of ratios
                                                (docs/method/diagnosis.md). */
    uint32_t parameter_count; /**< 1 to CLSP_MAX_EFFECT_PARAMETERS. */
    uint32_t reserved;        /**< 0. */
    ClspHypothesisFunction apply; /**< What it does to a frame. The same arguments must give the same pixels. NULL with
                                       OpenCL source. */
    void *user_data;          /**< Handed to `apply`; default NULL. */
    const char *opencl_source; /**< What it does to a pixel, in OpenCL C 1.2; NULL (default): `apply` does it. */
} ClspHypothesis;

/** How to diagnose. */
typedef struct ClspDiagnoseDesc {
    uint32_t struct_size;      /**< Size of the struct as the caller knows it. */
    uint32_t null_replicates;  /**< Simulated captures without effects, 12 to 100000; default 48. More: finer p-values,
                                    slower. */
    uint32_t max_effects;      /**< Effects in one explanation at most, 1 to 64, beside such as turn out too slight to
                                    be named; default 16. */
    uint32_t threads;          /**< Of the host, 1 to 1024; 0 (default): as many as the machine has. The report does not
                                    depend on it. */
    uint64_t seed;             /**< Of the simulated captures; default 0. The same seed gives the same report. */
    double level;              /**< Probability of seeing a gap where there is none, 1e-6 to 0.5; default 0.02. */
    const char *const *without; /**< Ids of effects that are no candidates; NULL (default): all are. */
    uint32_t without_count;    /**< How many; default 0. */
    uint32_t hypothesis_count; /**< 0 (default) to CLSP_MAX_HYPOTHESES. */
    const ClspHypothesis *const *hypotheses; /**< Pointers to the caller's own effects, which join the catalogue's;
                                                  default NULL. */
    ClspProgressFunction progress; /**< NULL (default): nobody is told. */
    void *progress_data;       /**< Handed to `progress`; default NULL. */
    uint32_t evidence;         /**< 1 (default): pictures and curves for clspDiagnosisWriteHtml() are collected; 0: its
                                    page has none. */
    uint32_t reserved;         /**< 0. */
    uint32_t window;           /**< CLSP_WINDOW_*; default AUTO. */
    uint32_t frames;           /**< Of each sequence at most, from the middle of each half; 0: all; default
                                    CLSP_FRAMES_AUTO. */
    uint32_t window_x;         /**< Of CLSP_WINDOW_GIVEN: the first column, even; 0 otherwise, and by default. */
    uint32_t window_y;         /**< The first row, even; 0 otherwise, and by default. */
    uint32_t window_width;     /**< 16 or more; 0 otherwise, and by default. */
    uint32_t window_height;    /**< 16 or more; 0 otherwise, and by default. */
    ClspProfile profile;       /**< Of clspCompare(): the camera that both sets are of (profile.h). Its effects make
                                    both scatter, which is no gap; retained while the call runs. NULL (default): a
                                    camera without effects. Of clspDiagnose(): NULL. */
    const char *tolerance_file; /**< What the caller accepts of the simulator's error, as JSON
                                     (docs/reference/gap-report.md): the report gets the key "acceptance". NULL
                                     (default): none. Not for clspCompare(). */
} ClspDiagnoseDesc;

/** The numbers of a diagnosis. */
typedef struct ClspDiagnosisSummary {
    uint32_t struct_size;       /**< Size of the struct as the caller knows it. */
    uint32_t verdict;           /**< CLSP_VERDICT_*. */
    uint32_t detected;          /**< 1: there is a gap at the level. */
    uint32_t residual_detected; /**< 1: a gap remains with the effects found. */
    uint32_t held_out;          /**< 1: the shrinkage is measured on frames that no fit has seen; 0: too few frames for
                                     that. */
    uint32_t effect_count;      /**< Of clspDiagnosisGetEffect(). */
    uint32_t equivalent_count;  /**< Of clspDiagnosisGetEquivalent(). */
    uint32_t ranked_count;      /**< Of clspDiagnosisGetRanked(). */
    uint32_t parameter_count;   /**< Of clspDiagnosisGetParameter(). */
    uint32_t place_count;       /**< Of clspDiagnosisGetPlace(). */
    uint32_t step_count;        /**< Of clspDiagnosisGetStep(). */
    uint32_t note_count;        /**< Of clspDiagnosisGetNote(). */
    uint64_t seed;              /**< Of the simulated captures. */
    double level;               /**< As asked for. */
    double p_value;             /**< Probability of so large a gap by chance; 1e-300 at least. */
    double distance;            /**< The gap beyond chance, in standard deviations of the baseline, root mean square
                                     over the statistics. */
    double null_95;             /**< What chance alone exceeds once in twenty times. */
    double probability;         /**< Of the effects named, among the candidates. */
    double distance_before;     /**< The gap of half captures without effects, in standard deviations of half captures
                                     simulated with the effects found (another scale than `distance`); 0 if no effect
                                     was found. */
    double distance_after;      /**< With the effects found, on the scale of distance_before. */
    double fraction;            /**< Part of the gap that is gone: 1 - after / before. Of a right model below 1 in about
                                     half of all captures, by chance. */
    double fraction_95[2];      /**< Its 95 % interval. */
    double residual_p_value;    /**< Probability of so large a remainder by chance. */
    double seconds;             /**< That the diagnosis took. */
    double black_level_dn;      /**< That the simulator without effects was calibrated to; NaN of a comparison. The
                                     report has the light of each sequence, too. */
    double read_noise_dn;       /**< As black_level_dn. */
    uint32_t judged;            /**< 0: every sequence with light was left out, so that the verdict is about dark frames
                                     alone. */
    uint32_t reserved;          /**< 0. */
} ClspDiagnosisSummary;

/** An effect that was weighed. */
typedef struct ClspDiagnosisRanked {
    uint32_t struct_size;     /**< Size of the struct as the caller knows it. */
    uint32_t parameter_count; /**< Of `values`. */
    uint32_t simulated;       /**< 1: compared by simulated captures of its own; 0: by its linear response. */
    uint32_t reserved;        /**< 0. */
    char effect[32];          /**< Its id. */
    char stage[16];           /**< Its stage. */
    double values[CLSP_MAX_EFFECT_PARAMETERS]; /**< Its fitted parameters in the order of the catalogue or the
                                                    hypothesis. */
    double probability;       /**< Among the effects of its step. */
    double distance_after;    /**< The gap that it would leave, in standard deviations of captures simulated with it; 0:
                                   no more than chance. */
    double gain;              /**< By which it lowers the squared distance on held-out frames plus the logarithm of the
                                   covariance's determinant: -2 ln of a likelihood ratio. */
} ClspDiagnosisRanked;

/** A fitted parameter of an effect that was found. */
typedef struct ClspDiagnosisParameter {
    uint32_t struct_size; /**< Size of the struct as the caller knows it. */
    uint32_t reserved;    /**< 0. */
    char effect[32];      /**< The effect's id. */
    char name[32];        /**< The parameter's name. */
    char unit[16];        /**< Its unit; "1" for a plain number. */
    double value;         /**< Fitted value. */
    double low;           /**< 95 % interval, lower end. */
    double high;          /**< 95 % interval, upper end. */
} ClspDiagnosisParameter;

/** One statistic of the real capture against the simulated ones. */
typedef struct ClspDiagnosisPlace {
    uint32_t struct_size; /**< Size of the struct as the caller knows it. */
    uint32_t reserved;    /**< 0. */
    char stage[16];       /**< Whose effects it shows first: "laser", "doe", "surface", "motion", "optics" or
                               "sensor". */
    char sequence[CLSP_MAX_CAPTURE_NAME]; /**< The sequence's name. */
    char statistic[64];   /**< For example "dot_width_x". */
    char region[32];      /**< "all", "r0c2" (of 3 x 3), "ring1" ... */
    char unit[32];        /**< For example "DN", "px"; "1" for a plain number. */
    double real;          /**< Of the capture. */
    double sim;           /**< Mean of the simulated captures without effects. */
    double z;             /**< Their difference in standard deviations of single simulated captures. */
    double p_adjusted;    /**< Its probability by chance, adjusted for the number of statistics (Holm). */
    double z_after;       /**< z with the effects found. */
    double distance_before; /**< On frames that no fit has seen, without effects: beyond chance, on the scale of
                                 ClspDiagnosisSummary::distance_before. NaN if no effect was found, and of a sequence of
                               fewer than four frames. */
    double distance_after;  /**< With the effects found; NaN as distance_before. */
    double fraction;        /**< Part of it that is gone: 1 - after / before. NaN also where the distance before is not
                                 beyond chance. */
    double fraction_95[2];  /**< Its 95 % interval; NaN as fraction. */
} ClspDiagnosisPlace;

/** What one effect took away from the gap, in the order in which effects were found. */
typedef struct ClspDiagnosisStep {
    uint32_t struct_size;  /**< Size of the struct as the caller knows it. */
    uint32_t reserved;     /**< 0. */
    char effect[32];       /**< Its id. */
    double distance_after; /**< The gap left by this effect and those before it. */
    double fraction;       /**< Part of the whole gap that is gone by then. */
} ClspDiagnosisStep;

/** Writes the defaults into *hypothesis. @param struct_size sizeof(ClspHypothesis). */
CLSP_API ClspStatus clspHypothesisInit(ClspHypothesis *hypothesis, uint32_t struct_size);
/**
 * Switches an effect of the caller's own on in a pipeline, or changes its parameters. Frames enqueued later have it.
 * Not for the per-frame path: builds its program. clspPipelineClearEffect() takes its id, too. Effects at one point
 * work one after the other, as they were first set.
 *
 * The frame that the source sees has the sensor's bits (0 without one), the pipeline's seed, the sequence 0 and the
 * lower 32 bits of the frame's index (a number beyond them is the sequence), CLSP_SCENE_DARK, CLSP_SCENE_DOTS of a
 * pattern or dots, or CLSP_SCENE_FLAT, and is not moving. IRRADIANCE is the ideal image before the lens distorts it;
 * what becomes negative or not finite there counts as a bad pixel (clspPipelineCheck()). INTENSITY is the light before
 * the sensor, or the frame of a pipeline without one. CODES needs a sensor, and UINT16 or UINT8 output; NaN becomes 0.
 * @param hypothesis with opencl_source; everything is copied.
 * @param values its parameters in order, `count` of them; those left out, or all if values is NULL, take the middle
 *                   between weak and strong.
 * @return CLSP_ERROR_UNSUPPORTED for a function of the host; CLSP_ERROR_BUILD with the compiler's log. After an error
 *         everything is as it was.
 */
CLSP_API ClspStatus clspPipelineSetHypothesis(ClspPipeline pipeline, const ClspHypothesis *hypothesis,
                                              const double *values, uint32_t count);
/** Writes the defaults into *desc. @param struct_size sizeof(ClspDiagnoseDesc). */
CLSP_API ClspStatus clspDiagnoseDescInit(ClspDiagnoseDesc *desc, uint32_t struct_size);

/**
 * Diagnoses a capture; *diagnosis gets one reference. Blocks: with six sequences of 40 frames on two processor cores
 * from some seconds to a minute, by how many effects there are.
 * @param context whose device simulates.
 * @param capture complete and in order (clspCaptureValidate() is called first).
 * @param desc NULL: the defaults.
 * @return CLSP_ERROR_CANCELLED when the progress function returned 0; CLSP_ERROR_INVALID_DATA for captures that cannot
 *         be judged, and for hypotheses that failed or made pixels that are not finite: the message names hypothesis,
 *         sequence and frame.
 */
CLSP_API ClspStatus clspDiagnose(ClspContext context, ClspCapture capture, const ClspDiagnoseDesc *desc,
                                 ClspDiagnosis *diagnosis);
/**
 * Compares a real capture with frames of any simulator: where they differ, and which catalogued effects, put on the
 * simulated frames as far as finished frames allow, would close how much. *diagnosis gets one reference. Blocks, for
 * about as long as clspDiagnose(). docs/guide/gap-compare.md explains the method.
 *
 * Sequences are paired by name where scene and motion agree, else by scene and motion, and cut to the same number of
 * frames; what has no partner is named in a note. Light levels, black levels and, where the simulated frames have less,
 * read noise are calibrated first. In the result `sim` stands for the simulated capture; parameters are what its frames
 * lack. The report has one key more, "compare": the pairs, the levels, the read noise, the effects that cannot be put
 * on finished frames and why.
 * @param context whose device draws what differs by chance, and puts effects on frames.
 * @param real what the camera recorded; complete and in order, as for clspDiagnose().
 * @param sim  what the simulator drew of the same scenes; as `real`.
 * @param desc NULL: the defaults. hypothesis_count must be 0, tolerance_file NULL.
 * @return CLSP_ERROR_INVALID_ARGUMENT for captures of different size or bits, and where no sequence has a partner;
 *         CLSP_ERROR_CANCELLED when the progress function returned 0; CLSP_ERROR_INVALID_DATA where no pair has light
 *         or is dark.
 */
CLSP_API ClspStatus clspCompare(ClspContext context, ClspCapture real, ClspCapture sim, const ClspDiagnoseDesc *desc,
                                ClspDiagnosis *diagnosis);
/** Adds a reference. */
CLSP_API ClspStatus clspDiagnosisRetain(ClspDiagnosis diagnosis);
/** Drops a reference; with the last one the diagnosis is gone. NULL is allowed. */
CLSP_API ClspStatus clspDiagnosisRelease(ClspDiagnosis diagnosis);

/** The numbers. @param summary with its struct_size set. */
CLSP_API ClspStatus clspDiagnosisGetSummary(ClspDiagnosis diagnosis, ClspDiagnosisSummary *summary);
/**
 * Id of an effect that was found, in the order in which they were found.
 * @param index    0 to effect_count - 1.
 * @param capacity size of `id` in bytes; the text is cut to fit and always ends with 0. No id has more than 32 bytes
 *                 with its 0.
 * @param id       NULL if capacity is 0.
 * @param length   size of the whole id with its final 0; may be NULL.
 */
CLSP_API ClspStatus clspDiagnosisGetEffect(ClspDiagnosis diagnosis, uint32_t index, uint64_t capacity, char *id,
                                           uint64_t *length);
/** Id of an effect that explains the gap as well as the others of the equivalents; as clspDiagnosisGetEffect(). */
CLSP_API ClspStatus clspDiagnosisGetEquivalent(ClspDiagnosis diagnosis, uint32_t index, uint64_t capacity, char *id,
                                               uint64_t *length);
/** Something that could not be judged, and why, in words; as clspDiagnosisGetEffect(), of any length. */
CLSP_API ClspStatus clspDiagnosisGetNote(ClspDiagnosis diagnosis, uint32_t index, uint64_t capacity, char *text,
                                         uint64_t *length);
/** An effect of the ranking, best first; behind them the effects found later, which were ranked in steps of their
 *  own. */
CLSP_API ClspStatus clspDiagnosisGetRanked(ClspDiagnosis diagnosis, uint32_t index, ClspDiagnosisRanked *ranked);
/** A fitted parameter of the effects found. @param parameter with its struct_size set. */
CLSP_API ClspStatus clspDiagnosisGetParameter(ClspDiagnosis diagnosis, uint32_t index,
                                              ClspDiagnosisParameter *parameter);
/** A statistic, worst first; all of them. @param place with its struct_size set. */
CLSP_API ClspStatus clspDiagnosisGetPlace(ClspDiagnosis diagnosis, uint32_t index, ClspDiagnosisPlace *place);
/** A step of the waterfall. @param step with its struct_size set. */
CLSP_API ClspStatus clspDiagnosisGetStep(ClspDiagnosis diagnosis, uint32_t index, ClspDiagnosisStep *step);

/**
 * The report as a JSON object, UTF-8 (the gap report format, version 1; docs/reference/gap-report.md lists its keys).
 * @param capacity size of `text` in bytes; the text is cut to fit and always ends with 0.
 * @param text     NULL if capacity is 0.
 * @param length   size of the whole text with its final 0; may be NULL.
 */
CLSP_API ClspStatus clspDiagnosisGetReportJson(ClspDiagnosis diagnosis, uint64_t capacity, char *text,
                                               uint64_t *length);
/** Writes the JSON report to a file, which appears, or replaces an older one, only when it is complete.
 *  @return CLSP_ERROR_IO if it cannot be written. */
CLSP_API ClspStatus clspDiagnosisWriteReport(ClspDiagnosis diagnosis, const char *path);
/** Writes the report for eyes: one HTML file with its pictures and plots, which needs no network.
 *  Otherwise as clspDiagnosisWriteReport(). */
CLSP_API ClspStatus clspDiagnosisWriteHtml(ClspDiagnosis diagnosis, const char *path);
/** The camera that was found, with the effects of the last model (profile.h); *profile gets one reference.
 *  @return CLSP_ERROR_INVALID_STATE for a comparison, whose simulator is not the library's. */
CLSP_API ClspStatus clspDiagnosisGetProfile(ClspDiagnosis diagnosis, ClspProfile *profile);

#ifdef __cplusplus
}
#endif

#endif /* CLSPECKLE_DIAGNOSIS_H */

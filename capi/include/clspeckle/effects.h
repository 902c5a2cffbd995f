/**
 * @file effects.h
 * @brief The catalogue of effects that make a camera's picture differ from the ideal one, each to be switched on in a
 *        pipeline.
 *
 * Ids, parameters and meaning are those of the sim-to-real gap protocol (docs/reference/effects.md lists them with
 * their equations, and the few parameters that it does not vary or name). An effect that is off costs nothing: kernels
 * are built without it. What an effect sets can also be set in the descriptions of the stages (the direction of ghost
 * dots as their offset); a pipeline with effects changes its stages' parameters, and clearing the effect puts them
 * back. Meanwhile, of the stages' own settings only a sensor's exposure and a pattern's pose may be changed: others
 * would be put back as they were when the first effect was set. ambient_light is a level in DN at the exposure of the
 * moment in which effects are set or cleared. Pipelines that share a stage must not both have effects on it.
 */
#ifndef CLSPECKLE_EFFECTS_H
#define CLSPECKLE_EFFECTS_H

#include "types.h"

#ifdef __cplusplus
extern "C" {
#endif

#define CLSP_MAX_EFFECT_PARAMETERS 4u /**< No effect has more parameters. */

/** One parameter of an effect. Layout frozen. */
typedef struct ClspEffectParameter {
    char name[32];   /**< For example "waves". */
    char unit[16];   /**< For example "px", "DN"; "1" for a plain number. */
    double minimum;  /**< Least value accepted. */
    double maximum;  /**< Greatest value accepted. */
    double weak;     /**< A weak effect, as cameras show it. */
    double strong;   /**< A strong one; may be below `weak`. */
} ClspEffectParameter;

/** One effect. Layout frozen. */
typedef struct ClspEffectInfo {
    char id[32];              /**< For example "defocus". */
    char stage[16];           /**< "laser", "doe", "surface", "motion", "optics" or "sensor". */
    char summary[128];        /**< What happens. */
    char kernel[64];          /**< File and function that carry it out. */
    uint32_t parameter_count; /**< 1 to CLSP_MAX_EFFECT_PARAMETERS. */
    uint32_t whole_parameters; /**< Bit i: parameters[i] counts or numbers something, and must be a whole number. */
    ClspEffectParameter parameters[CLSP_MAX_EFFECT_PARAMETERS]; /**< The first parameter_count of them. */
} ClspEffectInfo;

/** How many effects there are. */
CLSP_API ClspStatus clspEffectGetCount(uint32_t *count);
/** What effect `index` is, 0 to count - 1, in the order in which light meets them. */
CLSP_API ClspStatus clspEffectGetInfo(uint32_t index, ClspEffectInfo *info);

/**
 * In which scenes an effect changes frames (*acts), and in which a diagnosis can tell it (*shows): bits 1 <<
 * CLSP_SCENE_*. Either may be NULL.
 */
CLSP_API ClspStatus clspEffectGetScenes(const char *id, uint32_t *acts, uint32_t *shows);

/** What hosts ask of a camera that effects may change: where its codes end, and what its stages must hold. */
typedef struct ClspCameraTraits {
    uint32_t struct_size;        /**< Size of the struct as the caller knows it. */
    uint32_t bits;               /**< Of the sensor, 1 to 16; default 10. No effect changes it. */
    uint32_t effective_bits;     /**< As in ClspSensorDesc; 0 (default): bits. */
    uint32_t polarization_count; /**< Of the phase, 1 or 2 (default). */
    double fill_factor;          /**< Of the aperture; default 0. */
    double saturation_dn;        /**< As in ClspSensorDesc, default infinity. */
    double gamma;                /**< As in ClspSensorDesc, default 1. */
    double cubic_nonlinearity;   /**< As in ClspSensorDesc, default 0. */
    double ambient_dn;           /**< Constant light, default 0. */
    uint32_t nonlinearity_power; /**< As in ClspSensorDesc, default 3. */
    uint32_t reserved_nonlinearity; /**< 0. */
} ClspCameraTraits;

/** The defaults of each member. */
CLSP_API ClspStatus clspCameraTraitsInit(ClspCameraTraits *traits, uint32_t struct_size);
/**
 * Makes of a camera's traits what they are with an effect. `values` and `count` are those of clspPipelineSetEffect().
 * Needs no device; if it fails, *traits is as it was.
 */
CLSP_API ClspStatus clspEffectChangeTraits(const char *id, const double *values, uint32_t count,
                                           ClspCameraTraits *traits);

/**
 * Switches an effect on, or changes its parameters. Frames enqueued later have it. Not for the per-frame path: builds
 * programs and waits for the device. Only stages that the effect sets are made anew: a sensor draws its fixed patterns
 * again and forgets the frame before (image_lag), and depolarization of a phase with one polarization draws all phases
 * in the next frame. A restored state (clspPhaseEnqueueRestore()) is never lost so: with fewer polarizations the first
 * of them stays, and an effect that needs more is refused until the phase is refreshed. After an error everything is as
 * it was.
 * @param id     one of the catalogue's.
 * @param values its parameters in order, `count` of them; those left out, or all if values is NULL, take the middle
 *               between weak and strong.
 * Fails if the pipeline has not the stage that the effect belongs to (dots for laser and DOE effects, a sensor); a lens
 * is made if needed.
 */
CLSP_API ClspStatus clspPipelineSetEffect(ClspPipeline pipeline, const char *id, const double *values, uint32_t count);

/** An effect and its parameters. Layout frozen. */
typedef struct ClspEffectSetting {
    const char *id;       /**< One of the catalogue's. */
    const double *values; /**< Its parameters in order; NULL: all take the middle. */
    uint32_t count;       /**< Elements of `values`; those left out take the middle. */
    uint32_t reserved;    /**< 0. */
} ClspEffectSetting;

/** Several calls of clspPipelineSetEffect() in one: each stage is made anew once. All are switched on, beside those
 *  that are on, or, after an error, none.
 *  @param count elements of `effects`; 0: nothing happens. @param effects each id once. */
CLSP_API ClspStatus clspPipelineSetEffects(ClspPipeline pipeline, uint32_t count, const ClspEffectSetting *effects);
/** Switches an effect off; NULL: all of them. One that is off stays off. */
CLSP_API ClspStatus clspPipelineClearEffect(ClspPipeline pipeline, const char *id);

#ifdef __cplusplus
}
#endif

#endif /* CLSPECKLE_EFFECTS_H */

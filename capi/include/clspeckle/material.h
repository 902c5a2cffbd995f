/**
 * @file material.h
 * @brief What surfaces are made of: how rough, how they change the polarization, how their speckle moves and lives.
 *
 * A material image (UINT8) says for each pixel which entry of the table holds there. Ids outside the table count as bad
 * pixels (clspPipelineCheck() reports them) and take the first entry.
 */
#ifndef CLSPECKLE_MATERIAL_H
#define CLSPECKLE_MATERIAL_H

#include "types.h"

#ifdef __cplusplus
extern "C" {
#endif

#define CLSP_MAX_MATERIALS 256u /**< Entries that a table may have. */

/** One material. */
typedef struct ClspMaterial {
    uint32_t struct_size; /**< Size of the struct as the caller knows it. */
    uint32_t reserved;    /**< 0. */
    /** RMS height of the surface in metres, >= 0; infinity (default): fully developed speckle. With wavelength w and
     *  normal incidence the reflected phase spreads by s = 4 pi roughness_rms_m / w, and the fraction c = exp(-s^2) of
     *  the light keeps its phase (thesis 2.4; Goodman, Speckle Phenomena in Optics, 3.2): U = sqrt(I0) (sqrt(1 - c) z +
     *  sqrt(c)). */
    double roughness_rms_m;
    /** Degree of polarization of the returned light, 0 to 1; negative (default): that of the aperture. */
    double degree_of_polarization;
    /** Time in seconds after which a resting surface's field correlation has fallen to 1/e (skin, cloth), > 0; infinity
     *  (default): never. 0: new in each frame. */
    double correlation_time_s;
    /** Displacement across the viewing direction at which the field correlation has fallen to 1/e, > 0; default 0.5e-3
     *  (thesis 3.2.4). Infinity: never. */
    double lateral_correlation_length_m;
    /** Likewise along the viewing direction; default 3e-3 (thesis 3.2.5). */
    double axial_correlation_length_m;
    /** Likewise for rotation; default 0.25 degrees = 4.36332e-3 rad (thesis 3.2.6). */
    double rotation_correlation_angle_rad;
    /** Fraction of the light that enters the surface and leaves it elsewhere, 0 (default) to 1; see the pipeline's
     *  subsurface_length_px. */
    double subsurface_fraction;
} ClspMaterial;

/** Writes the defaults into *material. @param struct_size sizeof(ClspMaterial). */
CLSP_API ClspStatus clspMaterialInit(ClspMaterial *material, uint32_t struct_size);

/**
 * Makes a table; *table gets one reference.
 * @param materials `count` entries, each with its struct_size set to the same value; entry i is material id i. Copied.
 * @param count 1 to CLSP_MAX_MATERIALS.
 */
CLSP_API ClspStatus clspMaterialTableCreate(ClspContext context, const ClspMaterial *materials, uint32_t count,
                                            ClspMaterialTable *table);
/** Adds a reference. */
CLSP_API ClspStatus clspMaterialTableRetain(ClspMaterialTable table);
/** Drops a reference; with the last one the table is gone, once what was enqueued is done. NULL is allowed. */
CLSP_API ClspStatus clspMaterialTableRelease(ClspMaterialTable table);

#ifdef __cplusplus
}
#endif

#endif /* CLSPECKLE_MATERIAL_H */

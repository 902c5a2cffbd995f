/**
 * @file dot_layout.h
 * @brief Semi-random layouts of projected dots: a stated number in a stated field of view, a least distance, and
 *        neighbourhoods by which a dot is told from the others of its row.
 *
 * Directions are direction cosines (u, v) in the laser's frame, x to the right and y down, as in pattern.h. The field
 * of view is |u| <= sin(half_angle_x_rad), |v| <= sin(half_angle_y_rad). Dots are put one after the other at random
 * places of it, uniform in (u, v), each kept if it is at least min_distance from those before (random sequential
 * adsorption): anywhere, or on the orders of a unit cell (doe_design.h), which an element with that cell can make.
 *
 * A stereo camera finds a dot again by the dots around it, among those of the same row (its baseline lies along u).
 * With the neighbourhood of a dot being the offsets of the other dots within neighborhood_radius, and two offsets
 * matching within `tolerance`,
 *
 *   difference(i, j) = 1 - 2 matches / (neighbours of i + neighbours of j),
 *
 * 0 for dots that look alike, 1 for dots whose neighbourhoods have nothing in common; dots without neighbours look
 * alike. It is measured over all pairs with |v_i - v_j| <= row_half_height. Of pairs below min_difference one dot is
 * moved, until there are none.
 *
 * Thread rule: the function may be called from any number of threads at once; it needs no context.
 */
#ifndef CLSPECKLE_DOT_LAYOUT_H
#define CLSPECKLE_DOT_LAYOUT_H

#include "types.h"

#ifdef __cplusplus
extern "C" {
#endif

#define CLSP_MAX_LAYOUT_DOTS 100000u /**< Dots of a layout. */

/** What a layout is to be like. */
typedef struct ClspDotLayoutDesc {
    uint32_t struct_size;  /**< Size of the struct as the caller knows it. */
    uint32_t lattice;      /**< 1 (default): dots are orders of the cell; 0: anywhere. */
    uint64_t count;        /**< Of dots, 1 to CLSP_MAX_LAYOUT_DOTS; default 5303. */
    uint64_t seed;         /**< Default 0. The same seed gives the same layout. */
    uint32_t width;        /**< Pixels of the cell, 1 to 8192; default 512. Unused without lattice. */
    uint32_t height;       /**< As width; default 512. */
    double pixel_pitch_m;  /**< Of the cell, in metres; default 0.4e-6. Unused without lattice. */
    double wavelength_m;   /**< In metres; default 940e-9. */
    double half_angle_x_rad; /**< Half of the horizontal field of view, above 0; default 30 degrees. */
    double half_angle_y_rad; /**< Half of the vertical field of view, above 0; default 22.5 degrees. */
    double min_distance;   /**< Least distance between dots in direction cosines; 0 (default): 0.95 of the largest that
                                was found to hold so many dots. */
    double beam_diameter_m; /**< Distances below the diffraction limit 1.22 wavelength / diameter are refused; 0
                                 (default): not known. */
    double row_half_height; /**< Of dots that may be mistaken for each other, in direction cosines; 0 (default): half of
                                 the distance. */
    double neighborhood_radius; /**< In direction cosines; 0 (default): three mean spacings sqrt(area / count). */
    double tolerance;      /**< Neighbours within this match, in direction cosines; at most half of the distance; 0
                                (default): a quarter. */
    double min_difference; /**< That any two dots of a row have at least, 0 to 1; default 0.25; 0: measured only. */
    uint32_t point_symmetric; /**< 1: with every dot (u, v) there is (-u, -v), as binary elements make them, and with an
                                   odd count the zero order; default 0. */
    uint32_t repair_rounds; /**< In which alike dots are moved, at most; default 50. */
    ClspProgressFunction progress; /**< Told how far the layout is; NULL (default): nobody is told. */
    void *progress_data;   /**< Handed to `progress`; default NULL. */
} ClspDotLayoutDesc;

/** What a layout is like. */
typedef struct ClspDotLayoutInfo {
    uint32_t struct_size;       /**< Size of the struct as the caller knows it. */
    uint32_t reserved;          /**< 0. */
    double min_distance;        /**< That dots have at least, in direction cosines. */
    double mean_spacing;        /**< sqrt(area / count), in direction cosines. */
    double row_half_height;     /**< As used. */
    double neighborhood_radius; /**< As used. */
    double tolerance;           /**< As used. */
    double mean_neighbors;      /**< Of a dot. */
    double min_difference;      /**< The least of all pairs. */
    double mean_difference;     /**< Over all pairs. */
    uint64_t pair_count;        /**< Pairs in the same row band. */
    uint64_t worst_first;       /**< One dot of the pair of the least difference. */
    uint64_t worst_second;      /**< The other. */
    uint64_t moved_count;       /**< Dots that were moved for min_difference. */
} ClspDotLayoutInfo;

/** Writes the defaults into *desc. @param struct_size sizeof(ClspDotLayoutDesc). */
CLSP_API ClspStatus clspDotLayoutDescInit(ClspDotLayoutDesc *desc, uint32_t struct_size);

/**
 * Makes a layout. Blocks: a second for 5303 dots, longer where many dots must be moved.
 * @param directions gets desc->count pairs (u, v).
 * @param orders     gets desc->count pairs (m, n); NULL: not wanted; must be NULL without lattice.
 * @param info       with its struct_size set; NULL: not wanted.
 * @return CLSP_ERROR_INVALID_ARGUMENT where the field of view reaches beyond 90 degrees or out of the pixels' reach, so
 *         many dots do not fit at that distance, the distance is below the diffraction limit, or dots still look alike
 *         after repair_rounds. The message says what is possible. CLSP_ERROR_CANCELLED when the progress function
 *         returned 0.
 */
CLSP_API ClspStatus clspDotLayoutCreate(const ClspDotLayoutDesc *desc, double *directions, int32_t *orders,
                                        ClspDotLayoutInfo *info);

#ifdef __cplusplus
}
#endif

#endif /* CLSPECKLE_DOT_LAYOUT_H */

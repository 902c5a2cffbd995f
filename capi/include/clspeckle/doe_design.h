/**
 * @file doe_design.h
 * @brief Design of diffractive beam splitters: from wanted orders (or directions) and powers to the phase of a periodic
 *        unit cell.
 *
 * The element is a cell of width x height square pixels that repeats over the beam. Its transmission is exp(i phase);
 * the far field has orders (m, n), m to the right and n down, at the direction cosines u = m wavelength / (pixel_pitch
 * width), v = n wavelength / (pixel_pitch height) (contract of pattern.h: x to the right, y down, in the laser's
 * frame). With the cell's forward discrete Fourier transform T(m, n) = sum t(x, y) exp(-2 pi i (m x / width + n y /
 * height)) / (width height), the power of an order is
 *
 *   P(m, n) = |T(m, n)|^2 sinc^2(m / width) sinc^2(n / height),   sinc(x) = sin(pi x) / (pi x),
 *
 * the sinc being the envelope of a square pixel. All powers together, with the orders beyond |m| = width / 2 (which
 * repeat the T of the others), are 1: scalar diffraction of a thin element without losses (Goodman, Introduction to
 * Fourier Optics).
 *
 * Method: iterative Fourier transform with weights (Gerchberg and Saxton 1972 with the rules CLSP_DOE_RULE_*), soft
 * quantization to the levels (Wyrowski, J. Opt. Soc. Am. A 7, 961 (1990)), then direct binary search (Seldowitz,
 * Allebach and Sweeney, Appl. Opt. 26, 2788 (1987)). docs/method/doe-design.md explains it and has figures.
 *
 * Thread rule: clspDoeDesignCreate() and clspDoeDesignEvaluate() block; any number of threads may design at the same
 * time. The progress function is called on the thread that called. A design is complete and never changes: any number
 * of threads may read it at once.
 */
#ifndef CLSPECKLE_DOE_DESIGN_H
#define CLSPECKLE_DOE_DESIGN_H

#include "diagnosis.h"
#include "types.h"

#ifdef __cplusplus
extern "C" {
#endif

/** @name How the weights of the orders follow from their powers */
/** @{ */
#define CLSP_DOE_RULE_GS 0u  /**< Gerchberg-Saxton: not at all. */
/** Weighted (Di Leonardo, Ianni and Ruocco, Opt. Express 15, 1913 (2007)): times (amplitude / mean)^-feedback. */
#define CLSP_DOE_RULE_GSW 1u
/** Adaptive (Nogrette et al., Phys. Rev. X 4, 021034 (2014)): wanted powers times 1 / (1 - feedback (1 - power /
 *  mean)). */
#define CLSP_DOE_RULE_NOGRETTE 2u
/** As GSW; the orders keep their phases from fix_phase_iteration on until the quantization (Kim et al., Opt. Lett. 44,
 *  3178 (2019)). */
#define CLSP_DOE_RULE_KIM 3u
/** @} */

#define CLSP_MAX_DOE_SIDE 8192u       /**< Pixels of a cell along each axis. */
#define CLSP_MAX_DOE_LEVELS 256u      /**< Phase levels. */
#define CLSP_MAX_DOE_ORDERS 1000000u  /**< Wanted orders. */

/** A wanted order. The layout of this struct is frozen: it never grows. */
typedef struct ClspDoeDesignOrder {
    int32_t m;     /**< To the right; |m| below width / 2. */
    int32_t n;     /**< Down; |n| below height / 2. */
    double weight; /**< Wanted power relative to the other orders, above 0; at most 1e6 times the least of the list. */
} ClspDoeDesignOrder;

/** What to design. */
typedef struct ClspDoeDesignDesc {
    uint32_t struct_size; /**< Size of the struct as the caller knows it. */
    uint32_t width;       /**< Pixels of the cell, 1 to CLSP_MAX_DOE_SIDE, prime factors up to 13; default 512. */
    uint32_t height;      /**< As width; default 512. */
    uint32_t levels;      /**< Phase levels, multiples of 2 pi / levels: 2 to CLSP_MAX_DOE_LEVELS; 0: continuous.
                               Default 8. */
    double pixel_pitch_m; /**< Side of a pixel in metres; default 0.4e-6. */
    double wavelength_m;  /**< Of the light, in metres; default 940e-9. */
    double beam_diameter_m; /**< Of the beam on the element, in metres: orders closer than 1.22 wavelength / diameter
                                 are refused, and so is a cell larger than the beam. 0 (default): not known, not
                                 checked. */
    const ClspDoeDesignOrder *orders; /**< What is wanted; no default. Copied. */
    uint64_t order_count;   /**< 1 to CLSP_MAX_DOE_ORDERS. */
    uint64_t seed;          /**< Of the orders' first phases; default 0. The same seed gives the same design on the same
                                 device. */
    double feedback;        /**< Of the rule: GSW and KIM up to 2, NOGRETTE up to 0.99. 0 (default): 1 and 0.7. Lowered
                                 by itself where the powers swing (few orders). */
    uint32_t rule;          /**< CLSP_DOE_RULE_*; default GSW. */
    uint32_t iterations;    /**< Before the quantization, 1 to 100000; default 100. With 2 levels they lead from grey to
                                 binary. */
    uint32_t quantization_iterations; /**< In which the levels are taken, 1 to 100000; default 60. Unused with
                                           continuous phase. */
    uint32_t fix_phase_iteration; /**< Of KIM, at least 1; default 12. */
    uint32_t search_sweeps; /**< Sweeps of direct binary search at most, ended earlier when nothing gets better; default
                                 0. Needs levels. */
    uint32_t compensate_envelope; /**< 1 (default): the powers behind the pixels' envelope are made as wanted; 0: those
                                       before it. */
    uint32_t mirror_orders; /**< With 2 levels, whose transmission is real, P(-m, -n) = P(m, n). 1: missing mirror
                                 images are added to the list with the same weight; 0 (default): such a list is
                                 refused. */
    uint32_t reserved;      /**< 0. */
    ClspProgressFunction progress; /**< Told how far the design is; NULL (default): nobody is told. */
    void *progress_data;    /**< Handed to `progress`; default NULL. */
} ClspDoeDesignDesc;

/** What a design does with the light. Powers are parts of the incoming light: efficiency + (zero_order unless it is
 *  wanted) + other_orders + beyond = 1. */
typedef struct ClspDoeDesignReport {
    uint32_t struct_size;   /**< Size of the struct as the caller knows it. */
    uint32_t zero_order_wanted; /**< 1: order (0, 0) is in the list. */
    uint64_t order_count;   /**< Of the list, with added mirror images. */
    uint64_t step_count;    /**< Of clspDoeDesignGetHistory(). */
    double efficiency;      /**< Power of all wanted orders. */
    double grid_efficiency; /**< The same without the pixels' envelope: sum of |T|^2, as spatial light modulator papers
                                 count it. */
    double uniformity_rms;  /**< Standard deviation of power / weight over the orders, divided by its mean. */
    double uniformity_peak_to_peak; /**< (strongest - weakest) / (strongest + weakest) of power / weight. */
    double weakest;         /**< Least power / weight over the mean. */
    double strongest;       /**< Greatest power / weight over the mean. */
    double zero_order;      /**< Power of order (0, 0). */
    double zero_order_relative; /**< Over the mean power of a wanted order. */
    double largest_ghost;   /**< Greatest power of an order that is neither wanted nor (0, 0), in the base band |m| <=
                                 width / 2. */
    double largest_ghost_relative; /**< Over the mean power of a wanted order. */
    int32_t ghost_m;        /**< Which order that is. */
    int32_t ghost_n;        /**< Which order that is. */
    double other_orders;    /**< Power of all other orders of the base band, the largest ghost among them. */
    double beyond;          /**< Power outside of the base band: the pixels' own sidelobes. */
    uint64_t search_changes; /**< Pixels that the search changed. */
    uint32_t search_sweeps; /**< Sweeps that it made. */
    uint32_t reserved;      /**< 0. */
    double seconds;         /**< That the design took. */
} ClspDoeDesignReport;

/** Writes the defaults into *desc. @param struct_size sizeof(ClspDoeDesignDesc). */
CLSP_API ClspStatus clspDoeDesignDescInit(ClspDoeDesignDesc *desc, uint32_t struct_size);

/**
 * Designs; *design gets one reference. Blocks: two Fourier transforms of the cell for each iteration.
 * @return CLSP_ERROR_INVALID_ARGUMENT for descriptions that contradict themselves: an empty list, orders given twice
 *         (dots closer than the diffraction limit), outside of the cell's band or beyond 90 degrees, one level, a list
 *         without mirror images for 2 levels; CLSP_ERROR_CANCELLED when the progress function returned 0;
 *         CLSP_ERROR_OUT_OF_MEMORY where the device cannot hold the cell.
 */
CLSP_API ClspStatus clspDoeDesignCreate(ClspContext context, const ClspDoeDesignDesc *desc, ClspDoeDesign *design);
/**
 * The report of a phase that exists already. The iterations and the search of the description are checked but not made.
 * @param phase height x width, in radians, each within 1 % of a step of one of the levels (if levels is not 0).
 * @param phase_pitch_bytes from one row to the next; 0: tightly packed.
 * @return CLSP_ERROR_INVALID_DATA where a phase is not finite or is none of the levels: the message names it.
 */
CLSP_API ClspStatus clspDoeDesignEvaluate(ClspContext context, const ClspDoeDesignDesc *desc, const float *phase,
                                          uint64_t phase_pitch_bytes, ClspDoeDesign *design);
/** Adds a reference. */
CLSP_API ClspStatus clspDoeDesignRetain(ClspDoeDesign design);
/** Drops a reference; with the last one the design is gone. NULL is allowed. */
CLSP_API ClspStatus clspDoeDesignRelease(ClspDoeDesign design);

/** The numbers. @param report with its struct_size set. */
CLSP_API ClspStatus clspDoeDesignGetReport(ClspDoeDesign design, ClspDoeDesignReport *report);
/** The phase in radians, 0 to 2 pi, row by row. @param count width x height, or the call is refused. */
CLSP_API ClspStatus clspDoeDesignGetPhase(ClspDoeDesign design, uint64_t count, float *phase);
/**
 * The wanted orders, in the order of the list with added mirror images behind, and what power each gets.
 * @param count  order_count of the report, or the call is refused.
 * @param orders `count` orders; NULL: not wanted.
 * @param powers `count` powers P(m, n); NULL: not wanted.
 */
CLSP_API ClspStatus clspDoeDesignGetOrders(ClspDoeDesign design, uint64_t count, ClspDoeDesignOrder *orders,
                                           double *powers);
/**
 * The convergence: efficiency and uniformity_rms after each iteration; the last step is the finished design.
 * @param count step_count of the report, or the call is refused.
 * @param efficiency `count` numbers; NULL: not wanted.
 * @param uniformity_rms `count` numbers; NULL: not wanted. With compensate_envelope 0, before the envelope (but for the
 *                       last).
 */
CLSP_API ClspStatus clspDoeDesignGetHistory(ClspDoeDesign design, uint64_t count, double *efficiency,
                                            double *uniformity_rms);

/**
 * The orders of a cell that are nearest to directions. Needs no context.
 * @param width,height,pixel_pitch_m,wavelength_m the cell, as in ClspDoeDesignDesc.
 * @param count      of the directions, 1 to CLSP_MAX_DOE_ORDERS.
 * @param directions `count` pairs of direction cosines (u, v), u^2 + v^2 below 1.
 * @param orders     gets `count` orders of weight 1.
 * @param errors     gets `count` distances between a direction and its order, in direction cosines; NULL: not wanted.
 * @return CLSP_ERROR_INVALID_ARGUMENT for a direction beyond 90 degrees or out of the pixels' reach, and where two
 *         directions share an order: the message says which.
 */
CLSP_API ClspStatus clspDoeDesignSnapDirections(uint32_t width, uint32_t height, double pixel_pitch_m,
                                                double wavelength_m, uint64_t count, const double *directions,
                                                ClspDoeDesignOrder *orders, double *errors);

#ifdef __cplusplus
}
#endif

#endif /* CLSPECKLE_DOE_DESIGN_H */

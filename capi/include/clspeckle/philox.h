/**
 * @file philox.h
 * @brief Philox4x32-10 on the device: raw blocks, and images of bits, uniforms and normals.
 *
 * Source: J. K. Salmon et al., "Parallel random numbers: as easy as 1, 2, 3", SC'11. Bit-exact with the Random123
 * library.
 *
 * Image mapping (used by every random image in the library but the one below): with Q = ceil(height / 4), pixel (x, y)
 * takes word j = y / Q (integer division) of the block with counter (x, y mod Q, frame & 0xffffffff, stream | (frame >>
 * 32) << 16) and key (seed & 0xffffffff, seed >> 32). The integers are the same on every device and for any work-group
 * size.
 *
 * Conversions of a word w (single precision, no device built-in, the same bits on every device that rounds sqrt right):
 *  - uniform: fma((float)w, 2^-32, 2^-33), in (0, 1]
 *  - phasor:  exp(2 pi i w / 2^32)
 *  - normal:  words 0 and 1 of a block give r cos a and r sin a with r = sqrt(-2 ln uniform(word 0)), a = 2 pi word 1
 *             / 2^32 (Box-Muller); words 2 and 3 likewise.
 *
 * Noise that is new for every pixel of every frame (the sensor's read noise) takes a word for two pixels: row r = y mod
 * Q of a quarter takes word y / Q of the block of counter (x, r / 2, ...) (integer divisions), which makes a pair of
 * normals, the first for even r, the second for odd r:
 *  - pair:    R cos a and R sin a with R = sqrt(-2 ln uniform(word)), a = pi / 4 + 2 pi f,
 *             f = (int32)(word * 0xE78DDE6D mod 2^32) / 2^34, each negative where the word's bit 0 (the first)
 *             or 1 (the second) is set. The 2^32 points (uniform, a) are a lattice, as even as few are; single
 *             precision with short polynomials: right to 2e-6 R. clspPhiloxEnqueueBlocks() gives the words; no call
 *             makes the normals.
 */
#ifndef CLSPECKLE_PHILOX_H
#define CLSPECKLE_PHILOX_H

#include "types.h"

#ifdef __cplusplus
extern "C" {
#endif

/**
 * Runs Philox4x32-10 on `count` counters.
 * @param counters buffer of `count` x 4 uint32, from `counters_offset_bytes`.
 * @param key      two uint32, the same for all counters.
 * @param local_size work-group size; 0 leaves it to the device.
 * @param blocks   buffer of `count` x 4 uint32, from `blocks_offset_bytes`; may be the counters themselves.
 */
CLSP_API ClspStatus clspPhiloxEnqueueBlocks(ClspContext context, cl_command_queue queue, cl_mem counters,
                                            uint64_t counters_offset_bytes, const uint32_t key[2], uint64_t count,
                                            uint64_t local_size, cl_mem blocks, uint64_t blocks_offset_bytes,
                                            uint32_t num_events_in_wait_list, const cl_event *event_wait_list,
                                            cl_event *event);

#define CLSP_DISTRIBUTION_BITS 0u    /**< Raw words, CLSP_FORMAT_UINT32. */
#define CLSP_DISTRIBUTION_UNIFORM 1u /**< (0, 1], CLSP_FORMAT_FLOAT32. */
#define CLSP_DISTRIBUTION_NORMAL 2u  /**< Mean 0, variance 1, CLSP_FORMAT_FLOAT32. */

/** What clspPhiloxEnqueueFill() draws. */
typedef struct ClspPhiloxDesc {
    uint32_t struct_size; /**< Size of the struct as the caller knows it. */
    uint32_t distribution;  /**< CLSP_DISTRIBUTION_*; default UNIFORM. */
    uint64_t seed;          /**< Default 0. */
    uint64_t frame_index;   /**< Below 2^48; default 0. */
    uint32_t stream;        /**< 0x8000 to 0xffff are free for the host (default 0x8000); lower ones are the
                                 library's. */
    uint32_t local_size;    /**< Work-group size; 0 (default) leaves it to the device. */
} ClspPhiloxDesc;

/** Writes the defaults into *desc. @param struct_size sizeof(ClspPhiloxDesc). */
CLSP_API ClspStatus clspPhiloxDescInit(ClspPhiloxDesc *desc, uint32_t struct_size);

/** Fills an image with random numbers by the mapping at the top of this file. */
CLSP_API ClspStatus clspPhiloxEnqueueFill(ClspContext context, cl_command_queue queue, const ClspPhiloxDesc *desc,
                                          const ClspImage *image, uint32_t num_events_in_wait_list,
                                          const cl_event *event_wait_list, cl_event *event);

#ifdef __cplusplus
}
#endif

#endif /* CLSPECKLE_PHILOX_H */

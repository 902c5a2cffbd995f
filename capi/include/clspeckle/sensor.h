/**
 * @file sensor.h
 * @brief From intensity to codes: exposure, dark frame, hot and cold pixels, temporal noise, saturation, black level, ADC.
 *
 *     signal = min(max(exposure_gain_dn * I, 0), saturation_dn)     0 at cold pixels and where I is NaN
 *     value  = signal + black_level_dn + dark_frame(x, y) + hot(x, y) + read_noise_dn * n
 *     code   = clip(round_half_to_even(value), 0, 2^bits - 1)
 * n is standard normal, independent for each pixel and frame (Philox stream 0x10). Hot pixels are drawn once from the seed: a
 * pixel is hot where the uniform of stream 0x11 is below hot_pixel_fraction, its offset is -hot_pixel_mean_dn ln(u), u from stream 0x12;
 * cold where the uniform of stream 0x13 is below cold_pixel_fraction. Both use frame index 0. Thesis sections 3.2.1 to 3.2.3.
 */
#ifndef CLSPECKLE_SENSOR_H
#define CLSPECKLE_SENSOR_H

#include "types.h"

#ifdef __cplusplus
extern "C" {
#endif

/** How a sensor is made. */
typedef struct ClspSensorDesc {
    uint32_t struct_size; /**< Size of the struct as the caller knows it. */
    uint32_t width;              /**< Image width in pixels, 1 to 16384. */
    uint32_t height;             /**< Image height in pixels, 1 to 16384. */
    uint32_t bits;               /**< 8 to 16; default 10. */
    uint64_t seed;               /**< Default 0. */
    double exposure_gain_dn;     /**< DN per unit of intensity, >= 0; default 512. */
    double saturation_dn;        /**< The signal stops here, > 0; infinity (default): only the ADC clips. */
    double black_level_dn;       /**< Default 64. */
    double read_noise_dn;        /**< Standard deviation of the temporal noise, >= 0; default 4. */
    double hot_pixel_fraction;   /**< 0 to 1; default 0. */
    double hot_pixel_mean_dn;    /**< >= 0; default 150. */
    double cold_pixel_fraction;  /**< 0 to 1; default 0. */
    double float_full_scale;     /**< Value of the top code in a FLOAT32 output, > 0; default 1. */
    const float *dark_frame_dn;  /**< Host memory, height x width mean dark signal above the black level; copied. Finite. NULL (default): 0. */
    uint64_t dark_frame_pitch_bytes; /**< From row to row; 0 (default) means tightly packed. */
    uint32_t quantize;           /**< 1 (default): FLOAT32 output is quantized like codes. 0: it is only clipped. */
    uint32_t reserved;           /**< 0. */
} ClspSensorDesc;

/** Writes the defaults into *desc. @param struct_size sizeof(ClspSensorDesc). */
CLSP_API ClspStatus clspSensorDescInit(ClspSensorDesc *desc, uint32_t struct_size);
/** Makes a sensor; *sensor gets one reference. Draws hot and cold pixels and copies the dark frame; waits for the device if there are any. */
CLSP_API ClspStatus clspSensorCreate(ClspContext context, const ClspSensorDesc *desc, ClspSensor *sensor);
/** Adds a reference. */
CLSP_API ClspStatus clspSensorRetain(ClspSensor sensor);
/** Drops a reference; with the last one the sensor is gone, once what was enqueued is done. NULL is allowed. */
CLSP_API ClspStatus clspSensorRelease(ClspSensor sensor);

/** Changes the exposure; later Enqueue calls use it. @param exposure_gain_dn finite, >= 0. */
CLSP_API ClspStatus clspSensorSetExposureGain(ClspSensor sensor, double exposure_gain_dn);

/**
 * Exposes one frame.
 * @param intensity FLOAT32 image.
 * @param frame_index counter of the temporal noise, below 2^48.
 * @param output UINT16 codes, UINT8 codes (bits = 8 only) or FLOAT32 (code / (2^bits - 1) * float_full_scale); must not overlap
 *               the intensity, except that a FLOAT32 output may be the intensity itself.
 */
CLSP_API ClspStatus clspSensorEnqueueExpose(ClspSensor sensor, cl_command_queue queue, const ClspImage *intensity,
                                            uint64_t frame_index, const ClspImage *output,
                                            uint32_t num_events_in_wait_list, const cl_event *event_wait_list,
                                            cl_event *event);

#ifdef __cplusplus
}
#endif

#endif /* CLSPECKLE_SENSOR_H */

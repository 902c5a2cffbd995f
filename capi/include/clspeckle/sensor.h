/**
 * @file sensor.h
 * @brief From intensity to codes: exposure, crosstalk, pixel gain, dark current, shot noise, full well, lag,
 *        non-linearity, offsets, ADC.
 *
 * With the effects off that came later, a sensor is (thesis sections 3.2.1 to 3.2.3)
 *
 *     signal = min(max(exposure_gain_dn * I, 0), saturation_dn)     0 at cold pixels and where I is NaN
 *     value  = signal + black_level_dn + dark_frame(x, y) + hot(x, y) + read_noise_dn * n
 *     code   = clip(round_half_to_even(value), 0, 2^bits - 1)
 *
 * The whole chain; every step that is off is left out, and costs nothing (K is conversion_gain_dn_per_e, full is
 * 2^bits - 1):
 *
 *      1. s  = max(exposure_gain_dn * I, 0)                         0 where I is NaN
 *      2. s <- (1 - crosstalk_fraction) s + crosstalk_fraction / 4 (sum of s at the four neighbours)
 *              a neighbour outside of the image is the edge pixel itself
 *      3. s <- s * mosaic_gain[(x & 1) + 2 (y & 1)] * max(1 + prnu * n1(x, y), 0) * max(1 + column_prnu * n8(x), 0)
 *              * max(1 + row_prnu * n9(y), 0) * (1 - 0.3 u / dull_pixel_fraction where u < dull_pixel_fraction)
 *              * gain_map(x, y), 0 at cold pixels
 *      4. s <- s + K * dark_current_e_per_s * exposure_time_s
 *                  * 2^((temperature_c - dark_current_reference_temperature_c) / dark_current_doubling_k)
 *      5. s <- K * Poisson(s / K)                                   shot noise of light and dark current
 *      6. s <- min(s, saturation_dn)                                full well
 *      7. s <- (1 - lag_fraction) s + lag_fraction * (s of the frame before, after this step); the first frame has
 *              none before it
 *      8. s <- s (1 - cubic_nonlinearity min(s / full, 1)^nonlinearity_power),
 *              then s <- full * (s / full)^gamma
 *      9. v  = s + black_level_dn + dark_frame(x, y) + hot(x, y) + dsnu_dn * n2(x, y) + column_offset_dn * n3(x)
 *              + read_noise_dn * r(x, y) * n(x, y, t) + row_noise_dn * n5(y, t) + column_noise_dn * n6(x, t)
 *              + row_offset_dn * n10(y)
 *              + periodic_offset_dn * sin(2 pi (periodic_frequency_x x + periodic_frequency_y y + p))
 *              + telegraph_step_dn * (b(x, y, t) - c) at telegraph pixels, b 0 or 1, c 0 (1/2 with telegraph_centered)
 *              r = exp(read_noise_spread * n7(x, y) - read_noise_spread^2): log-normal, mean square 1
 *     10. code = clip(d * round_half_to_even(v / d), 0, 2^bits - d),  d = 2^(bits - effective_bits)
 *              With code_width_wave the n with L(n) <= v / d < L(n + 1) is in the place of the rounded v / d,
 *              L(n) = m + code_width_wave / (2 sin(pi / P)) sin(2 pi (m - widest_code) / P), m = n - 1/2,
 *              P = code_width_period, so that n is 1 + code_width_wave cos(2 pi (n - widest_code) / P) wide
 *
 * n1 to n10 are standard normal, from these Philox streams (philox.h): n1 0x14, n2 0x15, n3 0x16, n4 0x10, n5 0x17, n6
 * 0x1b, n7 0x1a, n8 0x1c, n9 0x1d, n10 0x1e.
 * n4 takes a word for two pixels ("pair" in philox.h). n is n4, and with a read_noise_correlation q it is
 * (n4(x, y) + w n4(x - 1, y)) / sqrt(1 + w^2), w = (1 - sqrt(1 - 4 q^2)) / (2 q); left of column 0 is column 2^32 - 1.
 * n1, n2, n3, n7 to n10
 * are drawn once (frame index 0); n4, n5, n6 are new in each frame. n3, n6 and n8 are images one pixel high, n5, n9 and
 * n10 one pixel wide. u is the pixel's uniform of stream 0x1f, p the first word of stream 0x36 as turns of 2^-32.
 * Telegraph pixels have a uniform of stream 0x37 below telegraph_fraction; b is the highest bit of the frame's word of
 * stream 0x38. Hot pixels are drawn once from the seed: a pixel is hot where the uniform of stream 0x11 is below
 * hot_pixel_fraction, its offset is -hot_pixel_mean_dn ln(u), u from stream 0x12; cold where the uniform of stream 0x13
 * is below cold_pixel_fraction.
 *
 * The Poisson deviate N of mean m takes one normal w of stream 0x18 and one uniform u of stream 0x19 for each pixel and
 * frame, whatever the mean. Below m = 12 electrons N is the number of k = 0, 1, ... with u < P(N > k), but for rounding
 * to single precision (total variation below 2e-6; what is less probable than 2^-32 does not occur). From 12 on N is
 * the least n with P(N <= n) >= Phi(w), worked out by a series in w (Giles, ACM TOMS 42 (2016)): total variation below
 * 3e-5, mean and variance right to 4e-6, skewness to 0.1 %. Codes are the same on every device: only operations that
 * round correctly are used, also for gamma.
 *
 * Names are those of EMVA 1288 where it has one: K is the overall system gain, prnu, column_prnu and row_prnu are the
 * pixels', columns' and rows' part of PRNU1288 (release 4.0), dsnu_dn is DSNU1288 in DN.
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
    const float *dark_frame_dn;  /**< Host memory, height x width mean dark signal above the black level; copied.
                                      Finite. NULL (default): 0. */
    uint64_t dark_frame_pitch_bytes; /**< From row to row; 0 (default) means tightly packed. */
    uint32_t quantize;           /**< 1 (default): FLOAT32 output is quantized like codes. 0: it is only clipped. */
    uint32_t reserved;           /**< 0. */

    /** K, DN per electron; 0 (default): the sensor knows of no electrons. Needed by the members that count in electrons
     *  or photons. */
    double conversion_gain_dn_per_e;
    /** Photons per pixel and exposure for each unit of intensity, >= 0; 0 (default): unused. Above 0 it sets
     *  exposure_gain_dn = K * quantum_efficiency * photons_per_unit; exposure_gain_dn itself must then stay at its
     *  default or be that. */
    double photons_per_unit;
    double quantum_efficiency;   /**< Electrons per photon, above 0 to 1; default 1. Used with photons_per_unit only. */
    /** Electrons that a pixel holds, >= 0; 0 (default): unused. Above 0 it sets saturation_dn = K * full_well_e, which
     *  must be above the black level; saturation_dn itself must then stay infinite or be that. */
    double full_well_e;
    double crosstalk_fraction;   /**< Part of a pixel's signal that its four neighbours get, 0 to 1; default 0. */
    double prnu;                 /**< Relative standard deviation of the pixels' gain, 0 to 1; default 0. */
    double mosaic_gain[4];       /**< Gain of the sites (x & 1, y & 1) = (0,0), (1,0), (0,1), (1,1), >= 0; default 1, 1,
                                      1, 1. */
    double dark_current_e_per_s; /**< Electrons per pixel and second at the reference temperature, >= 0; default 0.
                                      Needs K. */
    double dark_current_reference_temperature_c; /**< Degrees Celsius; default 25. */
    double dark_current_doubling_k; /**< Temperature step that doubles the dark current, > 0 kelvin; default 8. */
    double temperature_c;        /**< Of the sensor, degrees Celsius, -273.15 to 500; default 25. */
    double exposure_time_s;      /**< For the dark current only: exposure_gain_dn is per exposure. >= 0; default
                                      0.01. */
    double lag_fraction;         /**< Part of the frame before that remains, 0 to below 1; default 0. */
    double gamma;                /**< Exponent of the non-linearity, 0.1 to 10; default 1 (linear). */
    double dsnu_dn;              /**< Standard deviation of the pixels' offsets, constant in time, >= 0; default 0. */
    double column_offset_dn;     /**< Standard deviation of the columns' offsets, constant in time, >= 0; default 0. */
    double row_noise_dn;         /**< Standard deviation of the rows' offsets, new in each frame, >= 0; default 0. */
    double column_noise_dn;      /**< Standard deviation of the columns' offsets, new in each frame, >= 0; default 0. */
    double read_noise_spread;    /**< Standard deviation of the logarithm of the pixels' read noise, 0 to 2; default 0:
                                      all alike. The mean square over the pixels stays read_noise_dn^2. */
    uint32_t shot_noise;         /**< 1: Poisson noise of the electrons; needs K. 0 (default): none. */
    uint32_t effective_bits;     /**< Bits that the converter resolves, 1 to bits; 0 (default): bits. Codes are
                                      multiples of 2^(bits - effective_bits), saturated ones the largest. */
    double column_prnu;          /**< Relative standard deviation of the columns' gain, 0 to 1; default 0. */
    double row_prnu;             /**< Relative standard deviation of the rows' gain, 0 to 1; default 0. */
    double row_offset_dn;        /**< Standard deviation of the rows' offsets, constant in time, >= 0; default 0. */
    double dull_pixel_fraction;  /**< Part of the pixels whose gain is only 0.7 to 1 times what it would be, 0 to 1;
                                      default 0. */
    double cubic_nonlinearity;   /**< Part of the signal that the response lacks at full scale, -1 to 0.25; default
                                      0. Below, it goes with the signal to the power of nonlinearity_power. */
    double periodic_offset_dn;   /**< Amplitude of a wave of offsets, constant in time, >= 0; default 0. */
    double periodic_frequency_x; /**< Of the wave, cycles per pixel, -0.5 to 0.5; default 0. */
    double periodic_frequency_y; /**< Downwards. */
    double telegraph_fraction;   /**< Part of the pixels whose offset jumps in half of the frames, 0 to 1; default 0. */
    double telegraph_step_dn;    /**< By how much, >= 0; default 0. */
    uint32_t telegraph_centered; /**< 1: they jump by half of it up or down. 0 (default): up, or not at all. */
    uint32_t reserved_telegraph; /**< 0. */
    /** Host memory, height x width relative gains of the pixels (a PRNU map): finite, >= 0, their mean 0.9 to 1.1;
     *  copied. Other gains of pixels multiply it. NULL (default): 1. */
    const float *gain_map;
    uint64_t gain_map_pitch_bytes; /**< From row to row; 0 (default) means tightly packed. */
    double code_width_wave;      /**< Differential nonlinearity of the converter: amplitude of a wave of code widths, in
                                      codes, 0 to 0.5; default 0: all are one code wide. FLOAT32 output without
                                      quantization has none. */
    double code_width_period;    /**< Of the wave, codes, 2 to 16; default 4. */
    double widest_code;          /**< A code where the wave is highest, 0 to 65536; default 0. */
    uint32_t nonlinearity_power; /**< Of cubic_nonlinearity, 1, 2 or 3; default 3. With 1 the response is quadratic. */
    uint32_t reserved_nonlinearity; /**< 0. */
    double read_noise_correlation; /**< Of the read noise of neighbours in a row, -0.5 to 0.5; default 0: none. */
} ClspSensorDesc;

/** @name Colour filters: which colours lie at the sites (0,0) (1,0) / (0,1) (1,1) */
/** @{ */
#define CLSP_BAYER_RGGB 1u /**< Red, green / green, blue. */
#define CLSP_BAYER_BGGR 2u /**< Blue, green / green, red. */
#define CLSP_BAYER_GRBG 3u /**< Green, red / blue, green. */
#define CLSP_BAYER_GBRG 4u /**< Green, blue / red, green. */
/** @} */

/** Writes the defaults into *desc. @param struct_size sizeof(ClspSensorDesc). */
CLSP_API ClspStatus clspSensorDescInit(ClspSensorDesc *desc, uint32_t struct_size);
/**
 * Writes the settings of a known camera into *desc: the defaults, changed where the camera differs. Names, in any case:
 *  - "OS04A10": OmniVision OS04A10, 2688 x 1520 pixels, the thesis's camera (section 3.1). Size, 10-bit codes and black
 *    level 64 are public (its Linux driver); read noise is the thesis's 0.015 of full scale (3.2.3), which holds
 *    everything that changed from frame to frame there, so shot noise is off. Conversion gain, full well, quantum
 *    efficiency, dark current and fixed pattern are assumptions of a usual size for such a pixel, not the maker's.
 *    docs/method/sensor.md lists them one by one. exposure_gain_dn stays at its default, 512.
 * @param struct_size sizeof(ClspSensorDesc).
 * @return CLSP_ERROR_INVALID_ARGUMENT for an unknown name; the message lists the known ones.
 */
CLSP_API ClspStatus clspSensorDescFromProfile(ClspSensorDesc *desc, uint32_t struct_size, const char *name);
/**
 * The mosaic_gain of a colour filter.
 * @param bayer one of CLSP_BAYER_*.
 * @param red,green,blue relative efficiency of each colour at the wavelength of the light, finite, >= 0.
 * @param mosaic_gain the four values for ClspSensorDesc::mosaic_gain.
 */
CLSP_API ClspStatus clspSensorMosaicFromBayer(uint32_t bayer, double red, double green, double blue,
                                              double mosaic_gain[4]);
/**
 * The dark frame of a camera from its own captures in the dark, on the host. Sums are exact.
 * @param frames frame_count frames of height x width codes.
 * @param frame_count 1 to 65535; at least 2 for the noise.
 * @param row_pitch_bytes from row to row; 0: width codes.
 * @param frame_pitch_bytes from frame to frame; 0: height rows.
 * @param black_level_dn finite; taken off the mean.
 * @param dark_frame_dn height x width floats, tightly packed, for ClspSensorDesc::dark_frame_dn: the mean over the
 *        frames less the black level. May be NULL.
 * @param temporal_noise_dn for ClspSensorDesc::read_noise_dn: root of the mean over the pixels of the unbiased variance
 *        over the frames. The rounding to codes is in it (variance 1/12). May be NULL, but not both.
 */
CLSP_API ClspStatus clspSensorDarkFrameFromCaptures(const uint16_t *frames, uint32_t frame_count, uint32_t width,
                                                    uint32_t height, uint64_t row_pitch_bytes,
                                                    uint64_t frame_pitch_bytes, double black_level_dn,
                                                    float *dark_frame_dn, double *temporal_noise_dn);
/** Makes a sensor; *sensor gets one reference. Draws the fixed pattern and copies the maps; waits for the device if
 *  there is one. */
CLSP_API ClspStatus clspSensorCreate(ClspContext context, const ClspSensorDesc *desc, ClspSensor *sensor);
/** Adds a reference. */
CLSP_API ClspStatus clspSensorRetain(ClspSensor sensor);
/** Drops a reference; with the last one the sensor is gone, once what was enqueued is done. NULL is allowed. */
CLSP_API ClspStatus clspSensorRelease(ClspSensor sensor);

/** Changes the exposure; later Enqueue calls use it, also where photons_per_unit gave the first one.
 *  @param exposure_gain_dn finite, >= 0. */
CLSP_API ClspStatus clspSensorSetExposureGain(ClspSensor sensor, double exposure_gain_dn);
/**
 * Replaces all settings by those of another description of the same width and height: draws the fixed pattern again,
 * forgets the frame before, drops the dark frame and the gain map if there is none in *desc. Frames that were enqueued
 * before keep their settings. Waits for the device. If it fails, the sensor is as it was.
 */
CLSP_API ClspStatus clspSensorConfigure(ClspSensor sensor, const ClspSensorDesc *desc);
/** Forgets the frame before: the next one has no lag. Allowed, and without effect, where lag_fraction is 0. */
CLSP_API ClspStatus clspSensorResetLag(ClspSensor sensor);

/**
 * Exposes one frame. With lag_fraction above 0 the sensor remembers its last frame: the frames of one sensor must then
 * run one after the other (one in-order queue, or wait lists).
 * @param intensity FLOAT32 image.
 * @param frame_index counter of the temporal noise, below 2^48.
 * @param output UINT16 codes, UINT8 codes (bits = 8 only) or FLOAT32 (code / (2^bits - 1) * float_full_scale); must not
 *               overlap the intensity, except that without crosstalk a FLOAT32 output may be the intensity itself.
 */
CLSP_API ClspStatus clspSensorEnqueueExpose(ClspSensor sensor, cl_command_queue queue, const ClspImage *intensity,
                                            uint64_t frame_index, const ClspImage *output,
                                            uint32_t num_events_in_wait_list, const cl_event *event_wait_list,
                                            cl_event *event);

/**
 * Three colours for each pixel of a frame, by bilinear interpolation between the sites of each colour; what a camera of
 * a colour filter does to its frames before it hands them out (thesis section 3.2.1, where it is turned off). Numbers
 * stay what they are: the black level is not taken off, and a flat grey stays flat.
 * @param raw UINT16, UINT8 or FLOAT32 frame of the sensor's size, at least 2 x 2 pixels.
 * @param bayer one of CLSP_BAYER_*.
 * @param rgb FLOAT32X3 image; must not overlap the raw frame.
 */
CLSP_API ClspStatus clspSensorEnqueueDemosaic(ClspSensor sensor, cl_command_queue queue, const ClspImage *raw,
                                              uint32_t bayer, const ClspImage *rgb, uint32_t num_events_in_wait_list,
                                              const cl_event *event_wait_list, cl_event *event);

#ifdef __cplusplus
}
#endif

#endif /* CLSPECKLE_SENSOR_H */

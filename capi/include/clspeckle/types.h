/**
 * @file types.h
 * @brief Status codes, error details, handles, images: what every other clSpeckle header builds on.
 *
 * Conventions that hold for the whole API:
 *  - Every function returns a ::ClspStatus; ::CLSP_SUCCESS is 0, every error is negative. Details of the last error of
 *    the calling thread come from clspGetLastError(). Nothing is printed, nothing aborts, no C++ exception leaves.
 *  - Description structs begin with `struct_size`. Fill them with their `...Init` function, then change what you need.
 *    A shorter struct (an older caller) keeps the defaults for what it lacks; a longer one (a newer caller) is accepted
 *    while its unknown tail is zero.
 *  - Only functions with `Enqueue` in their name are asynchronous. They take a wait list and may return an event, as in
 *    OpenCL; after warm-up (the first call) they do not block, allocate device memory or build programs.
 *  - Handles are reference counted: `...Create` gives one reference, `...Retain` adds one, `...Release` drops one.
 *    Releasing NULL is allowed and does nothing. A child retains what it needs: releasing a context before its stages
 *    is fine.
 *  - Thread rule, unless a handle says otherwise: different handles may be used from different threads at the same
 *    time; one handle may be used from one thread at a time: a second thread gets CLSP_ERROR_INVALID_STATE while the
 *    first is in a call. ClspContext may be used from any number of threads at once.
 *  - Coordinates: pixel centres are integers, x to the right, y down, origin at the top left pixel. Lengths are in
 *    metres, angles in radians; `_dn` is digital numbers (codes), `_px` is image pixels.
 */
#ifndef CLSPECKLE_TYPES_H
#define CLSPECKLE_TYPES_H

#include <stddef.h>
#include <stdint.h>

/** The OpenCL version that these headers are written for; a host may ask for a later one. */
#ifndef CL_TARGET_OPENCL_VERSION
#define CL_TARGET_OPENCL_VERSION 120
#endif
#include <CL/cl.h>

/** Marks what the library exports. */
#if defined(_WIN32)
#if defined(CLSP_BUILDING_LIBRARY)
#define CLSP_API __declspec(dllexport)
#else
#define CLSP_API __declspec(dllimport)
#endif
#else
#define CLSP_API __attribute__((visibility("default")))
#endif

#define CLSP_VERSION_MAJOR 0 /**< Release number of these headers, first part. */
#define CLSP_VERSION_MINOR 1 /**< Release number, second part. */
#define CLSP_VERSION_PATCH 0 /**< Release number, third part. */
/** ABI number (the SOVERSION); counts up only when a binary built against an older header would break. */
#define CLSP_ABI_VERSION 0

#ifdef __cplusplus
extern "C" {
#endif

/** @name Status */
/** @{ */
typedef int32_t ClspStatus; /**< CLSP_SUCCESS or one of CLSP_ERROR_*. */

#define CLSP_SUCCESS 0 /**< All went well. */
/** An argument is NULL, out of range, NaN, or contradicts another one. */
#define CLSP_ERROR_INVALID_ARGUMENT (-1)
/** struct_size is smaller than the first version of the struct, or the unknown tail of a newer struct is not zero. */
#define CLSP_ERROR_INVALID_STRUCT_SIZE (-2)
/** A handle is NULL, was released, or is of another kind. */
#define CLSP_ERROR_INVALID_HANDLE (-3)
/** A cl_mem is too small for its image, or the pitch is smaller than a row. */
#define CLSP_ERROR_BUFFER_TOO_SMALL (-4)
/** A cl_mem, queue, event or handle belongs to another cl_context. */
#define CLSP_ERROR_WRONG_CONTEXT (-5)
/** The image format is not one that this function takes. */
#define CLSP_ERROR_INVALID_FORMAT (-6)
/** Two images that must not overlap do. */
#define CLSP_ERROR_OVERLAP (-7)
/** Pixels held NaN, infinite or negative values; see the message for how many and where the first one was. */
#define CLSP_ERROR_INVALID_DATA (-8)
/** No OpenCL platform or no device that fits; the message lists what was seen and how to install one. */
#define CLSP_ERROR_NO_DEVICE (-9)
/** An OpenCL call failed; see ClspErrorInfo::opencl_code. */
#define CLSP_ERROR_OPENCL (-10)
/** A program did not build; see ClspErrorInfo::build_log. */
#define CLSP_ERROR_BUILD (-11)
/** The device or the host has not enough memory. */
#define CLSP_ERROR_OUT_OF_MEMORY (-12)
/** The device or the FFT library cannot do what was asked. */
#define CLSP_ERROR_UNSUPPORTED (-13)
/** A file could not be read or written. */
#define CLSP_ERROR_IO (-14)
/** The object is not in a state for this call (for example: no frame has been enqueued yet). */
#define CLSP_ERROR_INVALID_STATE (-15)
/** A fault of the library itself. Please report it with the message. */
#define CLSP_ERROR_INTERNAL (-16)
/** The caller asked to stop (a progress function returned 0). */
#define CLSP_ERROR_CANCELLED (-17)

/** What went wrong in the last failing call of the calling thread. The strings stay valid until the next failing call
 *  on the same thread; they are never NULL. */
typedef struct ClspErrorInfo {
    uint32_t struct_size;    /**< sizeof(ClspErrorInfo), set by the caller before the call. */
    int32_t status;          /**< The status that the failing call returned; CLSP_SUCCESS if none has failed yet. */
    int32_t opencl_code;     /**< The OpenCL (or clFFT) error code behind it, 0 if none. */
    uint32_t reserved;       /**< 0. */
    const char *function;    /**< Name of the public function that failed. */
    const char *message;     /**< What was wrong, what was expected, what to do. */
    const char *build_log;   /**< The compiler's output after CLSP_ERROR_BUILD, else "". */
} ClspErrorInfo;

/** Copies the details of the last failing call of this thread into *info. */
CLSP_API ClspStatus clspGetLastError(ClspErrorInfo *info);

/** The name of a status, for example "CLSP_ERROR_NO_DEVICE". Never NULL; "unknown status" for other numbers. */
CLSP_API const char *clspStatusString(ClspStatus status);

/** The release number of the library that is loaded (compare with CLSP_VERSION_*). Any pointer may be NULL. */
CLSP_API ClspStatus clspGetVersion(uint32_t *major, uint32_t *minor, uint32_t *patch, uint32_t *abi);
/** @} */

/** @name Handles */
/** @{ */
typedef struct ClspContext_ *ClspContext;   /**< A device and its programs (runtime.h). */
typedef struct ClspPattern_ *ClspPattern;   /**< A projected pattern (pattern.h). */
typedef struct ClspDoePattern_ *ClspDoePattern; /**< The pattern of a diffractive element, or ideal dots (doe.h). */
typedef struct ClspDots_ *ClspDots;         /**< Ideal projected dots (dots.h). */
typedef struct ClspMaterialTable_ *ClspMaterialTable; /**< What surfaces are made of (material.h). */
typedef struct ClspMotion_ *ClspMotion;     /**< How surfaces moved since the last frame (motion.h). */
typedef struct ClspPhase_ *ClspPhase;       /**< A surface's random field (phase.h). */
typedef struct ClspAperture_ *ClspAperture; /**< A lens's aperture (aperture.h). */
typedef struct ClspLens_ *ClspLens;         /**< What a lens does beside diffraction (lens.h). */
typedef struct ClspSensor_ *ClspSensor;     /**< A sensor (sensor.h). */
typedef struct ClspPipeline_ *ClspPipeline; /**< A whole frame (pipeline.h). */
typedef struct ClspCapture_ *ClspCapture;   /**< What a real camera recorded (capture.h). */
typedef struct ClspDiagnosis_ *ClspDiagnosis; /**< What a diagnosis found (diagnosis.h). */
typedef struct ClspProfile_ *ClspProfile;     /**< A camera as a diagnosis found it (profile.h). */
typedef struct ClspDoeDesign_ *ClspDoeDesign; /**< A designed diffractive element (doe_design.h). */
typedef struct ClspDepth_ *ClspDepth;       /**< Depth from frames of dots (depth.h). */
typedef struct ClspTuning_ *ClspTuning;     /**< What a measurement of the engines found (tuning.h). */
/** @} */

/**
 * Told how far a long call is; called often, on the thread of the call. The call then fails with CLSP_ERROR_CANCELLED
 * and has no effect.
 * @param what what is being done, in words; good until the return.
 * @param fraction 0 to 1, never less than before.
 * @return 0 to cancel, anything else to go on.
 */
typedef int32_t (*ClspProgressFunction)(void *user_data, const char *what, double fraction);

/** @name Levels of the log */
/** @{ */
#define CLSP_LOG_WARNING 1u /**< Something is not as it should be, but the library goes on without it. */
#define CLSP_LOG_INFO 2u    /**< Choices that the library made, and why. */
/** @} */

/**
 * Told what the library has to say beside errors; on the thread of the call that it belongs to, so on several threads
 * at once where these share a context. It must not call the library.
 * @param level CLSP_LOG_*; later releases may have more.
 * @param message one line of UTF-8; good until the return.
 */
typedef void (*ClspLogFunction)(void *user_data, uint32_t level, const char *message);

/** @name Images in device memory */
/** @{ */
#define CLSP_FORMAT_NONE 0u       /**< Not an image. */
#define CLSP_FORMAT_UINT8 1u      /**< One unsigned byte per pixel. */
#define CLSP_FORMAT_UINT16 2u     /**< One unsigned 16-bit integer per pixel. */
#define CLSP_FORMAT_UINT32 3u     /**< One unsigned 32-bit integer per pixel. */
#define CLSP_FORMAT_FLOAT32 4u    /**< One float per pixel. */
#define CLSP_FORMAT_FLOAT32X2 5u  /**< Two floats per pixel, for example a complex field (re, im). */
#define CLSP_FORMAT_FLOAT32X3 6u  /**< Three packed floats per pixel (12 bytes). */
#define CLSP_FORMAT_FLOAT32X4 7u  /**< Four floats per pixel; of a position or a normal the fourth is ignored. */

/** A view of an image in a cl_mem buffer (not a cl_image). The library never owns the memory; it retains the cl_mem
 *  only for as long as OpenCL needs it. The layout of this struct is frozen: it never grows. */
typedef struct ClspImage {
    cl_mem mem;              /**< The buffer; NULL means "no image" where an image is optional. */
    uint64_t offset_bytes;   /**< Where the first pixel lies; a multiple of the size of one component. */
    uint64_t pitch_bytes;    /**< From one row to the next; 0 means tightly packed. A multiple of the component size. */
    uint32_t width;          /**< Pixels in a row. */
    uint32_t height;         /**< Rows. */
    uint32_t format;         /**< CLSP_FORMAT_*. */
    uint32_t reserved;       /**< 0. */
} ClspImage;
/** @} */

#ifdef __cplusplus
}
#endif

#endif /* CLSPECKLE_TYPES_H */

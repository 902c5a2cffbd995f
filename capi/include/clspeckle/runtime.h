/**
 * @file runtime.h
 * @brief Devices, contexts, queues, buffers, events.
 */
#ifndef CLSPECKLE_RUNTIME_H
#define CLSPECKLE_RUNTIME_H

#include "types.h"

#ifdef __cplusplus
extern "C" {
#endif

/** @name Devices */
/** @{ */

/** One OpenCL device, and whether clSpeckle can use it. */
typedef struct ClspDeviceInfo {
    uint32_t struct_size;             /**< sizeof(ClspDeviceInfo), set by the caller in the first element. */
    uint32_t usable;                  /**< 1: clSpeckle runs on it. 0: see `reason`. */
    uint64_t type;                    /**< CL_DEVICE_TYPE. */
    uint64_t global_memory_bytes;     /**< CL_DEVICE_GLOBAL_MEM_SIZE. */
    uint64_t max_allocation_bytes;    /**< CL_DEVICE_MAX_MEM_ALLOC_SIZE. */
    uint64_t local_memory_bytes;      /**< CL_DEVICE_LOCAL_MEM_SIZE. */
    uint64_t max_work_group_size;     /**< CL_DEVICE_MAX_WORK_GROUP_SIZE. */
    uint32_t compute_units;           /**< CL_DEVICE_MAX_COMPUTE_UNITS. */
    uint32_t rank;                    /**< 0 is the device that is taken when none is named, 1 the next, ... */
    cl_platform_id platform_id;       /**< For hosts that make their own cl_context. */
    cl_device_id device_id;           /**< For hosts that make their own cl_context. */
    char selector[16];                /**< "platform:device", for example "0:0"; see clspContextDesc::device. */
    char name[128];                   /**< CL_DEVICE_NAME. */
    char vendor[128];                 /**< CL_DEVICE_VENDOR. */
    char version[128];                /**< CL_DEVICE_VERSION. */
    char driver_version[128];         /**< CL_DRIVER_VERSION. */
    char platform_name[128];          /**< CL_PLATFORM_NAME. */
    char reason[256];                 /**< Why it is not usable; "" if it is. */
} ClspDeviceInfo;

/**
 * Lists every device of every platform, best first.
 * @param capacity number of elements in `devices`; 0 to ask only for the number.
 * @param devices  array of `capacity` elements, the first with its struct_size set; NULL if capacity is 0.
 * @param count    number of devices that exist (may exceed capacity). Not an error if 0.
 */
CLSP_API ClspStatus clspDeviceList(uint32_t capacity, ClspDeviceInfo *devices, uint32_t *count);

/**
 * Explains in a few lines of text which platforms and devices were seen, which one would be taken and why, why others
 * were refused, and how to install one.
 * @param selector as ClspContextDesc::device; NULL for the default choice.
 * @param capacity size of `text` in bytes; the text is cut to fit and always ends with 0.
 * @param length   size of the whole text with its final 0; may be NULL.
 */
CLSP_API ClspStatus clspDeviceExplain(const char *selector, uint64_t capacity, char *text, uint64_t *length);
/** @} */

/** @name Context */
/** @{ */

#define CLSP_DISK_CACHE_AUTO 0u /**< As CLSPECKLE_DISK_CACHE says (auto, off, on); else on, except on PoCL, which has a
                                     cache of its own. */
#define CLSP_DISK_CACHE_OFF 1u  /**< Programs are compiled in every process. */
#define CLSP_DISK_CACHE_ON 2u   /**< On every platform. */

/** How a context is made. */
typedef struct ClspContextDesc {
    uint32_t struct_size; /**< Size of the struct as the caller knows it. */
    uint32_t disk_cache;          /**< CLSP_DISK_CACHE_*; default AUTO. */
    /** The host's context, retained; NULL (default): clSpeckle makes its own. clFFT keeps what it has compiled for a
     *  cl_context (some megabytes) until the process ends: use one cl_context, not a new one for every clSpeckle
     *  context. */
    cl_context cl_context_handle;
    cl_device_id cl_device;       /**< The host's device; required with cl_context_handle, else NULL. */
    /** Which device a context of our own uses: "platform:device" as in ClspDeviceInfo::selector, "gpu", "cpu",
     *  "accelerator", or a part of the device's or platform's name in any case. NULL (default): the environment
     *  variable CLSPECKLE_DEVICE if set, else the best device. */
    const char *device;
    /** Folder with files that replace the built-in kernels of the same path ("stages/phase.cl", "common/philox.h"), for
     *  editing a kernel without a rebuild.
     *  NULL (default): the environment variable CLSPECKLE_KERNEL_DIR if set, else the built-in ones. */
    const char *kernel_dir;
    /** Folder of the program cache and the tuning record (tuning.h). NULL (default): CLSPECKLE_CACHE_DIR, else
     *  $XDG_CACHE_HOME/clspeckle, else ~/.cache/clspeckle. Made when first written; a folder that cannot be written
     *  turns the cache off silently. */
    const char *cache_dir;
    /** Told of warnings and choices while anything that belongs to the context lives. NULL (default): the environment
     *  variable CLSPECKLE_LOG says what is printed on standard error: "warning", "info" (choices, too) or "off"
     *  (default). */
    ClspLogFunction log;
    void *log_data; /**< Handed to `log`; default NULL. */
} ClspContextDesc;

/** Writes the defaults into *desc. @param struct_size sizeof(ClspContextDesc). */
CLSP_API ClspStatus clspContextDescInit(ClspContextDesc *desc, uint32_t struct_size);

/**
 * Makes a context: one device, its compiled programs and its FFT plans. May be used from any number of threads at once.
 * Contexts that clSpeckle makes on the same device share one cl_context, which lives as long as the process (clFFT
 * keeps hold of every cl_context that it has compiled for); their queues and buffers may therefore be mixed. OpenCL
 * does not survive fork(): in a child whose parent had used it every call on a device object is refused with
 * CLSP_ERROR_INVALID_STATE, and releasing what it inherited does nothing.
 * @param desc NULL for all defaults.
 */
CLSP_API ClspStatus clspContextCreate(const ClspContextDesc *desc, ClspContext *context);
/** Adds a reference. */
CLSP_API ClspStatus clspContextRetain(ClspContext context);
/** Drops a reference; stages made from the context keep what they need of it. NULL is allowed. */
CLSP_API ClspStatus clspContextRelease(ClspContext context);

/** What a context is and holds. */
typedef struct ClspContextInfo {
    uint32_t struct_size; /**< Size of the struct as the caller knows it. */
    uint32_t programs_built;         /**< Programs compiled from source since creation. */
    uint32_t programs_from_cache;    /**< Programs loaded from the disk cache since creation. */
    uint32_t allocation_count;       /**< Device buffers that the library holds now (host buffers not counted). */
    uint64_t allocated_bytes;        /**< Their size in bytes. */
    cl_context cl_context_handle;    /**< Not retained for the caller. */
    cl_device_id cl_device;          /**< Not retained for the caller. */
    char device_name[128];           /**< CL_DEVICE_NAME. */
    char platform_name[128];         /**< CL_PLATFORM_NAME. */
} ClspContextInfo;

/** Fills in *info; its struct_size must be set. */
CLSP_API ClspStatus clspContextGetInfo(ClspContext context, ClspContextInfo *info);
/** @} */

/** @name Queues, buffers and events for hosts without OpenCL code of their own
 *  They are plain OpenCL objects and may be mixed with the host's own. */
/** @{ */
#define CLSP_QUEUE_PROFILING 1u    /**< Needed for clspPipelineGetTimings(). */
#define CLSP_QUEUE_OUT_OF_ORDER 2u /**< Commands wait only for their wait lists. */

/** Makes a command queue. @param flags CLSP_QUEUE_* or 0. */
CLSP_API ClspStatus clspQueueCreate(ClspContext context, uint32_t flags, cl_command_queue *queue);
/** Waits until everything in the queue is done. */
CLSP_API ClspStatus clspQueueFinish(cl_command_queue queue);
/** Drops a reference. Releasing NULL is allowed. The last one of an out-of-order queue waits until everything in it is
 *  done. */
CLSP_API ClspStatus clspQueueRelease(cl_command_queue queue);

/** Allocates `size_bytes` > 0 of uninitialised device memory. */
CLSP_API ClspStatus clspBufferCreate(ClspContext context, uint64_t size_bytes, cl_mem *mem);
/** Drops a reference. Releasing NULL is allowed. */
CLSP_API ClspStatus clspBufferRelease(cl_mem mem);

/** Copies host memory to a buffer. `data` must stay valid and unchanged until the event is complete. */
CLSP_API ClspStatus clspBufferEnqueueWrite(cl_command_queue queue, const void *data, uint64_t size_bytes, cl_mem mem,
                                           uint64_t offset_bytes, uint32_t num_events_in_wait_list,
                                           const cl_event *event_wait_list, cl_event *event);
/** Copies a buffer to host memory. `data` must stay valid until the event is complete. */
CLSP_API ClspStatus clspBufferEnqueueRead(cl_command_queue queue, cl_mem mem, uint64_t offset_bytes,
                                          uint64_t size_bytes, void *data, uint32_t num_events_in_wait_list,
                                          const cl_event *event_wait_list, cl_event *event);
/** Blocking clspBufferEnqueueWrite(). */
CLSP_API ClspStatus clspBufferWrite(cl_command_queue queue, const void *data, uint64_t size_bytes, cl_mem mem,
                                    uint64_t offset_bytes);
/** Blocking clspBufferEnqueueRead(). */
CLSP_API ClspStatus clspBufferRead(cl_command_queue queue, cl_mem mem, uint64_t offset_bytes, uint64_t size_bytes,
                                   void *data);

/** Waits for events; fails if one of them ended with an error. */
CLSP_API ClspStatus clspEventWait(uint32_t num_events, const cl_event *events);
/** Drops a reference. Releasing NULL is allowed. */
CLSP_API ClspStatus clspEventRelease(cl_event event);
/** @} */

#ifdef __cplusplus
}
#endif

#endif /* CLSPECKLE_RUNTIME_H */

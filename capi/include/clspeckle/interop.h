/**
 * @file interop.h
 * @brief What engines hold in other ways than in buffers: cl_images, textures of GL, memory of other APIs.
 *
 * Frames read and write buffers (::ClspImage). A cl_image (a 2D image object of OpenCL, also one made of a GL texture)
 * is copied into such a buffer and from it on the device; memory that another API exports is used as a buffer, without
 * a copy:
 *
 *     acquire -> import depth, normals, .. -> frame -> export codes -> release
 *
 * Each is an enqueued command with a wait list and an event. None waits for the device, and from the second call with
 * the same formats on none builds a program or allocates device memory. A copy reads the channels of each pixel once
 * and writes them once. All functions may be called from any number of threads at once.
 *
 * | cl_image's data type                         | image's format                                   | values        |
 * |----------------------------------------------|--------------------------------------------------|---------------|
 * | CL_FLOAT, CL_HALF_FLOAT                      | FLOAT32, FLOAT32X2, X3, X4                       | the same      |
 * | CL_UNORM_INT8, _INT16, CL_SNORM_INT8, _INT16 | FLOAT32, FLOAT32X2, X3, X4; import only          | 0 or -1 to 1  |
 * | CL_UNSIGNED_INT8, _INT16, _INT32             | UINT8, UINT16, UINT32; the target is no narrower | the same      |
 * | CL_UNORM_INT8, _INT16                        | UINT8, UINT16                                    | the same bits |
 */
#ifndef CLSPECKLE_INTEROP_H
#define CLSPECKLE_INTEROP_H

#include "types.h"

#ifdef __cplusplus
extern "C" {
#endif

/** @name What a context has */
/** @{ */
#define CLSP_EXTERNAL_MEMORY_OPAQUE_FD 1u /**< A file descriptor from Vulkan or another API for the same device. */
#define CLSP_EXTERNAL_MEMORY_DMA_BUF 2u   /**< A file descriptor of a Linux dma-buf. */

/** What a context can share with other APIs. */
typedef struct ClspInteropInfo {
    uint32_t struct_size;             /**< Size of the struct as the caller knows it. */
    uint32_t cl_images;               /**< 1: the device has images (CL_DEVICE_IMAGE_SUPPORT). */
    uint32_t gl_textures;             /**< 1: the device has cl_khr_gl_sharing, and the cl_context was made with a GL
                                           context. */
    uint32_t external_memory;         /**< Sum of the CLSP_EXTERNAL_MEMORY_* that the device imports
                                           (cl_khr_external_memory). */
    char cl_images_reason[256];       /**< Why there are none; "" if there are. */
    char gl_textures_reason[256];     /**< Why there are none; "" if there are. */
    char external_memory_reason[256]; /**< Why there is none; "" if there is. */
} ClspInteropInfo;

/** Fills in *info; its struct_size must be set. */
CLSP_API ClspStatus clspContextGetInteropInfo(ClspContext context, ClspInteropInfo *info);
/** @} */

/** @name cl_images */
/** @{ */

/**
 * Copies channels of a cl_image into an image in a buffer, pixel by pixel; formats as in the table above.
 * @param cl_image a CL_MEM_OBJECT_IMAGE2D of order CL_R, CL_RG, CL_RGBA or CL_BGRA that kernels may read. Depth of a
 *        z-buffer (CL_DEPTH) is not metres: render the distance into a texture of its own.
 * @param first_channel 0 (red) to 3 (alpha): that of the image's first component; the others follow it.
 * @param image as large as the cl_image. Its bytes must not be in the buffer that the cl_image was made from.
 * @return CLSP_ERROR_UNSUPPORTED if the device has no images, CLSP_ERROR_INVALID_FORMAT for what is not in the table.
 */
CLSP_API ClspStatus clspClImageEnqueueImport(ClspContext context, cl_command_queue queue, cl_mem cl_image,
                                             uint32_t first_channel, const ClspImage *image,
                                             uint32_t num_events_in_wait_list, const cl_event *event_wait_list,
                                             cl_event *event);
/**
 * Copies an image in a buffer into a cl_image, from red on. Other channels become 0, alpha 1 (of CL_UNORM_* the largest
 * code, which reads as 1.0). Takes, returns and costs what clspClImageEnqueueImport() does; kernels must be allowed to
 * write the cl_image. Light in CL_HALF_FLOAT is rounded.
 */
CLSP_API ClspStatus clspClImageEnqueueExport(ClspContext context, cl_command_queue queue, const ClspImage *image,
                                             cl_mem cl_image, uint32_t num_events_in_wait_list,
                                             const cl_event *event_wait_list, cl_event *event);
/** @} */

/** @name GL textures and memory of other APIs
 *  The functions of the driver's extensions are looked up when they are first needed. Without them a call fails with
 *  CLSP_ERROR_UNSUPPORTED and the words of ClspInteropInfo. */
/** @{ */

/**
 * Makes a cl_image of a GL texture (clCreateFromGLTexture). Release it with clspBufferRelease() before the texture is
 * deleted.
 * @param flags CL_MEM_READ_ONLY for what is imported, CL_MEM_WRITE_ONLY for what is exported, or CL_MEM_READ_WRITE.
 * @param target GL_TEXTURE_2D (0x0DE1) or GL_TEXTURE_RECTANGLE (0x84F5).
 * @param level of the mipmap; 0 is the whole texture.
 * @param texture its name in the GL context that the cl_context was made with; complete.
 */
CLSP_API ClspStatus clspClImageCreateFromGl(ClspContext context, uint64_t flags, uint32_t target, int32_t level,
                                            uint32_t texture, cl_mem *cl_image);
/**
 * Makes a buffer of memory that another API exported as a file descriptor (clCreateBufferWithProperties), for use in
 * ::ClspImage without a copy. Release it with clspBufferRelease().
 * @param type one CLSP_EXTERNAL_MEMORY_*.
 * @param fd the driver's after success; the caller's, still open, after a failure.
 * @param size_bytes of the memory, as the other API allocated it.
 */
CLSP_API ClspStatus clspBufferCreateFromFd(ClspContext context, uint32_t type, int32_t fd, uint64_t size_bytes,
                                           cl_mem *mem);

#define CLSP_SHARED_GL 0u       /**< Objects made of GL's. */
#define CLSP_SHARED_EXTERNAL 1u /**< Buffers made of file descriptors. */

/**
 * Takes shared objects over from the other API: to be enqueued before what uses them. What the other API writes into
 * them must be complete: for GL that is glFinish(), or an event in the wait list where the device has cl_khr_gl_event.
 * @param kind CLSP_SHARED_*, that of all `mems`.
 * @param count of `mems`, at least 1.
 */
CLSP_API ClspStatus clspSharedEnqueueAcquire(ClspContext context, cl_command_queue queue, uint32_t kind, uint32_t count,
                                             const cl_mem *mems, uint32_t num_events_in_wait_list,
                                             const cl_event *event_wait_list, cl_event *event);
/** Gives shared objects back, after what used them. The other API may use them when the event is complete. */
CLSP_API ClspStatus clspSharedEnqueueRelease(ClspContext context, cl_command_queue queue, uint32_t kind, uint32_t count,
                                             const cl_mem *mems, uint32_t num_events_in_wait_list,
                                             const cl_event *event_wait_list, cl_event *event);
/** @} */

#ifdef __cplusplus
}
#endif

#endif /* CLSPECKLE_INTEROP_H */

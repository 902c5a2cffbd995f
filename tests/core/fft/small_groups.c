// Preloaded, it says of every device what GPUs have (work-groups of 1024 work-items, 48 KB of local memory), and of
// every kernel that it takes CLSP_KERNEL_WORK_GROUP_SIZE work-items and no local memory of its own: NVIDIA's driver
// gives kernels fewer than its devices have.
#define CL_TARGET_OPENCL_VERSION 120
#include <CL/cl.h>

#include <dlfcn.h>
#include <stdlib.h>

// Python loads the library with names of its own, which RTLD_NEXT does not see.
static void *real(const char *name) {
    return dlsym(dlopen("libOpenCL.so.1", RTLD_LAZY), name);
}

cl_int clGetKernelWorkGroupInfo(cl_kernel kernel, cl_device_id device, cl_kernel_work_group_info name, size_t size,
                                void *value, size_t *size_needed) {
    cl_int (*get)(cl_kernel, cl_device_id, cl_kernel_work_group_info, size_t, void *, size_t *);
    *(void **)&get = real("clGetKernelWorkGroupInfo");
    const cl_int status = get(kernel, device, name, size, value, size_needed);
    const char *items = getenv("CLSP_KERNEL_WORK_GROUP_SIZE");
    if (value && items && name == CL_KERNEL_WORK_GROUP_SIZE)
        *(size_t *)value = strtoul(items, NULL, 10);
    if (value && name == CL_KERNEL_LOCAL_MEM_SIZE)
        *(cl_ulong *)value = 0;
    return status;
}

cl_int clGetDeviceInfo(cl_device_id device, cl_device_info name, size_t size, void *value, size_t *size_needed) {
    cl_int (*get)(cl_device_id, cl_device_info, size_t, void *, size_t *);
    *(void **)&get = real("clGetDeviceInfo");
    const cl_int status = get(device, name, size, value, size_needed);
    if (value && name == CL_DEVICE_MAX_WORK_GROUP_SIZE)
        *(size_t *)value = 1024;
    if (value && name == CL_DEVICE_LOCAL_MEM_SIZE)
        *(cl_ulong *)value = 48 << 10;
    return status;
}

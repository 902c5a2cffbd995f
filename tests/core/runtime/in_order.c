// Preloaded, it has no queues out of order, as Mesa's driver for CPUs.
#define CL_TARGET_OPENCL_VERSION 120
#include <CL/cl.h>

#include <dlfcn.h>

cl_command_queue clCreateCommandQueue(cl_context context, cl_device_id device, cl_command_queue_properties properties,
                                      cl_int *error) {
    cl_command_queue (*create)(cl_context, cl_device_id, cl_command_queue_properties, cl_int *);
    // Python loads the library with names of its own, which RTLD_NEXT does not see.
    *(void **)&create = dlsym(dlopen("libOpenCL.so.1", RTLD_LAZY), "clCreateCommandQueue");
    if (properties & CL_QUEUE_OUT_OF_ORDER_EXEC_MODE_ENABLE) {
        if (error)
            *error = CL_INVALID_QUEUE_PROPERTIES;
        return NULL;
    }
    return create(context, device, properties, error);
}

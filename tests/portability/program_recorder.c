// Preloaded, it writes every OpenCL program that a process builds into the folder CLSP_RECORDED_PROGRAMS: NNNN.cl, and
// its options in NNNN.options. tests/portability compiles them for devices that are not at hand.
// CLSP_RECORDED_VECTOR_WIDTH, if set, is the width of floats that every device says its vectors have: programs are made
// as for that.
#define _GNU_SOURCE
#define CL_TARGET_OPENCL_VERSION 120
#include <CL/cl.h>

#include <dlfcn.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { max_programs = 4096 };

static pthread_mutex_t guard = PTHREAD_MUTEX_INITIALIZER;
static cl_program
    programs[max_programs]; // by number; a handle that was released and given out again: the later one counts
static int program_count;

static FILE *open_record(int number, const char *extension) {
    char path[4096];
    const char *folder = getenv("CLSP_RECORDED_PROGRAMS");
    snprintf(path, sizeof path, "%s/%04d.%s", folder ? folder : ".", number, extension);
    FILE *file = fopen(path, "wb");
    if (!file) {
        perror(path);
        abort();
    }
    return file;
}

cl_program clCreateProgramWithSource(cl_context context, cl_uint count, const char **strings, const size_t *lengths,
                                     cl_int *status) {
    static cl_program (*create)(cl_context, cl_uint, const char **, const size_t *, cl_int *);
    pthread_mutex_lock(&guard);
    if (!create)
        *(void **)&create = dlsym(RTLD_NEXT, "clCreateProgramWithSource");
    const cl_program program = create(context, count, strings, lengths, status);
    if (program_count == max_programs)
        abort();
    FILE *file = open_record(program_count, "cl");
    for (cl_uint i = 0; i < count; ++i)
        fwrite(strings[i], 1, lengths && lengths[i] ? lengths[i] : strlen(strings[i]), file);
    fclose(file);
    programs[program_count++] = program;
    pthread_mutex_unlock(&guard);
    return program;
}

cl_int clBuildProgram(cl_program program, cl_uint count, const cl_device_id *devices, const char *options,
                      void(CL_CALLBACK *notify)(cl_program, void *), void *user_data) {
    static cl_int (*build)(cl_program, cl_uint, const cl_device_id *, const char *,
                           void(CL_CALLBACK *)(cl_program, void *), void *);
    pthread_mutex_lock(&guard);
    if (!build)
        *(void **)&build = dlsym(RTLD_NEXT, "clBuildProgram");
    for (int number = program_count - 1; number >= 0; --number) {
        if (programs[number] == program) {
            FILE *file = open_record(number, "options");
            fputs(options ? options : "", file);
            fclose(file);
            break;
        }
    }
    pthread_mutex_unlock(&guard);
    return build(program, count, devices, options, notify, user_data);
}

cl_int clGetDeviceInfo(cl_device_id device, cl_device_info what, size_t size, void *value, size_t *size_ret) {
    static cl_int (*get)(cl_device_id, cl_device_info, size_t, void *, size_t *);
    pthread_mutex_lock(&guard);
    if (!get)
        *(void **)&get = dlsym(RTLD_NEXT, "clGetDeviceInfo");
    pthread_mutex_unlock(&guard);
    const cl_int status = get(device, what, size, value, size_ret);
    const char *width = getenv("CLSP_RECORDED_VECTOR_WIDTH");
    if (status == CL_SUCCESS && value && what == CL_DEVICE_NATIVE_VECTOR_WIDTH_FLOAT && width)
        *(cl_uint *)value = (cl_uint)atoi(width);
    return status;
}

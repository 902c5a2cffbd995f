/* Preloaded beside a program that draws with GL, this gives the OpenCL driver cl_khr_gl_sharing: a cl_image of a
 * texture gets the texture's texels when it is acquired, and the texture gets them back when it is released. On the
 * thread on which the GL context is current. */
#define _GNU_SOURCE
#define CL_TARGET_OPENCL_VERSION 120
#include <CL/cl.h>
#include <CL/cl_gl.h>
#include <GL/gl.h>
#include <GL/glext.h>
#include <dlfcn.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static cl_context_properties given[16]; /* by the last clCreateContext() with a GL context */
static size_t given_bytes;

static struct Texture {
    cl_mem image;
    GLuint name;
    cl_mem_flags flags;
    GLenum format, type;
    size_t region[3], bytes;
} textures[8];
static int texture_count;

cl_context clCreateContext(const cl_context_properties *properties, cl_uint count, const cl_device_id *devices,
                           void(CL_CALLBACK *notify)(const char *, const void *, size_t, void *), void *data,
                           cl_int *code) {
    cl_context (*real)(const cl_context_properties *, cl_uint, const cl_device_id *,
                       void(CL_CALLBACK *)(const char *, const void *, size_t, void *), void *, cl_int *);
    cl_context_properties kept[16] = {0};
    size_t i, n = 0;
    int has_gl = 0;
    *(void **)&real = dlsym(RTLD_NEXT, "clCreateContext");
    for (i = 0; properties && properties[i] != 0 && i + 2 < 16; i += 2) {
        if (properties[i] == CL_GL_CONTEXT_KHR || properties[i] == CL_EGL_DISPLAY_KHR) {
            has_gl = 1;
            continue;
        }
        kept[n++] = properties[i];
        kept[n++] = properties[i + 1];
    }
    if (has_gl) {
        given_bytes = (i + 1) * sizeof *properties;
        memcpy(given, properties, given_bytes);
    }
    return real(properties ? kept : NULL, count, devices, notify, data, code);
}

cl_int clGetContextInfo(cl_context context, cl_context_info what, size_t size, void *value, size_t *size_ret) {
    cl_int (*real)(cl_context, cl_context_info, size_t, void *, size_t *);
    *(void **)&real = dlsym(RTLD_NEXT, "clGetContextInfo");
    if (what != CL_CONTEXT_PROPERTIES || given_bytes == 0)
        return real(context, what, size, value, size_ret);
    if (size_ret)
        *size_ret = given_bytes;
    if (value)
        memcpy(value, given, size < given_bytes ? size : given_bytes);
    return CL_SUCCESS;
}

cl_int clGetDeviceInfo(cl_device_id device, cl_device_info what, size_t size, void *value, size_t *size_ret) {
    cl_int (*real)(cl_device_id, cl_device_info, size_t, void *, size_t *);
    static const char added[] = " cl_khr_gl_sharing";
    char text[8192];
    cl_int code;
    *(void **)&real = dlsym(RTLD_NEXT, "clGetDeviceInfo");
    if (what != CL_DEVICE_EXTENSIONS)
        return real(device, what, size, value, size_ret);
    code = real(device, what, sizeof text - sizeof added, text, NULL);
    if (code != CL_SUCCESS)
        return code;
    strcat(text, added);
    if (size_ret)
        *size_ret = strlen(text) + 1;
    if (value && size < strlen(text) + 1)
        return CL_INVALID_VALUE;
    if (value)
        strcpy(value, text);
    return CL_SUCCESS;
}

static cl_mem create(cl_context context, cl_mem_flags flags, cl_uint target, cl_int level, cl_uint name, cl_int *code) {
    struct Texture *texture = &textures[texture_count];
    cl_image_format format = {CL_R, CL_FLOAT};
    cl_image_desc desc;
    GLint width = 0, height = 0, internal = 0;
    glBindTexture(target, name);
    glGetTexLevelParameteriv(target, level, GL_TEXTURE_WIDTH, &width);
    glGetTexLevelParameteriv(target, level, GL_TEXTURE_HEIGHT, &height);
    glGetTexLevelParameteriv(target, level, GL_TEXTURE_INTERNAL_FORMAT, &internal);
    *code = CL_INVALID_GL_OBJECT;
    if (texture_count == 8 || glGetError() != GL_NO_ERROR || width == 0 ||
        (internal != GL_R32F && internal != GL_R16UI))
        return NULL;
    if (internal == GL_R16UI)
        format.image_channel_data_type = CL_UNSIGNED_INT16;
    memset(&desc, 0, sizeof desc);
    desc.image_type = CL_MEM_OBJECT_IMAGE2D;
    desc.image_width = (size_t)width;
    desc.image_height = (size_t)height;
    texture->image = clCreateImage(context, flags, &format, &desc, NULL, code);
    texture->name = name;
    texture->flags = flags;
    texture->format = internal == GL_R16UI ? GL_RED_INTEGER : GL_RED;
    texture->type = internal == GL_R16UI ? GL_UNSIGNED_SHORT : GL_FLOAT;
    texture->region[0] = (size_t)width;
    texture->region[1] = (size_t)height;
    texture->region[2] = 1;
    texture->bytes = (size_t)width * (size_t)height * (internal == GL_R16UI ? 2 : 4);
    ++texture_count;
    return texture->image;
}

static cl_int hand_over(int acquire, cl_command_queue queue, cl_uint count, const cl_mem *mems, cl_uint num_waits,
                        const cl_event *waits, cl_event *event) {
    static const size_t origin[3] = {0, 0, 0};
    cl_uint i;
    for (i = 0; i < count; ++i) {
        struct Texture *texture = NULL;
        void *texels;
        cl_int code;
        int k;
        for (k = 0; k < texture_count; ++k)
            if (textures[k].image == mems[i])
                texture = &textures[k];
        if (!texture)
            return CL_INVALID_GL_OBJECT;
        texels = malloc(texture->bytes);
        glBindTexture(GL_TEXTURE_2D, texture->name);
        if (acquire) {
            glGetTexImage(GL_TEXTURE_2D, 0, texture->format, texture->type, texels);
            code = clEnqueueWriteImage(queue, mems[i], CL_TRUE, origin, texture->region, 0, 0, texels, num_waits, waits,
                                       NULL);
        } else {
            code = clEnqueueReadImage(queue, mems[i], CL_TRUE, origin, texture->region, 0, 0, texels, num_waits, waits,
                                      NULL);
            if (code == CL_SUCCESS && texture->flags != CL_MEM_READ_ONLY)
                glTexSubImage2D(GL_TEXTURE_2D, 0, 0, 0, (GLsizei)texture->region[0], (GLsizei)texture->region[1],
                                texture->format, texture->type, texels);
        }
        free(texels);
        if (code != CL_SUCCESS)
            return code;
    }
    return clEnqueueMarkerWithWaitList(queue, num_waits, waits, event);
}

static cl_int acquire(cl_command_queue queue, cl_uint count, const cl_mem *mems, cl_uint num_waits,
                      const cl_event *waits, cl_event *event) {
    return hand_over(1, queue, count, mems, num_waits, waits, event);
}
static cl_int release(cl_command_queue queue, cl_uint count, const cl_mem *mems, cl_uint num_waits,
                      const cl_event *waits, cl_event *event) {
    return hand_over(0, queue, count, mems, num_waits, waits, event);
}

void *clGetExtensionFunctionAddressForPlatform(cl_platform_id platform, const char *name) {
    (void)platform;
    if (strcmp(name, "clCreateFromGLTexture") == 0)
        return (void *)(uintptr_t)create;
    if (strcmp(name, "clEnqueueAcquireGLObjects") == 0)
        return (void *)(uintptr_t)acquire;
    if (strcmp(name, "clEnqueueReleaseGLObjects") == 0)
        return (void *)(uintptr_t)release;
    return NULL;
}

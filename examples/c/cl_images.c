/*
 * For an engine whose pictures are cl_images: textures of OpenCL, or of GL where the cl_context was made with a GL
 * context. The ideal image of minimal.c comes in a texture, and codes leave in one; the engine never copies through
 * host memory between them. The scene and the seeds are those of minimal.c, and so are the files.
 *
 *     cl_images [prefix]      writes <prefix>_0.pgm to <prefix>_9.pgm, by default textures_0.pgm to textures_9.pgm
 */
#include <clspeckle/clspeckle.h>

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

enum { WIDTH = 320, HEIGHT = 240, FRAMES = 10, BITS = 10 };

static int failed(ClspStatus status) {
    ClspErrorInfo error;
    if (status == CLSP_SUCCESS)
        return 0;
    error.struct_size = sizeof(error);
    if (clspGetLastError(&error) == CLSP_SUCCESS)
        fprintf(stderr, "%s: %s (%s)\n%s", error.function, error.message, clspStatusString(error.status),
                error.build_log);
    return 1;
}

static int failed_cl(cl_int code, const char *call) {
    if (code != CL_SUCCESS)
        fprintf(stderr, "%s failed with OpenCL code %d\n", call, code);
    return code != CL_SUCCESS;
}

/* The engine's picture: dots, in the red channel of an RGBA texture. */
static void draw_dots(float *texels) {
    int x, y;
    for (y = 0; y < HEIGHT; ++y) {
        for (x = 0; x < WIDTH; ++x) {
            const int shift = (y / 16) % 2 ? 8 : 0;
            const double dx = (double)((x + shift) % 16) - 7.5, dy = (double)(y % 16) - 7.5;
            texels[4 * (y * WIDTH + x)] = (float)exp(-(dx * dx + dy * dy) / (2.0 * 1.5 * 1.5));
        }
    }
}

static int write_pgm(const char *path, const uint16_t *codes) {
    char temporary[1024];
    FILE *file;
    int i, ok;
    if (snprintf(temporary, sizeof(temporary), "%s.part", path) >= (int)sizeof(temporary)) {
        fprintf(stderr, "%s: the name is too long\n", path);
        return 0;
    }
    file = fopen(temporary, "wb");
    ok = file && fprintf(file, "P5\n%d %d\n%d\n", WIDTH, HEIGHT, (1 << BITS) - 1) > 0;
    for (i = 0; ok && i < WIDTH * HEIGHT; ++i) /* PGM is big-endian */
        ok = fputc(codes[i] >> 8, file) != EOF && fputc(codes[i] & 0xff, file) != EOF;
    ok = file && fclose(file) == 0 && ok && rename(temporary, path) == 0;
    if (!ok) {
        perror(path);
        if (file)
            remove(temporary);
    }
    return ok;
}

static cl_mem make_texture(cl_context context, cl_channel_order order, cl_channel_type type, cl_mem_flags flags) {
    cl_image_format format;
    cl_image_desc desc = {0};
    cl_int code = CL_SUCCESS;
    cl_mem texture;
    format.image_channel_order = order;
    format.image_channel_data_type = type;
    desc.image_type = CL_MEM_OBJECT_IMAGE2D;
    desc.image_width = WIDTH;
    desc.image_height = HEIGHT;
    texture = clCreateImage(context, flags, &format, &desc, NULL, &code);
    failed_cl(code, "clCreateImage");
    return texture;
}

int main(int argc, char **argv) {
    const char *prefix = argc > 1 ? argv[1] : "textures";
    const size_t origin[3] = {0, 0, 0}, region[3] = {WIDTH, HEIGHT, 1};
    ClspContext context = NULL;
    ClspPipelineDesc pipeline_desc = {0};
    ClspPipeline pipeline = NULL;
    cl_command_queue queue = NULL;
    cl_mem irradiance = NULL, output = NULL, picture = NULL, codes_texture = NULL;
    ClspContextInfo info;
    ClspInteropInfo interop;
    ClspPhaseDesc phase_desc;
    ClspApertureDesc aperture_desc;
    ClspSensorDesc sensor_desc;
    ClspFrame frame;
    float *texels = calloc((size_t)4 * WIDTH * HEIGHT, sizeof(float));
    uint16_t *codes = malloc(sizeof(uint16_t) * WIDTH * HEIGHT);
    int i, result = EXIT_FAILURE;

    if (!texels || !codes) {
        fprintf(stderr, "out of memory\n");
        goto done;
    }
    draw_dots(texels);

    /* An engine has a cl_context; it goes into ClspContextDesc. Here clSpeckle makes one, and the textures are made in
     * it. */
    info.struct_size = sizeof(info);
    interop.struct_size = sizeof(interop);
    if (failed(clspContextCreate(NULL, &context)) || failed(clspQueueCreate(context, 0, &queue)) ||
        failed(clspContextGetInfo(context, &info)) || failed(clspContextGetInteropInfo(context, &interop)))
        goto done;
    printf("GL textures: %s\n", interop.gl_textures ? "yes" : interop.gl_textures_reason);
    if (!interop.cl_images) {
        fprintf(stderr, "%s\n", interop.cl_images_reason);
        goto done;
    }
    picture = make_texture(info.cl_context_handle, CL_RGBA, CL_FLOAT, CL_MEM_READ_ONLY);
    codes_texture = make_texture(info.cl_context_handle, CL_R, CL_UNSIGNED_INT16, CL_MEM_WRITE_ONLY);
    if (!picture || !codes_texture)
        goto done;
    /* What the frame reads and writes. */
    if (failed(clspBufferCreate(context, sizeof(float) * WIDTH * HEIGHT, &irradiance)) ||
        failed(clspBufferCreate(context, sizeof(uint16_t) * WIDTH * HEIGHT, &output)))
        goto done;

    if (failed(clspPhaseDescInit(&phase_desc, sizeof(phase_desc))) ||
        failed(clspApertureDescInit(&aperture_desc, sizeof(aperture_desc))) ||
        failed(clspSensorDescInit(&sensor_desc, sizeof(sensor_desc))) ||
        failed(clspPipelineDescInit(&pipeline_desc, sizeof(pipeline_desc))) ||
        failed(clspFrameInit(&frame, sizeof(frame))))
        goto done;
    phase_desc.width = aperture_desc.width = sensor_desc.width = WIDTH;
    phase_desc.height = aperture_desc.height = sensor_desc.height = HEIGHT;
    phase_desc.seed = sensor_desc.seed = 2024;
    aperture_desc.degree_of_polarization = 0.5;
    aperture_desc.normalization = CLSP_NORMALIZATION_UNIT_MEAN;
    sensor_desc.bits = BITS;
    if (failed(clspPhaseCreate(context, &phase_desc, &pipeline_desc.phase)) ||
        failed(clspApertureCreate(context, &aperture_desc, &pipeline_desc.aperture)) ||
        failed(clspSensorCreate(context, &sensor_desc, &pipeline_desc.sensor)) ||
        failed(clspPipelineCreate(context, &pipeline_desc, &pipeline)))
        goto done;
    frame.irradiance.mem = irradiance;
    frame.output.mem = output;
    frame.irradiance.width = frame.output.width = WIDTH;
    frame.irradiance.height = frame.output.height = HEIGHT;
    frame.irradiance.format = CLSP_FORMAT_FLOAT32;
    frame.output.format = CLSP_FORMAT_UINT16;

    for (i = 0; i < FRAMES; ++i) {
        char path[1024];
        frame.frame_index = (uint64_t)i;
        /* The engine draws, clSpeckle takes the red channel, renders, and leaves codes in the other texture: all
         * enqueued. Textures of GL stand between clspSharedEnqueueAcquire() and clspSharedEnqueueRelease(). */
        if (failed_cl(clEnqueueWriteImage(queue, picture, CL_FALSE, origin, region, 0, 0, texels, 0, NULL, NULL),
                      "clEnqueueWriteImage") ||
            failed(clspClImageEnqueueImport(context, queue, picture, 0, &frame.irradiance, 0, NULL, NULL)) ||
            failed(clspPipelineEnqueueFrame(pipeline, queue, &frame, 0, NULL, NULL)) ||
            failed(clspClImageEnqueueExport(context, queue, &frame.output, codes_texture, 0, NULL, NULL)) ||
            failed_cl(clEnqueueReadImage(queue, codes_texture, CL_TRUE, origin, region, 0, 0, codes, 0, NULL, NULL),
                      "clEnqueueReadImage"))
            goto done;
        if (snprintf(path, sizeof(path), "%s_%d.pgm", prefix, i) >= (int)sizeof(path)) {
            fprintf(stderr, "%s: the name is too long\n", prefix);
            goto done;
        }
        if (!write_pgm(path, codes))
            goto done;
    }
    if (failed(clspPipelineCheck(pipeline, queue)))
        goto done;
    printf("wrote %s_0.pgm to %s_%d.pgm\n", prefix, prefix, FRAMES - 1);
    result = EXIT_SUCCESS;

done:
    if (queue)
        clspQueueFinish(queue); /* it may read `texels` still */
    clspPipelineRelease(pipeline);
    clspSensorRelease(pipeline_desc.sensor);
    clspApertureRelease(pipeline_desc.aperture);
    clspPhaseRelease(pipeline_desc.phase);
    clspBufferRelease(codes_texture);
    clspBufferRelease(picture);
    clspBufferRelease(output);
    clspBufferRelease(irradiance);
    clspQueueRelease(queue);
    clspContextRelease(context);
    free(codes);
    free(texels);
    return result;
}

/*
 * The shortest way through the C interface, without any OpenCL code of one's own: an ideal image of Gaussian dots goes
 * in, ten frames of a 10-bit camera at f/5.6 come out as 16-bit PGM files.
 *
 *     minimal [prefix]        writes <prefix>_0.pgm to <prefix>_9.pgm, by default speckle_0.pgm to speckle_9.pgm
 */
#include <clspeckle/clspeckle.h>

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

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

/* Dots of 1.5 pixels standard deviation, 16 pixels apart, every other row shifted by half of that. */
static void draw_dots(float *image) {
    int x, y;
    for (y = 0; y < HEIGHT; ++y) {
        for (x = 0; x < WIDTH; ++x) {
            const int shift = (y / 16) % 2 ? 8 : 0;
            const double dx = (double)((x + shift) % 16) - 7.5, dy = (double)(y % 16) - 7.5;
            image[y * WIDTH + x] = (float)exp(-(dx * dx + dy * dy) / (2.0 * 1.5 * 1.5));
        }
    }
}

/* Written under a temporary name and renamed: whoever watches the folder never sees half a file. */
static int write_pgm(const char *path, const uint16_t *codes) {
    unsigned char row[2 * WIDTH]; /* PGM is big-endian */
    char temporary[1024];
    FILE *file;
    int x, y, ok;
    if (snprintf(temporary, sizeof(temporary), "%s.part", path) >= (int)sizeof(temporary)) {
        fprintf(stderr, "%s: the name is too long\n", path);
        return 0;
    }
    file = fopen(temporary, "wb");
    if (!file) {
        perror(temporary);
        return 0;
    }
    ok = fprintf(file, "P5\n%d %d\n%d\n", WIDTH, HEIGHT, (1 << BITS) - 1) > 0;
    for (y = 0; y < HEIGHT; ++y) {
        for (x = 0; x < WIDTH; ++x) {
            row[2 * x] = (unsigned char)(codes[y * WIDTH + x] >> 8);
            row[2 * x + 1] = (unsigned char)(codes[y * WIDTH + x] & 0xff);
        }
        ok = fwrite(row, sizeof(row), 1, file) == 1 && ok;
    }
    ok = fclose(file) == 0 && ok;
    ok = ok && rename(temporary, path) == 0;
    if (!ok) {
        perror(path);
        remove(temporary);
    }
    return ok;
}

int main(int argc, char **argv) {
    const char *prefix = argc > 1 ? argv[1] : "speckle";
    ClspContext context = NULL;
    ClspPhase phase = NULL;
    ClspAperture aperture = NULL;
    ClspSensor sensor = NULL;
    ClspPipeline pipeline = NULL;
    cl_command_queue queue = NULL;
    cl_mem irradiance = NULL, output = NULL;
    ClspPhaseDesc phase_desc;
    ClspApertureDesc aperture_desc;
    ClspSensorDesc sensor_desc;
    ClspPipelineDesc pipeline_desc;
    ClspFrame frame;
    float *ideal = malloc(sizeof(float) * WIDTH * HEIGHT);
    uint16_t *codes = malloc(sizeof(uint16_t) * WIDTH * HEIGHT);
    int i, result = EXIT_FAILURE;

    if (!ideal || !codes) {
        fprintf(stderr, "out of memory\n");
        goto done;
    }
    draw_dots(ideal);

    /* A device and the memory on it. */
    if (failed(clspContextCreate(NULL, &context)) || failed(clspQueueCreate(context, 0, &queue)) ||
        failed(clspBufferCreate(context, sizeof(float) * WIDTH * HEIGHT, &irradiance)) ||
        failed(clspBufferCreate(context, sizeof(uint16_t) * WIDTH * HEIGHT, &output)) ||
        failed(clspBufferWrite(queue, ideal, sizeof(float) * WIDTH * HEIGHT, irradiance, 0)))
        goto done;

    /* The camera: a partly polarized surface, an f/5.6 lens before 2.9 um pixels at 940 nm, a 10-bit sensor. */
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
    if (failed(clspPhaseCreate(context, &phase_desc, &phase)) ||
        failed(clspApertureCreate(context, &aperture_desc, &aperture)) ||
        failed(clspSensorCreate(context, &sensor_desc, &sensor)))
        goto done;
    pipeline_desc.phase = phase;
    pipeline_desc.aperture = aperture;
    pipeline_desc.sensor = sensor;
    if (failed(clspPipelineCreate(context, &pipeline_desc, &pipeline)))
        goto done;

    /* Ten frames of a scene at rest: the speckle stays, the noise is new each time. */
    frame.irradiance.mem = irradiance;
    frame.irradiance.width = frame.output.width = WIDTH;
    frame.irradiance.height = frame.output.height = HEIGHT;
    frame.irradiance.format = CLSP_FORMAT_FLOAT32;
    frame.output.mem = output;
    frame.output.format = CLSP_FORMAT_UINT16;
    for (i = 0; i < FRAMES; ++i) {
        char path[1024];
        frame.frame_index = (uint64_t)i;
        if (failed(clspPipelineEnqueueFrame(pipeline, queue, &frame, 0, NULL, NULL)) ||
            failed(clspBufferRead(queue, output, 0, sizeof(uint16_t) * WIDTH * HEIGHT, codes)))
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

done: /* Any order will do, and NULL is allowed everywhere. */
    clspPipelineRelease(pipeline);
    clspSensorRelease(sensor);
    clspApertureRelease(aperture);
    clspPhaseRelease(phase);
    clspBufferRelease(output);
    clspBufferRelease(irradiance);
    clspQueueRelease(queue);
    clspContextRelease(context);
    free(codes);
    free(ideal);
    return result;
}

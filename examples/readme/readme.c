#include <clspeckle/clspeckle.h>

#include <stdio.h>
#include <stdlib.h>

/* Ends the program with the reason if a call failed. */
static void check(ClspStatus status) {
    if (status != CLSP_SUCCESS) {
        ClspErrorInfo error = {.struct_size = sizeof error};
        clspGetLastError(&error);
        fprintf(stderr, "%s: %s\n", error.function, error.message);
        exit(1);
    }
}

int main(void) {
    enum { WIDTH = 640, HEIGHT = 480 };
    static float ideal[HEIGHT * WIDTH]; /* what a renderer made: here a flat, lit wall */
    static uint16_t codes[HEIGHT * WIDTH];
    for (int i = 0; i < HEIGHT * WIDTH; ++i)
        ideal[i] = 1.0f;

    ClspContext context; /* the best device; or give your own cl_context */
    cl_command_queue queue;
    cl_mem irradiance, output;
    check(clspContextCreate(NULL, &context));
    check(clspQueueCreate(context, 0, &queue));
    check(clspBufferCreate(context, sizeof ideal, &irradiance));
    check(clspBufferCreate(context, sizeof codes, &output));

    ClspPhaseDesc phase_desc;
    check(clspPhaseDescInit(&phase_desc, sizeof phase_desc));
    phase_desc.width = WIDTH;
    phase_desc.height = HEIGHT;
    phase_desc.seed = 7;
    ClspApertureDesc aperture_desc; /* f/5.6, 2.9 um pixels, 940 nm */
    check(clspApertureDescInit(&aperture_desc, sizeof aperture_desc));
    aperture_desc.width = WIDTH;
    aperture_desc.height = HEIGHT;
    ClspSensorDesc sensor_desc; /* 10 bits, black level 64, read noise 4 */
    check(clspSensorDescInit(&sensor_desc, sizeof sensor_desc));
    sensor_desc.width = WIDTH;
    sensor_desc.height = HEIGHT;
    sensor_desc.seed = 7;

    ClspPipelineDesc pipeline_desc;
    check(clspPipelineDescInit(&pipeline_desc, sizeof pipeline_desc));
    check(clspPhaseCreate(context, &phase_desc, &pipeline_desc.phase));
    check(clspApertureCreate(context, &aperture_desc, &pipeline_desc.aperture));
    check(clspSensorCreate(context, &sensor_desc, &pipeline_desc.sensor));
    ClspPipeline pipeline;
    check(clspPipelineCreate(context, &pipeline_desc, &pipeline));

    check(clspBufferWrite(queue, ideal, sizeof ideal, irradiance, 0));
    ClspFrame frame;
    check(clspFrameInit(&frame, sizeof frame));
    frame.irradiance = (ClspImage){irradiance, 0, 0, WIDTH, HEIGHT, CLSP_FORMAT_FLOAT32, 0};
    frame.output = (ClspImage){output, 0, 0, WIDTH, HEIGHT, CLSP_FORMAT_UINT16, 0};
    for (frame.frame_index = 0; frame.frame_index < 10; ++frame.frame_index) /* same speckle, new noise */
        check(clspPipelineEnqueueFrame(pipeline, queue, &frame, 0, NULL, NULL));
    check(clspBufferRead(queue, output, 0, sizeof codes, codes));
    printf("first codes: %u %u %u\n", codes[0], codes[1], codes[2]);

    clspPipelineRelease(pipeline);
    clspSensorRelease(pipeline_desc.sensor);
    clspApertureRelease(pipeline_desc.aperture);
    clspPhaseRelease(pipeline_desc.phase);
    clspBufferRelease(output);
    clspBufferRelease(irradiance);
    clspQueueRelease(queue);
    clspContextRelease(context);
    return 0;
}

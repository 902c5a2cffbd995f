/* A consumer in C: one frame through the installed library. Prints a checksum of the codes. */
#include <clspeckle/clspeckle.h>

#include <stdio.h>

#define SIDE 32

static void check(ClspStatus status) {
    ClspErrorInfo error;
    error.struct_size = sizeof(error);
    if (status != CLSP_SUCCESS && clspGetLastError(&error) == CLSP_SUCCESS)
        fprintf(stderr, "%s: %s\n", error.function, error.message);
}

int main(void) {
    ClspContext context = NULL;
    ClspPhase phase = NULL;
    ClspAperture aperture = NULL;
    ClspSensor sensor = NULL;
    ClspPipeline pipeline = NULL;
    ClspPhaseDesc phase_desc;
    ClspApertureDesc aperture_desc;
    ClspSensorDesc sensor_desc;
    ClspPipelineDesc pipeline_desc;
    ClspFrame frame;
    cl_command_queue queue = NULL;
    cl_mem input = NULL, output = NULL;
    static float ideal[SIDE * SIDE];
    static uint16_t codes[SIDE * SIDE];
    unsigned long sum = 0;
    int i;
    for (i = 0; i < SIDE * SIDE; ++i)
        ideal[i] = 1.0f;
    check(clspContextCreate(NULL, &context));
    check(clspQueueCreate(context, 0, &queue));
    check(clspBufferCreate(context, sizeof(ideal), &input));
    check(clspBufferCreate(context, sizeof(codes), &output));
    check(clspBufferWrite(queue, ideal, sizeof(ideal), input, 0));
    check(clspPhaseDescInit(&phase_desc, sizeof(phase_desc)));
    check(clspApertureDescInit(&aperture_desc, sizeof(aperture_desc)));
    check(clspSensorDescInit(&sensor_desc, sizeof(sensor_desc)));
    check(clspPipelineDescInit(&pipeline_desc, sizeof(pipeline_desc)));
    check(clspFrameInit(&frame, sizeof(frame)));
    phase_desc.width = phase_desc.height = aperture_desc.width = aperture_desc.height = SIDE;
    sensor_desc.width = sensor_desc.height = SIDE;
    check(clspPhaseCreate(context, &phase_desc, &phase));
    check(clspApertureCreate(context, &aperture_desc, &aperture));
    check(clspSensorCreate(context, &sensor_desc, &sensor));
    pipeline_desc.phase = phase;
    pipeline_desc.aperture = aperture;
    pipeline_desc.sensor = sensor;
    check(clspPipelineCreate(context, &pipeline_desc, &pipeline));
    frame.irradiance.mem = input;
    frame.output.mem = output;
    frame.irradiance.width = frame.irradiance.height = frame.output.width = frame.output.height = SIDE;
    frame.irradiance.format = CLSP_FORMAT_FLOAT32;
    frame.output.format = CLSP_FORMAT_UINT16;
    check(clspPipelineEnqueueFrame(pipeline, queue, &frame, 0, NULL, NULL));
    check(clspBufferRead(queue, output, 0, sizeof(codes), codes));
    for (i = 0; i < SIDE * SIDE; ++i)
        sum = (sum * 31 + codes[i]) % 1000000007ul;
    printf("checksum %lu\n", sum);
    clspPipelineRelease(pipeline);
    clspSensorRelease(sensor);
    clspApertureRelease(aperture);
    clspPhaseRelease(phase);
    clspBufferRelease(input);
    clspBufferRelease(output);
    clspQueueRelease(queue);
    clspContextRelease(context);
    return codes[0] == 0;
}

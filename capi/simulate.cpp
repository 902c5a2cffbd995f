// A frame in one call: what a pipeline's first frame is, between copies from and to the host.
#include "camera.hpp"
#include "clspeckle/pipeline.h"
#include "fft/engine_choices.hpp"
#include "handles.hpp"
#include "pipeline/pipeline.hpp"
#include "runtime/device_buffer.hpp"

#include <fmt/core.h>

using namespace clsp;
using namespace clsp::capi;

namespace {

std::shared_ptr<Context> best_context() {
    begin_opencl();
    auto context = Context::create({});
    forced_engine(*context); // other words are refused here
    return context;
}

// A stage is as large as the image. Maps of another size would be read beyond their end.
void take_size(std::uint32_t &own, std::uint32_t wanted, const char *name, const char *image) {
    if (own != 0 && own != wanted)
        throw Error(Status::kInvalidArgument, fmt::format("{} is {}, but the image's {} is {}; set it to 0 or {}", name,
                                                          own, image, wanted, wanted));
    own = wanted;
}

} // namespace

extern "C" {

CLSP_API ClspStatus clspSimulate(ClspContext context, uint32_t width, uint32_t height, const float *irradiance,
                                 const ClspApertureDesc *aperture, const ClspSensorDesc *sensor, uint64_t seed,
                                 uint64_t frame_index, uint16_t *codes) {
    return guarded("clspSimulate", [&] {
        required(irradiance, "irradiance");
        required(codes, "codes");
        ApertureParameters lens = aperture ? aperture_parameters(aperture, "aperture") : ApertureParameters();
        SensorParameters chip = sensor ? sensor_parameters(sensor, "sensor") : SensorParameters();
        take_size(lens.width, width, "aperture->width", "width");
        take_size(lens.height, height, "aperture->height", "height");
        take_size(chip.width, width, "sensor->width", "width");
        take_size(chip.height, height, "sensor->height", "height");
        if (lens.workspace_from_host)
            throw Error(Status::kInvalidArgument,
                        "aperture->workspace_from_host is 1, it must be 0: this call has the memory");
        if (chip.seed == 0)
            chip.seed = seed;
        PhaseParameters surface;
        surface.width = width;
        surface.height = height;
        surface.oversampling = lens.oversampling;
        surface.guard_px = lens.guard_px;
        surface.seed = seed;
        PipelineParameters parameters;
        parameters.seed = seed;

        std::shared_ptr<Context> c;
        if (context)
            c = object(context);
        else
            c = best_context();
        PipelineStages stages;
        stages.phase = std::make_shared<Phase>(c, surface);
        stages.aperture = std::make_shared<Aperture>(c, lens);
        stages.sensor = std::make_shared<Sensor>(c, chip);
        Pipeline camera(c, std::move(stages), parameters);

        const std::size_t pixels = std::size_t{width} * height;
        const cl::CommandQueue queue(c->cl_context(), c->device());
        const DeviceBuffer light(c, pixels * sizeof(float), irradiance);
        const DeviceBuffer output(c, pixels * sizeof(std::uint16_t));
        Frame frame;
        frame.refresh = Refresh::kAll;
        frame.frame_index = frame_index;
        frame.irradiance = {light.get()(), 0, 0, width, height, Format::kFloat32};
        frame.output = {output.get()(), 0, 0, width, height, Format::kUint16};
        camera.enqueue_frame(queue(), frame, 0, nullptr, nullptr);
        camera.check(queue());
        queue.enqueueReadBuffer(output.get(), CL_TRUE, 0, pixels * sizeof(std::uint16_t), codes);
    });
}

} // extern "C"

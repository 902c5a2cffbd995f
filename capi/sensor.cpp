#include "clspeckle/sensor.h"

#include "convert.hpp"
#include "handles.hpp"
#include "stages/sensor.hpp"

using namespace clsp;
using namespace clsp::capi;

namespace {

ClspSensorDesc sensor_defaults() {
    const SensorParameters p;
    ClspSensorDesc desc{};
    desc.struct_size = sizeof desc;
    desc.bits = p.bits;
    desc.seed = p.seed;
    desc.exposure_gain_dn = p.exposure_gain_dn;
    desc.saturation_dn = p.saturation_dn;
    desc.black_level_dn = p.black_level_dn;
    desc.read_noise_dn = p.read_noise_dn;
    desc.hot_pixel_fraction = p.hot_pixel_fraction;
    desc.hot_pixel_mean_dn = p.hot_pixel_mean_dn;
    desc.cold_pixel_fraction = p.cold_pixel_fraction;
    desc.float_full_scale = p.float_full_scale;
    desc.quantize = p.quantize ? 1 : 0;
    return desc;
}

} // namespace

extern "C" {

CLSP_API ClspStatus clspSensorDescInit(ClspSensorDesc *desc, uint32_t struct_size) {
    return guarded("clspSensorDescInit", [&] { init_struct(desc, struct_size, sensor_defaults(), "desc"); });
}

CLSP_API ClspStatus clspSensorCreate(ClspContext context, const ClspSensorDesc *desc, ClspSensor *sensor) {
    return guarded("clspSensorCreate", [&] {
        const auto c = object(context);
        required(sensor, "sensor");
        const ClspSensorDesc d = read_struct(desc, sensor_defaults(), "desc");
        check_reserved(d.reserved, "desc->reserved");
        SensorParameters p;
        p.width = d.width;
        p.height = d.height;
        p.bits = d.bits;
        p.seed = d.seed;
        p.exposure_gain_dn = d.exposure_gain_dn;
        p.saturation_dn = d.saturation_dn;
        p.black_level_dn = d.black_level_dn;
        p.read_noise_dn = d.read_noise_dn;
        p.hot_pixel_fraction = d.hot_pixel_fraction;
        p.hot_pixel_mean_dn = d.hot_pixel_mean_dn;
        p.cold_pixel_fraction = d.cold_pixel_fraction;
        p.float_full_scale = d.float_full_scale;
        p.dark_frame_dn = d.dark_frame_dn;
        p.dark_frame_pitch_bytes = d.dark_frame_pitch_bytes;
        p.quantize = checked_flag(d.quantize, "desc->quantize");
        give(sensor, std::make_shared<Sensor>(c, p));
    });
}

CLSP_API ClspStatus clspSensorRetain(ClspSensor sensor) {
    return guarded("clspSensorRetain", [&] { HandleTable<ClspSensor>::instance().retain(sensor); });
}

CLSP_API ClspStatus clspSensorRelease(ClspSensor sensor) {
    return guarded("clspSensorRelease", [&] { HandleTable<ClspSensor>::instance().release(sensor); });
}

CLSP_API ClspStatus clspSensorSetExposureGain(ClspSensor sensor, double exposure_gain_dn) {
    return guarded("clspSensorSetExposureGain", [&] { object(sensor)->set_exposure_gain(exposure_gain_dn); });
}

CLSP_API ClspStatus clspSensorEnqueueExpose(ClspSensor sensor, cl_command_queue queue, const ClspImage *intensity,
                                            uint64_t frame_index, const ClspImage *output,
                                            uint32_t num_events_in_wait_list, const cl_event *event_wait_list,
                                            cl_event *event) {
    return guarded("clspSensorEnqueueExpose", [&] {
        const auto s = object(sensor);
        const ImageView in = check_image(description(intensity, "intensity"), "intensity", s->context()->cl_context()(),
                                         {s->width(), s->height()}, {Format::kFloat32});
        const ImageView out = s->check_output(description(output, "output"));
        enqueue(*s->context(), queue, num_events_in_wait_list, event_wait_list, event,
                [&](CommandChain &chain) { s->enqueue_expose(chain, in, frame_index, out); });
    });
}

} // extern "C"

#include "clspeckle/sensor.h"

#include "camera.hpp"
#include "convert.hpp"
#include "fields.hpp"
#include "handles.hpp"
#include "runtime/checks.hpp"
#include "stages/sensor.hpp"
#include "stages/sensor_datasheet.hpp"

#include <algorithm>
#include <cstddef>
#include <fmt/core.h>
#include <string>

using namespace clsp;
using namespace clsp::capi;

static_assert(offsetof(ClspSensorDesc, conversion_gain_dn_per_e) == kFirstSize<ClspSensorDesc>,
              "members are added after those of the first release");
static_assert(sizeof(ClspSensorDesc) == offsetof(ClspSensorDesc, read_noise_correlation) + sizeof(double),
              "no hidden padding at the end");

namespace clsp::capi {

CLSP_ENUM(Bayer, kGbrg, CLSP_BAYER_RGGB, CLSP_BAYER_BGGR, CLSP_BAYER_GRBG, CLSP_BAYER_GBRG)

} // namespace clsp::capi

namespace {

constexpr auto kSensorFields = [](auto field, auto &d, auto &p) {
    field(d.width, p.width);
    field(d.height, p.height);
    field(d.bits, p.bits);
    field(d.seed, p.seed);
    field(d.exposure_gain_dn, p.exposure_gain_dn);
    field(d.saturation_dn, p.saturation_dn);
    field(d.black_level_dn, p.black_level_dn);
    field(d.read_noise_dn, p.read_noise_dn);
    field(d.hot_pixel_fraction, p.hot_pixel_fraction);
    field(d.hot_pixel_mean_dn, p.hot_pixel_mean_dn);
    field(d.cold_pixel_fraction, p.cold_pixel_fraction);
    field(d.float_full_scale, p.float_full_scale);
    field(d.dark_frame_dn, p.dark_frame_dn);
    field(d.dark_frame_pitch_bytes, p.dark_frame_pitch_bytes);
    field(d.quantize, p.quantize, "desc->quantize");
    field(d.conversion_gain_dn_per_e, p.conversion_gain_dn_per_e);
    field(d.crosstalk_fraction, p.crosstalk_fraction);
    field(d.prnu, p.prnu);
    field(d.column_prnu, p.column_prnu);
    field(d.row_prnu, p.row_prnu);
    field(d.mosaic_gain, p.mosaic_gain);
    field(d.dark_current_e_per_s, p.dark_current_e_per_s);
    field(d.dark_current_reference_temperature_c, p.dark_current_reference_temperature_c);
    field(d.dark_current_doubling_k, p.dark_current_doubling_k);
    field(d.temperature_c, p.temperature_c);
    field(d.exposure_time_s, p.exposure_time_s);
    field(d.lag_fraction, p.lag_fraction);
    field(d.gamma, p.gamma);
    field(d.dsnu_dn, p.dsnu_dn);
    field(d.column_offset_dn, p.column_offset_dn);
    field(d.row_noise_dn, p.row_noise_dn);
    field(d.column_noise_dn, p.column_noise_dn);
    field(d.read_noise_spread, p.read_noise_spread);
    field(d.shot_noise, p.shot_noise, "desc->shot_noise");
    field(d.effective_bits, p.effective_bits);
    field(d.row_offset_dn, p.row_offset_dn);
    field(d.dull_pixel_fraction, p.dull_pixel_fraction);
    field(d.cubic_nonlinearity, p.cubic_nonlinearity);
    field(d.periodic_offset_dn, p.periodic_offset_dn);
    field(d.periodic_frequency_x, p.periodic_frequency_x);
    field(d.periodic_frequency_y, p.periodic_frequency_y);
    field(d.telegraph_fraction, p.telegraph_fraction);
    field(d.telegraph_step_dn, p.telegraph_step_dn);
    field(d.telegraph_centered, p.telegraph_centered, "desc->telegraph_centered");
    field(d.code_width_wave, p.code_width_wave);
    field(d.code_width_period, p.code_width_period);
    field(d.widest_code, p.widest_code);
    field(d.nonlinearity_power, p.nonlinearity_power);
    field(d.read_noise_correlation, p.read_noise_correlation);
    field(d.gain_map, p.gain_map);
    field(d.gain_map_pitch_bytes, p.gain_map_pitch_bytes);
    field(d.photons_per_unit, p.photons_per_unit);
    field(d.quantum_efficiency, p.quantum_efficiency);
    field(d.full_well_e, p.full_well_e);
};

ClspSensorDesc desc_of(const SensorDatasheet &datasheet) {
    return to_c<ClspSensorDesc>(kSensorFields, datasheet);
}

} // namespace

SensorParameters clsp::capi::sensor_parameters(const ClspSensorDesc *user, const char *name) {
    const ClspSensorDesc d = read_struct(user, desc_of({}), name);
    check_reserved(d.reserved, (std::string(name) + "->reserved").c_str());
    check_reserved(d.reserved_telegraph, (std::string(name) + "->reserved_telegraph").c_str());
    check_reserved(d.reserved_nonlinearity, (std::string(name) + "->reserved_nonlinearity").c_str());
    return from_c<SensorDatasheet>(kSensorFields, d).parameters();
}

extern "C" {

CLSP_INIT(SensorDesc, desc, desc_of({}))

CLSP_API ClspStatus clspSensorDescFromProfile(ClspSensorDesc *desc, uint32_t struct_size, const char *name) {
    return guarded("clspSensorDescFromProfile", [&] {
        required(name, "name");
        init_struct(desc, struct_size, desc_of(sensor_profile(name)), "desc");
    });
}

CLSP_API ClspStatus clspSensorMosaicFromBayer(uint32_t bayer, double red, double green, double blue,
                                              double mosaic_gain[4]) {
    return guarded("clspSensorMosaicFromBayer", [&] {
        required(mosaic_gain, "mosaic_gain");
        const auto gains = mosaic_gain_of(checked_enum<Bayer>(bayer, "bayer"), red, green, blue);
        std::copy(gains.begin(), gains.end(), mosaic_gain);
    });
}

CLSP_API ClspStatus clspSensorDarkFrameFromCaptures(const uint16_t *frames, uint32_t frame_count, uint32_t width,
                                                    uint32_t height, uint64_t row_pitch_bytes,
                                                    uint64_t frame_pitch_bytes, double black_level_dn,
                                                    float *dark_frame_dn, double *temporal_noise_dn) {
    return guarded("clspSensorDarkFrameFromCaptures", [&] {
        dark_frame_from_captures(
            {frames, frame_count, width, height, row_pitch_bytes, frame_pitch_bytes, black_level_dn}, dark_frame_dn,
            temporal_noise_dn);
    });
}

CLSP_API ClspStatus clspSensorCreate(ClspContext context, const ClspSensorDesc *desc, ClspSensor *sensor) {
    return guarded("clspSensorCreate", [&] {
        const auto c = object(context);
        required(sensor, "sensor");
        give(sensor, std::make_shared<Sensor>(c, sensor_parameters(desc, "desc")));
    });
}

CLSP_REFERENCES(Sensor)

CLSP_API ClspStatus clspSensorSetExposureGain(ClspSensor sensor, double exposure_gain_dn) {
    return guarded("clspSensorSetExposureGain", [&] { object(sensor)->set_exposure_gain(exposure_gain_dn); });
}

CLSP_API ClspStatus clspSensorConfigure(ClspSensor sensor, const ClspSensorDesc *desc) {
    return guarded("clspSensorConfigure", [&] { object(sensor)->configure(sensor_parameters(desc, "desc")); });
}

CLSP_API ClspStatus clspSensorResetLag(ClspSensor sensor) {
    return guarded("clspSensorResetLag", [&] { object(sensor)->reset_lag(); });
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
        s->keep_frame();
    });
}

CLSP_API ClspStatus clspSensorEnqueueDemosaic(ClspSensor sensor, cl_command_queue queue, const ClspImage *raw,
                                              uint32_t bayer, const ClspImage *rgb, uint32_t num_events_in_wait_list,
                                              const cl_event *event_wait_list, cl_event *event) {
    return guarded("clspSensorEnqueueDemosaic", [&] {
        const auto s = object(sensor);
        const auto context = s->context()->cl_context()();
        const ImageSize size{s->width(), s->height()};
        const ImageView in = check_image(description(raw, "raw"), "raw", context, size,
                                         {Format::kUint16, Format::kUint8, Format::kFloat32});
        const ImageView out = check_image(description(rgb, "rgb"), "rgb", context, size, {Format::kFloat32x3});
        if (s->width() < 2 || s->height() < 2)
            throw Error(Status::kInvalidArgument,
                        fmt::format("the sensor has {} x {} pixels (width x height); a colour filter needs at least "
                                    "2 x 2",
                                    s->width(), s->height()));
        const auto sites = checked_enum<Bayer>(bayer, "bayer");
        check_writable(out, "rgb");
        refuse_overlap(out, "rgb", in, "raw");
        enqueue(*s->context(), queue, num_events_in_wait_list, event_wait_list, event,
                [&](CommandChain &chain) { s->enqueue_demosaic(chain, in, sites, out); });
    });
}

} // extern "C"

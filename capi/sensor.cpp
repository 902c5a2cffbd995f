#include "clspeckle/sensor.h"

#include "convert.hpp"
#include "fields.hpp"
#include "handles.hpp"
#include "runtime/checks.hpp"
#include "stages/sensor.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <cstddef>
#include <fmt/core.h>
#include <iterator>
#include <string>

using namespace clsp;
using namespace clsp::capi;

static_assert(offsetof(ClspSensorDesc, conversion_gain_dn_per_e) == kFirstSize<ClspSensorDesc>,
              "members are added after those of the first release");
static_assert(sizeof(ClspSensorDesc) == offsetof(ClspSensorDesc, effective_bits) + sizeof(std::uint32_t),
              "no hidden padding at the end");

namespace {

constexpr auto kFields = [](auto field, auto &d, auto &p) {
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
};

ClspSensorDesc sensor_defaults() {
    auto desc = to_c<ClspSensorDesc>(kFields, SensorParameters());
    desc.quantum_efficiency = 1.0;
    return desc;
}

// Equal but for the rounding of whoever multiplied it out.
bool agree(double a, double b) {
    return std::abs(a - b) <= 1e-9 * std::abs(b);
}

// The exposure gain, also where it is given in photons.
double exposure_gain_of(const ClspSensorDesc &d) {
    check_not_negative(d.photons_per_unit, "photons_per_unit");
    if (!(d.quantum_efficiency > 0.0 && d.quantum_efficiency <= 1.0))
        throw Error(Status::kInvalidArgument,
                    fmt::format("quantum_efficiency is {}, it must be above 0 and at most 1 (electrons per photon)",
                                d.quantum_efficiency));
    if (d.photons_per_unit == 0.0)
        return d.exposure_gain_dn;
    if (d.conversion_gain_dn_per_e == 0.0)
        throw Error(Status::kInvalidArgument, "photons_per_unit needs to know what an electron is: set "
                                              "conversion_gain_dn_per_e, which is 0");
    const double gain = d.conversion_gain_dn_per_e * d.quantum_efficiency * d.photons_per_unit;
    if (d.exposure_gain_dn != SensorParameters().exposure_gain_dn && !agree(d.exposure_gain_dn, gain))
        throw Error(Status::kInvalidArgument,
                    fmt::format("exposure_gain_dn is {}, but photons_per_unit, quantum_efficiency and "
                                "conversion_gain_dn_per_e make it {}; give the one or the other",
                                d.exposure_gain_dn, gain));
    return gain;
}

// Where the signal clips, also where it is given in electrons.
double saturation_of(const ClspSensorDesc &d) {
    check_not_negative(d.full_well_e, "full_well_e");
    if (d.full_well_e == 0.0)
        return d.saturation_dn;
    if (d.conversion_gain_dn_per_e == 0.0)
        throw Error(Status::kInvalidArgument,
                    "full_well_e needs to know what an electron is: set conversion_gain_dn_per_e, which is 0");
    const double saturation = d.conversion_gain_dn_per_e * d.full_well_e;
    if (saturation <= d.black_level_dn)
        throw Error(Status::kInvalidArgument,
                    fmt::format("full_well_e is {}, which is {} DN at conversion_gain_dn_per_e = {}: it must be above "
                                "the black level, black_level_dn = {}",
                                d.full_well_e, saturation, d.conversion_gain_dn_per_e, d.black_level_dn));
    if (!std::isinf(d.saturation_dn) && !agree(d.saturation_dn, saturation))
        throw Error(Status::kInvalidArgument,
                    fmt::format("saturation_dn is {}, but full_well_e and conversion_gain_dn_per_e make it {}; give "
                                "the one or the other",
                                d.saturation_dn, saturation));
    return saturation;
}

SensorParameters parameters_of(const ClspSensorDesc *desc) {
    const ClspSensorDesc d = read_struct(desc, sensor_defaults(), "desc");
    check_reserved(d.reserved, "desc->reserved");
    auto p = from_c<SensorParameters>(kFields, d);
    p.exposure_gain_dn = exposure_gain_of(d);
    p.saturation_dn = saturation_of(d);
    return p;
}

struct Profile {
    const char *name;
    void (*apply)(ClspSensorDesc &desc);
};

// docs/sensor.md says where each number comes from.
void os04a10(ClspSensorDesc &desc) {
    desc.width = 2688;
    desc.height = 1520;
    desc.bits = 10;
    desc.black_level_dn = 64.0;
    desc.read_noise_dn = 0.015 * 1023.0;
    desc.conversion_gain_dn_per_e = 0.08;
    desc.full_well_e = 12000.0;
    desc.quantum_efficiency = 0.4;
    desc.dark_current_e_per_s = 10.0;
    desc.prnu = 0.01;
    desc.dsnu_dn = 0.5;
    desc.hot_pixel_fraction = 1e-4;
}

constexpr std::array<Profile, 1> kProfiles{{{"OS04A10", os04a10}}};

std::string lower(std::string text) {
    std::transform(text.begin(), text.end(), text.begin(), [](unsigned char c) { return std::tolower(c); });
    return text;
}

const Profile &profile_of(const std::string &name) {
    std::string known;
    for (const Profile &profile : kProfiles) {
        if (lower(profile.name) == lower(name))
            return profile;
        known += fmt::format("{}\"{}\"", known.empty() ? "" : ", ", profile.name);
    }
    throw Error(Status::kInvalidArgument, fmt::format("name is \"{}\", expected one of {}", name, known));
}

} // namespace

extern "C" {

CLSP_INIT(SensorDesc, desc, sensor_defaults())

CLSP_API ClspStatus clspSensorDescFromProfile(ClspSensorDesc *desc, uint32_t struct_size, const char *name) {
    return guarded("clspSensorDescFromProfile", [&] {
        ClspSensorDesc values = sensor_defaults();
        required(name, "name");
        profile_of(name).apply(values);
        init_struct(desc, struct_size, values, "desc");
    });
}

CLSP_API ClspStatus clspSensorMosaicFromBayer(uint32_t bayer, double red, double green, double blue,
                                              double mosaic_gain[4]) {
    return guarded("clspSensorMosaicFromBayer", [&] {
        required(mosaic_gain, "mosaic_gain");
        const auto gains = mosaic_gain_of(static_cast<Bayer>(bayer), red, green, blue);
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
        give(sensor, std::make_shared<Sensor>(c, parameters_of(desc)));
    });
}

CLSP_REFERENCES(Sensor)

CLSP_API ClspStatus clspSensorSetExposureGain(ClspSensor sensor, double exposure_gain_dn) {
    return guarded("clspSensorSetExposureGain", [&] { object(sensor)->set_exposure_gain(exposure_gain_dn); });
}

CLSP_API ClspStatus clspSensorConfigure(ClspSensor sensor, const ClspSensorDesc *desc) {
    return guarded("clspSensorConfigure", [&] { object(sensor)->configure(parameters_of(desc)); });
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
        check_bayer(static_cast<Bayer>(bayer));
        check_writable(out, "rgb");
        refuse_overlap(out, "rgb", in, "raw");
        enqueue(*s->context(), queue, num_events_in_wait_list, event_wait_list, event,
                [&](CommandChain &chain) { s->enqueue_demosaic(chain, in, static_cast<Bayer>(bayer), out); });
    });
}

} // extern "C"

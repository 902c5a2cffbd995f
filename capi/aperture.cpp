#include "clspeckle/aperture.h"

#include "camera.hpp"
#include "convert.hpp"
#include "fields.hpp"
#include "handles.hpp"
#include "stages/aperture.hpp"
#include "texts.hpp"

#include <string>

using namespace clsp;
using namespace clsp::capi;

namespace clsp::capi {

CLSP_ENUM(PupilShape, kRing, CLSP_PUPIL_CIRCLE, CLSP_PUPIL_IMAGE, CLSP_PUPIL_POLYGON, CLSP_PUPIL_RING)
CLSP_ENUM(Normalization, kUnitMean, CLSP_NORMALIZATION_TRANSMISSION, CLSP_NORMALIZATION_UNIT_MEAN)

} // namespace clsp::capi

namespace {

constexpr auto kApertureFields = [](auto field, auto &d, auto &p) {
    field(d.width, p.width);
    field(d.height, p.height);
    field(d.oversampling, p.oversampling);
    field(d.guard_px, p.guard_px);
    field(d.pupil, p.pupil.shape, "desc->pupil");
    field(d.normalization, p.pupil.normalization, "desc->normalization");
    field(d.soft_rim, p.pupil.soft_rim);
    field(d.pupil_image, p.pupil.image);
    field(d.pupil_width, p.pupil.image_width);
    field(d.pupil_height, p.pupil.image_height);
    field(d.pupil_pitch_bytes, p.pupil.image_pitch_bytes);
    field(d.workspace_from_host, p.workspace_from_host, "desc->workspace_from_host");
    field(d.relative_diameter, p.relative_diameter);
    field(d.f_number, p.f_number);
    field(d.pixel_pitch_m, p.pixel_pitch_m);
    field(d.wavelength_m, p.wavelength_m);
    field(d.degree_of_polarization, p.degree_of_polarization);
    field(d.blade_count, p.pupil.blade_count);
    field(d.blade_rotation_rad, p.pupil.blade_rotation_rad);
    field(d.blade_curvature, p.pupil.blade_curvature);
    field(d.obstruction_ratio, p.pupil.obstruction_ratio);
    field(d.defocus_waves, p.pupil.defocus_waves);
    field(d.zernike_waves, p.pupil.zernike_waves);
    field(d.fill_factor, p.fill_factor);
    field(d.pupil_image_imaginary, p.pupil.image_imaginary);
};

ClspApertureDesc aperture_defaults() {
    return to_c<ClspApertureDesc>(kApertureFields, ApertureParameters());
}

} // namespace

ApertureParameters clsp::capi::aperture_parameters(const ClspApertureDesc *user, const char *name) {
    const ClspApertureDesc d = read_struct(user, aperture_defaults(), name);
    check_reserved(d.reserved_blades, (std::string(name) + "->reserved_blades").c_str());
    return from_c<ApertureParameters>(kApertureFields, d);
}

extern "C" {

CLSP_INIT(ApertureDesc, desc, aperture_defaults())

CLSP_API ClspStatus clspApertureCreate(ClspContext context, const ClspApertureDesc *desc, ClspAperture *aperture) {
    return guarded("clspApertureCreate", [&] {
        const auto c = object(context);
        required(aperture, "aperture");
        give(aperture, std::make_shared<Aperture>(c, aperture_parameters(desc, "desc")));
    });
}

CLSP_REFERENCES(Aperture)

CLSP_API ClspStatus clspApertureGetInfo(ClspAperture aperture, ClspApertureInfo *info) {
    return guarded("clspApertureGetInfo", [&] {
        const auto a = object(aperture);
        ClspApertureInfo result{};
        result.grid_width = a->grid().grid_width;
        result.grid_height = a->grid().grid_height;
        result.pupil_samples = a->pupil_samples();
        result.relative_diameter = a->relative_diameter();
        result.mean_transmission = a->mean_transmission();
        result.workspace_bytes = a->workspace_bytes();
        copy_text(result.fft_backend, engine_name(a->engine().kind));
        copy_text(result.fft_reason, a->clfft_reason());
        copy_text(result.fft_engine, engine_name(a->engine().kind));
        const WorkGroup columns = a->engine().columns.value_or(WorkGroup{}),
                        rows = a->engine().rows.value_or(WorkGroup{});
        result.column_lines = columns.lines;
        result.column_work_items = columns.items;
        result.row_lines = rows.lines;
        result.row_work_items = rows.items;
        copy_text(result.fft_source, a->engine_source());
        write_struct(required(info, "info"), result, "info");
    });
}

CLSP_API ClspStatus clspApertureSetWorkspace(ClspAperture aperture, cl_mem mem, uint64_t offset_bytes,
                                             uint64_t size_bytes) {
    return guarded("clspApertureSetWorkspace", [&] { object(aperture)->set_workspace(mem, offset_bytes, size_bytes); });
}

CLSP_API ClspStatus clspApertureEnqueuePupil(ClspAperture aperture, cl_command_queue queue, const ClspImage *pupil,
                                             uint32_t num_events_in_wait_list, const cl_event *event_wait_list,
                                             cl_event *event) {
    return guarded("clspApertureEnqueuePupil", [&] {
        const auto a = object(aperture);
        enqueue(*a->context(), queue, num_events_in_wait_list, event_wait_list, event,
                [&](CommandChain &chain) { a->enqueue_pupil(chain, description(pupil, "pupil")); });
    });
}

CLSP_API ClspStatus clspApertureEnqueueIntensity(ClspAperture aperture, cl_command_queue queue, ClspPhase phase,
                                                 const ClspImage *irradiance, const ClspImage *intensity,
                                                 uint32_t num_events_in_wait_list, const cl_event *event_wait_list,
                                                 cl_event *event) {
    return guarded("clspApertureEnqueueIntensity", [&] {
        const auto a = object(aperture);
        const auto p = object(phase);
        const ImageSize size{a->grid().width, a->grid().height};
        const ::cl_context context = a->context()->cl_context()();
        const ImageView in =
            check_image(description(irradiance, "irradiance"), "irradiance", context, size, {Format::kFloat32});
        const ImageView out =
            check_image(description(intensity, "intensity"), "intensity", context, size, {Format::kFloat32});
        enqueue(*a->context(), queue, num_events_in_wait_list, event_wait_list, event,
                [&](CommandChain &chain) { a->enqueue_intensity(chain, *p, in, out); });
    });
}

} // extern "C"

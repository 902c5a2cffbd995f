#include "clspeckle/aperture.h"

#include "convert.hpp"
#include "handles.hpp"
#include "stages/aperture.hpp"

#include <algorithm>
#include <cstring>
#include <iterator>

using namespace clsp;
using namespace clsp::capi;

namespace {

ClspApertureDesc aperture_defaults() {
    const ApertureParameters p;
    ClspApertureDesc desc{};
    desc.struct_size = sizeof desc;
    desc.oversampling = p.oversampling;
    desc.guard_px = p.guard_px;
    desc.pupil = static_cast<std::uint32_t>(p.pupil.shape);
    desc.normalization = static_cast<std::uint32_t>(p.pupil.normalization);
    desc.relative_diameter = p.relative_diameter;
    desc.f_number = p.f_number;
    desc.pixel_pitch_m = p.pixel_pitch_m;
    desc.wavelength_m = p.wavelength_m;
    desc.soft_rim = p.pupil.soft_rim;
    desc.degree_of_polarization = p.degree_of_polarization;
    desc.blade_count = p.pupil.blade_count;
    desc.blade_rotation_rad = p.pupil.blade_rotation_rad;
    desc.blade_curvature = p.pupil.blade_curvature;
    desc.obstruction_ratio = p.pupil.obstruction_ratio;
    desc.defocus_waves = p.pupil.defocus_waves;
    desc.fill_factor = p.fill_factor;
    return desc;
}

} // namespace

extern "C" {

CLSP_API ClspStatus clspApertureDescInit(ClspApertureDesc *desc, uint32_t struct_size) {
    return guarded("clspApertureDescInit", [&] { init_struct(desc, struct_size, aperture_defaults(), "desc"); });
}

CLSP_API ClspStatus clspApertureCreate(ClspContext context, const ClspApertureDesc *desc, ClspAperture *aperture) {
    return guarded("clspApertureCreate", [&] {
        const auto c = object(context);
        required(aperture, "aperture");
        const ClspApertureDesc d = read_struct(desc, aperture_defaults(), "desc");
        ApertureParameters p;
        p.width = d.width;
        p.height = d.height;
        p.oversampling = d.oversampling;
        p.guard_px = d.guard_px;
        p.pupil.shape = static_cast<PupilShape>(d.pupil);
        p.pupil.normalization = static_cast<Normalization>(d.normalization);
        p.pupil.soft_rim = d.soft_rim;
        p.pupil.image = d.pupil_image;
        p.pupil.image_width = d.pupil_width;
        p.pupil.image_height = d.pupil_height;
        p.pupil.image_pitch_bytes = d.pupil_pitch_bytes;
        p.workspace_from_host = checked_flag(d.workspace_from_host, "desc->workspace_from_host");
        p.relative_diameter = d.relative_diameter;
        p.f_number = d.f_number;
        p.pixel_pitch_m = d.pixel_pitch_m;
        p.wavelength_m = d.wavelength_m;
        p.degree_of_polarization = d.degree_of_polarization;
        check_reserved(d.reserved_blades, "desc->reserved_blades");
        p.pupil.blade_count = d.blade_count;
        p.pupil.blade_rotation_rad = d.blade_rotation_rad;
        p.pupil.blade_curvature = d.blade_curvature;
        p.pupil.obstruction_ratio = d.obstruction_ratio;
        p.pupil.defocus_waves = d.defocus_waves;
        std::copy(std::begin(d.zernike_waves), std::end(d.zernike_waves), p.pupil.zernike_waves.begin());
        p.fill_factor = d.fill_factor;
        give(aperture, std::make_shared<Aperture>(c, p));
    });
}

CLSP_API ClspStatus clspApertureRetain(ClspAperture aperture) {
    return guarded("clspApertureRetain", [&] { HandleTable<ClspAperture>::instance().retain(aperture); });
}

CLSP_API ClspStatus clspApertureRelease(ClspAperture aperture) {
    return guarded("clspApertureRelease", [&] { HandleTable<ClspAperture>::instance().release(aperture); });
}

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
        std::strncpy(result.fft_backend, a->fft_backend(), sizeof result.fft_backend - 1);
        std::strncpy(result.fft_reason, a->fft_reason().c_str(), sizeof result.fft_reason - 1);
        std::strncpy(result.fft_engine, engine_name(a->engine().engine), sizeof result.fft_engine - 1);
        const GroupPick columns = a->engine().columns.value_or(GroupPick{}),
                        rows = a->engine().rows.value_or(GroupPick{});
        result.column_lines = columns.lines;
        result.column_work_items = columns.items;
        result.row_lines = rows.lines;
        result.row_work_items = rows.items;
        std::strncpy(result.fft_source, a->engine_source().c_str(), sizeof result.fft_source - 1);
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

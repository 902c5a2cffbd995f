#include "clspeckle/doe.h"

#include "convert.hpp"
#include "doe/doe_pattern.hpp"
#include "handles.hpp"
#include "progress.hpp"

#include <algorithm>

using namespace clsp;
using namespace clsp::capi;

namespace {

static_assert(CLSP_MAX_DOE_SAMPLES == kMaxDoeSide && CLSP_MAX_DOE_LINES == kMaxDoeLines,
              "the engine's limits and the API's must agree");

ClspBeamProfile beam_defaults() {
    const BeamParameters p;
    ClspBeamProfile beam{};
    beam.struct_size = sizeof beam;
    beam.kind = static_cast<std::uint32_t>(p.kind);
    beam.covariance_xx_m2 = p.covariance_xx_m2;
    beam.covariance_xy_m2 = p.covariance_xy_m2;
    beam.covariance_yy_m2 = p.covariance_yy_m2;
    beam.width_m = p.width_m;
    beam.height_m = p.height_m;
    beam.order = p.order;
    beam.m_squared = p.m_squared;
    return beam;
}

ClspDoeDefects defects_defaults() {
    const DoeDefects d;
    ClspDoeDefects defects{};
    defects.struct_size = sizeof defects;
    defects.refractive_index = d.refractive_index;
    defects.feature_samples = d.feature_samples;
    return defects;
}

ClspDoePatternDesc doe_defaults() {
    const DoePatternParameters p;
    ClspDoePatternDesc desc{};
    desc.struct_size = sizeof desc;
    desc.periodic = 1;
    desc.wavelength_m = p.wavelength_m;
    desc.oversampling = p.oversampling;
    desc.power_w = p.power_w;
    desc.image_width = p.image_width;
    desc.image_height = p.image_height;
    desc.pixel_envelope = 1;
    return desc;
}

ClspSpotPatternDesc spot_defaults() {
    const SpotPatternParameters p;
    ClspSpotPatternDesc desc{};
    desc.struct_size = sizeof desc;
    desc.wavelength_m = p.wavelength_m;
    desc.power_w = p.power_w;
    desc.image_width = p.image_width;
    desc.image_height = p.image_height;
    desc.half_extent_x = p.half_extent_x;
    desc.half_extent_y = p.half_extent_y;
    return desc;
}

BeamParameters beam_parameters(const ClspBeamProfile *user) {
    const ClspBeamProfile b = user ? read_struct(user, beam_defaults(), "beam") : beam_defaults();
    BeamParameters p;
    p.kind = static_cast<BeamKind>(b.kind);
    p.covariance_xx_m2 = b.covariance_xx_m2;
    p.covariance_xy_m2 = b.covariance_xy_m2;
    p.covariance_yy_m2 = b.covariance_yy_m2;
    p.width_m = b.width_m;
    p.height_m = b.height_m;
    p.order = b.order;
    p.skew_x = b.skew_x;
    p.skew_y = b.skew_y;
    p.m_squared = b.m_squared;
    p.image_width = b.image_width;
    p.image_height = b.image_height;
    p.image = b.image;
    p.image_pitch_bytes = b.image_pitch_bytes;
    return p;
}

DoeDefects doe_defects(const ClspDoeDefects *user) {
    const ClspDoeDefects d = user ? read_struct(user, defects_defaults(), "defects") : defects_defaults();
    check_reserved(d.reserved, "defects->reserved");
    DoeDefects p;
    p.levels = d.levels;
    p.relative_depth_error = d.relative_depth_error;
    p.rounding_sigma_m = d.rounding_sigma_m;
    p.etch_noise_rms_m = d.etch_noise_rms_m;
    p.refractive_index = d.refractive_index;
    p.dispersion_per_m = d.dispersion_per_m;
    p.seed = d.seed;
    p.feature_samples = d.feature_samples;
    return p;
}

DoePatternParameters doe_parameters(const ClspDoePatternDesc *user) {
    const ClspDoePatternDesc d = read_struct(user, doe_defaults(), "desc");
    check_reserved(d.reserved, "desc->reserved");
    DoePatternParameters p;
    p.width = d.width;
    p.height = d.height;
    p.periodic = checked_flag(d.periodic, "desc->periodic");
    p.phase = d.phase;
    p.phase_pitch_bytes = d.phase_pitch_bytes;
    p.pixel_pitch_m = d.pixel_pitch_m;
    p.wavelength_m = d.wavelength_m;
    p.dot_count = d.dot_count;
    p.dot_orders = d.dot_orders;
    p.dot_directions = d.dot_directions;
    p.dot_weights = d.dot_weights;
    p.beam = beam_parameters(d.beam);
    p.defects = doe_defects(d.defects);
    p.design_levels = d.design_levels;
    p.evaluation = static_cast<DoeEvaluation>(d.evaluation);
    p.line_count = d.line_count;
    p.oversampling = d.oversampling;
    p.line_wavelengths_m = d.line_wavelengths_m;
    p.line_powers = d.line_powers;
    p.doe_width_m = d.doe_width_m;
    p.doe_height_m = d.doe_height_m;
    p.power_w = d.power_w;
    p.image_width = d.image_width;
    p.image_height = d.image_height;
    p.half_extent_x = d.half_extent_x;
    p.half_extent_y = d.half_extent_y;
    p.pixel_envelope = checked_flag(d.pixel_envelope, "desc->pixel_envelope");
    p.max_memory_bytes = d.max_memory_bytes;
    p.cache_dir = d.cache_dir ? d.cache_dir : "";
    p.progress = progress_function(d.progress, d.progress_data);
    return p;
}

// Copies a result of known length.
template <typename T>
void copy_out(const std::vector<T> &from, std::uint64_t count, T *to, const char *name, const char *what) {
    if (count != from.size())
        throw Error(Status::kInvalidArgument,
                    fmt::format("count is {}, but the pattern has {} {}", count, from.size(), what));
    if (!to && !from.empty())
        throw Error(Status::kInvalidArgument, fmt::format("{} is NULL", name));
    std::copy(from.begin(), from.end(), to);
}

} // namespace

extern "C" {

CLSP_API ClspStatus clspBeamProfileInit(ClspBeamProfile *beam, uint32_t struct_size) {
    return guarded("clspBeamProfileInit", [&] { init_struct(beam, struct_size, beam_defaults(), "beam"); });
}

CLSP_API ClspStatus clspDoeDefectsInit(ClspDoeDefects *defects, uint32_t struct_size) {
    return guarded("clspDoeDefectsInit", [&] { init_struct(defects, struct_size, defects_defaults(), "defects"); });
}

CLSP_API ClspStatus clspDoePatternDescInit(ClspDoePatternDesc *desc, uint32_t struct_size) {
    return guarded("clspDoePatternDescInit", [&] { init_struct(desc, struct_size, doe_defaults(), "desc"); });
}

CLSP_API ClspStatus clspDoePatternCreate(ClspContext context, const ClspDoePatternDesc *desc, ClspDoePattern *pattern) {
    return guarded("clspDoePatternCreate", [&] {
        const auto c = object(context);
        required(pattern, "pattern");
        give(pattern, make_doe_pattern(c, doe_parameters(desc)));
    });
}

CLSP_API ClspStatus clspSpotPatternDescInit(ClspSpotPatternDesc *desc, uint32_t struct_size) {
    return guarded("clspSpotPatternDescInit", [&] { init_struct(desc, struct_size, spot_defaults(), "desc"); });
}

CLSP_API ClspStatus clspSpotPatternCreate(ClspContext context, const ClspSpotPatternDesc *desc,
                                          ClspDoePattern *pattern) {
    return guarded("clspSpotPatternCreate", [&] {
        object(context); // what cannot be used is refused here as everywhere
        required(pattern, "pattern");
        const ClspSpotPatternDesc d = read_struct(desc, spot_defaults(), "desc");
        check_reserved(d.reserved, "desc->reserved");
        SpotPatternParameters p;
        p.count = d.count;
        p.directions = d.directions;
        p.powers = d.powers;
        p.beam = beam_parameters(d.beam);
        p.wavelength_m = d.wavelength_m;
        p.power_w = d.power_w;
        p.image_width = d.image_width;
        p.image_height = d.image_height;
        p.half_extent_x = d.half_extent_x;
        p.half_extent_y = d.half_extent_y;
        give(pattern, make_spot_pattern(p));
    });
}

CLSP_API ClspStatus clspDoePatternRetain(ClspDoePattern pattern) {
    return guarded("clspDoePatternRetain", [&] { HandleTable<ClspDoePattern>::instance().retain(pattern); });
}

CLSP_API ClspStatus clspDoePatternRelease(ClspDoePattern pattern) {
    return guarded("clspDoePatternRelease", [&] { HandleTable<ClspDoePattern>::instance().release(pattern); });
}

CLSP_API ClspStatus clspDoePatternGetInfo(ClspDoePattern pattern, ClspDoePatternInfo *info) {
    return guarded("clspDoePatternGetInfo", [&] {
        const auto p = object(pattern);
        required(info, "info");
        const DoePatternBooks &b = p->result().books;
        ClspDoePatternInfo i{};
        i.source = static_cast<std::uint32_t>(p->source());
        i.image_width = b.image_width;
        i.image_height = b.image_height;
        i.half_extent_x = b.half_extent_x;
        i.half_extent_y = b.half_extent_y;
        i.power_w = b.power_w;
        i.dots = b.dots;
        i.zero_order = b.zero_order;
        i.ghosts = b.ghosts;
        i.scatter = b.scatter;
        i.inside_image = b.inside_image;
        i.uniformity_rms = b.uniformity_rms;
        i.divergence_x_rad = b.divergence_x_rad;
        i.divergence_y_rad = b.divergence_y_rad;
        i.m_squared = b.m_squared;
        i.order_spacing_x = b.order_spacing_x;
        i.order_spacing_y = b.order_spacing_y;
        i.dot_count = p->result().dot_shares.size();
        i.device_memory_bytes = b.device_memory_bytes;
        write_struct(*info, i, "info");
    });
}

CLSP_API ClspStatus clspDoePatternGetTexels(ClspDoePattern pattern, uint64_t count, float *texels) {
    return guarded("clspDoePatternGetTexels",
                   [&] { copy_out(object(pattern)->result().texels, count, texels, "texels", "texels"); });
}

CLSP_API ClspStatus clspDoePatternGetDotShares(ClspDoePattern pattern, uint64_t count, double *shares) {
    return guarded("clspDoePatternGetDotShares",
                   [&] { copy_out(object(pattern)->result().dot_shares, count, shares, "shares", "wanted dots"); });
}

} // extern "C"

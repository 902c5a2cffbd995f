#include "clspeckle/doe.h"

#include "convert.hpp"
#include "doe/doe_pattern.hpp"
#include "fields.hpp"
#include "handles.hpp"
#include "progress.hpp"

#include <algorithm>

using namespace clsp;
using namespace clsp::capi;

namespace clsp::capi {

CLSP_ENUM(BeamKind, kImage, CLSP_BEAM_GAUSSIAN, CLSP_BEAM_FLAT_CIRCLE, CLSP_BEAM_FLAT_SQUARE, CLSP_BEAM_SUPER_GAUSSIAN,
          CLSP_BEAM_SKEWED, CLSP_BEAM_IMAGE)
CLSP_ENUM(DoeEvaluation, kAperture, CLSP_DOE_EVALUATION_AUTO, CLSP_DOE_EVALUATION_ORDERS, CLSP_DOE_EVALUATION_APERTURE)

} // namespace clsp::capi

namespace {

static_assert(CLSP_MAX_DOE_SAMPLES == kMaxDoeSide && CLSP_MAX_DOE_LINES == kMaxDoeLines,
              "the engine's limits and the API's must agree");

constexpr auto kBeamFields = [](auto field, auto &d, auto &p) {
    field(d.kind, p.kind, "beam->kind");
    field(d.covariance_xx_m2, p.covariance_xx_m2);
    field(d.covariance_xy_m2, p.covariance_xy_m2);
    field(d.covariance_yy_m2, p.covariance_yy_m2);
    field(d.width_m, p.width_m);
    field(d.height_m, p.height_m);
    field(d.order, p.order);
    field(d.skew_x, p.skew_x);
    field(d.skew_y, p.skew_y);
    field(d.m_squared, p.m_squared);
    field(d.image_width, p.image_width);
    field(d.image_height, p.image_height);
    field(d.image, p.image);
    field(d.image_pitch_bytes, p.image_pitch_bytes);
};

ClspBeamProfile beam_defaults() {
    return to_c<ClspBeamProfile>(kBeamFields, BeamParameters());
}

constexpr auto kDefectsFields = [](auto field, auto &d, auto &p) {
    field(d.levels, p.levels);
    field(d.relative_depth_error, p.relative_depth_error);
    field(d.rounding_sigma_m, p.rounding_sigma_m);
    field(d.etch_noise_rms_m, p.etch_noise_rms_m);
    field(d.refractive_index, p.refractive_index);
    field(d.dispersion_per_m, p.dispersion_per_m);
    field(d.seed, p.seed);
    field(d.feature_samples, p.feature_samples);
};

ClspDoeDefects defects_defaults() {
    return to_c<ClspDoeDefects>(kDefectsFields, DoeDefects());
}

constexpr auto kImageFields = [](auto field, auto &d, auto &p) {
    field(d.wavelength_m, p.wavelength_m);
    field(d.power_w, p.power_w);
    field(d.image_width, p.image_width);
    field(d.image_height, p.image_height);
    field(d.half_extent_x, p.half_extent_x);
    field(d.half_extent_y, p.half_extent_y);
};

constexpr auto kDoeFields = [](auto field, auto &d, auto &p) {
    kImageFields(field, d, p);
    field(d.width, p.width);
    field(d.height, p.height);
    field(d.periodic, p.periodic, "desc->periodic");
    field(d.phase, p.phase);
    field(d.phase_pitch_bytes, p.phase_pitch_bytes);
    field(d.pixel_pitch_m, p.pixel_pitch_m);
    field(d.dot_count, p.dot_count);
    field(d.dot_orders, p.dot_orders);
    field(d.dot_directions, p.dot_directions);
    field(d.dot_weights, p.dot_weights);
    field(d.design_levels, p.design_levels);
    field(d.evaluation, p.evaluation, "desc->evaluation");
    field(d.line_count, p.line_count);
    field(d.oversampling, p.oversampling);
    field(d.line_wavelengths_m, p.line_wavelengths_m);
    field(d.line_powers, p.line_powers);
    field(d.doe_width_m, p.doe_width_m);
    field(d.doe_height_m, p.doe_height_m);
    field(d.pixel_envelope, p.pixel_envelope, "desc->pixel_envelope");
    field(d.max_memory_bytes, p.max_memory_bytes);
};

ClspDoePatternDesc doe_defaults() {
    return to_c<ClspDoePatternDesc>(kDoeFields, DoePatternParameters());
}

constexpr auto kSpotFields = [](auto field, auto &d, auto &p) {
    kImageFields(field, d, p);
    field(d.count, p.count);
    field(d.directions, p.directions);
    field(d.powers, p.powers);
};

ClspSpotPatternDesc spot_defaults() {
    return to_c<ClspSpotPatternDesc>(kSpotFields, SpotPatternParameters());
}

BeamParameters beam_parameters(const ClspBeamProfile *user) {
    return user ? from_c<BeamParameters>(kBeamFields, read_struct(user, beam_defaults(), "beam")) : BeamParameters();
}

DoeDefects doe_defects(const ClspDoeDefects *user) {
    const ClspDoeDefects d = user ? read_struct(user, defects_defaults(), "defects") : defects_defaults();
    check_reserved(d.reserved, "defects->reserved");
    return from_c<DoeDefects>(kDefectsFields, d);
}

DoePatternParameters doe_parameters(const ClspDoePatternDesc *user) {
    const ClspDoePatternDesc d = read_struct(user, doe_defaults(), "desc");
    check_reserved(d.reserved, "desc->reserved");
    auto p = from_c<DoePatternParameters>(kDoeFields, d);
    p.beam = beam_parameters(d.beam);
    p.defects = doe_defects(d.defects);
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

CLSP_INIT(BeamProfile, beam, beam_defaults())

CLSP_INIT(DoeDefects, defects, defects_defaults())

CLSP_INIT(DoePatternDesc, desc, doe_defaults())

CLSP_API ClspStatus clspDoePatternCreate(ClspContext context, const ClspDoePatternDesc *desc, ClspDoePattern *pattern) {
    return guarded("clspDoePatternCreate", [&] {
        const auto c = object(context);
        required(pattern, "pattern");
        give(pattern, make_doe_pattern(c, doe_parameters(desc)));
    });
}

CLSP_INIT(SpotPatternDesc, desc, spot_defaults())

CLSP_API ClspStatus clspSpotPatternCreate(ClspContext context, const ClspSpotPatternDesc *desc,
                                          ClspDoePattern *pattern) {
    return guarded("clspSpotPatternCreate", [&] {
        object(context); // what cannot be used is refused here as everywhere
        required(pattern, "pattern");
        const ClspSpotPatternDesc d = read_struct(desc, spot_defaults(), "desc");
        check_reserved(d.reserved, "desc->reserved");
        auto p = from_c<SpotPatternParameters>(kSpotFields, d);
        p.beam = beam_parameters(d.beam);
        give(pattern, make_spot_pattern(p));
    });
}

CLSP_REFERENCES(DoePattern)

CLSP_API ClspStatus clspDoePatternGetInfo(ClspDoePattern pattern, ClspDoePatternInfo *info) {
    return guarded("clspDoePatternGetInfo", [&] {
        const auto p = object(pattern);
        required(info, "info");
        const DoePowerBudget &b = p->result().budget;
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

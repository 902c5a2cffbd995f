#include "depth/depth.hpp"

#include "convert.hpp"
#include "fields.hpp"
#include "handles.hpp"

#include <algorithm>
#include <cstdint>
#include <limits>

using namespace clsp;
using namespace clsp::capi;

namespace clsp::capi {

CLSP_ENUM(DirectionKind, kDirectionCosines, CLSP_PROJECTION_TANGENT_PLANE, CLSP_PROJECTION_DIRECTION_COSINES)

} // namespace clsp::capi

namespace {

static_assert(CLSP_MAX_DIRECTIONS == kMaxDirections && CLSP_NO_DOT == kNoDot,
              "the engine's limits and the API's must agree");
static_assert(CLSP_DOT_SATURATED == kDotSaturated && CLSP_DOT_BORDER == kDotBorder && CLSP_DOT_MERGED == kDotMerged &&
                  CLSP_DOT_FIT_FAILED == kDotFitFailed && CLSP_DOT_FIXED_SHAPE == kDotFixedShape,
              "kDot* and CLSP_DOT_* must agree");
static_assert(CLSP_DEPTH_REASON_PLACED == std::uint32_t(DepthReason::kPlaced) &&
                  CLSP_DEPTH_REASON_FIT_FAILED == std::uint32_t(DepthReason::kFitFailed) &&
                  CLSP_DEPTH_REASON_NO_CANDIDATE == std::uint32_t(DepthReason::kNoCandidate) &&
                  CLSP_DEPTH_REASON_UNSUPPORTED == std::uint32_t(DepthReason::kUnsupported) &&
                  CLSP_DEPTH_REASON_AMBIGUOUS == std::uint32_t(DepthReason::kAmbiguous) &&
                  CLSP_DEPTH_REASON_CONFLICT == std::uint32_t(DepthReason::kConflict) &&
                  CLSP_DEPTH_REASON_OUT_OF_VIEW == std::uint32_t(DepthReason::kOutOfView) &&
                  CLSP_DEPTH_REASON_NOT_SEEN == std::uint32_t(DepthReason::kNotSeen),
              "DepthReason and CLSP_DEPTH_REASON_* must agree");
static_assert(CLSP_DEPTH_WARNING_NO_DOTS == kWarningNoDots && CLSP_DEPTH_WARNING_FEW_PLACED == kWarningFewPlaced &&
                  CLSP_DEPTH_WARNING_EPIPOLAR == kWarningEpipolar &&
                  CLSP_DEPTH_WARNING_SATURATED == kWarningSaturated && CLSP_DEPTH_WARNING_MERGED == kWarningMerged,
              "kWarning* and CLSP_DEPTH_WARNING_* must agree");
static_assert(sizeof(ClspDepthDot) == 232 && sizeof(ClspDepthPatternDot) == 8, "frozen");

constexpr auto kDepthFields = [](auto field, auto &d, auto &p) {
    field(d.width, p.detector.width);
    field(d.height, p.detector.height);
    field(d.max_dots, p.detector.max_dots);
    field(d.dot_sigma_px, p.detector.dot_sigma_px);
    field(d.read_noise_dn, p.detector.read_noise_dn);
    field(d.dn_per_electron, p.detector.dn_per_electron);
    field(d.black_level_dn, p.detector.black_level_dn);
    field(d.saturation_dn, p.detector.saturation_dn);
    field(d.min_amplitude_dn, p.detector.min_amplitude_dn);
    field(d.threshold_sigmas, p.detector.threshold_sigmas);
    field(d.min_correlation, p.detector.min_correlation);
    field(d.relative_diameter, p.detector.relative_diameter);
    field(d.speckle_contrast, p.detector.speckle_contrast);
    field(d.epipolar_tolerance_px, p.identification.epipolar_tolerance_px);
    field(d.min_confidence, p.identification.min_confidence);
    field(d.projection, p.geometry.directions, "desc->projection");
    field(d.laser_from_camera, p.geometry.laser_from_camera);
    field(d.fx_px, p.geometry.fx_px);
    field(d.fy_px, p.geometry.fy_px);
    field(d.cx_px, p.geometry.cx_px);
    field(d.cy_px, p.geometry.cy_px);
    field(d.near_m, p.geometry.near_m);
    field(d.far_m, p.geometry.far_m);
    field(d.direction_count, p.direction_count);
    field(d.directions, p.directions);
};

ClspDepthDesc depth_defaults() {
    return to_c<ClspDepthDesc>(kDepthFields, DepthParameters());
}

DepthParameters depth_parameters(const ClspDepthDesc *user) {
    const ClspDepthDesc d = read_struct(user, depth_defaults(), "desc");
    check_reserved(d.reserved, "desc->reserved");
    return from_c<DepthParameters>(kDepthFields, d);
}

template <std::size_t count> void assign(double (&to)[count], const std::array<double, count> &from) {
    std::copy(from.begin(), from.end(), to);
}

ClspDepthDot public_dot(const DepthDot &dot) {
    const DetectedDot &d = dot.detected;
    const Identity &identity = dot.identity;
    const bool known = identity.dot != kNoDot;
    const double nan = std::numeric_limits<double>::quiet_NaN();
    ClspDepthDot result{};
    result.x_px = d.x;
    result.y_px = d.y;
    assign(result.covariance_px2, d.covariance);
    result.centroid_x_px = d.centroid_x;
    result.centroid_y_px = d.centroid_y;
    result.amplitude_dn = d.amplitude;
    result.amplitude_sd_dn = d.amplitude_sd;
    result.background_dn = d.background;
    assign(result.shape_px2, d.shape);
    result.correlation = d.correlation;
    result.misfit = d.misfit;
    result.depth_m = dot.depth_m;
    result.depth_sd_m = dot.depth_sd_m;
    assign(result.position_m, dot.position_m);
    assign(result.position_sd_m, dot.position_sd_m);
    result.epipolar_error_px = known ? identity.place.error : nan;
    result.epipolar_sd_px = known ? identity.place.error_sd : nan;
    result.confidence = identity.confidence;
    result.flags = d.flags;
    result.reason = static_cast<std::uint32_t>(identity.reason);
    result.dot_index = identity.dot;
    result.candidate_count = identity.candidates;
    result.iterations = d.iterations;
    return result;
}

ClspDepthSummary public_summary(const DepthSummary &s) {
    ClspDepthSummary result{};
    result.warnings = s.warnings;
    result.detected_count = s.detected;
    result.fitted_count = s.fitted;
    result.placed_count = s.placed;
    result.saturated_count = s.saturated;
    result.merged_count = s.merged;
    result.pattern_in_view_count = s.in_view;
    result.median_epipolar_error_px = s.median_epipolar_error_px;
    result.expected_epipolar_error_px = s.expected_epipolar_error_px;
    result.median_sigma_px = s.median_sigma_px;
    result.median_centre_sd_px = s.median_centre_sd_px;
    return result;
}

// An array of the caller's that is as long as he says.
template <typename T> void check_room(std::uint64_t capacity, const T *dots) {
    if (capacity > 0 && !dots)
        throw Error(Status::kInvalidArgument,
                    fmt::format("dots is NULL but capacity is {}; give room for so many dots, or 0", capacity));
}

} // namespace

extern "C" {

CLSP_INIT(DepthDesc, desc, depth_defaults())

CLSP_API ClspStatus clspDepthCreate(ClspContext context, const ClspDepthDesc *desc, ClspDepth *depth) {
    return guarded("clspDepthCreate", [&] {
        const auto c = object(context);
        required(depth, "depth");
        give(depth, std::make_shared<Depth>(c, depth_parameters(desc)));
    });
}

CLSP_REFERENCES(Depth)

CLSP_API ClspStatus clspDepthEnqueueDetect(ClspDepth depth, cl_command_queue queue, const ClspImage *image,
                                           uint32_t num_events_in_wait_list, const cl_event *event_wait_list,
                                           cl_event *event) {
    return guarded("clspDepthEnqueueDetect", [&] {
        const auto d = object(depth);
        const Context &context = *d->context();
        const DotDetectorParameters &p = d->detector_parameters();
        const ImageView view = check_image(description(image, "image"), "image", context.cl_context()(),
                                           {p.width, p.height}, {Format::kUint8, Format::kUint16, Format::kFloat32});
        enqueue(context, queue, num_events_in_wait_list, event_wait_list, event,
                [&](CommandChain &chain) { d->enqueue_detect(chain, view); });
    });
}

CLSP_API ClspStatus clspDepthGetDots(ClspDepth depth, cl_command_queue queue, uint64_t capacity, ClspDepthDot *dots,
                                     uint64_t *count, ClspDepthSummary *summary) {
    return guarded("clspDepthGetDots", [&] {
        const auto d = object(depth);
        check_room(capacity, dots);
        std::uint64_t &number = required(count, "count");
        if (summary)
            check_struct_size(summary->struct_size, kFirstSize<ClspDepthSummary>, "summary");
        d->context()->check_queue(queue);
        const DepthResult &result = d->result(queue);
        for (std::uint64_t i = 0; i < std::min<std::uint64_t>(capacity, result.dots.size()); ++i)
            dots[i] = public_dot(result.dots[i]);
        if (summary)
            write_struct(*summary, public_summary(result.summary), "summary");
        number = result.dots.size();
    });
}

CLSP_API ClspStatus clspDepthGetPatternDots(ClspDepth depth, uint64_t capacity, ClspDepthPatternDot *dots,
                                            uint64_t *count) {
    return guarded("clspDepthGetPatternDots", [&] {
        const auto d = object(depth);
        check_room(capacity, dots);
        std::uint64_t &number = required(count, "count");
        const DepthResult &result = d->result(nullptr);
        for (std::uint64_t i = 0; i < std::min<std::uint64_t>(capacity, result.pattern.size()); ++i)
            dots[i] = {static_cast<std::uint32_t>(result.pattern[i].reason), result.pattern[i].detected};
        number = result.pattern.size();
    });
}

CLSP_API const char *clspDepthReasonString(uint32_t reason) {
    switch (reason) {
    case CLSP_DEPTH_REASON_PLACED:
        return "placed";
    case CLSP_DEPTH_REASON_FIT_FAILED:
        return "no Gaussian fits it";
    case CLSP_DEPTH_REASON_NO_CANDIDATE:
        return "no dot of the pattern can appear there";
    case CLSP_DEPTH_REASON_UNSUPPORTED:
        return "its neighbours speak against all of its candidates";
    case CLSP_DEPTH_REASON_AMBIGUOUS:
        return "several candidates are about as likely";
    case CLSP_DEPTH_REASON_CONFLICT:
        return "a likelier detected dot has its place";
    case CLSP_DEPTH_REASON_OUT_OF_VIEW:
        return "the camera cannot see it in the range of depth";
    case CLSP_DEPTH_REASON_NOT_SEEN:
        return "no detected dot is it";
    default:
        return "unknown reason";
    }
}

CLSP_API const char *clspDepthWarningString(uint32_t warning) {
    switch (warning) {
    case CLSP_DEPTH_WARNING_NO_DOTS:
        return "the frame has no dots; check the exposure, dot_sigma_px, min_amplitude_dn and the noise";
    case CLSP_DEPTH_WARNING_FEW_PLACED:
        return "fewer than half of the dots were placed; check the geometry, the list of dots and the range of depth";
    case CLSP_DEPTH_WARNING_EPIPOLAR:
        return "the dots lie beside their lines by more than their standard deviations explain, and depths err "
               "likewise; "
               "check laser_from_camera, the intrinsics, the distortion, and that relative_diameter and "
               "speckle_contrast are those of the lens and the light";
    case CLSP_DEPTH_WARNING_SATURATED:
        return "more than a tenth of the dots are saturated; shorten the exposure";
    case CLSP_DEPTH_WARNING_MERGED:
        return "more than a fifth of the dots are merged; check dot_sigma_px and the focus";
    default:
        return "unknown warning";
    }
}

} // extern "C"

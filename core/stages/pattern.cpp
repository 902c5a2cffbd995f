#include "stages/pattern.hpp"

#include "runtime/checks.hpp"
#include "runtime/error.hpp"
#include "fft/cpu/lanes.hpp"
#include "runtime/kernel_arguments.hpp"
#include "stages/pose.hpp"

#include <cmath>
#include <cstring>
#include <fmt/core.h>
#include <vector>

namespace clsp {
namespace {

constexpr std::uint32_t kMaxFilterTaps = 4;

// A summed-area table in integers, whose differences are exact however large the sums.
struct AreaTable {
    std::vector<cl_uint> sums; // (width + 1) x (height + 1): the texels before an edge, in units
    double unit = 0;
};

// All texels together; below 2^32 by more than what the rounding of 16384 rows can add.
constexpr double kAreaTotal = 4.29e9;

AreaTable make_area_table(const std::vector<float> &texels, std::size_t width, std::size_t height) {
    double total = 0;
    for (const float texel : texels)
        total += texel;
    AreaTable table;
    table.unit = total > 0 ? total / kAreaTotal : 1.0;
    table.sums.assign((width + 1) * (height + 1), 0);
    for (std::size_t y = 0; y < height; ++y) {
        // What rounding takes from a texel the next one gets: dim light that is less than a unit per texel is not lost.
        double rest = 0;
        cl_uint row = 0;
        for (std::size_t x = 0; x < width; ++x) {
            rest += double(texels[y * width + x]) / table.unit;
            const double whole = std::floor(rest + 0.5);
            rest -= whole;
            row += static_cast<cl_uint>(whole);
            table.sums[(y + 1) * (width + 1) + x + 1] = table.sums[y * (width + 1) + x + 1] + row;
        }
    }
    return table;
}

} // namespace

Pattern::Pattern(std::shared_ptr<Context> context, const PatternParameters &p)
    : context_(std::move(context)), projection_(p.projection), quantity_(p.quantity), filter_(p.filter),
      filter_taps_(p.filter_taps), width_(static_cast<cl_int>(p.width)), height_(static_cast<cl_int>(p.height)),
      bad_pixels_(context_) {
    if (p.width < 2 || p.height < 2 || p.width > kMaxImageSide || p.height > kMaxImageSide)
        throw Error(Status::kInvalidArgument,
                    fmt::format("the pattern is {} x {} texels (width x height); each side must be 2 to {}", p.width,
                                p.height, kMaxImageSide));
    if (p.filter_taps < 1 || p.filter_taps > kMaxFilterTaps)
        throw Error(Status::kInvalidArgument,
                    fmt::format("filter_taps is {}, it must be 1 to {}", p.filter_taps, kMaxFilterTaps));
    check_positive(p.half_extent_x, "half_extent_x");
    check_positive(p.half_extent_y, "half_extent_y");
    if (p.projection == Projection::kDirectionCosines && (p.half_extent_x > 1.0 || p.half_extent_y > 1.0))
        throw Error(Status::kInvalidArgument,
                    "half_extent_x and half_extent_y are direction cosines here and cannot exceed 1");
    check_not_negative(p.power_scale, "power_scale");
    extent_ = {{static_cast<float>(p.half_extent_x), static_cast<float>(p.half_extent_y),
                static_cast<float>(p.power_scale), 0.0f}};
    in_lanes_ = filter_ == PatternFilter::kBilinear && works_in_lanes(*context_);
    set_pose(p.laser_from_geometry);
    const auto good = [](float value) { return value >= 0.0f && std::isfinite(value); };
    const std::vector<float> texels =
        copy_host_image({p.texels, p.width, p.height, p.texels_pitch_bytes, "texels", "texels_pitch_bytes"}, good,
                        "pattern values must be finite and not negative");
    if (filter_ == PatternFilter::kArea) {
        const AreaTable table = make_area_table(texels, p.width, p.height);
        texels_ = DeviceBuffer(context_, table.sums.size() * sizeof(cl_uint), table.sums.data());
        extent_.s[3] = static_cast<float>(table.unit);
    } else {
        texels_ = DeviceBuffer(context_, texels.size() * sizeof(float), texels.data());
    }
}

void Pattern::set_pose(const Pose &pose) {
    check_pose(pose.data(), "laser_from_geometry");
    for (std::size_t i = 0; i < pose.size(); ++i)
        pose_.s[i] = static_cast<float>(pose[i]);
}

cl::Kernel &Pattern::kernel_for(const InputSet &inputs) {
    const auto found = kernels_.find(inputs);
    if (found != kernels_.end())
        return found->second;
    const auto [position, depth_along_ray, normal, albedo, visibility] = inputs;
    const std::string options =
        fmt::format("-DDIRECTION_COSINES={} -DPLANE_IRRADIANCE={} -DHAS_POSITION={} -DDEPTH_ALONG_RAY={} "
                    "-DHAS_NORMAL={} -DHAS_ALBEDO={} "
                    "-DVISIBILITY_FORMAT={} -DAREA_FILTER={} -DFILTER_TAPS={}",
                    projection_ == Projection::kDirectionCosines ? 1 : 0,
                    quantity_ == PatternQuantity::kPlaneIrradiance ? 1 : 0, position ? 1 : 0, depth_along_ray ? 1 : 0,
                    normal ? 1 : 0, albedo ? 1 : 0, static_cast<std::uint32_t>(visibility),
                    filter_ == PatternFilter::kArea ? 1 : 0, filter_taps_);
    cl::Kernel kernel = in_lanes_ ? context_->kernel("stages/pattern_lanes.cl", "pattern_lookup_lanes",
                                                     fmt::format("{} -DLANES={}", options, simd_lanes(*context_)))
                                  : context_->kernel("stages/pattern.cl", "pattern_lookup", options);
    return kernels_.emplace(inputs, std::move(kernel)).first->second;
}

Pattern::Inputs Pattern::check_inputs(const Geometry &g, const ImageView &irradiance) const {
    const ::cl_context cl_context = context_->cl_context()();
    const ImageSize size{irradiance.width, irradiance.height};
    check_writable(irradiance, "irradiance");
    if (static_cast<bool>(g.position) == static_cast<bool>(g.depth))
        throw Error(Status::kInvalidArgument, g.position
                                                  ? "geometry has both position and depth; give one of them"
                                                  : "geometry has neither position nor depth; one of them is needed");
    Inputs in;
    const auto take = [&](const ImageDescription &image, const char *name, std::initializer_list<Format> formats) {
        const ImageView view = check_image(image, name, cl_context, size, formats);
        refuse_overlap(irradiance, "irradiance", view, name);
        return view;
    };
    if (g.position) {
        in.position = take(g.position, "geometry.position", {Format::kFloat32x3, Format::kFloat32x4});
    } else {
        in.depth = take(g.depth, "geometry.depth", {Format::kFloat32});
        check_positive(g.fx_px, "geometry.fx_px");
        check_positive(g.fy_px, "geometry.fy_px");
        if (!std::isfinite(g.cx_px) || !std::isfinite(g.cy_px))
            throw Error(Status::kInvalidArgument, "geometry.cx_px and cy_px must be finite");
    }
    if (g.normal)
        in.normal = take(g.normal, "geometry.normal", {Format::kFloat32x3, Format::kFloat32x4});
    if (g.albedo)
        in.albedo = take(g.albedo, "geometry.albedo", {Format::kFloat32});
    if (g.visibility)
        in.visibility = take(g.visibility, "geometry.visibility", {Format::kFloat32, Format::kUint8});
    in.set = {static_cast<bool>(in.position), g.depth_kind == DepthKind::kAlongRay, static_cast<bool>(in.normal),
              static_cast<bool>(in.albedo), in.visibility.format};
    return in;
}

void Pattern::check_lookup(const Geometry &geometry, const ImageView &irradiance) {
    kernel_for(check_inputs(geometry, irradiance).set);
}

void Pattern::enqueue_lookup(CommandChain &chain, const Geometry &g, const ImageView &irradiance) {
    const Inputs in = check_inputs(g, irradiance);
    const ImageSize size{irradiance.width, irradiance.height};
    cl::Kernel &kernel = kernel_for(in.set);
    KernelArguments arguments(kernel);
    arguments.add(texels_.get()).add(width_).add(height_).add(extent_).add(pose_);
    arguments.add(cl_uint{size.width}).add(cl_uint{size.height});
    if (in.position)
        arguments.add(in.position).add(cl_uint{component_count(in.position.format)});
    else
        arguments.add(in.depth).add(cl_float4{{static_cast<float>(g.fx_px), static_cast<float>(g.fy_px),
                                               static_cast<float>(g.cx_px), static_cast<float>(g.cy_px)}});
    if (in.normal)
        arguments.add(in.normal).add(cl_uint{component_count(in.normal.format)});
    if (in.albedo)
        arguments.add(in.albedo);
    if (in.visibility)
        arguments.add(in.visibility);
    arguments.add(irradiance).add(bad_pixels_.buffer());
    if (in_lanes_)
        chain.run("pattern", kernel, size.height, 1, 1, 1);
    else
        chain.run("pattern", kernel, size.width, size.height);
}

} // namespace clsp

// The projected pattern looked up per pixel. The equations are in pattern.h of the C API.
#pragma once

#include "runtime/command_chain.hpp"
#include "runtime/device_buffer.hpp"
#include "runtime/image_view.hpp"
#include "stages/bad_pixels.hpp"

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <tuple>

namespace clsp {

enum class Projection : std::uint32_t { kTangentPlane = 0, kDirectionCosines = 1 };
enum class PatternQuantity : std::uint32_t { kRadiantIntensity = 0, kPlaneIrradiance = 1 };
enum class PatternFilter : std::uint32_t { kBilinear = 0, kArea = 1 };
enum class DepthKind : std::uint32_t { kAlongAxis = 0, kAlongRay = 1 };

using Pose = std::array<double, 12>; // [R|t], row-major

struct PatternParameters {
    Projection projection = Projection::kTangentPlane;
    PatternQuantity quantity = PatternQuantity::kRadiantIntensity;
    std::uint32_t width = 0, height = 0;
    const float *texels = nullptr; // host memory, only read during construction
    std::uint64_t texels_pitch_bytes = 0;
    double half_extent_x = 0.5, half_extent_y = 0.5;
    double power_scale = 1.0;
    Pose laser_from_geometry{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
    PatternFilter filter = PatternFilter::kBilinear;
    std::uint32_t filter_taps = 1;
};

struct Geometry {
    DepthKind depth_kind = DepthKind::kAlongAxis;
    ImageDescription position, depth, normal, albedo, visibility;
    double fx_px = 0, fy_px = 0, cx_px = 0, cy_px = 0;
};

class Pattern {
  public:
    Pattern(std::shared_ptr<Context> context, const PatternParameters &parameters);

    const std::shared_ptr<Context> &context() const { return context_; }
    void set_pose(const Pose &laser_from_geometry);
    BadPixelCounter &bad_pixels() { return bad_pixels_; }

    // Checks the images, and builds the kernel that they need.
    void check_lookup(const Geometry &geometry, const ImageView &irradiance);
    void enqueue_lookup(CommandChain &chain, const Geometry &geometry, const ImageView &irradiance);

  private:
    // Which inputs a frame has, and so which variant of the kernel it needs: position (else depth), depth along the
    // ray, normal, albedo, format of the visibility.
    using InputSet = std::tuple<bool, bool, bool, bool, Format>;
    struct Inputs {
        ImageView position, depth, normal, albedo, visibility;
        InputSet set;
    };
    Inputs check_inputs(const Geometry &geometry, const ImageView &irradiance) const;
    cl::Kernel &kernel_for(const InputSet &inputs);

    std::shared_ptr<Context> context_;
    Projection projection_;
    PatternQuantity quantity_;
    PatternFilter filter_;
    std::uint32_t filter_taps_;
    bool in_lanes_ = false; // whether lookups go in vectors, a row in a work-item
    cl_int width_, height_;
    cl_float4 extent_;
    cl_float16 pose_{};
    DeviceBuffer texels_; // with an area filter: their summed-area table
    BadPixelCounter bad_pixels_;
    std::map<InputSet, cl::Kernel> kernels_;
};

} // namespace clsp

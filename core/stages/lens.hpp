// What a lens does beside diffraction: distortion, glare, ambient light, vignetting. The equations are in lens.h of the
// C API.
#pragma once

#include "runtime/command_chain.hpp"
#include "runtime/device_buffer.hpp"
#include "runtime/fields.hpp"
#include "runtime/image_view.hpp"
#include "stages/filter.hpp"

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

namespace clsp {

enum class RadiusUnit : std::uint32_t { kCorner = 0, kFocalLength = 1 };
enum class Interpolation : std::uint32_t { kNearest = 0, kLinear = 1, kCubic = 2 };

struct LensParameters {
    std::uint32_t width = 0, height = 0;
    RadiusUnit radius_unit = RadiusUnit::kCorner;
    bool cos4_falloff = false;
    bool principal_point_given = false; // else it is the image's centre ((w - 1)/2, (h - 1)/2)
    double principal_point_x_px = 0.0, principal_point_y_px = 0.0;
    double focal_length_x_px = 0.0, focal_length_y_px = 0.0; // 0: not given
    double k1 = 0.0, k2 = 0.0, k3 = 0.0, p1 = 0.0, p2 = 0.0;
    double vignetting_corner_loss = 0.0;
    double glare_fraction = 0.0, glare_scale_px = 6.0;
    double ambient = 0.0;
};
CLSP_EQUALITY(LensParameters, width, height, radius_unit, cos4_falloff, principal_point_given, principal_point_x_px,
              principal_point_y_px, focal_length_x_px, focal_length_y_px, k1, k2, k3, p1, p2, vignetting_corner_loss,
              glare_fraction, glare_scale_px, ambient)

// Brown and Conrady's distortion of points, in double precision and in pixels.
class Distortion {
  public:
    struct Point {
        double x, y;
    };
    // The parameters must have been checked.
    explicit Distortion(const LensParameters &parameters);

    double principal_x() const { return principal_x_; }
    double principal_y() const { return principal_y_; }
    // Pixels from the principal point to the farthest corner pixel's centre; 1 if there is but one pixel.
    double corner_px() const { return corner_px_; }
    bool identity() const { return identity_; }

    // Where an ideal point is imaged, and back. Nothing where the lens images no such point: beyond the radius at which
    // the distortion turns back (or where the tangential terms fold the plane).
    std::optional<Point> distort(Point ideal) const;
    std::optional<Point> undistort(Point distorted) const;
    // For each pixel of an image by how much its ideal point is moved, x and y, rows one after the other. Throws
    // kInvalidArgument where the lens images no point.
    std::vector<float> displacements(std::uint32_t width, std::uint32_t height) const;

  private:
    struct Jacobian {
        double xx, xy, yy; // symmetric: the distortion is a gradient
    };
    double radial(double s) const { return 1.0 + s * (k1_ + s * (k2_ + s * k3_)); }
    double radial_slope(double s) const { return 1.0 + s * (3.0 * k1_ + s * (5.0 * k2_ + s * 7.0 * k3_)); }
    Point forward(Point p) const;
    Jacobian jacobian(Point p) const;
    bool unfolded(Point p) const;
    std::optional<double> undistorted_radius(double distorted) const;
    // Without tangential terms: ideal over distorted radius of a row of pixels at distances u2^0.5 along it. shrink:
    // any guess, for example that of the row before. False where it cannot be told so.
    bool shrink_row(const std::vector<double> &u2, double v2, std::vector<double> &shrink) const;

    double principal_x_, principal_y_, corner_px_;
    double unit_x_, unit_y_; // pixels
    double k1_, k2_, k3_, p1_, p2_;
    bool identity_;
    double fold_; // squared radius at which the distortion turns back; infinity if it does not
};

// What the lens lets through: 1 - corner_loss r^2, r = 1 in the farthest corner; never below 0. As
// kernels/stages/vignetting.h has it.
class Vignetting {
  public:
    explicit Vignetting(const LensParameters &parameters);
    // In double precision, at a pixel.
    double transmission(double x, double y) const;
    cl_float4 kernel_argument() const;

  private:
    double principal_x_, principal_y_, per_corner2_, corner_loss_;
};

class Lens {
  public:
    // keeps_filters: maps and filters that are switched off stay for the next time.
    Lens(std::shared_ptr<Context> context, const LensParameters &parameters, bool keeps_filters = false);

    const std::shared_ptr<Context> &context() const { return context_; }
    const LensParameters &parameters() const { return parameters_; }
    const Distortion &distortion() const { return *distortion_; }
    // Checks, builds programs, maps and filters; after an error the lens is what it was.
    void configure(const LensParameters &parameters);

    // True if enqueue_distort() moves anything.
    bool distorts() const { return !distortion_->identity(); }
    // True if enqueue_finish() changes anything (of a frame that is not dark).
    bool finishes() const;

    // What an image of this format holds as a rule: FLOAT32 is light (cubic), all others are geometry or numbers
    // (nearest).
    static Interpolation usual_interpolation(Format format);
    // Checks images and interpolation against this lens, and makes ready for them.
    void check_distort(const ImageView &ideal, const ImageView &distorted, Interpolation interpolation);
    void enqueue_distort(CommandChain &chain, const ImageView &ideal, const ImageView &distorted,
                         Interpolation interpolation);
    void enqueue_distort(CommandChain &chain, const ImageView &ideal, const ImageView &distorted) {
        enqueue_distort(chain, ideal, distorted, usual_interpolation(ideal.format));
    }
    // Vectors between pixels (FLOAT32X2, in pixels), nearest, and turned and stretched as the lens does it. Only if
    // distorts().
    void check_distort_shift(const ImageView &ideal, const ImageView &distorted);
    void enqueue_distort_shift(CommandChain &chain, const ImageView &ideal, const ImageView &distorted);

    // Throws unless light and out are apart or the same pixels, and out can be written.
    void check_finish(const ImageView &light, const ImageView &out) const;
    // A dark frame (shutter closed) gets no ambient light. Nothing is enqueued if nothing changes.
    void enqueue_finish(CommandChain &chain, const ImageView &light, const ImageView &out, bool is_dark);

  private:
    using Variant = std::pair<Format, Interpolation>;
    cl::Kernel &distort_kernel(Format format, Interpolation interpolation);

    std::shared_ptr<Context> context_;
    bool keeps_filters_;
    LensParameters parameters_;
    std::optional<Distortion> distortion_;
    // Map (float2 a pixel) and filter, and the parameters that they were made of.
    DeviceBuffer displacement_;
    LensParameters displacement_of_, glare_of_;
    std::map<Variant, cl::Kernel> distort_kernels_;
    cl::Kernel distort_shift_; // built on first use
    std::unique_ptr<FftFilter> glare_;
    cl_float4 vignetting_{};
    cl::Kernel finish_;
};

} // namespace clsp

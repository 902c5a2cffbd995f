#include "stages/lens.hpp"

#include "runtime/checks.hpp"
#include "runtime/error.hpp"
#include "runtime/kernel_arguments.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/core.h>
#include <limits>
#include <vector>

namespace clsp {
namespace {

// Pixels; four times the largest image.
constexpr double kFarthestPrincipalPoint = 4.0 * kMaxImageSide;
// Exponentials wider than this are flat over any image.
constexpr double kLargestGlareScale = kMaxImageSide;

void check(const LensParameters &p) {
    check_image_size(p.width, p.height, "the lens's image");
    const auto check_within = [](double value, double limit, const char *name) {
        if (!(std::abs(value) <= limit))
            throw Error(Status::kInvalidArgument,
                        fmt::format("{} is {}, it must be {} to {}", name, value, -limit, limit));
    };
    check_within(p.principal_point_x_px, kFarthestPrincipalPoint, "principal_point_x_px");
    check_within(p.principal_point_y_px, kFarthestPrincipalPoint, "principal_point_y_px");
    if (!p.principal_point_given && (p.principal_point_x_px != 0.0 || p.principal_point_y_px != 0.0))
        throw Error(Status::kInvalidArgument,
                    fmt::format("principal_point_px is ({}, {}), but principal_point_given is 0; set it to 1",
                                p.principal_point_x_px, p.principal_point_y_px));
    check_not_negative(p.focal_length_x_px, "focal_length_x_px");
    check_not_negative(p.focal_length_y_px, "focal_length_y_px");
    if (p.focal_length_x_px == 0.0 || p.focal_length_y_px == 0.0) {
        if (p.radius_unit == RadiusUnit::kFocalLength)
            throw Error(Status::kInvalidArgument, "radius_unit is the focal length, which needs "
                                                  "focal_length_x_px and focal_length_y_px above 0");
        if (p.cos4_falloff)
            throw Error(Status::kInvalidArgument,
                        "cos4_falloff is 1, which needs focal_length_x_px and focal_length_y_px above 0");
    }
    constexpr double kLargestCoefficient = 1e6;
    check_within(p.k1, kLargestCoefficient, "k1");
    check_within(p.k2, kLargestCoefficient, "k2");
    check_within(p.k3, kLargestCoefficient, "k3");
    check_within(p.p1, kLargestCoefficient, "p1");
    check_within(p.p2, kLargestCoefficient, "p2");
    check_fraction(p.vignetting_corner_loss, "vignetting_corner_loss");
    check_fraction(p.glare_fraction, "glare_fraction");
    if (!(p.glare_scale_px > 0.0 && p.glare_scale_px <= kLargestGlareScale))
        throw Error(Status::kInvalidArgument, fmt::format("glare_scale_px is {}, it must be above 0 and at most {}",
                                                          p.glare_scale_px, kLargestGlareScale));
    check_not_negative(p.ambient, "ambient");
}

// What the map of displacements is made of, and what the glare's filter is: all but what surely is not.
LensParameters distorting_part(LensParameters p) {
    p.cos4_falloff = false;
    p.vignetting_corner_loss = p.glare_fraction = p.ambient = 0.0;
    p.glare_scale_px = LensParameters().glare_scale_px;
    return p;
}
LensParameters glaring_part(const LensParameters &p) {
    LensParameters part;
    part.width = p.width;
    part.height = p.height;
    part.glare_scale_px = p.glare_scale_px;
    return part;
}

// The smallest s > 0 at which 1 + a s + b s^2 + c s^3 is 0; infinity if there is none.
double first_root(double a, double b, double c) {
    const auto value = [=](double s) { return 1.0 + s * (a + s * (b + s * c)); };
    // Between its extrema, at the roots of a + 2 b s + 3 c s^2, a cubic is monotone.
    std::vector<double> ends;
    if (c != 0.0) {
        const double discriminant = b * b - 3.0 * a * c;
        if (discriminant >= 0.0) {
            const double q = -(b + std::copysign(std::sqrt(discriminant), b));
            ends.push_back(q / (3.0 * c));
            if (q != 0.0)
                ends.push_back(a / q);
        }
    } else if (b != 0.0) {
        ends.push_back(-a / (2.0 * b));
    }
    ends.push_back(1e12); // a radius of a million units
    std::sort(ends.begin(), ends.end());
    double low = 0.0;
    for (double high : ends) {
        if (!(high > low))
            continue;
        if (value(high) <= 0.0) {
            for (int i = 0; i < 200 && low < high; ++i) {
                const double middle = 0.5 * (low + high);
                if (middle <= low || middle >= high)
                    break;
                (value(middle) > 0.0 ? low : high) = middle;
            }
            return low;
        }
        low = high;
    }
    return std::numeric_limits<double>::infinity();
}

} // namespace

Distortion::Distortion(const LensParameters &p)
    : principal_x_(p.principal_point_given ? p.principal_point_x_px : 0.5 * (p.width - 1.0)),
      principal_y_(p.principal_point_given ? p.principal_point_y_px : 0.5 * (p.height - 1.0)),
      corner_px_(std::hypot(std::max(principal_x_, p.width - 1.0 - principal_x_),
                            std::max(principal_y_, p.height - 1.0 - principal_y_))),
      k1_(p.k1), k2_(p.k2), k3_(p.k3), p1_(p.p1), p2_(p.p2),
      identity_(p.k1 == 0.0 && p.k2 == 0.0 && p.k3 == 0.0 && p.p1 == 0.0 && p.p2 == 0.0),
      fold_(first_root(3.0 * p.k1, 5.0 * p.k2, 7.0 * p.k3)) {
    if (corner_px_ == 0.0)
        corner_px_ = 1.0;
    unit_x_ = p.radius_unit == RadiusUnit::kCorner ? corner_px_ : p.focal_length_x_px;
    unit_y_ = p.radius_unit == RadiusUnit::kCorner ? corner_px_ : p.focal_length_y_px;
}

// In units of the radius, from the principal point (D. C. Brown, Photogrammetric Engineering 32 (1966) 444; the signs
// and names of p1, p2 are OpenCV's).
Distortion::Point Distortion::forward(Point p) const {
    const double s = p.x * p.x + p.y * p.y, r = radial(s);
    return {p.x * r + 2.0 * p1_ * p.x * p.y + p2_ * (s + 2.0 * p.x * p.x),
            p.y * r + p1_ * (s + 2.0 * p.y * p.y) + 2.0 * p2_ * p.x * p.y};
}

Distortion::Jacobian Distortion::jacobian(Point p) const {
    const double s = p.x * p.x + p.y * p.y, r = radial(s);
    const double slope = 2.0 * (k1_ + s * (2.0 * k2_ + s * 3.0 * k3_)); // 2 dR/ds
    return {r + slope * p.x * p.x + 2.0 * p1_ * p.y + 6.0 * p2_ * p.x,
            slope * p.x * p.y + 2.0 * p1_ * p.x + 2.0 * p2_ * p.y,
            r + slope * p.y * p.y + 6.0 * p1_ * p.y + 2.0 * p2_ * p.x};
}

// Where a symmetric Jacobian is positive definite all over a convex region, no two of its points have the same image.
bool Distortion::unfolded(Point p) const {
    const Jacobian j = jacobian(p);
    return p.x * p.x + p.y * p.y < fold_ && j.xx > 0.0 && j.xx * j.yy > j.xy * j.xy;
}

std::optional<Distortion::Point> Distortion::distort(Point ideal) const {
    if (identity_)
        return ideal;
    const Point p{(ideal.x - principal_x_) / unit_x_, (ideal.y - principal_y_) / unit_y_};
    if (!unfolded(p))
        return std::nullopt;
    const Point q = forward(p);
    return Point{principal_x_ + q.x * unit_x_, principal_y_ + q.y * unit_y_};
}

// r with r R(r^2) = distorted, on the branch that begins at the axis, where the left side rises.
std::optional<double> Distortion::undistorted_radius(double distorted) const {
    double low = 0.0, high = std::sqrt(fold_);
    if (fold_ < std::numeric_limits<double>::infinity()) {
        if (!(high * radial(fold_) > distorted))
            return std::nullopt;
    } else {
        high = std::max(1.0, distorted);
        while (!(high * radial(high * high) > distorted)) {
            high *= 2.0;
            if (!(high < 1e6))
                return std::nullopt;
        }
    }
    // Newton's method, kept within the bracket by bisection.
    double r = std::min(distorted, 0.5 * (low + high));
    for (int i = 0; i < 200; ++i) {
        const double error = r * radial(r * r) - distorted;
        if (error == 0.0)
            break;
        (error < 0.0 ? low : high) = r;
        double next = r - error / radial_slope(r * r);
        if (!(next > low && next < high))
            next = 0.5 * (low + high);
        if (std::abs(next - r) <= 1e-16 * r || next == low || next == high)
            break;
        r = next;
    }
    return r;
}

std::optional<Distortion::Point> Distortion::undistort(Point distorted) const {
    if (identity_)
        return distorted;
    const Point q{(distorted.x - principal_x_) / unit_x_, (distorted.y - principal_y_) / unit_y_};
    const double radius = std::hypot(q.x, q.y);
    if (radius == 0.0)
        return distorted;
    const std::optional<double> r = undistorted_radius(radius);
    if (!r)
        return std::nullopt;
    // Exact without tangential terms; with them, where Newton's method in the plane begins.
    Point p{q.x * (*r / radius), q.y * (*r / radius)};
    if (p1_ != 0.0 || p2_ != 0.0) {
        constexpr int kMostSteps = 50;
        int step = 0;
        for (; step < kMostSteps; ++step) {
            const Point f = forward(p);
            const Jacobian j = jacobian(p);
            const double determinant = j.xx * j.yy - j.xy * j.xy;
            if (!(determinant > 0.0))
                return std::nullopt;
            const double ex = f.x - q.x, ey = f.y - q.y;
            const double dx = (j.yy * ex - j.xy * ey) / determinant, dy = (j.xx * ey - j.xy * ex) / determinant;
            p.x -= dx;
            p.y -= dy;
            if (std::hypot(dx, dy) <= 1e-15 * (1.0 + std::hypot(p.x, p.y)))
                break;
        }
        if (step == kMostSteps)
            return std::nullopt;
    }
    if (!unfolded(p))
        return std::nullopt;
    return Point{principal_x_ + p.x * unit_x_, principal_y_ + p.y * unit_y_};
}

// Newton's method for f R(q f^2) = 1, q the distorted radius squared and f q^0.5 the ideal one, in all pixels of a row
// at a time: products and one quotient, of which compilers make vectors.
bool Distortion::shrink_row(const std::vector<double> &u2, double v2, std::vector<double> &shrink) const {
    const double k1 = k1_, k2 = k2_, k3 = k3_, fold = fold_;
    const double *const across = u2.data();
    double *const f = shrink.data();
    const std::size_t width = u2.size();
    // What is left after a step is of the order of its square.
    constexpr double kSettled = 1e-9;
    constexpr int kMostSteps = 10;
    std::int64_t moved = 1; // as wide as what is compared
    for (int step = 0; step < kMostSteps && moved > 0; ++step) {
        moved = 0;
        for (std::size_t x = 0; x < width; ++x) {
            const double was = f[x], s = (across[x] + v2) * was * was;
            const double r = 1.0 + s * (k1 + s * (k2 + s * k3));
            const double slope = 1.0 + s * (3.0 * k1 + s * (5.0 * k2 + s * 7.0 * k3));
            const double by = (was * r - 1.0) / slope;
            f[x] = was - by;
            moved += std::abs(by) <= kSettled ? 0 : 1; // what is no number has moved
        }
    }
    std::int64_t outside = 0;
    for (std::size_t x = 0; x < width; ++x)
        outside += f[x] > 0.0 && (across[x] + v2) * f[x] * f[x] < fold ? 0 : 1;
    return moved + outside == 0;
}

std::vector<float> Distortion::displacements(std::uint32_t width, std::uint32_t height) const {
    std::vector<float> map(std::size_t{width} * height * 2);
    // No image is wider than this; farther sources are all outside.
    static constexpr double kFarthest = 1e6;
    const auto within = [](double pixels) { return static_cast<float>(std::clamp(pixels, -kFarthest, kFarthest)); };
    std::vector<double> shrink(width, 1.0), u2;
    for (std::uint32_t x = 0; x < width; ++x) {
        const double u = (x - principal_x_) / unit_x_;
        u2.push_back(u * u);
    }
    for (std::uint32_t y = 0; y < height; ++y) {
        float *to = &map[std::size_t{y} * width * 2];
        const double v = (y - principal_y_) / unit_y_;
        if (p1_ == 0.0 && p2_ == 0.0 && shrink_row(u2, v * v, shrink)) {
            for (std::uint32_t x = 0; x < width; ++x) {
                to[2 * x] = within((x - principal_x_) * (shrink[x] - 1.0));
                to[2 * x + 1] = within((y - principal_y_) * (shrink[x] - 1.0));
            }
            continue;
        }
        shrink.assign(width, 1.0);
        for (std::uint32_t x = 0; x < width; ++x) {
            const auto source = undistort({double(x), double(y)});
            if (!source)
                throw Error(Status::kInvalidArgument,
                            fmt::format("the distortion folds over within the image: no ideal point is imaged at pixel "
                                        "({}, {}); use smaller k1, k2, k3, p1, p2, or check their radius_unit",
                                        x, y));
            to[2 * x] = within(source->x - x);
            to[2 * x + 1] = within(source->y - y);
        }
    }
    return map;
}

Vignetting::Vignetting(const LensParameters &p) : corner_loss_(p.vignetting_corner_loss) {
    const Distortion geometry(p);
    principal_x_ = geometry.principal_x();
    principal_y_ = geometry.principal_y();
    per_corner2_ = 1.0 / (geometry.corner_px() * geometry.corner_px());
}

double Vignetting::transmission(double x, double y) const {
    const double dx = x - principal_x_, dy = y - principal_y_;
    return std::max(0.0, 1.0 - corner_loss_ * (dx * dx + dy * dy) * per_corner2_);
}

cl_float4 Vignetting::kernel_argument() const {
    return {{static_cast<cl_float>(principal_x_), static_cast<cl_float>(principal_y_),
             static_cast<cl_float>(per_corner2_), static_cast<cl_float>(corner_loss_)}};
}

Lens::Lens(std::shared_ptr<Context> context, const LensParameters &parameters, bool keeps_filters)
    : context_(std::move(context)), keeps_filters_(keeps_filters) {
    configure(parameters);
}

void Lens::configure(const LensParameters &p) {
    check(p);
    const Distortion distortion(p);
    DeviceBuffer displacement;
    const LensParameters off, displacement_of = !distortion.identity() ? distorting_part(p)
                                                : keeps_filters_       ? displacement_of_
                                                                       : off;
    if (!distortion.identity() && displacement_of != displacement_of_) {
        const std::vector<float> map = distortion.displacements(p.width, p.height);
        displacement = DeviceBuffer(context_, map.size() * sizeof(float), map.data());
    }
    std::unique_ptr<FftFilter> glare;
    const bool glares = p.glare_fraction > 0.0;
    const LensParameters glare_of = glares ? glaring_part(p) : keeps_filters_ ? glare_of_ : off;
    if (glares && glare_of != glare_of_)
        glare = std::make_unique<FftFilter>(context_, p.width, p.height,
                                            exponential_guard_px(p.glare_scale_px, p.width, p.height),
                                            exponential_spread(p.glare_scale_px));
    const std::string options =
        fmt::format("-DDISTORT_SHIFT=0 -DDISTORT=0 -DGLARE={} -DVIGNETTING={} -DCOS4={}",
                    glares ? 1 : 0, p.vignetting_corner_loss > 0.0 ? 1 : 0, p.cos4_falloff ? 1 : 0);
    cl::Kernel finish = context_->kernel("stages/lens.cl", "lens_finish", options);
    // From here on nothing fails.
    if (!distortion_ || distortion_->identity() != distortion.identity())
        distort_kernels_.clear();
    parameters_ = p;
    distortion_ = distortion;
    vignetting_ = Vignetting(p).kernel_argument();
    if (displacement_of != displacement_of_)
        displacement_ = std::move(displacement);
    displacement_of_ = displacement_of;
    if (glare_of != glare_of_)
        glare_ = std::move(glare);
    glare_of_ = glare_of;
    finish_ = std::move(finish);
}

bool Lens::finishes() const {
    const LensParameters &p = parameters_;
    return p.glare_fraction > 0.0 || p.ambient > 0.0 || p.vignetting_corner_loss > 0.0 || p.cos4_falloff;
}

Interpolation Lens::usual_interpolation(Format format) {
    return format == Format::kFloat32 ? Interpolation::kCubic : Interpolation::kNearest;
}

cl::Kernel &Lens::distort_kernel(Format format, Interpolation interpolation) {
    const Variant variant{format, interpolation};
    const auto found = distort_kernels_.find(variant);
    if (found != distort_kernels_.end())
        return found->second;
    const char *component = format == Format::kUint8    ? "uchar"
                            : format == Format::kUint16 ? "ushort"
                            : format == Format::kUint32 ? "uint"
                                                        : "float";
    // Where the lens sees no ideal pixel there is no light and no surface: 0, and for points and normals NaN.
    const bool vector = format == Format::kFloat32x3 || format == Format::kFloat32x4;
    const std::string options = fmt::format(
        "-DDISTORT_SHIFT=0 -DDISTORT=1 -DHAS_MAP={} -DCOMPONENT={} -DCOMPONENTS={} -DINTERPOLATION={} -DOUTSIDE={}",
        distorts() ? 1 : 0, component, component_count(format), static_cast<std::uint32_t>(interpolation),
        vector ? "NAN" : "0");
    return distort_kernels_.emplace(variant, context_->kernel("stages/lens.cl", "lens_distort", options)).first->second;
}

void Lens::check_distort(const ImageView &ideal, const ImageView &distorted, Interpolation interpolation) {
    const bool integers =
        ideal.format == Format::kUint8 || ideal.format == Format::kUint16 || ideal.format == Format::kUint32;
    if (integers && interpolation != Interpolation::kNearest)
        throw Error(Status::kInvalidArgument,
                    fmt::format("interpolation is {}, but an image of {} has no values between its own; use nearest",
                                interpolation == Interpolation::kLinear ? "linear" : "cubic",
                                format_name(ideal.format)));
    if (ideal.format != distorted.format)
        throw Error(Status::kInvalidFormat, fmt::format("distorted.format is {}, expected {}, the format of ideal",
                                                        format_name(distorted.format), format_name(ideal.format)));
    check_writable(distorted, "distorted");
    refuse_overlap(distorted, "distorted", ideal, "ideal");
    distort_kernel(ideal.format, interpolation); // built now if it must be, not after the first commands of a frame
}

void Lens::enqueue_distort(CommandChain &chain, const ImageView &ideal, const ImageView &distorted,
                           Interpolation interpolation) {
    check_distort(ideal, distorted, interpolation);
    cl::Kernel &kernel = distort_kernel(ideal.format, interpolation);
    KernelArguments(kernel)
        .add(ideal)
        .add(displacement_.get())
        .add(distorted)
        .add(cl_uint{parameters_.width})
        .add(cl_uint{parameters_.height});
    chain.run("distortion", kernel, parameters_.width, parameters_.height);
}

void Lens::check_distort_shift(const ImageView &ideal, const ImageView &distorted) {
    if (!distorts())
        throw Error(Status::kInvalidState, "this lens does not distort");
    for (const ImageView *image : {&ideal, &distorted})
        if (image->format != Format::kFloat32x2)
            throw Error(Status::kInvalidFormat,
                        fmt::format("an image of shifts is {}, expected {}", format_name(image->format),
                                    format_name(Format::kFloat32x2)));
    check_writable(distorted, "distorted");
    refuse_overlap(distorted, "distorted", ideal, "ideal");
    if (!distort_shift_())
        distort_shift_ = context_->kernel("stages/lens.cl", "lens_distort_shift", "-DDISTORT_SHIFT=1 -DDISTORT=0");
}

void Lens::enqueue_distort_shift(CommandChain &chain, const ImageView &ideal, const ImageView &distorted) {
    check_distort_shift(ideal, distorted);
    KernelArguments(distort_shift_)
        .add(ideal)
        .add(displacement_.get())
        .add(distorted)
        .add(cl_uint{parameters_.width})
        .add(cl_uint{parameters_.height});
    chain.run("distortion", distort_shift_, parameters_.width, parameters_.height);
}

void Lens::check_finish(const ImageView &light, const ImageView &out) const {
    check_writable(out, "output");
    if (overlap(light, out) && !same_pixels(light, out))
        throw Error(Status::kOverlap,
                    "light and output overlap without being the same image; use one image for both, or two apart");
}

void Lens::enqueue_finish(CommandChain &chain, const ImageView &light, const ImageView &out, bool is_dark) {
    check_finish(light, out);
    const LensParameters &p = parameters_;
    const double ambient = is_dark ? 0.0 : p.ambient;
    const bool changes = p.glare_fraction > 0.0 || ambient > 0.0 || p.vignetting_corner_loss > 0.0 || p.cos4_falloff;
    if (!changes && same_pixels(light, out))
        return;
    const bool glares = p.glare_fraction > 0.0;
    if (glares)
        glare_->enqueue_convolve(chain, "glare", light);
    const auto inverse = [](double length) { return static_cast<cl_float>(length > 0.0 ? 1.0 / length : 0.0); };
    const cl_float2 inverse_focal{{inverse(p.focal_length_x_px), inverse(p.focal_length_y_px)}};
    KernelArguments arguments(finish_);
    arguments.add(light);
    if (glares)
        arguments.add(glare_->field())
            .add(cl_uint{glare_->grid().grid_width})
            .add(static_cast<cl_float>(p.glare_fraction));
    arguments.add(static_cast<cl_float>(ambient))
        .add(vignetting_)
        .add(inverse_focal)
        .add(out)
        .add(cl_uint{p.width})
        .add(cl_uint{p.height});
    chain.run("lens", finish_, p.width, p.height);
}

} // namespace clsp

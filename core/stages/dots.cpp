#include "stages/dots.hpp"

#include "runtime/checks.hpp"
#include "runtime/kernel_arguments.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

namespace clsp {
namespace {

constexpr std::uint32_t kTilePx = 16; // TILE_PX of stages/dots.cl
constexpr double kCutoff = 1e-7;      // of a dot's peak
constexpr double kSmallestSigma = 0.01;
constexpr std::uint64_t kMaxMembers = std::uint64_t{1} << 27; // 512 MiB of indices
constexpr std::uint64_t kMaxLatticeDots = 1024;               // that are asked for their neighbours

struct Dot {
    double x, y, sigma, peak;
};

void check_finite(double value, const char *name) {
    if (!std::isfinite(value))
        throw Error(Status::kInvalidArgument, fmt::format("{} is {}, it must be finite", name, value));
}

void check_sigma(double value, const std::string &name, Status status) {
    if (!(value >= kSmallestSigma && value <= kMaxImageSide))
        throw Error(status,
                    fmt::format("{} is {}, it must be {} to {} px", name, value, kSmallestSigma, kMaxImageSide));
}

void check(const DotsParameters &p) {
    check_image_size(p.width, p.height, "the image of the dots");
    if (p.count == 0 || p.count > kMaxDots)
        throw Error(Status::kInvalidArgument,
                    fmt::format("count is {}, a pattern has 1 to {} dots", p.count, kMaxDots));
    if (!p.positions_px)
        throw Error(Status::kInvalidArgument,
                    fmt::format("positions_px is NULL; it must point to x and y of {} dots", p.count));
    check_sigma(p.sigma_px, "sigma_px", Status::kInvalidArgument);
    check_not_negative(p.scale, "scale");
    if (p.principal_point_px) {
        check_finite((*p.principal_point_px)[0], "principal_point_x_px");
        check_finite((*p.principal_point_px)[1], "principal_point_y_px");
    }
    if (!(p.relative_wavelength_shift > -1.0 && p.relative_wavelength_shift <= 1.0))
        throw Error(
            Status::kInvalidArgument,
            fmt::format(
                "relative_wavelength_shift is {}, it must be above -1 and at most 1 (0.01 is a wavelength 1 % longer)",
                p.relative_wavelength_shift));
    if (!(std::abs(p.beam_skew) <= 3.0))
        throw Error(Status::kInvalidArgument, fmt::format("beam_skew is {}, it must be -3 to 3", p.beam_skew));
    check_finite(p.beam_skew_angle_rad, "beam_skew_angle_rad");
    if (!(p.beam_flatness >= 0.0 && p.beam_flatness <= 4.0))
        throw Error(Status::kInvalidArgument,
                    fmt::format("beam_flatness is {}, it must be 0 (Gaussian) to 4 (nearly a disc)", p.beam_flatness));
    check_not_negative(p.zero_order_relative_intensity, "zero_order_relative_intensity");
    check_not_negative(p.ghost_relative_intensity, "ghost_relative_intensity");
    if (p.ghost_offset_px) {
        check_finite((*p.ghost_offset_px)[0], "ghost_offset_x_px");
        check_finite((*p.ghost_offset_px)[1], "ghost_offset_y_px");
    }
    check_fraction(p.scatter_fraction, "scatter_fraction");
    for (std::uint64_t j = 0; j < p.count; ++j) {
        for (int axis = 0; axis < 2; ++axis)
            if (!std::isfinite(p.positions_px[2 * j + std::uint64_t(axis)]))
                throw Error(Status::kInvalidData,
                            fmt::format("positions_px: {} of dot {} is {}, it must be finite", axis ? "y" : "x", j,
                                        p.positions_px[2 * j + std::uint64_t(axis)]));
        if (p.sigmas_px)
            check_sigma(p.sigmas_px[j], fmt::format("sigmas_px[{}]", j), Status::kInvalidData);
        if (p.peaks && !(p.peaks[j] >= 0.0 && p.peaks[j] <= kLargestNumber))
            throw Error(Status::kInvalidData,
                        fmt::format("peaks[{}] is {}, it must be 0 to {}", j, p.peaks[j], kLargestNumber));
    }
}

double median(std::vector<double> &values) {
    const auto middle = values.begin() + std::ptrdiff_t(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    if (values.size() % 2 == 1)
        return *middle;
    return 0.5 * (*middle + *std::max_element(values.begin(), middle));
}

using GhostDirection = DotsParameters::GhostDirection;

// Half the diagonal of the lattice's cell, (v + w) / 2 (dots.h), or half of one of its vectors.
Vector2 lattice_offset(const std::vector<double> &positions, GhostDirection direction) {
    const std::uint64_t count = positions.size() / 2, asked = std::min(count, kMaxLatticeDots);
    const auto x = [&](std::uint64_t i) { return positions[2 * i]; };
    const auto y = [&](std::uint64_t i) { return positions[2 * i + 1]; };
    std::vector<std::uint64_t> by_y(count);
    for (std::uint64_t i = 0; i < count; ++i)
        by_y[i] = i;
    std::sort(by_y.begin(), by_y.end(),
              [&](std::uint64_t a, std::uint64_t b) { return y(a) != y(b) ? y(a) < y(b) : a < b; });
    std::array<std::vector<double>, 4> found; // dx and dy to the right, dx and dy downwards
    for (std::uint64_t k = 0; k < asked; ++k) {
        const std::uint64_t place = k * count / asked, j = by_y[place];
        struct Neighbour {
            double distance2 = std::numeric_limits<double>::infinity();
            std::uint64_t index = 0;
        };
        std::array<Neighbour, 2> nearest; // to the right, downwards
        // False once dots at this height are farther than what was found. Of equally near dots the first counts.
        const auto look_at = [&](std::uint64_t i) {
            const double dx = x(i) - x(j), dy = y(i) - y(j), distance2 = dx * dx + dy * dy;
            const bool right = dx > 0.0 && std::abs(dy) <= dx, down = dy > 0.0 && std::abs(dx) < dy;
            Neighbour &best = nearest[down ? 1 : 0];
            if ((right || down) && (distance2 < best.distance2 || (distance2 == best.distance2 && i < best.index)))
                best = {distance2, i};
            return dy * dy <= std::max(nearest[0].distance2, dy > 0.0 ? nearest[1].distance2 : 0.0);
        };
        for (std::uint64_t q = place + 1; q < count && look_at(by_y[q]);)
            ++q;
        for (std::uint64_t q = place; q > 0 && look_at(by_y[q - 1]);)
            --q;
        for (std::size_t way = 0; way < 2; ++way)
            if (std::isfinite(nearest[way].distance2)) {
                found[2 * way].push_back(x(nearest[way].index) - x(j));
                found[2 * way + 1].push_back(y(nearest[way].index) - y(j));
            }
    }
    if (found[0].empty() && found[2].empty())
        throw Error(
            Status::kInvalidArgument,
            "ghost_relative_intensity is not 0, but the dots are no lattice that says where the ghosts lie; give "
            "ghost_offset_x_px and ghost_offset_y_px, and set ghost_offset_given to 1");
    if ((direction == GhostDirection::kRight && found[0].empty()) ||
        (direction == GhostDirection::kDown && found[2].empty()))
        throw Error(
            Status::kInvalidArgument,
            fmt::format("ghosts lie half way along the lattice's vector {}, but no dot has a neighbour there; take "
                        "the other direction, or both",
                        direction == GhostDirection::kRight ? "to the right" : "downwards"));
    Vector2 offset{0.0, 0.0};
    for (std::size_t way = 0; way < 2; ++way)
        for (std::size_t axis = 0; axis < 2; ++axis)
            if (!found[2 * way + axis].empty() &&
                direction != (way == 0 ? GhostDirection::kDown : GhostDirection::kRight))
                offset[axis] += 0.5 * median(found[2 * way + axis]);
    return offset;
}

// Every dot that there is, also ghosts and zero order, in the order in which they are summed.
std::vector<Dot> all_dots(const DotsParameters &p, const std::vector<double> &positions,
                          const std::vector<double> &sigmas, const std::vector<double> &peaks) {
    const Vector2 c = p.principal_point_px.value_or(Vector2{0.5 * (p.width - 1.0), 0.5 * (p.height - 1.0)});
    const bool ghosts = p.ghost_relative_intensity > 0.0;
    const Vector2 offset =
        ghosts ? (p.ghost_offset_px ? *p.ghost_offset_px : lattice_offset(positions, p.ghost_direction)) : Vector2{};
    const double stretch = 1.0 + p.relative_wavelength_shift;
    std::vector<Dot> dots;
    dots.reserve((ghosts ? 2 : 1) * p.count + 1);
    double sum_of_sigmas = 0.0, sum_of_peaks = 0.0;
    const auto add = [&](std::uint64_t j, double dx, double dy, double relative) {
        const double sigma = sigmas.empty() ? p.sigma_px : sigmas[j], peak = peaks.empty() ? 1.0 : peaks[j];
        sum_of_sigmas += sigma;
        sum_of_peaks += peak;
        dots.push_back({c[0] + stretch * (positions[2 * j] + dx - c[0]),
                        c[1] + stretch * (positions[2 * j + 1] + dy - c[1]), sigma, relative * p.scale * peak});
    };
    for (std::uint64_t j = 0; j < p.count; ++j)
        add(j, 0.0, 0.0, 1.0);
    const double mean_sigma = sum_of_sigmas / double(p.count), mean_peak = sum_of_peaks / double(p.count);
    for (std::uint64_t j = 0; ghosts && j < p.count; ++j)
        add(j, offset[0], offset[1], p.ghost_relative_intensity);
    if (p.zero_order_relative_intensity > 0.0)
        dots.push_back({c[0], c[1], mean_sigma, p.zero_order_relative_intensity * p.scale * mean_peak});
    return dots;
}

// F of dots.h: the light of the clipped profile over that of the Gaussian.
double skewed_flux(double skew) {
    const double s = std::abs(skew);
    if (s == 0.0)
        return 1.0;
    const double a0 = -2.0 * std::cosh(std::acosh(3.0 / s) / 3.0);
    const double normal_law = 0.5 * std::erfc(a0 / std::sqrt(2.0)); // Phi(-a0)
    const double density = std::exp(-0.5 * a0 * a0) / std::sqrt(2.0 * M_PI);
    return normal_law + s / 6.0 * (a0 * a0 - 1.0) * density;
}

// The radius, in sigmas, beyond which no profile exceeds kCutoff.
double support(double skew, double power) {
    const auto bound = [&](double r) {
        return std::exp(-0.5 * std::pow(r, 2.0 * power)) * (1.0 + std::abs(skew) / 6.0 * (r * r + 3.0) * r);
    };
    double low = 1.0, high = 16.0; // bound(1) is at least exp(-1/2), bound(16) below exp(-100)
    while (high - low > 1e-3)
        (bound(0.5 * (low + high)) > kCutoff ? low : high) = 0.5 * (low + high);
    return high;
}

struct Binned {
    std::vector<cl_uint> first, members;
    std::vector<cl_int> nearest;
    std::vector<cl_float> shape;
};

// Which dots reach which tile: the pixels of a tile lie within a rectangle, a dot within a circle.
Binned bin(const std::vector<Dot> &dots, double radius_sigmas, double flux, std::uint32_t width, std::uint32_t height,
           std::uint32_t tiles_x, std::uint32_t tiles_y) {
    std::vector<Dot> seen;
    const auto reaches_image = [&](const Dot &dot) {
        const double r = radius_sigmas * dot.sigma;
        return dot.peak > 0.0 && dot.x >= -r && dot.y >= -r && dot.x <= width - 1.0 + r && dot.y <= height - 1.0 + r;
    };
    std::copy_if(dots.begin(), dots.end(), std::back_inserter(seen), reaches_image);

    const auto for_each_tile = [&](const Dot &dot, auto visit) {
        const double r = radius_sigmas * dot.sigma;
        const auto tile_range = [&](double centre, std::uint32_t tiles) {
            const double low = std::floor((centre - r) / kTilePx), high = std::floor((centre + r) / kTilePx);
            return std::pair<std::uint32_t, std::uint32_t>(
                static_cast<std::uint32_t>(std::clamp(low, 0.0, tiles - 1.0)),
                static_cast<std::uint32_t>(std::clamp(high, 0.0, tiles - 1.0)));
        };
        const auto [x_low, x_high] = tile_range(dot.x, tiles_x);
        const auto [y_low, y_high] = tile_range(dot.y, tiles_y);
        const auto distance = [](double centre, std::uint32_t tile) {
            const double low = double(tile) * kTilePx, high = low + kTilePx - 1;
            return std::max({low - centre, centre - high, 0.0});
        };
        for (std::uint32_t ty = y_low; ty <= y_high; ++ty)
            for (std::uint32_t tx = x_low; tx <= x_high; ++tx)
                if (std::hypot(distance(dot.x, tx), distance(dot.y, ty)) <= r)
                    visit(std::size_t{ty} * tiles_x + tx);
    };
    Binned result;
    const std::size_t tiles = std::size_t{tiles_x} * tiles_y;
    result.first.assign(tiles + 1, 0);
    std::uint64_t members = 0;
    for (const Dot &dot : seen) {
        for_each_tile(dot, [&](std::size_t tile) {
            ++result.first[tile + 1];
            ++members;
        });
        if (members > kMaxMembers)
            throw Error(
                Status::kUnsupported,
                fmt::format("the dots reach too many tiles of the image ({} sigma each way): more than {} pairs of "
                            "dot and tile; use fewer or narrower dots",
                            radius_sigmas, kMaxMembers));
    }
    for (std::size_t tile = 0; tile < tiles; ++tile)
        result.first[tile + 1] += result.first[tile];
    result.members.resize(std::max<std::size_t>(members, 1));
    std::vector<cl_uint> next(result.first.begin(), result.first.end() - 1);
    for (std::size_t j = 0; j < seen.size(); ++j)
        for_each_tile(seen[j], [&](std::size_t tile) { result.members[next[tile]++] = static_cast<cl_uint>(j); });
    for (const Dot &dot : seen) {
        const double x = std::nearbyint(dot.x), y = std::nearbyint(dot.y);
        for (const double value : {x, y})
            result.nearest.push_back(static_cast<cl_int>(value));
        for (const double value : {dot.x - x, dot.y - y, 1.0 / dot.sigma, dot.peak / flux})
            result.shape.push_back(static_cast<cl_float>(value));
    }
    // OpenCL has no empty buffers.
    result.nearest.resize(std::max<std::size_t>(result.nearest.size(), 2));
    result.shape.resize(std::max<std::size_t>(result.shape.size(), 4));
    return result;
}

template <typename T> DeviceBuffer upload(const std::shared_ptr<Context> &context, const std::vector<T> &values) {
    return DeviceBuffer(context, values.size() * sizeof(T), values.data());
}

} // namespace

Dots::Dots(std::shared_ptr<Context> context, const DotsParameters &parameters)
    : context_(std::move(context)), state_(make_state(parameters)) {}

void Dots::configure(const DotsParameters &parameters) {
    DotsParameters p = parameters;
    if (p.width != state_.parameters.width || p.height != state_.parameters.height)
        throw Error(
            Status::kInvalidArgument,
            fmt::format("the dots' image has {} x {} pixels (width x height), the new description {} x {}; make "
                        "new dots for another size",
                        state_.parameters.width, state_.parameters.height, p.width, p.height));
    if (p.count == 0 && !p.positions_px && !p.sigmas_px && !p.peaks) {
        p.count = state_.parameters.count;
        p.positions_px = state_.parameters.positions_px;
        p.sigmas_px = state_.parameters.sigmas_px;
        p.peaks = state_.parameters.peaks;
    }
    state_ = make_state(p);
}

Dots::State Dots::make_state(DotsParameters p) const {
    check(p);
    State state;
    state.positions_px.assign(p.positions_px, p.positions_px + 2 * p.count);
    if (p.sigmas_px)
        state.sigmas_px.assign(p.sigmas_px, p.sigmas_px + p.count);
    if (p.peaks)
        state.peaks.assign(p.peaks, p.peaks + p.count);
    // A vector's memory stays where it is when the state is moved.
    p.positions_px = state.positions_px.data();
    p.sigmas_px = p.sigmas_px ? state.sigmas_px.data() : nullptr;
    p.peaks = p.peaks ? state.peaks.data() : nullptr;
    state.parameters = p;

    const bool skewed = p.beam_skew != 0.0, flat = p.beam_flatness > 0.0, scattered = p.scatter_fraction > 0.0;
    const double power = 1.0 + 2.0 * p.beam_flatness;
    state.cosine = static_cast<cl_float>(std::cos(p.beam_skew_angle_rad));
    state.sine = static_cast<cl_float>(std::sin(p.beam_skew_angle_rad));
    state.skew_sixth = static_cast<cl_float>(p.beam_skew / 6.0);
    state.power = static_cast<cl_float>(power);
    state.tiles_x = (p.width + kTilePx - 1) / kTilePx;
    state.tiles_y = (p.height + kTilePx - 1) / kTilePx;
    const Binned binned =
        bin(all_dots(p, state.positions_px, state.sigmas_px, state.peaks), support(p.beam_skew, power),
            skewed_flux(p.beam_skew), p.width, p.height, state.tiles_x, state.tiles_y);
    state.first = upload(context_, binned.first);
    state.members = upload(context_, binned.members);
    state.nearest = upload(context_, binned.nearest);
    state.shape = upload(context_, binned.shape);
    const std::string defines =
        fmt::format("-DSKEW={} -DFLAT_TOP={} -DSCATTER={}", skewed ? 1 : 0, flat ? 1 : 0, scattered ? 1 : 0);
    state.render = context_->kernel("stages/dots.cl", "dots_render", defines);
    if (scattered) {
        state.kept = static_cast<cl_float>(1.0 - p.scatter_fraction);
        state.background = static_cast<cl_float>(p.scatter_fraction * mean_of_image(state, defines));
    }
    return state;
}

void Dots::add_common_arguments(KernelArguments &arguments, const State &state) const {
    arguments.add(state.first.get())
        .add(state.members.get())
        .add(state.nearest.get())
        .add(state.shape.get())
        .add(state.cosine)
        .add(state.sine)
        .add(state.skew_sixth)
        .add(state.power)
        .add(cl_uint{state.tiles_x})
        .add(cl_uint{state.parameters.width})
        .add(cl_uint{state.parameters.height});
}

double Dots::mean_of_image(const State &state, const std::string &defines) const {
    std::vector<cl_float> sums(std::size_t{state.tiles_x} * state.parameters.height);
    const DeviceBuffer device_sums(context_, sums.size() * sizeof(cl_float));
    cl::Kernel kernel = context_->kernel("stages/dots.cl", "dots_row_sums", defines);
    KernelArguments arguments(kernel);
    add_common_arguments(arguments, state);
    arguments.add(device_sums.get());
    cl::CommandQueue queue(context_->cl_context(), context_->device());
    CommandChain chain(queue(), 0, nullptr);
    chain.run("dots", kernel, state.tiles_x, state.parameters.height);
    queue.enqueueReadBuffer(device_sums.get(), CL_TRUE, 0, sums.size() * sizeof(cl_float), sums.data());
    double sum = 0.0;
    for (const cl_float row : sums)
        sum += double(row);
    return sum / (double(state.parameters.width) * state.parameters.height);
}

void Dots::enqueue_render(CommandChain &chain, const ImageView &irradiance) {
    check_writable(irradiance, "irradiance");
    if (irradiance.width != state_.parameters.width || irradiance.height != state_.parameters.height)
        throw Error(Status::kInvalidArgument,
                    fmt::format("irradiance is {} x {} pixels (width x height), the dots' image is {} x {}",
                                irradiance.width, irradiance.height, state_.parameters.width,
                                state_.parameters.height));
    KernelArguments arguments(state_.render);
    add_common_arguments(arguments, state_);
    arguments.add(state_.kept).add(state_.background).add(irradiance);
    chain.run("dots", state_.render, state_.tiles_x, irradiance.height);
}

} // namespace clsp

#include "statistics/dot_shape.hpp"

#include "statistics/sink.hpp"

#include <Eigen/Dense>

#include <algorithm>
#include <cmath>

namespace clsp::statistics {

namespace {

using Point = std::array<double, 2>;

// No spot is narrower than a pixel; moments of what is hardly any spot (strong defocus, light beside the dots) are
// quotients of noise, and are kept within what spots can have.
constexpr double kLeastMoment = 1.0 / 12.0, kLargestMoment = 10.0;

// Of the window under which a dot's light and place are taken, in standard deviations of the dot.
constexpr double kFluxWindow = 1.3;

// The pixels about a point, and a Gaussian window there, which is a product of one along x and one along y.
struct Window {
    std::size_t left = 0, right = 0, top = 0, bottom = 0; // right and bottom are past the end
    std::vector<double> x, y;                             // offsets from the point
    std::vector<double> window_x, window_y;

    Window(const Geometry &geometry, const Point &point, double radius, double width) {
        const auto range = [&](double centre, std::size_t size, std::size_t &first, std::size_t &end,
                               std::vector<double> &offset, std::vector<double> &window) {
            const double low = std::ceil(centre - radius), high = std::floor(centre + radius);
            first = std::size_t(std::clamp(low, 0.0, double(size)));
            end = std::size_t(std::clamp(high + 1.0, double(first), double(size)));
            for (std::size_t i = first; i < end; ++i) {
                offset.push_back(double(i) - centre);
                window.push_back(std::exp(-0.5 * offset.back() * offset.back() / (width * width)));
            }
        };
        range(point[0], geometry.width, left, right, x, window_x);
        range(point[1], geometry.height, top, bottom, y, window_y);
    }

    // f(light above background, weight, dx, dy) of each unmasked pixel.
    template <class Function>
    void visit(const Geometry &geometry, const std::vector<float> &image, double background, Function function) const {
        for (std::size_t i = top; i < bottom; ++i)
            for (std::size_t j = left; j < right; ++j) {
                const std::size_t pixel = i * geometry.width + j;
                if (geometry.is_used(pixel))
                    function(double(image[pixel]) - background, window_x[j - left] * window_y[i - top], x[j - left],
                             y[i - top]);
            }
    }
};

// Displacement of a dot at u, v (from the principal point, in corner radii) by each term.
std::array<Point, kDisplacementTerms> displacement_terms(double u, double v) {
    const double squared = u * u + v * v;
    return {{{1.0, 0.0}, {0.0, 1.0}, {u, v}, {-v, u}, {u, -v}, {v, u}, {u * squared, v * squared}}};
}

std::array<double, kDisplacementTerms> fit_displacement(const Geometry &geometry,
                                                        const std::vector<Point> &displacements,
                                                        const std::vector<double> &weights) {
    using Matrix = Eigen::Matrix<double, int(kDisplacementTerms), int(kDisplacementTerms)>;
    using Vector = Eigen::Matrix<double, int(kDisplacementTerms), 1>;
    Matrix gram = Matrix::Zero();
    Vector right = Vector::Zero();
    double total = 0.0;
    for (std::size_t i = 0; i < displacements.size(); ++i) {
        const Point &dot = geometry.dots.positions[i];
        const auto terms = displacement_terms((dot[0] - geometry.principal_point[0]) / geometry.corner_radius,
                                              (dot[1] - geometry.principal_point[1]) / geometry.corner_radius);
        total += weights[i];
        for (std::size_t a = 0; a < kDisplacementTerms; ++a) {
            right[int(a)] += weights[i] * (terms[a][0] * displacements[i][0] + terms[a][1] * displacements[i][1]);
            for (std::size_t b = 0; b < kDisplacementTerms; ++b)
                gram(int(a), int(b)) += weights[i] * (terms[a][0] * terms[b][0] + terms[a][1] * terms[b][1]);
        }
    }
    std::array<double, kDisplacementTerms> result{};
    if (!(total > 0.0))
        return result;
    const int count = displacements.size() < kDotsForField ? 2 : int(kDisplacementTerms);
    // A ridge far below the dots' own scatter: dots in one line leave terms undetermined, and those become 0.
    const Eigen::MatrixXd part =
        gram.topLeftCorner(count, count) + 1e-6 * total * Eigen::MatrixXd::Identity(count, count);
    const Eigen::VectorXd solution = Eigen::LDLT<Eigen::MatrixXd>(part).solve(Eigen::VectorXd(right.head(count)));
    for (int k = 0; k < count; ++k)
        result[std::size_t(k)] = solution[k];
    return result;
}

// Of the window in which a dot is searched: not as far as its neighbours.
double search_radius(const DotGeometry &dots, std::size_t dot, double width) {
    return std::max(std::min(2.5 * width, 1.2 * dots.cell_radius[dot]), 2.0);
}

Point displacement_at(const Geometry &geometry, const std::array<double, kDisplacementTerms> &fit, const Point &dot) {
    const auto terms = displacement_terms((dot[0] - geometry.principal_point[0]) / geometry.corner_radius,
                                          (dot[1] - geometry.principal_point[1]) / geometry.corner_radius);
    Point sum{};
    for (std::size_t k = 0; k < kDisplacementTerms; ++k)
        for (std::size_t axis = 0; axis < 2; ++axis)
            sum[axis] += fit[k] * terms[k][axis];
    return sum;
}

// The nominal positions, moved by the fitted terms.
void place_dots(const Geometry &geometry, DotPositions &positions) {
    const DotGeometry &dots = geometry.dots;
    const double limit = 0.5 * dots.spacing + dots.sigma;
    for (std::size_t i = 0; i < dots.positions.size(); ++i) {
        const Point moved = displacement_at(geometry, positions.terms, dots.positions[i]);
        for (std::size_t axis = 0; axis < 2; ++axis)
            positions.modelled[i][axis] = dots.positions[i][axis] + std::clamp(moved[axis], -limit, limit);
    }
}

} // namespace

DotPositions pulled_back(const Geometry &geometry, const std::vector<float> &image, double background,
                         DotPositions positions, double part) {
    for (double &term : positions.terms)
        term *= part;
    place_dots(geometry, positions);
    const double width = kFluxWindow * geometry.dots.sigma;
    for (std::size_t i = 0; i < positions.flux.size(); ++i) {
        double flux = 0.0;
        Window(geometry, positions.modelled[i], search_radius(geometry.dots, i, width), width)
            .visit(geometry, image, background,
                   [&](double light, double weight, double, double) { flux += weight * light; });
        positions.flux[i] = flux; // negative ones, too: cut at 0 the means over few dots would be lopsided
    }
    return positions;
}

double gaussian_flux(const Geometry &geometry) {
    const double window = kFluxWindow * kFluxWindow, sigma = geometry.dots.sigma;
    return 2.0 * M_PI * sigma * sigma * window / (1.0 + window);
}

DotPositions locate_dots(const Geometry &geometry, const std::vector<float> &image, double background) {
    const DotGeometry &dots = geometry.dots;
    const std::size_t count = dots.positions.size();
    DotPositions result;
    result.modelled = dots.positions;
    std::vector<Point> displacements(count);
    std::vector<double> weights(count);
    constexpr int kSteps = 3;
    for (int step = 0; step < kSteps; ++step) {
        result.flux.assign(count, 0.0);
        double mean_flux = 0.0;
        for (std::size_t i = 0; i < count; ++i) {
            // First from farther away: a dot may have moved by more than its width.
            const double width = (step == 0 ? 2.0 : kFluxWindow) * dots.sigma;
            const Window window(geometry, result.modelled[i], search_radius(dots, i, width), width);
            double flux = 0.0, along_x = 0.0, along_y = 0.0;
            window.visit(geometry, image, background, [&](double light, double weight, double dx, double dy) {
                flux += weight * light;
                along_x += weight * light * dx;
                along_y += weight * light * dy;
            });
            result.flux[i] = std::max(flux, 0.0);
            mean_flux += result.flux[i] / double(count);
            // Under the window a Gaussian dot shows only a part of its offset.
            const double whole = (dots.sigma * dots.sigma + width * width) / (width * width);
            const auto offset = [&](double moment) {
                return flux > 0.0 ? std::clamp(whole * moment / flux, -dots.cell_radius[i], dots.cell_radius[i]) : 0.0;
            };
            displacements[i] = {result.modelled[i][0] - dots.positions[i][0] + offset(along_x),
                                result.modelled[i][1] - dots.positions[i][1] + offset(along_y)};
        }
        for (std::size_t i = 0; i < count; ++i)
            weights[i] = ratio(result.flux[i], result.flux[i] + mean_flux);
        result.terms = fit_displacement(geometry, displacements, weights);
        place_dots(geometry, result);
    }
    double squares = 0.0, total = 0.0;
    for (std::size_t i = 0; i < count; ++i)
        for (std::size_t axis = 0; axis < 2; ++axis) {
            const double rest = dots.positions[i][axis] + displacements[i][axis] - result.modelled[i][axis];
            squares += 0.5 * weights[i] * rest * rest;
            total += 0.5 * weights[i];
        }
    result.residual_rms = std::sqrt(ratio(squares, total));
    return result;
}

DotShape measure_shape(const Geometry &geometry, const std::vector<float> &image, double background,
                       const DotPositions &positions, double least_core) {
    const DotGeometry &dots = geometry.dots;
    DotShape shape;
    const double sigma = dots.sigma, half_spacing = 0.5 * dots.spacing;
    const double reach = std::max(5.0 * sigma, half_spacing), window_width = kShapeWindow * sigma;
    struct Sums {
        double light = 0.0, x = 0.0, y = 0.0, xx = 0.0, yy = 0.0, xy = 0.0, x_cubed = 0.0, y_cubed = 0.0,
               r_fourth = 0.0;
    } all;
    std::array<double, kProfileRings> ring_light{}, ring_count{};
    std::array<std::array<double, 8>, 3> harmonics{};
    std::array<double, 3> harmonic_light{};
    double core = 0.0, core_count = 0.0;
    for (std::size_t i = 0; i < positions.modelled.size(); ++i) {
        const Window window(geometry, positions.modelled[i], reach, window_width);
        // Moments reach to where the neighbour's light begins.
        const double moment_radius = std::min(3.5 * sigma, std::max(1.2 * dots.cell_radius[i], 2.0 * sigma));
        Sums own;
        window.visit(geometry, image, background, [&](double light, double weight, double dx, double dy) {
            const double squared = dx * dx + dy * dy, radius = std::sqrt(squared), relative = radius / sigma;
            if (radius < moment_radius) {
                const double weighted = weight * light;
                own.light += weighted;
                own.x += weighted * dx;
                own.y += weighted * dy;
                own.xx += weighted * dx * dx;
                own.yy += weighted * dy * dy;
                own.xy += weighted * dx * dy;
                own.x_cubed += weighted * dx * dx * dx;
                own.y_cubed += weighted * dy * dy * dy;
                own.r_fourth += weighted * squared * squared;
            }
            if (relative < 1.0) {
                core += light;
                core_count += 1.0;
            }
            for (std::size_t k = 0; k < kProfileRings; ++k)
                if (relative >= kProfileEdges[k] && relative < kProfileEdges[k + 1]) {
                    ring_light[k] += light;
                    ring_count[k] += 1.0;
                }
            const bool inside[3] = {relative >= 0.7 && relative < 2.0, relative >= 2.0 && relative < 4.0,
                                    relative >= 4.0 ? radius < reach : relative >= 2.5 && radius < half_spacing};
            if (!(inside[0] || inside[1] || inside[2]))
                return;
            const double c = dx / radius, s = dy / radius;
            const double c2 = c * c - s * s, s2 = 2.0 * c * s, c3 = c2 * c - s2 * s, s3 = s2 * c + c2 * s;
            const double terms[8] = {c, s, c2, s2, c3, s3, c2 * c2 - s2 * s2, 2.0 * c2 * s2};
            for (std::size_t zone = 0; zone < 3; ++zone)
                if (inside[zone]) {
                    harmonic_light[zone] += zone == 2 ? 1.0 : std::max(light, 0.0);
                    for (std::size_t k = 0; k < 8; ++k)
                        harmonics[zone][k] += light * terms[k];
                }
        });
        all.light += own.light;
        all.x += own.x;
        all.y += own.y;
        all.xx += own.xx;
        all.yy += own.yy;
        all.xy += own.xy;
        all.x_cubed += own.x_cubed;
        all.y_cubed += own.y_cubed;
        all.r_fourth += own.r_fourth;
        shape.dot_width.push_back(own.light > 0.0 ? std::sqrt(std::max(0.5 * (own.xx + own.yy) / own.light, 0.0))
                                                  : 0.0);
    }
    shape.light_in_core = core_count > 0.0 ? core / core_count : 0.0;
    shape.core = std::max({shape.light_in_core, least_core, 1e-3});
    const double scale = shape.core;
    for (std::size_t k = 0; k < kProfileRings; ++k)
        shape.profile[k] = ratio(ring_light[k], ring_count[k]) / scale;
    for (std::size_t zone = 0; zone < 3; ++zone)
        for (std::size_t k = 0; k < 8; ++k)
            shape.harmonics[zone][k] = zone == 2 ? ratio(harmonics[zone][k], harmonic_light[zone]) / scale
                                                 : ratio(harmonics[zone][k], harmonic_light[zone]);
    if (!(all.light > 0.0))
        return shape;
    const double mean_x = all.x / all.light, mean_y = all.y / all.light;
    const double xx = std::max(all.xx / all.light - mean_x * mean_x, kLeastMoment),
                 yy = std::max(all.yy / all.light - mean_y * mean_y, kLeastMoment);
    shape.width_x = std::sqrt(xx);
    shape.width_y = std::sqrt(yy);
    shape.covariance_xy = std::clamp((all.xy / all.light - mean_x * mean_y) / std::sqrt(xx * yy), -1.0, 1.0);
    const auto skewness = [&](double cube, double square, double mean, double variance) {
        return std::clamp((cube / all.light - 3.0 * mean * square / all.light + 2.0 * mean * mean * mean) /
                              std::pow(variance, 1.5),
                          -kLargestMoment, kLargestMoment);
    };
    shape.skewness_x = skewness(all.x_cubed, all.xx, mean_x, xx);
    shape.skewness_y = skewness(all.y_cubed, all.yy, mean_y, yy);
    const double squared = (all.xx + all.yy) / all.light;
    shape.kurtosis = std::clamp(all.r_fourth / all.light / std::max(squared * squared, 4 * kLeastMoment * kLeastMoment),
                                -kLargestMoment, kLargestMoment);
    return shape;
}

double expected_core(const Geometry &geometry) {
    double inside = 0.0;
    for (const Point &dot : geometry.dots.positions)
        inside += dot[0] >= 0.0 && dot[1] >= 0.0 && dot[0] <= double(geometry.width - 1) &&
                  dot[1] <= double(geometry.height - 1) &&
                  geometry.is_used(std::size_t(dot[1] + 0.5) * geometry.width + std::size_t(dot[0] + 0.5));
    // A lens in focus spreads a point to about a Gaussian one of 0.42 / D px (Airy's disc).
    const double sigma = geometry.dots.sigma, lens = 0.42 / std::max(geometry.cutoff, 0.02);
    const double square = sigma * sigma + lens * lens;
    // Of a dot's light, the part within the disc of one sigma, over the disc's area.
    const double part = 1.0 - std::exp(-0.5 * sigma * sigma / square), area = M_PI * sigma * sigma;
    return part / area * double(geometry.used) / std::max(inside, 1.0);
}

double visibility(const DotShape &shape, double least_core) {
    return std::clamp(2.0 * shape.light_in_core / least_core - 1.0, 0.0, 1.0);
}

double window_mean(const Geometry &geometry, const std::vector<float> &image, const Point &point, double width) {
    const Window window(geometry, point, 3.0 * width, width);
    double light = 0.0, weights = 0.0;
    window.visit(geometry, image, 0.0, [&](double value, double weight, double, double) {
        light += weight * value;
        weights += weight;
    });
    return ratio(light, weights);
}

} // namespace clsp::statistics

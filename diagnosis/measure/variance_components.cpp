#include "measure/variance_components.hpp"

#include "inference/least_squares.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <utility>

namespace clsp {
namespace {

template <std::size_t Degree> constexpr int kTermsOf = int((Degree + 1) * (Degree + 2) / 2);
template <std::size_t Degree> using TermsOf = Eigen::Matrix<double, kTermsOf<Degree>, 1>;
template <std::size_t Degree> using SquareOf = Eigen::Matrix<double, kTermsOf<Degree>, kTermsOf<Degree>>;
using Terms = TermsOf<2>;
using Square = SquareOf<2>;

constexpr double kDefect = 6.0; // standard deviations from the rest of the pixels
// Pixels in strips of so many rows or columns may share whatever they like: row patterns, a speckle's grain.
constexpr std::size_t kStrip = 8;

// 1, u, v, u^2, u v, v^2, u^3 ...
template <std::size_t Degree> TermsOf<Degree> terms_at(const ImageShape &shape, std::size_t pixel) {
    const auto place = [](std::size_t i, std::size_t count) {
        return count > 1 ? double(i) / double(count - 1) - 0.5 : 0.0;
    };
    const double u = place(pixel % shape.width, shape.width), v = place(pixel / shape.width, shape.height);
    TermsOf<Degree> terms;
    terms[0] = 1.0;
    int k = 1;
    for (int degree = 1; degree <= int(Degree); ++degree) {
        for (int i = 0; i < degree; ++i, ++k)
            terms[k] = u * terms[k - degree];
        terms[k] = v * terms[k - degree - 1];
        ++k;
    }
    return terms;
}

// What is less than that part of a pixel's value is rounding, no pattern.
double beyond_rounding(double part, double value) {
    constexpr double kRounding = 1e-9;
    return std::abs(part) > kRounding * std::abs(value) ? part : 0.0;
}

// Products of the terms, and by them the least squares of the image less its first value: what is even is so exactly.
template <std::size_t Degree> struct TrendFit {
    SquareOf<Degree> products = SquareOf<Degree>::Zero();
    TermsOf<Degree> solution = TermsOf<Degree>::Zero();
    double first = 0.0;

    TrendFit(const ImageShape &shape, const std::vector<double> &image, const std::vector<std::uint8_t> &counts) {
        TermsOf<Degree> sums = TermsOf<Degree>::Zero();
        const auto counted = std::find_if(counts.begin(), counts.end(), [](std::uint8_t c) { return c != 0; });
        if (counted != counts.end())
            first = image[std::size_t(counted - counts.begin())];
        for (std::size_t i = 0; i < shape.size(); ++i) {
            if (!counts[i])
                continue;
            const TermsOf<Degree> terms = terms_at<Degree>(shape, i);
            products += terms * terms.transpose();
            sums += (image[i] - first) * terms;
        }
        solution = solve_least_squares(products, sums);
        for (double &term : solution)
            term = beyond_rounding(term, first);
    }
    double rest(double value, const TermsOf<Degree> &terms) const {
        return beyond_rounding(value - first - terms.dot(solution), value);
    }
};

// Means of rows or columns, their scatter, and the harmonic mean of their pixels.
struct Lines {
    std::vector<double> mean, count;
    double square = 0.0, degrees = 0.0, harmonic = 0.0;

    explicit Lines(std::size_t lines) : mean(lines), count(lines) {}
    void finish(double lost) {
        double used = 0.0, inverse = 0.0, sum = 0.0;
        for (std::size_t i = 0; i < mean.size(); ++i)
            if (count[i] > 0.0) {
                mean[i] /= count[i];
                used += 1.0;
                inverse += 1.0 / count[i];
                sum += mean[i];
            }
        for (std::size_t i = 0; i < mean.size(); ++i)
            if (count[i] > 0.0)
                square += (mean[i] - sum / used) * (mean[i] - sum / used);
        degrees = used - 1.0 - lost;
        square = degrees > 0.0 ? square / degrees : 0.0;
        harmonic = inverse > 0.0 ? used / inverse : 0.0;
    }
};

// Along a line with stride; mirrored at its ends (the border's sample twice).
void smooth_line(const std::vector<double> &kernel, const double *from, double *to, std::size_t count,
                 std::size_t stride) {
    const auto reach = static_cast<std::ptrdiff_t>(kernel.size() / 2), n = static_cast<std::ptrdiff_t>(count);
    for (std::ptrdiff_t i = 0; i < n; ++i) {
        double sum = 0.0;
        for (std::ptrdiff_t k = -reach; k <= reach; ++k) {
            std::ptrdiff_t j = (i + k) % (2 * n);
            j = j < 0 ? j + 2 * n : j;
            j = j < n ? j : 2 * n - 1 - j;
            sum += kernel[static_cast<std::size_t>(k + reach)] * from[static_cast<std::size_t>(j) * stride];
        }
        to[static_cast<std::size_t>(i) * stride] = sum;
    }
}

} // namespace

VarianceComponents variance_components(const ImageShape &shape, const std::vector<double> &image,
                                       const std::vector<std::uint8_t> &counts, std::size_t trend_degree) {
    Lines rows(shape.height), columns(shape.width);
    double n = 0.0, sum = 0.0;
    for (std::size_t i = 0; i < shape.size(); ++i) {
        if (!counts[i])
            continue;
        const std::size_t x = i % shape.width, y = i / shape.width;
        rows.mean[y] += image[i];
        rows.count[y] += 1.0;
        columns.mean[x] += image[i];
        columns.count[x] += 1.0;
        n += 1.0;
        sum += image[i];
    }
    // Of the trend powers of v are of rows, those of u of columns, products of pixels.
    const auto degree = double(trend_degree), products = 0.5 * degree * (degree - 1.0);
    rows.finish(degree);
    columns.finish(degree);
    double squares = 0.0, fourth = 0.0;
    for (std::size_t i = 0; i < shape.size(); ++i) {
        if (!counts[i])
            continue;
        const double rest = image[i] - rows.mean[i / shape.width] - columns.mean[i % shape.width] + sum / n;
        squares += rest * rest;
        fourth += rest * rest * rest * rest;
    }
    VarianceComponents result;
    const double degrees = n - (rows.degrees + columns.degrees + 1.0 + 2.0 * degree + products);
    if (degrees < 1.0 || rows.degrees < 1.0 || columns.degrees < 1.0)
        return result;
    result.pixel = squares / degrees;
    result.pixel_error = std::sqrt(std::max(0.0, fourth / n - squares / n * (squares / n)) / degrees);
    result.per_row = rows.harmonic;
    result.per_column = columns.harmonic;
    result.row_square = rows.square;
    result.row_degrees = rows.degrees;
    result.column_square = columns.square;
    result.column_degrees = columns.degrees;
    result.row = rows.square - result.pixel / rows.harmonic;
    result.column = columns.square - result.pixel / columns.harmonic;
    return result;
}

std::vector<double> without_trend(const ImageShape &shape, std::vector<double> image,
                                  const std::vector<std::uint8_t> &counts) {
    const TrendFit<kPatternTrend> fit(shape, image, counts);
    for (std::size_t i = 0; i < shape.size(); ++i)
        image[i] = fit.rest(image[i], terms_at<kPatternTrend>(shape, i));
    return image;
}

double leave_out_defects(const ImageShape &shape, const std::vector<double> &image, std::vector<std::uint8_t> &counts) {
    std::vector<double> sorted;
    for (std::size_t i = 0; i < shape.size(); ++i)
        if (counts[i])
            sorted.push_back(image[i]);
    const auto quantile = [&](double share) {
        const auto at = sorted.begin() + std::ptrdiff_t(share * double(sorted.size() - 1));
        std::nth_element(sorted.begin(), at, sorted.end());
        return *at;
    };
    if (sorted.size() < 2)
        return 0.0;
    const double median = quantile(0.5), deviation = 0.5 * (quantile(0.8413) - quantile(0.1587));
    double out = 0.0;
    for (std::size_t i = 0; i < shape.size(); ++i)
        if (counts[i] && std::abs(image[i] - median) > kDefect * deviation) {
            counts[i] = 0;
            out += 1.0;
        }
    return out / double(sorted.size());
}

SmoothTrend fit_trend(const ImageShape &shape, const std::vector<double> &image,
                      const std::vector<std::uint8_t> &counts) {
    const TrendFit<2> fit(shape, image, counts);
    SmoothTrend result;
    Eigen::Map<Terms>(result.terms.data()) = fit.solution;
    result.terms[0] += fit.first;
    // Clusters in two ways (Cameron, Gelbach and Miller): strips of rows and of columns, less what both have.
    const std::size_t across = (shape.width + kStrip - 1) / kStrip, down = (shape.height + kStrip - 1) / kStrip;
    std::vector<Terms> tiles(across * down, Terms::Zero());
    std::vector<double> rest(image.size());
    for (std::size_t i = 0; i < shape.size(); ++i)
        if (counts[i]) {
            const Terms terms = terms_at<2>(shape, i);
            rest[i] = fit.rest(image[i], terms);
            tiles[i / shape.width / kStrip * across + i % shape.width / kStrip] += rest[i] * terms;
        }
    Square rows = Square::Zero(), columns = Square::Zero(), both = Square::Zero();
    for (std::size_t y = 0; y < down; ++y) {
        Terms strip = Terms::Zero();
        for (std::size_t x = 0; x < across; ++x) {
            strip += tiles[y * across + x];
            both += tiles[y * across + x] * tiles[y * across + x].transpose();
        }
        rows += strip * strip.transpose();
    }
    for (std::size_t x = 0; x < across; ++x) {
        Terms strip = Terms::Zero();
        for (std::size_t y = 0; y < down; ++y)
            strip += tiles[y * across + x];
        columns += strip * strip.transpose();
    }
    // The fit has taken its part of their scatter: three terms along strips, six of all tiles.
    const auto widened = [](Square &scores, std::size_t clusters, double lost) {
        const double n = double(clusters);
        scores *= n > lost ? n / (n - lost) : 0.0;
    };
    widened(both, across * down, 6.0);
    widened(rows, down, 3.0);
    widened(columns, across, 3.0);
    // Few strips tell too little of rows and columns that know nothing of each other: of these the components do.
    std::vector<Terms> row_sums(shape.height, Terms::Zero()), column_sums(shape.width, Terms::Zero());
    for (std::size_t i = 0; i < shape.size(); ++i)
        if (counts[i]) {
            const Terms terms = terms_at<2>(shape, i);
            row_sums[i / shape.width] += terms;
            column_sums[i % shape.width] += terms;
        }
    const VarianceComponents parts = variance_components(shape, rest, counts, 2);
    Square modeled = std::max(0.0, parts.pixel) * fit.products;
    for (const Terms &sum : row_sums)
        modeled += std::max(0.0, parts.row) * sum * sum.transpose();
    for (const Terms &sum : column_sums)
        modeled += std::max(0.0, parts.column) * sum * sum.transpose();
    const Square inverse = pseudo_inverse(fit.products);
    const auto diagonal = [&](const Square &scores) { return Terms((inverse * scores * inverse).diagonal()); };
    Eigen::Map<Terms>(result.errors.data()) =
        diagonal(rows + columns - both).cwiseMax(diagonal(both)).cwiseMax(diagonal(modeled)).cwiseSqrt();
    return result;
}

HighPass high_pass(const ImageShape &shape, const std::vector<double> &image) {
    const auto convolved = [](const std::vector<double> &a, const std::vector<double> &b) {
        std::vector<double> result(a.size() + b.size() - 1);
        for (std::size_t i = 0; i < a.size(); ++i)
            for (std::size_t j = 0; j < b.size(); ++j)
                result[i + j] += a[i] * b[j];
        return result;
    };
    const std::vector<double> kernel =
        convolved(convolved(std::vector<double>(7, 1.0 / 7.0), std::vector<double>(11, 1.0 / 11.0)), {0.25, 0.5, 0.25});
    std::vector<double> across(image.size()), smooth(image.size());
    for (std::size_t y = 0; y < shape.height; ++y)
        smooth_line(kernel, &image[y * shape.width], &across[y * shape.width], shape.width, 1);
    for (std::size_t x = 0; x < shape.width; ++x)
        smooth_line(kernel, &across[x], &smooth[x], shape.height, shape.width);
    for (std::size_t i = 0; i < image.size(); ++i)
        smooth[i] = image[i] - smooth[i];
    double energy = 0.0;
    for (const double weight : kernel)
        energy += weight * weight;
    const double middle = kernel[kernel.size() / 2];
    return {std::move(smooth), 1.0 - 2.0 * middle * middle + energy * energy, 1.0 - 2.0 * middle + energy};
}

} // namespace clsp

#include "capture/pixel_oddities.hpp"

#include "capture/code_spacing.hpp"
#include "statistics/distributions.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <optional>

namespace clsp {
namespace {

constexpr double kNormalMad = 1.4826; // a normal law's deviation in median absolute deviations
constexpr double kApart = 8.0;        // deviations
constexpr double kLeastScale = 0.3;   // DN: what rounding to whole codes leaves
constexpr double kRestless = 25.0;    // times the usual variance, or twice what chance reaches
constexpr double kMostOdd = 0.1;      // of all pixels
constexpr double kLine = 0.5;         // of a line's pixels, from which the line is odd
constexpr std::size_t kLeastLines = 24, kLeastOfLine = 16, kLeastPixels = 100;
constexpr std::size_t kDegree = 4;
constexpr std::size_t kSamples = 20000; // of a surface's fit
constexpr std::uint32_t kNearX = 4;     // pixels so near belong to one block; data are written along rows
constexpr std::size_t kLeastBlock = 6;
constexpr double kBlockFill = 0.5;
constexpr std::size_t kLeastCells = 8;

template <typename T> double middle_of(std::vector<T> values) {
    const auto half = values.begin() + std::ptrdiff_t(values.size() / 2);
    std::nth_element(values.begin(), half, values.end());
    return *half;
}

template <typename T> double scale_of(const std::vector<T> &values) {
    std::vector<T> away;
    away.reserve(values.size());
    const double middle = middle_of(values);
    for (const T value : values)
        away.push_back(T(std::abs(value - middle)));
    return kNormalMad * middle_of(std::move(away));
}

struct Map {
    std::uint32_t width = 0, height = 0;
    const std::vector<std::uint8_t> *mask = nullptr;
    std::vector<float> mean, variance;
    std::uint32_t frames = 0;

    bool counts(std::size_t i) const { return mask->empty() || (*mask)[i] != 0; }
};

// A transient counts as its pixel's other frames do.
Map map_of(const PixelSums &pixels, const std::vector<Transient> &transients) {
    Map map{pixels.layout.width, pixels.layout.height, &pixels.sequence.mask, {}, {}, pixels.sequence.frame_count};
    const double n = map.frames;
    map.mean.resize(pixels.sums.size());
    map.variance.resize(n > 1 ? pixels.sums.size() : 0);
    for (std::size_t i = 0; i < pixels.sums.size(); ++i) {
        const double mean = pixels.sums[i] / n;
        map.mean[i] = float(mean);
        if (n > 1)
            map.variance[i] = float(std::max(0.0, (double(pixels.squares[i]) - mean * pixels.sums[i]) / (n - 1.0)));
    }
    for (const Transient &one : transients) {
        const double square = double(pixels.squares[one.index]) - double(one.code) * one.code;
        map.mean[one.index] = float(one.usual_dn);
        map.variance[one.index] = float(std::max(0.0, (square - (n - 1.0) * one.usual_dn * one.usual_dn) / (n - 2.0)));
    }
    return map;
}

// What is left of the means after a smooth surface, which no few pixels move.
std::vector<float> without_surface(const Map &map) {
    using Row = Eigen::Array<double, (kDegree + 1) * (kDegree + 2) / 2, 1>;
    using Powers = std::array<double, kDegree + 1>;
    const auto powers = [](std::uint32_t side) {
        std::vector<Powers> result(side);
        for (std::uint32_t k = 0; k < side; ++k) {
            result[k][0] = 1.0;
            for (std::size_t j = 1; j <= kDegree; ++j)
                result[k][j] = result[k][j - 1] * (2.0 * k / side - 1.0);
        }
        return result;
    };
    const std::vector<Powers> of_x = powers(map.width), of_y = powers(map.height);
    const auto terms = [&](std::size_t i) {
        const Powers &x = of_x[i % map.width], &y = of_y[i / map.width];
        Row row;
        Eigen::Index k = 0;
        for (std::size_t degree = 0; degree <= kDegree; ++degree)
            for (std::size_t j = 0; j <= degree; ++j)
                row[k++] = x[degree - j] * y[j];
        return row;
    };
    std::vector<std::size_t> all, sampled;
    for (std::size_t i = 0; i < map.mean.size(); ++i)
        if (map.counts(i))
            all.push_back(i);
    const std::size_t step = all.size() / kSamples + 1;
    for (std::size_t k = 0; k < all.size(); k += step)
        sampled.push_back(all[std::min(k + k / map.width % step, all.size() - 1)]); // of all columns
    Eigen::MatrixXd basis(sampled.size(), Row::RowsAtCompileTime);
    Eigen::VectorXd values(sampled.size());
    for (std::size_t s = 0; s < sampled.size(); ++s) {
        basis.row(Eigen::Index(s)) = terms(sampled[s]).matrix().transpose();
        values[Eigen::Index(s)] = map.mean[sampled[s]];
    }
    Eigen::VectorXd surface = Eigen::VectorXd::Zero(Row::RowsAtCompileTime);
    surface[0] = middle_of(std::vector<double>(values.data(), values.data() + values.size()));
    for (int round = 0; round < 12; ++round) {
        Eigen::VectorXd rest = values - basis * surface;
        const double scale =
            std::max(kLeastScale, scale_of(std::vector<double>(rest.data(), rest.data() + rest.size())));
        // Tukey's weights; at first wide, as a middle is no surface yet.
        const double reach = (round < 3 ? 9.0 : 4.7) * scale;
        Eigen::VectorXd weights = rest.unaryExpr([&](double r) {
            const double part = 1.0 - r * r / (reach * reach);
            return std::abs(r) < reach ? part * part : 0.0;
        });
        const Eigen::MatrixXd weighted = weights.asDiagonal() * basis;
        surface = (basis.transpose() * weighted +
                   1e-9 * double(sampled.size()) * Eigen::MatrixXd::Identity(basis.cols(), basis.cols()))
                      .ldlt()
                      .solve(weighted.transpose() * values);
    }
    std::vector<float> rest(map.mean.size());
    for (std::size_t i = 0; i < rest.size(); ++i)
        rest[i] = float(map.mean[i] - (terms(i) * surface.array()).sum());
    return rest;
}

std::vector<float> counted(const Map &map, const std::vector<float> &values) {
    std::vector<float> result;
    result.reserve(values.size());
    for (std::size_t i = 0; i < values.size(); ++i)
        if (map.counts(i))
            result.push_back(values[i]);
    return result;
}

// Below which variance none of the pixels would lie by chance; none where that cannot be told.
std::optional<double> least_variance(const Map &map, std::uint32_t step_dn) {
    std::vector<float> all = counted(map, map.variance);
    if (all.size() < 2)
        return std::nullopt;
    const auto tenth = all.begin() + std::ptrdiff_t(all.size() / 10);
    std::nth_element(all.begin(), tenth, all.end());
    const double quiet = *tenth, degrees = map.frames - 1.0, chance = kChanceOfFinding / double(all.size());
    // That all codes of a pixel are the same one, the most probable one.
    const double deviation = std::sqrt(quiet) / step_dn;
    if (deviation < 0.5 || std::pow(0.4 / deviation, degrees) > chance)
        return std::nullopt;
    // The lower tail of chi-square, by its first term: (d r / 2)^(d / 2) / Gamma(d / 2 + 1).
    const double ratio =
        2.0 / degrees * std::exp(2.0 / degrees * (std::log(chance) + std::lgamma(0.5 * degrees + 1.0)));
    return quiet * ratio;
}

// Above which variance a pixel is restless, by the usual one. Chi-square's quantiles by Wilson and Hilferty.
double most_variance(double usual, std::uint32_t frames, std::size_t pixels) {
    const double d = frames - 1.0, z = student_two_sided_quantile(kChanceOfFinding / double(pixels), 1e9);
    const auto ratio = [&](double deviations) {
        return std::pow(1.0 - 2.0 / (9.0 * d) + deviations * std::sqrt(2.0 / (9.0 * d)), 3.0);
    };
    return std::max(1.0, usual) * std::max(kRestless, 2.0 * ratio(z) / ratio(0.0));
}

// Lines whose middles lie apart: rows, or columns. scale: of single pixels.
std::vector<std::uint32_t> odd_lines(const Map &map, const std::vector<float> &rest, double pixel_scale, bool rows) {
    const std::uint32_t count = rows ? map.height : map.width, length = rows ? map.width : map.height;
    std::vector<double> middles;
    std::vector<std::uint32_t> lines;
    for (std::uint32_t line = 0; line < count; ++line) {
        std::vector<float> values;
        for (std::uint32_t k = 0; k < length; ++k) {
            const std::size_t i = rows ? std::size_t{line} * map.width + k : std::size_t{k} * map.width + line;
            if (map.counts(i))
                values.push_back(rest[i]);
        }
        if (values.size() < kLeastOfLine)
            continue;
        middles.push_back(middle_of(std::move(values)));
        lines.push_back(line);
    }
    std::vector<std::uint32_t> odd;
    if (middles.size() < kLeastLines)
        return odd;
    // A middle's own error: a few lines may be alike by chance.
    const double error = std::sqrt(0.5 * M_PI / double(length)) * pixel_scale;
    const double middle = middle_of(middles), scale = std::max({scale_of(middles), error, kLeastScale});
    for (std::size_t k = 0; k < lines.size(); ++k)
        if (std::abs(middles[k] - middle) > kApart * scale)
            odd.push_back(lines[k]);
    return double(odd.size()) > kMostOdd * double(lines.size()) ? std::vector<std::uint32_t>() : odd;
}

// Lines of laser light whose middle lies farther from all others' than those from each other, by level or by noise in
// time: telemetry. What light does to lines, it does to many.
std::vector<std::uint32_t> lines_apart(const Map &map, bool rows) {
    const std::uint32_t count = rows ? map.height : map.width, length = rows ? map.width : map.height;
    std::vector<std::uint32_t> odd;
    for (const bool by_noise : {false, true}) {
        if (by_noise && map.variance.empty())
            continue;
        std::vector<std::pair<double, std::uint32_t>> middles;
        for (std::uint32_t line = 0; line < count; ++line) {
            std::vector<float> values;
            for (std::uint32_t k = 0; k < length; ++k) {
                const std::size_t i = rows ? std::size_t{line} * map.width + k : std::size_t{k} * map.width + line;
                if (map.counts(i))
                    values.push_back(by_noise ? std::sqrt(map.variance[i]) : map.mean[i]);
            }
            if (values.size() >= kLeastOfLine)
                middles.emplace_back(middle_of(std::move(values)), line);
        }
        if (middles.size() < kLeastLines)
            continue;
        std::sort(middles.begin(), middles.end());
        const auto most = static_cast<std::size_t>(kMostOdd * double(middles.size()));
        // The largest gap, with few lines on one side of it.
        for (const bool above : {false, true})
            for (std::size_t few = most; few > 0; --few) {
                const std::size_t first = above ? middles.size() - few : few; // of the upper side
                const double gap = middles[first].first - middles[first - 1].first;
                const double spread = above ? middles[first - 1].first - middles.front().first
                                            : middles.back().first - middles[first].first;
                if (gap <= std::max(spread, kApart * kLeastScale))
                    continue;
                for (std::size_t k = above ? first : 0; k < (above ? middles.size() : first); ++k)
                    odd.push_back(middles[k].second);
                break;
            }
    }
    std::sort(odd.begin(), odd.end());
    odd.erase(std::unique(odd.begin(), odd.end()), odd.end());
    return double(odd.size()) > kMostOdd * double(count) ? std::vector<std::uint32_t>() : odd;
}

// A difference of halves, by groups (pairs of columns or rows, or cells), and whether chance does as much.
struct Halves {
    double difference = 0.0;
    bool by_chance = true;
};

Halves halves_of(const std::vector<double> &differences) {
    const double n = double(differences.size());
    const double mean = std::accumulate(differences.begin(), differences.end(), 0.0) / n;
    double square = 0.0;
    for (const double d : differences)
        square += (d - mean) * (d - mean);
    const double error = std::sqrt(square / (n - 1.0) / n);
    return {mean, error > 0.0 ? student_two_sided(mean / error, n - 1.0) > kChanceOfFinding : mean == 0.0};
}

std::vector<Mosaic> find_mosaic(const Map &map) {
    const std::uint32_t across = map.width / 2, down = map.height / 2;
    if (across < kLeastCells || down < kLeastCells)
        return {};
    std::vector<double> columns(across), rows(down), in_columns(across), in_rows(down), columns_n(across), rows_n(down);
    Mosaic mosaic;
    double cells = 0.0;
    // The last four sites are those of the next cells: a slope is no difference from both neighbours.
    for (std::uint32_t y = 0; 2 * y + 2 < map.height; ++y)
        for (std::uint32_t x = 0; 2 * x + 2 < map.width; ++x) {
            const std::size_t i = std::size_t{2 * y} * map.width + 2 * x, below = i + map.width,
                              next = below + map.width;
            const std::size_t sites[8] = {i, i + 1, below, below + 1, i + 2, below + 2, next, next + 1};
            if (!std::all_of(sites, sites + 8, [&](std::size_t s) { return map.counts(s); }))
                continue;
            double v[8];
            for (int k = 0; k < 8; ++k)
                v[k] = map.mean[sites[k]];
            for (std::size_t k = 0; k < 4; ++k)
                mosaic.levels[k] += v[k];
            columns[x] += 0.5 * (v[1] + v[3] - 0.5 * (v[0] + v[2] + v[4] + v[5]));
            rows[y] += 0.5 * (v[2] + v[3] - 0.5 * (v[0] + v[1] + v[6] + v[7]));
            in_columns[x] += 0.5 * (v[0] + v[3] - v[1] - v[2]);
            in_rows[y] += 0.5 * (v[0] + v[3] - v[1] - v[2]);
            ++columns_n[x];
            ++rows_n[y];
            ++cells;
        }
    const auto means = [](std::vector<double> sums, const std::vector<double> &counts) {
        std::vector<double> result;
        for (std::size_t k = 0; k < sums.size(); ++k)
            if (counts[k] > 0.0)
                result.push_back(sums[k] / counts[k]);
        return result;
    };
    const std::vector<double> by[4] = {means(columns, columns_n), means(rows, rows_n), means(in_columns, columns_n),
                                       means(in_rows, rows_n)};
    if (std::any_of(by, by + 4, [](const auto &groups) { return groups.size() < kLeastCells; }))
        return {};
    Halves diagonal = halves_of(by[2]);
    diagonal.by_chance |= halves_of(by[3]).by_chance;
    for (const Halves &halves : {halves_of(by[0]), halves_of(by[1]), diagonal})
        if (!halves.by_chance)
            mosaic.contrast = std::max(mosaic.contrast, std::abs(halves.difference));
    for (double &level : mosaic.levels)
        level /= cells;
    return mosaic.contrast > 0.0 ? std::vector<Mosaic>{mosaic} : std::vector<Mosaic>{};
}

// Of sites of 2 x 2 pixels, where all of these count.
std::vector<Mosaic> find_mosaic_of_blocks(const Map &map) {
    std::vector<std::uint8_t> mask;
    Map blocks{map.width / 2, map.height / 2, &mask, {}, {}, map.frames};
    for (std::uint32_t y = 0; y < blocks.height; ++y)
        for (std::uint32_t x = 0; x < blocks.width; ++x) {
            const std::size_t i = std::size_t{2 * y} * map.width + 2 * x;
            const std::size_t pixels[4] = {i, i + 1, i + map.width, i + map.width + 1};
            float sum = 0.0f;
            for (const std::size_t pixel : pixels)
                sum += map.mean[pixel];
            blocks.mean.push_back(0.25f * sum);
            mask.push_back(std::all_of(pixels, pixels + 4, [&](std::size_t s) { return map.counts(s); }) ? 1 : 0);
        }
    std::vector<Mosaic> found = find_mosaic(blocks);
    for (Mosaic &mosaic : found)
        mosaic.side = 2;
    return found;
}

} // namespace

PixelOddities find_oddities(const PixelSums &pixels) {
    PixelOddities result;
    if (pixels.ends)
        result.transients =
            find_transients(*pixels.ends, pixels.sums, pixels.squares, pixels.sequence.frame_count,
                            pixels.sequence.mask.empty() ? nullptr : pixels.sequence.mask.data(), pixels.step_dn);
    const Map map = map_of(pixels, result.transients);
    const CaptureScene scene = pixels.sequence.scene;
    const bool even = !is_laser(scene);
    if (scene != CaptureScene::kDark && (even || scene == CaptureScene::kBoard)) {
        result.mosaic = find_mosaic(map);
        const std::vector<Mosaic> of_blocks = find_mosaic_of_blocks(map);
        if (!of_blocks.empty() &&
            (result.mosaic.empty() || of_blocks.front().contrast > result.mosaic.front().contrast))
            result.mosaic = of_blocks;
    }
    if (even) {
        const std::vector<float> variances = counted(map, map.variance);
        if (counted(map, map.mean).size() < kLeastPixels)
            return result;
        const std::vector<float> rest = without_surface(map);
        const std::vector<float> all = counted(map, rest);
        const double middle = middle_of(all), scale = std::max(scale_of(all), kLeastScale);
        const double most = variances.empty() ? 0.0 : most_variance(middle_of(variances), map.frames, all.size());
        for (std::size_t i = 0; i < rest.size(); ++i) {
            if (!map.counts(i))
                continue;
            const auto index = static_cast<std::uint32_t>(i);
            if (std::abs(rest[i] - middle) > kApart * scale)
                result.pixels.push_back({index, rest[i] > middle ? PixelOddity::bright : PixelOddity::dark});
            else if (!variances.empty() && map.variance[i] > most)
                result.pixels.push_back({index, PixelOddity::restless});
        }
        result.rows = odd_lines(map, rest, scale, true);
        result.columns = odd_lines(map, rest, scale, false);
    } else {
        result.rows = lines_apart(map, true);
        result.columns = lines_apart(map, false);
    }
    if (even || (scene == CaptureScene::kBoard && pixels.sequence.moving))
        if (const auto least = least_variance(map, pixels.step_dn))
            for (std::size_t i = 0; i < map.variance.size(); ++i)
                if (map.counts(i) && map.variance[i] < *least && map.mean[i] < pixels.layout.maximum_code())
                    result.pixels.push_back({static_cast<std::uint32_t>(i), PixelOddity::stuck});
    std::stable_sort(result.pixels.begin(), result.pixels.end(),
                     [](const OddPixel &a, const OddPixel &b) { return a.index < b.index; });
    result.pixels.erase(std::unique(result.pixels.begin(), result.pixels.end(),
                                    [](const OddPixel &a, const OddPixel &b) { return a.index == b.index; }),
                        result.pixels.end());
    if (double(result.pixels.size()) > kMostOdd * double(map.mean.size()))
        result.pixels.clear();
    return result;
}

OddPlaces places_of(const std::vector<const PixelOddities *> &sequences, std::uint32_t width, std::uint32_t height) {
    std::map<std::uint32_t, PixelOddity> odd;
    std::vector<std::uint32_t> in_row(height), in_column(width);
    std::vector<bool> rows(height), columns(width);
    for (const PixelOddities *one : sequences) {
        for (const OddPixel &pixel : one->pixels)
            odd.try_emplace(pixel.index, pixel.how);
        for (const std::uint32_t row : one->rows)
            rows[row] = true;
        for (const std::uint32_t column : one->columns)
            columns[column] = true;
    }
    for (const auto &[index, how] : odd) {
        ++in_row[index / width];
        ++in_column[index % width];
    }
    for (std::uint32_t y = 0; y < height; ++y)
        rows[y] = rows[y] || in_row[y] > kLine * width;
    for (std::uint32_t x = 0; x < width; ++x)
        columns[x] = columns[x] || in_column[x] > kLine * height;

    OddPlaces places;
    const auto runs = [](const std::vector<bool> &lines, const auto &add) {
        for (std::uint32_t first = 0; first < lines.size(); ++first) {
            if (!lines[first])
                continue;
            std::uint32_t last = first;
            while (last + 1 < lines.size() && lines[last + 1])
                ++last;
            add(first, last);
            first = last;
        }
    };
    runs(rows, [&](std::uint32_t a, std::uint32_t b) { places.rows.push_back({a, b, 0, width - 1}); });
    runs(columns, [&](std::uint32_t a, std::uint32_t b) { places.columns.push_back({0, height - 1, a, b}); });

    // What is left, in groups of near pixels.
    std::vector<OddPixel> left;
    for (const auto &[index, how] : odd)
        if (!rows[index / width] && !columns[index % width])
            left.push_back({index, how});
    std::vector<std::size_t> group(left.size());
    std::iota(group.begin(), group.end(), std::size_t{0});
    const auto root = [&](std::size_t k) {
        while (group[k] != k)
            k = group[k] = group[group[k]];
        return k;
    };
    for (std::size_t a = 0; a < left.size(); ++a)
        for (std::size_t b = a + 1; b < left.size(); ++b) {
            const std::uint32_t dy = left[b].index / width - left[a].index / width;
            if (dy > 1)
                break;
            const auto dx = std::abs(std::int64_t{left[b].index % width} - std::int64_t{left[a].index % width});
            if (dx <= (dy == 0 ? kNearX : 1u))
                group[root(b)] = root(a);
        }
    std::map<std::size_t, std::vector<OddPixel>> groups;
    for (std::size_t k = 0; k < left.size(); ++k)
        groups[root(k)].push_back(left[k]);
    for (const auto &[first, members] : groups) {
        PixelBlock box{height, 0, width, 0};
        for (const OddPixel &pixel : members) {
            const std::uint32_t y = pixel.index / width, x = pixel.index % width;
            box = {std::min(box.first_row, y), std::max(box.last_row, y), std::min(box.first_column, x),
                   std::max(box.last_column, x)};
        }
        const double area = double(box.last_row - box.first_row + 1) * (box.last_column - box.first_column + 1);
        if (members.size() >= kLeastBlock && double(members.size()) >= kBlockFill * area)
            places.blocks.push_back(box);
        else
            places.single.insert(places.single.end(), members.begin(), members.end());
    }
    std::sort(places.single.begin(), places.single.end(),
              [](const OddPixel &a, const OddPixel &b) { return a.index < b.index; });
    return places;
}

} // namespace clsp

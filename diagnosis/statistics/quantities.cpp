#include "statistics/quantities.hpp"

#include "runtime/error.hpp"
#include "statistics/dot_shape.hpp"
#include "statistics/make_frames.hpp"
#include "statistics/sequence_level.hpp"
#include "statistics/spectrum_sums.hpp"
#include "statistics/statistic_groups.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>

namespace clsp {

namespace {

using namespace statistics;

constexpr double kTurn = 2.0 * M_PI;
// A code that does not occur is missing where its neighbours have so many pixels each, on average: by chance it would
// hardly be.
constexpr double kPixelsOfACode = 20.0;
constexpr std::size_t kNeighbours = 4; // to each side

class List {
  public:
    void put(const char *name, const char *unit, double value) {
        all_.push_back({name, unit, std::isfinite(value) ? value : kNotTold});
    }
    std::vector<Quantity> take() { return std::move(all_); }

  private:
    std::vector<Quantity> all_;
};

// The root of what is left of a variance once noise is taken out; 0 where less than noise is there.
double root_beyond(double variance, double noise) { return std::sqrt(std::max(0.0, variance - noise)); }

// Widths of codes n, 1 + amplitude cos(2 pi (n - widest) / period). Noise spreads each pixel's values over the codes:
// what the histogram has at a frequency beyond what such noise lets through is the converter's.
struct CodeWave {
    double amplitude = kNotTold, period = kNotTold, widest = kNotTold, error = kNotTold;
};

CodeWave find_code_wave(const std::vector<std::uint64_t> &histogram, double noise_dn) {
    constexpr double kStandsOut = 6.0;   // deviations of what chance makes
    constexpr double kBeyondNoise = 4.0; // deviations of what noise lets through
    constexpr double kMost = 0.5;        // of an effect's amplitude: more are codes that are missing
    CodeWave found;
    double strongest = 0.0;
    for (const std::size_t period : {2, 4, 8, 16}) {
        std::complex<double> sum;
        double count = 0.0;
        // Light that is cut piles up in the first and the last code.
        for (std::size_t code = 1; code + 1 < histogram.size(); ++code) {
            sum += double(histogram[code]) * std::polar(1.0, kTurn * double(code % period) / double(period));
            count += double(histogram[code]);
        }
        const double share = count > 0.0 ? std::abs(sum) / count : 0.0, turns = noise_dn / double(period);
        const double error = std::sqrt(0.5 / count) / share; // radians
        if (share <= strongest || share <= kBeyondNoise * std::exp(-0.5 * kTurn * kTurn * turns * turns))
            continue;
        strongest = share;
        const bool alternates = period == 2; // both ends of a period are one code apart: a share is all of the wave
        const double amplitude = alternates ? share : 2.0 * share;
        found = {};
        if (kStandsOut * error > 1.0 || amplitude > kMost)
            continue;
        const double codes_a_radian = double(period) / kTurn;
        const double widest = std::fmod(std::arg(sum) * codes_a_radian + double(period), double(period));
        found = {amplitude, double(period), alternates ? std::round(widest) : widest,
                 alternates ? 0.0 : error * codes_a_radian};
    }
    return found;
}

// Of the codes; before black level and scale.
void put_codes(const StatisticInput &in, double noise_dn, List &list) {
    const std::vector<std::uint64_t> &histogram = in.frames.histogram;
    const double total = double(in.geometry.frames) * double(in.geometry.used);
    const CodeWave wave = find_code_wave(histogram, noise_dn);
    list.put("code_width_wave", "codes", wave.amplitude);
    list.put("code_width_period", "codes", wave.period);
    list.put("widest_code", "codes", wave.widest);
    list.put("widest_code_error", "codes", wave.error);
    // Light that is cut piles up in the first and the last code.
    double missing = 0.0, told = 0.0;
    for (std::size_t code = kNeighbours + 1; code + kNeighbours + 1 < histogram.size(); ++code) {
        double around = 0.0;
        for (std::size_t k = 1; k <= kNeighbours; ++k)
            around += double(histogram[code - k] + histogram[code + k]) / (2.0 * kNeighbours);
        if (around < kPixelsOfACode)
            continue;
        told += 1.0;
        missing += histogram[code] == 0;
    }
    list.put("codes_missing", "%", told > 0.0 ? 100.0 * missing / told : kNotTold);
    list.put("codes_at_zero", "%", 100.0 * double(histogram.front()) / total);
    list.put("codes_at_maximum", "%", 100.0 * double(histogram.back()) / total);
}

// Rows or columns that are not masked whole.
double lines_used(const std::vector<double> &used) {
    return double(std::count_if(used.begin(), used.end(), [](double pixels) { return pixels > 0.0; }));
}

// What changes from frame to frame. Row, column and frame noise without what the noise of single pixels does to the
// means.
void put_temporal(const StatisticInput &in, double temporal_noise_dn, List &list) {
    const Geometry &geometry = in.geometry;
    const double frames = double(geometry.frames);
    if (geometry.frames < 2)
        return;
    double of_means = 0.0;
    for (const double mean : in.frames.frame_mean)
        of_means += (mean - in.frames.mean_signal) * (mean - in.frames.mean_signal) / (frames - 1.0);
    const double pixel = in.frames.pixel_variance, of_frame = pixel / double(geometry.used);
    // A moving scene's frames differ by their speckle.
    if (!geometry.moving) {
        double rows = 0.0;
        for (std::size_t t = 0; t < geometry.frames; ++t)
            for (std::size_t y = 0; y < geometry.height; ++y) {
                const double mean = in.frames.row_mean[t * geometry.height + y];
                rows += geometry.row_used[y] * mean * mean;
            }
        // Times the pixels of a line: what independent pixels have is the pixels' variance.
        const double unbiased = frames / (frames - 1.0);
        const double row_count = lines_used(geometry.row_used), column_count = lines_used(geometry.column_used);
        rows *= unbiased / (frames * row_count);
        const double columns = unbiased * in.residual.column_variance * double(geometry.width) / column_count;
        const double row_pixels = double(geometry.used) / row_count,
                     column_pixels = double(geometry.used) / column_count;
        list.put("temporal_noise", "DN", temporal_noise_dn);
        list.put("row_noise", "DN", root_beyond(rows / row_pixels, pixel / row_pixels));
        list.put("column_noise", "DN", root_beyond(columns / column_pixels, pixel / column_pixels));
        list.put("frame_mean_deviation", geometry.is_lit() ? "%" : "DN",
                 geometry.is_lit() ? 100.0 * root_beyond(of_means, of_frame) / in.frames.light
                                   : root_beyond(of_means, of_frame));
    }
    if (geometry.is_static_laser()) {
        const char *names[] = {"image_shift_x", "image_shift_y"};
        for (std::size_t k = 0; k < 2; ++k) {
            const ResidualSums::Motion &motion = in.residual.motions[k];
            double square = 0.0;
            for (const double amount : motion.amount)
                square += amount * amount / (frames - 1.0);
            list.put(names[k], "px", root_beyond(square, ratio(pixel, motion.information)));
        }
    }
}

// Dark and flat: EMVA 1288's spatial standard deviation, without the smooth field and without what is left of the
// temporal noise in a mean of frames.
void put_fixed_pattern(const StatisticInput &in, List &list) {
    const Geometry &geometry = in.geometry;
    const std::vector<float> pattern =
        without_field(geometry, in.frames.mean, fit_field(geometry, in.frames.mean, kFieldTerms));
    double square = 0.0;
    std::vector<double> rows(geometry.height), columns(geometry.width);
    for (std::size_t y = 0; y < geometry.height; ++y)
        for (std::size_t x = 0; x < geometry.width; ++x) {
            const double value = pattern[y * geometry.width + x];
            square += value * value / double(geometry.used);
            rows[y] += value;
            columns[x] += value;
        }
    const auto of_lines = [&](const std::vector<double> &totals, const std::vector<double> &used) {
        double beyond = 0.0, lines = 0.0;
        for (std::size_t k = 0; k < totals.size(); ++k)
            if (used[k] > 0.0) {
                beyond += (totals[k] * totals[k] / used[k] - square) / used[k];
                lines += 1.0;
            }
        return root_beyond(ratio(beyond, lines), 0.0);
    };
    // Of a single frame pattern and noise are one.
    const double temporal = geometry.frames > 1 ? in.frames.pixel_variance / double(geometry.frames) : kNotTold;
    list.put("fixed_pattern", "DN", std::isfinite(temporal) ? root_beyond(square, temporal) : kNotTold);
    const bool told = geometry.frames > 1;
    list.put("row_fixed_pattern", "DN", told ? of_lines(rows, geometry.row_used) : kNotTold);
    list.put("column_fixed_pattern", "DN", told ? of_lines(columns, geometry.column_used) : kNotTold);
    SpectralLine line;
    sum_spectrum(geometry, 1.0, {pattern.data()}, 1, &line);
    // Chance makes of noise what stands out so far once in 10,000 times.
    constexpr double kBeyondChance = 3.72;
    const auto of_line = [&](double value) { return line.prominence > kBeyondChance ? value : kNotTold; };
    list.put("wave_amplitude", "DN", of_line(line.amplitude));
    list.put("wave_frequency_x", "1/px", of_line(line.frequency_x));
    list.put("wave_frequency_y", "1/px", of_line(line.frequency_y));
    // Of one wave in white noise, the Cramer-Rao bound (Rife and Boorstyn 1974); from two frequencies under a Hann
    // window it is so many times that, root mean square (of 600 waves at frequencies drawn in NumPy 2.34).
    constexpr double kOfWindow = 2.35;
    const double rest = std::max(square - 0.5 * line.amplitude * line.amplitude, 0.0);
    const double side = double(std::min(geometry.width, geometry.height));
    list.put("wave_frequency_error", "1/px",
             of_line(kOfWindow * std::sqrt(6.0 * rest / double(geometry.used)) / (M_PI * line.amplitude * side)));
}

// How much darker the corner is than the axis: light = l (1 - a r^2), r = 1 in the corner.
void put_fall_off(const StatisticInput &in, List &list) {
    const FieldCoefficients field = fit_field(in.geometry, in.frames.mean, 4);
    list.put("corner_loss", "%", field[0] > 0.0 ? -100.0 * field[3] / field[0] : kNotTold);
}

// Full width at half maximum of the speckle's autocorrelation along an axis: between whole pixels by a straight line.
double half_width(const std::vector<float> &image, const Geometry &geometry, bool along_x, double noise_square) {
    const double zero = ratio(lag_sum(image.data(), image.data(), geometry.width, geometry.height, {0, 0}),
                              geometry.pairs({0, 0})) -
                        noise_square;
    double last = 1.0;
    for (int lag = 1; lag <= kMaximumLag && zero > 0.0; ++lag) {
        const Lag step = along_x ? Lag{lag, 0} : Lag{0, lag};
        const double here =
            ratio(lag_sum(image.data(), image.data(), geometry.width, geometry.height, step), geometry.pairs(step)) /
            zero;
        if (here <= 0.5)
            return 2.0 * (double(lag - 1) + (last - 0.5) / (last - here));
        last = here;
    }
    return kNotTold;
}

void put_speckle(const StatisticInput &in, List &list) {
    const Geometry &geometry = in.geometry;
    const bool over_time = geometry.moving && geometry.frames > 1;
    // Moving: the residuals of all frames (or of the first, for the autocorrelation, which is long to sum and the same
    // in all).
    std::vector<float> image;
    double variance = 0.0, noise = in.frames.read_variance, noise_of_image = noise, cube = 0.0;
    Powers powers;
    if (over_time) {
        powers = in.residual.powers;
        // Unbiased: residuals are from the mean of the frames themselves. Those of two are each other's negative.
        const double frames = double(geometry.frames), samples = frames * double(geometry.used);
        variance = powers.square / samples * frames / (frames - 1.0);
        cube = frames > 2.0 ? powers.cube / samples * frames * frames / ((frames - 1.0) * (frames - 2.0)) : kNotTold;
        const float *first = in.frames.residual_of(geometry, 0);
        image.assign(first, first + geometry.pixels);
        noise_of_image *= 1.0 - 1.0 / frames;
    } else {
        image = without_field(geometry, in.frames.mean, fit_field(geometry, in.frames.mean, 4));
        for (std::size_t y = 0; y < geometry.height; ++y)
            powers.add(image.data() + y * geometry.width, geometry.width);
        variance = powers.square / double(geometry.used);
        cube = powers.cube / double(geometry.used);
        noise_of_image = noise /= double(geometry.frames);
    }
    const double speckle = std::max(0.0, variance - noise);
    list.put("contrast", "1", in.frames.mean_signal > 0.0 ? std::sqrt(speckle) / in.frames.light : kNotTold);
    list.put("intensity_skewness", "1", speckle > 0.0 ? cube / std::pow(speckle, 1.5) : kNotTold);
    list.put("grain_width_x", "px", half_width(image, geometry, true, noise_of_image));
    list.put("grain_width_y", "px", half_width(image, geometry, false, noise_of_image));
}

// Of a Gaussian dot whose width under a Gaussian window is known: the squares' inverses add up.
double without_window(double width, double window) {
    const double inverse = 1.0 / (width * width) - 1.0 / (window * window);
    return inverse > 0.0 ? 1.0 / std::sqrt(inverse) : kNotTold;
}

void put_dots(const StatisticInput &in, List &list) {
    const Geometry &geometry = in.geometry;
    double background = 0.0;
    for (const std::uint32_t pixel : geometry.dots.between)
        background += double(in.frames.mean[pixel]) / double(geometry.dots.between.size());
    const DotPositions positions = locate_dots(geometry, in.frames.mean, background);
    const DotShape shape = measure_shape(geometry, in.frames.mean, background, positions, 0.0);
    const double least = kLeastCore * expected_core(geometry) * in.frames.light;
    const bool is_seen = visibility(shape, least) > 0.0 && in.frames.mean_signal > 0.0;
    const auto told = [&](double value) { return is_seen ? value : kNotTold; };
    const double window = kShapeWindow * geometry.dots.sigma;
    list.put("dot_width_x", "px", told(without_window(shape.width_x, window)));
    list.put("dot_width_y", "px", told(without_window(shape.width_y, window)));
    list.put("dot_shift_x", "px", told(positions.terms[kShiftX]));
    list.put("dot_shift_y", "px", told(positions.terms[kShiftY]));
    if (geometry.dots.positions.size() >= kDotsForField) {
        list.put("dot_magnification", "%", told(100.0 * positions.terms[kRadial] / geometry.corner_radius));
        list.put("dot_cubic_displacement", "px", told(positions.terms[kCubic]));
    }
    if (!geometry.dots.between.empty())
        list.put("light_between_dots", "%", told(100.0 * background / shape.core));
    const double axis = window_mean(geometry, in.frames.mean, geometry.principal_point, geometry.dots.sigma);
    list.put("light_on_axis", "%", told(100.0 * (axis - background) / shape.core));
}

} // namespace

std::vector<Quantity> sequence_quantities(const CaptureLayout &layout, std::size_t sequence, const std::uint16_t *codes,
                                          std::uint32_t frame_count, const Calibration &calibration, unsigned threads) {
    if (!codes)
        throw Error(Status::kInvalidArgument,
                    "quantities of a sequence: codes is NULL; give frame_count * height * width codes.");
    const Geometry geometry(layout, sequence, frame_count);
    SpareBuffers<float> spare;
    const auto sums = make_host_sums(threads, spare);
    const Frames frames = make_frames(geometry, codes, calibration, *sums);
    const ResidualSums residual = sum_residuals(geometry, frames, *sums);
    const StatisticInput in{geometry, frames, residual, *sums, codes, calibration.black_level_dn, nullptr, threads};
    List list;
    if (geometry.is_lit())
        list.put("mean_signal", "DN", frames.mean_signal);
    else
        list.put("dark_offset", "DN", frames.mean_signal + calibration.black_level_dn);
    const double noise_dn =
        frame_count > 1 ? sequence_level(layout, sequence, codes, frame_count).temporal_noise_dn : kNotTold;
    put_temporal(in, noise_dn, list);
    switch (geometry.scene) {
    case CaptureScene::kDark:
        put_fixed_pattern(in, list);
        break;
    case CaptureScene::kFlat:
        put_fixed_pattern(in, list);
        put_fall_off(in, list);
        break;
    case CaptureScene::kBoard:
        put_speckle(in, list);
        put_fall_off(in, list);
        break;
    case CaptureScene::kDots:
        put_dots(in, list);
        break;
    }
    put_codes(in, frame_count > 1 ? noise_dn : std::sqrt(frames.read_variance), list);
    return list.take();
}

std::vector<Quantity> pattern_quantities(const Capture &capture, const Calibration &calibration, unsigned threads) {
    std::vector<Quantity> result;
    for (std::size_t s = 0; s < capture.codes.size(); ++s) {
        const SequenceLayout &sequence = capture.layout.sequences[s];
        if (is_laser(sequence.scene))
            continue;
        const auto own = sequence_quantities(capture.layout, s, capture.codes[s].data(), sequence.frame_count,
                                             calibration, threads);
        result.insert(result.end(), own.begin(), own.end());
    }
    return result;
}

} // namespace clsp

#include "measure/pattern_maps.hpp"

#include "capture/stored_sequence.hpp"
#include "effects/effects.hpp"
#include "measure/clipped_dark.hpp"
#include "measure/variance_components.hpp"
#include "simulator/sequence_model.hpp"
#include "stages/sensor_response.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/core.h>
#include <numeric>

namespace clsp {
namespace {

constexpr double kBeyondChance = 4.0; // standard errors of a variance, at two frames: of more frames it is more
constexpr std::size_t kBlock = 16;   // pixels along a side: more than neighbors share
constexpr double kMostSignal = 0.9; // of the full well or of the converter's range: patterns are cut off beyond it

// Variances of the two-way layout: of single pixels, of rows' means, of columns' means, each without what the others
// hold.
struct Parts {
    double pixel = 0.0, row = 0.0, column = 0.0;

    Parts times(double factor) const { return {factor * pixel, factor * row, factor * column}; }
    Parts plus(const Parts &other) const { return {pixel + other.pixel, row + other.row, column + other.column}; }
    double total() const { return pixel + row + column; }
};

struct MeanFrame {
    std::size_t sequence = 0;
    double frames = 0.0;
    std::vector<double> mean;           // by pixel
    std::vector<std::uint8_t> unmasked; // by pixel
    std::vector<std::uint8_t> at_top;   // by pixel: in any frame
    double level = 0.0;                 // of unmasked pixels
    double zero_share = 0.0;            // of codes, but for pixels that are always 0: those are defects, not noise
    Parts noise; // what is left of the noise over time; whole frames that flicker are none of it
};

// Rounding is lost in noise; where there is none, a pixel's mean is off by as much as a uniform law of one step: the
// series of a rounding error under Gaussian noise.
double rounding_variance(double noise_variance, double step) {
    double sum = 0.0;
    for (int k = 1; k <= 50; ++k)
        sum += std::exp(-4.0 * M_PI * M_PI * k * k * noise_variance / (step * step)) / (k * k);
    return step * step / (2.0 * M_PI * M_PI) * sum;
}

// Sums of whole numbers, frame by frame.
MeanFrame mean_frame(const Capture &capture, std::size_t sequence, double code_step,
                     const std::function<void()> &checkpoint) {
    const CaptureLayout &layout = capture.layout;
    const SequenceLayout &of = layout.sequences[sequence];
    const std::size_t width = layout.width, height = layout.height, pixels = layout.pixel_count();
    const auto top = static_cast<std::uint32_t>(layout.maximum_code());
    MeanFrame result;
    result.sequence = sequence;
    result.frames = of.frame_count;
    result.unmasked.assign(pixels, 1);
    if (!of.mask.empty())
        std::transform(of.mask.begin(), of.mask.end(), result.unmasked.begin(),
                       [](std::uint8_t used) { return std::uint8_t{used != 0}; });
    std::vector<double> in_row(height), in_column(width);
    for (std::size_t i = 0; i < pixels; ++i) {
        in_row[i / width] += result.unmasked[i];
        in_column[i % width] += result.unmasked[i];
    }
    result.at_top.assign(pixels, 0);
    const double used = std::accumulate(in_row.begin(), in_row.end(), 0.0);
    std::vector<std::uint32_t> sums(pixels);
    std::vector<std::uint16_t> room;
    // Of rows' and columns' means less the frame's, over the frames.
    std::vector<double> row_sum(height), row_square(height), column_sum(width), column_square(width), column(width);
    std::vector<std::uint32_t> columns(width);
    double frame_sum = 0.0, frame_square = 0.0;
    long double squares = 0.0; // of codes
    std::uint64_t zeros = 0, dead = 0; // codes; pixels that are nothing but 0
    for (std::uint32_t t = 0; t < of.frame_count; ++t) {
        checkpoint();
        const std::uint16_t *codes = frame_of(capture, sequence, t, room);
        std::vector<double> rows(height);
        std::fill(columns.begin(), columns.end(), 0u);
        for (std::size_t y = 0; y < height; ++y) {
            std::uint64_t row = 0, square = 0;
            for (std::size_t x = 0, i = y * width; x < width; ++x, ++i) {
                const std::uint32_t code = result.unmasked[i] ? codes[i] : 0u;
                sums[i] += code;
                columns[x] += code;
                row += code;
                square += std::uint64_t{code} * code;
                zeros += result.unmasked[i] && code == 0u;
                result.at_top[i] |= code == top;
            }
            rows[y] = double(row);
            squares += static_cast<long double>(square);
        }
        const double mean = std::accumulate(rows.begin(), rows.end(), 0.0) / std::max(1.0, used);
        frame_sum += mean;
        frame_square += mean * mean;
        for (std::size_t y = 0; y < height; ++y)
            if (in_row[y] > 0.0) {
                const double apart = rows[y] / in_row[y] - mean;
                row_sum[y] += apart;
                row_square[y] += apart * apart;
            }
        for (std::size_t x = 0; x < width; ++x)
            if (in_column[x] > 0.0) {
                const double apart = columns[x] / in_column[x] - mean;
                column_sum[x] += apart;
                column_square[x] += apart * apart;
            }
    }
    const double n = result.frames;
    result.mean.resize(pixels);
    long double sum_squares = 0.0;
    for (std::size_t i = 0; i < pixels; ++i) {
        result.mean[i] = double(sums[i]) / n;
        sum_squares += static_cast<long double>(sums[i]) * sums[i];
        dead += result.unmasked[i] && sums[i] == 0u;
    }
    result.level = frame_sum / n;
    result.zero_share = (double(zeros) - n * double(dead)) / std::max(1.0, n * (used - double(dead)));
    if (of.frame_count < 2)
        return result;
    const auto variance = [n](double sum, double square) { return std::max(0.0, square - sum * sum / n) / (n - 1.0); };
    const auto mean_variance = [&](const std::vector<double> &sum, const std::vector<double> &square,
                                   const std::vector<double> &count) {
        double total = 0.0, lines = 0.0;
        for (std::size_t i = 0; i < sum.size(); ++i)
            if (count[i] > 0.0) {
                total += variance(sum[i], square[i]);
                ++lines;
            }
        return total / std::max(1.0, lines);
    };
    const double whole = double((squares - sum_squares / n) / (n - 1.0)) / std::max(1.0, used);
    const double rows = mean_variance(row_sum, row_square, in_row);
    const double columns_part = mean_variance(column_sum, column_square, in_column);
    const double pixel = std::max(0.0, whole - variance(frame_sum, frame_square) - rows - columns_part);
    result.noise = Parts{pixel, rows, columns_part}.times(1.0 / n);
    result.noise.pixel += rounding_variance(whole, code_step);
    return result;
}

// By how much blocks of pixels differ, where that is more than single pixels of that variance make; else 0.
template <typename Rest>
double smooth_deviation(const ImageShape &shape, const std::vector<std::uint8_t> &counts, double pixel_variance,
                        const Rest &rest) {
    const std::size_t across = (shape.width + kBlock - 1) / kBlock, down = (shape.height + kBlock - 1) / kBlock;
    std::vector<double> sums(across * down), used(across * down);
    for (std::size_t i = 0; i < shape.size(); ++i)
        if (counts[i]) {
            const std::size_t block = i / shape.width / kBlock * across + i % shape.width / kBlock;
            sums[block] += rest(i);
            ++used[block];
        }
    double excess = 0.0, by_pixels = 0.0, squares = 0.0, blocks = 0.0;
    for (std::size_t b = 0; b < sums.size(); ++b)
        if (used[b] > 0.0) {
            const double of_pixels = pixel_variance / used[b];
            excess += std::pow(sums[b] / used[b], 2) - of_pixels;
            by_pixels += of_pixels;
            squares += 2.0 * of_pixels * of_pixels;
            ++blocks;
        }
    return excess > std::max(by_pixels, kBeyondChance * std::sqrt(squares)) ? std::sqrt(excess / blocks) : 0.0;
}

// An image's pattern, taken apart and put together again without the noise's part of each variance. noise: of the
// image. Pixels that do not count get 0.
void hold_pattern(const ImageShape &shape, const std::vector<double> &image, const std::vector<std::uint8_t> &counts,
                  const Parts &noise, double middle, PatternMap &map) {
    std::vector<std::uint8_t> usual = counts; // rows and columns are not what one hot pixel makes of them
    leave_out_defects(shape, image, usual);
    std::vector<double> rows(shape.height), columns(shape.width), in_row(shape.height), in_column(shape.width);
    double sum = 0.0, used = 0.0;
    for (std::size_t i = 0; i < shape.size(); ++i)
        if (usual[i]) {
            rows[i / shape.width] += image[i];
            columns[i % shape.width] += image[i];
            ++in_row[i / shape.width];
            ++in_column[i % shape.width];
            sum += image[i];
            ++used;
        }
    const double mean = sum / std::max(1.0, used);
    const auto square_of = [&](std::vector<double> &lines, const std::vector<double> &in_line) {
        double square = 0.0, count = 0.0;
        for (std::size_t i = 0; i < lines.size(); ++i) {
            lines[i] = in_line[i] > 0.0 ? lines[i] / in_line[i] - mean : 0.0;
            square += lines[i] * lines[i];
            count += in_line[i] > 0.0;
        }
        return count > 1.0 ? square / (count - 1.0) : 0.0;
    };
    const double row_square = square_of(rows, in_row), column_square = square_of(columns, in_column);
    const auto rest = [&](std::size_t i) { return image[i] - mean - rows[i / shape.width] - columns[i % shape.width]; };
    double squares = 0.0;
    for (std::size_t i = 0; i < shape.size(); ++i)
        squares += usual[i] ? rest(i) * rest(i) : 0.0;
    const double free = used - double(shape.height + shape.width) + 1.0;
    // A variance is that of a pattern where it is beyond what its own error and the noise's make by chance.
    const auto part = [](double square, double of_noise, double freedom) {
        const double by_chance = of_noise * (1.0 + kBeyondChance * std::sqrt(4.0 / std::max(freedom, 1.0)));
        return square > by_chance ? std::sqrt(1.0 - of_noise / square) : 0.0;
    };
    map.pixel_part = part(free > 0.0 ? squares / free : 0.0, noise.pixel, free);
    map.row_part = part(row_square, noise.row, double(shape.height) - 1.0);
    map.column_part = part(column_square, noise.column, double(shape.width) - 1.0);
    map.standard_error = std::sqrt(noise.total());
    map.smooth_deviation = smooth_deviation(shape, usual, free > 0.0 ? squares / free : 0.0, rest);
    map.values.resize(shape.size());
    double all = 0.0, counted = 0.0;
    for (std::size_t i = 0; i < shape.size(); ++i) {
        if (!counts[i])
            continue;
        const double pattern = (usual[i] ? map.pixel_part : 1.0) * rest(i) + map.row_part * rows[i / shape.width] +
                               map.column_part * columns[i % shape.width];
        map.values[i] = static_cast<float>(pattern);
        all += pattern;
        ++counted;
    }
    // The mean of those that count is `middle`, and others have it.
    const double shift = middle - all / std::max(1.0, counted);
    for (std::size_t i = 0; i < shape.size(); ++i)
        map.values[i] = static_cast<float>(counts[i] ? map.values[i] + shift : middle);
}

// A map whose noise is larger than its pattern is not the camera's: patterns drawn anew are nearer.
std::optional<PatternMap> told(PatternMap map, const std::vector<std::uint8_t> &counts, const char *name,
                               const char *unit, std::vector<std::string> &notes) {
    double sum = 0.0, squares = 0.0, count = 0.0;
    for (std::size_t i = 0; i < map.values.size(); ++i)
        if (counts[i]) {
            const double value = map.values[i];
            sum += value;
            squares += value * value;
            ++count;
        }
    const double mean = sum / std::max(1.0, count);
    const double deviation = std::sqrt(std::max(0.0, squares / std::max(1.0, count) - mean * mean));
    if (deviation > 0.0 && deviation >= map.standard_error)
        return map;
    notes.push_back(deviation > 0.0
                        ? fmt::format("no {} map: its noise, {:.3g}{}, is larger than its pattern, {:.3g}{}; "
                                      "record more frames{}",
                                      name, map.standard_error, unit, deviation, unit,
                                      *unit ? "" : ", or with more light")
                        : fmt::format("no {} map: the frames show no pattern beyond their noise", name));
    return {};
}

class Measurement {
  public:
    Measurement(const Capture &given, const DiagnosisResult &result, const EffectSettings &effects,
                const CalibratedLevels &levels, const std::function<void()> &checkpoint)
        : given_(given), result_(result), levels_(levels),
          checkpoint_(checkpoint), shape_{given.layout.width, given.layout.height} {
        for (const EffectSetting &setting : effects)
            if (in_catalogue(setting.id))
                catalogue_.push_back(setting);
    }

    PatternMaps run() {
        PatternMaps maps;
        maps.dark = dark_map(maps.notes);
        maps.gain = gain_map(maps.notes);
        return maps;
    }

  private:
    // The camera without fixed patterns.
    SensorParameters sensor_of(std::size_t sequence) const {
        SensorParameters sensor = *sequence_model(given_.layout, {}, sequence, catalogue_).model.sensor;
        sensor.black_level_dn = levels_.black_level_dn;
        return sensor;
    }
    static double code_step(const SensorParameters &sensor) {
        return sensor.effective_bits ? double(1u << (sensor.bits - sensor.effective_bits)) : 1.0;
    }

    // Those of a scene whose frames can be averaged; why the others cannot.
    std::vector<MeanFrame> mean_frames(CaptureScene scene, std::string &why) const {
        std::vector<MeanFrame> result;
        for (std::size_t s = 0; s < given_.layout.sequences.size(); ++s) {
            const SequenceLayout &of = given_.layout.sequences[s];
            if (of.scene != scene)
                continue;
            std::string reason;
            if (!std::count(result_.judged.begin(), result_.judged.end(), of.name))
                reason = "it was left out of the diagnosis";
            else if (std::any_of(result_.frame_changes.begin(), result_.frame_changes.end(),
                                 [&](const auto &change) { return change.sequence == of.name; }))
                reason = "its frames change";
            else if (of.frame_count < 2)
                reason = "one frame does not tell its noise from its pattern; record two or more";
            else if (given_.layout.pixel_count() > kMostMapPixels)
                reason = fmt::format("its frames have more than {} pixels", kMostMapPixels);
            if (reason.empty()) {
                const SensorParameters sensor = sensor_of(s);
                MeanFrame frame = mean_frame(given_, s, code_step(sensor), checkpoint_);
                reason = scene == CaptureScene::kDark ? cut_off_dark(frame) : cut_off_flat(frame, sensor);
                if (reason.empty())
                    result.push_back(std::move(frame));
            }
            if (!reason.empty())
                why += fmt::format("{}{}: {}", why.empty() ? "" : "; ", of.name, reason);
        }
        return result;
    }
    static std::string cut_off_dark(const MeanFrame &frame) {
        return frame.zero_share > kMostZeros
                   ? fmt::format("{:.2g} % of its codes are 0, so that means of pixels are not their levels; record "
                                 "with a higher black level",
                                 100.0 * frame.zero_share)
                   : "";
    }
    std::string cut_off_flat(const MeanFrame &frame, const SensorParameters &sensor) const {
        const double full = given_.layout.maximum_code() - sensor.black_level_dn;
        const double most = kMostSignal * std::min(full, response_dn(sensor, std::min(sensor.saturation_dn, full)));
        const double signal = frame.level - sensor.black_level_dn;
        return signal > most ? fmt::format("its light, {:.5g} DN, is above {:.5g} DN, where pixels are cut off; record "
                                           "with less light",
                                           signal, most)
                             : "";
    }

    PatternMap map_of(const std::vector<MeanFrame> &frames) const {
        PatternMap map;
        for (const MeanFrame &frame : frames) {
            map.sequences.push_back(given_.layout.sequences[frame.sequence].name);
            map.frame_count += given_.layout.sequences[frame.sequence].frame_count;
        }
        return map;
    }

    std::optional<PatternMap> dark_map(std::vector<std::string> &notes) {
        std::string why;
        const std::vector<MeanFrame> darks = mean_frames(CaptureScene::kDark, why);
        if (darks.empty()) {
            if (!why.empty())
                notes.push_back("no dark map: " + why);
            return {};
        }
        PatternMap map = map_of(darks);
        const double frames = map.frame_count;
        offsets_.assign(shape_.size(), 0.0);
        counts_.assign(shape_.size(), 0);
        std::vector<double> weights(shape_.size());
        double middle = 0.0;
        for (const MeanFrame &dark : darks) {
            const double part = dark.frames / frames;
            for (std::size_t i = 0; i < shape_.size(); ++i)
                if (dark.unmasked[i]) {
                    offsets_[i] += part * (dark.mean[i] - dark.level);
                    weights[i] += part;
                    counts_[i] = 1;
                }
            dark_noise_ = dark_noise_.plus(dark.noise.times(part * part));
            middle += part * (dark.level - mean_dark_dn(sensor_of(dark.sequence)));
        }
        for (std::size_t i = 0; i < shape_.size(); ++i)
            offsets_[i] = counts_[i] ? offsets_[i] / weights[i] : 0.0;
        hold_pattern(shape_, offsets_, counts_, dark_noise_, middle, map);
        for (double &offset : offsets_)
            offset += middle;
        return told(std::move(map), counts_, "dark", " DN", notes);
    }

    std::optional<PatternMap> gain_map(std::vector<std::string> &notes) {
        const bool has_flats = std::any_of(given_.layout.sequences.begin(), given_.layout.sequences.end(),
                                           [](const SequenceLayout &s) { return s.scene == CaptureScene::kFlat; });
        if (!has_flats)
            return {};
        if (offsets_.empty()) {
            notes.push_back("no gain map: without a dark map gains are not told from offsets");
            return {};
        }
        std::string why;
        std::vector<MeanFrame> flats = mean_frames(CaptureScene::kFlat, why);
        std::vector<double> gains(shape_.size()), weights(shape_.size());
        double whole = 0.0, of_dark = 0.0;
        Parts noise;
        for (MeanFrame &flat : flats) {
            const double light = make_gains(flat);
            const Parts own = flat.noise.times(1.0 / (light * light));
            const double weight = 1.0 / (own.total() + dark_noise_.total() / (light * light) + 1e-18);
            for (std::size_t i = 0; i < shape_.size(); ++i)
                if (flat.unmasked[i]) {
                    gains[i] += weight * flat.mean[i];
                    weights[i] += weight;
                }
            noise = noise.plus(own.times(weight * weight));
            of_dark += weight / light;
            whole += weight;
            flat.mean = {}; // further flats may be many
        }
        if (!(whole > 0.0)) {
            notes.push_back("no gain map: " + why);
            return {};
        }
        std::vector<std::uint8_t> counts(shape_.size());
        for (std::size_t i = 0; i < shape_.size(); ++i) {
            counts[i] = weights[i] > 0.0;
            gains[i] = counts[i] ? gains[i] / weights[i] : 1.0;
        }
        if (std::none_of(counts.begin(), counts.end(), [](std::uint8_t c) { return c; })) {
            notes.push_back(
                "no gain map: no pixel counts in both a dark sequence and a flat; let their masks share some");
            return {};
        }
        PatternMap map = map_of(flats);
        hold_pattern(shape_, gains, counts,
                     noise.times(1.0 / (whole * whole)).plus(dark_noise_.times(std::pow(of_dark / whole, 2))), 1.0,
                     map);
        for (float &gain : map.values)
            gain = std::max(gain, 0.0f);
        std::optional<PatternMap> result = told(std::move(map), counts, "gain", "", notes);
        if (result && result->smooth_deviation > 0.0)
            notes.push_back(fmt::format("the gain map holds light: parts of the image differ by {:.2g} %, which is no "
                                        "pixel's own; light the flat more evenly, with a diffuser",
                                        100.0 * result->smooth_deviation));
        return result;
    }

    // Makes the mean frame one of relative gains: light above the dark, straightened, over the smooth light that lamp
    // and lens make. The light's mean, in DN of the frame.
    double make_gains(MeanFrame &flat) const {
        const SensorParameters sensor = sensor_of(flat.sequence);
        const double dark = dark_signal_dn(sensor), ground = mean_dark_dn(sensor) - response_dn(sensor, dark);
        const bool bent = sensor.gamma != 1.0 || sensor.cubic_nonlinearity != 0.0;
        double sum = 0.0, used = 0.0;
        for (std::size_t i = 0; i < shape_.size(); ++i) {
            const double response = flat.mean[i] - offsets_[i] - ground;
            const std::size_t site = (i % shape_.width & 1u) + 2 * (i / shape_.width & 1u);
            flat.unmasked[i] = flat.unmasked[i] && !flat.at_top[i] && counts_[i] && sensor.mosaic_gain[site] > 0.0;
            if (!flat.unmasked[i])
                continue;
            flat.mean[i] =
                ((bent ? signal_of_response_dn(sensor, response) : response) - dark) / sensor.mosaic_gain[site];
            sum += flat.mean[i];
            ++used;
        }
        std::vector<std::uint8_t> usual = flat.unmasked;
        leave_out_defects(shape_, without_trend(shape_, flat.mean, usual), usual);
        const std::vector<double> rest = without_trend(shape_, flat.mean, usual);
        for (std::size_t i = 0; i < shape_.size(); ++i) {
            const double light = flat.mean[i] - rest[i];
            flat.unmasked[i] = flat.unmasked[i] && light > 0.0;
            flat.mean[i] = flat.unmasked[i] ? flat.mean[i] / light : 1.0;
        }
        const double mean = used > 0.0 ? sum / used : 1.0;
        // Noise was measured in codes: a bent response makes it smaller or larger than its light.
        const double step = 1e-3 * std::max(mean, 1.0);
        const double slope =
            (response_dn(sensor, mean + dark + step) - response_dn(sensor, mean + dark - step)) / (2.0 * step);
        return std::max(mean * slope, 1e-9);
    }

    const Capture &given_;
    const DiagnosisResult &result_;
    const CalibratedLevels &levels_;
    const std::function<void()> &checkpoint_;
    EffectSettings catalogue_;
    ImageShape shape_;
    // Of the dark: by pixel, DN above the black level, as measured; which pixels have one; what is left of the noise.
    std::vector<double> offsets_;
    std::vector<std::uint8_t> counts_;
    Parts dark_noise_;
};

} // namespace

PatternMaps measure_pattern_maps(const Capture &given, const DiagnosisResult &result, const EffectSettings &effects,
                                 const CalibratedLevels &levels, const std::function<void()> &checkpoint) {
    return Measurement(given, result, effects, levels, checkpoint).run();
}

} // namespace clsp

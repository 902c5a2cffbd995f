#include "simulator/finished_frames.hpp"

#include "capture/applicability.hpp"
#include "simulator/host_noise.hpp"
#include "simulator/sample_filters.hpp"
#include "runtime/error.hpp"
#include "simulator/sensor_side.hpp"
#include "stages/philox.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/core.h>
#include <utility>

namespace clsp {
namespace {

using Image = std::vector<float>;

// Random numbers apart from those of frames that our own simulator may have made with the same seed.
constexpr std::uint64_t kSeedOffset = 0x66696e6973686564u;
// What triangular noise of two codes' width and rounding add, and what rounding alone does (DN^2).
constexpr double kRoundingVariance = 0.25;
constexpr int kGainRounds = 4;
constexpr std::size_t kTrialFrames = 4;
constexpr double kGainTolerance = 1e-4;
// Relative amplitude of the white noise that measures what a chain of filters leaves of noise.
constexpr double kProbe = 0.02;

} // namespace

std::string finished_frames_refusal(const std::string &effect, const CaptureLayout &layout) {
    if (!in_catalogue(effect))
        return {};
    const Effect &record = find_effect(effect);
    if (record.finished_need != FinishedNeed::kSecondPattern)
        return record.unfinished;
    if (layout.degree_of_polarization < 1.0)
        return "light that is polarized in part holds two patterns already, and mixing frames would make it four";
    const auto mixable = [](const SequenceLayout &s) { return is_laser(s.scene) && s.moving && s.frame_count >= 4; };
    if (std::none_of(layout.sequences.begin(), layout.sequences.end(), mixable))
        return "a second, independent pattern is a frame of a moving sequence, of which there is none with four frames";
    return {};
}

struct FinishedFrames::Implementation {
    // What goes through lens and sensor, and what comes to it behind them.
    struct Parted {
        std::vector<Image> light; // signal in DN, not negative; one image where all frames have the same
        double mean = 0.0;        // over the unmasked pixels
    };

    Implementation(std::shared_ptr<Context> context_, const Capture &capture_)
        : context(std::move(context_)), capture(capture_), layout(capture.layout), pixels(layout.pixel_count()),
          queue(context->cl_context(), context->device()), sensor_side(context, layout),
          image(context, pixels * sizeof(float)), other(context, pixels * sizeof(float)) {}

    const std::uint16_t *frame(std::size_t sequence, std::size_t t) const {
        return capture.codes[sequence].data() + t * pixels;
    }
    double black() const { return layout.black_level_dn; }

    double unmasked_mean(std::size_t sequence, const Image &values) const {
        const std::vector<std::uint8_t> &mask = layout.sequences[sequence].mask;
        double sum = 0.0, count = 0.0;
        for (std::size_t i = 0; i < pixels; ++i)
            if (mask.empty() || mask[i] != 0) {
                sum += values[i];
                ++count;
            }
        return sum / count;
    }

    Image mean_codes(std::size_t sequence) const {
        const std::uint32_t frames = layout.sequences[sequence].frame_count;
        Image mean(pixels, 0.0f);
        for (std::uint32_t t = 0; t < frames; ++t)
            for (std::size_t i = 0; i < pixels; ++i)
                mean[i] += float(frame(sequence, t)[i]) / float(frames);
        return mean;
    }

    bool is_one_light(std::size_t sequence) const {
        const SequenceLayout &s = layout.sequences[sequence];
        return s.frame_count >= 4 && (s.scene == CaptureScene::kFlat || !s.moving);
    }

    Parted part(std::size_t sequence) const {
        const std::uint32_t frames = layout.sequences[sequence].frame_count;
        Parted result;
        if (is_one_light(sequence)) {
            Image mean = mean_codes(sequence);
            for (float &value : mean)
                value = std::max(0.0f, value - float(black()));
            result.light.push_back(std::move(mean));
        } else {
            for (std::uint32_t t = 0; t < frames; ++t) {
                Image signal(pixels);
                for (std::size_t i = 0; i < pixels; ++i)
                    signal[i] = std::max(0.0f, float(frame(sequence, t)[i]) - float(black()));
                result.light.push_back(std::move(signal));
            }
        }
        result.mean = mean_of(sequence, result.light, result.light.size());
        return result;
    }

    // Depolarization: I = (1 + p) / 2 I1 + (1 - p) / 2 I2 with an independent pattern I2 of the same scene: the frame
    // half a sequence later of a moving sequence, for a static one the first frame of a moving one.
    std::vector<Image> mixed(std::size_t sequence, const Parted &parted, double degree_of_polarization) const {
        const float first = float(0.5 * (1.0 + degree_of_polarization)), second = 1.0f - first;
        std::vector<Image> result = parted.light;
        const SequenceLayout &s = layout.sequences[sequence];
        if (s.moving) {
            const std::size_t frames = parted.light.size();
            for (std::size_t t = 0; t < frames; ++t) {
                const Image &partner = parted.light[(t + frames / 2) % frames];
                for (std::size_t i = 0; i < pixels; ++i)
                    result[t][i] = first * parted.light[t][i] + second * partner[i];
            }
            return result;
        }
        for (std::size_t m = 0; m < layout.sequences.size(); ++m) {
            if (!is_mixing_partner(sequence, m))
                continue;
            const Parted partner = part(m);
            const float scale = float(parted.mean / partner.mean);
            for (Image &light : result)
                for (std::size_t i = 0; i < pixels; ++i)
                    light[i] = first * light[i] + second * scale * partner.light.front()[i];
            break;
        }
        return result;
    }
    bool is_mixing_partner(std::size_t sequence, std::size_t other_sequence) const {
        const SequenceLayout &a = layout.sequences[sequence], &b = layout.sequences[other_sequence];
        return a.scene == b.scene && b.moving && b.frame_count >= 4 && a.f_number == b.f_number;
    }

    void upload(const cl::Buffer &to, const Image &values) {
        check_opencl(
            clEnqueueWriteBuffer(queue(), to(), CL_TRUE, 0, pixels * sizeof(float), values.data(), 0, nullptr, nullptr),
            "clEnqueueWriteBuffer");
    }
    void download(const cl::Buffer &from, Image &values) {
        values.resize(pixels);
        check_opencl(clEnqueueReadBuffer(queue(), from(), CL_TRUE, 0, pixels * sizeof(float), values.data(), 0, nullptr,
                                         nullptr),
                     "clEnqueueReadBuffer");
    }
    ImageView view(const cl::Buffer &buffer, Format format = Format::kFloat32) const {
        return check_image({buffer(), 0, 0, layout.width, layout.height, format}, "image", context->cl_context()(),
                           {layout.width, layout.height}, {format});
    }

    // Distortion, pixel area and glare of images in place, in the order in which light meets them.
    void through_lens(const SequenceModel &model, std::vector<Image> &lights) {
        LensParameters distorting = model.model.lens, glaring = model.model.lens;
        distorting.glare_fraction = 0.0;
        glaring.k1 = 0.0;
        const double fill_factor = model.model.aperture.fill_factor;
        std::unique_ptr<Lens> distortion, glare;
        std::unique_ptr<FftFilter> pixel_area;
        if (distorting.k1 != 0.0)
            distortion = std::make_unique<Lens>(context, distorting);
        if (fill_factor > 0.0)
            pixel_area = std::make_unique<FftFilter>(context, layout.width, layout.height, kPixelAreaGuardPx,
                                                     pixel_area_spread(fill_factor));
        if (glaring.glare_fraction > 0.0)
            glare = std::make_unique<Lens>(context, glaring);
        if (!distortion && !pixel_area && !glare)
            return;
        for (Image &light : lights) {
            upload(image.get(), light);
            CommandChain chain(queue(), 0, nullptr);
            const cl::Buffer *at = &image.get();
            if (distortion) {
                distortion->enqueue_distort(chain, view(*at), view(other.get()), Interpolation::kCubic);
                at = &other.get();
            }
            if (pixel_area)
                pixel_area->enqueue(chain, "pixel area", view(*at), view(*at), 1.0);
            if (glare)
                glare->enqueue_finish(chain, view(*at), view(*at), false);
            download(*at, light);
            // Kernels with negative lobes may leave a trace of negative light.
            for (float &value : light)
                value = std::max(value, 0.0f);
        }
    }

    // The sensor's part before the read noise, and the part from there on.
    SensorParameters signal_part(const SequenceModel &model, std::uint64_t seed) const {
        SensorParameters p = *model.model.sensor;
        p.seed = seed;
        p.black_level_dn = p.read_noise_dn = 0.0;
        p.hot_pixel_fraction = p.dsnu_dn = p.column_offset_dn = p.row_offset_dn = p.periodic_offset_dn = 0.0;
        p.row_noise_dn = p.column_noise_dn = p.telegraph_fraction = 0.0;
        p.effective_bits = 0;
        p.quantize = false;
        p.float_full_scale = layout.maximum_code();
        return p;
    }
    SensorParameters converter_part(const SequenceModel &model, std::uint64_t seed, double read_noise_dn) const {
        const SensorParameters &of = *model.model.sensor;
        SensorParameters p;
        p.width = layout.width;
        p.height = layout.height;
        p.bits = layout.bits;
        p.seed = seed;
        p.exposure_gain_dn = 1.0;
        p.black_level_dn = 0.0; // it is in what comes in
        p.read_noise_dn = read_noise_dn;
        p.hot_pixel_fraction = of.hot_pixel_fraction;
        p.hot_pixel_mean_dn = of.hot_pixel_mean_dn;
        p.dsnu_dn = of.dsnu_dn;
        p.column_offset_dn = of.column_offset_dn;
        p.row_offset_dn = of.row_offset_dn;
        p.periodic_offset_dn = of.periodic_offset_dn;
        p.periodic_frequency_x = of.periodic_frequency_x;
        p.periodic_frequency_y = of.periodic_frequency_y;
        p.row_noise_dn = of.row_noise_dn;
        p.column_noise_dn = of.column_noise_dn;
        p.telegraph_fraction = of.telegraph_fraction;
        p.telegraph_step_dn = of.telegraph_step_dn;
        p.telegraph_centered = of.telegraph_centered;
        p.effective_bits = of.effective_bits;
        return p;
    }

    // Signals behind the sensor, before offsets and read noise: images of as many frames. light: DN; one image if all
    // frames have the same.
    std::vector<Image> expose(const SequenceModel &model, const SensorParameters &parameters, std::size_t sequence,
                              std::uint64_t seed, const std::vector<Image> &light, double gain,
                              std::uint32_t frame_count) {
        const std::size_t images = light.size();
        DeviceBuffer all(context, images * pixels * sizeof(float));
        for (std::size_t k = 0; k < images; ++k)
            check_opencl(clEnqueueWriteBuffer(queue(), all.get()(), CL_TRUE, k * pixels * sizeof(float),
                                              pixels * sizeof(float), light[k].data(), 0, nullptr, nullptr),
                         "clEnqueueWriteBuffer");
        const DeviceBuffer *lit = &all;
        bool one_light = images == 1;
        if (!SensorSide::passes_light(model)) {
            SequenceModel drawn = model;
            drawn.frames_differ = images > 1;
            sensor_side.enqueue_light(queue(), drawn, sequence,
                                      sensor_side.laser_factors(model, sequence, seed, frame_count),
                                      model.ambient_dn / gain, all, frame_count);
            lit = &sensor_side.light();
            one_light = false;
        }
        SensorParameters p = parameters;
        p.exposure_gain_dn = gain;
        Sensor sensor(context, p);
        const ImageView out = sensor.check_output({image.get()(), 0, 0, layout.width, layout.height, Format::kFloat32});
        std::vector<Image> result(frame_count);
        for (std::uint32_t t = 0; t < frame_count; ++t) {
            const std::size_t offset = one_light ? 0 : t * pixels * sizeof(float);
            const ImageView in =
                check_image({lit->get()(), offset, 0, layout.width, layout.height, Format::kFloat32}, "intensity",
                            context->cl_context()(), {layout.width, layout.height}, {Format::kFloat32});
            CommandChain chain(queue(), 0, nullptr);
            sensor.enqueue_expose(chain, in, frame_number(sequence, t), out);
            sensor.keep_frame();
            download(image.get(), result[t]);
        }
        return result;
    }

    double mean_of(std::size_t sequence, const std::vector<Image> &images, std::size_t count) const {
        double sum = 0.0;
        for (std::size_t k = 0; k < count; ++k)
            sum += unmasked_mean(sequence, images[k]);
        return sum / double(count);
    }

    // The gain at which the mean signal (DN) is that of the light: how bright a scene is belongs to the nuisances of a
    // capture.
    double calibrated_gain(const SequenceModel &model, const SensorParameters &signal, std::size_t sequence,
                           std::uint64_t seed, const std::vector<Image> &light, double mean_dn) {
        SequenceModel steady = model;
        steady.power_flicker = 0.0; // its mean is 1
        const std::vector<Image> trial(light.begin(),
                                       light.begin() + std::ptrdiff_t(std::min(light.size(), kTrialFrames)));
        const double wanted = mean_dn * mean_of(sequence, trial, trial.size());
        // Secant steps; the answer is monotonic.
        double gain = mean_dn, last_gain = 0.0, last_mean = 0.0;
        for (int round = 0; round < kGainRounds; ++round) {
            const auto exposed = expose(steady, signal, sequence, seed, trial, gain, std::uint32_t(trial.size()));
            const double mean = mean_of(sequence, exposed, exposed.size());
            const double slope = (mean - last_mean) / (gain - last_gain);
            if (std::abs(mean - wanted) < kGainTolerance * wanted || !(slope > 0.05))
                break;
            const double next = std::clamp(gain + (wanted - mean) / slope, 0.25 * gain, 4.0 * gain);
            last_gain = gain;
            last_mean = mean;
            gain = next;
        }
        return gain;
    }

    // Variance behind everything linear that white noise of variance 1 has in the light. gain: DN; mean_dn: what 1 of
    // the light stands for.
    double noise_kept(const SequenceModel &model, std::size_t sequence, std::uint64_t seed, double gain,
                      double mean_dn) {
        SequenceModel linear = model;
        linear.power_flicker = 0.0;
        SensorParameters p = signal_part(model, seed);
        p.shot_noise = false;
        p.lag_fraction = 0.0;
        p.gamma = 1.0;
        p.saturation_dn = SensorParameters().saturation_dn;
        std::vector<Image> probes(2, Image(pixels, 1.0f)); // even, rough
        HostNoise noise(seed, sequence, 0, HostStream::kProbe);
        for (float &value : probes[1])
            value += float(kProbe * noise.normal());
        through_lens(linear, probes);
        const std::vector<Image> seen = expose(linear, p, sequence, seed, probes, gain, 2);
        double sum = 0.0;
        for (std::size_t i = 0; i < pixels; ++i)
            sum += double(seen[1][i] - seen[0][i]) * double(seen[1][i] - seen[0][i]);
        const double amplitude_dn = kProbe * mean_dn;
        return sum / (double(pixels) * amplitude_dn * amplitude_dn);
    }

    std::shared_ptr<Context> context;
    const Capture &capture;
    const CaptureLayout &layout;
    std::size_t pixels;
    cl::CommandQueue queue;
    SensorSide sensor_side;
    DeviceBuffer image, other;
};

FinishedFrames::FinishedFrames(std::shared_ptr<Context> context, const Capture &capture)
    : implementation_(std::make_unique<Implementation>(std::move(context), capture)) {}
FinishedFrames::~FinishedFrames() = default;

bool FinishedFrames::concerns(const std::string &effect, std::size_t sequence) const {
    const Implementation &self = *implementation_;
    if (!finished_frames_refusal(effect, self.layout).empty() ||
        !acts_in(find_effect(effect), self.layout.sequences[sequence], self.layout.field, false))
        return false;
    const SequenceLayout &of = self.layout.sequences[sequence];
    switch (find_effect(effect).finished_need) {
    case FinishedNeed::kNothing:
        return true;
    case FinishedNeed::kSharedPicture:
        return self.is_one_light(sequence);
    case FinishedNeed::kSecondPattern:
        break;
    }
    if (of.moving)
        return of.frame_count >= 4;
    for (std::size_t m = 0; m < self.layout.sequences.size(); ++m)
        if (self.is_mixing_partner(sequence, m))
            return true;
    return false;
}

std::vector<std::uint16_t> FinishedFrames::codes(std::size_t sequence, const std::vector<EffectSetting> &effects,
                                                 std::uint64_t given_seed) {
    Implementation &self = *implementation_;
    const std::uint64_t seed = given_seed + kSeedOffset;
    const SequenceLayout &of = self.layout.sequences[sequence];
    const std::uint32_t frames = of.frame_count;
    std::vector<EffectSetting> here;
    for (const EffectSetting &effect : effects)
        if (concerns(effect.id, sequence))
            here.push_back(effect);
    const SequenceModel model = sequence_model(self.layout, {}, sequence, here);
    const bool dark = of.scene == CaptureScene::kDark;
    const double noise_variance = self.layout.read_noise_dn * self.layout.read_noise_dn;

    // Behind the sensor: by frame, or one image for all frames; what the light was, to be replaced by it.
    std::vector<Image> exposed;
    Implementation::Parted parted;
    double restored_variance = 0.0;
    // What happens to offsets and codes needs no light.
    const bool works_on_light = !dark && std::any_of(here.begin(), here.end(), [](const EffectSetting &effect) {
        return !in_catalogue(effect.id) || !(find_effect(effect.id).acts.scenes & kInDark);
    });
    if (works_on_light) {
        parted = self.part(sequence);
        std::vector<Image> light = parted.light;
        double mixing = 1.0; // of the read noise's variance
        if (const double p = model.model.aperture.degree_of_polarization; p < self.layout.degree_of_polarization) {
            light = self.mixed(sequence, parted, p);
            mixing = of.moving ? 0.5 * (1.0 + p * p) : 0.25 * (1.0 + p) * (1.0 + p);
        }
        const double shift = model.model.pipeline.vibration_rms_px;
        if (shift > 0.0) {
            const Image still = light.front();
            light.clear();
            for (std::uint32_t t = 0; t < frames; ++t) {
                const auto normals = host_normals(seed, frame_number(sequence, t), kStreamVibration);
                light.push_back(
                    shifted(still, self.layout.width, self.layout.height, shift * normals[0], shift * normals[1]));
            }
        }
        self.through_lens(model, light);
        // In units of the mean light, as a simulator's intensity.
        const double mean_light = self.mean_of(sequence, light, light.size());
        for (Image &image : light)
            for (float &value : image)
                value /= float(mean_light);
        const SensorParameters signal = self.signal_part(model, seed);
        const double gain = self.calibrated_gain(model, signal, sequence, seed, light, parted.mean);
        const bool frames_differ = light.size() > 1 || signal.shot_noise || model.power_flicker > 0.0;
        exposed = self.expose(model, signal, sequence, seed, light, gain, frames_differ ? frames : 1);
        const double kept = mixing * self.noise_kept(model, sequence, seed, gain, parted.mean);
        restored_variance = noise_variance * std::max(0.0, 1.0 - kept);
    }

    // Noise that is lost with the mean over the frames is the same in all of them.
    const bool one_light = works_on_light && parted.light.size() == 1;
    Image fixed;
    if (one_light && restored_variance > 0.0) {
        fixed.resize(self.pixels);
        HostNoise noise(seed, sequence, 0, HostStream::kRestored);
        const double deviation = std::sqrt(restored_variance / frames);
        for (float &value : fixed)
            value = float(deviation * noise.normal());
    }
    const double restored_dn = one_light ? 0.0 : std::sqrt(restored_variance);
    Sensor converter(self.context, self.converter_part(model, seed, restored_dn));
    const DeviceBuffer converted(self.context, self.pixels * sizeof(std::uint16_t));
    const ImageView out =
        converter.check_output({converted.get()(), 0, 0, self.layout.width, self.layout.height, Format::kUint16});
    std::vector<std::uint16_t> result(frames * self.pixels);
    Image value(self.pixels);
    // Rounding anew adds noise. Where noise can be told from light, by the frames' mean, as much of it is taken away
    // before.
    const Image mean = self.is_one_light(sequence) ? self.mean_codes(sequence) : Image();
    const float kept =
        float(std::sqrt(std::max(0.0, 1.0 - kRoundingVariance / (noise_variance + kQuantizationVariance))));
    for (std::uint32_t t = 0; t < frames; ++t) {
        HostNoise rounding(seed, sequence, t, HostStream::kRounding);
        const std::uint16_t *codes = self.frame(sequence, t);
        for (std::size_t i = 0; i < self.pixels; ++i)
            value[i] = float(rounding.triangular()) +
                       (mean.empty() ? float(codes[i]) : mean[i] + kept * (float(codes[i]) - mean[i]));
        if (works_on_light) {
            const Image &after = exposed.size() == 1 ? exposed.front() : exposed[t];
            const Image &before = one_light ? parted.light.front() : parted.light[t];
            for (std::size_t i = 0; i < self.pixels; ++i)
                value[i] += after[i] - before[i];
            for (std::size_t i = 0; i < fixed.size(); ++i)
                value[i] += fixed[i];
        }
        self.upload(self.image.get(), value);
        CommandChain chain(self.queue(), 0, nullptr);
        converter.enqueue_expose(chain, self.view(self.image.get()), frame_number(sequence, t), out);
        check_opencl(clEnqueueReadBuffer(self.queue(), converted.get()(), CL_TRUE, 0,
                                         self.pixels * sizeof(std::uint16_t), result.data() + t * self.pixels, 0,
                                         nullptr, nullptr),
                     "clEnqueueReadBuffer");
    }
    return result;
}

} // namespace clsp

#include "simulator/simulator.hpp"

#include "capture/applicability.hpp"
#include "runtime/error.hpp"
#include "runtime/launch_guard.hpp"
#include "simulator/opencl_hypothesis.hpp"
#include "simulator/optics.hpp"
#include "simulator/sensor_side.hpp"
#include "simulator/sequence_model.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <fmt/core.h>
#include <list>
#include <new>
#include <numeric>
#include <utility>

namespace clsp {
namespace {

constexpr std::size_t kDefaultCacheBytes = std::size_t{256} << 20;
constexpr std::uint32_t kMostFrames = 65535;

void check_layout(const CaptureLayout &layout) {
    check_image_size(layout.width, layout.height, "a capture's frame");
    if (layout.bits < 1 || layout.bits > 16)
        throw Error(Status::kInvalidArgument,
                    fmt::format("the camera's bits are {}, they must be 1 to 16", layout.bits));
    const auto check_above_zero = [](double value, const char *name) {
        if (!(value > 0.0 && std::isfinite(value)))
            throw Error(Status::kInvalidArgument, fmt::format("{} is {}, it must be finite and above 0", name, value));
    };
    check_above_zero(layout.pixel_pitch_m, "pixel_pitch_m");
    check_above_zero(layout.wavelength_m, "wavelength_m");
    if (!(layout.degree_of_polarization >= 0.0 && layout.degree_of_polarization <= 1.0))
        throw Error(Status::kInvalidArgument,
                    fmt::format("degree_of_polarization is {}, it must be 0 to 1", layout.degree_of_polarization));
    if (layout.sequences.empty())
        throw Error(Status::kInvalidArgument, "the capture's layout has no sequences; there is nothing to simulate");
    for (const SequenceLayout &sequence : layout.sequences) {
        const auto complain = [&](const std::string &what) {
            throw Error(Status::kInvalidArgument, fmt::format("sequence \"{}\": {}", sequence.name, what));
        };
        if (sequence.scene > CaptureScene::kDots)
            complain(fmt::format("scene is {}, it must be 0 to 3", static_cast<std::uint32_t>(sequence.scene)));
        if (sequence.scene == CaptureScene::kDots && (!layout.dots || layout.dots->positions_px.empty()))
            complain("its scene is dots, but the capture's layout lists no dots; give their positions");
        const bool lens = sequence.scene != CaptureScene::kDark;
        const double f_number = sequence.f_number > 0.0 ? sequence.f_number : layout.f_number;
        if (lens && !(f_number > 0.0 && std::isfinite(f_number)))
            complain(fmt::format("f_number is {}, it must be finite and above 0", f_number));
        if (!sequence.mask.empty() && sequence.mask.size() != layout.pixel_count())
            complain(fmt::format("its mask has {} pixels, a frame has {}", sequence.mask.size(), layout.pixel_count()));
    }
}

void check_levels(const SimulationLevels &levels, bool dark) {
    const auto check = [](double value, const char *name, bool negative) {
        if (!std::isfinite(value) || (value < 0.0 && !negative))
            throw Error(Status::kInvalidArgument,
                        fmt::format("{} is {}, it must be finite{}", name, value, negative ? "" : " and not negative"));
    };
    if (!dark)
        check(levels.gain_dn, "gain_dn", false);
    check(levels.black_level_dn, "black_level_dn", true);
    check(levels.read_noise_dn, "read_noise_dn", false);
}

// sum of values[i] weights[i]: in floats over a stretch, in lanes that compilers turn into vectors, in doubles beyond.
double weighted_sum(const float *values, const float *weights, std::size_t count) {
    constexpr std::size_t kLanes = 16, kStretch = 64 * kLanes;
    double sum = 0.0;
    for (std::size_t first = 0; first < count; first += kStretch) {
        const std::size_t end = std::min(first + kStretch, count);
        std::array<float, kLanes> lanes{};
        std::size_t i = first;
        for (; i + kLanes <= end; i += kLanes)
            for (std::size_t lane = 0; lane < kLanes; ++lane)
                lanes[lane] += values[i + lane] * weights[i + lane];
        for (; i < end; ++i)
            lanes[0] += values[i] * weights[i];
        sum += std::accumulate(lanes.begin(), lanes.end(), 0.0);
    }
    return sum;
}

// The first floats of a buffer, for the host to read; not copied where the device's memory is the host's.
class MappedFloats {
  public:
    MappedFloats(const cl::CommandQueue &queue, const DeviceBuffer &buffer, std::size_t count)
        : queue_(queue), buffer_(buffer.get()),
          data_(queue_.enqueueMapBuffer(buffer_, CL_TRUE, CL_MAP_READ, 0, count * sizeof(float))) {}
    MappedFloats(const MappedFloats &) = delete;
    MappedFloats &operator=(const MappedFloats &) = delete;
    ~MappedFloats() { clEnqueueUnmapMemObject(queue_(), buffer_(), data_, 0, nullptr, nullptr); }
    const float *data() const { return static_cast<const float *>(data_); }

  private:
    cl::CommandQueue queue_;
    cl::Buffer buffer_; // kept, whatever becomes of the cache
    void *data_;
};

} // namespace

struct Simulator::Implementation {
    // Intensities of a sequence that has been drawn.
    struct Drawn {
        std::size_t sequence;
        std::uint64_t seed;
        std::vector<EffectSetting> optical;
        std::uint32_t frame_count; // 1 of frames that are all the same
        DeviceBuffer intensities;
    };

    Implementation(std::shared_ptr<Context> context_, const CaptureLayout &layout_, std::vector<Hypothesis> hypotheses_)
        : context(std::move(context_)), layout(layout_), hypotheses(std::move(hypotheses_)),
          pixels(layout.pixel_count()), queue(context->cl_context(), context->device()), guard(*context, queue),
          optics(context, layout), sensor_side(context, layout) {}

    void check_sequence(std::size_t sequence) const {
        if (sequence >= layout.sequences.size())
            throw Error(Status::kInvalidArgument,
                        fmt::format("there is no sequence {}; the layout has {}, numbered from 0", sequence,
                                    layout.sequences.size()));
    }
    static void check_frames(std::uint32_t frame_count) {
        if (frame_count < 1 || frame_count > kMostFrames)
            throw Error(Status::kInvalidArgument,
                        fmt::format("frame_count is {}, it must be 1 to {}", frame_count, kMostFrames));
    }

    // Calls hypotheses on one frame.
    void apply(const std::vector<ActiveHypothesis> &active, std::size_t sequence, std::uint32_t frame,
               std::uint64_t seed, float *values) const {
        for (const ActiveHypothesis &a : active) {
            const std::string &id = a.hypothesis->id;
            const auto where = [&] {
                return fmt::format("the hypothesis \"{}\" on sequence \"{}\", frame {}", id,
                                   layout.sequences[sequence].name, frame);
            };
            try {
                a.hypothesis->apply({&layout, sequence, frame, seed, a.values, values});
            } catch (const Error &error) {
                throw Error(error.status(), fmt::format("{} failed: {}", where(), error.what()), error.opencl_code());
            } catch (const cl::Error &error) { // the device's failure, not the caller's
                throw from_opencl(error.err(), error.what());
            } catch (const std::bad_alloc &) {
                throw;
            } catch (const std::exception &error) {
                throw Error(Status::kInvalidData, fmt::format("{} failed: {}", where(), error.what()));
            } catch (...) {
                throw Error(Status::kInvalidData,
                            fmt::format("{} failed with an exception of an unknown kind", where()));
            }
            for (std::size_t i = 0; i < pixels; ++i)
                if (!std::isfinite(values[i]) ||
                    (values[i] < 0.0f && a.hypothesis->point == HypothesisPoint::kIrradiance))
                    throw Error(
                        Status::kInvalidData,
                        fmt::format("{} made the pixel x = {}, y = {} {}; {}", where(), i % layout.width,
                                    i / layout.width, values[i],
                                    std::isfinite(values[i]) ? "irradiance is never negative" : "it must be finite"));
        }
    }

    // Intensities behind the lens, at least frame_count of them where frames differ. Good until the next call.
    const DeviceBuffer &draw(const SequenceModel &model, std::size_t sequence, std::uint64_t seed,
                             std::uint32_t frame_count) {
        const std::uint32_t frames = model.frames_differ ? frame_count : 1;
        const auto same = [&](const Drawn &d) {
            return d.sequence == sequence && d.seed == seed && d.optical == model.optical;
        };
        auto found = std::find_if(drawn.begin(), drawn.end(), same);
        if (found != drawn.end() && found->frame_count >= frames) {
            drawn.splice(drawn.begin(), drawn, found);
            return drawn.front().intensities;
        }
        if (found != drawn.end())
            forget(found);
        const std::size_t bytes = frames * pixels * sizeof(float);
        Drawn next{sequence, seed, model.optical, frames, buffer_of(bytes)};
        FrameCallback on_irradiance;
        if (!model.on_irradiance.empty())
            on_irradiance = [&](std::uint32_t frame, float *values) {
                apply(model.on_irradiance, sequence, frame, seed, values);
            };
        optics.enqueue_render(queue(), model, sequence, seed, frame_count, on_irradiance, next.intensities);
        cached_bytes += next.intensities.bytes();
        drawn.push_front(std::move(next));
        while (cached_bytes > cache_bytes && drawn.size() > 1)
            forget(std::prev(drawn.end()));
        return drawn.front().intensities;
    }
    // A buffer of the size asked for, one that was forgotten if there is one.
    DeviceBuffer buffer_of(std::size_t bytes) {
        while (cached_bytes + bytes > cache_bytes && !drawn.empty())
            forget(std::prev(drawn.end()));
        if (spare && spare.bytes() == bytes)
            return std::move(spare);
        return DeviceBuffer(context, bytes);
    }
    void forget(std::list<Drawn>::iterator which) {
        cached_bytes -= which->intensities.bytes();
        spare = std::move(which->intensities);
        drawn.erase(which);
    }
    void drop_if_too_large() {
        while (cached_bytes > cache_bytes)
            forget(std::prev(drawn.end()));
    }

    void read(const DeviceBuffer &buffer, std::size_t bytes, void *to) const {
        check_opencl(clEnqueueReadBuffer(queue(), buffer.get()(), CL_TRUE, 0, bytes, to, 0, nullptr, nullptr),
                     "clEnqueueReadBuffer");
    }

    std::shared_ptr<Context> context;
    CaptureLayout layout;
    std::vector<Hypothesis> hypotheses;
    std::size_t pixels;
    cl::CommandQueue queue;
    LaunchGuard guard; // others simulate side by side with this one
    Optics optics;
    SensorSide sensor_side;
    std::list<Drawn> drawn; // the last one used in front
    DeviceBuffer spare;
    std::size_t cache_bytes = kDefaultCacheBytes, cached_bytes = 0;
};

Simulator::Simulator(std::shared_ptr<Context> context, const CaptureLayout &layout,
                     std::vector<Hypothesis> hypotheses) {
    if (!context)
        throw Error(Status::kInvalidArgument, "context is NULL; a simulator needs one");
    check_layout(layout);
    check_hypotheses(hypotheses);
    for (Hypothesis &hypothesis : hypotheses)
        if (!hypothesis.apply)
            hypothesis.apply = opencl_hypothesis(context, hypothesis);
    implementation_ = std::make_unique<Implementation>(std::move(context), layout, std::move(hypotheses));
}

Simulator::~Simulator() = default;

const CaptureLayout &Simulator::layout() const {
    return implementation_->layout;
}

bool Simulator::concerns(const std::string &id, std::size_t sequence) const {
    const Implementation &self = *implementation_;
    self.check_sequence(sequence);
    const SequenceLayout &layout = self.layout.sequences[sequence];
    for (const Hypothesis &hypothesis : self.hypotheses)
        if (hypothesis.id == id)
            return layout.scene != CaptureScene::kDark || hypothesis.point == HypothesisPoint::kCodes;
    return acts_in(find_effect(id), layout, self.layout.field, false);
}

std::vector<EffectSetting> Simulator::concerning(const std::vector<EffectSetting> &effects,
                                                 std::size_t sequence) const {
    const Implementation &self = *implementation_;
    self.check_sequence(sequence);
    const SequenceModel model = sequence_model(self.layout, self.hypotheses, sequence, effects);
    const auto is_hypothesis = [&](const EffectSetting &effect) {
        return std::any_of(self.hypotheses.begin(), self.hypotheses.end(),
                           [&](const Hypothesis &h) { return h.id == effect.id; });
    };
    std::vector<EffectSetting> result;
    for (const EffectSetting &effect : effects)
        if (is_hypothesis(effect) ? concerns(effect.id, sequence)
                                  : acts_in(find_effect(effect.id), self.layout.sequences[sequence], self.layout.field,
                                                   !model.on_irradiance.empty()))
            result.push_back(effect);
    // Hypotheses work one after the other as they are given; the catalogue's effects do so in its own order.
    std::stable_sort(result.begin(), result.end(), [&](const EffectSetting &a, const EffectSetting &b) {
        return is_hypothesis(a) != is_hypothesis(b) ? is_hypothesis(b) : !is_hypothesis(a) && a.id < b.id;
    });
    return result;
}

void Simulator::codes(std::size_t sequence, const std::vector<EffectSetting> &effects, const SimulationLevels &levels,
                      std::uint64_t seed, std::uint32_t frame_count, std::uint16_t *codes) {
    Implementation &self = *implementation_;
    self.check_sequence(sequence);
    self.check_frames(frame_count);
    if (!codes)
        throw Error(Status::kInvalidArgument, "codes is NULL; it must hold frame_count * height * width codes");
    const bool dark = self.layout.sequences[sequence].scene == CaptureScene::kDark;
    check_levels(levels, dark);
    const SequenceModel model = sequence_model(self.layout, self.hypotheses, sequence, effects);
    if (model.ambient_dn > 0.0 && !(levels.gain_dn > 0.0))
        throw Error(Status::kInvalidArgument,
                    fmt::format("ambient_light is a level in DN, but gain_dn of sequence \"{}\" is 0",
                                self.layout.sequences[sequence].name));
    const DeviceBuffer *light = &self.draw(model, sequence, seed, frame_count);
    bool one_light = !model.frames_differ;
    SensorSide &sensor = self.sensor_side;
    if (!SensorSide::passes_light(model)) {
        sensor.enqueue_light(self.queue(), model, sequence, sensor.laser_factors(model, sequence, seed, frame_count),
                             model.ambient_dn > 0.0 ? model.ambient_dn / levels.gain_dn : 0.0, *light, frame_count);
        light = &sensor.light();
        one_light = false;
    }
    const std::size_t values = frame_count * self.pixels;
    if (!model.on_intensity.empty()) {
        std::vector<float> host(values);
        self.read(*light, values * sizeof(float), host.data());
        for (std::uint32_t frame = 0; frame < frame_count; ++frame)
            self.apply(model.on_intensity, sequence, frame, seed, host.data() + frame * self.pixels);
        check_opencl(clEnqueueWriteBuffer(self.queue(), light->get()(), CL_TRUE, 0, values * sizeof(float), host.data(),
                                          0, nullptr, nullptr),
                     "clEnqueueWriteBuffer");
    }
    SimulationLevels used = levels;
    if (dark)
        used.gain_dn = 0.0; // whatever it is
    sensor.enqueue_expose(self.queue(), model, used, sequence, seed, *light, one_light, frame_count);
    self.read(sensor.codes(), values * sizeof(std::uint16_t), codes);
    if (!model.on_codes.empty()) {
        const float top = static_cast<float>(self.layout.maximum_code());
        std::vector<float> host(self.pixels);
        for (std::uint32_t frame = 0; frame < frame_count; ++frame) {
            std::uint16_t *of_frame = codes + frame * self.pixels;
            std::copy_n(of_frame, self.pixels, host.begin());
            self.apply(model.on_codes, sequence, frame, seed, host.data());
            for (std::size_t i = 0; i < self.pixels; ++i)
                of_frame[i] = static_cast<std::uint16_t>(std::clamp(std::nearbyint(host[i]), 0.0f, top));
        }
    }
    self.drop_if_too_large();
}

double Simulator::mean_intensity(std::size_t sequence, const std::vector<EffectSetting> &effects, std::uint64_t seed,
                                 std::uint32_t frame_count) {
    Implementation &self = *implementation_;
    self.check_sequence(sequence);
    self.check_frames(frame_count);
    SequenceModel model = sequence_model(self.layout, self.hypotheses, sequence, effects);
    if (self.layout.sequences[sequence].scene == CaptureScene::kDark)
        return 0.0;
    const DeviceBuffer &intensities = self.draw(model, sequence, seed, frame_count);
    const std::vector<float> factors = self.sensor_side.laser_factors(model, sequence, seed, frame_count);
    // What a pixel counts: fall-off, and 0 where the mask says so. The host's own pass over finished images needs the
    // two apart.
    const bool host_pass = !model.on_intensity.empty();
    const std::vector<float> kept = self.sensor_side.fall_off(model, sequence);
    std::vector<float> weight = host_pass ? std::vector<float>(self.pixels, 1.0f) : kept;
    const std::vector<std::uint8_t> &mask = self.layout.sequences[sequence].mask;
    for (std::size_t i = 0; i < mask.size(); ++i)
        if (mask[i] == 0)
            weight[i] = 0.0f;
    const auto used = mask.empty()
                          ? std::ptrdiff_t(self.pixels)
                          : std::ptrdiff_t(self.pixels) - std::count(mask.begin(), mask.end(), std::uint8_t{0});
    if (used == 0)
        throw Error(Status::kInvalidData, fmt::format("the mask of sequence \"{}\" leaves no pixel; give one that does",
                                                      self.layout.sequences[sequence].name));
    const std::uint32_t drawn_frames = model.frames_differ ? frame_count : 1;
    const MappedFloats host(self.queue, intensities, drawn_frames * self.pixels);
    double sum = 0.0;
    if (host_pass) {
        std::vector<float> image(self.pixels);
        for (std::uint32_t frame = 0; frame < frame_count; ++frame) {
            const float *of_frame = host.data() + (model.frames_differ ? frame * self.pixels : 0);
            for (std::size_t i = 0; i < self.pixels; ++i)
                image[i] = of_frame[i] * factors[frame] * kept[i];
            self.apply(model.on_intensity, sequence, frame, seed, image.data());
            sum += weighted_sum(image.data(), weight.data(), self.pixels);
        }
    } else if (model.frames_differ) {
        for (std::uint32_t frame = 0; frame < frame_count; ++frame)
            sum += double(factors[frame]) * weighted_sum(host.data() + frame * self.pixels, weight.data(), self.pixels);
    } else {
        sum = std::accumulate(factors.begin(), factors.end(), 0.0) *
              weighted_sum(host.data(), weight.data(), self.pixels);
    }
    self.drop_if_too_large();
    return sum / (double(used) * frame_count);
}

void Simulator::set_cache_bytes(std::size_t bytes) {
    implementation_->cache_bytes = bytes;
    implementation_->drop_if_too_large();
    implementation_->spare = {};
}

Capture simulate_capture(Simulator &simulator, const std::vector<EffectSetting> &effects,
                         const std::vector<SimulationLevels> &levels, std::uint64_t seed) {
    Capture capture;
    capture.layout = simulator.layout();
    const auto &sequences = capture.layout.sequences;
    if (levels.size() != sequences.size())
        throw Error(Status::kInvalidArgument,
                    fmt::format("there are levels for {} sequences, the layout has {}; give one each", levels.size(),
                                sequences.size()));
    for (std::size_t i = 0; i < sequences.size(); ++i) {
        capture.codes.emplace_back(sequences[i].frame_count * capture.layout.pixel_count());
        simulator.codes(i, effects, levels[i], seed, sequences[i].frame_count, capture.codes.back().data());
    }
    return capture;
}

} // namespace clsp

#include "inference/levels.hpp"

#include "inference/thresholds.hpp"
#include "runtime/error.hpp"
#include "simulator/host_noise.hpp"
#include "statistics/sequence_level.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/core.h>

namespace clsp {
namespace {

double normal_two_sided(double z) {
    return std::erfc(std::abs(z) / std::sqrt(2.0));
}

// black + scale (code - black) + noise, rounded and clipped.
void digitize_again(const CaptureLayout &layout, std::size_t sequence, double black, double scale, double deviation,
                    std::uint64_t seed, HostStream stream, std::vector<std::uint16_t> &codes) {
    const double top = layout.maximum_code();
    const std::size_t pixels = layout.pixel_count();
    for (std::size_t t = 0; t < codes.size() / pixels; ++t) {
        HostNoise noise(seed, sequence, t, stream);
        std::uint16_t *frame = codes.data() + t * pixels;
        for (std::size_t i = 0; i < pixels; ++i) {
            // Without a multiplication what has reached the end of the scale stays there.
            if (scale == 1.0 && double(frame[i]) >= top)
                continue;
            const double value = black + scale * (frame[i] - black) + deviation * noise.normal();
            frame[i] = static_cast<std::uint16_t>(std::clamp(std::nearbyint(value), 0.0, top));
        }
    }
}

// The other frames of a pair end where the multiplied ones do, with the noise that those have at their end.
void end_scale(const CaptureLayout &layout, std::size_t sequence, double last, double deviation, std::uint64_t seed,
               HostStream stream, std::vector<std::uint16_t> &codes) {
    const std::size_t pixels = layout.pixel_count();
    for (std::size_t t = 0; t < codes.size() / pixels; ++t) {
        HostNoise noise(seed, sequence, t, stream);
        for (std::size_t i = t * pixels; i < (t + 1) * pixels; ++i) {
            const double value = last + deviation * noise.normal();
            if (double(codes[i]) > last)
                codes[i] = static_cast<std::uint16_t>(std::clamp(std::nearbyint(value), 0.0, layout.maximum_code()));
        }
    }
}

// Variance to add so that frames of that read noise, multiplied by scale, have the read noise that is wanted.
double missing_variance(double wanted_dn, double noise_dn, double scale) {
    return wanted_dn * wanted_dn - scale * scale * (noise_dn * noise_dn + kQuantizationVariance);
}

} // namespace

CameraLevels camera_levels(const Capture &capture) {
    CameraLevels result{capture.layout.black_level_dn, capture.layout.read_noise_dn, false, 0.0};
    double mean = 0.0, means = 0.0, variance = 0.0, freedom = 0.0;
    for (std::size_t s = 0; s < capture.codes.size(); ++s) {
        const SequenceLayout &sequence = capture.layout.sequences[s];
        if (sequence.scene != CaptureScene::kDark)
            continue;
        const SequenceLevel level = sequence_level(capture.layout, s, capture.codes[s].data(), sequence.frame_count);
        mean += level.mean_dn;
        ++means;
        // Frames that are all alike are a damaged recording.
        if (sequence.frame_count < 2 || !(level.temporal_noise_dn > 0.0))
            continue;
        const double masked = double(std::count(sequence.mask.begin(), sequence.mask.end(), std::uint8_t{0}));
        const double own = (double(capture.layout.pixel_count()) - masked) * (sequence.frame_count - 1.0);
        variance += own * level.temporal_noise_dn * level.temporal_noise_dn;
        freedom += own;
    }
    if (means > 0.0)
        result.black_level_dn = mean / means;
    if (freedom > 0.0) {
        result.read_noise_dn = std::sqrt(std::max(0.0, variance / freedom - kQuantizationVariance));
        result.noise_measured = true;
        // A variance from that many degrees of freedom has the relative error sqrt(2 / freedom), its root half of that.
        result.noise_error = std::sqrt(0.5 / freedom);
    }
    return result;
}

ReadNoiseComparison level_captures(PairedCaptures &captures, const CameraLevels &real, const CameraLevels &sim,
                                   bool same_light, std::uint64_t seed) {
    ReadNoiseComparison result;
    result.real = real;
    result.sim = sim;
    captures.real.layout.black_level_dn = real.black_level_dn;
    captures.sim.layout.black_level_dn = sim.black_level_dn;
    captures.real.layout.read_noise_dn = real.read_noise_dn;
    captures.sim.layout.read_noise_dn = sim.read_noise_dn;
    double sim_noise = sim.read_noise_dn;
    if (real.noise_measured && sim.noise_measured) {
        const double low = std::max(1e-3, real.read_noise_dn), high = std::max(1e-3, sim.read_noise_dn);
        result.z = std::log(low / high) / std::hypot(real.noise_error, sim.noise_error);
        result.p_value = normal_two_sided(result.z);
        const double less = missing_variance(real.read_noise_dn, sim.read_noise_dn, 1.0);
        const double more = missing_variance(sim.read_noise_dn, real.read_noise_dn, 1.0);
        if (less >= kComparison.least_added_variance) {
            sim_noise = real.read_noise_dn;
            result.added_dn = std::sqrt(less);
        }
        result.excess = more >= kComparison.least_added_variance;
    }
    for (std::size_t s = captures.pairs.size(); s-- > 0;) {
        SequencePair &pair = captures.pairs[s];
        const SequenceLayout &sequence = captures.real.layout.sequences[s];
        std::vector<std::uint16_t> &a = captures.real.codes[s], &b = captures.sim.codes[s];
        if (sequence.scene != CaptureScene::kDark) {
            const auto signal = [&](const Capture &capture, const CameraLevels &camera) {
                return sequence_level(capture.layout, s, capture.codes[s].data(), pair.frames).mean_dn -
                       camera.black_level_dn;
            };
            pair.real_signal_dn = signal(captures.real, real);
            pair.sim_signal_dn = signal(captures.sim, sim);
            if (pair.real_signal_dn < kNaming.least_light_dn || pair.sim_signal_dn < kNaming.least_light_dn) {
                captures.notes.push_back(
                    fmt::format("{} and {} were left out: their light is {:.2f} DN and {:.2f} DN above the dark level, "
                                "which is too little to compare",
                                pair.real, pair.sim, pair.real_signal_dn, pair.sim_signal_dn));
                const auto at = std::ptrdiff_t(s);
                for (Capture *capture : {&captures.real, &captures.sim}) {
                    capture->codes.erase(capture->codes.begin() + at);
                    capture->layout.sequences.erase(capture->layout.sequences.begin() + at);
                }
                captures.pairs.erase(captures.pairs.begin() + at);
                continue;
            }
            // Above 1: the camera had more light.
            const double ratio = same_light ? 1.0 : pair.real_signal_dn / pair.sim_signal_dn;
            const double real_scale = std::min(1.0, 1.0 / ratio), sim_scale = std::min(1.0, ratio);
            const double real_missing = missing_variance(real.read_noise_dn, real.read_noise_dn, real_scale);
            if (real_scale < 1.0 && real_missing >= kComparison.least_added_variance) {
                pair.real_scale = real_scale;
                digitize_again(captures.real.layout, s, real.black_level_dn, real_scale, std::sqrt(real_missing), seed,
                               HostStream::kReal, a);
                const double top = captures.real.layout.maximum_code();
                end_scale(captures.sim.layout, s, sim.black_level_dn + real_scale * (top - real.black_level_dn),
                          std::sqrt(real_missing), seed, HostStream::kSimEnd, b);
            }
            if (sim_scale < 1.0 &&
                missing_variance(sim_noise, sim.read_noise_dn, sim_scale) >= kComparison.least_added_variance)
                pair.sim_scale = sim_scale;
            const double left = ratio * pair.real_scale / pair.sim_scale;
            if (std::abs(left - 1.0) > kComparison.noted_ratio)
                captures.notes.push_back(fmt::format(
                    "{} is compared at {:.1f} DN of light with {} at {:.1f} DN: the read noise is too small to "
                    "hide which codes a multiplication leaves out",
                    pair.real, pair.real_scale * pair.real_signal_dn, pair.sim, pair.sim_scale * pair.sim_signal_dn));
        }
        const double sim_missing = missing_variance(sim_noise, sim.read_noise_dn, pair.sim_scale);
        if (pair.sim_scale < 1.0 || result.added_dn > 0.0)
            digitize_again(captures.sim.layout, s, sim.black_level_dn, pair.sim_scale,
                           std::sqrt(std::max(0.0, sim_missing)), seed, HostStream::kSim, b);
        if (pair.sim_scale < 1.0)
            end_scale(captures.real.layout, s,
                      real.black_level_dn + pair.sim_scale * (captures.sim.layout.maximum_code() - sim.black_level_dn),
                      std::sqrt(std::max(0.0, sim_missing)), seed, HostStream::kRealEnd, a);
    }
    if (captures.pairs.empty())
        throw Error(Status::kInvalidData,
                    "no pair of sequences can be compared: none is dark, and none has light in both sets");
    return result;
}

} // namespace clsp

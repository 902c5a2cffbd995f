#include "capture/pairing.hpp"

#include "runtime/error.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/core.h>
#include <optional>

namespace clsp {
namespace {

// Descriptions that differ by less are the same camera.
constexpr double kSameRatio = 0.005;
constexpr double kSameDotPx = 0.05;

void check_frames(const CaptureLayout &real, const CaptureLayout &sim) {
    if (real.width != sim.width || real.height != sim.height)
        throw Error(Status::kInvalidArgument,
                    fmt::format("the frames of the real set have {} x {} pixels, those of the simulated set {} x {}; "
                                "statistics of a grid "
                                "of pixels cannot be compared with those of another: render or crop to the same size",
                                real.width, real.height, sim.width, sim.height));
    if (real.bits != sim.bits)
        throw Error(Status::kInvalidArgument, fmt::format("the camera's codes have {} bits in the real set and {} in "
                                                          "the simulated one; let the simulator write the "
                                                          "camera's codes, or correct camera.bits",
                                                          real.bits, sim.bits));
}

bool differ(double a, double b) {
    return std::abs(a - b) > kSameRatio * std::max(std::abs(a), std::abs(b));
}

double f_number(const CaptureLayout &layout, std::size_t sequence) {
    const double own = layout.sequences[sequence].f_number;
    return own > 0.0 ? own : layout.f_number;
}

std::vector<std::string> description_notes(const CaptureLayout &real, const CaptureLayout &sim, bool &dots_apart) {
    std::vector<std::string> notes;
    dots_apart = false;
    const auto number = [&](const char *what, double a, double b) {
        if (differ(a, b))
            notes.push_back(
                fmt::format("the sets' descriptions differ: {} is {:.6g} in the real set, {:.6g} in the simulated one",
                            what, a, b));
    };
    number("the pixel pitch in um", 1e6 * real.pixel_pitch_m, 1e6 * sim.pixel_pitch_m);
    number("the f-number", real.f_number, sim.f_number);
    number("the wavelength in nm", 1e9 * real.wavelength_m, 1e9 * sim.wavelength_m);
    number("the degree of polarization", real.degree_of_polarization, sim.degree_of_polarization);
    if (real.field != sim.field)
        notes.push_back("the sets' descriptions differ: baseline.field is another one");
    if (real.dots && sim.dots) {
        number("the dots' sigma in px", real.dots->sigma_px, sim.dots->sigma_px);
        const auto &a = real.dots->positions_px, &b = sim.dots->positions_px;
        if (a.size() != b.size()) {
            dots_apart = true;
            notes.push_back(fmt::format(
                "the sets' descriptions differ: {} dots in the real set, {} in the simulated one", a.size(), b.size()));
        } else {
            double farthest = 0.0;
            for (std::size_t i = 0; i < a.size(); ++i)
                farthest = std::max(farthest, std::hypot(a[i][0] - b[i][0], a[i][1] - b[i][1]));
            dots_apart = farthest > kSameDotPx;
            if (dots_apart)
                notes.push_back(fmt::format(
                    "the sets' descriptions differ: dots of the same number lie up to {:.2f} px apart", farthest));
        }
    }
    return notes;
}

// By sequence of the real set: its partner's number.
std::vector<std::optional<std::size_t>> partners_of(const CaptureLayout &real, const CaptureLayout &sim) {
    const std::size_t count = real.sequences.size();
    std::vector<std::optional<std::size_t>> partners(count);
    std::vector<bool> taken(sim.sequences.size(), false);
    const auto take = [&](std::size_t r, const auto &agree) {
        for (std::size_t s = 0; s < sim.sequences.size() && !partners[r]; ++s) {
            const SequenceLayout &a = real.sequences[r], &b = sim.sequences[s];
            if (!taken[s] && a.scene == b.scene && a.moving == b.moving && agree(s)) {
                partners[r] = s;
                taken[s] = true;
            }
        }
    };
    for (std::size_t r = 0; r < count; ++r)
        take(r, [&](std::size_t s) { return real.sequences[r].name == sim.sequences[s].name; });
    for (std::size_t r = 0; r < count; ++r)
        take(r, [&](std::size_t s) { return !differ(f_number(real, r), f_number(sim, s)); });
    for (std::size_t r = 0; r < count; ++r)
        take(r, [](std::size_t) { return true; });
    return partners;
}

std::vector<std::uint8_t> common_mask(const std::vector<std::uint8_t> &a, const std::vector<std::uint8_t> &b) {
    if (a.empty() || b.empty())
        return a.empty() ? b : a;
    std::vector<std::uint8_t> result(a.size());
    std::transform(a.begin(), a.end(), b.begin(), result.begin(), [](std::uint8_t x, std::uint8_t y) {
        return static_cast<std::uint8_t>(x != 0 && y != 0 ? 255 : 0);
    });
    return result;
}

} // namespace

PairedCaptures pair_captures(const Capture &real, const Capture &sim, const PartChoice &choice,
                             const WhyNotCompared &why_not) {
    check_frames(real.layout, sim.layout);
    PairedCaptures result;
    result.notes = description_notes(real.layout, sim.layout, result.dots_apart);
    CaptureLayout paired = real.layout;
    paired.sequences.clear();
    std::vector<std::size_t> real_numbers, sim_numbers;
    const auto partners = partners_of(real.layout, sim.layout);
    std::vector<bool> used(sim.layout.sequences.size(), false);
    std::string reasons;
    for (std::size_t r = 0; r < real.layout.sequences.size(); ++r) {
        const SequenceLayout &a = real.layout.sequences[r];
        if (!partners[r]) {
            result.real_alone.push_back(a.name);
            continue;
        }
        const std::size_t s = *partners[r];
        const SequenceLayout &b = sim.layout.sequences[s];
        used[s] = true;
        if (const std::string reason = why_not ? why_not(r, s) : ""; !reason.empty()) {
            result.left_out.push_back({a.name, b.name});
            result.notes.push_back(reason);
            reasons += (reasons.empty() ? "" : "; ") + reason;
            continue;
        }
        SequencePair pair;
        pair.real = a.name;
        pair.sim = b.name;
        pair.real_frames = a.frame_count;
        pair.sim_frames = b.frame_count;
        // Statistics of a few frames scatter and are biased otherwise than those of many: both get as many.
        pair.frames = std::min(a.frame_count, b.frame_count);
        if (a.scene != CaptureScene::kDark && a.scene != CaptureScene::kFlat &&
            differ(f_number(real.layout, r), f_number(sim.layout, s)))
            result.notes.push_back(fmt::format("{} has f/{:.3g} in the real set, its partner {} f/{:.3g}", a.name,
                                               f_number(real.layout, r), b.name, f_number(sim.layout, s)));
        SequenceLayout layout = a;
        layout.frame_count = pair.frames;
        layout.mask = common_mask(a.mask, b.mask);
        if (!layout.mask.empty() &&
            std::all_of(layout.mask.begin(), layout.mask.end(), [](std::uint8_t m) { return m == 0; }))
            throw Error(
                Status::kInvalidArgument,
                fmt::format("the masks of {} and {} together leave no pixel; both must show the same part of the scene",
                            a.name, b.name));
        paired.sequences.push_back(std::move(layout));
        real_numbers.push_back(r);
        sim_numbers.push_back(s);
        result.pairs.push_back(std::move(pair));
    }
    for (std::size_t s = 0; s < used.size(); ++s)
        if (!used[s])
            result.sim_alone.push_back(sim.layout.sequences[s].name);
    if (result.pairs.empty() && !reasons.empty())
        throw Error(
            Status::kInvalidData,
            fmt::format("no pair of sequences can be compared: {}. Check that the files belong to the scenes that "
                        "capture.json names, and record or render again with another exposure",
                        reasons));
    if (result.pairs.empty())
        throw Error(Status::kInvalidArgument,
                    "no sequence of the real set has a partner of the same scene and motion in the simulated set; "
                    "render the same "
                    "scenes (dark, flat, board, dots; static or moving) as the camera recorded");
    result.part = choose_part(paired, choice);
    result.real = take_part(real, real_numbers, paired.sequences, result.part);
    result.sim = take_part(sim, sim_numbers, paired.sequences, result.part);
    for (std::size_t i = 0; i < result.pairs.size(); ++i)
        result.pairs[i].frames = result.part.sequences[i].frames();
    return result;
}

} // namespace clsp

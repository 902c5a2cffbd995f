// The parts of EMVA 1288's measurement share what is known of each sequence.
#pragma once

#include "measure/clipped_dark.hpp"
#include "measure/emva_result.hpp"
#include "measure/frame_stack.hpp"

#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace clsp {

constexpr double kEmva95 = 1.959964;             // deviations of a normal law that hold 95 %
constexpr double kEmvaQuantization = 1.0 / 12.0; // DN^2
constexpr double kEmvaSaturated = 0.5;           // of a flat's pixels at the top
// Two sequences are of one exposure, of one level: in parts of the larger.
constexpr double kEmvaSameExposure = 0.01, kEmvaSameLevel = 0.02;

EmvaValue unknown_emva_value(std::string reason);
EmvaValue emva_value(double value, double error);
// Of two estimates that know nothing of each other; both above 0.
EmvaValue emva_quotient(const EmvaValue &over, const EmvaValue &under);

struct EmvaSequence {
    const SequenceLayout *layout = nullptr;
    FrameStack stack;
    bool usable = true;
    // Dark: where nothing clips as measured, else what lies behind. Level and variance of single codes, DN.
    double level = 0.0, level_error = 0.0, variance = 0.0, variance_error = 0.0;
    double draw_error = 0.0; // dark: of the camera's level by these pixels
    std::optional<ClippedDark> clipped;
    SmoothTrend trend; // lit: of the mean frame
};

class EmvaMeasurement {
  public:
    explicit EmvaMeasurement(const Capture &capture) : capture_(capture) {}
    Emva1288 run();

  private:
    void read();
    void look_for_contradictions();
    bool halves_agree(EmvaSequence &sequence);
    void measure_dark();
    void measure_gain();
    void gain_of_flats(std::vector<EmvaSequence *> &flats);
    std::pair<double, double> lag_factor(const std::vector<EmvaSequence *> &flats);
    void gain_at_rest();
    void measure_saturation();
    void measure_nonuniformity();
    void measure_linearity();
    void measure_dark_current();
    void measure_illumination();
    void derive();

    const EmvaSequence *dark_of(const EmvaSequence &flat) const;
    double signal(const EmvaSequence &flat) const { return flat.level - dark_of(flat)->level; }
    void note(const std::string &sequence, std::string text) { result_.notes.push_back({sequence, std::move(text)}); }
    std::string reason_without_dark() const;

    const Capture &capture_;
    std::vector<EmvaSequence> darks_, flats_, others_;
    std::string disorder_;          // of exposures; empty: none
    double saturation_limit_ = 0.0; // signal above dark, DN
    Emva1288 result_;
};

} // namespace clsp

// What EMVA 1288 (release 4.0) and photon transfer say of dark and flat frames. docs/method/emva1288.md has the
// formulas.
#pragma once

#include "capture/capture.hpp"

#include <array>
#include <limits>
#include <string>
#include <vector>

namespace clsp {

// A value with its 95 % interval, or why it is not known.
struct EmvaValue {
    double value = std::numeric_limits<double>::quiet_NaN();
    double low = value, high = value;
    std::string unknown; // the reason; empty: known

    bool known() const { return unknown.empty(); }
};

// Standard deviations of a fixed pattern: sqrt of variances, 0 where the estimate of a variance is not above 0.
struct EmvaNonuniformity {
    EmvaValue total, pixel, row, column;
};

// A dark or flat sequence: a point of the photon transfer.
struct EmvaPoint {
    std::string sequence;
    double level_dn = 0.0, variance_dn2 = 0.0; // mean code; over time, by differences of successive frames
    double variance_error_dn2 = 0.0;           // standard error
    bool used = false;                         // for the gain
    std::string unused;                        // why not
};

// The mean frame above dark over its mean is 1 + slope_x u + slope_y v + curvature_x u^2 + twist u v + curvature_y v^2,
// u and v from -1/2 to 1/2 across the image.
struct EmvaIllumination {
    std::string sequence;
    std::array<double, 5> percent{}, error_percent{}; // slope_x, slope_y, curvature_x, twist, curvature_y
};

// Variances of a mean frame as the standard's section 8 has them: all pixels count, and the temporal noise is taken for
// that of independent pixels. Negative where it explains more than all.
struct EmvaSpatial {
    std::string sequence; // empty: none
    double frames = 0.0, rows = 0.0, columns = 0.0, mean = 0.0;
    double stack_variance = 0.0, measured_variance = 0.0; // over time; of the mean frame, with what is left of it
    double variance = 0.0, row_average_variance = 0.0, column_average_variance = 0.0;
    double pixel_variance = 0.0, row_variance = 0.0, column_variance = 0.0;
};

enum class EmvaGainMethod { kNone, kFlats, kOneFlat, kFlatsWithoutDark, kLaserAtRest };

struct Emva1288 {
    EmvaGainMethod method = EmvaGainMethod::kNone;
    EmvaValue gain;                                          // K, DN per electron
    EmvaValue dark_level, dark_noise;                        // DN; the noise with the quantization's
    EmvaValue dark_noise_e;                                  // electrons, without it
    EmvaNonuniformity dsnu, dsnu_e, prnu;                    // DN, electrons, %
    double defect_share_dark = 0.0, defect_share_flat = 0.0; // of pixels, not counted above: docs/method/emva1288.md
    EmvaValue linearity_min, linearity_max;                  // %
    EmvaValue saturation, saturation_e;                      // signal above dark, DN, electrons
    EmvaValue sensitivity_threshold;                         // electrons
    EmvaValue snr_max, dynamic_range;                        // dB
    EmvaValue dark_current, dark_current_e;                  // DN per ms, electrons per s
    std::vector<EmvaPoint> points;
    std::vector<EmvaIllumination> illumination;
    // As they are (so does the package emva1288), and behind the high-pass filter of section 8.1.
    EmvaSpatial spatial_dark, spatial_flat, filtered_dark, filtered_flat;
    std::vector<CaptureWarning> notes; // what contradicts itself or limits the above
};

} // namespace clsp

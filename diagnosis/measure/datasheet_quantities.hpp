// What the capture measures in the units of a data sheet, beside the same of simulated captures: contrast, noise in DN,
// widths in pixels, the photon transfer. For people to read; no verdict goes by it.
#pragma once

#include "capture/capture.hpp"
#include "inference/model_fit.hpp"
#include "statistics/quantities.hpp"

#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

namespace clsp {

constexpr std::size_t kMeasuredCaptures = 8; // simulated ones of each version

// Over simulated captures, or of the only real one (deviation NaN then). NaN: not told by at least one of them.
struct QuantityMean {
    double mean = std::numeric_limits<double>::quiet_NaN();
    double deviation = std::numeric_limits<double>::quiet_NaN(); // from capture to capture
};

struct DatasheetQuantity {
    std::string sequence; // empty: of several sequences together
    std::string name, unit;
    std::vector<QuantityMean> versions; // real, baseline, and with effects if there are any
};

// A point of the photon transfer curve: dark and flat sequences of at least two frames.
struct TransferPoint {
    std::string sequence;
    double signal_dn = 0.0, variance_dn2 = 0.0; // above the black level; of pixels over time
    double variance_error_dn2 = 0.0;            // standard deviation of the estimate
};

// variance = intercept + gain * signal: EMVA 1288's system gain is the slope.
struct PhotonTransfer {
    std::vector<TransferPoint> points;
    std::size_t fitted_points = 0; // those below the limit
    bool fitted = false;           // by points at two levels at least
    double gain_dn_per_electron = 0.0, gain_error = 0.0;
    double intercept_dn2 = 0.0, intercept_error = 0.0;
};

struct DatasheetQuantities {
    std::size_t simulated_captures = 0;
    std::vector<DatasheetQuantity> quantities;
    std::vector<PhotonTransfer> transfer; // by version, of the first simulated capture; empty without points
};

// Weighted least squares over the points below 70 % of the full signal, as EMVA 1288 has it.
PhotonTransfer fit_photon_transfer(std::vector<TransferPoint> points, double full_signal_dn);

// Of the camera's frames alone, in the order of measure_datasheet().
std::vector<DatasheetQuantity> camera_quantities(const ReplicateRunner &runner, const Capture &real);

// final: nullptr if no effect was found. seed: of the diagnosis; the captures are apart from those of any fit.
DatasheetQuantities measure_datasheet(ReplicateRunner &runner, const Capture &real, const FittedModel &baseline,
                                      const FittedModel *final, std::uint64_t seed);

} // namespace clsp

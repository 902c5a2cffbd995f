// Statistics for the report's figures, of the frames of one sequence.
#pragma once

#include "capture/capture.hpp"

#include <cstddef>
#include <cstdint>
#include <vector>

namespace clsp {

constexpr std::size_t kHistogramBins = 128; // at most
constexpr int kDotReach = 12;               // px around a dot

// What the power spectrum is taken of.
enum class Fluctuation : std::uint32_t {
    kOverTime, // frame minus the mean of all frames
    kInFrame   // frame minus its own mean: of a static laser scene, whose speckle stands, and of single frames
};

namespace evidence {

// Frames of a sequence as codes.
struct Frames {
    const CaptureLayout *layout;
    const SequenceLayout *sequence;
    std::uint32_t count;
    const std::uint16_t *codes; // count * height * width

    std::size_t width() const { return layout->width; }
    std::size_t height() const { return layout->height; }
    std::size_t pixels() const { return layout->pixel_count(); }
    const std::uint16_t *frame(std::size_t index) const { return codes + index * pixels(); }
    bool is_used(std::size_t pixel) const { return sequence->mask.empty() || sequence->mask[pixel] != 0; }
};

// height * width values.
using Plane = std::vector<float>;

Plane mean_image(const Frames &frames);
Plane temporal_deviation(const Frames &frames, const Plane &mean); // unbiased
// Mean over squares of `edge` pixels; squares at the right and lower edge may be smaller.
Plane block_means(const Plane &plane, std::size_t width, std::size_t height, std::uint32_t edge);

// The value that a share of the plane's values lies below.
double quantile(Plane values, double share);
// Codes from the 0.05th to the 99.95th percentile of several versions, in at most kHistogramBins bins of whole codes.
struct HistogramRange {
    std::uint32_t first = 0, step = 1, bins = 1; // bin k: codes first + k * step ... + step - 1
};
HistogramRange histogram_range(const std::vector<Frames> &versions);
struct Histogram {
    std::vector<double> bins; // share of the pixels in each
    double outside = 0.0;     // share of the pixels below or above all bins
};
Histogram histogram(const Frames &frames, const HistogramRange &range);

// Mean over frames of the radial power spectral density, under a Hann window; its integral over the plane is the
// variance.
std::vector<double> radial_power(const Frames &frames, const Plane &mean, Fluctuation fluctuation, std::size_t bands);
std::size_t band_count(const CaptureLayout &layout);

// Pearson correlation of frames over the pixels, mean over all pairs that lie as far apart.
std::vector<double> temporal_autocorrelation(const Frames &frames);

// Mean image around the dots whose surroundings lie inside the image and are not masked.
struct DotStack {
    std::uint32_t dots = 0;
    Plane image;                    // (2 kDotReach + 1)^2, DN above black
    std::vector<double> profile_dn; // in rings of half a pixel
};
DotStack stack_dots(const Frames &frames, const Plane &mean, double black_level_dn);
std::vector<double> dot_profile_radii();

} // namespace evidence
} // namespace clsp

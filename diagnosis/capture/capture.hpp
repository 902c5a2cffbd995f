// A capture set: what a real camera recorded, sequence by sequence, and what is known of the camera (the capture-set
// format, version 1).
#pragma once

#include "stages/phase.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

namespace clsp {

enum class CaptureScene : std::uint32_t { kDark = 0, kFlat = 1, kBoard = 2, kDots = 3 };

// Speckle, which lamp light has not.
inline bool is_laser(CaptureScene scene) {
    return scene == CaptureScene::kBoard || scene == CaptureScene::kDots;
}

struct CaptureDots {
    double sigma_px = 0.0;
    std::vector<std::array<double, 2>> positions_px; // x, y
};

// Light over the field where it is not even: 1 + the sum of c x^i y^j with 1 <= i + j <= degree, ordered by i + j, then
// by j. x, y: pixels from the origin over the unit. As frames have it, with all light that falls on them.
struct SmoothLight {
    std::array<double, 2> origin_px{};
    double unit_px = 1.0;
    std::vector<double> coefficients; // empty: even light
    double level_dn = 0.0;            // of all light where the sum is 0; 0: not known

    double at(double x_px, double y_px) const {
        const double x = (x_px - origin_px[0]) / unit_px, y = (y_px - origin_px[1]) / unit_px;
        double sum = 1.0;
        std::size_t k = 0;
        for (std::size_t degree = 1; k < coefficients.size(); ++degree)
            for (std::size_t j = 0; j <= degree; ++j)
                sum += coefficients[k++] * power(x, degree - j) * power(y, j);
        return sum > 0.0 ? sum : 0.0;
    }

  private:
    static double power(double value, std::size_t exponent) {
        double result = 1.0;
        for (; exponent > 0; --exponent)
            result *= value;
        return result;
    }
};

// One sequence without its codes: what a simulated sequence has in common with the real one.
struct SequenceLayout {
    std::string name;
    CaptureScene scene = CaptureScene::kDark;
    bool moving = false;
    std::uint32_t frame_count = 0;
    double f_number = 0.0;             // its own, or the camera's
    std::optional<double> exposure_ms;
    double light_error = 0.0;          // relative, of light that was found to go as exposure_ms; 0: it has its own
    std::vector<std::uint8_t> mask;    // empty, or height * width; 0: ignored
    SmoothLight illumination;          // of lamp or laser, as the frames were found to have it
    std::vector<float> frame_light;    // in each frame, over its mean, as found; empty: all the same
    double frame_light_level_dn = 0.0; // that mean; 0: not known
};

// By how much lamp or laser varies where all light varies by one, and so much of it, in DN, does not.
inline double variation_of_source(double level_dn, double constant_dn) {
    constexpr double kLeastShare = 0.05; // with less, what varies is not the source
    return level_dn > 0.0 ? 1.0 / std::max(1.0 - constant_dn / level_dn, kLeastShare) : 1.0;
}

// Of a larger image. Distances from the optical axis stay those of the image: r = 1 in its corner.
struct ImageWindow {
    std::uint32_t x = 0, y = 0; // of the window's first pixel
    std::uint32_t image_width = 0, image_height = 0;
};

struct CaptureLayout {
    std::uint32_t width = 0, height = 0, bits = 0;
    double pixel_pitch_m = 0.0, f_number = 0.0, wavelength_m = 0.0, degree_of_polarization = 1.0;
    double black_level_dn = 0.0, read_noise_dn = 0.0; // the data sheet's
    FieldKind field = FieldKind::kCircularGaussian;
    std::array<double, 2> principal_point_px{};       // ((width - 1) / 2, (height - 1) / 2) unless given
    std::optional<CaptureDots> dots;
    std::vector<SequenceLayout> sequences;
    std::optional<ImageWindow> window; // whose layout this is; all positions are from the window's first pixel

    std::uint32_t image_width() const { return window ? window->image_width : width; }
    std::uint32_t image_height() const { return window ? window->image_height : height; }
    // Pixels from the optical axis to the farthest corner pixel's centre, of the image.
    double farthest_corner_px() const {
        const double x = principal_point_px[0] + (window ? window->x : 0),
                     y = principal_point_px[1] + (window ? window->y : 0);
        return std::hypot(std::max(x, image_width() - 1.0 - x), std::max(y, image_height() - 1.0 - y));
    }
    // From the image's centre.
    double corner_radius_px() const { return 0.5 * std::hypot(image_width() - 1.0, image_height() - 1.0); }
    std::size_t pixel_count() const { return std::size_t{width} * height; }
    double maximum_code() const { return double((std::uint64_t{1} << bits) - 1); }
    // What one DN of a converter of ten bits, for which figures in DN are meant, is of this one's.
    double dn_of_ten_bits() const { return maximum_code() / 1023.0; }
};

// How many exposure times the sequences of a scene name.
inline std::size_t exposure_count(const CaptureLayout &layout, CaptureScene scene) {
    std::set<double> times;
    for (const SequenceLayout &sequence : layout.sequences)
        if (sequence.scene == scene && sequence.exposure_ms)
            times.insert(*sequence.exposure_ms);
    return times.size();
}

// Rows and columns of an image; the last ones are part of it.
struct PixelBlock {
    std::uint32_t first_row = 0, last_row = 0, first_column = 0, last_column = 0;
};

// Something that does not stop the diagnosis and that its reader is to know.
struct CaptureWarning {
    std::string sequence; // its name; empty: the whole set
    std::string text;
    std::string kind{};                // a word of the table in docs/guide/captures.md
    std::vector<std::size_t> frames{}; // that it is about, from 0; empty: all
    std::vector<PixelBlock> pixels{};  // that it is about; empty: all
};

// The kind of what both files and codes may tell.
constexpr const char *kSwappedBytes = "swapped_bytes";

struct StoredSequence; // stored_sequence.hpp

struct Capture {
    std::string name; // of the folder that it was read from; empty: of none
    CaptureLayout layout;
    // By sequence: frame_count * height * width codes; empty of one that is stored.
    std::vector<std::vector<std::uint16_t>> codes;
    // By sequence, or shorter: those whose codes stay in their files; nullptr: the codes are in memory.
    std::vector<std::shared_ptr<const StoredSequence>> stored;
    // Of the reader: keys that it does not know and the like. What the codes themselves show is capture_warnings().
    std::vector<CaptureWarning> warnings;

    bool is_stored(std::size_t sequence) const { return sequence < stored.size() && stored[sequence]; }
};

// The words of the format.
inline const char *scene_name(CaptureScene scene) {
    constexpr const char *kNames[] = {"dark", "flat", "board", "dots"};
    return kNames[static_cast<std::uint32_t>(scene) & 3u];
}
inline const char *motion_name(bool moving) { return moving ? "moving" : "static"; }

} // namespace clsp

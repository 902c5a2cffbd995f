// The laser's beam at a diffractive element: its intensity, and the shape of its far field. The profiles are in doe.h
// of the C API.
#pragma once

#include <cstdint>
#include <vector>

namespace clsp {

enum class BeamKind : std::uint32_t { kGaussian = 0, kFlatCircle, kFlatSquare, kSuperGaussian, kSkewed, kImage };

struct BeamParameters {
    BeamKind kind = BeamKind::kGaussian;
    double covariance_xx_m2 = 6.25e-8, covariance_xy_m2 = 0, covariance_yy_m2 = 6.25e-8;
    double width_m = 1e-3, height_m = 1e-3;
    double order = 4;
    double skew_x = 0, skew_y = 0;
    double m_squared = 1;
    std::uint32_t image_width = 0, image_height = 0;
    const float *image = nullptr; // host memory, only read during construction
    std::uint64_t image_pitch_bytes = 0;
};

class BeamProfile {
  public:
    // Throws for parameters that make no beam.
    explicit BeamProfile(const BeamParameters &parameters);

    // Any scale; the beam is centred at (0, 0) and 0 (or below 1e-13 of its peak) outside of +-half_width().
    double intensity(double x_m, double y_m) const;
    double half_width_x_m() const { return half_x_; }
    double half_width_y_m() const { return half_y_; }
    double m_squared() const { return parameters_.m_squared; }
    // Share of the power outside of a centred rectangle.
    double share_outside(double width_m, double height_m) const;
    // Amplitudes on side x side points from edge to edge of +-half_width.
    std::vector<float> amplitudes(std::uint32_t side) const;
    // Everything that the profile depends on, for cache keys.
    std::vector<double> content() const;

  private:
    BeamParameters parameters_;
    std::vector<float> image_;
    double half_x_ = 0, half_y_ = 0;
    double inverse_xx_ = 0, inverse_xy_ = 0, inverse_yy_ = 0; // of the covariance matrix
};

// The far field |FT b|^2 of a beam as a summed-area table: entry (i, j) times unit is the share of the power with u
// below node i and v below node j. Node i lies at (i - (nodes - 1) / 2) step_u lambda. Integers, so that differences
// are exact and never negative.
struct SpotShape {
    std::uint32_t nodes_x = 0, nodes_y = 0;
    double step_u_per_m = 0, step_v_per_m = 0; // direction cosine per metre of wavelength
    std::vector<std::uint32_t> table;
    double unit = 0;
    double half_u_per_m = 0, half_v_per_m = 0; // half-widths that hold 95.45 % of the power
};

SpotShape make_spot_shape(const BeamProfile &beam);

} // namespace clsp

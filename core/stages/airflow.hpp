// Smooth random phase screens, correlated in time: moving air, or anything else that bends wavefronts gently.
//
//     screen = Re IFFT2( G S ),   G(f) = g exp(-(pi f L)^2 / 2),   f in cycles per pixel, L = scale_px
//     S <- r S exp(-2 pi i f_x v frames) + sqrt(1 - r^2) W,   r = exp(-frames / correlation_frames),   v = wind_px
// W are independent complex numbers with independent standard normal parts; S is drawn from the same law first, so the
// process is stationary from the start. The screen is then Gaussian, has the autocorrelation exp(-(d/L)^2) at distance
// d (1/e at scale_px), and after t frames exp(-t / correlation_frames) where the wind v has carried it along the rows:
// air that changes on its way, or, with correlation_frames infinite, a frozen screen (Taylor 1938), which leaves a
// pixel with the correlation exp(-(v t / L)^2) over time. g makes its standard deviation over the ensemble exactly
// rms_rad at every sample (the mean of one screen, random too, counts: DC is a sample of the spectrum like all others).
// It is periodic on the field grid. Frequencies at which G is below 2e-8 of its peak are left out.
#pragma once

#include "runtime/command_chain.hpp"
#include "runtime/device_buffer.hpp"
#include "fft/fft.hpp"
#include "runtime/fields.hpp"
#include "stages/field_grid.hpp"

#include <cstdint>
#include <memory>

namespace clsp {

struct AirflowParameters {
    double rms_rad = 0.0;            // standard deviation of the phase; 0: off
    double scale_px = 6.0;           // image pixels, whatever the oversampling
    double correlation_frames = 3.0; // > 0; infinity: a screen that stays as it is
    double wind_px = 0.0;            // to the right, image pixels a frame
    std::uint64_t seed = 0;
};
CLSP_EQUALITY(AirflowParameters, rms_rad, scale_px, correlation_frames, wind_px, seed)

class Airflow {
  public:
    // Throws if a parameter is out of range, rms_rad = 0 included: without airflow make none.
    Airflow(std::shared_ptr<Context> context, const FieldGrid &grid, const AirflowParameters &parameters);

    const std::shared_ptr<Context> &context() const { return context_; }
    const FieldGrid &grid() const { return grid_; }
    const AirflowParameters &parameters() const { return parameters_; }

    // Lets time go on by `frames` (0 leaves the screen as it is) and computes the screen; the first call draws it.
    // substep, 0 to 255, tells apart several calls with one frame_index.
    void enqueue_advance(CommandChain &chain, std::uint64_t frame_index, double frames = 1.0,
                         std::uint32_t substep = 0);
    // The next advance draws everything.
    void reset() { drawn_ = false; }
    bool drawn() const { return drawn_; }
    // Phase in turns (phase / 2 pi) on the field grid: grid_height x grid_width floats, dense. Meaningless before the
    // first advance.
    const cl::Buffer &screen() const { return screen_.get(); }

  private:
    std::shared_ptr<Context> context_;
    FieldGrid grid_;
    AirflowParameters parameters_;
    std::uint32_t box_width_ = 1, box_height_ = 1; // odd; frequencies that are kept
    bool drawn_ = false;
    bool halves_; // the grid's width is even: the transform is of half of it, its field the screen itself
    std::shared_ptr<Fft> fft_;
    DeviceBuffer state_, filter_x_, filter_y_, scratch_, screen_;
    DeviceBuffer roots_, field_; // with halves, without
    cl::Kernel advance_, spectrum_, write_screen_;
};

// Throws unless the parameters are in range (rms_rad may be 0).
void check_airflow(const AirflowParameters &parameters);

} // namespace clsp

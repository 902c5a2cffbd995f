// The lens's aperture. The equations are in aperture.h of the C API.
#pragma once

#include "runtime/command_chain.hpp"
#include "runtime/device_buffer.hpp"
#include "runtime/fft.hpp"
#include "runtime/image_view.hpp"
#include "stages/bad_pixels.hpp"
#include "stages/field_grid.hpp"
#include "stages/phase.hpp"
#include "stages/pupil.hpp"

#include <cstdint>
#include <memory>

namespace clsp {

struct ApertureParameters {
    std::uint32_t width = 0, height = 0, oversampling = 1, guard_px = 0;
    PupilParameters pupil;
    bool workspace_from_host = false;
    double relative_diameter = 0.0; // 0: from the next three
    double f_number = 5.6, pixel_pitch_m = 2.9e-6, wavelength_m = 940e-9;
    double degree_of_polarization = 1.0;
};

class Aperture {
  public:
    Aperture(std::shared_ptr<Context> context, const ApertureParameters &parameters);

    const std::shared_ptr<Context> &context() const { return context_; }
    const FieldGrid &grid() const { return grid_; }
    double relative_diameter() const { return relative_diameter_; }
    double mean_transmission() const { return mean_transmission_; }
    std::uint32_t pupil_samples() const { return pupil_samples_; }
    std::uint64_t workspace_bytes() const { return workspace_bytes_; }
    const char *fft_backend() const { return fft_->backend(); }
    BadPixelCounter &bad_pixels() { return bad_pixels_; }

    void set_workspace(cl_mem mem, std::uint64_t offset_bytes, std::uint64_t size_bytes);
    void enqueue_pupil(CommandChain &chain, const ImageDescription &pupil);
    // Throws unless the phase fits: same context, grid, enough polarizations.
    void check_phase(const Phase &phase) const;
    // Throws unless there is work memory.
    void check_workspace() const;
    // Throws if an image lies in the work memory.
    void refuse_workspace(const ImageView &image, const char *name) const {
        refuse_overlap(image, name, workspace_, "the work memory");
    }
    // irradiance and intensity may be the same pixels.
    void enqueue_intensity(CommandChain &chain, Phase &phase, const ImageView &irradiance, const ImageView &intensity);

  private:
    // Parts of the work memory.
    void slice_workspace(const cl::Buffer &memory, std::uint64_t offset);

    std::shared_ptr<Context> context_;
    FieldGrid grid_;
    double relative_diameter_;
    double degree_of_polarization_;
    double mean_transmission_ = 0.0;
    std::uint32_t pupil_samples_ = 0;
    std::shared_ptr<Fft> fft_;
    DeviceBuffer pupil_;
    BadPixelCounter bad_pixels_;
    std::uint64_t field_bytes_ = 0, scratch_offset_ = 0, partial_offset_ = 0, workspace_bytes_ = 0;
    DeviceBuffer own_workspace_;
    cl::Buffer field_, scratch_, partial_; // slices of the work memory
    ImageView workspace_;                  // all of it, for overlap checks
    cl::Kernel apply_pupil_, write_intensity_, add_intensity_;
};

} // namespace clsp

// The lens's aperture. The equations are in aperture.h of the C API.
#pragma once

#include "stages/engines/engine.hpp"
#include "runtime/command_chain.hpp"
#include "runtime/device_buffer.hpp"
#include "runtime/fields.hpp"
#include "runtime/image_view.hpp"
#include "runtime/lazy_kernel.hpp"
#include "stages/bad_pixels.hpp"
#include "stages/field.hpp"
#include "stages/field_grid.hpp"
#include "stages/phase.hpp"
#include "stages/pupil.hpp"

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace clsp {

struct ApertureParameters {
    std::uint32_t width = 0, height = 0, oversampling = 1, guard_px = 0;
    PupilParameters pupil;
    bool workspace_from_host = false;
    double relative_diameter = 0.0; // 0: from the next three
    double f_number = 5.6, pixel_pitch_m = 2.9e-6, wavelength_m = 940e-9;
    double degree_of_polarization = 1.0;
    double fill_factor = 0.0;         // 0: the mean over a pixel's own samples; else its light-sensitive part
    std::optional<EngineSpec> engine; // this one or clFFT; none: what the context chooses
};
CLSP_EQUALITY(ApertureParameters, width, height, oversampling, guard_px, pupil, workspace_from_host,
              relative_diameter, f_number, pixel_pitch_m, wavelength_m, degree_of_polarization, fill_factor, engine)

class Aperture {
  public:
    Aperture(std::shared_ptr<Context> context, const ApertureParameters &parameters);

    const std::shared_ptr<Context> &context() const { return context_; }
    const FieldGrid &grid() const { return grid_; }
    double relative_diameter() const { return relative_diameter_; }
    double mean_transmission() const { return mean_transmission_; }
    std::uint32_t pupil_samples() const { return pupil_samples_; }
    std::uint64_t workspace_bytes() const { return workspace_bytes_; }
    // The engine with its work-groups, where the choice comes from, and why it is clFFT ("" if it is not).
    const EngineSpec &engine() const { return engine_->spec(); }
    const std::string &engine_source() const { return engine_source_; }
    const std::string &clfft_reason() const { return clfft_reason_; }
    BadPixelCounter &bad_pixels() { return bad_pixels_; }
    const ApertureParameters &parameters() const { return parameters_; }
    // Takes all parameters but those of the grid and the work memory's owner. Waits for nothing; what is enqueued keeps
    // what it had.
    void configure(const ApertureParameters &parameters);

    void set_workspace(cl_mem mem, std::uint64_t offset_bytes, std::uint64_t size_bytes);
    void enqueue_pupil(CommandChain &chain, const ImageDescription &pupil);
    // Throws unless the phase fits: same context, grid, enough polarizations.
    void check_phase(const Phase &phase, const Field *field = nullptr) const;
    // Throws unless there is work memory.
    void check_workspace() const;
    // Throws if an image lies in the work memory.
    void refuse_workspace(const ImageView &image, const char *name) const {
        refuse_overlap(image, name, workspace_, "the work memory");
    }
    // Builds what such frames need, before their first command.
    void prepare(const Phase &phase, const Exposure &exposure);
    // Frames can be the sensor's codes (Exposure::exposed).
    bool exposes(const Sensor &sensor) const { return engine_->exposes(sensor); }
    // irradiance and intensity may be the same pixels, unless several fields are added (laser lines, materials,
    // Exposure::adds).
    void enqueue_intensity(CommandChain &chain, const Phase &phase, const ImageView &irradiance,
                           const ImageView &intensity, const Exposure &exposure = {});
    // Light without speckle: the irradiance times the pupil's mean transmission. The images may be the same pixels.
    // Builds what enqueue_incoherent() needs; without it the first call does.
    void prepare_incoherent() { incoherent_.get(*context_); }
    void enqueue_incoherent(CommandChain &chain, const ImageView &irradiance, const ImageView &intensity);

  private:
    std::vector<EngineChoice> choices(const ApertureParameters &parameters) const;
    // Parts of the work memory.
    void slice_workspace(const cl::Buffer &memory, std::uint64_t offset);
    Field &field_of(const Exposure &exposure) { return exposure.field ? *exposure.field : plain_field_; }

    std::shared_ptr<Context> context_;
    ApertureParameters parameters_; // the pupil's image is in the two below
    std::vector<float> pupil_image_, pupil_image_imaginary_;
    FieldGrid grid_;
    double relative_diameter_;
    double degree_of_polarization_;
    double normalized_mean_transmission_ = 1.0; // as the pupil is normalized
    double mean_transmission_ = 0.0;
    std::uint32_t pupil_samples_ = 0;
    std::unique_ptr<Engine> engine_;
    std::string engine_source_, clfft_reason_;
    DeviceBuffer pupil_;
    bool complex_pupil_ = false;
    BadPixelCounter bad_pixels_;
    std::uint64_t scratch_offset_ = 0, partial_offset_ = 0, workspace_bytes_ = 0;
    DeviceBuffer own_workspace_;
    WorkMemory memory_;   // slices of the work memory
    ImageView workspace_; // all of it, for overlap checks
    Field plain_field_;
    LazyKernel incoherent_;
};

} // namespace clsp

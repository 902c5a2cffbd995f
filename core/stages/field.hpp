// The field that leaves the surface towards the lens. The equations are in aperture.h and pipeline.h of the C API.
#pragma once

#include "runtime/command_chain.hpp"
#include "runtime/device_buffer.hpp"
#include "runtime/fields.hpp"
#include "runtime/image_view.hpp"
#include "stages/bad_pixels.hpp"
#include "stages/laser_lines.hpp"
#include "stages/material.hpp"
#include "stages/phase.hpp"

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <vector>

namespace clsp {

struct FieldParameters {
    double coherent_fraction = 0.0; // of light that keeps its phase, where no material table says otherwise
    std::uint32_t line_count = 1;   // lines of the laser
    double dephasing_rad = 0.0;     // s: a line at k turns by k s h, h the height in standard deviations
    double wavelength_m = 940e-9;   // roughness to phase, with a material table
    double degree_of_polarization = 1.0;
    std::uint64_t seed = 0;
    std::shared_ptr<MaterialTable> materials; // may be empty
};
CLSP_EQUALITY(FieldParameters, coherent_fraction, line_count, dephasing_rad, wavelength_m, degree_of_polarization,
              seed, materials)

// What a frame brings.
struct FieldInput {
    ImageView irradiance;
    ImageView material;                 // with a material table
    const cl::Buffer *screen = nullptr; // turns on the field grid; may be nullptr
    double coherent_gain = 1.0;         // on the amplitude of coherent_fraction's part, without a material table
};

class Field {
  public:
    Field(std::shared_ptr<Context> context, const FieldGrid &grid);

    const FieldParameters &parameters() const { return parameters_; }
    const std::vector<LaserLine> &lines() const { return lines_; }
    void configure(const FieldParameters &parameters);
    // True if the two polarizations' weights are in the field (they differ from pixel to pixel).
    bool weighs_polarizations() const { return parameters_.materials != nullptr; }
    BadPixelCounter &bad_materials() { return bad_materials_; }

    // For kernels that make the field themselves: how to build them, and their first arguments, those of
    // field_illuminate up to the screen.
    std::string options(const Phase &phase, const LaserLine &line, bool with_screen) const;
    void add_arguments(KernelArguments &arguments, const Phase &phase, const FieldInput &input,
                       std::uint32_t polarization, const LaserLine &line) const;

    // Draws the heights of the phase's surface that add_arguments() hands on, if they are needed and not those that
    // are there: before the first line of a frame.
    void enqueue_heights(CommandChain &chain, const Phase &phase);
    // Builds what such frames need; nothing is built later.
    void prepare(const Phase &phase, bool with_screen);
    void enqueue_illuminate(CommandChain &chain, const Phase &phase, const FieldInput &input,
                            std::uint32_t polarization, const LaserLine &line, const cl::Buffer &field,
                            const cl::Buffer &bad_pixels);

  private:
    // The pupil's amplitudes grow with the oversampling, because white noise loses power per cycle by it. A constant
    // field does not.
    double coherent_amplitude(double fraction) const;
    using Variant = std::array<bool, 2>; // dephased line, screen
    double turns_per_height(const LaserLine &line) const;
    std::string state_options(const Phase &phase) const;
    cl::Kernel &kernel_for(const Phase &phase, Variant variant);

    std::shared_ptr<Context> context_;
    FieldGrid grid_;
    FieldParameters parameters_;
    std::vector<LaserLine> lines_;
    DeviceBuffer table_;
    cl::Kernel draw_heights_;
    bool draws_in_lanes_ = false;
    DeviceBuffer heights_;                       // on the field grid; empty where no line needs them
    std::optional<std::uint64_t> heights_epoch_; // of the phase, as they are
    BadPixelCounter bad_materials_;
    std::string kernel_options_; // of the kernels kept
    std::map<Variant, cl::Kernel> kernels_;
};

} // namespace clsp

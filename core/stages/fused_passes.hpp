// The fused, pruned speckle engine: field, transform, pupil, transform back and intensity in three passes over the
// frame, of which only lines that the pupil lets through are ever stored.
//   A  columns: field, forward transform; the kept lines
//   B  kept lines: forward transform, pupil, inverse transform, in place
//   C  columns: inverse transform of the kept lines, |V|^2
// Made for CPU devices: a work-item is a work-group and works on LANES columns or lines at once, with explicit vectors.
#pragma once

#include "runtime/command_chain.hpp"
#include "runtime/device_buffer.hpp"
#include "runtime/fused_plan.hpp"
#include "runtime/image_view.hpp"
#include "stages/field.hpp"
#include "stages/field_grid.hpp"
#include "stages/phase.hpp"
#include "stages/pupil.hpp"

#include <cstdint>
#include <map>
#include <memory>
#include <string>

namespace clsp {

class FusedPasses {
  public:
    // Why the engine is not to be used for this grid on this device; "" if it is.
    static std::string refusal(const Context &context, const FieldGrid &grid);

    // sample_powers: pass C writes |V|^2 of every sample of the grid instead of pixels (for weights over samples, or an
    // oversampling that does not divide the vectors). every_line: room for all lines, whatever the pupil.
    FusedPasses(std::shared_ptr<Context> context, const FieldGrid &grid, const Pupil &pupil, bool every_line,
                bool sample_powers);

    // True if pass C can sum a pixel's samples by itself.
    static bool sums_pixels(const Context &context, std::uint32_t oversampling);

    std::uint32_t lanes() const { return lanes_; }
    std::uint32_t kept_lines() const { return kept_; }
    // Work memory for the kept lines.
    std::uint64_t lines_bytes() const;

    // Builds what such frames need; nothing is built later.
    void prepare(const Phase &phase, Field &field, bool with_screen, bool shifted);

    // A and B: from the irradiance to the kept lines behind the pupil. shift in samples of the grid.
    void enqueue_lines(CommandChain &chain, const Phase &phase, Field &field, const FieldInput &input,
                       std::uint32_t polarization, std::size_t line, const cl::Buffer &lines,
                       const cl::Buffer &bad_pixels);
    void enqueue_pupil(CommandChain &chain, const cl::Buffer &lines);
    void enqueue_pupil(CommandChain &chain, const cl::Buffer &lines, double shift_x, double shift_y);
    // C: weight |V|^2 to `intensity`, added to `before` unless that is empty. Both may be the same pixels.
    void enqueue_intensity(CommandChain &chain, const cl::Buffer &lines, double weight, const ImageView &before,
                           const ImageView &intensity);

  private:
    std::size_t column_items(std::uint32_t columns) const { return (columns + strips_ * lanes_ - 1) / (strips_ * lanes_); }
    cl::Kernel &columns_kernel(const std::string &field_options);
    cl::Kernel &rows_kernel(bool shifted);
    void make_tables(const Pupil &pupil, bool every_line);
    void add_rows(cl::Kernel &kernel, const cl::Buffer &lines, const double *shift);

    std::shared_ptr<Context> context_;
    FieldGrid grid_;
    std::uint32_t lanes_;
    std::uint32_t strips_;        // of columns, side by side
    std::uint32_t pixel_samples_; // along each axis, of what pass C writes
    FusedPlan row_plan_, column_plan_;
    ProgramCache::GeneratedHeader row_codelets_, column_codelets_;
    std::uint32_t kept_ = 0, groups_ = 0, capacity_groups_ = 0;
    bool complex_pupil_ = false;
    DeviceBuffer row_twiddles_, column_twiddles_;
    DeviceBuffer positions_, blocks_;
    DeviceBuffer pupil_;
    DeviceBuffer frequencies_, line_frequencies_;
    std::map<std::string, cl::Kernel> columns_;
    cl::Kernel rows_, shifted_rows_, inverse_;
};

} // namespace clsp

// The sums over pixels on the device (kernels/diagnosis/frame_sums.cl), for devices that are faster at it than the
// host's threads.
#pragma once

#include "runtime/context.hpp"
#include "runtime/device_buffer.hpp"
#include "runtime/launch_guard.hpp"
#include "statistics/frame_sums.hpp"

#include <memory>
#include <string>
#include <vector>

namespace clsp::statistics {

struct RowProduct; // as in diagnosis/frame_sums.cl

// Has a queue and buffers of its own, which are kept from one sequence to the next. The device's memory holds the codes
// of a sequence and four bytes for each besides.
class DeviceSums final : public FrameSums {
  public:
    // may_give_up: what the device fails at (no memory, above all) is left to the host from then on.
    explicit DeviceSums(std::shared_ptr<Context> context, bool may_give_up = false);
    ~DeviceSums() override;

    // Sequences that the device's buffers can hold, of images that are not tiny.
    bool takes(const Geometry &geometry) const;
    // After a failure: whether it is to be left to the host, which a warning in the context's log says then.
    bool gives_up(const std::string &why);

    std::vector<double> count_codes(const Geometry &geometry, const std::uint16_t *codes,
                                    std::vector<std::uint64_t> &histogram) override;
    void make_residuals(const Geometry &geometry, const ResidualScale &scale, Frames &frames) override;
    std::vector<ResidualFrameSums> sum_residuals(const Geometry &geometry, const Frames &frames,
                                                 const ResidualWeights &weights,
                                                 const std::vector<std::size_t> &lags) override;
    std::vector<SpeckleFrameSums> sum_speckle(const Geometry &geometry, const Frames &frames) override;
    std::vector<DotLagFrameSums> sum_dot_lags(const Geometry &geometry, const Frames &frames) override;
    std::vector<EdgeFrameSums> sum_edges(const Geometry &geometry) override;
    std::vector<std::vector<double>> frame_differences(const Geometry &geometry, const Frames &frames) override;
    std::vector<const float *> residual_images(const Geometry &geometry, const Frames &frames,
                                               const std::vector<std::size_t> &which) override;

  private:
    // Kept from call to call, larger ones in place of smaller ones.
    const cl::Buffer &reserve(DeviceBuffer &buffer, std::size_t bytes);
    void upload(DeviceBuffer &buffer, const void *values, std::size_t bytes, std::size_t offset = 0);
    void download(const DeviceBuffer &buffer, void *values, std::size_t bytes, std::size_t offset = 0) const;
    // A kernel over rows: sixteen work-items to each.
    void run_rows(const cl::Kernel &kernel, std::size_t rows, std::size_t images, std::size_t products = 1);
    // Sums of the products' rows, see row_sum().
    void sum_products(const cl::Buffer &images, std::size_t pixels, std::size_t pitch,
                      const std::vector<RowProduct> &products);
    double row_sum(std::size_t product, std::size_t frame, std::size_t row) const {
        return values_[(product * most_frames_ + frame) * most_rows_ + row];
    }
    // All rows of a product, the first one first.
    double sum_of(std::size_t product, std::size_t frame, std::size_t rows) const;
    std::vector<Powers> row_powers(const cl::Buffer &images, std::size_t count, std::size_t pixels, std::size_t width,
                                   std::size_t rows);

    std::shared_ptr<Context> context_;
    bool may_give_up_ = false, gave_up_ = false;
    cl::CommandQueue queue_;
    LaunchGuard guard_;
    cl::Kernel count_, residuals_, row_powers_, products_, columns_, bins_of_, edge_columns_, edge_rows_;
    // images: the residuals of all frames, then what they are multiplied with.
    DeviceBuffer codes_, weight_, images_, bins_, mean_, variance_, by_frame_, row_products_, small_, sums_;
    std::vector<Powers> powers_; // of the residuals' rows, frame by frame
    std::vector<double> values_; // row_sum()
    std::size_t most_frames_ = 0, most_rows_ = 0;
    std::vector<std::vector<float>> host_images_;
};

// What CLSPECKLE_STATISTICS says: "host", "device", or "auto", the default. Throws kInvalidArgument for another word.
enum class StatisticsChoice { kAuto, kHost, kDevice };
StatisticsChoice environment_statistics_choice();

// The device's sums, if it is to take them: by default GPUs with double precision do, and where such a one does not
// build the kernels, the host sums, after a warning in the context's log. nullptr: the host does. Throws, where the
// device is forced, for what it cannot.
std::unique_ptr<DeviceSums> make_device_sums(const std::shared_ptr<Context> &context, StatisticsChoice choice);

} // namespace clsp::statistics

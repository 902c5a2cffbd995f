#include "statistics/sequence_statistics.hpp"

#include "runtime/error.hpp"
#include "statistics/device_sums.hpp"
#include "statistics/make_frames.hpp"
#include "statistics/statistic_groups.hpp"

#include <fmt/format.h>

#include <cmath>
#include <utility>

namespace clsp {

namespace {

void measure(const statistics::Geometry &geometry, const std::uint16_t *codes, const Calibration &calibration,
             unsigned threads, statistics::FrameSums &sums, statistics::Sink &sink) {
    using namespace statistics;
    const Frames frames = make_frames(geometry, codes, calibration, sums);
    const ResidualSums residual = sum_residuals(geometry, frames, sums);
    const StatisticInput in{geometry, frames, residual, sums, codes, calibration.black_level_dn,
                            geometry.scene == CaptureScene::kFlat ? calibration.dark_frame.get() : nullptr, threads};
    measure_temporal_noise(in, sink);
    measure_repetition(in, sink);
    measure_code_lattice(in, sink);
    measure_blocks(in, sink);
    measure_field(in, sink);
    switch (geometry.scene) {
    case CaptureScene::kDark:
    case CaptureScene::kFlat:
        measure_fixed_pattern(in, sink);
        break;
    case CaptureScene::kBoard:
        measure_levels(in, sink);
        measure_intensity_law(in, sink);
        measure_speckle(in, sink);
        measure_static_scene(in, sink);
        break;
    case CaptureScene::kDots:
        measure_levels(in, sink);
        measure_dots(in, sink);
        measure_static_scene(in, sink);
        break;
    }
}

} // namespace

SequenceStatistics::SequenceStatistics(const CaptureLayout &layout, std::size_t sequence, std::uint32_t frame_count,
                                       std::shared_ptr<SpareBuffers<float>> spare)
    : geometry_(std::make_shared<statistics::Geometry>(layout, sequence, frame_count)),
      spare_(spare ? std::move(spare) : std::make_shared<SpareBuffers<float>>()) {
    // The list is what measuring black frames writes.
    const std::vector<std::uint16_t> black(geometry_->frames * geometry_->pixels);
    statistics::Sink sink(layout.sequences[sequence].name, &list_, nullptr);
    measure(*geometry_, black.data(), {}, 1, *statistics::make_host_sums(1, *spare_), sink);
}

void SequenceStatistics::compute(const std::uint16_t *codes, const Calibration &calibration, double *values,
                                 unsigned threads, statistics::DeviceSums *device) const {
    if (!codes || !values)
        throw Error(Status::kInvalidArgument,
                    fmt::format("statistics: {} is NULL; give {} numbers.", codes ? "values" : "codes",
                                codes ? list_.size() : geometry_->frames * geometry_->pixels));
    if (!std::isfinite(calibration.black_level_dn) || !std::isfinite(calibration.read_noise_dn) ||
        calibration.read_noise_dn < 0.0)
        throw Error(
            Status::kInvalidArgument,
            fmt::format(
                "statistics: black level {} DN, read noise {} DN; both must be finite and the noise not negative.",
                calibration.black_level_dn, calibration.read_noise_dn));
    const auto measured_by = [&](statistics::FrameSums &sums) {
        statistics::Sink sink({}, nullptr, values);
        measure(*geometry_, codes, calibration, threads, sums, sink);
        return sink.count();
    };
    const auto measured = [&] {
        if (device && device->takes(*geometry_)) {
            try {
                return measured_by(*device);
            } catch (const Error &error) {
                if (!device->gives_up(error.what()))
                    throw;
            } catch (const cl::Error &error) {
                if (!device->gives_up(fmt::format("{} failed with {}", error.what(), error.err())))
                    throw;
            }
        }
        return measured_by(*statistics::make_host_sums(threads, *spare_));
    };
    const std::size_t count = measured();
    if (count != list_.size())
        throw Error(Status::kInternal,
                    fmt::format("statistics: {} values for a list of {}; please report this.", count, list_.size()));
}

} // namespace clsp

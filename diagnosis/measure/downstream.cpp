#include "measure/downstream.hpp"

#include "measure/evidence.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/core.h>
#include <optional>

namespace clsp {
namespace {

using Point = std::array<double, 2>;

constexpr std::size_t kCentreDots = 2048; // at most, spread over the list: enough for the error to a few percent

struct FrameView {
    const CaptureLayout *layout;
    const SequenceLayout *sequence;
    const std::uint16_t *codes; // of one frame

    // Visits the pixels within a radius of a point; false if some lie outside the image or are masked.
    template <class Visit> bool around(const Point &point, double radius, const Visit &visit) const {
        const double left = std::ceil(point[0] - radius), right = std::floor(point[0] + radius);
        const double top = std::ceil(point[1] - radius), bottom = std::floor(point[1] + radius);
        if (left < 0.0 || top < 0.0 || right > layout->width - 1.0 || bottom > layout->height - 1.0)
            return false;
        for (auto y = std::size_t(top); y <= std::size_t(bottom); ++y)
            for (auto x = std::size_t(left); x <= std::size_t(right); ++x) {
                const double dx = double(x) - point[0], dy = double(y) - point[1], squared = dx * dx + dy * dy;
                if (squared > radius * radius)
                    continue;
                const std::size_t pixel = y * layout->width + x;
                if (!sequence->mask.empty() && !sequence->mask[pixel])
                    return false;
                visit(double(codes[pixel]), dx, dy, squared);
            }
        return true;
    }
};

// The centroid's distance from a nominal place.
std::optional<Point> centre_offset(const FrameView &view, const Point &nominal, double sigma, double spacing) {
    // What lies between this dot and the next: a ring from 2.5 sigma, or from half way to the next dot if that is
    // nearer, one pixel wide at the least.
    const double outer = std::max(std::min(3.5 * sigma, 0.6 * spacing), 2.5),
                 inner = std::min(2.5 * sigma, outer - 1.0);
    double background = 0.0, background_count = 0.0;
    if (!view.around(nominal, outer,
                     [&](double code, double, double, double squared) {
                         if (squared >= inner * inner) {
                             background += code;
                             ++background_count;
                         }
                     }) ||
        background_count == 0.0)
        return std::nullopt;
    background /= background_count;
    const double radius = std::max(2.0 * sigma, 1.5);
    Point offset{};
    for (int round = 0; round < 2; ++round) {
        double light = 0.0, x = 0.0, y = 0.0;
        const Point centre{nominal[0] + offset[0], nominal[1] + offset[1]};
        const bool is_inside = view.around(centre, radius, [&](double code, double dx, double dy, double) {
            const double signal = std::max(0.0, code - background);
            light += signal;
            x += signal * dx;
            y += signal * dy;
        });
        if (!is_inside || !(light > 0.0))
            return std::nullopt;
        offset = {offset[0] + x / light, offset[1] + y / light};
    }
    return offset;
}

double nearest_distance(const std::vector<Point> &positions, std::size_t index) {
    double nearest = 1e30;
    for (std::size_t j = 0; j < positions.size(); ++j)
        if (j != index)
            nearest = std::min(
                nearest, std::hypot(positions[j][0] - positions[index][0], positions[j][1] - positions[index][1]));
    return nearest;
}

} // namespace

double CentreErrors::rms() const {
    return count > 0.0 ? std::sqrt(square_sum / count) : 0.0;
}
double CentreErrors::rms_x() const {
    return count > 0.0 ? std::sqrt(square_sum_x / count) : 0.0;
}

CentreErrors centre_errors(const CaptureLayout &layout, const SequenceLayout &sequence, const std::uint16_t *codes,
                           std::uint32_t frame_count) {
    CentreErrors errors;
    if (!layout.dots)
        return errors;
    const std::vector<Point> &positions = layout.dots->positions_px;
    const std::size_t step = (positions.size() + kCentreDots - 1) / kCentreDots;
    for (std::size_t i = 0; i < positions.size(); i += step) {
        const double spacing = nearest_distance(positions, i);
        for (std::uint32_t t = 0; t < frame_count; ++t) {
            const FrameView view{&layout, &sequence, codes + t * layout.pixel_count()};
            if (const auto offset = centre_offset(view, positions[i], layout.dots->sigma_px, spacing)) {
                errors.square_sum += (*offset)[0] * (*offset)[0] + (*offset)[1] * (*offset)[1];
                errors.square_sum_x += (*offset)[0] * (*offset)[0];
                ++errors.count;
            }
        }
    }
    return errors;
}

Downstream measure_downstream(ReplicateRunner &runner, const Capture &real, const FittedModel &baseline,
                              const FittedModel *final, std::uint64_t seed) {
    const FittedModel *models[] = {nullptr, &baseline, final};
    return measure_downstream(
        runner.layout(), nullptr, final ? 3 : 2,
        [&](std::size_t version, std::size_t s, std::uint32_t frame_count) {
            return evidence_frames(runner, real, models[version], s, frame_count, seed);
        },
        runner.checkpoint);
}

Downstream measure_downstream(const CaptureLayout &layout, const CaptureDots *simulated_dots, std::size_t versions,
                              const VersionFrames &frames, const std::function<void()> &checkpoint) {
    const auto is_dots = [](const SequenceLayout &s) { return s.scene == CaptureScene::kDots; };
    const bool any_moving = std::any_of(layout.sequences.begin(), layout.sequences.end(),
                                        [&](const SequenceLayout &s) { return is_dots(s) && s.moving; });
    CaptureLayout simulated = layout;
    if (simulated_dots)
        simulated.dots = *simulated_dots;
    std::array<CentreErrors, 3> errors;
    for (std::size_t s = 0; s < layout.sequences.size(); ++s) {
        const SequenceLayout &sequence = layout.sequences[s];
        if (!layout.dots || !is_dots(sequence) || (any_moving && !sequence.moving))
            continue;
        if (checkpoint)
            checkpoint();
        const std::uint32_t frame_count = std::min(kEvidenceFrames, sequence.frame_count);
        for (std::size_t v = 0; v < versions; ++v) {
            const auto codes = frames(v, s, frame_count);
            const CentreErrors part = centre_errors(v ? simulated : layout, sequence, codes.data(), frame_count);
            errors[v].square_sum += part.square_sum;
            errors[v].square_sum_x += part.square_sum_x;
            errors[v].count += part.count;
        }
    }
    Downstream result;
    if (!(errors[0].count > 0.0) || !(errors[1].count > 0.0))
        return result;
    if (versions < 3 || !(errors[2].count > 0.0))
        errors[2] = errors[1];
    // dz = z^2 dx / (b f): z m, dx px along the baseline, b m, f px.
    const double depth_mm = 1e3 * kDepthDistance * kDepthDistance / (kDepthBaseline * double(layout.image_width()));
    result.valid = true;
    result.real = errors[0].rms();
    result.before = errors[1].rms();
    result.after = errors[2].rms();
    result.depth_error_mm_real = depth_mm * errors[0].rms_x();
    result.depth_error_mm_before = depth_mm * errors[1].rms_x();
    result.depth_error_mm_after = depth_mm * errors[2].rms_x();
    result.depth_assumption = fmt::format("depth z = {:g} m, baseline b = {:g} mm along the rows, focal length f = {} "
                                          "px (the image's width: a field of view "
                                          "of 53 degrees); dz = z^2 dx / (b f)",
                                          kDepthDistance, 1e3 * kDepthBaseline, layout.image_width());
    return result;
}

} // namespace clsp

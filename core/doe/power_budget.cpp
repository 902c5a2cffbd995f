#include "doe/power_budget.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

namespace clsp {
namespace {

double sinc(double x) {
    return std::abs(x) < 1e-8 ? 1.0 : std::sin(M_PI * x) / (M_PI * x);
}

// RMS of power over wanted power, over its mean, minus 1.
double uniformity(const std::vector<double> &shares, const std::vector<double> &weights) {
    double mean = 0, square = 0;
    for (std::size_t i = 0; i < shares.size(); ++i)
        mean += shares[i] / weights[i] / double(shares.size());
    if (!(mean > 0))
        return 0;
    for (std::size_t i = 0; i < shares.size(); ++i)
        square += std::pow(shares[i] / weights[i] / mean - 1, 2) / double(shares.size());
    return std::sqrt(square);
}

// Marks the texels around a direction that are nearer to it than to any before.
class Capture {
  public:
    Capture(const DoePowerBudget &budget, double reach_u, double reach_v)
        : width_(int(budget.image_width)), height_(int(budget.image_height)),
          texel_u_(2 * budget.half_extent_x / width_), texel_v_(2 * budget.half_extent_y / height_),
          reach_u_(std::max(reach_u, 1.5 * texel_u_)), reach_v_(std::max(reach_v, 1.5 * texel_v_)),
          owner(std::size_t(width_) * std::size_t(height_), -1),
          distance_(owner.size(), std::numeric_limits<float>::max()) {}

    void claim(double u, double v, int index) {
        const double cx = u / texel_u_ + 0.5 * width_, cy = v / texel_v_ + 0.5 * height_;
        const double rx = reach_u_ / texel_u_, ry = reach_v_ / texel_v_;
        for (int y = std::max(0, int(std::floor(cy - ry))); y <= std::min(height_ - 1, int(std::floor(cy + ry))); ++y)
            for (int x = std::max(0, int(std::floor(cx - rx))); x <= std::min(width_ - 1, int(std::floor(cx + rx)));
                 ++x) {
                const double far = std::pow((x + 0.5 - cx) / rx, 2) + std::pow((y + 0.5 - cy) / ry, 2);
                const std::size_t at = std::size_t(y) * std::size_t(width_) + std::size_t(x);
                if (far <= 1 && far < distance_[at]) {
                    distance_[at] = static_cast<float>(far);
                    owner[at] = index;
                }
            }
    }

  private:
    int width_, height_;
    double texel_u_, texel_v_, reach_u_, reach_v_;

  public:
    std::vector<int> owner; // of each texel

  private:
    std::vector<float> distance_;
};

} // namespace

void begin_power_budget(const PatternImage &image, const BeamProfile &beam, double half_u, double half_v,
                 DoePowerBudget &budget) {
    static_cast<PatternImage &>(budget) = image;
    budget.m_squared = beam.m_squared();
    budget.divergence_x_rad = std::asin(std::min(1.0, half_u));
    budget.divergence_y_rad = std::asin(std::min(1.0, half_v));
}

void balance_orders(const DoeElement &element, const DoeLight &light, DoePatternResult &result) {
    const auto columns = std::int64_t{element.sampled_width()}, rows = std::int64_t{element.sampled_height()};
    const bool envelope = element.parameters.pixel_envelope;
    const auto bin = [&](std::int64_t m, std::int64_t n) {
        return light.order_power[std::size_t(((n % rows + rows) % rows) * columns + (m % columns + columns) % columns)];
    };
    double total = 0;
    for (const double power : light.order_power)
        total += power;
    DoePowerBudget &budget = result.budget;
    bool zero_wanted = false;
    for (const auto &dot : element.dots) {
        const auto m = static_cast<std::int64_t>(dot[0]), n = static_cast<std::int64_t>(dot[1]);
        double share = bin(m, n);
        if (envelope)
            share *= std::pow(sinc(dot[0] / double(columns)) * sinc(dot[1] / double(rows)), 2);
        else if (m < -(columns / 2) || m > (columns - 1) / 2 || n < -(rows / 2) || n > (rows - 1) / 2)
            share = 0; // beyond the sampling limit
        result.dot_shares.push_back(share);
        budget.dots += share;
        zero_wanted = zero_wanted || (m == 0 && n == 0);
    }
    budget.zero_order = zero_wanted ? 0 : bin(0, 0);
    for (const SpectralLine &line : element.lines)
        budget.scatter -= line.share * std::expm1(-std::pow(element.phase_noise(line.wavelength_m), 2));
    // Over all orders that share a bin the envelope sums to 1, so that the bins hold all light.
    budget.ghosts = total - budget.dots - budget.zero_order;
    budget.uniformity_rms = element.dots.empty() ? 0 : uniformity(result.dot_shares, element.weights);
}

void balance_aperture(const DoeElement &element, const std::vector<float> &texel_shares, double half_u, double half_v,
                      DoePatternResult &result) {
    DoePowerBudget &budget = result.budget;
    constexpr int kZero = -2, kTwin = -3; // -1: nobody's
    Capture capture(budget, 2 * half_u, 2 * half_v);
    bool zero_wanted = false;
    for (std::size_t i = 0; i < element.dots.size(); ++i) {
        const auto [u, v] = element.direction(i, element.mean_wavelength_m);
        capture.claim(u, v, int(i));
        zero_wanted = zero_wanted || (std::abs(u) < half_u && std::abs(v) < half_v);
    }
    if (!zero_wanted)
        capture.claim(0, 0, kZero);
    const std::set<std::array<double, 2>> wanted(element.dots.begin(), element.dots.end());
    for (std::size_t i = 0; i < element.dots.size(); ++i)
        if (wanted.find({-element.dots[i][0], -element.dots[i][1]}) == wanted.end()) {
            const auto [u, v] = element.direction(i, element.mean_wavelength_m);
            capture.claim(-u, -v, kTwin);
        }
    result.dot_shares.assign(element.dots.size(), 0.0);
    for (std::size_t at = 0; at < texel_shares.size(); ++at) {
        const int owner = capture.owner[at];
        if (owner >= 0) {
            result.dot_shares[std::size_t(owner)] += texel_shares[at];
            budget.dots += texel_shares[at];
        } else if (owner == kZero) {
            budget.zero_order += texel_shares[at];
        } else if (owner == kTwin) {
            budget.ghosts += texel_shares[at];
        }
    }
    budget.scatter = 1 - budget.dots - budget.zero_order - budget.ghosts;
    budget.uniformity_rms = element.dots.empty() ? 0 : uniformity(result.dot_shares, element.weights);
}

void add_scatter(const DoeElement &element, std::vector<float> &texel_shares) {
    const DoePatternParameters &p = element.parameters;
    // The noise differs from pixel to pixel, not within one: its envelope is that of a whole pixel. Without an envelope
    // the light is even up to the sampling limit.
    for (const SpectralLine &line : element.lines) {
        const double scattered = -std::expm1(-std::pow(element.phase_noise(line.wavelength_m), 2)) * line.share;
        if (!(scattered > 0))
            continue;
        const auto profile = [&](std::uint32_t count, double half_extent) {
            std::vector<double> values(count);
            const double pitch = p.pixel_pitch_m / line.wavelength_m, step = 2 * half_extent / count;
            for (std::uint32_t i = 0; i < count; ++i) {
                const double at = pitch * ((i + 0.5) * step - half_extent);
                values[i] = pitch * step * (p.pixel_envelope ? std::pow(sinc(at), 2) : std::abs(at) < 0.5 ? 1.0 : 0.0);
            }
            return values;
        };
        const std::vector<double> x = profile(p.image_width, p.half_extent_x),
                                  y = profile(p.image_height, p.half_extent_y);
        for (std::size_t j = 0; j < y.size(); ++j)
            for (std::size_t i = 0; i < x.size(); ++i)
                texel_shares[j * x.size() + i] += static_cast<float>(scattered * x[i] * y[j]);
    }
}

void finish_texels(std::vector<float> texel_shares, DoePatternResult &result) {
    DoePowerBudget &budget = result.budget;
    const std::size_t width = budget.image_width, height = budget.image_height;
    const double texel_u = 2 * budget.half_extent_x / double(width),
                 texel_v = 2 * budget.half_extent_y / double(height);
    budget.inside_image = 0;
    for (std::size_t j = 0; j < height; ++j) {
        double row = 0;
        for (std::size_t i = 0; i < width; ++i) {
            const double u = (double(i) + 0.5) * texel_u - budget.half_extent_x,
                         v = (double(j) + 0.5) * texel_v - budget.half_extent_y;
            const double cosine_squared = 1 - u * u - v * v;
            float &texel = texel_shares[j * width + i];
            if (!(cosine_squared > 0)) {
                texel = 0;
                continue;
            }
            row += texel;
            texel = static_cast<float>(budget.power_w * std::max(0.0, double(texel)) * std::sqrt(cosine_squared) /
                                       (texel_u * texel_v));
        }
        budget.inside_image += row;
    }
    result.texels = std::move(texel_shares);
}

} // namespace clsp

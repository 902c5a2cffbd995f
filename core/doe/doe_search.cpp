#include "doe/doe_device.hpp"
#include "runtime/kernel_arguments.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/core.h>
#include <numeric>

namespace clsp {
namespace {

// The wanted powers are the mean of what there is and a little more: the search then raises the efficiency as well.
constexpr double kAmbition = 1.01;
// A sweep ends when so many candidates in a row are no good any more: what was foreseen is out of date then.
constexpr std::size_t kMostRefusals = 500;

// The orders' amplitudes with the pixel's envelope in them, kept up while pixels change.
class Amplitudes {
  public:
    Amplitudes(DoeDevice &device, const DoeDesignParameters &p) : device_(device), p_(p) {
        const std::size_t count = p.orders.size();
        for (auto *values : {&re_, &im_, &envelope_, &weight_, &wanted_, &step_re_, &step_im_})
            values->assign(count, 0.0);
        const auto table = [](std::vector<std::complex<double>> &phasors, std::uint32_t side) {
            for (std::uint32_t i = 0; i < side; ++i)
                phasors.push_back(std::conj(doe_level_phasor(i, side)));
        };
        table(phasors_x_, p.width);
        table(phasors_y_, p.height);
        for (std::size_t k = 0; k < count; ++k) {
            const DoeOrder &order = p.orders[k];
            bins_.push_back(doe_bin(order, p.width, p.height));
            envelope_[k] = p.compensate_envelope ? doe_envelope(order.m, order.n, p.width, p.height) : 1.0;
            weight_[k] = order.weight;
        }
    }

    // From scratch: amplitudes and wanted powers of these levels.
    void measure(const std::vector<std::uint8_t> &levels) {
        std::vector<cl_float2> field(device_.pixels());
        for (std::size_t i = 0; i < field.size(); ++i) {
            const auto t = doe_level_phasor(levels[i], p_.levels);
            field[i] = {{static_cast<cl_float>(t.real()), static_cast<cl_float>(t.imag())}};
        }
        device_.write(device_.field(), field);
        CommandChain chain(device_.queue(), 0, nullptr);
        device_.transform(chain, device_.field(), FftDirection::kForward);
        chain.finish(nullptr);
        device_.read(device_.field(), field);
        double powers = 0.0;
        for (std::size_t k = 0; k < bins_.size(); ++k) {
            const double scale = envelope_[k] / double(device_.pixels());
            re_[k] = double(field[bins_[k]].s[0]) * scale;
            im_[k] = double(field[bins_[k]].s[1]) * scale;
            powers += power(k);
        }
        const double weights = std::accumulate(weight_.begin(), weight_.end(), 0.0);
        for (std::size_t k = 0; k < bins_.size(); ++k)
            wanted_[k] = kAmbition * powers * weight_[k] / weights;
    }

    // The coefficients of doe_design_search: two far fields, and the sum that no pixel has a part in.
    double coefficients(std::vector<cl_float2> &first, std::vector<cl_float2> &second, double step_power) const {
        std::fill(first.begin(), first.end(), cl_float2{{0.0f, 0.0f}});
        second = first;
        double constant = 0.0;
        for (std::size_t k = 0; k < bins_.size(); ++k) {
            const double s = envelope_[k] / double(device_.pixels()), s2 = s * s, wanted = wanted_[k];
            const double a = 4.0 * (power(k) - wanted + step_power * s2) * s / wanted;
            first[bins_[k]] = {{static_cast<cl_float>(a * re_[k]), static_cast<cl_float>(-a * im_[k])}};
            const double b = 2.0 * s2 / wanted;
            const std::uint32_t x = 2 * (bins_[k] % p_.width) % p_.width, y = 2 * (bins_[k] / p_.width) % p_.height;
            cl_float2 &twice = second[std::size_t{y} * p_.width + x];
            twice.s[0] += static_cast<cl_float>(b * (re_[k] * re_[k] - im_[k] * im_[k]));
            twice.s[1] += static_cast<cl_float>(-2.0 * b * re_[k] * im_[k]);
            constant +=
                (step_power * s2 * (4.0 * power(k) - 2.0 * wanted) + step_power * step_power * s2 * s2) / wanted;
        }
        return constant;
    }

    // Makes the change of pixel (x, y) if the cost falls.
    bool try_change(std::uint32_t x, std::uint32_t y, std::complex<double> change) {
        const std::size_t count = bins_.size();
        const double scale = 1.0 / double(device_.pixels());
        for (std::size_t k = 0; k < count; ++k) {
            const std::uint32_t bin_x = bins_[k] % p_.width, bin_y = bins_[k] / p_.width;
            const std::complex<double> &ex = phasors_x_[std::uint64_t{bin_x} * x % p_.width],
                                       &ey = phasors_y_[std::uint64_t{bin_y} * y % p_.height];
            const double e_re = ex.real() * ey.real() - ex.imag() * ey.imag(),
                         e_im = ex.real() * ey.imag() + ex.imag() * ey.real(), s = envelope_[k] * scale;
            step_re_[k] = s * (change.real() * e_re - change.imag() * e_im);
            step_im_[k] = s * (change.real() * e_im + change.imag() * e_re);
        }
        double difference = 0.0;
        for (std::size_t k = 0; k < count; ++k) {
            const double d = step_re_[k] * (2.0 * re_[k] + step_re_[k]) + step_im_[k] * (2.0 * im_[k] + step_im_[k]);
            difference += d * (2.0 * (power(k) - wanted_[k]) + d) / wanted_[k];
        }
        if (!(difference < 0.0))
            return false;
        for (std::size_t k = 0; k < count; ++k) {
            re_[k] += step_re_[k];
            im_[k] += step_im_[k];
        }
        return true;
    }

  private:
    double power(std::size_t k) const { return re_[k] * re_[k] + im_[k] * im_[k]; }

    DoeDevice &device_;
    const DoeDesignParameters &p_;
    std::vector<std::uint32_t> bins_;
    std::vector<double> re_, im_, envelope_, weight_, wanted_, step_re_, step_im_;
    std::vector<std::complex<double>> phasors_x_, phasors_y_;
};

} // namespace

DoeSearchResult search_doe(DoeDevice &device, const DoeDesignParameters &p, std::vector<std::uint8_t> &levels) {
    const auto &context = device.shared_context();
    const std::size_t pixels = device.pixels();
    Amplitudes amplitudes(device, p);
    const DeviceBuffer second(context, pixels * sizeof(cl_float2)), change(context, pixels * sizeof(cl_float));
    const DeviceBuffer level_buffer(context, pixels), best_buffer(context, pixels);
    cl::Kernel search = context->kernel("doe/doe_design.cl", "doe_design_search");
    const double step_power = std::norm(doe_level_phasor(1, p.levels) - 1.0);
    std::vector<cl_float2> first_field(pixels), second_field(pixels);
    std::vector<cl_float> gains(pixels);
    std::vector<std::uint8_t> best(pixels);
    DoeSearchResult result;
    for (std::uint32_t sweep = 0; sweep < p.search_sweeps; ++sweep) {
        const auto tell = [&](double part) {
            report_progress(p.progress, fmt::format("search, sweep {} of at most {}", sweep + 1, p.search_sweeps),
                            0.5 + 0.48 * (sweep + part) / p.search_sweeps);
        };
        tell(0.0);
        amplitudes.measure(levels);
        const double constant = amplitudes.coefficients(first_field, second_field, step_power);
        device.write(device.field(), first_field);
        device.write(second.get(), second_field);
        device.write(level_buffer.get(), levels);
        KernelArguments(search)
            .add(level_buffer.get())
            .add(device.field())
            .add(second.get())
            .add(static_cast<cl_uint>(pixels))
            .add(cl_uint{p.levels})
            .add(static_cast<cl_float>(constant))
            .add(best_buffer.get())
            .add(change.get());
        CommandChain chain(device.queue(), 0, nullptr);
        device.transform(chain, device.field(), FftDirection::kForward);
        device.transform(chain, second.get(), FftDirection::kForward);
        chain.run("doe_search", search, pixels);
        chain.finish(nullptr);
        device.read(change.get(), gains);
        device.read(best_buffer.get(), best);

        std::vector<std::uint32_t> candidates;
        for (std::size_t i = 0; i < pixels; ++i)
            if (gains[i] < 0.0f)
                candidates.push_back(static_cast<std::uint32_t>(i));
        std::sort(candidates.begin(), candidates.end(), [&](std::uint32_t a, std::uint32_t b) {
            return gains[a] < gains[b] || (gains[a] == gains[b] && a < b);
        });
        // The amplitudes of the orders move with every change: each is tried once more before it is made.
        std::uint64_t changes = 0;
        std::size_t refusals = 0;
        for (std::size_t c = 0; c < candidates.size() && refusals < kMostRefusals; ++c) {
            if (c % 256 == 0)
                tell(double(c) / double(candidates.size()));
            const std::uint32_t i = candidates[c];
            const auto step = doe_level_phasor(best[i], p.levels) - doe_level_phasor(levels[i], p.levels);
            if (amplitudes.try_change(i % p.width, i / p.width, step)) {
                levels[i] = best[i];
                ++changes;
                refusals = 0;
            } else {
                ++refusals;
            }
        }
        result.changes += changes;
        result.sweeps = sweep + 1;
        if (changes == 0)
            break;
    }
    return result;
}

} // namespace clsp

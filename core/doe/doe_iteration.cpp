#include "doe/doe_device.hpp"
#include "runtime/kernel_arguments.hpp"
#include "stages/philox.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/core.h>
#include <unordered_map>

namespace clsp {
namespace {

constexpr std::size_t kPartials = 128;

// Where the soft binary projection starts: gain of the field's standard deviation. It grows as 1 / (1 - t).
constexpr double kFirstGain = 0.6;
// Part of the quantization after which every pixel is on a level.
constexpr double kSoftPart = 0.8;

double default_feedback(DoeRule rule) {
    return rule == DoeRule::kAdaptive ? 0.7 : 1.0;
}

// With few orders the projection to a phase amplifies what the weights do, and full feedback swings between two states:
// the orders' deviations then have the opposite sign of those before. Where they do, it is lowered.
class Feedback {
  public:
    explicit Feedback(double value) : value_(value) {}
    double value() const { return value_; }
    // mean, deviation: of the amplitudes over the wanted ones; product: mean product with those before.
    void observe(double mean, double deviation, double product) {
        constexpr double kLarge = 0.005, kOpposite = -0.3, kLowered = 0.7;
        const double covariance = product - mean * mean_;
        if (deviation > kLarge * mean && covariance < kOpposite * deviation * deviation_)
            value_ *= kLowered;
        mean_ = mean;
        deviation_ = deviation;
    }

  private:
    double value_, mean_ = 0.0, deviation_ = 0.0;
};

// Random phases of the orders; of mirrored orders opposite ones where the transmission is real.
std::vector<cl_float2> first_phasors(const DoeDesignParameters &p) {
    std::unordered_map<std::uint32_t, std::size_t> index;
    for (std::size_t k = 0; k < p.orders.size(); ++k)
        index.emplace(doe_bin(p.orders[k], p.width, p.height), k);
    std::vector<cl_float2> phasors(p.orders.size());
    for (std::size_t k = 0; k < p.orders.size(); ++k) {
        const auto block = host_block(p.seed, {static_cast<std::uint32_t>(k), 0, 0, kStreamDoePhase});
        double angle = 2.0 * M_PI * block[0] * 0x1p-32;
        if (p.levels == 2) {
            const DoeOrder &order = p.orders[k];
            const std::size_t twin = index.at(doe_bin({-order.m, -order.n, 1.0}, p.width, p.height));
            if (twin == k)
                angle = 0.0;
            else if (twin < k) {
                phasors[k] = {{phasors[twin].s[0], -phasors[twin].s[1]}};
                continue;
            }
        }
        phasors[k] = {{static_cast<cl_float>(std::cos(angle)), static_cast<cl_float>(std::sin(angle))}};
    }
    return phasors;
}

} // namespace

std::vector<DoeDesignStep> iterate_doe(DoeDevice &device, const DoeDesignParameters &p) {
    const auto &context = device.shared_context();
    const std::size_t count = p.orders.size();
    std::vector<cl_uint> bins(count);
    std::vector<cl_float> wanted(count), envelope_power(count);
    double weight_sum = 0.0;
    for (const DoeOrder &order : p.orders)
        weight_sum += order.weight;
    for (std::size_t k = 0; k < count; ++k) {
        const DoeOrder &order = p.orders[k];
        bins[k] = doe_bin(order, p.width, p.height);
        const double amplitude = std::sqrt(order.weight / weight_sum * double(count));
        const double s = doe_envelope(order.m, order.n, p.width, p.height);
        envelope_power[k] = static_cast<cl_float>(s * s);
        wanted[k] = static_cast<cl_float>(p.compensate_envelope ? amplitude / s : amplitude);
    }
    const DeviceBuffer bin_buffer(context, count * sizeof(cl_uint), bins.data());
    const DeviceBuffer wanted_buffer(context, count * sizeof(cl_float), wanted.data());
    const DeviceBuffer envelope_buffer(context, count * sizeof(cl_float), envelope_power.data());
    const DeviceBuffer phasors(context, count * sizeof(cl_float2), first_phasors(p).data());
    const DeviceBuffer weights(context, count * sizeof(cl_float), std::vector<cl_float>(count, 1.0f).data());
    const DeviceBuffer relative(context, count * sizeof(cl_float), std::vector<cl_float>(count, 0.0f).data());
    const std::size_t items = std::min(kPartials, count);
    const DeviceBuffer partial(context, items * sizeof(cl_float4)), power(context, items * sizeof(cl_float4));
    const DeviceBuffer turned(context, items * sizeof(cl_float));

    const auto kernel = [&](const char *name) { return context->kernel("doe/doe_design.cl", name); };
    cl::Kernel clear = kernel("doe_design_clear"), sum = kernel("doe_design_sum"),
               scatter = kernel("doe_design_scatter"), project = kernel("doe_design_project"),
               measure = kernel("doe_design_measure"), weigh = kernel("doe_design_weigh");
    const auto pixels = static_cast<cl_uint>(device.pixels());
    const auto orders = static_cast<cl_uint>(count), partials = static_cast<cl_uint>(items);
    KernelArguments(clear).add(device.field()).add(pixels);
    KernelArguments(sum).add(weights.get()).add(wanted_buffer.get()).add(orders).add(power.get());
    KernelArguments(scatter)
        .add(weights.get())
        .add(wanted_buffer.get())
        .add(phasors.get())
        .add(bin_buffer.get())
        .add(power.get())
        .add(partials)
        .add(orders)
        .add(static_cast<cl_float>(device.pixels()))
        .add(device.field());
    Feedback feedback(p.feedback > 0.0 ? p.feedback : default_feedback(p.rule));

    const std::uint32_t quantizing = p.levels == 0 ? 0 : p.quantization_iterations;
    const std::uint32_t total = p.iterations + quantizing;
    std::vector<DoeDesignStep> history;
    history.reserve(total);
    std::vector<cl_float4> sums(items);
    std::vector<cl_float> products(items);
    const double share = p.search_sweeps > 0 ? 0.5 : 0.98; // of the progress bar
    for (std::uint32_t i = 0; i < total; ++i) {
        report_progress(p.progress, fmt::format("iteration {} of {}", i + 1, total), share * i / total);
        // Binary: the gain grows through the free iterations. Else: the soft part of the quantization.
        double fraction = 0.0, gain = 0.0;
        if (i >= p.iterations)
            fraction = p.levels == 2 ? 1.0 : std::min(1.0, (i - p.iterations + 1) / (kSoftPart * quantizing));
        else if (p.levels == 2)
            gain = kFirstGain * p.iterations / double(p.iterations - i);
        KernelArguments(project)
            .add(device.field())
            .add(pixels)
            .add(cl_uint{p.levels})
            .add(static_cast<cl_float>(fraction >= 1.0 - 1e-9 ? 1.0 : fraction))
            .add(static_cast<cl_float>(gain));
        const bool keep_phase = p.rule == DoeRule::kPhaseFixed && i >= p.fix_phase_iteration && i < p.iterations;
        KernelArguments(measure)
            .add(device.field())
            .add(bin_buffer.get())
            .add(wanted_buffer.get())
            .add(orders)
            .add(envelope_buffer.get())
            .add(static_cast<cl_float>(1.0 / double(device.pixels())))
            .add(cl_uint{keep_phase})
            .add(phasors.get())
            .add(relative.get())
            .add(partial.get())
            .add(turned.get());
        KernelArguments(weigh)
            .add(relative.get())
            .add(partial.get())
            .add(partials)
            .add(orders)
            .add(static_cast<cl_uint>(p.rule))
            .add(static_cast<cl_float>(feedback.value()))
            .add(weights.get());

        CommandChain chain(device.queue(), 0, nullptr);
        if (i > 0)
            chain.run("doe_weigh", weigh, count);
        chain.run("doe_sum", sum, items);
        chain.run("doe_clear", clear, device.pixels());
        chain.run("doe_scatter", scatter, count);
        device.transform(chain, device.field(), FftDirection::kInverse);
        chain.run("doe_project", project, device.pixels());
        if (i + 1 == total) { // the element itself stays in the field
            chain.finish(nullptr);
            break;
        }
        device.transform(chain, device.field(), FftDirection::kForward);
        chain.run("doe_measure", measure, items);
        chain.finish(nullptr);
        device.read(partial.get(), sums);
        device.read(turned.get(), products);
        double ratio = 0.0, ratio2 = 0.0, ratio4 = 0.0, powers = 0.0, product = 0.0;
        for (std::size_t item = 0; item < items; ++item) {
            ratio += double(sums[item].s[0]);
            ratio2 += double(sums[item].s[1]);
            ratio4 += double(sums[item].s[2]);
            powers += double(sums[item].s[3]);
            product += double(products[item]);
        }
        const double n = double(count), mean = ratio / n, mean2 = ratio2 / n;
        history.push_back({powers, mean2 > 0.0 ? std::sqrt(std::max(ratio4 / n - mean2 * mean2, 0.0)) / mean2 : 0.0});
        feedback.observe(mean, std::sqrt(std::max(mean2 - mean * mean, 0.0)), product / n);
    }
    check_opencl(clFinish(device.queue()), "clFinish");
    return history;
}

} // namespace clsp

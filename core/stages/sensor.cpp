#include "stages/sensor.hpp"

#include "runtime/checks.hpp"
#include "runtime/error.hpp"
#include "fft/cpu/lanes.hpp"
#include "stages/philox.hpp"
#include "stages/sensor_camera.hpp"
#include "stages/sensor_response.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/core.h>
#include <numeric>
#include <vector>

namespace clsp {
namespace {

double top_code_of(const SensorParameters &p) {
    return double((1u << p.bits) - 1u);
}

// Distance of neighbouring codes.
double code_step_of(const SensorParameters &p) {
    return p.effective_bits == 0 ? 1.0 : double(1u << (p.bits - p.effective_bits));
}

double check_range(double value, double low, double high, const char *name) {
    if (!(value >= low && value <= high))
        throw Error(Status::kInvalidArgument, fmt::format("{} is {}, it must be {} to {}", name, value, low, high));
    return value;
}

void check_temperature(double value, const char *name) {
    constexpr double kAbsoluteZero = -273.15, kHottest = 500.0;
    if (!(value >= kAbsoluteZero && value <= kHottest))
        throw Error(Status::kInvalidArgument, fmt::format("{} is {}, it must be {} to {} (degrees Celsius)", name,
                                                          value, kAbsoluteZero, kHottest));
}

void check_electrons(const SensorParameters &p) {
    check_not_negative(p.conversion_gain_dn_per_e, "conversion_gain_dn_per_e");
    constexpr double kSmallest = 1e-9; // its inverse stays far within single precision
    if (p.conversion_gain_dn_per_e > 0.0 && p.conversion_gain_dn_per_e < kSmallest)
        throw Error(Status::kInvalidArgument,
                    fmt::format("conversion_gain_dn_per_e is {}, it must be 0 (no electrons) or at least {}",
                                p.conversion_gain_dn_per_e, kSmallest));
    if (p.shot_noise && p.conversion_gain_dn_per_e == 0.0)
        throw Error(Status::kInvalidArgument,
                    "shot_noise needs to know what an electron is: set conversion_gain_dn_per_e, which is 0");
    check_not_negative(p.dark_current_e_per_s, "dark_current_e_per_s");
    check_temperature(p.dark_current_reference_temperature_c, "dark_current_reference_temperature_c");
    check_positive(p.dark_current_doubling_k, "dark_current_doubling_k");
    check_temperature(p.temperature_c, "temperature_c");
    check_not_negative(p.exposure_time_s, "exposure_time_s");
    if (p.dark_current_e_per_s > 0.0 && p.conversion_gain_dn_per_e == 0.0)
        throw Error(Status::kInvalidArgument,
                    "dark_current_e_per_s needs to know what an electron is: set conversion_gain_dn_per_e, which is 0");
    const double dark = dark_signal_dn(p);
    if (!(dark <= kLargestNumber))
        throw Error(Status::kInvalidArgument,
                    fmt::format("dark_current_e_per_s, temperature_c and exposure_time_s give a dark signal of {} DN; "
                                "lower one of them",
                                dark));
    if (dark >= p.saturation_dn)
        throw Error(Status::kInvalidArgument,
                    fmt::format("the dark current alone gives {} DN and fills the well of saturation_dn = {}; lower "
                                "dark_current_e_per_s, temperature_c or exposure_time_s",
                                dark, p.saturation_dn));
}

void check_parameters(const SensorParameters &p) {
    check_image_size(p.width, p.height, "the sensor");
    if (p.bits < 8 || p.bits > 16)
        throw Error(Status::kInvalidArgument, fmt::format("bits is {}, it must be 8 to 16", p.bits));
    if (p.effective_bits > p.bits)
        throw Error(Status::kInvalidArgument,
                    fmt::format("effective_bits is {}, it must be 1 to bits = {}, or 0 for as many as bits",
                                p.effective_bits, p.bits));
    check_not_negative(p.exposure_gain_dn, "exposure_gain_dn");
    if (!(p.saturation_dn > 0.0))
        throw Error(
            Status::kInvalidArgument,
            fmt::format("saturation_dn is {}, it must be above 0 (infinity for a sensor that only the ADC clips)",
                        p.saturation_dn));
    if (!(std::abs(p.black_level_dn) <= kLargestNumber))
        throw Error(Status::kInvalidArgument, fmt::format("black_level_dn is {}, it must be finite and at most {}",
                                                          p.black_level_dn, kLargestNumber));
    if (p.black_level_dn >= top_code_of(p))
        throw Error(Status::kInvalidArgument,
                    fmt::format("black_level_dn is {}, but the top code of {} bits is {}: every pixel would be white",
                                p.black_level_dn, p.bits, top_code_of(p)));
    check_not_negative(p.read_noise_dn, "read_noise_dn");
    check_fraction(p.hot_pixel_fraction, "hot_pixel_fraction");
    check_not_negative(p.hot_pixel_mean_dn, "hot_pixel_mean_dn");
    check_fraction(p.cold_pixel_fraction, "cold_pixel_fraction");
    check_positive(p.float_full_scale, "float_full_scale");
    check_fraction(p.crosstalk_fraction, "crosstalk_fraction");
    check_fraction(p.prnu, "prnu");
    check_fraction(p.column_prnu, "column_prnu");
    check_fraction(p.row_prnu, "row_prnu");
    for (std::size_t i = 0; i < p.mosaic_gain.size(); ++i)
        check_not_negative(p.mosaic_gain[i], fmt::format("mosaic_gain[{}]", i).c_str());
    if (std::all_of(p.mosaic_gain.begin(), p.mosaic_gain.end(), [](double gain) { return gain == 0.0; }))
        throw Error(Status::kInvalidArgument,
                    "mosaic_gain is 0 at all four sites: no pixel would see light; 1, 1, 1, 1 is no mosaic");
    check_electrons(p);
    if (!(p.lag_fraction >= 0.0 && p.lag_fraction < 1.0))
        throw Error(Status::kInvalidArgument,
                    fmt::format("lag_fraction is {}, it must be at least 0 and below 1", p.lag_fraction));
    check_range(p.gamma, 0.1, 10.0, "gamma");
    check_not_negative(p.dsnu_dn, "dsnu_dn");
    check_not_negative(p.column_offset_dn, "column_offset_dn");
    check_not_negative(p.row_noise_dn, "row_noise_dn");
    check_not_negative(p.column_noise_dn, "column_noise_dn");
    check_range(p.read_noise_spread, 0.0, 2.0, "read_noise_spread");
    check_not_negative(p.row_offset_dn, "row_offset_dn");
    check_fraction(p.dull_pixel_fraction, "dull_pixel_fraction");
    check_range(p.cubic_nonlinearity, -1.0, 0.25, "cubic_nonlinearity");
    if (p.nonlinearity_power < 1 || p.nonlinearity_power > 3)
        throw Error(Status::kInvalidArgument,
                    fmt::format("nonlinearity_power is {}, it must be 1, 2 or 3", p.nonlinearity_power));
    check_range(p.read_noise_correlation, -0.5, 0.5, "read_noise_correlation");
    check_not_negative(p.periodic_offset_dn, "periodic_offset_dn");
    check_range(p.periodic_frequency_x, -0.5, 0.5, "periodic_frequency_x");
    check_range(p.periodic_frequency_y, -0.5, 0.5, "periodic_frequency_y");
    check_fraction(p.telegraph_fraction, "telegraph_fraction");
    check_not_negative(p.telegraph_step_dn, "telegraph_step_dn");
    // Within these the kernel finds every code; wider waves are missing codes.
    check_range(p.code_width_wave, 0.0, 0.5, "code_width_wave");
    check_range(p.code_width_period, 2.0, 16.0, "code_width_period");
    check_range(p.widest_code, 0.0, 65536.0, "widest_code");
}

bool has_mosaic(const SensorParameters &p) {
    return p.mosaic_gain != SensorParameters().mosaic_gain;
}
bool draws_offset(const SensorParameters &p) {
    return p.hot_pixel_fraction > 0.0 || p.dsnu_dn > 0.0 || p.column_offset_dn > 0.0 || p.row_offset_dn > 0.0 ||
           p.periodic_offset_dn > 0.0;
}
bool has_offset(const SensorParameters &p) {
    return p.dark_frame_dn || draws_offset(p);
}
bool has_pixel_gain(const SensorParameters &p) {
    return p.gain_map || p.prnu > 0.0 || p.column_prnu > 0.0 || p.row_prnu > 0.0 || p.dull_pixel_fraction > 0.0;
}
// Cold pixels alone take a byte each; with a map of gains they are zeros of its map.
bool has_response(const SensorParameters &p) {
    return p.cold_pixel_fraction > 0.0 && !has_pixel_gain(p);
}
bool has_read_noise_map(const SensorParameters &p) {
    return p.read_noise_dn > 0.0 && p.read_noise_spread > 0.0;
}
bool has_correlated_noise(const SensorParameters &p) {
    return p.read_noise_dn > 0.0 && p.read_noise_correlation != 0.0;
}
bool has_telegraph_noise(const SensorParameters &p) {
    return p.telegraph_fraction > 0.0 && p.telegraph_step_dn > 0.0;
}

bool has_code_widths(const SensorParameters &p, Format output) {
    return p.code_width_wave > 0.0 && (p.quantize || output != Format::kFloat32);
}

// As kernels/stages/sensor.cl has them: maps of the host that a fixed pattern is drawn upon.
constexpr cl_uint kDarkFrameGiven = 1, kGainMapGiven = 2;

// Cycles as 2^-32 turns.
cl_uint turns_of(double cycles) {
    return static_cast<cl_uint>(static_cast<std::int64_t>(std::llround(cycles * 4294967296.0)));
}

// Gains that brighten or darken the whole image would hide in a map what is the exposure's.
void check_gain_map(const std::vector<float> &gains) {
    constexpr double kLeast = 0.9, kMost = 1.1;
    const double mean = std::accumulate(gains.begin(), gains.end(), 0.0) / double(gains.size());
    if (!(mean >= kLeast && mean <= kMost))
        throw Error(Status::kInvalidData,
                    fmt::format("gain_map has a mean of {:.6g}, it must be {} to {}: its gains are relative to the "
                                "image's mean; divide it by its mean, and multiply exposure_gain_dn by that",
                                mean, kLeast, kMost));
}

} // namespace

std::array<double, 4> mosaic_gain_of(Bayer bayer, double red, double green, double blue) {
    check_not_negative(red, "red");
    check_not_negative(green, "green");
    check_not_negative(blue, "blue");
    switch (bayer) {
    case Bayer::kRggb:
        return {{red, green, green, blue}};
    case Bayer::kBggr:
        return {{blue, green, green, red}};
    case Bayer::kGrbg:
        return {{green, red, blue, green}};
    default:
        return {{green, blue, red, green}};
    }
}

Sensor::Sensor(std::shared_ptr<Context> context, const SensorParameters &p)
    : context_(std::move(context)), parameters_(p) {
    check_parameters(p);
    if (p.dark_frame_dn)
        dark_frame_ = copy_host_image(
            {p.dark_frame_dn, p.width, p.height, p.dark_frame_pitch_bytes, "dark_frame_dn", "dark_frame_pitch_bytes"},
            [](float value) { return std::isfinite(value); }, "it must be finite");
    parameters_.dark_frame_dn = p.dark_frame_dn ? dark_frame_.data() : nullptr;
    parameters_.dark_frame_pitch_bytes = 0;
    if (p.gain_map) {
        gain_map_ =
            copy_host_image({p.gain_map, p.width, p.height, p.gain_map_pitch_bytes, "gain_map", "gain_map_pitch_bytes"},
                            [](float value) { return std::isfinite(value) && value >= 0.0f; },
                            "it must be finite and at least 0");
        check_gain_map(gain_map_);
    }
    parameters_.gain_map = p.gain_map ? gain_map_.data() : nullptr;
    parameters_.gain_map_pitch_bytes = 0;
    make_fixed_pattern();
    if (p.lag_fraction > 0.0)
        lag_state_ = DeviceBuffer(context_, std::size_t{p.width} * p.height * 2 * sizeof(float));
    in_lanes_ = clsp::works_in_lanes(*context_);
    make_switches();
}

void Sensor::make_fixed_pattern() {
    const SensorParameters &p = parameters_;
    const std::size_t pixels = std::size_t{p.width} * p.height;
    if (has_offset(p))
        offset_ = DeviceBuffer(context_, pixels * sizeof(float), p.dark_frame_dn ? dark_frame_.data() : nullptr);
    if (has_response(p))
        response_ = DeviceBuffer(context_, pixels);
    if (has_pixel_gain(p))
        pixel_gain_ = DeviceBuffer(context_, pixels * sizeof(float), p.gain_map ? gain_map_.data() : nullptr);
    if (has_read_noise_map(p))
        read_noise_map_ = DeviceBuffer(context_, pixels * sizeof(float));
    if (!draws_offset(p) && !response_ && !pixel_gain_ && !read_noise_map_)
        return; // nothing to draw
    const std::uint32_t quarter = quarter_rows(p.height);
    constexpr double kDullest = 0.7; // gains of dull pixels are uniform from there to 1
    const double dull_slope = p.dull_pixel_fraction > 0.0 ? (kDullest - 1.0) / p.dull_pixel_fraction : 0.0;
    cl::Kernel kernel = context_->kernel("stages/sensor.cl", "sensor_fixed_pattern", "-DFIXED_PATTERN=1");
    KernelArguments(kernel)
        .add(offset_.get())
        .add(response_.get())
        .add(pixel_gain_.get())
        .add(read_noise_map_.get())
        .add(cl_uint{(p.dark_frame_dn ? kDarkFrameGiven : 0u) | (p.gain_map ? kGainMapGiven : 0u)})
        .add(cl_uint{p.width})
        .add(cl_uint{p.height})
        .add(cl_uint{quarter})
        .add(philox_key(p.seed))
        .add(static_cast<cl_float>(p.hot_pixel_fraction))
        .add(static_cast<cl_float>(p.hot_pixel_mean_dn))
        .add(static_cast<cl_float>(p.cold_pixel_fraction))
        .add(static_cast<cl_float>(p.prnu))
        .add(static_cast<cl_float>(p.column_prnu))
        .add(static_cast<cl_float>(p.row_prnu))
        .add(static_cast<cl_float>(p.dull_pixel_fraction))
        .add(static_cast<cl_float>(dull_slope))
        .add(static_cast<cl_float>(p.dsnu_dn))
        .add(static_cast<cl_float>(p.column_offset_dn))
        .add(static_cast<cl_float>(p.row_offset_dn))
        .add(static_cast<cl_float>(p.periodic_offset_dn))
        .add(turns_of(p.periodic_frequency_x))
        .add(turns_of(p.periodic_frequency_y))
        .add(static_cast<cl_float>(p.read_noise_dn))
        .add(static_cast<cl_float>(p.read_noise_spread));
    cl::CommandQueue queue(context_->cl_context(), context_->device());
    CommandChain chain(queue(), 0, nullptr);
    chain.run("sensor", kernel, p.width, quarter);
    queue.finish();
}

void Sensor::configure(const SensorParameters &p) {
    if (p.width != parameters_.width || p.height != parameters_.height)
        throw Error(Status::kInvalidArgument,
                    fmt::format("the sensor has {} x {} pixels (width x height), the new parameters {} x {}; make a "
                                "new sensor for another size",
                                parameters_.width, parameters_.height, p.width, p.height));
    Sensor next(context_, p);
    for (const auto &[format, kernel] : kernels_)
        next.kernel_for(format); // so that no frame has to
    next.demosaic_kernels_ = std::move(demosaic_kernels_);
    *this = std::move(next);
}

void Sensor::set_exposure_gain(double exposure_gain_dn) {
    check_not_negative(exposure_gain_dn, "exposure_gain_dn");
    parameters_.exposure_gain_dn = exposure_gain_dn;
}

cl::Kernel &Sensor::kernel_for(Format output) {
    const auto found = kernels_.find(output);
    if (found != kernels_.end())
        return found->second;
    const cl::Kernel kernel =
        in_lanes_ ? context_->kernel("stages/sensor_lanes.cl", "sensor_expose_lanes",
                                     fmt::format("-DOUTPUT_FORMAT={} -DLANES={}", static_cast<std::uint32_t>(output),
                                                 simd_lanes(*context_)))
                  : context_->kernel("stages/sensor.cl", "sensor_expose",
                                     fmt::format("{} -DCROSSTALK={}", pixel_options(output),
                                                 parameters_.crosstalk_fraction > 0.0 ? 1 : 0));
    return kernels_.emplace(output, kernel).first->second;
}

std::string Sensor::pixel_options(Format output) const {
    return fmt::format("-DOUTPUT_FORMAT={} -DQUANTIZE={} -DCODE_WIDTHS={}{}", static_cast<std::uint32_t>(output),
                       parameters_.quantize || output != Format::kFloat32 ? 1 : 0,
                       has_code_widths(parameters_, output) ? 1 : 0, switches_);
}

void Sensor::make_switches() {
    const SensorParameters &p = parameters_;
    const auto define = [&](const char *name, bool on) { switches_ += fmt::format(" -D{}={}", name, on ? 1 : 0); };
    define("READ_NOISE", p.read_noise_dn > 0.0);
    define("COLD", bool(response_));
    define("OFFSET", bool(offset_));
    define("CODE_STEP", code_step_of(p) != 1.0);
    define("MOSAIC", has_mosaic(p));
    define("PRNU", bool(pixel_gain_));
    define("DARK_CURRENT", dark_signal_dn(p) > 0.0);
    define("SHOT_NOISE", p.shot_noise);
    define("LAG", bool(lag_state_));
    define("CUBIC", p.cubic_nonlinearity != 0.0);
    define("GAMMA", p.gamma != 1.0);
    define("ROW_NOISE", p.row_noise_dn > 0.0);
    define("COLUMN_NOISE", p.column_noise_dn > 0.0);
    define("TELEGRAPH", has_telegraph_noise(p));
    define("READ_NOISE_SPREAD", bool(read_noise_map_));
    define("READ_NOISE_CORRELATED", has_correlated_noise(p));
}

ImageView Sensor::check_output(const ImageDescription &output, bool in_last_pass) {
    const ImageView view =
        check_image(output, "output", context_->cl_context()(), {parameters_.width, parameters_.height},
                    {Format::kUint16, Format::kUint8, Format::kFloat32});
    if (view.format == Format::kUint8 && parameters_.bits > 8)
        throw Error(
            Status::kInvalidFormat,
            fmt::format("output.format is uint8, but the sensor has {} bits; use uint16", parameters_.bits));
    check_writable(view, "output");
    if (!in_last_pass)
        kernel_for(view.format); // built now if it must be, not after the first commands of a frame
    return view;
}

void Sensor::enqueue_expose(CommandChain &chain, const ImageView &intensity, std::uint64_t frame_index,
                            const ImageView &output) {
    check_frame_index(frame_index);
    if (overlap(intensity, output)) {
        if (!same_pixels(intensity, output))
            throw Error(Status::kOverlap,
                        "intensity and output overlap; only a FLOAT32 output may be the intensity image itself");
        if (parameters_.crosstalk_fraction > 0.0)
            throw Error(Status::kOverlap, "output is the intensity image itself; with crosstalk_fraction above 0 each "
                                          "pixel also reads its neighbours: give an output of its own");
    }
    const SensorParameters &p = parameters_;
    cl::Kernel &kernel = kernel_for(output.format);
    const std::uint32_t quarter = quarter_rows(p.height);
    KernelArguments arguments(kernel);
    add_arguments(arguments.add(intensity), frame_index, output);
    if (in_lanes_)
        chain.run("sensor", kernel, (quarter + 1) / 2, 1, 1, 1);
    else
        chain.run("sensor", kernel, p.width, quarter);
}

void Sensor::keep_frame() {
    if (!lags())
        return;
    lag_started_ = true;
    lag_second_ = !lag_second_;
}

// The largest number that occurs.
double Sensor::top_code(Format output) const {
    const double full = top_code_of(parameters_);
    return parameters_.quantize || output != Format::kFloat32 ? full + 1.0 - code_step_of(parameters_) : full;
}

void Sensor::add_arguments(KernelArguments &arguments, std::uint64_t frame_index, const ImageView &output) const {
    const SensorParameters &p = parameters_;
    const auto real = [](double value) { return static_cast<cl_float>(value); };
    const auto on = [](bool is_on, SensorSwitch which) { return is_on ? cl_uint{which} : 0u; };
    const double full = top_code_of(p), step = code_step_of(p);
    SensorConstants c;
    c.switches = on(p.read_noise_dn > 0.0, kSensorReadNoise) | on(p.shot_noise, kSensorShotNoise) |
                 on(p.row_noise_dn > 0.0, kSensorRowNoise) | on(p.column_noise_dn > 0.0, kSensorColumnNoise) |
                 on(has_mosaic(p), kSensorMosaic) | on(p.gamma != 1.0, kSensorGamma) |
                 on(!lag_started_, kSensorLagFirst) | on(lag_second_, kSensorLagSecond) |
                 on(p.quantize || output.format != Format::kFloat32, kSensorQuantize) |
                 on(p.crosstalk_fraction > 0.0, kSensorCrosstalk) |
                 on(p.cubic_nonlinearity != 0.0, kSensorCubic) | on(has_telegraph_noise(p), kSensorTelegraph) |
                 on(has_code_widths(p, output.format), kSensorCodeWidths) |
                 on(has_correlated_noise(p), kSensorCorrelated);
    c.width = p.width;
    c.height = p.height;
    c.quarter = quarter_rows(p.height);
    c.key_low = philox_key(p.seed).s[0];
    c.key_high = philox_key(p.seed).s[1];
    c.frame_low = frame_low(frame_index);
    c.frame_high = frame_high(frame_index);
    c.gain = real(p.exposure_gain_dn);
    c.crosstalk = real(p.crosstalk_fraction);
    for (int site = 0; site < 4; ++site)
        c.mosaic[site] = real(p.mosaic_gain[site]);
    c.dark_signal = real(dark_signal_dn(p));
    c.dn_per_electron = real(p.conversion_gain_dn_per_e);
    c.electrons_per_dn = real(p.conversion_gain_dn_per_e > 0.0 ? 1.0 / p.conversion_gain_dn_per_e : 0.0);
    c.saturation = real(p.saturation_dn);
    c.lag = real(p.lag_fraction);
    c.gamma = real(p.gamma);
    c.gamma_full = real(full);
    c.gamma_scale = real(1.0 / full);
    c.black_level = real(p.black_level_dn);
    c.read_noise = real(p.read_noise_dn);
    c.row_noise = real(p.row_noise_dn);
    c.column_noise = real(p.column_noise_dn);
    c.code_step = real(step);
    c.steps_per_dn = real(1.0 / step);
    c.top_code = real(top_code(output.format));
    c.output_scale = real(p.float_full_scale / full);
    c.cubic = real(p.cubic_nonlinearity);
    c.telegraph_fraction = real(p.telegraph_fraction);
    c.telegraph_low = real(p.telegraph_centered ? -0.5 * p.telegraph_step_dn : 0.0);
    c.telegraph_high = real(p.telegraph_centered ? 0.5 * p.telegraph_step_dn : p.telegraph_step_dn);
    // A wave of levels, which rises so much from one end of the widest code to the other.
    constexpr double kPi = 3.14159265358979323846;
    c.code_wave = real(0.5 * p.code_width_wave / std::sin(kPi / p.code_width_period));
    c.code_wave_frequency = real(1.0 / p.code_width_period);
    c.widest_code = real(p.widest_code);
    c.nonlinearity_power = p.nonlinearity_power;
    // n + w n' of independent deviates correlates with its neighbour by w / (1 + w^2).
    const double r = p.read_noise_correlation;
    const double weight = r == 0.0 ? 0.0 : (1.0 - std::sqrt(1.0 - 4.0 * r * r)) / (2.0 * r);
    c.read_noise_own = real(1.0 / std::hypot(1.0, weight));
    c.read_noise_left = real(weight / std::hypot(1.0, weight));
    arguments.add(c)
        .add(offset_.get())
        .add(response_.get())
        .add(pixel_gain_.get())
        .add(read_noise_map_.get())
        .add(lag_state_.get())
        .add(output);
}

void Sensor::enqueue_demosaic(CommandChain &chain, const ImageView &raw, Bayer bayer, const ImageView &rgb) {
    const SensorParameters &p = parameters_;
    const auto found = demosaic_kernels_.find(raw.format);
    cl::Kernel &kernel =
        found != demosaic_kernels_.end()
            ? found->second
            : demosaic_kernels_
                  .emplace(raw.format, context_->kernel("stages/sensor.cl", "sensor_demosaic",
                                                        fmt::format("-DDEMOSAIC=1 -DINPUT_FORMAT={}",
                                                                    static_cast<std::uint32_t>(raw.format))))
                  .first->second;
    const bool red_is_odd_column = bayer == Bayer::kBggr || bayer == Bayer::kGrbg;
    const bool red_is_odd_row = bayer == Bayer::kBggr || bayer == Bayer::kGbrg;
    KernelArguments(kernel)
        .add(raw)
        .add(cl_uint{p.width})
        .add(cl_uint{p.height})
        .add(cl_uint{red_is_odd_column ? 1u : 0u})
        .add(cl_uint{red_is_odd_row ? 1u : 0u})
        .add(rgb);
    chain.run("demosaic", kernel, p.width, p.height);
}

void dark_frame_from_captures(const DarkCaptures &c, float *dark_frame_dn, double *temporal_noise_dn) {
    if (!c.frames)
        throw Error(Status::kInvalidArgument,
                    "frames is NULL; it must point to frame_count frames of height rows of width uint16");
    if (!dark_frame_dn && !temporal_noise_dn)
        throw Error(Status::kInvalidArgument, "dark_frame_dn and temporal_noise_dn are both NULL: nothing to work out");
    check_image_size(c.width, c.height, "a captured frame");
    constexpr std::uint32_t kMostFrames = 65535; // count * sum of squares fits 64 bits
    if (c.count < 1 || c.count > kMostFrames)
        throw Error(Status::kInvalidArgument,
                    fmt::format("frame_count is {}, it must be 1 to {}", c.count, kMostFrames));
    if (temporal_noise_dn && c.count < 2)
        throw Error(Status::kInvalidArgument,
                    "frame_count is 1: the temporal noise shows only between two frames or more; give more frames, or "
                    "NULL for temporal_noise_dn");
    if (!(std::abs(c.black_level_dn) <= kLargestNumber))
        throw Error(Status::kInvalidArgument, fmt::format("black_level_dn is {}, it must be finite and at most {}",
                                                          c.black_level_dn, kLargestNumber));
    const std::uint64_t row_bytes = std::uint64_t{c.width} * sizeof(std::uint16_t);
    const std::uint64_t row_pitch = c.row_pitch_bytes ? c.row_pitch_bytes : row_bytes;
    constexpr std::uint64_t kLargestPitch = std::uint64_t{1} << 40; // far above any frame, far below an overflow
    if (row_pitch < row_bytes || row_pitch % sizeof(std::uint16_t) != 0 || row_pitch > kLargestPitch / c.height)
        throw Error(Status::kInvalidArgument,
                    fmt::format("row_pitch_bytes is {}, it must be a multiple of {}, at least {} (a row), at most {}",
                                row_pitch, sizeof(std::uint16_t), row_bytes, kLargestPitch / c.height));
    const std::uint64_t frame_bytes = row_pitch * (c.height - 1) + row_bytes;
    const std::uint64_t frame_pitch = c.frame_pitch_bytes ? c.frame_pitch_bytes : row_pitch * c.height;
    if (frame_pitch < frame_bytes || frame_pitch % sizeof(std::uint16_t) != 0 || frame_pitch > kLargestPitch)
        throw Error(
            Status::kInvalidArgument,
            fmt::format("frame_pitch_bytes is {}, it must be a multiple of {}, at least {} (a frame), at most {}",
                        frame_pitch, sizeof(std::uint16_t), frame_bytes, kLargestPitch));
    const std::uint64_t n = c.count;
    std::vector<std::uint64_t> sums(c.width), squares(c.width);
    double variance = 0.0; // the sum over the pixels
    for (std::uint32_t y = 0; y < c.height; ++y) {
        std::fill(sums.begin(), sums.end(), std::uint64_t{0});
        std::fill(squares.begin(), squares.end(), std::uint64_t{0});
        for (std::uint64_t frame = 0; frame < n; ++frame) {
            const std::uint16_t *row =
                c.frames + (frame * frame_pitch + std::uint64_t{y} * row_pitch) / sizeof(std::uint16_t);
            for (std::uint32_t x = 0; x < c.width; ++x) {
                sums[x] += row[x];
                squares[x] += std::uint64_t{row[x]} * row[x];
            }
        }
        for (std::uint32_t x = 0; x < c.width; ++x) {
            if (dark_frame_dn)
                dark_frame_dn[std::size_t{y} * c.width + x] =
                    static_cast<float>(double(sums[x]) / double(n) - c.black_level_dn);
            if (temporal_noise_dn)
                variance += double(n * squares[x] - sums[x] * sums[x]) / (double(n) * double(n - 1));
        }
    }
    if (temporal_noise_dn)
        *temporal_noise_dn = std::sqrt(variance / (double(c.width) * double(c.height)));
}

} // namespace clsp

#include "commands.hpp"

#include "context.hpp"
#include "errors.hpp"
#include "exposure_range.hpp"
#include "files.hpp"
#include "interrupt.hpp"
#include "json.hpp"
#include "output.hpp"
#include "plane_checks.hpp"
#include "stage_times.hpp"
#include "text.hpp"

#include <fmt/format.h>

#include <sys/stat.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <future>
#include <limits>
#include <map>
#include <numeric>
#include <optional>
#include <set>
#include <utility>

namespace tools {

namespace {

using clspeckle::Buffer;

constexpr std::uint32_t refresh_none =
    2; // index of the word in the option's table; the C interface has no such constant

constexpr double most_gain = 1e30; // that a sensor takes
/** Part of speckle's pixels at the top code where its mean is at full scale: exp(-1). */
constexpr double most_saturated = 0.36787944117144233;

/** Host planes on the device. */
class DeviceFrame {
  public:
    DeviceFrame(const clspeckle::Context &context, cl_command_queue queue, std::uint32_t width, std::uint32_t height)
        : context_(context), queue_(queue), width_(width), height_(height) {}

    void upload(const FrameData &data) {
        // What was the frame becomes the one before it; its memory is kept and the other one's overwritten.
        for (const auto &[now, before] : {std::pair<ClspImage *, ClspImage *>{&depth, &previous_depth},
                                          {&position, &previous_position},
                                          {&material, &previous_material}})
            *before = *now;
        for (const char *name : {"depth", "position", "material"})
            std::swap(buffers_[name], buffers_[std::string("previous ") + name]);
        material = put("material", data.material, CLSP_FORMAT_UINT8);
        motion = put("motion", data.motion, CLSP_FORMAT_FLOAT32X2);
        irradiance = put("irradiance", data.irradiance.values, CLSP_FORMAT_FLOAT32);
        depth = put("depth", data.depth.values, CLSP_FORMAT_FLOAT32);
        position = put("position", data.position.values, CLSP_FORMAT_FLOAT32X3);
        normal = put("normal", data.normal.values, CLSP_FORMAT_FLOAT32X3);
        albedo = put("albedo", data.albedo.values, CLSP_FORMAT_FLOAT32);
        visibility = put("visibility", data.visibility.values, CLSP_FORMAT_FLOAT32);
        refresh = put("refresh", data.refresh, CLSP_FORMAT_UINT8);
    }

    ClspImage irradiance{}, depth{}, position{}, normal{}, albedo{}, visibility{}, refresh{}, material{}, motion{};
    ClspImage previous_depth{}, previous_position{}, previous_material{};

  private:
    template <typename T> ClspImage put(const char *name, const std::vector<T> &values, std::uint32_t format) {
        if (values.empty())
            return ClspImage{};
        Buffer &buffer = buffers_[name];
        const std::uint64_t size = values.size() * sizeof(T);
        if (buffer.size_bytes() != size)
            buffer = Buffer(context_, size);
        buffer.write(queue_, values);
        return buffer.image(width_, height_, format);
    }

    const clspeckle::Context &context_;
    cl_command_queue queue_;
    std::uint32_t width_;
    std::uint32_t height_;
    std::map<std::string, Buffer> buffers_;
};

/** A plane for one of the stages, with its size checked. */
std::vector<float> read_plane(const std::string &path, image_io::Role role, std::vector<std::string> &warnings,
                              std::uint32_t *width, std::uint32_t *height, std::string *advice = nullptr,
                              image_io::Encoding encoding = image_io::Encoding::as_stored) {
    image_io::ReadRequest request;
    request.role = role;
    const auto reader = image_io::open_one(path, request);
    // Colors may make a picture, which is decoded, but no number.
    const bool picture = encoding != image_io::Encoding::as_stored;
    const auto colors = picture ? image_io::Colors::mean : image_io::Colors::refused;
    image_io::Plane plane = image_io::read_gray(*reader, 0, warnings, colors, encoding);
    // The numbers of a map are what they are.
    const bool scaled = role != image_io::Role::map;
    const std::string scale = scaled ? check_full_scale(plane, path, path, warnings) : "";
    if (advice)
        *advice = scale;
    if (scaled)
        plane.normalize();
    *width = plane.width;
    *height = plane.height;
    return std::move(plane.values);
}

/** Everything that is made once. */
class Renderer {
  public:
    Renderer(Config &config, Input &input, Console &console) : config_(config), input_(input), console_(console) {
        width_ = input.width;
        height_ = input.height;
        const std::string format = config.text("render.format");
        has_sensor_ = config.flag("sensor.enabled");
        float_output_ = FrameFormat(format).is_float();
        if (!has_sensor_ && !float_output_)
            throw InputError(
                fmt::format("--no-sensor gives intensities, which {} cannot hold; choose a --format that begins "
                            "with float-",
                            format));
        if (config.text("pattern.image").empty() && input.scene)
            throw InputError(
                fmt::format("{} is a scene: name the projected pattern with --pattern IMAGE{}", input.first_name,
                            input.image_name.empty()
                                ? ""
                                : fmt::format(", or, if one of its channels is the ideal image, that channel: {}",
                                              input.image_name)));
        if (!config.text("pattern.image").empty() && !input.scene &&
            config.layer("pattern.image") == Layer::command_line)
            throw InputError(
                fmt::format("{} is an ideal image, which takes no --pattern; a scene has the EXR channels Z or P.X, "
                            "P.Y, P.Z, or comes from --depth or --position",
                            input.first_name));
        illumination_ = config.choice("render.illumination");
        if (illumination_ == CLSP_ILLUMINATION_INCOHERENT && input.scene)
            throw InputError(
                fmt::format("{} is a scene: --illumination incoherent needs an ideal image, which says what "
                            "light the lamp brings",
                            input.first_name));
        moves_ = config.text("motion.rule") != "off";
        if (moves_ && !input.moves)
            throw InputError(
                fmt::format("--motion {}: {} does not tell how it moves; a scene with the channels motion.X "
                            "and motion.Y, or a sequence.json, does",
                            config.text("motion.rule"), input.first_name));
        decide_frames();
        warnings_ = input.oddities;
        try {
            first_ = read(0);
        } catch (...) {
            flush_warnings(); // one of them may be the cause
            throw;
        }
        if (input.scene && first_.position.empty() &&
            (config.number("camera.fx_px") <= 0 || config.number("camera.fy_px") <= 0))
            throw InputError(
                fmt::format("{}: depth needs the camera: give --fx, --fy, --cx and --cy in pixels", first_.name));
        check_materials();
        if (config.choice("render.refresh") == CLSP_REFRESH_MASK &&
            config.layer("render.refresh") == Layer::command_line && first_.refresh.empty())
            console.warn("--refresh mask: the input has no refresh mask, so the speckle stays");
    }

    void make_stages() {
        context_.emplace(make_context(config_.text("render.device")));
        queue_ = clspeckle::Queue(*context_, CLSP_QUEUE_PROFILING);
        const std::uint64_t seed = config_.integer("render.seed");
        const auto seed_of = [&](const char *id) { return config_.is_word(id) ? seed : config_.integer(id); };
        const double polarization = config_.number("aperture.degree_of_polarization");

        auto phase = clspeckle::make<ClspPhaseDesc>();
        phase.width = width_;
        phase.height = height_;
        phase.oversampling = static_cast<std::uint32_t>(config_.integer("aperture.oversampling"));
        phase.guard_px = static_cast<std::uint32_t>(config_.integer("aperture.guard_px"));
        phase.field = config_.choice("phase.field");
        phase.polarization_count = polarization < 1 || uses_materials_ ? 2 : 1;
        phase.seed = seed_of("phase.seed");
        const bool correlates = config_.text("motion.rule") == "correlate";
        phase.dynamics = correlates && phase.field == CLSP_FIELD_CIRCULAR_GAUSSIAN ? CLSP_DYNAMICS_CONTINUOUS
                                                                                   : CLSP_DYNAMICS_REPLACE;
        phase.translate = moves_ && config_.flag("motion.translate") ? 1 : 0;
        phase_ = clspeckle::Phase(*context_, phase);

        auto aperture = clspeckle::make<ClspApertureDesc>();
        aperture.width = width_;
        aperture.height = height_;
        aperture.oversampling = phase.oversampling;
        aperture.guard_px = phase.guard_px;
        aperture.normalization = config_.choice("aperture.normalization");
        aperture.relative_diameter = config_.number("aperture.relative_diameter");
        aperture.f_number = config_.number("aperture.f_number");
        aperture.pixel_pitch_m = config_.number("aperture.pixel_pitch_m");
        aperture.wavelength_m = config_.number("aperture.wavelength_m");
        aperture.fill_factor = config_.number("aperture.fill_factor");
        aperture.soft_rim = config_.number("aperture.soft_rim");
        aperture.degree_of_polarization = polarization;
        std::vector<float> pupil;
        if (const std::string path = config_.text("aperture.pupil_image"); !path.empty()) {
            pupil =
                plane(path, "pupil image", image_io::Role::image, &aperture.pupil_width, &aperture.pupil_height, 1.0);
            aperture.pupil = CLSP_PUPIL_IMAGE;
            aperture.pupil_image = pupil.data();
        }
        aperture_ = clspeckle::Aperture(*context_, aperture);

        if (const std::vector<double> axis = config_.numbers("lens.principal_point_px"); !axis.empty()) {
            auto lens = clspeckle::make<ClspLensDesc>();
            lens.width = width_;
            lens.height = height_;
            lens.principal_point_given = 1;
            lens.principal_point_x_px = axis[0];
            lens.principal_point_y_px = axis[1];
            lens_ = clspeckle::Lens(*context_, lens);
        }

        double dark_dn = 0; // mean of the dark frame
        if (has_sensor_) {
            const std::string profile = config_.text("sensor.profile");
            auto sensor = profile.empty() ? clspeckle::make<ClspSensorDesc>() : clspeckle::Sensor::profile(profile);
            // The options say both in dn, and have taken over what the profile says.
            sensor.photons_per_unit = 0;
            sensor.full_well_e = 0;
            sensor.width = width_;
            sensor.height = height_;
            sensor.bits = static_cast<std::uint32_t>(config_.integer("sensor.bits"));
            sensor.seed = seed_of("sensor.seed");
            // The automatic gain needs the ideal image; until then any gain does.
            if (!config_.is_word("sensor.exposure_gain_dn"))
                sensor.exposure_gain_dn = config_.number("sensor.exposure_gain_dn");
            sensor.saturation_dn = config_.number("sensor.saturation_dn");
            sensor.black_level_dn = config_.number("sensor.black_level_dn");
            sensor.read_noise_dn = config_.number("sensor.read_noise_dn");
            sensor.exposure_time_s = config_.number("sensor.exposure_time_s");
            sensor.hot_pixel_fraction = config_.number("sensor.hot_pixel_fraction");
            sensor.hot_pixel_mean_dn = config_.number("sensor.hot_pixel_mean_dn");
            sensor.cold_pixel_fraction = config_.number("sensor.cold_pixel_fraction");
            sensor.float_full_scale = config_.number("sensor.float_full_scale");
            sensor.quantize = config_.flag("sensor.quantize") ? 1 : 0;
            const std::vector<float> dark = pixel_map("sensor.dark_frame", "dark frame", false);
            const std::vector<float> gains = pixel_map("sensor.gain_map", "gain map", true);
            if (!dark.empty())
                dark_dn = std::accumulate(dark.begin(), dark.end(), 0.0) / static_cast<double>(dark.size());
            sensor.dark_frame_dn = dark.empty() ? nullptr : dark.data();
            sensor.gain_map = gains.empty() ? nullptr : gains.data();
            try {
                sensor_ = clspeckle::Sensor(*context_, sensor);
            } catch (const clspeckle::Error &error) {
                // What the pixels' own checks leave: the mean of the gains.
                if (error.status() == CLSP_ERROR_INVALID_DATA)
                    throw InputError(config_.text("sensor.gain_map") + ": " + error.message());
                throw;
            }
        }

        if (input_.scene) {
            auto pattern = clspeckle::make<ClspPatternDesc>();
            const std::string path = config_.text("pattern.image");
            const std::vector<float> texels = plane(path, "pattern", image_io::Role::image, &pattern.width,
                                                    &pattern.height, INFINITY, encoding_of(config_));
            pattern.texels = texels.data();
            pattern.half_extent_x = config_.number("pattern.half_extent_x");
            pattern.half_extent_y = config_.number("pattern.half_extent_y");
            pattern.projection = config_.choice("pattern.projection");
            pattern.quantity = config_.choice("pattern.quantity");
            pattern.filter = config_.choice("pattern.filter");
            pattern.power_scale = config_.number("pattern.power_scale");
            const std::vector<double> pose = config_.numbers("pattern.laser_from_geometry");
            std::copy(pose.begin(), pose.end(), pattern.laser_from_geometry);
            pattern_ = clspeckle::Pattern(*context_, pattern);
        }
        if (!input_.materials.empty())
            materials_ = clspeckle::MaterialTable(*context_, input_.materials);
        if (moves_)
            motion_ = make_motion(phase.translate);
        auto pipeline = clspeckle::make<ClspPipelineDesc>();
        pipeline.pattern = pattern_;
        pipeline.phase = phase_;
        pipeline.aperture = aperture_;
        pipeline.sensor = sensor_;
        pipeline.lens = lens_;
        pipeline.motion = motion_;
        if (uses_materials_)
            pipeline.materials = materials_;
        pipeline.subsurface_length_px = config_.number("surface.subsurface_length_px");
        pipeline.seed = seed;
        pipeline_ = clspeckle::Pipeline(*context_, pipeline);

        device_.emplace(*context_, queue_, width_, height_);
        const std::size_t sample_bytes = float_output_ ? sizeof(float) : sizeof(std::uint16_t);
        output_ = Buffer(*context_, std::uint64_t{width_} * height_ * sample_bytes);
        output_image_ = output_.image(width_, height_, float_output_ ? CLSP_FORMAT_FLOAT32 : CLSP_FORMAT_UINT16);
        device_->upload(first_);
        range_.emplace(config_, has_sensor_, dark_dn);
        if (has_sensor_ && config_.is_word("sensor.exposure_gain_dn"))
            choose_gain();
        // After the gain, which some of them need.
        for (const EffectSetting &effect : config_.effects()) {
            if (changes_dots(effect.id))
                throw InputError(
                    fmt::format("--effect {}: changes the dots that the library draws (dots.h); render has "
                                "an ideal image or a scene's pattern instead",
                                effect_text(effect)));
            try {
                pipeline_.set_effect(effect.id, effect.values);
            } catch (const clspeckle::Error &error) {
                if (error.status() != CLSP_ERROR_INVALID_ARGUMENT)
                    throw;
                throw InputError(fmt::format("--effect {}: {}", effect_text(effect), error.message()));
            }
        }
        flush_warnings();
    }

    std::uint64_t frames() const { return frames_; }

    void warm_up() {
        const double start = now();
        const ClspGeometry geometry = make_geometry();
        pipeline_.warm_up(queue_, make_frame(geometry, nullptr, config_.integer("render.first_frame")));
        warm_up_seconds_ = now() - start;
    }

    void run(Output &output) {
        const std::uint64_t first_number = config_.integer("render.first_frame");
        const bool preview = config_.flag("render.preview");
        const bool save_ideal = config_.flag("render.save_ideal");
        const bool still = input_.frame_count == 1;
        std::optional<PreviewScale> scale;
        std::optional<PreviewScale> ideal_scale;
        std::future<FrameData> next;
        FrameData data = std::move(first_);
        run_started_ = now();
        for (std::uint64_t i = 0; i < frames_; ++i) {
            check_interrupt();
            if (i > 0 && !still) {
                data = next.get();
                flush_warnings();
                device_->upload(data);
            }
            if (!still && i + 1 < frames_)
                next = std::async(std::launch::async, [this, i] { return read(i + 1); });
            const std::uint64_t number = first_number + i;

            const ClspGeometry geometry = make_geometry();
            const bool moved = moves_ && i > 0 && !still;
            const ClspMotionInput motion = make_motion_input(data);
            const ClspFrame frame = make_frame(geometry, moved ? &motion : nullptr, number);
            const double start = now();
            pipeline_.enqueue_frame(queue_, frame);
            queue_.finish();
            device_seconds_ += now() - start;
            times_.add(pipeline_.timings());

            Samples samples = read_output();
            const auto saturated = count_saturated(samples);
            if (i == 0)
                saturated_first_ = saturated;
            if ((i == 0 || !still) && may_be_odd(data, samples, saturated))
                warn_of_exposure(data, saturated);
            if (i == 0) {
                moments_ = clspeckle::statistics::moments(*context_, queue_, output_image_);
                if (preview)
                    scale = PreviewScale::of(samples);
            }
            if (save_ideal && (i == 0 || !still)) {
                std::vector<float> ideal = input_.scene ? look_up() : data.irradiance.values;
                if (preview && !ideal_scale)
                    ideal_scale = PreviewScale::of(Samples(ideal));
                output.write_ideal(number, std::move(ideal), preview ? &*ideal_scale : nullptr);
            }
            output.write_frame(number, std::move(samples), preview ? &*scale : nullptr);
            console_.progress(i + 1, frames_);
        }
        output.finish();
        run_seconds_ = now() - run_started_;
        pipeline_.check(queue_);
    }

    void report(const std::vector<std::string> &files, const std::string &folder) {
        const ClspContextInfo device = context_->info();
        const ClspApertureInfo aperture = aperture_.info();
        const std::uint64_t pixels = std::uint64_t{width_} * height_;
        const std::uint64_t oversampling = config_.integer("aperture.oversampling");
        const bool padded =
            aperture.grid_width != width_ * oversampling || aperture.grid_height != height_ * oversampling;
        // A frame without light has none.
        const double light = moments_.mean - black_level();
        const double contrast = light > 0 ? moments_.standard_deviation / light : NAN;
        const double saturated = static_cast<double>(saturated_) / static_cast<double>(pixels * frames_);
        const double frame_milliseconds = times_.all.mean();
        const double rate = static_cast<double>(frames_) / run_seconds_;
        if (console_.json()) {
            Json stages = Json::object();
            for (const StageTimes &stage : times_.stages)
                stages[stage.name] = {{"mean", stage.mean()},
                                      {"median", stage.median()},
                                      {"minimum", stage.least()},
                                      {"maximum", stage.most()},
                                      {"frames", stage.milliseconds.size()}};
            const auto version = clspeckle::version();
            Json root = {
                {"version", fmt::format("{}.{}.{}", version.major, version.minor, version.patch)},
                {"device", {{"name", device.device_name}, {"platform", device.platform_name}}},
                {"input", {{"kind", input_.kind}, {"first", input_.first_name}, {"frames", input_.frame_count}}},
                {"image", {{"width", width_}, {"height", height_}}},
                {"grid", {{"width", aperture.grid_width}, {"height", aperture.grid_height}, {"padded", padded}}},
                {"aperture",
                 {{"relative_diameter", aperture.relative_diameter},
                  {"mean_transmission", aperture.mean_transmission},
                  {"pupil_samples", aperture.pupil_samples},
                  {"fft_engine", aperture.fft_engine}}},
                {"frames", frames_},
                {"first_frame",
                 {{"mean", moments_.mean},
                  {"standard_deviation", moments_.standard_deviation},
                  {"contrast", contrast},
                  {"minimum", moments_.minimum},
                  {"maximum", moments_.maximum},
                  {"saturated_share", static_cast<double>(saturated_first_) / static_cast<double>(pixels)}}},
                {"saturated_share", saturated},
                {"milliseconds",
                 {{"warm_up", warm_up_seconds_ * 1e3}, {"frame", frame_milliseconds}, {"stages", stages}}},
                {"frames_per_second", {{"device", device_rate()}, {"with_files", rate}}},
                {"output", {{"folder", folder}, {"format", config_.text("render.format")}, {"files", files}}},
                {"warnings", console_.warnings()},
                {"config", config_.dump()},
            };
            if (!config_.profile().empty())
                root["profile"] = {{"file", config_.profile()}, {"replaced", config_.replaced()}};
            if (has_sensor_)
                root["exposure_gain_dn"] = config_.number("sensor.exposure_gain_dn");
            console_.result(root.dump(2, ' ', false, Json::error_handler_t::replace));
            return;
        }
        console_.print(fmt::format("device      {} ({})", device.device_name, device.platform_name));
        console_.print(fmt::format("input       {}, {} x {} pixels, {} frame{}", input_.kind, width_, height_,
                                   input_.frame_count, input_.frame_count == 1 ? "" : "s"));
        console_.print(
            fmt::format("field grid  {} x {}{}", aperture.grid_width, aperture.grid_height,
                        !padded ? ", no padding"
                                : fmt::format(", padded from {} x {}", width_ * oversampling, height_ * oversampling)));
        console_.print(fmt::format("aperture    relative diameter {:.4f} cycles per pixel, mean transmission {:.4f}",
                                   aperture.relative_diameter, aperture.mean_transmission));
        // The intensity has twice the field's bandwidth: D cycles per pixel, of which the grid holds oversampling / 2.
        if (aperture.relative_diameter > static_cast<double>(oversampling) / 2 * (1 + 1e-9))
            console_.print(fmt::format("sampling    D exceeds oversampling / 2 = {:g}: the finest speckle aliases; "
                                       "--oversampling integrates over the pixel",
                                       static_cast<double>(oversampling) / 2));
        if (has_sensor_)
            console_.print(fmt::format("exposure    gain {:.9g} dn per unit of intensity{}",
                                       config_.number("sensor.exposure_gain_dn"),
                                       gain_chosen_ ? ", chosen from the first ideal image" : ""));
        if (!config_.profile().empty())
            console_.print("profile     " + config_.profile());
        for (const std::string &text : config_.replaced())
            console_.print("            " + text);
        for (const auto &[id, name] : {std::pair{"sensor.dark_frame", "dark frame"}, {"sensor.gain_map", "gain map  "}})
            if (has_sensor_ && !config_.text(id).empty())
                console_.print(fmt::format("{}  {}", name, config_.text(id)));
        for (const EffectSetting &effect : config_.effects())
            console_.print("effect      " + effect_text(effect));
        const std::string of = has_sensor_ && black_level() != 0 ? " above the black level" : "";
        console_.print(fmt::format("first frame mean {:.5g}, standard deviation {:.5g}, contrast{} {}", moments_.mean,
                                   moments_.standard_deviation, of, light > 0 ? fmt::format("{:.4f}", contrast) : "-"));
        if (has_sensor_)
            console_.print(fmt::format("saturated   {} of all pixels", percent(saturated)));
        std::string times;
        for (const StageTimes &stage : times_.stages)
            times += fmt::format("{}{} {:.3f}", times.empty() ? "" : ", ", stage.name, stage.mean());
        console_.print(fmt::format("time, ms    {} (warm-up {:.0f})", times, warm_up_seconds_ * 1e3));
        console_.print(
            fmt::format("speed       {:.1f} frames per second on the device, {:.1f} with files", device_rate(), rate));
        if (config_.flag("render.stage_times"))
            console_.print(times_.table());
        console_.print(describe_files(files, folder));
    }

  private:
    FrameData read(std::uint64_t frame) { return input_.read(frame, warnings_); }

    /** Frames of a series differ in their numbers: what is said of one holds for the others. */
    void flush_warnings() {
        for (const std::string &warning : warnings_) {
            std::string kind;
            std::copy_if(warning.begin(), warning.end(), std::back_inserter(kind),
                         [](unsigned char c) { return std::isdigit(c) == 0; });
            if (warned_.insert(kind).second)
                console_.warn(warning);
        }
        warnings_.clear();
    }

    void decide_frames() {
        frames_ = config_.is_word("render.frames") ? input_.frame_count : config_.integer("render.frames");
        if (input_.frame_count > 1 && frames_ > input_.frame_count)
            throw InputError(fmt::format("--frames {}: the input has {} frames", frames_, input_.frame_count));
    }

    static bool is_black(const std::vector<float> &values) {
        return std::all_of(values.begin(), values.end(), [](float value) { return value == 0; });
    }
    static std::string black(const std::string &what) {
        return fmt::format("{} is 0 everywhere: it may be another channel or page than meant, which FILE:CHANNEL and "
                           "FILE:page=N name",
                           what);
    }

    std::vector<float> plane(const std::string &path, const char *what, image_io::Role role, std::uint32_t *width,
                             std::uint32_t *height, double high,
                             image_io::Encoding encoding = image_io::Encoding::as_stored) {
        image_io::Plane plane;
        std::string advice;
        plane.values = read_plane(path, role, warnings_, width, height, &advice, encoding);
        plane.width = *width;
        plane.height = *height;
        if (is_black(plane.values))
            black_plane_ = black(fmt::format("the {} {}", what, path));
        if (std::isinf(high))
            check_light(plane, path, what, light_choice(config_), warnings_);
        else
            check_values(plane, path, what, high, advice.empty() ? "" : advice + " divides its whole numbers");
        return std::move(plane.values);
    }

    /** A map of the sensor's pixels; empty if the option names none. */
    std::vector<float> pixel_map(const char *id, const char *what, bool positive) {
        const std::string path = config_.text(id);
        if (path.empty())
            return {};
        std::uint32_t width = 0;
        std::uint32_t height = 0;
        std::vector<float> map = read_plane(path, image_io::Role::map, warnings_, &width, &height);
        if (width != width_ || height != height_)
            throw InputError(fmt::format("{}: the {} has {} x {} pixels, the image {} x {}", path, what, width, height,
                                         width_, height_));
        for (std::size_t i = 0; i < map.size(); ++i)
            if (!std::isfinite(map[i]) || (positive && map[i] < 0))
                throw InputError(fmt::format("{}: pixel ({}, {}) of the {} is {}; it must be finite{}", path,
                                             i % width_, i / width_, what, map[i], positive ? " and at least 0" : ""));
        return map;
    }

    /** Whether the pipeline needs the materials, and whether the frames have what it takes. */
    void check_materials() {
        const auto plain = clspeckle::make<ClspMaterial>();
        for (const ClspMaterial &m : input_.materials)
            uses_materials_ |= m.roughness_rms_m != plain.roughness_rms_m || m.subsurface_fraction > 0 ||
                               m.degree_of_polarization != plain.degree_of_polarization;
        if (!input_.scene && !first_.material.empty() && input_.materials.empty())
            throw InputError(
                "--material gives each pixel's id, but no list says what they are made of; add --materials FILE");
        if (uses_materials_ && first_.material.empty())
            throw InputError(fmt::format(
                "{}: the materials need each pixel's id: the channel material, or --material IMAGE", first_.name));
        for (std::size_t i = 0; i < first_.material.size() && !input_.materials.empty(); ++i)
            if (first_.material[i] >= input_.materials.size())
                throw InputError(fmt::format("{}: pixel ({}, {}) has the material {}, which is not in the list of "
                                             "materials",
                                             first_.name, i % width_, i / width_, first_.material[i]));
    }

    clspeckle::Motion make_motion(std::uint32_t translate) {
        auto motion = clspeckle::make<ClspMotionDesc>();
        motion.width = width_;
        motion.height = height_;
        motion.rule = config_.text("motion.rule") == "replace" ? CLSP_MOTION_REPLACE : CLSP_MOTION_CORRELATE;
        motion.translate = translate;
        motion.depth_kind = config_.choice("camera.depth_kind");
        motion.materials = materials_;
        motion.fx_px = config_.number("camera.fx_px");
        motion.fy_px = config_.number("camera.fy_px");
        motion.cx_px = config_.number("camera.cx_px");
        motion.cy_px = config_.number("camera.cy_px");
        motion.replace_threshold = config_.number("motion.replace_threshold");
        return {*context_, motion};
    }

    /** How the frame that is on the device came about from the one before it. @param data must stay. */
    ClspMotionInput make_motion_input(const FrameData &data) const {
        auto input = clspeckle::make<ClspMotionInput>();
        input.frame_time_s = config_.number("motion.frame_time_s");
        const bool position = device_->position.mem != nullptr;
        (position ? input.position : input.depth) = position ? device_->position : device_->depth;
        (position ? input.previous_position : input.previous_depth) =
            position ? device_->previous_position : device_->previous_depth;
        if (materials_) {
            input.material = device_->material;
            if (input.material.mem)
                input.previous_material = device_->previous_material;
        }
        input.motion = device_->motion;
        if (!data.previous_from_current.empty()) {
            input.previous_from_current = data.previous_from_current.data();
            input.transform_count = static_cast<std::uint32_t>(data.previous_from_current.size() / 12);
        }
        return input;
    }

    ClspGeometry make_geometry() const {
        auto geometry = clspeckle::make<ClspGeometry>();
        geometry.depth_kind = config_.choice("camera.depth_kind");
        geometry.position = device_->position;
        geometry.depth = device_->depth;
        geometry.normal = device_->normal;
        geometry.albedo = device_->albedo;
        geometry.visibility = device_->visibility;
        geometry.fx_px = config_.number("camera.fx_px");
        geometry.fy_px = config_.number("camera.fy_px");
        geometry.cx_px = config_.number("camera.cx_px");
        geometry.cy_px = config_.number("camera.cy_px");
        return geometry;
    }

    /** The frame that is on the device. */
    ClspFrame make_frame(const ClspGeometry &geometry, const ClspMotionInput *motion, std::uint64_t number) const {
        auto frame = clspeckle::make<ClspFrame>();
        const std::uint32_t refresh = config_.choice("render.refresh");
        frame.frame_index = number;
        frame.refresh = refresh == refresh_none ? CLSP_REFRESH_MASK : refresh;
        frame.illumination = illumination_;
        frame.motion = motion;
        if (uses_materials_)
            frame.material = device_->material;
        if (refresh == CLSP_REFRESH_MASK)
            frame.refresh_mask = device_->refresh;
        if (input_.scene)
            frame.geometry = &geometry;
        else
            frame.irradiance = device_->irradiance;
        frame.output = output_image_;
        return frame;
    }

    /** The ideal image of the scene that is on the device. */
    std::vector<float> look_up() {
        const std::size_t pixels = std::size_t{width_} * height_;
        if (!ideal_)
            ideal_ = Buffer(*context_, pixels * sizeof(float));
        pattern_.enqueue_lookup(queue_, make_geometry(), ideal_.image(width_, height_, CLSP_FORMAT_FLOAT32));
        return ideal_.read<float>(queue_, pixels);
    }

    /** The light by which --exposure-gain auto exposes. */
    static double bright_of(std::vector<float> values) {
        const float bright = percentile(values, 0.999);
        return bright > 0 ? bright : *std::max_element(values.begin(), values.end());
    }

    void choose_gain() {
        const double bright = bright_of(input_.scene ? look_up() : first_.irradiance.values);
        if (bright <= 0)
            throw InputError(fmt::format("{}: {}, so that no exposure can be chosen. If no light is meant, give "
                                         "--illumination dark and a number for --exposure-gain",
                                         first_.name, why_black(first_)));
        if (range_->room() <= 0)
            throw InputError(fmt::format("--exposure-gain auto finds no room: {}", range_->why_no_room()));
        const double gain = range_->auto_signal() / (bright * passed());
        if (!(gain <= most_gain))
            throw InputError(fmt::format("{}: the first ideal image is too dark ({:g}) for an exposure; scale it with "
                                         "--irradiance-scale",
                                         first_.name, bright));
        sensor_.set_exposure_gain(gain);
        config_.resolve("sensor.exposure_gain_dn", gain);
        gain_chosen_ = true;
        console_.print(fmt::format("exposure gain chosen: repeat it with --exposure-gain {}", gain));
    }

    /** The likely cause of an ideal image without any light. */
    std::string why_black(const FrameData &data) const {
        if (!black_plane_.empty())
            return black_plane_;
        if (!data.albedo.empty() && is_black(data.albedo.values))
            return black("the albedo " + data.albedo_name);
        if (!data.visibility.empty() && is_black(data.visibility.values))
            return black("the visibility " + data.visibility_name);
        return input_.scene
                   ? fmt::format("the ideal image is 0 everywhere: the pattern does not meet the scene{}. Check "
                                 "its pose and extent (--pattern-laser-from-geometry, "
                                 "--pattern-half-extent-x), and the unit of depths (--depth-scale)",
                                 data.normal.empty() ? "" : ", or the normals face away")
                   : "the ideal image is 0 everywhere: it may be another channel or page than meant, "
                     "which FILE:CHANNEL and FILE:page=N name, or an image that was never drawn";
    }

    /** Part of the light that the aperture passes, in the mean. */
    double passed() const {
        const bool kept_mean = config_.choice("aperture.normalization") == CLSP_NORMALIZATION_UNIT_MEAN;
        return kept_mean ? 1.0 : aperture_.info().mean_transmission;
    }

    /** Whether a frame may be one to warn of. What the pattern brings to a scene is looked up again where less than
     * half of the signal is left that there was, or more than twice that of the last time. */
    bool may_be_odd(const FrameData &data, const Samples &samples, std::uint64_t saturated) {
        if (illumination_ == CLSP_ILLUMINATION_DARK)
            return false;
        if (!input_.scene) {
            const std::vector<float> &values = data.irradiance.values;
            return saturated > 0 || *std::max_element(values.begin(), values.end()) * dn_per_light() < least_light();
        }
        const double mean = std::visit(
            [](const auto &values) {
                return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
            },
            samples);
        const double signal = std::max(mean - black_level(), 0.0);
        const bool look = !signal_looked_up_ || signal < signal_ / 2 || signal > 2 * *signal_looked_up_;
        if (look)
            signal_looked_up_ = signal;
        signal_ = look ? signal : std::max(signal, signal_);
        return look;
    }
    double dn_per_light() const { return (has_sensor_ ? config_.number("sensor.exposure_gain_dn") : 1) * passed(); }
    double least_light() const { return has_sensor_ ? 0.5 : std::numeric_limits<double>::denorm_min(); }

    /** A frame without light, or with most of its light at the top code, is seldom meant. Each is told once.
     * @param at_end pixels at the last code. */
    void warn_of_exposure(const FrameData &data, std::uint64_t at_end) {
        const std::vector<float> values = input_.scene ? look_up() : data.irradiance.values;
        const double brightest = *std::max_element(values.begin(), values.end());
        const double mean = std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
        const double gain = has_sensor_ ? config_.number("sensor.exposure_gain_dn") : 0, behind = dn_per_light();
        const bool ambient = range_->ambient_light() >= 0.5;
        const bool dark = brightest * behind < least_light();
        const char *no_light = ambient ? "the pattern brings no light" : "the frame has no light";
        const auto pixels = static_cast<double>(values.size());
        const double lit = ambient || gain <= 0
                               ? pixels
                               : static_cast<double>(std::count_if(values.begin(), values.end(),
                                                                   [behind](float v) { return v * behind >= 0.5; }));
        const auto saturated = static_cast<double>(at_end);
        const std::string part = passed() == 1 ? "" : fmt::format(", of which the aperture passes {:.3g}", passed());
        // An ideal image may be dark where the light is ambient, or where the gain says so.
        const bool meant = !input_.scene && (ambient || (has_sensor_ && gain <= 0 && brightest > 0));
        if (dark && !meant && !std::exchange(told_dark_, true)) {
            if (brightest <= 0)
                console_.warn(
                    fmt::format("{}: {}: {}. No gain helps; if no light is meant, --illumination dark says so",
                                data.name, no_light, why_black(data)));
            else if (input_.scene)
                console_.warn(fmt::format(
                    "{}: {}: the brightest point gets {:.3g} of full scale. Check the pattern's pose and extent "
                    "(--pattern-laser-from-geometry, --pattern-half-extent-x), the unit of depths (--depth-scale), and "
                    "the gain ({} dn{})",
                    data.name, no_light, brightest * behind / range_->top_code(), gain, part));
            else
                console_.warn(fmt::format("{}: the frame has no light: the brightest number is {:.3g}{}, and with a "
                                          "gain of {} dn that is less than half a code; {}",
                                          data.name, brightest, part, gain, gain_advice(values)));
        }
        if ((dark && !ambient) || !has_sensor_ || saturated <= 0 || saturated < most_saturated * lit ||
            std::exchange(told_saturated_, true))
            return;
        const std::string end = range_->ends_below_top()
                                    ? fmt::format("at {:g} + {:g} dn, where its signal ends below the top code "
                                                  "(--saturation-dn or the effect full_well)",
                                                  range_->offset(), range_->largest_signal())
                                    : "at the top code";
        const std::string told = fmt::format("{}: {:.0f} % of the frame is {}, where {:.0f} % has light", data.name,
                                             100 * saturated / pixels, end, 100 * lit / pixels);
        if (brightest * behind <= std::min((range_->top_code() + 1) / 2, range_->largest_signal() / 2))
            console_.warn(fmt::format("{}, though the brightest {} brings no more than half of the range: the code "
                                      "without light, {:g}, and ambient light, {:g} dn, fill the rest; lower them",
                                      told, input_.scene ? "point" : "number", range_->offset(),
                                      range_->ambient_light()));
        else
            console_.warn(
                fmt::format("{}: the mean light is {:.3g}, and the gain {} dn for light of 1; {}{}", told, mean, gain,
                            input_.scene || mean <= 1 ? "" : "--full-scale N makes N the number that means 1, and ",
                            gain_advice(values)));
    }

    /** What brings light into the range: --exposure-gain auto where choose_gain() takes it. */
    std::string gain_advice(const std::vector<float> &values) const {
        if (range_->room() <= 0)
            return "no gain helps: " + range_->why_no_room();
        if (range_->auto_signal() / (bright_of(values) * passed()) > most_gain)
            return "scale it with --irradiance-scale, and --exposure-gain auto finds one";
        return "--exposure-gain auto finds one";
    }

    Samples read_output() {
        const std::size_t pixels = std::size_t{width_} * height_;
        if (float_output_)
            return output_.read<float>(queue_, pixels);
        return output_.read<std::uint16_t>(queue_, pixels);
    }

    /** In units of the output. */
    double black_level() const {
        if (!has_sensor_)
            return 0;
        const double unit = float_output_ ? config_.number("sensor.float_full_scale") / range_->top_code() : 1.0;
        return config_.number("sensor.black_level_dn") * unit;
    }
    double device_rate() const { return static_cast<double>(frames_) / device_seconds_; }

    /** Pixels of a frame that are at their end. */
    std::uint64_t count_saturated(const Samples &samples) {
        if (!has_sensor_)
            return 0;
        // Half a code below it, against the rounding of a float output.
        const double unit = float_output_ ? config_.number("sensor.float_full_scale") / range_->top_code() : 1.0;
        const double last = (range_->last_code() - (float_output_ ? 0.5 : 0.0)) * unit;
        return std::visit(
            [&](const auto &values) {
                const auto count = static_cast<std::uint64_t>(std::count_if(
                    values.begin(), values.end(), [last](auto v) { return static_cast<double>(v) >= last; }));
                saturated_ += count;
                return count;
            },
            samples);
    }

    static std::string describe_files(const std::vector<std::string> &files, const std::string &folder) {
        std::string names;
        if (files.size() <= 4) {
            for (const std::string &name : files)
                names += (names.empty() ? "" : ", ") + name;
        } else {
            names = fmt::format("{} files, {} to {}", files.size(), files.front(), files.back());
        }
        return fmt::format("written     {}: {}", folder, names);
    }

    Config &config_;
    Input &input_;
    Console &console_;
    std::uint32_t width_ = 0;
    std::uint32_t height_ = 0;
    std::uint64_t frames_ = 1;
    std::uint32_t illumination_ = CLSP_ILLUMINATION_LASER;
    bool moves_ = false;
    bool uses_materials_ = false;
    bool has_sensor_ = true;
    bool float_output_ = false;
    bool gain_chosen_ = false;
    std::string black_plane_; ///< What is 0 everywhere; empty: nothing is.
    FrameData first_;
    std::set<std::string> warned_;
    std::vector<std::string> warnings_;

    std::optional<clspeckle::Context> context_;
    clspeckle::Queue queue_;
    clspeckle::Pattern pattern_;
    clspeckle::Phase phase_;
    clspeckle::Aperture aperture_;
    clspeckle::Lens lens_;
    clspeckle::Sensor sensor_;
    clspeckle::MaterialTable materials_;
    clspeckle::Motion motion_;
    clspeckle::Pipeline pipeline_;
    std::optional<DeviceFrame> device_;
    Buffer output_;
    Buffer ideal_;
    ClspImage output_image_{};

    ClspMoments moments_{};
    std::uint64_t saturated_ = 0;
    std::uint64_t saturated_first_ = 0;
    std::optional<ExposureRange> range_;
    std::optional<double> signal_looked_up_; ///< Mean signal of the frame whose ideal image was last looked up,
    double signal_ = 0;                      ///< and the largest since.
    bool told_dark_ = false;
    bool told_saturated_ = false;
    FrameTimes times_;
    double warm_up_seconds_ = 0;
    double device_seconds_ = 0;
    double run_started_ = 0;
    double run_seconds_ = 0;
};

/** Removes the folders that were made for nothing. */
class FolderGuard {
  public:
    explicit FolderGuard(std::vector<std::string> created) : created_(std::move(created)) {}
    FolderGuard(const FolderGuard &) = delete;
    FolderGuard &operator=(const FolderGuard &) = delete;
    ~FolderGuard() {
        // Only empty folders go: what was written stays.
        std::error_code ignored;
        for (auto folder = created_.rbegin(); folder != created_.rend(); ++folder)
            if (!std::filesystem::remove(*folder, ignored))
                break;
    }
    void keep() { created_.clear(); }

  private:
    std::vector<std::string> created_;
};

/** Refuses a run that would replace one of its own inputs; before anything is written. */
void check_overwriting(const Config &config, const Input &input, const std::string &folder, std::uint64_t frames) {
    namespace fs = std::filesystem;
    std::error_code code;
    if (!fs::is_directory(folder, code))
        return;
    std::map<std::pair<dev_t, ino_t>, std::string> inputs;
    std::vector<std::string> files = input.files;
    for (const char *id : {"pattern.image", "aperture.pupil_image", "sensor.dark_frame", "sensor.gain_map"})
        if (!config.text(id).empty())
            files.push_back(image_io::split_name(config.text(id)).path);
    // What std::filesystem::equivalent compares, without a call for each pair.
    struct stat status {};
    for (const std::string &file : files)
        if (::stat(file.c_str(), &status) == 0)
            inputs.emplace(std::make_pair(status.st_dev, status.st_ino), file);
    const auto check = [&](const std::string &name) {
        if (::stat((fs::path(folder) / name).c_str(), &status) != 0)
            return;
        const auto found = inputs.find({status.st_dev, status.st_ino});
        if (found != inputs.end())
            throw InputError(
                fmt::format("the output would overwrite the input {}; choose another --output", found->second));
    };
    check("config.json");
    const FrameFormat format(config.text("render.format"));
    if (format.storage->stack)
        check(format.file_name(0));
    const std::uint64_t first = config.integer("render.first_frame");
    for (std::uint64_t i = first; i < first + frames; ++i) {
        if (!format.storage->stack)
            check(format.file_name(i));
        if (config.flag("render.save_ideal"))
            check(fmt::format("ideal_{:06}.npy", i));
        if (config.flag("render.preview"))
            check(fmt::format("preview_{:06}.png", i));
        if (config.flag("render.preview") && config.flag("render.save_ideal"))
            check(fmt::format("ideal_preview_{:06}.png", i));
    }
}

} // namespace

void run_render(Config &config, Input &input, const std::string &folder, Console &console) {
    Renderer renderer(config, input, console);
    check_overwriting(config, input, folder, renderer.frames());
    (void)json_document(config.dump(), 2); // before the frames: config.json can be written
    // Asked before the device, so that a size that is too large is told as what it is: wrong usage.
    try {
        clspeckle::field_grid(input.width, input.height,
                              static_cast<std::uint32_t>(config.integer("aperture.oversampling")),
                              static_cast<std::uint32_t>(config.integer("aperture.guard_px")));
    } catch (const clspeckle::Error &error) {
        throw InputError(error.what());
    }
    check_interrupt();
    renderer.make_stages();
    FolderGuard guard(make_output_folder(folder));
    check_interrupt();
    renderer.warm_up();
    Output output(folder, FrameFormat(config.text("render.format")), renderer.frames(), input.width, input.height);
    try {
        renderer.run(output);
        output.write_text("config.json", json_document(config.dump(), 2) + "\n");
    } catch (const Interrupted &) {
        output.wait();
        const std::vector<std::string> files = output.files();
        const auto count = std::count_if(files.begin(), files.end(),
                                         [](const std::string &name) { return name.rfind("frame_", 0) == 0; });
        throw Interrupted(fmt::format("interrupted; {} complete frame{} of this run in {}", count,
                                      count == 1 ? " is" : "s are", folder));
    } catch (...) {
        if (const std::size_t count = output.discard(); count > 0)
            console.warn(fmt::format("the run failed, so the {} file{} that it had written to {} {} removed", count,
                                     count == 1 ? "" : "s", folder, count == 1 ? "is" : "are"));
        throw;
    }
    guard.keep();
    renderer.report(output.files(), folder);
}

} // namespace tools

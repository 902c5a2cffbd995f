#include "pipeline/pipeline.hpp"

#include "effects/effects.hpp"
#include "runtime/checks.hpp"
#include "runtime/error.hpp"
#include "stages/philox.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/core.h>
#include <utility>

namespace clsp {
namespace {

void check_parameters(const PipelineParameters &p) {
    check_not_negative(p.power_flicker, "power_flicker");
    check_not_negative(p.subsurface_length_px, "subsurface_length_px");
    check_fraction(p.subsurface_fraction, "subsurface_fraction");
    if (p.subsurface_fraction > 0.0 && p.subsurface_length_px == 0.0)
        throw Error(Status::kInvalidArgument,
                    fmt::format("subsurface_fraction is {}, but subsurface_length_px is 0; set it above 0",
                                p.subsurface_fraction));
    if (p.sub_exposures > kMaxSubstep)
        throw Error(Status::kInvalidArgument,
                    fmt::format("sub_exposures is {}, it must be 0 (automatic) to {}", p.sub_exposures, kMaxSubstep));
    check_not_negative(p.exposure_path, "exposure_path");
    check_fraction(p.shutter_fraction, "shutter_fraction");
    if (!(p.boiling_correlation_frames > 0.0))
        throw Error(Status::kInvalidArgument,
                    fmt::format("boiling_correlation_frames is {}, it must be above 0 (infinity: off)",
                                p.boiling_correlation_frames));
    check_airflow(p.airflow);
    check_not_negative(p.vibration_rms_px, "vibration_rms_px");
}

// Parts of an exposure in which what moves is seen at work, unless the host says how many.
constexpr std::uint32_t kBlurSteps = 8;
std::uint32_t blur_steps(const PipelineParameters &p) {
    return p.sub_exposures == 0 ? kBlurSteps : p.sub_exposures;
}

bool boils(const PipelineParameters &p) {
    return std::isfinite(p.boiling_correlation_frames);
}

// The parts that differ, as kSets* of effects.hpp.
unsigned changed_parts(const PipelineModel &a, const PipelineModel &b) {
    unsigned parts = 0;
    const auto compare = [&](unsigned part, bool same) { parts |= same ? 0u : part; };
    compare(kSetsPhase, a.phase == b.phase);
    compare(kSetsAperture, a.aperture == b.aperture);
    compare(kSetsLens, a.lens == b.lens);
    compare(kSetsDots, a.dots == b.dots);
    compare(kSetsSensor, a.sensor == b.sensor);
    return parts;
}

// The kernel of stages/own_effect.cl for images of a format.
LazyKernel &format_kernel(std::map<Format, LazyKernel> &kernels, const char *name, Format format) {
    const auto found = kernels.find(format);
    if (found != kernels.end())
        return found->second;
    const char *pixel = format == Format::kUint8 ? "uchar" : format == Format::kUint16 ? "ushort" : "float";
    return kernels.emplace(format, LazyKernel("stages/own_effect.cl", name, fmt::format("-DPIXEL={}", pixel)))
        .first->second;
}

// In the catalogue's order, whatever the order of the calls.
PipelineModel with_effects(PipelineModel model, const std::map<std::string, std::vector<double>> &effects) {
    for (const Effect &effect : effect_catalogue())
        if (const auto found = effects.find(effect.id); found != effects.end())
            effect.apply(model, found->second.data());
    return model;
}

} // namespace

Pipeline::Pipeline(std::shared_ptr<Context> context, PipelineStages stages, const PipelineParameters &parameters,
                   PipelineOptions options)
    : context_(std::move(context)), stages_(std::move(stages)), parameters_(parameters), options_(options) {
    check_stages();
    check_own(model());
    apply_own(model());
}

void Pipeline::check_stages() const {
    if (!stages_.phase || !stages_.aperture)
        throw Error(Status::kInvalidArgument, fmt::format("{} is NULL; a pipeline needs a phase and an aperture",
                                                          stages_.phase ? "aperture" : "phase"));
    const ::cl_context ours = context_->cl_context()();
    const auto check_context = [&](const auto &stage, const char *name) {
        if (stage && stage->context()->cl_context()() != ours)
            throw Error(Status::kWrongContext, fmt::format("{} belongs to another context than the pipeline", name));
    };
    check_context(stages_.pattern, "pattern");
    check_context(stages_.dots, "dots");
    check_context(stages_.materials, "materials");
    check_context(stages_.motion, "motion");
    check_context(stages_.phase, "phase");
    check_context(stages_.aperture, "aperture");
    check_context(stages_.lens, "lens");
    check_context(stages_.sensor, "sensor");
    if (stages_.pattern && stages_.dots)
        throw Error(Status::kInvalidArgument, "a pipeline has a pattern or dots, not both");
    stages_.aperture->check_phase(*stages_.phase);
    if (stages_.materials && stages_.phase->polarization_count() < 2)
        throw Error(Status::kInvalidArgument, "a material table needs a phase with polarization_count 2");
    if (stages_.motion) {
        const MotionParameters &motion = stages_.motion->parameters();
        const PhaseParameters &phase = stages_.phase->parameters();
        if (motion.rule == MotionRule::kCorrelate && phase.dynamics != Dynamics::kContinuous)
            throw Error(Status::kInvalidArgument,
                        "motion has the rule correlate, which needs a phase with dynamics continuous; or make the "
                        "motion with the rule replace");
        if (motion.translate && !phase.translate)
            throw Error(Status::kInvalidArgument,
                        "motion was made with translate = 1, which needs a phase with translate = 1");
    }
    const FieldGrid &grid = stages_.aperture->grid();
    const auto check_size = [&](const auto &stage, const char *name) {
        if (stage && (stage->parameters().width != grid.width || stage->parameters().height != grid.height))
            throw Error(Status::kInvalidArgument,
                        fmt::format("the {} has {} x {} pixels (width x height), the aperture {} x {}", name,
                                    stage->parameters().width, stage->parameters().height, grid.width, grid.height));
    };
    check_size(stages_.dots, "dots");
    check_size(stages_.motion, "motion");
    check_size(stages_.lens, "lens");
    check_size(stages_.sensor, "sensor");
}

PipelineModel Pipeline::model() const {
    PipelineModel model;
    model.pipeline = parameters_;
    model.phase = stages_.phase->parameters();
    model.aperture = stages_.aperture->parameters();
    if (stages_.lens) {
        model.lens = stages_.lens->parameters();
    } else {
        model.lens.width = stages_.aperture->grid().width;
        model.lens.height = stages_.aperture->grid().height;
    }
    if (stages_.dots) {
        // The stage's own list of dots stays; its pointers would not outlive a change.
        model.dots = stages_.dots->parameters();
        model.dots->count = 0;
        model.dots->positions_px = model.dots->sigmas_px = model.dots->peaks = nullptr;
    }
    if (stages_.sensor) {
        model.sensor = stages_.sensor->parameters();
        if (!dark_frame_.values.empty())
            model.sensor->dark_frame_dn = dark_frame_.values.data();
        if (!gain_map_.values.empty())
            model.sensor->gain_map = gain_map_.values.data();
    }
    return model;
}

// What remembers frames comes last, so that nothing behind it fails and takes it back: a stage that is set back has
// its parameters again, and not its memory.
void Pipeline::apply(const PipelineModel &model, unsigned sets, unsigned &applied) {
    const auto apply_part = [&](unsigned part, auto configure) {
        if (!(sets & part))
            return;
        configure();
        applied |= part;
    };
    apply_part(kSetsAperture, [&] { stages_.aperture->configure(model.aperture); });
    apply_part(kSetsLens, [&] {
        if (stages_.lens)
            stages_.lens->configure(model.lens);
        else
            stages_.lens = std::make_shared<Lens>(context_, model.lens, options_.keeps_filters);
    });
    apply_part(kSetsDots, [&] { stages_.dots->configure(*model.dots); });
    apply_own(model);
    apply_part(kSetsPhase, [&] { stages_.phase->configure(model.phase); });
    apply_part(kSetsSensor, [&] { stages_.sensor->configure(*model.sensor); });
}

void Pipeline::check_own(const PipelineModel &model) const {
    const PipelineParameters &p = model.pipeline;
    check_parameters(p);
    if ((boils(p) || p.exposure_path > 0.0) && model.phase.field != FieldKind::kCircularGaussian)
        throw Error(
            Status::kInvalidArgument,
            "boiling_correlation_frames and exposure_path need a phase with a circular Gaussian field");
    if (stages_.materials && (p.coherent_fraction > 0.0 || p.subsurface_fraction > 0.0))
        throw Error(Status::kInvalidArgument,
                    fmt::format("{} was given to a pipeline with a material table; set {} of the materials",
                                p.coherent_fraction > 0.0 ? "coherent_fraction" : "subsurface_fraction",
                                p.coherent_fraction > 0.0 ? "roughness_rms_m" : "subsurface_fraction"));
}

void Pipeline::apply_own(const PipelineModel &model) {
    const PipelineParameters &p = model.pipeline;
    const ExposureParameters exposure{p.exposure_path,       p.sub_exposures, p.exposure_correlation,
                                      model.phase.dynamics, p.line_count,    p.dephasing_rad};
    ExposureSteps steps = exposure_ == exposure              ? exposure_steps_
                          : options_.independent_exposures ? independent_exposures(exposure)
                                                           : exposure_steps(exposure);
    FieldParameters field;
    field.coherent_fraction = p.coherent_fraction;
    field.line_count = p.line_count;
    field.dephasing_rad = p.dephasing_rad;
    field.wavelength_m = model.aperture.wavelength_m;
    field.degree_of_polarization = model.aperture.degree_of_polarization;
    field.seed = p.seed;
    field.materials = stages_.materials;
    AirflowParameters air = p.airflow;
    air.seed = p.seed;
    // Air that stays as it is goes on as it was.
    const bool same_air = airflow_ && air == airflow_->parameters();
    std::unique_ptr<Airflow> airflow;
    if (p.airflow.rms_rad > 0.0 && !same_air)
        airflow = std::make_unique<Airflow>(context_, stages_.aperture->grid(), air);
    std::unique_ptr<Field> new_field;
    if (!field_ || field_->parameters() != field) {
        new_field = std::make_unique<Field>(context_, stages_.aperture->grid());
        new_field->configure(field);
    }
    if (new_field)
        field_ = std::move(new_field);
    parameters_ = p;
    exposure_ = exposure;
    exposure_steps_ = std::move(steps);
    if (!same_air)
        airflow_ = std::move(airflow);
    allocate();
}

void Pipeline::allocate() {
    const FieldGrid &grid = stages_.aperture->grid();
    const std::size_t pixels = std::size_t{grid.width} * grid.height;
    const auto image = [&](DeviceBuffer &buffer, bool needed, std::size_t bytes_per_pixel) {
        if (!needed)
            buffer = {};
        else if (!buffer)
            buffer = DeviceBuffer(context_, pixels * bytes_per_pixel);
    };
    const PipelineParameters &p = parameters_;
    const bool distorts = stages_.lens && stages_.lens->distorts();
    lens_distorts_ = distorts;
    lens_finishes_ = stages_.lens && stages_.lens->finishes();
    const bool makes_light = stages_.pattern || stages_.dots;
    bool material_subsurface = false;
    if (stages_.materials)
        for (const Material &material : stages_.materials->materials())
            material_subsurface |= material.subsurface_fraction > 0.0;
    if (material_subsurface && p.subsurface_length_px == 0.0)
        throw Error(
            Status::kInvalidArgument,
            "the material table has a subsurface_fraction, but the pipeline's subsurface_length_px is 0; set it "
            "above 0");
    const bool subsurface = p.subsurface_fraction > 0.0 || material_subsurface;
    // Where several fields are added, the ideal image cannot lie where the light is summed.
    const bool many_fields = p.line_count > 1 || exposure_steps_.count > 1 || p.shutter_fraction > 0.0 ||
                             stages_.materials || options_.keeps_irradiance;
    const bool own_light = has_own_effect(OwnEffectPoint::kIntensity);
    image(light_, makes_light || stages_.sensor || (stages_.lens && stages_.lens->finishes()) || own_light,
          sizeof(float));
    image(irradiance_, (makes_light && (many_fields || distorts)) || (subsurface && !distorts), sizeof(float));
    for (DeviceBuffer &pixels_of_own : own_pixels_)
        image(pixels_of_own, !own_effects_.empty(), sizeof(float));
    image(distorted_, distorts, sizeof(float));
    image(distorted_material_, distorts && stages_.materials, 1);
    image(distorted_path_, distorts && stages_.motion, sizeof(float));
    image(distorted_correlation_, distorts && stages_.motion, sizeof(float));
    image(distorted_shift_, distorts && stages_.motion, sizeof(cl_float2));
    image(distorted_mask_, distorts, 1);
    image(distorted_motion_mask_, distorts && stages_.motion, 1);
    image(subsurface_weight_, material_subsurface, sizeof(float));
    subsurface_on_ = subsurface;
    if (!subsurface && !options_.keeps_filters) {
        subsurface_.reset();
        subsurface_length_px_ = 0.0;
    }
    if (subsurface && subsurface_length_px_ != p.subsurface_length_px) {
        subsurface_ = std::make_unique<FftFilter>(context_, grid.width, grid.height,
                                                  exponential_guard_px(p.subsurface_length_px, grid.width, grid.height),
                                                  exponential_spread(p.subsurface_length_px));
        subsurface_length_px_ = p.subsurface_length_px;
    }
    if (material_subsurface) {
        std::vector<float> fractions;
        for (const Material &material : stages_.materials->materials())
            fractions.push_back(static_cast<float>(material.subsurface_fraction));
        subsurface_table_ = DeviceBuffer(context_, fractions.size() * sizeof(float), fractions.data());
        material_lookup_ = context_->kernel("stages/material.cl", "material_lookup");
    }
    dark_ =
        LazyKernel("stages/aperture.cl", "aperture_dark", "-DCOMPLEX_PUPIL=0 -DSHIFT=0 -DPIXEL_TAPS=0 -DACCUMULATE=0");
}

void Pipeline::keep_maps() {
    if (!stages_.sensor || base_)
        return;
    const SensorParameters &p = stages_.sensor->parameters();
    const auto keep = [&](KeptMap &kept, const float *map) {
        const std::size_t size = map ? std::size_t{p.width} * p.height : 0;
        if (size == kept.values.size() && std::equal(map, map + size, kept.values.begin()))
            return;
        kept.values.assign(map, map + size);
        kept.of_camera = false; // the sensor's owner has changed it
    };
    keep(dark_frame_, p.dark_frame_dn);
    keep(gain_map_, p.gain_map);
}

void Pipeline::use_model(const PipelineModel &wanted, unsigned parts) {
    check_own(wanted);
    const PipelineModel before = model();
    unsigned applied = 0;
    try {
        apply(wanted, parts, applied);
    } catch (...) {
        unsigned restored = 0;
        apply(before, applied, restored);
        throw;
    }
}

void Pipeline::configure(const PipelineModel &wanted) {
    use_model(wanted, changed_parts(model(), wanted));
}

void Pipeline::use_effects(Effects effects, std::optional<PixelMaps> maps) {
    keep_maps();
    PipelineModel base = base_ ? *base_ : model();
    PipelineModel before = with_effects(base, effects_);
    // What the host may have changed since: the exposure. What effects made of the one before is made anew.
    if (base.sensor)
        base.sensor->exposure_gain_dn = before.sensor->exposure_gain_dn =
            stages_.sensor->parameters().exposure_gain_dn;
    // A camera's maps come and go with it.
    const auto replaces = [&](const std::vector<float> &map, const KeptMap &kept) {
        return stages_.sensor && (!map.empty() || kept.of_camera);
    };
    const bool new_dark_frame = maps && replaces(maps->dark_frame_dn, dark_frame_);
    const bool new_gain_map = maps && replaces(maps->gain_map, gain_map_);
    const auto pointer = [](const std::vector<float> &map) { return map.empty() ? nullptr : map.data(); };
    if (new_dark_frame)
        base.sensor->dark_frame_dn = pointer(maps->dark_frame_dn);
    if (new_gain_map)
        base.sensor->gain_map = pointer(maps->gain_map);
    const PipelineModel with = with_effects(base, effects);
    // Stages whose effects stay as they were are left alone.
    use_model(with, changed_parts(before, with));
    // The base's pointers stay good: what is moved keeps its place.
    if (new_dark_frame)
        dark_frame_ = {std::move(maps->dark_frame_dn), true};
    if (new_gain_map)
        gain_map_ = {std::move(maps->gain_map), true};
    effects_ = std::move(effects);
    if (effects_.empty())
        base_.reset();
    else
        base_ = std::move(base);
}

void Pipeline::set_effect(const std::string &id, const double *values, std::uint32_t count) {
    const Effect &effect = find_effect(id);
    Effects effects = effects_;
    effects[id] = check_effect_values(effect, values, count);
    use_effects(std::move(effects));
}

void Pipeline::add_effects(Effects effects, const Effects &wanted, std::optional<PixelMaps> maps) {
    for (const auto &[id, values] : wanted)
        effects[id] =
            check_effect_values(find_effect(id), values.data(), static_cast<std::uint32_t>(values.size()));
    use_effects(std::move(effects), std::move(maps));
}

void Pipeline::set_effects(const Effects &wanted) {
    add_effects(effects_, wanted);
}

void Pipeline::set_camera(const Effects &wanted, PixelMaps maps) {
    keep_maps();
    const auto check = [](const std::vector<float> &map, const KeptMap &own, const char *name) {
        if (!map.empty() && !own.values.empty() && !own.of_camera && map != own.values)
            throw Error(
                Status::kInvalidArgument,
                fmt::format("the sensor has a {0} already, and the camera has another one; make the sensor without "
                            "{0}, or set the camera without its maps",
                            name));
    };
    check(maps.dark_frame_dn, dark_frame_, "dark_frame_dn");
    check(maps.gain_map, gain_map_, "gain_map");
    Effects effects = effects_;
    for (const std::string &id : maps.holds)
        effects.erase(id);
    add_effects(std::move(effects), wanted, std::move(maps));
}

void Pipeline::set_own_effect(const std::string &id, OwnEffectPoint point, OwnEffectStep step) {
    if (point == OwnEffectPoint::kCodes && !stages_.sensor)
        throw Error(
            Status::kInvalidArgument,
            fmt::format("the effect \"{}\" acts on codes, but this pipeline has no sensor; make it with one", id));
    const std::vector<OwnEffect> before = own_effects_;
    auto shared = std::make_shared<const OwnEffectStep>(std::move(step));
    own_effects_.erase(std::remove_if(own_effects_.begin(), own_effects_.end(),
                                      [&](const OwnEffect &own) { return own.id == id && own.point != point; }),
                       own_effects_.end());
    const auto found =
        std::find_if(own_effects_.begin(), own_effects_.end(), [&](const OwnEffect &own) { return own.id == id; });
    if (found != own_effects_.end())
        found->step = std::move(shared);
    else
        own_effects_.push_back({id, point, std::move(shared)});
    try {
        allocate();
    } catch (...) {
        own_effects_ = before;
        throw;
    }
}

void Pipeline::clear_effects() {
    use_effects({});
    own_effects_.clear();
    allocate();
}

void Pipeline::clear_effect(const std::string &id) {
    const auto own = std::find_if(own_effects_.begin(), own_effects_.end(),
                                  [&](const OwnEffect &effect) { return effect.id == id; });
    if (own != own_effects_.end()) {
        own_effects_.erase(own);
        allocate();
        return;
    }
    find_effect(id);
    Effects effects = effects_;
    effects.erase(id);
    use_effects(std::move(effects));
}

ImageView Pipeline::own_image(const DeviceBuffer &buffer, Format format) const {
    const FieldGrid &grid = stages_.aperture->grid();
    return check_image({buffer.get()(), 0, 0, grid.width, grid.height, format}, "image", context_->cl_context()(),
                       {grid.width, grid.height}, {format});
}

// The host's images of a frame, checked; those that a frame has not are empty.
struct Pipeline::Images {
    ImageView output, mask, material, irradiance;
    ImageView light; // what the lens and the sensor get; the output where there are neither
};

Pipeline::Images Pipeline::check_images(const Frame &frame) {
    const ::cl_context cl_context = context_->cl_context()();
    check_frame_index(frame.frame_index);
    if (exposure_steps_.independent && frame.frame_index >> kPatternShift)
        throw Error(Status::kInternal, "a number of a frame with independent exposures has more than 42 bits");
    stages_.aperture->check_workspace();
    if (stages_.lens && (stages_.lens->distorts() != lens_distorts_ || stages_.lens->finishes() != lens_finishes_))
        allocate(); // the lens was changed by its owner
    const FieldGrid &grid = stages_.aperture->grid();
    const ImageSize size{grid.width, grid.height};
    const bool laser = frame.illumination == Illumination::kLaser;
    Images images;
    images.output = stages_.sensor ? stages_.sensor->check_output(frame.output, laser && exposes_in_last_pass())
                                   : check_image(frame.output, "output", cl_context, size, {Format::kFloat32});
    check_writable(images.output, "output");
    stages_.aperture->refuse_workspace(images.output, "output");
    const auto input = [&](const ImageDescription &image, const char *name,
                           std::initializer_list<Format> formats) -> ImageView {
        const ImageView view = check_image(image, name, cl_context, size, formats);
        refuse_overlap(images.output, "output", view, name);
        stages_.aperture->refuse_workspace(view, name);
        return view;
    };
    if (frame.refresh_mask)
        images.mask = input(frame.refresh_mask, "refresh_mask", {Format::kUint8});
    images.light = stages_.sensor || finishes() || has_own_effect(OwnEffectPoint::kIntensity) ? own_image(light_)
                                                                                              : images.output;
    if (images.output.format == Format::kFloat32 && has_own_effect(OwnEffectPoint::kCodes))
        throw Error(Status::kInvalidFormat,
                    "output.format is float32, but an effect of your own acts on codes; use uint16, or uint8");
    // Surfaces move and live whatever the light.
    if (frame.motion && !stages_.motion)
        throw Error(Status::kInvalidArgument,
                    "motion was given to a pipeline without a motion stage; make the pipeline with one");
    if (frame.illumination == Illumination::kDark)
        return images;
    if (frame.illumination == Illumination::kIncoherent && !frame.irradiance)
        throw Error(
            Status::kInvalidArgument,
            "irradiance is missing; with incoherent illumination it is the light of the scene, whatever the "
            "pipeline's pattern or dots");
    if (laser && stages_.pattern) {
        if (!frame.geometry)
            throw Error(Status::kInvalidArgument,
                        "geometry is NULL; this pipeline has a pattern and needs the frame's geometry");
        for (const ImageDescription *image :
             {&frame.geometry->position, &frame.geometry->depth, &frame.geometry->normal, &frame.geometry->albedo,
              &frame.geometry->visibility})
            if (*image)
                refuse_overlap(images.output, "output",
                               check_image(*image, "geometry", cl_context, size,
                                           {Format::kFloat32, Format::kFloat32x3, Format::kFloat32x4, Format::kUint8}),
                               "an image of the geometry");
    } else if (laser && frame.geometry) {
        throw Error(Status::kInvalidArgument,
                    "geometry was given to a pipeline without a pattern; give irradiance, or make the "
                    "pipeline with a pattern");
    }
    if (laser && (stages_.pattern || stages_.dots)) {
        if (frame.irradiance)
            throw Error(Status::kInvalidArgument,
                        fmt::format("irradiance was given to a pipeline with {}; give {}, or make the "
                                    "pipeline without",
                                    stages_.pattern ? "a pattern" : "dots",
                                    stages_.pattern ? "geometry alone" : "no irradiance"));
        images.irradiance = irradiance_ ? own_image(irradiance_) : own_image(light_);
    } else {
        images.irradiance = input(frame.irradiance, "irradiance", {Format::kFloat32});
    }
    if (laser && stages_.materials) {
        if (!frame.material)
            throw Error(Status::kInvalidArgument,
                        "material is missing; this pipeline has a material table and needs each pixel's material id");
        images.material = input(frame.material, "material", {Format::kUint8});
    }
    return images;
}

bool Pipeline::distorts() const {
    return stages_.lens && stages_.lens->distorts();
}

bool Pipeline::finishes() const {
    return stages_.lens && stages_.lens->finishes();
}

bool Pipeline::has_own_effect(OwnEffectPoint point) const {
    return std::any_of(own_effects_.begin(), own_effects_.end(),
                       [&](const OwnEffect &own) { return own.point == point; });
}

ImageView Pipeline::plan_own_effects(FramePlan &plan, OwnEffectPoint point, const Frame &frame,
                                     const ImageView &image) {
    if (!has_own_effect(point))
        return image;
    const ApertureParameters &aperture = stages_.aperture->parameters();
    const OwnEffectFrame of{image.width,
                            image.height,
                            stages_.sensor ? stages_.sensor->parameters().bits : 0,
                            frame.frame_index,
                            parameters_.seed,
                            frame.illumination == Illumination::kDark,
                            stages_.pattern || stages_.dots,
                            aperture.pixel_pitch_m / (aperture.wavelength_m * stages_.aperture->relative_diameter()),
                            aperture.pixel_pitch_m,
                            aperture.wavelength_m};
    plan.add(frame_step::GatherPixels{&format_kernel(gather_, "own_effect_gather", image.format), context_.get(), image,
                                      own_pixels_[0].get()});
    std::size_t place = 0;
    for (const OwnEffect &own : own_effects_)
        if (own.point == point) {
            plan.add(frame_step::ApplyOwnEffect{own.step, own_pixels_[place].get(), own_pixels_[1 - place].get(), of});
            place = 1 - place;
        }
    return own_image(own_pixels_[place]);
}

void Pipeline::plan_scatter(FramePlan &plan, const ImageView &pixels, const ImageView &image) {
    const bool codes = image.format != Format::kFloat32;
    const float top = codes ? static_cast<float>((1u << stages_.sensor->parameters().bits) - 1) : 0.0f;
    plan.add(frame_step::ScatterPixels{&format_kernel(scatter_, "own_effect_scatter", image.format), context_.get(),
                                       cl::Buffer(pixels.mem, true), top, image});
}

bool Pipeline::exposes_in_last_pass() const {
    return stages_.sensor && !finishes() && !has_own_effect(OwnEffectPoint::kIntensity) &&
           stages_.aperture->exposes(*stages_.sensor);
}

ImageView Pipeline::plan_distortion(FramePlan &plan, const ImageView &image, const DeviceBuffer &distorted,
                                    Interpolation interpolation, bool adds_step) {
    if (!image || !distorts())
        return image;
    const ImageView out = own_image(distorted, image.format);
    if (adds_step)
        plan.add(frame_step::Distort{stages_.lens.get(), image, out, interpolation});
    return out;
}

PhaseAdvance Pipeline::plan_surface(FramePlan &plan, const Frame &frame, ImageView mask, bool fresh) {
    Phase *phase = stages_.phase.get();
    const PipelineParameters &p = parameters_;
    const std::uint64_t number = frame.frame_index;
    PhaseAdvance advance;
    if (frame.motion) {
        // Surfaces are of one material for all stages, unless the motion's input says otherwise.
        MotionInput input = *frame.motion;
        if (!input.material && stages_.motion->parameters().materials)
            input.material = frame.material;
        plan.add(frame_step::ComputeMotion{stages_.motion.get(), input});
        advance = stages_.motion->advance();
    }
    mask = plan_distortion(plan, mask, distorted_mask_, Interpolation::kNearest);
    advance.mask = plan_distortion(plan, advance.mask, distorted_motion_mask_, Interpolation::kNearest);
    advance.path = plan_distortion(plan, advance.path, distorted_path_, Interpolation::kNearest);
    advance.correlation =
        plan_distortion(plan, advance.correlation, distorted_correlation_, Interpolation::kNearest);
    if (advance.shift && distorts()) {
        const ImageView out = own_image(distorted_shift_, Format::kFloat32x2);
        plan.add(frame_step::DistortShift{stages_.lens.get(), advance.shift, out});
        advance.shift = out;
    }
    const bool lives = boils(p) && !fresh;
    if (fresh) {
        plan.add(frame_step::DrawPhase{phase, number, {}});
    } else if (frame.motion || lives) {
        if (mask && !advance.mask)
            advance.mask = mask;
        else if (mask)
            plan.add(frame_step::DrawPhase{phase, number, mask});
        if (lives && !advance.correlation)
            advance.uniform_correlation *= std::exp(-1.0 / p.boiling_correlation_frames);
        // The rest of the way is gone while the shutter is open.
        const std::uint32_t parts = blur_steps(p);
        if (advance.path && frame.illumination == Illumination::kLaser)
            advance.path_scale = 1.0 - p.shutter_fraction + p.shutter_fraction / parts;
        plan.add(frame_step::AdvancePhase{phase, number, advance});
        if (lives && advance.correlation) {
            PhaseAdvance boiling;
            boiling.uniform_correlation = std::exp(-1.0 / p.boiling_correlation_frames);
            boiling.substep = kMaxSubstep;
            plan.add(frame_step::AdvancePhase{phase, number, boiling});
        }
    } else if (mask) {
        plan.add(frame_step::DrawPhase{phase, number, mask});
    }
    return advance;
}

ImageView Pipeline::plan_subsurface(FramePlan &plan, const Frame &frame, const ImageView &irradiance,
                                    const ImageView &material) {
    if (!subsurface_on_)
        return irradiance;
    // The host's image stays as it is.
    const ImageView spread = irradiance_ && !distorted_ ? own_image(irradiance_) : irradiance;
    if (frame.keeps_irradiance)
        return spread;
    ImageView weight;
    if (subsurface_weight_) {
        plan.add(frame_step::LookUpMaterial{&material_lookup_, material,
                                            static_cast<cl_uint>(stages_.materials->materials().size()),
                                            subsurface_table_.get(), subsurface_weight_.get()});
        weight = own_image(subsurface_weight_);
    }
    plan.add(frame_step::Spread{subsurface_.get(), irradiance, spread, parameters_.subsurface_fraction, weight});
    return spread;
}

void Pipeline::plan_laser(FramePlan &plan, const Frame &frame, const Images &images, bool fresh) {
    Phase *phase = stages_.phase.get();
    const PipelineParameters &p = parameters_;
    if (stages_.pattern && !frame.keeps_irradiance)
        plan.add(frame_step::LookUpPattern{stages_.pattern.get(), *frame.geometry, images.irradiance});
    else if (stages_.dots && !frame.keeps_irradiance)
        plan.add(frame_step::RenderDots{stages_.dots.get(), images.irradiance});
    const PhaseAdvance advance = plan_surface(plan, frame, images.mask, fresh);
    // The lens shows geometry and light at the same distorted places; speckle arises behind it.
    const ImageView ideal = plan_own_effects(plan, OwnEffectPoint::kIrradiance, frame, images.irradiance);
    ImageView irradiance = plan_distortion(plan, ideal, distorted_, Interpolation::kCubic, !frame.keeps_irradiance);
    const ImageView material =
        plan_distortion(plan, images.material, distorted_material_, Interpolation::kNearest);
    irradiance = plan_subsurface(plan, frame, irradiance, material);

    const bool drawn_anew = frame.refresh == Refresh::kAll;
    Exposure exposure;
    exposure.field = field_.get();
    exposure.material = material;
    const double gain =
        std::max(0.0, 1.0 + p.power_flicker * host_normals(p.seed, frame.frame_index, kStreamFlicker)[0]);
    // What shakes or bends a still picture; in frames drawn anew nothing would show it. Those begin a scene of their
    // own.
    if (drawn_anew && airflow_)
        plan.add(frame_step::ResetAir{airflow_.get()});
    if (!drawn_anew && airflow_) {
        plan.add(frame_step::AdvanceAir{airflow_.get(), frame.frame_index});
        exposure.screen = &airflow_->screen();
    }
    if (!drawn_anew && p.vibration_rms_px > 0.0) {
        const auto shift = host_normals(p.seed, frame.frame_index, kStreamVibration);
        exposure.shift_x_px = p.vibration_rms_px * shift[0];
        exposure.shift_y_px = p.vibration_rms_px * shift[1];
        exposure.moves_image = true;
    }
    // Parts of an exposure: of the way that the surface goes, or of what a surface drawn anew does meanwhile.
    const ExposureSteps &steps = exposure_steps_;
    const bool blurred = p.shutter_fraction > 0.0 && advance.path && !fresh && !drawn_anew;
    const std::uint32_t count = blurred ? blur_steps(p) : drawn_anew ? steps.count : 1;
    const bool has_modes = drawn_anew && (count > 1 || steps.independent) && !steps.modes.empty();
    exposure.gain = gain / count;
    for (std::uint32_t i = 0; i < count; ++i) {
        if (has_modes) {
            exposure.gain = gain * steps.modes[i].weight;
            exposure.coherent_gain = steps.modes[i].coherent_gain;
        }
        if (!steps.lines.empty())
            exposure.lines = &steps.lines[i];
        if (i > 0 && steps.independent) {
            plan.add(frame_step::DrawPhase{phase, pattern_number(frame.frame_index, i), {}});
        } else if (i > 0) {
            PhaseAdvance step;
            if (blurred) {
                step.path = advance.path;
                step.path_scale = p.shutter_fraction / count;
                step.continues = true;
            } else {
                step.uniform_path = steps.path;
                step.uniform_correlation = steps.correlation;
            }
            step.substep = i;
            plan.add(frame_step::AdvancePhase{phase, frame.frame_index, step});
        }
        exposure.adds = i > 0;
        if (i + 1 == count && exposes_in_last_pass())
            exposure.exposed = {stages_.sensor.get(), frame.frame_index, images.output};
        plan.add(frame_step::Image{stages_.aperture.get(), phase, irradiance, images.light, exposure});
    }
}

void Pipeline::plan_frame(FramePlan &plan, const Frame &frame, bool fresh) {
    const Images images = check_images(frame);
    plan.clear();
    if (frame.illumination == Illumination::kLaser) {
        plan_laser(plan, frame, images, fresh);
    } else {
        plan_surface(plan, frame, images.mask, fresh);
        if (frame.illumination == Illumination::kIncoherent) {
            const ImageView ideal = plan_own_effects(plan, OwnEffectPoint::kIrradiance, frame, images.irradiance);
            const ImageView irradiance =
                plan_distortion(plan, ideal, distorted_, Interpolation::kCubic, !frame.keeps_irradiance);
            plan.add(frame_step::ImageIncoherent{stages_.aperture.get(), irradiance, images.light});
        } else {
            plan.add(frame_step::Darken{&dark_, context_.get(), images.light});
        }
    }
    ImageView light = images.light;
    const bool own_light = has_own_effect(OwnEffectPoint::kIntensity);
    if (finishes()) {
        const ImageView out = stages_.sensor || own_light ? light : images.output;
        plan.add(frame_step::FinishLens{stages_.lens.get(), light, out, frame.illumination == Illumination::kDark});
        light = out;
    }
    if (own_light && frame.illumination != Illumination::kDark)
        light = plan_own_effects(plan, OwnEffectPoint::kIntensity, frame, light);
    if (own_light && !stages_.sensor)
        plan_scatter(plan, light, images.output);
    if (stages_.sensor && !(frame.illumination == Illumination::kLaser && exposes_in_last_pass()))
        plan.add(frame_step::Expose{stages_.sensor.get(), light, frame.frame_index, images.output});
    if (has_own_effect(OwnEffectPoint::kCodes))
        plan_scatter(plan, plan_own_effects(plan, OwnEffectPoint::kCodes, frame, images.output), images.output);
}

void Pipeline::enqueue_frames(cl_command_queue queue, const Frame *frames, std::size_t count, cl_uint num_waits,
                              const cl_event *waits, cl_event *event) {
    // Everything that can be checked is checked before the first command, so that a refused frame changes nothing.
    if (half_moved_ && count > 0) {
        if (frames[0].refresh != Refresh::kAll)
            throw Error(
                Status::kInvalidState,
                "an earlier frame failed after it had begun to move surface, air or lag, so that a frame now would "
                "be neither the same nor the next; begin anew with a frame that refreshes all");
        if (airflow_)
            airflow_->reset();
        if (lag_lost_ && stages_.sensor)
            stages_.sensor->reset_lag();
    }
    context_->check_queue(queue);
    check_wait_list(context_->cl_context()(), num_waits, waits);
    plans_.resize(std::max(plans_.size(), count));
    bool drawn = stages_.phase->refreshed();
    for (std::size_t i = 0; i < count; ++i)
        try {
            if (!drawn)
                plan_frame(plans_[i], frames[i], false); // builds what the frames after this one will need
            plan_frame(plans_[i], frames[i], !drawn || frames[i].refresh == Refresh::kAll);
            drawn = true;
        } catch (const Error &error) {
            if (count == 1)
                throw;
            throw Error(error.status(), fmt::format("frames[{}]: {}", i, error.what()), error.opencl_code(),
                        error.build_log());
        }

    CommandChain chain(queue, num_waits, waits, &next_profile_);
    bool moved = false;
    try {
        for (std::size_t i = 0; i < count; ++i) {
            next_profile_.entries.clear();
            plans_[i].enqueue(chain, moved);
            if (i + 1 == count) {
                chain.finish(event);
            } else if (stages_.sensor && stages_.sensor->lags()) {
                // Two frames after a frame the sensor has it no longer.
                lag_lost_ = moved = true;
            }
            if (stages_.sensor)
                stages_.sensor->keep_frame();
            // Only now is it the last frame: a refused one leaves the times of the one before.
            std::swap(profile_, next_profile_);
            has_frame_ = true;
        }
        half_moved_ = lag_lost_ = false;
    } catch (...) {
        half_moved_ = half_moved_ || moved;
        throw;
    }
}

void Pipeline::warm_up(cl_command_queue queue, const Frame &frame) {
    Phase &phase = *stages_.phase;
    context_->check_queue(queue);
    if (!phase.refreshed()) {
        enqueue_frame(queue, frame, 0, nullptr, nullptr);
        check_opencl(clFinish(queue), "clFinish");
        forget();
        return;
    }
    const Phase::Origin origin = phase.origin();
    const DeviceBuffer saved(context_, phase.state_bytes());
    CommandChain save(queue, 0, nullptr);
    phase.enqueue_save(save, saved.get()(), 0);
    check_opencl(clFinish(queue), "clFinish");
    const bool half_moved = half_moved_;
    const auto restore = [&] {
        half_moved_ = lag_lost_ = true; // until it is done
        CommandChain chain(queue, 0, nullptr);
        phase.enqueue_restore(chain, saved.get()(), 0);
        phase.set_origin(origin);
        check_opencl(clFinish(queue), "clFinish");
        forget_frames();
        half_moved_ = half_moved;
        lag_lost_ = false;
    };
    try {
        enqueue_frame(queue, frame, 0, nullptr, nullptr);
        check_opencl(clFinish(queue), "clFinish");
    } catch (...) {
        restore();
        throw;
    }
    restore();
}

void Pipeline::forget() {
    stages_.phase->forget();
    forget_frames();
    half_moved_ = lag_lost_ = false;
}

void Pipeline::forget_frames() {
    if (stages_.sensor)
        stages_.sensor->reset_lag();
    if (airflow_)
        airflow_->reset();
}

void Pipeline::check(cl_command_queue queue) {
    context_->check_queue(queue);
    check_opencl(clFinish(queue), "clFinish");
    std::string message;
    const auto report = [&](const BadPixels &bad, const char *what) {
        if (bad.not_finite == 0 && bad.negative == 0)
            return;
        const std::uint32_t width = stages_.aperture->grid().width;
        message += fmt::format("{}{}: {} NaN or infinite and {} negative pixels since the last check, the first at x = "
                               "{}, y = {}; they were "
                               "taken as 0",
                               message.empty() ? "" : "; ", what, bad.not_finite, bad.negative, bad.first_index % width,
                               bad.first_index / width);
    };
    const auto report_as = [&](const BadPixels &bad, const char *what, const char *fault, const char *taken) {
        if (bad.not_finite == 0 && bad.negative == 0)
            return;
        const std::uint32_t width = stages_.aperture->grid().width;
        message += fmt::format("{}{}: {} pixels {} since the last check, the first at x = {}, y = {}; they were {}",
                               message.empty() ? "" : "; ", what, bad.not_finite + bad.negative, fault,
                               bad.first_index % width, bad.first_index / width, taken);
    };
    if (stages_.pattern)
        report(stages_.pattern->bad_pixels().take(queue), "albedo or visibility");
    report(stages_.aperture->bad_pixels().take(queue), "irradiance");
    report_as(stages_.phase->bad_pixels().take(queue), "path, correlation or shift", "NaN or out of range", "replaced");
    report_as(field_->bad_materials().take(queue), "material", "with ids outside the table",
              "given the first material");
    if (stages_.motion) {
        report_as(stages_.motion->bad_pixels().take(queue), "motion", "NaN", "taken as moved");
        report_as(stages_.motion->bad_materials().take(queue), "the motion's material", "with ids outside the table",
                  "given the first material");
    }
    if (!message.empty())
        throw Error(Status::kInvalidData, message);
}

std::vector<StageTiming> Pipeline::timings() {
    if (!has_frame_)
        throw Error(Status::kInvalidState, "no frame has been enqueued yet");
    if (profile_.entries.empty())
        throw Error(Status::kInvalidState,
                    "the last frame's queue had no profiling; make one with profiling (in OpenCL "
                    "CL_QUEUE_PROFILING_ENABLE)");
    wait_for_events(1, &profile_.entries.back().event());
    std::vector<StageTiming> timings;
    cl_ulong previous_end = 0;
    for (const ChainProfile::Entry &entry : profile_.entries) {
        const cl_ulong end = entry.event.getProfilingInfo<CL_PROFILING_COMMAND_END>();
        const cl_ulong own_start = entry.event.getProfilingInfo<CL_PROFILING_COMMAND_START>();
        // A transform is several kernels of which we see the last one's event: its time runs from the end of the step
        // before.
        const std::string stage = entry.stage;
        const bool is_transform = stage == "fft" || stage == "inverse_fft";
        const cl_ulong start = is_transform && previous_end != 0 ? std::min(previous_end, own_start) : own_start;
        const auto same = [&](const StageTiming &timing) { return timing.stage == stage; };
        auto found = std::find_if(timings.begin(), timings.end(), same);
        if (found == timings.end())
            found = timings.insert(timings.end(), {stage, 0.0});
        found->milliseconds += double(end - start) * 1e-6;
        previous_end = end;
    }
    return timings;
}

} // namespace clsp

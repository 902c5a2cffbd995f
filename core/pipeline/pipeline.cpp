#include "pipeline/pipeline.hpp"

#include "effects/effects.hpp"
#include "runtime/checks.hpp"
#include "runtime/error.hpp"
#include "runtime/kernel_arguments.hpp"
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
    if (p.exposure_correlation != ExposureCorrelation::kField &&
        p.exposure_correlation != ExposureCorrelation::kGaussian)
        throw Error(Status::kInvalidArgument,
                    fmt::format("exposure_correlation is {}, it must be 0 (CLSP_EXPOSURE_CORRELATION_FIELD) or 1 "
                                "(CLSP_EXPOSURE_CORRELATION_GAUSSIAN)",
                                static_cast<std::uint32_t>(p.exposure_correlation)));
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

} // namespace

Pipeline::Pipeline(std::shared_ptr<Context> context, PipelineStages stages, const PipelineParameters &parameters)
    : context_(std::move(context)), stages_(std::move(stages)), parameters_(parameters) {
    check_stages();
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
                        "motion has the rule CLSP_MOTION_CORRELATE, which needs a phase with dynamics "
                        "CLSP_DYNAMICS_CONTINUOUS; or make the motion with CLSP_MOTION_REPLACE");
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
        if (!dark_frame_.empty())
            model.sensor->dark_frame_dn = dark_frame_.data();
    }
    return model;
}

void Pipeline::apply_stages(const PipelineModel &model, unsigned sets, unsigned &applied) {
    const auto apply = [&](unsigned part, auto configure) {
        if (!(sets & part))
            return;
        configure();
        applied |= part;
    };
    apply(kSetsPhase, [&] { stages_.phase->configure(model.phase); });
    apply(kSetsAperture, [&] { stages_.aperture->configure(model.aperture); });
    apply(kSetsLens, [&] {
        if (stages_.lens)
            stages_.lens->configure(model.lens);
        else
            stages_.lens = std::make_shared<Lens>(context_, model.lens);
    });
    apply(kSetsDots, [&] { stages_.dots->configure(*model.dots); });
    apply(kSetsSensor, [&] { stages_.sensor->configure(*model.sensor); });
}

void Pipeline::apply_own(const PipelineModel &model) {
    const PipelineParameters &p = model.pipeline;
    check_parameters(p);
    const ExposureSteps steps =
        exposure_steps(p.exposure_path, p.sub_exposures, model.phase.dynamics, p.exposure_correlation);
    if ((boils(p) || p.exposure_path > 0.0) && model.phase.field != FieldKind::kCircularGaussian)
        throw Error(
            Status::kInvalidArgument,
            "boiling_correlation_frames and exposure_path need a phase with field CLSP_FIELD_CIRCULAR_GAUSSIAN");
    if (stages_.materials && (p.coherent_fraction > 0.0 || p.subsurface_fraction > 0.0))
        throw Error(Status::kInvalidArgument,
                    fmt::format("{} was given to a pipeline with a material table; set {} of the materials",
                                p.coherent_fraction > 0.0 ? "coherent_fraction" : "subsurface_fraction",
                                p.coherent_fraction > 0.0 ? "roughness_rms_m" : "subsurface_fraction"));
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
    auto new_field = std::make_unique<Field>(context_, stages_.aperture->grid());
    new_field->configure(field);
    field_ = std::move(new_field);
    parameters_ = p;
    exposure_steps_ = steps;
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
    const bool many_fields =
        p.line_count > 1 || exposure_steps_.count > 1 || p.shutter_fraction > 0.0 || stages_.materials;
    image(light_, makes_light || stages_.sensor || (stages_.lens && stages_.lens->finishes()), sizeof(float));
    image(irradiance_, (makes_light && (many_fields || distorts)) || (subsurface && !distorts), sizeof(float));
    image(distorted_, distorts, sizeof(float));
    image(distorted_material_, distorts && stages_.materials, 1);
    image(distorted_path_, distorts && stages_.motion, sizeof(float));
    image(distorted_correlation_, distorts && stages_.motion, sizeof(float));
    image(distorted_shift_, distorts && stages_.motion, sizeof(cl_float2));
    image(distorted_mask_, distorts, 1);
    image(distorted_motion_mask_, distorts && stages_.motion, 1);
    image(subsurface_weight_, material_subsurface, sizeof(float));
    subsurface_.reset();
    if (subsurface) {
        if (!filter_workspace_)
            filter_workspace_ = std::make_shared<FilterWorkspace>(context_);
        subsurface_ = std::make_unique<FftFilter>(context_, grid.width, grid.height,
                                                  exponential_guard_px(p.subsurface_length_px, grid.width, grid.height),
                                                  exponential_spread(p.subsurface_length_px), filter_workspace_);
    }
    if (material_subsurface) {
        std::vector<float> fractions;
        for (const Material &material : stages_.materials->materials())
            fractions.push_back(static_cast<float>(material.subsurface_fraction));
        subsurface_table_ = DeviceBuffer(context_, fractions.size() * sizeof(float), fractions.data());
        material_lookup_ = context_->kernel("stages/material.cl", "material_lookup");
    }
    dark_ = LazyKernel("stages/aperture.cl", "aperture_dark", "-DCOMPLEX_PUPIL=0 -DSHIFT=0 -DPIXEL_TAPS=0 -DACCUMULATE=0");
}

void Pipeline::keep_dark_frame() {
    if (!stages_.sensor || !dark_frame_.empty())
        return;
    const SensorParameters &p = stages_.sensor->parameters();
    if (p.dark_frame_dn)
        dark_frame_.assign(p.dark_frame_dn, p.dark_frame_dn + std::size_t{p.width} * p.height);
}

void Pipeline::use_effects(Effects effects) {
    keep_dark_frame();
    const PipelineModel before = model();
    PipelineModel base = base_ ? *base_ : before;
    // What the host may have changed since: the exposure.
    if (base.sensor)
        base.sensor->exposure_gain_dn = before.sensor->exposure_gain_dn;
    PipelineModel with = base;
    unsigned sets = 0;
    // In the catalogue's order, whatever the order of the calls. Stages whose effects stay as they were are left alone.
    for (const Effect &effect : effect_catalogue()) {
        const auto old = effects_.find(effect.id), now = effects.find(effect.id);
        if (now != effects.end())
            effect.apply(with, now->second.data());
        if ((old == effects_.end()) != (now == effects.end()) || (now != effects.end() && old->second != now->second))
            sets |= effect.sets;
    }
    unsigned applied = 0;
    try {
        apply_stages(with, sets, applied);
        apply_own(with);
    } catch (...) {
        unsigned restored = 0;
        apply_stages(before, applied, restored);
        apply_own(before);
        throw;
    }
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

void Pipeline::clear_effect(const std::string &id) {
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

// The images of a frame, checked; those that a frame has not are empty.
struct Pipeline::Checked {
    ImageView output, mask, material, irradiance;
    ImageView light; // what the lens and the sensor get; the output where there are neither
};

Pipeline::Checked Pipeline::check_frame(const Frame &frame) {
    const ::cl_context cl_context = context_->cl_context()();
    check_frame_index(frame.frame_index);
    stages_.aperture->check_workspace();
    if (stages_.lens && (stages_.lens->distorts() != lens_distorts_ || stages_.lens->finishes() != lens_finishes_))
        allocate(); // the lens was changed by its owner
    const FieldGrid &grid = stages_.aperture->grid();
    const ImageSize size{grid.width, grid.height};
    if (frame.refresh != Refresh::kMask && frame.refresh != Refresh::kAll)
        throw Error(Status::kInvalidArgument,
                    fmt::format("refresh is {}, expected CLSP_REFRESH_MASK or CLSP_REFRESH_ALL",
                                static_cast<std::uint32_t>(frame.refresh)));
    if (frame.illumination > Illumination::kDark)
        throw Error(Status::kInvalidArgument,
                    fmt::format("illumination is {}, expected CLSP_ILLUMINATION_LASER, _INCOHERENT or _DARK",
                                static_cast<std::uint32_t>(frame.illumination)));
    const bool laser = frame.illumination == Illumination::kLaser;
    Checked images;
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
    if (stages_.sensor || (stages_.lens && stages_.lens->finishes()))
        images.light = own_image(light_);
    else
        images.light = images.output;

    // Surfaces move and live whatever the light.
    if (frame.motion) {
        if (!stages_.motion)
            throw Error(Status::kInvalidArgument,
                        "motion was given to a pipeline without a motion stage; make the pipeline with one");
        stages_.motion->check(*frame.motion);
        const PhaseAdvance advance = stages_.motion->advance();
        if (stages_.lens && stages_.lens->distorts()) {
            const auto check_distort = [&](const ImageView &image, const DeviceBuffer &buffer) {
                if (image)
                    stages_.lens->check_distort(image, own_image(buffer, image.format), Interpolation::kNearest);
            };
            check_distort(advance.mask, distorted_motion_mask_);
            check_distort(advance.path, distorted_path_);
            check_distort(advance.correlation, distorted_correlation_);
            if (advance.shift)
                stages_.lens->check_distort_shift(advance.shift, own_image(distorted_shift_, Format::kFloat32x2));
        }
    }
    prepare_advances(frame, images);
    if (images.mask && stages_.lens && stages_.lens->distorts())
        stages_.lens->check_distort(images.mask, own_image(distorted_mask_, Format::kUint8), Interpolation::kNearest);
    if (images.mask)
        stages_.phase->prepare_masked_refresh();
    if (frame.illumination == Illumination::kDark) {
        dark_.get(*context_);
        return images;
    }
    if (frame.illumination == Illumination::kIncoherent)
        stages_.aperture->prepare_incoherent();
    if (frame.illumination == Illumination::kIncoherent && !frame.irradiance)
        throw Error(
            Status::kInvalidArgument,
            "irradiance is missing; with CLSP_ILLUMINATION_INCOHERENT it is the light of the scene, whatever the "
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
    if (stages_.lens && stages_.lens->distorts())
        stages_.lens->check_distort(images.irradiance, own_image(distorted_), Interpolation::kCubic);
    if (!laser)
        return images;
    if (stages_.materials) {
        if (!frame.material)
            throw Error(Status::kInvalidArgument,
                        "material is missing; this pipeline has a material table and needs each pixel's material id");
        images.material = input(frame.material, "material", {Format::kUint8});
    }
    if (stages_.lens && stages_.lens->distorts()) {
        if (images.material)
            stages_.lens->check_distort(images.material, own_image(distorted_material_, Format::kUint8),
                                        Interpolation::kNearest);
    }
    // As in enqueue_laser().
    const bool drawn_anew = frame.refresh == Refresh::kAll;
    Exposure exposure;
    exposure.field = field_.get();
    stages_.aperture->check_phase(*stages_.phase, field_.get());
    exposure.screen = airflow_ && !drawn_anew ? &airflow_->screen() : nullptr;
    exposure.moves_image = parameters_.vibration_rms_px > 0.0 && !drawn_anew;
    exposure.adds = exposures_of(frame, drawn_anew) > 1;
    if (exposes_in_last_pass())
        exposure.exposed = {stages_.sensor.get(), frame.frame_index, images.output};
    stages_.aperture->prepare(*stages_.phase, exposure);
    return images;
}

bool Pipeline::blurs(const Frame &frame) const {
    return parameters_.shutter_fraction > 0.0 && frame.motion && stages_.motion->advance().path;
}

std::uint32_t Pipeline::exposures_of(const Frame &frame, bool fresh) const {
    if (blurs(frame) && !fresh)
        return blur_steps(parameters_);
    return frame.refresh == Refresh::kAll ? exposure_steps_.count : 1;
}

void Pipeline::prepare_advances(const Frame &frame, const Checked &images) {
    Phase &phase = *stages_.phase;
    const double boiling = std::exp(-1.0 / parameters_.boiling_correlation_frames);
    if (frame.motion || boils(parameters_)) {
        PhaseAdvance advance = frame.motion ? stages_.motion->advance() : PhaseAdvance{};
        if (!advance.mask)
            advance.mask = images.mask;
        if (boils(parameters_) && !advance.correlation)
            advance.uniform_correlation *= boiling;
        phase.check_advance(advance);
        if (boils(parameters_) && advance.correlation) {
            PhaseAdvance more;
            more.uniform_correlation = boiling;
            phase.check_advance(more);
        }
    }
    if (frame.illumination != Illumination::kLaser)
        return;
    PhaseAdvance step;
    if (frame.refresh != Refresh::kAll && blurs(frame) && blur_steps(parameters_) > 1) {
        step.path = stages_.motion->advance().path;
        phase.check_advance(step);
    } else if (frame.refresh == Refresh::kAll && exposure_steps_.count > 1) {
        step.uniform_path = exposure_steps_.path;
        step.uniform_correlation = exposure_steps_.correlation;
        phase.check_advance(step);
    }
}

bool Pipeline::exposes_in_last_pass() const {
    return stages_.sensor && !(stages_.lens && stages_.lens->finishes()) && stages_.aperture->exposes(*stages_.sensor);
}

struct Pipeline::Surface {
    PhaseAdvance advance; // of this frame
    bool fresh = false;   // all of it was drawn anew
};

Pipeline::Surface Pipeline::enqueue_surface(CommandChain &chain, const Frame &frame, const Checked &images) {
    Phase &phase = *stages_.phase;
    const PipelineParameters &p = parameters_;
    ImageView mask = images.mask;
    Surface surface;
    PhaseAdvance &advance = surface.advance;
    if (frame.motion)
        advance = stages_.motion->enqueue_compute(chain, *frame.motion);
    if (stages_.lens && stages_.lens->distorts()) {
        const auto distort = [&](ImageView &image, const DeviceBuffer &buffer) {
            if (!image)
                return;
            const ImageView out = own_image(buffer, image.format);
            stages_.lens->enqueue_distort(chain, image, out, Interpolation::kNearest);
            image = out;
        };
        distort(mask, distorted_mask_);
        distort(advance.mask, distorted_motion_mask_);
        distort(advance.path, distorted_path_);
        distort(advance.correlation, distorted_correlation_);
        if (advance.shift) {
            const ImageView out = own_image(distorted_shift_, Format::kFloat32x2);
            stages_.lens->enqueue_distort_shift(chain, advance.shift, out);
            advance.shift = out;
        }
    }
    surface.fresh = frame.refresh == Refresh::kAll || !phase.refreshed();
    const bool lives = boils(p) && !surface.fresh;
    if (surface.fresh) {
        phase.enqueue_refresh(chain, frame.frame_index, {});
    } else if (frame.motion || lives) {
        if (mask && !advance.mask)
            advance.mask = mask;
        else if (mask)
            phase.enqueue_refresh(chain, frame.frame_index, mask);
        if (lives && !advance.correlation)
            advance.uniform_correlation *= std::exp(-1.0 / p.boiling_correlation_frames);
        // The rest of the way is gone while the shutter is open.
        const std::uint32_t parts = blur_steps(p);
        if (advance.path && frame.illumination == Illumination::kLaser)
            advance.path_scale = 1.0 - p.shutter_fraction + p.shutter_fraction / parts;
        phase.enqueue_advance(chain, frame.frame_index, advance);
        if (lives && advance.correlation) {
            PhaseAdvance boiling;
            boiling.uniform_correlation = std::exp(-1.0 / p.boiling_correlation_frames);
            boiling.substep = kMaxSubstep;
            phase.enqueue_advance(chain, frame.frame_index, boiling);
        }
    } else if (mask) {
        phase.enqueue_refresh(chain, frame.frame_index, mask);
    }
    return surface;
}

void Pipeline::enqueue_laser(CommandChain &chain, const Frame &frame, const Checked &images) {
    Phase &phase = *stages_.phase;
    const PipelineParameters &p = parameters_;
    const FieldGrid &grid = stages_.aperture->grid();
    ImageView irradiance = images.irradiance, material = images.material;
    if (stages_.pattern)
        stages_.pattern->enqueue_lookup(chain, *frame.geometry, irradiance);
    else if (stages_.dots)
        stages_.dots->enqueue_render(chain, irradiance);
    const Surface surface = enqueue_surface(chain, frame, images);
    // The lens shows geometry and light at the same distorted places; speckle arises behind it.
    if (stages_.lens && stages_.lens->distorts()) {
        const ImageView out = own_image(distorted_);
        stages_.lens->enqueue_distort(chain, irradiance, out, Interpolation::kCubic);
        irradiance = out;
        if (material) {
            const ImageView ids = own_image(distorted_material_, Format::kUint8);
            stages_.lens->enqueue_distort(chain, material, ids, Interpolation::kNearest);
            material = ids;
        }
    }

    if (subsurface_) {
        ImageView weight;
        if (subsurface_weight_) {
            KernelArguments(material_lookup_)
                .add(material)
                .add(static_cast<cl_uint>(stages_.materials->materials().size()))
                .add(subsurface_table_.get())
                .add(subsurface_weight_.get())
                .add(cl_uint{grid.width})
                .add(cl_uint{grid.height});
            chain.run("subsurface", material_lookup_, grid.width, grid.height);
            weight = own_image(subsurface_weight_);
        }
        // The host's image stays as it is.
        const ImageView spread = irradiance_ && !distorted_ ? own_image(irradiance_) : irradiance;
        subsurface_->enqueue(chain, "subsurface", irradiance, spread, p.subsurface_fraction, weight);
        irradiance = spread;
    }

    const bool blurred = blurs(frame) && !surface.fresh;
    const std::uint32_t count = exposures_of(frame, surface.fresh);
    Exposure exposure;
    exposure.field = field_.get();
    exposure.material = material;
    exposure.gain = std::max(0.0, 1.0 + p.power_flicker * host_normals(p.seed, frame.frame_index, kStreamFlicker)[0]);
    // What shakes or bends a still picture; in frames drawn anew nothing would show it. Those begin a scene of their
    // own.
    if (frame.refresh == Refresh::kAll) {
        if (airflow_)
            airflow_->reset();
    } else {
        if (airflow_) {
            airflow_->enqueue_advance(chain, frame.frame_index);
            exposure.screen = &airflow_->screen();
        }
        if (p.vibration_rms_px > 0.0) {
            const auto shift = host_normals(p.seed, frame.frame_index, kStreamVibration);
            exposure.shift_x_px = p.vibration_rms_px * shift[0];
            exposure.shift_y_px = p.vibration_rms_px * shift[1];
            exposure.moves_image = true;
        }
    }
    const double gain = exposure.gain;
    exposure.gain = gain / count;
    const bool has_modes = !blurred && count > 1 && !exposure_steps_.modes.empty();
    for (std::uint32_t i = 0; i < count; ++i) {
        if (has_modes) {
            exposure.gain = gain * exposure_steps_.modes[i].weight;
            exposure.coherent_gain = exposure_steps_.modes[i].coherent_gain;
        }
        if (i > 0) {
            PhaseAdvance step;
            if (blurred) {
                step.path = surface.advance.path;
                step.path_scale = p.shutter_fraction / count;
                step.continues = true;
            } else {
                step.uniform_path = exposure_steps_.path;
                step.uniform_correlation = exposure_steps_.correlation;
            }
            step.substep = i;
            phase.enqueue_advance(chain, frame.frame_index, step);
            exposure.adds = true;
        }
        if (i + 1 == count && exposes_in_last_pass())
            exposure.exposed = {stages_.sensor.get(), frame.frame_index, images.output};
        stages_.aperture->enqueue_intensity(chain, phase, irradiance, images.light, exposure);
    }
}

void Pipeline::enqueue_checked(CommandChain &chain, const Frame &frame, const Checked &images) {
    const FieldGrid &grid = stages_.aperture->grid();
    if (frame.illumination == Illumination::kLaser) {
        enqueue_laser(chain, frame, images);
    } else if (frame.illumination == Illumination::kIncoherent) {
        enqueue_surface(chain, frame, images);
        ImageView irradiance = images.irradiance;
        if (stages_.lens && stages_.lens->distorts()) {
            irradiance = own_image(distorted_);
            stages_.lens->enqueue_distort(chain, images.irradiance, irradiance, Interpolation::kCubic);
        }
        stages_.aperture->enqueue_incoherent(chain, irradiance, images.light);
    } else {
        enqueue_surface(chain, frame, images);
        cl::Kernel &dark = dark_.get(*context_);
        KernelArguments(dark).add(images.light).add(cl_uint{grid.width}).add(cl_uint{grid.height});
        chain.run("intensity", dark, grid.width, grid.height);
    }
    ImageView light = images.light;
    if (stages_.lens && stages_.lens->finishes()) {
        const ImageView out = stages_.sensor ? light : images.output;
        stages_.lens->enqueue_finish(chain, light, out, frame.illumination == Illumination::kDark);
        light = out;
    }
    if (stages_.sensor && !(frame.illumination == Illumination::kLaser && exposes_in_last_pass()))
        stages_.sensor->enqueue_expose(chain, light, frame.frame_index, images.output);
}

void Pipeline::enqueue_frames(cl_command_queue queue, const Frame *given, std::size_t count, cl_uint num_waits,
                              const cl_event *waits, cl_event *event) {
    // Surfaces are of one material for all stages, unless the motion's input says otherwise.
    const auto completed = [&](const Frame &frame, MotionInput &motion) {
        Frame full = frame;
        if (frame.motion && !frame.motion->material && stages_.motion && stages_.motion->parameters().materials) {
            motion = *frame.motion;
            motion.material = frame.material;
            full.motion = &motion;
        }
        return full;
    };
    // Everything that can be checked is checked before the first command, so that a refused frame changes nothing.
    context_->check_queue(queue);
    check_wait_list(context_->cl_context()(), num_waits, waits);
    MotionInput motion;
    std::vector<Checked> images;
    images.reserve(count);
    for (std::size_t i = 0; i < count; ++i)
        try {
            images.push_back(check_frame(completed(given[i], motion)));
        } catch (const Error &error) {
            if (count == 1)
                throw;
            throw Error(error.status(), fmt::format("frames[{}]: {}", i, error.what()), error.opencl_code(),
                        error.build_log());
        }

    CommandChain chain(queue, num_waits, waits, &next_profile_);
    for (std::size_t i = 0; i < count; ++i) {
        next_profile_.entries.clear();
        enqueue_checked(chain, completed(given[i], motion), images[i]);
        if (i + 1 == count)
            chain.finish(event);
        // Only now is it the last frame: a refused one leaves the times of the one before.
        std::swap(profile_, next_profile_);
        has_frame_ = true;
    }
}

void Pipeline::warm_up(cl_command_queue queue, const Frame &frame) {
    Phase &phase = *stages_.phase;
    context_->check_queue(queue);
    if (!phase.refreshed()) {
        enqueue_frame(queue, frame, 0, nullptr, nullptr);
        check_opencl(clFinish(queue), "clFinish");
        phase.forget();
        forget_frames();
        return;
    }
    const std::uint64_t epoch = phase.epoch();
    const DeviceBuffer saved(context_, phase.state_bytes());
    CommandChain save(queue, 0, nullptr);
    phase.enqueue_save(save, saved.get()(), 0);
    check_opencl(clFinish(queue), "clFinish");
    const auto restore = [&] {
        CommandChain chain(queue, 0, nullptr);
        phase.enqueue_restore(chain, saved.get()(), 0);
        phase.set_epoch(epoch);
        check_opencl(clFinish(queue), "clFinish");
    };
    try {
        enqueue_frame(queue, frame, 0, nullptr, nullptr);
        check_opencl(clFinish(queue), "clFinish");
    } catch (...) {
        restore();
        throw;
    }
    restore();
    forget_frames();
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
                    "the last frame's queue had no profiling; make it with CLSP_QUEUE_PROFILING or "
                    "CL_QUEUE_PROFILING_ENABLE");
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

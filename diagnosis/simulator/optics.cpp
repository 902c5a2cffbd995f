#include "simulator/optics.hpp"

#include "runtime/error.hpp"
#include "runtime/kernel_arguments.hpp"
#include "stages/philox.hpp"

#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

namespace clsp {
namespace {

// By fewer lines of the laser: of the squared contrast of the whole exposure, to which a weak pattern adds little.
constexpr double kLineError = 1e-3;

bool same_pupil(const ApertureParameters &a, const ApertureParameters &b) {
    const auto key = [](const ApertureParameters &p) {
        return std::tuple(p.f_number, p.pixel_pitch_m, p.wavelength_m, p.degree_of_polarization, p.fill_factor,
                          p.pupil.defocus_waves, p.pupil.obstruction_ratio);
    };
    return key(a) == key(b);
}

bool same_dots(const DotsParameters &a, const DotsParameters &b) {
    const auto key = [](const DotsParameters &p) {
        return std::tuple(p.sigma_px, p.relative_wavelength_shift, p.beam_skew, p.beam_skew_angle_rad, p.beam_flatness,
                          p.zero_order_relative_intensity, p.ghost_relative_intensity, p.ghost_direction,
                          p.scatter_fraction);
    };
    return key(a) == key(b);
}

} // namespace

Optics::Optics(std::shared_ptr<Context> context, const CaptureLayout &layout)
    : context_(std::move(context)), layout_(layout), pixels_(layout.pixel_count()),
      filter_workspace_(std::make_shared<FilterWorkspace>(context_)), irradiance_(context_, pixels_ * sizeof(float)) {
    const std::vector<float> ones(pixels_, 1.0f);
    uniform_ = DeviceBuffer(context_, pixels_ * sizeof(float), ones.data());
    dark_ =
        context_->kernel("stages/aperture.cl", "aperture_dark", "-DCOMPLEX_PUPIL=0 -DSHIFT=0 -DPIXEL_TAPS=0 -DACCUMULATE=0");
}

ImageView Optics::image(const cl::Buffer &buffer, std::size_t index) const {
    return check_image({buffer(), index * pixels_ * sizeof(float), 0, layout_.width, layout_.height, Format::kFloat32},
                       "image", context_->cl_context()(), {layout_.width, layout_.height}, {Format::kFloat32});
}

Optics::Stages &Optics::stages_for(const PipelineModel &model, std::uint64_t seed) {
    PhaseParameters phase = model.phase;
    phase.seed = seed;
    const auto same_grid = [&](const Stages &s) { return s.phase->parameters().oversampling == phase.oversampling; };
    const auto found = std::find_if(stages_.begin(), stages_.end(), same_grid);
    if (found != stages_.end()) {
        std::rotate(stages_.begin(), found, found + 1);
        stages_.front().phase->configure(phase);
        if (!same_pupil(stages_.front().aperture->parameters(), model.aperture))
            stages_.front().aperture->configure(model.aperture);
    } else {
        Stages made;
        made.phase = std::make_unique<Phase>(context_, phase);
        made.aperture = std::make_unique<Aperture>(context_, model.aperture);
        made.field = std::make_unique<Field>(context_, made.aperture->grid());
        constexpr std::size_t kMostGrids = 3; // their buffers grow with the square of the oversampling
        if (stages_.size() == kMostGrids)
            stages_.pop_back();
        stages_.insert(stages_.begin(), std::move(made));
    }
    Stages &stages = stages_.front();
    const PipelineParameters &p = model.pipeline;
    FieldParameters field;
    field.coherent_fraction = p.coherent_fraction;
    field.line_count = p.line_count;
    field.dephasing_rad = p.dephasing_rad;
    field.wavelength_m = model.aperture.wavelength_m;
    field.degree_of_polarization = model.aperture.degree_of_polarization;
    field.seed = seed;
    const auto key = [](const FieldParameters &f) {
        return std::tuple(f.coherent_fraction, f.line_count, f.dephasing_rad, f.seed);
    };
    if (key(field) != key(stages.field->parameters()))
        stages.field->configure(field);
    prepare_exposure(p);
    return stages;
}

void Optics::prepare_exposure(const PipelineParameters &p) {
    const bool same_exposure = p.exposure_path == exposure_path_ && p.exposure_correlation == exposure_correlation_;
    if (same_exposure && p.line_count == line_count_ && p.dephasing_rad == dephasing_rad_)
        return;
    if (!same_exposure)
        exposure_modes_ = exposure_modes(p.exposure_path, p.exposure_correlation);
    exposure_path_ = p.exposure_path;
    exposure_correlation_ = p.exposure_correlation;
    line_count_ = p.line_count;
    dephasing_rad_ = p.dephasing_rad;
    double variance = 0.0;
    for (const ExposureMode &mode : exposure_modes_)
        variance += mode.weight * mode.weight;
    const std::vector<LaserLine> lines = equal_lines(line_count_);
    lines_of_modes_.clear();
    for (const ExposureMode &mode : exposure_modes_) {
        const double share = mode.weight * mode.weight / variance, count = static_cast<double>(exposure_modes_.size());
        lines_of_modes_.push_back(fewest_lines(lines, dephasing_rad_, kLineError / (count * share)));
    }
}

void Optics::enqueue_irradiance(CommandChain &chain, const PipelineModel &model, CaptureScene scene) {
    const ImageView irradiance = image(irradiance_.get());
    if (scene == CaptureScene::kDots) {
        if (!dots_)
            dots_ = std::make_unique<Dots>(context_, *model.dots);
        else if (!same_dots(dots_->parameters(), *model.dots))
            dots_->configure(*model.dots);
        dots_->enqueue_render(chain, irradiance);
    } else {
        chain.copy("irradiance", uniform_.get()(), 0, irradiance_.get()(), 0, pixels_ * sizeof(float));
    }
}

namespace {

LensParameters distorting_part(LensParameters lens) {
    lens.glare_fraction = 0.0;
    return lens;
}
LensParameters glaring_part(LensParameters lens) {
    lens.k1 = 0.0;
    return lens;
}
bool same_lens(const LensParameters &a, const LensParameters &b) {
    return std::tie(a.k1, a.glare_fraction, a.glare_scale_px) == std::tie(b.k1, b.glare_fraction, b.glare_scale_px);
}
void configure(const std::shared_ptr<Context> &context, std::unique_ptr<Lens> &lens, const LensParameters &parameters) {
    if (!lens)
        lens = std::make_unique<Lens>(context, parameters);
    else if (!same_lens(lens->parameters(), parameters))
        lens->configure(parameters);
}

} // namespace

void Optics::enqueue_speckle(CommandChain &chain, const PipelineModel &model, Stages &stages, Airflow *airflow,
                             std::uint64_t seed, std::uint64_t counter, bool fresh, bool moving,
                             const ImageView &irradiance, const ImageView &intensity) {
    const PipelineParameters &p = model.pipeline;
    Phase &phase = *stages.phase;
    if (fresh) {
        phase.enqueue_refresh(chain, counter, {});
    } else if (std::isfinite(p.boiling_correlation_frames)) {
        PhaseAdvance advance;
        advance.uniform_correlation = std::exp(-1.0 / p.boiling_correlation_frames);
        phase.enqueue_advance(chain, counter, advance);
    }
    const std::size_t count = moving ? exposure_modes_.size() : 1;
    Exposure exposure;
    exposure.field = stages.field.get();
    if (airflow) {
        airflow->enqueue_advance(chain, counter);
        exposure.screen = &airflow->screen();
    }
    if (p.vibration_rms_px > 0.0) {
        const auto shift = host_normals(seed, counter, kStreamVibration);
        exposure.shift_x_px = p.vibration_rms_px * shift[0];
        exposure.shift_y_px = p.vibration_rms_px * shift[1];
        exposure.moves_image = true;
    }
    for (std::size_t i = 0; i < count; ++i) {
        if (i > 0) {
            phase.enqueue_refresh(chain, mode_counter(counter, i), {});
            exposure.adds = true;
        }
        exposure.lines = &lines_of_modes_[i];
        if (moving) {
            exposure.gain = exposure_modes_[i].weight;
            exposure.coherent_gain = exposure_modes_[i].coherent_gain;
        }
        stages.aperture->enqueue_intensity(chain, phase, irradiance, intensity, exposure);
    }
}

void Optics::enqueue_render(cl_command_queue queue, const SequenceModel &sequence_model, std::size_t sequence,
                            std::uint64_t seed, std::uint32_t frame_count, const FrameCallback &on_irradiance,
                            const DeviceBuffer &intensities) {
    const PipelineModel &model = sequence_model.model;
    const SequenceLayout &layout = layout_.sequences[sequence];
    const std::uint32_t frames = sequence_model.frames_differ ? frame_count : 1;
    CommandChain chain(queue, 0, nullptr);
    if (layout.scene == CaptureScene::kDark) {
        const ImageView intensity = image(intensities.get());
        KernelArguments(dark_).add(intensity).add(cl_uint{layout_.width}).add(cl_uint{layout_.height});
        chain.run("intensity", dark_, layout_.width, layout_.height);
        return;
    }
    // The ideal image, as the lens shows it: the same in every frame.
    enqueue_irradiance(chain, model, layout.scene);
    ImageView irradiance = image(irradiance_.get());
    const bool distorts = model.lens.k1 != 0.0;
    if (distorts) {
        configure(context_, distortion_, distorting_part(model.lens));
        if (!distorted_)
            distorted_ = DeviceBuffer(context_, pixels_ * sizeof(float));
    }
    const bool spreads = model.pipeline.subsurface_fraction > 0.0;
    if (spreads && (!subsurface_ || subsurface_length_px_ != model.pipeline.subsurface_length_px)) {
        const double length = model.pipeline.subsurface_length_px;
        subsurface_ = std::make_unique<FftFilter>(context_, layout_.width, layout_.height,
                                                  exponential_guard_px(length, layout_.width, layout_.height),
                                                  exponential_spread(length), filter_workspace_);
        subsurface_length_px_ = length;
    }
    const auto through_lens_and_surface = [&](ImageView light) {
        if (distorts) {
            const ImageView out = image(distorted_.get());
            distortion_->enqueue_distort(chain, light, out, Interpolation::kCubic);
            light = out;
        }
        if (spreads)
            subsurface_->enqueue(chain, "subsurface", light, light, model.pipeline.subsurface_fraction);
        return light;
    };
    std::vector<float> ideal, changed;
    if (on_irradiance) {
        ideal.resize(pixels_);
        changed.resize(pixels_);
        check_opencl(clEnqueueReadBuffer(queue, irradiance_.get()(), CL_TRUE, 0, pixels_ * sizeof(float), ideal.data(),
                                         0, nullptr, nullptr),
                     "clEnqueueReadBuffer");
        if (!shaped_)
            shaped_ = DeviceBuffer(context_, pixels_ * sizeof(float));
    } else {
        irradiance = through_lens_and_surface(irradiance);
    }
    const bool laser = layout.scene != CaptureScene::kFlat;
    if (model.lens.glare_fraction > 0.0)
        configure(context_, glare_, glaring_part(model.lens));
    Stages &stages = stages_for(model, seed);
    std::unique_ptr<Airflow> airflow;
    if (laser && model.pipeline.airflow.rms_rad > 0.0) {
        AirflowParameters air = model.pipeline.airflow;
        air.seed = seed;
        airflow = std::make_unique<Airflow>(context_, stages.aperture->grid(), air);
    }
    for (std::uint32_t frame = 0; frame < frames; ++frame) {
        if (on_irradiance) {
            changed = ideal;
            on_irradiance(frame, changed.data());
            check_opencl(clEnqueueWriteBuffer(queue, shaped_.get()(), CL_TRUE, 0, pixels_ * sizeof(float),
                                              changed.data(), 0, nullptr, nullptr),
                         "clEnqueueWriteBuffer");
            irradiance = through_lens_and_surface(image(shaped_.get()));
        }
        const ImageView intensity = image(intensities.get(), frame);
        if (laser)
            enqueue_speckle(chain, model, stages, airflow.get(), seed, frame_counter(sequence, frame),
                            layout.moving || frame == 0, layout.moving, irradiance, intensity);
        else
            stages.aperture->enqueue_incoherent(chain, irradiance, intensity);
        if (model.lens.glare_fraction > 0.0)
            glare_->enqueue_finish(chain, intensity, intensity, false);
    }
}

} // namespace clsp

// Every kernel of the library once, on 64 x 64 pixels: what oclgrind watches. Odd offsets and pitches, so that an
// access beside an image lands in memory that is not the kernel's.
#include <clspeckle/clspeckle.hpp>

#include "simulator/simulator.hpp"
#include "statistics/device_sums.hpp"
#include "statistics/sequence_statistics.hpp"

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <numeric>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace {

constexpr std::uint32_t side = 64, pixels = side * side;

struct Image {
    Image(const clspeckle::Context &context, std::uint32_t format)
        : buffer(context, 4 + (side + 1) * clspeckle::pixel_bytes(format) * side),
          view(buffer.image(side, side, format, (side + 1) * clspeckle::pixel_bytes(format), 4)) {}
    clspeckle::Buffer buffer;
    ClspImage view;
};

template <typename T> void fill(const Image &image, cl_command_queue queue, T value) {
    image.buffer.write(queue, std::vector<T>(image.buffer.size_bytes() / sizeof(T), value));
}

void run_philox(const clspeckle::Context &context, const clspeckle::Queue &queue) {
    std::vector<std::uint32_t> counters(4 * 100);
    std::iota(counters.begin(), counters.end(), 0u);
    const clspeckle::Buffer blocks(context, queue, counters);
    const std::uint32_t key[2] = {1, 2};
    clspeckle::philox::enqueue_blocks(context, queue, blocks, 0, key, 100, 0, blocks, 0);
    queue.finish();
}

// cl_images of both kinds of texels, and codes as fractions.
void run_cl_images(const clspeckle::Context &context, const clspeckle::Queue &queue) {
    for (const auto &[type, format] : {std::pair{CL_FLOAT, CLSP_FORMAT_FLOAT32X3},
                                       {CL_UNSIGNED_INT16, CLSP_FORMAT_UINT16},
                                       {CL_UNORM_INT8, CLSP_FORMAT_UINT8}}) {
        const cl_image_format texel{CL_RGBA, static_cast<cl_channel_type>(type)};
        cl_image_desc desc{};
        desc.image_type = CL_MEM_OBJECT_IMAGE2D;
        desc.image_width = desc.image_height = side;
        cl_int code = CL_SUCCESS;
        const auto texture = clspeckle::ClImage::adopt(
            clCreateImage(context.info().cl_context_handle, CL_MEM_READ_WRITE, &texel, &desc, nullptr, &code));
        if (code != CL_SUCCESS)
            throw std::runtime_error("clCreateImage failed with " + std::to_string(code));
        const Image image(context, format);
        fill(image, queue, std::uint8_t{1});
        texture.enqueue_export(context, queue, image.view);
        texture.enqueue_import(context, queue, 1, image.view);
        queue.finish();
    }
}

void run() {
    const clspeckle::Context context;
    std::printf("device: %s\n", context.info().device_name);
    const clspeckle::Queue queue(context);
    run_philox(context, queue);
    run_cl_images(context, queue);
    const Image words(context, CLSP_FORMAT_UINT32), ideal(context, CLSP_FORMAT_FLOAT32),
        result(context, CLSP_FORMAT_FLOAT32);
    const Image bytes(context, CLSP_FORMAT_UINT8), codes(context, CLSP_FORMAT_UINT16), mask(context, CLSP_FORMAT_UINT8);
    fill(mask, queue, std::uint8_t{1});

    auto philox = clspeckle::make<ClspPhiloxDesc>();
    clspeckle::philox::enqueue_fill(context, queue, philox, ideal.view);
    philox.distribution = CLSP_DISTRIBUTION_NORMAL;
    clspeckle::philox::enqueue_fill(context, queue, philox, result.view);
    philox.distribution = CLSP_DISTRIBUTION_BITS;
    clspeckle::philox::enqueue_fill(context, queue, philox, words.view);

    const std::vector<float> texels(33 * 21, 1.0f);
    auto pattern_desc = clspeckle::make<ClspPatternDesc>();
    pattern_desc.width = 33;
    pattern_desc.height = 21;
    pattern_desc.texels = texels.data();
    const Image depth(context, CLSP_FORMAT_FLOAT32), position(context, CLSP_FORMAT_FLOAT32X3),
        normal(context, CLSP_FORMAT_FLOAT32X4), albedo(context, CLSP_FORMAT_FLOAT32),
        visibility(context, CLSP_FORMAT_FLOAT32);
    fill(depth, queue, 1.5f);
    fill(position, queue, 0.7f);
    fill(normal, queue, -0.5f);
    fill(albedo, queue, 0.5f);
    fill(visibility, queue, 1.0f);
    auto by_depth = clspeckle::make<ClspGeometry>();
    by_depth.depth = depth.view;
    by_depth.fx_px = by_depth.fy_px = 60;
    by_depth.cx_px = by_depth.cy_px = 31.5;
    auto by_position = clspeckle::make<ClspGeometry>();
    by_position.position = position.view;
    by_position.normal = normal.view;
    by_position.albedo = albedo.view;
    by_position.visibility = visibility.view;
    const clspeckle::Pattern pattern(context, pattern_desc);
    pattern_desc.projection = CLSP_PROJECTION_DIRECTION_COSINES;
    pattern_desc.quantity = CLSP_QUANTITY_PLANE_IRRADIANCE;
    clspeckle::Pattern(context, pattern_desc).enqueue_lookup(queue, by_position, result.view);
    by_depth.depth_kind = CLSP_DEPTH_ALONG_RAY;
    by_depth.visibility = mask.view;
    pattern.enqueue_lookup(queue, by_depth, result.view);

    auto phase_desc = clspeckle::make<ClspPhaseDesc>();
    phase_desc.width = phase_desc.height = side;
    auto aperture_desc = clspeckle::make<ClspApertureDesc>();
    aperture_desc.width = aperture_desc.height = side;
    aperture_desc.degree_of_polarization = 0.5;
    auto sensor_desc = clspeckle::make<ClspSensorDesc>();
    sensor_desc.width = sensor_desc.height = side;
    const clspeckle::Phase phase(context, phase_desc);
    phase.enqueue_refresh(queue, 0);
    phase.enqueue_refresh(queue, 1, &mask.view);
    const clspeckle::Buffer field(context, pixels * 8), state(context, phase.state_size());
    phase.enqueue_field(queue, 1, field.image(side, side, CLSP_FORMAT_FLOAT32X2));
    phase.enqueue_save(queue, state);
    phase.enqueue_restore(queue, state);
    phase_desc.field = CLSP_FIELD_UNIT_PHASOR;
    phase_desc.guard_px = aperture_desc.guard_px = 3;
    const clspeckle::Phase padded(context, phase_desc);
    padded.enqueue_refresh(queue, 0);
    padded.enqueue_refresh(queue, 1, &mask.view);
    const float half[] = {0.5f, 1.0f, 0.5f, 0.5f};
    aperture_desc.pupil = CLSP_PUPIL_IMAGE;
    aperture_desc.pupil_image = half;
    aperture_desc.pupil_width = aperture_desc.pupil_height = 2;
    const clspeckle::Aperture padded_aperture(context, aperture_desc);
    padded_aperture.enqueue_intensity(queue, padded, ideal.view, result.view);
    const ClspApertureInfo info = padded_aperture.info();
    const clspeckle::Buffer pupil(context, std::uint64_t{info.grid_width} * info.grid_height * 4);
    padded_aperture.enqueue_pupil(queue, pupil.image(info.grid_width, info.grid_height, CLSP_FORMAT_FLOAT32));
    // Oversampling: half the image on the same number of samples.
    phase_desc = clspeckle::make<ClspPhaseDesc>();
    phase_desc.width = phase_desc.height = side / 2;
    phase_desc.oversampling = 2;
    auto fine_desc = clspeckle::make<ClspApertureDesc>();
    fine_desc.width = fine_desc.height = side / 2;
    fine_desc.oversampling = 2;
    fine_desc.relative_diameter = 1.5;
    const clspeckle::Phase fine(context, phase_desc);
    fine.enqueue_refresh(queue, 0);
    ClspImage quarter = ideal.view, quarter_result = result.view;
    quarter.width = quarter.height = quarter_result.width = quarter_result.height = side / 2;
    clspeckle::Aperture(context, fine_desc).enqueue_intensity(queue, fine, quarter, quarter_result);

    const std::vector<float> dark(pixels, 1.0f);
    sensor_desc.dark_frame_dn = sensor_desc.gain_map = dark.data();
    sensor_desc.hot_pixel_fraction = sensor_desc.cold_pixel_fraction = 0.1;
    const clspeckle::Sensor sensor(context, sensor_desc);
    sensor.enqueue_expose(queue, ideal.view, 0, result.view);
    sensor_desc.bits = 8;
    sensor_desc.quantize = 0;
    sensor_desc.read_noise_dn = 0;
    const clspeckle::Sensor plain(context, sensor_desc);
    plain.enqueue_expose(queue, ideal.view, 0, bytes.view);
    plain.enqueue_expose(queue, ideal.view, 0, result.view);

    aperture_desc.guard_px = 0;
    aperture_desc.pupil = CLSP_PUPIL_CIRCLE;
    aperture_desc.pupil_image = nullptr;
    aperture_desc.soft_rim = 0.2;
    const clspeckle::Pipeline pipeline(context, pattern, phase, clspeckle::Aperture(context, aperture_desc), sensor);
    auto frame = clspeckle::make<ClspFrame>();
    frame.geometry = &by_depth;
    frame.refresh_mask = mask.view;
    frame.output = codes.view;
    pipeline.warm_up(queue, frame);
    pipeline.enqueue_frame(queue, frame);
    pipeline.check(queue);
    clspeckle::Hypothesis own;
    own.stage = "optics";
    own.parameters = {{"by", "1", 0.0, 2.0, 1.0, 1.5}};
    own.opencl_source = "float hypothesis(hypothesis_frame frame, hypothesis_values values, uint x, uint y) {\n"
                        "    return values.by * hypothesis_pixel(frame, x - 1, y + 1);\n}\n";
    for (const std::uint32_t point : {CLSP_HYPOTHESIS_IRRADIANCE, CLSP_HYPOTHESIS_INTENSITY, CLSP_HYPOTHESIS_CODES}) {
        own.id = "own_" + std::to_string(point);
        own.point = point;
        clspeckle::set_effect(pipeline, own);
    }
    pipeline.enqueue_frame(queue, frame);
    pipeline.check(queue);
    pipeline.clear_effects();

    const ClspMoments moments = clspeckle::statistics::moments(context, queue, ideal.view, &mask.view);
    clspeckle::statistics::moments(context, queue, codes.view);
    clspeckle::statistics::moments(context, queue, bytes.view);
    clspeckle::statistics::histogram(context, queue, codes.view, 0, 1024, 16);
    clspeckle::statistics::autocovariance(context, queue, ideal.view, 3);
    queue.finish();
    std::printf("mean of the uniforms: %.3f\n", moments.mean);
    if (std::abs(moments.mean - 0.5) > 0.05)
        throw std::runtime_error("the uniforms are not uniform");
}

// The pattern's lookup with every kind of image, in whole vectors and what is left of a row, and bad pixels in either.
void run_lookups() {
    const clspeckle::Context context;
    const clspeckle::Queue queue(context);
    const std::vector<float> texels(33 * 21, 1.0f);
    auto desc = clspeckle::make<ClspPatternDesc>();
    desc.width = 33;
    desc.height = 21;
    desc.texels = texels.data();
    const clspeckle::Pattern pattern(context, desc);
    desc.projection = CLSP_PROJECTION_DIRECTION_COSINES;
    desc.quantity = CLSP_QUANTITY_PLANE_IRRADIANCE;
    const clspeckle::Pattern cosines(context, desc);
    Image depth(context, CLSP_FORMAT_FLOAT32), three(context, CLSP_FORMAT_FLOAT32X3),
        four(context, CLSP_FORMAT_FLOAT32X4), factor(context, CLSP_FORMAT_FLOAT32), bytes(context, CLSP_FORMAT_UINT8),
        result(context, CLSP_FORMAT_FLOAT32);
    fill(depth, queue, 1.5f);
    fill(three, queue, 0.7f);
    fill(four, queue, -0.5f);
    fill(bytes, queue, std::uint8_t{200});
    std::vector<float> factors(factor.buffer.size_bytes() / sizeof(float), 0.5f);
    for (std::size_t i = 0; i < factors.size(); i += 31)
        factors[i] = -1.0f;
    factor.buffer.write(queue, factors);
    for (const std::uint32_t width : {side, 37u, 3u}) {
        for (Image *image : {&depth, &three, &four, &factor, &bytes, &result}) {
            image->view.width = width;
            image->view.height = 9;
        }
        auto geometry = clspeckle::make<ClspGeometry>();
        geometry.position = three.view;
        geometry.normal = four.view;
        geometry.albedo = geometry.visibility = factor.view;
        cosines.enqueue_lookup(queue, geometry, result.view);
        geometry.position = four.view;
        geometry.normal = three.view;
        cosines.enqueue_lookup(queue, geometry, result.view);
        geometry = clspeckle::make<ClspGeometry>();
        geometry.depth = depth.view;
        geometry.depth_kind = CLSP_DEPTH_ALONG_RAY;
        geometry.fx_px = geometry.fy_px = 60;
        geometry.cx_px = geometry.cy_px = 31.5;
        geometry.visibility = bytes.view;
        pattern.enqueue_lookup(queue, geometry, result.view);
    }
    queue.finish();
}

// Airflow on a grid of odd width, whose screens take a transform of the whole width.
void run_odd_airflow() {
    constexpr std::uint32_t width = 15, height = 12;
    const clspeckle::Context context;
    const clspeckle::Queue queue(context);
    const double position[2] = {7.2, 6.1};
    auto dots_desc = clspeckle::make<ClspDotsDesc>();
    auto phase_desc = clspeckle::make<ClspPhaseDesc>();
    auto aperture_desc = clspeckle::make<ClspApertureDesc>();
    dots_desc.width = phase_desc.width = aperture_desc.width = width;
    dots_desc.height = phase_desc.height = aperture_desc.height = height;
    dots_desc.positions_px = position;
    dots_desc.count = 1;
    const clspeckle::Dots dots(context, dots_desc);
    const clspeckle::Phase phase(context, phase_desc);
    const clspeckle::Aperture aperture(context, aperture_desc);
    auto desc = clspeckle::make<ClspPipelineDesc>();
    desc.dots = dots;
    desc.phase = phase;
    desc.aperture = aperture;
    const clspeckle::Pipeline pipeline(context, desc);
    pipeline.set_effect("airflow");
    const clspeckle::Buffer intensity(context, width * height * 4);
    auto frame = clspeckle::make<ClspFrame>();
    frame.output = intensity.image(width, height, CLSP_FORMAT_FLOAT32);
    pipeline.enqueue_frame(queue, frame);
    pipeline.check(queue);
}

// Dots through the whole camera with every effect, on a small grid: the transforms take long under a watching device.
void run_effects() {
    constexpr std::uint32_t small = 32;
    const clspeckle::Context context;
    const clspeckle::Queue queue(context);
    const std::vector<double> positions{8.3, 8.1, 24.2, 7.7, 8.0, 23.9, 23.6, 24.4};
    auto dots_desc = clspeckle::make<ClspDotsDesc>();
    auto phase_desc = clspeckle::make<ClspPhaseDesc>();
    auto aperture_desc = clspeckle::make<ClspApertureDesc>();
    auto sensor_desc = clspeckle::make<ClspSensorDesc>();
    auto motion_desc = clspeckle::make<ClspMotionDesc>();
    for (auto *size :
         {&dots_desc.width, &dots_desc.height, &phase_desc.width, &phase_desc.height, &aperture_desc.width,
          &aperture_desc.height, &sensor_desc.width, &sensor_desc.height, &motion_desc.width, &motion_desc.height})
        *size = small;
    dots_desc.positions_px = positions.data();
    dots_desc.count = 4;
    phase_desc.dynamics = CLSP_DYNAMICS_CONTINUOUS;
    phase_desc.translate = 1;
    const clspeckle::Dots dots(context, dots_desc);
    const clspeckle::Phase phase(context, phase_desc);
    const clspeckle::Aperture aperture(context, aperture_desc);
    const clspeckle::Sensor sensor(context, sensor_desc);
    const clspeckle::Buffer codes(context, small * small * 2);
    auto frame = clspeckle::make<ClspFrame>();
    frame.output = codes.image(small, small, CLSP_FORMAT_UINT16);

    auto desc = clspeckle::make<ClspPipelineDesc>();
    desc.dots = dots;
    desc.phase = phase;
    desc.aperture = aperture;
    desc.sensor = sensor;
    const clspeckle::Pipeline camera(context, desc);
    for (const ClspEffectInfo &effect : clspeckle::effects())
        if (std::string(effect.id) != "linewidth" && std::string(effect.id) != "motion_decorrelation")
            camera.set_effect(effect.id);
    for (const std::uint32_t refresh : {CLSP_REFRESH_ALL, CLSP_REFRESH_MASK}) {
        frame.refresh = refresh;
        camera.enqueue_frame(queue, frame);
        ++frame.frame_index;
    }
    frame.illumination = CLSP_ILLUMINATION_DARK;
    camera.enqueue_frame(queue, frame);
    const clspeckle::Buffer lamp(context, queue, std::vector<float>(small * small, 0.5f));
    frame.illumination = CLSP_ILLUMINATION_INCOHERENT;
    frame.irradiance = lamp.image(small, small, CLSP_FORMAT_FLOAT32);
    camera.enqueue_frame(queue, frame);
    const clspeckle::Buffer colours(context, small * small * 12);
    const ClspImage rgb = colours.image(small, small, CLSP_FORMAT_FLOAT32X3);
    clspeckle::check(
        clspSensorEnqueueDemosaic(sensor, queue, &frame.output, CLSP_BAYER_RGGB, &rgb, 0, nullptr, nullptr));
    camera.clear_effects();

    // Several lines, an exposure that blurs, materials, and motion by vectors that carries the speckle along.
    std::vector<ClspMaterial> materials(2, clspeckle::make<ClspMaterial>());
    materials[1].correlation_time_s = 0.1;
    materials[1].subsurface_fraction = 0.5;
    const clspeckle::MaterialTable table(context, materials);
    motion_desc.materials = table;
    motion_desc.translate = 1;
    motion_desc.fx_px = motion_desc.fy_px = 40;
    motion_desc.cx_px = motion_desc.cy_px = 15.5;
    const clspeckle::Motion motion(context, motion_desc);
    auto lens_desc = clspeckle::make<ClspLensDesc>();
    lens_desc.width = lens_desc.height = small;
    const clspeckle::Lens lens(context, lens_desc);
    desc.lens = lens;
    desc.materials = table;
    desc.motion = motion;
    desc.line_count = 2;
    desc.dephasing_rad = 0.7;
    desc.exposure_path = 0.5;
    desc.sub_exposures = 2;
    desc.shutter_fraction = 0.5;
    desc.subsurface_length_px = 1;
    const clspeckle::Pipeline living(context, desc);
    const clspeckle::Buffer depth(context, queue, std::vector<float>(small * small, 1.0f));
    const clspeckle::Buffer vectors(context, queue, std::vector<float>(2 * small * small, 0.6f));
    const clspeckle::Buffer ids(context, queue, std::vector<std::uint8_t>(small * small, 1));
    auto input = clspeckle::make<ClspMotionInput>();
    input.depth = input.previous_depth = depth.image(small, small, CLSP_FORMAT_FLOAT32);
    input.motion = vectors.image(small, small, CLSP_FORMAT_FLOAT32X2);
    input.material = ids.image(small, small, CLSP_FORMAT_UINT8);
    input.frame_time_s = 1.0 / 30;
    frame = clspeckle::make<ClspFrame>();
    frame.output = codes.image(small, small, CLSP_FORMAT_UINT16);
    frame.material = input.material;
    frame.refresh = CLSP_REFRESH_ALL;
    living.enqueue_frame(queue, frame);
    frame.refresh = CLSP_REFRESH_MASK;
    frame.motion = &input;
    frame.frame_index = 1;
    living.enqueue_frame(queue, frame);
    lens_desc.k1 = 0.1;
    lens.configure(lens_desc);
    frame.frame_index = 2;
    living.enqueue_frame(queue, frame);
    living.check(queue);
    queue.finish();
}

// Lines, strips and blocks that end anywhere, and every way from samples to pixels, with what else the aperture can do.
struct ApertureCase {
    std::uint32_t width, height, oversampling, guard_px;
    double diameter, fill_factor, defocus_waves;
    std::uint32_t field;
};

void run_apertures(const std::vector<ApertureCase> &cases) {
    const clspeckle::Context context;
    const clspeckle::Queue queue(context);
    for (const ApertureCase &c : cases) {
        auto phase_desc = clspeckle::make<ClspPhaseDesc>();
        auto aperture_desc = clspeckle::make<ClspApertureDesc>();
        phase_desc.width = aperture_desc.width = c.width;
        phase_desc.height = aperture_desc.height = c.height;
        phase_desc.oversampling = aperture_desc.oversampling = c.oversampling;
        phase_desc.guard_px = aperture_desc.guard_px = c.guard_px;
        phase_desc.field = c.field;
        aperture_desc.relative_diameter = c.diameter;
        aperture_desc.fill_factor = c.fill_factor;
        aperture_desc.defocus_waves = c.defocus_waves;
        aperture_desc.degree_of_polarization = 0.3;
        auto desc = clspeckle::make<ClspPipelineDesc>();
        const clspeckle::Phase phase(context, phase_desc);
        const clspeckle::Aperture aperture(context, aperture_desc);
        desc.phase = phase;
        desc.aperture = aperture;
        desc.vibration_rms_px = 0.5;
        const clspeckle::Pipeline camera(context, desc);
        std::vector<float> light(c.width * c.height, 0.5f);
        light.back() = -1.0f;
        const clspeckle::Buffer irradiance(context, queue, light);
        const clspeckle::Buffer intensity(context, light.size() * sizeof(float));
        auto frame = clspeckle::make<ClspFrame>();
        frame.irradiance = irradiance.image(c.width, c.height, CLSP_FORMAT_FLOAT32);
        frame.output = intensity.image(c.width, c.height, CLSP_FORMAT_FLOAT32);
        for (const std::uint32_t refresh : {CLSP_REFRESH_ALL, CLSP_REFRESH_MASK}) {
            frame.refresh = refresh;
            camera.enqueue_frame(queue, frame);
            ++frame.frame_index;
        }
        queue.finish();
    }
}

// What only the simulator of captures runs: light between the lens and the sensor, of frames that are all the same and
// of ones that differ. No public call simulates without a diagnosis, which would take hours here.
// Patterns of diffractive elements both ways, ideal dots, and the lookup over footprints.
void run_doe() {
    const clspeckle::Context context;
    const clspeckle::Queue queue(context);
    std::vector<float> phase(12 * 8);
    for (std::size_t i = 0; i < phase.size(); ++i)
        phase[i] = static_cast<float>(i * i % 7);
    auto desc = clspeckle::make<ClspDoePatternDesc>();
    desc.width = 12;
    desc.height = 8;
    desc.phase = phase.data();
    desc.pixel_pitch_m = 2e-6;
    desc.image_width = 21;
    desc.image_height = 17;
    auto defects = clspeckle::make<ClspDoeDefects>();
    defects.levels = 4;
    defects.rounding_sigma_m = 1e-6;
    defects.feature_samples = 2;
    defects.etch_noise_rms_m = 20e-9;
    desc.defects = &defects;
    auto beam = clspeckle::make<ClspBeamProfile>();
    beam.covariance_xx_m2 = beam.covariance_yy_m2 = 1e-10;
    desc.beam = &beam;
    const auto check_books = [&] {
        const ClspDoePatternInfo info = clspeckle::DoePattern(context, desc).info();
        const double sum = info.dots + info.zero_order + info.ghosts + info.scatter;
        if (!(std::abs(sum - 1) < 1e-5))
            throw std::runtime_error("the power budget of a diffractive element adds up to " + std::to_string(sum));
    };
    desc.half_extent_x = desc.half_extent_y = 0.15;
    check_books();
    beam.kind = CLSP_BEAM_FLAT_SQUARE;
    beam.width_m = 24e-6;
    beam.height_m = 16e-6;
    desc.evaluation = CLSP_DOE_EVALUATION_APERTURE;
    check_books();

    auto spots = clspeckle::make<ClspSpotPatternDesc>();
    const std::vector<double> directions = {0.0, 0.1, 0.2, -0.1};
    spots.count = 2;
    spots.directions = directions.data();
    spots.image_width = 33;
    spots.image_height = 21;
    const std::vector<float> texels = clspeckle::DoePattern(context, spots).texels();
    auto pattern_desc = clspeckle::make<ClspPatternDesc>();
    pattern_desc.projection = CLSP_PROJECTION_DIRECTION_COSINES;
    pattern_desc.width = 33;
    pattern_desc.height = 21;
    pattern_desc.texels = texels.data();
    pattern_desc.filter = CLSP_FILTER_AREA;
    pattern_desc.filter_taps = 2;
    const clspeckle::Pattern pattern(context, pattern_desc);
    const Image depth(context, CLSP_FORMAT_FLOAT32), result(context, CLSP_FORMAT_FLOAT32);
    fill(depth, queue, 1.0f);
    auto geometry = clspeckle::make<ClspGeometry>();
    geometry.depth = depth.view;
    geometry.fx_px = geometry.fy_px = 50;
    geometry.cx_px = geometry.cy_px = 31.5;
    pattern.enqueue_lookup(queue, geometry, result.view);
    queue.finish();
}

void run_simulator() {
    clsp::CaptureLayout layout;
    layout.width = 22;
    layout.height = 14;
    layout.bits = 10;
    layout.pixel_pitch_m = 2.9e-6;
    layout.f_number = 5.6;
    layout.wavelength_m = 940e-9;
    layout.principal_point_px = {10.5, 6.5};
    for (const bool board : {false, true}) {
        clsp::SequenceLayout sequence;
        sequence.name = board ? "board" : "flat";
        sequence.scene = board ? clsp::CaptureScene::kBoard : clsp::CaptureScene::kFlat;
        sequence.moving = board;
        sequence.frame_count = 3;
        layout.sequences.push_back(sequence);
    }
    clsp::Hypothesis rows;
    rows.id = "rows";
    rows.stage = "sensor";
    rows.point = clsp::HypothesisPoint::kCodes;
    rows.parameters = {{"sigma", "DN", 0.0, 10.0, 1.0, 3.0}};
    rows.opencl_source = "float hypothesis(hypothesis_frame frame, hypothesis_values values, uint x, uint y) {\n"
                         "    return hypothesis_pixel(frame, x + 1, y - 1) + values.sigma *\n"
                         "        (hypothesis_normal(frame, 0, y, 0) + hypothesis_fixed_normal(frame, x, y, 1));\n}\n";
    const std::shared_ptr<clsp::Context> context = clsp::Context::create({});
    clsp::Simulator simulator(context, layout, {rows});
    const std::vector<clsp::EffectSetting> effects{
        {"vignetting", {0.4}}, {"power_flicker", {0.1}}, {"ambient_light", {20.0}}, {"rows", {2.0}}};
    const std::vector<clsp::SimulationLevels> levels(2, {200.0, 64.0, 3.0});
    const clsp::Capture capture = clsp::simulate_capture(simulator, effects, levels, 1);
    for (const std::vector<std::uint16_t> &codes : capture.codes) {
        const double mean = std::accumulate(codes.begin(), codes.end(), 0.0) / double(codes.size());
        if (std::abs(mean - 264.0) > 80.0)
            throw std::runtime_error("the simulated frames have a mean of " + std::to_string(mean) +
                                     " DN, expected about 264");
    }

    // What is measured on the device is what is measured on the host, if it has double precision.
    if (context->device().getInfo<CL_DEVICE_DOUBLE_FP_CONFIG>() == 0)
        return;
    clsp::statistics::DeviceSums device(context);
    for (std::size_t s = 0; s < layout.sequences.size(); ++s) {
        const clsp::SequenceStatistics statistics(layout, s, layout.sequences[s].frame_count);
        std::vector<double> host(statistics.list().size()), there = host;
        statistics.compute(capture.codes[s].data(), {64.0, 3.0}, host.data(), 1);
        statistics.compute(capture.codes[s].data(), {64.0, 3.0}, there.data(), 1, &device);
        if (host != there)
            throw std::runtime_error("the statistics of \"" + layout.sequences[s].name +
                                     "\" on the device are not the host's");
    }
}

// Design of a beam splitter: each projection, each rule and the search.
void run_doe_design() {
    const clspeckle::Context context;
    const std::vector<ClspDoeDesignOrder> orders = {
        {-2, 1, 1.0}, {2, -1, 1.0}, {3, 3, 2.0}, {-3, -3, 2.0}, {0, 0, 1.0}};
    for (const std::uint32_t levels : {0u, 2u, 5u})
        for (const std::uint32_t rule : {CLSP_DOE_RULE_GS, CLSP_DOE_RULE_NOGRETTE, CLSP_DOE_RULE_KIM}) {
            auto desc = clspeckle::make<ClspDoeDesignDesc>();
            desc.width = 18;
            desc.height = 15;
            desc.pixel_pitch_m = 2e-6;
            desc.levels = levels;
            desc.rule = rule;
            desc.orders = orders.data();
            desc.order_count = orders.size();
            desc.iterations = desc.fix_phase_iteration = desc.quantization_iterations = 2;
            desc.search_sweeps = levels ? 1 : 0;
            const clspeckle::DoeDesign design(context, desc);
            if (!(design.report().efficiency > 0.1))
                throw std::runtime_error("a design puts no light into its orders");
        }
}

// Dots found, fitted beside a neighbour and a saturated pixel, and placed, from each format of a frame.
void run_depth() {
    const clspeckle::Context context;
    const clspeckle::Queue queue(context);
    const Image codes(context, CLSP_FORMAT_UINT16), values(context, CLSP_FORMAT_FLOAT32),
        bytes(context, CLSP_FORMAT_UINT8);
    const double centres[][2] = {{12.3, 14.1}, {30.2, 15.7}, {36.4, 15.9}, {1.2, 40.3}, {50.1, 47.6}};
    std::vector<std::uint16_t> code(codes.buffer.size_bytes() / 2);
    std::vector<float> value(values.buffer.size_bytes() / 4);
    std::vector<std::uint8_t> byte(bytes.buffer.size_bytes());
    for (std::uint32_t y = 0; y < side; ++y)
        for (std::uint32_t x = 0; x < side; ++x) {
            double light = 10.0;
            for (const auto &c : centres)
                light += 220.0 * std::exp(-0.5 * ((x - c[0]) * (x - c[0]) + (y - c[1]) * (y - c[1])) / 2.25);
            const std::size_t i = std::size_t{y} * (side + 1) + x;
            code.at(2 + i) = static_cast<std::uint16_t>(light); // the images begin after 4 bytes
            value.at(1 + i) = static_cast<float>(light);
            byte.at(4 + i) = static_cast<std::uint8_t>(light);
        }
    codes.buffer.write(queue, code);
    values.buffer.write(queue, value);
    bytes.buffer.write(queue, byte);

    auto desc = clspeckle::make<ClspDepthDesc>();
    desc.width = desc.height = side;
    desc.max_dots = 32;
    desc.read_noise_dn = 1.0;
    desc.dn_per_electron = 0.1;
    desc.saturation_dn = 225.0;
    // The dots as a laser 5 cm to the right throws them on a wall at 1 m.
    std::vector<double> directions;
    for (const auto &c : centres) {
        directions.push_back((c[0] - 31.5) / 60.0 - 0.05);
        directions.push_back((c[1] - 31.5) / 60.0);
    }
    desc.directions = directions.data();
    desc.direction_count = directions.size() / 2;
    desc.laser_from_camera[3] = -0.05;
    desc.fx_px = desc.fy_px = 60;
    desc.cx_px = desc.cy_px = 31.5;
    const clspeckle::Depth depth(context, desc);
    for (const Image *image : {&codes, &values, &bytes}) {
        depth.enqueue_detect(queue, image->view);
        const clspeckle::DepthResult result = depth.dots(queue);
        if (result.dots.size() != 5 || depth.pattern_dots().size() != 5)
            throw std::runtime_error("expected 5 dots, found " + std::to_string(result.dots.size()));
    }
}

} // namespace

// `all_stages philox` runs one kernel alone.
int main(int argc, char **argv) {
    try {
        if (argc > 1 && std::string(argv[1]) == "philox") {
            const clspeckle::Context context;
            run_philox(context, clspeckle::Queue(context));
            return 0;
        }
        setenv("CLSPECKLE_FFT", "clfft", 1); // contexts read it when they are made
        run();
        run_effects();
        run_doe_design();
        setenv("CLSPECKLE_FFT", "cpu", 1);
        run_effects();
        run_lookups();
        run_odd_airflow();
        run_doe_design();
        std::vector<ApertureCase> apertures{{18, 15, 1, 0, 0.5, 0.0, 0.2, CLSP_FIELD_UNIT_PHASOR},
                                            {10, 9, 2, 1, 0.6, 0.0, 0.0, CLSP_FIELD_CIRCULAR_GAUSSIAN},
                                            {7, 5, 3, 0, 0.6, 0.0, 0.0, CLSP_FIELD_CIRCULAR_GAUSSIAN},
                                            {11, 7, 2, 0, 0.6, 0.7, 0.0, CLSP_FIELD_CIRCULAR_GAUSSIAN}};
        run_apertures(apertures);
        run_doe();
        // Again in work-groups; columns too long for both parts of them to stand in local memory at once, and
        // butterflies for which there are too few work-items and too many.
        setenv("CLSPECKLE_FFT", "gpu", 1);
        run_effects();
        apertures.push_back({5, 1080, 1, 0, 0.3, 0.0, 0.0, CLSP_FIELD_UNIT_PHASOR});
        apertures.push_back({250, 4, 1, 0, 0.5, 0.0, 0.0, CLSP_FIELD_CIRCULAR_GAUSSIAN});
        run_apertures(apertures);
        setenv("CLSPECKLE_FFT", "cpu", 1);
        run_depth();
        run_simulator();
    } catch (const std::exception &error) {
        std::fprintf(stderr, "failed: %s\n", error.what());
        return 1;
    }
    std::puts("all stages ran");
}

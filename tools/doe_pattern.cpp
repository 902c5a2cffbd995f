#include "doe_pattern.hpp"

#include "context.hpp"
#include "doe_files.hpp"
#include "errors.hpp"
#include "files.hpp"
#include "interrupt.hpp"
#include "io/formats.hpp"
#include "json.hpp"
#include "number_options.hpp"
#include "picture.hpp"
#include "text.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace tools {

namespace {

const std::vector<std::string> beams = {"gaussian", "flat_circle", "flat_square", "super_gaussian", "skewed", "image"};
const std::vector<std::string> evaluations = {"auto", "orders", "aperture"};

constexpr const char *examples =
    R"(DESIGN is NAME.npy, the phase in radians (float32, height x width), with NAME.json beside it:
  {"pixel_pitch_m": 1e-6, "wavelength_m": 940e-9, "periodic": true,
   "levels": 2, "orders": [[m, n, weight], ...]}
"periodic": the phase is a cell that repeats over the beam; else the whole aperture, with "directions": [[u, v, weight], ...].
What the defects mean: docs/method/doe.md.

Examples:
  clspeckle doe pattern cell.npy -o pattern.npy --beam-sigma-um 250 \
      --etch-noise-nm 15 --depth-error 0.03
  clspeckle doe inspect cell.npy -o cell.png --wavelength-nm 910
)";

/** What the library's messages call the options. */
const std::vector<std::pair<std::string, std::string>> option_names = {{"relative_depth_error", "--depth-error"},
                                                                       {"rounding_sigma_m", "--rounding-um"},
                                                                       {"etch_noise_rms_m", "--etch-noise-nm"},
                                                                       {"refractive_index", "--refractive-index"},
                                                                       {"dispersion_per_m", "--dispersion-per-um"},
                                                                       {"m_squared", "--m-squared"},
                                                                       {"oversampling", "--oversampling"},
                                                                       {"power_w", "--power-w"},
                                                                       {"evaluation APERTURE", "--evaluation aperture"},
                                                                       {"evaluation ORDERS", "--evaluation orders"}};

constexpr std::uint32_t panel_side = 900; // of the figure
constexpr double gamma_of_figure = 0.5;

std::uint32_t word_index(const std::string &word, const std::vector<std::string> &words, const char *name) {
    const auto found = std::find(words.begin(), words.end(), word);
    if (found == words.end())
        throw InputError(fmt::format("{} is \"{}\"; expected {}", name, word, fmt::join(words, ", ")));
    return static_cast<std::uint32_t>(found - words.begin());
}

clspeckle::DoePattern compute(const DoePatternArguments &a, const Design &design, Console &console) {
    auto beam = clspeckle::make<ClspBeamProfile>();
    beam.kind = word_index(a.beam, beams, "--beam");
    double sigma_x = std::sqrt(beam.covariance_xx_m2), sigma_y = std::sqrt(beam.covariance_yy_m2);
    take_positive_pair(a.beam_sigma_um, 1e-6, sigma_x, sigma_y, "--beam-sigma-um");
    beam.covariance_xx_m2 = sigma_x * sigma_x;
    beam.covariance_yy_m2 = sigma_y * sigma_y;
    take_positive_pair(a.beam_width_um, 1e-6, beam.width_m, beam.height_m, "--beam-width-um");
    take_pair(a.beam_skew, 1, beam.skew_x, beam.skew_y, "--beam-skew");
    beam.order = a.beam_order;
    beam.m_squared = a.m_squared;
    image_io::Plane image;
    if (!a.beam_image.empty()) {
        beam.kind = CLSP_BEAM_IMAGE;
        constexpr image_io::Encoding words[] = {image_io::Encoding::automatic, image_io::Encoding::linear,
                                                image_io::Encoding::srgb};
        image =
            read_plane(a.beam_image, console, words[word_index(a.transfer, {"auto", "linear", "srgb"}, "--transfer")]);
        beam.image = image.values.data();
        beam.image_width = image.width;
        beam.image_height = image.height;
    } else if (beam.kind == CLSP_BEAM_IMAGE) {
        throw InputError("--beam image needs --beam-image FILE");
    }
    auto defects = clspeckle::make<ClspDoeDefects>();
    defects.levels = a.levels;
    defects.relative_depth_error = a.depth_error;
    defects.rounding_sigma_m = a.rounding_um * 1e-6;
    defects.etch_noise_rms_m = a.etch_noise_nm * 1e-9;
    defects.refractive_index = a.refractive_index.value_or(defects.refractive_index);
    defects.dispersion_per_m = a.dispersion_per_um * 1e6;
    defects.seed = a.seed;
    auto desc = clspeckle::make<ClspDoePatternDesc>();
    desc.width = design.phase.width;
    desc.height = design.phase.height;
    desc.phase = design.phase.values.data();
    desc.periodic = design.periodic ? 1 : 0;
    desc.pixel_pitch_m = design.pixel_pitch_m;
    desc.wavelength_m = design.wavelength_m;
    desc.design_levels = design.levels;
    const DotList &dots = design.dots;
    desc.dot_count = dots.weights.size();
    desc.dot_orders = dots.numbers.empty() ? nullptr : dots.numbers.data();
    desc.dot_directions = dots.directions.empty() ? nullptr : dots.directions.data();
    desc.dot_weights = dots.weights.empty() ? nullptr : dots.weights.data();
    desc.beam = &beam;
    desc.defects = &defects;
    desc.evaluation = word_index(a.evaluation, evaluations, "--evaluation");
    desc.oversampling = a.oversampling;
    std::vector<double> wavelengths_m;
    for (const double wavelength : a.wavelengths_nm)
        wavelengths_m.push_back(wavelength * 1e-9);
    if (!a.line_powers.empty() && a.line_powers.size() != wavelengths_m.size())
        throw InputError(fmt::format("--line-power has {} numbers, but --wavelength-nm has {}", a.line_powers.size(),
                                     wavelengths_m.size()));
    desc.line_count = static_cast<std::uint32_t>(wavelengths_m.size());
    desc.line_wavelengths_m = wavelengths_m.empty() ? nullptr : wavelengths_m.data();
    desc.line_powers = a.line_powers.empty() ? nullptr : a.line_powers.data();
    take_positive_pair(a.doe_size_mm, 1e-3, desc.doe_width_m, desc.doe_height_m, "--doe-size-mm");
    desc.power_w = a.power_w;
    if (!a.texels.empty()) {
        desc.image_width = a.texels.front();
        desc.image_height = a.texels.back();
    }
    take_positive_pair(a.half_extent, 1, desc.half_extent_x, desc.half_extent_y, "--half-extent");
    desc.pixel_envelope = a.smooth ? 0 : 1;
    desc.cache_dir = a.cache.empty() ? nullptr : a.cache.c_str();
    const clspeckle::Context context = make_context(a.device);
    return clspeckle::DoePattern(context, desc, progress_on(console));
}

Json budget_of(const ClspDoePatternInfo &i) {
    return {{"projection", "direction_cosines"},
            {"quantity", "radiant_intensity"},
            {"half_extent_x", i.half_extent_x},
            {"half_extent_y", i.half_extent_y},
            {"power_w", i.power_w},
            {"dots", i.dots},
            {"zero_order", i.zero_order},
            {"ghosts", i.ghosts},
            {"scatter", i.scatter},
            {"inside_image", i.inside_image},
            {"uniformity_rms", i.uniformity_rms},
            {"dot_count", i.dot_count},
            {"divergence_x_rad", i.divergence_x_rad},
            {"divergence_y_rad", i.divergence_y_rad},
            {"m_squared", i.m_squared},
            {"order_spacing_x", i.order_spacing_x},
            {"order_spacing_y", i.order_spacing_y},
            {"device_memory_bytes", i.device_memory_bytes}};
}

void print_budget(const ClspDoePatternInfo &i, Console &console) {
    const char *source = i.source == CLSP_DOE_SOURCE_DISK ? "from the cache" : "computed";
    console.print(fmt::format(
        "{} x {} texels over +-{:.4f} x +-{:.4f} in direction cosines, {}; spots +-{:.3g} x +-{:.3g} mrad (M^2 {:g})",
        i.image_width, i.image_height, i.half_extent_x, i.half_extent_y, source, 1e3 * i.divergence_x_rad,
        1e3 * i.divergence_y_rad, i.m_squared));
    const auto percent = [](double share) { return fmt::format("{:.3f} %", 100 * share); };
    std::vector<std::vector<std::string>> rows = {{"share of the power", ""}};
    if (i.dot_count > 0)
        rows.push_back({fmt::format("{} wanted dots", i.dot_count), percent(i.dots)});
    rows.push_back({"zero order", percent(i.zero_order)});
    rows.push_back({"ghosts", percent(i.ghosts)});
    rows.push_back({"scatter", percent(i.scatter)});
    rows.push_back({"within the image", percent(i.inside_image)});
    console.print(table(rows));
    if (i.dot_count > 0)
        console.print(fmt::format("RMS of the dots' powers about those wanted: {:.2f} %", 100 * i.uniformity_rms));
}

/** A part of the texels as a square panel: the brightest texel of each of its pixels, so that no dot is lost. */
std::vector<float> panel(const std::vector<float> &texels, std::uint32_t width, std::uint32_t height, double x0,
                         double y0, double x1, double y1) {
    std::vector<float> values(std::size_t{panel_side} * panel_side, 0.0f);
    const auto range = [](double first, double last, std::uint32_t k, std::uint32_t size) {
        const double step = (last - first) / panel_side, begin = first + k * step;
        const auto from = static_cast<std::int64_t>(std::floor(begin));
        const auto to = std::max(from + 1, static_cast<std::int64_t>(std::floor(begin + step)));
        return std::pair{std::clamp<std::int64_t>(from, 0, size), std::clamp<std::int64_t>(to, 0, size)};
    };
    for (std::uint32_t j = 0; j < panel_side; ++j) {
        const auto [ya, yb] = range(y0, y1, j, height);
        for (std::uint32_t i = 0; i < panel_side; ++i) {
            const auto [xa, xb] = range(x0, x1, i, width);
            float &value = values[std::size_t{j} * panel_side + i];
            for (std::int64_t y = ya; y < yb; ++y)
                for (std::int64_t x = xa; x < xb; ++x)
                    value = std::max(value, texels[static_cast<std::size_t>(y) * width + static_cast<std::size_t>(x)]);
        }
    }
    return values;
}

/** A part of the pattern, with axes, and the scale of its own brightest texel. */
void draw_panel(Picture &picture, Box box, const std::vector<float> &values, double u, double v, double half,
                const std::string &title) {
    const double most = *std::max_element(values.begin(), values.end());
    const auto place = [&](double value) { return most > 0 ? std::pow(value / most, gamma_of_figure) : 0.0; };
    for (std::uint32_t y = 0; y < panel_side; ++y)
        for (std::uint32_t x = 0; x < panel_side; ++x)
            picture.set(box.x + static_cast<int>(x), box.y + static_cast<int>(y),
                        viridis(place(values[std::size_t{y} * panel_side + x])));
    picture.axes(box, {u - half, u + half, "u (direction cosine, to the right)"}, {v - half, v + half, "v (down)"});
    picture.text(box.x + box.width / 2.0, box.y - Picture::line_height - 6, title, black, 0.5);
    picture.bar({box.x + box.width + 20, box.y, 24, box.height}, {0, most, "W/sr"}, place);
}

/** The whole pattern, and a part of it, side by side. */
void write_figure(const std::string &path, const ClspDoePatternInfo &i, const std::vector<float> &texels,
                  const std::vector<double> &zoom) {
    const double u = zoom.empty() ? 0 : zoom[0], v = zoom.empty() ? 0 : zoom[1];
    const double half = zoom.empty() ? std::min(i.half_extent_x, i.half_extent_y) / 12 : zoom[2];
    const auto part = [&](double at_u, double at_v, double size) {
        const auto x_of = [&](double at) { return (at / i.half_extent_x + 1) / 2 * i.image_width; };
        const auto y_of = [&](double at) { return (at / i.half_extent_y + 1) / 2 * i.image_height; };
        return panel(texels, i.image_width, i.image_height, x_of(at_u - size), y_of(at_v - size), x_of(at_u + size),
                     y_of(at_v + size));
    };
    constexpr int side = panel_side, column = Picture::left_margin + side + Picture::bar_width;
    Picture picture(2 * column, Picture::top_margin + side + Picture::bottom_margin);
    // Square in direction cosines.
    const double extent = std::max(i.half_extent_x, i.half_extent_y);
    const Box left = {Picture::left_margin, Picture::top_margin, side, side};
    draw_panel(picture, left, part(0, 0, extent), 0, 0, extent, "The pattern; the frame is the part at the right");
    const auto pixel = [&](double at) { return static_cast<int>((at / extent + 1) / 2 * side); };
    for (int k = 0; k < 2; ++k) // a frame that is cut by the panel stays within it
        picture.outline({std::max(left.x + pixel(u - half), left.x) - k, std::max(left.y + pixel(v - half), left.y) - k,
                         std::min(pixel(u + half), side) - std::max(pixel(u - half), 0) + 1 + 2 * k,
                         std::min(pixel(v + half), side) - std::max(pixel(v - half), 0) + 1 + 2 * k},
                        {255, 90, 60});
    draw_panel(picture, {column + Picture::left_margin, Picture::top_margin, side, side}, part(u, v, half), u, v, half,
               "The part; each panel has its own scale");
    picture.write(path);
}

void add_options(CLI::App &app, DoePatternArguments &a, bool &json, bool &quiet) {
    app.add_option("DESIGN", a.design, "Phase of the element: NAME.npy, with NAME.json beside it")
        ->required()
        ->type_name("");
    const auto number = [&](const char *name, auto &value, const Range &range, const char *what) {
        add_number_with_default(app, name, value, range, what);
    };
    const auto numbers = [&](const char *name, std::vector<double> &value, const Range &range, const char *what) {
        add_numbers(app, name, value, range, what);
    };
    app.add_option("--beam", a.beam,
                   "gaussian, flat_circle, flat_square, super_gaussian, skewed or image (default gaussian)")
        ->check(known_words(beams))
        ->type_name("WORD");
    numbers("--beam-sigma-um", a.beam_sigma_um, ranges::beam_um,
            "Standard deviation of a Gaussian or skewed beam's intensity, or x,y (default 250)");
    numbers("--beam-width-um", a.beam_width_um, ranges::beam_um,
            "Full width of the other beams, or width,height (default 1000)");
    number("--beam-order", a.beam_order, ranges::beam_order, "Of a super-Gaussian beam");
    numbers("--beam-skew", a.beam_skew, ranges::beam_skew, "Shape parameter of a skewed beam, or x,y");
    number("--m-squared", a.m_squared, ranges::beam_quality, "Beam quality: the spots are that much wider");
    app.add_option("--beam-image", a.beam_image, "Image of the beam's intensity over --beam-width-um")
        ->type_name("IMAGE");
    app.add_option("--transfer", a.transfer,
                   "How numbers of that image stand for light: auto (as the file says), linear or srgb (default auto)")
        ->check(known_words({"auto", "linear", "srgb"}))
        ->type_name("WORD");
    number("--levels", a.levels, ranges::levels, "Levels that manufacture has; 0: no limit");
    number("--depth-error", a.depth_error, ranges::relative_depth_error, "All depths are (1 + this) times as deep");
    number("--rounding-um", a.rounding_um, ranges::rounding_um, "Standard deviation by which the relief is blurred");
    number("--etch-noise-nm", a.etch_noise_nm, ranges::etch_noise_nm, "RMS error of each pixel's depth");
    add_number(app, "--refractive-index", a.refractive_index, ranges::refractive_index,
               "At the design's wavelength (default 1.4507, fused silica)");
    number("--dispersion-per-um", a.dispersion_per_um, ranges::dispersion_per_um,
           "Change of the index with the wavelength");
    add_seed(app, a.seed, "Of the etch noise");
    numbers("--wavelength-nm", a.wavelengths_nm, ranges::wavelength_nm,
            "Of the laser, or of its lines (default the design's)");
    numbers("--line-power", a.line_powers, ranges::relative_power, "Relative power of each line (default all equal)");
    numbers("--doe-size-mm", a.doe_size_mm, ranges::element_mm,
            "Size of the element, or width,height (default without limit)");
    app.add_option("--evaluation", a.evaluation, "orders, aperture or auto (default auto)")
        ->check(known_words(evaluations))
        ->type_name("WORD");
    number("--oversampling", a.oversampling, ranges::samples, "Directions per pixel of an aperture");
    number("--power-w", a.power_w, ranges::power_w, "Of the beam");
    app.add_option("--texels", a.texels, "Size of the image: width,height (default 2048,2048)")
        ->delimiter(',')
        ->expected(2)
        ->check(unsigned_integer<std::uint32_t>())
        ->type_name("W,H");
    numbers("--half-extent", a.half_extent, ranges::cosine,
            "The image covers so much to each side in direction cosines, or x,y (default: all)");
    app.add_flag("--smooth", a.smooth, "The phase is smooth between the pixels' centres: no envelope of square pixels");
    app.add_option("--cache", a.cache, "Folder in which patterns are kept between runs")->type_name("FOLDER");
    app.add_option("--device", a.device, "OpenCL device, as for render")->type_name("TEXT");
    app.add_flag("--overwrite", a.overwrite, "Replace files that exist");
    app.add_flag("--json", json, "Print JSON");
    app.add_flag("--quiet", quiet, "Print warnings and errors only");
}

/** A part that shows nothing of the pattern is a mistake. */
void check_zoom(const std::vector<double> &zoom, double extent_x, double extent_y) {
    if (zoom.empty())
        return;
    if (!(zoom[2] > 0 && zoom[2] <= 1 && std::isfinite(zoom[0]) && std::isfinite(zoom[1])))
        throw InputError("--zoom U,V,HALF: the half width must be above 0 and at most 1, the centre finite");
    if (std::abs(zoom[0]) - zoom[2] >= extent_x || std::abs(zoom[1]) - zoom[2] >= extent_y)
        throw InputError(fmt::format("--zoom {},{},{}: lies outside of the pattern, which reaches from -{:g} to {:g} "
                                     "and from -{:g} to {:g} in direction cosines",
                                     zoom[0], zoom[1], zoom[2], extent_x, extent_x, extent_y, extent_y));
}

void run(const DoePatternArguments &a, bool to_file, Console &console) {
    check_zoom(a.zoom, 1, 1);
    const std::string design_stem = without_npy(a.design);
    std::vector<std::string> inputs = {design_stem + ".npy", design_stem + ".json"};
    if (!a.beam_image.empty())
        inputs.push_back(a.beam_image);
    std::string stem;
    if (to_file)
        stem = checked_stem(a.output, {".npy", ".json"}, a.overwrite, inputs);
    else if (a.figure)
        check_output_file({a.output, "-o", image_io::format_named("PNG").extensions}, a.overwrite, inputs);
    const Design design = read_design(a.design, console);
    const clspeckle::DoePattern pattern = compute(a, design, console);
    const ClspDoePatternInfo info = pattern.info();
    check_zoom(a.zoom, info.half_extent_x, info.half_extent_y);
    check_interrupt();
    Json budget = budget_of(info);
    if (to_file) {
        const std::vector<float> texels = pattern.texels();
        write_npy_with_json(stem, info.image_width, info.image_height, texels, budget.dump(2) + "\n");
    } else if (a.figure) {
        write_figure(a.output, info, pattern.texels(), a.zoom);
    }
    if (console.json()) {
        console.result(budget.dump(2));
        return;
    }
    print_budget(info, console);
    if (to_file)
        console.print(fmt::format(
            "Look it up with: clspeckle render SCENE -o FOLDER --pattern {}.npy --pattern-projection direction_cosines "
            "--pattern-half-extent-x {:.9g} --pattern-half-extent-y {:.9g} --pattern-filter area",
            stem, info.half_extent_x, info.half_extent_y));
}

} // namespace

void add_doe_pattern(CLI::App &group, DoePatternCommands &commands, bool &json, bool &quiet) {
    DoePatternArguments &a = commands.arguments;
    CLI::App &pattern = *group.add_subcommand("pattern", "Compute the pattern of a DOE, for render --pattern");
    pattern.footer(examples);
    pattern
        .add_option("-o,--output", a.output,
                    "NPY of radiant intensities; a JSON with what is known is written beside it")
        ->required()
        ->type_name("FILE.npy");
    add_options(pattern, a, json, quiet);
    CLI::App &inspect = *group.add_subcommand("inspect", "Say where a DOE's light goes, and draw its pattern");
    inspect.footer(examples);
    inspect
        .add_option("-o,--output", a.output,
                    "Figure with axes and scales: the pattern, and a part of it (colors go with the square root of the "
                    "intensity)")
        ->type_name("FILE.png");
    inspect
        .add_option("--zoom", a.zoom,
                    "Part of the pattern in the figure: centre u,v and half width (default 0,0, a twelfth)")
        ->delimiter(',')
        ->expected(3)
        ->type_name("U,V,HALF");
    add_options(inspect, a, json, quiet);
    commands.pattern_command = &pattern;
    commands.inspect_command = &inspect;
}

bool run_doe_pattern(const DoePatternCommands &commands, Console &console) {
    const bool to_file = commands.pattern_command->parsed();
    if (!to_file && !commands.inspect_command->parsed())
        return false;
    DoePatternArguments arguments = commands.arguments;
    arguments.figure = !to_file && commands.inspect_command->count("--output") > 0;
    if (!to_file && !arguments.figure && !arguments.zoom.empty())
        throw InputError("--zoom is a part of the figure, which is drawn with -o FILE.png");
    const CLI::App &command = to_file ? *commands.pattern_command : *commands.inspect_command;
    if (command.count("--beam-image") > 0 && command.count("--beam") > 0 && arguments.beam != "image")
        throw InputError(fmt::format("--beam {} has no effect beside --beam-image; leave it out", arguments.beam));
    if (command.count("--transfer") > 0 && command.count("--beam-image") == 0)
        throw InputError("--transfer is of the numbers of --beam-image; name that, or leave it out");
    with_option_names(option_names, [&] { run(arguments, to_file, console); });
    return true;
}

} // namespace tools

#include "doe_design.hpp"

#include "context.hpp"
#include "doe_files.hpp"
#include "errors.hpp"
#include "io/image_io.hpp"
#include "json.hpp"
#include "number_options.hpp"
#include "text.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

namespace tools {

namespace {

constexpr const char *design_examples =
    R"(Designs the phase of a cell of square pixels that repeats over the beam and splits it into the wanted orders, by
weighted Gerchberg-Saxton, soft quantization to the phase levels and, with --search, direct binary search. Says which
part of the light goes into the dots, how equal they are, and where the rest goes.

ORDERS is a JSON file with "orders": [[m, n, weight], ...] (m to the right, n down; the weight may be left out), or with
"directions": [[u, v, weight], ...] as direction cosines, which are snapped to the cell's orders: what `clspeckle doe
layout` writes, or an earlier design. Without it a semi-random layout of --dots is made. Two phase levels make every
order's mirror image too: use --symmetric (or --mirror with your own list).

Written: OUTPUT.npy (float32, height x width, phase in radians) and OUTPUT.json beside it (the cell, the orders, the
figures), both complete or not at all.

Examples:
  clspeckle doe design -o dots
  clspeckle doe design -o binary --levels 2 --symmetric --search 3
  clspeckle doe layout -o layout --dots 2509 \
      && clspeckle doe design layout.json -o dots2509 --levels 16
)";

constexpr const char *layout_examples =
    R"(Puts dots into a field of view: at random, but with a least distance, and so that the dots around a dot tell it from the
others of its row. The measure of that, 0 for dots that look alike and 1 for dots whose neighbourhoods have nothing in
common, is printed for the two dots that are most alike; docs/method/doe-design.md defines it.

Written: OUTPUT.json with "directions" and, on the orders of a cell, "orders", which `clspeckle doe design` takes.

Examples:
  clspeckle doe layout -o layout
  clspeckle doe layout -o free --dots 2509 --free --field-of-view 70,50
)";

/** Of the layout that is made without a list. */
constexpr std::initializer_list<const char *> layout_options = {"--dots", "--field-of-view", "--min-distance",
                                                                "--min-difference", "--symmetric"};

/** What the library's messages call the options. */
const std::vector<std::pair<std::string, std::string>> option_names = {
    {"mirror_orders is set", "--mirror is given"},
    {"set mirror_orders", "give --mirror"},
    {"mirror_orders", "--mirror"},
    {"search_sweeps", "--search"},
    {"fix_phase_iteration", "--fix-phase-iteration"},
    {"quantization_iterations", "--quantization-iterations"},
    {"beam_diameter_m", "--beam-um"},
    {"pixel_pitch_m", "--pitch-um"},
    {"min_distance", "--min-distance"},
    {"min_difference", "--min-difference"},
    {"row_half_height", "--row"},
    {"neighborhood_radius", "--radius"},
    {"repair_rounds", "--repair-rounds"},
    {"count(?= is)", "--dots"}};

/** An option that would do nothing hides a mistake. */
void refuse_options(const CLI::App &app, std::initializer_list<const char *> names, const char *why) {
    for (const char *name : names)
        if (app.count(name) > 0)
            throw InputError(fmt::format("{} has no effect {}; leave it out", name, why));
}

/** The list of a file; directions are snapped when the cell is known. */
struct Wanted {
    std::vector<ClspDoeDesignOrder> orders;
    std::vector<double> directions, weights; ///< Of directions.
    std::map<std::string, double> cell;      ///< What the file says of the cell.
};

Wanted read_wanted(const std::string &path) {
    const JsonDocument document = read_json(path);
    const Json &file = document.root();
    const bool orders = file.is_object() && file.contains("orders"),
               directions = file.is_object() && file.contains("directions");
    if (!orders && !directions)
        throw InputError(fmt::format(
            "{}: holds neither \"orders\": [[m, n, weight], ...] nor \"directions\": [[u, v, weight], ...]", path));
    const char *key = orders ? "orders" : "directions";
    const Json &list = file[key];
    if (!list.is_array() || list.empty())
        throw InputError(fmt::format("{}: \"{}\" is {}; a list with at least one entry is needed", path, key,
                                     list.is_array() ? "empty" : "no list"));
    DotList dots = read_dot_list(file, path, key);
    Wanted wanted;
    if (orders)
        for (std::size_t k = 0; k < dots.weights.size(); ++k)
            wanted.orders.push_back({dots.numbers[2 * k], dots.numbers[2 * k + 1], dots.weights[k]});
    wanted.directions = std::move(dots.directions);
    wanted.weights = std::move(dots.weights);
    if (orders) // directions mean the same with any cell
        for (const char *name : {"width", "height", "pixel_pitch_m", "wavelength_m"})
            if (file.contains(name))
                wanted.cell[name] = json_number(file[name], fmt::format("{}: \"{}\"", path, name));
    return wanted;
}

/** A number that the command line and a file may both say. */
double agreed(double given, const std::map<std::string, double> &file, const char *name, const char *option,
              double fallback) {
    const auto found = file.find(name);
    if (found == file.end())
        return given > 0.0 ? given : fallback;
    if (given > 0.0 && std::abs(given - found->second) > 1e-6 * found->second)
        throw InputError(
            fmt::format("{} says {}, but the list of orders was made for a {} of {}: orders of one cell are other "
                        "directions in another; leave the option out",
                        option, given, name, found->second));
    return found->second;
}

struct Cell {
    std::uint32_t width, height;
    double pixel_pitch_m, wavelength_m;
};

Cell settle(const DoeCellArguments &a, const std::map<std::string, double> &file) {
    const auto positive = [](double value, const char *option) {
        if (!(value >= 0.0) || std::isinf(value))
            throw InputError(fmt::format("{} is {}; a number above 0 is needed", option, value));
    };
    positive(a.pixel_pitch_um, "--pitch-um");
    positive(a.wavelength_nm, "--wavelength-nm");
    const auto defaults = clspeckle::make<ClspDoeDesignDesc>();
    const auto side = [&](std::size_t index, const char *name, std::uint32_t fallback) {
        const double given = a.size.empty() ? 0.0 : a.size[a.size.size() > 1 ? index : 0];
        const double value = agreed(given, file, name, "--size", fallback);
        if (!(value >= 1.0 && value <= CLSP_MAX_DOE_SIDE) || value != std::floor(value))
            throw InputError(
                fmt::format("the {} of the cell is {}; it must be 1 to {} pixels", name, value, CLSP_MAX_DOE_SIDE));
        return static_cast<std::uint32_t>(value);
    };
    if (!a.size.empty() && (a.size[0] == 0 || a.size.back() == 0))
        throw InputError("--size holds a 0; a cell has at least one pixel along each axis");
    return {side(0, "width", defaults.width), side(1, "height", defaults.height),
            agreed(a.pixel_pitch_um * 1e-6, file, "pixel_pitch_m", "--pitch-um", defaults.pixel_pitch_m),
            agreed(a.wavelength_nm * 1e-9, file, "wavelength_m", "--wavelength-nm", defaults.wavelength_m)};
}

ClspDotLayoutDesc layout_desc(const DoeCellArguments &a, const Cell &cell) {
    auto desc = clspeckle::make<ClspDotLayoutDesc>();
    constexpr double half_degree = M_PI / 360.0;
    desc.count = a.dots;
    desc.seed = a.seed;
    desc.width = cell.width;
    desc.height = cell.height;
    desc.pixel_pitch_m = cell.pixel_pitch_m;
    desc.wavelength_m = cell.wavelength_m;
    desc.half_angle_x_rad = a.field_of_view_deg.front() * half_degree;
    desc.half_angle_y_rad = a.field_of_view_deg.back() * half_degree;
    desc.min_distance = a.min_distance;
    desc.min_difference = a.min_difference;
    desc.beam_diameter_m = a.beam_diameter_um * 1e-6;
    desc.point_symmetric = a.symmetric ? 1 : 0;
    return desc;
}

Json layout_numbers(const ClspDotLayoutInfo &info) {
    return {{"min_distance", info.min_distance},
            {"mean_spacing", info.mean_spacing},
            {"row_half_height", info.row_half_height},
            {"neighborhood_radius", info.neighborhood_radius},
            {"tolerance", info.tolerance},
            {"mean_neighbors", info.mean_neighbors},
            {"min_difference", info.min_difference},
            {"mean_difference", info.mean_difference},
            {"pair_count", info.pair_count},
            {"worst_pair", {info.worst_first, info.worst_second}},
            {"moved_count", info.moved_count}};
}

Json report_numbers(const ClspDoeDesignReport &report) {
    return {{"order_count", report.order_count},
            {"efficiency", report.efficiency},
            {"grid_efficiency", report.grid_efficiency},
            {"uniformity_rms", report.uniformity_rms},
            {"uniformity_peak_to_peak", report.uniformity_peak_to_peak},
            {"weakest", report.weakest},
            {"strongest", report.strongest},
            {"zero_order", report.zero_order},
            {"zero_order_relative", report.zero_order_relative},
            {"zero_order_wanted", report.zero_order_wanted == 1},
            {"largest_ghost", report.largest_ghost},
            {"largest_ghost_relative", report.largest_ghost_relative},
            {"ghost_order", {report.ghost_m, report.ghost_n}},
            {"other_orders", report.other_orders},
            {"beyond", report.beyond},
            {"search_changes", report.search_changes},
            {"search_sweeps", report.search_sweeps},
            {"seconds", report.seconds}};
}

std::string summary(const ClspDoeDesignReport &r, const std::string &name) {
    const std::string relative_zero =
        fmt::format("{} ({:.2f} of a dot's)", percent(r.zero_order), r.zero_order_relative);
    return table({{"orders", fmt::format("{}", r.order_count)},
                  {"efficiency", fmt::format("{} ({} without the pixels' envelope)", percent(r.efficiency),
                                             percent(r.grid_efficiency))},
                  {"uniformity error", fmt::format("{} RMS, {} peak to peak", percent(r.uniformity_rms),
                                                   percent(r.uniformity_peak_to_peak))},
                  {"zero order", r.zero_order_wanted ? relative_zero + ", wanted" : relative_zero},
                  {"largest ghost",
                   fmt::format("{:.3f} of a dot's power, at ({}, {})", r.largest_ghost_relative, r.ghost_m, r.ghost_n)},
                  {"other orders", percent(r.other_orders)},
                  {"beyond the base band", percent(r.beyond)},
                  {"time", fmt::format("{:.1f} s", r.seconds)},
                  {"written", name + ".npy, " + name + ".json"}});
}

void write_design(const std::string &name, const ClspDoeDesignDesc &desc, const clspeckle::DoeDesign &design,
                  const Json &extra) {
    const std::vector<float> phase = design.phase(std::size_t{desc.width} * desc.height);
    Json json = {{"pixel_pitch_m", desc.pixel_pitch_m},
                 {"wavelength_m", desc.wavelength_m},
                 {"width", desc.width},
                 {"height", desc.height},
                 {"periodic", true},
                 {"levels", desc.levels},
                 {"seed", desc.seed},
                 {"tool", "clspeckle doe design"}};
    json["report"] = report_numbers(design.report());
    json.update(extra);
    for (const ClspDoeDesignOrder &order : design.orders())
        json["orders"].push_back({order.m, order.n, order.weight});
    write_npy_with_json(name, desc.width, desc.height, phase, json.dump() + "\n");
}

void run_design(const DoeDesignArguments &a, Console &console) {
    const std::vector<std::string> inputs = a.orders.empty() ? std::vector<std::string>() : std::vector{a.orders};
    const std::string name = checked_stem(a.output, {".npy", ".json"}, a.cell.overwrite, inputs);
    Wanted wanted;
    if (!a.orders.empty())
        wanted = read_wanted(a.orders);
    const Cell cell = settle(a.cell, wanted.cell);
    if (a.period_um != 0.0)
        for (const std::uint32_t side : {cell.width, cell.height})
            if (!(std::abs(a.period_um * 1e-6 - side * cell.pixel_pitch_m) <= 1e-3 * cell.pixel_pitch_m))
                throw InputError(
                    fmt::format("--period-um is {}, but {} pixels of {:g} um are {:g} um: change one of --period-um, "
                                "--size and --pitch-um, or leave one out",
                                a.period_um, side, cell.pixel_pitch_m * 1e6, side * cell.pixel_pitch_m * 1e6));
    Json extra = Json::object();
    if (a.orders.empty()) {
        const clspeckle::DotLayout layout = clspeckle::dot_layout(layout_desc(a.cell, cell));
        for (std::size_t k = 0; k < layout.orders.size() / 2; ++k)
            wanted.orders.push_back({layout.orders[2 * k], layout.orders[2 * k + 1], 1.0});
        extra["layout"] = layout_numbers(layout.info);
    } else if (!wanted.directions.empty()) {
        const auto snapped = clspeckle::DoeDesign::snap(cell.width, cell.height, cell.pixel_pitch_m, cell.wavelength_m,
                                                        wanted.directions);
        wanted.orders = snapped.orders;
        double largest = 0.0, sum = 0.0;
        for (std::size_t k = 0; k < snapped.errors.size(); ++k) {
            wanted.orders[k].weight = wanted.weights[k];
            largest = std::max(largest, snapped.errors[k]);
            sum += snapped.errors[k] * snapped.errors[k];
        }
        const double rms = std::sqrt(sum / static_cast<double>(snapped.errors.size()));
        extra["snap_error"] = {{"rms", rms}, {"largest", largest}};
        console.print(
            fmt::format("{} directions snapped to the cell's orders: off by {:.3g} RMS, {:.3g} at most (direction "
                        "cosines; the orders are {:.3g} x {:.3g} apart)\n",
                        wanted.orders.size(), rms, largest, cell.wavelength_m / (cell.pixel_pitch_m * cell.width),
                        cell.wavelength_m / (cell.pixel_pitch_m * cell.height)));
    }
    static const std::map<std::string, std::uint32_t> rules = {{"gs", CLSP_DOE_RULE_GS},
                                                               {"gsw", CLSP_DOE_RULE_GSW},
                                                               {"nogrette", CLSP_DOE_RULE_NOGRETTE},
                                                               {"kim", CLSP_DOE_RULE_KIM}};
    auto desc = clspeckle::make<ClspDoeDesignDesc>();
    desc.width = cell.width;
    desc.height = cell.height;
    desc.pixel_pitch_m = cell.pixel_pitch_m;
    desc.wavelength_m = cell.wavelength_m;
    desc.beam_diameter_m = a.cell.beam_diameter_um * 1e-6;
    desc.levels = a.levels;
    desc.orders = wanted.orders.data();
    desc.order_count = wanted.orders.size();
    desc.seed = a.cell.seed;
    desc.rule = rules.at(a.rule);
    desc.feedback = a.feedback;
    desc.iterations = a.iterations;
    desc.quantization_iterations = a.quantization_iterations;
    desc.fix_phase_iteration = a.fix_phase_iteration;
    desc.search_sweeps = a.search_sweeps;
    desc.compensate_envelope = a.keep_envelope ? 0 : 1;
    desc.mirror_orders = a.mirror ? 1 : 0;
    const clspeckle::Context context = make_context(a.device);
    const clspeckle::DoeDesign design(context, desc, progress_on(console));
    extra["rule"] = a.rule;
    write_design(name, desc, design, extra);
    const ClspDoeDesignReport report = design.report();
    if (console.json()) {
        Json result = report_numbers(report);
        result.update(extra);
        result["files"] = {name + ".npy", name + ".json"};
        result["warnings"] = console.warnings();
        console.result(result.dump(2));
    }
    console.print(summary(report, name));
}

void run_layout(const DoeLayoutArguments &a, Console &console) {
    const std::string name = checked_stem(a.output, {".json"}, a.cell.overwrite, {});
    const Cell cell = settle(a.cell, {});
    ClspDotLayoutDesc desc = layout_desc(a.cell, cell);
    desc.lattice = a.free ? 0 : 1;
    desc.row_half_height = a.row_half_height;
    desc.neighborhood_radius = a.neighborhood_radius;
    desc.tolerance = a.tolerance;
    desc.repair_rounds = a.repair_rounds;
    const clspeckle::DotLayout layout = clspeckle::dot_layout(desc, progress_on(console));
    const Json numbers = layout_numbers(layout.info);
    Json json = {{"wavelength_m", desc.wavelength_m},
                 {"seed", desc.seed},
                 {"tool", "clspeckle doe layout"},
                 {"half_angle_x_rad", desc.half_angle_x_rad},
                 {"half_angle_y_rad", desc.half_angle_y_rad},
                 {"layout", numbers}};
    if (!a.free)
        json.update({{"width", desc.width}, {"height", desc.height}, {"pixel_pitch_m", desc.pixel_pitch_m}});
    for (std::size_t k = 0; k < layout.directions.size(); k += 2) {
        json["directions"].push_back({layout.directions[k], layout.directions[k + 1]});
        if (!a.free)
            json["orders"].push_back({layout.orders[k], layout.orders[k + 1]});
    }
    image_io::write_text(name + ".json", json.dump() + "\n");
    if (console.json()) {
        Json result = numbers;
        result["files"] = {name + ".json"};
        result["warnings"] = console.warnings();
        console.result(result.dump(2));
    }
    const ClspDotLayoutInfo &info = layout.info;
    console.print(table(
        {{"dots", fmt::format("{}", desc.count)},
         {"least distance", fmt::format("{:.5f} in direction cosines ({:.2f} of the mean spacing)", info.min_distance,
                                        info.min_distance / info.mean_spacing)},
         {"neighbourhood", fmt::format("radius {:.4f}, {:.1f} dots; they match within {:.5f}", info.neighborhood_radius,
                                       info.mean_neighbors, info.tolerance)},
         {"difference", fmt::format("{:.3f} at least, {:.3f} on average, of {} pairs in rows of +-{:.5f}",
                                    info.min_difference, info.mean_difference, info.pair_count, info.row_half_height)},
         {"moved", fmt::format("{} dots", info.moved_count)},
         {"written", name + ".json"}}));
}

void add_cell(CLI::App &app, DoeCellArguments &a, bool &json, bool &quiet) {
    app.add_option("--size", a.size,
                   "Pixels of the cell: WIDTH,HEIGHT or one number for both; prime factors up to 13 (default 512)")
        ->delimiter(',')
        ->expected(1, 2)
        ->allow_extra_args(false)
        ->check(unsigned_integer<std::uint32_t>())
        ->type_name("INTEGER,...");
    add_number(app, "--pitch-um", a.pixel_pitch_um, ranges::pixel_pitch_um, "Side of a pixel (default 0.4)");
    add_number(app, "--wavelength-nm", a.wavelength_nm, ranges::wavelength_nm, "Wavelength (default 940)");
    add_number(app, "--beam-um", a.beam_diameter_um, ranges::beam_um,
               "Diameter of the beam: dots closer than the diffraction limit are then refused");
    add_number_with_default(app, "--dots", a.dots, ranges::dots, "How many dots");
    add_numbers(app, "--field-of-view", a.field_of_view_deg, ranges::angle_deg,
                fmt::format("Full angles, horizontal and vertical (default {:g},{:g})", a.field_of_view_deg[0],
                            a.field_of_view_deg[1]))
        ->expected(1, 2)
        ->allow_extra_args(false);
    add_number(app, "--min-distance", a.min_distance, ranges::distance_of_directions,
               "Least distance between dots in direction cosines (default: nearly the largest possible)");
    add_number(app, "--min-difference", a.min_difference, ranges::part,
               fmt::format("Of the neighbourhoods of any two dots of a row; 0: measured only (default {})",
                           a.min_difference));
    app.add_flag("--symmetric", a.symmetric, "With every dot its mirror image, as elements of two levels make them");
    add_seed(app, a.seed, "Seed of everything random");
    app.add_flag("--overwrite", a.overwrite, "Replace files that exist");
    app.add_flag("--json", json, "Print the figures as JSON on standard output, everything else on standard error");
    app.add_flag("--quiet", quiet, "Print warnings and errors only");
}

} // namespace

void add_doe_design(CLI::App &group, DoeDesignCommands &commands, bool &json, bool &quiet) {
    DoeDesignArguments &d = commands.design;
    CLI::App &design = *group.add_subcommand("design", "Design the phase of a beam splitter");
    commands.design_command = &design;
    design.footer(design_examples);
    design
        .add_option("ORDERS", d.orders, "JSON file with the wanted orders or directions; without it a layout is made")
        ->type_name("");
    design.add_option("-o,--output", d.output, "Name of the files, without .npy and .json")
        ->required()
        ->type_name("NAME");
    add_number_with_default(design, "--levels", d.levels, ranges::levels, "Phase levels; 0: continuous");
    design
        .add_option("--rule", d.rule,
                    "How the weights of the orders are adapted: gs, gsw, nogrette or kim (default gsw)")
        ->type_name("WORD")
        ->take_last()
        ->check(CLI::IsMember({"gs", "gsw", "nogrette", "kim"}));
    add_number(design, "--feedback", d.feedback, ranges::feedback, "Of the rule (default 1; nogrette 0.7)");
    add_number_with_default(design, "--iterations", d.iterations, ranges::sweeps, "Before the phase is quantized");
    add_number_with_default(design, "--quantization-iterations", d.quantization_iterations, ranges::sweeps,
                            "In which the levels are taken");
    add_number_with_default(design, "--fix-phase-iteration", d.fix_phase_iteration, ranges::sweeps,
                            "From which on kim keeps the phases of the orders");
    add_number_with_default(design, "--search", d.search_sweeps, ranges::sweeps,
                            "Sweeps of direct binary search at most");
    design.add_flag("--keep-envelope", d.keep_envelope,
                    "Make the powers before the pixels' envelope as wanted, not those behind it");
    design.add_flag("--mirror", d.mirror, "With two levels: add missing mirror images to the list");
    add_number(design, "--period-um", d.period_um, ranges::period_um,
               "Period of the cell, checked against --size and --pitch-um");
    design.add_option("--device", d.device, "OpenCL device, as for render")->type_name("TEXT");
    add_cell(design, d.cell, json, quiet);

    DoeLayoutArguments &l = commands.layout;
    CLI::App &layout = *group.add_subcommand("layout", "Make a semi-random layout of dots");
    commands.layout_command = &layout;
    layout.footer(layout_examples);
    layout.add_option("-o,--output", l.output, "Name of the file, without .json")->required()->type_name("NAME");
    layout.add_flag("--free", l.free, "Dots anywhere, not on the orders of a cell");
    add_number(
        layout, "--row", l.row_half_height, ranges::distance_of_directions,
        "Dots whose v differ by no more may be mistaken for each other, in direction cosines (default: half of the "
        "least distance)");
    add_number(layout, "--radius", l.neighborhood_radius, ranges::distance_of_directions,
               "Of a neighbourhood, in direction cosines (default: three mean spacings)");
    add_number(layout, "--tolerance", l.tolerance, ranges::distance_of_directions,
               "Neighbours within this match, in direction cosines (default: a quarter of the least distance)");
    add_number_with_default(layout, "--repair-rounds", l.repair_rounds, ranges::sweeps,
                            "In which dots that look alike are moved");
    add_cell(layout, l.cell, json, quiet);
}

bool run_doe_design(const DoeDesignCommands &commands, Console &console) {
    if (commands.design_command->parsed()) {
        if (!commands.design.orders.empty())
            refuse_options(*commands.design_command, layout_options, "beside a list of orders or directions");
        with_option_names(option_names, [&] { run_design(commands.design, console); });
    } else if (commands.layout_command->parsed()) {
        if (commands.layout.free)
            refuse_options(*commands.layout_command, {"--size", "--pitch-um"}, "with --free, which knows no cell");
        with_option_names(option_names, [&] { run_layout(commands.layout, console); });
    } else {
        return false;
    }
    return true;
}

} // namespace tools

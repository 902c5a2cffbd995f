#include "depth.hpp"

#include "context.hpp"
#include "errors.hpp"
#include "files.hpp"
#include "interrupt.hpp"
#include "io/formats.hpp"
#include "json.hpp"
#include "text.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>

namespace tools {

namespace {

double median_depth(const DepthFrame &frame, double ClspDepthDot::*member) {
    std::vector<double> values;
    for (const ClspDepthDot &dot : frame.result.dots)
        if (dot.reason == CLSP_DEPTH_REASON_PLACED)
            values.push_back(dot.*member);
    if (values.empty())
        return std::nan("");
    const auto middle = values.begin() + std::ptrdiff_t(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    return *middle;
}

std::map<std::string, std::uint64_t> detected_reasons(const DepthFrame &frame) {
    std::map<std::string, std::uint64_t> counts;
    for (const ClspDepthDot &dot : frame.result.dots)
        ++counts[clspeckle::Depth::reason(dot.reason)];
    return counts;
}

std::map<std::string, std::uint64_t> pattern_reasons(const DepthFrame &frame) {
    std::map<std::string, std::uint64_t> counts;
    for (const ClspDepthPatternDot &dot : frame.pattern)
        ++counts[clspeckle::Depth::reason(dot.reason)];
    return counts;
}

std::vector<std::string> warnings_of(const DepthFrame &frame) {
    std::vector<std::string> texts;
    for (std::uint32_t bit = 1; bit != 0 && bit <= frame.result.summary.warnings; bit <<= 1)
        if (frame.result.summary.warnings & bit)
            texts.push_back(clspeckle::Depth::warning(bit));
    return texts;
}

Json to_json(const DepthFrame &frame) {
    const ClspDepthSummary &s = frame.result.summary;
    return {{"file", frame.name},
            {"width", frame.width},
            {"height", frame.height},
            {"detected_count", s.detected_count},
            {"fitted_count", s.fitted_count},
            {"placed_count", s.placed_count},
            {"saturated_count", s.saturated_count},
            {"merged_count", s.merged_count},
            {"pattern_in_view_count", s.pattern_in_view_count},
            {"median_depth_m", or_null(median_depth(frame, &ClspDepthDot::depth_m))},
            {"median_depth_sd_m", or_null(median_depth(frame, &ClspDepthDot::depth_sd_m))},
            {"median_epipolar_error_px", or_null(s.median_epipolar_error_px)},
            {"expected_epipolar_error_px", or_null(s.expected_epipolar_error_px)},
            {"median_sigma_px", or_null(s.median_sigma_px)},
            {"median_centre_sd_px", or_null(s.median_centre_sd_px)},
            {"detected_dots", detected_reasons(frame)},
            {"pattern_dots", pattern_reasons(frame)},
            {"warnings", warnings_of(frame)}};
}

std::string number_text(double value, const char *format) {
    return std::isfinite(value) ? fmt::format(fmt::runtime(format), value) : "-";
}

void print_frames(const std::vector<DepthFrame> &frames, Console &console) {
    std::vector<std::vector<std::string>> rows = {
        {"file", "dots", "placed", "depth m", "+- mm", "epipolar px", "expected", "sigma px", "saturated", "merged"}};
    std::map<std::string, std::uint64_t> unplaced;
    for (const DepthFrame &frame : frames) {
        const ClspDepthSummary &s = frame.result.summary;
        rows.push_back({frame.name, std::to_string(s.detected_count),
                        s.detected_count > 0 ? fmt::format("{} ({:.1f} %)", s.placed_count,
                                                           100.0 * double(s.placed_count) / double(s.detected_count))
                                             : "0",
                        number_text(median_depth(frame, &ClspDepthDot::depth_m), "{:.4f}"),
                        number_text(1e3 * median_depth(frame, &ClspDepthDot::depth_sd_m), "{:.3g}"),
                        number_text(s.median_epipolar_error_px, "{:.3f}"),
                        number_text(s.expected_epipolar_error_px, "{:.3f}"), number_text(s.median_sigma_px, "{:.2f}"),
                        std::to_string(s.saturated_count), std::to_string(s.merged_count)});
        for (const auto &[reason, count] : detected_reasons(frame))
            if (reason != clspeckle::Depth::reason(CLSP_DEPTH_REASON_PLACED))
                unplaced[reason] += count;
    }
    console.result(table(rows));
    if (unplaced.empty())
        return;
    rows = {{"dots without a depth", ""}};
    for (const auto &[reason, count] : unplaced)
        rows.push_back({reason, std::to_string(count)});
    console.result("\n" + table(rows));
}

/** True for what write_depth_pictures() may write into the folder. */
bool is_picture(const std::string &file, const std::string &folder) {
    std::error_code code; // a link and what it leads to
    const auto has_picture_name = [&](const std::filesystem::path &path) {
        const std::string name = path.filename().string();
        const bool png = path.extension() == ".png", npy = path.extension() == ".npy";
        const bool written = (png && name.rfind("overlay_", 0) == 0) || ((png || npy) && name.rfind("depth_", 0) == 0);
        return written && same_file(path.parent_path().empty() ? "." : path.parent_path().string(), folder);
    };
    return has_picture_name(file) || has_picture_name(std::filesystem::weakly_canonical(file, code));
}

/** Before the work, not after it. */
void check_outputs(const DepthArguments &arguments, const std::vector<std::string> &files) {
    std::vector<std::string> inputs = files;
    inputs.insert(inputs.end(), {arguments.dots, arguments.geometry});
    for (const OutputFile &output :
         {OutputFile{arguments.csv, "--csv"}, OutputFile{arguments.npy, "--npy", {".npy"}}}) {
        if (output.path.empty())
            continue;
        if (!arguments.pictures.empty() && is_picture(output.path, arguments.pictures))
            throw InputError(fmt::format("{}: is a name that --pictures takes; name another file", output.path));
        check_output_file(output, arguments.overwrite, inputs);
    }
    if (!arguments.csv.empty() && !arguments.npy.empty() && same_file(arguments.csv, arguments.npy))
        throw InputError(fmt::format("{}: --csv and --npy name the same file", arguments.csv));
    if (arguments.pictures.empty())
        return;
    for (const std::string &input : inputs)
        if (is_picture(image_io::split_name(input).path, arguments.pictures))
            throw InputError(
                fmt::format("{}: is an input, which --pictures might replace; name another folder", input));
    std::error_code code;
    if (!arguments.overwrite)
        for (const auto &entry : std::filesystem::directory_iterator(arguments.pictures, code))
            if (is_picture(entry.path().string(), arguments.pictures))
                throw OutputError(
                    fmt::format("{} exists; choose another folder with --pictures, or replace its pictures "
                                "with --overwrite",
                                entry.path().string()));
}

} // namespace

void run_depth(DepthArguments &arguments, Console &console) {
    ClspDepthDesc &desc = arguments.desc;
    DotDirections dots = read_directions(arguments.dots);
    const std::string unknown_speckle = read_geometry(arguments.geometry, desc);
    if (!unknown_speckle.empty() && !arguments.relative_diameter)
        console.warn(unknown_speckle);
    const std::vector<double> directions = projected(std::move(dots), desc.projection, arguments.dots);
    desc.near_m = arguments.near_m.value_or(desc.near_m);
    desc.far_m = arguments.far_m.value_or(desc.far_m);
    desc.relative_diameter = arguments.relative_diameter.value_or(desc.relative_diameter);
    desc.directions = directions.data();
    desc.direction_count = directions.size() / 2;

    std::vector<std::string> files;
    for (const std::string &argument : arguments.files)
        for (std::string &file : expand(argument, Purpose::measurement))
            files.push_back(std::move(file));
    check_outputs(arguments, files);
    std::uint64_t total = 0, done = 0;
    for (const std::string &file : files) {
        const auto reader = image_io::open(file, request_of(arguments.channel, arguments.raw));
        const image_io::Info &info = reader->info();
        if (total == 0) {
            desc.width = info.width;
            desc.height = info.height;
        } else if (info.width != desc.width || info.height != desc.height) {
            throw InputError(fmt::format("{}: has {} x {} pixels, {} has {} x {}; frames must be of one size", file,
                                         info.width, info.height, files.front(), desc.width, desc.height));
        }
        total += info.frame_count;
    }

    const clspeckle::Context context = make_context(arguments.device);
    const clspeckle::Queue queue(context);
    const clspeckle::Depth depth(context, desc);
    const clspeckle::Buffer buffer(context, std::uint64_t{desc.width} * desc.height * sizeof(float));
    if (!arguments.pictures.empty())
        make_output_folder(arguments.pictures, "--pictures");

    std::vector<DepthFrame> frames;
    std::vector<std::string> warnings;
    for (const std::string &file : files) {
        const auto reader = image_io::open(file, request_of(arguments.channel, arguments.raw));
        for (std::uint64_t index = 0; index < reader->info().frame_count; ++index) {
            check_interrupt();
            DepthFrame frame;
            frame.name = reader->info().frame_count > 1 ? fmt::format("{}[{}]", file, index) : file;
            frame.width = desc.width;
            frame.height = desc.height;
            const image_io::Plane plane = image_io::read_gray(*reader, index, warnings);
            for (std::size_t i = 0; i < plane.values.size(); ++i)
                if (!std::isfinite(plane.values[i]))
                    throw InputError(fmt::format("{}: pixel ({}, {}) is {}; depth needs finite values", frame.name,
                                                 i % plane.width, i / plane.width, plane.values[i]));
            buffer.write(queue, plane.values);
            depth.enqueue_detect(queue, buffer.image(desc.width, desc.height, CLSP_FORMAT_FLOAT32));
            frame.result = depth.dots(queue);
            frame.pattern = depth.pattern_dots();
            for (const std::string &warning : warnings)
                console.warn(warning);
            warnings.clear();
            for (const std::string &warning : warnings_of(frame))
                console.warn(frame.name + ": " + warning);
            if (!arguments.pictures.empty())
                write_depth_pictures(arguments.pictures, frames.size(), plane, frame);
            frames.push_back(std::move(frame));
            console.progress(++done, total);
        }
    }
    if (!arguments.csv.empty())
        write_depth_csv(arguments.csv, frames);
    if (!arguments.npy.empty())
        write_depth_npy(arguments.npy, frames);
    if (console.json()) {
        Json root = {{"pattern_dots", desc.direction_count}, {"frames", Json::array()}};
        for (const DepthFrame &frame : frames)
            root["frames"].push_back(to_json(frame));
        root["warnings"] = console.warnings();
        console.result(root.dump(2, ' ', false, Json::error_handler_t::replace));
        return;
    }
    print_frames(frames, console);
}

} // namespace tools

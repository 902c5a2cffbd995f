#include "capture.hpp"

#include "context.hpp"
#include "dot_finder.hpp"
#include "errors.hpp"
#include "files.hpp"
#include "interrupt.hpp"
#include "io/byte_order.hpp"
#include "io/codes.hpp"
#include "io/formats.hpp"
#include "io/series.hpp"
#include "json.hpp"
#include "text.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <map>
#include <numeric>
#include <optional>
#include <regex>
#include <set>

namespace tools {

namespace {

namespace fs = std::filesystem;

constexpr const char *kRule =
    "names of files and folders begin with dark, flat, board or dots, and those of board and dots say static (rest) or "
    "moving: dark.npy, board_moving/0001.png, dots_static_01.tif";
constexpr double kQuantizationVariance = 1.0 / 12.0;
// Half the mean square of the difference of two frames over the variance within one: noise alone has little of it, new
// speckle all; of dots the pattern's own variance stays.
constexpr double kNewBoard = 0.6;
constexpr double kNewDots = 0.25;
constexpr double kClipped = 0.01; // of the dark codes that are 0

/** One sequence: its files, and what they hold. */
struct Found {
    std::string name, file, mask; // paths in the folder
    std::string scene;
    bool moving = false;
    bool motion_named = true;
    std::optional<double> exposure_ms;
    std::vector<std::string> paths;

    std::uint64_t frames = 0;
    std::vector<double> sum, square; // of the codes, by pixel
    double change = 0.0;             // of speckle between two frames
    double at_zero = 0.0;            // part of the codes
    image_io::detail::WholeNumbers words{2};

    bool laser() const { return scene == "board" || scene == "dots"; }
    double pixels() const { return static_cast<double>(sum.size()); }
    double mean() const {
        return std::accumulate(sum.begin(), sum.end(), 0.0) / (pixels() * static_cast<double>(frames));
    }
    /** The mean over pixels of the variance in time. */
    double variance() const {
        double result = 0.0;
        const auto n = static_cast<double>(frames);
        for (std::size_t i = 0; i < sum.size(); ++i)
            result += (square[i] - sum[i] * sum[i] / n) / (n - 1.0);
        return result / pixels();
    }
};

/** All codes of a folder together. */
struct Codes {
    std::uint32_t width = 0, height = 0;
    std::string first;            // the file whose size they have
    std::string bytes;            // a file with 8-bit samples
    std::uint32_t set = 0;        // bits that any code has
    std::uint32_t always = 65535; // bits that all codes have
    std::uint32_t largest = 0;
    double full_scale = 0;                                    // of files that say it
    std::map<std::string, std::vector<std::string>> warnings; // of files, by what is said of them
    bool swapped_told = false;                                // their bytes look swapped, by their own reader
};

/** What an error about the frames adds: how else their files may be meant. */
std::string but(const Codes &codes) {
    if (codes.warnings.empty())
        return "";
    const auto &[warning, paths] = *codes.warnings.begin();
    return fmt::format(". But {}: {}", paths.front(), warning);
}

std::string lower(std::string text) {
    for (char &c : text)
        c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    return text;
}

std::string scene_of(const std::string &name) {
    for (const auto &[begin, scene] :
         {std::pair{"dark", "dark"}, {"flat", "flat"}, {"board", "board"}, {"dot", "dots"}})
        if (lower(name).rfind(begin, 0) == 0)
            return scene;
    return "";
}

bool holds_frames(const fs::path &path) {
    const image_io::Format *format = image_io::format_of_extension(path.string());
    return format && format->codes != image_io::Codes::none;
}

/** Without the number at its end, which counts frames. */
std::string without_number(const std::string &stem) {
    const std::size_t end = stem.find_last_not_of("0123456789");
    return end == std::string::npos ? "" : stem.substr(0, end + 1);
}

std::string sequence_name(std::string text) {
    for (char &c : text)
        if (!std::isalnum(static_cast<unsigned char>(c)) && c != '_' && c != '-' && c != '.')
            c = '_';
    text = text.substr(0, 63);
    return text.substr(0, text.find_last_not_of("_-. ") + 1);
}

/** .raw files, and PNM files with a layout that leaves out the bytes of a header. @param raw the layout. */
bool is_raw(const std::string &path, const std::string &raw) {
    const image_io::Format *format = image_io::format_of_extension(path);
    const auto layout = request_of("", raw).raw;
    return format && (format->name == "raw" || (format->name == "PNM" && layout && layout->offset > 0));
}

std::unique_ptr<image_io::Reader> open_frames(const std::string &path, const std::string &raw) {
    return image_io::open(path, request_of("", is_raw(path, raw) ? raw : ""));
}

class Folder {
  public:
    Folder(std::string folder, const std::string &raw) : folder_(std::move(folder)) {
        std::error_code code;
        if (!fs::is_directory(folder_, code))
            throw InputError(fmt::format("{}: {}; name the folder that holds the frames: {}", folder_,
                                         fs::exists(folder_, code) ? "is no folder" : "does not exist", kRule));
        std::map<std::string, std::vector<fs::path>> numbered; // by prefix and extension
        std::map<std::string, fs::path> masks;
        std::vector<fs::path> entries;
        for (const fs::directory_entry &entry : fs::directory_iterator(folder_, code))
            entries.push_back(entry.path());
        if (code)
            throw InputError(fmt::format("{}: cannot be read: {}", folder_, code.message()));
        std::sort(entries.begin(), entries.end());
        for (const fs::path &path : entries) {
            const std::string file = path.filename().string();
            const std::string stem = path.stem().string();
            if (file[0] == '.' || file == "capture.json" || file == "key.json")
                continue;
            if (scene_of(file).empty() || !(fs::is_directory(path, code) || holds_frames(path)))
                leave_out(path);
            else if (fs::is_directory(path, code))
                add_folder(path);
            else if (stem.size() > 5 && stem.compare(stem.size() - 5, 5, "_mask") == 0)
                masks[sequence_name(stem.substr(0, stem.size() - 5))] = path;
            else if (without_number(stem) == stem ||
                     image_io::format_of_extension(file)->codes == image_io::Codes::stacks ||
                     open_frames(path.string(), raw)->info().frame_count > 1)
                add(stem, file, {path.string()});
            else
                numbered[without_number(stem) + '/' + path.extension().string()].push_back(path);
        }
        for (const auto &[key, paths] : numbered) {
            const std::string prefix = key.substr(0, key.find('/'));
            // As many digits as all have: another sequence's numbers may follow the same words.
            std::set<std::size_t> lengths;
            std::string digits;
            for (const fs::path &path : paths)
                lengths.insert(path.stem().string().size() - prefix.size());
            for (std::size_t i = 0; i < *lengths.begin(); ++i)
                digits += "[0-9]";
            if (lengths.size() > 1)
                digits = "[0-9]*";
            std::vector<std::string> files;
            for (const fs::path &path : paths)
                files.push_back(path.string());
            add(prefix, image_io::literal_pattern(prefix) + digits + paths[0].extension().string(), files);
        }
        for (Found &found : sequences)
            if (const auto mask = masks.find(found.name); mask != masks.end())
                found.mask = mask->second.filename().string();
        // The order of a light path seen backwards; several of one scene by their names.
        static const std::string order = "dark flat board dots";
        std::stable_sort(sequences.begin(), sequences.end(), [](const Found &a, const Found &b) {
            return std::pair(order.find(a.scene), a.name) < std::pair(order.find(b.scene), b.name);
        });
        if (sequences.empty())
            throw InputError(fmt::format(
                "{}: holds no frames whose scene is named; expected: {}{}{}", folder_, kRule,
                others.empty() ? "" : fmt::format(". There are: {}", fmt::join(others, ", ")),
                no_frames.empty() ? "" : ". " + no_frames.begin()->second.front() + " " + no_frames.begin()->first));
    }

    std::vector<Found> sequences;
    std::vector<std::string> others;                           // whose names tell no scene
    std::map<std::string, std::vector<std::string>> no_frames; // whose names do, by why they are none

  private:
    void leave_out(const fs::path &path) {
        const std::string file = path.filename().string();
        others.push_back(file);
        std::error_code code;
        if (scene_of(file).empty() || !fs::is_regular_file(path, code))
            return;
        if (const std::string why = image_io::why_no_frame(path.string()); !why.empty()) {
            no_frames[why].push_back(path.string());
            others.pop_back();
        }
    }

    static std::vector<std::string> names_of(const std::vector<std::string> &paths) {
        std::vector<std::string> names;
        for (const std::string &path : paths)
            names.push_back(fs::path(path).filename().string());
        return names;
    }

    void add_folder(const fs::path &folder) {
        std::set<std::string> kinds;
        std::vector<std::string> files;
        std::map<std::string, std::vector<std::string>> none; // by why they are no frames
        std::error_code code;
        for (const fs::directory_entry &entry : fs::directory_iterator(folder)) {
            if (entry.path().filename().string()[0] == '.' || !entry.is_regular_file(code))
                continue;
            const std::string file = entry.path().string();
            if (holds_frames(entry.path())) {
                kinds.insert(lower(entry.path().extension().string()));
                files.push_back(file);
            } else if (const std::string why = image_io::why_no_frame(file); !why.empty()) {
                none[why].push_back(file);
            }
        }
        image_io::leave_previews_out(files);
        std::sort(files.begin(), files.end(), image_io::natural_less);
        if (files.empty())
            throw InputError(
                fmt::format("{}: holds no {} frames; put them there, or give the folder another name{}",
                            folder.string(), image_io::frame_formats("or"),
                            none.empty() ? "" : ". " + none.begin()->second.front() + " " + none.begin()->first));
        for (auto &[why, paths] : none)
            no_frames[why].insert(no_frames[why].end(), paths.begin(), paths.end());
        if (kinds.size() > 1)
            throw InputError(fmt::format("{}: holds files of several kinds ({}); leave one there, the frames",
                                         folder.string(), fmt::join(kinds, ", ")));
        const std::string name = folder.filename().string();
        const std::vector<image_io::Series> series = image_io::series_of(names_of(files));
        if (kinds.count(".npy") == 0 && series.size() > 1) {
            std::string list;
            for (const image_io::Series &one : series)
                list += (list.empty() ? "" : ", ") + one.pattern;
            throw InputError(fmt::format("{}: the names in the folder tell {} series: {}; move each into a folder of "
                                         "its own, such as {}_1: init makes a sequence of each",
                                         folder.string(), series.size(), list, name));
        }
        if (kinds.count(".npy") == 0)
            add(name, name, files);
        for (const std::string &file : kinds.count(".npy") ? files : std::vector<std::string>())
            add(files.size() == 1 ? name : name + "_" + fs::path(file).stem().string(),
                name + "/" + fs::path(file).filename().string(), {file});
    }

    void add(const std::string &text, const std::string &file, std::vector<std::string> paths) {
        Found found;
        found.name = sequence_name(text);
        found.file = file;
        found.scene = scene_of(text);
        found.paths = std::move(paths);
        const std::string words = lower(text);
        const auto says = [&](const char *word) { return words.find(word) != std::string::npos; };
        found.moving = says("moving");
        found.motion_named = found.moving || says("static") || says("rest");
        std::smatch time;
        if (std::regex_search(words, time, std::regex(R"((\d+(?:\.\d+)?)ms)")))
            found.exposure_ms = std::stod(time[1]);
        for (const Found &other : sequences)
            if (lower(other.name) == lower(found.name))
                throw InputError(fmt::format("{}: {} and {} would both be the sequence \"{}\"; rename or move one",
                                             folder_, other.file, file, found.name));
        sequences.push_back(std::move(found));
    }

    std::string folder_;
};

/** Sums over all frames of a sequence. */
void read_frames(Found &found, const std::string &raw, Codes &codes, const std::function<void()> &frame_done) {
    std::vector<float> first;
    for (const std::string &path : found.paths) {
        const auto reader = open_frames(path, raw);
        const image_io::Info &info = reader->info();
        if (const std::string why = image_io::why_no_codes(info, found.file); !why.empty())
            throw InputError(fmt::format("{}: {}", path, why));
        for (const std::string &warning : info.warnings) {
            const bool swapped = warning == info.looks_swapped;
            // The codes of all sequences together tell it of arrays, with the same way out.
            if (swapped && info.format->codes == image_io::Codes::stacks)
                continue;
            codes.warnings[warning].push_back(path);
            codes.swapped_told = codes.swapped_told || swapped;
        }
        if (info.white_is_zero)
            codes.warnings[image_io::told_white(info) + ". If it is only marked so, save the frames as min-is-black"]
                .push_back(path);
        if (codes.first.empty()) {
            codes.width = info.width;
            codes.height = info.height;
            codes.first = path;
        }
        if (info.width != codes.width || info.height != codes.height)
            throw InputError(fmt::format("{}: has {} x {} pixels, but {} has {} x {}; one camera has one size: cut the "
                                         "frames alike, or move what is of another camera",
                                         path, info.width, info.height, codes.first, codes.width, codes.height));
        if (info.sample == "uint8")
            codes.bytes = path;
        codes.full_scale = std::max(codes.full_scale, info.full_scale);
        const std::size_t pixels = std::size_t{codes.width} * codes.height;
        found.sum.resize(pixels);
        found.square.resize(pixels);
        for (std::uint64_t frame = 0; frame < info.frame_count; ++frame, ++found.frames) {
            check_interrupt();
            std::vector<float> values;
            values.reserve(pixels);
            reader->read_rows(frame, [&](const float *row) { values.insert(values.end(), row, row + codes.width); });
            double difference = 0.0;
            double differences = 0.0;
            for (std::size_t i = 0; i < pixels; ++i) {
                const double value = values[i];
                const auto code = static_cast<std::uint32_t>(values[i]);
                found.sum[i] += value;
                found.square[i] += value * value;
                found.at_zero += code == 0;
                found.words.add(code);
                codes.largest = std::max(codes.largest, code);
                codes.set |= code == 65535 ? 0 : code; // what clips is no multiple of anything
                codes.always &= code;
                if (found.frames == 1) {
                    difference += value - first[i];
                    differences += (value - first[i]) * (value - first[i]);
                }
            }
            if (found.frames == 0)
                first = std::move(values);
            if (found.frames == 1) {
                const auto n = static_cast<double>(pixels);
                double mean = 0.0;
                double square = 0.0;
                for (const float value : first) {
                    mean += value / n;
                    square += value * value / n;
                }
                found.change =
                    0.5 * (differences / n - difference / n * difference / n) / std::max(square - mean * mean, 1e-12);
            }
            frame_done();
        }
    }
    found.at_zero /= found.pixels() * static_cast<double>(found.frames);
    if (found.laser() && !found.motion_named)
        found.moving = found.change > (found.scene == "board" ? kNewBoard : kNewDots);
}

/** What was found, and what has to be looked at before the description is right, in words. */
struct Notes {
    std::string found, text;
    void add(const std::string &field, const std::string &value, const std::string &why) {
        text += fmt::format("  {}: {}\n{}\n", field, value, wrapped(why, "      "));
    }
};

/** How codes stand in the words of the files. */
struct CodeFormat {
    std::uint32_t bits = 0;
    std::uint32_t shift = 0; // below the lowest bit
};

/**
 * Bits that files say, or the least that hold the largest code; in the upper bits of 16 where those are used and the
 * lowest ones never.
 *
 * @param given bits, or 0.
 */
CodeFormat format_of(const Codes &codes, std::uint32_t given, Notes &notes) {
    constexpr std::array<std::uint32_t, 5> usual = {8, 10, 12, 14, 16};
    const auto least = [&](const auto &fits) { return *std::find_if(usual.begin(), usual.end(), fits); };
    const auto holding = [&](double code) { return least([&](std::uint32_t bits) { return code < std::exp2(bits); }); };
    if (!codes.bytes.empty() && codes.largest > 255)
        throw InputError(fmt::format("{}: has 8-bit samples, but codes reach {} elsewhere; record all frames with the "
                                     "same bits",
                                     codes.bytes, codes.largest));
    if (!codes.bytes.empty() && given != 0 && given != 8)
        throw InputError(
            fmt::format("--bits {}: {} has 8-bit samples, which hold codes of 8 bits only", given, codes.bytes));
    const bool words = codes.full_scale == 65535.0;
    std::uint32_t free = 0;
    while (free < 8 && (codes.set >> free & 1) == 0)
        ++free;
    const std::uint32_t aligned = given ? given : least([&](std::uint32_t bits) { return bits + free >= 16; });
    // A lowest bit that all codes have is no part of theirs: they were shifted otherwise, as the check tells.
    const bool varies = (codes.always >> free & 1) == 0;
    if (words && varies && codes.largest >> 15 != 0 && aligned < 16 && aligned + free >= 16) {
        notes.add("/camera/msb_aligned", "true",
                  fmt::format("all words are multiples of {}: codes of {} bits in the upper ones of 16", 1u << free,
                              aligned));
        return {aligned, 16 - aligned};
    }
    const std::uint32_t bits = given ? given : holding(words ? codes.largest : codes.full_scale);
    if (codes.largest >> bits != 0)
        throw InputError(fmt::format("--bits {}: codes reach {}; leave the option out, or give more{}", bits,
                                     codes.largest, but(codes)));
    if (words && !given && codes.largest != (1u << bits) - 1)
        notes.add("/camera/bits", std::to_string(bits),
                  fmt::format("no code is above {}: a converter that nothing brought to its end may have more (--bits)",
                              codes.largest));
    return {bits, 0};
}

/** The mean of the middle half: what hot pixels do not move. */
double middle_mean(std::vector<double> values) {
    std::sort(values.begin(), values.end());
    const auto quarter = static_cast<std::ptrdiff_t>(values.size() / 4);
    return std::accumulate(values.begin() + quarter, values.end() - quarter, 0.0) /
           static_cast<double>(static_cast<std::ptrdiff_t>(values.size()) - 2 * quarter);
}

/** Black level and read noise of the darkest dark frames: /camera's members. */
void describe_dark(const std::vector<Found> &sequences, const std::optional<double> &given_noise_dn, Json &camera,
                   Notes &notes) {
    const auto darkest = [&](const auto &fits) {
        const Found *least = nullptr;
        for (const Found &found : sequences)
            if (fits(found) && (!least || found.mean() < least->mean()))
                least = &found;
        return least;
    };
    const auto rounded = [](double value) { return std::round(value * 100.0) / 100.0; };
    const auto note = [&](const char *field, double value, const std::string &why) {
        notes.add(std::string("/camera/") + field, fmt::format("{:g}", rounded(value)), why);
    };
    const auto pixel_means = [](const Found &found) {
        std::vector<double> means;
        for (const double sum : found.sum)
            means.push_back(sum / static_cast<double>(found.frames));
        return means;
    };
    const Found *dark = darkest([](const Found &f) { return f.scene == "dark"; });
    double level = 0.0;
    if (dark) {
        level = middle_mean(pixel_means(*dark));
        if (dark->at_zero > kClipped)
            note("black_level_dn", level,
                 fmt::format("{:.1f} % of {} are clipped at 0: the level behind is lower; raise the camera's offset",
                             100.0 * dark->at_zero, dark->name));
    } else {
        if (const Found *speckled = darkest([](const Found &f) { return f.laser(); })) {
            const std::vector<double> means = pixel_means(*speckled);
            level = *std::min_element(means.begin(), means.end());
        }
        note("black_level_dn", level,
             "no dark frames: the darkest pixel between speckle; record some, the lens covered");
    }
    const Found *still = dark && dark->frames > 1
                             ? dark
                             : darkest([](const Found &f) { return f.frames > 1 && !(f.laser() && f.moving); });
    if (!still && !given_noise_dn)
        throw InputError(
            "no two frames are of a scene at rest, so that frames tell no read noise; record two dark frames "
            "or more, or give the data sheet's (--read-noise-dn)");
    const double noise =
        given_noise_dn ? *given_noise_dn : std::sqrt(std::max(0.0, still->variance() - kQuantizationVariance));
    if (!given_noise_dn && (still->variance() <= kQuantizationVariance || still->at_zero > kClipped))
        note(
            "read_noise_dn", noise,
            fmt::format("not known: {}; give the data sheet's (--read-noise-dn)",
                        still->at_zero > kClipped
                            ? fmt::format("{:.1f} % of {} are clipped at 0, so that its noise is larger than {:.2f} DN",
                                          100.0 * still->at_zero, still->name, noise)
                            : fmt::format("the noise of {} is lost in the converter's rounding (its variance is {:.2g} "
                                          "DN^2, rounding alone may have {:.2g})",
                                          still->name, still->variance(), kQuantizationVariance)));
    else if (!given_noise_dn && still != dark)
        note("read_noise_dn", noise,
             fmt::format("no two dark frames: the noise of {}, which has photon noise, too", still->name));
    camera["black_level_dn"] = rounded(level);
    camera["read_noise_dn"] = rounded(noise);
    if (dark)
        notes.found += fmt::format("{}: a black level of {:.2f} DN, a noise of {}\n", dark->name, level,
                                   noise > 0.0 ? fmt::format("{:.2f} DN", noise) : "less than rounding's");
}

/** The dots of all frames of scenes with dots, of those in motion if there are any: /dots. */
Json describe_dots(const std::vector<Found> &sequences, const Codes &codes, double noise_dn,
                   const std::optional<double> &pupil_diameter, Notes &notes) {
    const bool moving =
        std::any_of(sequences.begin(), sequences.end(), [](const Found &f) { return f.scene == "dots" && f.moving; });
    std::vector<double> sum(std::size_t{codes.width} * codes.height);
    std::uint64_t frames = 0;
    std::string names;
    for (const Found &found : sequences)
        if (found.scene == "dots" && found.moving == moving) {
            for (std::size_t i = 0; i < sum.size(); ++i)
                sum[i] += found.sum[i];
            frames += found.frames;
            names += (names.empty() ? "" : ", ") + found.name;
        }
    std::vector<float> mean;
    for (const double value : sum)
        mean.push_back(static_cast<float>(value / static_cast<double>(frames)));
    FoundDots dots = find_dots(mean, codes.width, codes.height, noise_dn / std::sqrt(static_cast<double>(frames)));
    if (dots.positions_px.empty())
        throw InputError(fmt::format("{}: no dots stand out of the noise of {} frame{}; record more light or more "
                                     "frames, or name a file with the projector's dots (--dots)",
                                     names, frames, frames == 1 ? "" : "s"));
    const double imaged = dots.sigma_px;
    if (pupil_diameter)
        dots.sigma_px = sigma_before_lens(imaged, *pupil_diameter);
    dots.sigma_px = std::round(100.0 * dots.sigma_px) / 100.0;
    notes.found += fmt::format("{}: {} dots, {:.2f} px wide (standard deviation) as imaged\n", names,
                               dots.positions_px.size(), imaged);
    notes.add("/dots", fmt::format("{} dots, sigma_px {:g}", dots.positions_px.size(), dots.sigma_px),
              std::string("places are those of the light; the projector's data sheet knows better, and dots beyond the "
                          "border") +
                  (pupil_diameter ? ". The lens's diffraction was taken off the width"
                                  : ". The lens's blur is in the width") +
                  (moving ? "" : ". Speckle at rest moves them by about half their width: record dots in motion"));
    return {{"sigma_px", dots.sigma_px}, {"positions_px", dots.positions_px}};
}

Json dots_of_file(const std::string &file) {
    const DotPattern pattern = read_dots(file, CaptureMakeArguments{}.dots_sigma_px);
    Json positions = Json::array();
    for (std::size_t i = 0; i < pattern.positions_px.size(); i += 2)
        positions.push_back({pattern.positions_px[i], pattern.positions_px[i + 1]});
    return {{"sigma_px", pattern.sigma_px}, {"positions_px", positions}};
}

/** Refuses what the check would refuse, in its words. */
void check_description(image_io::AtomicFile &file, const std::string &path, const Codes &codes, Console &console) {
    file.close();
    const std::string &written = file.temporary_path();
    try {
        (void)clspeckle::Capture::open(written, progress_on(console));
    } catch (const clspeckle::Error &error) {
        std::string message = error.message();
        for (std::size_t at = message.find(written); at != std::string::npos; at = message.find(written))
            message.replace(at, written.size(), path);
        message += but(codes);
        throw clspeckle::Error(error.status(), error.opencl_code(), error.function(), message, error.build_log());
    }
}

} // namespace

namespace {

std::string named(const std::vector<std::string> &paths) {
    return paths.front() + (paths.size() > 1 ? fmt::format(" and {} more", paths.size() - 1) : "");
}

/** What is odd about files and their codes, as the check will say it. */
void warn_of_files(const std::vector<Found> &sequences, const Codes &codes, Console &console) {
    std::vector<image_io::detail::WholeNumbers> words;
    for (const Found &found : sequences)
        words.push_back(found.words);
    const image_io::detail::SwappedWords swapped = image_io::detail::swapped_among(words);
    std::string names;
    for (const std::size_t i : swapped.which)
        names += (names.empty() ? "" : ", ") + sequences[i].name;
    // Files that say so themselves know how they are read in the other order.
    if (!names.empty() && !codes.swapped_told)
        console.warn(fmt::format("{}: the codes {}. If so, save codes.byteswap(), and write capture.json again with "
                                 "--force: its numbers are those of swapped codes",
                                 names, image_io::detail::told_swapped(swapped.bits)));
    for (const auto &[warning, paths] : codes.warnings)
        console.warn(fmt::format("{}: {}", named(paths), warning));
}

} // namespace

void run_capture_init(const CaptureInitArguments &a, Console &console) {
    Folder folder(a.folder, a.raw);
    std::vector<Found> &sequences = folder.sequences;
    const std::string path = (fs::path(a.folder) / "capture.json").string();
    std::error_code code;
    if (fs::exists(path, code) && !a.force)
        throw InputError(fmt::format("{}: exists, and may have been edited; replace it with --force", path));
    image_io::AtomicFile file(path); // before frames are read: whoever may not write shall not wait
    std::uint64_t total = 0;
    for (const Found &found : sequences)
        for (const std::string &one : found.paths)
            total += open_frames(one, a.raw)->info().frame_count;
    Codes codes;
    std::uint64_t done = 0;
    for (Found &found : sequences)
        read_frames(found, a.raw, codes, [&] { console.progress(++done, total); });

    Notes notes;
    Json camera;
    camera["width"] = codes.width;
    camera["height"] = codes.height;
    const CodeFormat format = format_of(codes, a.bits, notes);
    camera["bits"] = format.bits;
    if (format.shift > 0)
        camera["msb_aligned"] = true;
    const double dn = std::exp2(-double(format.shift));
    for (Found &found : sequences) {
        for (double &sum : found.sum)
            sum *= dn;
        for (double &square : found.square)
            square *= dn * dn;
    }
    const auto given = [&](const std::optional<double> &value, double otherwise, const char *field,
                           const char *option) {
        if (!value)
            notes.add(field, fmt::format("{:g}", otherwise), fmt::format("frames do not tell it ({})", option));
        return value.value_or(otherwise);
    };
    const CaptureMakeArguments usual;
    camera["pixel_pitch_um"] =
        given(a.pixel_pitch_um, usual.pixel_pitch_um, "/camera/pixel_pitch_um", "--pixel-pitch-um");
    camera["f_number"] = given(a.f_number, usual.f_number, "/camera/f_number", "--f-number");
    describe_dark(sequences, a.read_noise_dn, camera, notes);
    const bool laser = std::any_of(sequences.begin(), sequences.end(), [](const Found &f) { return f.laser(); });
    Json root = {{"format", "clspeckle-capture"}, {"version", 1}, {"camera", camera}};
    root["laser"] = {{"wavelength_nm", a.wavelength_nm.value_or(usual.wavelength_nm)}, {"degree_of_polarization", 1.0}};
    if (laser) {
        given(a.wavelength_nm, usual.wavelength_nm, "/laser/wavelength_nm", "--wavelength-nm");
        notes.add("/laser/degree_of_polarization", "1",
                  "of the light that comes back: 1 from metal, near 0 from white paint");
    }
    if (std::any_of(sequences.begin(), sequences.end(), [](const Found &f) { return f.scene == "dots"; })) {
        std::optional<double> diameter;
        if (a.pixel_pitch_um && a.f_number && a.wavelength_nm)
            diameter = *a.pixel_pitch_um / (*a.wavelength_nm * 1e-3 * *a.f_number);
        root["dots"] = !a.dots_file.empty() ? dots_of_file(a.dots_file)
                                            : describe_dots(sequences, codes, camera["read_noise_dn"], diameter, notes);
    }
    std::vector<std::vector<std::string>> rows = {{"sequence", "scene", "motion", "frames", "mean", "file"}};
    for (const Found &found : sequences) {
        const char *motion = found.moving ? "moving" : "static";
        Json entry = {{"name", found.name}, {"file", found.file}, {"scene", found.scene}, {"motion", motion}};
        if (found.exposure_ms)
            entry["exposure_ms"] = *found.exposure_ms;
        if (!found.mask.empty())
            entry["mask"] = found.mask;
        if (is_raw(found.paths.front(), a.raw))
            entry["raw"] = a.raw;
        if (found.laser() && !found.motion_named)
            notes.add(fmt::format("/sequences/{}/motion", root["sequences"].size()), motion,
                      fmt::format("the name {} says neither static nor moving: its frames look so", found.name));
        root["sequences"].push_back(std::move(entry));
        rows.push_back({found.name, found.scene, motion, std::to_string(found.frames),
                        fmt::format("{:.2f}", found.mean()), found.file});
    }
    const std::string text = json_document(root, 1) + "\n";
    file.write(text.data(), text.size());
    check_description(file, path, codes, console);
    file.commit();
    console.print(table(rows) + "\n" + notes.found);
    for (const std::string &other : folder.others)
        if (const fs::path left = fs::path(a.folder) / other; holds_frames(left) || fs::is_directory(left, code))
            console.warn(fmt::format("{}: is left out, as its name tells no scene; {}", left.string(), kRule));
    for (const auto &[why, paths] : folder.no_frames)
        console.warn(fmt::format("{}: is left out: it {}", named(paths), why));
    warn_of_files(sequences, codes, console);
    if (!notes.text.empty())
        console.print("To be edited:\n" + notes.text);
    console.print(fmt::format("{}: written. Next: clspeckle capture check {}", path, a.folder));
}

} // namespace tools

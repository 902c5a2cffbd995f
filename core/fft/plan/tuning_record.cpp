#include "fft/plan/tuning_record.hpp"

#include "io/json_file.hpp"
#include "io/json_text.hpp"
#include "runtime/error.hpp"
#include "runtime/whole_file.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fmt/core.h>

namespace clsp {
namespace {

namespace fs = std::filesystem;
using image_io::Json;
using image_io::JsonText;
using image_io::shown;

constexpr const char *kFormat = "clspeckle-tuning";
// Beyond these, a file is not what it says.
constexpr std::size_t kMostText = 1024, kMostEntries = 4096;
constexpr std::uint32_t kLongestSide = 1u << 16;
constexpr double kLongestMs = 1e7;

[[noreturn]] void refuse(const std::string &what) {
    throw Error(Status::kInvalidData, what);
}

// A member of an object, with its place for messages.
class Node {
  public:
    Node(const Json &json, std::string place) : json_(json), place_(std::move(place)) {}

    bool has(const char *name) const { return json_.is_object() && json_.contains(name); }
    Node at(const char *name) const {
        if (!json_.is_object())
            refuse(fmt::format("{} is no object", place_));
        const auto found = json_.find(name);
        if (found == json_.end())
            refuse(fmt::format("{} has no \"{}\"", place_, name));
        return {*found, fmt::format("{}.{}", place_, name)};
    }
    std::vector<Node> items() const {
        if (!json_.is_array() || json_.size() > kMostEntries)
            refuse(fmt::format("{} is no list of at most {} entries", place_, kMostEntries));
        std::vector<Node> nodes;
        for (const Json &item : json_)
            nodes.emplace_back(item, fmt::format("{}[{}]", place_, nodes.size()));
        return nodes;
    }
    std::string text() const {
        if (!json_.is_string() || json_.get_ref<const std::string &>().size() > kMostText)
            refuse(fmt::format("{} is no text of at most {} bytes", place_, kMostText));
        return json_.get<std::string>();
    }
    std::string filled_text() const {
        if (text().empty())
            refuse(fmt::format("{} is empty", place_));
        return text();
    }
    std::uint32_t integer(std::uint32_t least, std::uint32_t most) const {
        if (!json_.is_number_unsigned() || json_.get<std::uint64_t>() < least || json_.get<std::uint64_t>() > most)
            refuse(fmt::format("{} is {}, expected an integer from {} to {}", place_, shown(json_), least, most));
        return json_.get<std::uint32_t>();
    }
    // Above 0, or also 0.
    double number(double most, bool zero = false) const {
        const double value = json_.is_number() ? json_.get<double>() : std::nan("");
        if (!(value <= most && (value > 0.0 || (zero && value == 0.0))))
            refuse(fmt::format("{} is {}, expected a number {} 0 and at most {}", place_, shown(json_),
                               zero ? "from" : "above", most));
        return value;
    }
    const std::string &place() const { return place_; }

  private:
    const Json &json_;
    std::string place_;
};

std::optional<WorkGroup> pick_of(const Node &node, const char *name) {
    if (!node.has(name))
        return {};
    const Node pick = node.at(name);
    return WorkGroup{pick.at("lines").integer(1, 64), pick.at("work_items").integer(1, 4096)};
}

EngineSpec spec_of(const Node &node) {
    const std::string name = node.at("engine").text();
    const std::optional<EngineKind> engine = engine_of(name);
    if (!engine)
        refuse(fmt::format("{}.engine is \"{}\", expected cpu, gpu or clfft", node.place(), name));
    EngineSpec spec{*engine, pick_of(node, "columns"), pick_of(node, "rows")};
    if (spec.kind != EngineKind::kGpu && (spec.columns || spec.rows))
        refuse(fmt::format("{} has work-groups, which only gpu has", node.place()));
    return spec;
}

TunedCandidate candidate_of(const Node &node) {
    TunedCandidate candidate;
    candidate.spec = spec_of(node);
    if (node.has("refusal")) {
        candidate.refusal = node.at("refusal").filled_text();
        return candidate;
    }
    candidate.median_ms = node.at("median_ms").number(kLongestMs);
    candidate.spread_ms = node.at("spread_ms").number(kLongestMs, true);
    return candidate;
}

TunedSize size_of(const Node &node) {
    TunedSize size;
    size.width = node.at("width").integer(1, kLongestSide);
    size.height = node.at("height").integer(1, kLongestSide);
    size.frames = node.at("frames").integer(1, 1u << 20);
    size.relative_diameter = node.at("relative_diameter").number(64.0);
    size.date = node.at("date").filled_text();
    size.version = node.at("clspeckle_version").filled_text();
    size.reason = node.at("reason").text();
    size.chosen = spec_of(node.at("chosen"));
    for (const Node &candidate : node.at("candidates").items())
        size.candidates.push_back(candidate_of(candidate));
    const bool measured =
        std::any_of(size.candidates.begin(), size.candidates.end(), [&](const TunedCandidate &candidate) {
            return candidate.counts() && candidate.spec == size.chosen;
        });
    if (!measured)
        refuse(fmt::format("{}.chosen is {}, which is no candidate that was measured", node.place(),
                           describe(size.chosen)));
    return size;
}

TuningRecord record_of(const Node &node) {
    const Node device = node.at("device");
    TuningRecord record;
    record.device.name = device.at("name").filled_text();
    record.device.vendor = device.at("vendor").text();
    record.device.platform = device.at("platform").text();
    record.device.driver_version = device.at("driver_version").text();
    record.device.compute_units = device.at("compute_units").integer(1, 1u << 20);
    for (const Node &size : node.at("sizes").items())
        record.sizes.push_back(size_of(size));
    return record;
}

void put(JsonText &json, const EngineSpec &spec) {
    json["engine"] = engine_name(spec.kind);
    for (const auto &[name, pick] : {std::pair{"columns", spec.columns}, std::pair{"rows", spec.rows}})
        if (pick)
            json[name] = {{"lines", pick->lines}, {"work_items", pick->items}};
}

[[noreturn]] void refuse_place(const std::string &path) {
    throw Error(Status::kIo,
                fmt::format("the tuning record cannot be written to {}; name a file in a folder that can be "
                            "written to",
                            path));
}

double rounded_ms(double value) {
    return std::round(value * 1e6) / 1e6;
}

JsonText json_of(const TunedSize &size) {
    JsonText json = {{"width", size.width},   {"height", size.height}, {"relative_diameter", size.relative_diameter},
                     {"frames", size.frames}, {"date", size.date},     {"clspeckle_version", size.version}};
    json["chosen"] = JsonText::object();
    put(json["chosen"], size.chosen);
    json["reason"] = size.reason;
    json["candidates"] = JsonText::array();
    for (const TunedCandidate &candidate : size.candidates) {
        JsonText entry = JsonText::object();
        put(entry, candidate.spec);
        if (candidate.counts()) {
            entry["median_ms"] = rounded_ms(candidate.median_ms);
            entry["spread_ms"] = rounded_ms(candidate.spread_ms);
        } else {
            entry["refusal"] = candidate.refusal;
        }
        json["candidates"].push_back(std::move(entry));
    }
    return json;
}

} // namespace

void TuningFile::merge(const TuningRecord &measured) {
    const auto same_device = [&](const TuningRecord &record) { return record.device == measured.device; };
    auto found = std::find_if(records.begin(), records.end(), same_device);
    if (found == records.end())
        found = records.insert(records.end(), {measured.device, {}});
    for (const TunedSize &size : measured.sizes) {
        const auto same_size = [&](const TunedSize &other) {
            return other.width == size.width && other.height == size.height;
        };
        found->sizes.erase(std::remove_if(found->sizes.begin(), found->sizes.end(), same_size), found->sizes.end());
        found->sizes.push_back(size);
    }
    std::sort(found->sizes.begin(), found->sizes.end(), [](const TunedSize &a, const TunedSize &b) {
        return std::pair(std::uint64_t{a.width} * a.height, a.width) <
               std::pair(std::uint64_t{b.width} * b.height, b.width);
    });
}

TuningFile parse_tuning(const std::string &text) {
    image_io::JsonDocument document;
    try {
        document = image_io::parse_json(text, "the file");
    } catch (const image_io::JsonError &error) {
        refuse(error.what());
    }
    const Node root(document.root(), "the file");
    if (!root.has("format") || root.at("format").text() != kFormat)
        refuse(fmt::format("\"format\" is not \"{}\"", kFormat));
    const std::uint32_t version = root.at("format_version").integer(0, ~std::uint32_t{0});
    if (version != kTuningFormatVersion)
        refuse(fmt::format("it has format version {}, this release reads {}", version, kTuningFormatVersion));
    TuningFile file;
    for (const Node &record : root.at("records").items())
        file.records.push_back(record_of(record));
    for (const char *name : {"\"fused-lanes\"", "\"fused-groups\""})
        file.old_names = file.old_names || text.find(name) != std::string::npos;
    return file;
}

std::string tuning_json(const TuningFile &file) {
    JsonText json = {{"format", kFormat}, {"format_version", kTuningFormatVersion}};
    json["records"] = JsonText::array();
    for (const TuningRecord &record : file.records) {
        const TunedDevice &device = record.device;
        JsonText entry;
        entry["device"] = {{"name", device.name},
                           {"vendor", device.vendor},
                           {"platform", device.platform},
                           {"driver_version", device.driver_version},
                           {"compute_units", device.compute_units}};
        entry["sizes"] = JsonText::array();
        for (const TunedSize &size : record.sizes)
            entry["sizes"].push_back(json_of(size));
        json["records"].push_back(std::move(entry));
    }
    // A driver's text need not be UTF-8.
    return json.text(2) + "\n";
}

TuningFile load_tuning(const std::string &path) {
    std::error_code failed;
    const fs::file_status status = fs::status(path, failed);
    if (status.type() == fs::file_type::not_found)
        return {};
    if (status.type() == fs::file_type::none)
        throw Error(Status::kIo, "it cannot be looked at: " + failed.message());
    if (!fs::is_regular_file(status))
        throw Error(Status::kInvalidData, "it is no file that can be read");
    std::string text;
    try {
        text = image_io::read_json_text(path);
    } catch (const image_io::JsonError &error) {
        refuse(error.what());
    } catch (const image_io::ReadError &error) {
        throw Error(Status::kIo, error.what());
    }
    return parse_tuning(text);
}

void save_tuning(const std::string &path, const TuningFile &file) {
    const std::string text = tuning_json(file);
    const auto write = [&](image_io::AtomicFile &to) { to.write(text.data(), text.size()); };
    if (!write_whole_file(fs::absolute(path), write))
        refuse_place(path);
}

void check_tuning_place(const std::string &path) {
    std::error_code failed;
    const fs::path whole = fs::absolute(path);
    fs::create_directories(whole.parent_path(), failed);
    try {
        const image_io::AtomicFile probe(whole.string());
    } catch (const image_io::WriteError &) {
        refuse_place(path);
    }
}

std::vector<EngineChoice> tuned_choices(const TuningFile &file, const TunedDevice &device, bool any_driver,
                                        std::uint32_t width, std::uint32_t height, const std::string &source) {
    const double area = std::log(double(width) * height);
    struct Found {
        const TunedSize *size;
        double distance; // of the areas; the same size comes before others of its area
    };
    std::vector<Found> found;
    for (const TuningRecord &record : file.records) {
        if (any_driver ? record.device.name != device.name : !(record.device == device))
            continue;
        for (const TunedSize &size : record.sizes) {
            const bool same = size.width == width && size.height == height;
            found.push_back({&size, same ? -1.0 : std::abs(std::log(double(size.width) * size.height) - area)});
        }
    }
    std::stable_sort(found.begin(), found.end(),
                     [](const Found &a, const Found &b) { return a.distance < b.distance; });
    std::vector<EngineChoice> choices;
    for (const Found &entry : found) {
        EngineChoice choice{entry.size->chosen,
                            fmt::format("{}, {} x {}", source, entry.size->width, entry.size->height)};
        // Work-items share out the points of a line: another length wants others.
        if (entry.size->width != width && choice.spec.rows)
            choice.spec.rows->items = 0;
        if (entry.size->height != height && choice.spec.columns)
            choice.spec.columns->items = 0;
        const bool known = std::any_of(choices.begin(), choices.end(),
                                       [&](const EngineChoice &other) { return other.spec == choice.spec; });
        if (!known)
            choices.push_back(std::move(choice));
    }
    return choices;
}

} // namespace clsp

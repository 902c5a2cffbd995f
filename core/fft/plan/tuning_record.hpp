// Which engine was the fastest on which device: records that `clspeckle tune` writes and apertures follow.
// docs/guide/runtime.md describes the file.
#pragma once

#include "fft/engine_spec.hpp"

#include <cstdint>
#include <string>
#include <vector>

namespace clsp {

constexpr std::uint32_t kTuningFormatVersion = 1;

// A device as records know it.
struct TunedDevice {
    std::string name, vendor, platform, driver_version;
    std::uint32_t compute_units = 0;

    // The same device with the same driver.
    bool operator==(const TunedDevice &other) const {
        return name == other.name && vendor == other.vendor && platform == other.platform &&
               driver_version == other.driver_version && compute_units == other.compute_units;
    }
};

struct TunedCandidate {
    EngineSpec spec;
    double median_ms = 0.0; // of a frame; 0 if it could not be measured
    double spread_ms = 0.0; // 1.4826 times the median absolute deviation
    std::string refusal;    // why it was not measured, or does not count; "" if it does

    bool counts() const { return refusal.empty(); }
};

// Of one size of the field grid.
struct TunedSize {
    std::uint32_t width = 0, height = 0;
    std::uint32_t frames = 0;       // measured of each candidate
    double relative_diameter = 0.0; // of the aperture
    std::string date;               // YYYY-MM-DD
    std::string version;            // of clSpeckle
    EngineSpec chosen;              // one of the candidates that count
    std::string reason;
    std::vector<TunedCandidate> candidates;
};

struct TuningRecord {
    TunedDevice device;
    std::vector<TunedSize> sizes;
};

// A file: one record for each device.
struct TuningFile {
    std::vector<TuningRecord> records;
    bool old_names = false; // some of its engines have the names of before

    // Puts measured sizes in the place of older ones of the same device and size.
    void merge(const TuningRecord &measured);
};

// Throws kInvalidData, with what is wrong, for anything but a whole and sane file.
TuningFile parse_tuning(const std::string &text);
std::string tuning_json(const TuningFile &file);

// The file at `path`. No file is an empty one; throws kInvalidData for a wrong one and kIo where it cannot be read.
TuningFile load_tuning(const std::string &path);
// Whole or not at all: throws kIo.
void save_tuning(const std::string &path, const TuningFile &file);
// Throws kIo if save_tuning() could not write there; leaves nothing but the folder.
void check_tuning_place(const std::string &path);

// What records say of a grid, nearest size first (in the ratio of the areas). Work-groups of another size are taken by
// their lines alone. `any_driver`: the device's name is enough.
std::vector<EngineChoice> tuned_choices(const TuningFile &file, const TunedDevice &device, bool any_driver,
                                        std::uint32_t width, std::uint32_t height, const std::string &source);

// Records that are built into the library.
struct ShippedTuning {
    const char *name; // of the file in tuning/
    const char *text;
};
extern const ShippedTuning kShippedTunings[];
extern const std::size_t kShippedTuningCount;

} // namespace clsp

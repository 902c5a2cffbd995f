// What a diagnosis found, as a camera that can be rendered again: the simulator's settings, every effect of its model,
// and apart from them the lab's conditions.
#pragma once

#include "inference/replicate_runner.hpp"
#include "measure/diagnosis_result.hpp"
#include "measure/pattern_maps.hpp"

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace clsp {

struct ProfileParameter {
    std::string name;
    double value = 0.0;
    std::optional<std::array<double, 2>> interval; // of 95 %; none where the parameter was not fitted
};

struct ProfileEffect {
    std::string id;
    std::vector<ProfileParameter> parameters; // all, in the catalogue's order
    bool named = true;                        // by the verdict; false: fitted beside such effects
    bool conditional = false;                 // rests on a scene in which something unknown remains
};

// The light that one sequence was recorded in.
struct ProfileSequence {
    std::string name;
    CaptureScene scene = CaptureScene::kDark;
    bool moving = false;
    double f_number = 0.0;
    std::optional<double> exposure_ms;
    double mean_dn = 0.0;  // of the camera's frames
    double light_dn = 0.0; // above black, of the simulator's; 0 of dark ones
    double gain_dn =
        0.0; // DN per unit of the ideal image, which is 1 on flat and board and at a dot's peak; 0 of dark ones
};

// Of a lamp or a laser, as LabLight has it.
struct ProfileLight {
    std::string name;
    std::vector<std::string> sequences;
    bool uneven = false; // certain, and calibrated away
    std::array<double, 2> slope{};
    double corner_loss = 0.0;
};

struct ProfileDrift {
    std::string sequence;
    double deviation = 0.0;
};

// The numbers of CLSP_PROFILE_MAP_*.
enum ProfileMapKind : unsigned { kDarkMap = 1, kGainMap = 2 };

// A map of the camera's pixels, in a file beside the profile's.
struct ProfileMap {
    std::string file;               // its name, without a folder
    std::uint64_t hash = 0;         // FNV-1a of the values' bytes
    std::vector<std::string> holds; // effects that it stands for
    std::vector<std::string> sequences;
    std::uint32_t frame_count = 0;
    double standard_error = 0.0; // of a pixel: PatternMap
    double pixel_part = 1.0, row_part = 1.0, column_part = 1.0;
    std::shared_ptr<const std::vector<float>> values; // null: they are in the file
};

struct CameraProfile {
    // The camera, as the simulator has it.
    std::uint32_t width = 0, height = 0, bits = 0;
    double pixel_pitch_m = 0.0, f_number = 0.0, wavelength_m = 0.0, degree_of_polarization = 1.0;
    FieldKind field = FieldKind::kCircularGaussian;
    std::array<double, 2> principal_point_px{};
    double black_level_dn = 0.0, read_noise_dn = 0.0; // calibrated
    // How the field is sampled: samples of a pixel along each axis, and the part of its area that they stand for; 0:
    // all.
    std::uint32_t oversampling = 1;
    double fill_factor = 0.0;
    std::vector<ProfileEffect> effects;    // of the catalogue
    std::vector<ProfileEffect> hypotheses; // the caller's own, which only a diagnosis can simulate
    // Patterns of its own pixels: DN above the black level; gains over the image's mean.
    std::optional<ProfileMap> dark_map, gain_map;
    std::vector<std::string> map_notes; // why one is missing
    std::string path;                   // of the file that it was read from; empty: of none

    unsigned maps() const { return (dark_map ? kDarkMap : 0u) | (gain_map ? kGainMap : 0u); }
    // Whether one of these maps holds the effect's pattern.
    bool is_held(const std::string &effect, unsigned maps) const;

    // The lab.
    std::vector<ProfileSequence> sequences;
    std::vector<ProfileLight> lights;
    std::vector<ProfileDrift> lamp_drifts;
    bool lens_or_light = false; // a fall-off may be the lens's or the light's: one kind of light alone was there

    // Where it is from.
    std::string capture, version; // the set's name, empty if it has none; of clSpeckle
    Verdict verdict = Verdict::kNone;
    std::vector<std::string> equivalent;
    bool residual_detected = false;
    double level = 0.0;
    std::uint64_t seed = 0;
};

std::uint64_t hash_of(const std::vector<float> &values);

// given: the capture as it was recorded. result: all but the profile. effects, levels: of the last model.
CameraProfile camera_profile(ReplicateRunner &runner, const Capture &given, const DiagnosisResult &result,
                             const EffectSettings &effects, const CalibratedLevels &levels, PatternMaps maps);

} // namespace clsp

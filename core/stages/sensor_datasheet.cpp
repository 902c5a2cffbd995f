#include "stages/sensor_datasheet.hpp"

#include "runtime/checks.hpp"
#include "runtime/error.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <fmt/core.h>

namespace clsp {

namespace {

// Equal but for the rounding of whoever multiplied it out.
bool agree(double a, double b) {
    return std::abs(a - b) <= 1e-9 * std::abs(b);
}

// The exposure gain, also where it is given in photons.
double exposure_gain_of(const SensorDatasheet &d) {
    check_not_negative(d.photons_per_unit, "photons_per_unit");
    if (!(d.quantum_efficiency > 0.0 && d.quantum_efficiency <= 1.0))
        throw Error(Status::kInvalidArgument,
                    fmt::format("quantum_efficiency is {}, it must be above 0 and at most 1 (electrons per photon)",
                                d.quantum_efficiency));
    if (d.photons_per_unit == 0.0)
        return d.exposure_gain_dn;
    if (d.conversion_gain_dn_per_e == 0.0)
        throw Error(Status::kInvalidArgument, "photons_per_unit needs to know what an electron is: set "
                                              "conversion_gain_dn_per_e, which is 0");
    const double gain = d.conversion_gain_dn_per_e * d.quantum_efficiency * d.photons_per_unit;
    if (d.exposure_gain_dn != SensorParameters().exposure_gain_dn && !agree(d.exposure_gain_dn, gain))
        throw Error(Status::kInvalidArgument,
                    fmt::format("exposure_gain_dn is {}, but photons_per_unit, quantum_efficiency and "
                                "conversion_gain_dn_per_e make it {}; give the one or the other",
                                d.exposure_gain_dn, gain));
    return gain;
}

// Where the signal clips, also where it is given in electrons.
double saturation_of(const SensorDatasheet &d) {
    check_not_negative(d.full_well_e, "full_well_e");
    if (d.full_well_e == 0.0)
        return d.saturation_dn;
    if (d.conversion_gain_dn_per_e == 0.0)
        throw Error(Status::kInvalidArgument,
                    "full_well_e needs to know what an electron is: set conversion_gain_dn_per_e, which is 0");
    const double saturation = d.conversion_gain_dn_per_e * d.full_well_e;
    if (saturation <= d.black_level_dn)
        throw Error(Status::kInvalidArgument,
                    fmt::format("full_well_e is {}, which is {} DN at conversion_gain_dn_per_e = {}: it must be above "
                                "the black level, black_level_dn = {}",
                                d.full_well_e, saturation, d.conversion_gain_dn_per_e, d.black_level_dn));
    if (!std::isinf(d.saturation_dn) && !agree(d.saturation_dn, saturation))
        throw Error(Status::kInvalidArgument,
                    fmt::format("saturation_dn is {}, but full_well_e and conversion_gain_dn_per_e make it {}; give "
                                "the one or the other",
                                d.saturation_dn, saturation));
    return saturation;
}

// docs/method/sensor.md says where each number comes from.
SensorDatasheet os04a10() {
    SensorDatasheet d;
    d.width = 2688;
    d.height = 1520;
    d.bits = 10;
    d.black_level_dn = 64.0;
    d.read_noise_dn = 0.015 * 1023.0;
    d.conversion_gain_dn_per_e = 0.08;
    d.full_well_e = 12000.0;
    d.quantum_efficiency = 0.4;
    d.dark_current_e_per_s = 10.0;
    d.prnu = 0.01;
    d.dsnu_dn = 0.5;
    d.hot_pixel_fraction = 1e-4;
    return d;
}

struct Profile {
    const char *name;
    SensorDatasheet (*datasheet)();
};

constexpr std::array<Profile, 1> kProfiles{{{"OS04A10", os04a10}}};

std::string lower(std::string text) {
    std::transform(text.begin(), text.end(), text.begin(), [](unsigned char c) { return std::tolower(c); });
    return text;
}

} // namespace

SensorParameters SensorDatasheet::parameters() const {
    SensorParameters p = *this;
    p.exposure_gain_dn = exposure_gain_of(*this);
    p.saturation_dn = saturation_of(*this);
    return p;
}

SensorDatasheet sensor_profile(const std::string &name) {
    std::string known;
    for (const Profile &profile : kProfiles) {
        if (lower(profile.name) == lower(name))
            return profile.datasheet();
        known += fmt::format("{}\"{}\"", known.empty() ? "" : ", ", profile.name);
    }
    throw Error(Status::kInvalidArgument, fmt::format("name is \"{}\", expected one of {}", name, known));
}

} // namespace clsp

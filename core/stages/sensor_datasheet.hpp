// A sensor as its data sheet describes it: light in photons, the well in electrons; and the sheets of known sensors.
#pragma once

#include "stages/sensor.hpp"

#include <string>

namespace clsp {

struct SensorDatasheet : SensorParameters {
    double photons_per_unit = 0.0;   // 0: exposure_gain_dn says it
    double quantum_efficiency = 1.0; // electrons per photon
    double full_well_e = 0.0;        // 0: saturation_dn says it

    // What the sensor works with, in DN. Refuses what contradicts itself.
    SensorParameters parameters() const;
};

// The sheet of a sensor, by a name in which case does not matter.
SensorDatasheet sensor_profile(const std::string &name);

} // namespace clsp

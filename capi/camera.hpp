// From the C structs of a camera's parts to the engine's, for calls that make all of them.
#pragma once

#include "clspeckle/aperture.h"
#include "clspeckle/sensor.h"
#include "stages/aperture.hpp"
#include "stages/sensor.hpp"

namespace clsp::capi {

// name: what messages call the struct.
ApertureParameters aperture_parameters(const ClspApertureDesc *user, const char *name);
SensorParameters sensor_parameters(const ClspSensorDesc *user, const char *name);

} // namespace clsp::capi

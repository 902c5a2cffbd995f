// What a sensor makes of light on the average, without noise: for whoever turns codes back into light.
#pragma once

#include "stages/sensor_parameters.hpp"

namespace clsp {

// Mean signal of the dark current in DN.
double dark_signal_dn(const SensorParameters &parameters);
// Non-linearity: what the readout gives of a signal below the full well; and the signal that it gives as much of.
double response_dn(const SensorParameters &parameters, double signal_dn);
double signal_of_response_dn(const SensorParameters &parameters, double response_dn);
// Mean code in the dark, of pixels without offsets of their own.
double mean_dark_dn(const SensorParameters &parameters);

} // namespace clsp

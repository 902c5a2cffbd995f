// How uneven a lab's lamp and laser are: conditions of the recording, calibrated like its light levels.
#pragma once

#include "capture/capture.hpp"

#include <array>
#include <string>
#include <vector>

namespace clsp {

struct LabLight {
    std::string name;                   // "lamp" (flats) or "laser" (boards; dots where there is no board)
    std::vector<std::string> sequences; // it falls on
    SmoothLight light;                  // 1 on the optical axis; even where no unevenness is certain
    double p_value = 1.0;               // of so much unevenness by chance
    // Of the light, per unit of x or y, 1 from the optical axis to the farthest corner; of r^2 where r is 1 there.
    std::array<double, 2> slope{}, slope_error{};
    double corner_loss = 0.0, corner_loss_error = 0.0;
};

// A lamp that is not as bright in every frame of a flat.
struct LampDrift {
    std::string sequence;
    double deviation = 0.0; // of a frame's light, over its mean
    std::vector<float> frame_light;
    double level_dn = 0.0; // their mean
};

struct LabLights {
    std::vector<LabLight> lights;
    std::vector<LampDrift> drifts; // of flats where it is certain
    // The fall-off that lamp and laser share, and that is centred: the lens's. It is in neither of them. 0 where it is
    // no more than two lights may share by themselves.
    double shared_corner_loss = 0.0;
    // Standard deviation of the lens's own about that: lights that are brightest on the axis share a fall-off, too. A
    // light may have as much of it as is seen of its unevenness; no capture tells. The evener light counts.
    double shared_corner_loss_error = 0.0;
    // A slope that both have alike, the camera's, too; 0: they have not.
    std::array<double, 2> shared_slope{};
    // Lamp or laser alone is there: what falls off may be the lens or the light.
    bool lens_or_light = false;
};

// From the mean frames above the dark ones. The fall-off of both kinds of light is one lens's as long as it agrees;
// else what is less. A slope is the camera's only where both are certain and alike. A slope, or what is left of the
// fall-off, counts where chance makes as much once in 1e4 times; rows and columns of pixels may differ.
LabLights measure_lab_lights(const Capture &capture);
// Without what would be calibrated: the numbers stay.
void leave_uncalibrated(LabLights &found);
// Lets the sequences have it.
void set_illumination(const LabLights &found, CaptureLayout &layout);

} // namespace clsp

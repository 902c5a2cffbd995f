// The parameters of a frame: what effects change, and what a pipeline is made of.
#pragma once

#include "stages/exposure_modes.hpp"
#include "runtime/fields.hpp"
#include "stages/airflow.hpp"
#include "stages/aperture.hpp"
#include "stages/dots.hpp"
#include "stages/lens.hpp"
#include "stages/phase.hpp"
#include "stages/sensor.hpp"

#include <cstdint>
#include <limits>
#include <optional>

namespace clsp {

// What belongs to no stage alone. The defaults are off.
struct PipelineParameters {
    std::uint64_t seed = 0;
    std::uint32_t line_count = 1; // laser
    double dephasing_rad = 0.0;
    double power_flicker = 0.0;
    double coherent_fraction = 0.0; // surface, where no material says otherwise
    double subsurface_length_px = 0.0, subsurface_fraction = 0.0;
    std::uint32_t sub_exposures = 0; // exposure; 0: as many as exposure_path takes
    double exposure_path = 0.0;
    ExposureCorrelation exposure_correlation = ExposureCorrelation::kField;
    double shutter_fraction = 0.0; // of the motion between two frames
    double boiling_correlation_frames = std::numeric_limits<double>::infinity();
    AirflowParameters airflow;
    double vibration_rms_px = 0.0;
};
CLSP_EQUALITY(PipelineParameters, seed, line_count, dephasing_rad, power_flicker, coherent_fraction,
              subsurface_length_px, subsurface_fraction, sub_exposures, exposure_path, exposure_correlation,
              shutter_fraction, boiling_correlation_frames, airflow, vibration_rms_px)

// Every parameter of a pipeline and its stages: what an effect changes.
struct PipelineModel {
    PipelineParameters pipeline;
    PhaseParameters phase;
    ApertureParameters aperture;
    LensParameters lens;
    std::optional<DotsParameters> dots;
    std::optional<SensorParameters> sensor;
};

} // namespace clsp

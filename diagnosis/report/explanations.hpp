// Names of statistics, regions, units, stages and effects in plain words.
#pragma once

#include "measure/diagnosis_result.hpp"

#include <string>

namespace clsp {

std::string explain_statistic(const std::string &name);
std::string explain_quantity(const std::string &name);
std::string explain_region(const std::string &region);
// The unit of a statistic as it stands in a table.
std::string explain_unit(const std::string &unit);
std::string explain_stage(const std::string &stage);
// The effect's one-line description from the catalogue or the hypothesis; empty if it is in neither.
std::string explain_effect(const DiagnosisResult &result, const std::string &effect);
std::string explain_sequence(CaptureScene scene, bool moving);
// An effect with the values of its parameters and their units.
std::string effect_with_values(const DiagnosisResult &result, const RankedEffect &ranked);

// Black level, read noise and light that the simulator was adjusted to.
// a, b and c.
std::string joined(const std::vector<std::string> &items);
std::string explain_calibration(const CalibrationResult &calibration);
// Lamps and lasers that are not even, lamps that drift; empty if there are none.
std::string explain_illumination(const LabLights &found);
// Why a statistic has no interval of the part of its distance that is gone; empty where it has one.
std::string why_no_interval(const GapPlace &place, const DiagnosisResult &result);

// What the verdict does not reach: sequences, effects and questions that could not be judged.
std::string explain_reach(const DiagnosisResult &result);
// The verdict in a sentence or two.
std::string verdict_sentence(const DiagnosisResult &result);

} // namespace clsp

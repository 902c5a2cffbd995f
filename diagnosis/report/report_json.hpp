// The report of a diagnosis as JSON (the gap report format, version 1).
#pragma once

#include "measure/diagnosis_result.hpp"

#include <string>

namespace clsp {

const char *verdict_name(Verdict verdict);
std::string report_json(const DiagnosisResult &result);

} // namespace clsp

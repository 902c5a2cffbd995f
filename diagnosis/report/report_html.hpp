// The report of a diagnosis as one HTML page that needs nothing else: pictures and the plotting library are within.
#pragma once

#include "measure/diagnosis_result.hpp"

#include <string>

namespace clsp {

std::string report_html(const DiagnosisResult &result);

} // namespace clsp

// Figures of the report as Vega specifications.
#pragma once

#include "measure/diagnosis_result.hpp"
#include "measure/evidence.hpp"
#include "report/html_page.hpp"

#include <string>
#include <vector>

namespace clsp {

const char *version_name(Version version);

// Curves of the versions of a sequence over a common abscissa.
struct CurvePlot {
    std::string x_title, y_title;
    std::vector<double> x;
    std::vector<std::vector<double>> own_x; // by version, in the place of x; empty: x is common to all
    std::vector<std::vector<double>> y;     // by version
    std::vector<double> y_domain;       // lowest and highest; empty: those of the data
    double y_floor = 0.0;               // what is less is drawn there; with a logarithmic axis more than 0
    bool logarithmic = false, steps = false, with_points = false, from_zero = false;
};
JsonText curve_figure(const CurvePlot &plot);

// Largest |z| of each stage in each sequence.
JsonText stage_map(const DiagnosisResult &result);
// Largest |z| over the regions of each statistic in each sequence, before and (if effects were found) after; the `rows`
// statistics with the largest. rows = 0: all.
JsonText statistic_map(const DiagnosisResult &result, std::size_t rows);
std::size_t statistic_name_count(const DiagnosisResult &result);

JsonText ranking_figure(const DiagnosisResult &result);
JsonText waterfall_figure(const DiagnosisResult &result);

} // namespace clsp

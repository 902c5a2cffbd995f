// Sections of the HTML report.
#pragma once

#include "measure/diagnosis_result.hpp"
#include "measure/evidence.hpp"
#include "report/html_page.hpp"

namespace clsp {

void write_summary(const DiagnosisResult &result, HtmlPage &page);
// The first frames of the camera and of both simulators, side by side; only if the result has evidence.
void write_strip(const DiagnosisResult &result, HtmlPage &page);
void write_places(const DiagnosisResult &result, HtmlPage &page);
void write_cause(const DiagnosisResult &result, HtmlPage &page);
void write_shrinkage(const DiagnosisResult &result, HtmlPage &page);
void write_downstream(const DiagnosisResult &result, HtmlPage &page);
// In a data sheet's units.
void write_datasheet(const DiagnosisResult &result, HtmlPage &page);
void write_advice(const DiagnosisResult &result, HtmlPage &page);
// Only if the result has evidence.
void write_evidence(const DiagnosisResult &result, HtmlPage &page);
void write_notes(const DiagnosisResult &result, HtmlPage &page);
void write_explanation(const DiagnosisResult &result, HtmlPage &page);

} // namespace clsp

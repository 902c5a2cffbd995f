// EMVA 1288's numbers of a capture set for programs, for readers and for the package emva1288.
#pragma once

#include "measure/diagnosis_result.hpp"
#include "measure/emva1288.hpp"
#include "report/html_page.hpp"

#include "io/json_text.hpp"
#include <string>

namespace clsp {

// The key "emva1288" of a report (docs/method/emva1288.md).
image_io::JsonText emva_json(const Emva1288 &emva);
// With the sections and element names of the package's results (release 1.0.2), which its xml_to_dict() and
// compare_xml() read. What is not known is None.
std::string emva_xml(const Emva1288 &emva);
void write_emva(const DiagnosisResult &result, HtmlPage &page);

} // namespace clsp

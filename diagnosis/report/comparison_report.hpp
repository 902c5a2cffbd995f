// What a comparison adds to the report of a diagnosis.
#pragma once

#include "measure/diagnosis_result.hpp"
#include "report/html_page.hpp"

#include "io/json_text.hpp"

namespace clsp {

// The key "compare".
image_io::JsonText comparison_json(const Comparison &comparison);
// The page's section on pairs, levels and effects that cannot be put on finished frames; nothing of a diagnosis.
void write_comparison(const DiagnosisResult &result, HtmlPage &page);

} // namespace clsp

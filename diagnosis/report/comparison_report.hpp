// What a comparison adds to the report of a diagnosis.
#pragma once

#include "measure/diagnosis_result.hpp"
#include "report/html_page.hpp"

#include <nlohmann/json_fwd.hpp>

namespace clsp {

// The key "compare".
nlohmann::ordered_json comparison_json(const Comparison &comparison);
// The page's section on pairs, levels and effects that cannot be put on finished frames; nothing of a diagnosis.
void write_comparison(const DiagnosisResult &result, HtmlPage &page);

} // namespace clsp

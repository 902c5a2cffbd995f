// What a test engineer computes of dark and flat frames before any simulation: EMVA 1288 (release 4.0) and photon
// transfer, of the raw codes alone. docs/method/emva1288.md has the formulas.
#pragma once

#include "capture/capture.hpp"
#include "measure/emva_result.hpp"

#include <vector>

namespace clsp {

struct NamedEmvaValue {
    const char *name, *unit, *text; // "system_gain", "DN/e", "system gain K"
    const EmvaValue *value;
};
// All values in the order of reports.
std::vector<NamedEmvaValue> named_values(const Emva1288 &emva);
// The values point into what they are taken from.
std::vector<NamedEmvaValue> named_values(Emva1288 &&emva) = delete;
const char *method_name(EmvaGainMethod method);

Emva1288 measure_emva1288(const Capture &capture);

} // namespace clsp

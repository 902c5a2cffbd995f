// How far the simulator may be believed, quantity by quantity in its own unit: the area validation metric.
#pragma once

#include "measure/datasheet_quantities.hpp"

#include <string>
#include <vector>

namespace clsp {

// The area between two distribution functions: here that of simulated captures, taken for a normal one, and the step at
// the camera's only value, which is the mean distance of a simulated capture from the camera (Ferson, Oberkampf and
// Ginzburg, Comput. Methods Appl. Mech. Eng. 197 (2008) 2408). In the quantity's unit.
struct AreaMetric {
    double area = 0.0;
    double bias = 0.0;    // of it: how far the simulated captures' mean is from the camera
    double scatter = 0.0; // the rest: how far simulated captures are from each other
};
// deviation: of the simulated captures; at least 0.
AreaMetric area_metric(double real, double mean, double deviation);

struct CredibilityRow {
    std::string sequence; // empty: of several sequences together
    std::string quantity, unit;
    std::vector<AreaMetric> versions; // of the baseline, and with effects if there are any
};
// Of the quantities that the camera's and all simulated captures tell.
std::vector<CredibilityRow> credibility(const DatasheetQuantities &measured);

} // namespace clsp

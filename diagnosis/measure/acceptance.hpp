// Whether the simulator is good enough for its user: its differences from the camera against tolerances of a file.
#pragma once

#include <array>
#include <cstddef>
#include <limits>
#include <string>
#include <vector>

namespace clsp {

// One number of the file. A key is "NAME", "SEQUENCE/NAME" or, of statistics, "SEQUENCE/NAME/REGION".
struct Tolerance {
    bool of_statistic = false;
    std::string key;
    double limit = 0.0;
    std::string unit; // empty: that of what it is for; "%" of anything else's: of the camera's value
};
struct Tolerances {
    std::string path;
    std::vector<Tolerance> entries;
};
// {"quantities": {KEY: LIMIT}, "statistics": {KEY: LIMIT}}; LIMIT: 0.2 or "0.2 DN". Throws kIo and kInvalidArgument.
Tolerances read_tolerances(const std::string &path);

enum class Acceptance { kAccepted, kNotAccepted, kUndecided };
const char *acceptance_name(Acceptance acceptance);

// Simulator less camera.
struct JudgedDifference {
    double difference = std::numeric_limits<double>::quiet_NaN(); // NaN: simulated captures do not tell it
    std::array<double, 2> interval_95 = {difference, difference};
    Acceptance acceptance = Acceptance::kUndecided;
};
// Of the mean of so many simulated captures, which scatter by the deviation, as the camera's value does.
JudgedDifference judge_difference(double real, double mean, double deviation, double captures, double tolerance);

// What a tolerance may be for: a quantity of a data sheet or a statistic that the camera's frames tell.
struct Measurable {
    bool is_statistic = false;
    std::string sequence, name, region, unit; // sequence: empty of several together
    double real = 0.0;
    std::size_t index = 0; // among all quantities, or all statistics
};
struct AcceptanceRow {
    Measurable of;
    double tolerance = 0.0; // in its unit
    std::vector<JudgedDifference> versions; // of the baseline, and with effects if there are any
};
// What the tolerances are for, in that order; of two that are for one thing the one with more in its key counts. Throws
// kInvalidArgument for what is not there, and names what is.
std::vector<AcceptanceRow> acceptance_rows(const Tolerances &tolerances, const std::vector<Measurable> &there);

} // namespace clsp

// Phases of a periodic unit cell that splits a beam into wanted diffraction orders: weighted Gerchberg-Saxton on the
// device, then direct binary search. The definitions are in doe_design.h of the C API.
#pragma once

#include "doe/doe_orders.hpp"
#include "runtime/context.hpp"

#include <memory>
#include <vector>

namespace clsp {

struct DoeDesign {
    DoeDesignParameters parameters; // orders: with the mirrored ones; no progress
    std::vector<float> phase;       // height x width, radians in [0, 2 pi)
    std::vector<double> powers;     // of the orders
    std::vector<DoeDesignStep> history;
    DoeDesignReport report;
};

std::shared_ptr<const DoeDesign> design_doe(const std::shared_ptr<Context> &context, DoeDesignParameters parameters);

// What a given phase does with the orders.
std::shared_ptr<const DoeDesign> evaluate_doe(const std::shared_ptr<Context> &context, DoeDesignParameters parameters,
                                              std::vector<float> phase);

} // namespace clsp

// Where the light of a pattern goes: wanted dots, zero order, ghosts, scatter.
#pragma once

#include "doe/doe_element.hpp"
#include "doe/doe_field.hpp"

namespace clsp {

// What is known before any light is counted; half_u, half_v: a spot's half-angle in direction cosines.
void begin_power_budget(const PatternImage &image, const BeamProfile &beam, double half_u, double half_v,
                 DoePowerBudget &budget);
// From the bins of the cell's transform.
void balance_orders(const DoeElement &element, const DoeLight &light, DoePatternResult &result);
// From the texels; half_u, half_v: a spot's half-angle at the mean wavelength.
void balance_aperture(const DoeElement &element, const std::vector<float> &texel_shares, double half_u, double half_v,
                      DoePatternResult &result);
// Adds the light that etch noise scatters under the pixel's envelope (ORDERS).
void add_scatter(const DoeElement &element, std::vector<float> &texel_shares);
// From shares of the power to W/sr; fills inside_image.
void finish_texels(std::vector<float> texel_shares, DoePatternResult &result);

} // namespace clsp

// Tail probabilities.
#pragma once

namespace clsp {

// P(|T| > |t|) of Student's law.
double student_two_sided(double t, double degrees_of_freedom);
// The |t| with that probability.
double student_two_sided_quantile(double probability, double degrees_of_freedom);
// P(X > x) of the gamma law with that mean and variance.
double gamma_upper(double x, double mean, double variance);

} // namespace clsp

// Tail probabilities.
#pragma once

namespace clsp {

// P(|T| > |t|) of Student's law.
double student_two_sided(double t, double degrees_of_freedom);
// The |t| with that probability.
double student_two_sided_quantile(double probability, double degrees_of_freedom);
// The Gaussian deviate that is as rare as z on the long side of a law of mean 0, deviation 1 and that skewness (Cornish
// and Fisher's first term); on the short side, where it would be rarer, z itself.
double without_skewness(double z, double skewness);
// P(X > x) of Fisher's law.
double fisher_upper(double x, double numerator_freedom, double denominator_freedom);
// P(X > x) of the gamma law with that mean and variance.
double gamma_upper(double x, double mean, double variance);

} // namespace clsp

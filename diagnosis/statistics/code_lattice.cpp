// The histogram of codes as such: converters with fewer effective bits, missing codes, compression.
#include "statistics/histogram_share.hpp"
#include "statistics/statistic_groups.hpp"

#include <cmath>

namespace clsp::statistics {
namespace {

constexpr std::size_t kFewPatterns = 4;
constexpr double kSpecklePixels = 4.0; // above a level near the top, of a speckle that reaches it

} // namespace

void measure_code_lattice(const StatisticInput &in, Sink &sink) {
    const std::vector<std::uint64_t> &histogram = in.frames.histogram;
    const double total = double(in.geometry.frames) * double(in.geometry.used);
    const auto put_multiples = [&](std::size_t step, std::size_t first, const char *name) {
        std::uint64_t multiples = 0;
        for (std::size_t code = first; code < histogram.size(); code += step)
            multiples += histogram[code];
        sink.put("sensor", name, "1", double(multiples) / total - 1.0 / double(step));
    };
    put_multiples(2, 0, "codes_multiple_of_2");
    put_multiples(4, 0, "codes_multiple_of_4");
    put_multiples(4, 1, "codes_multiple_of_4_plus_1"); // with the two before: all four remainders
    put_multiples(8, 0, "codes_multiple_of_8");
    // Fourth differences of the counts pass a smooth law and keep its counting noise, which is 1 in these units. The
    // last codes on both sides, where clipping piles up, are left out.
    double rough = 0.0, counts = 0.0;
    for (std::size_t code = 5; code + 5 < histogram.size(); ++code) {
        const double a = double(histogram[code - 2]), b = double(histogram[code - 1]), c = double(histogram[code]);
        const double d = double(histogram[code + 1]), e = double(histogram[code + 2]);
        const double difference = a - 4.0 * b + 6.0 * c - 4.0 * d + e;
        rough += difference * difference;
        counts += a + 16.0 * b + 36.0 * c + 16.0 * d + e;
    }
    sink.put("sensor", "histogram_roughness", "log", std::log((rough + 70.0) / (counts + 70.0)));
}

void measure_levels(const StatisticInput &in, Sink &sink) {
    const std::vector<std::uint64_t> &histogram = in.frames.histogram;
    const double total = double(in.geometry.frames) * double(in.geometry.used);
    const double full = in.geometry.maximum_code - in.black_level_dn;
    // A bright speckle has several pixels, and stays where it is in a scene that rests.
    const bool speckle = is_laser(in.geometry.scene);
    const double together = speckle ? kSpecklePixels * (in.geometry.moving ? 1.0 : double(in.geometry.frames)) : 1.0;
    for (const int percent : {25, 50, 75, 95}) {
        const double level = 0.01 * percent * full;
        const double above = share_above(histogram, total, in.black_level_dn, level, full - level);
        sink.put_share("sensor", "share_above_" + std::to_string(percent) + "_percent", above, together, total);
    }
    // The brightest speckle of few speckle patterns is an accident of the patterns.
    if (speckle && (!in.geometry.moving || in.geometry.frames < kFewPatterns))
        return;
    // The bright end without a maximum: the ratio of the 16th to the 8th moment comes near it, and is smooth.
    double eighth = 0.0, sixteenth = 0.0;
    for (std::size_t code = 0; code < histogram.size(); ++code) {
        const double signal = std::max(double(code) - in.black_level_dn, 0.0) / full, squared = signal * signal;
        const double fourth = squared * squared, power = fourth * fourth;
        eighth += double(histogram[code]) * power / total;
        sixteenth += double(histogram[code]) * power * power / total;
    }
    sink.put("sensor", "bright_end", "log", eighth > 1e-60 ? std::log(sixteenth / eighth) / 8.0 : 0.0);
}

} // namespace clsp::statistics

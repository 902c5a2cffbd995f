#include "report/explanations.hpp"
#include "report/figures.hpp"
#include "report/report_sections.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/core.h>
#include <functional>

namespace clsp {
namespace {

constexpr std::uint32_t kStripWidth = 320; // px; a narrow page makes them smaller

using PictureOf = Picture VersionEvidence::*;

std::string scale_text(const Picture &picture) {
    return picture.channels == 3
               ? fmt::format("blue {} DN, white 0, red +{} DN", figure(picture.low_dn), figure(picture.high_dn))
               : fmt::format("black {} DN, white {} DN", figure(picture.low_dn), figure(picture.high_dn));
}

// One row of pictures, a cell for each version.
void write_pictures(const SequenceEvidence &sequence, PictureOf which, const std::string &what,
                    std::uint32_t shown_width, HtmlPage &page) {
    const auto has = [&](const VersionEvidence &version) { return !(version.*which).empty(); };
    const auto first = std::find_if(sequence.versions.begin(), sequence.versions.end(), has);
    if (first == sequence.versions.end())
        return;
    page.raw("<figure><div class=\"pictures\">\n");
    for (std::size_t v = 0; v < sequence.versions.size(); ++v) {
        const Picture &picture = sequence.versions[v].*which;
        if (picture.empty())
            continue;
        const std::string name = version_name(static_cast<Version>(v));
        page.raw("<div>");
        page.picture(picture, fmt::format("{}, {}: {}", sequence.name, name, what), shown_width);
        page.raw(fmt::format("<span>{}</span></div>\n", escaped(name)));
    }
    page.raw(fmt::format("</div><figcaption>{}</figcaption></figure>\n",
                         escaped(fmt::format("{} Scale: {}.", what, scale_text((*first).*which)))));
}

std::vector<std::vector<double>> curves(const SequenceEvidence &sequence, std::vector<double> VersionEvidence::*curve) {
    std::vector<std::vector<double>> result;
    for (const VersionEvidence &version : sequence.versions)
        result.push_back(version.*curve);
    return result;
}

void write_histogram(const SequenceEvidence &sequence, HtmlPage &page) {
    CurvePlot plot;
    plot.x_title = "code, DN";
    plot.y_title = "share of the pixels";
    plot.y = curves(sequence, &VersionEvidence::histogram);
    double outside = 0.0, least = 1.0;
    for (const VersionEvidence &version : sequence.versions) {
        outside = std::max(outside, version.histogram_outside);
        for (const double share : version.histogram)
            least = share > 0.0 ? std::min(least, share) : least;
    }
    for (std::size_t k = 0; k < plot.y.front().size(); ++k)
        plot.x.push_back(sequence.histogram_first_dn + double(k) * sequence.histogram_step_dn);
    plot.logarithmic = true;
    plot.y_floor = 0.5 * least;
    plot.steps = true;
    page.plot(
        plot.x.empty() ? JsonText::object() : curve_figure(plot),
        fmt::format("Histogram of the codes{}; the axis is logarithmic, bins without a pixel lie on its lower end.{}",
                    sequence.histogram_step_dn > 1.0 ? fmt::format(", {:g} codes to a bin", sequence.histogram_step_dn)
                                                     : std::string(),
                    outside > 0.0 ? fmt::format(" Up to {:.2g} % of the pixels lie outside.", 100.0 * outside)
                                  : std::string()));
}

void write_power(const SequenceEvidence &sequence, HtmlPage &page) {
    CurvePlot plot;
    plot.x_title = "spatial frequency, cycles/px";
    plot.y_title = "power, DN² px²";
    plot.x = sequence.frequency;
    plot.y = curves(sequence, &VersionEvidence::power);
    double largest = 0.0, least = 0.0;
    for (const auto &curve : plot.y)
        for (const double power : curve) {
            largest = std::max(largest, power);
            if (power > 0.0)
                least = least > 0.0 ? std::min(least, power) : power;
        }
    if (!(largest > 0.0)) {
        page.paragraph("The frames do not fluctuate at all: there is no power spectrum to show.");
        return;
    }
    plot.logarithmic = true;
    plot.y_floor = std::max(least, 1e-6 * largest);
    // At least a decade: noise of the estimate is not to look like structure.
    const double widen = std::max(1.0, std::sqrt(10.0 * plot.y_floor / largest));
    plot.y_domain = {plot.y_floor / widen, largest * widen};
    page.plot(curve_figure(plot),
              fmt::format(
                  "Radial power spectrum of the fluctuations ({}), mean over {} frames: coarse structure on the left, "
                  "fine on the right.",
                  sequence.fluctuation == Fluctuation::kOverTime ? "frame minus the mean of all frames"
                                                                 : "frame minus its own mean",
                  sequence.frame_count));
}

void write_autocorrelation(const SequenceEvidence &sequence, HtmlPage &page) {
    if (sequence.frame_count < 2)
        return;
    CurvePlot plot;
    plot.x_title = "frames apart";
    plot.y_title = "correlation of the frames";
    plot.y = curves(sequence, &VersionEvidence::autocorrelation);
    for (std::uint32_t lag = 0; lag < sequence.frame_count; ++lag)
        plot.x.push_back(lag);
    plot.with_points = true;
    plot.from_zero = true;
    page.plot(curve_figure(plot), "Correlation of whole frames that lie apart in time: 1 where nothing changes; "
                                  "structure that stands (dots, fixed "
                                  "patterns, resting speckle) keeps it up.");
}

void write_dot_profile(const SequenceEvidence &sequence, HtmlPage &page) {
    if (!sequence.dot_count)
        return;
    CurvePlot plot;
    plot.x_title = "distance from the dot, px";
    plot.y_title = "signal, DN";
    plot.x = sequence.dot_radius_px;
    plot.y = curves(sequence, &VersionEvidence::dot_profile_dn);
    plot.from_zero = true;
    page.plot(curve_figure(plot), fmt::format("Profile of the dots: mean of {} dots and {} frames, black level taken "
                                              "off. A neighbour's light may show at "
                                              "the far end.",
                                              sequence.dot_count, sequence.frame_count));
}

} // namespace

void write_strip(const DiagnosisResult &result, HtmlPage &page) {
    if (!result.evidence)
        return;
    const auto differs = [&](const SequenceEvidence &sequence) {
        return std::any_of(result.places.begin(), result.places.end(), [&](const GapPlace &place) {
            return place.statistic.sequence == sequence.name && place.p_adjusted < result.level;
        });
    };
    const auto write = [&](const SequenceEvidence &sequence) {
        write_pictures(sequence, &VersionEvidence::first_frame, sequence.name + ": first frame.", kStripWidth, page);
    };
    const std::vector<SequenceEvidence> &sequences = result.evidence->sequences;
    page.raw("<section id=\"strip\">\n");
    page.heading(2, "What it looks like");
    for (const SequenceEvidence &sequence : sequences)
        if (differs(sequence))
            write(sequence);
    const auto alike = std::count_if(sequences.begin(), sequences.end(), std::not_fn(differs));
    if (alike > 0) {
        page.raw(fmt::format("<details><summary>{} in which no statistic differs beyond chance</summary>\n",
                             alike == 1 ? "A sequence" : fmt::format("{} sequences", alike)));
        for (const SequenceEvidence &sequence : sequences)
            if (!differs(sequence))
                write(sequence);
        page.raw("</details>\n");
    }
    page.raw("</section>\n");
}

void write_evidence(const DiagnosisResult &result, HtmlPage &page) {
    if (!result.evidence)
        return;
    const Evidence &evidence = *result.evidence;
    // What differs most is seen first, the rest is a click away.
    const std::string worst = result.places.empty() ? std::string() : result.places.front().statistic.sequence;
    page.raw("<section id=\"evidence\">\n");
    page.heading(2, "The evidence");
    page.paragraph(fmt::format(
        "The first frames of each sequence, {} x {} pixels of {} bits, beside as many new frames of the simulator. The "
        "simulated surface is another one with the same statistics: grains of speckle are not in the same places, and "
        "differ in "
        "number and shape only where the simulator is wrong.",
        evidence.width, evidence.height, evidence.bits));
    for (const SequenceEvidence &sequence : evidence.sequences) {
        page.raw(fmt::format("<details class=\"sequence\"{}><summary>", sequence.name == worst ? " open" : ""));
        page.raw(escaped(sequence.name) + " <small>" + escaped(explain_sequence(sequence.scene, sequence.moving)) +
                 "</small></summary>\n");
        if (sequence.averaged_px > 1)
            page.paragraph(
                fmt::format("Pictures are shown with squares of {0} x {0} pixels averaged.", sequence.averaged_px));
        const Picture &frame = sequence.versions.front().first_frame;
        const std::uint32_t width = std::clamp<std::uint32_t>(frame.width, 240, 320);
        write_pictures(sequence, &VersionEvidence::mean_image, fmt::format("Mean of {} frames.", sequence.frame_count),
                       width, page);
        write_pictures(sequence, &VersionEvidence::temporal_deviation,
                       "Standard deviation of each pixel over the frames.", width, page);
        write_pictures(sequence, &VersionEvidence::difference, "Residual map: simulated minus real mean image.", width,
                       page);
        write_pictures(
            sequence, &VersionEvidence::smooth_difference,
            fmt::format("The same, averaged over squares of {0} x {0} pixels: slow differences without the grain.",
                        sequence.smooth_px),
            width, page);
        page.raw("<div class=\"plots\">\n");
        write_histogram(sequence, page);
        write_power(sequence, page);
        write_autocorrelation(sequence, page);
        write_dot_profile(sequence, page);
        page.raw("</div>\n");
        write_pictures(sequence, &VersionEvidence::dot_stack,
                       fmt::format("The surroundings of a dot, {} px to each side, mean over {} dots.", kDotReach,
                                   sequence.dot_count),
                       200, page);
        page.raw("</details>\n");
    }
    page.raw("</section>\n");
}

} // namespace clsp

#include "measure/credibility.hpp"
#include "report/explanations.hpp"
#include "report/figures.hpp"
#include "report/report_sections.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/core.h>

namespace clsp {
namespace {

// scatter: of such values, where this one has no deviation of its own.
std::string with_deviation(const QuantityMean &value, double scatter) {
    if (!std::isfinite(value.mean))
        return "–";
    return std::isfinite(value.deviation) ? with_uncertainty(value.mean, value.deviation)
                                          : rounded(value.mean, scatter);
}

// Beyond twice what simulated captures scatter by, or scatter and difference are not known.
bool differs(const DatasheetQuantity &quantity) {
    if (quantity.versions.size() < 2)
        return true;
    const QuantityMean &real = quantity.versions[0], &sim = quantity.versions[1];
    return !(std::abs(real.mean - sim.mean) <= 2.0 * sim.deviation);
}

void write_photon_transfer(const std::vector<PhotonTransfer> &versions, HtmlPage &page) {
    if (versions.empty() || !versions.front().fitted)
        return;
    page.heading(3, "Photon transfer");
    CurvePlot plot;
    plot.x_title = "signal, DN";
    plot.y_title = "variance over time, DN²";
    plot.with_points = plot.from_zero = true;
    for (const PhotonTransfer &transfer : versions) {
        std::vector<TransferPoint> points = transfer.points;
        std::stable_sort(points.begin(), points.end(),
                         [](const TransferPoint &a, const TransferPoint &b) { return a.signal_dn < b.signal_dn; });
        plot.own_x.emplace_back();
        plot.y.emplace_back();
        for (const TransferPoint &point : points) {
            plot.own_x.back().push_back(point.signal_dn);
            plot.y.back().push_back(point.variance_dn2);
        }
    }
    const PhotonTransfer &real = versions.front();
    page.plot(
        curve_figure(plot),
        fmt::format("Variance over time against signal, dark and flat sequences. Photon noise makes it a straight "
                    "line, whose slope is the system gain: real {} DN per electron, by {} of {} points (those up to "
                    "70 % of the full signal).",
                    with_uncertainty(real.gain_dn_per_electron, real.gain_error), real.fitted_points,
                    real.points.size()));
}

// Bias and scatter of each version.
void write_credibility(const DiagnosisResult &result, HtmlPage &page) {
    const std::vector<CredibilityRow> rows = credibility(result.datasheet);
    if (rows.empty())
        return;
    page.heading(3, "How far the simulator may be believed");
    page.paragraph("The area validation metric: how far a simulated capture is from the camera on average, in the "
                   "quantity's unit. Bias is what a better model takes away, scatter what captures differ by anyway. " +
                   explain_reach(result));
    std::vector<std::string> head = {"sequence", "quantity", "unit"};
    std::vector<std::size_t> numbers;
    for (std::size_t v = 0; v < rows.front().versions.size(); ++v)
        for (const char *what : {"area metric", "bias", "scatter"}) {
            numbers.push_back(head.size());
            head.push_back(fmt::format("{}, {}", what, version_name(static_cast<Version>(v + 1))));
        }
    std::vector<std::vector<std::string>> table;
    for (const CredibilityRow &row : rows) {
        table.push_back({row.sequence.empty() ? "dark and flat" : row.sequence, row.quantity, explain_unit(row.unit)});
        for (const AreaMetric &metric : row.versions)
            for (const double value : {metric.area, metric.bias, metric.scatter})
                table.back().push_back(figure(value));
    }
    page.table(head, table, numbers);
}

void write_acceptance(const DiagnosisResult &result, HtmlPage &page) {
    if (result.acceptance.empty())
        return;
    page.heading(3, "Accepted by your tolerances");
    page.paragraph("Simulator less camera, with its 95 % interval. It is accepted where the whole interval lies within "
                   "the tolerance, not accepted where all of it lies outside, and undecided between: more frames make "
                   "the interval narrower.");
    std::vector<std::string> head = {"sequence", "quantity", "unit", "camera", "tolerance"};
    std::vector<std::size_t> numbers = {3, 4};
    for (std::size_t v = 0; v < result.acceptance.front().versions.size(); ++v) {
        const char *version = version_name(static_cast<Version>(v + 1));
        numbers.push_back(head.size());
        head.push_back(fmt::format("difference, {}", version));
        head.push_back(fmt::format("95 % interval, {}", version));
        head.emplace_back(version);
    }
    std::vector<std::vector<std::string>> table;
    for (const AcceptanceRow &row : result.acceptance) {
        const Measurable &of = row.of;
        table.push_back({of.sequence.empty() ? "dark and flat" : of.sequence,
                         of.region.empty() || of.region == "all" ? of.name : of.name + ", " + of.region,
                         explain_unit(of.unit), figure(of.real), "± " + figure(row.tolerance)});
        for (const JudgedDifference &judged : row.versions) {
            table.back().push_back(figure(judged.difference));
            table.back().push_back(
                std::isfinite(judged.interval_95[0])
                    ? fmt::format("{} to {}", figure(judged.interval_95[0]), figure(judged.interval_95[1]))
                    : "–");
            table.back().emplace_back(acceptance_name(judged.acceptance));
        }
    }
    page.table(head, table, numbers);
}

} // namespace

void write_datasheet(const DiagnosisResult &result, HtmlPage &page) {
    const DatasheetQuantities &datasheet = result.datasheet;
    if (datasheet.quantities.empty())
        return;
    page.raw("<section id=\"measurements\">\n");
    page.heading(2, "Measured in a data sheet's units");
    page.paragraph(fmt::format(
        "The same quantities of the camera's frames and of the simulator's{}. They are for the reader; the verdict "
        "goes by the statistics above, which have narrow laws.",
        datasheet.simulated_captures > 1
            ? fmt::format(" (mean and standard deviation of {} simulated captures)", datasheet.simulated_captures)
            : std::string()));
    const std::size_t versions = datasheet.quantities.front().versions.size();
    std::vector<std::string> head = {"sequence", "quantity", "what it is", "unit"};
    std::vector<std::size_t> numbers;
    for (std::size_t v = 0; v < versions; ++v) {
        numbers.push_back(head.size());
        head.push_back(version_name(static_cast<Version>(v)));
    }
    std::vector<std::vector<std::string>> unlike, alike;
    for (const DatasheetQuantity &quantity : datasheet.quantities) {
        auto &rows = differs(quantity) ? unlike : alike;
        rows.push_back({quantity.sequence.empty() ? "dark and flat" : quantity.sequence, quantity.name,
                        explain_quantity(quantity.name), explain_unit(quantity.unit)});
        for (const QuantityMean &value : quantity.versions)
            rows.back().push_back(with_deviation(value, versions > 1 ? quantity.versions[1].deviation : 0.0));
    }
    if (!unlike.empty())
        page.table(head, unlike, numbers);
    page.folded("Quantities within twice the simulator's scatter", head, alike, numbers);
    write_photon_transfer(datasheet.transfer, page);
    write_credibility(result, page);
    write_acceptance(result, page);
    page.raw("</section>\n");
}

} // namespace clsp

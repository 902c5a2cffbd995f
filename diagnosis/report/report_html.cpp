#include "report/report_html.hpp"

#include "report/comparison_report.hpp"
#include "report/emva_report.hpp"
#include "report/html_page.hpp"
#include "report/paste.hpp"
#include "report/report_json.hpp"
#include "report/report_script.hpp"
#include "report/report_sections.hpp"

#include <fmt/core.h>

namespace clsp {
namespace {

// The policy forbids every request and the evaluation of text, whatever a capture's names may hold.
const char *const kPolicy = "default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'";

// Colours have names, which a dark screen changes; paper is white. Figures keep their white ground: their colours mean
// something.
const char *const kStyle = R"CSS(
:root { color-scheme: light dark; --ink: #222; --page: #fff; --soft: #555; --panel: #f4f4f4; --line: #ccc; --link: #0b5394;
    --bad: #a00; }
@media screen and (prefers-color-scheme: dark) {
    :root { --ink: #ddd; --page: #17191c; --soft: #a5a9ae; --panel: #23262a; --line: #4a4e53; --link: #8ab8f0; --bad: #ff8a7a; }
    .plot { background: #fff; color: #222; border-radius: 4px; } img { filter: brightness(0.9); }
}
@media print { :root { color-scheme: light; } }
body { font: 15px/1.5 system-ui, "Segoe UI", "DejaVu Sans", sans-serif; color: var(--ink); background: var(--page);
    margin: 0 auto; padding: 1em 1.5em 4em; max-width: 1160px; overflow-wrap: break-word; }
h1 { font-size: 1.6em; margin: 0.4em 0; line-height: 1.25; } h2 { font-size: 1.3em; border-bottom: 1px solid var(--line);
    margin-top: 2.2em; }
h3 { font-size: 1.08em; margin-top: 1.6em; } nav a { margin-right: 1.1em; } a { color: var(--link); }
.verdict { border-left: 8px solid #777; background: var(--panel); padding: 0.4em 1em; margin: 1em 0; }
.verdict.none { border-color: #2e8b57; } .verdict.named { border-color: #0072B2; }
.verdict.ambiguous { border-color: #e69f00; }
.verdict.unknown { border-color: #c0281c; } .word { font-weight: bold; font-size: 1.15em; margin: 0.3em 0; }
    .sentence { margin: 0.3em 0; }
.table { overflow-x: auto; } table { border-collapse: collapse; font-size: 0.9em; margin: 0.8em 0; }
th, td { text-align: left; vertical-align: top; padding: 0.25em 0.7em 0.25em 0; border-bottom: 1px solid var(--line);
    overflow-wrap: normal; }
th { border-bottom-width: 2px; } .number { text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap; }
figure { margin: 1.2em 0; } figcaption { font-size: 0.88em; color: var(--soft); max-width: 62em; }
.plot, pre { overflow-x: auto; } pre { background: var(--panel); padding: 0.6em 0.8em; font-size: 0.88em; }
.failed { color: var(--bad); } .plots { display: flex; flex-wrap: wrap; gap: 0 2em; }
.plots figure { max-width: 540px; min-width: 0; } .plots svg { max-width: 100%; height: auto; }
.pictures { display: grid; grid-template-columns: repeat(3, minmax(0, max-content)); gap: 0.6em 1em; }
.pictures span { display: block; font-size: 0.85em; }
img { image-rendering: pixelated; border: 1px solid var(--line); max-width: 100%; height: auto; box-sizing: border-box; }
details.sequence { border: 1px solid var(--line); border-radius: 4px; padding: 0.4em 1em; }
details { margin: 0.8em 0; } summary { cursor: pointer; font-weight: bold; }
summary small { font-weight: normal; color: var(--soft); }
footer { margin-top: 3em; border-top: 1px solid var(--line); font-size: 0.88em; color: var(--soft); }
@media (max-width: 600px) { body { padding: 0.5em 0.8em 3em; } details.sequence { padding: 0.4em 0.6em; }
    .pictures { gap: 0.3em; } nav a { display: inline-block; padding: 0.3em 0; } }
@media print { body { max-width: none; padding: 0; font-size: 11px; } nav { display: none; }
    figure, tr, img { break-inside: avoid; } h2, h3 { break-after: avoid; } .table, .plot, pre { overflow: visible; }
    pre { white-space: pre-wrap; } svg { max-width: 100%; height: auto; } .number { white-space: normal; } }
)CSS";

} // namespace

std::string report_html(const DiagnosisResult &result) {
    HtmlPage page;
    page.raw("<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n");
    page.raw(fmt::format("<meta http-equiv=\"Content-Security-Policy\" content=\"{}\">\n", kPolicy));
    page.raw("<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n");
    page.raw(fmt::format("<meta name=\"generator\" content=\"clSpeckle {}\">\n", CLSP_PROJECT_VERSION));
    page.raw(fmt::format("<title>clSpeckle gap report: {}</title>\n",
                         result.no_light_judged ? "nothing could be judged" : verdict_name(result.verdict)));
    page.raw(fmt::format("<style>{}</style>\n</head>\n<body>\n", kStyle));
    page.heading(1, "How the simulated camera differs from the real one");
    page.raw("<nav><a href=\"#summary\">Verdict</a>");
    page.raw(result.evidence ? "<a href=\"#strip\">Pictures</a>" : "");
    page.raw(result.profile ? "<a href=\"#paste\">To paste</a>" : "");
    page.raw("<a href=\"#advice\">Capture next</a><a href=\"#where\">Where</a><a href=\"#cause\">Cause</a>"
             "<a href=\"#shrink\">Shrinkage</a><a href=\"#downstream\">Downstream</a>");
    page.raw(result.datasheet.quantities.empty() ? "" : "<a href=\"#measurements\">Measurements</a>");
    page.raw(result.emva ? "<a href=\"#emva1288\">EMVA 1288</a>" : "");
    page.raw(result.evidence ? "<a href=\"#evidence\">Evidence</a>" : "");
    page.raw("<a href=\"#notes\">Notes</a><a href=\"#reading\">How to read this</a></nav>\n");
    page.raw("<noscript><p>The figures are drawn by JavaScript, which is switched off here. Text, tables and pictures "
             "are complete.</p></noscript>\n");
    write_summary(result, page);
    write_strip(result, page);
    if (result.profile)
        write_paste(*result.profile, page);
    write_advice(result, page);
    write_places(result, page);
    write_cause(result, page);
    write_shrinkage(result, page);
    write_downstream(result, page);
    write_datasheet(result, page);
    write_emva(result, page);
    write_comparison(result, page);
    write_evidence(result, page);
    write_notes(result, page);
    write_explanation(result, page);
    page.raw(fmt::format("<footer><p>clSpeckle {}, seed {}, level of false alarms {}. The same capture, version and "
                         "seed give the same report. "
                         "The figures are drawn by Vega.</p></footer>\n",
                         CLSP_PROJECT_VERSION, result.seed, escaped(figure(result.level))));
    page.raw("<script>\n" + report_script() + "</script>\n</body>\n</html>\n");
    return page.text();
}

} // namespace clsp

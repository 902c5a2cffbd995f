#include "report/html_page.hpp"

#include "report/picture_png.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/core.h>
#include <nlohmann/json.hpp>

namespace clsp {
std::string escaped(const std::string &text) {
    const std::string valid = nlohmann::json::parse(image_io::json_string(text)).get<std::string>();
    std::string result;
    for (const char c : valid) {
        switch (c) {
        case '&':
            result += "&amp;";
            break;
        case '<':
            result += "&lt;";
            break;
        case '>':
            result += "&gt;";
            break;
        case '"':
            result += "&quot;";
            break;
        case '\'':
            result += "&#39;";
            break;
        default:
            result += (c >= 0 && c < ' ') || c == 127 ? ' ' : c;
        }
    }
    return result;
}

std::string figure(double value) {
    return std::isfinite(value) ? fmt::format("{:.3g}", value) : "–";
}

std::string rounded(double value, double uncertainty) {
    if (!std::isfinite(value) || !(uncertainty > 0.0) || !std::isfinite(uncertainty))
        return figure(value);
    constexpr int kMostDecimals = 6; // beyond, powers of ten are shorter
    const int decimals = 1 - static_cast<int>(std::floor(std::log10(uncertainty)));
    const double step = std::pow(10.0, -decimals), nearest = std::round(value / step) * step;
    if (nearest == 0.0)
        return "0";
    const int digits = static_cast<int>(std::floor(std::log10(std::abs(nearest)))) + decimals + 1;
    return decimals > kMostDecimals ? fmt::format("{:.{}g}", nearest, std::clamp(digits, 1, 15))
                                    : fmt::format("{:.{}f}", nearest, std::max(decimals, 0));
}

std::string with_uncertainty(double value, double uncertainty) {
    return fmt::format("{} ± {}", rounded(value, uncertainty), rounded(uncertainty, uncertainty));
}

std::string probability(double value) {
    if (!std::isfinite(value))
        return "–";
    if (value < 0.001)
        return "< 0.001";
    return value > 0.999 && value < 1.0 ? "> 0.999" : fmt::format("{:.3f}", value);
}

void HtmlPage::heading(int level, const std::string &text) {
    text_ += fmt::format("<h{0}>{1}</h{0}>\n", level, escaped(text));
}

void HtmlPage::paragraph(const std::string &text, const char *style) {
    text_ += style ? fmt::format("<p class=\"{}\">{}</p>\n", style, escaped(text))
                   : fmt::format("<p>{}</p>\n", escaped(text));
}

void HtmlPage::list(const std::vector<std::string> &items) {
    text_ += "<ul>\n";
    for (const std::string &item : items)
        text_ += "<li>" + escaped(item) + "</li>\n";
    text_ += "</ul>\n";
}

void HtmlPage::table(const std::vector<std::string> &head, const std::vector<std::vector<std::string>> &rows,
                     const std::vector<std::size_t> &numbers) {
    const auto opening = [&](const char *tag, std::size_t column) {
        const bool is_number = std::find(numbers.begin(), numbers.end(), column) != numbers.end();
        return fmt::format("<{}{}>", tag, is_number ? " class=\"number\"" : "");
    };
    text_ += "<div class=\"table\"><table>\n<thead><tr>";
    for (std::size_t c = 0; c < head.size(); ++c)
        text_ += opening("th", c) + escaped(head[c]) + "</th>";
    text_ += "</tr></thead>\n<tbody>\n";
    for (const auto &row : rows) {
        text_ += "<tr>";
        for (std::size_t c = 0; c < row.size(); ++c)
            text_ += opening("td", c) + escaped(row[c]) + "</td>";
        text_ += "</tr>\n";
    }
    text_ += "</tbody></table></div>\n";
}

void HtmlPage::folded(const std::string &summary, const std::vector<std::string> &head,
                      const std::vector<std::vector<std::string>> &rows, const std::vector<std::size_t> &numbers) {
    if (rows.empty())
        return;
    text_ += "<details><summary>" + escaped(summary) + "</summary>\n";
    table(head, rows, numbers);
    text_ += "</details>\n";
}

void HtmlPage::picture(const Picture &image, const std::string &description, std::uint32_t shown_width) {
    const std::uint32_t height = std::uint32_t(std::lround(double(shown_width) * image.height / image.width));
    text_ += fmt::format("<img src=\"data:image/png;base64,{}\" alt=\"{}\" width=\"{}\" height=\"{}\">\n",
                         base64(encode_png(image)), escaped(description), shown_width, height);
}

void HtmlPage::plot(const JsonText &specification, const std::string &caption) {
    ++plots_;
    // Within a script element only "<" could end it.
    std::string json;
    for (const char c : specification.text())
        if (c == '<')
            json += "\\u003c";
        else
            json += c;
    text_ += fmt::format(
        "<figure><div id=\"figure-{0}\" class=\"plot\"></div>\n"
        "<script type=\"application/json\" class=\"vega-specification\" data-figure=\"figure-{0}\">{1}</script>\n"
        "<figcaption>{2}</figcaption></figure>\n",
        plots_, json, escaped(caption));
}

} // namespace clsp

// Pieces of an HTML page: text that is always escaped, tables, pictures and figures.
#pragma once

#include "io/json_text.hpp"
#include "measure/picture.hpp"

#include <string>
#include <vector>

namespace clsp {

using image_io::JsonText;

// Characters that mean something in HTML as entities; what is not valid UTF-8 as U+FFFD, control characters as spaces.
std::string escaped(const std::string &text);
// Three significant digits; a dash for what is not finite.
std::string figure(double value);
// As many digits as the uncertainty, a standard deviation, leaves: its second digit is the last one. Without one:
// figure().
std::string rounded(double value, double uncertainty);
// "12.34 ± 0.56": both as rounded() has them, so that they end at the same digit.
std::string with_uncertainty(double value, double uncertainty);
// A probability: what is less than a thousandth is said to be so.
std::string probability(double value);

class HtmlPage {
  public:
    // Markup of our own, as it stands.
    void raw(const std::string &markup) { text_ += markup; }
    void heading(int level, const std::string &text);
    void paragraph(const std::string &text, const char *style = nullptr);
    void list(const std::vector<std::string> &items);
    // Columns whose index is in `numbers` are set to the right.
    void table(const std::vector<std::string> &head, const std::vector<std::vector<std::string>> &rows,
               const std::vector<std::size_t> &numbers = {});
    // A table that a click unfolds; nothing without rows.
    void folded(const std::string &summary, const std::vector<std::string> &head,
                const std::vector<std::vector<std::string>> &rows, const std::vector<std::size_t> &numbers = {});
    void picture(const Picture &image, const std::string &description, std::uint32_t shown_width);
    // Drawn by Vega.
    void plot(const JsonText &specification, const std::string &caption);

    const std::string &text() const { return text_; }

  private:
    std::string text_;
    int plots_ = 0;
};

} // namespace clsp

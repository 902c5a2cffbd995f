#include "text.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <numeric>
#include <sstream>

namespace tools {

std::string table(const std::vector<std::vector<std::string>> &rows, const std::string &indent) {
    std::vector<std::size_t> widths;
    for (const auto &row : rows) {
        widths.resize(std::max(widths.size(), row.size()), 0);
        for (std::size_t i = 0; i < row.size(); ++i)
            widths[i] = std::max(widths[i], row[i].size());
    }
    std::string text;
    for (const auto &row : rows) {
        std::string line = indent;
        for (std::size_t i = 0; i < row.size(); ++i)
            line += i + 1 < row.size() ? fmt::format("{:<{}}  ", row[i], widths[i]) : row[i];
        line.erase(line.find_last_not_of(' ') + 1);
        text += (text.empty() ? "" : "\n") + line;
    }
    return text;
}

std::string percent(double share) {
    return share < 1e-3 ? fmt::format("{:.2g} %", 100 * share) : fmt::format("{:.2f} %", 100 * share);
}

std::string joined(const std::vector<std::string> &words, const char *last) {
    std::string text;
    for (std::size_t i = 0; i < words.size(); ++i)
        text += (i == 0 ? "" : i + 1 == words.size() ? last : ", ") + words[i];
    return text;
}

std::string wrapped(const std::string &text, const std::string &indent, std::size_t width) {
    std::istringstream words(text);
    std::string result;
    std::size_t used = 0;
    for (std::string word; words >> word;) {
        if (used > 0 && indent.size() + used + 1 + word.size() > width) {
            result += "\n";
            used = 0;
        }
        result += (used == 0 ? indent : " ") + word;
        used += word.size() + (used == 0 ? 0 : 1);
    }
    return result;
}

std::size_t edit_distance(const std::string &a, const std::string &b) {
    std::vector<std::size_t> row(b.size() + 1);
    std::iota(row.begin(), row.end(), std::size_t{0});
    for (std::size_t i = 1; i <= a.size(); ++i) {
        std::size_t diagonal = row[0];
        row[0] = i;
        for (std::size_t j = 1; j <= b.size(); ++j) {
            const std::size_t replace = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
            diagonal = row[j];
            row[j] = std::min({row[j] + 1, row[j - 1] + 1, replace});
        }
    }
    return row[b.size()];
}

std::string nearest(const std::string &word, const std::vector<std::string> &candidates) {
    std::string best;
    std::size_t least = ~std::size_t{0};
    for (const std::string &candidate : candidates) {
        const std::size_t distance = edit_distance(word, candidate);
        if (distance < least) {
            least = distance;
            best = candidate;
        }
    }
    return best;
}

std::string suggestion(const std::string &word, const std::vector<std::string> &candidates, bool quoted) {
    const std::size_t dashes = std::min(word.find_first_not_of('-'), word.size());
    std::vector<std::string> longer;
    for (const std::string &candidate : candidates)
        if (word.size() > dashes + 1 && candidate.rfind(word, 0) == 0)
            longer.push_back(candidate);
    const std::string best = nearest(word, longer.empty() ? candidates : longer);
    const std::size_t letters = std::max(word.size(), best.size()) - dashes;
    if (longer.empty() && edit_distance(word, best) > std::max<std::size_t>(1, letters / 3))
        return "";
    return "; the nearest one is " + (quoted ? '"' + best + '"' : best);
}

} // namespace tools

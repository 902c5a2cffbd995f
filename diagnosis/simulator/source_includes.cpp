#include "simulator/source_includes.hpp"

#include <algorithm>
#include <cctype>
#include <iterator>
#include <utility>

namespace clsp {
namespace {

constexpr const char *kDirectives[] = {"include", "include_next", "import", "embed", "__include_macros"};
constexpr const char *kWords[] = {
    "__has_include", "__has_include_next", "__has_embed", "asm", "__asm", "__asm__", "_Pragma", "__pragma"};
constexpr const char *kPragmas[] = {"OPENCL", "STDC", "unroll"};

// Phase 1 of translation, where compilers know it.
std::string with_trigraphs(const std::string &text) {
    constexpr std::pair<char, char> kTrigraphs[] = {{'=', '#'}, {'/', '\\'}, {'\'', '^'}, {'(', '['}, {')', ']'},
                                                    {'!', '|'}, {'<', '{'},  {'>', '}'},  {'-', '~'}};
    std::string result;
    for (std::size_t i = 0; i < text.size(); ++i) {
        const auto meant = text.compare(i, 2, "??") != 0 || i + 2 >= text.size()
                               ? std::end(kTrigraphs)
                               : std::find_if(std::begin(kTrigraphs), std::end(kTrigraphs),
                                              [&](const auto &pair) { return pair.first == text[i + 2]; });
        result += meant == std::end(kTrigraphs) ? text[i] : meant->second;
        i += meant == std::end(kTrigraphs) ? 0 : 2;
    }
    return result;
}

bool is_blank(char c) {
    return c == ' ' || c == '\t' || c == '\v' || c == '\f' || c == '\0';
}

// Compilers take Unicode's blanks, too; what else is beyond ASCII stands in no directive.
bool is_space(char c) {
    return is_blank(c) || static_cast<unsigned char>(c) >= 0x80;
}

// Phase 2: lines that a backslash joins. blanks: some compilers take blanks between it and the line's end.
std::string joined(const std::string &text, bool blanks) {
    std::string result;
    for (std::size_t i = 0; i < text.size(); ++i) {
        std::size_t end = i + 1;
        while (text[i] == '\\' && blanks && end < text.size() && is_blank(text[end]))
            ++end;
        if (text[i] == '\\' && end < text.size() && (text[end] == '\n' || text[end] == '\r'))
            i = text.compare(end, 2, "\r\n") == 0 ? end + 1 : end;
        else
            result += text[i];
    }
    return result;
}

bool is_line_end(char c) {
    return c == '\n' || c == '\r';
}

// Phase 3: a blank for each comment, nothing within quotation marks. What is not closed ends with its line.
std::string bare(const std::string &text) {
    std::string result;
    for (std::size_t i = 0; i < text.size(); ++i) {
        const char c = text[i];
        if (text.compare(i, 2, "/*") == 0) {
            const std::size_t end = text.find("*/", i + 2);
            i = end == std::string::npos ? text.size() : end + 1;
            result += ' ';
        } else if (text.compare(i, 2, "//") == 0) {
            while (i + 1 < text.size() && !is_line_end(text[i + 1]))
                ++i;
        } else if (c == '"' || c == '\'') {
            result += c;
            while (i + 1 < text.size() && text[i + 1] != c && !is_line_end(text[i + 1]))
                i += text[i + 1] == '\\' && i + 2 < text.size() && !is_line_end(text[i + 2]) ? 2 : 1;
            if (i + 1 < text.size() && text[i + 1] == c)
                result += text[++i];
        } else {
            result += c;
        }
    }
    return result;
}

bool is_word(char c) {
    return std::isalnum(static_cast<unsigned char>(c)) || c == '_' || c == '$';
}

// Behind blanks.
std::string word_at(const std::string &text, std::size_t at) {
    while (at < text.size() && is_space(text[at]))
        ++at;
    std::size_t end = at;
    while (end < text.size() && is_word(text[end]))
        ++end;
    return text.substr(at, end - at);
}

template <std::size_t N> bool is_one_of(const std::string &word, const char *const (&words)[N]) {
    return std::find(std::begin(words), std::end(words), word) != std::end(words);
}

std::string found_in(const std::string &text) {
    for (std::size_t i = 0; i < text.size(); ++i) {
        if (is_word(text[i])) {
            const std::string word = word_at(text, i);
            if (is_one_of(word, kWords))
                return word;
            i += word.size() - 1;
            continue;
        }
        const std::size_t hash = text[i] == '#' ? 1 : text.compare(i, 2, "%:") == 0 ? 2 : 0;
        if (hash == 0)
            continue;
        i += hash - 1;
        if (text.compare(i + 1, hash, text, i + 1 - hash, hash) == 0)
            return "##";
        const std::string word = word_at(text, i + 1);
        if (is_one_of(word, kDirectives))
            return "#" + word;
        if (word != "pragma")
            continue;
        if (const std::string kind = word_at(text, text.find(word, i) + word.size()); !is_one_of(kind, kPragmas))
            return "#pragma " + kind;
    }
    return "";
}

} // namespace

std::string word_that_reads_files(const std::string &source) {
    for (const bool trigraphs : {false, true})
        for (const bool blanks : {false, true})
            if (std::string word = found_in(bare(joined(trigraphs ? with_trigraphs(source) : source, blanks)));
                !word.empty())
                return word;
    return "";
}

} // namespace clsp

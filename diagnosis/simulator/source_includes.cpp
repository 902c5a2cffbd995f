#include "simulator/source_includes.hpp"

#include <algorithm>
#include <cctype>
#include <iterator>
#include <utility>

namespace clsp {
namespace {

constexpr const char *kDirectives[] = {"include", "include_next", "import", "embed", "__include_macros"};
constexpr const char *kQuestions[] = {"__has_include", "__has_include_next", "__has_embed"};

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

bool is_word(char c) {
    return std::isalnum(static_cast<unsigned char>(c)) || c == '_' || c == '$';
}

// The begin of a long one.
std::string word_at(const std::string &text, std::size_t at) {
    std::size_t end = at;
    while (end < text.size() && end < at + 32 && is_word(text[end]))
        ++end;
    return text.substr(at, end - at);
}

template <std::size_t N> bool is_one_of(const std::string &word, const char *const (&words)[N]) {
    return std::find(std::begin(words), std::end(words), word) != std::end(words);
}

class Tokens {
  public:
    explicit Tokens(const std::string &text) : text_(text) {}

    // The place of the first one, behind blanks and comments; those end at the first "*/" whatever they hold.
    std::size_t next(std::size_t at) {
        at = behind_blanks(at);
        if (text_.compare(at, 2, "/*") != 0)
            return at;
        // Many hashes can stand before one end.
        const bool same = at >= known_begin_ && at + 4 <= known_end_;
        const std::size_t end = same ? known_end_ : comment_end(at);
        known_begin_ = same ? known_begin_ : at;
        if (end != known_end_) {
            known_end_ = end;
            known_next_ = behind_blanks(end);
            while (text_.compare(known_next_, 2, "/*") == 0)
                known_next_ = behind_blanks(comment_end(known_next_));
        }
        return known_next_;
    }

  private:
    std::size_t behind_blanks(std::size_t at) const {
        while (at < text_.size() && is_space(text_[at]))
            ++at;
        return at;
    }
    std::size_t comment_end(std::size_t at) const {
        const std::size_t end = text_.find("*/", at + 2);
        return end == std::string::npos ? text_.size() : end + 2;
    }
    const std::string &text_;
    std::size_t known_begin_ = 0, known_end_ = 0, known_next_ = 0;
};

bool reads_files(const std::string &text) {
    Tokens tokens(text);
    for (std::size_t i = 0; i < text.size(); ++i) {
        const std::size_t hash = text[i] == '#' ? 1 : text.compare(i, 2, "%:") == 0 ? 2 : 0;
        if (hash > 0 && is_one_of(word_at(text, tokens.next(i + hash)), kDirectives))
            return true;
        if (is_word(text[i]) && (i == 0 || !is_word(text[i - 1])) && is_one_of(word_at(text, i), kQuestions))
            return true;
    }
    return false;
}

} // namespace

bool includes_files(const std::string &source) {
    for (const bool trigraphs : {false, true})
        for (const bool blanks : {false, true})
            if (reads_files(joined(trigraphs ? with_trigraphs(source) : source, blanks)))
                return true;
    return false;
}

} // namespace clsp

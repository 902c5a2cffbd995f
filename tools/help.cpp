#include "help.hpp"

#include "text.hpp"

#include <algorithm>
#include <sstream>

namespace tools {

namespace {

constexpr std::size_t line_width = 80;
constexpr std::size_t description_column = 26;

std::size_t longest_word(const std::string &text) {
    std::istringstream words(text);
    std::size_t longest = 0;
    for (std::string word; words >> word;)
        longest = std::max(longest, word.size());
    return longest;
}

/** A name with its description beside it, or below where it is too long. */
std::string entry(const std::string &name, const std::string &description) {
    const std::string head = "  " + name;
    const bool fits = description_column + longest_word(description) <= line_width;
    const std::string text = wrapped(description, std::string(fits ? description_column : 6, ' '), line_width);
    const bool beside = fits && head.size() + 2 <= description_column && !text.empty();
    return head + (beside ? text.substr(head.size()) : "\n" + text) + "\n";
}

} // namespace

std::string reflowed(const std::string &text, std::size_t width) {
    std::istringstream lines(text);
    std::string result, paragraph;
    const auto end_paragraph = [&] {
        if (!paragraph.empty())
            result += wrapped(paragraph, "", width) + "\n";
        paragraph.clear();
    };
    for (std::string line; std::getline(lines, line);) {
        if (!line.empty() && line[0] != ' ') {
            paragraph += line + " ";
            continue;
        }
        end_paragraph();
        result += line + "\n";
    }
    end_paragraph();
    return result;
}

std::string names_of(const CLI::Option &option) {
    if (!option.nonpositional())
        return option.get_name(true) + (option.get_expected_max() > 1 ? "..." : "");
    std::string names;
    for (const std::string &name : option.get_snames())
        names += (names.empty() ? "-" : ", -") + name;
    for (const std::string &name : option.get_lnames())
        names += (names.empty() ? "--" : ", --") + name;
    const std::string type = option.get_type_name();
    return type.empty() ? names : names + " " + type.substr(0, type.find(':'));
}

std::vector<const CLI::App *> shown_commands(const CLI::App &app) {
    return app.get_subcommands([](const CLI::App *command) { return !command->get_group().empty(); });
}

std::string Formatter::make_option(const CLI::Option *option, bool) const {
    return entry(names_of(*option), option->get_description());
}

std::string Formatter::make_subcommand(const CLI::App *command) const {
    return entry(command->get_name(), command->get_description());
}

std::string Formatter::make_description(const CLI::App *command) const {
    return reflowed(CLI::Formatter::make_description(command), line_width);
}

std::string Formatter::make_footer(const CLI::App *command) const {
    return reflowed(command->get_footer(), line_width);
}

} // namespace tools

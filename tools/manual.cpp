#include "manual.hpp"

#include "help.hpp"

#include <fmt/format.h>

#include <sstream>

namespace tools {

namespace {

/** Text as roff takes it. */
std::string escaped(const std::string &text) {
    std::string result;
    for (const char c : text) {
        if (c == '\\')
            result += "\\e";
        else if (c == '-')
            result += "\\-";
        else
            result += c;
    }
    return !result.empty() && (result[0] == '.' || result[0] == '\'') ? "\\&" + result : result;
}

/** A footer: paragraphs, headings of lists, and lists as they are. */
std::string footer(const std::string &text) {
    std::istringstream lines(text);
    std::string result;
    bool listed = false, begins = true;
    for (std::string line; std::getline(lines, line);) {
        const bool item = !line.empty() && line[0] == ' ';
        if (item != listed)
            result += item ? ".PP\n.nf\n" : ".fi\n";
        if (item)
            result += escaped(line) + "\n";
        else if (line.empty())
            begins = true;
        else
            result += (begins || listed ? ".PP\n" : "") + escaped(line) + "\n";
        begins = begins && line.empty();
        listed = item;
    }
    return result + (listed ? ".fi\n" : "");
}

std::string options(const CLI::App &command) {
    std::string result;
    const auto add = [&](const std::string &name, const std::string &description) {
        result += fmt::format(".TP\n.B {}\n{}\n", escaped(name), escaped(description));
    };
    for (const CLI::Option *option : command.get_options([](const CLI::Option *o) { return o->get_positional(); }))
        add(names_of(*option), option->get_description());
    for (const std::string &group : command.get_groups()) {
        if (group.empty())
            continue;
        if (group != "Options")
            result += fmt::format(".PP\n{}:\n", escaped(group));
        for (const CLI::Option *option :
             command.get_options([&](const CLI::Option *o) { return o->get_group() == group && o->nonpositional(); }))
            add(names_of(*option), option->get_description());
    }
    return result;
}

/** A command and those within it. */
void add_command(const CLI::App &command, const std::string &path, std::string &page) {
    const std::string words = command.get_footer();
    page += fmt::format(".SS {}\n{}.\n{}{}", escaped(path), escaped(command.get_description()), options(command),
                        footer(words.substr(0, words.find("Exit codes:"))));
    for (const CLI::App *inner : shown_commands(command))
        add_command(*inner, path + " " + inner->get_name(), page);
}

} // namespace

std::string manual(const CLI::App &app, const std::string &version) {
    std::string page =
        fmt::format(".TH CLSPECKLE 1 \"\" \"clspeckle {}\" \"User Commands\"\n"
                    ".SH NAME\nclspeckle \\- simulate and diagnose laser-dot depth cameras\n"
                    ".SH SYNOPSIS\n.B clspeckle\n.I COMMAND\n.RI [ OPTIONS ] ...\n"
                    ".SH DESCRIPTION\n{}\n{}.SH OPTIONS\n{}.SH COMMANDS\n",
                    escaped(version), escaped(app.get_description()), footer(app.get_footer()), options(app));
    for (const CLI::App *command : shown_commands(app))
        add_command(*command, "clspeckle " + command->get_name(), page);
    return page;
}

} // namespace tools

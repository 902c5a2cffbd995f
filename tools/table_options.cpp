#include "table_options.hpp"

#include "number_options.hpp"
#include "options.hpp"
#include "text.hpp"

#include <algorithm>
#include <cstdint>
#include <vector>

namespace tools {

namespace {

/** What an option takes, for the help. */
std::string type_name(const Option &option) {
    switch (option.kind) {
    case Kind::integer:
        return option.words.empty() ? "INTEGER" : "INTEGER|" + option.words.front();
    case Kind::number:
        return option.words.empty() ? "NUMBER" : "NUMBER|" + option.words.front();
    case Kind::choice:
        return "WORD";
    case Kind::file:
        return "IMAGE";
    case Kind::numbers:
        return "NUMBER,...";
    default:
        return "TEXT";
    }
}

/** A default as the command line would take it. */
std::string default_text(const Option &option) {
    const Json &value = option.fallback;
    if (value.is_string())
        return value.get<std::string>();
    if (value.is_boolean())
        return value.get<bool>() ? "on" : "off";
    if (!value.is_array())
        return value.is_number_float() ? fmt::format("{}", value.get<double>()) : value.dump();
    std::string text;
    for (const double number : value.get<std::vector<double>>())
        text += fmt::format("{}{}", text.empty() ? "" : ",", number);
    return text;
}

std::string description(const Option &option) {
    std::string facts = option.range();
    if (!option.unit.empty())
        facts += (facts.empty() ? "" : ", ") + std::string("in ") + option.unit;
    const std::string fallback = default_text(option);
    if (!fallback.empty())
        facts += (facts.empty() ? "" : "; ") + std::string("default ") + fallback;
    return facts.empty() ? option.help : option.help + " (" + facts + ")";
}

std::vector<std::string> option_names(const CLI::App &app) {
    std::vector<std::string> names;
    for (const CLI::Option *option : app.get_options()) {
        for (const std::string &name : option->get_lnames())
            names.push_back("--" + name);
        for (const std::string &name : option->get_snames())
            names.push_back("-" + name);
    }
    return names;
}

} // namespace

CLI::Validator has_name() {
    return CLI::Validator(
        [](std::string &text) { return text.empty() ? std::string("is empty; name a file") : std::string(); }, "");
}

void add_table(CLI::App &app, std::map<std::string, std::string> &given) {
    for (const Option &option : option_table()) {
        const std::string id = option.id();
        const auto keep = [&given, id](const std::string &text) { given[id] = text; };
        const std::string group = "Configuration: " + option.section;
        if (option.kind == Kind::boolean) {
            app.add_flag_function(
                   "--" + option.name + ",!--no-" + option.name,
                   [keep](std::int64_t count) { keep(count > 0 ? "true" : "false"); }, description(option))
                ->group(group)
                ->multi_option_policy(CLI::MultiOptionPolicy::TakeLast);
            continue;
        }
        std::string names = "--" + option.name;
        if (!option.alias.empty())
            names += ",--" + option.alias;
        CLI::Option *added = app.add_option_function<std::string>(names, keep, description(option))
                                 ->group(group)
                                 ->type_name(type_name(option))
                                 ->take_last();
        if (option.kind == Kind::choice)
            added->check(known_words(option.words));
    }
}

std::string usage_message(const CLI::App &app, const CLI::ParseError &error, int argc, char **argv) {
    const CLI::App *command = &app;
    std::string path = "clspeckle"; // and the commands so far
    const auto known = [](const CLI::App &in, const std::string &name) {
        const auto names = option_names(in);
        return std::find(names.begin(), names.end(), name) != names.end();
    };
    for (int i = 1; i < argc; ++i) {
        const std::string word = argv[i];
        if (word == "--")
            break;
        std::vector<std::string> names;
        for (const CLI::App *sub : command->get_subcommands([](const CLI::App *) { return true; }))
            names.push_back(sub->get_name());
        if (!names.empty() && !word.empty() && word[0] != '-') {
            if (std::find(names.begin(), names.end(), word) == names.end())
                return fmt::format("there is no command \"{}\"{} (see {} --help)", word, suggestion(word, names), path);
            command = command->get_subcommand(word);
            path += " " + word;
            continue;
        }
        const std::string name = word.substr(0, word.find('='));
        if (word.rfind("--", 0) == 0 && !known(*command, name))
            return fmt::format("there is no option {}{} (see {} --help)", name,
                               suggestion(name, option_names(*command), false), path);
    }
    return fmt::format("{} (see {} --help)", error.what(), path);
}

} // namespace tools

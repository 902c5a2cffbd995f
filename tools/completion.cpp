#include "completion.hpp"

#include "help.hpp"

#include <clspeckle/clspeckle.hpp>
#include <fmt/format.h>

#include <algorithm>
#include <map>

namespace tools {

namespace {

// Each asks this program for what fits, so that they know its options and words, whatever its version.
const std::map<std::string, const char *> scripts = {{"bash", R"(# Completion of clspeckle for bash.
_clspeckle() {
    local line
    COMPREPLY=()
    while IFS= read -r line; do
        case $line in
        :files) compopt -o default ;;
        :folders) compopt -o dirnames ;;
        *) COMPREPLY+=("${line%%$'\t'*}") ;;
        esac
    done < <("${COMP_WORDS[0]}" complete -- "${COMP_WORDS[@]:1:COMP_CWORD}" 2>/dev/null)
}
complete -F _clspeckle clspeckle
)"},
                                                     {"zsh", R"(#compdef clspeckle
# Completion of clspeckle for zsh.
_clspeckle() {
    local line
    local -a lines found
    lines=("${(@f)$("$words[1]" complete -- "${(@)words[2,CURRENT]}" 2>/dev/null)}")
    [[ $PREFIX == --*=* ]] && compset -P '*='
    for line in $lines; do
        case $line in
        :files) _files ;;
        :folders) _files -/ ;;
        *) found+=("${${line%%$'\t'*}//:/\\:}:${line#*$'\t'}") ;;
        esac
    done
    (( $#found )) && _describe clspeckle found
}
if [[ $funcstack[1] == _clspeckle ]]; then
    _clspeckle "$@"
else
    compdef _clspeckle clspeckle
fi
)"},
                                                     {"fish", R"(# Completion of clspeckle for fish.
function __clspeckle_complete
    set -l words (commandline -opc)
    set -l current (commandline -ct)
    set -l option (string match -r -- '^--[^=]+=' $current)
    for line in ($words[1] complete -- $words[2..] "$current" 2>/dev/null)
        switch $line
            case :files
                __fish_complete_path (string replace -- "$option" '' $current)
            case :folders
                __fish_complete_directories (string replace -- "$option" '' $current)
            case '*'
                echo "$option$line"
        end
    end
end
complete -c clspeckle -f -a '(__clspeckle_complete)'
)"}};

bool begins_with(const std::string &text, const std::string &begin) {
    return text.compare(0, begin.size(), begin) == 0;
}

bool contains(const std::string &text, const char *part) {
    return text.find(part) != std::string::npos;
}

/** As much of a description as a list has room for: its first clause. */
std::string brief(const std::string &description) {
    std::string text = description.substr(0, description.find_first_of(":;("));
    std::replace_if(
        text.begin(), text.end(), [](char c) { return c == '\n' || c == '\t'; }, ' ');
    text.erase(text.find_last_not_of(" ,") + 1);
    return text;
}

/** The words that an option takes, or ":files" or ":folders"; nothing where any text may stand. */
std::vector<std::string> values_of(const CLI::Option &option) {
    const std::string type = option.get_type_name(); // "WORD:{gaussian,image}"
    const std::string takes = type.substr(0, type.find(':'));
    const std::size_t open = type.find('{');
    std::vector<std::string> found;
    if (open != std::string::npos) {
        found = CLI::detail::split(type.substr(open + 1, type.find('}', open) - open - 1), ',');
    } else if (begins_with(takes, "EFFECT") || begins_with(takes, "ID")) {
        for (const ClspEffectInfo &effect : clspeckle::effects())
            found.push_back(std::string(effect.id) + "\t" + brief(effect.summary));
    } else if (contains(takes, "FOLDER")) {
        found.push_back(":folders");
    } else if (takes.empty() || contains(takes, "FILE") || contains(takes, "IMAGE") || takes == "PLAN") {
        found.push_back(":files"); // without a name of its kind: INPUT and the like
    }
    return found;
}

const CLI::Option *option_named(const CLI::App &command, const std::string &word) {
    return word.size() > 1 && word[0] == '-' ? command.get_option_no_throw(word) : nullptr;
}

bool takes_value(const CLI::Option *option) {
    return option && option->get_items_expected_min() > 0;
}

} // namespace

std::vector<std::string> completion_shells() {
    std::vector<std::string> names;
    for (const auto &[shell, script] : scripts)
        names.push_back(shell);
    return names;
}

std::string completion_script(const std::string &shell) {
    return scripts.at(shell);
}

std::vector<std::string> completions(const CLI::App &app, std::vector<std::string> words) {
    if (words.empty())
        words.emplace_back();
    std::string current = words.back();
    words.pop_back();
    // bash makes three words of --option=value, the other shells one.
    const std::size_t equals = current.find('=');
    if (current == "=" || (!words.empty() && words.back() == "=")) {
        if (current == "=")
            current.clear();
        else
            words.pop_back();
    } else if (begins_with(current, "--") && equals != std::string::npos) {
        words.push_back(current.substr(0, equals));
        current.erase(0, equals + 1);
    }

    const CLI::App *command = &app;
    const CLI::Option *waiting = nullptr; // for its value
    for (const std::string &word : words) {
        if (waiting) {
            waiting = word == "=" ? waiting : nullptr;
            continue;
        }
        const CLI::Option *option = option_named(*command, word);
        if (takes_value(option))
            waiting = option;
        for (const CLI::App *next : command->get_subcommands([&](const CLI::App *c) { return c->get_name() == word; }))
            command = next;
    }

    std::vector<std::string> candidates;
    if (waiting) {
        candidates = values_of(*waiting);
    } else if (begins_with(current, "-")) {
        for (const CLI::Option *option : command->get_options([](const CLI::Option *o) { return o->nonpositional(); }))
            for (const std::string &name : option->get_lnames())
                candidates.push_back("--" + name + "\t" + brief(option->get_description()));
    } else {
        for (const CLI::App *next : shown_commands(*command))
            candidates.push_back(next->get_name() + "\t" + brief(next->get_description()));
        for (const CLI::Option *option : command->get_options([](const CLI::Option *o) { return o->get_positional(); }))
            for (const std::string &value : values_of(*option))
                candidates.push_back(value);
    }
    std::vector<std::string> fitting;
    for (const std::string &candidate : candidates)
        if (candidate[0] == ':' || begins_with(candidate, current))
            fitting.push_back(candidate);
    return fitting;
}

} // namespace tools

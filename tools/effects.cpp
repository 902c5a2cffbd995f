#include "effects.hpp"

#include "errors.hpp"
#include "text.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstring>
#include <map>

namespace tools {

namespace {

const ClspEffectInfo &find(const std::string &id, const std::string &where) {
    std::vector<std::string> ids;
    for (const ClspEffectInfo &effect : effect_catalogue()) {
        if (id == effect.id)
            return effect;
        ids.emplace_back(effect.id);
    }
    throw InputError(
        fmt::format("{}: there is no effect \"{}\"{} (see clspeckle effects)", where, id, suggestion(id, ids)));
}

double middle(const ClspEffectParameter &parameter) {
    return 0.5 * (parameter.weak + parameter.strong);
}

/** All parameters in order, those that are given in their range. */
EffectSetting complete(const ClspEffectInfo &effect, const std::map<std::string, double> &given,
                       const std::string &where) {
    EffectSetting setting{effect.id, {}};
    std::vector<std::string> names;
    for (std::uint32_t i = 0; i < effect.parameter_count; ++i)
        names.emplace_back(effect.parameters[i].name);
    for (const auto &[name, value] : given) {
        const auto found = std::find(names.begin(), names.end(), name);
        if (found == names.end())
            throw InputError(fmt::format("{}: the effect {} has no parameter \"{}\"{}; it has {}", where, effect.id,
                                         name, suggestion(name, names), fmt::join(names, ", ")));
        const ClspEffectParameter &parameter = effect.parameters[found - names.begin()];
        if (!(value >= parameter.minimum && value <= parameter.maximum))
            throw InputError(fmt::format("{}: {} must be {:g} to {:g} ({}); got {:g}", where, name, parameter.minimum,
                                         parameter.maximum, parameter.unit, value));
    }
    for (std::uint32_t i = 0; i < effect.parameter_count; ++i) {
        const auto found = given.find(names[i]);
        setting.values.push_back(found == given.end() ? middle(effect.parameters[i]) : found->second);
    }
    return setting;
}

} // namespace

const std::vector<ClspEffectInfo> &effect_catalogue() {
    static const std::vector<ClspEffectInfo> catalogue = clspeckle::effects();
    return catalogue;
}

bool changes_dots(const std::string &id) {
    return std::string(find(id, id).kernel).find("stages/dots.cl") != std::string::npos;
}

ClspCameraTraits traits_with(const std::vector<EffectSetting> &effects, ClspCameraTraits traits) {
    for (const EffectSetting &effect : effects)
        try {
            clspeckle::change_traits(traits, effect.id, effect.values);
        } catch (const clspeckle::Error &error) {
            throw InputError(fmt::format("--effect {}: {}", effect_text(effect), error.message()));
        }
    return traits;
}

EffectSetting parse_effect(const std::string &text) {
    const std::string where = "--effect " + text;
    const std::size_t colon = std::min(text.find(':'), text.size());
    const ClspEffectInfo &effect = find(text.substr(0, colon), where);
    std::map<std::string, double> given;
    for (std::size_t start = colon + 1; start <= text.size();) {
        const std::size_t end = std::min(text.find(',', start), text.size());
        const std::string part = text.substr(start, end - start);
        const std::size_t equals = std::min(part.find('='), part.size());
        const std::string name = part.substr(0, equals);
        const char *first = part.data() + std::min(equals + 1, part.size());
        double value = 0;
        const auto result = std::from_chars(first, part.data() + part.size(), value);
        if (name.empty() || result.ec != std::errc() || result.ptr != part.data() + part.size())
            throw InputError(fmt::format("{}: \"{}\" is not NAME=NUMBER; an effect is given as {}", where, part,
                                         effect_text(complete(effect, {}, where))));
        if (!given.emplace(name, value).second)
            throw InputError(fmt::format("{}: {} is given twice", where, name));
        start = end + 1;
    }
    return complete(effect, given, where);
}

EffectSetting effect_from_json(const std::string &id, const Json &parameters, const std::string &where) {
    const ClspEffectInfo &effect = find(id, where);
    if (!parameters.is_object())
        throw InputError(fmt::format("{} must be an object of numbers, got {}; for example {}", where,
                                     shown(parameters), effect_parameters(complete(effect, {}, where)).dump()));
    std::map<std::string, double> given;
    for (const auto &[name, value] : parameters.items()) {
        if (!value.is_number())
            throw InputError(fmt::format("{}: {} must be a number, got {}", where, name, shown(value)));
        given.emplace(name, value.get<double>());
    }
    return complete(effect, given, where);
}

Json effect_parameters(const EffectSetting &setting) {
    const ClspEffectInfo &effect = find(setting.id, setting.id);
    Json root = Json::object();
    for (std::size_t i = 0; i < setting.values.size(); ++i)
        root[effect.parameters[i].name] = setting.values[i];
    return root;
}

std::string effect_text(const EffectSetting &setting) {
    const ClspEffectInfo &effect = find(setting.id, setting.id);
    std::string text = setting.id;
    for (std::size_t i = 0; i < setting.values.size(); ++i)
        text += fmt::format("{}{}={}", i == 0 ? ":" : ",", effect.parameters[i].name, setting.values[i]);
    return text;
}

void run_effects(Console &console) {
    if (console.json()) {
        Json list = Json::array();
        for (const ClspEffectInfo &effect : effect_catalogue()) {
            Json parameters = Json::array();
            for (std::uint32_t i = 0; i < effect.parameter_count; ++i) {
                const ClspEffectParameter &p = effect.parameters[i];
                parameters.push_back({{"name", p.name},
                                      {"unit", p.unit},
                                      {"minimum", p.minimum},
                                      {"maximum", p.maximum},
                                      {"weak", p.weak},
                                      {"middle", middle(p)},
                                      {"strong", p.strong}});
            }
            list.push_back({{"id", effect.id},
                            {"stage", effect.stage},
                            {"summary", effect.summary},
                            {"kernel", effect.kernel},
                            {"parameters", parameters}});
        }
        console.result(Json{{"effects", list}}.dump(2));
        return;
    }
    std::vector<std::vector<std::string>> rows = {{"stage", "effect", "parameter", "unit", "weak", "strong", "range"}};
    std::string summaries;
    std::size_t widest = 0;
    for (const ClspEffectInfo &effect : effect_catalogue())
        widest = std::max(widest, std::strlen(effect.id));
    for (const ClspEffectInfo &effect : effect_catalogue()) {
        for (std::uint32_t i = 0; i < effect.parameter_count; ++i) {
            const ClspEffectParameter &p = effect.parameters[i];
            rows.push_back({i == 0 ? effect.stage : "", i == 0 ? effect.id : "", p.name, p.unit,
                            fmt::format("{:g}", p.weak), fmt::format("{:g}", p.strong),
                            fmt::format("{:g} to {:g}", p.minimum, p.maximum)});
        }
        summaries += fmt::format("  {:<{}}{}\n", effect.id, widest + 2, effect.summary);
    }
    console.result(table(rows) + "\n");
    console.result(summaries + "\nSwitch one on: clspeckle render ideal.png -o out --effect " +
                   effect_text(parse_effect("defocus")));
}

} // namespace tools

/**
 * @file effects.hpp
 * @brief The library's catalogue of effects on the command line and in the configuration.
 */
#ifndef CLSPECKLE_TOOLS_EFFECTS_HPP
#define CLSPECKLE_TOOLS_EFFECTS_HPP

#include "console.hpp"
#include "json.hpp"

#include <clspeckle/clspeckle.hpp>

#include <string>
#include <vector>

namespace tools {

/** An effect that is on, with all its parameters in order. */
struct EffectSetting {
    std::string id;
    std::vector<double> values;
};

/** Read from the library once. */
const std::vector<ClspEffectInfo> &effect_catalogue();

/** Whether an effect changes the dots that the library draws: what brings a pattern of its own cannot have it. */
bool changes_dots(const std::string &id);

/** What a camera has with effects. @param traits what it has without. */
ClspCameraTraits traits_with(const std::vector<EffectSetting> &effects, ClspCameraTraits traits);

/** From "ID" or "ID:NAME=VALUE,NAME=VALUE"; what is left out takes the middle between weak and strong. */
EffectSetting parse_effect(const std::string &text);
/** From an id and an object of numbers, as in a configuration. @param where for messages. */
EffectSetting effect_from_json(const std::string &id, const Json &parameters, const std::string &where);
/** The object of numbers. */
Json effect_parameters(const EffectSetting &setting);
/** As --effect takes it. */
std::string effect_text(const EffectSetting &setting);

/** Lists the catalogue. */
void run_effects(Console &console);

} // namespace tools

#endif // CLSPECKLE_TOOLS_EFFECTS_HPP

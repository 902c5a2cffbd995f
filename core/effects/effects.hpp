// The catalogue of effects that make a camera's picture differ from the ideal one. One effect is one entry of one table: its id, where it acts,
// its parameters with units and ranges, its kernel, and what it sets in the model.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace clsp {

struct PipelineModel;

struct EffectParameter {
    const char *name;
    const char *unit;
    double minimum, maximum; // what is accepted
    double weak, strong;     // what real cameras show, from barely visible to strong
    bool whole = false;      // counts or numbers something: only whole numbers differ
};

// Which parts of the model an effect sets.
enum : unsigned {
    kSetsPipeline = 1,
    kSetsPhase = 2,
    kSetsAperture = 4,
    kSetsLens = 8,
    kSetsDots = 16,
    kSetsSensor = 32,
};

struct Effect {
    const char *id;
    const char *stage; // laser, doe, surface, motion, optics or sensor
    const char *summary;
    const char *kernel; // file and function that carry it out
    unsigned sets;
    std::vector<EffectParameter> parameters;
    void (*apply)(PipelineModel &model, const double *values);
};

// In the order in which light meets them.
const std::vector<Effect> &effect_catalogue();
bool in_catalogue(const std::string &id);
// Throws kInvalidArgument, listing the ids, if there is none of that name.
const Effect &find_effect(const std::string &id);
// Values within the ranges; nullptr gives the middle between weak and strong.
std::vector<double> check_effect_values(const Effect &effect, const double *values, std::uint32_t count);

} // namespace clsp

// The catalogue's records: no field of any effect is missing, and they agree with each other.
#include "effects/effects.hpp"

#include <algorithm>
#include <cstring>
#include <gtest/gtest.h>
#include <set>

namespace clsp {
namespace {

bool says_something(const char *text) {
    return text && std::strlen(text) > 0;
}

TEST(EffectRecords, NoFieldIsMissing) {
    for (const Effect &effect : effect_catalogue()) {
        ASSERT_TRUE(says_something(effect.id));
        SCOPED_TRACE(effect.id);
        EXPECT_TRUE(says_something(effect.stage));
        EXPECT_TRUE(says_something(effect.summary));
        EXPECT_TRUE(says_something(effect.kernel));
        EXPECT_TRUE(says_something(effect.symptom));
        EXPECT_NE(nullptr, effect.unfinished);
        EXPECT_NE(0u, effect.sets);
        EXPECT_FALSE(effect.parameters.empty());
        EXPECT_NE(nullptr, effect.apply);
        EXPECT_NE(0u, effect.acts.scenes);
        EXPECT_NE(0u, effect.shows.scenes);
        EXPECT_GE(effect.shows.frames, 1u);
        EXPECT_GE(effect.cost.patterns, 1u);
    }
}

TEST(EffectRecords, IdsAreUnique) {
    std::set<std::string> ids;
    for (const Effect &effect : effect_catalogue())
        EXPECT_TRUE(ids.insert(effect.id).second) << effect.id;
}

TEST(EffectRecords, WhatShowsActs) {
    for (const Effect &effect : effect_catalogue()) {
        SCOPED_TRACE(effect.id);
        EXPECT_EQ(0u, effect.shows.scenes & ~effect.acts.scenes);
        if (effect.acts.motion != SceneMotion::kAny) {
            EXPECT_EQ(effect.acts.motion, effect.shows.motion);
        }
    }
}

TEST(EffectRecords, FormsAreValuesOfTheEffectsParameters) {
    for (const Effect &effect : effect_catalogue())
        for (const EffectForms &forms : effect.forms) {
            SCOPED_TRACE(effect.id);
            const auto found =
                std::find_if(effect.parameters.begin(), effect.parameters.end(),
                             [&](const EffectParameter &p) { return std::string(p.name) == forms.parameter; });
            ASSERT_NE(effect.parameters.end(), found) << forms.parameter;
            EXPECT_FALSE(forms.values.empty());
            for (const double value : forms.values) {
                EXPECT_GE(value, found->minimum);
                EXPECT_LE(value, found->maximum);
                EXPECT_NE(value, found->weak) << "the catalogue's own form is tried anyway";
            }
        }
}

TEST(EffectRecords, MeasuredParametersAreTheEffects) {
    for (const Effect &effect : effect_catalogue())
        for (const MeasuredParameter &measured : effect.measured_parameters)
            EXPECT_TRUE(std::any_of(effect.parameters.begin(), effect.parameters.end(), [&](const EffectParameter &p) {
                return std::string(p.name) == measured.parameter;
            })) << effect.id << ", " << measured.parameter;
}

TEST(EffectRecords, EvenEffectsHaveBothSigns) {
    for (const Effect &effect : effect_catalogue())
        if (effect.even) {
            EXPECT_LT(effect.parameters.front().minimum, 0.0) << effect.id;
        }
}

TEST(EffectRecords, ConfusableAreEffectsAndEachPairStandsOnce) {
    std::set<std::set<std::string>> pairs;
    for (const Effect &effect : effect_catalogue())
        for (const ConfusableEffect &other : effect.confusable_effects) {
            EXPECT_TRUE(in_catalogue(other.id)) << effect.id << " and " << other.id;
            EXPECT_TRUE(says_something(other.capture));
            EXPECT_TRUE(pairs.insert({effect.id, other.id}).second) << effect.id << " and " << other.id;
        }
    EXPECT_FALSE(pairs.empty());
}

} // namespace
} // namespace clsp

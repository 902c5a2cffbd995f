// What a simulated sequence is drawn with.
#pragma once

#include <string>
#include <vector>

namespace clsp {

// An effect that is on, one of the catalogue's or a hypothesis.
struct EffectSetting {
    std::string id;
    std::vector<double> values;
    bool operator==(const EffectSetting &other) const { return id == other.id && values == other.values; }
};

// Levels of one simulated sequence.
struct SimulationLevels {
    double gain_dn = 0.0;        // g of this sequence, in DN per unit of intensity; unused in the dark
    double black_level_dn = 0.0; // b
    double read_noise_dn = 0.0;  // r
};

} // namespace clsp

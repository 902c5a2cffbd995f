// Patterns kept in files: named by what they were computed from, written whole or not at all, ignored where damaged.
#pragma once

#include "doe/doe_element.hpp"
#include "runtime/cache_folder.hpp"

#include <memory>
#include <string>

namespace clsp {

// Everything that a pattern depends on, in 32 hexadecimal digits.
std::string doe_pattern_key(const DoeElement &element, const BeamProfile &beam, const std::string &device_name);

// nullptr if there is no whole, undamaged file of this key.
std::shared_ptr<DoePatternResult> load_doe_pattern(const CacheFolder &folder, const std::string &key);
// A cache that cannot be written costs time, not correctness: failures are silent.
void store_doe_pattern(const CacheFolder &folder, const std::string &key, const DoePatternResult &result);

} // namespace clsp

// Which capture would tell effects apart that a set cannot.
#pragma once

#include <string>
#include <vector>

namespace clsp {

struct Advice {
    std::vector<std::string> separates;
    std::string capture;
};

// One item for each pair of the effects for which a capture is known.
std::vector<Advice> advice_for(const std::vector<std::string> &equivalent);

} // namespace clsp

// One list of fields for a C struct and the parameters behind it, for both directions. A list is a generic lambda
//     [](auto field, auto &c, auto &p) { field(c.member, p.parameter); ... }
// and what `field` does is the direction. A flag names itself, for the message about one that is neither 0 nor 1.
#pragma once

#include "structs.hpp"

#include <algorithm>
#include <iterator>
#include <type_traits>

namespace clsp::capi {

struct FieldFromC {
    template <typename C, typename P> void operator()(const C &c, P &p, const char *flag = nullptr) const {
        if constexpr (std::is_array_v<C>)
            std::copy(std::begin(c), std::end(c), std::begin(p));
        else if constexpr (std::is_same_v<P, bool>)
            p = checked_flag(c, flag);
        else
            p = static_cast<P>(c);
    }
};

struct FieldToC {
    template <typename C, typename P> void operator()(C &c, const P &p, const char * = nullptr) const {
        if constexpr (std::is_array_v<C>)
            std::copy(std::begin(p), std::end(p), std::begin(c));
        else
            c = static_cast<C>(p);
    }
};

// The parameters that a C struct describes.
template <typename Parameters, typename List, typename Struct> Parameters from_c(List list, const Struct &c) {
    Parameters p;
    list(FieldFromC{}, c, p);
    return p;
}

// The C struct of some parameters; its defaults, if they are the default ones.
template <typename Struct, typename List, typename Parameters> Struct to_c(List list, const Parameters &p) {
    Struct c{};
    c.struct_size = sizeof c;
    list(FieldToC{}, c, p);
    return c;
}

} // namespace clsp::capi

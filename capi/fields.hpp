// One list of fields for a C struct and the parameters behind it, for both directions. A list is a generic lambda
//     [](auto field, auto &c, auto &p) { field(c.member, p.parameter); ... }
// and what `field` does is the direction. A flag or an enumeration names itself, for the message about a number that is
// none of its values: field(c.rule, p.rule, "desc->rule").
#pragma once

#include "enums.hpp"
#include "structs.hpp"

#include <algorithm>
#include <iterator>
#include <type_traits>

namespace clsp::capi {

struct FieldFromC {
    template <typename C, typename P> void operator()(const C &c, P &p) const {
        static_assert(!std::is_same_v<P, bool> && !std::is_enum_v<P>, "flags and enumerations name themselves");
        if constexpr (std::is_array_v<C>)
            std::copy(std::begin(c), std::end(c), std::begin(p));
        else
            p = static_cast<P>(c);
    }
    void operator()(std::uint32_t c, bool &p, const char *name) const { p = checked_flag(c, name); }
    template <typename Enum> void operator()(std::uint32_t c, Enum &p, const char *name) const {
        p = checked_enum<Enum>(c, name);
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

#include "native/aperture.hpp"

namespace native {
namespace {

template <unsigned N> constexpr Entry<Filter> filter_entry() {
    using P = typename PlanOf<N>::type;
    return {N, {filter_tables<P>, ends_of<P>, filter_lines<P>}};
}

template <unsigned... N>
Filter filter_among(std::uint32_t length, const char *what, std::integer_sequence<unsigned, N...>) {
    return entry_of<Filter>(length, {filter_entry<N>()...}, what);
}

} // namespace

Filter filter_of(std::uint32_t length, const char *what) {
    return filter_among(
        length, what,
        std::integer_sequence<unsigned, 64, 96, 128, 160, 256, 512, 720, 1024, 1080, 1280, 1920, 2048, 4096>{});
}

} // namespace native

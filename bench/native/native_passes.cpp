#include "native/native_passes.hpp"

#include "native/lanes.hpp"
#include "native/orders.hpp"

#include <cstdlib>
#include <new>
#include <stdexcept>
#if defined(__linux__)
#include <sys/mman.h>
#endif

namespace native {

void FreePages::operator()(void *memory) const {
    std::free(memory);
}

Pages allocate_pages(std::size_t floats) {
    constexpr std::size_t huge_page = std::size_t{2} << 20;
    const std::size_t bytes = (floats * sizeof(float) + huge_page - 1) / huge_page * huge_page;
    void *const memory = std::aligned_alloc(huge_page, bytes);
    if (!memory)
        throw std::bad_alloc();
#if defined(__linux__)
    madvise(memory, bytes, MADV_HUGEPAGE); // a wish: small pages serve as well, only slower
#endif
    return Pages(static_cast<float *>(memory));
}

std::uint32_t lanes() {
    return kLanes;
}

std::unique_ptr<Passes> make_passes(Order order, std::uint32_t width, std::uint32_t height, double relative_diameter,
                                    unsigned threads) {
    if (!(relative_diameter > 0.0 && relative_diameter <= 1.0))
        throw std::invalid_argument("relative diameters lie above 0, and are at most 1");
    return order == Order::kColumnsFirst ? make_column_first(width, height, relative_diameter, threads)
                                         : make_row_first(width, height, relative_diameter, threads);
}

} // namespace native

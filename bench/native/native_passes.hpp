// The three passes of the engine for CPUs in C++, for CPUs, with neither OpenCL nor a library of transforms: what is
// left to gain for the engine's kernels shows beside it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>

namespace native {

// Memory in huge pages, where the system grants them: a column's rows lie on different small pages, more of them than
// the processor keeps translations of.
struct FreePages {
    void operator()(void *memory) const;
};
using Pages = std::unique_ptr<float[], FreePages>;
Pages allocate_pages(std::size_t floats);

// Each makes exp(i phase) sqrt(ideal), transforms it, keeps what a round aperture lets through, and stores the squared
// modulus of the inverse transform.
//   columns first  columns forward, of which only the lines inside the aperture are stored; rows forward, aperture,
//                  rows inverse, in place; columns inverse
//   rows first     the same with rows and columns exchanged, as in the engine's lanes: images are read and written
//                  along their rows
enum class Order { kColumnsFirst, kRowsFirst };

class Passes {
  public:
    virtual ~Passes() = default;
    // phase in radians, up to some thousands; ideal finite, not negative; all width * height floats without gaps, from
    // a multiple of 64 bytes on.
    virtual void intensity(const float *phase, const float *ideal, float *intensity) = 0;
    virtual std::size_t workspace_bytes() const = 0;
};

// Floats in a vector of this build.
std::uint32_t lanes();

// An aperture of relative_diameter times what the sampling resolves, above 0 and at most 1; threads 0: one for each
// core. Throws std::invalid_argument for what there is no plan for.
std::unique_ptr<Passes> make_passes(Order order, std::uint32_t width, std::uint32_t height, double relative_diameter,
                                    unsigned threads = 0);

} // namespace native

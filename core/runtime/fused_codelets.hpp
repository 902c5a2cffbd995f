// OpenCL source of a plan's transform, on several lines at once: lane l of a vector belongs to line l.
#pragma once

#include "runtime/fused_plan.hpp"

#include <string>

namespace clsp {

constexpr const char *kFusedCodeletsName = "fused_codelets.h";

// The text that the kernels fused_*.cl include as "fused_codelets.h". It reads LANES and the types of fused_lanes.h,
// and macros of the including file for what a line is made of and becomes:
//   FFT_TILE                      address space of the tiles
//   FFT_STRIPS                    strips of LANES lines that the first and the last stage take side by side
//   FFT_INPUT(strip, p, re, im)   sets re and im to point p of the strip's lines           (fft_forward_first)
//   FFT_OUTPUT(strip, p, re, im)  takes point p of them                                    (fft_inverse_last)
//   FFT_PUPIL(p, re, im)          multiplies what stands at position p by the pupil        (fft_filter_block)
//   FFT_PUPIL_PARAMETERS, FFT_PUPIL_ARGUMENTS  what FFT_PUPIL needs besides, each with a comma before it
// A tile holds the points of a strip, re and im of point p at tile[2 p] and tile[2 p + 1], and one point more that
// stages leave alone: FFT_TILE_VECTORS vectors. `tiles` holds those of all strips. Blocks count from 0 to FFT_BLOCKS
// - 1.
//   fft_forward_first                              statement: the first stage of all strips, into `tiles`
//   fft_forward_block(b, tile, twiddles)           the other stages, block by block
//   fft_inverse_block(b, tile, twiddles), fft_inverse_last  the same backwards
//   fft_filter_block(b, tile, twiddles ..)         fft_forward_block, pupil, fft_inverse_block in one
//   transpose_lanes(v)                             LANES vectors
std::string fused_codelets(const FusedPlan &plan, std::uint32_t lanes);

} // namespace clsp

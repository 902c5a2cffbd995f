// OpenCL source of a plan's transform, on several lines at once: lane l of a vector belongs to line l.
#pragma once

#include "fft/plan/line_plan.hpp"

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace clsp {

constexpr const char *kCpuCodeletsName = "fft/cpu/codelets.h";

// The text that the kernels of fft/cpu include as "fft/cpu/codelets.h". It reads LANES and the types of common/lanes.h,
// and macros of the including file for what a line is made of and becomes:
//   FFT_TILE                      address space of the tiles
//   FFT_STRIPS                    strips of LANES lines that the first and the last stage take side by side
//   FFT_INPUT(strip, p, re, im)   sets re and im to point p of the strip's lines           (fft_forward_first)
//   FFT_OUTPUT(strip, p, re, im)  takes point p of them                                    (fft_inverse_last)
//   FFT_PUPIL(p, re, im)          multiplies what stands at position p by the pupil        (fft_filter_block)
//   FFT_INPUT_LOOP                a pragma before the loop over FFT_INPUT (may be left out)
//   FFT_ENDS                      defined: only some points of a line count, as the table `ends` says (needed_ends())
//   FFT_PUPIL_PARAMETERS, FFT_PUPIL_ARGUMENTS  what FFT_PUPIL needs besides, each with a comma before it
// A tile holds the points of a strip, re and im of point p at tile[2 p] and tile[2 p + 1]. Where there are several
// strips, or a kernel wants it, one point more lies behind them that stages leave alone: FFT_TILE_VECTORS vectors.
// `tiles` holds those of all strips. Blocks count from 0 to FFT_BLOCKS - 1.
//   fft_forward_first                              statement: the first stage of all strips, into `tiles`
//   fft_forward_block(b, tile, twiddles FFT_ENDS_ARGUMENT)  the other stages, block by block
//   fft_inverse_block(b, tile, twiddles FFT_ENDS_ARGUMENT), fft_inverse_last  the same backwards
//   fft_filter_block(b, tile, twiddles FFT_ENDS_ARGUMENT ..)  fft_forward_block, pupil, fft_inverse_block in one
//   transpose_lanes(v)                             LANES vectors
// and of the including file shuffle_lanes(a, b, places), elements of two vectors; places is a macro that lists their
// constant numbers.
std::string cpu_codelets(const LinePlan &plan, std::uint32_t lanes);

// Of a low-pass only some frequencies count. Behind the last stage those that a butterfly leaves lie a last radix's
// part of the spectrum apart, from low to high: only the ones at both ends are low. kEnds: how many at each end
// there is code for, besides all.
constexpr std::uint8_t kEnds[] = {0, 1, 2, 4}, kAllEnds = 255;

// For each butterfly of the last stage how many points at either end it needs for all positions that count, rounded
// up to one of kEnds or kAllEnds. What lies there and does not count is made, too (forward), and read
// (inverse).
std::vector<std::uint8_t> needed_ends(const LinePlan &plan, const std::function<bool(std::uint32_t)> &counts);
// Whether position p is made and read.
bool within_ends(const LinePlan &plan, const std::vector<std::uint8_t> &ends, std::uint32_t position);

} // namespace clsp

// OpenCL source of a plan's transform by a work-group: lines stand in local memory, and several work-items share each
// of them.
#pragma once

#include "fft/engine_spec.hpp"
#include "fft/plan/line_plan.hpp"

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace clsp {

// What a work-group is. A work-item holds the points of its butterflies in registers; between stages points change
// hands in a tile of local memory, where a point behind each block of the last stage keeps work-items off each other's
// banks.
struct WorkGroupShape {
    std::uint32_t lines = 1; // in a work-group
    std::uint32_t items = 1; // work-items for each line
    bool split = false; // real parts go through the tile first, then imaginary ones: half the memory, three barriers
                        // instead of one
    // Neighbouring work-items take neighbouring lines (columns), not neighbouring points of a line (rows).
    bool across = false;

    std::uint32_t work_items() const { return lines * items; }
};

struct WorkGroupLimits {
    std::uint32_t work_items; // work-items in a work-group
    std::uint64_t local_bytes;
};

// Which positions of a plan the pupil lets through. Those of the last stage's butterflies' q-th points make up run q
// (q = 0 .. last radix - 1), neighbouring frequencies: most runs pass whole or not at all.
struct PassBand {
    std::uint32_t always = 0; // bit q: all of run q passes
    std::uint32_t never = 0;  // bit q: nothing of it
};
// passes: of each frequency of the transform.
PassBand pass_band(const LinePlan &plan, const std::vector<bool> &passes);

// What the rule takes of work-items: larger groups wait longer at their barriers and leave fewer of them to a
// processor. AMD's driver gives no more to begin with, and NVIDIA's (580.159) gives these kernels no more, though its
// devices say 1024.
constexpr std::uint32_t kMostWorkItems = 256;
// What a work-item holds in registers with a strain: with 40 points NVIDIA's processors still have two work-groups of
// 256, with 45 one. More are over budget.
constexpr std::uint32_t kMostPointsPerItem = 40;

// The most points that a work-item holds.
std::uint32_t points_per_item(const LinePlan &plan, std::uint32_t items);
// Work-items for each line, at most `limit`, such that the fewest stand idle and none holds more than `points` points;
// 0 if there is no such number.
std::uint32_t items_for(const LinePlan &plan, std::uint32_t limit, std::uint32_t points);
std::uint64_t gpu_tile_bytes(const LinePlan &plan, const WorkGroupShape &shape);

// A shape that fits the limits; none if a line alone does not. Lines across (of complex points): eight side by side
// fill half a cache line of every row, four fill the sectors that GPUs fetch; fewer only where memory allows no more.
// Lines along: as few as make up a wavefront.
std::optional<WorkGroupShape> choose_shape(const LinePlan &plan, const WorkGroupLimits &limits, bool across);

// The shape with those lines and work-items, if it fits the limits and no work-item would stand idle throughout.
std::optional<WorkGroupShape> picked_shape(const LinePlan &plan, const WorkGroupLimits &limits, bool across,
                                           const WorkGroup &pick);
// Shapes that are worth a measurement: so many lines as powers of two allow up to 16, with as few work-items as hold 8,
// 16 or 32 points each.
std::vector<WorkGroup> work_groups_to_try(const LinePlan &plan, const WorkGroupLimits &limits, bool across);
// A shape for a kernel that turned out to leave its work-group less than `shape` takes: fewer work-items for each line,
// then fewer lines, always a multiple of lines_of, and more than kMostPointsPerItem only where that does not fit
// either. None if nothing fits.
std::optional<WorkGroupShape> smaller_shape(const LinePlan &plan, const WorkGroupShape &shape,
                                            const WorkGroupLimits &limits, std::uint32_t lines_of);

constexpr const char *kGpuCodeletsName = "fft/gpu/codelets.h";

// The text that the kernels of fft/gpu include under that name. It reads the types of fft/gpu/work_groups.h and defines
//   FFT_LENGTH, FFT_LINES, FFT_ITEMS, FFT_WORK_ITEMS
//   FFT_ACROSS      1: neighbouring work-items take neighbouring lines
//   FFT_POINTS        points that a work-item holds in re[] and im[]
//   FFT_TILE_STRIDE, FFT_LINE_STRIDE  of neighbouring points and of lines in the tile, in floats
//   fft_tile_at(p)  which point of a line in the tile is point p
//   FFT_FIRST_RADIX, FFT_FIRST_BUTTERFLIES, FFT_FIRST_COUNT, fft_first_takes(b), fft_first_point(b, q)
//                   of the first stage: work-item t takes butterflies b = t + c FFT_ITEMS, c below FFT_FIRST_COUNT,
//                   where fft_first_takes(b); point q of that is held as number c FFT_FIRST_RADIX + q
//   FFT_LAST_..     the same of the last stage, whose points are positions of the plan
//   FFT_LAST_ALWAYS, FFT_LAST_NEVER  the band's runs
//   fft_forward(t, re, im, tile, twiddles)   from the first stage's points to the last one's; all work-items call it
//   fft_inverse(t, re, im, tile, twiddles)   back; points of runs that never pass are not asked for
// tile: of the work-item's line. After either, a work-item may write the tile's points that it holds without a barrier.
std::string gpu_codelets(const LinePlan &plan, const WorkGroupShape &shape, const PassBand &band = {});

// The plan's twiddle factors that are read, in the order in which neighbouring work-items do: stage after stage, for
// each such k those of all j.
std::vector<float> gpu_twiddles(const LinePlan &plan);

} // namespace clsp

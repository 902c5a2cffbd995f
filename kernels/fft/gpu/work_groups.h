// The fused engine's shape for GPUs: a work-group has FFT_LINES columns or rows in local memory, and FFT_ITEMS work-items share each of them
// (core/fft/gpu/codelets.hpp). The codelets' values are numbers here, not vectors of several lines.
//
// Rows first: pass A transforms the rows and keeps of each the frequencies that the pupil lets through, pass B transforms what is kept along
// the columns, pass C takes it back along the rows. So images are read and written along their rows, and only pass B, whose points are 8 bytes
// long, goes across them. Frequency k of those kept (a line along the columns), row y, is lines[y * pitch + k]. The pitch is larger than the number of lines: what lies behind them nobody writes.
#ifndef CLSP_FUSED_GROUPS_H
#define CLSP_FUSED_GROUPS_H

#include "common/phasor.h"

typedef float lanes_f;
#define SPREAD(value) (value)

// Stands in the table of slots for a position whose line is not kept.
#define NO_SLOT 0xffffffffu

#include "fft/gpu/codelets.h"

#define GROUP_SIZE __attribute__((reqd_work_group_size(FFT_GROUP_ITEMS, 1, 1)))

// Of this work-item: which of the group's lines it works on, and its number among those that do.
#if FFT_ACROSS
#define GROUP_LINE ((uint)get_local_id(0) % FFT_LINES)
#define GROUP_T ((uint)get_local_id(0) / FFT_LINES)
#else
#define GROUP_LINE ((uint)get_local_id(0) / FFT_ITEMS)
#define GROUP_T ((uint)get_local_id(0) % FFT_ITEMS)
#endif

// Which lines the pupil keeps is mostly known when a kernel is generated, in FFT_LAST_RADIX runs of positions: all of a run, nothing of it
// (FFT_LAST_NEVER), or what the table of slots says. What is never kept is neither transformed nor stored.
#define last_is_never(q) (FFT_LAST_NEVER >> (q) & 1u)
#define last_is_always(q) (FFT_LAST_ALWAYS >> (q) & 1u)
#define last_slot(slots, b, q)                                                                                                             \
    (last_is_always(q) ? (size_t)(b) + popcount(FFT_LAST_ALWAYS & ((1u << (q)) - 1u)) * FFT_LAST_BUTTERFLIES : slots[last_entry(b, q)])

// Points are numbers of 64 bits where memory is read or written by them: sums of fewer bits may wrap around, so that compilers cannot take
// a base and constants behind it.

// Tables over the positions of the last stage are in this order, so that neighbouring work-items read neighbouring entries.
#define last_entry(b, q) ((q) * FFT_LAST_BUTTERFLIES + (b))

#endif

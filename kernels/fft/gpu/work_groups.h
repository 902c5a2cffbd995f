// The engine for GPUs: a work-group has FFT_LINES columns or rows in local memory, and FFT_ITEMS work-items share each
// of them (core/fft/gpu/codelets.hpp). The codelets' values are numbers here, not vectors of several lines.
//
// Rows first: rows_forward transforms the rows and keeps of each what the pupil lets through, columns transforms these
// pupil columns along their length, rows_inverse takes them back along the rows. So images are read and written along
// their rows, and only columns, whose points are 8 bytes long, goes across them. Pupil column k, row y, is lines[y *
// pitch + k]. The pitch is larger than the number of lines: what lies behind them nobody writes.
#ifndef CLSP_WORK_GROUPS_H
#define CLSP_WORK_GROUPS_H

#include "common/phasor.h"

typedef float lanes_f;
#define SPREAD(value) (value)

// Stands in the table of slots for a position whose column does not pass.
#define NO_SLOT 0xffffffffu

#include "fft/gpu/codelets.h"

#define WORK_GROUP_SIZE __attribute__((reqd_work_group_size(FFT_WORK_ITEMS, 1, 1)))

// Of this work-item: which of the work-group's lines it works on, and its number among those that do.
#if FFT_ACROSS
#define ITEM_LINE ((uint)get_local_id(0) % FFT_LINES)
#define ITEM_T ((uint)get_local_id(0) / FFT_LINES)
#else
#define ITEM_LINE ((uint)get_local_id(0) / FFT_ITEMS)
#define ITEM_T ((uint)get_local_id(0) % FFT_ITEMS)
#endif

// Which columns pass is mostly known when a kernel is generated, in FFT_LAST_RADIX runs of positions: all of a run,
// nothing of it (FFT_LAST_NEVER), or what the table of slots says. What never passes is neither transformed nor stored.
#define last_is_never(q) (FFT_LAST_NEVER >> (q) & 1u)
#define last_is_always(q) (FFT_LAST_ALWAYS >> (q) & 1u)
#define last_slot(slots, b, q)                                                                                         \
    (last_is_always(q) ? (size_t)(b) + popcount(FFT_LAST_ALWAYS & ((1u << (q)) - 1u)) * FFT_LAST_BUTTERFLIES           \
                       : slots[last_entry(b, q)])

// Points are numbers of 64 bits where memory is read or written by them: sums of fewer bits may wrap around, so that
// compilers cannot take a base and constants behind it.

// Tables over the positions of the last stage are in this order, so that neighbouring work-items read neighbouring
// entries.
#define last_entry(b, q) ((q) * FFT_LAST_BUTTERFLIES + (b))

#endif

// The fused engine's shape for GPUs: a work-group has FFT_LINES columns or rows in local memory, and FFT_ITEMS work-items share each of them
// (core/runtime/fused_group_codelets.hpp). The codelets' values are numbers here, not vectors of several lines.
//
// Kept lines lie one after the other, each from left to right: point x of line k is lines[k grid_width + x].
#ifndef CLSP_FUSED_GROUPS_H
#define CLSP_FUSED_GROUPS_H

#include "phasor.h"

typedef float lanes_f;
#define SPREAD(value) (value)

// Stands in the table of slots for a position whose line is not kept.
#define NO_SLOT 0xffffffffu

#include "fused_group_codelets.h"

#define GROUP_SIZE __attribute__((reqd_work_group_size(FFT_GROUP_ITEMS, 1, 1)))

// Of this work-item: which of the group's lines it works on, and its number among those that do.
#if FFT_ACROSS
#define GROUP_LINE ((uint)get_local_id(0) % FFT_LINES)
#define GROUP_T ((uint)get_local_id(0) / FFT_LINES)
#else
#define GROUP_LINE ((uint)get_local_id(0) / FFT_ITEMS)
#define GROUP_T ((uint)get_local_id(0) % FFT_ITEMS)
#endif

// Tables over the positions of the last stage are in this order, so that neighbouring work-items read neighbouring entries.
#define last_entry(b, q) ((q) * FFT_LAST_BUTTERFLIES + (b))

#endif

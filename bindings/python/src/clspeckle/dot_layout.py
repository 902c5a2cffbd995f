"""Semi-random layouts of projected dots: a least distance, and neighbourhoods by which a dot is told from others.

The C interface with every definition: ``dot_layout.h``.
"""

from __future__ import annotations

import ctypes
import dataclasses

import numpy as np
import numpy.typing as npt

from . import _check, _library, errors
from ._progress import Call, Progress

__all__ = ["DotLayout", "dot_layout"]

_ARGUMENTS = _check.Arguments(_library.ClspDotLayoutDesc)
_REALS = [name for name, kind in _ARGUMENTS.members.items() if kind is ctypes.c_double]


@dataclasses.dataclass(frozen=True)
class DotLayout:
    """Dots and how they lie; lengths are in direction cosines."""

    directions: npt.NDArray[np.float64]
    """(n, 2): direction cosines (u, v), x to the right and y down."""
    orders: npt.NDArray[np.int32] | None
    """(n, 2): orders (m, n) of the cell; None of free directions."""
    min_distance: float
    """That dots have at least."""
    mean_spacing: float
    """sqrt(area of the field of view / n)."""
    row_half_height: float
    """Dots whose v differ by no more are of the same row."""
    neighborhood_radius: float
    """How far a neighbourhood reaches."""
    tolerance: float
    """Neighbours within this match."""
    mean_neighbors: float
    """Of a dot."""
    min_difference: float
    """Of the neighbourhoods of two dots of a row: 0 alike, 1 nothing in common; the least of all pairs."""
    mean_difference: float
    """Over all pairs."""
    pair_count: int
    """Pairs of the same row."""
    worst_pair: tuple[int, int]
    """The dots of the least difference."""
    moved_count: int
    """Dots that were moved for `min_difference`."""


def dot_layout(
    count: int = 5303,
    *,
    lattice: bool = True,
    shape: tuple[int, int] = (512, 512),
    point_symmetric: bool = False,
    seed: int = 0,
    repair_rounds: int | None = None,
    progress: Progress | None = None,
    **parameters: float,
) -> DotLayout:
    """Puts dots into a field of view.

    Args:
        count: how many.
        lattice: True: on the orders of a cell of `shape` pixels; False: anywhere.
        shape: (height, width) of the cell in pixels.
        point_symmetric: with every dot its mirror image, as binary elements make them.
        seed: the same seed gives the same layout.
        repair_rounds: in which dots that look alike are moved.
        progress: called with what is being done and the fraction that is done; returning False cancels.
        **parameters: `pixel_pitch_m`, `wavelength_m`, `half_angle_x_rad`, `half_angle_y_rad`, `min_distance`,
            `beam_diameter_m`, `row_half_height`, `neighborhood_radius`, `tolerance`, `min_difference`, as in
            ClspDotLayoutDesc.
    """
    _check.known_names(parameters, _REALS, "dot_layout")
    given = {"count": count, "seed": seed, "repair_rounds": repair_rounds, **parameters}
    desc = _ARGUMENTS.describe_image(shape, given)
    desc.lattice = _check.flag(lattice, "lattice")
    desc.point_symmetric = _check.flag(point_symmetric, "point_symmetric")
    if not 1 <= desc.count <= _library.CLSP_MAX_LAYOUT_DOTS:
        raise errors.InvalidArgumentError(f"count is {desc.count}, expected 1 to {_library.CLSP_MAX_LAYOUT_DOTS}")
    directions = np.empty((desc.count, 2))
    orders = np.empty((desc.count, 2), np.int32) if lattice else None
    info = _library.initialized(_library.ClspDotLayoutInfo)
    call = Call()
    desc.progress = call.progress(progress)
    with call.running():
        _library.call(
            "clspDotLayoutCreate",
            ctypes.byref(desc),
            _check.pointer(directions),
            None if orders is None else _check.pointer(orders),
            ctypes.byref(info),
        )
    worst = (info.worst_first, info.worst_second)
    return _library.record(DotLayout, info, directions=directions, orders=orders, worst_pair=worst)

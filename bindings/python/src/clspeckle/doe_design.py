"""Design of diffractive beam splitters: from wanted orders to the phase of a periodic unit cell.

    layout = clspeckle.dot_layout(5303)
    design = clspeckle.design_doe(layout.orders, levels=8)
    print(design.efficiency, design.uniformity_rms)

The method: ``docs/method/doe-design.md``; the C interface with every definition: ``doe_design.h``.
"""

from __future__ import annotations

import ctypes
import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _check, _library, errors
from ._handle import Handle, create
from ._progress import Call, Progress
from .runtime import Context, resolve_context

__all__ = ["DoeDesign", "SnappedOrders", "design_doe", "evaluate_doe", "snap_directions"]

_RULES = _library.words("DOE_RULE")
_ARGUMENTS = _check.Arguments(_library.ClspDoeDesignDesc, flags=("compensate_envelope", "mirror_orders"))
_PARAMETERS = (
    "levels",
    "seed",
    "iterations",
    "quantization_iterations",
    "fix_phase_iteration",
    "search_sweeps",
    "pixel_pitch_m",
    "wavelength_m",
    "beam_diameter_m",
    "feedback",
    "compensate_envelope",
    "mirror_orders",
)


class DoeDesign(Handle):
    """What :func:`design_doe` made, or :func:`evaluate_doe` measured. It never changes; any thread may read it.

    Powers are parts of the incoming light: `efficiency` + (`zero_order` unless it is wanted) + `other_orders` +
    `beyond` is 1.

    Attributes:
        phase: (height, width), float32, radians from 0 to 2 pi.
        orders: (n, 2), m to the right and n down; with the mirror images that were added.
        weights: (n,), wanted relative powers.
        powers: (n,), what each order gets.
        history: (steps, 2): efficiency and uniformity_rms after each iteration; the last is the design's own.
        efficiency: power of all wanted orders.
        grid_efficiency: the same without the pixels' envelope.
        uniformity_rms: standard deviation of power over weight, relative to its mean.
        uniformity_peak_to_peak: (strongest - weakest) / (strongest + weakest).
        weakest, strongest: least and greatest power over weight, relative to the mean.
        zero_order, zero_order_relative: power of order (0, 0), and relative to a wanted order's mean.
        zero_order_wanted: True if it is in the list.
        largest_ghost, largest_ghost_relative: of an order that is neither wanted nor (0, 0).
        ghost_order: (m, n) of it.
        other_orders: power of all other orders of the base band.
        beyond: power outside of the base band.
        search_changes, search_sweeps: what the direct binary search did.
        seconds: that it took.
    """

    _c_name = "clspDoeDesign"
    _pickle_advice = "its arrays are NumPy's"

    efficiency: float
    grid_efficiency: float
    uniformity_rms: float
    uniformity_peak_to_peak: float
    weakest: float
    strongest: float
    zero_order: float
    zero_order_relative: float
    largest_ghost: float
    largest_ghost_relative: float
    other_orders: float
    beyond: float
    search_changes: int
    search_sweeps: int
    seconds: float

    def __init__(self) -> None:
        raise TypeError("a DoeDesign is made by clspeckle.design_doe() or clspeckle.evaluate_doe()")

    @classmethod
    def _of(cls, pointer: int | None, shape: tuple[int, int]) -> DoeDesign:
        made = cls.__new__(cls)
        made._adopt(pointer)
        made._read(shape)
        return made

    def _read(self, shape: tuple[int, int]) -> None:
        report = _library.fetched(_library.ClspDoeDesignReport, "clspDoeDesignGetReport", self._get())
        for name in DoeDesign.__annotations__:
            setattr(self, name, getattr(report, name))
        self.zero_order_wanted = bool(report.zero_order_wanted)
        self.ghost_order: tuple[int, int] = (report.ghost_m, report.ghost_n)
        self.phase = np.empty(shape, np.float32)
        _library.call("clspDoeDesignGetPhase", self._get(), self.phase.size, _check.pointer(self.phase))
        count, steps = report.order_count, report.step_count
        orders = (_library.ClspDoeDesignOrder * count)()
        self.powers = np.empty(count)
        _library.call("clspDoeDesignGetOrders", self._get(), count, orders, _check.pointer(self.powers))
        self.orders, self.weights = _split(orders)
        columns = np.empty((2, steps))
        pointers = [_check.pointer(column) for column in columns]
        _library.call("clspDoeDesignGetHistory", self._get(), steps, *pointers)
        self.history = np.ascontiguousarray(columns.T)


@dataclasses.dataclass(frozen=True)
class SnappedOrders:
    """The orders that are nearest to directions."""

    orders: npt.NDArray[np.int32]
    """(n, 2), m to the right and n down."""
    errors: npt.NDArray[np.float64]
    """(n,): how far off each is, in direction cosines."""


def _split(orders: Any) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.float64]]:
    table = np.frombuffer(orders, dtype=[("m", np.int32), ("n", np.int32), ("weight", np.float64)])
    return np.stack([table["m"], table["n"]], axis=1), table["weight"].copy()


def _order_table(orders: npt.ArrayLike, weights: npt.ArrayLike | None) -> Any:
    given = _check.array(orders, "orders")
    if given.dtype.kind not in "iu" and given.size > 0:
        raise errors.InvalidFormatError(f"orders has dtype {given.dtype}, expected integers")
    if given.ndim != 2 or given.shape[1] != 2 or given.size == 0:
        raise errors.InvalidArgumentError(f"orders has shape {given.shape}, expected (n, 2) with at least one order")
    if int(given.min()) < -(2**31) or int(given.max()) >= 2**31:
        raise errors.InvalidArgumentError("orders must fit 32 bits")
    wanted = np.ones(len(given)) if weights is None else _check.array(weights, "weights")
    if wanted.dtype.kind not in "fiu" or wanted.shape != (len(given),):
        raise errors.InvalidArgumentError(
            f"weights has dtype {wanted.dtype} and shape {wanted.shape}, expected {len(given)} real numbers"
        )
    table = np.empty(len(given), dtype=[("m", np.int32), ("n", np.int32), ("weight", np.float64)])
    table["m"], table["n"], table["weight"] = given[:, 0], given[:, 1], wanted
    return (_library.ClspDoeDesignOrder * len(table)).from_buffer_copy(table.tobytes())


def _desc(table: Any, shape: tuple[int, int], rule: str, given: Mapping[str, Any]) -> Any:
    _check.known_names(given, _PARAMETERS, "design_doe")
    desc = _ARGUMENTS.describe_image(shape, given)
    desc.rule = _check.choice(rule, "rule", _RULES)
    desc.orders, desc.order_count = table, len(table)
    return desc


def design_doe(
    orders: npt.ArrayLike,
    weights: npt.ArrayLike | None = None,
    *,
    shape: tuple[int, int] = (512, 512),
    rule: str = "gsw",
    progress: Progress | None = None,
    context: Context | None = None,
    **parameters: Any,
) -> DoeDesign:
    """Designs the phase of a cell that sends light to the wanted orders.

    Args:
        orders: (n, 2) integers, m to the right and n down.
        weights: (n,), wanted relative powers; all equal without.
        shape: (height, width) of the cell in pixels.
        rule: how weights follow from powers: "gs", "gsw", "nogrette" or "kim".
        progress: called with what is being done and the fraction that is done; returning False cancels.
        context: whose device computes; the default one without.
        **parameters: `levels` (0: continuous), `pixel_pitch_m`, `wavelength_m`, `beam_diameter_m`, `seed`, `feedback`,
            `iterations`, `quantization_iterations`, `fix_phase_iteration`, `search_sweeps`, `compensate_envelope`,
            `mirror_orders`, as in ClspDoeDesignDesc.
    """
    table = _order_table(orders, weights)
    desc = _desc(table, shape, rule, parameters)
    device = resolve_context(context)
    call = Call()
    desc.progress = call.progress(progress)
    with call.running():
        pointer = create("clspDoeDesignCreate", device._get(), ctypes.byref(desc))
    return DoeDesign._of(pointer, (desc.height, desc.width))


def evaluate_doe(
    phase: npt.ArrayLike,
    orders: npt.ArrayLike,
    weights: npt.ArrayLike | None = None,
    *,
    context: Context | None = None,
    **parameters: Any,
) -> DoeDesign:
    """Measures what a phase does with the light.

    Args:
        phase: (height, width) in radians.
        orders: (n, 2) integers, m to the right and n down.
        weights: (n,), wanted relative powers; all equal without.
        context: whose device computes; the default one without.
        **parameters: as of :func:`design_doe`; `levels` is 0 here without.
    """
    plane = _check.float_plane(phase, "phase", (None, None), "phases")
    _check.within(plane, "phase", low=-1e4, high=1e4)
    table = _order_table(orders, weights)
    desc = _desc(table, (plane.shape[0], plane.shape[1]), "gsw", {"levels": 0, **parameters})
    device = resolve_context(context)
    with device._lock:
        pointer = create("clspDoeDesignEvaluate", device._get(), ctypes.byref(desc), _check.pointer(plane), 0)
    return DoeDesign._of(pointer, (plane.shape[0], plane.shape[1]))


def snap_directions(
    directions: npt.ArrayLike,
    *,
    shape: tuple[int, int] = (512, 512),
    pixel_pitch_m: float = 0.4e-6,
    wavelength_m: float = 940e-9,
) -> SnappedOrders:
    """The orders of a cell that are nearest to directions, (n, 2) direction cosines (u, v)."""
    given = _check.array(directions, "directions")
    if given.dtype.kind not in "fiu" or given.ndim != 2 or given.shape[1] != 2 or given.size == 0:
        raise errors.InvalidArgumentError(
            f"directions has dtype {given.dtype} and shape {given.shape}, expected real numbers of shape (n, 2)"
        )
    pairs = np.ascontiguousarray(given, dtype=np.float64)
    height, width = _check.image_shape(shape)
    orders = (_library.ClspDoeDesignOrder * len(pairs))()
    distances = np.empty(len(pairs))
    _library.call(
        "clspDoeDesignSnapDirections",
        width,
        height,
        _check.real(pixel_pitch_m, "pixel_pitch_m"),
        _check.real(wavelength_m, "wavelength_m"),
        len(pairs),
        _check.pointer(pairs),
        orders,
        _check.pointer(distances),
    )
    return SnappedOrders(_split(orders)[0], distances)

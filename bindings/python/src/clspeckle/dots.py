"""Ideal projected dots, with the defects of the laser and of the diffractive optical element.

    I0(x) = scale * sum_j peak_j g((x - x_j) / sigma_j),    g(r) = exp(-|r|^2 / 2)

at pixel centres (integers). Each defect is off by default. Equations: ``dots.h``.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _check, _library, errors
from ._handle import exclusive
from ._interop import EventLike
from ._staging import DeviceImageLike, Stage
from .runtime import Context, Event, QueueLike

__all__ = ["Dots"]


_ARGUMENTS = _check.Arguments(_library.ClspDotsDesc)


def real_array(value: Any, name: str, shape: tuple[int | None, ...]) -> npt.NDArray[np.float64]:
    """An array of real numbers; None stands for any length of at least 1."""
    given = _check.array(value, name)
    if given.dtype.kind not in "fiu":
        raise errors.InvalidFormatError(f"{name} has dtype {given.dtype}, expected real numbers")
    expected = tuple(length if wanted is None else wanted for length, wanted in zip(given.shape, shape))
    if given.ndim != len(shape) or given.shape != expected or given.size == 0:
        text = ", ".join("n" if wanted is None else str(wanted) for wanted in shape) + ("," if len(shape) == 1 else "")
        raise errors.InvalidArgumentError(f"{name} has shape {given.shape}, expected ({text}), n at least 1")
    return np.ascontiguousarray(given, dtype=np.float64)


def _describe(
    shape: tuple[int, int], positions_px: npt.ArrayLike | None, options: dict[str, Any]
) -> tuple[_library.ClspDotsDesc, list[npt.NDArray[np.float64]]]:
    """The description, and the arrays that it points to. No positions: those of before."""
    desc = _ARGUMENTS.describe_image(shape, {name: value for name, value in options.items() if name != "sigma_px"})
    kept: list[npt.NDArray[np.float64]] = []

    def pointer(array: npt.NDArray[np.float64]) -> Any:
        kept.append(array)
        return _check.pointer(array)

    sigma, peaks = options.get("sigma_px"), options.get("peaks")
    if positions_px is not None:
        positions = real_array(positions_px, "positions_px", (None, 2))
        desc.count = positions.shape[0]
        desc.positions_px = pointer(positions)
        if peaks is not None:
            desc.peaks = pointer(real_array(peaks, "peaks", (positions.shape[0],)))
    elif peaks is not None or (sigma is not None and np.ndim(sigma) > 0):
        raise errors.InvalidArgumentError("peaks, or a sigma_px for each dot, need positions_px")
    if sigma is not None:
        if np.ndim(sigma) == 0:
            desc.sigma_px = _check.real(sigma, "sigma_px")
        else:
            desc.sigmas_px = pointer(real_array(sigma, "sigma_px", (desc.count,)))
    return desc, kept


class Dots(Stage):
    """A dot pattern in the image plane.

    Args:
        shape: (height, width) of the image in pixels, each 1 to 16384.
        positions_px: (n, 2), x and y of each dot; finite, may lie outside of the image; n at most 1000000.
        sigma_px: width of the dots, one number or (n,), 0.01 to 16384.
        peaks: (n,) peaks, >= 0; None: 1 for all.
        scale: factor on all peaks, >= 0.
        principal_point_px: (x, y) where the optical axis meets the image; None: its centre.
        relative_wavelength_shift: d > -1, at most 1; dots move radially from the principal point by 1 + d.
        beam_skew: s, -3 to 3: third Hermite (Gram-Charlier) term of the profile; s is the skewness along the axis.
        beam_skew_angle_rad: direction of the skew, from x (right) to y (down).
        beam_flatness: f, 0 to 4: super-Gaussian profile exp(-(r^2)^(1 + 2 f) / 2).
        zero_order_relative_intensity: peak of one more dot at the principal point, over the mean peak.
        ghost_relative_intensity: peak of a copy of each dot over that of the dot.
        ghost_offset_px: (x, y) from a dot to its copy; None: half the diagonal of the lattice's cell.
        scatter_fraction: 0 to 1, the part of the light that is spread evenly over the image.
        context: None for :func:`default_context`.

    What is None has the C library's default, see :meth:`defaults`.

    Threads: calls on one object from several threads run one after the other; different objects run at the same time.
    """

    _c_name = "clspDots"
    _arguments = _ARGUMENTS

    def __init__(
        self,
        shape: tuple[int, int],
        positions_px: npt.ArrayLike,
        *,
        sigma_px: npt.ArrayLike | None = None,
        peaks: npt.ArrayLike | None = None,
        scale: float | None = None,
        principal_point_px: tuple[float, float] | None = None,
        relative_wavelength_shift: float | None = None,
        beam_skew: float | None = None,
        beam_skew_angle_rad: float | None = None,
        beam_flatness: float | None = None,
        zero_order_relative_intensity: float | None = None,
        ghost_relative_intensity: float | None = None,
        ghost_offset_px: tuple[float, float] | None = None,
        scatter_fraction: float | None = None,
        context: Context | None = None,
    ) -> None:
        options = {name: value for name, value in locals().items() if name in _OPTIONS}
        if positions_px is None:
            raise TypeError("positions_px must be an array of shape (n, 2), got None")
        desc, _kept = _describe(shape, positions_px, options)
        self._create(desc, context)
        self.shape: tuple[int, int] = (desc.height, desc.width)

    def configure(self, positions_px: npt.ArrayLike | None = None, **options: Any) -> None:
        """Changes the pattern; later calls use it. If it fails everything stays as it was.

        Args:
            positions_px: as for the constructor; None: the dots stay, with a sigma and a peak of their own if they had.
            options: the keyword arguments of the constructor but `context`. Those that are not given have their
                defaults again.
        """
        _check.known_names(options, _OPTIONS, "configure()")
        with exclusive(self):
            desc, _kept = _describe(self.shape, positions_px, options)
            _library.call("clspDotsConfigure", self._get(), ctypes.byref(desc))

    def render(self, *, out: Any = None, queue: QueueLike | None = None) -> Any:
        """The ideal image. Blocks.

        Args:
            out: float32 array of (height, width), or a float32 device image, to write to; None: a new array.

        Returns:
            `out`, or a new (height, width) float32 array.
        """
        with exclusive(self):
            command = self._command(queue)
            target = command.output(out, self.shape)
            return target.finish(self._enqueue(command, "Render", target.image))

    def enqueue_render(
        self,
        irradiance: DeviceImageLike,
        *,
        queue: QueueLike | None = None,
        wait_for: Sequence[EventLike] | None = None,
    ) -> Event:
        """:meth:`render` into a float32 device image, asynchronously."""
        with exclusive(self):
            command = self._asynchronous(queue, wait_for)
            return self._enqueue(command, "Render", command.image(irradiance, "irradiance", self.shape))


_OPTIONS = _check.optional(Dots.__init__)

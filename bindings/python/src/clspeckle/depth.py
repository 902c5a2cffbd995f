"""Depth from a frame of laser dots: detection with sub-pixel centres, identification, triangulation.

Equations, units and limits: ``depth.h``.
"""

from __future__ import annotations

import ctypes
import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _check, _library, _show, errors
from ._handle import exclusive
from ._interop import EventLike
from ._staging import DeviceImageLike, ImageLike, Stage
from .dots import real_array
from .pattern import PROJECTION
from .runtime import FLOAT32, Context, Event, QueueLike, queue_pointer

__all__ = ["Depth", "DepthResult", "DepthSummary"]

_WARNINGS = ("no_dots", "few_placed", "epipolar", "saturated", "merged")  # by bit

DOT_DTYPE = np.dtype(_library.ClspDepthDot)
"""A detected dot: the members of ``ClspDepthDot``."""
PATTERN_DTYPE = np.dtype(_library.ClspDepthPatternDot)
"""A dot of the pattern: the members of ``ClspDepthPatternDot``."""


@dataclasses.dataclass(frozen=True)
class DepthSummary:
    """A frame's result in numbers."""

    detected_count: int
    """Detected dots."""
    fitted_count: int
    """Detected dots with a centre."""
    placed_count: int
    """Detected dots with a depth."""
    saturated_count: int
    """Those with saturated pixels."""
    merged_count: int
    """Those that are merged."""
    pattern_in_view_count: int
    """Dots of the pattern that the camera could see in the range of depth."""
    median_epipolar_error_px: float
    """Of the magnitude, over placed dots; NaN without any."""
    expected_epipolar_error_px: float
    """The same as the centres' covariances say."""
    median_sigma_px: float
    """Width of fitted dots, geometric mean of both axes; NaN without any."""
    median_centre_sd_px: float
    """Of fitted dots, along an axis; NaN without any."""
    warnings: dict[str, str]
    """By name ("no_dots", "few_placed", "epipolar", "saturated", "merged"), in words."""


@dataclasses.dataclass(frozen=True, eq=False)
class DepthResult:
    """What a frame shows."""

    dots: npt.NDArray[Any]
    """Structured array of ``DOT_DTYPE``, one per detected dot, row by row; `reason` is 0 where there is a depth."""
    pattern: npt.NDArray[Any]
    """Structured array of ``PATTERN_DTYPE``, one element per dot of the pattern."""
    summary: DepthSummary
    """The same in numbers."""

    @property
    def placed(self) -> npt.NDArray[Any]:
        """The dots with a depth."""
        selected: npt.NDArray[Any] = self.dots[self.dots["reason"] == _library.CLSP_DEPTH_REASON_PLACED]
        return selected

    def table(self) -> Any:
        """The detected dots as a pandas.DataFrame: the members of `dots`, those of several numbers as columns `name_0`,
        `name_1`, ...; `reason_text` in words.

        Raises:
            ImportError: pandas is not installed.
        """
        columns: dict[str, Any] = {}
        for name in self.dots.dtype.names or ():
            values = self.dots[name]
            if name != "reserved" and values.ndim == 1:
                columns[name] = values
            elif name != "reserved":
                columns.update({f"{name}_{k}": values[:, k] for k in range(values.shape[1])})
        columns["reason_text"] = [reason_text(int(number)) for number in self.dots["reason"]]
        return _show.data_frame(columns, "table()")

    def reasons(self) -> dict[str, int]:
        """How many detected dots have which reason, in words; "placed" are those with a depth."""
        numbers, counts = np.unique(self.dots["reason"], return_counts=True)
        return {reason_text(int(number)): int(count) for number, count in zip(numbers, counts)}


def reason_text(reason: int) -> str:
    """A number of ``ClspDepthDot::reason`` in words."""
    return _library.text(_library.library().clspDepthReasonString(_check.integer(reason, "reason")))


def warning_text(warning: int) -> str:
    """One bit of ``ClspDepthSummary::warnings`` in words."""
    return _library.text(_library.library().clspDepthWarningString(_check.integer(warning, "warning")))


class Depth(Stage):
    """Depth for frames of one size.

    Args:
        shape: (height, width) of the frames in pixels.
        directions: (n, 2) directions of the pattern's dots in the laser's frame; None: detection alone.
        laser_from_camera: [R|t], (3, 4) or (4, 4), R a rotation, t in metres.
        intrinsics: (fx, fy, cx, cy) in pixels, of a camera without distortion.
        projection: what directions are: "tangent_plane" (x/z, y/z) or "direction_cosines" (x/d, y/d).
        near_m: least depth.
        far_m: largest depth.
        dot_sigma_px: expected width of the dots, 0.5 to 5.
        min_amplitude_dn: dots below it are not looked at.
        threshold_sigmas: of the noise; without effect while the noise is unknown.
        min_correlation: with the expected dot, 0 to below 1.
        read_noise_dn: standard deviation of the noise in the dark; with dn_per_electron 0, too: unknown.
        dn_per_electron: of the shot noise.
        black_level_dn: value without light.
        saturation_dn: pixels at or above it are saturated; 0: none is.
        relative_diameter: D of the lens, pixel pitch / (wavelength * f-number), in cycles per pixel, as of
            :class:`Aperture`: it tells how far speckle moves centres; 0: not known, their deviations are the noise's.
        speckle_contrast: 0 to 1; sqrt((1 + P^2) / 2) for the degree of polarization P, less where speckle moves.
        epipolar_tolerance_px: largest distance from a line that the geometry's errors may cause.
        min_confidence: least probability of a dot that is placed, 0.5 to below 1.
        max_dots: room for detected dots.
        context: None for :func:`default_context`.

    What is None has the C library's default, see :meth:`defaults`.

    Threads: calls on one object from several threads run one after the other; different objects run at the same time.
    """

    _c_name = "clspDepth"
    _arguments = _check.Arguments(_library.ClspDepthDesc, words={"projection": PROJECTION})

    def __init__(
        self,
        shape: tuple[int, int],
        directions: npt.ArrayLike | None = None,
        laser_from_camera: npt.ArrayLike | None = None,
        intrinsics: Sequence[float] | None = None,
        *,
        projection: str | None = None,
        near_m: float | None = None,
        far_m: float | None = None,
        dot_sigma_px: float | None = None,
        min_amplitude_dn: float | None = None,
        threshold_sigmas: float | None = None,
        min_correlation: float | None = None,
        read_noise_dn: float | None = None,
        dn_per_electron: float | None = None,
        black_level_dn: float | None = None,
        saturation_dn: float | None = None,
        relative_diameter: float | None = None,
        speckle_contrast: float | None = None,
        epipolar_tolerance_px: float | None = None,
        min_confidence: float | None = None,
        max_dots: int | None = None,
        context: Context | None = None,
    ) -> None:
        desc = self._arguments.describe_image(shape, locals())
        kept = None
        if directions is not None:
            kept = real_array(directions, "directions", (None, 2))
            desc.direction_count = len(kept)
            desc.directions = _check.pointer(kept)
            if laser_from_camera is None or intrinsics is None:
                raise errors.InvalidArgumentError("directions need laser_from_camera and intrinsics")
        if laser_from_camera is not None:
            desc.laser_from_camera = _check.pose(laser_from_camera, "laser_from_camera")
        if intrinsics is not None:
            try:
                fx, fy, cx, cy = intrinsics
            except (TypeError, ValueError):
                raise TypeError(f"intrinsics must be (fx, fy, cx, cy), got {_check.kind(intrinsics)}") from None
            for name, value in (("fx_px", fx), ("fy_px", fy), ("cx_px", cx), ("cy_px", cy)):
                setattr(desc, name, _check.real(value, name))
        self._create(desc, context)
        self.shape: tuple[int, int] = (desc.height, desc.width)
        self.direction_count: int = desc.direction_count

    def measure(self, image: ImageLike, *, queue: QueueLike | None = None) -> DepthResult:
        """The dots of a frame, each with its depth or the reason why it has none. Blocks.

        Args:
            image: (height, width), uint8, uint16 or float32 (other real dtypes are converted), on host or device.

        Raises:
            InvalidDataError: NaN or infinite pixels.
            UnsupportedError: more dots than max_dots.
        """
        with exclusive(self):
            command = self._command(queue)
            view = command.image(image, "image", self.shape, FLOAT32, _check.number_plane)
            self._enqueue(command, "Detect", view).wait()
            return self._result(command.queue)

    def enqueue_detect(
        self,
        image: DeviceImageLike,
        *,
        queue: QueueLike | None = None,
        wait_for: Sequence[EventLike] | None = None,
    ) -> Event:
        """Detects the dots of an image in device memory, asynchronously; :meth:`result` has the outcome."""
        with exclusive(self):
            command = self._asynchronous(queue, wait_for)
            return self._enqueue(command, "Detect", command.image(image, "image", self.shape))

    def result(self, *, queue: QueueLike | None = None) -> DepthResult:
        """The outcome of the last frame. Blocks.

        Args:
            queue: that of :meth:`enqueue_detect`, or one that has waited for its event.
        """
        with exclusive(self):
            return self._result(queue)

    def _result(self, queue: QueueLike | None) -> DepthResult:
        pointer = queue_pointer(queue, self.context)
        count = ctypes.c_uint64()
        _library.call("clspDepthGetDots", self._get(), pointer, 0, None, ctypes.byref(count), None)
        dots = np.zeros(count.value, DOT_DTYPE)
        raw = _library.initialized(_library.ClspDepthSummary)
        _library.call(
            "clspDepthGetDots",
            self._get(),
            pointer,
            len(dots),
            dots.ctypes.data_as(ctypes.POINTER(_library.ClspDepthDot)) if len(dots) else None,
            ctypes.byref(count),
            ctypes.byref(raw),
        )
        pattern = np.zeros(self.direction_count, PATTERN_DTYPE)
        _library.call(
            "clspDepthGetPatternDots",
            self._get(),
            len(pattern),
            pattern.ctypes.data_as(ctypes.POINTER(_library.ClspDepthPatternDot)) if len(pattern) else None,
            ctypes.byref(count),
        )
        warnings = {
            name: warning_text(1 << bit) for bit, name in enumerate(_WARNINGS) if int(raw.warnings) & (1 << bit)
        }
        return DepthResult(dots, pattern, _library.record(DepthSummary, raw, warnings=warnings))

"""What a lens does beside diffraction: distortion, glare, ambient light, vignetting.

With x = (px - cx)/ux, y = (py - cy)/uy and r^2 = x^2 + y^2, an ideal point is imaged at (Brown and Conrady)

    x' = x (1 + k1 r^2 + k2 r^4 + k3 r^6) + 2 p1 x y + p2 (r^2 + 2 x^2)
    y' = y (1 + k1 r^2 + k2 r^4 + k3 r^6) + p1 (r^2 + 2 y^2) + 2 p2 x y

and light L behind the aperture becomes, with h the exponential point spread of the glare and g its fraction,

    v ( (1 - g) L + g (h * L) + ambient ),  v = (1 - vignetting_corner_loss r^2) cos^4,  r = 1 in the farthest corner

Equations: ``lens.h``.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _check, _library
from ._handle import exclusive
from ._interop import EventLike
from ._staging import Command, DeviceImageLike, ImageLike, Stage
from .runtime import FLOAT32, Context, DeviceImage, Event, Format, QueueLike, find_format

__all__ = ["Lens"]

_INTERPOLATION = _library.words("INTERPOLATION")


class Lens(Stage):
    """A lens, but for its aperture. What is not given changes nothing.

    Args:
        shape: (height, width) of the image in pixels, each 1 to 16384.
        k1, k2, k3: radial distortion; above 0 points move outwards (pincushion).
        p1, p2: tangential distortion.
        radius_unit: "corner" (r = 1 at the farthest corner pixel's centre) or "focal_length" (OpenCV's convention).
        principal_point_px: (cx, cy) where the optical axis meets the image; None: its centre.
        focal_length_px: (fx, fy), each > 0; for radius_unit "focal_length" and for cos4_falloff.
        vignetting_corner_loss: 0 to 1.
        cos4_falloff: True: light falls off with the fourth power of the field angle's cosine.
        glare_fraction: part of the light that is spread by exp(-d / glare_scale_px), 0 to 1.
        glare_scale_px: > 0.
        ambient: constant light in units of intensity, >= 0.
        context: None for :func:`default_context`.

    What is None has the C library's default, see :meth:`defaults`. A distortion that folds over within the image is
    refused.

    Threads: calls on one object from several threads run one after the other; different objects run at the same time.
    """

    _c_name = "clspLens"
    _arguments = _check.Arguments(
        _library.ClspLensDesc, words={"radius_unit": _library.words("LENS_RADIUS")}, flags=("cos4_falloff",)
    )

    def __init__(
        self,
        shape: tuple[int, int],
        *,
        k1: float | None = None,
        k2: float | None = None,
        k3: float | None = None,
        p1: float | None = None,
        p2: float | None = None,
        radius_unit: str | None = None,
        principal_point_px: tuple[float, float] | None = None,
        focal_length_px: tuple[float, float] | None = None,
        vignetting_corner_loss: float | None = None,
        cos4_falloff: bool | None = None,
        glare_fraction: float | None = None,
        glare_scale_px: float | None = None,
        ambient: float | None = None,
        context: Context | None = None,
    ) -> None:
        desc = self._arguments.describe_image(shape, locals())
        self._create(desc, context)
        self.shape: tuple[int, int] = (desc.height, desc.width)
        self._ambient: float = desc.ambient

    @classmethod
    def defaults(cls) -> dict[str, Any]:
        """The C library's defaults of the keyword arguments."""
        return {**super().defaults(), "principal_point_px": None, "focal_length_px": None}

    def configure(self, shape: tuple[int, int] | None = None, **arguments: Any) -> None:
        """Changes the lens into one made with these arguments (those of the constructor but the context); later calls
        use the new one. After an error it is what it was."""
        _check.known_names(arguments, self.defaults(), "configure()")
        desc = self._arguments.describe_image(self.shape if shape is None else shape, arguments)
        with exclusive(self):
            _library.call("clspLensConfigure", self._get(), ctypes.byref(desc))
            self.shape = (desc.height, desc.width)
            self._ambient = desc.ambient

    def distort(
        self, ideal: ImageLike, *, interpolation: str | None = None, out: Any = None, queue: QueueLike | None = None
    ) -> Any:
        """Warps an image as the lens does. Blocks.

        Args:
            ideal: (height, width) float32, uint8 (or bool), uint16 or uint32, (height, width, n) float32 with n = 2, 3
                or 4, or a device image.
            interpolation: "nearest", "linear" or "cubic"; integers take "nearest" only. None: "cubic" for one float a
                pixel (light), else "nearest".
            out: array or device image of the same shape and dtype, which must not overlap the ideal image; None: a new
                array.

        Returns:
            `out`, or a new array. Where the lens sees no ideal pixel it is 0, with 3 or 4 floats a pixel NaN.
        """
        with exclusive(self):
            command = self._command(queue)
            source = command.image(ideal, "ideal", self.shape, FLOAT32, _ideal)
            target = command.output(out, source.shape, (source.dtype,))
            return target.finish(self._distort(command, source, target.image, interpolation))

    def enqueue_distort(
        self,
        ideal: DeviceImageLike,
        distorted: DeviceImageLike,
        *,
        interpolation: str | None = None,
        queue: QueueLike | None = None,
        wait_for: Sequence[EventLike] | None = None,
    ) -> Event:
        """:meth:`distort` from one device image into another, asynchronously."""
        with exclusive(self):
            command = self._asynchronous(queue, wait_for)
            source = command.image(ideal, "ideal", self.shape)
            target = command.image(distorted, "distorted", self.shape, _format(source))
            return self._distort(command, source, target, interpolation)

    def _distort(self, command: Command, ideal: DeviceImage, target: DeviceImage, interpolation: str | None) -> Event:
        if interpolation is None:
            interpolation = "cubic" if _format(ideal) is FLOAT32 else "nearest"
        number = _check.choice(interpolation, "interpolation", _INTERPOLATION)
        return self._enqueue(command, "Distort", number, ideal, target)

    def finish(self, light: ImageLike, *, dark: bool = False, out: Any = None, queue: QueueLike | None = None) -> Any:
        """Glare, ambient light and vignetting. Blocks.

        Args:
            light: (height, width), finite, >= 0: the intensity behind the aperture. In a float32 device image NaN,
                infinite and negative pixels spread no glare.
            dark: True: a dark frame, without ambient light.
            out: float32 array, or a float32 device image, which may be the light itself; None: a new array.

        Returns:
            `out`, or a new (height, width) float32 array.
        """
        with exclusive(self):
            command = self._command(queue)
            target = command.output(out, self.shape)
            source = command.image(light, "light", self.shape)
            return target.finish(self._enqueue(command, "Finish", source, _check.flag(dark, "dark"), target.image))

    def enqueue_finish(
        self,
        light: DeviceImageLike,
        output: DeviceImageLike,
        *,
        dark: bool = False,
        queue: QueueLike | None = None,
        wait_for: Sequence[EventLike] | None = None,
    ) -> Event:
        """:meth:`finish` from one float32 device image into another, or in place, asynchronously."""
        with exclusive(self):
            command = self._asynchronous(queue, wait_for)
            source = command.image(light, "light", self.shape)
            target = command.image(output, "output", self.shape)
            return self._enqueue(command, "Finish", source, _check.flag(dark, "dark"), target)

    def distort_points(self, ideal_px: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """Where ideal points are imaged.

        Args:
            ideal_px: (..., 2): x, y in pixels, finite.

        Returns:
            The same shape, float64; (NaN, NaN) for points that the lens does not image, because they lie beyond the
            radius where the distortion turns back.
        """
        return self._points("clspLensDistortPoints", ideal_px, "ideal_px")

    def undistort_points(self, distorted_px: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """The ideal points behind image points: the inverse of :meth:`distort_points` to 1e-9 px. Every point of the
        image has one; (NaN, NaN) where nothing is imaged."""
        return self._points("clspLensUndistortPoints", distorted_px, "distorted_px")

    def _points(self, function: str, value: npt.ArrayLike, name: str) -> npt.NDArray[np.float64]:
        given = _check.array(value, name)
        if given.dtype.kind not in "fiu":
            raise _check.format_error(name, given.dtype, (np.float64,))
        if given.ndim == 0 or given.shape[-1] != 2:
            raise _check.range_error(f"the shape of {name}", given.shape, "(..., 2)")
        points = np.array(given, dtype=np.float64, order="C")
        pointer = _check.pointer(points)
        with exclusive(self):
            _library.call(function, self._get(), pointer, points.size // 2, pointer)
        return points


def _ideal(value: Any, name: str, shape: tuple[int, int]) -> npt.NDArray[Any]:
    given = _check.array(value, name)
    if given.dtype == np.bool_:
        given = np.ascontiguousarray(given).view(np.uint8)
    if given.dtype.kind == "f":
        channels = given.shape[2:] if given.ndim == 3 and given.shape[2] in (2, 3, 4) else ()
        return _check.float_plane(given, name, (*shape, *channels))
    if given.dtype not in (np.uint8, np.uint16, np.uint32):
        raise _check.format_error(name, given.dtype, (np.float32, np.uint8, np.uint16, np.uint32))
    _check.check_shape(given, name, shape)
    return np.ascontiguousarray(given)


def _format(image: DeviceImage) -> Format:
    return find_format(image.shape, image.dtype, "ideal")

"""The projected pattern: looked up per pixel as a texture, with 1/d^2, surface cosine, baseline and shadow.

For a pixel with position X, unit normal N and albedo a in the geometry frame: X_L = R X + t in the laser frame (the
laser at the origin, looking along +z, x to the right, y down), d = |X_L|, w = X_L / d. With J the radiant intensity
that the pattern has in that direction,

    E  = power_scale * J * max(0, -w . R N) / d^2 * visibility
    I0 = E * albedo / pi

Equations and conventions: ``pattern.h``; thesis section 3.3, Lambert's law.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import Any, Union

import numpy as np
import numpy.typing as npt

from . import _check, _doubts, _library, errors
from ._handle import exclusive
from ._interop import EventLike
from ._staging import Command, DeviceImageLike, HostCheck, ImageLike, Stage, on_device, refuse_handle
from .runtime import FLOAT32, FLOAT32X3, Context, Event, Format, QueueLike

__all__ = ["Geometry", "Pattern"]

PROJECTION = _library.words("PROJECTION")
DEPTH_KIND = {
    "along_axis": _library.CLSP_DEPTH_ALONG_AXIS,
    "along_ray": _library.CLSP_DEPTH_ALONG_RAY,
}


@dataclasses.dataclass(eq=False)
class Geometry:
    """What a renderer knows about every pixel. Give `position`, or `depth` with `intrinsics`.

    Every image is a NumPy array or in device memory, and all have the same height and width.
    """

    position: ImageLike | None = None
    """(height, width, 3 or 4) metres. NaN or infinite: no surface here, nothing is returned."""
    depth: ImageLike | None = None
    """(height, width) metres, no integers; the geometry frame is then the camera frame. <= 0, NaN, infinite: no
    surface."""
    intrinsics: Any | None = None
    """(fx, fy, cx, cy) in pixels, or the 3 x 3 camera matrix; for depth."""
    normal: ImageLike | None = None
    """(height, width, 3 or 4), unit length, towards the camera; None: the surface faces the laser."""
    albedo: ImageLike | None = None
    """(height, width) in [0, 1], more with a warning; uint8 and uint16 are divided by their top code; None: 1."""
    visibility: ImageLike | None = None
    """(height, width): does the laser see the point. Floats in [0, 1], uint8 from 0 to 255, uint16 from 0 to
    65535, or bool; None: 1."""
    depth_kind: str | None = None
    """"along_axis" (z in the camera frame) or "along_ray" (distance from the camera centre); None: the C library's
    default."""


def intrinsics_numbers(value: Any) -> tuple[float, float, float, float]:
    """fx, fy, cx, cy of the four, or of a camera matrix."""
    given = _check.array(value, "intrinsics")
    if given.dtype.kind not in "fiu":
        raise errors.InvalidFormatError(f"intrinsics has dtype {given.dtype}, expected real numbers")
    if given.shape == (4,):
        fx, fy, cx, cy = (float(v) for v in given)
        return fx, fy, cx, cy
    if given.shape != (3, 3):
        raise errors.InvalidArgumentError(
            f"intrinsics has shape {given.shape}, expected (4,): fx, fy, cx, cy; or (3, 3): the camera matrix"
        )
    if given[0, 1] != 0 or given[1, 0] != 0 or not np.array_equal(given[2], (0, 0, 1)):
        raise errors.InvalidArgumentError(
            f"intrinsics is {given.tolist()}, expected [[fx, 0, cx], [0, fy, cy], [0, 0, 1]] (no skew)"
        )
    return float(given[0, 0]), float(given[1, 1]), float(given[0, 2]), float(given[1, 2])


def vectors_of(value: Any, name: str) -> npt.NDArray[Any]:
    """An array of one image of vectors with three components, or four."""
    given = _check.array(value, name)
    if given.ndim == 4 and len(given) == 1:
        given = given[0]
    if given.ndim != 3 or given.shape[2] not in (3, 4):
        first = given.ndim == 3 and given.shape[0] in (3, 4)
        advice = f"; np.moveaxis({name}, 0, -1) puts x, y, z behind" if first else ""
        raise errors.InvalidArgumentError(f"{name} has shape {given.shape}, expected (height, width, 3 or 4){advice}")
    return given


def vectors_plane(value: Any, name: str, shape: tuple[int, int]) -> npt.NDArray[np.float32]:
    """An image of vectors with three components, or four."""
    given = vectors_of(value, name)
    if given.shape[:2] != tuple(shape):
        raise errors.InvalidArgumentError(
            f"{name} has shape {given.shape}, expected {_check.shape_text(shape)[:-1]}, 3 or 4)"
        )
    return _check.float_plane(given, name, (shape[0], shape[1], None), "an image of vectors")


def positions_plane(value: Any, name: str, shape: tuple[int, int]) -> npt.NDArray[np.float32]:
    """Positions in metres; of whole numbers the unit is not known."""
    given = vectors_of(value, name)
    if given.dtype.kind in "iub":
        raise _check.unit_error(given.dtype, name)
    return vectors_plane(given, name, shape)


def _normals(value: Any, name: str, shape: tuple[int, int]) -> npt.NDArray[np.float32]:
    given = vectors_of(value, name)
    if given.dtype.kind == "u" and given.dtype.itemsize <= 2:
        raise errors.InvalidFormatError(
            f"{name} has dtype {given.dtype}, expected an image of vectors: floating-point. If they are encoded as "
            f"colors, give {name}[..., :3] / {np.iinfo(given.dtype).max} * 2 - 1"
        )
    return vectors_plane(given, name, shape)


def _albedos(value: Any, name: str, shape: tuple[int, int]) -> npt.NDArray[np.float32]:
    plane = _check.light_plane(value, name, shape)
    _check.within(plane, name)
    _doubts.of_albedo(plane, name)
    return plane


def _visibilities(value: Any, name: str, shape: tuple[int, int]) -> npt.NDArray[Any]:
    given = _check.array(value, name)
    if given.dtype == np.bool_ or given.dtype == np.uint8:
        given = _check.one_image(given, name)
        _check.check_shape(given, name, shape)
        plane: npt.NDArray[np.uint8] = np.ascontiguousarray(given, dtype=np.uint8)
        return plane * np.uint8(255) if given.dtype == np.bool_ else plane
    light = _check.light_plane(given, name, shape, mean=False)
    _check.within(light, name, 0.0, 1.0)
    return light


_IMAGES: dict[str, tuple[HostCheck, Format]] = {
    "position": (positions_plane, FLOAT32X3),
    "depth": (_check.depth_plane, FLOAT32),
    "normal": (_normals, FLOAT32X3),
    "albedo": (_albedos, FLOAT32),
    "visibility": (_visibilities, FLOAT32),
}


def geometry_shape(geometry: Geometry) -> tuple[int, int]:
    """The (height, width) of a geometry, from the first of its images that has one."""
    for name in _IMAGES:
        value = getattr(geometry, name)
        shape: tuple[int, ...] = () if value is None else getattr(value, "shape", ())
        if value is not None and not on_device(value):
            refuse_handle(value, name)
            if name in ("position", "normal"):
                shape = vectors_of(value, name).shape
            else:
                shape = _check.one_image(_check.array(value, name), name, tell=False, check=False).shape
            if len(shape) < 2:
                raise errors.InvalidArgumentError(f"{name} has shape {shape}, expected (height, width, ...)")
        if len(shape) >= 2:
            return _check.image_shape(shape[:2], f"{name}.shape")
    raise errors.InvalidArgumentError(
        "the size of the geometry is not known: give position or depth as an array, a DeviceImage or a pyopencl array"
    )


def geometry_struct(
    geometry: Geometry, shape: tuple[int, int], command: Command, laser: Sequence[float]
) -> _library.ClspGeometry:
    """The C struct of a geometry; host images are uploaded.

    Args:
        laser: its place in the geometry frame.
    """
    if (geometry.position is None) == (geometry.depth is None):
        which = "neither" if geometry.position is None else "both"
        raise errors.InvalidArgumentError(f"a geometry needs position, or depth with intrinsics; {which} given")
    if geometry.depth is not None and geometry.intrinsics is None:
        raise errors.InvalidArgumentError("depth needs intrinsics: (fx, fy, cx, cy) in pixels")
    struct = _library.initialized(_library.ClspGeometry)
    if geometry.depth_kind is not None:
        struct.depth_kind = _check.choice(geometry.depth_kind, "depth_kind", DEPTH_KIND)
    if geometry.intrinsics is not None:
        numbers = intrinsics_numbers(geometry.intrinsics)
        if not all(math.isfinite(number) for number in numbers) or numbers[0] == 0 or numbers[1] == 0:
            raise errors.InvalidArgumentError(f"intrinsics is {numbers}, expected finite numbers, fx and fy not 0")
        struct.fx_px, struct.fy_px, struct.cx_px, struct.cy_px = numbers
    command.fill(struct, vars(geometry), _IMAGES, shape)
    used = (geometry.normal, geometry.depth if geometry.position is None else geometry.position)
    if not command.asynchronous and not any(value is None or on_device(value) for value in used):
        _doubts.of_normals(
            vectors_of(geometry.normal, "normal"),
            None if geometry.depth is None else _check.one_image(np.asarray(geometry.depth), "depth", tell=False),
            None if geometry.position is None else vectors_of(geometry.position, "position"),
            None if geometry.intrinsics is None else numbers,
            laser,
        )
    return struct


def _place(pose: Any) -> list[float]:
    """The laser in the geometry frame, -R^T t, of laser_from_geometry."""
    return [-sum(pose[4 * j + i] * pose[4 * j + 3] for j in range(3)) for i in range(3)]


class Pattern(Stage):
    """A projected pattern.

    Args:
        texels: (height, width) pattern image, row 0 first, each side 2 to 16384; finite, >= 0; copied.
        projection: what the pattern's axes are: "tangent_plane" (x/z, y/z) or "direction_cosines" (x/d, y/d).
        quantity: "radiant_intensity" (W/sr up to a factor), or "plane_irradiance": as an image of the pattern on a
            plane at unit distance shows it.
        half_extent_x: the image covers [-half_extent_x, half_extent_x], in pattern coordinates.
        half_extent_y: likewise.
        power_scale: factor on the pattern values.
        laser_from_geometry: [R|t], (3, 4) or (4, 4), R a rotation, t in metres.
        filter: "bilinear", or "area": the mean over a pixel's footprint, so that dots keep their light at any distance.
        filter_taps: of "area": parts of the footprint along each axis of the image, 1 to 4.
        context: None for :func:`default_context`.

    What is None has the C library's default, see :meth:`defaults`.

    Threads: calls on one object from several threads run one after the other; different objects run at the same time.
    """

    _c_name = "clspPattern"
    _arguments = _check.Arguments(
        _library.ClspPatternDesc,
        words={"projection": PROJECTION, "quantity": _library.words("QUANTITY"), "filter": _library.words("FILTER")},
    )

    def __init__(
        self,
        texels: npt.ArrayLike,
        *,
        projection: str | None = None,
        quantity: str | None = None,
        half_extent_x: float | None = None,
        half_extent_y: float | None = None,
        power_scale: float | None = None,
        laser_from_geometry: npt.ArrayLike | None = None,
        filter: str | None = None,
        filter_taps: int | None = None,
        context: Context | None = None,
    ) -> None:
        plane = _check.irradiance_plane(texels, "texels")
        if not plane.any():
            _doubts.warn("texels is 0 everywhere, so that the pattern gives no light: is it another image than meant?")
        desc = self._arguments.describe(locals())
        desc.height, desc.width = plane.shape
        desc.texels = _check.pointer(plane)
        if laser_from_geometry is not None:
            desc.laser_from_geometry = _check.pose(laser_from_geometry, "laser_from_geometry")
        self._create(desc, context)
        self._place: list[float] = _place(desc.laser_from_geometry)

    @classmethod
    def defaults(cls) -> dict[str, Any]:
        """The C library's defaults of the keyword arguments."""
        pose = _library.initialized(_library.ClspPatternDesc).laser_from_geometry
        return {**super().defaults(), "laser_from_geometry": np.array(pose).reshape(3, 4)}

    def set_pose(self, laser_from_geometry: npt.ArrayLike) -> None:
        """Moves the laser: [R|t], (3, 4) or (4, 4), R a rotation, t in metres. Later calls use the new pose."""
        pose = _check.pose(laser_from_geometry, "laser_from_geometry")
        with exclusive(self):
            _library.call("clspPatternSetPose", self._get(), pose)
            self._place = _place(pose)

    def lookup(self, geometry: Geometry, *, out: Any = None, queue: QueueLike | None = None) -> Any:
        """The ideal infrared image I0 of a geometry. Blocks.

        Args:
            geometry: images in host or device memory.
            out: float32 array of (height, width), or a float32 device image, to write to; None: a new array.

        Returns:
            `out`, or a new (height, width) float32 array.
        """
        _require_geometry(geometry)
        shape = geometry_shape(geometry)
        with exclusive(self):
            command = self._command(queue)
            target = command.output(out, shape)
            struct = geometry_struct(geometry, shape, command, self._place)
            return target.finish(self._enqueue(command, "Lookup", struct, target.image))

    def enqueue_lookup(
        self,
        geometry: Geometry,
        irradiance: DeviceImageLike,
        *,
        queue: QueueLike | None = None,
        wait_for: Sequence[EventLike] | None = None,
    ) -> Event:
        """:meth:`lookup`, asynchronously; all images must be in device memory.

        Args:
            irradiance: float32 image of the size of the geometry, fully written; must not overlap an input.
        """
        _require_geometry(geometry)
        shape = geometry_shape(geometry)
        with exclusive(self):
            command = self._asynchronous(queue, wait_for)
            struct = geometry_struct(geometry, shape, command, self._place)
            return self._enqueue(command, "Lookup", struct, command.image(irradiance, "irradiance", shape))


def _require_geometry(value: Any) -> None:
    if not isinstance(value, Geometry):
        raise TypeError(f"geometry must be a clspeckle.Geometry, got {_check.kind(value)}")


Scene = Union[ImageLike, Geometry]
"""What a frame shows: an ideal image, or the geometry that the pattern falls on."""

"""How far each pixel's surface point has moved since the last frame, in units of its speckle's correlation lengths.

With X the point's position in the camera's frame, X' that in the previous camera's frame, v = X / |X|, delta = X - X'
and a the angle by which the surface turned,

    axial = delta . v      lateral = |delta - axial v|
    path  = sqrt((lateral / l_lateral)^2 + (axial / l_axial)^2 + (a / a_rotation)^2)
    correlation = exp(-frame_time_s / correlation_time_s)
    shift = pixel of X' minus pixel of X

which is what :meth:`Phase.advance <clspeckle.Phase.advance>` takes. Equations and conventions: ``motion.h``.
"""

from __future__ import annotations

import ctypes
import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _check, _library, errors
from ._handle import Handle, create, exclusive
from ._interop import EventLike
from ._staging import DeviceImageLike, ImageLike, Operands, Staging, device_image, on_device
from .material import MaterialTable
from .pattern import _DEPTH_KIND, _depths, _intrinsics, _positions
from .runtime import (
    FLOAT32,
    FLOAT32X2,
    FLOAT32X3,
    UINT8,
    Context,
    Event,
    Format,
    QueueLike,
    queue_pointer,
    resolve_context,
)

__all__ = ["Motion", "MotionInput"]

_RULE = {
    "correlate": _library.CLSP_MOTION_CORRELATE,
    "replace": _library.CLSP_MOTION_REPLACE,
}


@dataclasses.dataclass(eq=False)
class MotionInput:
    """What a renderer knows about two frames. Give `position` or `depth`, and how points moved in one of three ways:

    - `previous_position` of the same points (and `previous_normal`);
    - `previous_from_current`, one rigid transform for all or one for each material;
    - `motion` with the previous frame's own `previous_depth` or `previous_position`.

    Every image is a NumPy array or in device memory, and all have the same height and width.
    """

    position: ImageLike | None = None
    """(height, width, 3 or 4) metres, camera frame. NaN, infinite or z <= 0: no surface."""
    depth: ImageLike | None = None
    """(height, width) metres. <= 0, NaN or infinite: no surface."""
    normal: ImageLike | None = None
    """(height, width, 3 or 4), camera frame; used with `previous_normal`."""
    material: ImageLike | None = None
    """(height, width) of integers 0 to 255: entries of the table."""
    motion: ImageLike | None = None
    """(height, width, 2) of (x, y) in pixels: previous pixel minus current pixel of the same surface point."""
    previous_position: ImageLike | None = None
    """(height, width, 3 or 4): of the same point, or with `motion` or transforms the previous frame's own."""
    previous_depth: ImageLike | None = None
    """(height, width): the previous frame's own."""
    previous_normal: ImageLike | None = None
    """(height, width, 3 or 4), previous camera frame: of the same point, or with `motion` the previous frame's own."""
    previous_material: ImageLike | None = None
    """(height, width): the previous frame's own."""
    previous_from_current: npt.ArrayLike | None = None
    """[R|t], (3, 4) or (4, 4), or one for each material, (n, 3, 4) or (n, 4, 4)."""
    frame_time_s: float = 0.0
    """Time since the previous frame in seconds."""
    roll_from_motion: bool = False
    """True: rotation about the direction of view from the curl of `motion`."""


def _materials(value: Any, name: str, shape: tuple[int, int]) -> npt.NDArray[np.uint8]:
    given = _check.array(value, name)
    if given.dtype.kind not in "iu":
        raise errors.InvalidFormatError(f"{name} has dtype {given.dtype}, expected integers (uint8)")
    _check.check_shape(given, name, shape)
    if given.dtype != np.uint8 and (int(given.min()) < 0 or int(given.max()) > 255):
        raise errors.InvalidDataError(f"{name} must hold integers from 0 to 255")
    return np.ascontiguousarray(given, dtype=np.uint8)


_IMAGES: tuple[tuple[str, Any, Format], ...] = (
    ("position", _positions, FLOAT32X3),
    ("depth", _depths, FLOAT32),
    ("normal", _positions, FLOAT32X3),
    ("material", _materials, UINT8),
    ("motion", _check.vector2_plane, FLOAT32X2),
    ("previous_position", _positions, FLOAT32X3),
    ("previous_depth", _depths, FLOAT32),
    ("previous_normal", _positions, FLOAT32X3),
    ("previous_material", _materials, UINT8),
)

_OUTPUTS: dict[str, tuple[type, Format]] = {
    "path": (np.float32, FLOAT32),
    "correlation": (np.float32, FLOAT32),
    "shift": (np.float32, FLOAT32X2),
    "displacement": (np.float32, FLOAT32X3),
    "mask": (np.uint8, UINT8),
}


def _transforms(value: npt.ArrayLike) -> npt.NDArray[np.float64]:
    given = _check.array(value, "previous_from_current")
    if given.ndim not in (2, 3) or given.size == 0:
        raise errors.InvalidArgumentError(
            f"previous_from_current has shape {given.shape}, expected (3, 4), (4, 4), (n, 3, 4) or (n, 4, 4)"
        )
    matrices = given[np.newaxis] if given.ndim == 2 else given
    return np.array([list(_check.pose(matrix, "previous_from_current")) for matrix in matrices])


def motion_struct(
    given: MotionInput,
    shape: tuple[int, int],
    staging: Staging,
    queue: QueueLike | None,
    operands: Operands,
    device_only: bool = False,
) -> tuple[_library.ClspMotionInput, Any]:
    """The C struct of an input, and what must be kept until the call is made; host images are uploaded."""
    if not isinstance(given, MotionInput):
        raise TypeError(f"motion must be a clspeckle.MotionInput, got {_check.kind(given)}")
    struct = _library.initialized(_library.ClspMotionInput)
    struct.frame_time_s = _check.real(given.frame_time_s, "frame_time_s")
    struct.roll_from_motion = _check.flag(given.roll_from_motion, "roll_from_motion")
    kept = None
    if given.previous_from_current is not None:
        kept = _transforms(given.previous_from_current)
        struct.previous_from_current = kept.ctypes.data_as(ctypes.POINTER(ctypes.c_double))
        struct.transform_count = len(kept)
    # All host images are checked before the first one is uploaded.
    host = {
        name: check(value, name, shape)
        for name, check, _ in _IMAGES
        for value in (getattr(given, name),)
        if value is not None and not device_only and not on_device(value)
    }
    for name, _, default in _IMAGES:
        value = getattr(given, name)
        if name in host:
            setattr(struct, name, operands.add(staging.upload(f"motion.{name}", host[name], queue, operands)))
        elif value is not None:
            image = device_image(value, name, (*shape, default.channels), default, staging.context)
            setattr(struct, name, operands.add(image))
    return struct, kept


class Motion(Handle):
    """Motion of surfaces between two frames.

    Args:
        shape: (height, width) of the image in pixels.
        rule: for pipelines: "correlate": the phase is carried on along the path, "replace": it is drawn anew where the
            mask says so (the thesis's rule).
        translate: for pipelines: True: the phase, which must have `translate` too, moves with the surface.
        depth_kind: of depth and previous_depth: "along_axis" or "along_ray".
        materials: None: one material, the default one.
        intrinsics: (fx, fy, cx, cy) in pixels, or the 3 x 3 camera matrix; for depth images and for shifts.
        replace_threshold: for the mask, >= 0.
        occlusion_tolerance: relative difference of depth above which two points are on different surfaces.
        context: None for :func:`default_context`, or that of the materials.

    What is None has the C library's default, see :meth:`defaults`.

    Threads: calls on one object from several threads run one after the other; different objects run at the same time.
    """

    _release = "clspMotionRelease"

    def __init__(
        self,
        shape: tuple[int, int],
        *,
        rule: str | None = None,
        translate: bool | None = None,
        depth_kind: str | None = None,
        materials: MaterialTable | None = None,
        intrinsics: Any | None = None,
        replace_threshold: float | None = None,
        occlusion_tolerance: float | None = None,
        context: Context | None = None,
    ) -> None:
        desc = _library.initialized(_library.ClspMotionDesc)
        desc.height, desc.width = _check.image_shape(shape)
        if rule is not None:
            desc.rule = _check.choice(rule, "rule", _RULE)
        if translate is not None:
            desc.translate = _check.flag(translate, "translate")
        if depth_kind is not None:
            desc.depth_kind = _check.choice(depth_kind, "depth_kind", _DEPTH_KIND)
        if intrinsics is not None:
            desc.fx_px, desc.fy_px, desc.cx_px, desc.cy_px = _intrinsics(intrinsics)
        given = {"replace_threshold": replace_threshold, "occlusion_tolerance": occlusion_tolerance}
        _check.assign(desc, given, {}, given)
        if materials is not None:
            if not isinstance(materials, MaterialTable):
                raise TypeError(f"materials must be a clspeckle.MaterialTable, got {_check.kind(materials)}")
            desc.materials = materials._get()
            context = materials.context if context is None else context
        self.context = resolve_context(context)
        self._adopt(create("clspMotionCreate", self.context._get(), ctypes.byref(desc)))
        self.shape: tuple[int, int] = (desc.height, desc.width)
        self._staging = Staging(self.context)

    def _forget(self) -> None:
        self._staging.clear()

    @staticmethod
    def defaults() -> dict[str, Any]:
        """The C library's defaults of the keyword arguments that have one."""
        desc = _library.initialized(_library.ClspMotionDesc)
        names = ("rule", "translate", "depth_kind", "replace_threshold", "occlusion_tolerance")
        result = _check.defaults(desc, {"rule": _RULE, "depth_kind": _DEPTH_KIND}, names)
        result["translate"] = bool(result["translate"])
        return result

    def compute(
        self, given: MotionInput, outputs: Sequence[str] = ("path",), *, queue: QueueLike | None = None
    ) -> dict[str, npt.NDArray[Any]]:
        """What moved how far, by name. Blocks.

        Args:
            given: images in host or device memory.
            outputs: of "path" (correlation lengths; infinity: the point is new), "correlation", "shift" ((x, y) in
                pixels), "displacement" (lateral in metres, axial in metres, angle in radians) and "mask" (uint8).
        """
        if isinstance(outputs, str):
            raise TypeError(f"outputs must be a sequence of names, got {_check.kind(outputs)}")
        for name in outputs:
            if name not in _OUTPUTS:
                raise errors.InvalidArgumentError(
                    f"outputs has {name!r}, expected {_check.one_of(_OUTPUTS)}{_check.nearest(str(name), _OUTPUTS)}"
                )
        with exclusive(self):
            queue = self.context.queue if queue is None else queue
            targets = {}
            for name in outputs:
                dtype, default = _OUTPUTS[name]
                shape = self.shape if default.channels == 1 else (*self.shape, default.channels)
                targets[name] = self._staging.image(f"output.{name}", shape, dtype)
            event = self._enqueue(given, targets, queue, None, False)
            return {name: image.read(queue=queue, wait_for=[event]) for name, image in targets.items()}

    def enqueue_compute(
        self,
        given: MotionInput,
        *,
        path: DeviceImageLike | None = None,
        correlation: DeviceImageLike | None = None,
        shift: DeviceImageLike | None = None,
        displacement: DeviceImageLike | None = None,
        mask: DeviceImageLike | None = None,
        queue: QueueLike | None = None,
        wait_for: Sequence[EventLike] | None = None,
    ) -> Event:
        """:meth:`compute`, asynchronously; all images must be in device memory, and at least one output be given."""
        outputs = {"path": path, "correlation": correlation, "shift": shift, "displacement": displacement, "mask": mask}
        with exclusive(self):
            return self._enqueue(given, outputs, queue, wait_for, True)

    def _enqueue(
        self,
        given: MotionInput,
        outputs: Mapping[str, DeviceImageLike | None],
        queue: QueueLike | None,
        wait_for: Sequence[EventLike] | None,
        device_only: bool,
    ) -> Event:
        operands = Operands()
        struct, kept = motion_struct(given, self.shape, self._staging, queue, operands, device_only)
        result = _library.initialized(_library.ClspMotionOutput)
        for name, value in outputs.items():
            if value is not None:
                default = _OUTPUTS[name][1]
                image = device_image(value, name, (*self.shape, default.channels), default, self.context)
                setattr(result, name, operands.add(image))
        event = operands.enqueue(
            "clspMotionEnqueueCompute",
            self._get(),
            queue_pointer(queue, self.context),
            ctypes.byref(struct),
            ctypes.byref(result),
            wait_for=wait_for,
        )
        del kept  # the library has copied the transforms
        return event

    def check(self, *, queue: QueueLike | None = None) -> None:
        """Waits, and reports bad pixels of all calls since the last check.

        Raises:
            InvalidDataError: there were some; the message says how many, and where the first one is.
        """
        with exclusive(self):
            _library.call("clspMotionCheck", self._get(), queue_pointer(queue, self.context))

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

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _check, _library, errors
from ._handle import exclusive
from ._interop import EventLike
from ._staging import Command, DeviceImageLike, HostCheck, ImageLike, Stage
from .material import MaterialTable
from .pattern import DEPTH_KIND, intrinsics_numbers, positions_plane, vectors_plane
from .runtime import FLOAT32, FLOAT32X2, FLOAT32X3, UINT8, Context, Event, Format, QueueLike

__all__ = ["Motion", "MotionInput"]


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


def material_plane(value: Any, name: str, shape: tuple[int, int]) -> npt.NDArray[np.uint8]:
    """An image of material ids."""
    given = _check.array(value, name)
    if given.dtype.kind not in "biu":
        raise errors.InvalidFormatError(f"{name} has dtype {given.dtype}, expected integers (uint8)")
    given = _check.one_image(given, name)
    _check.check_shape(given, name, shape)
    if given.dtype != np.uint8 and (int(given.min()) < 0 or int(given.max()) > 255):
        raise errors.InvalidDataError(f"{name} must hold integers from 0 to 255")
    return np.ascontiguousarray(given, dtype=np.uint8)


_IMAGES: dict[str, tuple[HostCheck, Format]] = {
    "position": (positions_plane, FLOAT32X3),
    "depth": (_check.depth_plane, FLOAT32),
    "normal": (vectors_plane, FLOAT32X3),
    "material": (material_plane, UINT8),
    "motion": (_check.vector2_plane, FLOAT32X2),
    "previous_position": (positions_plane, FLOAT32X3),
    "previous_depth": (_check.depth_plane, FLOAT32),
    "previous_normal": (vectors_plane, FLOAT32X3),
    "previous_material": (material_plane, UINT8),
}

_OUTPUTS = {"path": FLOAT32, "correlation": FLOAT32, "shift": FLOAT32X2, "displacement": FLOAT32X3, "mask": UINT8}


def _transforms(value: npt.ArrayLike) -> npt.NDArray[np.float64]:
    given = _check.array(value, "previous_from_current")
    if given.ndim not in (2, 3) or given.size == 0:
        raise errors.InvalidArgumentError(
            f"previous_from_current has shape {given.shape}, expected (3, 4), (4, 4), (n, 3, 4) or (n, 4, 4)"
        )
    matrices = given[np.newaxis] if given.ndim == 2 else given
    return np.array([list(_check.pose(matrix, "previous_from_current")) for matrix in matrices])


def motion_struct(given: MotionInput, shape: tuple[int, int], command: Command) -> tuple[_library.ClspMotionInput, Any]:
    """The C struct of an input, and what must be kept until the call is made; host images are uploaded."""
    if not isinstance(given, MotionInput):
        raise TypeError(f"motion must be a clspeckle.MotionInput, got {_check.kind(given)}")
    struct = _library.initialized(_library.ClspMotionInput)
    struct.frame_time_s = _check.real(given.frame_time_s, "frame_time_s")
    struct.roll_from_motion = _check.flag(given.roll_from_motion, "roll_from_motion")
    kept = None
    if given.previous_from_current is not None:
        kept = _transforms(given.previous_from_current)
        struct.previous_from_current = _check.pointer(kept)
        struct.transform_count = len(kept)
    command.fill(struct, vars(given), _IMAGES, shape, "motion.")
    return struct, kept


class Motion(Stage):
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

    _c_name = "clspMotion"
    _arguments = _check.Arguments(
        _library.ClspMotionDesc,
        words={"rule": _library.words("MOTION"), "depth_kind": DEPTH_KIND},
        flags=("translate",),
    )

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
        desc = self._arguments.describe_image(shape, locals())
        if intrinsics is not None:
            desc.fx_px, desc.fy_px, desc.cx_px, desc.cy_px = intrinsics_numbers(intrinsics)
        if materials is not None:
            if not isinstance(materials, MaterialTable):
                raise TypeError(f"materials must be a clspeckle.MaterialTable, got {_check.kind(materials)}")
            desc.materials = materials._get()
            context = materials.context if context is None else context
        self._create(desc, context)
        self.shape: tuple[int, int] = (desc.height, desc.width)

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
            command, targets = self._command(queue), {}
            for name in outputs:
                pixel = _OUTPUTS[name]
                shape = self.shape if pixel.channels == 1 else (*self.shape, pixel.channels)
                targets[name] = self._staging.image(f"output.{name}", shape, pixel.dtype)
            event = self._compute(command, given, targets)
            return {name: image.read(queue=command.queue, wait_for=[event]) for name, image in targets.items()}

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
            return self._compute(self._asynchronous(queue, wait_for), given, outputs)

    def _compute(self, command: Command, given: MotionInput, outputs: Mapping[str, DeviceImageLike | None]) -> Event:
        struct, _transforms = motion_struct(given, self.shape, command)
        result = _library.initialized(_library.ClspMotionOutput)
        for name, value in outputs.items():
            if value is not None:
                setattr(result, name, command.add(command.image(value, name, self.shape, _OUTPUTS[name])))
        return self._enqueue(command, "Compute", struct, result)

    def check(self, *, queue: QueueLike | None = None) -> None:
        """Waits, and reports bad pixels of all calls since the last check.

        Raises:
            InvalidDataError: there were some; the message says how many, and where the first one is.
        """
        self._wait_and_check(queue)

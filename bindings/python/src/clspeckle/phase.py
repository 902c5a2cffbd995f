"""The surface's random field: persistent, refreshed where a mask says so.

The field lives on the field grid: `oversampling` samples per pixel and axis, padded to a size that the FFT takes. Each
sample holds z with E|z|^2 = 1: exp(i phi) with phi uniform ("unit_phasor"), or a circular complex Gaussian number
("circular_gaussian", the limit of very many scatterers per pixel; contrast 1 for any aperture). With dynamics
"continuous" it follows the path that the surface moves gradually. Equations: ``phase.h``.
"""

from __future__ import annotations

import ctypes
import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _check, _library, errors
from ._handle import exclusive
from ._interop import EventLike, SupportsIntPtr
from ._staging import Command, DeviceImageLike, HostCheck, ImageLike, Stage
from .runtime import FLOAT32, FLOAT32X2, UINT8, Buffer, Context, Event, Format, QueueLike, memory_pointer

__all__ = ["FieldGrid", "Phase", "field_grid"]


@dataclasses.dataclass(frozen=True)
class FieldGrid:
    """Size of the field grid of an image."""

    width: int
    """Of the image in pixels."""
    height: int
    """Of the image in pixels."""
    oversampling: int
    """Field samples per pixel along each axis."""
    guard_px: int
    """Pixels of padding at least."""
    grid_width: int
    """Smallest n >= oversampling * (width + guard_px) with no prime factor above 13."""
    grid_height: int
    """Likewise along y."""

    @property
    def shape(self) -> tuple[int, int]:
        """(grid_height, grid_width)."""
        return self.grid_height, self.grid_width


def field_grid(shape: tuple[int, int], *, oversampling: int = 1, guard_px: int = 0) -> FieldGrid:
    """The field grid of an image of `shape` (height, width). Needs no device; may be called from any thread.

    Args:
        oversampling: field samples per pixel along each axis, 1 to 8.
        guard_px: at least this many pixels of padding, against light that wraps around the border.
    """
    height, width = _check.image_shape(shape)
    grid = _library.ClspFieldGrid(
        width=width,
        height=height,
        oversampling=_check.integer(oversampling, "oversampling"),
        guard_px=_check.integer(guard_px, "guard_px"),
    )
    _library.call("clspFieldGridCompute", ctypes.byref(grid))
    return FieldGrid(width, height, grid.oversampling, grid.guard_px, grid.grid_width, grid.grid_height)


_ADVANCE_IMAGES: dict[str, tuple[HostCheck, Format]] = {
    "path": (_check.float_plane, FLOAT32),
    "correlation": (_check.float_plane, FLOAT32),
    "shift": (_check.vector2_plane, FLOAT32X2),
    "mask": (_check.mask_plane, UINT8),
}


class Phase(Stage):
    """A phase state.

    Args:
        shape: (height, width) of the image in pixels, each 1 to 16384.
        oversampling: field samples per pixel and axis, 1 to 8.
        guard_px: pixels of padding at least.
        field: "circular_gaussian" or "unit_phasor".
        polarization_count: 1 or 2; 2 is needed for a degree of polarization below 1.
        seed: below 2^64.
        dynamics: "replace": a sample is kept or replaced; "continuous": it follows the path of its surface gradually
            (circular Gaussian only).
        translate: True: the state can move with the surface (`shift` of :meth:`advance`).
        context: None for :func:`default_context`.

    What is None has the C library's default, see :meth:`defaults`.

    Threads: calls on one object from several threads run one after the other; different objects run at the same time.
    """

    _c_name = "clspPhase"
    _arguments = _check.Arguments(
        _library.ClspPhaseDesc,
        words={"field": _library.words("FIELD"), "dynamics": _library.words("DYNAMICS")},
        flags=("translate",),
    )
    _pickle_advice = "save() gives its state as an array, restore() takes it in the process that uses it"

    def __init__(
        self,
        shape: tuple[int, int],
        *,
        oversampling: int | None = None,
        guard_px: int | None = None,
        field: str | None = None,
        polarization_count: int | None = None,
        seed: int | None = None,
        dynamics: str | None = None,
        translate: bool | None = None,
        context: Context | None = None,
    ) -> None:
        desc = self._arguments.describe_image(shape, locals())
        self._create(desc, context)
        self.shape: tuple[int, int] = (desc.height, desc.width)
        self.polarization_count: int = desc.polarization_count
        self._holds_any_field = (desc.field, desc.dynamics, desc.translate) == (
            _library.CLSP_FIELD_CIRCULAR_GAUSSIAN,
            _library.CLSP_DYNAMICS_REPLACE,
            0,
        )
        self.grid = field_grid(self.shape, oversampling=desc.oversampling, guard_px=desc.guard_px)

    @property
    def grid_shape(self) -> tuple[int, int]:
        """(height, width) of the field grid."""
        return self.grid.shape

    def refresh(self, frame_index: int, mask: ImageLike | None = None, *, queue: QueueLike | None = None) -> None:
        """Draws new values. Blocks.

        Args:
            frame_index: counter of the new values, below 2^48.
            mask: (height, width) of bool or integers, or a uint8 device image: pixels that are not 0 are drawn anew.
                None: all of them. The first refresh always draws everything.
        """
        with exclusive(self):
            self._refresh(self._command(queue), frame_index, mask).wait()

    def enqueue_refresh(
        self,
        frame_index: int,
        mask: DeviceImageLike | None = None,
        *,
        queue: QueueLike | None = None,
        wait_for: Sequence[EventLike] | None = None,
    ) -> Event:
        """:meth:`refresh`, asynchronously; the mask must be in device memory."""
        with exclusive(self):
            return self._refresh(self._asynchronous(queue, wait_for), frame_index, mask)

    def _refresh(self, command: Command, frame_index: int, mask: Any) -> Event:
        frame_index = _check.integer(frame_index, "frame_index", 64)
        image = None if mask is None else command.mask(mask, "mask", self.shape)
        return self._enqueue(command, "Refresh", frame_index, image)

    def advance(
        self,
        frame_index: int,
        *,
        path: ImageLike | float | None = None,
        correlation: ImageLike | float | None = None,
        shift: ImageLike | None = None,
        mask: ImageLike | None = None,
        substep: int = 0,
        queue: QueueLike | None = None,
    ) -> None:
        """Carries the field on: it moves (`shift`), follows the path, and lives (`correlation`). Blocks.

        Args:
            frame_index: counter of the new values, below 2^48; with `substep` another one than in all calls before.
            path: >= 0 in correlation lengths, infinity: replaced; a number for all pixels, or a float32 image.
            correlation: 0 to 1, what time has left of the field's correlation; a number or a float32 image.
            shift: (height, width, 2) of (x, y) in pixels: where the surface point was minus where it is.
            mask: bool or integers: pixels that are not 0 are replaced.
            substep: tells several advances with one frame_index apart, 0 to 127.

        A pixel with a path, correlation or shift that is NaN or out of range is replaced, and :meth:`check` reports it.
        """
        with exclusive(self):
            images = {"path": path, "correlation": correlation, "shift": shift, "mask": mask}
            self._advance(self._command(queue), frame_index, images, substep).wait()

    def enqueue_advance(
        self,
        frame_index: int,
        *,
        path: DeviceImageLike | float | None = None,
        correlation: DeviceImageLike | float | None = None,
        shift: DeviceImageLike | None = None,
        mask: DeviceImageLike | None = None,
        substep: int = 0,
        queue: QueueLike | None = None,
        wait_for: Sequence[EventLike] | None = None,
    ) -> Event:
        """:meth:`advance`, asynchronously; all images must be in device memory."""
        with exclusive(self):
            images = {"path": path, "correlation": correlation, "shift": shift, "mask": mask}
            return self._advance(self._asynchronous(queue, wait_for), frame_index, images, substep)

    def _advance(self, command: Command, frame_index: int, images: dict[str, Any], substep: int) -> Event:
        frame_index = _check.integer(frame_index, "frame_index", 64)
        struct = _library.initialized(_library.ClspPhaseAdvance)
        struct.substep = _check.integer(substep, "substep")
        for name in ("path", "correlation"):
            if isinstance(images[name], (int, float, np.integer, np.floating)):
                setattr(struct, "uniform_" + name, _check.real(images.pop(name), name))
        command.fill(struct, images, _ADVANCE_IMAGES, self.shape)
        return self._enqueue(command, "Advance", frame_index, struct)

    def check(self, *, queue: QueueLike | None = None) -> None:
        """Waits, and reports bad pixels of all advances since the last check.

        Raises:
            InvalidDataError: there were some; the message says how many, and where the first one is.
        """
        self._wait_and_check(queue)

    def field(self, polarization: int = 0, *, queue: QueueLike | None = None) -> npt.NDArray[np.complex64]:
        """z of one polarization as complex64 of :attr:`grid_shape`. Blocks.

        Raises:
            InvalidStateError: nothing has been drawn yet.
        """
        with exclusive(self):
            image = self._staging.image("field", self.grid_shape, np.complex64)
            event = self.enqueue_field(polarization, image, queue=queue)
            return image.read(queue=queue, wait_for=[event])

    def enqueue_field(
        self,
        polarization: int,
        field: DeviceImageLike,
        *,
        queue: QueueLike | None = None,
        wait_for: Sequence[EventLike] | None = None,
    ) -> Event:
        """Writes z of one polarization to a complex64 (or float32 x 2) device image of :attr:`grid_shape`."""
        with exclusive(self):
            command = self._asynchronous(queue, wait_for)
            number = _check.integer(polarization, "polarization")
            return self._enqueue(command, "Field", number, command.image(field, "field", self.grid_shape, FLOAT32X2))

    @property
    def state_size(self) -> int:
        """Size of the saved state in bytes."""
        size = ctypes.c_uint64()
        _library.call("clspPhaseGetStateSize", self._get(), ctypes.byref(size))
        return size.value

    def save(self, *, queue: QueueLike | None = None) -> npt.NDArray[np.uint8]:
        """The state as bytes; ``np.save`` or ``.tobytes()`` keep it. Blocks.

        Raises:
            InvalidStateError: nothing has been drawn yet.
        """
        with exclusive(self), Buffer(self.state_size, context=self.context) as memory:
            event = self.enqueue_save(memory, queue=queue)
            result = np.empty(memory.size_bytes, np.uint8)
            memory.enqueue_read(result, queue=queue, wait_for=[event]).wait()
            return result

    def restore(
        self, state: npt.NDArray[np.uint8] | bytes | bytearray | memoryview, *, queue: QueueLike | None = None
    ) -> None:
        """Takes a state back that :meth:`save` gave, bit for bit. Blocks. It stays until everything is drawn anew; an
        effect that would lose it is refused, see :meth:`Pipeline.set_effect`.

        Args:
            state: bytes, or a uint8 array, from a phase of the same shape, oversampling, guard_px, field and
                polarization_count.
        """
        if isinstance(state, (bytes, bytearray, memoryview)):
            state = np.frombuffer(state, np.uint8)
        source = _check.array(state, "state")
        if source.dtype != np.uint8 or source.ndim != 1:
            raise errors.InvalidFormatError(f"state must be bytes or a flat uint8 array, got {_check.kind(source)}")
        with exclusive(self):
            if source.nbytes != self.state_size:
                raise errors.InvalidArgumentError(
                    f"state has {source.nbytes} bytes, expected {self.state_size}; it must come from a phase of the "
                    "same shape, oversampling, guard_px, field and polarization_count"
                )
            with Buffer(source.nbytes, context=self.context) as memory:
                written = memory.enqueue_write(source, queue=queue)
                self.enqueue_restore(memory, queue=queue, wait_for=[written]).wait()

    def set_field(self, field: npt.ArrayLike, *, queue: QueueLike | None = None) -> None:
        """Takes a field of the caller's own as z, until the next refresh. Blocks.

        Args:
            field: (height, width) of :attr:`grid_shape`, complex or real, of a phase with one polarization; else
                (polarization_count, height, width). Light of a mean of 1 has a mean square of 1 where
                samples are independent, as in speckle. A smooth field passes the pupil whole and becomes brighter by
                the square of the oversampling (normalization "transmission"): divide it by the oversampling.

        Needs a circular Gaussian field, which holds any numbers, with dynamics "replace" and without `translate`.
        Frames without a refresh image it.
        """
        if not self._holds_any_field:
            raise errors.InvalidStateError(
                'a field of your own needs a phase with field "circular_gaussian", dynamics "replace" and '
                "translate=False; make the phase so"
            )
        given = _check.array(field, "field")
        if given.dtype.kind not in "iufc":
            raise errors.InvalidFormatError(f"field has dtype {given.dtype}, expected complex64 or real numbers")
        whole = (self.polarization_count, *self.grid_shape)
        if given.shape not in ({whole, whole[1:]} if self.polarization_count == 1 else {whole}):
            raise errors.InvalidArgumentError(
                f"field has shape {given.shape}, expected {whole if self.polarization_count > 1 else whole[1:]}: "
                "polarizations, and samples of the field grid (grid_shape)"
            )
        with np.errstate(over="ignore"):
            z = np.ascontiguousarray(given, np.complex64)
        bad = ~np.isfinite(z)
        if bad.any():
            raise errors.InvalidDataError(f"field must hold finite numbers; {_check.places(bad)} are not")
        self.restore(z.reshape(-1).view(np.uint8), queue=queue)

    def enqueue_save(
        self,
        memory: Buffer | SupportsIntPtr | int,
        *,
        offset_bytes: int = 0,
        queue: QueueLike | None = None,
        wait_for: Sequence[EventLike] | None = None,
    ) -> Event:
        """Copies the state to a buffer of at least :attr:`state_size` bytes from the offset on."""
        return self._copy("Save", memory, offset_bytes, self._asynchronous(queue, wait_for))

    def enqueue_restore(
        self,
        memory: Buffer | SupportsIntPtr | int,
        *,
        offset_bytes: int = 0,
        queue: QueueLike | None = None,
        wait_for: Sequence[EventLike] | None = None,
    ) -> Event:
        """Copies a state back from a buffer."""
        return self._copy("Restore", memory, offset_bytes, self._asynchronous(queue, wait_for))

    def _copy(self, what: str, memory: Buffer | SupportsIntPtr | int, offset_bytes: int, command: Command) -> Event:
        with exclusive(self):
            offset = _check.integer(offset_bytes, "offset_bytes", 64)
            return self._enqueue(command, what, memory_pointer(memory, "memory"), offset)

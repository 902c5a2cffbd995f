"""Image arguments of the stages: NumPy arrays go through reused device memory, device images go in as they are."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any, Union

import numpy as np
import numpy.typing as npt

from . import _check, _interop, _library
from ._interop import EventLike, SupportsIntPtr, SupportsOpenCLArray, WaitList, enqueue
from .runtime import Buffer, Context, DeviceImage, Event, Format, QueueLike, find_format

DeviceImageLike = Union[DeviceImage, Buffer, SupportsIntPtr, SupportsOpenCLArray]
"""A :class:`DeviceImage`, a ``pyopencl.array.Array``, or a bare Buffer (ours or PyOpenCL's) that holds the image
tightly packed in the size and format that the argument has by default."""

ImageLike = Union[npt.ArrayLike, DeviceImageLike]
"""Host or device image."""


def on_device(value: Any) -> bool:
    """True for anything that holds device memory."""
    return (
        isinstance(value, (DeviceImage, Buffer))
        or _interop.is_pyopencl_array(value)
        or _interop.is_pyopencl(value, "MemoryObjectHolder")
    )


def refuse_handle(value: Any, name: str) -> None:
    """Refuses an integer cl_mem, and says how to use it."""
    if isinstance(value, int) and not isinstance(value, bool):
        raise TypeError(
            f"{name} is an integer; a bare cl_mem handle has no shape: DeviceImage.wrap({name}, shape, dtype, ...)"
        )


def device_image(value: Any, name: str, shape: tuple[int, ...], default: Format, context: Context) -> DeviceImage:
    """A device image argument; a bare buffer is taken as tightly packed `shape` of format `default`."""
    if isinstance(value, DeviceImage):
        value.int_ptr  # refuses a closed one  # noqa: B018
        return value
    if _interop.is_pyopencl_array(value):
        return DeviceImage.wrap(value, context=context)
    if isinstance(value, Buffer) or _interop.is_pyopencl(value, "MemoryObjectHolder"):
        full = shape[:2] if default.channels == 1 else (*shape[:2], default.channels)
        return DeviceImage.wrap(value, full, default.dtype, context=context)
    refuse_handle(value, name)
    raise TypeError(
        f"{name} must be an image in device memory (DeviceImage, pyopencl array or buffer), got {_check.kind(value)}; "
        "DeviceImage.from_array() copies an array there"
    )


@dataclasses.dataclass
class Operands:
    """The images of one Enqueue call, for the wait list before it and the bookkeeping after it."""

    images: list[DeviceImage] = dataclasses.field(default_factory=list)
    events: list[Event] = dataclasses.field(default_factory=list)

    def add(self, image: DeviceImage) -> _library.ClspImage:
        """Counts an image in and returns its struct."""
        self.images.append(image)
        return image.struct()

    def waiting(self, wait_for: Sequence[EventLike] | None, *more: Event | None) -> WaitList:
        """The caller's events, those that PyOpenCL keeps with its arrays, and our own."""
        pending = [event for image in self.images for event in image._pending()]
        pending += [event for event in (*self.events, *more) if event is not None]
        return _interop.wait_list(wait_for, pending)

    def wait(self) -> None:
        """Blocks until the images can be used, for calls without a wait list."""
        waiting = self.waiting(None)
        if waiting.count:
            _library.call("clspEventWait", waiting.count, waiting.pointers)

    def enqueue(
        self, name: str, *arguments: Any, wait_for: Sequence[EventLike] | None = None, after: Event | None = None
    ) -> Event:
        """Makes the call, and tells PyOpenCL's arrays of it."""
        event = enqueue(name, *arguments, waiting=self.waiting(wait_for, after))
        for image in self.images:
            image._notify(event)
        return event


class Staging:
    """Device memory for host images, by the name of the argument; allocated once and kept while the size stays."""

    def __init__(self, context: Context) -> None:
        self.context = context
        self._images: dict[str, DeviceImage] = {}

    def image(self, name: str, shape: tuple[int, ...], dtype: npt.DTypeLike) -> DeviceImage:
        """Memory of undefined content."""
        kept = self._images.get(name)
        if kept is None or kept.shape != shape or kept.dtype != np.dtype(dtype):
            kept = self._images[name] = DeviceImage(shape, dtype, context=self.context)
        return kept

    def upload(self, name: str, array: npt.NDArray[Any], queue: QueueLike | None, operands: Operands) -> DeviceImage:
        """Starts a copy; `operands` waits for it."""
        image = self.image(name, array.shape, array.dtype)
        operands.events += image.enqueue_write(array, queue=queue)
        return image

    def clear(self) -> None:
        """Gives all memory back."""
        for image in self._images.values():
            image.close()
        self._images.clear()


@dataclasses.dataclass
class Output:
    """Where the result of a blocking call goes."""

    image: DeviceImage
    """What the device writes."""
    host: npt.NDArray[Any] | None
    """The array to copy it to; None: the caller gave device memory."""
    given: Any
    """What the caller gave, and gets back."""

    def finish(self, queue: QueueLike | None, event: Event) -> Any:
        """Waits, and returns the result."""
        if self.host is None:
            event.wait()
            return self.given
        return self.image.read(self.host, queue=queue, wait_for=[event])


def output(
    out: Any,
    name: str,
    shape: tuple[int, int],
    dtypes: Sequence[npt.DTypeLike],
    dtype: npt.DTypeLike | None,
    staging: Staging,
    context: Context,
) -> Output:
    """Resolves ``out=`` and ``dtype=``; without either the first of `dtypes` is taken."""
    accepted = [np.dtype(d) for d in dtypes]
    wanted = None if dtype is None else np.dtype(dtype)
    if wanted is not None and wanted not in accepted:
        raise _check.format_error("dtype", wanted, accepted)
    if out is not None and on_device(out):
        default = find_format(shape, wanted or accepted[0], name)
        image = device_image(out, name, shape, default, context)
        if wanted is not None and image.dtype != wanted:
            raise _check.format_error(name, image.dtype, [wanted])
        return Output(image, None, out)
    if out is None:
        out = np.empty(shape, wanted or accepted[0])
    else:
        _check.host_output(out, name, shape, accepted if wanted is None else (wanted,))
    return Output(staging.image(name, shape, out.dtype), out, out)

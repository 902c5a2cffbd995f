"""What the stages share. NumPy images go through reused device memory, device images go in as they are."""

from __future__ import annotations

import ctypes
import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any, Callable, ClassVar, Union

import numpy as np
import numpy.typing as npt

from . import _check, _interop, _library
from ._handle import Handle, create, exclusive
from ._interop import EventLike, SupportsDLPack, SupportsIntPtr, SupportsOpenCLArray, WaitList, enqueue
from .runtime import (
    FLOAT32,
    UINT8,
    Buffer,
    Context,
    DeviceImage,
    Event,
    Format,
    QueueLike,
    find_format,
    queue_pointer,
    resolve_context,
)

DeviceImageLike = Union[DeviceImage, Buffer, SupportsIntPtr, SupportsOpenCLArray]
"""A :class:`DeviceImage`, a ``pyopencl.array.Array``, or a bare Buffer (ours or PyOpenCL's) that holds the image
tightly packed in the size and format that the argument has by default."""

ImageLike = Union[npt.ArrayLike, SupportsDLPack, DeviceImageLike]
"""Host or device image, or a tensor."""

HostCheck = Callable[[Any, str, tuple[int, int]], npt.NDArray[Any]]
"""Makes an argument (value, name, shape) an array, or says what is wrong with it."""


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
        "DeviceImage.from_array() copies an array there, and DeviceImage.from_dlpack() takes a tensor"
    )


class Staging:
    """Device memory for host images, by the name of the argument; allocated once and kept while the size stays."""

    def __init__(self, context: Context) -> None:
        self.context = context
        self._images: dict[str, DeviceImage] = {}
        self.brightest = 0.0
        """The largest number of the ideal image that was last copied, as light."""

    def image(self, name: str, shape: tuple[int, ...], dtype: npt.DTypeLike) -> DeviceImage:
        """Memory of undefined content."""
        kept = self._images.get(name)
        if kept is None or kept.shape != shape or kept.dtype != np.dtype(dtype):
            kept = self._images[name] = DeviceImage(shape, dtype, context=self.context)
        return kept

    def kept(self, name: str) -> DeviceImage | None:
        """What was last copied for an argument."""
        return self._images.get(name)

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
    queue: QueueLike

    def finish(self, event: Event) -> Any:
        """Waits, and returns the result."""
        if self.host is None:
            event.wait()
            return self.given
        return self.image.read(self.host, queue=self.queue, wait_for=[event])


class Command:
    """One Enqueue call in the making: its queue, the images that it uses, and what it waits for.

    Host images are copied to `staging`, or refused if the command is `asynchronous`.
    """

    def __init__(
        self,
        staging: Staging,
        queue: QueueLike | None,
        wait_for: Sequence[EventLike] | None = None,
        *,
        asynchronous: bool = False,
    ) -> None:
        self.staging = staging
        self.context = staging.context
        self.queue: QueueLike = self.context.queue if queue is None else queue
        self.wait_for = wait_for
        self.asynchronous = asynchronous
        self._images: list[DeviceImage] = []
        self._uploads: list[Event] = []

    def add(self, image: DeviceImage) -> _library.ClspImage:
        """Counts an image in and returns its struct."""
        self._images.append(image)
        return image.struct()

    def upload(self, name: str, array: npt.NDArray[Any]) -> DeviceImage:
        """Starts a copy; the command waits for it."""
        image = self.staging.image(name, array.shape, array.dtype)
        self._uploads += image.enqueue_write(array, queue=self.queue)
        return image

    def image(
        self,
        value: Any,
        name: str,
        shape: tuple[int, int],
        default: Format = FLOAT32,
        check: HostCheck = _check.irradiance_plane,
    ) -> DeviceImage:
        """An image argument: in device memory, or on the host, where `check` makes it an array of an image's format."""
        if self.asynchronous or on_device(value):
            return device_image(value, name, shape, default, self.context)
        refuse_handle(value, name)
        return self.upload(name, check(value, name, shape))

    def mask(self, value: Any, name: str, shape: tuple[int, int]) -> DeviceImage:
        """A mask argument: where it is not 0."""
        return self.image(value, name, shape, UINT8, _check.mask_plane)

    def fill(
        self,
        struct: Any,
        images: Mapping[str, Any],
        kinds: Mapping[str, tuple[HostCheck, Format]],
        shape: tuple[int, int],
        prefix: str = "",
    ) -> None:
        """Sets those images of a struct that are not None. All host images are checked before the first is uploaded."""
        given = {name: images[name] for name in kinds if images.get(name) is not None}
        host = {
            name: kinds[name][0](value, name, shape)
            for name, value in given.items()
            if not self.asynchronous and not on_device(value)
        }
        for name, value in given.items():
            if name in host:
                image = self.upload(prefix + name, host[name])
            else:
                image = device_image(value, name, shape, kinds[name][1], self.context)
            setattr(struct, name, self.add(image))

    def output(
        self,
        out: Any,
        shape: tuple[int, ...],
        dtypes: Sequence[npt.DTypeLike] = (np.float32,),
        dtype: npt.DTypeLike | None = None,
    ) -> Output:
        """Resolves ``out=`` and ``dtype=``; without either the first of `dtypes` is taken."""
        accepted = [np.dtype(d) for d in dtypes]
        wanted = None if dtype is None else np.dtype(dtype)
        if wanted is not None and wanted not in accepted:
            raise _check.format_error("dtype", wanted, accepted)
        if out is not None and on_device(out):
            default = find_format(shape, wanted or accepted[0], "out")
            image = device_image(out, "out", shape, default, self.context)
            if wanted is not None and image.dtype != wanted:
                raise _check.format_error("out", image.dtype, [wanted])
            return Output(image, None, out, self.queue)
        if out is None:
            out = np.empty(shape, wanted or accepted[0])
        else:
            _check.host_output(out, "out", shape, accepted if wanted is None else (wanted,))
        return Output(self.staging.image("out", shape, out.dtype), out, out, self.queue)

    def _waiting(self, *more: Event | None) -> WaitList:
        """The caller's events, those that PyOpenCL keeps with its arrays, and our own."""
        pending = [event for image in self._images for event in image._pending()]
        pending += [event for event in (*self._uploads, *more) if event is not None]
        return _interop.wait_list(self.wait_for, pending)

    def wait(self) -> None:
        """Blocks until the images can be used, for calls without a wait list."""
        waiting = self._waiting()
        if waiting.count:
            _library.call("clspEventWait", waiting.count, waiting.pointers)

    def enqueue(self, name: str, handle: int, *arguments: Any, after: Event | None = None) -> Event:
        """Makes the call, where images and structs go by pointer, and tells PyOpenCL's arrays of it."""
        passed = []
        for argument in arguments:
            if isinstance(argument, DeviceImage):
                argument = self.add(argument)
            passed.append(ctypes.byref(argument) if isinstance(argument, ctypes.Structure) else argument)
        event = enqueue(name, handle, queue_pointer(self.queue, self.context), *passed, waiting=self._waiting(after))
        for image in self._images:
            image._notify(event)
        return event


class Stage(Handle):
    """A step of the simulation, and the device memory that its NumPy images go through."""

    _arguments: ClassVar[_check.Arguments]
    context: Context
    _staging: Staging

    def _create(self, desc: Any, context: Context | None) -> None:
        self.context = resolve_context(context)
        self._adopt(create(f"{self._c_name}Create", self.context._get(), ctypes.byref(desc)))
        self._staging = Staging(self.context)

    def _forget(self) -> None:
        self._staging.clear()

    @classmethod
    def defaults(cls) -> dict[str, Any]:
        """The C library's defaults of the keyword arguments that have one."""
        owner = next(kind for kind in cls.__mro__ if "_arguments" in vars(kind))
        arguments = cls._arguments
        return arguments.values(arguments.describe({}), _check.optional(vars(owner)["__init__"]))

    def _command(self, queue: QueueLike | None) -> Command:
        """For a call that blocks."""
        return Command(self._staging, queue)

    def _asynchronous(self, queue: QueueLike | None, wait_for: Sequence[EventLike] | None) -> Command:
        """For a call from device memory to device memory."""
        return Command(self._staging, queue, wait_for, asynchronous=True)

    def _enqueue(self, command: Command, what: str, *arguments: Any) -> Event:
        return command.enqueue(f"{self._c_name}Enqueue{what}", self._get(), *arguments)

    def _wait_and_check(self, queue: QueueLike | None) -> None:
        with exclusive(self):
            _library.call(f"{self._c_name}Check", self._get(), queue_pointer(queue, self.context))

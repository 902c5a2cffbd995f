"""Devices, contexts, queues, events and images in device memory: ``runtime.h``, and the image type of ``types.h``."""

from __future__ import annotations

import ctypes
import dataclasses
import logging
import os
import threading
from collections.abc import Sequence
from typing import Any, Union

import numpy as np
import numpy.typing as npt

from . import _check, _interop, _library, _tensor, errors
from ._handle import Handle, create
from ._interop import Event, EventLike, OpenCLHandle, SupportsIntPtr, SupportsOpenCLArray, enqueue

__all__ = [
    "Buffer",
    "Context",
    "ContextInfo",
    "Device",
    "DeviceImage",
    "Event",
    "Queue",
    "Version",
    "default_context",
    "devices",
    "explain_devices",
    "version",
    "wait",
]

_LOG_LEVELS = {_library.CLSP_LOG_WARNING: logging.WARNING, _library.CLSP_LOG_INFO: logging.INFO}


def _log(_data: int | None, level: int, message: bytes) -> None:
    try:
        logging.getLogger("clspeckle").log(_LOG_LEVELS.get(level, logging.DEBUG), "%s", _library.text(message))
    except KeyboardInterrupt as interrupt:  # ctypes would drop it
        _library.held_interrupts.append(interrupt)


# Never freed: stages outlive their contexts, and what they log still comes here.
_LOG_FUNCTION = _library.LOG_FUNCTION(_log)


@dataclasses.dataclass(frozen=True)
class Version:
    """Release number and ABI number of the C library."""

    major: int
    """Of the release."""
    minor: int
    """Of the release."""
    patch: int
    """Of the release."""
    abi: int
    """Of the interface: the SOVERSION."""

    def __str__(self) -> str:
        return f"{self.major}.{self.minor}.{self.patch}"


def version() -> Version:
    """The version of the C library that is loaded. May be called from any thread.

    Raises:
        LibraryLoadError: the library was not found; the message lists the places.
    """
    numbers = [ctypes.c_uint32() for _ in range(4)]
    _library.call("clspGetVersion", *(ctypes.byref(number) for number in numbers))
    return Version(*(number.value for number in numbers))


# --- Devices ---


@dataclasses.dataclass(frozen=True)
class Device:
    """One OpenCL device, and whether clSpeckle can use it."""

    usable: bool
    """True: clSpeckle runs on it; False: see `reason`."""
    reason: str
    """Why it is not usable, "" if it is."""
    rank: int
    """0 is the device that is taken when none is named, 1 the next."""
    selector: str
    """"platform:device", for ``Context(selector)``."""
    name: str
    """CL_DEVICE_NAME."""
    vendor: str
    """CL_DEVICE_VENDOR."""
    version: str
    """CL_DEVICE_VERSION."""
    driver_version: str
    """CL_DRIVER_VERSION."""
    platform_name: str
    """CL_PLATFORM_NAME."""
    type: tuple[str, ...]
    """Some of "cpu", "gpu", "accelerator", "custom", "default"."""
    compute_units: int
    """CL_DEVICE_MAX_COMPUTE_UNITS."""
    global_memory_bytes: int
    """CL_DEVICE_GLOBAL_MEM_SIZE."""
    max_allocation_bytes: int
    """CL_DEVICE_MAX_MEM_ALLOC_SIZE."""
    local_memory_bytes: int
    """CL_DEVICE_LOCAL_MEM_SIZE."""
    max_work_group_size: int
    """CL_DEVICE_MAX_WORK_GROUP_SIZE."""
    platform_id: int
    """cl_platform_id as an integer."""
    device_id: int
    """cl_device_id as an integer (``pyopencl.Device.from_int_ptr``)."""


# cl.h: CL_DEVICE_TYPE_*
_DEVICE_TYPES = ((1 << 1, "cpu"), (1 << 2, "gpu"), (1 << 3, "accelerator"), (1 << 4, "custom"), (1 << 0, "default"))


def devices() -> list[Device]:
    """Every device of every OpenCL platform, best first; empty if there is none. May be called from any thread."""
    count = ctypes.c_uint32()
    _library.call("clspDeviceList", 0, None, ctypes.byref(count))
    capacity = count.value
    if capacity == 0:
        return []
    infos = (_library.ClspDeviceInfo * capacity)()
    for info in infos:
        info.struct_size = ctypes.sizeof(info)
    _library.call("clspDeviceList", capacity, infos, ctypes.byref(count))
    return [
        _library.record(
            Device,
            info,
            usable=bool(info.usable),
            type=tuple(word for bit, word in _DEVICE_TYPES if info.type & bit),
            platform_id=info.platform_id or 0,
            device_id=info.device_id or 0,
        )
        for info in infos[: min(capacity, count.value)]
    ]


def explain_devices(device: str | Device | None = None) -> str:
    """In words: which platforms and devices were seen, which one would be taken and why, how to install one.

    Args:
        device: as for :class:`Context`.

    May be called from any thread.
    """
    return _library.text_of("clspDeviceExplain", _selector(device))


def _selector(device: str | Device | None) -> bytes | None:
    if device is None:
        return None
    if isinstance(device, Device):
        device = device.selector
    if not isinstance(device, str):
        raise TypeError(
            'device must be a Device of devices(), or text: "gpu", "cpu", "accelerator", "platform:device" or a part '
            f"of a name; got {_check.kind(device)}. For PyOpenCL's objects use Context.from_opencl()"
        )
    return _check.no_null(device.encode("utf-8"), "device")


# --- Context ---


@dataclasses.dataclass(frozen=True)
class ContextInfo:
    """What a context is and holds."""

    device_name: str
    """CL_DEVICE_NAME."""
    platform_name: str
    """CL_PLATFORM_NAME."""
    programs_built: int
    """Programs compiled from source since creation."""
    programs_from_cache: int
    """Programs loaded from the disk cache since creation."""
    allocation_count: int
    """Device buffers that the library holds now; those of Buffer and DeviceImage are not counted."""
    allocated_bytes: int
    """What they take."""
    opencl_context: int
    """cl_context as an integer (``pyopencl.Context.from_int_ptr``)."""
    opencl_device: int
    """cl_device_id as an integer."""


class Context(Handle):
    """One device, its compiled programs and its FFT plans.

    Args:
        device: which device: a :class:`Device`, its selector "platform:device", "gpu", "cpu", "accelerator", or a
            part of the device's or platform's name in any case. None: the environment variable CLSPECKLE_DEVICE if
            set, else the best device.
        kernel_dir: folder with files that replace the built-in kernels of the same path (``stages/phase.cl``).
            None: the environment variable CLSPECKLE_KERNEL_DIR if set, else the built-in ones.
        cache_dir: folder of the program cache and the tuning record (:func:`tune`). None: CLSPECKLE_CACHE_DIR, else
            ``$XDG_CACHE_HOME/clspeckle``, else ``~/.cache/clspeckle``.
        disk_cache: "on", "off" or "auto": as CLSPECKLE_DISK_CACHE says; else on, except on PoCL, which has a cache of
            its own.
        profiling: True: :attr:`queue` measures times, which :meth:`Pipeline.timings` needs.

    A context is needed by every stage; those made without one share :func:`default_context`. PyOpenCL users share
    theirs with :meth:`from_opencl`.

    What the library has to say beside errors goes to the logger "clspeckle" of :mod:`logging`: warnings, and at the
    level INFO choices, such as which engine makes an aperture's transforms.

    Threads: may be used from any number of threads at once. Close it only when none uses it; stages made from it stay
    usable after that.

    Raises:
        NoDeviceError: no OpenCL device, or none that fits; the message lists what was seen and how to install one.
    """

    _c_name = "clspContext"

    def __init__(
        self,
        device: str | Device | None = None,
        *,
        kernel_dir: str | os.PathLike[str] | None = None,
        cache_dir: str | os.PathLike[str] | None = None,
        disk_cache: str | None = None,
        profiling: bool = False,
    ) -> None:
        desc = _context_desc(kernel_dir, cache_dir, disk_cache)
        desc.device = _selector(device)
        self._set_up(desc, profiling)

    @classmethod
    def from_opencl(
        cls,
        context: OpenCLHandle,
        device: OpenCLHandle | None = None,
        *,
        kernel_dir: str | os.PathLike[str] | None = None,
        cache_dir: str | os.PathLike[str] | None = None,
        disk_cache: str | None = None,
        profiling: bool = False,
    ) -> Context:
        """A context on an OpenCL context of the application, which is retained while this one lives.

        Args:
            context: ``pyopencl.Context``, or cl_context as an integer. An integer must be a valid handle, as in C.
            device: ``pyopencl.Device``, or cl_device_id as an integer; may be left out if a PyOpenCL context has one
                device.

        The others are those of :class:`Context`.
        """
        pointer = _interop.handle(context, "Context", "context")
        if device is None:
            if not _interop.is_pyopencl(context, "Context"):
                raise TypeError("device is needed with an integer context handle")
            owned: Any = context
            if len(owned.devices) != 1:
                raise errors.InvalidArgumentError(
                    f"the PyOpenCL context has {len(owned.devices)} devices; say which one with device="
                )
            device = owned.devices[0]
        desc = _context_desc(kernel_dir, cache_dir, disk_cache)
        desc.cl_context_handle = pointer
        desc.cl_device = _interop.handle(device, "Device", "device")
        self = cls.__new__(cls)
        self._set_up(desc, profiling)
        return self

    def _set_up(self, desc: _library.ClspContextDesc, profiling: bool) -> None:
        self._profiling = bool(_check.flag(profiling, "profiling"))
        self._queue: Queue | None = None
        self._camera_lock = threading.Lock()
        self._camera: tuple[Any, Handle] | None = None
        self._adopt(create("clspContextCreate", ctypes.byref(desc)))

    def _forget(self) -> None:
        with self._camera_lock:
            self._camera = None
        if self._queue is not None:
            self._queue.close()

    @property
    def queue(self) -> Queue:
        """The in-order queue that calls without ``queue=`` use; made on first use, shared by all threads.

        Threads that want their work to overlap make a :class:`Queue` each.
        """
        pointer = self._get()
        with self._lock:
            if self._queue is None or self._queue.closed:
                self._queue = Queue._make(pointer, self._profiling, False)
            return self._queue

    def info(self) -> ContextInfo:
        """Names, counts of programs and of device memory."""
        info = _library.fetched(_library.ClspContextInfo, "clspContextGetInfo", self._get())
        opencl = {"opencl_context": info.cl_context_handle or 0, "opencl_device": info.cl_device or 0}
        return _library.record(ContextInfo, info, **opencl)

    def __repr__(self) -> str:
        return super().__repr__() if self.closed else f"<clspeckle.Context on {self.info().device_name}>"

    def _take_camera(self, key: Any) -> Any:
        """The pipeline that was kept for `key`, for the caller alone; another one is dropped."""
        with self._camera_lock:
            kept, self._camera = self._camera, None
        return kept[1] if kept is not None and kept[0] == key and not kept[1].closed else None

    def _keep_camera(self, key: Any, camera: Handle) -> None:
        with self._camera_lock:
            if not self.closed:
                self._camera = (key, camera)


def _context_desc(
    kernel_dir: str | os.PathLike[str] | None,
    cache_dir: str | os.PathLike[str] | None,
    disk_cache: str | None,
) -> _library.ClspContextDesc:
    desc = _library.initialized(_library.ClspContextDesc)
    desc.log = _LOG_FUNCTION
    if kernel_dir is not None:
        desc.kernel_dir = _check.path(kernel_dir, "kernel_dir")
    if cache_dir is not None:
        desc.cache_dir = _check.path(cache_dir, "cache_dir")
    if disk_cache is not None:
        desc.disk_cache = _check.choice(disk_cache, "disk_cache", _library.words("DISK_CACHE"))
    return desc


_default_lock = threading.Lock()
_default: Context | None = None


def _after_fork_in_child() -> None:
    global _default_lock
    _default_lock = threading.Lock()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_after_fork_in_child)


def default_context() -> Context:
    """The context that stages without ``context=`` share; made on first use, and anew if it was closed.

    It is on the best device, or on the one that the environment variable CLSPECKLE_DEVICE names. May be called from any
    thread.
    """
    global _default
    _library.refuse_fork()
    with _default_lock:
        if _default is None or _default.closed:
            _default = Context()
        return _default


def resolve_context(context: Context | None, *sources: Any) -> Context:
    """`context`, else the context of the first of our device images, else the default one."""
    if context is None:
        for source in sources:
            found = getattr(source, "context", None) if isinstance(source, (DeviceImage, Buffer)) else None
            if found is not None:
                context = found
                break
        else:
            context = default_context()
    if not isinstance(context, Context):
        raise TypeError(
            f"context must be a clspeckle.Context, got {_check.kind(context)}. For PyOpenCL's: Context.from_opencl()"
        )
    context._get()
    return context


# --- Queues and events ---


class Queue(Handle):
    """A command queue.

    Args:
        context: None for :func:`default_context`.
        profiling: True: commands are timed, which :meth:`Pipeline.timings` needs.
        out_of_order: True: only events order the commands.

    Wherever a method takes ``queue=``, a ``pyopencl.CommandQueue`` or an integer cl_command_queue will do as well.

    Threads: OpenCL queues may be used from any number of threads at once.
    """

    _c_name = "clspQueue"

    def __init__(self, context: Context | None = None, *, profiling: bool = False, out_of_order: bool = False) -> None:
        self._create(resolve_context(context)._get(), profiling, out_of_order)

    def _create(self, context: int, profiling: bool, out_of_order: bool) -> None:
        flags = _library.CLSP_QUEUE_PROFILING * _check.flag(profiling, "profiling")
        flags |= _library.CLSP_QUEUE_OUT_OF_ORDER * _check.flag(out_of_order, "out_of_order")
        self._adopt(create("clspQueueCreate", context, flags))

    @classmethod
    def _make(cls, context: int, profiling: bool, out_of_order: bool) -> Queue:
        self = cls.__new__(cls)
        self._create(context, profiling, out_of_order)
        return self

    @property
    def int_ptr(self) -> int:
        """cl_command_queue as an integer (``pyopencl.CommandQueue.from_int_ptr``)."""
        return self._get()

    def finish(self) -> None:
        """Waits until everything in the queue is done."""
        _library.call("clspQueueFinish", self._get())


QueueLike = Union[Queue, SupportsIntPtr, int]
"""A queue of ours, a ``pyopencl.CommandQueue``, or an integer handle."""


def queue_pointer(queue: QueueLike | None, context: Context | None) -> int:
    """The cl_command_queue of an argument; None is the context's own queue."""
    if queue is None:
        queue = resolve_context(context).queue
    if isinstance(queue, Queue):
        return queue._get()
    return _interop.handle(queue, "CommandQueue", "queue")


def wait(events: Sequence[EventLike]) -> None:
    """Blocks until all events (ours, PyOpenCL's or integer handles) are complete; does nothing for an empty list.

    Raises:
        OpenCLError: one of the commands failed.
    """
    waiting = _interop.wait_list(events)
    if waiting.count:
        _library.call("clspEventWait", waiting.count, waiting.pointers)


# --- Memory ---


def memory_pointer(memory: Any, name: str) -> int:
    """The cl_mem behind a Buffer, a PyOpenCL object or an integer."""
    if isinstance(memory, Buffer):
        return memory._get()
    if _interop.is_pyopencl(memory, "MemoryObjectHolder"):  # Buffer, and the buffers of PyOpenCL's memory pools
        return _interop.handle(memory, "MemoryObjectHolder", name)
    if not isinstance(memory, int) or isinstance(memory, bool):
        raise TypeError(
            f"{name} must be a Buffer, a pyopencl.Buffer or an integer cl_mem handle, got {_check.kind(memory)} "
            "(shared virtual memory cannot be used)"
        )
    return _interop.handle(memory, "Buffer", name)


class Buffer(Handle):
    """Device memory without a shape.

    Args:
        size_bytes: at least 1; the content is undefined.
        context: None for :func:`default_context`.

    Most code needs :class:`DeviceImage` instead.

    Threads: one thread at a time writes; the object itself may be shared.
    """

    _c_name = "clspBuffer"
    _pickle_advice = "read() gives its content"

    def __init__(self, size_bytes: int, *, context: Context | None = None) -> None:
        size = _check.integer(size_bytes, "size_bytes", 64)
        self.context = resolve_context(context)
        self.size_bytes = size
        self._adopt(create("clspBufferCreate", self.context._get(), size))

    @classmethod
    def _on_host(cls, array: npt.NDArray[Any], size_bytes: int, context: Context) -> Buffer:
        """A buffer on the memory of an array."""
        self = cls.__new__(cls)
        self.context, self.size_bytes = context, size_bytes
        self._adopt(_tensor.host_buffer(context.info().opencl_context, array, size_bytes))
        return self

    @property
    def int_ptr(self) -> int:
        """cl_mem as an integer (``pyopencl.Buffer.from_int_ptr``); still owned by this object."""
        return self._get()

    def write(self, data: Any, *, offset_bytes: int = 0, queue: QueueLike | None = None) -> None:
        """Copies host memory (bytes or an array of any dtype) to the buffer. Blocks."""
        source = _bytes_of(data, "data")
        _library.call(
            "clspBufferWrite",
            queue_pointer(queue, self.context),
            source.ctypes.data,
            source.nbytes,
            self._get(),
            _check.integer(offset_bytes, "offset_bytes", 64),
        )

    def read(
        self, size_bytes: int | None = None, *, offset_bytes: int = 0, queue: QueueLike | None = None
    ) -> npt.NDArray[np.uint8]:
        """Copies `size_bytes` (None: all from the offset on) to a new uint8 array. Blocks."""
        offset = _check.integer(offset_bytes, "offset_bytes", 64)
        size = max(0, self.size_bytes - offset) if size_bytes is None else _check.integer(size_bytes, "size_bytes", 64)
        if offset + size > self.size_bytes or size == 0:
            raise errors.BufferTooSmallError(
                f"cannot read {size} bytes from offset {offset}; the buffer has {self.size_bytes} bytes"
            )
        result = np.empty(size, np.uint8)
        _library.call(
            "clspBufferRead", queue_pointer(queue, self.context), self._get(), offset, size, result.ctypes.data
        )
        return result

    def enqueue_write(
        self,
        data: Any,
        *,
        offset_bytes: int = 0,
        queue: QueueLike | None = None,
        wait_for: Sequence[EventLike] | None = None,
    ) -> Event:
        """Starts a copy of host memory to the buffer; do not change `data` before the event is complete."""
        source = _bytes_of(data, "data")
        return enqueue(
            "clspBufferEnqueueWrite",
            queue_pointer(queue, self.context),
            source.ctypes.data,
            source.nbytes,
            self._get(),
            _check.integer(offset_bytes, "offset_bytes", 64),
            waiting=_interop.wait_list(wait_for),
            kept=(source,),
        )

    def enqueue_read(
        self,
        out: npt.NDArray[Any],
        *,
        offset_bytes: int = 0,
        queue: QueueLike | None = None,
        wait_for: Sequence[EventLike] | None = None,
    ) -> Event:
        """Starts a copy of ``out.nbytes`` bytes into a C-contiguous array; its content is there once the event is."""
        if not isinstance(out, np.ndarray) or not out.flags.c_contiguous or not out.flags.writeable:
            raise TypeError(f"out must be a writeable, C-contiguous NumPy array, got {_check.kind(out)}")
        return enqueue(
            "clspBufferEnqueueRead",
            queue_pointer(queue, self.context),
            self._get(),
            _check.integer(offset_bytes, "offset_bytes", 64),
            out.nbytes,
            out.ctypes.data,
            waiting=_interop.wait_list(wait_for),
            kept=(out,),
        )


def _bytes_of(data: Any, name: str) -> npt.NDArray[np.uint8]:
    if isinstance(data, (bytes, bytearray, memoryview)):
        return np.frombuffer(data, np.uint8)
    return np.ascontiguousarray(_check.array(data, name)).reshape(-1).view(np.uint8)


@dataclasses.dataclass(frozen=True)
class Format:
    """One CLSP_FORMAT_* in NumPy's terms."""

    code: int
    dtype: npt.DTypeLike
    channels: int
    name: str

    @property
    def component_bytes(self) -> int:
        return np.dtype(self.dtype).itemsize

    @property
    def pixel_bytes(self) -> int:
        return self.component_bytes * self.channels


UINT8 = Format(_library.CLSP_FORMAT_UINT8, np.uint8, 1, "uint8")
UINT16 = Format(_library.CLSP_FORMAT_UINT16, np.uint16, 1, "uint16")
UINT32 = Format(_library.CLSP_FORMAT_UINT32, np.uint32, 1, "uint32")
FLOAT32 = Format(_library.CLSP_FORMAT_FLOAT32, np.float32, 1, "float32")
FLOAT32X2 = Format(_library.CLSP_FORMAT_FLOAT32X2, np.float32, 2, "float32 x 2")
FLOAT32X3 = Format(_library.CLSP_FORMAT_FLOAT32X3, np.float32, 3, "float32 x 3")
FLOAT32X4 = Format(_library.CLSP_FORMAT_FLOAT32X4, np.float32, 4, "float32 x 4")

_SCALARS: dict[Any, Format] = {np.dtype(f.dtype): f for f in (UINT8, UINT16, UINT32, FLOAT32)}
_SCALARS[np.dtype(np.bool_)] = UINT8
_SCALARS[np.dtype(np.complex64)] = FLOAT32X2
_VECTORS = {2: FLOAT32X2, 3: FLOAT32X3, 4: FLOAT32X4}
_FORMATS_TEXT = (
    "bool, uint8, uint16, uint32, float32 or complex64 of shape (height, width), or float32 of shape (height, width, "
    "channels) with 2 to 4 channels"
)


def _image_shape(shape: Sequence[int]) -> tuple[int, ...]:
    try:
        lengths = tuple(shape)
    except TypeError:
        lengths = ()
    if len(lengths) not in (2, 3) or isinstance(shape, str):
        raise TypeError(f"shape must be (height, width) or (height, width, channels), got {_check.kind(shape)}")
    return (*_check.image_shape(lengths[:2]), *(_check.integer(n, "shape[2]") for n in lengths[2:]))


def find_format(shape: tuple[int, ...], dtype: npt.DTypeLike, name: str) -> Format:
    """The format of an array of pixels."""
    kind = np.dtype(dtype)
    if len(shape) == 2:
        if kind in _SCALARS:
            return _SCALARS[kind]
        # OpenCL vectors: float2, float4, and float3, which takes the room of a float4
        fields = list((kind.fields or {}).values())
        if fields and all(field[0] == np.float32 for field in fields) and kind.itemsize in (8, 16):
            return _VECTORS[kind.itemsize // 4]
    elif len(shape) == 3 and kind == np.float32 and shape[2] in _VECTORS:
        return _VECTORS[shape[2]]
    raise errors.InvalidFormatError(f"{name} has dtype {kind} and shape {tuple(shape)}, expected {_FORMATS_TEXT}")


def _pitch(shape: tuple[int, ...], strides: Sequence[int], pixel: Format) -> int | None:
    """From one row to the next; None if the pixels of a row, or the rows, do not lie as in an image."""
    # Strides along an axis of one element mean nothing.
    packed = shape[1] == 1 or strides[1] == pixel.pixel_bytes
    packed = packed and (len(shape) == 2 or strides[2] == pixel.component_bytes)
    row = shape[1] * pixel.pixel_bytes
    pitch = row if shape[0] == 1 else strides[0]
    return pitch if packed and pitch >= row else None


class DeviceImage:
    """An image in device memory: memory of its own, or a view of somebody else's buffer.

    Args:
        shape: (height, width), or (height, width, channels) for float32 with 2 to 4 channels.
        dtype: uint8 (or bool), uint16, uint32, float32, or complex64 (two floats per pixel).
        context: None for :func:`default_context`.

    The constructor allocates memory of undefined content; :meth:`from_array` copies an array, :meth:`wrap` looks at
    memory that exists. ``np.array(image)`` reads the image. So does ``np.asarray(image)``, but on a CPU's context it
    looks at the image itself (``__array_interface__``): what is written to one is seen in the other.

    Threads: one thread at a time writes; the object itself may be shared.
    """

    memory: Any
    """What owns the memory: a :class:`Buffer`, a PyOpenCL object, or an integer handle."""
    shape: tuple[int, ...]
    dtype: np.dtype[Any]
    offset_bytes: int
    """Where the first pixel lies."""
    pitch_bytes: int
    """From one row to the next."""
    context: Context | None
    """The context of :meth:`read` and :meth:`write`; None for a view that was made without one."""

    def __init__(
        self, shape: Sequence[int], dtype: npt.DTypeLike = np.float32, *, context: Context | None = None
    ) -> None:
        size, kind = _image_shape(shape), np.dtype(dtype)
        pixel = find_format(size, kind, "the image")
        memory = Buffer(size[0] * size[1] * pixel.pixel_bytes, context=context)
        self._set_up(memory, size, kind, pixel, 0, 0, memory.context)
        self._owned = memory

    _owned: Buffer | None = None

    def _set_up(
        self,
        memory: Any,
        shape: tuple[int, ...],
        dtype: np.dtype[Any],
        pixel: Format,
        offset_bytes: int,
        pitch_bytes: int,
        context: Context | None,
    ) -> None:
        self.memory, self.shape, self.dtype, self.format = memory, shape, dtype, pixel
        self.offset_bytes, self.context = offset_bytes, context
        self.pitch_bytes = pitch_bytes or shape[1] * pixel.pixel_bytes
        self._array: Any = None

    @classmethod
    def from_array(cls, array: Any, *, context: Context | None = None, queue: QueueLike | None = None) -> DeviceImage:
        """Copies an array of one of the class's dtypes to new device memory. Blocks."""
        source = _check.array(array, "array")
        find_format(source.shape, source.dtype, "array")
        image = cls(source.shape, source.dtype, context=context)
        image.write(source, queue=queue)
        return image

    @classmethod
    def from_dlpack(cls, tensor: Any, *, context: Context | None = None, copy: bool | None = None) -> DeviceImage:
        """An image on the memory of a tensor (PyTorch, JAX, CuPy, NumPy: all that speaks DLPack), or a copy of it.

        On a CPU's context a tensor in host memory is not copied: what is written to one is seen in the other. Its
        rows must be tightly packed in themselves, and it must be writeable. Else it is copied, as by
        :meth:`from_array`, and the logger "clspeckle" says why: what is written to the image does not reach the tensor.
        It is a warning where the tensor could be written to. OpenCL shares no memory with CUDA, ROCm and the like.

        Args:
            tensor: one of the class's dtypes and shapes; what has an ``__array_interface__`` is one, too. A PyTorch
                tensor must not require a gradient.
            context: None for :func:`default_context`.
            copy: False: refused where it would be copied; True: copied in any case, without a word.

        Raises:
            BufferError: `copy` is False, and the tensor cannot be shared.

        ``np.from_dlpack(image)``, ``np.asarray(image)``, ``torch.from_dlpack(image)`` and so on go the other way:
        without a copy from a CPU's context. The commands of its queue are waited for; what other queues still write to
        the image is not.
        """
        view = _check.array(tensor, "tensor")
        pixel = find_format(view.shape, view.dtype, "tensor")
        context = resolve_context(context)
        pitch = _pitch(view.shape, view.strides, pixel)
        if copy:
            return cls.from_array(view, context=context)
        if not _tensor.on_cpu(context.info().opencl_device):
            why = "OpenCL's device is no CPU"
        elif not view.flags.writeable:
            why = "it is read-only"
            if _tensor.is_tensor(tensor) and not _tensor.TELLS_READ_ONLY:
                why += ", as all tensors are for NumPy before 2.1"
        elif pitch is None or view.size == 0:
            why = "its pixels do not lie next to each other"
        elif _tensor.is_tensor(tensor) and tensor.__dlpack_device__()[0] != _tensor.CPU:
            why = "it is not in the host's memory"
        else:
            memory = Buffer._on_host(view, pitch * (view.shape[0] - 1) + view.shape[1] * pixel.pixel_bytes, context)
            self = cls.__new__(cls)
            self._set_up(memory, view.shape, view.dtype, pixel, 0, pitch, context)
            self._owned = memory
            return self
        if copy is False:
            raise BufferError(f"the tensor cannot be shared: {why}; without copy=False it is copied")
        may_be_written = view.flags.writeable or (_tensor.is_tensor(tensor) and not _tensor.TELLS_READ_ONLY)
        level = logging.WARNING if may_be_written else logging.INFO
        logging.getLogger("clspeckle").log(
            level, "the tensor is copied: %s; what is written to the image does not reach it", why
        )
        return cls.from_array(view, context=context)

    def __dlpack_device__(self) -> tuple[int, int]:
        return _tensor.CPU, 0

    def __dlpack__(
        self,
        *,
        stream: Any = None,
        max_version: tuple[int, int] | None = None,
        dl_device: tuple[int, int] | None = None,
        copy: bool | None = None,
    ) -> Any:
        if stream is not None or (dl_device is not None and tuple(dl_device) != (_tensor.CPU, 0)):
            raise BufferError("a DeviceImage becomes a tensor of the host alone: no stream, and the device (1, 0)")
        context = resolve_context(self.context)
        shared = _tensor.on_cpu(context.info().opencl_device)
        if copy is False and not shared:
            raise BufferError("this image is not in the host's memory and cannot be looked at without a copy")
        if copy or not shared:
            if not shared:
                logging.getLogger("clspeckle").info("the image is copied: OpenCL's device is no CPU")
            array = self.read()
        else:
            array = self._array_on(self._mapped())
        if max_version is None or not _tensor.TELLS_READ_ONLY:
            return array.__dlpack__()
        return array.__dlpack__(max_version=max_version)

    @property
    def __array_interface__(self) -> dict[str, Any]:
        """The memory of an image of a CPU's context, for packages that look at arrays by this protocol."""
        if self.context is None or not _tensor.on_cpu(self.context.info().opencl_device):
            raise AttributeError("the image is not in the host's memory, or looks at foreign memory without a context")
        view = self._mapped()
        return {**self._array_on(view).__array_interface__, "data": view}

    def _mapped(self) -> Any:
        """The image's bytes where they lie, after what its queue still does with them."""
        wait(self._pending())
        span = self.pitch_bytes * (self.height - 1) + self._row_bytes
        memory = self.memory if hasattr(self.memory, "int_ptr") else self
        return _tensor.mapped(self._queue(None), memory, self.offset_bytes, span)

    def _array_on(self, memory: Any) -> npt.NDArray[Any]:
        """Host memory that begins with the first pixel, as an array."""
        strides: tuple[int, ...] = (self.pitch_bytes, self.format.pixel_bytes, self.format.component_bytes)
        return np.ndarray(self.shape, self.dtype, memory, strides=strides[: len(self.shape)])

    @classmethod
    def wrap(
        cls,
        memory: Buffer | SupportsIntPtr | SupportsOpenCLArray | int,
        shape: Sequence[int] | None = None,
        dtype: npt.DTypeLike | None = None,
        *,
        offset_bytes: int = 0,
        pitch_bytes: int = 0,
        context: Context | None = None,
    ) -> DeviceImage:
        """A view of memory that exists; nothing is copied, and the memory is not owned (but kept alive if it can be).

        Args:
            memory: a :class:`Buffer`, a ``pyopencl.Buffer``, a ``pyopencl.array.Array`` (whose shape, dtype, offset and
                strides are taken over), or cl_mem as an integer, which must be a valid handle, as in C.
            shape: (height, width), or (height, width, channels). Not with an Array.
            dtype: as for the class. Not with an Array.
            offset_bytes: where the first pixel lies; a multiple of the size of a component.
            pitch_bytes: from one row to the next; 0: tightly packed.
            context: needed for :meth:`read` and :meth:`write` of memory that is not ours, unless they get a queue.

        Raises:
            InvalidFormatError: a dtype, or strides, that no image format describes.
        """
        if context is not None:
            context = resolve_context(context)
        self = cls.__new__(cls)
        if _interop.is_pyopencl_array(memory):
            if shape is not None or dtype is not None or offset_bytes or pitch_bytes:
                raise TypeError("a pyopencl.array.Array brings its own shape, dtype, offset and strides")
            self._wrap_array(memory, context)
            return self
        if shape is None or dtype is None:
            raise TypeError("shape and dtype are needed to look at memory as an image")
        if isinstance(memory, Buffer):
            memory._get()
            context = context or memory.context
        else:
            memory_pointer(memory, "memory")
        size, kind = _image_shape(shape), np.dtype(dtype)
        pixel = find_format(size, kind, "the image")
        offset, pitch = _check.integer(offset_bytes, "offset_bytes", 64), _check.integer(pitch_bytes, "pitch_bytes", 64)
        row = size[1] * pixel.pixel_bytes
        if pitch and pitch < row:
            raise errors.BufferTooSmallError(f"pitch_bytes is {pitch}, but a row of {size[1]} pixels takes {row} bytes")
        self._set_up(memory, size, kind, pixel, offset, pitch, context)
        return self

    def _wrap_array(self, array: Any, context: Context | None) -> None:
        shape, dtype, strides = tuple(int(n) for n in array.shape), np.dtype(array.dtype), array.strides
        pixel = find_format(shape, dtype, "the pyopencl array")
        if 0 in shape:
            raise errors.InvalidArgumentError(f"the pyopencl array has no pixels (shape {shape})")
        pitch = _pitch(shape, strides, pixel)
        if pitch is None:
            raise errors.InvalidFormatError(
                f"the pyopencl array of shape {shape} and dtype {dtype} has strides {tuple(strides)}; the pixels of a "
                "row must lie next to each other and the rows below each other: use "
                "DeviceImage.from_array(numpy.ascontiguousarray(array.map_to_host()))"
            )
        memory_pointer(array.base_data, "the pyopencl array's memory")
        self._set_up(array.base_data, shape, dtype, pixel, int(array.offset), pitch, context)
        self._array = array

    @property
    def width(self) -> int:
        """Pixels in a row."""
        return self.shape[1]

    @property
    def height(self) -> int:
        """Rows."""
        return self.shape[0]

    @property
    def int_ptr(self) -> int:
        """cl_mem as an integer."""
        return memory_pointer(self.memory, "the image's memory")

    @property
    def closed(self) -> bool:
        """True after :meth:`close`, of this image or of its :class:`Buffer`."""
        return isinstance(self.memory, Buffer) and self.memory.closed

    def close(self) -> None:
        """Gives memory of its own back; a view gives nothing back."""
        if self._owned is not None:
            self._owned.close()

    def __enter__(self) -> DeviceImage:
        return self

    def __exit__(self, *details: object) -> None:
        self.close()

    def struct(self) -> _library.ClspImage:
        """The C struct; valid while this image lives."""
        return _library.ClspImage(
            mem=self.int_ptr,
            offset_bytes=self.offset_bytes,
            pitch_bytes=self.pitch_bytes,
            width=self.width,
            height=self.height,
            format=self.format.code,
        )

    # The pixels of a row as bytes are what is copied; rows are apart by the pitch.

    @property
    def _row_bytes(self) -> int:
        return self.width * self.format.pixel_bytes

    @property
    def _packed(self) -> bool:
        return self.height == 1 or self.pitch_bytes == self._row_bytes

    def _queue(self, queue: QueueLike | None) -> int:
        if queue is None and self.context is None:
            if self._array is not None and self._array.queue is not None:
                queue = self._array.queue
            else:
                raise errors.InvalidArgumentError(
                    "this image looks at foreign memory without a context; give queue=, or context= to wrap()"
                )
        return queue_pointer(queue, self.context)

    def _pending(self) -> list[EventLike]:
        return [] if self._array is None else list(self._array.events)

    def _notify(self, event: Event) -> Event:
        if self._array is not None:
            _interop.notify(self._array, event.int_ptr)
        return event

    def write(self, array: Any, *, queue: QueueLike | None = None) -> None:
        """Copies an array of the image's shape and dtype to the image. Blocks."""
        for event in self.enqueue_write(array, queue=queue):
            event.wait()

    def enqueue_write(
        self,
        array: Any,
        *,
        queue: QueueLike | None = None,
        wait_for: Sequence[EventLike] | None = None,
    ) -> list[Event]:
        """Starts a copy of an array to the image; do not change the array before the events are complete.

        Returns:
            One event, or one for each row if the rows are not tightly packed (what lies between them is left alone).
        """
        source = _check.array(array, "array")
        if source.dtype != self.dtype:
            raise errors.InvalidFormatError(f"array has dtype {source.dtype}, expected {self.dtype}")
        if source.shape != self.shape:
            raise errors.InvalidArgumentError(f"array has shape {source.shape}, expected {self.shape}")
        rows = np.ascontiguousarray(source).reshape(self.height, -1).view(np.uint8)
        pointer, memory = self._queue(queue), self.int_ptr
        waiting = _interop.wait_list(wait_for, self._pending())
        pieces = [rows] if self._packed else list(rows)
        events = [
            enqueue(
                "clspBufferEnqueueWrite",
                pointer,
                piece.ctypes.data,
                piece.nbytes,
                memory,
                self.offset_bytes + index * self.pitch_bytes,
                waiting=waiting,
                kept=(rows, self.memory),
            )
            for index, piece in enumerate(pieces)
        ]
        for event in events:
            self._notify(event)
        return events

    def read(
        self,
        out: npt.NDArray[Any] | None = None,
        *,
        queue: QueueLike | None = None,
        wait_for: Sequence[EventLike] | None = None,
    ) -> npt.NDArray[Any]:
        """Copies the image to an array of its shape and dtype (a new one without `out`). Blocks."""
        if out is None:
            out = np.empty(self.shape, self.dtype)
        elif self.dtype.names is None:
            _check.host_output(out, "out", self.shape, (self.dtype,))
        pointer, waiting = self._queue(queue), _interop.wait_list(wait_for, self._pending())
        direct = self._packed and out.flags.c_contiguous
        span = (
            self._row_bytes if direct and self.height == 1 else self.pitch_bytes * (self.height - 1) + self._row_bytes
        )
        target = out if direct else np.empty(span, np.uint8)
        enqueue(
            "clspBufferEnqueueRead",
            pointer,
            self.int_ptr,
            self.offset_bytes,
            span,
            target.ctypes.data,
            waiting=waiting,
            kept=(target, self.memory),
        ).wait()
        if not direct:
            out[...] = self._array_on(target)
        return out

    def enqueue_read(
        self,
        out: npt.NDArray[Any],
        *,
        queue: QueueLike | None = None,
        wait_for: Sequence[EventLike] | None = None,
    ) -> Event:
        """Starts a copy of a tightly packed image into a C-contiguous array; its content is there once the event is."""
        _check.host_output(out, "out", self.shape, (self.dtype,))
        if not (self._packed and out.flags.c_contiguous):
            raise errors.InvalidArgumentError("enqueue_read() needs a tightly packed image and a C-contiguous array")
        return self._notify(
            enqueue(
                "clspBufferEnqueueRead",
                self._queue(queue),
                self.int_ptr,
                self.offset_bytes,
                out.nbytes,
                out.ctypes.data,
                waiting=_interop.wait_list(wait_for, self._pending()),
                kept=(out, self.memory),
            )
        )

    def enqueue_import(
        self,
        cl_image: SupportsIntPtr | int,
        first_channel: int = 0,
        *,
        queue: QueueLike | None = None,
        wait_for: Sequence[EventLike] | None = None,
    ) -> Event:
        """Starts a copy of a cl_image of the same size into the image, on the device.

        Args:
            cl_image: ``pyopencl.Image`` of two dimensions, or a cl_mem as an integer: floats, halves or fractions into
                float32, unsigned integers or fractions of as many bits into uint8, uint16 or uint32.
            first_channel: 0 (red) to 3 (alpha): that of the first component; the others follow it.

        Raises:
            InvalidFormatError: the two hold different things; the message says what goes together.
            UnsupportedError: the device has no images.
        """
        channel = _check.integer(first_channel, "first_channel")
        picture = _interop.handle(cl_image, "Image", "cl_image")
        image = ctypes.byref(self.struct())
        return self._enqueue("clspClImageEnqueueImport", picture, channel, image, queue=queue, wait_for=wait_for)

    def enqueue_export(
        self,
        cl_image: SupportsIntPtr | int,
        *,
        queue: QueueLike | None = None,
        wait_for: Sequence[EventLike] | None = None,
    ) -> Event:
        """Starts a copy of the image into a cl_image of the same size, from red on; other channels become 0, alpha 1.

        Arguments and errors as for :meth:`enqueue_import`.
        """
        picture = _interop.handle(cl_image, "Image", "cl_image")
        image = ctypes.byref(self.struct())
        return self._enqueue("clspClImageEnqueueExport", image, picture, queue=queue, wait_for=wait_for)

    def _enqueue(
        self, name: str, *arguments: Any, queue: QueueLike | None, wait_for: Sequence[EventLike] | None
    ) -> Event:
        if self.context is None:
            raise errors.InvalidArgumentError("this image looks at foreign memory; give context= to wrap()")
        waiting = _interop.wait_list(wait_for, self._pending())
        return self._notify(enqueue(name, self.context._get(), self._queue(queue), *arguments, waiting=waiting))

    def __array__(self, dtype: npt.DTypeLike | None = None, copy: bool | None = None) -> npt.NDArray[Any]:
        if copy is False:
            raise ValueError("an image in device memory cannot be looked at without a copy")
        result = self.read()
        return result if dtype is None else result.astype(dtype)

    def __reduce_ex__(self, protocol: Any) -> Any:
        raise TypeError(
            "a DeviceImage belongs to one process and one OpenCL device; it cannot be pickled or copied: read() gives "
            "its content"
        )

    def __repr__(self) -> str:
        state = "closed" if self.closed else "view" if self._owned is None else "open"
        return f"<clspeckle.DeviceImage {self.shape} {self.dtype} {state}>"

"""OpenCL objects of other packages (PyOpenCL's, and plain integer handles), and events, which mix with theirs.

PyOpenCL is never imported here: whoever holds one of its objects has imported it already.
"""

from __future__ import annotations

import atexit
import ctypes
import dataclasses
import sys
import weakref
from collections.abc import Sequence
from typing import Any, Protocol, Union

from . import _library, errors
from ._check import kind


class SupportsIntPtr(Protocol):
    """An object of PyOpenCL: a Context, Device, CommandQueue, Buffer or Event."""

    @property
    def int_ptr(self) -> int: ...


class SupportsOpenCLArray(Protocol):
    """A ``pyopencl.array.Array``."""

    @property
    def base_data(self) -> Any: ...

    @property
    def offset(self) -> int: ...

    @property
    def strides(self) -> Any: ...


class SupportsDLPack(Protocol):
    """A tensor of PyTorch, JAX, CuPy and others."""

    def __dlpack__(self, **options: Any) -> Any: ...

    def __dlpack_device__(self) -> tuple[int, int]: ...


OpenCLHandle = Union[SupportsIntPtr, int]
"""A PyOpenCL object, or the address of an OpenCL object as an integer."""


def is_pyopencl(value: Any, class_name: str) -> bool:
    """True for an object of pyopencl.<class_name>."""
    kind_of = getattr(sys.modules.get("pyopencl"), class_name, None)
    return kind_of is not None and isinstance(value, kind_of)


def is_pyopencl_array(value: Any) -> bool:
    """True for a pyopencl.array.Array."""
    kind_of = getattr(sys.modules.get("pyopencl.array"), "Array", None)
    return kind_of is not None and isinstance(value, kind_of)


def handle(value: Any, class_name: str, name: str) -> int:
    """The address of an OpenCL object that PyOpenCL calls `class_name`."""
    if is_pyopencl(value, class_name):
        pointer = value.int_ptr
    elif isinstance(value, int) and not isinstance(value, bool):
        pointer = value
    else:
        raise TypeError(f"{name} must be a pyopencl.{class_name} or an integer handle, got {kind(value)}")
    if not 0 < pointer < 2 ** (8 * ctypes.sizeof(ctypes.c_void_p)):
        raise errors.InvalidHandleError(f"{name} is {pointer}, which is no OpenCL handle")
    return int(pointer)


def _drop_event(pointer: int, kept: list[Any]) -> None:
    try:
        if kept:  # host memory that the command still reads or writes
            _library.call("clspEventWait", 1, ctypes.byref(ctypes.c_void_p(pointer)))
    except errors.ClspeckleError:
        pass  # a failed command no longer touches memory, and a finalizer has nobody to tell
    finally:
        kept.clear()
        _library.release("clspEventRelease", pointer)


# Events whose commands may still use host memory.
_pending: weakref.WeakSet[Event] = weakref.WeakSet()


@atexit.register
def _leave_memory_to_pending_copies() -> None:
    # A copy may run on while the interpreter goes down, or wait for an event that never comes: neither free its memory
    # nor wait for it.
    for event in list(_pending):
        for thing in event._kept:
            ctypes.pythonapi.Py_IncRef(ctypes.py_object(thing))


class Event:
    """The completion of an ``enqueue_...`` call. Goes into ``wait_for=`` lists, also together with PyOpenCL's events.

    Host arrays that a pending copy uses are kept alive; dropping such an event waits for the copy.

    Threads: may be used from any number of threads at once.
    """

    def __init__(self) -> None:
        raise TypeError("events come from enqueue_... methods")

    @classmethod
    def _from_pointer(cls, pointer: int | None, *kept: Any) -> Event:
        if not pointer:
            raise errors.InternalError("the library returned no event")
        self = cls.__new__(cls)
        self._pointer = pointer
        self._kept = list(kept)
        self._finalizer = weakref.finalize(self, _drop_event, pointer, self._kept)
        self._finalizer.atexit = False
        if kept:
            _pending.add(self)
        return self

    _pointer: int
    _kept: list[Any]
    _finalizer: weakref.finalize[Any, Any]

    @property
    def int_ptr(self) -> int:
        """cl_event as an integer (``pyopencl.Event.from_int_ptr``); owned by this object."""
        return self._pointer

    def wait(self) -> None:
        """Blocks until the command is complete.

        Raises:
            OpenCLError: the command failed.
        """
        _library.call("clspEventWait", 1, ctypes.byref(ctypes.c_void_p(self._pointer)))
        self._kept.clear()
        _pending.discard(self)

    def __reduce_ex__(self, protocol: Any) -> Any:
        raise TypeError("an Event belongs to one process and one OpenCL device; it cannot be pickled or copied")

    def __repr__(self) -> str:
        return f"<clspeckle.Event {self._pointer:#x}>"


EventLike = Union[Event, SupportsIntPtr, int]
"""An event of ours, of PyOpenCL, or an integer handle."""


@dataclasses.dataclass(frozen=True)
class WaitList:
    """The wait list of an Enqueue call."""

    count: int
    pointers: ctypes.Array[ctypes.c_void_p] | None
    kept: tuple[Any, ...]
    """The events themselves: PyOpenCL drops those of its arrays when it has seen them complete."""


def wait_list(events: Sequence[EventLike] | None, more: Sequence[EventLike] = ()) -> WaitList:
    """A wait list of the caller's events and more."""
    kept: list[EventLike] = list(more)
    if events is not None:
        if isinstance(events, (str, bytes)) or not hasattr(events, "__iter__"):
            raise TypeError(f"wait_for must be a list of events, got {kind(events)}")
        kept = [*events, *kept]
    if not kept:
        return WaitList(0, None, ())
    pointers = (ctypes.c_void_p * len(kept))()
    for index, event in enumerate(kept):
        if isinstance(event, Event):
            pointers[index] = event.int_ptr
        else:
            pointers[index] = handle(event, "Event", f"wait_for[{index}]")
    return WaitList(len(kept), pointers, tuple(kept))


def notify(array: Any, event: int) -> None:
    """Tells a pyopencl.array.Array of a command that uses it, so that PyOpenCL's next one waits for it."""
    array.add_event(sys.modules["pyopencl"].Event.from_int_ptr(event, True))


def enqueue(name: str, *arguments: Any, waiting: WaitList, kept: Sequence[Any] = ()) -> Event:
    """Calls an Enqueue function and returns its event."""
    event = ctypes.c_void_p()
    _library.call(name, *arguments, waiting.count, waiting.pointers, ctypes.byref(event))
    return Event._from_pointer(event.value, *kept)

"""OpenCL objects of other packages: PyOpenCL's, and plain integer handles.

PyOpenCL is never imported here: whoever holds one of its objects has imported it already.
"""

from __future__ import annotations

import ctypes
import dataclasses
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Protocol, Union

from . import errors
from ._check import kind

if TYPE_CHECKING:
    from .runtime import Event


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


OpenCLHandle = Union[SupportsIntPtr, int]
"""A PyOpenCL object, or the address of an OpenCL object as an integer."""

EventLike = Union["Event", SupportsIntPtr, int]
"""An event of ours, of PyOpenCL, or an integer handle."""


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


@dataclasses.dataclass(frozen=True)
class WaitList:
    """The wait list of an Enqueue call."""

    count: int
    pointers: ctypes.Array[ctypes.c_void_p] | None
    kept: tuple[Any, ...]
    """The events themselves: PyOpenCL drops those of its arrays when it has seen them complete."""


def wait_list(events: Sequence[EventLike] | None, more: Sequence[EventLike] = ()) -> WaitList:
    """A wait list of the caller's events and more."""
    from .runtime import Event

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

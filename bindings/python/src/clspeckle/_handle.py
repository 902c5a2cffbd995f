"""What all objects of the C library have in common: closing, locking, and a refusal to be pickled."""

from __future__ import annotations

import contextlib
import ctypes
import itertools
import threading
import weakref
from collections.abc import Iterator, Sequence
from types import TracebackType
from typing import Any, ClassVar, TypeVar

from . import _library, errors

Self = TypeVar("Self", bound="Handle")

_serial = itertools.count()


class Handle:
    """One reference of a C object, dropped by :meth:`close`, by leaving a ``with`` block, or with the Python object.

    At the end of the process nothing is released: the driver does that, and a daemon thread may still be in a call.
    """

    _c_name: ClassVar[str]
    """What the names of its C functions begin with, such as "clspPhase" of clspPhaseRelease()."""
    _pickle_advice: ClassVar[str] = "make it in the process that uses it"

    _pointer: int | None = None
    _finalizer: weakref.finalize[Any, Any] | None = None

    def _adopt(self, pointer: int | None) -> None:
        """Takes over a fresh reference."""
        if not pointer:
            raise errors.InternalError(f"the library returned no {type(self).__name__}")
        self._serial = next(_serial)
        self._lock = threading.RLock()
        self._finalizer = weakref.finalize(self, _library.release, f"{self._c_name}Release", pointer)
        self._finalizer.atexit = False
        self._pointer = pointer

    @property
    def closed(self) -> bool:
        """True after :meth:`close`."""
        return self._pointer is None

    def _get(self) -> int:
        """The C pointer; raises if this object was closed, or came here by fork()."""
        _library.refuse_fork()
        if self._pointer is None:
            raise errors.InvalidHandleError(f"this {type(self).__name__} is closed; make a new one")
        return self._pointer

    @property
    def handle(self) -> int:
        """The C pointer as an integer, for C code of one's own; still owned by this object."""
        return self._get()

    def close(self) -> None:
        """Drops the reference; further use raises :class:`~clspeckle.errors.InvalidHandleError`. May be called twice.

        Waits for a call that another thread is making on this object.
        """
        if self._pointer is None:
            return
        if _library.was_forked():  # the lock may be held by a thread that is not here
            self._pointer = None
            return
        with self._lock:
            if self._pointer is None:
                return
            self._pointer = None
            self._forget()
            if self._finalizer is not None:
                self._finalizer()

    def _forget(self) -> None:
        """Drops what else belongs to the object; called once by :meth:`close`."""

    def __enter__(self: Self) -> Self:
        self._get()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def __reduce_ex__(self, protocol: Any) -> Any:
        raise TypeError(
            f"a {type(self).__name__} belongs to one process and one OpenCL device; it cannot be pickled or copied: "
            f"{self._pickle_advice}"
        )

    def _state(self) -> str:
        return "closed" if self.closed else "open"

    def __repr__(self) -> str:
        return f"<clspeckle.{type(self).__name__} {self._state()}>"


@contextlib.contextmanager
def exclusive(*handles: Handle, also: Sequence[Handle | None] = ()) -> Iterator[None]:
    """Keeps other threads out of these objects; the order of locking is that of creation, so there is no deadlock.

    `handles` must be open. Those of `also` need not be: what the C library retains outlives its Python object.
    """
    for handle in handles:
        handle._get()
    ordered = {handle._serial: handle for handle in (*handles, *also) if handle is not None}
    with contextlib.ExitStack() as stack:
        for serial in sorted(ordered):
            stack.enter_context(ordered[serial]._lock)
        for handle in handles:
            handle._get()  # closed while this thread waited
        yield


def create(name: str, *arguments: Any) -> int | None:
    """Calls a ``...Create`` function and returns the new pointer."""
    pointer = ctypes.c_void_p()
    _library.call(name, *arguments, ctypes.byref(pointer))
    return pointer.value

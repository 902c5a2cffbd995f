"""The shared library: where it is found, how its functions are called, how its errors are raised.

The C headers themselves, name by name, are in ``_generated.py``. Calls release the GIL (they go through
:class:`ctypes.CDLL`).
"""

from __future__ import annotations

import ctypes
import dataclasses
import os
import signal
import sys
import threading
from ctypes import c_int32, c_uint32, c_uint64
from pathlib import Path
from typing import Any, Callable, TypeVar, cast

from . import errors
from ._generated import *  # noqa: F403
from ._generated import ABI_VERSION, CLSP_SUCCESS, FUNCTIONS, OTHER_FUNCTIONS, ClspErrorInfo

# These touch no OpenCL object; all others start the OpenCL runtime of this process.
_HOST_ONLY = {
    name for name in FUNCTIONS if name.endswith("Init") or name.startswith(("clspCapture", "clspProfile"))
} | {
    "clspGetLastError",
    "clspGetVersion",
    "clspFieldGridCompute",
    "clspDoeDesignSnapDirections",
    "clspDotLayoutCreate",
    "clspEffectGetCount",
    "clspEffectGetInfo",
    "clspEffectGetScenes",
    "clspEffectChangeTraits",
    "clspSensorDescFromProfile",
    "clspSensorMosaicFromBayer",
    "clspSensorDarkFrameFromCaptures",
}

_lock = threading.Lock()
_library: ctypes.CDLL | None = None
_opencl_started = False
_forked = False


def _after_fork_in_child() -> None:
    global _forked, _lock
    _lock = threading.Lock()  # another thread of the parent may have held it
    _forked = _forked or _opencl_started


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_after_fork_in_child)


def was_forked() -> bool:
    """True in a child of fork() whose parent had used OpenCL."""
    return _forked


def refuse_fork() -> None:
    """Raises :class:`InvalidStateError` in a child of fork() whose parent had used OpenCL.

    The threads of an OpenCL runtime do not survive a fork, and a call would hang for ever.
    """
    if _forked:
        raise errors.InvalidStateError(
            "this process was forked from one that had already used OpenCL, which does not survive a fork; start "
            'workers with the "spawn" or "forkserver" method (multiprocessing.get_context("spawn"), '
            'DataLoader(multiprocessing_context="spawn")), or use clspeckle in the workers alone'
        )


def file_names() -> tuple[str, ...]:
    """Names that the shared library may have on this platform, best first."""
    if sys.platform == "win32":
        return ("clspeckle.dll", "libclspeckle.dll")
    if sys.platform == "darwin":
        return (f"libclspeckle.{ABI_VERSION}.dylib", "libclspeckle.dylib")
    return (f"libclspeckle.so.{ABI_VERSION}", "libclspeckle.so")


def _more_rights() -> bool:
    """True in a process with more rights than who started it: what he says in the environment counts for nothing."""
    return hasattr(os, "geteuid") and (os.geteuid(), os.getegid()) != (os.getuid(), os.getgid())


def candidates() -> list[tuple[str, str]]:
    """Where the library is looked for, in order: (what the place is, path or name)."""
    chosen = os.environ.get("CLSPECKLE_LIBRARY")
    if chosen and not _more_rights():
        # Whoever names a file wants that file: nothing else is tried.
        return [("environment variable CLSPECKLE_LIBRARY", chosen)]
    package = Path(__file__).resolve().parent
    places = [("inside the package", package)]
    # bindings/python/src/clspeckle/_library.py of a source checkout
    parents = package.parents
    if len(parents) > 3 and (parents[3] / "capi" / "include" / "clspeckle" / "clspeckle.h").is_file():
        places.append(("build folder of the source checkout", parents[3] / "build" / "lib"))
    found = [(what, str(folder / name)) for what, folder in places for name in file_names()]
    return found + [("the system's loader", name) for name in file_names()]


def _load() -> ctypes.CDLL:
    tried: list[str] = []
    for what, path in candidates():
        if os.path.dirname(path) and not os.path.isfile(path):
            tried.append(f"{path} ({what}): no such file")
            continue
        try:
            loaded = ctypes.CDLL(path)
        except OSError as error:
            if "libOpenCL" in str(error):
                raise errors.LibraryLoadError(
                    f"{path} needs OpenCL's loader, which this system lacks ({error}); install it, with a driver. On "
                    "Debian: apt-get install ocl-icd-libopencl1 pocl-opencl-icd. One is the loader; the "
                    "other makes a device of the CPU; a GPU needs its vendor's driver instead"
                ) from None
            tried.append(f"{path} ({what}): {error}")
            continue
        _bind(loaded, path)
        return loaded
    raise errors.LibraryLoadError(
        "the shared library clspeckle was not found or did not load. Tried:\n  "
        + "\n  ".join(tried)
        + "\nInstall the package from a checkout (pip install .), or build the library (cmake -B build "
        "&& cmake --build build), or set CLSPECKLE_LIBRARY to its file."
    )


def _bind(loaded: ctypes.CDLL, path: str) -> None:
    def signature(name: str, restype: Any, argtypes: tuple[Any, ...]) -> Any:
        try:
            function = getattr(loaded, name)
        except AttributeError:
            raise errors.LibraryLoadError(
                f"{path} has no function {name}: it is not clspeckle, or older than this Python package; install the "
                "library and the package from the same release"
            ) from None
        function.restype = restype
        function.argtypes = argtypes
        return function

    get_version = signature("clspGetVersion", c_int32, FUNCTIONS["clspGetVersion"])
    abi = c_uint32()
    if get_version(None, None, None, ctypes.byref(abi)) != CLSP_SUCCESS or abi.value != ABI_VERSION:
        raise errors.LibraryLoadError(
            f"{path} has ABI number {abi.value}, this Python package needs {ABI_VERSION}; install the library and the "
            "package from the same release"
        )
    for name, argtypes in FUNCTIONS.items():
        signature(name, c_int32, argtypes)
    for name, (restype, argtypes) in OTHER_FUNCTIONS.items():
        signature(name, restype, argtypes)


def library() -> ctypes.CDLL:
    """The loaded library; loads it on the first call. May be called from any thread."""
    global _library
    if _library is None:
        with _lock:
            if _library is None:
                _library = _load()
    return _library


held_interrupts: list[KeyboardInterrupt] = []
"""Ctrl-C while Python was called back: nothing can be raised through C."""


def call(name: str, *arguments: Any) -> None:
    """Calls a function that returns a status, and raises its error, or Ctrl-C that came within."""
    global _opencl_started
    function = getattr(library(), name)
    if name in _HOST_ONLY:
        status: int = function(*arguments)
    else:
        refuse_fork()
        started, _opencl_started = _opencl_started, True
        status = function(*arguments) if started else _without_interrupts(function, arguments)
    if held_interrupts and threading.current_thread() is threading.main_thread():
        interrupt = held_interrupts[0]
        held_interrupts.clear()
        raise interrupt
    if status != CLSP_SUCCESS:
        raise last_error(status, name)


def _without_interrupts(function: Any, arguments: tuple[Any, ...]) -> int:
    """The first call that starts OpenCL.

    A driver's threads inherit which signals are blocked, and so does the linker that they run: otherwise Ctrl-C at a
    terminal ends the linker, too, and PoCL then ends the process.
    """
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        return int(function(*arguments))
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def last_error(status: int, name: str) -> errors.ClspeckleError:
    """The exception for the last failing call of this thread."""
    info = ClspErrorInfo()
    info.struct_size = ctypes.sizeof(info)
    if library().clspGetLastError(ctypes.byref(info)) != CLSP_SUCCESS or info.status != status:
        return errors.from_status(status, status_string(status), function=name)
    return errors.from_status(
        status,
        text(info.message),
        function=text(info.function) or name,
        opencl_code=info.opencl_code,
        build_log=text(info.build_log),
    )


def status_string(status: int) -> str:
    """The C name of a status, for example "CLSP_ERROR_NO_DEVICE"."""
    return text(library().clspStatusString(status))


def text(value: bytes | None) -> str:
    """A C string as text; drivers do not always write UTF-8."""
    return (value or b"").decode("utf-8", "replace")


Struct = TypeVar("Struct", bound=ctypes.Structure)
Record = TypeVar("Record")


def initialized(struct: type[Struct]) -> Struct:
    """A struct with its size and, if it describes something, the defaults that the C library writes."""
    value = struct()
    init = f"c{struct.__name__[1:]}Init"
    if init in FUNCTIONS:
        call(init, ctypes.byref(value), ctypes.sizeof(value))
    else:
        value.struct_size = ctypes.sizeof(value)
    return value


def fetched(struct: type[Struct], name: str, *arguments: Any) -> Struct:
    """The struct that a function writes, which is its last argument."""
    value = initialized(struct)
    call(name, *arguments, ctypes.byref(value))
    return value


def record(kind: Callable[..., Record], struct: ctypes.Structure, **others: Any) -> Record:
    """A dataclass from the struct's members of the same names; `others` are the fields that are not."""
    names = [field.name for field in dataclasses.fields(cast(Any, kind)) if field.name not in others]
    values = {name: getattr(struct, name) for name in names}
    return kind(**{name: text(v) if isinstance(v, bytes) else v for name, v in values.items()}, **others)


def words(prefix: str) -> dict[str, int]:
    """The constants CLSP_<prefix>_... by the rest of their names: "unit_mean" for CLSP_NORMALIZATION_UNIT_MEAN."""
    start = f"CLSP_{prefix}_"
    return {name[len(start) :].lower(): number for name, number in globals().items() if name.startswith(start)}


def text_of(name: str, *arguments: Any) -> str:
    """The text of a function that ends with (capacity, text, length)."""
    length = c_uint64()
    buffer = ctypes.create_string_buffer(1 << 16)  # what is longer is asked for twice
    call(name, *arguments, len(buffer), buffer, ctypes.byref(length))
    if length.value > len(buffer):
        buffer = ctypes.create_string_buffer(length.value)
        call(name, *arguments, len(buffer), buffer, None)
    return text(buffer.value)


def release(name: str, pointer: int) -> None:
    """Gives an object back; used by finalizers, so it never raises, and does nothing in a forked child."""
    if _library is not None and not _forked:
        getattr(_library, name)(pointer)

"""What failed calls raise: one exception class per status of the C interface.

Every class derives from :class:`ClspeckleError`, and also from the built-in exception that says the same, so that
``except ValueError`` or ``except MemoryError`` work as well. The checks that this binding makes on the host raise the
same classes as the C library does. An argument of an unfit Python type (``None`` for an image, text for a number) is a
plain :class:`TypeError`.

Exceptions can be pickled, so they travel between worker processes.
"""

from __future__ import annotations

from typing import Any, ClassVar

__all__ = [
    "BufferTooSmallError",
    "BuildError",
    "CancelledError",
    "ClspeckleError",
    "InputOutputError",
    "InternalError",
    "InvalidArgumentError",
    "InvalidDataError",
    "InvalidFormatError",
    "InvalidHandleError",
    "InvalidStateError",
    "InvalidStructSizeError",
    "LibraryLoadError",
    "NoDeviceError",
    "OpenCLError",
    "OutOfMemoryError",
    "OverlapError",
    "UnsupportedError",
    "WrongContextError",
]


class ClspeckleError(Exception):
    """Base of all errors of clSpeckle.

    Attributes:
        status: the CLSP_ERROR_* number of the class, 0 for errors that the C library knows nothing of.
        message: what was wrong, what was expected, what to do.
        function: name of the C function that failed; "" if the binding refused the argument itself.
        opencl_code: the OpenCL (or clFFT) error code behind it, 0 if none.
        build_log: the OpenCL compiler's output after :class:`BuildError`, else "".
    """

    status: ClassVar[int] = 0

    def __init__(self, message: str, *, function: str = "", opencl_code: int = 0, build_log: str = "") -> None:
        super().__init__(message)
        self.message = message
        self.function = function
        self.opencl_code = opencl_code
        self.build_log = build_log

    def __str__(self) -> str:
        text = f"{self.function}: {self.message}" if self.function else self.message
        if self.opencl_code:
            text += f" (OpenCL code {self.opencl_code})"
        if self.build_log:
            text += f"\n{self.build_log}"
        return text

    def __reduce__(self) -> tuple[Any, ...]:
        # BaseException would call the class with its positional arguments alone.
        return _rebuild, (type(self), self.message, self.function, self.opencl_code, self.build_log)


def _rebuild(
    kind: type[ClspeckleError], message: str, function: str, opencl_code: int, build_log: str
) -> ClspeckleError:
    return kind(message, function=function, opencl_code=opencl_code, build_log=build_log)


class InvalidArgumentError(ClspeckleError, ValueError):
    """An argument is missing, out of range, NaN, or contradicts another one."""

    status = -1


class InvalidStructSizeError(ClspeckleError, ValueError):
    """The library and the binding disagree about the size of a struct."""

    status = -2


class InvalidHandleError(ClspeckleError, ValueError):
    """An object was closed, or a handle is NULL or of another kind."""

    status = -3


class BufferTooSmallError(ClspeckleError, ValueError):
    """A buffer is too small for its image, or the pitch is smaller than a row."""

    status = -4


class WrongContextError(ClspeckleError, ValueError):
    """A buffer, queue, event or stage belongs to another context."""

    status = -5


class InvalidFormatError(ClspeckleError, TypeError, ValueError):
    """The dtype or the channels of an image are not ones that this argument takes."""

    status = -6


class OverlapError(ClspeckleError, ValueError):
    """Two images that must not share memory do."""

    status = -7


class InvalidDataError(ClspeckleError, ValueError):
    """Pixels are NaN, infinite, negative or beyond their range; the message says how many and where the first one
    is."""

    status = -8


class NoDeviceError(ClspeckleError, RuntimeError):
    """No OpenCL platform or no device that fits; the message lists what was seen and how to install one."""

    status = -9


class OpenCLError(ClspeckleError, RuntimeError):
    """An OpenCL call failed; see ``opencl_code``."""

    status = -10


class BuildError(ClspeckleError, RuntimeError):
    """An OpenCL program did not build; see ``build_log``."""

    status = -11


class OutOfMemoryError(ClspeckleError, MemoryError):
    """The device or the host has not enough memory."""

    status = -12


class UnsupportedError(ClspeckleError, NotImplementedError):
    """The device or the FFT library cannot do what was asked."""

    status = -13


class InputOutputError(ClspeckleError, OSError):
    """A file could not be read or written."""

    status = -14


class InvalidStateError(ClspeckleError, RuntimeError):
    """The object is not in a state for this call, for example no frame has been rendered yet."""

    status = -15


class InternalError(ClspeckleError, RuntimeError):
    """A fault of the library itself. Please report it with the message."""

    status = -16


class CancelledError(ClspeckleError, RuntimeError):
    """A progress function asked to stop."""

    status = -17


class LibraryLoadError(ClspeckleError, ImportError):
    """The shared library clspeckle was not found, did not load, or does not fit this binding."""


BY_STATUS: dict[int, type[ClspeckleError]] = {
    kind.status: kind for kind in ClspeckleError.__subclasses__() if kind is not LibraryLoadError
}
"""The exception class of each status of the C interface."""


def from_status(
    status: int, message: str, *, function: str = "", opencl_code: int = 0, build_log: str = ""
) -> ClspeckleError:
    """The exception for a status; :class:`ClspeckleError` itself for a status that this binding does not know."""
    kind = BY_STATUS.get(status, ClspeckleError)
    if kind is ClspeckleError:
        message = f"{message} (status {status})"
    return kind(message, function=function, opencl_code=opencl_code, build_log=build_log)

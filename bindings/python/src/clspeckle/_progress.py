"""Calls of the C library that take long: they tell how far they are, and can be stopped."""

from __future__ import annotations

import contextlib
import signal
import sys
import threading
from collections.abc import Iterator
from typing import Any, Callable, Union

from . import _library, errors

Progress = Callable[[str, float], Union[bool, None]]
"""Told what is being done and the fraction that is done; returning False cancels."""


class Call:
    """One call: keeps what C points to, and the first exception of the user's functions."""

    def __init__(self) -> None:
        self.thrown: BaseException | None = None
        self.interrupted = False
        self.kept: list[Any] = []

    def keep(self, value: Any) -> Any:
        self.kept.append(value)
        return value

    @contextlib.contextmanager
    def running(self) -> Iterator[None]:
        """Around the call: Ctrl-C cancels it, and what a function of the user's has raised comes out of it."""
        try:
            with self._interruptible():
                yield
        except errors.ClspeckleError as error:
            if self.thrown is not None:
                raise self.thrown from error
            raise

    @contextlib.contextmanager
    def _interruptible(self) -> Iterator[None]:
        # Python's own handler would raise within a callback before its first line, where nothing can catch it.
        handler = signal.getsignal(signal.SIGINT)
        if threading.current_thread() is not threading.main_thread() or not callable(handler):
            yield
            return

        def note(_number: int, _frame: Any) -> None:
            self.interrupted = True

        signal.signal(signal.SIGINT, note)
        try:
            yield
        finally:
            signal.signal(signal.SIGINT, handler)
            if self.interrupted:
                handler(signal.SIGINT, sys._getframe())

    def progress(self, report: Progress | None) -> Any:
        """For the struct's member `progress`."""
        if report is not None and not callable(report):
            raise TypeError(f"progress must be a function or None, got {type(report).__name__}")

        def tell(_data: int | None, what: bytes, fraction: float) -> int:
            try:
                if self.interrupted or self.thrown is not None:
                    return 0
                return 0 if report is not None and report(_library.text(what), fraction) is False else 1
            except BaseException as error:
                self.thrown = self.thrown or error
                return 0

        return self.keep(_library.PROGRESS_FUNCTION(tell))

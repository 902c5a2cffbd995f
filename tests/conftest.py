"""What every pytest suite shares: `reference`, `gap_check` and `thesis` on the path, one context for the session, a
table of measured errors.

Without an OpenCL device every test of the library fails: a suite that skips itself shows nothing.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).parents[1] / "validation")]
# What the user of this machine has measured is no part of the tests.
os.environ.setdefault("CLSPECKLE_TUNING", "off")

if TYPE_CHECKING:
    import clspeckle

_measured: dict[str, float] = {}


@pytest.fixture(scope="session")
def context() -> Iterator[clspeckle.Context]:
    """One context for all tests, so that programs and FFT plans are made once."""
    import clspeckle

    with clspeckle.Context() as made:
        yield made


@pytest.fixture
def measured(request: pytest.FixtureRequest) -> Callable[[str, float], None]:
    """Notes the largest value of a quantity of this test; all of them are printed after the run."""

    def note(what: str, value: float) -> None:
        key = f"{request.node.nodeid}: {what}"
        _measured[key] = max(float(value), _measured.get(key, 0.0))

    return note


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    if _measured:
        terminalreporter.section("measured (largest)")
        for key, value in _measured.items():
            terminalreporter.write_line(f"{value:9.3g}  {key}")

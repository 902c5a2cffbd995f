"""Long work shows on a terminal how far it is and how long the rest takes; elsewhere nothing of that is printed."""

from __future__ import annotations

import os
import pty
import re
import subprocess
from pathlib import Path

import numpy as np
import pytest


def on_terminal(program: Path, folder: Path, *arguments: str) -> str:
    """Standard error of a run whose standard error is a terminal."""
    terminal, end = pty.openpty()
    with subprocess.Popen([program, *arguments], cwd=folder, stdout=subprocess.DEVNULL, stderr=end) as process:
        os.close(end)
        shown = b""
        while True:
            try:
                piece = os.read(terminal, 4096)
            except OSError:  # the other end is closed
                break
            shown += piece
        os.close(terminal)
    assert process.returncode == 0, shown
    return shown.decode()


@pytest.mark.parametrize(
    ("arguments", "bar"),
    [
        (
            ["render", "ideal.npy", "-o", "out", "--frames", "8000", "--no-preview"],
            r"\d+/8000 frames, [\d.]+/s, \d+ s left",
        ),
        (["doe", "design", "-o", "cell", "--iterations", "1500"], r"\d+ %, \d+ s left: \w+"),
    ],
)
def test_time_that_is_left(program: Path, tmp_path: Path, arguments: list[str], bar: str) -> None:
    np.save(tmp_path / "ideal.npy", np.ones((48, 64), np.float32))
    assert re.search(bar, on_terminal(program, tmp_path, *arguments))


def test_no_bar_in_a_file(ok, tmp_path: Path) -> None:
    np.save(tmp_path / "ideal.npy", np.ones((48, 64), np.float32))
    assert ok("render", "ideal.npy", "-o", "out", "--frames", "20").err == ""

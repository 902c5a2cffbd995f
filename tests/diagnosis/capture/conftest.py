"""A small capture set in memory, and the command line program."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

ROOT = Path(__file__).resolve().parents[3]
PROGRAM = Path(os.environ.get("CLSPECKLE_CLI", ROOT / "build" / "bin" / "clspeckle"))
SHAPE = (16, 24)


@pytest.fixture
def codes() -> Callable[..., npt.NDArray[np.uint16]]:
    def draw(frames: int, mean: float, seed: int = 0) -> npt.NDArray[np.uint16]:
        values = np.random.default_rng(seed).normal(mean, 4.0, (frames, *SHAPE))
        return np.clip(np.rint(values), 0, 1023).astype(np.uint16)

    return draw


@pytest.fixture
def cli(tmp_path: Path) -> Callable[..., subprocess.CompletedProcess[str]]:
    """Runs the program in the test's own folder."""
    if not PROGRAM.is_file():
        pytest.fail(f"{PROGRAM} does not exist: build it, or name it in CLSPECKLE_CLI")

    def run(*arguments: object, code: int = 0) -> subprocess.CompletedProcess[str]:
        done = subprocess.run(
            [str(PROGRAM), *map(str, arguments)],
            cwd=tmp_path,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            check=False,
            text=True,
            timeout=300,
        )
        assert done.returncode == code, f"exit code {done.returncode}: {done.stdout}{done.stderr}"
        return done

    return run

"""Runs the command line program; CLSPECKLE_CLI names it, build/bin/clspeckle is the default."""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from cli_support import PROGRAM, Run


@pytest.fixture(scope="session")
def program() -> Path:
    if not PROGRAM.is_file():
        pytest.fail(f"{PROGRAM} does not exist: build it, or name it in CLSPECKLE_CLI")
    return PROGRAM


@pytest.fixture
def cli(program: Path, tmp_path: Path) -> Callable[..., Run]:
    """Runs the program in the test's own folder. A signal (a crash) fails the test at once."""

    def run(*arguments: object, **settings: object) -> Run:
        done = subprocess.run(
            [str(program), *map(str, arguments)],
            cwd=tmp_path,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            check=False,
            text=True,
            timeout=300,
            **settings,
        )
        assert done.returncode >= 0, f"ended by signal {-done.returncode}: {done.stderr}"
        return Run(done.returncode, done.stdout, done.stderr)

    return run


@pytest.fixture
def ok(cli: Callable[..., Run]) -> Callable[..., Run]:
    def run(*arguments: object, **settings: object) -> Run:
        result = cli(*arguments, **settings)
        assert result.code == 0, result.err
        return result

    return run


@pytest.fixture
def refused(cli: Callable[..., Run], tmp_path: Path) -> Callable[..., str]:
    """Runs something that must fail with exit code 1 and one message, and must leave nothing behind."""

    def run(*arguments: object, code: int = 1, **settings: object) -> str:
        before = set(tmp_path.rglob("*"))
        result = cli(*arguments, **settings)
        assert result.code == code, f"exit code {result.code}: {result.out}{result.err}"
        assert "clspeckle: " in result.err
        assert result.out == ""
        assert set(tmp_path.rglob("*")) == before, "something was left behind"
        return result.err

    return run


@pytest.fixture
def ideal(tmp_path: Path) -> Path:
    """A small ideal image: bright dots on a dim ground."""
    image = np.full((48, 64), 0.05, np.float32)
    image[4::8, 4::8] = 1.0
    path = tmp_path / "ideal.npy"
    np.save(path, image)
    return path

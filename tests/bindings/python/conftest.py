"""What the tests of the Python binding share. A missing device, compiler or PyOpenCL fails them; nothing is skipped."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

import clspeckle
from binding_common import ROOT, SHAPE, Runner


@pytest.fixture(scope="session")
def root() -> Path:
    """The checkout."""
    return ROOT


@pytest.fixture(scope="session")
def headers() -> Path:
    """The folder that is given to the C compiler with -I."""
    return ROOT / "capi" / "include"


@pytest.fixture(scope="session")
def context() -> Iterator[clspeckle.Context]:
    """One context for all tests, so that programs and FFT plans are made once."""
    with clspeckle.Context() as made:
        yield made


@pytest.fixture(scope="session")
def ideal() -> npt.NDArray[np.float32]:
    """An ideal image of 32 x 48 pixels; read-only, as anything that comes from elsewhere may be."""
    image = np.random.default_rng(5).random(SHAPE, np.float32) + np.float32(0.25)
    image.flags.writeable = False
    return image


@pytest.fixture
def stages(context: clspeckle.Context) -> tuple[clspeckle.Phase, clspeckle.Aperture, clspeckle.Sensor]:
    return (
        clspeckle.Phase(SHAPE, seed=3, context=context),
        clspeckle.Aperture(SHAPE, degree_of_polarization=0.5, context=context),
        clspeckle.Sensor(SHAPE, seed=3, context=context),
    )


@pytest.fixture
def camera(stages: tuple[clspeckle.Phase, clspeckle.Aperture, clspeckle.Sensor]) -> clspeckle.Pipeline:
    phase, aperture, sensor = stages
    return clspeckle.Pipeline(phase=phase, aperture=aperture, sensor=sensor)


@pytest.fixture
def run_python(tmp_path: Path) -> Runner:
    """Runs a program in an interpreter of its own, with the package and library that this one uses."""

    def run(program: str, *, package: Path | None = None, **environment: str) -> subprocess.CompletedProcess[str]:
        file = tmp_path / "program.py"
        file.write_text(program, encoding="utf-8")
        variables = dict(os.environ)
        variables["PYTHONPATH"] = str(package or Path(clspeckle.__file__).parent.parent)
        variables.update(environment)
        return subprocess.run(
            [sys.executable, str(file)],
            env=variables,
            cwd=tmp_path,
            capture_output=True,
            text=True,
            timeout=300,
            check=False,
        )

    return run

"""The same seed gives the same bytes in C, C++, Python and the command line program."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import numpy as np
import numpy.typing as npt

import clspeckle

WIDTH, HEIGHT, FRAMES, SEED = 320, 240, 10, 2024
BIN = Path(os.environ.get("CLSPECKLE_BIN", Path(__file__).parents[3] / "build" / "bin"))


def dots() -> npt.NDArray[np.float32]:
    """The image that examples/c/minimal.c draws: dots of 1.5 pixels standard deviation, 16 pixels apart, rows
    staggered."""
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    shift = np.where(y // 16 % 2 == 1, 8, 0)
    dx, dy = (x + shift) % 16 - 7.5, y % 16 - 7.5
    return np.exp(-(dx**2 + dy**2) / (2 * 1.5 * 1.5)).astype(np.float32)


def read_pgm(path: Path) -> npt.NDArray[np.uint16]:
    """A binary 16-bit PGM as the examples write it."""
    data = path.read_bytes()
    assert data.startswith(b"P5\n320 240\n1023\n")
    return np.frombuffer(data, ">u2", offset=len(b"P5\n320 240\n1023\n")).reshape(HEIGHT, WIDTH).astype(np.uint16)


def example(name: str, folder: Path) -> npt.NDArray[np.uint16]:
    """Frames of an example program."""
    subprocess.run([BIN / name, folder / name], check=True, capture_output=True)
    return np.stack([read_pgm(folder / f"{name}_{index}.pgm") for index in range(FRAMES)])


def test_all_four_agree(tmp_path: Path) -> None:
    ideal = dots()
    camera = clspeckle.Pipeline.from_parameters(
        ideal.shape, seed=SEED, degree_of_polarization=0.5, normalization="unit_mean", bits=10
    )
    python = np.stack([camera.render(ideal, frame_index=index) for index in range(FRAMES)])
    assert python.std() > 10, "an image without structure would agree with anything"
    assert not np.array_equal(python[0], python[1]), "the noise must be new in each frame"

    assert np.array_equal(example("minimal_c", tmp_path), python)
    assert np.array_equal(example("minimal_cpp", tmp_path), python)

    np.save(tmp_path / "ideal.npy", ideal)
    command = [BIN / "clspeckle", "render", tmp_path / "ideal.npy", "-o", tmp_path / "cli", "--frames", str(FRAMES)]
    command += ["--seed", str(SEED), "--degree-of-polarization", "0.5", "--normalization", "unit_mean"]
    command += ["--format", "npy-stack", "--no-preview"]
    subprocess.run(command, check=True, capture_output=True)
    (stack,) = (tmp_path / "cli").glob("*.npy")
    assert np.array_equal(np.load(stack), python)


def test_another_seed_gives_other_frames() -> None:
    ideal = dots()
    frames = [clspeckle.simulate(ideal, seed=seed) for seed in (SEED, SEED + 1)]
    assert np.mean(frames[0] != frames[1]) > 0.5

"""Effects, illumination and the sensor's profile give the same bytes in the program (C++ on C) and in Python."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

import clspeckle

SHAPE, SEED = (96, 128), 2024
BIN = Path(os.environ.get("CLSPECKLE_BIN", Path(__file__).parents[3] / "build" / "bin"))
# Of each stage, and all that remember the frame before; each one costs a set of programs.
EFFECTS: dict[str, dict[str, float]] = {
    "linewidth": {"dephasing_rad": 0.7},
    "depolarization": {"degree_of_polarization": 0.25},
    "surface_boiling": {"correlation_frames": 3.0},
    "airflow": {"rms_rad": 0.5, "scale_px": 8.0},
    "vibration": {"rms_px": 0.25},
    "defocus": {"waves": 0.5},
    "glare": {"fraction": 0.125, "scale_px": 5.0},
    "ambient_light": {"level_dn": 20.0},
    "lens_distortion": {"k1": 0.03},
    "shot_noise": {"dn_per_electron": 0.25},
    "prnu": {"sigma": 0.02},
    "image_lag": {"fraction": 0.1},
}


def ideal() -> npt.NDArray[np.float32]:
    """Dots of 2 pixels standard deviation, 16 pixels apart."""
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]]
    return np.exp(-((x % 16 - 7.5) ** 2 + (y % 16 - 7.5) ** 2) / 8).astype(np.float32)


def program(folder: Path, *arguments: object) -> npt.NDArray[Any]:
    np.save(folder / "ideal.npy", ideal())
    command: list[object] = [BIN / "clspeckle", "render", folder / "ideal.npy", "-o", folder / "out", "--frames", 3]
    command += ["--seed", SEED, "--refresh", "none", "--exposure-gain", 900, "--format", "npy-stack", "--no-preview"]
    subprocess.run([str(word) for word in [*command, *arguments]], check=True, capture_output=True)
    stack: npt.NDArray[Any] = np.load(folder / "out" / "frames.npy")
    return stack


def python(**parameters: Any) -> npt.NDArray[Any]:
    camera = clspeckle.Pipeline.from_parameters(SHAPE, seed=SEED, **{"exposure_gain_dn": 900, **parameters})
    return camera.render_batch([ideal()] * 3)


def test_effects_alone_and_together(tmp_path: Path) -> None:
    without = python()
    arguments: list[object] = []
    for effect, values in EFFECTS.items():
        text = f"{effect}:" + ",".join(f"{name}={value}" for name, value in values.items())
        arguments += ["--effect", text]
    together = python(effects=EFFECTS)
    assert not np.array_equal(together, without)
    np.testing.assert_array_equal(program(tmp_path, *arguments), together)
    for effect in ("airflow", "shot_noise"):
        folder = tmp_path / effect
        folder.mkdir()
        np.testing.assert_array_equal(program(folder, "--effect", effect), python(effects={effect: {}}))


def test_a_sensors_profile(tmp_path: Path) -> None:
    profile = clspeckle.Sensor.profile("OS04A10")
    given = {name: value for name, value in profile.items() if name not in ("shape", "exposure_gain_dn", "seed")}
    got = program(tmp_path, "--sensor-profile", "OS04A10")
    np.testing.assert_array_equal(got, python(**given))
    assert not np.array_equal(got, python())


def test_a_lamp(tmp_path: Path) -> None:
    camera = clspeckle.Pipeline.from_parameters(SHAPE, seed=SEED, exposure_gain_dn=900)
    expected = [camera.render(ideal(), illumination="incoherent") for _ in range(3)]
    np.testing.assert_array_equal(program(tmp_path, "--illumination", "incoherent"), expected)

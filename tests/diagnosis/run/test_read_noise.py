"""Read noise that neighbours in a row share is named, with its sign. The camera is a formula here."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import clspeckle
from diagnosed import diagnosed

BLACK_DN, READ_NOISE_DN, GAIN_DN = 64.0, 4.0, 0.25


def recorded(folder: Path, left: float) -> Path:
    """A part of each pixel's noise goes on to the next one in its row."""
    random = np.random.Generator(np.random.PCG64(20261201))
    frames, height, width = 12, 96, 120

    def codes(light_dn: float) -> np.ndarray:
        white = random.normal(size=(frames, height, width + 1))
        noise = READ_NOISE_DN * (white[..., 1:] + left * white[..., :-1]) / np.hypot(1.0, left)
        signal = GAIN_DN * random.poisson(light_dn / GAIN_DN, noise.shape)
        return np.rint(BLACK_DN + signal + noise).clip(0, 1023).astype(np.uint16)

    sequences = {
        "dark": clspeckle.CaptureSequence(codes(0.0), "dark"),
        "flat": clspeckle.CaptureSequence(codes(400.0), "flat"),
    }
    camera = {"bits": 10, "black_level_dn": BLACK_DN, "read_noise_dn": READ_NOISE_DN}
    clspeckle.Capture.from_arrays(sequences, camera=camera).write(folder)
    return folder


@pytest.mark.parametrize("left", [-0.06, 0.1])
def test_noise_that_goes_on_along_rows_is_named(tmp_path: Path, left: float) -> None:
    """138,000 codes in the dark: a correlation has a standard error of 0.0028, so that the weaker one is 20 of them."""
    report = diagnosed(recorded(tmp_path / "set", left))
    assert sorted(report["cause"]["effects"]) == ["correlated_read_noise", "shot_noise"]
    assert not report["shrink"]["residual_detected"]
    (first,) = (one for one in report["cause"]["ranking"] if one["effect"] == "correlated_read_noise")
    low, high = first["intervals"]["correlation"]
    truth = left / (1 + left**2)
    assert low < truth < high
    assert first["parameters"]["correlation"] == pytest.approx(truth, abs=0.015)


def test_white_noise_is_not(tmp_path: Path) -> None:
    report = diagnosed(recorded(tmp_path / "set", 0.0))
    assert report["cause"]["effects"] == ["shot_noise"]
    assert not report["shrink"]["residual_detected"]

"""Flats under one lamp at several exposure times show a bent response in their means. The camera is a formula here.

Codes are black + the response to x + read noise, x Poisson of what the time gives, times the gain.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import clspeckle
from diagnosed import diagnosed

BLACK_DN, READ_NOISE_DN, GAIN_DN, BITS = 60.0, 3.0, 0.3, 12
TIMES_MS = (1.0, 2.0, 3.5, 5.0, 6.5, 8.0)
DN_PER_MS = 440.0
FULL_DN = 2.0**BITS - 1.0
STEADY = (1.0,) * len(TIMES_MS)

Signal = np.ndarray[Any, np.dtype[np.float64]]


def linear(signal: Signal) -> Signal:
    return signal


def recorded(folder: Path, response: Callable[[Signal], Signal], lamp: tuple[float, ...]) -> Path:
    random = np.random.Generator(np.random.PCG64(20261130))
    shape = (6, 64, 80)

    def codes(light_dn: float) -> np.ndarray[Any, np.dtype[np.uint16]]:
        signal = GAIN_DN * random.poisson(light_dn / GAIN_DN, shape)
        noisy = BLACK_DN + response(signal) + READ_NOISE_DN * random.normal(size=shape)
        return np.rint(noisy).clip(0, 2**BITS - 1).astype(np.uint16)

    sequences = {"dark": clspeckle.CaptureSequence(codes(0.0), "dark")}
    for time, power in zip(TIMES_MS, lamp, strict=True):
        light_dn = DN_PER_MS * time * power
        sequences[f"flat_{time:g}ms"] = clspeckle.CaptureSequence(codes(light_dn), "flat", exposure_ms=time)
    camera = {"bits": BITS, "black_level_dn": BLACK_DN, "read_noise_dn": READ_NOISE_DN}
    clspeckle.Capture.from_arrays(sequences, camera=camera).write(folder)
    return folder


def parameter(report: dict[str, Any], effect: str, name: str) -> float:
    (value,) = (one["parameters"][name] for one in report["cause"]["ranking"] if one["effect"] == effect)
    return float(value)


def test_means_show_a_bent_response(tmp_path: Path) -> None:
    """The means are off a line by up to 1.1 %, ten times what a lamp is."""
    full = FULL_DN - BLACK_DN
    report = diagnosed(recorded(tmp_path / "set", lambda signal: full * (signal / full) ** 0.96, STEADY))
    assert sorted(report["cause"]["effects"]) == ["gamma", "shot_noise"]
    assert not report["shrink"]["residual_detected"]
    assert parameter(report, "gamma", "gamma") == pytest.approx(0.96, abs=0.002)
    assert parameter(report, "shot_noise", "dn_per_electron") == pytest.approx(GAIN_DN, rel=0.02)


@pytest.mark.parametrize("power", [1, 2, 3])
def test_means_show_the_power_of_a_response(tmp_path: Path, power: int) -> None:
    """At the brightest flat the signal lacks 8 %: of its square, or of a higher power."""
    part = DN_PER_MS * TIMES_MS[-1] / FULL_DN
    lacking = 0.08 / part**power
    report = diagnosed(recorded(tmp_path / "set", lambda s: s * (1 - lacking * (s / FULL_DN) ** power), STEADY))
    assert sorted(report["cause"]["effects"]) == ["nonlinearity", "shot_noise"]
    assert not report["shrink"]["residual_detected"]
    assert parameter(report, "nonlinearity", "power") == power
    assert parameter(report, "nonlinearity", "cubic") == pytest.approx(lacking, rel=0.1)
    assert parameter(report, "shot_noise", "dn_per_electron") == pytest.approx(GAIN_DN, rel=0.02)


def test_a_lamp_that_is_not_steady_is_no_response(tmp_path: Path) -> None:
    report = diagnosed(recorded(tmp_path / "set", linear, (1.0, 1.01, 0.99, 1.005, 0.995, 1.0)))
    assert report["cause"]["effects"] == ["shot_noise"]
    assert not report["shrink"]["residual_detected"]


def test_a_lamp_that_is_set_anew_is_no_response(tmp_path: Path) -> None:
    report = diagnosed(recorded(tmp_path / "set", linear, (1.0, 0.8, 0.5, 0.9, 0.6, 0.7)))
    assert report["cause"]["effects"] == ["shot_noise"]
    assert not report["shrink"]["residual_detected"]
    assert not any("signal_by_exposure" in place["statistic"] for place in report["where"])

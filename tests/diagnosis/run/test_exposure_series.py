"""Flats under one lamp at several exposure times show a bent response in their means. The camera is a formula here.

Codes are black + full (x / full)^gamma + read noise, x Poisson of what the time gives, times the gain.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import clspeckle
from diagnosed import diagnosed

BLACK_DN, READ_NOISE_DN, GAIN_DN, BITS = 60.0, 3.0, 0.3, 12
TIMES_MS = (1.0, 2.0, 3.5, 5.0, 6.5, 8.0)
DN_PER_MS = 440.0


def recorded(folder: Path, gamma: float, lamp: tuple[float, ...]) -> Path:
    random = np.random.Generator(np.random.PCG64(20261130))
    shape, full = (6, 64, 80), 2.0**BITS - 1.0 - BLACK_DN

    def codes(light_dn: float) -> np.ndarray[Any, np.dtype[np.uint16]]:
        signal = GAIN_DN * random.poisson(light_dn / GAIN_DN, shape)
        bent = full * (signal / full) ** gamma
        noisy = BLACK_DN + bent + READ_NOISE_DN * random.normal(size=shape)
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
    report = diagnosed(recorded(tmp_path / "set", 0.96, (1.0,) * len(TIMES_MS)))
    assert sorted(report["cause"]["effects"]) == ["gamma", "shot_noise"]
    assert not report["shrink"]["residual_detected"]
    assert parameter(report, "gamma", "gamma") == pytest.approx(0.96, abs=0.002)
    assert parameter(report, "shot_noise", "dn_per_electron") == pytest.approx(GAIN_DN, rel=0.02)


def test_a_lamp_that_is_not_steady_is_no_response(tmp_path: Path) -> None:
    report = diagnosed(recorded(tmp_path / "set", 1.0, (1.0, 1.01, 0.99, 1.005, 0.995, 1.0)))
    assert report["cause"]["effects"] == ["shot_noise"]
    assert not report["shrink"]["residual_detected"]


def test_a_lamp_that_is_set_anew_is_no_response(tmp_path: Path) -> None:
    report = diagnosed(recorded(tmp_path / "set", 1.0, (1.0, 0.8, 0.5, 0.9, 0.6, 0.7)))
    assert report["cause"]["effects"] == ["shot_noise"]
    assert not report["shrink"]["residual_detected"]
    assert not any("signal_by_exposure" in place["statistic"] for place in report["where"])

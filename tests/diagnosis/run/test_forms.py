"""Effects whose line in the catalogue leaves a choice are named in each of its forms, and a report says which it is."""

from __future__ import annotations

import dataclasses
import json
import os
import subprocess
from pathlib import Path
from typing import Any

import pytest
from gap_check.camera import draw_camera
from gap_check.generator import write_capture

ROOT = Path(__file__).resolve().parents[3]
PROGRAM = Path(os.environ.get("CLSPECKLE_CLI", ROOT / "build" / "bin" / "clspeckle"))


def first_of(tmp_path: Path, effect: str, reading: str, values: dict[str, float], seed: int) -> dict[str, Any]:
    """What the diagnosis says of the one effect, which it is to name alone."""
    camera = draw_camera(seed)
    camera = dataclasses.replace(camera, readings=dataclasses.replace(camera.readings, **{effect: reading}))
    write_capture(tmp_path, camera, {effect: values}, 40, seed)
    command = [PROGRAM, "diagnose", tmp_path, "--json", tmp_path / "report.json", "--quiet"]
    done = subprocess.run([str(word) for word in command], check=False, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    report = json.loads((tmp_path / "report.json").read_text())
    assert (report["cause"]["verdict"], report["cause"]["effects"]) == ("named", [effect])
    assert not report["shrink"]["residual_detected"]
    first: dict[str, Any] = report["cause"]["ranking"][0]
    return first


@pytest.mark.parametrize(
    ("law", "lags", "seed"),
    [
        ("gaussian", 1.4, 511),
        pytest.param("gaussian", 2.5, 512, marks=pytest.mark.nightly),
        pytest.param("exponential", 1.4, 513, marks=pytest.mark.nightly),
    ],
)
def test_the_law_of_motion_in_the_exposure(tmp_path: Path, law: str, lags: float, seed: int) -> None:
    """Gaussian ones were `unknown` from 1.4 on: no exponential one has their contrast and skewness."""
    first = first_of(tmp_path, "motion_decorrelation", law, {"lags": lags}, seed)
    assert first["parameters"]["correlation_law"] == (1 if law == "gaussian" else 0)
    low, high = first["intervals"]["lags"]
    assert 0.9 * lags < low < lags < high < 1.1 * lags


def test_what_the_simulator_made_is_told(tmp_path: Path) -> None:
    """The camera's own exposures, of a few patterns, have the law that they were made by."""
    options = [
        "--effect",
        "motion_decorrelation:lags=1.4,correlation_law=1",
        "--frames",
        "16",
        "--seed",
        "5",
        "--quiet",
    ]
    report = tmp_path / "report.json"
    for command in (["capture", "make", tmp_path / "set", *options], ["diagnose", tmp_path / "set", "--json", report]):
        done = subprocess.run([PROGRAM, *command], check=False, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
    cause = json.loads(report.read_text())["cause"]
    assert (cause["verdict"], cause["effects"]) == ("named", ["motion_decorrelation"])
    assert cause["ranking"][0]["parameters"]["correlation_law"] == 1
    low, high = cause["ranking"][0]["intervals"]["lags"]
    assert 1.2 < low < 1.4 < high < 1.6


def test_an_effect_alone_has_the_form_that_is_as_likely_in_its_interval(tmp_path: Path) -> None:
    """A weak bend of power 1 is nearly one of power 2, and no other effect is there to call for a second look."""
    report = tmp_path / "report.json"
    make = ["capture", "make", tmp_path / "set", "--effect", "nonlinearity:cubic=0.06,power=1", "--width", "128"]
    make += ["--height", "112", "--frames", "24", "--seed", "32", "--quiet"]
    for command in (make, ["diagnose", tmp_path / "set", "--json", report, "--quiet"]):
        done = subprocess.run([str(word) for word in (PROGRAM, *command)], check=False, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
    cause = json.loads(report.read_text())["cause"]
    assert (cause["verdict"], cause["effects"]) == ("named", ["nonlinearity"])
    assert cause["ranking"][0]["intervals"]["power"] == [1, 2]


@pytest.mark.nightly
def test_a_form_that_is_not_told_is_in_the_intervals(tmp_path: Path) -> None:
    """Beside depolarization 0.7 lags of the exponential law may be as good as the 1.4 of the Gaussian one."""
    seed = 702
    camera = draw_camera(seed)
    camera = dataclasses.replace(camera, readings=dataclasses.replace(camera.readings, motion_decorrelation="gaussian"))
    effects = {"motion_decorrelation": {"lags": 1.4}, "depolarization": {"degree_of_polarization": 0.3}}
    write_capture(tmp_path, camera, effects, 40, seed)
    command = [PROGRAM, "diagnose", tmp_path, "--json", tmp_path / "report.json", "--quiet"]
    done = subprocess.run([str(word) for word in command], check=False, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    cause = json.loads((tmp_path / "report.json").read_text())["cause"]
    assert sorted(cause["effects"]) == sorted(effects)
    (motion,) = (one for one in cause["ranking"] if one["effect"] == "motion_decorrelation")
    low, high = motion["intervals"]["lags"]
    if motion["intervals"]["correlation_law"] == [1, 1]:  # it is told
        assert 1.2 < low < 1.4 < high < 1.6
        return
    assert motion["intervals"]["correlation_law"] == [0, 1]
    assert low < 0.75
    assert high > 1.25


@pytest.mark.parametrize(("reading", "seed"), [("wind", 521), pytest.param("near", 522, marks=pytest.mark.nightly)])
def test_the_law_of_moving_air(tmp_path: Path, reading: str, seed: int) -> None:
    """A frozen screen that the wind carries along was `unknown`: no autoregression forgets so little at first.

    The generator's scale s is that of exp(-r^2 / (2 s^2)), sqrt(2) of it is ours; the wind goes s / 2 a frame.
    """
    scale = 6.0
    first = first_of(tmp_path, "airflow", reading, {"rms_rad": 0.5, "scale_px": scale}, seed)
    found = first["parameters"]
    assert found["correlation_law"] == (1 if reading == "wind" else 0)
    assert found["rms_rad"] == pytest.approx(0.5, rel=0.15)  # of one draw, whose cells of air are some hundreds
    assert found["scale_px"] == pytest.approx(2**0.5 * scale, rel=0.2)
    assert found["correlation_frames"] == pytest.approx(2**0.5 * 2 if reading == "wind" else 5, rel=0.2)

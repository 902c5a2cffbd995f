"""Effects whose line in the catalogue leaves a choice are named in each of its forms, and a report says which it is."""

from __future__ import annotations

import dataclasses
import json
import os
import subprocess
from pathlib import Path

import pytest
from withheld.camera import draw_camera
from withheld.generator import write_capture

ROOT = Path(__file__).resolve().parents[2]
PROGRAM = Path(os.environ.get("CLSPECKLE_CLI", ROOT / "build" / "bin" / "clspeckle"))


@pytest.mark.parametrize(
    ("law", "lags", "seed"), [("gaussian", 1.4, 511), ("gaussian", 2.5, 512), ("exponential", 1.4, 513)]
)
def test_the_law_of_motion_in_the_exposure(tmp_path: Path, law: str, lags: float, seed: int) -> None:
    """Gaussian ones were `unknown` from 1.4 on: no exponential one has their contrast and skewness."""
    camera = draw_camera(seed)
    camera = dataclasses.replace(camera, readings=dataclasses.replace(camera.readings, motion_decorrelation=law))
    write_capture(tmp_path, camera, {"motion_decorrelation": {"lags": lags}}, 40, seed)
    command = [PROGRAM, "diagnose", tmp_path, "--json", tmp_path / "report.json", "--quiet"]
    done = subprocess.run([str(word) for word in command], env={**os.environ, "CLSPECKLE_FFT": "fused"}, check=False,
                          capture_output=True, text=True)  # fmt: skip
    assert done.returncode == 0, done.stderr
    report = json.loads((tmp_path / "report.json").read_text())
    assert (report["cause"]["verdict"], report["cause"]["effects"]) == ("named", ["motion_decorrelation"])
    assert not report["shrink"]["residual_detected"]
    first = report["cause"]["ranking"][0]
    assert first["parameters"]["correlation_law"] == (1 if law == "gaussian" else 0)
    low, high = first["intervals"]["lags"]
    assert 0.9 * lags < low < lags < high < 1.1 * lags

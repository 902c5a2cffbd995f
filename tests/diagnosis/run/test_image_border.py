"""Cameras' images end where the world goes on; the simulated baseline is periodic, and its pupil as coarse as the
image's sides leave it.

120 frames of 128 x 96 pixels tell the two apart: without allowance for it the light between the dots alone is 8
standard deviations off (p below 1e-6 for either seed), and every capture of a real camera would be a gap. A null's p is
uniform: with both seeds and levels fixed the test is deterministic, and a change that draws other numbers fails it with
a probability of 4 %.
"""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path

import numpy as np
import pytest

from gap_check.camera import draw_camera, draw_lattice, stream
from gap_check.generator import write_capture

ROOT = Path(__file__).resolve().parents[3]
PROGRAM = Path(os.environ.get("CLSPECKLE_CLI", ROOT / "build" / "bin" / "clspeckle"))


def expect_no_gap(folder: Path) -> None:
    command = [PROGRAM, "diagnose", folder, "--json", folder / "report.json", "--quiet"]
    done = subprocess.run([str(word) for word in command], check=False, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    report = json.loads((folder / "report.json").read_text())
    assert report["cause"]["verdict"] == "none", [(w["statistic"], w["z"]) for w in report["where"][:3]]


@pytest.mark.parametrize("seed", [1, pytest.param(4, marks=pytest.mark.nightly)])
def test_an_image_that_ends_at_its_border_is_no_gap(tmp_path: Path, seed: int) -> None:
    camera = draw_camera(700 + seed, 128, 96, border_px=24, f_number=5.6)
    write_capture(tmp_path, camera, {}, 120, 70 + seed)
    expect_no_gap(tmp_path)


def test_dots_beyond_the_border_are_no_gap(tmp_path: Path) -> None:
    # Projectors overfill images: the lattice goes on. All dots are listed whose light reaches the image.
    rng = stream(5, "overfilled")
    lattice = draw_lattice(176, 144, rng)
    inside = np.all((lattice > 24 - 10) & (lattice < np.array([176, 144]) - 24 + 10), axis=1)
    camera = draw_camera(705, 128, 96, border_px=24, f_number=8.0, positions_px=lattice[inside])
    write_capture(tmp_path, camera, {}, 40, 75)
    expect_no_gap(tmp_path)

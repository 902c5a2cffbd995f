"""One frame cannot tell a fixed pattern from noise: the amount of either is no gap, what has a shape is."""

from __future__ import annotations

from pathlib import Path

import pytest

from diagnosed import diagnosed
from gap_check.camera import draw_camera
from gap_check.generator import write_capture


@pytest.mark.parametrize("effect", ["shot_noise", "prnu", "dsnu"])
def test_noise_passes_for_no_pattern(tmp_path: Path, effect: str) -> None:
    values = {"shot_noise": {"dn_per_electron": 0.2}, "prnu": {"sigma": 0.01}, "dsnu": {"sigma_dn": 2.0}}[effect]
    write_capture(tmp_path / "set", draw_camera(931, 128, 96), {effect: values}, 1, 932)
    report = diagnosed(tmp_path / "set")
    assert report["cause"]["verdict"] == "none"
    assert any("noise and fixed patterns cannot be told apart" in note for note in report["notes"])


def test_a_pattern_of_columns_is_still_named(tmp_path: Path) -> None:
    write_capture(tmp_path / "set", draw_camera(933, 128, 96), {"column_fpn": {"sigma_dn": 3.0}}, 1, 934)
    assert diagnosed(tmp_path / "set")["cause"]["effects"] == ["column_fpn"]

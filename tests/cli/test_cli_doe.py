"""Patterns of diffractive elements from the command line."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from cli_support import Run

SMALL = ["--texels", "96,64", "--beam-sigma-um", "60"]


@pytest.fixture
def design(tmp_path: Path) -> Path:
    """A binary grating of 16 pixels of 1.5 um."""
    phase = np.where(np.arange(16) < 8, 0, np.pi).astype(np.float32)[None, :].repeat(16, axis=0)
    np.save(tmp_path / "cell.npy", phase)
    about = {
        "pixel_pitch_m": 1.5e-6,
        "wavelength_m": 940e-9,
        "periodic": True,
        "levels": 2,
        "orders": [[1, 0, 1.0], [-1, 0, 1.0]],
    }
    (tmp_path / "cell.json").write_text(json.dumps(about))
    return tmp_path / "cell.npy"


def test_pattern_is_written_with_its_books(ok: Callable[..., Run], design: Path, tmp_path: Path) -> None:
    run = ok("doe", "pattern", design, "-o", tmp_path / "pattern.npy", *SMALL)
    texels = np.load(tmp_path / "pattern.npy")
    assert texels.shape == (64, 96)
    assert texels.dtype == np.float32
    assert np.all(texels >= 0)
    books = json.loads((tmp_path / "pattern.json").read_text())
    assert books["dots"] + books["zero_order"] + books["ghosts"] + books["scatter"] == pytest.approx(1, abs=1e-6)
    assert books["dots"] == pytest.approx(2 * (2 / np.pi) ** 2, rel=0.01)
    assert books["half_extent_x"] == pytest.approx(940e-9 / 3e-6)
    assert "--pattern-projection direction_cosines" in run.out
    assert "2 wanted dots" in run.out
    as_json = ok("doe", "pattern", design, "-o", tmp_path / "again", *SMALL, "--json").json()
    assert as_json == books
    assert np.array_equal(np.load(tmp_path / "again.npy"), texels)


def test_defects_reach_the_library(ok: Callable[..., Run], design: Path) -> None:
    deep = ok("doe", "inspect", design, *SMALL, "--depth-error", 0.1, "--json").json()
    assert deep["zero_order"] == pytest.approx(np.sin(0.05 * np.pi) ** 2, rel=0.01)
    noisy = ok("doe", "inspect", design, *SMALL, "--etch-noise-nm", 30, "--json").json()
    s = 2 * np.pi * 0.4507 * 30e-9 / 940e-9
    assert noisy["scatter"] == pytest.approx(1 - np.exp(-(s**2)), rel=1e-4)
    lines = ok("doe", "inspect", design, *SMALL, "--wavelength-nm", "910,970", "--line-power", "1,1", "--json").json()
    assert lines["zero_order"] == pytest.approx(np.mean(np.cos(np.pi / 2 * 940 / np.array([910, 970])) ** 2), rel=0.01)
    wide = ok("doe", "inspect", design, *SMALL, "--m-squared", 1.5, "--json").json()
    assert wide["divergence_x_rad"] == pytest.approx(1.5 * deep["divergence_x_rad"], rel=1e-4)


def test_figure_and_cache(ok: Callable[..., Run], design: Path, tmp_path: Path) -> None:
    options = [*SMALL, "--cache", tmp_path / "cache"]
    assert "computed" in ok("doe", "inspect", design, "-o", tmp_path / "figure.png", *options).out
    assert (tmp_path / "figure.png").read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
    assert "from the cache" in ok("doe", "inspect", design, *options, "--zoom", "0.03,0,0.01").out
    assert [path.suffix for path in (tmp_path / "cache").iterdir()] == [".doe"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--beam", "round"], "super_gaussian"),
        (["--beam", "image"], "--beam-image"),
        (["--depth-error", "2"], "relative_depth_error"),
        (["--doe-size-mm", "0.1"], "larger than the DOE"),
        (["--wavelength-nm", "940", "--line-power", "1,2"], "--line-power"),
        (["--half-extent", "1,2,3"], "--half-extent"),
        (["--zoom", "0,0,0"], "--zoom"),
    ],
)
def test_bad_options(refused: Callable[..., str], design: Path, arguments: list[str], message: str) -> None:
    assert message in refused("doe", "inspect", design, *arguments)


def test_bad_designs(refused: Callable[..., str], design: Path, tmp_path: Path) -> None:
    assert "overwrite" in refused("doe", "pattern", design, "-o", design)
    about = json.loads(design.with_suffix(".json").read_text())
    for change, message in (
        ({"pixel_pitch_m": None}, "pixel_pitch_m"),
        ({"levels": 3}, "3 levels"),
        ({"orders": [[0.5, 1]]}, "integers"),
        ({"orders": [[1]]}, "expected 2"),
        ({"orders": [[1000, 0]]}, "beyond 90 degrees"),
    ):
        design.with_suffix(".json").write_text(json.dumps(about | change))
        assert message in refused("doe", "inspect", design, *SMALL)
    design.with_suffix(".json").unlink()
    assert "cell.json" in refused("doe", "inspect", design, *SMALL)
    assert "nothing" in refused("doe", "inspect", tmp_path / "nothing.npy")

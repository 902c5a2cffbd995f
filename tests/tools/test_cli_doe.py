"""Patterns of diffractive elements from the command line."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from cli_support import Run
from PIL import Image, ImageCms

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


def test_light_of_a_beam_image_is_decoded_as_that_of_other_images(
    ok: Callable[..., Run], refused: Callable[..., str], design: Path, tmp_path: Path
) -> None:
    codes = np.rint(255 * np.linspace(0, 1, 32)[None, :].repeat(32, axis=0)).astype(np.uint8)
    v = codes / 255
    light = np.where(v <= 0.04045, v / 12.92, ((v + 0.055) / 1.055) ** 2.4)
    np.save(tmp_path / "light.npy", light.astype(np.float32))
    np.save(tmp_path / "codes.npy", codes)
    srgb = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    Image.fromarray(codes).save(tmp_path / "beam.png", icc_profile=srgb)

    def divergence(*options: object) -> tuple[float, str]:
        run = ok("doe", "inspect", design, "--texels", "96,64", "--beam-width-um", 200, *options, "--json")
        return run.json()["divergence_x_rad"], run.err

    expected, told = divergence("--beam-image", "light.npy")
    assert told == ""
    linear, _ = divergence("--beam-image", "codes.npy")
    assert abs(linear / expected - 1) > 0.01
    given, told = divergence("--beam-image", "beam.png")
    assert given == pytest.approx(expected, rel=1e-4)
    assert (
        "encoded for a screen (sRGB, says its ICC profile) and were decoded to linear light; --transfer linear" in told
    )
    given, told = divergence("--beam-image", "beam.png", "--transfer", "linear")
    assert given == linear and told == ""
    assert divergence("--beam-image", "codes.npy", "--transfer", "srgb")[0] == pytest.approx(expected, rel=1e-4)


def test_figure_and_cache(ok: Callable[..., Run], design: Path, tmp_path: Path) -> None:
    options = [*SMALL, "--cache", tmp_path / "cache"]
    assert "computed" in ok("doe", "inspect", design, "-o", tmp_path / "figure.png", *options).out
    assert (tmp_path / "figure.png").read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
    again = ok("doe", "inspect", design, "-o", tmp_path / "zoom.png", *options, "--zoom", "0.03,0,0.01")
    assert "from the cache" in again.out
    assert (tmp_path / "zoom.png").read_bytes() != (tmp_path / "figure.png").read_bytes()
    assert [path.suffix for path in (tmp_path / "cache").iterdir()] == [".doe"]


def test_the_figure_shows_where_the_light_is(ok: Callable[..., Run], design: Path, tmp_path: Path) -> None:
    """The two orders of the grating lie where the axis says, and the scales end at the brightest texel."""
    ok("doe", "inspect", design, "-o", tmp_path / "figure.png", "--texels", "900,900", "--beam-sigma-um", "60",
       "--half-extent", "0.1", "--zoom", "0.03,0,0.02")  # fmt: skip
    figure = np.asarray(Image.open(tmp_path / "figure.png")).astype(int)
    left, top, side, column = 110, 40, 900, 110 + 900 + 150
    bright = np.all(abs(figure - (253, 231, 37)) < 30, axis=2)
    panel = bright[top : top + side, left : left + side]
    x = np.flatnonzero(panel.any(axis=0)) + 0.5
    u = 0.940 / 24  # wavelength over the grating's period
    for order in (-u, u):
        assert abs(x - (order / 0.1 + 1) / 2 * side).min() < 3
    assert abs(abs((x / side * 2 - 1) * 0.1) - u).max() < 0.002
    zoomed = np.flatnonzero(bright[top : top + side, column + left : column + left + side].any(axis=0)) + 0.5
    assert abs(zoomed.mean() - ((u - 0.01) / 0.04) * side) < 9
    for origin in (left, column + left):
        bar = figure[top : top + side, origin + side + 32]
        np.testing.assert_allclose(bar[0], (253, 231, 37), atol=2)
        np.testing.assert_allclose(bar[-1], (68, 1, 84), atol=2)
        assert np.count_nonzero(np.all(figure[top + side :, origin : origin + side] == 0, axis=2)) > 500, "numbers"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--beam", "round"], "super_gaussian"),
        (["--beam", "image"], "--beam-image"),
        (["--depth-error", "2"], "--depth-error"),
        (["--seed", "-1"], "0 to 18446744073709551615"),
        (["--seed", str(2**64)], "--seed"),
        (["--levels", str(2**32 + 2)], "--levels"),
        (["--beam-sigma-um", "-250"], "expected a number from 0.1 to 1000000"),
        (["--refractive-index", "0"], "--refractive-index"),
        (["--beam", "flat_circle", "--beam-image", "cell.npy"], "no effect"),
        (["--transfer", "srgb"], "--transfer is of the numbers of --beam-image"),
        (["--beam-image", "cell.npy", "--transfer", "gamma"], "--transfer"),
        (["--doe-size-mm", "0.1"], "larger than the DOE"),
        (["--wavelength-nm", "940", "--line-power", "1,2"], "--line-power"),
        (["--half-extent", "1,2,3"], "--half-extent"),
        (["--zoom", "0,0,0", "-o", "new.png"], "--zoom"),
        (["--zoom", "0,0,inf", "-o", "new.png"], "--zoom"),
        (["--zoom", "5,5,0.1", "-o", "new.png"], "outside of the pattern"),
        (["--zoom", "0.6,0,0.1", "-o", "new.png"], "outside of the pattern"),
        (["--zoom", "0,0,0.1"], "-o FILE.png"),
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
        ({"levels": 2.5}, '"levels" is 2.5'),
        ({"levels": -2}, '"levels" is -2'),
        ({"levels": 2**32 + 2}, '"levels" is 4294967298'),
        ({"periodic": "false"}, "expected true or false"),
        ({"directions": [[0.1, 0.1]]}, 'has "directions", but'),
        ({"orders": [[0.5, 1]]}, "an integer"),
        ({"orders": [[1]]}, "two numbers"),
        ({"orders": [[1000, 0]]}, "beyond 90 degrees"),
    ):
        design.with_suffix(".json").write_text(json.dumps(about | change))
        assert message in refused("doe", "inspect", design, *SMALL)
    design.with_suffix(".json").write_text('{"pixel_pitch_m": 1e-6, "pixel_pitch_m": 2e-6}')
    assert "given twice" in refused("doe", "inspect", design, *SMALL)
    design.with_suffix(".json").write_text(json.dumps(about))
    np.save(tmp_path / "cell.npy", np.zeros((1, 16, 16), np.float32))
    assert "has 3 axes" in refused("doe", "inspect", design, *SMALL)
    np.save(tmp_path / "cell.npy", np.zeros((16, 16), np.uint16))
    assert "floating-point" in refused("doe", "inspect", design, *SMALL)
    np.save(tmp_path / "cell.npy", np.zeros((16, 16), np.float32))
    design.with_suffix(".json").unlink()
    assert "cell.json" in refused("doe", "inspect", design, *SMALL)
    assert "nothing" in refused("doe", "inspect", tmp_path / "nothing.npy")


def test_no_file_is_replaced_unasked(ok: Callable[..., Run], refused: Callable[..., str], design: Path) -> None:
    folder = design.parent
    for command in ("inspect", "pattern"):
        for output in ("cell.npy", "./cell.json", folder / "cell.npy"):
            message = refused("doe", command, "cell.npy", "-o", output, "--overwrite", *SMALL)
            assert "overwrite the input" in message
    (folder / "link.png").symlink_to("cell.npy")
    assert "overwrite the input" in refused("doe", "inspect", "cell.npy", "-o", "link.png", "--overwrite", *SMALL)
    for command, output in (("inspect", "figure.png"), ("pattern", "pattern.npy")):
        (folder / output).write_text("mine")
        assert "--overwrite" in refused("doe", command, "cell.npy", "-o", output, *SMALL, code=3)
        assert (folder / output).read_text() == "mine"
        ok("doe", command, "cell.npy", "-o", output, *SMALL, "--overwrite")
        assert (folder / output).stat().st_size > 1000
    for name in ("e.jpg", "e", "png", ".png", "e.png.bak"):
        message = refused("doe", "inspect", "cell.npy", "-o", name, "--overwrite", *SMALL)
        assert f"-o {name}: the file is written as .png" in message
        assert not (folder / name).exists()
    ok("doe", "inspect", "cell.npy", "-o", "e.PNG", *SMALL)
    (folder / "other.json").write_text("mine")
    assert "other.json exists" in refused("doe", "pattern", "cell.npy", "-o", "other", *SMALL, code=3)


@pytest.mark.parametrize("command", ["inspect", "pattern"])
def test_a_pipe_stays_what_it_is(refused: Callable[..., str], design: Path, command: str) -> None:
    """A device would be refused in the same place; none is risked here."""
    ending = ".npy" if command == "pattern" else ".png"
    pipe = design.parent / f"pipe{ending}"
    os.mkfifo(pipe)
    assert "is a pipe, a device" in refused("doe", command, design, "-o", pipe, *SMALL, "--overwrite", code=3)
    assert pipe.is_fifo()
    link = design.parent / f"link{ending}"
    link.symlink_to(pipe.name)
    assert "is a pipe, a device" in refused("doe", command, design, "-o", link, *SMALL, "--overwrite", code=3)
    assert pipe.is_fifo()

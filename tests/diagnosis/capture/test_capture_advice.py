"""What the messages on capture sets advise, done: each refusal's way out is taken, and the set is read."""

from __future__ import annotations

import json
import re
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import imageio.v3 as iio
import numpy as np
import pytest

Cli = Callable[..., subprocess.CompletedProcess[str]]
SHAPE = (16, 24)


@pytest.fixture
def description(tmp_path: Path) -> dict[str, Any]:
    (tmp_path / "set").mkdir()
    camera = {"width": SHAPE[1], "height": SHAPE[0], "bits": 10, "pixel_pitch_um": 2.9, "f_number": 5.6,
              "black_level_dn": 64, "read_noise_dn": 4}  # fmt: skip
    sequences = [{"name": "dark", "file": "dark.npy", "scene": "dark"}]
    return {"format": "clspeckle-capture", "version": 1, "camera": camera, "laser": {"wavelength_nm": 940.0},
            "sequences": sequences}  # fmt: skip


@pytest.fixture
def check(cli: Cli, tmp_path: Path, description: dict[str, Any]) -> Callable[..., str]:
    """Writes the description, and gives what the check says on the standard error stream."""

    def run(code: int = 0) -> str:
        (tmp_path / "set" / "capture.json").write_text(json.dumps(description))
        return cli("capture", "check", "set", code=code).stderr

    return run


def codes(level: float = 64.0, frames: int = 4) -> np.ndarray:
    return np.rint(np.random.default_rng(1).normal(level, 4, (frames, *SHAPE))).astype(np.uint16)


def test_a_folder_without_a_description(cli: Cli, tmp_path: Path) -> None:
    (tmp_path / "set").mkdir()
    np.save(tmp_path / "set" / "dark.npy", codes())
    command = re.search(r"`clspeckle (.*?)` writes a first one", cli("capture", "check", "set", code=1).stderr)
    assert command
    cli(*command[1].split())
    cli("capture", "check", "set")


@pytest.mark.parametrize(
    ("made", "advice"),
    [
        (lambda c: c.astype(np.float64), r"save (codes\.astype\(numpy\.uint16\))$"),
        (lambda c: c.astype(np.int32), r"save (codes\.astype\(numpy\.uint16\))$"),
    ],
    ids=["fractions", "int32"],
)
def test_arrays_of_another_type(check, tmp_path: Path, made: Any, advice: str) -> None:
    np.save(tmp_path / "set" / "dark.npy", made(codes()))
    found = re.search(advice, check(code=1).strip())
    assert found
    array = np.load(tmp_path / "set" / "dark.npy")
    np.save(tmp_path / "set" / "dark.npy", eval(found[1], {"codes": array, "numpy": np}))
    check()


def test_images_with_three_channels(check, tmp_path: Path, description: dict[str, Any]) -> None:
    description["sequences"][0]["file"] = "dark.png"
    description["camera"]["bits"] = 8
    image = np.stack([codes()[0].astype(np.uint8)] * 3, axis=-1)
    iio.imwrite(tmp_path / "set" / "dark.png", image)
    advice = re.search(r'name one: "file": "(\S+)"$', check(code=1).strip())
    assert advice
    description["sequences"][0]["file"] = advice[1]
    check()


def test_eight_bits(check, tmp_path: Path, description: dict[str, Any]) -> None:
    np.save(tmp_path / "set" / "dark.npy", codes().astype(np.uint8))
    assert "set /camera/bits to 8" in check(code=1)
    description["camera"]["bits"] = 8
    check()


def test_codes_above_the_top_code(check, tmp_path: Path, description: dict[str, Any]) -> None:
    some = codes()
    some[2, 3:6, 5:9] = 1700
    np.save(tmp_path / "set" / "dark.npy", some)
    told = check(code=1)
    assert "frame 2, pixel (5, 3): the code is 1700" in told
    assert "12 of 384 codes of the frame are above it, in rows 3 to 5 and columns 5 to 8, the largest is 1700" in told
    np.save(tmp_path / "set" / "dark.npy", codes(1700))
    bits = re.search(r"Set bits to (\d+) or more, or msb_aligned to true", check(code=1))
    assert bits
    description["camera"]["bits"] = int(bits[1])
    check()
    description["camera"].update(bits=10, msb_aligned=True)
    np.save(tmp_path / "set" / "dark.npy", codes() << 6)
    check()


def test_a_size_that_is_not_the_cameras(check, tmp_path: Path, description: dict[str, Any]) -> None:
    np.save(tmp_path / "set" / "dark.npy", codes())
    description["camera"].update(width=SHAPE[0], height=SHAPE[1])
    assert "the two sides are exchanged" in check(code=1)
    description["camera"]["width"] = 32
    size = re.search(r"has frames of (\d+) x (\d+) pixels .* correct /camera/width and /camera/height", check(code=1))
    assert size
    description["camera"].update(width=int(size[1]), height=int(size[2]))
    check()


def test_a_folder_of_two_formats(check, tmp_path: Path, description: dict[str, Any]) -> None:
    description["sequences"][0]["file"] = "frames [1]/dark"
    folder = tmp_path / "set" / "frames [1]" / "dark"
    folder.mkdir(parents=True)
    for i, frame in enumerate(codes()):
        iio.imwrite(folder / f"f{i}.png", frame)
        iio.imwrite(folder / f"f{i}.tif", frame)
    advice = re.search(r'for example "file": "(.*?)"', check(code=1))
    assert advice
    description["sequences"][0]["file"] = advice[1]
    check()


def test_files_elsewhere(check, tmp_path: Path, description: dict[str, Any]) -> None:
    np.save(tmp_path / "dark.npy", codes())
    description["sequences"][0]["file"] = "../dark.npy"
    assert "copy the file there, or link to it" in check(code=1)
    description["sequences"][0]["file"] = "dark.npy"
    (tmp_path / "set" / "dark.npy").symlink_to(tmp_path / "dark.npy")
    check()


def test_the_examples_of_a_description_can_be_pasted(check, tmp_path: Path, description: dict[str, Any]) -> None:
    np.save(tmp_path / "set" / "dark.npy", codes())
    np.save(tmp_path / "set" / "board.npy", codes(200))
    description["sequences"].append({"name": "board", "file": "board.npy", "scene": "board", "motion": "static"})
    del description["laser"]
    laser = re.search(r"expected an object, for example (\{.*?\}) with the values of your laser", check(code=1))
    assert laser
    description["laser"] = json.loads(laser[1])
    check()
    description["sequences"][1]["scene"] = "dots"
    assert "add it (the design of the pattern, or centroids of the mean image)" in check(code=1)
    description["dots"] = {}
    assert "/dots/sigma_px is missing" in check(code=1)
    description["dots"] = {"sigma_px": 2, "positions_px": []}
    assert "give at least one [x, y]" in check(code=1)
    description["dots"]["positions_px"] = [[10, 8]]
    check()
    entries, description["sequences"] = description["sequences"], []
    example = re.search(r"for example (\[\{.*\}\])", check(code=1))
    assert example
    description["sequences"] = json.loads(example[1])
    check()
    description["sequences"] = [*entries, {**entries[0], "name": "Dark"}]
    assert "give each sequence a name of its own" in check(code=1)


def test_more_bits_than_codes_use(check, tmp_path: Path, description: dict[str, Any]) -> None:
    np.save(tmp_path / "set" / "dark.npy", codes())
    np.save(tmp_path / "set" / "flat.npy", codes(800))
    description["sequences"].append({"name": "flat", "file": "flat.npy", "scene": "flat"})
    description["camera"]["bits"] = 14
    bits = re.search(r"set bits to (\d+), or saturation is overlooked", check())
    assert bits
    description["camera"]["bits"] = int(bits[1])
    assert check() == ""


def test_a_mask_that_is_none(check, tmp_path: Path, description: dict[str, Any]) -> None:
    np.save(tmp_path / "set" / "dark.npy", codes())
    description["sequences"][0]["mask"] = "mask.png"
    iio.imwrite(tmp_path / "set" / "mask.png", np.zeros((*SHAPE, 3), np.uint8))
    said = check(code=1)
    assert f"one 8-bit gray image of {SHAPE[1]} x {SHAPE[0]} pixels" in said and 'take "mask" out' in said
    iio.imwrite(tmp_path / "set" / "mask.png", np.zeros(SHAPE, np.uint8))
    assert "is 0 everywhere" in check(code=1)
    iio.imwrite(tmp_path / "set" / "mask.png", np.full(SHAPE, 255, np.uint8))
    check()
    del description["sequences"][0]["mask"]
    check()

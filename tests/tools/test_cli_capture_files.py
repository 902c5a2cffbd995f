"""Frames of a capture set whose files say more than their codes: the same set, whatever holds its frames."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import tifffile
from PIL import Image
from test_cli_diagnose import write_set

TIMES = {"metadata": {"axes": "TYX"}}


@pytest.fixture
def frames(tmp_path: Path) -> np.ndarray:
    return np.load(write_set(tmp_path / "set", 0) / "dark.npy")


def checked(ok, folder: Path, name: str) -> tuple[dict, str]:
    """What capture check says of the dark frames in another file."""
    capture = json.loads((folder / "capture.json").read_text())
    for sequence in capture["sequences"]:
        if sequence["name"] == "dark":
            sequence["file"] = name
    (folder / "capture.json").write_text(json.dumps(capture))
    result = ok("capture", "check", folder, "--json", "-")
    sequences = result.json()["sequences"]
    return next(one for one in sequences if one["name"] == "dark"), result.out + result.err


def same(given: dict, expected: dict) -> None:
    assert given["frames"] == expected["frames"] and given.get("mean_dn") == expected.get("mean_dn")


def test_a_stack_of_imagej_is_all_its_frames(ok, tmp_path: Path, frames: np.ndarray) -> None:
    expected, _ = checked(ok, tmp_path / "set", "dark.npy")
    tifffile.imwrite(tmp_path / "set" / "stack.tif", frames, imagej=True, truncate=True, **TIMES)
    same(checked(ok, tmp_path / "set", "stack.tif")[0], expected)


def test_white_is_zero(ok, tmp_path: Path, frames: np.ndarray) -> None:
    """By the file's word where that can be, else as stored; both are told."""
    expected, _ = checked(ok, tmp_path / "set", "dark.npy")
    tifffile.imwrite(tmp_path / "set" / "turned.tif", 65535 - frames, photometric="miniswhite")
    given, told = checked(ok, tmp_path / "set", "turned.tif")
    same(given, expected)
    assert "says that 0 is white: a code is 65535 minus the number that is stored" in told
    tifffile.imwrite(tmp_path / "set" / "marked.tif", frames, photometric="miniswhite")
    given, told = checked(ok, tmp_path / "set", "marked.tif")
    same(given, expected)
    assert "above 1023, the top code of 10 bits: they are taken as stored" in told


def test_lossy_compression_is_refused(refused, tmp_path: Path, frames: np.ndarray) -> None:
    Image.fromarray((frames[0] >> 2).astype(np.uint8)).save(tmp_path / "set" / "lossy.tif", compression="jpeg")
    capture = json.loads((tmp_path / "set" / "capture.json").read_text())
    capture["sequences"] = [s | {"file": "lossy.tif"} for s in capture["sequences"] if s["name"] == "dark"]
    (tmp_path / "set" / "capture.json").write_text(json.dumps(capture))
    assert "is compressed with losses, which change codes and their noise" in refused("capture", "check", "set")


def test_one_page_can_be_named(ok, refused, tmp_path: Path, frames: np.ndarray) -> None:
    with tifffile.TiffWriter(tmp_path / "set" / "odd.tif") as tif:
        tif.write(frames[0], photometric="minisblack")
        tif.write(np.ascontiguousarray(frames[1][::2, ::2]), photometric="minisblack")
    capture = json.loads((tmp_path / "set" / "capture.json").read_text())
    for sequence in capture["sequences"]:
        if sequence["name"] == "dark":
            sequence["file"] = "odd.tif"
    (tmp_path / "set" / "capture.json").write_text(json.dumps(capture))
    message = refused("capture", "check", "set")
    assert "holds images that are no series" in message and "odd.tif:page=0" in message
    assert checked(ok, tmp_path / "set", "odd.tif:page=0")[0]["frames"] == 1

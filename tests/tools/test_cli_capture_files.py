"""Frames of a capture set whose files say more than their codes: the same set, whatever holds its frames."""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path

import imageio.v3 as iio
import numpy as np
import pytest
import tifffile
from PIL import Image
from test_cli_diagnose import write_set

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "io"))
import test_variants_tiff  # noqa: E402

TIMES = {"metadata": {"axes": "TYX"}}


def described(folder: Path, name: str) -> None:
    """The dark frames are in another file."""
    capture = json.loads((folder / "capture.json").read_text())
    for sequence in capture["sequences"]:
        if sequence["name"] == "dark":
            sequence["file"] = name
    (folder / "capture.json").write_text(json.dumps(capture))


@pytest.fixture
def frames(tmp_path: Path) -> np.ndarray:
    return np.load(write_set(tmp_path / "set", 0) / "dark.npy")


def checked(ok, folder: Path, name: str) -> tuple[dict, str]:
    """What capture check says of the dark frames in another file."""
    described(folder, name)
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


WRITERS = {
    "planar.tif": lambda path, frame: tifffile.imwrite(
        path, np.stack([frame] * 3), photometric="rgb", planarconfig="separate"
    ),
    "chunky.tif": lambda path, frame: tifffile.imwrite(path, np.stack([frame] * 3, axis=-1), photometric="rgb"),
    "stack.npy": lambda path, frame: np.save(path, np.stack([frame] * 3, axis=-1)[None]),
}


@pytest.mark.parametrize("name", WRITERS)
def test_alike_channels_have_a_way_out(ok, refused, tmp_path: Path, frames: np.ndarray, name: str) -> None:
    np.save(tmp_path / "set" / "one.npy", frames[:1])
    expected, _ = checked(ok, tmp_path / "set", "one.npy")
    WRITERS[name](tmp_path / "set" / name, frames[0])
    described(tmp_path / "set", name)
    advice = re.search(r'name one: "file": "(\S+)"', refused("capture", "check", "set"))
    assert advice and advice[1] == f"{name}:R"
    same(checked(ok, tmp_path / "set", advice[1])[0], expected)


def test_a_channel_of_all_files_of_a_sequence(ok, refused, tmp_path: Path, frames: np.ndarray) -> None:
    expected, _ = checked(ok, tmp_path / "set", "dark.npy")
    folder = tmp_path / "set" / "colors"
    folder.mkdir()
    for i, frame in enumerate(frames):
        tifffile.imwrite(folder / f"d{i}.tif", np.stack([frame] * 3, axis=-1), photometric="rgb")
    described(tmp_path / "set", "colors")
    advice = re.search(r'name one: "file": "(\S+)"', refused("capture", "check", "set"))
    assert advice and advice[1] == "colors:R"
    for name in (advice[1], "colors/d*.tif:G"):
        same(checked(ok, tmp_path / "set", name)[0], expected)
    described(tmp_path / "set", "dark.npy:full_scale=1023")
    assert "take full_scale out" in refused("capture", "check", "set")
    checked(ok, tmp_path / "set", "dark.npy")


def test_one_word_for_files_of_several_sequences(ok, tmp_path: Path) -> None:
    folder = write_set(tmp_path / "all", 0)
    capture = json.loads((folder / "capture.json").read_text())
    for sequence in capture["sequences"]:
        codes = np.load(folder / sequence["file"])
        sequence["file"] = sequence["name"] + ".tif"
        tifffile.imwrite(folder / sequence["file"], 65535 - codes, photometric="miniswhite")
    (folder / "capture.json").write_text(json.dumps(capture))
    told = [w for w in ok("capture", "check", folder, "--json", "-").json()["warnings"] if "0 is white" in w["text"]]
    assert len(told) == 1 and len(capture["sequences"]) > 1
    assert f" and {len(capture['sequences']) - 1} more: its photometric" in told[0]["text"]


def test_packed_codes(ok, tmp_path: Path, frames: np.ndarray) -> None:
    """TIFF of 10 and 12 bits without padding."""
    expected, _ = checked(ok, tmp_path / "set", "dark.npy")
    for bits in (10, 12):
        packed = tmp_path / "set" / f"packed{bits}"
        packed.mkdir()
        for i, frame in enumerate(frames):
            (packed / f"{i}.tif").write_bytes(test_variants_tiff.packed_tiff(frame, bits))
        same(checked(ok, tmp_path / "set", packed.name)[0], expected)


def test_words_with_swapped_bytes(ok, refused, tmp_path: Path, frames: np.ndarray) -> None:
    expected, _ = checked(ok, tmp_path / "set", "dark.npy")
    array = frames + np.uint16(200)
    np.save(tmp_path / "set" / "swapped.npy", array.byteswap())
    described(tmp_path / "set", "swapped.npy")
    message = refused("capture", "check", "set")
    assert f"of {array[0].size} codes of the frame are above it, in rows 0 to" in message
    advice = re.search(r"If so, save (array\.byteswap\(\))", message)
    assert advice and "none needs more than 10 bits" in message
    saved = np.load(tmp_path / "set" / "swapped.npy")
    np.save(tmp_path / "set" / "again.npy", eval(advice[1], {"array": saved}))
    assert checked(ok, tmp_path / "set", "again.npy")[0]["mean_dn"] == pytest.approx(expected["mean_dn"] + 200)


def test_words_with_swapped_bytes_of_other_formats(ok, refused, tmp_path: Path, frames: np.ndarray) -> None:
    expected, _ = checked(ok, tmp_path / "set", "dark.npy")
    for ending, write in ((".png", iio.imwrite), (".tif", tifffile.imwrite)):
        folder = tmp_path / "set" / ending[1:]
        folder.mkdir()
        for i, frame in enumerate(frames + np.uint16(200)):
            write(folder / f"{i}{ending}", frame.byteswap())
        described(tmp_path / "set", folder.name)
        message = refused("capture", "check", "set")
        assert "none needs more than 10 bits. If so, save array.byteswap()" in message
        assert "Set bits" not in message
        for i, frame in enumerate(frames + np.uint16(200)):
            write(folder / f"{i}{ending}", iio.imread(folder / f"{i}{ending}").byteswap().reshape(frame.shape))
        given = checked(ok, tmp_path / "set", folder.name)[0]["mean_dn"]
        assert given == pytest.approx(expected["mean_dn"] + 200)


def test_one_image_of_several_is_a_mask(ok, refused, tmp_path: Path, frames: np.ndarray) -> None:
    masks = np.zeros((2, *frames.shape[1:]), np.uint8)
    masks[:, 3:9, 5:20] = 255
    tifffile.imwrite(tmp_path / "set" / "masks.tif", masks, photometric="minisblack")
    described(tmp_path / "set", "dark.npy")
    path = tmp_path / "set" / "capture.json"
    text = json.loads(path.read_text())
    text["sequences"][0]["mask"] = "masks.tif"
    path.write_text(json.dumps(text))
    message = refused("capture", "check", "set")
    named = re.search(r'for example "(masks.tif:page=0)"', message)
    assert named and "masks.tif: holds 2 images, a mask is one" in message
    text["sequences"][0]["mask"] = named[1]
    path.write_text(json.dumps(text))
    given = ok("capture", "check", "set", "--json", "-").json()["sequences"][0]
    assert given["masked_fraction"] == pytest.approx(1 - np.mean(masks[0] > 0))


def test_frames_behind(ok, refused, tmp_path: Path, frames: np.ndarray) -> None:
    """Height x width x frames."""
    expected, _ = checked(ok, tmp_path / "set", "dark.npy")
    array = np.ascontiguousarray(np.moveaxis(np.concatenate([frames] * 3), 0, -1))
    assert array.shape[2] > 4
    np.save(tmp_path / "set" / "behind.npy", array)
    described(tmp_path / "set", "behind.npy")
    advice = re.search(r"save (numpy\.moveaxis\(array, -1, 0\))", refused("capture", "check", "set"))
    assert advice
    np.save(tmp_path / "set" / "before.npy", eval(advice[1], {"array": array, "numpy": np}))
    assert checked(ok, tmp_path / "set", "before.npy")[0]["mean_dn"] == expected["mean_dn"]

"""Which files of a folder are one series: names that differ in numbers alone. Every advice that is given is
followed."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Callable
from pathlib import Path

import imageio.v3 as iio
import numpy as np
import pytest
from cli_support import Run

QUICK = ("--read-noise-dn", 0, "--no-preview", "--quiet")
SIZE = (12, 16)

FOLDERS = {
    "passes": [f"{name}{i:04}.png" for name in ("Albedo", "Depth", "Image") for i in (1, 2, 3)],
    "left and right": [f"{side}_{i}.png" for side in ("left", "right") for i in range(3)],
    "cameras by number": [f"cam{c}_{i:04}.png" for c in (0, 1) for i in range(5)],
    "number first": [f"{i:03}_{side}.png" for side in ("left", "right") for i in range(3)],
    "plain and suffixed": [f"{i:03}{end}.png" for end in ("", "_depth") for i in range(3)],
    "a stranger": [*(f"frame_{i}.png" for i in range(4)), "average.png"],
    "no numbers": ["left.png", "right.png"],
    "characters of patterns": [f"{name}[{i}].png" for name in ("a", "b") for i in range(2)],
}
SERIES = {
    "plain": [f"{i}.png" for i in range(12)],
    "signed": [f"{i}.png" for i in range(-11, 3)],
    "padded and not": ["frame_9.png", "frame_010.png", "frame_11.png"],
    "time stamps": [f"img_2024-05-01_12-{m:02}-{s:02}.png" for m, s in ((58, 7), (59, 8), (59, 40), (60, 7))],
    "one": ["picture.png"],
    "a constant number": [f"cam0_{i}_of_3.png" for i in range(3)],
}


def level(path: Path) -> float:
    return float(iio.imread(path).mean())


def filled(folder: Path, names: list[str]) -> None:
    """Image i, in the order of the list, has the gray value 10 (i + 1)."""
    folder.mkdir()
    for i, name in enumerate(names):
        iio.imwrite(folder / name, np.full(SIZE, 10 * (i + 1), np.uint8))


def rendered(ok: Callable[..., Run], tmp_path: Path, argument: str) -> int:
    shutil.rmtree(tmp_path / "out", ignore_errors=True)
    ok("render", argument, "-o", "out", *QUICK)
    return len(list((tmp_path / "out").glob("frame_*")))


@pytest.mark.parametrize("kind", FOLDERS)
def test_several_series_are_refused_and_each_can_be_named(ok, refused, tmp_path: Path, kind: str) -> None:
    filled(tmp_path / "many", FOLDERS[kind])
    message = refused("render", "many", "-o", "out")
    found = re.search(r"many: the names in the folder tell (\d) series: (.*); name one, for example '(.*?)'", message)
    assert found, message
    patterns = [re.sub(r" \(\d+ files\)", "", one) for one in found[2].split(", ")]
    assert len(patterns) == int(found[1])
    assert found[3] == f"many/{patterns[0]}"
    counts = [rendered(ok, tmp_path, f"many/{pattern}") for pattern in patterns]
    assert sum(counts) == len(FOLDERS[kind]), "the patterns share no file and leave none out"
    everything = re.search(r"all as one series with '(.*?)'", message)
    assert everything and rendered(ok, tmp_path, everything[1]) == len(FOLDERS[kind])


@pytest.mark.parametrize("kind", SERIES)
def test_one_series_is_taken_in_natural_order(ok, tmp_path: Path, kind: str) -> None:
    filled(tmp_path / "one", SERIES[kind])
    ok("render", "one", "-o", "out", *QUICK, "--save-ideal", "--format", "npy")
    levels = [float(np.load(path).mean()) for path in sorted((tmp_path / "out").glob("ideal_*.npy"))]
    assert len(levels) == len(SERIES[kind]) and levels == sorted(levels)


def test_a_gap_in_the_numbers_is_told(ok, tmp_path: Path) -> None:
    filled(tmp_path / "one", [f"f{i}.png" for i in (1, 2, 4, 5)])
    assert "one: 1 of the numbers 1 to 5 is missing, the first one is 3" in ok(
        "render", "one", "-o", "out", "--read-noise-dn", 0).err  # fmt: skip
    assert "missing" not in ok("render", "one/f2.png", "one/f4.png", "-o", "two", "--read-noise-dn", 0).err


def test_names_given_one_by_one_are_looked_at(ok, tmp_path: Path) -> None:
    """As a shell makes them of a pattern without quotes: previews are no frames, several series are told."""
    filled(tmp_path / "many", ["left_0.png", "right_0.png", "left_1.png", "preview_000000.png"])
    names = [f"many/{name}" for name in ("left_0.png", "left_1.png", "preview_000000.png", "right_0.png")]
    told = ok("render", *names, "-o", "out", "--read-noise-dn", 0).err
    assert "the names of the 3 files tell 2 series (left_*.png (2 files), right_0.png)" in told, told
    assert len(list((tmp_path / "out").glob("frame_*"))) == 3
    assert "series" not in ok("render", *names[:2], "-o", "two", "--read-noise-dn", 0).err


def test_names_in_another_order_than_they_count_are_told(ok, tmp_path: Path) -> None:
    exposures = ["frame_exp5_0.png", "frame_exp10_1.png", "frame_exp5_2.png", "frame_exp10_3.png"]
    filled(tmp_path / "one", exposures)
    words = "the last number of their names counts from 0 to 3, but they are taken in the order 0, 2, 1, 3"
    assert words in ok("render", "one", "-o", "out", "--read-noise-dn", 0).err
    capture_set(tmp_path / "one", "*.png")
    assert words in ok("capture", "check", "one").err
    # The advice: the number that counts comes first.
    filled(tmp_path / "two", [f"frame_{i}_exp{5 + 5 * (i % 2)}.png" for i in range(4)])
    assert "order" not in ok("render", "two", "-o", "out2", "--read-noise-dn", 0).err
    # A shell sorts 10 before 2.
    filled(tmp_path / "many", [f"f{i}.png" for i in range(9, 12)])
    assert (
        "taken in the order 10, 11, 9" in ok("render", "many/f10.png", "many/f11.png", "many/f9.png", "-o", "out3").err
    )
    assert "order" not in ok("render", "many", "-o", "out4").err


def capture_set(folder: Path, file: str, bits: int = 8) -> None:
    camera = {"width": SIZE[1], "height": SIZE[0], "bits": bits, "pixel_pitch_um": 3, "f_number": 4,
              "black_level_dn": 10, "read_noise_dn": 1}  # fmt: skip
    sequences = [{"name": "flat", "file": file, "scene": "flat"}]
    folder.joinpath("capture.json").write_text(
        json.dumps({"format": "clspeckle-capture", "version": 1, "camera": camera, "sequences": sequences})
    )


@pytest.mark.parametrize("kind", FOLDERS)
def test_a_capture_set_names_one_of_them(ok, refused, tmp_path: Path, kind: str) -> None:
    folder = tmp_path / "set"
    folder.mkdir()
    filled(folder / "flat", FOLDERS[kind])
    capture_set(folder, "flat/")
    message = refused("capture", "check", "set")
    found = re.search(r'tell \d series: .*; name one, for example "file": "(.*?)", or all .* "file": "(.*?)"', message)
    assert found, message
    capture_set(folder, found[1])
    few = json.loads(ok("capture", "check", "set", "--json", "-").out)["sequences"][0]["frames"]
    capture_set(folder, found[2])
    assert json.loads(ok("capture", "check", "set", "--json", "-").out)["sequences"][0]["frames"] == len(FOLDERS[kind])
    assert few < len(FOLDERS[kind])


def test_previews_are_no_frames(ok, tmp_path: Path) -> None:
    """What render leaves in a folder is a sequence of its frames: by the folder's name, by a pattern, by init."""
    np.save(tmp_path / "ideal.npy", np.ones(SIZE, np.float32))
    folder = tmp_path / "set"
    folder.mkdir()
    ok("render", "ideal.npy", "-o", "set/dark", "--bits", 8, "--frames", 4, "--exposure-gain", 20, "--black-level", 16,
        "--read-noise", 1, "--preview", "--quiet")  # fmt: skip
    assert len(list((folder / "dark").glob("preview_*.png"))) == 4
    for file in ("dark", "dark/*.png"):
        capture_set(folder, file)
        assert json.loads(ok("capture", "check", "set", "--json", "-").out)["sequences"][0]["frames"] == 4
    ok("capture", "init", "set", "--force")
    assert json.loads(ok("capture", "check", "set", "--json", "-").out)["sequences"][0]["frames"] == 4


def test_init_tells_the_series_of_a_folder(ok, refused, tmp_path: Path) -> None:
    folder = tmp_path / "set"
    folder.mkdir()
    filled(folder / "dark", FOLDERS["left and right"])
    message = refused("capture", "init", "set")
    assert "tell 2 series: left_*.png, right_*.png; move each into a folder of its own, such as dark_1" in message
    for i, side in enumerate(("left", "right")):
        (folder / f"dark_{i + 1}").mkdir()
        for path in (folder / "dark").glob(f"{side}_*"):
            path.rename(folder / f"dark_{i + 1}" / path.name)
    (folder / "dark").rmdir()
    ok("capture", "init", "set")
    described = json.loads((folder / "capture.json").read_text())
    assert [s["file"] for s in described["sequences"]] == ["dark_1", "dark_2"]


def test_files_that_differ_are_named(refused, tmp_path: Path) -> None:
    folder = tmp_path / "set"
    folder.mkdir()
    filled(folder / "flat", ["f0.png", "f1.png", "f2.png"])
    capture_set(folder, "flat")
    iio.imwrite(folder / "flat" / "f1.png", np.full((12, 20), 40, np.uint8))
    assert "f1.png: has frames of 20 x 12 pixels" in refused("capture", "check", "set")
    assert "f1.png" in refused("render", "set/flat", "-o", "out")
    iio.imwrite(folder / "flat" / "f1.png", np.full(SIZE, 40, np.uint8))
    iio.imwrite(folder / "flat" / "f2.png", np.full(SIZE, 40, np.uint16))
    assert "f2.png" in refused("render", "set/flat", "-o", "out")
    capture_set(folder, "flat", bits=10)
    assert "f0.png: has samples of type uint8" in refused("capture", "check", "set")


def test_images_in_folders_of_a_folder_are_pointed_out(
    ok: Callable[..., Run], refused: Callable[..., str], tmp_path: Path
) -> None:
    for i, name in enumerate(("left", "right")):
        (tmp_path / "set" / name).mkdir(parents=True)
        iio.imwrite(tmp_path / "set" / name / "1.png", np.full(SIZE, 60 + 60 * i, np.uint8))
    (tmp_path / "set" / "notes").mkdir()
    (tmp_path / "set" / "notes" / "a.txt").write_text("no image")
    message = refused("render", "set", "-o", "out", *QUICK)
    found = re.search(r"Folders in it do; name one: (\S+), (\S+)$", message.strip())
    assert found and "notes" not in message
    for folder in found.groups():
        ok("render", folder, "-o", "out", *QUICK)

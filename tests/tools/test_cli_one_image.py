"""Options that take one image: a file of several is refused with a name for one of them, which is read."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import cli_images as images
import numpy as np
import pytest
import tifffile

HEIGHT, WIDTH = 36, 48
Array = np.ndarray
RANDOM = np.random.default_rng(3)
# Codes, so that every format holds them; the mean of each is that of a gain.
STACK = np.stack([RANDOM.permuted(np.tile([0, 1, 2], HEIGHT * WIDTH // 3)).reshape(HEIGHT, WIDTH) for _ in range(6)])
STACK = STACK.astype(np.uint8)
# No number is scaled: what every option takes.
REAL = np.where(RANDOM.random(STACK.shape) < 0.05, 0, 1).astype(np.float32)
QUICK = ["--format", "npy", "--no-preview", "--read-noise", 0, "--exposure-gain", 200, "--seed", 1]

# What the option is of, and whether its numbers are light.
OPTIONS: dict[str, tuple[Callable[[str], list], bool]] = {
    "dark": (lambda file: ["render", "one.npy", "--dark-frame", file, *QUICK], False),
    "gain": (lambda file: ["render", "one.npy", "--gain-map", file, *QUICK], False),
    "pupil": (lambda file: ["render", "one.npy", "--pupil-image", file, *QUICK], True),
    "mask": (lambda file: ["render", "one.npy", "--refresh-mask", file, *QUICK], False),
    "material": (
        lambda file: ["render", "one.npy", "--material", file, "--materials", "materials.json", *QUICK],
        False,
    ),
    "pattern": (
        lambda file: ["render", "--depth", "wall.npy", "--pattern", file, "--pattern-half-extent-x", 0.6,
                      "--pattern-half-extent-y", 0.4, "--fx", 50, "--fy", 50, "--cx", 24, "--cy", 18, *QUICK],
        True,
    ),
}  # fmt: skip

SEVERAL: dict[str, Callable[[Path], object]] = {
    "pages.tif": lambda p: tifffile.imwrite(p, STACK, photometric="minisblack"),
    "hidden.tif": lambda p: tifffile.imwrite(p, STACK, photometric="minisblack", imagej=True),
    "stack.npy": lambda p: np.save(p, STACK),
    "behind.npy": lambda p: np.save(p, np.moveaxis(STACK, 0, -1)),
    "images.pgm": lambda p: p.write_bytes(b"".join(b"P5 48 36 255\n" + one.tobytes() for one in STACK)),
    "parts.exr": lambda p: images.exr_parts(
        p, **{f"p{i}": {"Y": one} for i, one in enumerate(REAL)}
    ),
}  # fmt: skip


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    np.save(tmp_path / "one.npy", np.full((HEIGHT, WIDTH), 0.5, np.float32))
    np.save(tmp_path / "wall.npy", np.full((HEIGHT, WIDTH), 1.0, np.float32))
    (tmp_path / "materials.json").write_text('{"materials": [{"id": 2}]}')
    return tmp_path


def named(message: str, file: str) -> str:
    """What a message says to name; files of the configuration are absolute."""
    found = re.search(rf"for example (\S*{file}:(?:page=\d+|\w+\.\w+))", message)
    assert found, message
    return found[1]


@pytest.mark.parametrize("file", SEVERAL)
@pytest.mark.parametrize("option", OPTIONS)
def test_one_of_several_must_be_named(ok, refused, folder: Path, option: str, file: str) -> None:
    arguments, light = OPTIONS[option]
    SEVERAL[file](folder / file)
    message = refused(*arguments(file), "-o", "none")
    assert f"{file}: " in message
    if file == "behind.npy":
        advice = re.search(r"save (numpy\.moveaxis\(array, -1, 0\))", message)
        assert advice, message
        np.save(folder / file, eval(advice[1], {"numpy": np, "array": np.load(folder / file)}))
        message = refused(*arguments(file), "-o", "none")
    ok(*arguments(named(message, file)), "-o", "given")
    np.save(folder / "first.npy", (REAL if file == "parts.exr" else STACK)[0])
    ok(*arguments("first.npy"), "-o", "expected")
    given, expected = (np.load(folder / out / "frame_000000.npy") for out in ("given", "expected"))
    np.testing.assert_array_equal(given, expected)
    if file not in ("behind.npy", "parts.exr"):
        name = file + ":page=5,full_scale=2"
        if light:
            ok(*arguments(name), "-o", "scaled")
        else:
            assert "dark frames and gains are the numbers that they are" in refused(*arguments(name), "-o", "none")


@pytest.mark.parametrize("file", [name for name in SEVERAL if name != "behind.npy"])
def test_a_mask_of_statistics(ok, refused, folder: Path, file: str) -> None:
    SEVERAL[file](folder / file)
    np.save(folder / "frame.npy", STACK[1])
    name = named(refused("statistics", "frame.npy", "--mask", file), file)
    given = ok("statistics", "frame.npy", "--mask", name, "--json").json()["frames"]
    mask = (REAL if file == "parts.exr" else STACK)[0] != 0
    assert given[0]["mean"] == pytest.approx(STACK[1][mask].mean())


@pytest.mark.parametrize("option", ["dark", "gain", "pupil", "mask"])
def test_colors_are_no_number(ok, refused, folder: Path, option: str) -> None:
    arguments, _ = OPTIONS[option]
    np.save(folder / "rgb.npy", np.moveaxis(STACK[:3], 0, -1))
    name = re.search(r"behind the file's name: (\S*rgb.npy:R)", refused(*arguments("rgb.npy"), "-o", "none"))
    assert name
    ok(*arguments(name[1]), "-o", "given")
    np.save(folder / "first.npy", STACK[0])
    ok(*arguments("first.npy"), "-o", "expected")
    given, expected = (np.load(folder / out / "frame_000000.npy") for out in ("given", "expected"))
    np.testing.assert_array_equal(given, expected)

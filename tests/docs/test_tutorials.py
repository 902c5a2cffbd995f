"""Each tutorial, followed to the letter, ends in its picture, within ten minutes."""

from __future__ import annotations

import struct
import subprocess

import followed
import pytest

# What a reader would see if it went right: words of what is printed.
TUTORIALS = {
    "engine": (),
    "training-data": ("12 pairs of (96, 128) uint16",),
    "camera-test": ("gain 0.2", "by shot_noise and prnu"),
    "optics": ("defocus 0.6",),
}
FOLDER = followed.ROOT / "docs" / "tutorials"


def test_there_are_no_others() -> None:
    assert {page.stem for page in FOLDER.glob("*.md")} - {"index"} == set(TUTORIALS)


@pytest.mark.parametrize("name", TUTORIALS)
def test_to_the_letter(name: str, checkout: followed.Checkout) -> None:
    printed = checkout.follow(FOLDER / f"{name}.md")
    assert all(words in printed for words in TUTORIALS[name]), printed
    picture = (checkout.folder / f"{name}.png").read_bytes()
    width, height = struct.unpack(">II", picture[16:24])
    assert picture.startswith(b"\x89PNG")
    assert width > 400
    assert height > 200
    assert (followed.ROOT / "docs" / "images" / "tutorials" / f"{name}.png").is_file()


def test_a_command_that_fails_is_an_error(checkout: followed.Checkout) -> None:
    page = checkout.folder / "page.md"
    page.write_text("```sh\nbuild/bin/clspeckle render no-such-file.png -o out\n```\n")
    with pytest.raises(AssertionError, match=r"no-such-file\.png"):
        checkout.follow(page)


def test_a_page_that_takes_too_long_is_an_error(checkout: followed.Checkout) -> None:
    page = checkout.folder / "page.md"
    page.write_text("```sh\nsleep 0.6\n```\n\n```sh\nsleep 0.6\n```\n")
    with pytest.raises(subprocess.TimeoutExpired):
        checkout.follow(page, within_s=1.0)

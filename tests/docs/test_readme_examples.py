"""Every Python block of the README and of docs/guide/frames.md is a file of examples/readme, word for word, and runs.

The README is followed to the letter: its commands, then its Python."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import followed
import pytest

ROOT = Path(__file__).parents[2]
EXAMPLES = sorted((ROOT / "examples" / "readme").glob("*.py"))


def blocks_of(page: str, language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", (ROOT / page).read_text(), re.DOTALL)


def test_every_block_is_an_example() -> None:
    blocks = [block for page in ("README.md", "docs/guide/frames.md") for block in blocks_of(page, "python")]
    assert len(blocks) >= 5
    assert sorted(blocks) == sorted(file.read_text() for file in EXAMPLES)


def run(name: str) -> str:
    file = ROOT / "examples" / "readme" / name
    return subprocess.run([sys.executable, file], check=True, capture_output=True, text=True, timeout=300).stdout


def test_the_readme_to_the_letter(checkout: followed.Checkout) -> None:
    out = checkout.follow(ROOT / "README.md")
    assert (checkout.folder / "report.html").is_file()
    assert len(list((checkout.folder / "frames").glob("frame_*.png"))) >= 1
    assert "named ('defocus',)" in out
    assert float(out.split("part of the gap gone:")[1]) > 0.7


def test_the_readme_is_short() -> None:
    assert len((ROOT / "README.md").read_text().split()) < 900


def test_motion() -> None:
    kept = {line.split()[0]: float(line.split()[-1]) for line in run("motion.py").splitlines()}
    # 0.2 mm of 0.5 mm leave R(0.375)^2 = 0.85 of the intensity's correlation (phase.h); noise takes some of it away.
    assert 0.5 < kept["wall"] < 0.9
    assert abs(kept["skin"]) < 0.2


def test_effects() -> None:
    assert len(run("effects.py").splitlines()) >= 30


def test_the_whole_camera() -> None:
    first, *_, lamp, dark = (int(word) for word in run("camera.py").split()[1:])
    assert first > 200 and lamp > 200
    assert 64 < dark < 80, "the black level and what the noise adds"


@pytest.mark.parametrize("file", EXAMPLES, ids=lambda file: file.name)
def test_lines_are_short_enough_to_read(file: Path) -> None:
    assert all(len(line) <= 120 for line in file.read_text().splitlines())

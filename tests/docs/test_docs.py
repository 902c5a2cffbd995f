"""What the README and the docs show is what the project holds: code, options, files."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
BIN = Path(os.environ.get("CLSPECKLE_BIN", ROOT / "build" / "bin"))
FRAMES = (ROOT / "docs" / "guide" / "frames.md").read_text()
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]


@pytest.mark.parametrize(("language", "file"), [("c", "readme.c"), ("python", "readme.py")])
def test_first_code_of_a_language_is_the_example(language: str, file: str) -> None:
    blocks = re.findall(rf"```{language}\n(.*?)```", FRAMES, re.DOTALL)
    assert blocks, f"docs/guide/frames.md shows no {language} code"
    assert blocks[0] == (ROOT / "examples" / "readme" / file).read_text()


def test_c_and_python_agree() -> None:
    """The same camera with the same seed: both print the same codes."""
    c = subprocess.run([BIN / "example_readme"], check=True, capture_output=True, text=True).stdout
    python = subprocess.run(
        [sys.executable, ROOT / "examples" / "readme" / "readme.py"], check=True, capture_output=True, text=True
    ).stdout
    assert c == python
    assert len(c.split(":")[1].split()) == 3


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page: Path) -> None:
    links = re.findall(r"\]\((?!https?:|#)([^)#]+)", page.read_text())
    missing = [link for link in links if not (page.parent / link).exists()]
    assert not missing


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_options_of_the_program_exist(page: Path) -> None:
    """Every `clspeckle COMMAND --option` in a code line or code span is an option of that command."""
    for line in re.findall(r"clspeckle (render|statistics|devices|tune)(?![\w-])([^\n`]*)", page.read_text()):
        command, rest = line
        text = subprocess.run([BIN / "clspeckle", command, "--help"], check=True, capture_output=True, text=True).stdout
        for option in re.findall(r"(?<!\S)--[a-z][a-z0-9-]*", rest):
            assert option in text, f"{page.name}: clspeckle {command} has no {option}"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_c_names_exist(page: Path) -> None:
    headers = "".join(header.read_text() for header in (ROOT / "capi" / "include" / "clspeckle").glob("*.h"))
    names = set(re.findall(r"\bclsp[A-Z]\w+|\bCLSP_[A-Z0-9_]+\b|\bClsp[A-Z]\w+", page.read_text()))
    cmake = (ROOT / "CMakeLists.txt").read_text() + (ROOT / "scripts" / "test.sh").read_text()
    unknown = {name for name in names if name not in headers and name not in cmake and not name.endswith("_")}
    assert not unknown

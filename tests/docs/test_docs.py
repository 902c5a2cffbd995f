"""What the README and the docs show is what the project holds: code, options, files."""

from __future__ import annotations

import functools
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
BIN = Path(os.environ.get("CLSPECKLE_BIN", ROOT / "build" / "bin"))
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]


@pytest.mark.parametrize(
    ("page", "language", "file"),
    [
        ("docs/guide/frames.md", "c", "readme.c"),
        ("docs/guide/frames.md", "python", "readme.py"),
        ("README.md", "c", "first.c"),
        ("docs/tutorials/engine.md", "cpp", "first.cpp"),
    ],
)
def test_first_code_of_a_language_is_the_example(page: str, language: str, file: str) -> None:
    blocks = re.findall(rf"```{language}\n(.*?)```", (ROOT / page).read_text(), re.DOTALL)
    assert blocks, f"{page} shows no {language} code"
    assert blocks[0] == (ROOT / "examples" / "readme" / file).read_text()


def printed(*command: str | Path) -> str:
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


FIRST = """import clspeckle, numpy as np
print("first codes:", *clspeckle.simulate(np.ones((480, 640), np.float32), f_number=5.6, seed=7)[0, :3])"""


@pytest.mark.parametrize(
    ("programs", "python"),
    [
        (["example_readme"], [ROOT / "examples" / "readme" / "readme.py"]),
        (["example_first", "example_first_cpp"], ["-c", FIRST]),
    ],
)
def test_c_and_python_agree(programs: list[str], python: list[str | Path]) -> None:
    """The same camera with the same seed: all print the same codes."""
    expected = printed(sys.executable, *python)
    assert len(set(expected.split(":")[1].split())) == 3
    for program in programs:
        assert printed(BIN / program) == expected, program


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page: Path) -> None:
    links = re.findall(r"\]\((?!https?:|#)([^)#]+)", page.read_text())
    missing = [link for link in links if not (page.parent / link).exists()]
    assert not missing
    outside = [link for link in links if not (page.parent / link).resolve().is_relative_to(ROOT.resolve())]
    assert not outside, "only the checkout is there for all who read"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_options_of_the_program_exist(page: Path) -> None:
    """Every `clspeckle COMMAND --option` in a code line or code span is an option of that command."""
    text = re.sub(r"\\\n\s+", " ", page.read_text())
    for words in re.findall(r"\bclspeckle((?: [^\s`|>;&#]+)+)", text):
        command = command_of(words.split())
        for option in re.findall(r"(?<!\S)--[a-z][a-z0-9-]*", words) if command else []:
            assert re.search(rf"{option}\b(?!-)", help_of(*command)), f"clspeckle{words}: no {option}"


@functools.cache
def help_of(*command: str) -> str:
    return subprocess.run([BIN / "clspeckle", *command, "--help"], check=True, capture_output=True, text=True).stdout


def command_of(words: list[str]) -> tuple[str, ...]:
    """The longest beginning of the words that is a command."""
    found: tuple[str, ...] = ()
    for word in words:
        if not re.search(rf"^  {re.escape(word)}  ", help_of(*found).partition("Subcommands:")[2], re.MULTILINE):
            break
        found = (*found, word)
    return found


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_c_names_exist(page: Path) -> None:
    headers = "".join(header.read_text() for header in (ROOT / "capi" / "include" / "clspeckle").glob("*.h"))
    names = set(re.findall(r"\bclsp[A-Z]\w+|\bCLSP_[A-Z0-9_]+\b|\bClsp[A-Z]\w+", page.read_text()))
    cmake = (ROOT / "CMakeLists.txt").read_text() + (ROOT / "scripts" / "test.sh").read_text()
    unknown = {name for name in names if name not in headers and name not in cmake and not name.endswith("_")}
    assert not unknown

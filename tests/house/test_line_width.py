"""Lines of sources have at most 120 columns, and Python has the form that Ruff gives it.

The text of raw strings of C++ has a form of its own, a word that fills a line cannot be broken, and
what only tools read does not count."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "scripts"))

import plain_english  # noqa: E402

PRAGMA = re.compile(r"  # (?:type|noqa|fmt|mypy)\b.*")
RAW = re.compile(r'R"(\w*)\(.*?\)\1"', re.DOTALL)


def too_long(text: str) -> list[str]:
    text = RAW.sub(lambda raw: 'R""' + "\n" * raw[0].count("\n"), text)
    lines = [PRAGMA.sub("", line) for line in text.splitlines()]
    return [
        f"{number}: {line}"
        for number, line in enumerate(lines, 1)
        if len(line) > 120 and max(map(len, line.split())) < plain_english.WIDE_WORD
    ]


def scripts() -> list[Path]:
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, check=True, capture_output=True, text=True).stdout.split()
    return [ROOT / name for name in listed if name.endswith((".cmake", ".sh", "CMakeLists.txt"))]


def test_lines_have_at_most_120_columns() -> None:
    found = []
    for path in plain_english.sources() + scripts():
        found += [f"{path.relative_to(ROOT)}:{line}" for line in too_long(path.read_text())]
    assert not found


def test_raw_strings_are_left_alone() -> None:
    assert too_long(f'auto a = R"(\n{"x y " * 33})";\n// {"z " * 60}\n') == [f"3: // {'z ' * 60}"]


def test_a_word_that_fills_a_line_is_left_alone() -> None:
    assert not too_long(f"# https://example.org/{'x' * 120}\n")


def test_python_is_formatted() -> None:
    command = [sys.executable, "-m", "ruff", "format", "--check", "--quiet", "--no-cache", str(ROOT)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"run ruff format\n{done.stdout}{done.stderr}"

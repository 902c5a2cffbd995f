"""Lines of C, C++ and OpenCL C have at most 120 columns, but for the text of raw strings, which has a form of its own."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = ("bench", "kernels")  # of the others' older lines some are longer
RAW = re.compile(r'R"(\w*)\(.*?\)\1"', re.DOTALL)


def too_long(text: str) -> list[str]:
    text = RAW.sub(lambda raw: 'R""' + "\n" * raw[0].count("\n"), text)
    return [f"{number}: {line}" for number, line in enumerate(text.splitlines(), 1) if len(line) > 120]


@pytest.mark.parametrize("folder", FOLDERS)
def test_lines_have_at_most_120_columns(folder: str) -> None:
    found = []
    for path in sorted((ROOT / folder).rglob("*")):
        if path.suffix in (".cpp", ".hpp", ".c", ".h", ".cl"):
            found += [f"{path.relative_to(ROOT)}:{line}" for line in too_long(path.read_text())]
    assert not found


def test_raw_strings_are_left_alone() -> None:
    assert too_long(f'auto a = R"(\n{"x" * 130})";\n// {"y" * 118}\n') == [f"3: // {'y' * 118}"]

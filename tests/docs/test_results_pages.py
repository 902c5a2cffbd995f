"""Tables of results: each section with one names the command that made it, and the day."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGES = sorted((ROOT / "docs" / "results").glob("*.md"))
TABLE = re.compile(r"^\|[-:| ]+\|$", re.MULTILINE)
DATE = re.compile(r"\b20\d\d-\d\d-\d\d\b")
COMMAND = re.compile(r"(?:^    |`)[^`\n]*?(?:\bclspeckle\b|python|scripts/|build/bin/|ctest|gap_check)", re.MULTILINE)
# Pages that a program writes as a whole, and says so in the first lines.
WRITTEN = ("real.md", "thesis.md")
# Tables that say what a word means, and hold nothing that was measured.
DEFINITIONS = {
    ("gap-check.md", "## What is drawn"),
    ("gap-check.md", "## Where the catalogue leaves a choice"),
    ("gap-check.md", "## Effects outside the catalogue"),
}


def sections(page: Path) -> list[tuple[str, str]]:
    text = re.sub(r"^```.*?^```", "", page.read_text(), flags=re.DOTALL | re.MULTILINE)
    parts = re.split(r"^(#{2,} .*)$", text, flags=re.MULTILINE)
    return [("", parts[0]), *zip(parts[1::2], parts[2::2], strict=True)]


def unnamed(found: list[tuple[str, str]], top: str = "") -> list[str]:
    """Headings of sections whose tables have no command, or no day."""
    return [
        heading
        for heading, text in found
        if TABLE.search(text) and not all(pattern.search(top + text) for pattern in (DATE, COMMAND))
    ]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_tables_have_a_command_and_a_day(page: Path) -> None:
    found = sections(page)
    top = found[0][1] if page.name in WRITTEN else ""
    assert [heading for heading in unnamed(found, top) if (page.name, heading) not in DEFINITIONS] == []


def test_no_definition_is_left_over() -> None:
    headings = {(page.name, heading) for page in PAGES for heading, _ in sections(page)}
    assert headings >= DEFINITIONS


def test_a_table_without_a_day_is_found() -> None:
    table = "\n| a |\n|---|\n| 1 |\n"
    assert unnamed(
        [("", "Words.\n"), ("## A", f"`scripts/a.py`{table}"), ("## B", f"`ctest` on 2026-11-20{table}")]
    ) == ["## A"]

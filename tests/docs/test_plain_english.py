"""Short sentences: on average at most 20 words, none above 45, on every page.

Short lines: at most 120 columns, on every page. The changelog has one line a change."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "scripts"))

import plain_english  # noqa: E402

MEAN, LONGEST, COLUMNS = 20.0, 45, 120
READMES = sorted(page for folder in ("examples", "bindings") for page in (ROOT / folder).rglob("README.md"))


@pytest.mark.parametrize("page", [*plain_english.pages(), *READMES], ids=lambda page: f"{page.parent.name}/{page.name}")
def test_sentences_are_short(page: Path) -> None:
    found = plain_english.measure(page)
    said = max(found.sentences, key=lambda sentence: len(sentence.split()), default="")
    assert found.longest <= LONGEST, said
    assert found.mean <= MEAN


@pytest.mark.parametrize("page", [*plain_english.pages(), *READMES], ids=lambda page: f"{page.parent.name}/{page.name}")
def test_lines_are_short(page: Path) -> None:
    said = plain_english.measure(page).widest
    assert len(said) <= COLUMNS, said


def test_what_counts(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text(
        "# Heading\n\nOne two three. Four [five](six.md)\n`a b c` seven.\n\n```sh\nnot this\n```\n\n- An item\n- a b\n"
    )
    assert plain_english.measure(page).lengths == [3, 4, 2, 2]


def test_columns_that_count(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    address = "https://example.org/" + "x" * 120
    page.write_text(f"Short.\n\n    a command of {'code ' * 20}\n\n| {'a row ' * 40}|\n- {address}\n")
    assert plain_english.measure(page).widest.startswith("    a command of code")

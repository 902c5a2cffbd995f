"""Short sentences: on average at most 20 words, none above 45, on every page.

Short lines: at most 120 columns, on every page. The changelog has one line a change."""

from __future__ import annotations

import re
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


# Licenses of others, in their words.
QUOTED = {"diagnosis/report/report_script.cpp"}
# How the code came to be is told by its history.
PAST = re.compile(r"\b(?:formerly|previously|until now|refactor\w*|legacy|TODO|FIXME|XXX|HACK)\b")


def test_comments_are_short_and_of_what_is() -> None:
    """By the same rule as pages, but that formulas are no words: comments and docstrings of all sources."""
    long, past, count, total = [], [], 0, 0
    for path in plain_english.sources():
        if (name := path.relative_to(ROOT).as_posix()) in QUOTED:
            continue
        for sentence in plain_english.comments(path):
            length = plain_english.words(sentence)
            count, total = count + 1, total + length
            if length > LONGEST:
                long.append((name, length, sentence))
            if PAST.search(sentence) and path != Path(__file__):
                past.append((name, sentence))
    assert count > 10_000
    assert total / count <= MEAN
    assert long == []
    assert past == []


@pytest.mark.parametrize(
    ("name", "text"),
    [
        (
            "a.cpp",
            'int a = 1; // One two\nconst char *b = "// no comment"; // three\n\n'
            "/** Four @param five. */\n// six\n// seven\n",
        ),
        ("a.py", '"""Four."""\na = 1  # One two\nb = "# no"  # three\n\n# six\n# seven\n'),
    ],
)  # fmt: skip
def test_what_counts_of_comments(tmp_path: Path, name: str, text: str) -> None:
    (tmp_path / name).write_text(text)
    assert sorted(plain_english.comments(tmp_path / name)) == ["One two", "six seven"]

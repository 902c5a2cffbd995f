"""Every promise that the docs make names the tests that hold it, and they are there."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGES = ("docs/reference/promises.md", "SECURITY.md")


def promises(text: str) -> list[tuple[str, str]]:
    """The rows of the tables "promise | test"."""
    rows = []
    inside = False
    for line in text.splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")] if line.startswith("|") else []
        if cells == ["promise", "test"]:
            inside = True
        elif not cells:
            inside = False
        elif inside and not set(cells[0]) <= set("-: "):
            assert len(cells) == 2, line
            rows.append((cells[0], cells[1]))
    return rows


def what_is_wrong(tests: str) -> list[str]:
    """Of a row's second cell: `path::name` below tests/, between commas."""
    wrong = []
    for word in tests.split(", "):
        named = re.fullmatch(r"`([\w./]+)::([\w.]+)`", word)
        if not named:
            wrong.append(f"{word} is not `path::name`")
            continue
        path, name = ROOT / "tests" / named[1], named[2]
        suite, _, test = name.rpartition(".")
        pattern = rf"^def {name}\(" if path.suffix == ".py" else rf"^TEST(?:_[FP])?\({suite}, {test}\)"
        if not path.is_file() or not re.search(pattern, path.read_text(encoding="utf-8"), re.MULTILINE):
            wrong.append(f"there is no {word}")
    return wrong


@pytest.mark.parametrize("page", PAGES)
def test_promises_name_tests_that_exist(page: str) -> None:
    rows = promises((ROOT / page).read_text(encoding="utf-8"))
    assert len(rows) >= 10
    assert {promise: wrong for promise, tests in rows if (wrong := what_is_wrong(tests))} == {}


def test_wrong_rows_are_told() -> None:
    assert promises("| promise | test |\n|---|---|\n| a | b |\n\n| c | d |\n") == [("a", "b")]
    assert what_is_wrong("`house/test_promises.py::test_wrong_rows_are_told`") == []
    for tests in ("`house/test_promises.py`", "", "`house/test_promises.py::test_none`", "`house/none.py::test_none`",
                  "`faults/test_faults.cpp::Faults.None`"):  # fmt: skip
        assert len(what_is_wrong(tests)) == 1

"""The changelog has the form of Keep a Changelog, and one line a change."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
TEXT = (ROOT / "CHANGELOG.md").read_text()
KINDS = ["Added", "Changed", "Deprecated", "Removed", "Fixed", "Security"]


def releases() -> dict[str, str]:
    parts = re.split(r"^## \[(.+?)\].*$", TEXT, flags=re.MULTILINE)
    return dict(zip(parts[1::2], parts[2::2], strict=True))


def test_it_begins_with_what_is_unreleased() -> None:
    assert next(iter(releases())) == "Unreleased"
    assert "https://keepachangelog.com/" in TEXT
    assert "https://semver.org/" in TEXT


def test_kinds_are_those_of_keep_a_changelog() -> None:
    for name, text in releases().items():
        kinds = re.findall(r"^### (.+)$", text, re.MULTILINE)
        assert kinds == [kind for kind in KINDS if kind in kinds], f"{name}: {kinds}"


def test_one_line_a_change() -> None:
    for name, text in releases().items():
        changes = text[text.index("### ") :].splitlines()
        wrong = [line for line in changes if line and not re.match(r"#{3,4} \S|- \S.*[.:]$", line)]
        assert wrong == [], f"{name}: a change is one line that begins with a dash and ends with a full stop"
        told = [line for line in changes if line.startswith("- ")]
        assert len(told) == len(set(told)), f"{name}: a change stands twice"

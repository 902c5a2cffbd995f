"""docs/guide/files.md says what each message of the readers means: its table and the sources have the same words."""

from __future__ import annotations

import re
from pathlib import Path

from test_advice import messages

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "guide" / "files.md"
# Parts of messages, of names and of other formats' headers. What is longer says something by itself.
LEAST_WORDS = 5
# What another message ends with or has within it: an advice, a cause, a thing.
PARTS = re.compile(
    r"^(?:[.;, ]|save |convert it |get the file |read its pixels |it as one of|numpy\.|not finite|mirrored|\{\{'descr'"
    r"|an? \w+ \(|an image of \{\}|\{\} image|\{\} bytes are there)"
)


def words_of_the_page() -> list[str]:
    section = PAGE.read_text().partition("\n## Messages\n")[2].partition("\n## ")[0]
    rows = [line.split(" | ")[0] for line in section.splitlines() if line.startswith("| `")]
    return [words for row in rows for words in re.findall(r"`([^`]+)`", row)]


def texts() -> list[tuple[str, str]]:
    paths = [path for suffix in ("cpp", "hpp") for path in sorted((ROOT / "io").rglob(f"*.{suffix}"))]
    return [(str(path.relative_to(ROOT)), text) for path in paths for text in messages(path) if " " in text]


def test_every_row_is_of_a_message() -> None:
    known = [text for _, text in texts()]
    listed = words_of_the_page()
    assert len(listed) > 100
    assert [words for words in listed if not any(words in text for text in known)] == []
    assert len(listed) == len(set(listed))


def test_every_message_has_a_row() -> None:
    listed = words_of_the_page()
    long = [(path, text) for path, text in texts() if len(re.findall(r"[A-Za-z]{2,}", text)) >= LEAST_WORDS]
    said = [(path, text) for path, text in long if not PARTS.search(text)]
    assert len(said) > 150
    assert [(path, text) for path, text in said if not any(words in text for words in listed)] == []

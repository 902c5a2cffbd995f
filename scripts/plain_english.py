"""Prints, for each page, how many sentences it has, their mean length in words, the longest one, and its widest line.

    scripts/plain_english.py [FILE ...] [--longest N]     # without files: all pages of the project

Words of code blocks, tables, headings and links' addresses do not count. An item of a list is a sentence of its own.
A row of a table cannot be broken, so its columns do not count; nor do those of a line that one long word fills.
"""

from __future__ import annotations

import argparse
import re
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
END = re.compile(r"[.!?](?=\s|$)")
WIDE_WORD = 80
ITEM = re.compile(r"^\s*(?:[-*+]|\d+\.)\s+")


@dataclass(frozen=True)
class Measure:
    path: Path
    sentences: list[str]
    widest: str

    @property
    def lengths(self) -> list[int]:
        return [len(sentence.split()) for sentence in self.sentences]

    @property
    def mean(self) -> float:
        return sum(self.lengths) / max(len(self.lengths), 1)

    @property
    def longest(self) -> int:
        return max(self.lengths, default=0)


def widest(text: str) -> str:
    lines = [line for line in text.splitlines() if not line.lstrip().startswith("|")]
    lines = [line for line in lines if max(map(len, line.split()), default=0) < WIDE_WORD]
    return max(lines, key=len, default="")


def paragraphs(text: str) -> list[str]:
    found: list[str] = [""]
    fenced = False
    for line in text.splitlines():
        if line.lstrip().startswith("```"):
            fenced = not fenced
            found.append("")
        elif (
            fenced
            or (line.startswith(("    ", "#", "|", "<!--")) and not found[-1])
            or not line.strip()
            or line.lstrip().startswith(("|", "#"))
        ):
            found.append("")
        else:
            if ITEM.match(line):
                found.append("")
            found[-1] += " " + ITEM.sub("", line).strip()
    return [paragraph.strip() for paragraph in found if paragraph.strip()]


def plain(text: str) -> str:
    """Without the marks; an expression in code or dollars is one word."""
    text = re.sub(r"`[^`]*`", "code", text)
    text = re.sub(r"\$[^$]*\$", "formula", text)
    text = re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", text)
    return text.replace("*", "").replace("e.g.", "eg").replace("i.e.", "ie")


def measure(path: Path) -> Measure:
    sentences = []
    text = path.read_text()
    for paragraph in paragraphs(text):
        sentences += [part.strip() for part in END.split(plain(paragraph)) if len(part.split()) > 1]
    return Measure(path, sentences, widest(text))


def pages() -> list[Path]:
    return [ROOT / "README.md", ROOT / "CONTRIBUTING.md", ROOT / "SECURITY.md", *sorted((ROOT / "docs").rglob("*.md"))]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="*", type=Path, metavar="FILE")
    parser.add_argument("--longest", type=int, default=0, metavar="N", help="also print sentences of more than N words")
    arguments = parser.parse_args()
    print(" mean  longest  sentences  columns  page")
    for path in arguments.files or pages():
        found = measure(path.resolve())
        name = path.resolve().relative_to(ROOT) if path.resolve().is_relative_to(ROOT) else path
        print(f"{found.mean:5.1f}  {found.longest:7}  {len(found.sentences):9}  {len(found.widest):7}  {name}")
        if arguments.longest:
            for sentence in found.sentences:
                if len(sentence.split()) > arguments.longest:
                    print(f"         {len(sentence.split()):3}: {sentence}")


if __name__ == "__main__":
    main()

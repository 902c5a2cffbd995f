"""Prints, for each page, how many sentences it has, their mean length in words, the longest one, and its widest line.

    scripts/plain_english.py [FILE ...] [--longest N]     # without files: all pages of the project
    scripts/plain_english.py --comments [FILE ...]        # the same of comments and docstrings of the sources

Words of code blocks, tables, headings and links' addresses do not count. An item of a list is a sentence of its own.
A row of a table cannot be broken, so its columns do not count; nor do those of a line that one long word fills.
In comments names, numbers and formulas are no words. A line with a gap of two spaces is a row of a table.
"""

from __future__ import annotations

import argparse
import ast
import io
import re
import subprocess
import tokenize
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


# A text in quotes, which may hold what looks like a comment, or a comment.
CPP = re.compile(r'"(?:[^"\\\n]|\\.)*"|\'(?:[^\'\\\n]|\\.)\'|//[^\n]*|/\*.*?\*/', re.DOTALL)
DOXYGEN = re.compile(r"[@\\](?!p\b|c\b|ref\b)[a-z]+\b")
WORD = re.compile(r"[(\"']*[A-Za-z][A-Za-z'-]+[,;:)\"']*$")
SOURCES = (".c", ".cl", ".cpp", ".h", ".hpp", ".py")


def cpp_comments(text: str) -> list[str]:
    found: list[str] = []
    end = -1  # of a comment whose next line may go on
    for match in CPP.finditer(text):
        if match[0].startswith("//"):
            line = match[0].lstrip("/").removeprefix("<")
            if end >= 0 and re.fullmatch(r"\n[ \t]*", text[end : match.start()]):
                found[-1] += "\n" + line
            else:
                found.append(line)
            end = match.end()
        elif match[0].startswith("/*"):
            found.append(
                "\n".join(re.sub(r"^\s*\*", "", line) for line in match[0].strip("/").strip("*<").splitlines())
            )
    return found


def python_comments(text: str) -> list[str]:
    found: list[str] = []
    last = -1
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type == tokenize.COMMENT:
            line = token.string.lstrip("#")
            if token.start[0] == last + 1 and token.line.lstrip().startswith("#"):
                found[-1] += "\n" + line
            else:
                found.append(line)
            last = token.start[0]
    documented = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
    texts = [ast.get_docstring(node) for node in ast.walk(ast.parse(text)) if isinstance(node, documented)]
    return found + [documentation for documentation in texts if documentation]


def comments(path: Path) -> list[str]:
    """Sentences of the comments and docstrings of a source."""
    text = path.read_text()
    found: list[str] = []
    for comment in python_comments(text) if path.suffix == ".py" else cpp_comments(text):
        lines = [line.removeprefix(" ") for line in DOXYGEN.sub("\n\n", comment).splitlines()]
        lines = [f"\n{line}\n" if re.search(r"\S {2,}\S", line) else line for line in lines]
        for paragraph in paragraphs("\n".join(lines)):
            found += [part.strip() for part in END.split(plain(paragraph)) if words(part) > 1]
    return found


def words(sentence: str) -> int:
    return sum(1 for part in sentence.split() if WORD.match(part))


def sources() -> list[Path]:
    """All that is written by hand here."""
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, check=True, capture_output=True, text=True).stdout.split(
        "\n"
    )
    return [ROOT / name for name in listed if name.endswith(SOURCES) and not name.endswith("_generated.py")]


def pages() -> list[Path]:
    return [ROOT / "README.md", ROOT / "CONTRIBUTING.md", ROOT / "SECURITY.md", *sorted((ROOT / "docs").rglob("*.md"))]


def print_comments(paths: list[Path], longest: int) -> None:
    print(" mean  longest  sentences  source")
    for path in paths:
        found = comments(path.resolve())
        lengths = [words(sentence) for sentence in found] or [0]
        mean = sum(lengths) / len(lengths)
        print(f"{mean:5.1f}  {max(lengths):7}  {len(found):9}  {path.resolve().relative_to(ROOT)}")
        if longest:
            for sentence, length in zip(found, lengths):
                if length > longest:
                    print(f"         {length:3}: {sentence}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="*", type=Path, metavar="FILE")
    parser.add_argument("--comments", action="store_true", help="of comments and docstrings")
    parser.add_argument("--longest", type=int, default=0, metavar="N", help="also print sentences of more than N words")
    arguments = parser.parse_args()
    if arguments.comments:
        print_comments(arguments.files or sources(), arguments.longest)
        return
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

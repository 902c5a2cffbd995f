"""Every message that says what to type has a test that types it.

advice.txt lists fragments of messages, each with the test that provokes the message and follows it; a dash stands where
the words name something and advise nothing. What looks like such a message is found in the sources that read, check and
write files."""

from __future__ import annotations

import ast
import functools
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
TABLE = Path(__file__).with_name("advice.txt")
SOURCES = [
    *sorted((ROOT / "io").rglob("*.cpp")),
    *sorted((ROOT / "diagnosis" / "capture").glob("*.cpp")),
    *(ROOT / "tools" / f"{name}.cpp" for name in ("capture", "capture_init", "depth", "depth_files", "diagnose")),
    *(ROOT / "tools" / f"{name}.cpp" for name in ("doe_design", "doe_files", "doe_pattern", "files", "input")),
    *(ROOT / "tools" / f"{name}.cpp" for name in ("render", "statistics")),
]
# Options, lines of Python, names of files with what is wanted of them, and what is to be saved, named or converted.
ADVISES = re.compile(
    r"--[a-z]|numpy\.|tifffile\.|\bcodes\[|array\.|FILE:|\\\"file|:page=|`clspeckle|\\\"mask|[Ss]ave |\bset [a-z/]"
    r"|[Nn]ame (it|one|the|a|them)\b|[Cc]onvert it|full_scale=|unpack|tar -x|> gray|pamsplit|for example"
)
LITERAL = re.compile(r'"((?:[^"\\\n]|\\.)*)"')


def messages(path: Path) -> list[str]:
    """String literals, those that stand side by side joined."""
    text = re.sub(r"(?m)^\s*(//|\*|/\*).*$", "", path.read_text())
    found: list[str] = []
    end = -1
    for literal in LITERAL.finditer(text):
        if end >= 0 and not text[end : literal.start()].strip():
            found[-1] += literal[1]
        else:
            found.append(literal[1])
        end = literal.end()
    return found


@functools.cache
def advising() -> list[tuple[str, str]]:
    return [
        (str(path.relative_to(ROOT)), message.replace('\\"', '"'))
        for path in SOURCES
        for message in messages(path)
        if " " in message and len(message) > 12 and ADVISES.search(message)
    ]


def table() -> list[tuple[str, str]]:
    rows = [line.rsplit(" | ", 1) for line in TABLE.read_text().splitlines() if line and not line.startswith("#")]
    return [(fragment, test.strip()) for fragment, test in rows]


def test_every_advice_is_followed_by_a_test() -> None:
    fragments = [fragment for fragment, _ in table()]
    missing = [f"{path}: {text}" for path, text in advising() if not any(fragment in text for fragment in fragments)]
    assert missing == [], "write a test that follows the advice, and name it in tests/house/advice.txt"


def test_the_table_is_of_what_there_is() -> None:
    texts = [text for _, text in advising()]
    functions: dict[str, set[str]] = {}
    for fragment, test in table():
        assert any(fragment in text for text in texts), f"no message says: {fragment}"
        if test == "-":
            continue
        file, _, name = test.partition("::")
        if file not in functions:
            tree = ast.parse((ROOT / "tests" / file).read_text())
            functions[file] = {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)}
        assert name in functions[file], f"there is no test {test}"

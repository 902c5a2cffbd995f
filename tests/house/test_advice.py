"""Every message that says what to type has a test that types it.

advice.txt lists fragments of messages, each with the test that provokes the message and follows it; a dash stands where
the words name something and advise nothing. What looks like such a message is found in all sources of the product:
options and names of files in those that read, check and write files, and what begins with a word such as "use" or
"give" everywhere."""

from __future__ import annotations

import ast
import functools
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
TABLE = Path(__file__).with_name("advice.txt")
FILES = [
    *sorted((ROOT / "io").rglob("*.cpp")),
    *sorted((ROOT / "diagnosis" / "capture").glob("*.cpp")),
    *(ROOT / "tools" / f"{name}.cpp" for name in ("capture", "capture_init", "depth", "depth_files", "diagnose")),
    *(ROOT / "tools" / f"{name}.cpp" for name in ("doe_design", "doe_files", "doe_pattern", "files", "input")),
    *(ROOT / "tools" / f"{name}.cpp" for name in ("plane_checks", "planes", "render", "scene_sequence", "statistics")),
]
SOURCES = FILES + [
    path
    for folder in ("bindings/cpp/include", "bindings/python/src", "capi", "core", "diagnosis", "io", "tools")
    for suffix in ("cpp", "hpp", "py")
    for path in sorted((ROOT / folder).rglob(f"*.{suffix}"))
    if path not in FILES and path.name != "_generated.py"
]
# Options, lines of Python, names of files with what is wanted of them, and what is to be saved, named or converted.
ADVISES = re.compile(
    r"--[a-z]|numpy\.|tifffile\.|\bcodes\[|array\.|FILE:|\\\"file|:page=|`clspeckle|\\\"mask|[Ss]ave |\bset [a-z/]"
    r"|[Nn]ame (it|one|the|a|them)\b|[Cc]onvert it|full_scale=|unpack|tar -x|> gray|pamsplit|for example"
)
# What is to be done, behind the end of a part of a sentence.
WORDS = (
    "use give pass make take name set choose call leave list lower raise widen add put create release correct change "
)
WORDS += (
    "install try write repeat run save fill start update refresh upload unset remove replace read rename move copy "
)
WORDS += "wait let begin shorten merge crop record divide multiply see check say spell scale"
DO = "|".join(WORDS.split())
IMPERATIVE = re.compile(
    rf"(?:^|[;:(] ?|, or |, and |\bor |\bthen |\), ?)(?:{DO})\b (?!the same)|\. (?:{DO.title()})\b|`(?:clspeckle|chmod)"
)
LITERAL = re.compile(r'"((?:[^"\\\n]|\\.)*)"')


def messages(path: Path) -> list[str]:
    """String literals, those that stand side by side joined."""
    if path.suffix == ".py":
        return python_messages(path)
    text = re.sub(r"(?m)^\s*(//|\*|/\*|#include).*$", "", path.read_text())
    found: list[str] = []
    end = -1
    for literal in LITERAL.finditer(text):
        if end >= 0 and not text[end : literal.start()].strip():
            found[-1] += literal[1]
        else:
            found.append(literal[1])
        end = literal.end()
    return [message.replace('\\"', '"') for message in found]


def python_messages(path: Path) -> list[str]:
    """The same without documentation; what is put in is {}."""
    tree = ast.parse(path.read_text())
    parts = {id(part) for node in ast.walk(tree) if isinstance(node, ast.JoinedStr) for part in ast.walk(node)}
    told = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    found = []
    for node in ast.walk(tree):
        if isinstance(node, ast.JoinedStr):
            found.append("".join(str(v.value) if isinstance(v, ast.Constant) else "{}" for v in node.values))
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and not {id(node)} & (parts | told):
            found.append(node.value)
    return found


@functools.cache
def advising() -> list[tuple[str, str]]:
    return [
        (str(path.relative_to(ROOT)), message)
        for path in SOURCES
        for message in messages(path)
        if " " in message
        and len(message) >= 12
        and (ADVISES.search(message.replace('"', '\\"')) if path in FILES else IMPERATIVE.search(message))
    ]


def table() -> list[tuple[str, str]]:
    rows = [line.rsplit(" | ", 1) for line in TABLE.read_text().splitlines() if line and not line.startswith("#")]
    return [(fragment, test.strip()) for fragment, test in rows]


def functions_of(path: Path) -> set[str]:
    text = path.read_text()
    if path.suffix == ".cpp":
        return {f"{suite}.{name}" for suite, name in re.findall(r"\bTEST(?:_F|_P)?\((\w+), (\w+)\)", text)}
    return {node.name for node in ast.walk(ast.parse(text)) if isinstance(node, ast.FunctionDef)}


def test_every_advice_is_followed_by_a_test() -> None:
    fragments = [fragment for fragment, _ in table()]
    missing = [f"{path}: {text}" for path, text in advising() if not any(fragment in text for fragment in fragments)]
    assert missing == [], "write a test that follows the advice, and name it in tests/house/advice.txt"


def test_the_table_is_of_what_there_is() -> None:
    texts = [text for _, text in advising()]
    tests: dict[str, set[str]] = {}
    for fragment, test in table():
        assert any(fragment in text for text in texts), f"no message says: {fragment}"
        if test == "-":
            continue
        file, _, name = test.partition("::")
        if file not in tests:
            tests[file] = functions_of(ROOT / "tests" / file)
        assert name in tests[file], f"there is no test {test}"

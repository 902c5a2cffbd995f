"""Every option, key and symbol stands in the reference exactly once, with words. One without words is found."""

from __future__ import annotations

import ast
import html
import json
import os
import re
import subprocess
import sys
from collections import Counter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "scripts"))

import undocumented  # noqa: E402

HEADERS = sorted((ROOT / "capi" / "include" / "clspeckle").glob("*.h"))
PACKAGE = ROOT / "bindings" / "python" / "src" / "clspeckle"
BIN = Path(os.environ.get("CLSPECKLE_BIN", ROOT / "build" / "bin"))
# Modules whose names are public, and those of their classes.
MODULES = ("", "errors", "philox", "statistics", "plot", "dataset")


def ids(page: Path) -> Counter[str]:
    return Counter(re.findall(r'\bid="([^"]+)"', page.read_text()))


def printed(*words: str) -> str:
    return subprocess.run([BIN / "clspeckle", *words], check=True, capture_output=True, text=True).stdout


# --- C ---


def symbols_of(header: str) -> list[str]:
    """Functions, macros, types and members, as the site names them."""
    text = re.sub(r"/\*.*?\*/", "", header, flags=re.DOTALL)
    found = re.findall(r"^CLSP_API \w+ \*?(\w+)\(", text, re.MULTILINE)
    found += re.findall(r"^#define (CLSP_\w+)[ (]", text, re.MULTILINE)
    for body, name in re.findall(r"^typedef struct \w+ \{(.*?)^\} (\w+);", text, re.DOTALL | re.MULTILINE):
        found.append(name)
        for declared in body.split(";"):
            member = re.search(r"\(\*(\w+)\)|(\w+)(?:\[\w+\])*\s*$", declared)
            found += [f"{name}.{member[1] or member[2]}"] if member else []
    for body, _ in re.findall(r"^typedef enum \w+ \{(.*?)^\} (\w+);", text, re.DOTALL | re.MULTILINE):
        found += re.findall(r"\b(CLSP_\w+)\s*(?:=|,|$)", body, re.MULTILINE)
    return found


def test_every_c_symbol_once(site: Path) -> None:
    page = ids(site / "reference" / "c.html")
    symbols = [name for header in HEADERS for name in symbols_of(header.read_text())]
    symbols = [name for name in symbols if name not in ("CLSP_API", "CLSP_API_EXPORTS")]
    assert len(symbols) > 1000
    # An enumerator has its type's name in front.
    counts = Counter(key.removeprefix("c.") for key in page.elements()) + Counter(
        key.rpartition(".")[2] for key in page.elements() if re.search(r"\.CLSP_\w+$", key) and key.count(".") > 1
    )
    assert {name: counts[name] for name in symbols if counts[name] != 1} == {}
    assert "The C and C++ interface of clSpeckle" in (site / "doxygen" / "index.html").read_text()


@pytest.mark.parametrize(
    "symbol",
    [
        "/** A type. */\ntypedef struct ClspNew { int said; /**< Words. */ int unsaid; } ClspNew;",
        "CLSP_API int unsaid(int value);",
        "#define unsaid 1u",
    ],
)
def test_a_c_symbol_without_words_fails(symbol: str, tmp_path: Path) -> None:
    (tmp_path / "new.h").write_text(f"/** @file new.h\n * @brief New. */\n\n{symbol}\n")
    text = (ROOT / "docs" / "Doxyfile").read_text()
    text += f"\nINPUT = {tmp_path / 'new.h'}\nOUTPUT_DIRECTORY = {tmp_path}\n"
    done = subprocess.run(["doxygen", "-"], input=text, capture_output=True, text=True, check=False, cwd=ROOT)
    assert done.returncode != 0
    assert re.search(r"unsaid.* is not documented", done.stderr)


# --- Python ---


def public(module: str) -> dict[str, object]:
    import clspeckle
    import clspeckle.dataset

    found = getattr(clspeckle, module) if module else clspeckle
    named = {name: getattr(found, name) for name in found.__all__}
    return {name: value for name, value in named.items() if not isinstance(value, type(re))}


def places(name: str, value: object) -> list[str]:
    """Names under which modules offer it; one of them is in the reference."""
    return [f"clspeckle.{m}.{name}".replace("..", ".") for m in MODULES if public(m).get(name) is value]


@pytest.mark.parametrize("module", MODULES, ids=lambda name: name or "clspeckle")
def test_every_python_symbol_once_with_words(site: Path, module: str) -> None:
    page = ids(site / "reference" / "python.html")
    nodes = undocumented.defined(PACKAGE)
    assert public(module)
    for name, value in public(module).items():
        home = [place for place in places(name, value) if place in page]
        assert [page[place] for place in home] == [1], f"{name}: {home}"
        node = nodes.get(name)
        if isinstance(node, ast.ClassDef) and name != undocumented.ARGUMENTS:
            once = {
                member: page[f"{home[0]}.{member}"] == 1 or undocumented.is_attribute(node, member)
                for member in undocumented.members(node)
            }
            assert [member for member, is_once in once.items() if not is_once] == []


def test_every_argument_of_a_pipeline_is_a_stage_s() -> None:
    nodes = undocumented.defined(PACKAGE)
    stages = " ".join(
        ast.get_docstring(node) or ""
        for stage in ("Phase", "Aperture", "Lens", "Sensor", "Pipeline")
        for node in [nodes[stage], *[f for f in nodes[stage].body if isinstance(f, ast.FunctionDef)]]  # type: ignore[union-attr]
    )
    parameters = nodes[undocumented.ARGUMENTS]
    own = ast.get_docstring(parameters) or ""
    keys = [entry.target.id for entry in parameters.body if isinstance(entry, ast.AnnAssign)]  # type: ignore[union-attr]
    assert len(keys) > 90
    assert [key for key in keys if not re.search(rf"\b{key}\b", stages) and f"``{key}``" not in own] == []


@pytest.mark.parametrize(
    ("code", "name"),
    [
        ("def tell():\n    return 1\n", "tell"),
        ('class Told:\n    """Words."""\n    def tell(self):\n        return 1\n', "Told.tell"),
        ('class Told:\n    """Words."""\n    said: int\n    """Words."""\n    unsaid: int\n', "Told.unsaid"),
    ],
)
def test_a_python_symbol_without_words_fails(code: str, name: str, tmp_path: Path) -> None:
    (tmp_path / "told.py").write_text(f'__all__ = ["{name.partition(".")[0]}"]\n{code}')
    command = [sys.executable, ROOT / "scripts" / "undocumented.py"]
    done = subprocess.run([*command, tmp_path], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (1, f"{name} has no words: add a docstring\n")
    assert subprocess.run(command, check=False).returncode == 0
    assert "scripts/undocumented.py" in (ROOT / "scripts" / "docs.sh").read_text()


# --- Options ---


OPTION = re.compile(r"^  (?:-\w, )?(--[a-z][\w-]*)(?:, -\w)?((?:, --[\w-]+)*)(.*)\n((?: {6,}.*\n)*)", re.MULTILINE)


def options(text: str) -> dict[str, bool]:
    """Of a command's help, and whether each has words: behind it or in the lines below."""
    found: dict[str, bool] = {}
    for name, others, rest, below in OPTION.findall(text + "\n"):
        words = bool(re.search(r"\S {2,}\S|^ {2,}\S", rest)) or bool(below.strip())
        for one in [name, *re.findall(r"--[\w-]+", others)]:
            assert one not in found, f"{one} stands twice"
            found[one] = words
    return found


def commands(page: str) -> dict[str, str]:
    """The sections of the reference: a command's words and its help."""
    blocks = re.findall(r"<h\d>(clspeckle[\w -]*)<a.*?<pre>(.*?)</pre>", page, re.DOTALL)
    return {name.strip(): html.unescape(re.sub(r"<[^>]+>", "", text)) for name, text in blocks}


def test_every_option_once_with_words(site: Path) -> None:
    page = (site / "reference" / "command-line.html").read_text()
    found = commands(page)
    assert len(found) == len(re.findall(r"<h\d>clspeckle", page)) > 20
    total = 0
    for command, text in found.items():
        told = options(text)
        known = set(re.findall(r"^(--[\w-]+)", printed("complete", "--", *command.split()[1:], "--"), re.MULTILINE))
        assert set(told) == known, command
        assert [name for name, words in told.items() if not words] == []
        total += len(told)
    assert total > 200


def test_an_option_without_words_fails() -> None:
    told = options("Options:\n  -h, --help   Print this help\n  --new TEXT\n  --other TEXT\n      Words\n")
    assert told == {"--help": True, "--new": False, "--other": True}


# --- Keys ---


def test_every_key_of_the_configuration_once(site: Path) -> None:
    page = (site / "reference" / "configuration.html").read_text()
    values = json.loads(printed("render", "--dump-config"))
    keys = [f"{group}.{key}" for group, rest in values.items() if group != "effects" for key in rest]
    assert len(keys) > 60
    cells = Counter(re.findall(r'<code[^>]* id="key-[^"]*"[^>]*>(.*?)</code>', page))
    cells = Counter({re.sub(r"<[^>]+>", "", cell): count for cell, count in cells.items()})
    assert cells == Counter(keys)
    told = options(commands((site / "reference" / "command-line.html").read_text())["clspeckle render"])
    rows = re.findall(r"<tr.*?</tr>", page, re.DOTALL)
    for cell in (re.sub(r"<[^>]+>", " ", one).split() for one in rows[1:]):
        assert told[cell[1]], cell


def keys_of_capture_json(source: str) -> list[str]:
    """Those that the reader knows; of others it warns."""
    found = []
    for where, listed in re.findall(r'note_unknown\(\s*\w+, (where|"[^"]*"),\s*\{(.*?)\}', source, re.DOTALL):
        parent = "sequences[]." if where == "where" else f"{where[2:-1]}.".lstrip(".")
        found += [parent + key for key in re.findall(r'"(\w+)"', listed)]
    return found


def keys_of_table(page: str) -> Counter[str]:
    cells = re.findall(r"^\| (`.*?`) \|", page, re.MULTILINE)
    return Counter(key for cell in cells for key in re.findall(r"`([^`]+)`", cell))


def test_every_key_of_capture_json_once() -> None:
    source = (ROOT / "diagnosis" / "capture" / "capture_json.cpp").read_text()
    keys = keys_of_capture_json(source)
    assert len(keys) > 25
    assert keys_of_table((ROOT / "docs" / "reference" / "capture-json.md").read_text()) == Counter(keys)


def test_a_key_without_a_row_fails() -> None:
    source = (ROOT / "diagnosis" / "capture" / "capture_json.cpp").read_text()
    source = source.replace('"msb_aligned"}', '"msb_aligned", "new"}')
    table = keys_of_table((ROOT / "docs" / "reference" / "capture-json.md").read_text())
    assert Counter(keys_of_capture_json(source)) - table == Counter(["camera.new"])


def keys_of_sequence_json(source: str) -> set[str]:
    """Those that the reader takes; in most objects it refuses others."""
    taken = source[source.index("load_materials(") :]
    found = set(re.findall(r'(?:root|entry), "(\w+)", (?:path|nothing)|root\.contains\("(\w+)"\)', taken))
    names = {key for pair in found for key in pair if key}
    objects = {"material_ids", "geometry_from_object"}
    keys = {f"moving_objects[].{key}" if key in objects else key for key in names if key != "living"}
    for parent, name, listed in re.findall(r'take\((root|laser), "(\w+)",\s*\{(\{.*?\})\}\)', taken, re.DOTALL):
        keys |= {name if parent == "root" else f"laser.{name}"}
        keys |= {f"{name}.{key}" for key in re.findall(r'\{"(\w+)", "', listed)}
    (listed,) = re.findall(r'keys = \{("id".*?)\};', taken)
    members = re.findall(r'\{"(\w+)", &ClspMaterial', taken)
    return keys | {f"materials[].{key}" for key in [*re.findall(r'"(\w+)"', listed), *members]}


def test_every_key_of_sequence_json_once() -> None:
    keys = keys_of_sequence_json((ROOT / "tools" / "scene_sequence.cpp").read_text())
    assert len(keys) > 35
    assert keys_of_table((ROOT / "docs" / "reference" / "sequence-json.md").read_text()) == Counter(keys)


def test_every_environment_variable_once() -> None:
    files = [p for folder in ("core", "capi", "diagnosis", "io", "tools") for p in (ROOT / folder).rglob("*.[ch]pp")]
    named = {
        name for file in [*files, *PACKAGE.rglob("*.py")] for name in re.findall(r'"(CLSPECKLE_\w+)"', file.read_text())
    }
    assert len(named) > 5
    assert keys_of_table((ROOT / "docs" / "reference" / "environment.md").read_text()) == Counter(named)

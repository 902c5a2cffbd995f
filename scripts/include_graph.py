#!/usr/bin/env python3
"""Circles and wrong arrows between the files of the project, from its #include and import lines.

    scripts/include_graph.py [--root FOLDER] [--json]

A C++ header and its source are one file here, and imports within Python functions count. Prints a line for each
finding; exit code 1 if there are any:
  circle   files that need each other, all of a circle in one line
  arrow    a file that uses a folder which it must not know (ARROWS)
  room     a folder of core or diagnosis of which ARROWS says nothing
  C word   a string in core or diagnosis that speaks of the C interface (CLSP_..., clspX...)
"""

from __future__ import annotations

import argparse
import ast
import json
import re
import sys
from pathlib import Path

# Where quoted includes of a folder's files are looked for, beside their own folder.
INCLUDES = {
    "core": ["core", "."],
    "io": ["."],
    "diagnosis": ["diagnosis", "core", "."],
    "capi": ["capi", "capi/include", "diagnosis", "core", "."],
    "tools": ["tools", "capi/include", "bindings/cpp/include", "."],
    "bindings/cpp": ["bindings/cpp/include", "capi/include"],
}
# The folders that a folder's files may use. The longest name that fits a file counts.
CORE = ["core/runtime", "core/fft", "core/stages"]
ARROWS = {
    "core": ["core", "io"],
    "core/runtime": ["core/runtime", "io"],
    "core/fft": ["core/fft", "core/runtime", "io"],
    "core/stages": CORE,
    "core/effects": ["core/effects", *CORE],
    "core/pipeline": ["core/pipeline", "core/effects", *CORE],
    **{f"core/{folder}": [f"core/{folder}", *CORE] for folder in ("depth", "doe", "statistics", "tuning")},
    "io": ["io"],
    "diagnosis": ["diagnosis", "core", "io"],
    "diagnosis/capture": ["diagnosis/capture", "core", "io"],
    "diagnosis/simulator": ["diagnosis/simulator", "diagnosis/capture", "core"],
    "diagnosis/statistics": ["diagnosis/statistics", "diagnosis/capture", "core"],
    "diagnosis/inference": [f"diagnosis/{x}" for x in ("inference", "statistics", "simulator", "capture")] + ["core"],
    "diagnosis/measure": [f"diagnosis/{x}" for x in ("measure", "inference", "statistics", "simulator", "capture")]
    + ["core"],
    "diagnosis/report": ["diagnosis/report", "diagnosis/measure", "diagnosis/capture", "core", "io"],
    "diagnosis/run": [f"diagnosis/{x}" for x in ("run", "measure", "inference", "statistics", "simulator", "capture")]
    + ["core"],
    "capi": ["capi", "diagnosis", "core", "io"],
    "bindings/cpp": ["bindings/cpp", "capi/include"],
    "tools": ["tools", "bindings/cpp/include", "capi/include", "io"],
}
PACKAGES = {"clspeckle": "bindings/python/src", "gap_check": "validation", "thesis": "validation"}
C_WORD = re.compile(r'"(?:[^"\\\n]|\\.)*?\b(CLSP_[A-Z]|clsp[A-Z]\w)(?:[^"\\\n]|\\.)*"')
C_TEXTS = {"diagnosis/report/paste.cpp"}  # C that reports print, to be pasted
QUOTED = re.compile(r'^#include "([^"]+)"', re.MULTILINE)


def cpp_graph(root: Path) -> dict[str, set[str]]:
    """The files that each file includes, by their paths below the root."""
    graph: dict[str, set[str]] = {}
    for top, folders in INCLUDES.items():
        for path in sorted((root / top).rglob("*")):
            if path.suffix not in (".cpp", ".hpp", ".h"):
                continue
            used = graph.setdefault(path.relative_to(root).as_posix(), set())
            for name in QUOTED.findall(path.read_text()):
                found = next(
                    (p for p in [path.parent / name, *(root / f / name for f in folders)] if p.is_file()), None
                )
                if found:
                    used.add(found.resolve().relative_to(root).as_posix())
    return graph


def python_graph(root: Path) -> dict[str, set[str]]:
    """The modules that each module imports, in functions, too."""
    graph: dict[str, set[str]] = {}
    for package, folder in PACKAGES.items():
        home = root / folder
        modules: dict[str, Path] = {}
        for path in sorted((home / package).rglob("*.py")):
            parts = path.relative_to(home).with_suffix("").parts
            modules[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
        for name, path in modules.items():
            used = graph.setdefault(path.relative_to(root).as_posix(), set())
            here = name.split(".") if path.stem == "__init__" else name.split(".")[:-1]
            for node in ast.walk(ast.parse(path.read_text())):
                wanted: list[str] = []
                if isinstance(node, ast.ImportFrom):
                    start = here[: len(here) - node.level + 1] if node.level else []
                    of = ".".join([*start, *([node.module] if node.module else [])])
                    wanted = [f"{of}.{a.name}" if f"{of}.{a.name}" in modules else of for a in node.names]
                elif isinstance(node, ast.Import):
                    wanted = [alias.name for alias in node.names]
                used.update(modules[w].relative_to(root).as_posix() for w in wanted if w in modules and w != name)
    return graph


def circles(graph: dict[str, set[str]]) -> list[list[str]]:
    """Sets of files of which each reaches each other one."""
    reach: dict[str, set[str]] = {}
    for start in graph:
        seen: set[str] = set()
        waiting = [start]
        while waiting:
            for after in graph.get(waiting.pop(), ()):
                if after not in seen:
                    seen.add(after)
                    waiting.append(after)
        reach[start] = seen
    found = {tuple(sorted(b for b in reach[a] if a in reach.get(b, ()))) for a in graph if a in reach[a]}
    return [list(files) for files in sorted(found)]


def units(graph: dict[str, set[str]]) -> dict[str, set[str]]:
    """A header and its source as one."""
    result: dict[str, set[str]] = {}
    for path, used in graph.items():
        unit = path.rpartition(".")[0]
        result.setdefault(unit, set()).update({u.rpartition(".")[0] for u in used} - {unit})
    return result


def wrong_arrows(graph: dict[str, set[str]]) -> list[str]:
    result = []
    for path, used in graph.items():
        rooms = [room for room in ARROWS if path.startswith(room + "/")]
        for other in sorted(used) if rooms else ():
            if not any(other.startswith(allowed + "/") for allowed in ARROWS[max(rooms, key=len)]):
                result.append(f"{path} -> {other}")
    return result


def missing_rooms(root: Path) -> list[str]:
    folders = [f"{top}/{p.name}" for top in ("core", "diagnosis") for p in sorted((root / top).glob("*/"))]
    return [folder for folder in folders if folder not in ARROWS]


def c_words(root: Path) -> list[str]:
    result = []
    for top in ("core", "diagnosis"):
        for path in sorted((root / top).rglob("*.[ch]pp")):
            name = path.relative_to(root).as_posix()
            if name not in C_TEXTS:
                result += [f"{name}: {m[0]}" for m in C_WORD.finditer(path.read_text())]
    return result


def findings(root: Path) -> list[str]:
    root = root.resolve()
    cpp, python = cpp_graph(root), python_graph(root)
    return [
        *(f"circle: {' '.join(files)}" for graph in (units(cpp), python) for files in circles(graph)),
        *(f"arrow: {arrow}" for arrow in wrong_arrows(cpp)),
        *(f"room: {folder}" for folder in missing_rooms(root)),
        *(f"C word: {word}" for word in c_words(root)),
    ]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--root", type=Path, default=Path(__file__).resolve().parents[1], help="the project's folder")
    parser.add_argument("--json", action="store_true", help="print the findings as a JSON list")
    given = parser.parse_args()
    found = findings(given.root)
    print(json.dumps(found, indent=2) if given.json else "\n".join(found))
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())

#!/usr/bin/env python3
"""Prints public names of the Python package without words, and ends with 1 if there are any.

usage: scripts/undocumented.py [FOLDER]      # of the package

Public is what a module's __all__ lists, with the methods, properties and fields of its classes. A field has its words
below it, or in the class's list of attributes.
"""

from __future__ import annotations

import ast
import re
import sys
from pathlib import Path
from typing import Union

PACKAGE = Path(__file__).resolve().parents[1] / "bindings" / "python" / "src" / "clspeckle"
# Its keys are arguments of the stages, under whose names they have their words.
ARGUMENTS = "PipelineParameters"

Named = Union[ast.FunctionDef, ast.ClassDef]


def trees(package: Path) -> list[ast.Module]:
    """Of the package's files, the public ones last."""
    files = sorted(package.rglob("*.py"), key=lambda file: not file.name.startswith("_"))
    return [ast.parse(file.read_text()) for file in files]


def defined(package: Path) -> dict[str, Named]:
    """Functions and classes by name; of two of one name the public module's."""
    return {
        node.name: node
        for tree in trees(package)
        for node in tree.body
        if isinstance(node, (ast.FunctionDef, ast.ClassDef))
    }


def listed(package: Path) -> set[str]:
    """What the modules' __all__ name."""
    found: set[str] = set()
    for tree in trees(package):
        for node in tree.body:
            if isinstance(node, ast.Assign) and any(
                isinstance(t, ast.Name) and t.id == "__all__" for t in node.targets
            ):
                found |= set(ast.literal_eval(node.value))
    return found


def is_attribute(node: ast.ClassDef, name: str) -> bool:
    """Of those that the words of the class list, one or several to a line."""
    return re.search(rf"^ *(?:\w+, )*{name}(?:, \w+)*: ", ast.get_docstring(node) or "", re.MULTILINE) is not None


def members(node: ast.ClassDef) -> dict[str, bool]:
    """Methods, properties and fields that are public, and whether each has words."""
    found: dict[str, bool] = {}
    for place, entry in enumerate(node.body):
        if isinstance(entry, ast.FunctionDef) and not entry.name.startswith("_"):
            found[entry.name] = found.get(entry.name, False) or ast.get_docstring(entry) is not None
        elif isinstance(entry, ast.AnnAssign) and isinstance(entry.target, ast.Name):
            after = node.body[place + 1] if place + 1 < len(node.body) else None
            words = isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant)
            if not entry.target.id.startswith("_"):
                found[entry.target.id] = words or is_attribute(node, entry.target.id)
    return found


def unsaid(node: Named) -> list[str]:
    found = [] if ast.get_docstring(node) else [node.name]
    if isinstance(node, ast.ClassDef) and node.name != ARGUMENTS:
        found += [f"{node.name}.{name}" for name, words in members(node).items() if not words]
    return found


def main() -> int:
    package = Path(sys.argv[1]) if len(sys.argv) > 1 else PACKAGE
    nodes = defined(package)
    missing = [name for public in sorted(listed(package) & set(nodes)) for name in unsaid(nodes[public])]
    for name in missing:
        print(f"{name} has no words: add a docstring", file=sys.stderr)
    return 1 if missing else 0


if __name__ == "__main__":
    sys.exit(main())

"""The top level holds what a newcomer needs, and nothing that a program left there."""

from __future__ import annotations

import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
FILES = {
    ".clang-format", ".gitignore", "CHANGELOG.md", "CITATION.cff", "CMakeLists.txt", "CMakePresets.json",
    "CONTRIBUTING.md", "LICENSE", "README.md", "SECURITY.md", "pyproject.toml",
}  # fmt: skip
FOLDERS = {
    ".ci", "bench", "bindings", "capi", "cmake", "core", "diagnosis", "docs", "examples", "io", "kernels",
    "packaging", "scripts", "tests", "tools", "tuning", "validation",
}  # fmt: skip


def test_top_level() -> None:
    done = subprocess.run(["git", "-C", str(ROOT), "ls-files"], capture_output=True, text=True, check=True)
    tracked = [Path(line).parts for line in done.stdout.splitlines()]
    assert {parts[0] for parts in tracked if len(parts) == 1} == FILES
    assert {parts[0] for parts in tracked if len(parts) > 1} == FOLDERS

"""Folders of tests mirror the sources: what is in core/stages has its tests in tests/core/stages."""

from __future__ import annotations

import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
# Tests of no folder's sources, and what they are of.
OTHERS = {
    "abi": "the shared library",
    "bindings/agreement": "the bindings, with each other",
    "concurrency": "threads and processes",
    "faults": "calls that fail",
    "fuzz": "all readers",
    "house": "the repository",
    "install": "what is installed",
    "memory": "memory over thousands of calls",
    "portability": "other compilers of kernels",
    "reference": "the oracle",
    "runtimes": "other OpenCL runtimes",
    "sanitizers": "everything, under sanitizers",
}
SOURCES = ("bench", "bindings", "capi", "core", "diagnosis", "docs", "examples", "io", "tools", "validation")


def tracked() -> list[Path]:
    done = subprocess.run(["git", "-C", str(ROOT), "ls-files"], capture_output=True, text=True, check=True)
    return [Path(line) for line in done.stdout.splitlines() if (ROOT / line).exists()]


def is_below(folder: str, others: list[str] | dict[str, str]) -> bool:
    return any(folder == other or folder.startswith(other + "/") for other in others)


def test_folders_of_tests_are_folders_or_files_of_sources() -> None:
    files = [path for path in tracked() if path.parts[0] in SOURCES]
    folders = {parent.as_posix() for path in files for parent in path.parents}
    named = {path.with_suffix("").as_posix() for path in files}
    tests = {path.parent.relative_to("tests").as_posix() for path in tracked() if path.parts[0] == "tests"} - {"."}
    lost = {folder for folder in tests if folder not in folders | named and not is_below(folder, OTHERS)}
    assert not lost, f"no sources are called so: {sorted(lost)}"
    assert all((ROOT / "tests" / folder).is_dir() for folder in OTHERS)


def test_programs_stand_with_the_sources_that_they_test() -> None:
    """test_x.cpp of a source x.cpp of the engine, the diagnosis, the readers or a benchmark."""
    homes: dict[str, list[str]] = {}
    for path in tracked():
        if path.parts[0] in ("bench", "core", "diagnosis", "io") and path.suffix in (".cpp", ".hpp"):
            homes.setdefault(path.stem, []).append(path.parent.as_posix())
    wrong = []
    for path in tracked():
        if path.parts[0] != "tests" or path.suffix != ".cpp" or not path.stem.startswith("test_"):
            continue
        source, folder = path.stem.removeprefix("test_"), path.parent.relative_to("tests").as_posix()
        if source in homes and not any(is_below(home, [folder]) or is_below(folder, [home]) for home in homes[source]):
            wrong.append(f"{path.as_posix()}: {source} is in {', '.join(sorted(set(homes[source])))}")
    assert not wrong


def test_whole_diagnoses_are_tests_of_the_room_that_runs_them() -> None:
    """What a test of another room of the diagnosis needs, it makes without a verdict."""
    tests = [
        path for path in tracked() if path.as_posix().startswith("tests/diagnosis/") and path.suffix in (".cpp", ".hpp")
    ]
    others = [path for path in tests if path.parts[2] != "run"]
    wrong = [path.as_posix() for path in others if '#include "run/' in (ROOT / path).read_text()]
    assert len(others) > 20 and not wrong

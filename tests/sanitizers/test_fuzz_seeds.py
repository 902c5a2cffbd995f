"""What the fuzzers begin with, and what they found before (tests/fuzz/corpus), once through the sanitized readers."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from test_sanitizers import ADDRESS_OPTIONS, ROOT, run, sanitized_build

sys.path.insert(0, str(ROOT / "tests" / "fuzz"))

import make_file_seeds
import make_seeds

CORPUS = ROOT / "tests" / "fuzz" / "corpus"
FORMATS = sorted({*make_seeds.FORMATS.values(), "raw"})


@pytest.fixture(scope="session")
def readers() -> Path:
    return (
        sanitized_build("sanitizers/address", "address,undefined", ["clspeckle-image-replay", "clspeckle-file-replay"])
        / "bin"
    )


@pytest.fixture(scope="session")
def seeds(readers: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("seeds")
    make_seeds.main(folder)
    make_file_seeds.main(folder)
    done = run(readers / "clspeckle-file-replay", f"--seeds={folder}", **ADDRESS_OPTIONS)
    assert done.returncode == 0, done.stdout
    return folder


@pytest.mark.parametrize(
    ("program", "option"),
    [("image", f"--format={name}") for name in FORMATS]
    + [("file", f"--kind={name}") for name in make_file_seeds.KINDS],
)
def test_replay(readers: Path, seeds: Path, program: str, option: str) -> None:
    name = option.partition("=")[2]
    files = sorted(path for folder in (seeds / name, CORPUS / name) for path in folder.glob("*"))
    assert files
    done = run(readers / f"clspeckle-{program}-replay", option, *files, **ADDRESS_OPTIONS)
    assert done.returncode == 0, done.stdout[-20000:]
    assert f"{len(files)} files" in done.stdout

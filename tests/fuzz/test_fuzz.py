"""All readers under libFuzzer with AddressSanitizer and UndefinedBehaviorSanitizer, and what fuzzers found before.

In the night each reader runs for ten minutes (CLSPECKLE_FUZZ_SECONDS), begun from small files of its format or kind and
from corpus/, which holds files that once were read wrongly. Every change reads those once, with sanitizers
(tests/sanitizers/test_fuzz_seeds.py). A tool that is missing is a failure.
"""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import make_file_seeds
import make_seeds
import pytest

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
BUILD = Path(os.environ.get("CLSPECKLE_BUILD_DIR", ROOT / "build"))
BIN = Path(os.environ.get("CLSPECKLE_BIN", BUILD / "bin"))
SECONDS = int(os.environ.get("CLSPECKLE_FUZZ_SECONDS", "600"))
FORMATS = sorted({*make_seeds.FORMATS.values(), "raw"})
KINDS = make_file_seeds.KINDS
LIMITS = ["-timeout=10", "-rss_limit_mb=1500"]


@pytest.fixture(scope="session")
def seeds(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("seeds")
    make_seeds.main(folder)
    make_file_seeds.main(folder)
    run(BIN / "clspeckle-file-replay", f"--seeds={folder}")
    return folder


def inputs(seeds: Path, name: str) -> list[Path]:
    return sorted(path for folder in (seeds / name, HERE / "corpus" / name) for path in folder.glob("*"))


def run(*command: object, **variables: str) -> str:
    done = subprocess.run(
        list(map(str, command)), capture_output=True, check=False, text=True, errors="replace", timeout=3000,
        env={**os.environ, **variables},
    )  # fmt: skip
    assert done.returncode == 0, (done.stdout + done.stderr)[-10000:]
    return done.stdout + done.stderr


@pytest.mark.parametrize("name", [*FORMATS, *KINDS])
def test_every_reader_has_something_to_begin_with(seeds: Path, name: str) -> None:
    assert inputs(seeds, name)


@pytest.fixture(scope="session")
def fuzzers() -> Path:
    build = BUILD / "fuzz"
    run("cmake", "-G", "Ninja", "-S", ROOT, "-B", build, "-DCMAKE_C_COMPILER=clang", "-DCMAKE_CXX_COMPILER=clang++",
        "-DCMAKE_BUILD_TYPE=None", "-DCMAKE_C_FLAGS=-O1 -g1", "-DCMAKE_CXX_FLAGS=-O1 -g1", "-DCLSP_BUILD_FUZZERS=ON",
        "-DCLSP_BUILD_TOOLS=ON", "-DCLSP_BUILD_EXAMPLES=OFF", "-DCLSP_BUILD_BENCH=OFF",
        "-DCLSP_BUILD_TESTS=OFF")  # fmt: skip
    run("cmake", "--build", build, "--parallel", "2", "--target", "fuzz_images", "fuzz_files")
    return build / "bin"


def fuzz(name: str, seeds: Path, tmp_path: Path, *command: object) -> None:
    folders = [tmp_path, seeds / name]
    if (HERE / "corpus" / name).is_dir():
        folders.append(HERE / "corpus" / name)
    run(*command, *folders, f"-max_total_time={SECONDS}", f"-artifact_prefix={tmp_path}/", *LIMITS)
    assert len(list(tmp_path.iterdir())) > 5, "it found no new paths: nothing was fuzzed"


@pytest.mark.nightly
@pytest.mark.parametrize("name", FORMATS)
def test_fuzzers(seeds: Path, fuzzers: Path, tmp_path: Path, name: str) -> None:
    fuzz(name, seeds, tmp_path, fuzzers / "fuzz_images", f"--format={name}", "-max_len=4000")


@pytest.mark.nightly
@pytest.mark.parametrize("kind", KINDS)
def test_fuzzers_of_files(seeds: Path, fuzzers: Path, tmp_path: Path, kind: str) -> None:
    fuzz(kind, seeds, tmp_path, fuzzers / "fuzz_files", f"--kind={kind}", "-max_len=8000", f"-dict={seeds / 'words'}")

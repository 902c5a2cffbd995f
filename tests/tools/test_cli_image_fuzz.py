"""Damaged files of every format and layout, fed to the readers within one process.

The program of fuzz_image_io.cpp lies beside the command line program."""

from __future__ import annotations

import os
import re
import subprocess
from pathlib import Path

import cli_images as images
import pytest
from cli_support import PROGRAM

FUZZ = PROGRAM.parent / "clspeckle-image-fuzz"
ITERATIONS = int(os.environ.get("CLSPECKLE_IMAGE_FUZZ_ITERATIONS", "300"))


@pytest.mark.parametrize("suffix", sorted({Path(name).suffix for name in images.FORMATS}))
def test_damaged_files(tmp_path: Path, suffix: str) -> None:
    if not FUZZ.is_file():
        pytest.fail(f"{FUZZ} does not exist: build it with the tests")
    names = [name for name in images.FORMATS if name.endswith(suffix)]
    (tmp_path / "seeds").mkdir()
    (tmp_path / "scratch").mkdir()
    for name in names:
        images.FORMATS[name][0](tmp_path / "seeds" / name)
    done = subprocess.run(
        [FUZZ, tmp_path / "seeds", str(ITERATIONS), "20240607"],
        capture_output=True,
        check=False,
        text=True,
        timeout=3000,
        env={**os.environ, "TMPDIR": str(tmp_path / "scratch")},
    )
    assert done.returncode == 0, done.stdout + done.stderr
    read = {m[1]: int(m[2]) for m in re.finditer(r"^(\S+): (\d+) of \d+ damaged files read", done.stdout, re.MULTILINE)}
    assert set(read) == set(names)
    # A loop that damages nothing would accept all of them.
    assert all(count < ITERATIONS * 0.8 for count in read.values()), read

"""scripts/same_bytes.py sees what is the same, and what is not."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SCRIPT = ROOT / "scripts" / "same_bytes.py"
BUILD = Path(os.environ.get("CLSPECKLE_BUILD_DIR", ROOT / "build"))


def run(*words: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, SCRIPT, *words]
    return subprocess.run([str(word) for word in command], check=False, capture_output=True, text=True)


def test_a_build_is_the_same_as_itself() -> None:
    done = run(BUILD, BUILD, "--only", "frame, ")
    assert done.returncode == 0, done.stderr
    assert "6 of 6 cases are the same" in done.stdout


def test_other_noise_is_seen(tmp_path: Path) -> None:
    program = tmp_path / "bin" / "clspeckle"
    program.parent.mkdir()
    program.write_text(f'#!/bin/sh\nexec {BUILD}/bin/clspeckle "$@" --read-noise-dn 3\n')
    program.chmod(0o755)
    done = run(BUILD, tmp_path, "--only", "frame, plain")
    assert done.returncode == 1
    assert "0 of 1 cases are the same" in done.stdout
    assert "frame, plain: " in done.stderr and "from byte" in done.stderr


def test_a_command_that_fails_on_both_sides_is_not_the_same(tmp_path: Path) -> None:
    (tmp_path / "set").mkdir()  # without capture.json
    done = run(BUILD, BUILD, "--sets", tmp_path / "set", "--only", "check of")
    assert done.returncode == 1
    assert "0 of 1 cases are the same" in done.stdout
    assert "fails before, and compares nothing" in done.stderr


def test_a_build_that_is_not_there_is_refused(tmp_path: Path) -> None:
    done = run(BUILD, tmp_path)
    assert done.returncode == 2
    assert "no program at" in done.stderr

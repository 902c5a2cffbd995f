"""Where the sums over pixels are taken changes no bit of a report; a wrong word for it is refused."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
PROGRAM = Path(os.environ.get("CLSPECKLE_CLI", ROOT / "build" / "bin" / "clspeckle"))


def run(*words: object, statistics: str) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "CLSPECKLE_STATISTICS": statistics, "CLSPECKLE_LOG": "info"}
    command = [str(word) for word in (PROGRAM, *words)]
    return subprocess.run(command, env=environment, check=False, capture_output=True, text=True)


def test_the_same_report_by_host_and_device(tmp_path: Path) -> None:
    size = ["--width", "96", "--height", "80", "--frames", "8", "--seed", "3", "--quiet"]
    made = run("capture", "make", tmp_path / "set", "--effect", "gamma:gamma=0.8", *size, statistics="auto")
    assert made.returncode == 0, made.stderr
    for place in ("host", "device"):
        done = run("diagnose", tmp_path / "set", "--json", tmp_path / place, statistics=place)
        assert done.returncode == 0, done.stderr
        assert ("the device takes the statistics' sums" in done.stderr) == (place == "device")
    assert (tmp_path / "host").read_text() == (tmp_path / "device").read_text()
    refused = run("diagnose", tmp_path / "set", "--quiet", statistics="gpu")
    assert refused.returncode == 1
    assert 'CLSPECKLE_STATISTICS is "gpu"; set it to auto, host or device' in refused.stderr

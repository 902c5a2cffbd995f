"""Where a search that goes by first looks would end too early.

A defocus of 0.77 waves at f/8 promised a tenth of the gap by the change that one of 0.95 makes, less than a fifth of what
subsurface scattering did; it got no fit, and the verdict was `unknown`. The set is one of the full plan's with seed 28.
"""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path

from withheld.camera import draw_camera
from withheld.generator import write_capture

ROOT = Path(__file__).resolve().parents[2]
PROGRAM = Path(os.environ.get("CLSPECKLE_CLI", ROOT / "build" / "bin" / "clspeckle"))


def test_what_bends_is_looked_at_again(tmp_path: Path) -> None:
    waves = 0.7686956926046582
    write_capture(tmp_path, draw_camera(629797011), {"defocus": {"waves": waves}}, 40, 749373475)
    command = [PROGRAM, "diagnose", tmp_path, "--json", tmp_path / "report.json", "--quiet"]
    done = subprocess.run([str(word) for word in command], env={**os.environ, "CLSPECKLE_FFT": "fused"}, check=False,
                          capture_output=True, text=True)  # fmt: skip
    assert done.returncode == 0, done.stderr
    cause = json.loads((tmp_path / "report.json").read_text())["cause"]
    assert (cause["verdict"], cause["effects"]) == ("named", ["defocus"])
    low, high = cause["ranking"][0]["intervals"]["waves"]
    assert 0.95 * waves < low < high < 1.05 * waves

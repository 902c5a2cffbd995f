"""The withheld-effect check's small plan through the program: 12 sets of 96 x 80 pixels, 16 frames, strong effects.

Too few for a measurement: what is asserted holds unless something is broken. The two nulls raise a false alarm each
with a probability of 2 %; of the five strong single effects three must be named, where the full check names nine of
ten.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
PROGRAM = Path(os.environ.get("CLSPECKLE_CLI", ROOT / "build" / "bin" / "clspeckle"))
LEAST_NAMED = 3


def test_small_plan(tmp_path: Path) -> None:
    command = [PROGRAM, "gap", "check", "--plan", "small", "--out", "check", "--json", "score.json", "--python",
               sys.executable, "--generator", ROOT / "validation" / "gap_check", "--jobs", "2"]  # fmt: skip
    done = subprocess.run([str(word) for word in command], cwd=tmp_path, check=False, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    score = json.loads((tmp_path / "score.json").read_text())
    assert score["sets"] == {"null": 2, "single": 5, "pair": 1, "many": 1, "outside": 2, "without": 1}
    assert not score["missing"]
    figures = {figure["id"]: figure for figure in score["figures"]}
    assert figures["failed"]["successes"] == 0, f"a diagnosis wrote no report\n{done.stderr}"
    assert figures["false_alarms"]["successes"] == 0, score["wrong"]
    assert figures["detected"]["successes"] == 5, score["wrong"]
    assert figures["top1"]["successes"] >= LEAST_NAMED, score["wrong"]
    assert {
        "pairs_both",
        "many_recall",
        "outside_unknown",
        "without_unknown",
        "interval_coverage",
        "residual_gone",
    } <= figures.keys()
    assert "exactly named" in done.stdout

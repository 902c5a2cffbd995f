"""Active stereo: the noise that speckle gives a disparity, against theory."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
EXAMPLE = ROOT / "examples" / "active_stereo" / "active_stereo.py"


def test_disparity_noise_follows_contrast(tmp_path: Path) -> None:
    """Within a tenth of theory, at two contrasts.

    1,000 windows of one fixed seed give the noise to 4.5 % (one standard deviation, by ten runs of other seeds, whose
    mean is 0.7 % below theory). Light that is not brought to the same exposure is off by half.
    """
    table = tmp_path / "table.json"
    command = [sys.executable, EXAMPLE, "--f-number", "5.6", "--json", table, "--figure", tmp_path / "figure.png"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    polarized, depolarized = json.loads(table.read_text())["rows"]
    for row in (polarized, depolarized):
        assert abs(row["least_squares_px"] / row["theory_px"] - 1) < 0.1, row
    assert abs(depolarized["theory_px"] / polarized["theory_px"] - 0.5**0.5) < 1e-6
    assert depolarized["matcher_px"] < 0.9 * polarized["matcher_px"]
    assert depolarized["wrong_share"] < 0.5 * polarized["wrong_share"]
    assert (tmp_path / "figure.png").stat().st_size > 20000

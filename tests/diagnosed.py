"""A capture set diagnosed by the program."""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path
from typing import Any

PROGRAM = Path(os.environ.get("CLSPECKLE_CLI", Path(__file__).parents[1] / "build" / "bin" / "clspeckle"))


def diagnosed(folder: Path) -> dict[str, Any]:
    """The report of the set in a folder."""
    command = [str(PROGRAM), "diagnose", str(folder), "--json", "-", "--quiet"]
    done = subprocess.run(command, check=False, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    report: dict[str, Any] = json.loads(done.stdout)
    return report

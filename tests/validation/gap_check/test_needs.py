"""What `python -m gap_check` needs is named where it is missing."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]


def test_a_missing_package_is_named(tmp_path: Path) -> None:
    (tmp_path / "scipy.py").write_text('raise ModuleNotFoundError("No module named scipy", name="scipy")\n')
    path = os.pathsep.join([str(tmp_path), str(ROOT / "validation")])
    done = subprocess.run(
        [sys.executable, "-m", "gap_check", "effects"],
        capture_output=True, text=True, check=False, env={**os.environ, "PYTHONPATH": path},
    )  # fmt: skip
    assert done.returncode == 1
    assert "scipy is not installed" in done.stderr
    assert "Traceback" not in done.stderr
    (needs,) = re.findall(r"pip install -r (\S+)", done.stderr)
    assert "scipy" in Path(needs).read_text()

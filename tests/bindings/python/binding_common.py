"""Names that the tests of the Python binding share."""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from pathlib import Path

SHAPE = (32, 48)
"""(height, width) of the images; small, and with two different sides."""

ROOT = Path(__file__).resolve().parents[3]
"""The checkout."""

Runner = Callable[..., "subprocess.CompletedProcess[str]"]
"""What the fixture run_python gives."""

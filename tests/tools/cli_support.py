"""What the tests of the command line program share."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
PROGRAM = Path(os.environ.get("CLSPECKLE_CLI", ROOT / "build" / "bin" / "clspeckle"))


@dataclass(frozen=True)
class Run:
    """A finished run of the program."""

    code: int
    out: str
    err: str

    def json(self) -> dict:
        return json.loads(self.out)


def frames(folder: Path) -> list[np.ndarray]:
    """The NPY frames of a run, in order."""
    return [np.load(path) for path in sorted(folder.glob("frame_*.npy"))]

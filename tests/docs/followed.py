"""A page followed to the letter: its commands, files and Python, in order, in a folder like the checkout.

A reader is promised a result within ten minutes: a page that takes longer, all its commands together, is an error."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
BUILD = Path(os.environ.get("CLSPECKLE_BUILD_DIR", ROOT / "build"))
# ```sh is run, ```python is run, and ```LANGUAGE FILE (as the comment in the line before names it) is written.
BLOCK = re.compile(r"(?:<!-- file: (\S+) -->\n)?```(\w+)\n(.*?)```", re.DOTALL)
TEN_MINUTES_S = 600.0
WRAPPER = """#!/bin/sh
exec "{python}" "$@"
"""


@dataclass(frozen=True)
class Checkout:
    folder: Path

    @classmethod
    def make(cls, folder: Path) -> Checkout:
        """What a page may name of a checkout that is built; what is written stays out of the real one."""
        for name in ("examples", "capi", "bindings", "scripts", "docs"):
            (folder / name).symlink_to(ROOT / name)
        (folder / "build").symlink_to(BUILD)
        python = folder / ".venv" / "bin" / "python"
        python.parent.mkdir(parents=True)
        python.write_text(WRAPPER.format(python=sys.executable))
        python.chmod(0o755)
        return cls(folder)

    def follow(self, page: Path, within_s: float = TEN_MINUTES_S) -> str:
        """Runs the page; returns what its commands print. A command that fails is an error with its words."""
        end = time.monotonic() + within_s
        printed = []
        for file, language, text in BLOCK.findall(page.read_text()):
            if file:
                (self.folder / file).write_text(text)
            if language == "sh":
                printed.append(self.run(["bash", "-euo", "pipefail", "-c", text], end))
            elif language == "python":
                printed.append(self.run([sys.executable, "-c", text], end))
        return "".join(printed)

    def run(self, command: list[str], end: float) -> str:
        environment = {
            **os.environ,
            "PATH": f"{self.folder / '.venv' / 'bin'}:{os.environ['PATH']}",
            "MPLBACKEND": "agg",
        }
        left = max(end - time.monotonic(), 0.0)
        done = subprocess.run(
            command, cwd=self.folder, env=environment, capture_output=True, text=True, check=False, timeout=left
        )
        assert done.returncode == 0, f"{command[-1]}\n{done.stdout}\n{done.stderr}"
        return done.stdout

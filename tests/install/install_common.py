"""What the tests of installing share."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
BUILD = Path(os.environ.get("CLSPECKLE_BUILD_DIR", ROOT / "build"))
CC = os.environ.get("CLSPECKLE_C_COMPILER", "cc")
CXX = os.environ.get("CLSPECKLE_CXX_COMPILER", "c++")
STRICT = ["-Wall", "-Wextra", "-Wpedantic", "-Werror"]


def run(*command: object, env: dict[str, str] | None = None) -> str:
    """Runs a command; its output is shown if it fails."""
    words = [str(word) for word in command]
    done = subprocess.run(words, check=False, capture_output=True, text=True, env={**os.environ, **(env or {})})
    assert done.returncode == 0, f"{shlex.join(words)}\n{done.stdout}\n{done.stderr}"
    return done.stdout


def checksum(program: Path, **env: str) -> str:
    output = run(program, env=env)
    assert re.fullmatch(r"checksum \d+\n", output), output
    return output


def configure(source: Path, build: Path, *arguments: str) -> None:
    run("cmake", "-S", source, "-B", build, f"-DCMAKE_C_COMPILER={CC}", f"-DCMAKE_CXX_COMPILER={CXX}",
        f"-DCONSUMER_FLAGS={';'.join(STRICT)}", *arguments)  # fmt: skip


def release() -> tuple[str, str]:
    """Release number and ABI number, as the header has them."""
    text = (ROOT / "capi" / "include" / "clspeckle" / "types.h").read_text()
    abi = re.search(r"#define CLSP_ABI_VERSION (\d+)", text)
    assert abi is not None
    return ".".join(re.findall(r"#define CLSP_VERSION_\w+ (\d+)", text)), abi[1]

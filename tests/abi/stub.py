"""A library that has the functions of the public headers and nothing else: stub.py OUTPUT

It compiles in a second and has the headers' ABI: the compiler holds the real functions to the same declarations, and
test_abi.py the real library to the same symbols.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
HEADERS = ROOT / "capi" / "include" / "clspeckle"
CC = os.environ.get("CLSPECKLE_C_COMPILER", "cc")


def declared(headers: Path = HEADERS) -> dict[str, str]:
    """Every function of the headers with its declaration."""
    text = "".join(path.read_text() for path in sorted(headers.glob("*.h")))
    text = re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL)
    found = re.findall(r"^CLSP_API\s+([^;{]*?\b(clsp\w+)\s*\([^;]*\))\s*;", text, re.MULTILINE)
    return {name: declaration for declaration, name in found}


def build(library: Path, headers: Path = HEADERS) -> None:
    abi = re.search(r"#define CLSP_ABI_VERSION (\d+)", (HEADERS / "types.h").read_text())
    assert abi is not None
    bodies = (f"{declaration} {{ return 0; }}\n" for declaration in declared(headers).values())
    command = [CC, "-std=c99", "-g", "-shared", "-fPIC", f"-Wl,-soname,libclspeckle.so.{abi[1]}",
               f"-Wl,--version-script={ROOT / 'capi' / 'clspeckle.map'}", f"-I{headers.parent}", "-x", "c", "-", "-o",
               str(library)]  # fmt: skip
    done = subprocess.run(
        command,
        input="#include <clspeckle/clspeckle.h>\n" + "".join(bodies),
        check=False,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, f"{command}\n{done.stderr}"


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: stub.py OUTPUT")
    build(Path(sys.argv[1]))

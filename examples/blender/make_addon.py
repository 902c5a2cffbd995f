#!/usr/bin/env python3
"""Writes the add-on as one archive that Blender installs (Preferences > Add-ons > Install from Disk).

python examples/blender/make_addon.py clspeckle_camera.zip
"""

from __future__ import annotations

import sys
import zipfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
FILES = [*sorted((HERE / "clspeckle_camera").glob("*.py")), HERE.parent / "camera_view.py"]


def main() -> int:
    if len(sys.argv) != 2 or not sys.argv[1].endswith(".zip"):
        print("usage: make_addon.py FILE.zip", file=sys.stderr)
        return 1
    with zipfile.ZipFile(sys.argv[1], "w", zipfile.ZIP_DEFLATED) as archive:
        for file in FILES:
            archive.write(file, f"clspeckle_camera/{file.name}")
    return 0


if __name__ == "__main__":
    sys.exit(main())

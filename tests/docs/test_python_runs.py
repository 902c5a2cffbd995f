"""The Python of every page runs, block after block, each page in a folder of its own."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import followed
import pytest

ROOT = followed.ROOT
BIN = Path(os.environ.get("CLSPECKLE_BIN", ROOT / "build" / "bin"))
# Their blocks are files of examples/readme (test_readme_examples.py), or other tests run them.
ELSEWHERE = {"README.md", "docs/guide/frames.md", "docs/guide/captures.md", "docs/reference/profile.md"}
CAPTURE = "capture make my-camera --sequences dark,flat --width 64 --height 48 --frames 8 --effect shot_noise --seed 3"
SCENE = """import clspeckle, numpy as np
texels = np.ones((64, 64), np.float32)
left_geometry = right_geometry = clspeckle.Geometry(
    depth=np.ones((480, 640), np.float32), intrinsics=(500, 500, 320, 240)
)
"""
PAIRS = """import numpy as np
from clspeckle import dataset
recipe = dataset.Recipe(scenes=[np.ones((48, 64), np.float32)], effects=["prnu"], effects_per_image=(1, 1))
"""
# What a page takes as given: commands of the program, Python before a block, by the block's number.
GIVEN: dict[str, tuple[list[str], dict[int, str]]] = {
    "docs/guide/datasets.md": (
        [],
        {
            0: PAIRS + 'dataset.write(recipe, "set", count=18, format="zarr")\n',
            2: PAIRS + 'dataset.write(recipe, "set", count=2)\n',
        },
    ),
    "docs/guide/stereo.md": ([], {0: SCENE}),
    "docs/method/diagnosis.md": ([CAPTURE], {}),
}
# Each begins anew: what is written has the same name.
APART = {"docs/guide/datasets.md"}


def blocks(page: Path) -> list[str]:
    return re.findall(r"^```python\n(.*?)^```", page.read_text(), re.DOTALL | re.MULTILINE)


def pages() -> dict[str, list[str]]:
    found = {page.relative_to(ROOT).as_posix(): blocks(page) for page in sorted((ROOT / "docs").rglob("*.md"))}
    return {name: code for name, code in found.items() if code and name not in ELSEWHERE and "/tutorials/" not in name}


@pytest.mark.parametrize("name", pages())
def test_it_runs(name: str, tmp_path: Path) -> None:
    commands, before = GIVEN.get(name, ([], {}))
    for command in commands:
        subprocess.run([BIN / "clspeckle", *command.split()], check=True, cwd=tmp_path, capture_output=True)
    code = [before.get(place, "") + block for place, block in enumerate(pages()[name])]
    for place, text in enumerate(code if name in APART else ["\n".join(code)]):
        folder = tmp_path / str(place) if name in APART else tmp_path
        folder.mkdir(exist_ok=True)
        (folder / "page.py").write_text(text)
        done = subprocess.run(
            [sys.executable, "page.py"], cwd=folder, capture_output=True, text=True, check=False, timeout=300
        )
        assert done.returncode == 0, f"{text}\n{done.stdout}\n{done.stderr}"


def test_what_others_run_is_there() -> None:
    assert [name for name in ELSEWHERE if not blocks(ROOT / name)] == []
    assert [name for name in GIVEN if name not in pages()] == []

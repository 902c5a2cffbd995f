"""The Python of docs/guide/captures.md runs and prints what it should; its capture.json is one."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest

import clspeckle

PAGE = (Path(__file__).resolve().parents[3] / "docs" / "guide" / "captures.md").read_text()


def test_the_python_runs(capsys: pytest.CaptureFixture[str]) -> None:
    (code,) = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    exec(compile(code, "docs/guide/captures.md", "exec"), {})
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "dark 0 4" and lines[1] == "flat 336 9"
    assert any("boiling" in line for line in lines)


def test_the_description_is_one(tmp_path: Path) -> None:
    (text,) = re.findall(r"```json\n(.*?)```", PAGE, re.DOTALL)
    root = json.loads(text)
    draw = np.random.default_rng(2)
    for sequence in root["sequences"]:
        # Arrays stand for the images; the page's point here is the description.
        sequence["file"] = sequence["name"] + ".npy"
        sequence.pop("mask", None)
        np.save(tmp_path / sequence["file"], np.rint(draw.normal(200, 4, (2, 160, 192))).astype(np.uint16))
    (tmp_path / "capture.json").write_text(json.dumps(root))
    capture = clspeckle.Capture.open(tmp_path)
    assert [s.exposure_ms for s in capture.sequences.values()] == [None, 5.0, 10.0, None, None]
    assert capture.sequences["dots_static"].f_number == 4.0

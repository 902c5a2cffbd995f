"""Two builds of a benchmark program side by side: ratios, their intervals, and what is refused."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parents[2] / "bench" / "two_programs.py"
# A program of Google Benchmark whose processor times are 10 ms and 40 us times FACTOR, one run in ten three times as
# long, as beside other programs; the second benchmark's unit is another one.
PROGRAM = """#!{python}
import json, pathlib
count = pathlib.Path(__file__).with_suffix(".count")
runs = int(count.read_text()) if count.exists() else 0
count.write_text(str(runs + 1))
runs += len("{own}")  # each is disturbed in rounds of its own
slow = 3 if runs % 10 == 9 else 1 + 0.001 * (runs % 3)
entry = lambda name, unit, time: dict(name=name, time_unit=unit, cpu_time=time * {factor} * slow, real_time=time)
entries = [entry("frame", "ms", 10), entry("sum", "us", 40), entry("{own}", "ns", 1)]
print(json.dumps(dict(benchmarks=entries if {known} else [])))
"""


def program(path: Path, factor: float, own: str, known: bool = True) -> Path:
    path.write_text(PROGRAM.format(python=sys.executable, factor=factor, own=own, known=known))
    path.chmod(0o755)
    return path


def run(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, SCRIPT, *arguments], capture_output=True, text=True, check=False)


def test_ratios_are_those_of_the_programs_whatever_disturbs_a_run(tmp_path: Path) -> None:
    first, second = program(tmp_path / "first", 1, "one"), program(tmp_path / "second", 1.1, "other")
    done = run(first, second, "--rounds", "10", "--json", tmp_path / "times.json")
    assert done.returncode == 0, done.stderr
    ratios = json.loads((tmp_path / "times.json").read_text())["ratios"]
    assert list(ratios["cpu_time"]) == ["frame", "sum", "all"]  # what both have
    for row in ratios["cpu_time"].values():
        assert row["least"] == pytest.approx(1.1)
        assert row["low"] <= row["median"] <= row["high"]
        assert row["median"] == pytest.approx(1.1, abs=0.003)
        assert 1.09 < row["low"] < row["high"] < 1.11
    assert ratios["cpu_time"]["sum"]["first_ms"] == pytest.approx(0.04, rel=0.01)
    assert ratios["real_time"]["all"]["median"] == 1
    assert re.search(r"^\| frame \| 10\.0\d \| 11\.0\d \| 1\.100 \| 1\.\d{3} \|", done.stdout, re.MULTILINE)


@pytest.mark.parametrize(
    ("known", "options", "words"),
    [
        (False, (), "no benchmark of both programs matches '.'"),
        (True, ("--rounds", "1"), "--rounds: at least 2"),
    ],
)
def test_what_cannot_be_compared_is_refused(known: bool, options: tuple[str, ...], words: str, tmp_path: Path) -> None:
    first, second = program(tmp_path / "first", 1, "one"), program(tmp_path / "second", 1, "other", known)
    done = run(first, second, *options)
    assert done.returncode != 0
    assert words in done.stderr

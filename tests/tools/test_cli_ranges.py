"""Every number that an option takes has a range in its help, and what lies beyond it, or is no number, is refused."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest

# What each command needs beside the option; what would be read or written comes after the options are judged.
COMMANDS = {
    "render": ["ideal.npy", "-o", "out"],
    "depth": ["ideal.npy", "--dots", "dots.txt", "--geometry", "rig.json"],
    "doe design": ["-o", "element"],
    "doe layout": ["-o", "layout"],
    "doe pattern": ["element.npy", "-o", "pattern.npy"],
    "doe inspect": ["element.npy"],
    "capture init": ["."],
    "capture make": ["set"],
    "diagnose": ["set"],
    "statistics": ["ideal.npy"],
}
OPTION = re.compile(r"^  (?:-\w, )?(--[a-z-]+)(?:,--[a-z-]+)* (NUMBER|INTEGER)(?:\|\w+)?(,\.\.\.)?\s", re.MULTILINE)
NUMBER = r"(-?\d[\d.e+-]*)"
# Of several values, with a rule of their own.
OTHERS = {"--size", "--texels", "--flat-level", "--board-level", "--dots-level", "--frames"}


def options_of(text: str) -> dict[str, tuple[bool, float, float, int]]:
    """By name: a whole number or not, the range that the help gives, and how many numbers there are."""
    found = {}
    heads = list(OPTION.finditer(text))
    for head in heads:
        words = text[head.end() :].split("\n  -")[0].split("\n\n")[0]
        words = " ".join(words.split()).replace("2^64 - 1", str(2**64 - 1))
        if head[1] in OTHERS:
            continue
        ranges = re.findall(rf"{NUMBER} to {NUMBER}", words)
        assert ranges, f"{head[1]}: {words}"
        low, high = (float(end.rstrip(".")) for end in ranges[-1])
        count = int(match[1]) if (match := re.search(r"(\d+) numbers, each", words)) else 1
        found[head[1]] = (head[2] == "INTEGER", low, high, count)
    assert heads
    return found


@pytest.mark.parametrize("command", COMMANDS)
def test_numbers_beyond_a_range_are_refused(cli, tmp_path: Path, command: str) -> None:
    np.save(tmp_path / "ideal.npy", np.ones((8, 8), np.float32))
    for name, (whole, low, high, count) in options_of(cli(*command.split(), "--help").out).items():
        assert -math.inf < low < high < math.inf
        values = ["nan", "inf", "-inf", "", "x"]
        if whole:
            values += ["1.5", "-1", str(2**64), *([str(int(high) + 1)] if high < 2**63 else [])]
        else:
            values += [f"{high * 1.01 + 1e-9:.17g}", f"{low - 0.01 * abs(low) - 1e-9:.17g}"]
        if low > 0:
            values += ["0", "-1"]
        if name in ("--saturation-dn", "--motion-boiling"):
            values.remove("inf")
        for value in values:
            result = cli(*command.split(), *COMMANDS[command], f"{name}={','.join([value] * count)}")
            assert result.code != 0, f"{command} {name}={value} was taken"
            assert name in result.err, f"{name}={value}: {result.err}"
        assert not (tmp_path / "out").exists()

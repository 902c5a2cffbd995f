"""Every key of a report stands in docs/reference/gap-report.md: in a row of its own, once, or in its holder's row.

So does every key of a camera profile in docs/reference/profile.md."""

from __future__ import annotations

import json
import re
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
from test_cli_diagnose import QUICK, write_set

ROOT = Path(__file__).resolve().parents[2]
# Their keys are names of other lists, or those of another table: parameters, effects, the page on EMVA 1288.
NAMES = ("cause.ranking.parameters", "cause.ranking.intervals", "scales", "calibration.with_effects", "emva1288")


def keys(value: Any, path: str = "") -> set[str]:
    if isinstance(value, list):
        return set().union(*(keys(item, path) for item in value))
    if not isinstance(value, dict):
        return set()
    here = {f"{path}.{key}".lstrip("."): item for key, item in value.items()}
    return set(here).union(*(keys(item, name) for name, item in here.items() if name not in NAMES))


def described() -> tuple[Counter[str], dict[str, set[str]]]:
    """How often each key has a row, and the words in code of its row. `a[].b`, `c` stands for a.b and a.c."""
    page = (ROOT / "docs" / "reference" / "gap-report.md").read_text()
    table = page[: page.index("A distance is")]
    rows: Counter[str] = Counter()
    words: dict[str, set[str]] = {}
    for cell, rest in re.findall(r"^\| (`.*?) \|(.*)$", table, re.MULTILINE):
        names = [name.replace("[]", "") for name in re.findall(r"`([^`]+)`", cell)]
        holder = names[0].rpartition(".")[0]
        for name in names:
            if name == "..._error":  # of each before it
                full = [f"{holder}.{other.rpartition('.')[2]}_error" for other in names if other != name]
            else:
                full = [name if name == names[0] else f"{holder}.{name}".lstrip(".")]
            for one in full:
                rows[one] += 1
                words[one] = set(re.findall(r"`(\w+)`", rest))
    return rows, words


def test_every_key_is_described_once(ok, tmp_path: Path) -> None:
    write_set(tmp_path / "set", 0)
    flat = np.load(tmp_path / "set" / "flat.npy")
    flat[:, :, flat.shape[2] // 2 :] += 20
    np.save(tmp_path / "set" / "flat.npy", flat)
    report = ok("diagnose", "set", "--json", "-", "--quiet", *QUICK).json()
    rows, words = described()
    assert [name for name, count in rows.items() if count > 1] == []
    found = keys(report)
    assert len(found) > 100

    def is_described(key: str) -> bool:
        if rows[key] or any(name.startswith(key + ".") for name in rows):
            return True
        holder, _, name = key.rpartition(".")
        while holder:
            if name in words.get(holder, ()):
                return True
            holder = holder.rpartition(".")[0]
        return False

    assert [key for key in sorted(found) if not is_described(key)] == []


def test_every_key_of_a_profile_is_described(ok, tmp_path: Path) -> None:
    ok("capture", "make", "set", "--sequences", "dark,flat", "--width", 64, "--height", 48, "--frames", 16, "--seed", 3,
       "--effect", "shot_noise:dn_per_electron=0.4")  # fmt: skip
    ok("diagnose", "set", "--profile", "camera.json", "--quiet", *QUICK)
    profile = json.loads((tmp_path / "camera.json").read_text())
    assert profile["effects"]
    assert profile["maps"]
    page = (ROOT / "docs" / "reference" / "profile.md").read_text()
    rows = re.findall(r"^\| .*", page, re.MULTILINE)
    told = {word for row in rows for word in re.findall(r"[`.](\w+)(?=[`.\[])", row)}
    names = ("effects.parameters", "effects.intervals")  # of the catalogue
    found = {key for key in keys(profile) if not key.startswith(tuple(f"{name}." for name in names))}
    assert len(found) > 40
    assert {key for key in found if key.rpartition(".")[2] not in told} == set()

"""Nothing names a folder that only some machines have: a home, or what lies beside the checkout."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
TEXTS = (".md", ".py", ".sh", ".txt", ".hpp", ".cpp", ".h", ".cl", ".c", ".cmake", ".toml", ".json", ".yml", ".cff")
OF_SOMEBODY = re.compile(r"(?<![\w.])/(?:home|Users|work|root|mnt|media)/(?!\.\.)[\w.-]+")
BESIDE = re.compile(r"(?:\$ROOT|\$\(pwd\)|ROOT|checkout)[\"']?\s*/\s*[\"']?\.\.")


def files() -> list[Path]:
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, check=True, capture_output=True, text=True).stdout.split(
        "\n"
    )
    return [ROOT / name for name in listed if name.endswith(TEXTS)]


def named(text: str) -> list[str]:
    return [match[0] for pattern in (OF_SOMEBODY, BESIDE) for match in pattern.finditer(text)]


def test_no_file_names_such_a_folder() -> None:
    found = {file.relative_to(ROOT).as_posix(): named(file.read_text(errors="replace")) for file in files()}
    assert len(found) > 1000
    assert {name: places for name, places in found.items() if places} == {}


@pytest.mark.parametrize("text", ["see {}home/me/frames", "DATA={}work/sets", '(ROOT {} ".." / "shared")'])
def test_what_is_found(text: str) -> None:
    assert named(text.format("/"))

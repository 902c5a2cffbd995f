"""The recipes of docs/guide/architecture.md name files and words that are there, and commits that went that way."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = ("core", "diagnosis", "docs", "io", "kernels", "tests", "tools", "validation")
PAGE = (ROOT / "docs/guide/architecture.md").read_text()
RECIPES = dict(re.findall(r"\*\*Add (.*?)\*\*(.*?)(?=\n\*\*|\Z)", PAGE.split("## Recipes")[1], re.DOTALL))
# What the commits that a recipe names must have touched between them: old folders, same steps.
STEPS = {
    "an effect": ("core/effects/effects.cpp", "tests/core/effects/", "docs/effects.md", "validation/gap_check/"),
    "a stage or kernel.": (
        "kernels/stages/", "core/stages/", "core/pipeline/frame_plan.hpp", "tests/core/",
        "tests/sanitizers/all_stages.cpp",
    ),
    "a statistic.": ("diagnosis/statistics/", "tests/reference/gap_statistics.py", "docs/gap-statistics.md"),
}  # fmt: skip


def sources() -> dict[str, str]:
    suffixes = (".cpp", ".hpp", ".h", ".cl", ".py", ".md")
    files = [p for folder in FOLDERS for p in (ROOT / folder).rglob("*") if p.suffix in suffixes]
    return {p.relative_to(ROOT).as_posix(): p.read_text() for p in files if p.name != "architecture.md"}


def git(*command: str) -> str:
    return subprocess.run(["git", "-C", ROOT, *command], capture_output=True, text=True, check=False).stdout


def test_the_four_are_there() -> None:
    names = [name.split(" ", 1)[1].strip(".") for name in RECIPES]
    assert names == ["effect", "stage or kernel", "statistic", "image format"]


def test_names_of_recipes_exist() -> None:
    files = sources()
    text = "\n".join(files.values())
    missing = []
    for name in re.findall(r"`([^`]+)`", "".join(RECIPES.values())):
        if re.fullmatch(r"[\w./-]+/?", name) and ("/" in name or "." in name):
            if not (ROOT / name).exists() and not any(path.endswith("/" + name) for path in files):
                missing.append(name)
        elif re.fullmatch(r"[\w:]+(\(.*\))?", name):
            word = name.split("(")[0].split("::")[-1]
            program = any(path.rpartition("/")[2].startswith(word) for path in files)
            if not program and not re.search(rf"\b{word}\b", text):
                missing.append(name)
    assert not missing


@pytest.mark.parametrize("recipe", STEPS)
def test_commits_went_that_way(recipe: str) -> None:
    commits = re.findall(r"\b[0-9a-f]{7,40}\b", RECIPES[recipe])
    assert commits, "a commit that followed the recipe"
    if git("rev-parse", "--is-shallow-repository").strip() != "false":
        return  # an unpacked archive has no history, a shallow clone a short one
    touched = [git("show", "--format=", "--name-only", commit).splitlines() for commit in commits]
    for part in STEPS[recipe]:
        assert any(name.startswith(part) for names in touched for name in names), f"{part}: {touched}"
    for commit, names in zip(commits, touched, strict=True):
        assert any(name.startswith(part) for name in names for part in STEPS[recipe]), commit

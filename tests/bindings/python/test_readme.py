"""The examples of the README run, in their order, in one interpreter."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from binding_common import Runner


@pytest.fixture(scope="module")
def blocks(root: Path) -> list[str]:
    text = (root / "bindings" / "python" / "README.md").read_text(encoding="utf-8")
    return re.findall(r"```python\n(.*?)```", text, flags=re.S)


def test_examples_run(blocks: list[str], run_python: Runner) -> None:
    assert len(blocks) >= 8
    program = "\n".join(blocks) + '\nprint("the end")\n'
    result = run_python(program)
    assert result.returncode == 0, result.stderr
    assert result.stdout.splitlines()[-1] == "the end"
    assert "must hold finite values" in result.stdout  # the error that the README shows


def test_the_readme_names_what_there_is(root: Path) -> None:
    import clspeckle

    text = (root / "bindings" / "python" / "README.md").read_text(encoding="utf-8")
    for dotted in set(re.findall(r"clspeckle\.([\w.]+)", text)):
        thing: object = clspeckle
        for part in dotted.rstrip(".").split("."):
            thing = getattr(thing, part)

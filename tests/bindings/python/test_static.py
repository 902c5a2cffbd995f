"""Types and style of the package and of these tests, and that everything public is documented."""

from __future__ import annotations

import ast
import graphlib
import inspect
import subprocess
import sys
from pathlib import Path

import pytest

import clspeckle


def run(root: Path, *arguments: str) -> None:
    result = subprocess.run(
        [sys.executable, "-m", *arguments], cwd=root, capture_output=True, text=True, timeout=600, check=False
    )
    assert result.returncode == 0, result.stdout + result.stderr


def test_types(tmp_path: Path, root: Path) -> None:
    options = ["--config-file", "pyproject.toml", "--cache-dir", str(tmp_path)]
    run(root, "mypy", *options, "bindings/python/src", "tests/bindings/python")


def test_types_of_a_user(tmp_path: Path, root: Path) -> None:
    """What a typed program sees: results have types, and wrong calls are found."""
    (tmp_path / "good.py").write_text(
        "import numpy as np\n"
        "import numpy.typing as npt\n"
        "import clspeckle\n"
        "ideal = np.ones((4, 4), np.float32)\n"
        "frame: npt.NDArray[np.uint16] = clspeckle.simulate(ideal, f_number=4.0, seed=7)\n"
        "camera = clspeckle.Pipeline.from_parameters((4, 4), seed=7)\n"
        "out = np.empty((4, 4), np.uint16)\n"
        "same: npt.NDArray[np.uint16] = camera.render(ideal, refresh='all', out=out)\n"
        "seconds: float = sum(camera.timings().values()) * 1e-3\n"
    )
    environment = ["--strict", "--cache-dir", str(tmp_path / "cache")]
    command = [sys.executable, "-m", "mypy", *environment, str(tmp_path / "good.py")]
    variables = {"MYPYPATH": str(root / "bindings" / "python" / "src"), "PATH": "/usr/bin:/bin"}
    good = subprocess.run(command, capture_output=True, text=True, env=variables, timeout=600, check=False)
    assert good.returncode == 0, good.stdout
    (tmp_path / "good.py").write_text(
        "import clspeckle\n"
        "clspeckle.simulate([[1.0]], f_numer=4.0)\n"
        "clspeckle.Phase((4, 4), seed='seven')\n"
        "clspeckle.Pipeline(phase=clspeckle.Phase((4, 4)))\n"
    )
    bad = subprocess.run(command, capture_output=True, text=True, env=variables, timeout=600, check=False)
    for line in (2, 3, 4):
        assert f"good.py:{line}: error" in bad.stdout, bad.stdout


@pytest.mark.parametrize("folder", ["bindings/python", "tests/bindings/python"])
def test_style(folder: str, root: Path) -> None:
    options = ["--config", "pyproject.toml", "--no-cache"]
    run(root, "ruff", "check", *options, folder)
    run(root, "ruff", "format", "--check", *options, folder)


def test_everything_public_is_documented_and_listed() -> None:
    assert sorted(clspeckle.__all__) == list(clspeckle.__all__)
    for name in clspeckle.__all__:
        thing = getattr(clspeckle, name)
        assert inspect.getdoc(thing), name
        if not inspect.isclass(thing) or not thing.__module__.startswith("clspeckle."):
            continue
        for member, value in vars(thing).items():
            function = value.__func__ if isinstance(value, (staticmethod, classmethod)) else value
            if not member.startswith("_") and (inspect.isfunction(function) or isinstance(value, property)):
                assert inspect.getdoc(function), f"{name}.{member}"
    for module in (clspeckle.errors, clspeckle.philox, clspeckle.statistics):
        for name in module.__all__:
            assert inspect.getdoc(getattr(module, name)), f"{module.__name__}.{name}"


def test_the_package_runs_on_the_oldest_python_that_it_names(root: Path) -> None:
    for file in sorted((root / "bindings" / "python" / "src" / "clspeckle").glob("*.py")):
        ast.parse(file.read_text(encoding="utf-8"), feature_version=(3, 9))


def test_no_circle_of_imports() -> None:
    """Imports within functions and for type checkers count as well."""
    files = {file.stem: file for file in Path(clspeckle.__file__).parent.glob("*.py")}
    graph: dict[str, set[str]] = {}
    for name, file in files.items():
        tree = ast.parse(file.read_text(encoding="utf-8"))
        imports = [node for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) and node.level == 1]
        graph[name] = {node.module for node in imports if node.module}
        graph[name] |= {alias.name for node in imports if not node.module for alias in node.names}
        assert graph[name] <= set(files), name
    assert len(graph) > 20
    tuple(graphlib.TopologicalSorter(graph).static_order())  # raises CycleError with the circle

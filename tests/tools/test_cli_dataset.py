"""clspeckle dataset: the package's command under the program's name."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import clspeckle
import numpy as np
import pytest

PYTHON = ["--python", sys.executable]


@pytest.fixture
def recipe(tmp_path: Path) -> Path:
    np.save(tmp_path / "wall.npy", np.full((24, 32), 0.5, np.float32))
    given = {"scenes": ["wall.npy"], "effects": ["prnu", "row_noise"], "effects_per_image": [1, 2], "seed": 3}
    (tmp_path / "recipe.json").write_text(json.dumps(given))
    return tmp_path / "recipe.json"


def shards(folder: Path) -> list[bytes]:
    return [path.read_bytes() for path in sorted(folder.iterdir())]


def test_it_is_the_packages_command(ok, cli, recipe: Path, tmp_path: Path) -> None:
    run = ok("dataset", recipe, "--out", "set", "--count", 5, "--shard-size", 2, *PYTHON)
    assert "3 shards in set" in run.out
    assert "5 of 5 pairs" in run.err
    words = [recipe, "--out", "other", "--count", "5", "--shard-size", "2", "--quiet"]
    subprocess.run([sys.executable, "-m", "clspeckle.dataset", *words], check=True, cwd=tmp_path)
    assert shards(tmp_path / "set") == shards(tmp_path / "other")
    more = ok("dataset", recipe, "--out", "bare", "--count", 2, "--no-ideal", "--workers", 2, "--quiet", *PYTHON)
    assert more.out == more.err == ""
    assert json.loads((tmp_path / "bare" / "dataset.json").read_text())["with_ideal"] is False
    device = clspeckle.devices()[0].selector
    ok("dataset", recipe, "--out", "set2", "--count", 5, "--shard-size", 2, "--devices", f"{device},{device}", *PYTHON)
    assert shards(tmp_path / "set") == shards(tmp_path / "set2")
    ok("dataset", recipe, "--out", "set4", "--count", 5, "--shard-size", 2, "--workers", 2, "--threads", 1, *PYTHON)
    assert shards(tmp_path / "set") == shards(tmp_path / "set4")
    nobody = cli("dataset", recipe, "--out", "set3", "--count", 5, "--cluster", "tcp://127.0.0.1:9", *PYTHON)
    assert nobody.code == 2
    assert "tcp://127.0.0.1:9: no scheduler of a cluster answers" in nobody.err
    run = ok("dataset", recipe, "--out", "arrays", "--count", 5, "--shard-size", 2, "--format", "zarr", *PYTHON)
    assert "3 shards in arrays" in run.out
    assert (tmp_path / "arrays" / "codes" / "c" / "2" / "0" / "0").is_file()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([], "RECIPE"),
        (["recipe.json", "--out", "set"], "--count"),
        (["recipe.json", "--out", "set", "--count", 0], "--count"),
        (["recipe.json", "--out", "set", "--count", 1, "--shard-size", 0], "--shard-size"),
        (["recipe.json", "--out", "set", "--count", 1, "--workers", 0], "--workers"),
        (["recipe.json", "--out", "set", "--count", 1, "--format", "hdf5"], "--format"),
        (
            ["recipe.json", "--out", "set", "--count", 1, "--python", "no-such-python"],
            "there is no program no-such-python",
        ),
    ],
    ids=str,
)
def test_bad_usage(refused, recipe: Path, tmp_path: Path, arguments: list[object], words: str) -> None:
    assert words in refused("dataset", *arguments)
    assert not (tmp_path / "set").exists()


def test_what_the_package_refuses_is_refused(cli, recipe: Path) -> None:
    run = cli("dataset", "nowhere.json", "--out", "set", "--count", 1, *PYTHON)
    assert run.code == 1 and "nowhere.json" in run.err
    recipe.write_text('{"scenes": ["wall.npy"], "effects": ["prnuu"]}')
    run = cli("dataset", recipe, "--out", "set", "--count", 1, *PYTHON)
    assert run.code == 1 and "prnuu" in run.err


def test_it_says_what_python_lacks(cli, recipe: Path, program: Path, tmp_path: Path) -> None:
    """A Python without the package, away from any checkout; and the same with the package."""
    bare = tmp_path / "bare-python"
    bare.write_text(f'#!/bin/sh\nexec "{sys.executable}" -I -S "$@"\n')
    bare.chmod(0o755)
    run = cli("dataset", recipe, "--out", "set", "--count", 1, "--python", bare)
    assert run.code == 1
    assert "No module named 'numpy'" in run.err
    assert "NumPy and the package clspeckle" in run.err and "another Python is named with --python" in run.err
    away = tmp_path / "bin"
    away.mkdir()
    shutil.copy(program, away / "clspeckle")
    library = os.environ.get("CLSPECKLE_LIBRARY", str(program.parent.parent / "lib" / "libclspeckle.so"))
    environment = {**os.environ, "LD_LIBRARY_PATH": str(Path(library).parent)}
    command = [away / "clspeckle", "dataset", recipe, "--out", "set", "--count", "1"]
    alone = subprocess.run(
        [*command, "--python", bare], check=False, cwd=tmp_path, env=environment, capture_output=True, text=True
    )
    assert alone.returncode == 1 and "the package clspeckle" in alone.stderr
    subprocess.run([*command, *PYTHON], check=True, cwd=tmp_path, env=environment, capture_output=True)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM], ids=["ctrl-c", "sigterm"])
def test_it_stops_and_goes_on(ok, recipe: Path, program: Path, tmp_path: Path, number: signal.Signals) -> None:
    words = [recipe, "--out", "set", "--count", 4000, "--shard-size", 20, *PYTHON]
    run = subprocess.Popen(
        [program, "dataset", *map(str, words)], cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    while not list(tmp_path.glob("set/shard-*.tar")):
        assert run.poll() is None, run.communicate()
        time.sleep(0.01)
    run.send_signal(number)
    told = run.communicate(timeout=60)[1]
    assert run.returncode == 130, told
    assert "the same command goes on" in told
    assert not list((tmp_path / "set").glob(".*")), "half files are gone"

"""Other OpenCL runtimes: oclgrind, Intel's for CPUs and Mesa's rusticl run a part of the suite; the last two all of it
at night."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from clspeckle.dataset import Pairs

ROOT = Path(__file__).resolve().parents[2]
BUILD = Path(os.environ.get("CLSPECKLE_BUILD_DIR", ROOT / "build"))
sys.path.insert(0, str(ROOT / "scripts"))
import runtimes  # noqa: E402

# Random numbers against other people's, codes, queues and threads.
PART = ["test_philox", "test_safety", "test_concurrency"]
OTHERS = ["oclgrind", "intel", "rusticl"]


def check(runtime: str, programs: list[str], limit: float) -> None:
    try:
        result = runtimes.run_programs(runtime, BUILD, programs, limit)
    except runtimes.Missing as missing:
        pytest.skip(f"{runtime} cannot be had: {missing}")
    assert result.device
    assert not result.failed
    assert result.passed > 5 * len(programs) // 2


@pytest.mark.parametrize("runtime", OTHERS)
def test_a_part_runs_on_another_runtime(runtime: str) -> None:
    check(runtime, PART, 150.0)


def frames(runtime: str, folder: Path) -> np.ndarray:
    """What the smallest example renders on it: ten frames of 320 x 240, ten bits."""
    folder.mkdir()
    variables = {**os.environ, **runtimes.environment_of(runtime, BUILD)}
    done = subprocess.run(
        [BUILD / "bin" / "minimal_c"], cwd=folder, env=variables, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return np.stack(
        [np.frombuffer(file.read_bytes()[-2 * 320 * 240 :], ">u2") for file in sorted(folder.glob("*.pgm"))]
    )


@pytest.mark.nightly
@pytest.mark.parametrize("runtime", ["intel", "rusticl"])
def test_codes_are_those_of_pocl(runtime: str, tmp_path: Path) -> None:
    """But for the few pixels that rounding decides. Seen: at most 1 of 76,800 differs, by 1."""
    try:
        theirs = frames(runtime, tmp_path / runtime)
    except runtimes.Missing as missing:
        pytest.skip(f"{runtime} cannot be had: {missing}")
    ours = frames("pocl", tmp_path / "pocl")
    assert ours.shape == theirs.shape == (10, 76800)
    assert len(np.unique(ours)) > 100
    assert np.abs(ours.astype(int) - theirs).max() <= 1
    assert np.mean(ours != theirs) < 1e-3


WORKERS = """
import json, os, sys, time
from clspeckle import dataset, default_context, devices
from clspeckle.dataset import shards

def who(_):
    mine = default_context().info().opencl_device
    time.sleep(0.5)  # so that each of the workers gets some
    return os.environ["CLSPECKLE_DEVICE"], next(d.selector for d in devices() if d.device_id == mine)

if __name__ == "__main__":
    names = [d.selector for d in devices()]
    with shards._Processes(2 * len(names), None, names).start() as workers:
        seen = sorted(set(workers.map(who, range(8 * len(names)))))
    recipe = dataset.Recipe.from_file("recipe.json")
    sets = {"all": names, **{name: [name] for name in names}}
    for folder, used in sets.items():
        dataset.write(recipe, folder, count=12, shard_size=1, devices=used)
    print(json.dumps([names, seen]))
"""


@pytest.mark.nightly
def test_workers_have_the_devices_of_two_runtimes(tmp_path: Path) -> None:
    """Each its own, in turn; a set by both has the codes of either, but for the few pixels that rounding decides."""
    try:
        variables = {**os.environ, **runtimes.environment_of("intel", BUILD)}
    except runtimes.Missing as missing:
        pytest.skip(f"intel cannot be had: {missing}")
    system = Path(os.environ.get("OCL_ICD_VENDORS", "/etc/OpenCL/vendors"))
    for driver in (*system.glob("pocl*.icd"), *Path(variables["OCL_ICD_VENDORS"]).glob("*.icd")):
        (tmp_path / driver.name).write_text(driver.read_text())
    variables |= {"OCL_ICD_VENDORS": str(tmp_path), "OPENCL_VENDOR_PATH": str(tmp_path)}
    np.save(tmp_path / "scene.npy", np.ones((120, 160), np.float32))
    (tmp_path / "recipe.json").write_text(
        '{"scenes": ["scene.npy"], "effects": ["prnu", "row_noise", "defocus", "depolarization"], "seed": 4}'
    )
    (tmp_path / "workers.py").write_text(WORKERS)
    done = subprocess.run(
        [sys.executable, "workers.py"], cwd=tmp_path, env=variables, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    names, seen = json.loads(done.stdout)
    assert len(names) == 2
    assert seen == sorted([name, name] for name in names)
    sets = [np.stack([pair.codes for pair in Pairs(tmp_path / folder)]).astype(int) for folder in ("all", *names)]
    for other in sets[1:]:
        assert np.abs(sets[0] - other).max() <= 1
        assert np.mean(sets[0] != other) < 1e-3


@pytest.mark.nightly
@pytest.mark.parametrize("runtime", ["intel", "rusticl"])
def test_all_runs_on_another_runtime(runtime: str) -> None:
    programs = (BUILD / "tests" / "gtest_programs.txt").read_text().split()
    check(runtime, sorted(set(programs) - runtimes.NO_TESTS_OF_A_RUNTIME), 1800.0)


def test_what_is_known_to_fail_has_a_reason() -> None:
    for known in runtimes.known_failures():
        assert known.runtime in runtimes.RUNTIMES
        assert len(known.reason) > 20


def test_a_failure_and_a_hang_are_told(tmp_path: Path) -> None:
    """Programs that stand for a build: one passes half, one crashes, one never ends."""
    report = (
        '<testsuites><testsuite name="S"><testcase classname="S" name="Good"/>'
        '<testcase classname="S" name="Bad"><failure message="m"/></testcase></testsuite></testsuites>'
    )
    programs = {
        "clspeckle": "echo '0:0  A device: taken: the best'",
        "test_half": f"echo '{report}' > \"${{GTEST_OUTPUT#xml:}}\"; exit 1",
        "test_crash": "kill -SEGV $$",
        "test_endless": "exec sleep 60",
    }
    (tmp_path / "bin").mkdir()
    for name, body in programs.items():
        (tmp_path / "bin" / name).write_text(f"#!/bin/sh\n{body}\n")
        (tmp_path / "bin" / name).chmod(0o755)
    result = runtimes.run_programs("pocl", tmp_path, ["test_half", "test_crash", "test_endless"], 1.0)
    assert (result.device, result.programs, result.passed) == ("A device", 3, 1)
    assert result.failed == ["S.Bad", "test_crash: signal 11", "test_endless: more than 1 s"]

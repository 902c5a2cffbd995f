"""Sets of training pairs: drawn by seed and number alone, written whole, gone on with after a kill."""

from __future__ import annotations

import concurrent.futures
import dataclasses
import errno
import fcntl
import hashlib
import json
import logging
import math
import multiprocessing
import os
import pickle
import signal
import subprocess
import sys
import tarfile
import time
from pathlib import Path
from typing import Any

import distributed
import numpy as np
import numpy.typing as npt
import pytest
import zarr

import clspeckle
from binding_common import Runner
from clspeckle import dataset
from clspeckle.dataset import Pairs, Recipe, formats
from clspeckle.dataset import shards as shard_files

EFFECTS = {"defocus": {"waves": {"log": [0.1, 1.0]}}, "prnu": {}, "adc_bits": {}, "row_noise": {"sigma_dn": 2}}
CAMERAS = ({"f_number": [2.8, 8], "bits": {"choice": [8, 10]}, "exposure_gain_dn": 150}, {"f_number": 4})


def recipe(ideal: npt.NDArray[np.float32], **changes: Any) -> Recipe:
    given: dict[str, Any] = {
        "scenes": [ideal, ideal[:16] * 0.5],
        "cameras": CAMERAS,
        "effects": EFFECTS,
        "effects_per_image": (0, 3),
        "seed": 11,
    }
    return Recipe(**{**given, **changes})


def hashes(folder: Path) -> dict[str, str]:
    return {file.name: hashlib.sha256(file.read_bytes()).hexdigest() for file in sorted(folder.iterdir())}


def test_draws_depend_on_seed_and_number_alone(ideal: npt.NDArray[np.float32]) -> None:
    there = recipe(ideal)
    draws = [there.draw(i) for i in range(40)]
    assert draws == [recipe(ideal).draw(i) for i in reversed(range(40))][::-1]
    assert len({d.seed for d in draws}) == 40
    assert draws != [recipe(ideal, seed=12).draw(i) for i in range(40)]
    # The order in which a recipe names its effects is none of the draw's.
    turned = recipe(ideal, effects=dict(reversed(EFFECTS.items())))
    assert draws == [turned.draw(i) for i in range(40)]


def test_draws_follow_their_ranges(ideal: npt.NDArray[np.float32]) -> None:
    """4000 draws of one seed; a share that is off by four standard deviations fails, which chance does in 1 of 1000."""
    there = recipe(ideal)
    draws = [there.draw(i) for i in range(4000)]

    def is_share(count: int, total: int, share: float) -> bool:
        return abs(count - total * share) < 4 * math.sqrt(total * share * (1 - share))

    for scene in (0, 1):
        assert is_share(sum(d.scene == scene for d in draws), 4000, 0.5)
    for count in range(4):
        assert is_share(sum(len(d.effects) == count for d in draws), 4000, 0.25)
    for effect in EFFECTS:
        assert is_share(sum(effect in d.effects for d in draws), 4000, 1.5 / 4)
    first = [d.parameters for d in draws if d.camera == 0]
    assert is_share(len(first), 4000, 0.5)
    assert all(2.8 <= p["f_number"] <= 8 and p["exposure_gain_dn"] == 150 for p in first)
    assert is_share(sum(p["f_number"] < 5.4 for p in first), len(first), 0.5)
    assert is_share(sum(p["bits"] == 8 for p in first), len(first), 0.5)
    waves = [d.effects["defocus"]["waves"] for d in draws if "defocus" in d.effects]
    assert is_share(sum(w < math.sqrt(0.1) for w in waves), len(waves), 0.5), "uniform in the logarithm"
    bits = [d.effects["adc_bits"]["bits"] for d in draws if "adc_bits" in d.effects]
    assert set(bits) == {6.0, 7.0, 8.0}, "whole numbers from weak to strong"
    assert is_share(bits.count(6.0), len(bits), 1 / 3)
    assert {d.effects["row_noise"]["sigma_dn"] for d in draws if "row_noise" in d.effects} == {2}


def test_a_pair_is_what_simulate_gives(ideal: npt.NDArray[np.float32]) -> None:
    there = recipe(ideal)
    for index in range(6):
        pair = there.render(index)
        drawn = pair.draw
        scene = [ideal, ideal[:16] * 0.5][drawn.scene]
        assert np.array_equal(pair.ideal, scene)
        expected = clspeckle.simulate(scene, seed=drawn.seed, effects=drawn.effects, **drawn.parameters)
        assert np.array_equal(pair.codes, expected)
    assert len({there.render(i).codes.tobytes() for i in range(6)}) == 6


def test_a_polarization_without_light_is_not_drawn(
    ideal: npt.NDArray[np.float32], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The same bits as with both; where both have light, both are drawn."""
    drawn: list[int] = []
    make = clspeckle.Phase.__init__

    def noted(self: Any, *args: Any, **given: Any) -> None:
        make(self, *args, **given)
        drawn.append(self.polarization_count)

    monkeypatch.setattr(clspeckle.Phase, "__init__", noted)
    effects = ["defocus", "linewidth", "depolarization", "low_roughness"]
    there = recipe(ideal, cameras=[{"exposure_gain_dn": 150}], effects=effects, effects_per_image=(0, 2))
    counts = set()
    for index in range(16):
        pair = there.render(index)
        both = 2 if "depolarization" in pair.draw.effects else 1
        assert drawn.pop() == both
        given: dict[str, Any] = {"exposure_gain_dn": 150, "seed": pair.draw.seed, "effects": pair.draw.effects}
        clspeckle.simulate(pair.ideal, **given)
        assert drawn.pop() == both
        whole = clspeckle.simulate(pair.ideal, polarization_count=2, **given)
        assert drawn.pop() == 2
        assert np.array_equal(pair.codes, whole)
        counts.add(both)
    assert counts == {1, 2}
    clspeckle.simulate(ideal, degree_of_polarization=0.5, seed=1)
    assert drawn.pop() == 2


def test_shards_are_the_same_bytes_however_they_are_made(ideal: npt.NDArray[np.float32], tmp_path: Path) -> None:
    there = recipe(ideal)
    told: list[tuple[int, int]] = []
    shards = dataset.write(there, tmp_path / "one", count=10, shard_size=4, progress=lambda *t: told.append(t))
    assert [s.name for s in shards] == ["shard-000000.tar", "shard-000001.tar", "shard-000002.tar"]
    assert told == [(0, 10), (4, 10), (8, 10), (10, 10)]
    expected = hashes(tmp_path / "one")
    assert set(expected) == {"dataset.json", *(s.name for s in shards)}
    with concurrent.futures.ThreadPoolExecutor(2) as executor:
        dataset.write(there, tmp_path / "threads", count=10, shard_size=4, executor=executor)
    dataset.write(there, tmp_path / "processes", count=10, shard_size=4, workers=2)
    # Ended by its progress, then gone on with.
    some = dataset.write(there, tmp_path / "ended", count=10, shard_size=4, progress=lambda done, _: done < 4)
    assert [s.name for s in some] == ["shard-000000.tar"]
    before = some[0].stat().st_mtime_ns
    dataset.write(there, tmp_path / "ended", count=10, shard_size=4)
    assert some[0].stat().st_mtime_ns == before, "what is there stays"
    for folder in ("threads", "processes", "ended"):
        assert hashes(tmp_path / folder) == expected, folder

    pairs = Pairs(tmp_path / "one")
    assert len(pairs) == 10
    for index in (0, 5, 9):
        pair = there.render(index)
        assert np.array_equal(pairs[index].codes, pair.codes)
        assert pairs[index].codes.dtype == np.uint16
        assert np.array_equal(pairs[index].ideal, pair.ideal)
        assert pairs[index].draw == pair.draw
    assert pairs[-1].draw.index == 9
    assert [p.draw.index for p in pairs[2:8:3]] == [2, 5]
    assert [p.draw.index for p in pairs] == list(range(10))
    with pytest.raises(IndexError, match="pair 10 of a set of 10"):
        pairs[10]
    again = pickle.loads(pickle.dumps(Pairs(tmp_path / "one", transform=dataclasses.astuple)))
    assert np.array_equal(again[5][1], pairs[5].codes)
    with tarfile.open(shards[0]) as archive:
        assert archive.getnames()[:3] == ["000000000.codes.npy", "000000000.ideal.npy", "000000000.json"]


def test_without_ideal_images_the_recipe_has_them(ideal: npt.NDArray[np.float32], tmp_path: Path) -> None:
    there = recipe(ideal)
    (shard,) = dataset.write(there, tmp_path / "set", count=3, with_ideal=False)
    with tarfile.open(shard) as archive:
        assert not any("ideal" in name for name in archive.getnames())
    with pytest.raises(clspeckle.errors.InvalidArgumentError, match="holds no ideal images; give the recipe as scenes"):
        Pairs(tmp_path / "set")
    pairs = Pairs(tmp_path / "set", scenes=there)
    assert all(np.array_equal(p.ideal, there.ideal(p.draw.scene)) for p in pairs)
    with pytest.raises(clspeckle.errors.InvalidArgumentError, match="scenes are not those of"):
        Pairs(tmp_path / "set", scenes=recipe(ideal, scenes=[ideal]))


@pytest.fixture
def recipe_file(ideal: npt.NDArray[np.float32], tmp_path: Path) -> Path:
    np.save(tmp_path / "wall_0.npy", ideal)
    np.save(tmp_path / "wall_1.npy", (ideal[:16] > 0.5).astype(np.uint16) * 65535)
    given = {"scenes": ["wall_*.npy"], "cameras": CAMERAS, "effects": EFFECTS, "effects_per_image": [1, 2], "seed": 5}
    file = tmp_path / "recipe.json"
    file.write_text(json.dumps(given))
    return file


def command(file: Path, out: Path, *more: object) -> list[str]:
    return [sys.executable, "-m", "clspeckle.dataset", str(file), "--out", str(out), *map(str, more)]


def test_a_killed_run_goes_on(recipe_file: Path, tmp_path: Path) -> None:
    """Killed as a whole, or a worker alone: no half shard, and the same bytes in the end."""
    there = Recipe.from_file(recipe_file)
    dataset.write(there, tmp_path / "expected", count=60, shard_size=5)
    expected = hashes(tmp_path / "expected")
    for victim in ("all", "worker"):
        out = tmp_path / victim
        run = subprocess.Popen(
            command(recipe_file, out, "--count", 60, "--shard-size", 5, "--workers", 2),
            stderr=subprocess.PIPE, text=True, start_new_session=True,
        )  # fmt: skip
        while not list(out.glob(".shard-*.part")):
            assert run.poll() is None, run.stderr
            time.sleep(0.01)
        if victim == "all":
            os.killpg(run.pid, signal.SIGKILL)
            run.wait()
        else:
            workers = [int(p.name) for p in Path("/proc").iterdir() if p.name.isdigit() and is_worker(p, run.pid)]
            os.kill(workers[0], signal.SIGKILL)
            told = run.communicate(timeout=120)[1]
            assert run.returncode == 2, told
            assert "a worker ended while it wrote shard-" in told
            assert "the next call goes on" in told
        whole = list(out.glob("shard-*.tar"))
        assert len(whole) < 12
        assert all(hashlib.sha256(f.read_bytes()).hexdigest() == expected[f.name] for f in whole)
        with pytest.raises(clspeckle.errors.InvalidArgumentError, match="is not whole"):
            Pairs(out)
        done = subprocess.run(
            command(recipe_file, out, "--count", 60, "--shard-size", 5), capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stderr
        assert f"{5 * len(whole)} of 60 pairs" in done.stderr.splitlines()[0]
        assert "60 of 60 pairs" in done.stderr
        assert hashes(out) == expected, victim


def is_worker(process: Path, parent: int) -> bool:
    try:
        status = (process / "stat").read_text().rpartition(")")[2].split()
        return int(status[1]) == parent and b"spawn_main" in (process / "cmdline").read_bytes()
    except OSError:
        return False


def test_a_cluster_makes_the_same_bytes_though_a_worker_dies(recipe_file: Path, tmp_path: Path) -> None:
    dask: Any = distributed  # has no types of its own
    there = Recipe.from_file(recipe_file)
    dataset.write(there, tmp_path / "expected", count=40, shard_size=2)
    with (
        dask.LocalCluster(n_workers=2, threads_per_worker=1, host="127.0.0.1", dashboard_address=None) as cluster,
        dask.Client(cluster) as client,
    ):
        killed: list[int] = []

        def kill_one(done: int, _count: int) -> None:
            if done >= 4 and not killed:
                killed.append(next(iter(cluster.workers.values())).pid)
                os.kill(killed[0], signal.SIGKILL)

        dataset.write(
            there, tmp_path / "set", count=40, shard_size=2, executor=client.get_executor(), progress=kill_one
        )
    assert killed
    assert hashes(tmp_path / "set") == hashes(tmp_path / "expected")


def test_a_cluster_is_named_by_its_address(recipe_file: Path, tmp_path: Path) -> None:
    """The command finds it; a cluster that fails, has no workers or is not there is told in words."""
    dask: Any = distributed
    words = ("--count", 8, "--shard-size", 2)
    subprocess.run(command(recipe_file, tmp_path / "expected", *words), check=True, capture_output=True)

    def on(address: str, out: str, *more: object) -> subprocess.CompletedProcess[str]:
        arguments = command(recipe_file, tmp_path / out, *words, "--cluster", address, *more)
        return subprocess.run(arguments, capture_output=True, text=True, check=False, timeout=120)

    with dask.LocalCluster(
        n_workers=2, threads_per_worker=1, host="127.0.0.1", dashboard_address=None
    ) as cluster:  # fmt: skip
        cluster.scheduler.allowed_failures = 0
        address = cluster.scheduler_address
        done = on(address, "set")
        assert done.returncode == 0, done.stderr
        assert hashes(tmp_path / "set") == hashes(tmp_path / "expected")
        # The first worker that begins a shard dies, and the cluster gives up.
        run = subprocess.Popen(
            command(recipe_file, tmp_path / "dead", "--count", 4000, "--shard-size", 1000, "--cluster", address),
            stderr=subprocess.PIPE, text=True,
        )  # fmt: skip
        while not list((tmp_path / "dead").glob(".shard-*.part")):
            assert run.poll() is None, run.communicate()
            time.sleep(0.01)
        for worker in list(cluster.workers.values()):
            os.kill(worker.pid, signal.SIGKILL)
        told = run.communicate(timeout=120)[1]
        assert run.returncode == 2, told
        assert "a worker ended while it wrote shard-" in told
        assert "the next call goes on" in told
        assert not list((tmp_path / "dead").glob("shard-*")), "nothing half-written has a name"
    with dask.LocalCluster(n_workers=0, host="127.0.0.1", dashboard_address=None) as empty:
        none = on(empty.scheduler_address, "none")
        assert none.returncode == 2
        assert "the cluster has no workers; start some with `dask worker tcp://" in none.stderr
    gone = on(address, "gone")
    assert gone.returncode == 2
    assert "no scheduler of a cluster answers" in gone.stderr
    assert "start one with `dask scheduler`" in gone.stderr
    assert not (tmp_path / "gone").exists()


def test_options_of_devices_and_clusters_are_checked_first(
    ideal: npt.NDArray[np.float32], recipe_file: Path, tmp_path: Path
) -> None:
    """In the options' own words, before anything is connected or made."""

    def refused(*more: str) -> str:
        done = subprocess.run(
            command(recipe_file, tmp_path / "set", "--count", 1, *more),
            capture_output=True, text=True, check=False, timeout=60,
        )  # fmt: skip
        assert (done.returncode, done.stdout, done.stderr.count("\n")) in ((1, "", 1), (2, "", 1)), done.stderr
        assert not (tmp_path / "set").exists()
        return done.stderr

    for devices in ("", ",", "0:0,,0:0", "0:0,"):
        told = refused("--devices", devices)
        assert f'--devices is "{devices}", where a name is missing; give names with a comma between them' in told
    nobody = "tcp://127.0.0.1:9"
    assert "--workers is not for a cluster, which has its own; leave it out" in refused(
        "--cluster", nobody, "--workers", "2"
    )
    told = refused("--cluster", nobody, "--devices", "0:0")
    assert "--devices is not for a cluster" in told
    assert "leave it out, and set CLSPECKLE_DEVICE where each" in told
    told = refused("--cluster", nobody, "--threads", "1")
    assert "--threads is not for a cluster" in told
    assert "leave it out, and set POCL_MAX_PTHREAD_COUNT where each" in told
    assert "--cluster is empty; give the address that `dask scheduler` prints" in refused("--cluster", "")
    for address in ("nowhere", "tcp://nowhere:port", "post://nowhere:1"):
        assert f"{address}: no scheduler of a cluster answers" in refused("--cluster", address)
    # The advice: names with a comma between them, also with a space behind it.
    device = next(d for d in clspeckle.devices() if d.usable).selector
    done = subprocess.run(
        command(recipe_file, tmp_path / "set", "--count", 1, "--devices", f"{device}, {device}"),
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    with pytest.raises(TypeError, match=r"executor must be a concurrent\.futures\.Executor, got int 5"):
        dataset.write(recipe(ideal), tmp_path / "by", count=1, executor=5)
    with pytest.raises(TypeError, match="progress must be a function of two numbers, got int 5"):
        dataset.write(recipe(ideal), tmp_path / "by", count=1, progress=5)  # type: ignore[arg-type]
    assert not (tmp_path / "by").exists()
    (tmp_path / "file").write_bytes(b"x")
    for taken in (tmp_path / "file", tmp_path / "file" / "set"):
        with pytest.raises(
            NotADirectoryError, match="a set is a folder of its own, and a file has that name; name ano"
        ):
            dataset.write(recipe(ideal), taken, count=1)
    assert (tmp_path / "file").read_bytes() == b"x"
    # An executor has workers of its own, too.
    with concurrent.futures.ThreadPoolExecutor(1) as executor:
        with pytest.raises(TypeError, match="leave them out, and set CLSPECKLE_DEVICE where each of those workers"):
            dataset.write(recipe(ideal), tmp_path / "by", count=1, executor=executor, devices=["0:0"])
        dataset.write(recipe(ideal), tmp_path / "by", count=1, executor=executor)


def test_workers_have_devices_in_turn(
    ideal: npt.NDArray[np.float32], recipe_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    device = next(d for d in clspeckle.devices() if d.usable)
    there = recipe(ideal)
    dataset.write(there, tmp_path / "expected", count=4, shard_size=1)
    dataset.write(there, tmp_path / "set", count=4, shard_size=1, devices=[device.selector, device.selector])
    assert hashes(tmp_path / "set") == hashes(tmp_path / "expected")
    with pytest.raises(clspeckle.errors.ClspeckleError, match="no-such-device"):
        dataset.write(there, tmp_path / "wrong", count=4, shard_size=1, devices=[device.selector, "no-such-device"])
    with pytest.raises(TypeError, match=r"devices must be a list of names, such as"):
        dataset.write(there, tmp_path / "wrong", count=4, devices="0:0")
    begun = multiprocessing.get_context("spawn").Value("l", 0)
    monkeypatch.setenv("CLSPECKLE_DEVICE", "")
    monkeypatch.setenv("POCL_MAX_PTHREAD_COUNT", "1")
    monkeypatch.setenv("POCL_AFFINITY", "1")
    named = []
    for _ in range(5):
        shard_files._begin_worker(3, ("a", "b"), begun)
        named.append(os.environ["CLSPECKLE_DEVICE"])
    assert named == ["a", "b", "a", "b", "a"]
    assert (os.environ["POCL_MAX_PTHREAD_COUNT"], os.environ["POCL_AFFINITY"]) == ("3", "0")
    monkeypatch.undo()
    done = subprocess.run(
        command(recipe_file, tmp_path / "named", "--count", 1, "--devices", "no-such-device"),
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode in (1, 2)
    assert "no-such-device" in done.stderr


def test_workers_share_the_cores_out_unless_told(
    ideal: npt.NDArray[np.float32], recipe_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What a worker's driver is told; and the bytes are the same whatever it is."""

    def told(workers: int, threads: int | None = None) -> int:
        return shard_files._Processes(workers, threads, ())._threads

    monkeypatch.delenv("POCL_MAX_PTHREAD_COUNT", raising=False)
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: set(range(8)))
    assert [told(1), told(2), told(3), told(20), told(2, 5)] == [8, 4, 2, 1, 5]
    monkeypatch.setenv("POCL_MAX_PTHREAD_COUNT", "6")
    assert [told(2), told(2, 5)] == [6, 5]
    monkeypatch.undo()

    there = recipe(ideal)
    dataset.write(there, tmp_path / "expected", count=4, shard_size=1)
    for threads in (1, 3 * len(os.sched_getaffinity(0))):
        monkeypatch.setenv("POCL_AFFINITY", "1")  # threads beyond the cores would end the process
        dataset.write(there, tmp_path / str(threads), count=4, shard_size=1, threads=threads)
        assert hashes(tmp_path / str(threads)) == hashes(tmp_path / "expected")
    done = subprocess.run(
        command(recipe_file, tmp_path / "two", "--count", 4, "--workers", 2, "--threads", 1),
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    with pytest.raises(clspeckle.errors.InvalidArgumentError, match="threads is 0; expected at least 1, or None"):
        dataset.write(there, tmp_path / "none", count=4, threads=0)
    with concurrent.futures.ThreadPoolExecutor(1) as executor:
        with pytest.raises(TypeError, match="leave them out, and set POCL_MAX_PTHREAD_COUNT where each of those"):
            dataset.write(there, tmp_path / "by", count=1, executor=executor, threads=1)
        dataset.write(there, tmp_path / "by", count=1, executor=executor)


def test_a_full_disk_leaves_no_half_shard(
    ideal: npt.NDArray[np.float32], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    add = formats._add
    calls: list[str] = []

    def full(archive: tarfile.TarFile, name: str, data: bytes) -> None:
        calls.append(name)
        if len(calls) == 8:
            raise OSError(errno.ENOSPC, "No space left on device")
        add(archive, name, data)

    monkeypatch.setattr(formats, "_add", full)
    with pytest.raises(OSError, match=r"no space left for shard-000001.tar; finished shards stay"):
        dataset.write(recipe(ideal), tmp_path / "set", count=4, shard_size=2)
    assert sorted(file.name for file in (tmp_path / "set").iterdir()) == ["dataset.json", "shard-000000.tar"]
    dataset.write(recipe(ideal), tmp_path / "set", count=4, shard_size=2)
    assert len(Pairs(tmp_path / "set")) == 4


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"scenes": []}, "scenes is empty"),
        ({"scenes": "wall.npy"}, "expected a list of arrays or .npy files"),
        ({"scenes": [np.zeros((4, 4, 3), np.float32)]}, r"scenes\[0\] has shape \(4, 4, 3\)"),
        ({"scenes": [np.full((4, 4), -1.0)]}, "negative or not finite"),
        ({"scenes": [np.zeros((4, 4), np.int64)]}, "has dtype int64; expected float32"),
        ({"cameras": []}, "cameras is empty"),
        ({"cameras": [{"f_numbre": 4}]}, r"cameras\[0\] has no parameter 'f_numbre'.*f_number"),
        ({"cameras": [{"seed": 4}]}, "has seed, which the recipe draws"),
        ({"cameras": [{"f_number": [8, 2.8]}]}, r"cameras\[0\].f_number is \[8, 2.8\]; expected \[low, high\]"),
        ({"cameras": [{"f_number": {"log": [0, 8]}}]}, "logarithms need numbers above 0"),
        ({"cameras": [{"f_number": {"normal": [4, 1]}}]}, r'expected one of \{"uniform"'),
        ({"effects": "defocus"}, "expected ids with ranges"),
        ({"effects": ["defokus"]}, "there is no effect 'defokus'.*defocus"),
        ({"effects": ["zero_order"]}, "the effect zero_order is of ideal dots"),
        ({"effects": {"defocus": {"wave": 1}}}, "the effect defocus has no parameter 'wave'"),
        ({"effects": {"adc_bits": {"bits": [6.5, 8]}}}, "expected .* of whole numbers"),
        ({"effects": {"nonlinearity": {"power": [1, 4]}}}, "power has 4; expected whole numbers from 1 to 3"),
        (
            {"effects": {"adc_bits": {"bits": {"choice": [8, 6.5]}}}},
            "bits has 6.5; expected whole numbers from 1 to 16",
        ),
        ({"effects": {"prnu": {"sigma": {"log": [0.1, 2]}}}}, "sigma has 2; expected numbers from 0 to 1"),
        ({"effects": ["defocus"]}, "effects_per_image is .*no more than the 1 effects"),
        ({"effects_per_image": (3, 1)}, "the first no more than the second"),
        ({"seed": -1}, "seed"),
    ],
)
def test_what_is_no_recipe_is_refused(ideal: npt.NDArray[np.float32], changes: dict[str, Any], message: str) -> None:
    with pytest.raises((clspeckle.errors.InvalidArgumentError, TypeError, ValueError), match=message):
        recipe(ideal, **changes)


def test_what_does_not_go_together_names_the_pair(ideal: npt.NDArray[np.float32]) -> None:
    there = recipe(ideal, cameras=[{"bits": 99}])
    with pytest.raises(clspeckle.errors.InvalidArgumentError, match=r"pair 3 .*bits"):
        there.render(3)


def test_whole_numbers_and_lists_of_a_camera(ideal: npt.NDArray[np.float32]) -> None:
    camera = {"bits": [8, 10], "principal_point_px": [8, 9], "f_number": np.float32(4), "exposure_gain_dn": 150}
    there = recipe(ideal, cameras=[camera], effects_per_image=(0, 0))
    drawn = [there.draw(i).parameters for i in range(30)]
    assert {type(d["bits"]) for d in drawn} == {int}
    assert {d["bits"] for d in drawn} == {8, 9, 10}
    assert drawn[0]["principal_point_px"] == [8, 9]
    there.render(0)
    json.dumps(there.described())


def test_scenes_stay_what_they_were(ideal: npt.NDArray[np.float32], tmp_path: Path) -> None:
    mine = ideal.copy()
    there = recipe(ideal, scenes=[mine])
    before = there.render(2).codes
    mine[:] = 9
    assert np.array_equal(there.render(2).codes, before)
    np.save(tmp_path / "scene.npy", ideal)

    def overwrite(done: int, _count: int) -> None:
        if done == 2:
            np.save(tmp_path / "scene.npy", ideal[:-1])

    files = recipe(ideal, scenes=[tmp_path / "scene.npy"])
    with pytest.raises(clspeckle.errors.InvalidArgumentError, match="has changed since the recipe read it first"):
        dataset.write(files, tmp_path / "set", count=4, shard_size=2, progress=overwrite)
    anew = recipe(ideal, scenes=[tmp_path / "scene.npy"])
    assert dataset.write(anew, tmp_path / "other", count=4, shard_size=2), "the advice works"


def test_a_recipe_that_failed_leaves_the_folder_free(ideal: npt.NDArray[np.float32], tmp_path: Path) -> None:
    with pytest.raises(clspeckle.errors.InvalidArgumentError, match="pair 0"):
        dataset.write(recipe(ideal, cameras=[{"bits": 99}]), tmp_path, count=1)
    dataset.write(recipe(ideal), tmp_path, count=1)
    assert len(Pairs(tmp_path)) == 1


def test_workers_end_with_their_parent(recipe_file: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    run = subprocess.Popen(command(recipe_file, out, "--count", 4000, "--shard-size", 1000, "--workers", 2, "--quiet"))
    while not list(out.glob(".shard-*.part")):
        assert run.poll() is None
        time.sleep(0.01)
    workers = [p for p in Path("/proc").iterdir() if p.name.isdigit() and is_worker(p, run.pid)]
    assert workers
    run.kill()
    run.wait()
    end = time.monotonic() + 30
    while any(p.exists() for p in workers):
        assert time.monotonic() < end, "a worker goes on"
        time.sleep(0.05)


def test_an_interrupt_within_a_log_message_arrives(ideal: npt.NDArray[np.float32]) -> None:
    class Interrupted(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            raise KeyboardInterrupt

    logger = logging.getLogger("clspeckle")
    level, handler = logger.level, Interrupted()
    logger.setLevel(logging.DEBUG)
    logger.addHandler(handler)
    try:
        with pytest.raises(KeyboardInterrupt), clspeckle.Context() as context:
            clspeckle.simulate(ideal, f_number=5.1, context=context)
    finally:
        logger.removeHandler(handler)
        logger.setLevel(level)
    assert clspeckle._library.held_interrupts == []


def test_a_folder_is_of_one_set(ideal: npt.NDArray[np.float32], tmp_path: Path) -> None:
    dataset.write(recipe(ideal), tmp_path, count=2)
    with pytest.raises(clspeckle.errors.InvalidArgumentError, match="holds another set: its recipe differ"):
        dataset.write(recipe(ideal, seed=12), tmp_path, count=2)
    with pytest.raises(clspeckle.errors.InvalidArgumentError, match="its shard_size, recipe differ"):
        dataset.write(recipe(ideal, seed=12), tmp_path, count=3, shard_size=2)
    with pytest.raises(clspeckle.errors.InvalidArgumentError, match="set of 2 pairs, more than 1; give that count or"):
        dataset.write(recipe(ideal), tmp_path, count=1)
    assert len(dataset.write(recipe(ideal), tmp_path, count=2)) == 1, "the advice works"
    assert dataset.write(recipe(ideal, seed=12), tmp_path / "another", count=2), "the advice works"
    with pytest.raises(clspeckle.errors.InvalidArgumentError, match="expected at least 1 of each"):
        dataset.write(recipe(ideal), tmp_path, count=0)
    (tmp_path / "shard-000000.tar").unlink()
    with pytest.raises(clspeckle.errors.InvalidArgumentError, match="1 of 1 shards are missing"):
        Pairs(tmp_path)
    (tmp_path / "dataset.json").write_text("{}")
    with pytest.raises(clspeckle.errors.InvalidArgumentError, match="is no description of a set"):
        Pairs(tmp_path)
    with pytest.raises(clspeckle.errors.InvalidArgumentError, match=r"expected what clspeckle.dataset.write\(\) makes"):
        Pairs(tmp_path / "nowhere")


@pytest.mark.parametrize("count", [4, 5])
def test_a_larger_count_goes_on(
    ideal: npt.NDArray[np.float32], tmp_path: Path, count: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The first count ends with a shard, or within one, whose remainder is then made again."""
    there = recipe(ideal)
    dataset.write(there, tmp_path / "whole", count=11, shard_size=2)
    first = dataset.write(there, tmp_path / "set", count=count, shard_size=2)
    kept = {path: path.stat().st_mtime_ns for path in first[:2]}
    with monkeypatch.context() as patch:
        patch.setattr(shard_files, "_write_shard", no_more)
        with pytest.raises(OSError, match="no more"):
            dataset.write(there, tmp_path / "set", count=11, shard_size=2)
    with pytest.raises(clspeckle.errors.InvalidArgumentError, match="4 of 6 shards are missing"):
        Pairs(tmp_path / "set")
    dataset.write(there, tmp_path / "set", count=11, shard_size=2)
    assert hashes(tmp_path / "set") == hashes(tmp_path / "whole")
    assert {path: path.stat().st_mtime_ns for path in first[:2]} == kept


def no_more(*_: Any) -> int:
    raise OSError("no more")


def test_one_run_in_a_folder_at_a_time(ideal: npt.NDArray[np.float32], recipe_file: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    words = ("--count", 4000, "--shard-size", 10)
    run = subprocess.Popen(command(recipe_file, out, *words, "--workers", 2), stderr=subprocess.DEVNULL)
    try:
        while not list(out.glob(".shard-*.part")):
            assert run.poll() is None
            time.sleep(0.01)
        other = subprocess.run(command(recipe_file, out, *words), capture_output=True, text=True, check=False)
        assert other.returncode == 3, other.stderr
        assert f"process {run.pid} of " in other.stderr
        assert "writes to it; wait for its end, or name another folder" in other.stderr
        with pytest.raises(BlockingIOError, match=f"process {run.pid} of "):
            dataset.write(Recipe.from_file(recipe_file), out, count=4000, shard_size=10)
    finally:
        run.kill()
        run.wait()
    assert (out / ".lock").exists()
    # A killed run holds nothing, and its file is nothing that stays.
    dataset.write(Recipe.from_file(recipe_file), out, count=4000, shard_size=10, progress=lambda *_: False)
    assert not (out / ".lock").exists()

    def within(done: int, _count: int) -> bool:
        if done == 1:
            with pytest.raises(BlockingIOError, match=f"process {os.getpid()} of "):
                dataset.write(recipe(ideal), tmp_path / "one", count=2, shard_size=1)
        return True

    dataset.write(recipe(ideal), tmp_path / "one", count=2, shard_size=1, progress=within)


def test_a_file_system_without_locks_is_told(
    ideal: npt.NDArray[np.float32], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def no_locks(_file: int, _how: int) -> None:
        raise OSError(errno.EOPNOTSUPP, "Operation not supported")

    monkeypatch.setattr(fcntl, "flock", no_locks)
    dataset.write(recipe(ideal), tmp_path / "set", count=1)
    assert "its file system has no locks" in caplog.text
    assert sorted(file.name for file in (tmp_path / "set").iterdir()) == ["dataset.json", "shard-000000.tar"]


def test_other_numbers_build_no_programs(ideal: npt.NDArray[np.float32]) -> None:
    """Effects of the catalogue, each alone and those of a kind together, drawn again and again."""
    alone = [effect for effect in clspeckle.effects() if "stages/dots.cl" not in effect.kernel]
    assert len(alone) > 30
    image = np.tile(ideal, (3, 3))
    with clspeckle.Context() as context:

        def programs() -> int:
            return context.info().programs_built

        for effect in alone:
            there = recipe(image, scenes=[image], cameras=[{"bits": 10}], effects=[effect.id], effects_per_image=(1, 1))
            # Nine steps from weak to strong; what a dataset draws lies between.
            for step in range(9):
                between = {p: p.weak + step / 8 * (p.strong - p.weak) for p in effect.parameters}
                values = {p.name: round(value) if p.whole else value for p, value in between.items()}
                clspeckle.simulate(image, bits=10, effects={effect.id: values}, context=context)
            before = programs()
            for index in range(6):
                there.render(index, context=context)
            assert programs() == before, effect.id
        # Sets of fixed patterns are many; none has a program of its own.
        patterns = (
            "prnu",
            "column_gain",
            "row_gain",
            "dsnu",
            "column_fpn",
            "row_fpn",
            "periodic_offset",
            "hot_pixels",
            "pixel_dull",
        )
        there = recipe(image, scenes=[image], cameras=[{"bits": 10}], effects=patterns, effects_per_image=(2, 9))
        before = programs()
        sets = {tuple(there.draw(index).effects) for index in range(40)}
        assert len(sets) > 30
        for index in range(40):
            there.render(index, context=context)
        assert programs() == before


FLAT = """
import json, sys
import numpy as np
import clspeckle
from clspeckle import dataset

rows, columns = np.mgrid[:48, :64]
scene = (np.exp(-(((columns % 16 - 8) ** 2 + (rows % 16 - 8) ** 2) / 8.0)) + 0.05).astype(np.float32)
camera = {"f_number": [3.2, 8], "read_noise_dn": {"log": [1, 8]}, "bits": [8, 10], "exposure_gain_dn": 300}
effects = [effect.id for effect in clspeckle.effects() if "stages/dots.cl" not in effect.kernel]
recipe = dataset.Recipe(scenes=[scene], cameras=[camera], effects=effects, effects_per_image=(1, 3), seed=1)
seen = {}

def progress(done, count):
    resident = next(line for line in open("/proc/self/status") if line.startswith("VmRSS:"))
    seen[done] = [int(resident.split()[1]), clspeckle.default_context().info().programs_built]

dataset.write(recipe, "set", count=2000, shard_size=100, progress=progress)
print(json.dumps(seen))
"""


def test_memory_stays_flat(run_python: Runner) -> None:
    """2,000 pairs of one to three effects of all that an image can have. Programs are built once for each kind of
    frame: 43 by the first 200 pairs, 6 by the others. After 1,000 pairs less than 4 KiB a pair may stay, of whose
    images each has more (measured: 0.2 KiB)."""
    done = run_python(FLAT)
    assert done.returncode == 0, done.stderr
    resident, programs = zip(*(json.loads(done.stdout)[str(pairs)] for pairs in (200, 1000, 2000)), strict=True)
    assert programs[2] - programs[0] <= 10
    assert resident[2] < 1.1 * resident[0]
    assert resident[2] - resident[1] < 4 * 1000


def test_a_cluster_needs_its_package(monkeypatch: pytest.MonkeyPatch) -> None:
    with monkeypatch.context() as patch:
        patch.setitem(sys.modules, "distributed", None)
        with pytest.raises(RuntimeError, match="pip install distributed"), dataset.cluster("tcp://127.0.0.1:9"):
            pass
    with pytest.raises(RuntimeError, match="no scheduler of a cluster answers"), dataset.cluster("nowhere"):
        pass


def test_recipes_in_files(recipe_file: Path, tmp_path: Path) -> None:
    there = Recipe.from_file(recipe_file)
    assert there.ideal(1).max() == 1, "integers are divided by their top code"
    assert dataclasses.replace(there.draw(0)).index == 0
    for text, message in (
        ('{"scenes": ["wall_0.npy"], "efects": {}}', "has no member 'efects'.*effects"),
        ('{"scenes": ["none_*.npy"], "effects": []}', "no file is called 'none_"),
        ("[1]", "expected an object"),
        ('{"scenes": "wall_0.npy", "effects": []}', "expected a list of names of files"),
        ('{"scenes": ["wall_0.npy"]}', "effects is missing"),
        ("{", "recipe.json: "),
    ):
        recipe_file.write_text(text)
        with pytest.raises(clspeckle.errors.InvalidArgumentError, match=message):
            Recipe.from_file(recipe_file)
    recipe_file.write_text('{"scenes": ["none.npy"], "effects": ["prnu"], "effects_per_image": [1, 1]}')
    done = subprocess.run(
        command(recipe_file, tmp_path / "out", "--count", 1), capture_output=True, text=True, check=False
    )
    assert done.returncode == 1
    assert "none.npy" in done.stderr
    assert "expected an image as .npy" in done.stderr


def all_hashes(folder: Path) -> dict[str, str]:
    files = [file for file in sorted(folder.rglob("*")) if file.is_file()]
    return {file.relative_to(folder).as_posix(): hashlib.sha256(file.read_bytes()).hexdigest() for file in files}


def test_zarr_reads_what_is_written(ideal: npt.NDArray[np.float32], tmp_path: Path) -> None:
    there = recipe(ideal, scenes=[ideal, ideal * 0.5])
    paths = dataset.write(there, tmp_path / "set", count=10, shard_size=4, format="zarr")
    assert [path.relative_to(tmp_path / "set").as_posix() for path in paths] == [f"codes/c/{n}/0/0" for n in range(3)]
    group: Any = zarr.open_group(tmp_path / "set", mode="r")
    assert sorted(group) == ["codes", "ideal", "labels"]
    assert group["codes"].shape == group["ideal"].shape == (10, *ideal.shape)
    assert group["codes"].dtype == np.uint16
    assert group["ideal"].dtype == np.float32
    codes, scenes, labels = (group[name][:] for name in ("codes", "ideal", "labels"))
    pairs = Pairs(tmp_path / "set")
    for index in range(10):
        pair = there.render(index)
        assert np.array_equal(codes[index], pair.codes)
        assert np.array_equal(scenes[index], pair.ideal)
        assert dataset.Draw(**json.loads(labels[index])) == pair.draw
        assert np.array_equal(pairs[index].codes, pair.codes)
        assert np.array_equal(pairs[index].ideal, pair.ideal)
        assert pairs[index].draw == pair.draw
    assert codes.any()
    again = pickle.loads(pickle.dumps(pairs))
    assert np.array_equal(again[-1].codes, codes[9])
    dataset.write(there, tmp_path / "bare", count=2, format="zarr", with_ideal=False)
    assert sorted(zarr.open_group(tmp_path / "bare", mode="r")) == ["codes", "labels"]
    assert np.array_equal(Pairs(tmp_path / "bare", scenes=there)[1].ideal, scenes[1])


def test_zarr_is_the_same_bytes_however_it_is_made(
    ideal: npt.NDArray[np.float32], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By processes, after an end within a shard, with a larger count; and no half file is left by a full disk."""
    there = recipe(ideal, scenes=[ideal])
    dataset.write(there, tmp_path / "one", count=11, shard_size=4, format="zarr")
    expected = all_hashes(tmp_path / "one")
    assert len(expected) == 1 + 4 + 9
    dataset.write(there, tmp_path / "processes", count=11, shard_size=4, format="zarr", workers=2)
    dataset.write(there, tmp_path / "larger", count=6, shard_size=4, format="zarr")
    dataset.write(there, tmp_path / "larger", count=11, shard_size=4, format="zarr")
    # A disk that is full when the second shard's second file gets its name: only codes are written after it.
    sync = os.fsync
    calls: list[int] = []

    def full(file: int) -> None:
        calls.append(file)
        if len(calls) == 5 + 3 + 2:
            raise OSError(errno.ENOSPC, "No space left on device")
        sync(file)

    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync", full)
        with pytest.raises(OSError, match="no space left for ideal/c/1/0/0; finished shards stay: make room and call"):
            dataset.write(there, tmp_path / "full", count=11, shard_size=4, format="zarr")
    left = all_hashes(tmp_path / "full")
    assert {name for name in left if "/c/" in name} == {"codes/c/0/0/0", "ideal/c/0/0/0", "labels/c/0", "labels/c/1"}
    assert all(expected[name] == digest for name, digest in left.items())
    with pytest.raises(clspeckle.errors.InvalidArgumentError, match="2 of 3 shards are missing, the first is sha"):
        Pairs(tmp_path / "full")
    dataset.write(there, tmp_path / "full", count=11, shard_size=4, format="zarr")
    for folder in ("processes", "larger", "full"):
        assert all_hashes(tmp_path / folder) == expected, folder


def test_a_killed_run_of_zarr_goes_on(recipe_file: Path, tmp_path: Path) -> None:
    given = {**json.loads(recipe_file.read_text()), "scenes": ["wall_0.npy"]}
    recipe_file.write_text(json.dumps(given))
    words = ("--count", 60, "--shard-size", 5, "--format", "zarr")
    subprocess.run(command(recipe_file, tmp_path / "expected", *words), check=True, capture_output=True)
    run = subprocess.Popen(command(recipe_file, tmp_path / "set", *words, "--quiet"), start_new_session=True)
    while not (tmp_path / "set" / "codes" / "c" / "1").exists():
        assert run.poll() is None
        time.sleep(0.005)
    os.killpg(run.pid, signal.SIGKILL)
    run.wait()
    assert not (tmp_path / "set" / "codes" / "c" / "11" / "0" / "0").exists(), "killed too late to tell"
    done = subprocess.run(command(recipe_file, tmp_path / "set", *words), capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert not done.stderr.startswith("0 of 60")
    assert all_hashes(tmp_path / "set") == all_hashes(tmp_path / "expected")


def test_zarr_refuses_what_it_cannot_hold(ideal: npt.NDArray[np.float32], tmp_path: Path) -> None:
    with pytest.raises(clspeckle.errors.InvalidArgumentError, match='one size: give such, or the format "webdataset"'):
        dataset.write(recipe(ideal), tmp_path / "sizes", count=2, format="zarr")
    dataset.write(recipe(ideal), tmp_path / "sizes", count=2, format="webdataset")
    there = recipe(ideal, scenes=[ideal])
    with pytest.raises(clspeckle.errors.InvalidArgumentError, match="format"):
        dataset.write(there, tmp_path / "set", count=2, format="hdf5")
    for first, second in (("zarr", "webdataset"), ("webdataset", "zarr")):
        dataset.write(there, tmp_path / first, count=2, format=first)
        with pytest.raises(clspeckle.errors.InvalidArgumentError, match="holds another set: its shard_format differ"):
            dataset.write(there, tmp_path / first, count=2, format=second)
    with pytest.raises(clspeckle.errors.InvalidArgumentError, match='at most 1000000, or the format "webdataset"'):
        dataset.write(there, tmp_path / "large", count=2, shard_size=10**6 + 1, format="zarr")
    assert not list((tmp_path / "large").iterdir())
    for name in ("codes/c/0/0/0", "ideal/c/0/0/0", "labels/c/0"):
        file = tmp_path / "zarr" / name
        whole = file.read_bytes()
        # All of it gone, none there, cut off so that the index is that of the pair before, and elsewhere.
        index = 16 * 1000 + 4
        absent = whole[:-index] + b"\xff" * index
        for damaged in (b"", b"\xff" * len(whole), absent, whole[:-16], whole[:-7], whole[:-index], whole[:100]):
            file.write_bytes(damaged)
            with pytest.raises(clspeckle.errors.InvalidDataError, match=f"pair 1: .*{name} .*; remove that file, and"):
                Pairs(tmp_path / "zarr")[1]
        file.unlink()
        dataset.write(there, tmp_path / "zarr", count=2, format="zarr")
        assert file.read_bytes() == whole, "the advice works"
    assert Pairs(tmp_path / "zarr")[1].draw.index == 1
    (tmp_path / "zarr" / "codes" / "zarr.json").unlink()
    with pytest.raises(clspeckle.errors.InvalidArgumentError, match="with a larger count writes it again"):
        Pairs(tmp_path / "zarr")
    dataset.write(there, tmp_path / "zarr", count=3, format="zarr")
    assert len(Pairs(tmp_path / "zarr")) == 3


def test_checksum_is_castagnolis() -> None:
    assert formats.crc32c(b"123456789") == 0xE3069283

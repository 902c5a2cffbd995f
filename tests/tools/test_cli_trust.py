"""What the program believes: no names outside a folder, no caches that others may write into (SECURITY.md)."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from cli_support import Run

OUTSIDE = [
    "/etc/hostname",
    "../secret.npy",
    "in/../../secret.npy",
    "..\\secret.npy",
    "../secret.npy:R",
    ".[.]/secret.npy",
]


@pytest.fixture
def secret(tmp_path: Path) -> Path:
    """A folder beside a file that it must not lead to."""
    (tmp_path / "set" / "in").mkdir(parents=True)
    np.save(tmp_path / "secret.npy", np.ones((24, 32), np.float32))
    return tmp_path / "set"


@pytest.mark.parametrize("name", OUTSIDE)
def test_sequences_stay_in_their_folder(refused: Callable[..., str], ok, secret: Path, name: str) -> None:
    about = {"format": "clspeckle-gbuffer-sequence", "version": 1, "frames": [name]}
    (secret / "sequence.json").write_text(json.dumps(about))
    message = refused("render", "set/sequence.json", "-o", "out")
    assert '"frames" names' in message
    assert "outside the folder of the file: copy it there, or link to it" in message
    about = {**about, "frames": ["in.npy"], "laser": {"pattern": {"file": name}}}
    (secret / "sequence.json").write_text(json.dumps(about))
    assert '"pattern.file" names' in refused("render", "set/sequence.json", "-o", "out")


@pytest.mark.parametrize("name", OUTSIDE)
def test_captures_stay_in_their_folder(refused: Callable[..., str], ok, tmp_path: Path, name: str) -> None:
    ok("capture", "make", "set", "--width", 32, "--height", 32, "--frames", 4, "--sequences", "dark")
    about = json.loads((tmp_path / "set" / "capture.json").read_text())
    for key in ("file", "mask"):
        changed = {**about, "sequences": [{**about["sequences"][0], key: name}]}
        (tmp_path / "set" / "capture.json").write_text(json.dumps(changed))
        assert f"/sequences/0/{key} is " in (message := refused("capture", "check", "set"))
        assert "expected a path within the folder of capture.json" in message


@pytest.mark.parametrize("name", OUTSIDE)
def test_hypotheses_stay_in_their_folder(refused: Callable[..., str], tmp_path: Path, name: str) -> None:
    about = {"id": "own", "stage": "optics", "parameters": {"a": {"weak": 1, "strong": 2}}, "opencl": name}
    (tmp_path / "set").mkdir()
    (tmp_path / "own.json").write_text(json.dumps(about))
    assert "outside the folder of the file: copy it there, or link to it" in refused(
        "diagnose", "set", "--hypothesis", "own.json"
    )
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere" / "own.cl").write_text("float hypothesis(void);")
    (tmp_path / "own.json").write_text(json.dumps({**about, "opencl": "own.cl"}))
    for put in (shutil.copy, os.symlink):
        put(tmp_path / "elsewhere" / "own.cl", tmp_path / "own.cl")
        assert "the folder holds no capture.json" in refused("diagnose", "set", "--hypothesis", "own.json")
        (tmp_path / "own.cl").unlink()


def test_patterns_come_from_folders_of_ones_own(ok: Callable[..., Run], tmp_path: Path) -> None:
    phase = np.random.default_rng(1).uniform(0, 6.28, (16, 16)).astype(np.float32)
    np.save(tmp_path / "cell.npy", phase)
    (tmp_path / "cell.json").write_text(json.dumps({"pixel_pitch_m": 1e-6, "wavelength_m": 940e-9}))
    command = ["doe", "inspect", "cell.npy", "--cache", "cache", "--texels", "96,64", "--beam-sigma-um", "60"]
    assert "computed" in ok(*command).out
    assert (tmp_path / "cache").stat().st_mode & 0o777 == 0o700
    (file,) = (tmp_path / "cache").iterdir()
    assert file.stat().st_mode & 0o777 == 0o600
    assert "from the cache" in ok(*command).out
    (tmp_path / "cache").chmod(0o777)
    told = ok(*command)
    assert "computed" in told.out
    assert "the cache folder cache is not used: others may write into it (mode 777)" in told.err
    assert "`chmod go-w 'cache'`" in told.err
    subprocess.run(["chmod", "go-w", "cache"], check=True, cwd=tmp_path)
    assert "from the cache" in ok(*command).out
    file.chmod(0o666)
    assert "computed" in ok(*command).out
    assert "from the cache" in ok(*command).out
    if os.geteuid() == 0:
        os.chown(tmp_path / "cache", 65534, 65534)
        told = ok(*command)
        assert "computed" in told.out
        assert "it belongs to the user 65534, not to 0" in told.err


def test_names_that_are_no_names(refused: Callable[..., str], ok: Callable[..., Run], tmp_path: Path) -> None:
    """A pattern of folders goes as deep on the stack as it has levels; a name goes to the terminal when it is told."""
    ok("capture", "make", "set", "--width", 32, "--height", 32, "--frames", 4, "--sequences", "dark")
    about = json.loads((tmp_path / "set" / "capture.json").read_text())

    def written(**changes: object) -> None:
        changed = {**about, "sequences": [{**about["sequences"][0], **changes}]}
        (tmp_path / "set" / "capture.json").write_text(json.dumps(changed))

    for levels in (3000, 100000):
        written(file="*/" * levels + "x")
        message = refused("capture", "check", "set")
        assert f"/sequences/0/file has {2 * levels + 1} bytes; at most 4095 are taken" in message
        assert len(message) < 1000
    assert "is a pattern of 6001 bytes" in refused("render", "*/" * 3000 + "x", "-o", "out")
    written(**{"\x1b[31mred": 1})
    told = ok("capture", "check", "set").err
    assert "red" in told
    assert "\x1b" not in told
    written(file="\x1b[31mred.npy")
    message = refused("capture", "check", "set")
    assert "red.npy" in message
    assert "\x1b" not in message


def test_a_shared_folder_is_no_cache(ok: Callable[..., Run], tmp_path: Path) -> None:
    np.save(tmp_path / "cell.npy", np.zeros((16, 16), np.float32))
    (tmp_path / "cell.json").write_text(json.dumps({"pixel_pitch_m": 1e-6, "wavelength_m": 940e-9}))
    (tmp_path / "cache").mkdir()
    (tmp_path / "cache").chmod(0o1777)
    told = ok("doe", "inspect", "cell.npy", "--cache", "cache", "--texels", "96,64", "--beam-sigma-um", "60").err
    assert "it is a folder for everybody; choose another one" in told
    assert "chmod" not in told


def test_only_unfinished_files_are_swept(ok: Callable[..., Run], tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    left, other = (tmp_path / "out" / f".clspeckle-0123456789abcdef.part{end}" for end in (".png", "ners.txt"))
    left.touch()
    other.touch()
    np.save(tmp_path / "ideal.npy", np.ones((16, 16), np.float32))
    ok("render", "ideal.npy", "-o", "out", "--no-preview")
    assert not left.exists()
    assert other.exists()

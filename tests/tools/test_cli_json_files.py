"""Every kind of JSON file that the program reads, with all that can be wrong with JSON: one clear error, soon."""

from __future__ import annotations

import json
import os
import resource
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from cli_support import PROGRAM, Run

DEEP = 80000
WIDE = 200_000
SECONDS = 10  # of work, whatever else the machine does; what is quadratic takes minutes

# Text, and what the message must say.
BAD: dict[str, tuple[bytes, str]] = {
    "deep lists": (b"[" * DEEP + b"]" * DEEP, "nested more than 100 levels deep"),
    "deep objects": (b'{"camera":' * DEEP + b"1" + b"}" * DEEP, "nested more than 100 levels deep"),
    "key twice": (b'{"format": {"a": 1, "a": 1}}', 'the key "format.a" is given twice; keep one of them'),
    "cut": (b'{"format": [1, {"a', "the file ends before it is complete"),
    "zero byte": (b"{}\0{}", "save it in that encoding"),
    "UTF-16": ('{"format": 1}'.encode("utf-16"), "save it in that encoding"),
    "Latin-1": ('{"name": "Gr\u00fcn"}'.encode("latin-1"), "save it in that encoding"),
    "huge number": (b'{"version": 1e999}', "expected a number below 1.8e308"),
    "huge text": (b'{"format": ' + b"x" * 1000000, "is not valid JSON"),
    "huge key": (b'{"' + b"k" * 1000000 + b'": 1}', "has a key of 1000000 bytes"),
}
# JSON that is none of the file's kind, in its size: refused by whoever reads it.
LISTS = ("sequences", "materials", "orders", "dots")
MANY = json.dumps({key: [{}] * (WIDE // len(LISTS)) for key in LISTS}).encode()


def limit_work() -> None:
    resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS))


def write_design(folder: Path) -> None:
    np.save(folder / "bad.npy", np.zeros((16, 16), np.float32))


def write_frame(folder: Path) -> None:
    np.save(folder / "ideal.npy", np.ones((24, 32), np.float32))
    np.save(folder / "ids.npy", np.zeros((24, 32), np.uint8))
    (folder / "dots.txt").write_text("0 0\n")
    (folder / "set").mkdir()


# The command that reads bad.json, by the kind of file.
KINDS: dict[str, list[str]] = {
    "capture": ["capture", "check", "bad.json"],
    "configuration": ["render", "ideal.npy", "-o", "out", "--config", "bad.json"],
    "sequence": ["render", "bad.json", "-o", "out"],
    "materials": ["render", "--depth", "ideal.npy", "--material", "ids.npy", "--materials", "bad.json", "-o", "out"],
    "profile": ["render", "ideal.npy", "-o", "out", "--profile", "bad.json"],
    "dots": ["capture", "make", "new", "--dots", "bad.json"],
    "design": ["doe", "inspect", "bad.npy"],
    "wanted dots": ["doe", "design", "bad.json", "-o", "new"],
    "directions": ["depth", "ideal.npy", "--geometry", "whole.json", "--dots", "bad.json"],
    "geometry": ["depth", "ideal.npy", "--geometry", "bad.json", "--dots", "dots.txt"],
    "hypothesis": ["diagnose", "set", "--hypothesis", "bad.json"],
    "tolerance": ["diagnose", "camera", "--tolerance", "bad.json"],
}


@pytest.fixture(scope="module")
def camera(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("camera")
    size = ["--width", "32", "--height", "32", "--frames", "4", "--sequences", "dark,flat"]
    subprocess.run([str(PROGRAM), "capture", "make", "camera", *size], check=True, cwd=folder, capture_output=True)
    return folder / "camera"


@pytest.fixture
def refuse(refused: Callable[..., str], camera: Path, tmp_path: Path) -> Callable[[str, bytes], str]:
    write_frame(tmp_path)
    write_design(tmp_path)
    (tmp_path / "camera").symlink_to(camera)
    intrinsics = {"fx_px": 30.0, "fy_px": 30.0, "cx_px": 15.5, "cy_px": 11.5}
    pose = [1.0, 0, 0, 0.1, 0, 1, 0, 0, 0, 0, 1, 0]
    (tmp_path / "whole.json").write_text(json.dumps({"camera": intrinsics, "laser": {"laser_from_geometry": pose}}))

    def run(kind: str, content: bytes) -> str:
        (tmp_path / "bad.json").write_bytes(content)
        message = refused(*KINDS[kind], preexec_fn=limit_work)
        assert "bad.json" in message
        assert len(message) < 2000
        return message

    return run


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_no_json_is_refused(refuse: Callable[[str, bytes], str], kind: str) -> None:
    for name, (content, words) in BAD.items():
        assert words in refuse(kind, content), name


@pytest.mark.parametrize("kind", KINDS)
def test_large_files_take_little_time(refuse: Callable[[str, bytes], str], kind: str) -> None:
    refuse(kind, MANY)


def test_many_unknown_keys_are_counted(ok: Callable[..., Run], camera: Path, tmp_path: Path) -> None:
    about = json.loads((camera / "capture.json").read_text())
    (tmp_path / "set").mkdir()
    for frames in camera.glob("*.npy"):
        (tmp_path / "set" / frames.name).symlink_to(frames)
    (tmp_path / "set" / "capture.json").write_text(json.dumps({**about, **{f"key{i}": 1 for i in range(WIDE)}}))
    told = ok("capture", "check", "set", preexec_fn=limit_work).err
    assert "the key /key19 is not known and is ignored" in told
    assert f"{WIDE - 20} further keys of / are not known and are ignored" in told
    assert "/key20 " not in told


def test_a_byte_order_mark_is_taken(ok: Callable[..., Run], tmp_path: Path) -> None:
    write_frame(tmp_path)
    (tmp_path / "config.json").write_bytes(b"\xef\xbb\xbf" + b'{"render": {"format": "npy"}}')
    ok("render", "ideal.npy", "-o", "out", "--config", "config.json")


@pytest.mark.parametrize("content", [text for text, _ in BAD.values()], ids=list(BAD))
def test_a_tuning_record_that_is_none_changes_nothing(ok: Callable[..., Run], tmp_path: Path, content: bytes) -> None:
    write_frame(tmp_path)
    (tmp_path / "tuning.json").write_bytes(content)
    variables = {**os.environ, "CLSPECKLE_TUNING": str(tmp_path / "tuning.json")}
    done = ok("render", "ideal.npy", "-o", "out", preexec_fn=limit_work, env=variables)
    assert "tuning.json is ignored: the file: " in done.err
    assert len(done.err) < 2000


def test_lists_of_dots_take_linear_time(refused: Callable[..., str], tmp_path: Path) -> None:
    """Many lines without a comment; the last one is wrong, so that the whole list is read."""
    write_frame(tmp_path)
    pose = [1.0, 0, 0, 0.1, 0, 1, 0, 0, 0, 0, 1, 0]
    intrinsics = {"fx_px": 30.0, "fy_px": 30.0, "cx_px": 15.5, "cy_px": 11.5}
    (tmp_path / "whole.json").write_text(json.dumps({"camera": intrinsics, "laser": {"laser_from_geometry": pose}}))
    (tmp_path / "many.txt").write_text("0.1 0.2\n" * 5 * WIDE + "0.1\n")
    message = refused("depth", "ideal.npy", "--geometry", "whole.json", "--dots", "many.txt", preexec_fn=limit_work)
    assert f"line {5 * WIDE + 1}" in message

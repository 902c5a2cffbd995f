"""Windows and some frames of large captures give the verdict that all of it gives, in bounded memory."""

from __future__ import annotations

import json
import os
import resource
import subprocess
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import clspeckle
from gap_check.camera import draw_camera
from gap_check.generator import write_capture

ROOT = Path(__file__).resolve().parents[3]
PROGRAM = Path(os.environ.get("CLSPECKLE_CLI", ROOT / "build" / "bin" / "clspeckle"))
ADDRESS_SPACE = 2 << 30  # what a shell's `ulimit -v 2097152` leaves
CAMERA = {"bits": 10, "pixel_pitch_um": 2.9, "f_number": 5.6, "black_level_dn": 64.0, "read_noise_dn": 4.0}


def run(*arguments: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run([str(PROGRAM), *map(str, arguments)], check=False, capture_output=True, text=True)


def diagnosed(folder: Path, *options: object) -> dict[str, Any]:
    done = run("diagnose", folder, "--json", "-", "--quiet", *options)
    assert done.returncode == 0, done.stderr
    report: dict[str, Any] = json.loads(done.stdout)
    return report


@pytest.mark.parametrize(
    ("effect", "parameter", "value", "tolerance"),
    [
        ("vignetting", "corner_loss", 0.3, 0.02),
        pytest.param("lens_distortion", "k1", 0.04, 0.004, marks=pytest.mark.nightly),
    ],
)
def test_a_window_says_what_the_whole_says(
    tmp_path: Path, effect: str, parameter: str, value: float, tolerance: float
) -> None:
    """Both effects go by the distance from the optical axis; the window is a strip of half of the rows."""
    camera = draw_camera(911, 224, 192)
    write_capture(tmp_path / "set", camera, {effect: {parameter: value}}, 16, 912)
    whole = diagnosed(tmp_path / "set")
    assert "used" not in whole["coverage"]
    part = diagnosed(tmp_path / "set", "--window", "0,48,224,96", "--frames", "12")
    used = part["coverage"]["used"]
    assert {(u["frames"], u["of"], u["x"], u["y"], u["width"], u["height"]) for u in used} == {(12, 16, 0, 48, 224, 96)}
    assert used[0]["runs"] == [{"first": 1, "count": 6}, {"first": 9, "count": 6}]
    assert any("rows 48 to 143" in note for note in part["notes"])
    for report in (whole, part):
        assert report["cause"]["verdict"] == "named"
        assert report["cause"]["effects"] == [effect]
        ranked = next(r for r in report["cause"]["ranking"] if r["effect"] == effect)
        assert ranked["parameters"][parameter] == pytest.approx(value, abs=tolerance)


def large_set(folder: Path, frames: int, scale: float = 1.0) -> Path:
    """Dark and flat frames of 1280 x 1024 pixels, 2.6 MB each."""
    folder.mkdir()
    random = np.random.default_rng(3)
    noise = (4.0 * random.standard_normal(2 * 1280 * 1024, dtype=np.float32)).astype(np.float32)
    for name, level in (("dark", 64.0), ("flat", 64.0 + 200.0 * scale)):
        stack = np.lib.format.open_memmap(folder / f"{name}.npy", "w+", np.uint16, (frames, 1024, 1280))
        for frame in stack:  # other noise in each frame, without drawing it anew
            start = random.integers(noise.size // 2)
            frame[...] = np.rint(level + noise[start : start + frame.size].reshape(frame.shape))
        del stack
    sequences = [{"name": name, "file": f"{name}.npy", "scene": name} for name in ("dark", "flat")]
    described = {"format": "clspeckle-capture", "version": 1, "camera": {"width": 1280, "height": 1024, **CAMERA},
                 "laser": {"wavelength_nm": 940.0}, "sequences": sequences}  # fmt: skip
    (folder / "capture.json").write_text(json.dumps(described))
    return folder


def peak_megabytes(out: Path, *arguments: object) -> float:
    """Of the program, to within what it takes in its last 20 ms; `out` gets what it prints."""
    peak = 0.0
    with out.open("w") as stream:
        process = subprocess.Popen(
            [str(PROGRAM), *map(str, arguments)],
            stdout=stream,
            preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (ADDRESS_SPACE, ADDRESS_SPACE)),
        )
        while process.poll() is None:  # what wait4() tells has the memory of this process in it
            status = Path(f"/proc/{process.pid}/status").read_text()
            for line in status.splitlines():
                if line.startswith("VmHWM:"):
                    peak = int(line.split()[1]) / 1024
            time.sleep(0.02)
    assert process.returncode == 0
    return peak


def test_memory_does_not_grow_with_the_capture(tmp_path: Path) -> None:
    """Of 315 MB, more than what is read into memory: a check takes that of a few frames, a diagnosis what its
    simulations take."""
    folder = large_set(tmp_path / "set", 60)
    out = tmp_path / "out.json"
    checked = peak_megabytes(out, "capture", "check", folder, "--json", "-")
    summary = json.loads(out.read_text())
    assert [s["frames"] for s in summary["sequences"]] == [60, 60]
    assert summary["sequences"][1]["temporal_noise_dn"] == pytest.approx(4.01, abs=0.02)
    assert 0 < checked < 150
    judged = peak_megabytes(out, "diagnose", folder, "--json", "-", "--quiet", "--max-effects", "1")
    report = json.loads(out.read_text())
    assert [u["of"] for u in report["coverage"]["used"]] == [60, 60]
    assert all(u["width"] == 1280 and u["height"] < 1024 for u in report["coverage"]["used"])
    assert 0 < judged < 1000

    # Two large sets against each other: the same window of both.
    other = large_set(tmp_path / "other", 60, 1.1)
    compared = peak_megabytes(out, "gap", "compare", folder, other, "--json", "-", "--quiet", "--max-effects", "1")
    assert [u["of"] for u in json.loads(out.read_text())["coverage"]["used"]] == [60, 60]
    assert 0 < compared < 1000

    with clspeckle.Capture.open(folder) as capture:
        (folder / "flat.npy").unlink()
        with pytest.raises(clspeckle.errors.InputOutputError, match="flat.npy"):
            _ = capture.sequences


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--window", "a"], "X,Y,WIDTH,HEIGHT"),
        (["--window", "0,0,32"], "X,Y,WIDTH,HEIGHT"),
        (["--window", "0,0,32,32,"], "X,Y,WIDTH,HEIGHT"),
        (["--window", "-2,0,32,32"], "X,Y,WIDTH,HEIGHT"),
        (["--window", "90,0,32,32"], "reaches to column 122"),
        (["--window", "0,0,12,32"], "16 x 16"),
        (["--window", "1,0,32,32"], "odd"),
        (["--frames", "-1"], "--frames"),
        (["--frames", "65536"], "--frames"),
    ],
)
def test_bad_parts_are_refused(tmp_path: Path, options: list[str], words: str) -> None:
    write_capture(tmp_path / "set", draw_camera(913, 96, 80), {}, 4, 914)
    done = run("diagnose", tmp_path / "set", *options)
    assert done.returncode == 1
    assert words in done.stderr


def test_python_takes_windows_and_frames(tmp_path: Path) -> None:
    write_capture(tmp_path / "set", draw_camera(913, 96, 80), {}, 12, 914)
    told: list[float] = []
    with clspeckle.Capture.open(tmp_path / "set", progress=lambda _what, part: told.append(part)) as capture:
        assert told[-1] == 1.0 and told == sorted(told)
        found = clspeckle.diagnose(capture, window=(16, 8, 64, 64), frames=8, null_replicates=12, max_effects=1)
        assert {(u.frames, u.of, u.window) for u in found.coverage.used} == {(8, 12, (16, 8, 64, 64))}
        whole = clspeckle.diagnose(capture, window="whole", frames=0, null_replicates=12, max_effects=1)
        assert whole.coverage.used == ()
        for bad in ("all", (0, 0, 64), 3, (0, 0, 64, 64.5)):
            with pytest.raises((TypeError, clspeckle.errors.InvalidArgumentError), match="window"):
                clspeckle.diagnose(capture, window=bad)  # type: ignore[arg-type]
        with pytest.raises(clspeckle.errors.InvalidArgumentError, match="80"):
            clspeckle.diagnose(capture, window=(0, 40, 64, 64))
    with pytest.raises(clspeckle.errors.CancelledError):
        clspeckle.Capture.open(tmp_path / "set", progress=lambda _what, _part: False)

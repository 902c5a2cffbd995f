"""clspeckle diagnose: reports, summary, options, refusals. What a verdict is worth is tested elsewhere; here the captures are small."""

from __future__ import annotations

import json
import re
import signal
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest

QUICK = ["--replicates", 12, "--max-effects", 1]


def write_set(folder: Path, ramp_dn: float, bits: int = 10) -> Path:
    """Dark and flat of a camera with black level 64 and read noise 4; the flat is brighter on the right, by up to ramp_dn each way."""
    folder.mkdir()
    random = np.random.default_rng(7)
    ramp = np.linspace(-1, 1, 64)
    entries = []
    for name, light in (("dark", 0 * ramp), ("flat", 300 + ramp_dn * ramp)):
        codes = np.clip(np.rint(64 + light + random.normal(0, 4, (8, 48, 64))), 0, 1023).astype(np.uint16)
        np.save(folder / f"{name}.npy", codes)
        entries.append({"name": name, "file": f"{name}.npy", "scene": name, "motion": "static"})
    camera = {"width": 64, "height": 48, "bits": bits, "pixel_pitch_um": 2.9, "f_number": 5.6, "black_level_dn": 64.0, "read_noise_dn": 4.0}
    text = {"format": "clspeckle-capture", "version": 1, "camera": camera, "laser": {"wavelength_nm": 940.0}, "sequences": entries}
    (folder / "capture.json").write_text(json.dumps(text))
    return folder


def test_no_gap(ok, tmp_path: Path) -> None:
    write_set(tmp_path / "set", 0)
    run = ok("diagnose", "set", "--json", "report.json", *QUICK)
    assert run.out.startswith("NONE: at the level 0.02 no gap")
    assert "Report: report.json" in run.out
    report = json.loads((tmp_path / "report.json").read_text())
    assert (report["format"], report["version"]) == ("clspeckle-gap-report", 1)
    assert report["cause"]["verdict"] == "none"
    assert report["cause"]["effects"] == []
    assert not report["gap"]["detected"]
    again = ok("diagnose", "set/capture.json", "--json", "-", "--threads", 1, *QUICK)
    assert again.json() == report, "the same seed, the same report"
    other = ok("diagnose", "set", "--json", "-", "--quiet", "--seed", 1, *QUICK).json()
    assert other["gap"]["null_95"] != report["gap"]["null_95"]
    assert ok("diagnose", "set", "--quiet", *QUICK).out == ""


def test_a_gap_is_located(ok, tmp_path: Path) -> None:
    write_set(tmp_path / "set", 20)
    run = ok("diagnose", "set", "--json", "report.json", *QUICK)
    report = json.loads((tmp_path / "report.json").read_text())
    assert report["gap"]["detected"]
    verdict = report["cause"]["verdict"]
    assert verdict == "unknown", "no effect of the catalogue is a ramp"
    assert run.out.startswith("UNKNOWN: a significant part of the gap")
    worst = report["where"][0]
    assert worst["sequence"] == "flat"
    assert re.search(rf"{worst['stage']} +flat +{worst['statistic']} ", run.out)
    for words in ("Gap: ", "Where: ", "Residual: a significant gap remains", "Seed 0"):
        assert words in run.out
    assert max(map(len, run.out.splitlines())) <= 140
    assert [path.name for path in tmp_path.iterdir() if path.name.startswith(".")] == []


def test_an_effect_is_named_with_a_waterfall(ok, tmp_path: Path) -> None:
    """Rows that jump in each frame: nothing else does that. 8 frames of 48 rows, 3 DN against 4 DN of pixel noise."""
    write_set(tmp_path / "set", 0)
    random = np.random.default_rng(8)
    for name in ("dark", "flat"):
        codes = np.load(tmp_path / "set" / f"{name}.npy") + np.rint(random.normal(0, 3, (8, 48, 1)))
        np.save(tmp_path / "set" / f"{name}.npy", np.clip(codes, 0, 1023).astype(np.uint16))
    run = ok("diagnose", "set", "--json", "report.json", "--html", "report.html", *QUICK)
    assert "For a browser: report.html" in run.out
    assert "row_noise" in (tmp_path / "report.html").read_text(encoding="utf-8")
    report = json.loads((tmp_path / "report.json").read_text())
    assert "row_noise" in report["cause"]["effects"]
    assert report["shrink"]["fraction"] > 0.5
    assert re.search(r"\* +row_noise +sensor ", run.out)
    assert re.search(r"simulator as it is +[\d.]+ +#+", run.out)
    assert re.search(r"with row_noise +[\d.]+ +\d+ % gone", run.out)
    withheld = ok("diagnose", "set", "--json", "-", "--without", "row_noise,gamma", *QUICK).json()
    ranked = {entry["effect"] for entry in withheld["cause"]["ranking"]}
    assert not ranked & {"row_noise", "gamma"}
    assert "row_noise" not in withheld["cause"]["effects"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["missing"], "missing"),
        (["set", "--without", "defokus"], "defokus"),
        (["set", "--level", 0.9], "--level"),
        (["set", "--replicates", 3], "--replicates"),
        (["set", "--max-effects", 0], "--max-effects"),
        (["set", "--seed", -1], "--seed"),
        (["set", "--jsn", "x"], "the nearest one is --json"),
        ([], "CAPTURE"),
    ],
    ids=str,
)
def test_bad_usage(refused, tmp_path: Path, arguments: list[object], words: str) -> None:
    write_set(tmp_path / "set", 0)
    assert words in refused("diagnose", *arguments)


@pytest.mark.parametrize("path", ["nowhere/report.json", "set"])
def test_reports_that_cannot_be_written_are_refused_at_once(refused, tmp_path: Path, path: str) -> None:
    write_set(tmp_path / "set", 0)
    start = time.monotonic()
    assert path in refused("diagnose", "set", "--json", path, "--replicates", 100000, code=3)
    assert time.monotonic() - start < 60


def test_interrupt(program: Path, tmp_path: Path) -> None:
    write_set(tmp_path / "set", 0)
    command = [program, "diagnose", "set", "--json", "report.json", "--replicates", "100000"]
    with subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as running:
        time.sleep(3)
        running.send_signal(signal.SIGINT)
        out, err = running.communicate(timeout=120)
    assert running.returncode == 130, err
    assert "interrupted" in err and out == ""
    assert not (tmp_path / "report.json").exists()


def test_warnings_of_the_capture_are_told(ok, tmp_path: Path) -> None:
    folder = write_set(tmp_path / "set", 0)
    text = json.loads((folder / "capture.json").read_text())
    text["camera"]["shutter"] = "rolling"
    (folder / "capture.json").write_text(json.dumps(text))
    assert "shutter" in ok("diagnose", "set", "--quiet", *QUICK).err


def test_help(ok) -> None:
    text = ok("diagnose", "--help").out
    assert "Usage: clspeckle" in text and "Examples:" in text
    assert max(map(len, text.splitlines())) <= 120, "it fits a terminal"
    for words in ("none", "named", "ambiguous", "unknown", "--without", "--level"):
        assert words in text

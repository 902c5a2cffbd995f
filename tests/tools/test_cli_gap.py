"""clspeckle gap compare and gap check: reports, summaries, options, refusals. The captures are small, the causes
gross."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from cli_support import ROOT

QUICK = ["--replicates", 12, "--max-effects", 1]
WITHHELD = ROOT / "validation" / "gap_check"


def write_set(
    folder: Path, seed: int, row_dn: float = 0.0, width: int = 64, frames: int = 8, light_dn: float = 300.0
) -> Path:
    """Dark and flat of a camera with black level 64 and read noise 4; its rows jump by row_dn in each frame."""
    folder.mkdir()
    random = np.random.default_rng(seed)
    entries = []
    for name, light in (("dark", 0.0), ("flat", light_dn)):
        signal = 64 + light + row_dn * random.normal(size=(frames, 48, 1)) + random.normal(0, 4, (frames, 48, width))
        np.save(folder / f"{name}.npy", np.clip(np.rint(signal), 0, 1023).astype(np.uint16))
        entries.append({"name": name, "file": f"{name}.npy", "scene": name, "motion": "static"})
    camera = {
        "width": width,
        "height": 48,
        "bits": 10,
        "pixel_pitch_um": 2.9,
        "f_number": 5.6,
        "black_level_dn": 64.0,
        "read_noise_dn": 4.0,
    }
    text = {
        "format": "clspeckle-capture",
        "version": 1,
        "camera": camera,
        "laser": {"wavelength_nm": 940.0},
        "sequences": entries,
    }
    (folder / "capture.json").write_text(json.dumps(text))
    return folder


def test_what_a_simulator_lacks(ok, tmp_path: Path) -> None:
    write_set(tmp_path / "real", 1, row_dn=3.0)
    write_set(tmp_path / "sim", 2, frames=10, light_dn=360.0)
    run = ok("gap", "compare", "real", "sim", "--json", "report.json", "--html", "report.html", *QUICK)
    report = json.loads((tmp_path / "report.json").read_text())
    assert report["format"] == "clspeckle-gap-report"
    assert report["cause"]["ranking"][0]["effect"] == "row_noise"
    assert report["cause"]["ranking"][0]["parameters"]["sigma_dn"] == pytest.approx(3.0, abs=0.6)
    pairs = report["compare"]["pairs"]
    assert [(pair["real"], pair["sim"], pair["frames"]) for pair in pairs] == [("dark", "dark", 8), ("flat", "flat", 8)]
    assert pairs[1]["sim_scale"] == pytest.approx(300 / 360, rel=0.01)
    assert re.search(r"\* +row_noise +sensor ", run.out)
    assert re.search(r"flat +flat +8 +300\.\d, 3\d\d\.\d", run.out)
    assert "cannot be put on finished frames" in run.out
    assert "What was compared" in (tmp_path / "report.html").read_text(encoding="utf-8")
    again = ok("gap", "compare", "real", "sim", "--json", "-", "--threads", 1, *QUICK)
    assert again.json() == report, "the same seed, the same report"


@pytest.mark.parametrize("of_sim", [False, True])
def test_sequences_without_light_are_left_out_as_by_a_diagnosis(cli, ok, tmp_path: Path, of_sim: bool) -> None:
    """Frames without light among others, and a sequence that has none at all."""
    write_set(tmp_path / "lit", 1, frames=16)
    unlit = write_set(tmp_path / "unlit", 2, frames=16)
    codes, dark = np.load(unlit / "flat.npy"), np.load(unlit / "dark.npy")
    codes[1::2] = dark[::-2]
    np.save(unlit / "flat.npy", codes)
    compared = ["gap", "compare", *(("lit", "unlit") if of_sim else ("unlit", "lit")), "--json", "-", *QUICK]
    report = ok(*compared).json()
    note = "flat was left out: " + ("of the simulator, " if of_sim else "") + "8 of its 16 frames have no light"
    assert note in report["notes"]
    assert [pair["real"] for pair in report["compare"]["pairs"]] == report["coverage"]["sequences"] == ["dark"]
    assert report["coverage"]["left_out"] == ["flat"]
    assert report["cause"]["verdict"] == "unknown", "that is no reason to find no gap"
    np.save(unlit / "flat.npy", dark[::-1])
    report = ok(*compared).json()
    assert any("flat was left out: " in note and "no light to judge" in note for note in report["notes"])
    assert report["coverage"]["left_out"] == ["flat"]
    np.save(unlit / "dark.npy", np.full_like(dark, 64))
    message = cli(*compared).err
    assert "no pair of sequences can be compared: dark was left out" in message


def test_equal_sets(ok, tmp_path: Path) -> None:
    write_set(tmp_path / "real", 1)
    write_set(tmp_path / "sim", 2)
    run = ok("gap", "compare", "real", "sim", *QUICK)
    assert run.out.startswith("NONE")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["compare", "real"], "SIM"),
        (["compare", "real", "missing"], "missing"),
        (["compare", "real", "wide"], "64 x 48 pixels, those of the simulated set 72 x 48"),
        (["compare", "real", "real", "--without", "defokus"], "defokus"),
        (["compare", "real", "real", "--jsn", "x"], "the nearest one is --json"),
        (["compair"], 'the nearest one is "compare"'),
        (["check"], "--out"),
        (["check", "--out", "check", "--generator", "real"], "holds no generator"),
        (
            ["check", "--out", "check", "--generator", WITHHELD, "--python", "no-such-python"],
            "there is no program no-such-python",
        ),
        (["check", "--out", "check", "--generator", WITHHELD, "--jobs", 0], "--jobs"),
    ],
    ids=str,
)
def test_bad_usage(refused, tmp_path: Path, arguments: list[object], words: str) -> None:
    write_set(tmp_path / "real", 1)
    write_set(tmp_path / "wide", 1, width=72)
    assert words in refused("gap", *arguments)


TINY = {
    "name": "tiny",
    "width": 64,
    "height": 48,
    "frames": 8,
    "nulls": 1,
    "singles_each": 1,
    "single_effects": ["row_noise"],
    "pairs": 0,
    "many": 0,
    "outside_each": 0,
    "without_each": 0,
    "replica_groups": 0,
    "minimum_strength": 0.9,
}


def test_check_counts_what_the_diagnosis_says(ok, cli, program: Path, tmp_path: Path) -> None:
    """Two sets: nothing on, and strong row noise."""
    (tmp_path / "tiny.json").write_text(json.dumps(TINY))
    common = ["gap", "check", "--plan", "tiny.json", "--generator", WITHHELD, "--python", sys.executable]
    quick = f"'{program}' diagnose --quiet --replicates 12 --max-effects 1"
    run = ok(*common, "--out", "check", "--command", quick, "--json", "score.json")
    score = json.loads((tmp_path / "score.json").read_text())
    assert score["sets"] == {"null": 1, "single": 1}
    figures = {figure["id"]: figure for figure in score["figures"]}
    assert figures["failed"]["successes"] == 0
    assert re.search(r"false alarms: verdict other than `none` +a +\d", run.out)
    assert re.search(r"exactly named +b +[\d.]+ % .* of 1 sets", run.out)
    assert (tmp_path / "check" / "score" / "score.md").is_file()
    assert not (tmp_path / "check" / "captures" / "s0000").exists(), "a set exists only while it is diagnosed"
    # A finished check is only scored again.
    assert ok(*common, "--out", "check", "--command", "false", "--json", "-").json() == score
    # A tool that writes no reports is counted wrong, not an error of the check.
    failed = {f["id"]: f for f in ok(*common, "--out", "broken", "--command", "false", "--json", "-").json()["figures"]}
    assert failed["failed"]["successes"] == 2
    # Another plan in the same folder is refused, in the generator's words.
    other = cli(*common[:2], "--plan", "small", *common[4:], "--out", "check")
    assert other.code == 1 and "another plan" in other.err


@pytest.mark.nightly
def test_power_counts_what_is_noticed_and_named(ok, cli, refused, program: Path, tmp_path: Path) -> None:
    """One effect, six strengths, two numbers of frames: the weak one is named with 16 frames."""
    common = ["gap", "power", "--generator", WITHHELD, "--python", sys.executable]
    quick = f"'{program}' diagnose --quiet --replicates 12 --max-effects 1 --without prnu"
    small = [*common, "--effect", "shot_noise", "--frames", "2,4", "--repeats", 1]
    run = ok(*small, "--out", "study", "--command", quick, "--json", "power.json", "--jobs", 2)
    power = json.loads((tmp_path / "power.json").read_text())
    assert power["effects"] == ["shot_noise"]
    assert [(row["frames"], row["sets"]) for row in power["rows"]] == [
        (frames, 1) for frames in (2, 4) for _ in range(6)
    ]
    shares = [row["detected"]["share"] for row in power["rows"] if row["frames"] == 4]
    assert shares[-1] == 1.0, "the catalogue's weakest photon noise is noticed in four frames"
    assert re.search(r"\n4 +1\.00 +1 +100\.0 %", run.out)
    assert (tmp_path / "study" / "power.md").is_file()
    assert ok(*small, "--out", "study", "--command", "false", "--json", "-").json() == power, "counted again"
    assert {row["failed"] for row in power["rows"]} == {0}
    broken = ok(*small, "--out", "broken", "--command", "false", "--json", "-")
    assert {(row["failed"], row["detected"]["share"]) for row in broken.json()["rows"]} == {(1, 0.0)}
    assert "12 of 12 diagnoses wrote no valid report" in broken.err
    assert "--repeats" in refused(*common, "--out", "study2", "--repeats", 0)
    unknown = cli(*common, "--out", "study3", "--effect", "defokus", "--repeats", 1)
    assert unknown.code == 1 and "defokus" in unknown.err


def test_check_says_what_it_needs(cli, program: Path, tmp_path: Path) -> None:
    """Away from any checkout, and with a Python that has no NumPy."""
    away = tmp_path / "bin"
    away.mkdir()
    shutil.copy(program, away / "clspeckle")
    library = os.environ.get("CLSPECKLE_LIBRARY", str(program.parent.parent / "lib" / "libclspeckle.so"))
    environment = {**os.environ, "LD_LIBRARY_PATH": str(Path(library).parent)}
    command = [away / "clspeckle", "gap", "check", "--out", "check"]
    alone = subprocess.run(command, check=False, cwd=tmp_path, env=environment, capture_output=True, text=True)
    assert alone.returncode == 1, alone.stderr
    assert "validation/gap_check" in alone.stderr and "--generator" in alone.stderr
    bare = tmp_path / "bare-python"
    bare.write_text("#!/bin/sh\nexit 1\n")
    bare.chmod(0o755)
    run = cli("gap", "check", "--out", "check", "--generator", WITHHELD, "--python", bare)
    assert run.code == 1 and "NumPy and SciPy" in run.err and "requirements.txt" in run.err

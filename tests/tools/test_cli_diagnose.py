"""clspeckle diagnose: reports, summary, options, refusals. What a verdict is worth is tested elsewhere; here the
captures are small."""

from __future__ import annotations

import contextlib
import json
import os
import re
import signal
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest

QUICK = ["--replicates", 12, "--max-effects", 1]


def write_set(folder: Path, ramp_dn: float, bits: int = 10) -> Path:
    """Dark and flat of a camera with black level 64 and read noise 4; the flat is brighter on the right, by up to
    ramp_dn each way."""
    folder.mkdir()
    random = np.random.default_rng(7)
    ramp = np.linspace(-1, 1, 64)
    entries = []
    for name, light in (("dark", 0 * ramp), ("flat", 300 + ramp_dn * ramp)):
        codes = np.clip(np.rint(64 + light + random.normal(0, 4, (8, 48, 64))), 0, 1023).astype(np.uint16)
        np.save(folder / f"{name}.npy", codes)
        entries.append({"name": name, "file": f"{name}.npy", "scene": name, "motion": "static"})
    camera = {
        "width": 64,
        "height": 48,
        "bits": bits,
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


def test_sequences_with_frames_without_light_are_left_out(ok, tmp_path: Path) -> None:
    """An emitter that alternates: half of the frames are dark. What is advised makes a set that is judged."""
    folder = write_set(tmp_path / "set", 0)
    random = np.random.default_rng(8)

    def speckle() -> np.ndarray:
        field = np.fft.fft2(random.normal(size=(48, 64)) + 1j * random.normal(size=(48, 64)))
        pupil = np.hypot(np.fft.fftfreq(48)[:, None], np.fft.fftfreq(64)) < 0.275
        intensity = np.abs(np.fft.ifft2(field * pupil)) ** 2
        return intensity / intensity.mean()

    text = json.loads((folder / "capture.json").read_text())
    del text["sequences"][1]
    still = speckle()
    scenes = {"dark": [0 * still] * 16, "static": [still] * 16, "moving": [speckle() for _ in range(16)]}
    for motion, frames in scenes.items():
        lit = [175 * frame * (t % 2 == 0) for t, frame in enumerate(frames)]
        codes = np.clip(np.rint(64 + np.stack(lit) + random.normal(0, 4, (16, 48, 64))), 0, 1023).astype(np.uint16)
        np.save(folder / f"{motion}.npy", codes)
        if motion != "dark":
            text["sequences"].append({"name": motion, "file": f"{motion}.npy", "scene": "board", "motion": motion})
    (folder / "capture.json").write_text(json.dumps(text))
    report = ok("diagnose", "set", "--replicates", 12).out
    assert "NOTHING COULD BE JUDGED of light" in report
    for motion in ("static", "moving"):
        assert f"{motion} was left out: 8 of its 16 frames have no light" in report
    told = ok("capture", "check", "set").err
    assert "static: 8 of 16 frames" in told and "moving: 8 of 16 frames" in told and "take codes[0::2]" in told
    for motion in ("static", "moving"):
        np.save(folder / f"{motion}.npy", np.load(folder / f"{motion}.npy")[0::2])
    assert "have no light" not in ok("capture", "check", "set").err
    assert "was left out" not in ok("diagnose", "set", "--replicates", 12, "--max-effects", 1).out


def test_a_set_with_frames_without_light_is_not_none(ok, tmp_path: Path) -> None:
    """One lost frame: its sequence is left out, and the others, which have no gap, do not speak for it."""
    folder = write_set(tmp_path / "set", 0)
    codes = np.load(folder / "flat.npy")
    codes[3] = np.load(folder / "dark.npy")[3]
    np.save(folder / "lost.npy", codes)
    text = json.loads((folder / "capture.json").read_text())
    text["sequences"].append({**text["sequences"][1], "name": "lost", "file": "lost.npy"})
    (folder / "capture.json").write_text(json.dumps(text))
    report = ok("diagnose", "set", "--json", "-", "--quiet", *QUICK).json()
    assert report["coverage"]["left_out"] == ["lost"]
    assert [change["sequence"] for change in report["gap"]["frame_changes"]] == ["lost"]
    assert report["cause"]["verdict"] == "unknown"


def test_no_gap(ok, tmp_path: Path) -> None:
    write_set(tmp_path / "set", 0)
    run = ok("diagnose", "set", "--json", "report.json", *QUICK)
    assert run.out.startswith("NONE: no gap in what could be tested: at the level 0.02, none of ")
    assert "statistics of dark and flat tells camera and simulator apart" in " ".join(run.out.split())
    shown = run.out[run.out.index("Not tested, so not shown to be right") : run.out.index("Gap: ")]
    assert "defocus" in shown and "motion during the exposure" in " ".join(shown.split())
    assert "dsnu" not in shown, "dark frames show it"
    assert "Report: report.json" in run.out
    calibrated = next(line for line in run.out.splitlines() if line.startswith("Calibrated: "))
    assert calibrated.startswith("Calibrated: black level 6") and "light in DN: flat " in calibrated
    report = json.loads((tmp_path / "report.json").read_text())
    coverage = report["coverage"]
    assert (coverage["sequences"], coverage["left_out"]) == (["dark", "flat"], [])
    assert coverage["statistics"] == len(report["shrink"]["per_statistic"])
    assert {"defocus", "zero_order", "surface_boiling"} <= set(coverage["effects_not_visible"])
    assert not {"prnu", "dsnu", "vignetting"} & set(coverage["effects_not_visible"])
    assert "beam and diffractive element" in coverage["questions_open"]
    assert {"gap.distance", "cause.ranking.distance_after", "shrink.distance_before", "shrink.fraction"} <= set(
        report["scales"]
    )
    assert (report["format"], report["version"]) == ("clspeckle-gap-report", 1)
    assert report["cause"]["verdict"] == "none"
    assert report["cause"]["effects"] == []
    assert not report["gap"]["detected"]
    again = ok("diagnose", "set/capture.json", "--json", "-", "--threads", 1, *QUICK)
    assert again.json() == report, "the same seed, the same report"
    other = ok("diagnose", "set", "--json", "-", "--quiet", "--seed", 1, *QUICK).json()
    assert other["gap"]["null_95"] != report["gap"]["null_95"]
    assert ok("diagnose", "set", "--quiet", *QUICK).out == ""


def test_quiet_is_silent(ok, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Compilers of OpenCL C count their warnings on standard error: kernels that are built for the first time give
    none."""
    write_set(tmp_path / "set", 0)
    monkeypatch.setenv("CLSPECKLE_DISK_CACHE", "off")
    monkeypatch.setenv("POCL_CACHE_DIR", str(tmp_path / "cache"))
    (tmp_path / "cache").mkdir()
    assert ok("diagnose", "set", "--quiet", *QUICK).err == ""
    made = ok("capture", "make", "made", "--width", 48, "--height", 40, "--frames", 2, "--quiet")
    assert (made.out, made.err) == ("", "")


def marked(out: str) -> set[str]:
    """The effects with a star in the ranking."""
    return set(re.findall(r"^ +\* +(\S+)", out, re.MULTILINE))


def test_a_gap_is_located(ok, tmp_path: Path) -> None:
    write_set(tmp_path / "set", 0)
    flat = np.load(tmp_path / "set" / "flat.npy")
    flat[:, :, flat.shape[2] // 2 :] += 20  # an edge, which no lamp has
    np.save(tmp_path / "set" / "flat.npy", flat)
    run = ok("diagnose", "set", "--json", "report.json", *QUICK)
    report = json.loads((tmp_path / "report.json").read_text())
    measured = {(entry["sequence"], entry["quantity"]): entry for entry in report["measurements"]["quantities"]}
    noise = measured["flat", "temporal_noise"]
    assert noise["unit"] == "DN"
    assert noise["real"] == pytest.approx(4, abs=0.15) and noise["sim"] == pytest.approx(4, abs=0.15)
    assert 0 < noise["sim_deviation"] < 0.1
    assert ("sim_with_effects" in noise) == bool(report["shrink"]["steps"])
    assert abs(measured[None, "system_gain"]["real"]) < 0.01, "there is no photon noise"
    assert report["measurements"]["photon_transfer"][0]["points"][1]["signal_dn"] == pytest.approx(310, abs=1)
    looks = report["cause"]["screening"]
    assert {"vignetting", "prnu"} <= {look["effect"] for look in looks}, "all that can show, fitted or not"
    assert "defocus" not in {look["effect"] for look in looks}
    assert [look["share"] for look in looks] == sorted((look["share"] for look in looks), reverse=True)
    assert not all(look["fitted"] for look in looks)
    assert report["gap"]["detected"]
    verdict = report["cause"]["verdict"]
    assert verdict == "unknown", "no effect of the catalogue is an edge"
    assert run.out.startswith("UNKNOWN: a significant part of the gap")
    assert marked(run.out) == set(report["cause"]["effects"]), "what takes nothing away is no part of the explanation"
    assert len(report["shrink"]["steps"]) > len(report["cause"]["effects"]), "and there is some"
    worst = report["where"][0]
    assert worst["sequence"] == "flat"
    assert re.search(rf"{worst['stage']} +flat +{worst['statistic']} ", run.out)
    for words in (
        "Gap: ",
        "standard deviations of the baseline",
        "Where: ",
        "Residual: a significant gap remains",
        "Seed 0",
    ):
        assert words in run.out
    probabilities = [
        report["gap"]["p_value"],
        report["shrink"]["residual_p_value"],
        *(place["p_adjusted"] for place in report["where"]),
    ]
    assert all(1e-300 <= p <= 1 for p in probabilities), "never 0: tails are extrapolated"
    assert "NONE" not in run.out and "Not tested" not in run.out
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
    assert marked(run.out) == set(report["cause"]["effects"])
    assert re.search(r"simulator as it is +[\d.]+ +#+", run.out)
    assert re.search(r"with row_noise +[\d.]+ +\d+ % gone", run.out)
    assert "in standard deviations of the simulator with the effect" in run.out
    assert "in standard deviations of half captures simulated with all effects found" in run.out
    withheld = ok("diagnose", "set", "--json", "-", "--without", "row_noise,gamma", *QUICK).json()
    ranked = {entry["effect"] for entry in withheld["cause"]["ranking"]}
    assert not ranked & {"row_noise", "gamma"}
    assert "row_noise" not in withheld["cause"]["effects"]


RAMP = """float hypothesis(hypothesis_frame frame, hypothesis_values values, uint x, uint y) {
    return hypothesis_pixel(frame, x, y) + values.slope * (2.0f * x / (frame.width - 1) - 1.0f);
}
"""


def write_hypothesis(folder: Path, source: str = RAMP, **change: object) -> Path:
    """In a folder of its own: the source lies beside the description, wherever the program runs."""
    folder.mkdir()
    (folder / "ramp.cl").write_text(source)
    about = {"id": "ramp", "stage": "optics", "summary": "more light on the right", "point": "intensity",
             "parameters": {"slope": {"weak": 0.02, "strong": 0.2, "unit": "1"}}, "opencl": "ramp.cl"}  # fmt: skip
    about.update(change)
    path = folder / "ramp.json"
    path.write_text(json.dumps({key: value for key, value in about.items() if value is not None}))
    return path


def test_an_effect_of_ones_own(ok, refused, tmp_path: Path) -> None:
    write_set(tmp_path / "set", 20)
    write_hypothesis(tmp_path / "own")
    report = ok("diagnose", "set", "--hypothesis", "own/ramp.json", "--json", "-", *QUICK).json()
    assert report["cause"]["effects"] == ["ramp"]
    assert report["cause"]["ranking"][0]["parameters"]["slope"] == pytest.approx(20 / 300, abs=0.003)
    # It takes part in the ranking; what explains more is named.
    write_hypothesis(tmp_path / "rows", RAMP.replace("2.0f * x / (frame.width", "2.0f * y / (frame.height"), id="rows")
    both = ok(
        "diagnose", "set", "--hypothesis", "own/ramp.json", "--hypothesis", "rows/ramp.json", "--json", "-", *QUICK
    )
    assert both.json()["cause"]["effects"] == ["ramp"]
    message = refused("diagnose", "set", "--hypothesis", "own/ramp.json", "--hypothesis", "own/ramp.json", *QUICK)
    assert 'two hypotheses have the id "ramp"' in message
    without = ok("diagnose", "set", "--hypothesis", "own/ramp.json", "--without", "ramp", "--json", "-", *QUICK).json()
    assert "ramp" not in {entry["effect"] for entry in without["cause"]["ranking"]}
    (tmp_path / "deep.json").write_text("[" * 200000 + "]" * 200000)
    assert "nested more than 100 levels deep" in refused("diagnose", "set", "--hypothesis", "deep.json", *QUICK)
    write_hypothesis(tmp_path / "broken", RAMP.replace("values.slope", "slop"))
    message = refused("diagnose", "set", "--hypothesis", "broken/ramp.json", *QUICK)
    assert 'the OpenCL source of the hypothesis "ramp" does not build' in message
    assert "ramp:2" in message and "slop" in message


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"id": "two words"}, "it must be 1 to 31 letters, digits"),
        ({"id": None}, '"id" is missing'),
        ({"id": 3}, '"id" must be text without control characters, got 3'),
        ({"id": "gamma"}, "id of an effect of the catalogue"),
        ({"stage": "optic"}, 'is "optic", it must be laser, doe'),
        ({"stage": None}, '"stage" is missing'),
        ({"point": "code"}, '"point" is "code", it must be irradiance, intensity or codes'),
        ({"parameters": None}, '"parameters" must be an object with 1 to 4 entries'),
        ({"parameters": {}}, '"parameters" must be an object with 1 to 4 entries'),
        ({"parameters": {"slope": 3}}, 'the parameter "slope" must be an object, got 3'),
        ({"parameters": {"slope": {"weak": 1}}}, 'the parameter "slope": "strong" is missing'),
        ({"parameters": {"slope": {"weak": 1, "strong": "2"}}}, '"strong" must be a number, got "2"'),
        ({"parameters": {"slope": {"weak": 1, "strong": 2, "least": 0}}}, 'unknown key "least"'),
        (
            {"parameters": {"slope": {"weak": 1, "strong": 2, "minimum": 1.5}}},
            "weak and strong within minimum and maximum",
        ),
        ({"parameters": {"a slope": {"weak": 1, "strong": 2}}}, "letters, digits and '_'"),
        ({"opencl": "nowhere.cl"}, "nowhere.cl cannot be read: it does not exist"),
        ({"opencl": "."}, "cannot be read: it is no file"),
        ({"stage": "op\x1btics"}, "without control characters"),
        ({"parameters": {"a" * 32: {"weak": 1, "strong": 2}}}, "its name has 32 bytes"),
        ({"parameters": {"slope": {"weak": 1, "strong": 2, "unit": "u" * 16}}}, "its unit 16"),
        (
            {"parameters": {"slope": {"weak": 1, "strong": 1, "minimum": 1, "maximum": 1}}},
            "a minimum below the maximum",
        ),
        ({"parameters": {"slope": {"weak": [1], "strong": 1}}}, '"weak" must be a number, got [1]'),
        ({"opencl": None}, '"opencl" is missing'),
        ({"open_cl": "ramp.cl"}, 'unknown key "open_cl"; the nearest one is "opencl"; the keys are id,'),
    ],
    ids=str,
)
def test_effects_of_ones_own_that_cannot_be(refused, tmp_path: Path, change: dict[str, object], words: str) -> None:
    write_set(tmp_path / "set", 0)
    write_hypothesis(tmp_path / "own", **change)
    message = refused("diagnose", "set", "--hypothesis", "own/ramp.json", *QUICK)
    assert words in message
    assert not re.search(r"CLSP_|clsp[A-Z]|desc->", message), "names of the C interface mean nothing here"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["missing"], "missing"),
        (["set", "--hypothesis", "missing.json"], "missing.json"),
        (["set", "--hypothesis", ""], "--hypothesis: is empty; name a file"),
        (["set", "--hypothesis", "set/capture.json"], "unknown key"),
        (["set", "--hypothesis", "set/dark.npy"], "is not valid JSON"),
        (["set", "--without", "defokus"], '--without: there is no effect "defokus"; the nearest one is "defocus"'),
        (
            ["set", "--without", "gamma,,defocus"],
            "--without gamma,,defocus: one of the names is empty; the effects are linewidth, ",
        ),
        (["set", "--without", " "], "one of the names is empty"),
        (["set", "--without", ""], "one of the names is empty"),
        (["set", "--level", 0.9], '--level: is "0.9"; expected a number from 1e-06 to 0.5'),
        (["set", "--level", 2], '--level: is "2"'),
        (["set", "--level", "nan"], '--level: is "nan"'),
        (["set", "--level", "low"], '--level: is "low"'),
        (["set", "--replicates", 3], "expected an integer from 12 to 100000"),
        (["set", "--null-replicates", 3.5], '--null-replicates: is "3.5"'),
        (["set", "--max-effects", 0], '--max-effects: is "0"; expected an integer from 1 to 64'),
        (["set", "--threads", 2000], '--threads: is "2000"; expected an integer from 0 to 1024'),
        (["set", "--seed", -1], '--seed: is "-1"; expected an integer from 0 to 18446744073709551615'),
        (["set", "--seed", 2**64], '--seed: is "18446744073709551616"'),
        (["set", "--html", "-"], "--html -: the page is written to a file"),
        (["set", "--html", ""], "--html: is empty; name a file"),
        (["set", "--json", ""], "--json: is empty; name a file"),
        (["set", "--json", "a", "--html", "a"], "name the same file"),
        (["set", "--jsn", "x"], "the nearest one is --json"),
        ([], "CAPTURE"),
    ],
    ids=str,
)
def test_bad_usage(refused, tmp_path: Path, arguments: list[object], words: str) -> None:
    write_set(tmp_path / "set", 0)
    message = refused("diagnose", *arguments)
    assert words in message
    assert not re.search(r"CLSP_|clsp[A-Z]|desc->", message), "names of the C interface mean nothing here"
    assert [path.name for path in tmp_path.iterdir()] == ["set"]


@pytest.mark.parametrize(
    "command",
    [
        f"diagnose set {option} set/{name}"
        for option in ("--json", "--html", "--emva", "--profile")
        for name in ("capture.json", "flat.npy")
    ]
    + [
        "capture emva set --json set/capture.json",
        "capture emva set --xml set/flat.npy",
        "capture check set/capture.json --json set/flat.npy",
    ],
)
def test_no_output_replaces_a_file_of_the_set(refused, tmp_path: Path, command: str) -> None:
    write_set(tmp_path / "set", 0)
    before = {path.name: path.read_bytes() for path in (tmp_path / "set").iterdir()}
    assert "belongs to the capture set; choose another file" in refused(*command.split())
    assert {path.name: path.read_bytes() for path in (tmp_path / "set").iterdir()} == before


def test_names_of_effects_may_have_blanks(ok, tmp_path: Path) -> None:
    write_set(tmp_path / "set", 20)
    plain = ok("diagnose", "set", "--json", "-", "--without", "gamma,vignetting", *QUICK).json()
    assert (
        ok("diagnose", "--without", " vignetting ", "--without", "gamma", "set", "--json", "-", *QUICK).json() == plain
    )


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


def children(pid: int) -> str:
    """Ids of the processes that a process has started."""
    with contextlib.suppress(OSError):
        return "".join(path.read_text() for path in Path(f"/proc/{pid}/task").glob("*/children"))
    return ""


def test_interrupt_while_the_driver_compiles(program: Path, tmp_path: Path) -> None:
    """PoCL links its kernels with a program of its own, which Ctrl-C ends as well: the build error is no news. An empty
    cache makes it compile."""
    write_set(tmp_path / "set", 0)
    (tmp_path / "cache").mkdir()
    environment = {
        **os.environ,
        "POCL_CACHE_DIR": str(tmp_path / "cache"),
        "CLSPECKLE_CACHE_DIR": str(tmp_path / "own"),
    }
    command = [program, "diagnose", "set", "--replicates", "100000", "--quiet"]
    with subprocess.Popen(
        command,
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=environment,
        start_new_session=True,
    ) as running:
        deadline = time.monotonic() + 30
        while time.monotonic() < deadline and not children(running.pid):
            time.sleep(0.001)
        os.killpg(running.pid, signal.SIGINT)  # as a terminal does
        out, err = running.communicate(timeout=120)
    assert running.returncode == 130, err
    assert "clspeckle: interrupted" in err and out == ""
    assert "does not build" not in err


def test_what_cannot_be_judged_is_left_out(ok, refused, tmp_path: Path) -> None:
    """A quarter of the flat is saturated: its light is not known. Without it the set is dark; saturated dark frames
    leave nothing."""
    folder = write_set(tmp_path / "set", 0)
    codes = np.load(folder / "flat.npy")
    codes[:, :, :16] = 1023
    np.save(folder / "flat.npy", codes)
    report = ok("diagnose", "set", "--json", "-", *QUICK).json()
    assert report["cause"]["verdict"] == "none"
    assert (report["coverage"]["sequences"], report["coverage"]["left_out"]) == (["dark"], ["flat"])
    assert "vignetting" in report["coverage"]["effects_not_visible"], "it shows in the flat only"
    assert any(note.startswith("flat was left out: 25 % of its pixels are at the top code") for note in report["notes"])
    assert report["coverage"]["judged"] is False
    run = ok("diagnose", "set", "--html", "page.html", *QUICK)
    assert run.out.startswith("NOTHING COULD BE JUDGED of light: every sequence that has some was left out (flat;")
    page = (tmp_path / "page.html").read_text()
    assert "<title>clSpeckle gap report: nothing could be judged</title>" in page
    assert "Nothing could be judged of light: every sequence that has some was left out (flat)" in page
    (folder / "capture.json").write_text(
        json.dumps(
            {
                **json.loads((folder / "capture.json").read_text()),
                "sequences": [{"name": "dark", "file": "dark.npy", "scene": "dark"}],
            }
        )
    )
    dark = ok("diagnose", "set", "--json", "-", *QUICK).json()
    assert dark["coverage"]["judged"] is True, "no light was asked about"
    write_set(tmp_path / "other", 0)
    (folder / "capture.json").write_text((tmp_path / "other" / "capture.json").read_text())
    np.save(folder / "dark.npy", np.full_like(codes, 1023))
    message = refused("diagnose", "set", "--json", "-", *QUICK)
    assert "no sequence of the capture can be judged: dark was left out: 100 % of its pixels" in message


def test_warnings_of_the_capture_are_told(ok, tmp_path: Path) -> None:
    folder = write_set(tmp_path / "set", 0)
    text = json.loads((folder / "capture.json").read_text())
    text["camera"]["shutter"] = "rolling"
    (folder / "capture.json").write_text(json.dumps(text))
    text["camera"]["read_noise_dn"] = 100.0
    (folder / "capture.json").write_text(json.dumps(text))
    run = ok("diagnose", "set", "--quiet", "--json", "report.json", "--html", "report.html", *QUICK)
    notes = " ".join(json.loads((tmp_path / "report.json").read_text())["notes"])
    for words in ("shutter", "/camera/read_noise_dn is 100, but the dark frames"):
        assert words in run.err
        assert words in notes
        assert words in (tmp_path / "report.html").read_text(encoding="utf-8")


def test_help(ok) -> None:
    text = ok("diagnose", "--help").out
    assert "Usage: clspeckle" in text and "Examples:" in text
    for words in ("none", "named", "ambiguous", "unknown", "--without", "--level", "Exit codes:", "130  interrupted"):
        assert words in text


@pytest.mark.parametrize(
    ("waves", "seed"), [(1.3, 1), *(pytest.param(waves, 2, marks=pytest.mark.nightly) for waves in (1.25, 1.3))]
)
def test_a_lens_far_out_of_focus(ok, tmp_path: Path, waves: float, seed: int) -> None:
    """No spots are left, and half way from weak to strong the effect does something else: it is found, and nothing
    else.

    Without a second look at other strengths, or with statistics that are told relative to a core without light, each of
    the three was unknown.
    """
    which = ["--sequences", "dark,board_moving,dots_static,dots_moving", "--width", 120, "--height", 96, "--frames", 8]
    ok(
        "capture",
        "make",
        "set",
        *which,
        "--f-number",
        8,
        "--effect",
        f"defocus:waves={waves}",
        "--seed",
        seed,
        "--quiet",
    )
    report = ok("diagnose", "set", "--json", "-", "--quiet").json()
    assert (report["cause"]["verdict"], report["cause"]["effects"]) == ("named", ["defocus"])
    ranked = report["cause"]["ranking"][0]
    assert abs(ranked["parameters"]["waves"]) == pytest.approx(waves, abs=0.05)
    assert report["cause"]["screening"][0]["effect"] == "defocus" and report["cause"]["screening"][0]["share"] > 0.5

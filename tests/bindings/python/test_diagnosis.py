"""clspeckle.diagnose: captures of three kinds, hypotheses, progress, Ctrl-C, refusals.

What a verdict is worth is tested elsewhere; here the captures are small and the causes are gross.
"""

from __future__ import annotations

import contextlib
import json
import math
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import clspeckle
from binding_common import Runner
from clspeckle import errors

HEIGHT, WIDTH, FRAMES = 48, 64, 8
QUICK: dict[str, Any] = {"null_replicates": 12, "max_effects": 1}
RAMP = np.linspace(-1, 1, WIDTH, dtype=np.float32)


def codes(ramp_dn: float) -> dict[str, npt.NDArray[np.uint16]]:
    """Dark and flat of a camera with black level 64 and read noise 4; the flat has a ramp across its columns."""
    random = np.random.default_rng(7)
    light = {"dark": 0 * RAMP, "flat": 300 + ramp_dn * RAMP}
    return {
        name: np.clip(np.rint(64 + level + random.normal(0, 4, (FRAMES, HEIGHT, WIDTH))), 0, 1023).astype(np.uint16)
        for name, level in light.items()
    }


def add_ramp(pixels: npt.NDArray[np.float32], *, sequence: str, frame_index: int, seed: int, slope: float) -> None:
    assert (pixels.shape, sequence) == ((HEIGHT, WIDTH), "flat")
    assert pixels.dtype == np.float32
    assert 0 <= frame_index < FRAMES
    assert seed >= 0
    pixels += slope * RAMP


HYPOTHESIS = clspeckle.Hypothesis("ramp", "optics", add_ramp, {"slope": (0.02, 0.2)}, units={"slope": "1"})


RAMP_SOURCE = """
float hypothesis(hypothesis_frame frame, hypothesis_values values, uint x, uint y) {
    return hypothesis_pixel(frame, x, y) + values.slope * (2.0f * x / (frame.width - 1) - 1.0f);
}
"""


@pytest.fixture(scope="module")
def found(context: clspeckle.Context) -> clspeckle.Diagnosis:
    """Of a camera whose gap has a cause among the hypotheses."""
    return clspeckle.diagnose(codes(20), hypotheses=[HYPOTHESIS], context=context, **QUICK)


def test_a_hypothesis_is_ranked(found: clspeckle.Diagnosis) -> None:
    assert found.detected
    assert found.effects == ("ramp",)
    assert found.distance > 10 * found.null_95
    first = found.ranking[0]
    assert first.effect == "ramp"
    assert first.probability > 0.95
    assert first.parameters["slope"] == pytest.approx(20 / 300, abs=0.003)
    low, high = first.intervals["slope"]
    assert low <= first.parameters["slope"] <= high
    assert found.where
    assert found.where[0].sequence == "flat"
    assert abs(found.where[0].z) >= abs(found.where[-1].z)
    assert found.shrink.fraction > 0.9
    assert found.shrink.held_out
    assert [step.effect for step in found.shrink.steps] == ["ramp"]
    assert found.seconds > 0


def test_a_hypothesis_as_opencl_source(found: clspeckle.Diagnosis, context: clspeckle.Context) -> None:
    """It says what the function says, and nobody is called back."""
    hypothesis = clspeckle.Hypothesis("ramp", "optics", RAMP_SOURCE, {"slope": (0.02, 0.2)})
    by_source = clspeckle.diagnose(codes(20), hypotheses=[hypothesis], context=context, **QUICK)
    assert by_source.effects == ("ramp",)
    slopes = [diagnosis.ranking[0].parameters["slope"] for diagnosis in (by_source, found)]
    assert slopes[0] == pytest.approx(slopes[1], rel=1e-3)
    assert clspeckle.Hypothesis("x", "optics", RAMP_SOURCE, {"seed": (1, 2)}), "no argument of a function"
    broken = clspeckle.Hypothesis("ramp", "optics", RAMP_SOURCE.replace("values.slope", "slop"), {"slope": (0.02, 0.2)})
    with pytest.raises(errors.BuildError, match='of the hypothesis "ramp" does not build') as caught:
        clspeckle.diagnose(codes(20), hypotheses=[broken], context=context, **QUICK)
    assert "slop" in caught.value.build_log


def test_measurements_in_units(found: clspeckle.Diagnosis) -> None:
    """With the ramp the flat's field is that of the camera; its noise is of both."""
    measured = {(one.sequence, one.quantity): one for one in found.quantities}
    noise = measured["flat", "temporal_noise"]
    assert noise.unit == "DN"
    assert noise.real == pytest.approx(noise.sim, abs=0.2)
    assert noise.sim_with_effects == pytest.approx(noise.sim, abs=0.2)
    assert 0 < noise.sim_deviation < 0.2
    assert measured[None, "system_gain"].unit == "DN/electron"
    assert found.screening[0].effect == "ramp"
    assert found.screening[0].fitted
    assert found.screening[0].share > 0.9


def test_summary_and_report(found: clspeckle.Diagnosis, tmp_path: Path) -> None:
    text = str(found)
    for words in (found.verdict, "ramp: slope = ", found.where[0].statistic, "held-out", "residual"):
        assert words in text
    report = found.report
    assert (report["format"], report["version"]) == ("clspeckle-gap-report", 1)
    assert report["cause"]["verdict"] == found.verdict
    report.clear()
    assert found.report, "a new dict each time"
    for _ in range(2):  # the second one replaces the first
        found.write(tmp_path / "report.json")
        assert json.loads((tmp_path / "report.json").read_text()) == found.report
    assert [path.name for path in tmp_path.iterdir()] == ["report.json"]
    found.write_html(tmp_path / "report.html")
    assert "ramp" in (tmp_path / "report.html").read_text(encoding="utf-8")
    with pytest.raises(errors.InputOutputError):
        found.write(tmp_path / "missing" / "report.json")
    assert found.verdict in repr(found)


def test_captures_of_three_kinds_agree(context: clspeckle.Context, tmp_path: Path) -> None:
    arrays = codes(0)
    first = clspeckle.diagnose(arrays, seed=3, camera={"f_number": 4.0}, context=context, **QUICK)
    assert first.verdict == "none"
    assert (first.effects, first.ranking, first.where, first.shrink.steps) == ((), (), (), ())
    assert "no gap in what could be tested: dark, flat" in str(first)
    assert "cannot show here: " in str(first)
    assert first.coverage.sequences == ("dark", "flat")
    assert first.coverage.left_out == ()
    assert first.calibration is not None
    assert first.calibration.light_dn.keys() == set(first.coverage.sequences)
    for place in first.where:
        low, high = place.ci95
        assert math.isnan(place.fraction) or low <= place.fraction <= high
    assert first.coverage.statistics == len(first.report["shrink"]["per_statistic"])
    assert "defocus" in first.coverage.effects_not_visible
    assert "dsnu" not in first.coverage.effects_not_visible
    assert "beam and diffractive element" in first.coverage.questions_open
    capture = clspeckle.Capture.from_arrays(arrays, camera={"f_number": 4.0})
    assert clspeckle.diagnose(capture, seed=3, context=context, **QUICK).report == first.report
    assert not capture.closed
    capture.write(tmp_path / "set")
    assert (
        clspeckle.diagnose(tmp_path / "set", seed=3, threads=1, evidence=False, context=context, **QUICK).report
        == first.report
    )


def test_progress_and_cancelling(context: clspeckle.Context, capsys: pytest.CaptureFixture[str]) -> None:
    told: list[tuple[str, float]] = []

    def stop_at_ten(what: str, fraction: float) -> bool:
        told.append((what, fraction))
        return len(told) < 10

    with pytest.raises(errors.CancelledError, match="cancelled"):
        clspeckle.diagnose(codes(0), progress=stop_at_ten, context=context, **QUICK)
    assert len(told) == 10
    assert all(what for what, _ in told)
    fractions = [fraction for _, fraction in told]
    assert fractions == sorted(fractions)
    assert 0 <= fractions[0] <= fractions[-1] <= 1
    assert capsys.readouterr().err == ""

    def fail(what: str, fraction: float) -> None:
        raise KeyError("mine")

    with pytest.raises(KeyError, match="mine"):
        clspeckle.diagnose(codes(0), progress=fail, context=context, **QUICK)


def test_what_a_hypothesis_raises_comes_back(context: clspeckle.Context) -> None:
    def diagnose(apply: Any) -> None:
        hypothesis = clspeckle.Hypothesis("mine", "sensor", apply, {"a": (1, 3)}, point="codes")
        arrays = codes(0)
        arrays["flat"][:, ::2] += 8  # a gap that no lamp makes
        clspeckle.diagnose(arrays, hypotheses=[hypothesis], context=context, **QUICK)

    def fail(pixels: Any, **_: Any) -> None:
        raise ZeroDivisionError("mine")

    with pytest.raises(ZeroDivisionError, match="mine") as caught:
        diagnose(fail)
    assert '"mine" on sequence "dark", frame 0' in str(caught.value.__cause__)
    with pytest.raises(errors.InvalidArgumentError, match="'mine' returned has shape"):
        diagnose(lambda pixels, **_: pixels[1:])
    with pytest.raises(errors.InvalidFormatError, match="'mine' returned has dtype complex"):
        diagnose(lambda pixels, **_: pixels * 1j)
    with pytest.raises(TypeError, match="unexpected keyword argument"):
        diagnose(lambda pixels, *, frame_index: None)
    with pytest.raises(errors.InvalidDataError, match='"mine" on sequence "dark", frame 0'):
        diagnose(lambda pixels, **_: pixels * np.nan)

    def spoil(pixels: npt.NDArray[np.float32], **_: Any) -> None:
        pixels[3, 5] = np.inf

    with pytest.raises(errors.InvalidDataError, match='"mine" on sequence "dark", frame 0'):
        diagnose(spoil)


def test_control_c_cancels(run_python: Runner) -> None:
    program = """
import os, signal, sys
sys.path.insert(0, TESTS)
import clspeckle
from test_diagnosis import QUICK, codes

calls = 0
def interrupt(what, fraction):
    global calls
    calls += 1
    if calls == 5:
        os.kill(os.getpid(), signal.SIGINT)

before = signal.getsignal(signal.SIGINT)
try:
    clspeckle.diagnose(codes(0), progress=interrupt, **QUICK)
except KeyboardInterrupt:
    print("interrupted after", calls)
assert signal.getsignal(signal.SIGINT) is before
"""
    result = run_python(f"TESTS = {str(Path(__file__).parent)!r}\n" + program)
    assert result.stdout == "interrupted after 5\n", result.stderr
    assert "Exception ignored" not in result.stderr


def test_control_c_while_the_driver_compiles(tmp_path: Path) -> None:
    """PoCL links its kernels with a program of its own, which Ctrl-C at a terminal reaches as well.

    An empty cache makes it link.
    """
    program = f"""
import sys
sys.path.insert(0, {str(Path(__file__).parent)!r})
import clspeckle
from test_diagnosis import QUICK, codes
try:
    clspeckle.diagnose(codes(0), **QUICK)
except KeyboardInterrupt:
    print("interrupted")
"""
    environment = {**os.environ, "POCL_CACHE_DIR": str(tmp_path), "CLSPECKLE_CACHE_DIR": str(tmp_path / "own")}
    with subprocess.Popen(
        [sys.executable, "-c", program],
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    ) as running:
        deadline = time.monotonic() + 30
        while time.monotonic() < deadline and not children(running.pid):
            time.sleep(0.001)
        os.killpg(running.pid, signal.SIGINT)
        out, err = running.communicate(timeout=120)
    assert (running.returncode, out) == (0, "interrupted\n"), err


def children(pid: int) -> str:
    """Ids of the processes that a process has started."""
    with contextlib.suppress(OSError):
        return "".join(path.read_text() for path in Path(f"/proc/{pid}/task").glob("*/children"))
    return ""


def test_progress_bar(run_python: Runner) -> None:
    program = "import sys\nsys.path.insert(0, TESTS)\nimport clspeckle\nfrom test_diagnosis import QUICK, codes\n"
    program += "print(clspeckle.diagnose(codes(0), progress=True, **QUICK).verdict)\n"
    result = run_python(f"TESTS = {str(Path(__file__).parent)!r}\n" + program)
    assert result.stdout == "none\n", result.stderr
    assert "[=" in result.stderr
    assert " % simulating" in result.stderr


@pytest.mark.parametrize(
    ("arguments", "kind", "words"),
    [
        ({"level": 0.7}, errors.InvalidArgumentError, "^level is 0.7, expected 1e-06 to 0.5$"),
        ({"level": float("nan")}, errors.InvalidArgumentError, "^level is nan"),
        ({"level": "low"}, TypeError, "level must be a number"),
        ({"null_replicates": 5}, errors.InvalidArgumentError, "^null_replicates is 5, expected 12 to 100000$"),
        ({"max_effects": 0}, errors.InvalidArgumentError, "^max_effects is 0, expected 1 to 64$"),
        ({"threads": -1}, errors.InvalidArgumentError, "^threads is -1"),
        ({"threads": 2000}, errors.InvalidArgumentError, "^threads is 2000, expected 1 to 1024$"),
        ({"evidence": 1}, TypeError, "evidence"),
        ({"seed": 2**64}, errors.InvalidArgumentError, "seed"),
        ({"without": "defocus"}, TypeError, "list of ids"),
        ({"without": ["defokus"]}, errors.InvalidArgumentError, "defokus"),
        ({"without": [3]}, TypeError, "ids"),
        ({"progress": 3}, TypeError, "progress"),
        ({"hypotheses": ["ramp"]}, TypeError, "Hypothesis"),
        ({"hypotheses": [HYPOTHESIS, HYPOTHESIS]}, errors.InvalidArgumentError, "two hypotheses"),
    ],
    ids=str,
)
def test_bad_arguments(
    context: clspeckle.Context, arguments: dict[str, Any], kind: type[Exception], words: str
) -> None:
    with pytest.raises(kind, match=words):
        clspeckle.diagnose(codes(0), context=context, **{**QUICK, **arguments})


@pytest.mark.parametrize(
    ("change", "kind", "words"),
    [
        ({"id": "defocus"}, errors.InvalidArgumentError, "catalogue"),
        ({"id": "two words"}, errors.InvalidArgumentError, "letters"),
        ({"id": None}, TypeError, "id"),
        ({"stage": "optic"}, errors.InvalidArgumentError, 'did you mean "optics"'),
        ({"point": "code"}, errors.InvalidArgumentError, 'did you mean "codes"'),
        ({"apply": None}, TypeError, "function"),
        ({"apply": ""}, errors.InvalidArgumentError, "without anything in it"),
        ({"apply": "float a;\0"}, errors.InvalidArgumentError, "source of the hypothesis .* null"),
        ({"apply": "float \ud800"}, errors.InvalidArgumentError, "UTF-8"),
        ({"apply": "float a;", "parameters": {"\u00e9": (1, 2)}}, errors.InvalidArgumentError, "OpenCL C"),
        ({"parameters": {}}, errors.InvalidArgumentError, "has 0 entries, expected 1 to 4"),
        ({"parameters": dict.fromkeys("abcde", (1, 2))}, errors.InvalidArgumentError, "has 5 entries"),
        ({"parameters": {"slope": (0, 0)}}, errors.InvalidArgumentError, "minimum below the maximum"),
        ({"parameters": {"slope": (1, float("nan"))}}, errors.InvalidArgumentError, "finite"),
        ({"parameters": {"slope": (1, 2, -float("inf"), 3)}}, errors.InvalidArgumentError, "finite"),
        ({"stage": 3}, TypeError, "stage"),
        ({"point": None}, TypeError, "point"),
        ({"units": "px"}, TypeError, "units"),
        ({"parameters": [1, 2]}, TypeError, "dict"),
        ({"parameters": {"slope": 1.0}}, TypeError, "weak, strong"),
        ({"parameters": {"slope": (1, 2, 3)}}, TypeError, "weak, strong"),
        ({"parameters": {"slope": "12"}}, TypeError, "weak, strong"),
        ({"parameters": {"slope": (1, 2, 1.5, 3)}}, errors.InvalidArgumentError, "slope"),
        ({"parameters": {"seed": (1, 2)}}, errors.InvalidArgumentError, "seed"),
        ({"parameters": {"a b": (1, 2)}}, errors.InvalidArgumentError, "a b"),
        ({"units": {"slop": "px"}}, errors.InvalidArgumentError, "slop"),
        ({"units": {"slope": "a unit of many words"}}, errors.InvalidArgumentError, "15 bytes"),
    ],
    ids=str,
)
def test_bad_hypotheses(context: clspeckle.Context, change: dict[str, Any], kind: type[Exception], words: str) -> None:
    good: dict[str, Any] = {"id": "ramp", "stage": "optics", "apply": add_ramp, "parameters": {"slope": (0.02, 0.2)}}
    with pytest.raises(kind, match=words):
        clspeckle.diagnose(codes(0), hypotheses=[clspeckle.Hypothesis(**{**good, **change})], context=context, **QUICK)


@pytest.mark.parametrize(
    "change", [{"stage": "optic"}, {"point": "code"}, {"id": ""}, {"apply": 3}, {"parameters": {}}], ids=str
)
def test_bad_hypotheses_are_refused_at_construction(change: dict[str, Any]) -> None:
    good: dict[str, Any] = {"id": "ramp", "stage": "optics", "apply": add_ramp, "parameters": {"slope": (0.02, 0.2)}}
    assert clspeckle.Hypothesis(**good).point == "intensity"
    with pytest.raises((TypeError, errors.InvalidArgumentError)) as caught:
        clspeckle.Hypothesis(**{**good, **change})
    assert "CLSP" not in str(caught.value)


def test_bad_captures(context: clspeckle.Context, tmp_path: Path) -> None:
    bad: Any = 3
    with pytest.raises(TypeError, match="folder"):
        clspeckle.diagnose(bad, context=context)
    with pytest.raises(errors.InputOutputError, match="missing"):
        clspeckle.diagnose(tmp_path / "missing", context=context)
    with pytest.raises(TypeError, match="belong to a dict"):
        clspeckle.diagnose(tmp_path, camera={"bits": 12}, context=context)
    with pytest.raises(errors.InvalidArgumentError):
        clspeckle.diagnose({}, context=context)


def test_a_closed_diagnosis_keeps_its_numbers(context: clspeckle.Context, tmp_path: Path) -> None:
    with clspeckle.diagnose(codes(0), context=context, **QUICK) as made:
        assert made.verdict == "none"
    assert made.closed
    assert made.report["cause"]["verdict"] == "none"
    with pytest.raises(errors.InvalidHandleError):
        made.write(tmp_path / "report.json")
    with pytest.raises(TypeError, match="diagnose"):
        clspeckle.Diagnosis()
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler

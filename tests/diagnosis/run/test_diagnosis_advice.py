"""What a diagnosis, a comparison and the numbers of EMVA 1288 advise: each advice is provoked, and followed.

The captures are small and their causes are gross. tests/house/advice.txt names the messages."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import clspeckle
import numpy as np
import numpy.typing as npt
import pytest
from clspeckle import errors

HEIGHT, WIDTH, FRAMES = 48, 64, 8
BLACK, GAIN = 64.0, 0.5
QUICK: dict[str, Any] = {"null_replicates": 12, "max_effects": 1}
Codes = npt.NDArray[np.uint16]


def frames(
    electrons: float = 0.0,
    *,
    seed: int = 1,
    noise_dn: Any = 4.0,
    black: Any = BLACK,
    gain: float = GAIN,
    count: int = FRAMES,
) -> Codes:
    """Of a linear camera of 10 bits without fixed patterns; noise and black level may be given for each frame."""
    draw = np.random.default_rng(seed)
    light = draw.poisson(electrons, (count, HEIGHT, WIDTH))
    signal = black + gain * light + noise_dn * draw.normal(size=light.shape)
    return np.clip(np.rint(signal), 0, 1023).astype(np.uint16)


def sequence(codes: Codes, scene: str, exposure_ms: float | None = None) -> clspeckle.CaptureSequence:
    return clspeckle.CaptureSequence(codes, scene=scene, exposure_ms=exposure_ms)


def emva(given: dict[str, Any]) -> str:
    """All that the numbers of EMVA 1288 say in words."""
    capture = clspeckle.Capture.from_arrays(given, camera={"bits": 10})
    return json.dumps(capture.emva1288(), ensure_ascii=False)


def each(*of: float) -> Any:
    return np.array(of, float).reshape(-1, 1, 1)


TWO_NOISES = frames(noise_dn=each(*[3] * 4, *[12] * 4))
PATTERNS = 20 * np.random.default_rng(9).normal(size=(2, HEIGHT, WIDTH))
TWO_SCENES = frames(black=200 + np.repeat(PATTERNS, 4, axis=0))
DARK, FLAT = frames(), frames(600, seed=2)

MEASURED: list[tuple[str, dict[str, Any], dict[str, Any]]] = [
    (
        "not one camera at one gain, so the sequence is not used; record it again",
        {"dark": TWO_NOISES, "flat": FLAT},
        {"dark": DARK, "flat": FLAT},
    ),
    (
        "no dark sequence of two frames or more that agree (see the notes)",
        {"dark": TWO_NOISES, "flat": FLAT},
        {"dark": DARK, "flat": FLAT},
    ),
    (
        "the camera or the scene changed between them, so the sequence is not used; record it again, or split it there",
        {"dark": TWO_SCENES},
        {"dark_1": sequence(TWO_SCENES[:4], "dark"), "dark_2": sequence(TWO_SCENES[4:], "dark")},
    ),
    (
        "a flat cannot be darker than the dark; check which files belong to which scene",
        {"dark": FLAT, "flat": DARK},
        {"dark": DARK, "flat": FLAT},
    ),
    (
        "levels do not order as exposures do; check exposure_ms and the lamp",
        {"dark": DARK, "a": sequence(FLAT, "flat", 4.0), "b": sequence(frames(900, seed=3), "flat", 2.0)},
        {"dark": DARK, "a": sequence(FLAT, "flat", 2.0), "b": sequence(frames(900, seed=3), "flat", 4.0)},
    ),
    (
        "or the frames are copies of one; record with more gain",
        {"dark": frames(noise_dn=0.05), "flat": FLAT},
        {"dark": frames(noise_dn=0.4), "flat": FLAT},
    ),
    (
        "too few are above it to place a Gaussian; raise the camera's black level",
        {"dark": frames(black=-8), "flat": FLAT},
        {"dark": frames(black=20), "flat": FLAT},
    ),
]


@pytest.mark.parametrize(("says", "bad", "good"), MEASURED, ids=[case[0][:40].replace(" ", "_") for case in MEASURED])
def test_measured(says: str, bad: dict[str, Any], good: dict[str, Any]) -> None:
    assert says in emva(bad)
    assert says not in emva(good)


def notes_of(found: clspeckle.Diagnosis) -> str:
    return " ".join(found.report["notes"])


def maps_of(given: dict[str, Any], context: clspeckle.Context, **camera: Any) -> str:
    """What the profile of a diagnosis says of the maps that it lacks."""
    capture = clspeckle.Capture.from_arrays(given, camera={"bits": 10, **camera})
    return " ".join(clspeckle.diagnose(capture, context=context, **QUICK).profile().data["maps"]["notes"])


def patterned(electrons: float, count: int, black: float = BLACK, **more: Any) -> Codes:
    """Offsets of 0.6 DN and gains of 1 %."""
    own = np.random.default_rng(77).normal(size=(2, HEIGHT, WIDTH))
    return frames(electrons * (1 + 0.01 * own[0]), black=black + 0.6 * own[1], count=count, **more)


def test_maps(context: clspeckle.Context) -> None:
    few, many = ({"dark": patterned(0, n), "flat": patterned(800, n, seed=2)} for n in (4, 64))
    bright = {"dark": patterned(0, 64), "flat": patterned(1800, 16, seed=2)}
    low = {"dark": patterned(0, 16, black=3.0), "flat": patterned(800, 16, black=3.0, seed=2)}
    for says, bad, good, camera in (
        ("is larger than its pattern", few, many, {}),
        ("where pixels are cut off; record with less light", bright, many, {}),
        ("are not their levels; record with a higher black level", low, many, {"black_level_dn": 3.0}),
    ):
        told = maps_of(bad, context, **camera)
        assert says in told, told
        assert says not in maps_of(good, context)


def test_comparisons(context: clspeckle.Context, tmp_path: Path) -> None:
    real = {"dark": frames(), "flat": frames(600, seed=2)}

    def compared(dark: Any, **more: Any) -> clspeckle.Diagnosis:
        sim = {"dark": dark, "flat": frames(600, seed=4)}
        return clspeckle.compare(real, sim, context=context, **QUICK, **more)

    says = "it cannot be taken out of finished frames; lower it in the simulator"
    assert says in notes_of(compared(frames(noise_dn=9, seed=3)))
    quiet = compared(frames(noise_dn=3, seed=3))
    assert says not in notes_of(quiet)
    says = "read noise was not compared: that takes dark sequences of two frames or more in both sets"
    assert says in notes_of(compared(frames(count=1, seed=3)))
    assert says not in notes_of(quiet)
    white = np.full_like(real["dark"], 1023)
    with pytest.raises(
        errors.InvalidDataError, match=r"record it with the lens covered, correct camera.bits, or leave it out"
    ):
        compared(white)
    clspeckle.compare(real, {"flat": frames(600, seed=4)}, context=context, **QUICK)
    # Profiles of a comparison are the real camera's.
    own = clspeckle.diagnose(real, context=context, **QUICK).profile()
    other = clspeckle.diagnose({"dark": real["dark"]}, context=context, **QUICK).profile()
    wide = clspeckle.diagnose({"dark": np.tile(real["dark"], 2)}, context=context, **QUICK).profile()
    for profile in (other, wide):
        with pytest.raises(
            errors.InvalidArgumentError, match="give the profile that a diagnosis of the real set wrote"
        ):
            compared(frames(seed=3), profile=profile)
    compared(frames(seed=3), profile=own)


def test_a_diagnosis_that_cannot_be_made(context: clspeckle.Context) -> None:
    def diagnosed(codes: Codes, **more: Any) -> clspeckle.Diagnosis:
        return clspeckle.diagnose({"dark": codes}, context=context, **QUICK, **more)

    with pytest.raises(errors.InvalidDataError, match=r"Check that the files belong .* with another exposure"):
        diagnosed(np.full((FRAMES, HEIGHT, WIDTH), 1023, np.uint16))
    diagnosed(DARK)
    with pytest.raises(
        errors.InvalidArgumentError, match='"gama" cannot be left out: .* `clspeckle effects` lists them'
    ):
        diagnosed(DARK, without=["gama"])
    diagnosed(DARK, without=[clspeckle.effects()[0].id])


SOURCE = """
float hypothesis(hypothesis_frame frame, hypothesis_values values, uint x, uint y) {
    return hypothesis_pixel(frame, x, y) + values.%s;
}
"""


def shifted(
    name: str = "shift", more: str = "", id: str = "own", do: Callable[..., Any] | str | None = None
) -> clspeckle.Hypothesis:
    return clspeckle.Hypothesis(id, "sensor", do or more + SOURCE % name, {name: (0.5, 2.0)}, units={name: "DN"})


@pytest.mark.parametrize(
    ("says", "bad", "good"),
    [
        ("it must stand alone. Put the text of files into it", [shifted(more='#include "a.h"\n')],
         [shifted(more="constant int a = 1;\n")]),
        ("a word of OpenCL C's own; give it another name", [shifted("float")], [shifted("shift")]),
        ("has the id of an effect of the catalogue; give it another", [shifted(id="gamma")], [shifted(id="my_gamma")]),
        ('two hypotheses have the id "own"; give each its own', [shifted(), shifted("by")],
         [shifted(), shifted("by", id="by")]),
    ],
)  # fmt: skip
def test_hypotheses(
    says: str, bad: list[clspeckle.Hypothesis], good: list[clspeckle.Hypothesis], context: clspeckle.Context
) -> None:
    with pytest.raises(errors.InvalidArgumentError) as told:
        clspeckle.diagnose({"dark": DARK}, hypotheses=bad, context=context, **QUICK)
    assert says in str(told.value)
    clspeckle.diagnose({"dark": DARK}, hypotheses=good, context=context, **QUICK)

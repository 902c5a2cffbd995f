"""Whole cameras: what is drawn, how the lab's light falls, and how reports on them are counted."""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gap_check.camera import EXPOSURE_MS, LASER_SEQUENCES, LONG_DARK, LONG_EXPOSURE_MS, Camera, stream
from gap_check.conditions import EVEN, Conditions, draw_conditions
from gap_check.effects import CATALOGUE
from gap_check.outcome import Outcome
from gap_check.plan import PLANS, USUAL, SetPlan, camera_of, draw_sets, key, load_plan, sequences_of, write_drawn
from gap_check.scene import ideal_image
from gap_check.scorer import SCENES, gain, rung_of, score
from gap_check.tables import markdown
from support import BY_NAME, codes

WHOLE = PLANS["whole"]


def test_what_is_drawn() -> None:
    sets = draw_sets(WHOLE)
    assert len(sets) == 60
    assert sum(bool(s.hidden) for s in sets) == 30
    hidden = Counter(s.hidden for s in sets if s.hidden)
    assert max(hidden.values()) == 1
    for entry in sets:
        usual = [name for name in entry.strengths if name != entry.hidden]
        assert len(usual) == 10
        assert all(len(set(choices) & set(usual)) == 1 for choices in USUAL)
        assert all(0 <= entry.strengths[name] <= 0.5 for name in usual)
        assert entry.hidden in ("", *CATALOGUE)
    chosen = Counter(name for s in sets for name in s.strengths if name != s.hidden)
    # Halves of 60: 30 +- 3.9.
    assert all(12 <= chosen[name] <= 48 for choices in USUAL if len(choices) == 2 for name in choices)
    more = draw_sets(replace(WHOLE, whole=400))
    assert {s.hidden for s in more} == {"", *CATALOGUE} - {"shot_noise", "prnu", "dsnu", "row_noise"}


def test_light_of_the_lab(camera: Camera) -> None:
    y, x = np.mgrid[0:128, 0:128] - 63.5
    corner = np.hypot(63.5, 63.5)
    sloping = replace(camera, conditions=Conditions(lamp_slope=0.12, lamp_direction_deg=90.0))
    flat = ideal_image(sloping, BY_NAME["flat"], {}, 1)
    assert np.allclose(flat, 1 + 0.12 * y / corner)
    assert np.array_equal(ideal_image(sloping, BY_NAME["board_static"], {}, 1), np.ones((128, 128)))
    # A Gaussian about a centre to the right of the axis, 25 % lower at the point straight across.
    falling = replace(camera, conditions=Conditions(beam_loss=0.25, beam_center=(0.4, 0.0)))
    board = ideal_image(falling, BY_NAME["board_moving"], {}, 1)
    r2 = (x / corner - 0.4) ** 2 + (y / corner) ** 2
    shape = 0.75 ** (r2 / 1.4**2)
    assert np.allclose(board, shape / shape.mean())
    assert np.array_equal(ideal_image(falling, BY_NAME["flat"], {}, 1), np.ones((128, 128)))
    even, lit = (ideal_image(c, BY_NAME["dots_moving"], {}, 1) for c in (camera, falling))
    assert np.allclose(lit, even * board)


def test_conditions_are_within_their_ranges() -> None:
    drawn = [draw_conditions(stream(seed, "conditions")) for seed in range(300)]
    x, y = np.meshgrid(np.linspace(-0.77, 0.77, 41), np.linspace(-0.64, 0.64, 41))  # 192 x 160
    for c in drawn:
        beam = c.beam(x, y)
        assert 0.7 <= beam.min() < beam.max() <= 1
        tilted = replace(c, lamp_curvature=0.0).lamp(x, y)
        assert 0.85 <= tilted.min() < tilted.max() <= 1.15
        assert c.lamp(x, y).min() > 0.65
    assert np.ptp([c.lamp_direction_deg for c in drawn]) > 330
    assert max(c.beam_loss for c in drawn) > 0.29


def test_a_set_on_disk(tmp_path: Path) -> None:
    plan = replace(WHOLE, width=60, height=50, frames=2, flat_exposures_ms=(5.0, 2.5))
    entry = next(s for s in draw_sets(plan) if "dark_current" not in s.strengths)
    warm = SetPlan("whole", {**entry.strengths, "dark_current": 0.5}, 3, 4, hidden="dark_current")
    for number, (drawn, long) in enumerate(((entry, ()), (warm, (LONG_DARK,)))):
        write_drawn(tmp_path / str(number), plan, drawn)
        described = json.loads((tmp_path / str(number) / "capture.json").read_text())["sequences"]
        exposures = {s["name"]: s["exposure_ms"] for s in described}
        assert list(exposures)[6:8] == ["flat_2", "flat_3"]
        assert [exposures[n] for n in ("dark", "flat", "flat_2", "flat_3")] == [EXPOSURE_MS, EXPOSURE_MS, 5.0, 2.5]
        assert list(exposures)[8:] == [s.name for s in long]
        if long:
            assert exposures["dark_long"] == LONG_EXPOSURE_MS
        flats = [np.load(tmp_path / str(number) / f"{name}.npy").mean() - 64 for name in ("flat", "flat_2", "flat_3")]
        assert flats[1] / flats[0] == pytest.approx(0.5, abs=0.05)
        assert flats[2] / flats[0] == pytest.approx(0.25, abs=0.05)
        truth = key(plan, drawn)
        assert truth["hidden"] == drawn.hidden
        assert truth["conditions"]["beam_loss"] == camera_of(plan, drawn).conditions.beam_loss
        assert "uneven_illumination" not in truth["effects"]
    usual = SetPlan("single", {"prnu": 0.5}, 3, 4)
    assert key(WHOLE, usual)["conditions"] == {}
    assert camera_of(WHOLE, usual).conditions == EVEN
    assert len(sequences_of(WHOLE, usual)) == 6
    write_drawn(tmp_path / "usual", replace(plan, flat_exposures_ms=()), usual)
    assert "exposure_ms" not in (tmp_path / "usual" / "capture.json").read_text()
    path = tmp_path / "plan.json"
    path.write_text(json.dumps({"base": "whole", "flat_exposures_ms": [5, 2.5]}))
    assert load_plan(str(path)).flat_exposures_ms == (5, 2.5)


def test_the_beam_reaches_the_codes(camera: Camera) -> None:
    """The mean of 24 moving boards of a beam that falls by 30 % to the right: 0.15 of scatter, and a slope of it."""
    falling = replace(camera, conditions=Conditions(beam_loss=0.3, beam_center=(-0.4, 0.0)))
    for name in LASER_SEQUENCES[:2]:
        even, lit = (codes(c, name) - camera.black_dn for c in (camera, falling))
        ratio = [(lit[..., part].sum() / even[..., part].sum()) for part in (slice(0, 32), slice(96, 128))]
        assert ratio[1] / ratio[0] == pytest.approx(0.7 ** ((0.93**2 - 0.13**2) / 1.4**2), abs=0.03)


def told(truth: dict[str, Any], names: set[str], verdict: str = "named", gain: float = 1.0) -> dict[str, Any]:
    """A report that names these, with a gain that is off by a factor and an interval of 4 %."""
    k = truth["effects"]["shot_noise"]["dn_per_electron"] * gain
    entry = {"effect": "shot_noise", "parameters": {"dn_per_electron": k},
             "intervals": {"dn_per_electron": [0.98 * k, 1.02 * k]}}  # fmt: skip
    by_rung = {scene: sorted(n for n in names if n in CATALOGUE and rung_of(n) == scene) for scene in SCENES}
    rungs = [{"rung": r, "verdict": "named" if n else "none", "effects": n} for r, n in by_rung.items()]
    return {
        "where": [],
        "cause": {"verdict": verdict, "effects": sorted(names), "ranking": [entry], "rungs": rungs},
        "shrink": {"fraction": 0.97, "residual_detected": False},
    }


def outcomes(diagnosis: Any) -> list[Outcome]:
    keys = [key(WHOLE, entry) for entry in draw_sets(WHOLE)]
    return [Outcome(f"s{i:04d}", "whole", truth, diagnosis(truth), 40.0) for i, truth in enumerate(keys)]


def figures(result: dict[str, Any]) -> dict[str, tuple[float | None, bool | None]]:
    return {f["id"]: (f["value"], f["met"]) for f in result["figures"] if f["id"].startswith("whole")}


def test_a_right_diagnosis_is_counted_so() -> None:
    result = score(outcomes(lambda truth: told(truth, set(truth["effects"]))), [])
    got = figures(result)
    assert {name for name, (value, met) in got.items() if (value, met) == (1.0, True)} == {
        "whole_hidden", "whole_recall", "whole_precision", "whole_no_false", "whole_gain", "whole_time"}  # fmt: skip
    assert got["whole_gap"] == (0.97, True)
    assert got["whole_gain_interval"] == (1.0, False)  # always is too often for 95 %
    assert result["wrong"] == []
    assert [r["rung"] for r in result["rungs"]] == ["dark", "flat", "board", "dots"]
    assert sum(r["named"] for r in result["rungs"]) == 630 == sum(r["recalled"] for r in result["rungs"])
    text = markdown(result)
    assert "| the hidden effect named | whole | 100.0 % |" in text
    assert "## Rung by rung" in text
    assert "| `prnu` | 60 / 60 | - | 0 |" in text


def test_wrong_diagnoses_are_counted_so() -> None:
    def diagnosis(truth: dict[str, Any]) -> dict[str, Any]:
        names = set(truth["effects"]) - {truth["hidden"], "prnu"} | ({"stray"} if not truth["hidden"] else set())
        return told(truth, names, "unknown", 1.05)

    result = score(outcomes(diagnosis), [])
    got = figures(result)
    assert got["whole_hidden"] == (0.0, False)
    assert got["whole_recall"][0] == pytest.approx(540 / 630)
    assert got["whole_precision"][0] == pytest.approx(540 / 570)
    assert got["whole_no_false"] == (0.0, False)
    assert got["whole_gain"] == (0.0, False)
    assert got["whole_gain_interval"] == (0.0, False)
    assert len(result["wrong"]) == 60
    stray = next(row for row in result["names"] if row["effect"] == "stray")
    assert (stray["sets"], stray["false"]) == (0, 30)


def test_photon_transfer_goes_before_a_fit() -> None:
    truth = key(WHOLE, draw_sets(WHOLE)[0])
    k = truth["effects"]["shot_noise"]["dn_per_electron"]
    said = told(truth, set(truth["effects"]), gain=1.2)
    for measured, expected in (
        ({"value": 1.02 * k, "interval": [0.99 * k, 1.05 * k]}, (True, True)),
        ({"value": 1.02 * k, "interval": None}, (True, None)),
        ({"value": None, "interval": None, "unknown": "no flat"}, (False, False)),
    ):
        said["emva1288"] = {"values": {"system_gain": measured}}
        found = gain(Outcome("s", "whole", truth, said))
        assert (found.close, found.held) == expected


def test_a_diagnosis_that_fails_is_wrong() -> None:
    result = score(outcomes(lambda truth: {}), [])
    got = figures(result)
    for name in ("whole_hidden", "whole_recall", "whole_no_false", "whole_gain", "whole_gap"):
        assert got[name] == (0.0, False), name
    assert got["whole_gain_interval"] == (None, None)
    assert result["rungs"] == []


def test_rungs_of_effects() -> None:
    expected = {"dsnu": "dark", "telegraph_noise": "dark", "prnu": "flat", "vignetting": "flat", "crosstalk": "board",
                "image_lag": "board", "defocus": "dots"}  # fmt: skip
    assert {name: rung_of(name) for name in expected} == expected

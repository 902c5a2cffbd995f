"""The power study's plan and its counting."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from gap_check.effects import EFFECTS
from gap_check.outcome import Outcome
from gap_check.plan import draw_sets
from gap_check.power import STRENGTHS, markdown, plan_of, power, table


def test_strengths_below_weak_go_to_nothing() -> None:
    assert EFFECTS["row_noise"].at(-1) == {"sigma_dn": 0.0}
    assert EFFECTS["row_noise"].at(-0.5) == {"sigma_dn": pytest.approx(0.4)}
    assert EFFECTS["depolarization"].at(-0.5) == {"degree_of_polarization": pytest.approx(0.85)}
    assert EFFECTS["glare"].at(-0.5) == {"fraction": pytest.approx(0.025), "scale_px": 6.0}
    for name in ("surface_boiling", "full_well", "adc_bits"):
        with pytest.raises(ValueError, match="between nothing and weak"):
            EFFECTS[name].at(-0.5)


def test_plan_repeats_strengths_on_one_camera() -> None:
    sets = draw_sets(plan_of(8, ("defocus", "row_noise"), STRENGTHS, 3, 1))
    assert len(sets) == 2 * 3 * len(STRENGTHS)
    of_defocus = [s for s in sets if "defocus" in s.strengths]
    assert len({s.camera_seed for s in of_defocus}) == 1
    assert len({s.seed for s in of_defocus}) == len(of_defocus)


def _outcome(strength: float, verdict: str, effects: list[str]) -> Outcome:
    key = {"effects": {"defocus": {"waves": 0.1}}, "strength": {"defocus": strength}}
    return Outcome("s", "level", key, {"cause": {"verdict": verdict, "effects": effects, "equivalent": []}})


def test_table_counts() -> None:
    rows = table({8: [_outcome(-0.9, "none", []), _outcome(-0.9, "unknown", []), _outcome(0.0, "named", ["defocus"])]})
    assert [(r["strength"], r["sets"], r["detected"]["share"], r["included"]["share"]) for r in rows] == [
        (-0.9, 2, 0.5, 0.0),
        (0.0, 1, 1.0, 1.0),
    ]
    assert "| 8 | 0.10 | 2 | 0.50" in markdown(rows)


def test_study_runs_and_goes_on(tmp_path: Path) -> None:
    """With a diagnosis that always says the same; a second run diagnoses nothing."""
    said = {"cause": {"verdict": "named", "effects": ["row_noise"], "equivalent": [], "ranking": []}, "where": []}
    (tmp_path / "said.json").write_text(json.dumps(said))
    command = f"env CAPTURE={{capture}} cp {tmp_path / 'said.json'} {{report}}"
    for _ in range(2):
        text = power(tmp_path / "study", command, 1, 60.0, (4,), ("row_noise",), 1, 1, True)
        command = "false {capture} {report}"
    assert text.count("1.00") >= 2 * len(STRENGTHS)
    assert (tmp_path / "study" / "power.png").stat().st_size > 1000
    assert len(json.loads((tmp_path / "study" / "power.json").read_text())["rows"]) == len(STRENGTHS)

"""What the diagnosis can see: detection and right naming against strength, for several numbers of frames."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from .effects import CATALOGUE
from .figures import wilson
from .outcome import Outcome, read_outcomes
from .plan import Plan, write_plan
from .runner import find_sets, run_sets

# Strengths below 0 lie between nothing (-1) and weak (0): parts 0.05 to 1 of the weak amplitude.
STRENGTHS = (-0.95, -0.9, -0.8, -0.6, -0.3, 0.0)
FRAMES = (4, 8, 16, 32)
EFFECTS = (
    "depolarization",
    "linewidth",
    "defocus",
    "ghost_dots",
    "vignetting",
    "crosstalk",
    "shot_noise",
    "row_noise",
)


def plan_of(frames: int, effects: Sequence[str], strengths: Sequence[float], repeats: int, seed: int) -> Plan:
    """Sets of each effect at each strength, `repeats` times with other surfaces and noise."""
    every = tuple(s for s in strengths for _ in range(repeats))
    return Plan(f"power {frames}", frames=frames, seed=seed, levels=dict.fromkeys(effects, every))


def _share(outcomes: list[Outcome], what: str) -> dict[str, Any]:
    hits = sum(bool(o.verdict not in ("none", "failed") if what == "detected" else o.included) for o in outcomes)
    low, high = wilson(hits, len(outcomes))
    return {"share": hits / len(outcomes) if outcomes else None, "wilson95": [low, high]}


def table(outcomes: dict[int, list[Outcome]]) -> list[dict[str, Any]]:
    """A row for each number of frames and strength, over all effects."""
    rows = []
    for frames, of_frames in sorted(outcomes.items()):
        for strength in sorted({o.strength for o in of_frames if o.strength is not None}):
            chosen = [o for o in of_frames if o.strength == strength]
            rows.append({
                "frames": frames, "strength": strength, "sets": len(chosen),
                "failed": sum(o.verdict == "failed" for o in chosen),
                "detected": _share(chosen, "detected"), "included": _share(chosen, "included"),
            })  # fmt: skip
    return rows


def markdown(rows: list[dict[str, Any]]) -> str:
    """The table for a page."""
    lines = ["| frames | part of the weak amplitude | sets | noticed | named, or among the equivalents |",
             "|---|---|---|---|---|"]  # fmt: skip
    for row in rows:
        cells = []
        for what in ("detected", "included"):
            low, high = row[what]["wilson95"]
            cells.append(f"{row[what]['share']:.2f} ({low:.2f} to {high:.2f})")
        lines.append(f"| {row['frames']} | {1 + row['strength']:.2f} | {row['sets']} | {cells[0]} | {cells[1]} |")
    failed = sum(row["failed"] for row in rows)
    if failed:
        lines += ["", f"{failed} diagnoses wrote no valid report; they count as nothing noticed."]
    return "\n".join(lines) + "\n"


def power(
    out: Path, command: str, jobs: int, timeout_s: float, frames: Sequence[int], effects: Sequence[str], repeats: int,
    seed: int, figures: bool,
) -> str:  # fmt: skip
    """Draws, diagnoses and counts; sets that have a report are not diagnosed again. Writes OUT/power.{json,md,png}."""
    effects = tuple(dict.fromkeys(effects))
    for name in effects:
        if name not in CATALOGUE:
            known = ", ".join(CATALOGUE)
            raise ValueError(f"{name!r} is no effect of the catalogue, so that none could name it; there are: {known}")
    outcomes: dict[int, list[Outcome]] = {}
    for count in frames:
        folder = out / f"frames_{count}"
        write_plan(folder, plan_of(count, effects, STRENGTHS, repeats, seed))
        sets = find_sets(folder)
        run_sets(sets, folder / "reports", command, jobs, timeout_s)
        outcomes[count], _ = read_outcomes(sets, folder / "reports")
    rows = table(outcomes)
    (out / "power.json").write_text(
        json.dumps({"effects": list(effects), "repeats": repeats, "rows": rows}, indent=1) + "\n"
    )
    if figures:
        from .plots import plot_power  # matplotlib takes seconds to load

        plot_power(rows, out / "power.png")
    text = markdown(rows)
    (out / "power.md").write_text(text)
    return text

"""The table of the withheld-effect check, from keys and reports."""

from __future__ import annotations

from collections import Counter, defaultdict
from dataclasses import asdict, dataclass
from math import erf, sqrt
from typing import Any

import numpy as np

from .effects import CATALOGUE, EFFECTS
from .figures import NORMAL_975, Figure, proportion, quantity, wilson
from .outcome import Outcome

SINGLE_KINDS = ("single", "replica", "level")
STRENGTH_EDGES = (0.0, 0.2, 0.4, 0.6, 0.8, 1.0)
# Central intervals whose coverage is counted, and the bins of the truths' ranks.
CALIBRATION_LEVELS = (0.5, 0.8, 0.95)
RANK_BINS = 10
DETECTABILITY_EDGES = (0.0, 3.0, 5.0, 8.0, 15.0, 30.0, 100.0, float("inf"))


@dataclass(frozen=True)
class Estimate:
    """One parameter of an effect that the report named, or of a single one that it held for possible."""

    set_name: str
    effect: str
    parameter: str
    truth: float
    estimate: float
    low: float | None
    high: float | None

    @property
    def relative_error(self) -> float:
        """|estimate - truth| / |truth|; near a truth of 0 over a tenth of the range from weak to strong."""
        weak, strong = EFFECTS[self.effect].ranges.get(self.parameter, (0.0, 0.0))
        return abs(self.estimate - self.truth) / max(abs(self.truth), 0.1 * abs(strong - weak), 1e-12)

    @property
    def held(self) -> bool | None:
        """Whether the interval holds the truth; None without an interval."""
        if self.low is None or self.high is None:
            return None
        slack = 1e-9 * max(1.0, abs(self.truth))
        return self.low - slack <= self.truth <= self.high + slack

    @property
    def rank(self) -> float | None:
        """Where the truth lies in the parameter's distribution, 0 to 1: normal, as wide as the interval on each side.

        Evenly spread if the intervals are right at all levels (Talts et al. 2018, arXiv 1804.06788). None without an
        interval, or with one that ends at the estimate, as at the end of a range.
        """
        bound = self.high if self.truth > self.estimate else self.low
        if bound is None or bound == self.estimate:
            return None
        deviations = NORMAL_975 * (self.truth - self.estimate) / abs(bound - self.estimate)
        return 0.5 * (1 + erf(deviations / sqrt(2)))


def estimates(outcomes: list[Outcome]) -> list[Estimate]:
    """Of all parameters that are drawn (those with a range) and whose effect was named; of single effects also where
    the truth was among the equivalents."""
    return [
        estimate
        for outcome in outcomes
        for effect in sorted(outcome.truth & EFFECTS.keys())
        if (outcome.included if len(outcome.truth) == 1 else effect in outcome.effects)
        for estimate in _estimates_of(outcome, effect)
    ]


def _estimates_of(outcome: Outcome, effect: str) -> list[Estimate]:
    entry = outcome.ranked(effect) or {}
    found = []
    for parameter, truth in outcome.key["effects"][effect].items():
        weak, strong = EFFECTS[effect].ranges.get(parameter, (0.0, 0.0))
        if weak == strong or parameter not in entry.get("parameters", {}):
            continue
        interval = entry.get("intervals", {}).get(parameter) or (None, None)
        low, high = (None if bound is None else float(bound) for bound in interval)
        value = float(entry["parameters"][parameter])
        found.append(Estimate(outcome.name, effect, parameter, float(truth), value, low, high))
    return found


def calibration(outcomes: list[Outcome]) -> dict[str, Any]:
    """Whether the intervals are right at every level, not at 95 % alone: ranks of the truths (Estimate.rank)."""
    ranks = [rank for e in estimates(outcomes) if (rank := e.rank) is not None]
    levels = []
    for level in CALIBRATION_LEVELS:
        inside = sum(abs(2 * rank - 1) <= level for rank in ranks)
        levels.append(
            {"level": level, "held": inside, "count": len(ranks), "wilson95": list(wilson(inside, len(ranks)))}
        )
    counts = np.histogram(ranks, bins=RANK_BINS, range=(0.0, 1.0))[0]
    return {"levels": levels, "ranks": [int(count) for count in counts]}


def replica_coverage(outcomes: list[Outcome]) -> list[bool]:
    """Whether `shrink.ci95` holds the true fraction.

    The true fraction of a truth is the mean of the fractions over sets that differ only in surfaces and noise. It is
    estimated by the mean of the *other* sets of the group, so that no set is compared with itself. With R sets that
    mean scatters by 1 / sqrt(R - 1) of one fraction's scatter: exact 95 % intervals come out near 93 % for R = 6.
    Only sets whose report named the truth count: others shrink by another model.
    """
    groups: dict[str, list[Outcome]] = defaultdict(list)
    for outcome in outcomes:
        if outcome.kind == "replica" and outcome.exact and outcome.fraction() is not None:
            groups[str(outcome.key.get("group"))].append(outcome)
    held = []
    for members in groups.values():
        if len(members) < 3:
            continue
        fractions = np.array([member.fraction() for member in members], float)
        for index, member in enumerate(members):
            interval = member.report["shrink"].get("ci95")
            if interval and None not in interval:
                others = float(np.delete(fractions, index).mean())
                held.append(bool(interval[0] <= others <= interval[1]))
    return held


def _label(outcome: Outcome) -> str:
    """The column of the confusion matrix."""
    if outcome.verdict == "named":
        return next(iter(outcome.effects)) if len(outcome.effects) == 1 else "several"
    if outcome.verdict == "ambiguous":
        return "ambiguous, truth in" if outcome.included else "ambiguous, truth out"
    return outcome.verdict


EXTRA_COLUMNS = ("several", "ambiguous, truth in", "ambiguous, truth out", "unknown", "none", "failed")


def confusion(singles: list[Outcome]) -> tuple[list[str], list[str], list[list[int]]]:
    """Truths, verdicts, counts."""
    truths = [name for name in CATALOGUE if any(o.truth == {name} for o in singles)]
    counts = Counter((next(iter(o.truth)), _label(o)) for o in singles)
    others = sorted({label for _, label in counts} - set(truths) - set(EXTRA_COLUMNS))
    columns = [*truths, *others, *(c for c in EXTRA_COLUMNS if any(label == c for _, label in counts))]
    return truths, columns, [[counts[(truth, column)] for column in columns] for truth in truths]


def binned(
    outcomes: list[Outcome], values: list[float | None], edges: tuple[float, ...], last_closed: bool = True
) -> list[dict[str, Any]]:
    """Detection, exact and inclusive accuracy in bins of a value."""
    rows = []
    for low, high in zip(edges, edges[1:], strict=False):
        final = last_closed and high == edges[-1]
        inside = [
            o
            for o, v in zip(outcomes, values, strict=True)
            if v is not None and low <= v and (v < high or (final and v <= high))
        ]
        row: dict[str, Any] = {"low": low, "high": None if np.isinf(high) else high, "sets": len(inside)}
        for name, hits in (
            ("detected", [o.verdict not in ("none", "failed") for o in inside]),
            ("exact", [o.exact for o in inside]),
            ("included", [o.included for o in inside]),
        ):
            share = sum(hits) / len(hits) if hits else None
            row[name] = {"share": share, "wilson95": list(wilson(sum(hits), len(hits)))}
        rows.append(row)
    return rows


@dataclass(frozen=True)
class Gain:
    """DN per electron, as the report has it, beside what is true."""

    truth: float
    estimate: float | None
    low: float | None = None
    high: float | None = None

    @property
    def close(self) -> bool:
        return self.estimate is not None and abs(self.estimate / self.truth - 1) <= 0.03

    @property
    def held(self) -> bool | None:
        return None if self.low is None or self.high is None else self.low <= self.truth <= self.high


def gain(outcome: Outcome) -> Gain:
    """The gain of a camera with photon noise: by photon transfer if the report has it, else as it was fitted."""
    truth = float(outcome.key["effects"]["shot_noise"]["dn_per_electron"])
    measured = outcome.report.get("emva1288", {}).get("values", {}).get("system_gain", {})
    if measured.get("value") is not None:
        return Gain(truth, measured["value"], *(measured.get("interval") or (None, None)))
    entry = outcome.ranked("shot_noise") or {}
    estimate = entry.get("parameters", {}).get("dn_per_electron")
    low, high = entry.get("intervals", {}).get("dn_per_electron") or (None, None)
    return Gain(truth, estimate, low, high)


def _whole(outcomes: list[Outcome]) -> list[Figure]:
    hidden, usual = [o for o in outcomes if o.hidden], [o for o in outcomes if not o.hidden]
    gains = [gain(o) for o in outcomes]
    times = [o.wall_s for o in outcomes if o.wall_s is not None]
    return [
        proportion("whole_hidden", "the hidden effect named", "whole", [o.hidden in o.effects for o in hidden],
                   (0.90, 1.0)),
        proportion("whole_recall", "recall: true effects that are named", "whole",
                   [name in o.effects for o in outcomes for name in o.truth], (0.85, 1.0), "effects"),
        proportion("whole_precision", "precision: named effects that are true", "whole",
                   [name in o.truth for o in outcomes for name in o.effects], (0.90, 1.0), "effects"),
        proportion("whole_no_false", "no false name, without a hidden effect", "whole",
                   [not o.failed and o.effects <= o.truth for o in usual], (0.90, 1.0)),
        proportion("whole_gain", "gain within 3 %", "whole", [g.close for g in gains], (0.95, 1.0)),
        proportion("whole_gain_interval", "95 % intervals of the gain that hold the truth", "whole",
                   [g.held for g in gains if g.held is not None], (0.90, 0.99)),
        quantity("whole_gap", "median part of the gap that is gone", "whole",
                 [o.fraction() or 0.0 for o in outcomes], median=True, target=(0.95, 1.0)),
        proportion("whole_time", "diagnosed within 90 s", "whole", [t <= 90 for t in times], (1.0, 1.0)),
    ]  # fmt: skip


SCENES = ("dark", "flat", "board", "dots")


def rung_of(effect: str) -> str:
    """The first scene, from the dark on, in which an effect shows."""
    seen = {name.split("_")[0] for name in EFFECTS[effect].sequences}
    return next(scene for scene in SCENES if scene in seen)


def rungs(outcomes: list[Outcome]) -> list[dict[str, Any]]:
    """Verdicts and names of each rung, of reports that have them."""
    rows = []
    for scene in SCENES:
        told = [(o, rung) for o in outcomes for rung in o.rungs if rung.get("rung") == scene]
        if not told:
            continue
        named = [(o, str(name)) for o, rung in told for name in rung.get("effects", [])]
        true = [(o, name) for o, _ in told for name in o.truth if rung_of(name) == scene]
        rows.append(
            {
                "rung": scene,
                "verdicts": dict(Counter(str(rung.get("verdict")) for _, rung in told)),
                "true": len(true),
                "recalled": sum(name in o.effects for o, name in true),
                "named": len(named),
                "named_true": sum(name in o.truth for o, name in named),
            }
        )
    return rows


def _abstention(outcomes: list[Outcome], letter: str, target: tuple[float, float] | None) -> list[Figure]:
    unknown = [o for o in outcomes if o.verdict == "unknown"]
    located = [o for o in unknown if o.sequences]
    prefix = {"d": "outside", "e": "without"}[letter]
    return [
        proportion(f"{prefix}_unknown", "abstention: verdict `unknown`", letter,
                   [o.verdict == "unknown" for o in outcomes], target),
        proportion(f"{prefix}_unknown_stage", "`unknown`, and the worst statistic in a right stage", letter,
                   [o.verdict == "unknown" and o.worst.get("stage") in o.stages for o in outcomes], target),
        proportion(f"{prefix}_named", "a catalogued effect named, or several held equivalent", letter,
                   [o.verdict in ("named", "ambiguous") for o in outcomes]),
        proportion(f"{prefix}_missed", "not noticed: verdict `none`", letter, [o.verdict == "none" for o in outcomes]),
        proportion(f"{prefix}_alone", "of the `unknown`: no catalogued effect listed beside", letter,
                   [not o.effects for o in unknown]),
        proportion(f"{prefix}_stage", "of the `unknown`: stage of the worst statistic is the effect's own or alike",
                   letter, [o.worst.get("stage") in o.stages for o in located]),
        proportion(f"{prefix}_own_stage", "of the `unknown`: stage of the worst statistic is the effect's own", letter,
                   [o.worst.get("stage") in o.own_stages for o in located if o.own_stages]),
        proportion(f"{prefix}_sequence", "of the `unknown`: sequence of the worst statistic is one where it shows",
                   letter, [o.worst.get("sequence") in o.sequences for o in located]),
    ]  # fmt: skip


def figures(outcomes: list[Outcome]) -> list[Figure]:
    """All lines of the table; targets are those of the project's issue."""
    by_kind: dict[str, list[Outcome]] = defaultdict(list)
    for outcome in outcomes:
        by_kind[outcome.kind].append(outcome)
    nulls, pairs, many = by_kind["null"], by_kind["pair"], by_kind["many"]
    singles = [o for kind in SINGLE_KINDS for o in by_kind[kind]]
    drawn = by_kind["single"] + by_kind["replica"]  # strengths of `level` are chosen, not drawn
    told = estimates(drawn)
    held = [e.held for e in told if e.held is not None]
    right = [o for o in singles if o.exact and "residual_detected" in o.report.get("shrink", {})]
    sizes = [float(len(o.candidates)) for o in drawn if o.candidates]
    named = [(o.truth & o.effects, o.truth, o.effects) for o in many]
    return [
        proportion("false_alarms", "false alarms: verdict other than `none`", "a",
                   [o.verdict != "none" for o in nulls], (0.0, 0.05)),
        proportion("detected", "noticed: verdict other than `none`", "b",
                   [o.verdict not in ("none", "failed") for o in drawn]),
        proportion("top1", "exactly named", "b", [o.exact for o in drawn], (0.90, 1.0)),
        proportion("top1_ambiguous", "named, or ambiguous with the truth among the equivalents", "b",
                   [o.included for o in drawn], (0.95, 1.0)),
        proportion("wrong_name", "one wrong effect named", "b",
                   [o.verdict == "named" and not o.effects & o.truth for o in drawn]),
        quantity("set_size", "mean number of explanations left (named: 1)", "b", sizes),
        quantity("parameter_error", "median relative error of the parameters", "b",
                 [e.relative_error for e in told], median=True, unit="parameters"),
        proportion("parameter_10", "parameters within 10 %", "b", [e.relative_error <= 0.1 for e in told],
                   unit="parameters"),
        proportion("interval_coverage", "95 % intervals of the parameters that hold the truth", "b",
                   [bool(h) for h in held], (0.90, 0.99), unit="parameters"),
        proportion("residual_gone", "`residual_detected` is false once the true effect is in", "b",
                   [not o.report["shrink"]["residual_detected"] for o in right], (0.90, 1.0)),
        proportion("fraction_coverage", "`shrink.ci95` holds the true fraction (mean of the other replicas)", "b",
                   replica_coverage(outcomes)),
        proportion("pairs_both", "both effects named", "c, pairs",
                   [o.verdict == "named" and o.truth <= o.effects for o in pairs], (0.70, 1.0)),
        proportion("pairs_exact", "both named and nothing else", "c, pairs", [o.exact for o in pairs]),
        proportion("pairs_included", "both named, or among the equivalents", "c, pairs",
                   [o.included or (o.verdict == "named" and o.truth <= o.effects) for o in pairs]),
        proportion("pairs_one", "at least one of both named", "c, pairs", [bool(o.truth & o.effects) for o in pairs]),
        proportion("many_recall", "recall: true effects that are named", "c, 3 to 6",
                   [name in hit for hit, truth, _ in named for name in truth], (0.80, 1.0), "effects"),
        proportion("many_precision", "precision: named effects that are true", "c, 3 to 6",
                   [name in hit for hit, _, listed in named for name in listed], (0.80, 1.0), "effects"),
        *_abstention(by_kind["outside"], "d", (0.90, 1.0)),
        *_abstention(by_kind["without"], "e", None),
        *_whole(by_kind["whole"]),
        proportion("failed", "diagnoses that wrote no report", "all", [o.failed for o in outcomes], (0.0, 0.0)),
        quantity("wall_s", "median time of a set, s", "all",
                 [o.wall_s for o in outcomes if o.wall_s is not None], median=True),
    ]  # fmt: skip


def per_effect(outcomes: list[Outcome]) -> list[dict[str, Any]]:
    """Accuracy, detectability, error and coverage of each effect alone; abstention where it was withheld."""
    rows = []
    for name, info in EFFECTS.items():
        mine = [o for o in outcomes if o.truth == {name} and o.kind in SINGLE_KINDS]
        withheld = [o for o in outcomes if o.truth == {name} and o.kind in ("without", "outside")]
        if not mine and not withheld:
            continue
        told = estimates(mine)
        held = [e.held for e in told if e.held is not None]
        said = Counter(_label(o) for o in withheld)
        rows.append(
            {
                "effect": name,
                "stage": info.stage,
                "in_catalogue": info.in_catalogue,
                "sets": len(mine),
                "exact": sum(o.exact for o in mine),
                "included": sum(o.included for o in mine),
                "detectability": float(np.median([o.detectability for o in mine or withheld])),
                "relative_error": float(np.median([e.relative_error for e in told])) if told else None,
                "intervals": len(held),
                "intervals_held": sum(bool(h) for h in held),
                "withheld_sets": len(withheld),
                "withheld_unknown": said["unknown"],
                "withheld_said": dict(said),
            }
        )
    return rows


def names_of_whole(outcomes: list[Outcome]) -> list[dict[str, Any]]:
    """Each effect in whole cameras: how often it was there, was named, and was named where it was not there."""
    mine = [o for o in outcomes if o.kind == "whole"]
    rows = []
    for name in sorted({name for o in mine for name in o.truth | o.effects}):
        there = [o for o in mine if name in o.truth]
        rows.append(
            {
                "effect": name,
                "sets": len(there),
                "named": sum(name in o.effects for o in there),
                "hidden": sum(o.hidden == name for o in there),
                "hidden_named": sum(o.hidden == name and name in o.effects for o in there),
                "false": sum(name in o.effects for o in mine) - sum(name in o.effects for o in there),
            }
        )
    return rows


def wrong_sets(outcomes: list[Outcome]) -> list[dict[str, Any]]:
    """Every set that did not come out as it should, for looking at."""
    rows = []
    for o in outcomes:
        right = {
            "null": o.verdict == "none",
            "outside": o.verdict == "unknown",
            "without": o.verdict == "unknown",
            "whole": o.effects == o.truth,
        }.get(o.kind, o.included)
        if not right:
            rows.append(
                {
                    "set": o.name,
                    "kind": o.kind,
                    "truth": o.key["effects"],
                    "strength": o.key.get("strength"),
                    "verdict": o.verdict,
                    "effects": sorted(o.effects),
                    "equivalent": [sorted(c) for c in o.candidates] if o.verdict == "ambiguous" else [],
                    "detectability": o.detectability,
                    "worst": {k: o.worst.get(k) for k in ("stage", "sequence", "statistic", "region", "z")},
                }
            )
    return rows


def score(outcomes: list[Outcome], missing: list[str]) -> dict[str, Any]:
    """Everything, as JSON takes it."""
    singles = [o for o in outcomes if o.kind in SINGLE_KINDS]
    truths, columns, counts = confusion(singles)
    times = [o.wall_s for o in outcomes if o.wall_s is not None]
    memory = [o.peak_memory_mib for o in outcomes if o.peak_memory_mib is not None]
    return {
        "format": "clspeckle-withheld-score",
        "version": 1,
        "sets": dict(Counter(o.kind for o in outcomes)),
        "missing": missing,
        "figures": [{**asdict(f), "met": f.met} for f in figures(outcomes)],
        "confusion": {"truths": truths, "verdicts": columns, "counts": counts},
        "strength": binned(singles, [o.strength for o in singles], STRENGTH_EDGES),
        "detectability": binned(singles, [o.detectability for o in singles], DETECTABILITY_EDGES),
        "effects": per_effect(outcomes),
        "rungs": rungs(outcomes),
        "names": names_of_whole(outcomes),
        "parameters": [{**asdict(e), "held": e.held} for e in estimates(singles)],
        "calibration": calibration(outcomes),
        "time_s": {"median": float(np.median(times)), "max": max(times)} if times else None,
        "peak_memory_mib": max(memory) if memory else None,
        "wrong": wrong_sets(outcomes),
    }

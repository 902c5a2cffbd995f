"""What a report says of a set, beside what is true."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .effects import EFFECTS
from .json_file import read_json
from .runner import CheckSet, key_kind, read_report

VERDICTS = ("none", "named", "ambiguous", "unknown")


def _effect_set(item: Any) -> frozenset[str]:
    """An equivalent explanation: an effect, or a list of effects, or an object with either."""
    if isinstance(item, str):
        return frozenset([item])
    if isinstance(item, dict):
        return _effect_set(item.get("effects", item.get("effect", [])))
    return frozenset(str(name) for name in item)


@dataclass(frozen=True)
class Outcome:
    """One set: key and report."""

    name: str
    kind: str
    key: dict[str, Any]
    report: dict[str, Any]  # empty if the diagnosis failed
    wall_s: float | None = None
    peak_memory_mib: float | None = None

    @property
    def failed(self) -> bool:
        return not self.report

    @property
    def truth(self) -> frozenset[str]:
        return frozenset(self.key["effects"])

    @property
    def verdict(self) -> str:
        return str(self.report["cause"]["verdict"]) if self.report else "failed"

    @property
    def effects(self) -> frozenset[str]:
        """What the report names."""
        return frozenset(self.report["cause"].get("effects", [])) if self.report else frozenset()

    @property
    def candidates(self) -> list[frozenset[str]]:
        """The explanations that the report leaves: one of `named`, all equivalents of `ambiguous`."""
        if self.verdict == "named":
            return [self.effects]
        if self.verdict != "ambiguous":
            return []
        found = [_effect_set(item) for item in self.report["cause"].get("equivalent", [])]
        if self.effects and self.effects not in found and len(self.effects) == 1:
            found.append(self.effects)  # the best of them stands in `effects` alone
        return list(dict.fromkeys(found))

    @property
    def exact(self) -> bool:
        return self.verdict == "named" and self.effects == self.truth

    @property
    def included(self) -> bool:
        """Named, or ambiguous with the truth among the equivalents (beside what is certain, if anything is)."""
        if self.verdict == "ambiguous":
            return any(self.truth in (c, c | self.effects) for c in self.candidates)
        return self.exact

    @property
    def stages(self) -> frozenset[str]:
        if "stages" in self.key:
            return frozenset(self.key["stages"])
        return frozenset(stage for name in self.truth if name in EFFECTS for stage in EFFECTS[name].stages)

    @property
    def own_stages(self) -> frozenset[str]:
        return frozenset(EFFECTS[name].stage for name in self.truth if name in EFFECTS)

    @property
    def sequences(self) -> frozenset[str]:
        if "sequences" in self.key:
            return frozenset(self.key["sequences"])
        return frozenset(sequence for name in self.truth if name in EFFECTS for sequence in EFFECTS[name].sequences)

    @property
    def worst(self) -> dict[str, Any]:
        """The first, worst entry of `where`."""
        where = self.report.get("where", []) if self.report else []
        return where[0] if where else {}

    @property
    def detectability(self) -> float:
        """The largest |z| over all statistics."""
        where = self.report.get("where", []) if self.report else []
        return max((abs(float(entry.get("z") or 0.0)) for entry in where), default=0.0)

    @property
    def strength(self) -> float | None:
        """0 (weak) to 1 (strong) of a single effect, of its first parameter if the key does not say."""
        strengths = self.key.get("strength")
        if isinstance(strengths, dict) and len(strengths) == 1:
            return float(next(iter(strengths.values())))
        if len(self.truth) == 1 and self.truth <= EFFECTS.keys():
            name = next(iter(self.truth))
            for parameter, (weak, strong) in EFFECTS[name].ranges.items():
                if weak != strong and parameter in self.key["effects"][name]:
                    return float((self.key["effects"][name][parameter] - weak) / (strong - weak))
        return None

    @property
    def hidden(self) -> str:
        """What a whole camera has beside the usual effects; empty if nothing."""
        return str(self.key.get("hidden", ""))

    @property
    def rungs(self) -> list[dict[str, Any]]:
        """The verdicts of dark, flat, board and dots, if the report has them."""
        return list(self.report["cause"].get("rungs", [])) if self.report else []

    def fraction(self) -> float | None:
        """The part of the gap that is gone."""
        value = self.report.get("shrink", {}).get("fraction")
        return None if value is None else float(value)

    def ranked(self, effect: str) -> dict[str, Any] | None:
        """The ranking's first entry of an effect."""
        ranking = self.report["cause"].get("ranking", []) if self.report else []
        for entry in ranking:
            if _effect_set(entry) == {effect}:
                return dict(entry)
        return None


def read_outcomes(sets: list[CheckSet], reports: Path) -> tuple[list[Outcome], list[str]]:
    """Outcomes of all sets that were diagnosed, failures among them; and the names of those that were not."""
    outcomes, missing = [], []
    for entry in sets:
        report = read_report(reports / f"{entry.name}.json")
        run = _read_run(reports / f"{entry.name}.run")
        if report is None and not run:
            missing.append(entry.name)
            continue
        if report is not None and report["cause"].get("verdict") not in VERDICTS:
            report = None  # not a report of the protocol
        outcomes.append(
            Outcome(
                entry.name, key_kind(entry.key), entry.key, report or {}, run.get("wall_s"), run.get("peak_memory_mib")
            )
        )
    return outcomes, missing


def _read_run(path: Path) -> dict[str, Any]:
    try:
        run = read_json(path)
    except (OSError, ValueError):
        return {}
    return run if isinstance(run, dict) else {}

"""The gap between a real camera and the simulator: whether there is one, where, what causes it, how far it shrinks.

    found = clspeckle.diagnose("my-camera")  # the folder of a capture set
    print(found)

The method and every number of the report: ``docs/method/diagnosis.md``; the C interface: ``diagnosis.h``.
"""

from __future__ import annotations

import ctypes
import dataclasses
import html
import json
import math
import os
import re
import sys
import time
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Callable, TypeVar, Union, cast

import numpy as np
import numpy.typing as npt

from . import _check, _library, _show, errors
from ._handle import Handle, create, exclusive
from ._progress import Call, Progress
from .capture import Capture, CaptureSequence
from .profile import Profile
from .runtime import Context, resolve_context

__all__ = [
    "Calibration",
    "Coverage",
    "Diagnosis",
    "GapPlace",
    "Hypothesis",
    "Quantity",
    "RankedEffect",
    "ScreenedEffect",
    "ShrinkStep",
    "Shrinkage",
    "UsedFrames",
    "compare",
    "diagnose",
]

_POINTS = _library.words("HYPOTHESIS")
_ARGUMENTS = _check.Arguments(_library.ClspDiagnoseDesc, flags=("evidence",))
_STAGES = ("laser", "doe", "surface", "motion", "optics", "sensor")
_KEYWORDS = ("sequence", "frame_index", "seed")
_ID = re.compile(r"[A-Za-z0-9_.-]{1,31}")
_WORST = 12  # statistics that a notebook shows
_LEAST_LEVEL, _MOST_LEVEL = 1e-6, 0.5
_RANGES = {"null_replicates": (12, 100000), "max_effects": (1, 64), "threads": (1, 1024)}
"""Those of the C library (diagnosis.h), so that messages name the arguments of :func:`diagnose`."""

Entry = TypeVar("Entry")
CaptureLike = Union[Capture, str, "os.PathLike[str]", Mapping[str, Union[npt.ArrayLike, CaptureSequence]]]


@dataclasses.dataclass(frozen=True)
class Hypothesis:
    """An effect of one's own, which joins the catalogue's in the ranking.

    ::

        def haze(pixels, *, sequence, frame_index, seed, fraction):
            return (1 - fraction) * pixels + fraction * pixels.mean()

        clspeckle.Hypothesis("haze", "optics", haze, {"fraction": (0.05, 0.3, 0, 1)})

        # rows.cl:
        # float hypothesis(hypothesis_frame frame, hypothesis_values values, uint x, uint y) {
        #     return hypothesis_pixel(frame, x, y) + values.sigma * hypothesis_fixed_normal(frame, 0, y, 0);
        # }
        source = Path("rows.cl").read_text()
        clspeckle.Hypothesis("rows", "sensor", source, {"sigma": (0.5, 4, 0, 50)}, point="codes")
    """

    id: str
    """1 to 31 letters, digits, "_", "-" and "."; neither the catalogue's nor another hypothesis's."""
    stage: str
    """"laser", "doe", "surface", "motion", "optics" or "sensor"."""
    apply: Callable[..., Any] | str
    """``apply(pixels, *, sequence, frame_index, seed, **parameters)``: changes `pixels`, a float32 array of (height,
    width), in place and returns None, or returns a new array. The same arguments must give the same pixels: what is
    random must come from `seed` (of the simulated capture), `sequence` (its name) and `frame_index`.

    Or text: OpenCL C that defines ``float hypothesis(hypothesis_frame frame, hypothesis_values values, uint x, uint
    y)``, the new value of a pixel (docs/method/diagnosis.md, ``diagnosis.h``). It runs on the device."""
    parameters: Mapping[str, Sequence[float]]
    """1 to 4 by name: (weak, strong) or (weak, strong, minimum, maximum). All move together from weak to strong, and
    may go beyond. Without a minimum and a maximum the range ends twice the difference beyond weak and strong, or at 0
    if both lie on one side of it. The effect is looked for in both directions if its first parameter's range lies on
    both sides of 0 with weak and strong on one of them, and if it is a ratio: unit "1", minimum 1/r, maximum r, weak
    and strong on one side of 1."""
    point: str = "intensity"
    """"irradiance": the ideal image, before the speckle forms; "intensity": behind the lens, before the sensor, 1 is
    the mean of flat and board; "codes": the sensor's codes, rounded after the call. Only "codes" acts in the dark."""
    summary: str = ""
    """What happens, in words."""
    units: Mapping[str, str] = dataclasses.field(default_factory=dict)
    """Units by parameter; "1" for those that are not named."""

    def __post_init__(self) -> None:
        """Refuses at once what :func:`diagnose` could not take."""
        for member in ("id", "stage", "summary"):
            if not isinstance(getattr(self, member), str):
                raise TypeError(f"{member} of a hypothesis must be text, got {_check.kind(getattr(self, member))}")
        name = self.id
        if not _ID.fullmatch(name):
            raise errors.InvalidArgumentError(
                f'id of the hypothesis is {name!r}, expected 1 to 31 letters, digits, "_", "-" and "."'
            )
        if not callable(self.apply) and not isinstance(self.apply, str):
            raise TypeError(
                f"apply of the hypothesis {name!r} must be a function or OpenCL source, got {_check.kind(self.apply)}"
            )
        if self.stage not in _STAGES:
            raise errors.InvalidArgumentError(
                f"stage of the hypothesis {name!r} is {self.stage!r}, expected {_check.one_of(_STAGES)}"
                f"{_check.nearest(self.stage, _STAGES)}"
            )
        _check.choice(self.point, f"point of the hypothesis {name!r}", _POINTS)
        if not isinstance(self.parameters, Mapping):
            raise TypeError(
                f"parameters of the hypothesis {name!r} must be a dict of name to (weak, strong), got "
                f"{_check.kind(self.parameters)}"
            )
        if not 1 <= len(self.parameters) <= _library.CLSP_MAX_EFFECT_PARAMETERS:
            raise errors.InvalidArgumentError(
                f"parameters of the hypothesis {name!r} has {len(self.parameters)} entries, expected 1 to "
                f"{_library.CLSP_MAX_EFFECT_PARAMETERS}: without a parameter there is nothing to fit"
            )
        for key, given in self.parameters.items():
            if isinstance(self.apply, str) and not (isinstance(key, str) and key.isidentifier() and key.isascii()):
                raise errors.InvalidArgumentError(
                    f"the parameter {key!r} of the hypothesis {name!r} must be a name that OpenCL C can have: letters, "
                    "digits and '_', no digit first"
                )
            if not isinstance(self.apply, str) and (
                not isinstance(key, str) or not key.isidentifier() or key in _KEYWORDS
            ):
                raise errors.InvalidArgumentError(
                    f"the parameter {key!r} of the hypothesis {name!r} must be a name that `apply` can have as an "
                    f"argument, other than {', '.join(_KEYWORDS)}"
                )
            weak, strong, minimum, maximum = _range_of(given, f"parameters[{key!r}] of the hypothesis {name!r}")
            finite = all(map(math.isfinite, (weak, strong, minimum, maximum)))
            if not finite or not minimum <= min(weak, strong) <= max(weak, strong) <= maximum or minimum == maximum:
                raise errors.InvalidArgumentError(
                    f"parameters[{key!r}] of the hypothesis {name!r} has weak {weak:g}, strong {strong:g}, minimum "
                    f"{minimum:g}, maximum {maximum:g}; expected finite numbers, weak and strong from minimum to "
                    "maximum, and a minimum below the maximum"
                )
        if not isinstance(self.units, Mapping):
            raise TypeError(f"units of the hypothesis {name!r} must be a dict, got {_check.kind(self.units)}")
        for unit in self.units:
            if unit not in self.parameters:
                raise errors.InvalidArgumentError(f"units of the hypothesis {name!r} names {unit!r}, no parameter")


@dataclasses.dataclass(frozen=True)
class RankedEffect:
    """An effect that was weighed."""

    effect: str
    """Its id."""
    parameters: dict[str, float]
    """Fitted values."""
    intervals: dict[str, tuple[float, float]]
    """95 % intervals of the parameters; of the effects found only."""
    probability: float
    """Among the effects of its step."""
    distance_after: float
    """The gap that it would leave, in standard deviations of captures simulated with it; 0: no more than chance."""


@dataclasses.dataclass(frozen=True)
class GapPlace:
    """One statistic of the real capture against the simulated ones."""

    stage: str
    """Whose effects it shows first."""
    sequence: str
    """Name of the sequence."""
    statistic: str
    """For example "dot_width_x"."""
    region: str
    """"all", or a part of the image."""
    unit: str
    """Of `real` and `sim`."""
    real: float
    """Of the capture."""
    sim: float
    """Mean of the simulated captures without effects."""
    z: float
    """Their difference in standard deviations of single simulated captures."""
    p_adjusted: float
    """Its probability by chance, adjusted for the number of statistics (Holm)."""
    z_after: float
    """z with the effects found."""
    distance_before: float = math.nan
    """On frames that no fit has seen, beyond chance, on the scale of :attr:`Shrinkage.distance_before`; NaN if no
    effect was found, and of a sequence of fewer than four frames."""
    distance_after: float = math.nan
    """With the effects found."""
    fraction: float = math.nan
    """Part of it that is gone: 1 - after / before; NaN also where the distance before is not beyond chance."""
    ci95: tuple[float, float] = (math.nan, math.nan)
    """Its 95 % interval."""


@dataclasses.dataclass(frozen=True)
class ShrinkStep:
    """What one effect took away from the gap."""

    effect: str
    """Its id."""
    distance_after: float
    """The gap left by this effect and those before it."""
    fraction: float
    """Part of the whole gap that is gone by then."""


@dataclasses.dataclass(frozen=True)
class Shrinkage:
    """How far the gap shrinks with the effects found."""

    distance_before: float
    """Without them; 0 if none was found. In standard deviations of half captures simulated with all effects found, as
    `distance_after`; another scale than :attr:`Diagnosis.distance`."""
    distance_after: float
    """With them."""
    fraction: float
    """Part of the gap that is gone: 1 - after / before. Both are what lies beyond the mean of chance, which chance
    exceeds in about half of all captures: a right model may well leave less than 1."""
    ci95: tuple[float, float]
    """Its 95 % interval."""
    held_out: bool
    """True: measured on frames that no fit has seen."""
    residual_detected: bool
    """True: a gap remains."""
    residual_p_value: float
    """Probability of so large a remainder by chance."""
    steps: tuple[ShrinkStep, ...]
    """The effects in the order in which they were found."""


def _number(value: Any) -> float:
    """JSON has no infinities; the report has null for them."""
    return math.nan if value is None else float(value)


def _interval(limits: Sequence[Any] | None) -> tuple[float, float]:
    low, high = limits or (None, None)
    return _number(low), _number(high)


def _entry(kind: Callable[..., Entry], entry: Mapping[str, Any], **others: Any) -> Entry:
    """A dataclass from the report's members of the same names; `others` are the fields that are not."""
    values = {}
    for field in dataclasses.fields(cast(Any, kind)):
        if field.name not in others and field.name in entry:
            value = entry[field.name]
            values[field.name] = _number(value) if field.type == "float" else value
    return kind(**values, **others)


def _ranked(entry: Mapping[str, Any]) -> RankedEffect:
    parameters = {name: _number(value) for name, value in entry["parameters"].items()}
    intervals = {name: _interval(limits) for name, limits in entry["intervals"].items()}
    return _entry(RankedEffect, entry, parameters=parameters, intervals=intervals)


def _shrinkage(entry: Mapping[str, Any]) -> Shrinkage:
    steps = tuple(_entry(ShrinkStep, step) for step in entry["steps"])
    return _entry(Shrinkage, entry, ci95=_interval(entry["ci95"]), steps=steps)


@dataclasses.dataclass(frozen=True)
class UsedFrames:
    """What was judged of a sequence, where not all of the capture was."""

    sequence: str
    """Name of the sequence."""
    frames: int
    """How many were judged."""
    of: int
    """How many it has."""
    window: tuple[int, int, int, int]
    """(x, y, width, height) of what was judged, in pixels."""


@dataclasses.dataclass(frozen=True)
class Coverage:
    """How far a verdict reaches: nothing is said about what is not covered, least of all by "none"."""

    statistics: int
    """Statistics that were compared."""
    sequences: tuple[str, ...]
    """Names of the sequences that were judged."""
    left_out: tuple[str, ...]
    """Those that were not; the notes say why."""
    effects_not_visible: tuple[str, ...]
    """Effects that cannot show in the sequences that were judged."""
    questions_open: tuple[str, ...]
    """Questions that these sequences leave open."""
    judged: bool = True
    """False: every sequence with light was left out, and the verdict is about dark frames alone."""
    used: tuple[UsedFrames, ...] = ()
    """By sequence that was judged; empty if the whole capture was, but for what was left out."""


@dataclasses.dataclass(frozen=True)
class Calibration:
    """What the simulator was adjusted to before any gap was spoken of."""

    black_level_dn: float
    """Black level."""
    read_noise_dn: float
    """Read noise."""
    light_dn: dict[str, float]
    """Light above black by sequence, as the simulator without effects has it; 0 of dark ones."""


@dataclasses.dataclass(frozen=True)
class ScreenedEffect:
    """What an effect promised before any was fitted."""

    effect: str
    """Its id."""
    share: float
    """Of the squared distance, that as much of its change at a middle strength as fits best would take away; 0 to 1."""
    fitted: bool
    """False: it was put aside."""


@dataclasses.dataclass(frozen=True)
class Quantity:
    """A quantity of a sequence in the units of a data sheet, of the camera's frames and of simulated ones.

    For people to read: the verdict goes by the statistics. NaN is what the frames do not tell. The list with
    definitions: ``docs/method/gap-statistics.md``.
    """

    sequence: str | None
    """Name of the sequence; None: of the dark and flat ones together."""
    quantity: str
    """For example "temporal_noise"."""
    unit: str
    """Of all values: "DN", "px", "%", "1", "DN^2", "DN/electron"."""
    real: float
    """Of the capture."""
    sim: float
    """Mean over simulated captures without effects."""
    sim_deviation: float = math.nan
    """Standard deviation over the simulated captures."""
    sim_with_effects: float = math.nan
    """With the effects found; NaN if there are none."""
    sim_with_effects_deviation: float = math.nan
    """Standard deviation over the simulated captures with the effects."""


class Diagnosis(Handle):
    """What :func:`diagnose` or :func:`compare` found; ``print`` shows a summary.

    It never changes, and any number of threads may read it.

    Attributes:
        verdict: "none" (no gap), "named" (the effects explain it), "ambiguous" (the `equivalents` explain it equally
            well), or "unknown" (a significant part of the gap is explained by no effect).
        detected: True if there is a gap.
        p_value: probability of so large a gap by chance.
        distance: the gap beyond chance, in standard deviations of the baseline, root mean square over the statistics.
        null_95: what chance alone exceeds once in twenty times.
        effects: ids of the effects found, in the order in which they were found.
        probability: of the effects named, among the candidates.
        equivalents: ids of effects that explain the gap equally well.
        ranking: the effects that were weighed, best first.
        screening: what all effects that can show promised before any was fitted, the most promising first; empty
            without a gap and of a comparison.
        where: statistics that differ significantly, worst first.
        shrink: how far the gap shrinks with the effects found.
        advice: which captures would tell the equivalents apart.
        coverage: what was judged, and what could not be.
        calibration: black level, read noise and light that the simulator was adjusted to; None of a comparison, whose
            sets have levels of their own (``report["compare"]``).
        quantities: numbers in a data sheet's units (noise in DN, widths in px, system gain), sequence by sequence,
            of the camera and of the simulator; empty of a comparison, whose sets are brought to one light and noise
            first.
        emva1288: EMVA 1288's numbers of the dark and flat frames alone, as :meth:`Capture.emva1288` gives them; empty
            of a comparison.
        notes: what could not be judged, and why.
        seconds: that the diagnosis took.
    """

    _c_name = "clspDiagnosis"
    _pickle_advice = "its `report` is a plain dict"

    def __init__(self) -> None:
        raise TypeError("a Diagnosis is made by clspeckle.diagnose() or clspeckle.compare()")

    @classmethod
    def _of(cls, pointer: int | None) -> Diagnosis:
        made = cls.__new__(cls)
        made._adopt(pointer)
        made._read()
        return made

    def _read(self) -> None:
        self._json = _library.text_of("clspDiagnosisGetReportJson", self._get())
        summary = _library.fetched(_library.ClspDiagnosisSummary, "clspDiagnosisGetSummary", self._get())
        report = self.report
        gap, cause = report["gap"], report["cause"]
        self.verdict: str = cause["verdict"]
        self.detected: bool = gap["detected"]
        self.p_value = _number(gap["p_value"])
        self.distance = _number(gap["distance"])
        self.null_95 = _number(gap["null_95"])
        self.effects: tuple[str, ...] = tuple(cause["effects"])
        self.probability = _number(cause["probability"])
        self.equivalents: tuple[str, ...] = tuple(cause["equivalent"])
        self.ranking = tuple(_ranked(entry) for entry in cause["ranking"])
        self.screening = tuple(_entry(ScreenedEffect, entry) for entry in cause.get("screening", ()))
        self.where = tuple(_entry(GapPlace, entry, ci95=_interval(entry["ci95"])) for entry in report["where"])
        self.shrink = _shrinkage(report["shrink"])
        self.advice: tuple[str, ...] = tuple(
            f"{entry['capture']} (separates {', '.join(entry['separates'])})" for entry in report["advice"]
        )
        lists = ("sequences", "left_out", "effects_not_visible", "questions_open")
        coverage = report["coverage"]
        used = tuple(
            _entry(UsedFrames, entry, window=tuple(entry[name] for name in ("x", "y", "width", "height")))
            for entry in coverage.get("used", ())
        )
        self.coverage = _entry(Coverage, coverage, used=used, **{name: tuple(coverage[name]) for name in lists})
        calibration = report.get("calibration")
        self.calibration: Calibration | None = None
        if calibration is not None:
            light = {entry["name"]: _number(entry["light_dn"]) for entry in calibration["sequences"]}
            self.calibration = _entry(Calibration, calibration, light_dn=light)
        measured = report.get("measurements", {"quantities": ()})
        self.quantities = tuple(_entry(Quantity, entry) for entry in measured["quantities"])
        self.emva1288: dict[str, Any] = report.get("emva1288", {})
        self.notes: tuple[str, ...] = tuple(report["notes"])
        self.seconds: float = summary.seconds

    @property
    def report(self) -> dict[str, Any]:
        """The whole report, as `clspeckle diagnose --json` writes it; a new dict each time."""
        result: dict[str, Any] = json.loads(self._json)
        return result

    def write(self, path: str | os.PathLike[str]) -> None:
        """Writes the JSON report to a file, which appears, or replaces an older one, only when it is complete."""
        with exclusive(self):
            _library.call("clspDiagnosisWriteReport", self._get(), _check.path(path, "path"))

    def write_html(self, path: str | os.PathLike[str]) -> None:
        """Writes the report for eyes: one HTML file with its pictures and plots, which needs no network."""
        with exclusive(self):
            _library.call("clspDiagnosisWriteHtml", self._get(), _check.path(path, "path"))

    def profile(self) -> Profile:
        """The camera that was found, with the effects of the last model.

        Raises:
            InvalidStateError: of a comparison, whose simulator is not the library's.
        """
        with exclusive(self):
            return Profile._of(create("clspDiagnosisGetProfile", self._get()))

    def _sentence(self) -> str:
        if self.verdict == "none":
            return f"no gap in what could be tested: {', '.join(self.coverage.sequences)} (p = {self.p_value:.2g})"
        named = ", ".join(self.effects)
        if self.verdict == "named":
            return f"the gap is explained by {named} (probability {self.probability:.2f})"
        if self.verdict == "ambiguous":
            return f"the gap is explained equally well by {' or '.join(self.equivalents)}"
        beside = f"; beside it {named} was found" if named else ""
        return f"a significant part of the gap is explained by no effect{beside}"

    def __str__(self) -> str:
        lines = [f"{self.verdict}: {self._sentence()}"]
        if not self.coverage.judged:
            lines.insert(0, "nothing could be judged of light; about dark frames alone:")
        for what, names in (
            ("not judged", self.coverage.left_out),
            ("cannot show here", self.coverage.effects_not_visible),
            ("left open", self.coverage.questions_open),
        ):
            if names and self.verdict == "none":
                lines.append(f"{what}: {', '.join(names)}")
        if self.detected:
            lines.append(f"gap: {self.distance:.3g} (95 % of chance below {self.null_95:.3g}), p = {self.p_value:.2g}")
        if self.where:
            lines.append("where:")
        for place in self.where[:8]:
            unit = "" if place.unit == "1" else f" {place.unit}"
            region = "" if place.region == "all" else f" in {place.region}"
            lines.append(
                f"  {place.stage}: {place.statistic}{region} of {place.sequence}: real {place.real:.4g}{unit}, sim "
                f"{place.sim:.4g}{unit}, z = {place.z:+.1f}"
            )
        found = [ranked for ranked in self.ranking if ranked.intervals]
        if found:
            lines.append("effects:")
        lines += [f"  {ranked.effect}: {_values(ranked)}" for ranked in found]
        if self.shrink.steps:
            on = "held-out frames" if self.shrink.held_out else "the frames of the fit"
            low, high = self.shrink.ci95
            lines.append(
                f"shrinks: {self.shrink.distance_before:.3g} to {self.shrink.distance_after:.3g}, "
                f"{100 * self.shrink.fraction:.0f} % ({100 * low:.0f} to {100 * high:.0f} %) on {on}"
            )
            rest = "a gap remains" if self.shrink.residual_detected else "nothing significant remains"
            lines.append(f"residual: {rest} (p = {self.shrink.residual_p_value:.2g})")
        lines += [f"advice: {advice}" for advice in self.advice]
        lines += [f"note: {note}" for note in self.notes]
        return "\n".join(lines)

    def _state(self) -> str:
        if self.closed:
            return "closed"
        named = self.equivalents if self.verdict == "ambiguous" else self.effects
        found = {ranked.effect: ranked for ranked in self.ranking if ranked.intervals}
        texts = [f"{effect} ({_values(found[effect])})" if effect in found else effect for effect in named]
        return f"{self.verdict}: {'; '.join(texts)}" if texts else self.verdict

    def _repr_html_(self) -> str:
        """What a notebook shows: verdict, scenes, effects with their parameters, the worst statistics."""
        parts = [f"<p><b>{html.escape(self.verdict)}</b>: {html.escape(self._sentence())}</p>"]
        if not self.coverage.judged:
            parts.append("<p>Nothing could be judged of light; this is about dark frames alone.</p>")
        rungs = self.report["cause"].get("rungs", [])
        if rungs:
            rows = [(rung["rung"], rung["verdict"], ", ".join(rung["effects"])) for rung in rungs]
            parts.append(_show.html_table(("scene", "verdict", "effects"), rows))
        found = [(ranked.effect, _values(ranked)) for ranked in self.ranking if ranked.intervals]
        if found:
            parts.append(_show.html_table(("effect", "parameters, 95 % intervals"), found))
        worst = [
            (
                place.sequence,
                place.statistic,
                _show.rounded(place.real, _deviation(place)),
                _show.rounded(place.sim, _deviation(place)),
                place.unit,
                f"{place.z:+.1f}",
            )
            for place in self.where[:_WORST]
        ]
        if worst:
            parts.append(_show.html_table(("sequence", "statistic", "real", "simulated", "unit", "z"), worst))
        return "\n".join(parts)

    def plot(self) -> Any:
        """The worst statistics' z without and with the effects found, and how the distance shrinks, effect by effect.

        Returns:
            a matplotlib.figure.Figure, which a notebook shows and ``savefig`` writes.

        Raises:
            ImportError: matplotlib is not installed.
        """
        shrink = self.shrink
        before = shrink.distance_before if shrink.steps else self.distance
        return _show.gap_figure(self.where[:_WORST], shrink.steps, before, f"{self.verdict}: {self._sentence()}")

    def table(self, which: str = "where") -> Any:
        """A list of the result as a pandas.DataFrame, a column for each member.

        Args:
            which: "where", "ranking", "screening", "quantities" or "steps" (of :attr:`shrink`). Parameters of the
                ranking are columns `effect.parameter`, with `.low` and `.high` of those that have an interval.

        Raises:
            ImportError: pandas is not installed.
            InvalidArgumentError: there is no such list.
        """
        kinds = {
            "where": (GapPlace, self.where),
            "ranking": (RankedEffect, self.ranking),
            "screening": (ScreenedEffect, self.screening),
            "quantities": (Quantity, self.quantities),
            "steps": (ShrinkStep, self.shrink.steps),
        }
        if which not in kinds:
            raise errors.InvalidArgumentError(f"which is {which!r}, expected {_check.one_of(tuple(kinds))}")
        kind, entries = kinds[which]
        columns: dict[str, list[Any]] = {}
        for field in dataclasses.fields(cast(Any, kind)):
            values = [getattr(entry, field.name) for entry in entries]
            if field.name == "ci95":
                columns["low_95"], columns["high_95"] = ([limits[k] for limits in values] for k in (0, 1))
            elif field.name not in ("parameters", "intervals"):
                columns[field.name] = values
        if which == "ranking":
            for row, ranked in enumerate(self.ranking):
                for name, value in ranked.parameters.items():
                    cells = {"": value, **dict(zip((".low", ".high"), ranked.intervals.get(name, ())))}
                    for suffix, cell in cells.items():
                        column = columns.setdefault(f"{ranked.effect}.{name}{suffix}", [math.nan] * len(self.ranking))
                        column[row] = cell
        return _show.data_frame(columns, "table()")


def _values(ranked: RankedEffect) -> str:
    """Fitted parameters with their 95 % intervals, in as many digits as these leave."""
    texts = []
    for name, value in ranked.parameters.items():
        low, high = ranked.intervals.get(name, (math.nan, math.nan))
        value_text, low_text, high_text = (_show.rounded(number, (high - low) / 4) for number in (value, low, high))
        texts.append(f"{name} = {value_text} ({low_text} to {high_text})")
    return ", ".join(texts)


def _deviation(place: GapPlace) -> float:
    """What z counts in."""
    return abs(place.real - place.sim) / abs(place.z) if place.z else math.nan


def _range_of(given: Sequence[float], name: str) -> tuple[float, float, float, float]:
    """Weak, strong, minimum, maximum."""
    try:
        numbers = [_check.real(value, name) for value in given]
    except TypeError:
        raise TypeError(
            f"{name} must be (weak, strong) or (weak, strong, minimum, maximum), got {_check.kind(given)}"
        ) from None
    if isinstance(given, (str, bytes)) or len(numbers) not in (2, 4):
        raise TypeError(f"{name} must be (weak, strong) or (weak, strong, minimum, maximum), got {_check.kind(given)}")
    if len(numbers) == 4:
        return numbers[0], numbers[1], numbers[2], numbers[3]
    low, high = min(numbers), max(numbers)
    span = high - low or abs(high)
    minimum, maximum = low - 2 * span, high + 2 * span
    if low >= 0:
        minimum = max(0.0, minimum)
    if high <= 0:
        maximum = min(0.0, maximum)
    return numbers[0], numbers[1], minimum, maximum


def hypothesis_struct(hypothesis: Hypothesis) -> Any:
    """Its C struct, without a function of Python's; what it points to lives as long as it does."""
    name = hypothesis.id
    names = list(hypothesis.parameters)
    parameters = (_library.ClspEffectParameter * max(1, len(names)))()
    for parameter, key in zip(parameters, names):
        where = f"parameters[{key!r}] of the hypothesis {name!r}"
        parameter.name = _fitting(key, 32, where)
        parameter.unit = _fitting(hypothesis.units.get(key, "1"), 16, f"the unit of {where}")
        numbers = _range_of(hypothesis.parameters[key], where)
        parameter.weak, parameter.strong, parameter.minimum, parameter.maximum = numbers
    struct = _library.initialized(_library.ClspHypothesis)
    struct.point = _check.choice(hypothesis.point, f"point of the hypothesis {name!r}", _POINTS)
    for member in ("id", "stage", "summary"):
        setattr(struct, member, _check.no_null(getattr(hypothesis, member).encode(), member))
    struct.parameters = parameters
    struct.parameter_count = len(names)
    if isinstance(hypothesis.apply, str):
        what = f"the OpenCL source of the hypothesis {name!r}"
        try:
            struct.opencl_source = _check.no_null(hypothesis.apply.encode(), what)
        except UnicodeEncodeError as error:
            raise errors.InvalidArgumentError(f"{what} is no text that UTF-8 can hold: {error}") from None
    return struct


def hypothesis_values(hypothesis: Hypothesis, given: Mapping[str, Any]) -> dict[str, float]:
    """All its parameters by name, in order; those that are missing or None take the middle between weak and strong."""
    for key in given:
        if key not in hypothesis.parameters:
            names = list(hypothesis.parameters)
            hint = _check.nearest(key, names) or f"; it has {', '.join(names)}"
            raise TypeError(f"the effect {hypothesis.id} has no parameter {key!r}{hint}")
    result = {}
    for key, numbers in hypothesis.parameters.items():
        weak, strong, *_ = _range_of(numbers, f"parameters[{key!r}] of the hypothesis {hypothesis.id!r}")
        result[key] = 0.5 * (weak + strong) if given.get(key) is None else _check.real(given[key], key)
    return result


class _DiagnosisCall(Call):
    """One call of clspDiagnose() or clspCompare()."""

    def hypothesis(self, hypothesis: Hypothesis) -> _library.ClspHypothesis:
        if not isinstance(hypothesis, Hypothesis):
            raise TypeError(f"hypotheses must be clspeckle.Hypothesis objects, got {_check.kind(hypothesis)}")
        struct: _library.ClspHypothesis = self.keep(hypothesis_struct(hypothesis))
        if not isinstance(hypothesis.apply, str):
            function = self._applier(hypothesis, hypothesis.apply, list(hypothesis.parameters))
            struct.apply = self.keep(_library.HYPOTHESIS_FUNCTION(function))
        return struct

    def _applier(
        self, hypothesis: Hypothesis, function: Callable[..., Any], names: list[str]
    ) -> Callable[[int | None, Any], int]:
        def apply(_data: int | None, pointer: Any) -> int:
            try:
                if self.interrupted:
                    return 1
                frame = pointer.contents
                shape = (frame.height, frame.width)
                view = np.ctypeslib.as_array(frame.pixels, shape=shape)
                pixels = view.copy()  # whoever keeps it keeps memory of Python's
                result = function(
                    pixels,
                    sequence=_library.text(frame.sequence_name),
                    frame_index=frame.frame_index,
                    seed=frame.seed,
                    **{name: frame.values[i] for i, name in enumerate(names)},
                )
                what = f"what the hypothesis {hypothesis.id!r} returned"
                view[...] = pixels if result is None else _check.float_plane(result, what, shape)
                return 0
            except BaseException as error:
                self.thrown = self.thrown or error
                return 1

        return apply


def _fitting(text: Any, size: int, what: str) -> bytes:
    if not isinstance(text, str):
        raise TypeError(f"{what} must be text, got {_check.kind(text)}")
    encoded = _check.no_null(text.encode(), what)
    if not 0 < len(encoded) < size:
        raise errors.InvalidArgumentError(f"{what} is {text!r}, expected 1 to {size - 1} bytes")
    return encoded


class _Bar:
    """A progress bar on standard error."""

    def __init__(self) -> None:
        self.drawn = -math.inf
        self.full = 0
        self.width = 0

    def __call__(self, what: str, fraction: float) -> None:
        now, full = time.monotonic(), int(30 * fraction)
        if now - self.drawn < 0.1 and full == self.full:
            return
        self.drawn, self.full = now, full
        line = f"[{'=' * full}{' ' * (30 - full)}] {100 * fraction:3.0f} % {what}"
        sys.stderr.write("\r" + line.ljust(self.width))
        sys.stderr.flush()
        self.width = len(line)

    def clear(self) -> None:
        if self.width:
            sys.stderr.write("\r" + " " * self.width + "\r")
            sys.stderr.flush()


def _capture(
    capture: CaptureLike,
    camera: Mapping[str, Any] | None,
    dots_px: npt.ArrayLike | None,
    dots_sigma_px: float | None,
    progress: bool | Progress | None,
) -> Capture:
    if isinstance(capture, Mapping):
        return Capture.from_arrays(capture, camera=camera, dots_px=dots_px, dots_sigma_px=dots_sigma_px)
    if camera is not None or dots_px is not None or dots_sigma_px is not None:
        raise TypeError(
            "camera, dots_px and dots_sigma_px belong to a dict of arrays; a Capture or a folder has its own"
        )
    if isinstance(capture, Capture):
        return capture
    if isinstance(capture, (str, os.PathLike)):
        bar = _Bar() if progress is True else None
        try:
            return Capture.open(capture, progress=bar)
        finally:
            if bar is not None:
                bar.clear()
    raise TypeError(
        f"capture must be a Capture, the folder of one, or a dict of name to codes, got {_check.kind(capture)}"
    )


def _set_window(desc: _library.ClspDiagnoseDesc, window: str | Sequence[int] | None) -> None:
    if window is None:
        return
    if isinstance(window, str):
        desc.window = _check.choice(window, "window", {"whole": _library.CLSP_WINDOW_WHOLE})
        return
    try:
        numbers = [_check.integer(value, "window") for value in window]
    except TypeError:
        numbers = []
    if len(numbers) != 4:
        raise TypeError(f'window must be (x, y, width, height) in pixels or "whole", got {_check.kind(window)}')
    desc.window = _library.CLSP_WINDOW_GIVEN
    desc.window_x, desc.window_y, desc.window_width, desc.window_height = numbers


def _ids(without: Iterable[str]) -> list[bytes]:
    if isinstance(without, (str, bytes)):
        raise TypeError(f"without must be a list of ids, got {_check.kind(without)}; write [{without!r}]")
    result = []
    for value in without:
        if not isinstance(value, str):
            raise TypeError(f"without must be a list of ids of effects, got {_check.kind(value)} in it")
        result.append(_check.no_null(value.encode(), "without"))
    return result


def diagnose(
    capture: CaptureLike,
    *,
    seed: int | None = None,
    without: Iterable[str] = (),
    hypotheses: Iterable[Hypothesis] = (),
    level: float | None = None,
    null_replicates: int | None = None,
    max_effects: int | None = None,
    threads: int | None = None,
    evidence: bool | None = None,
    window: str | Sequence[int] | None = None,
    frames: int | None = None,
    tolerances: str | os.PathLike[str] | None = None,
    progress: bool | Progress | None = None,
    camera: Mapping[str, Any] | None = None,
    dots_px: npt.ArrayLike | None = None,
    dots_sigma_px: float | None = None,
    context: Context | None = None,
) -> Diagnosis:
    """Compares a real capture with the simulator: is there a gap, where, what causes it, how far does it shrink.

    Blocks: with six sequences of 40 frames on two processor cores from some seconds to a minute, by how many
    effects there are; Ctrl-C cancels. The same seed
    gives the same report.

    Args:
        capture: a :class:`Capture`, the folder of a capture set, or a dict of name to codes as for
            :meth:`Capture.from_arrays`.
        seed: of the simulated captures; None: 0.
        without: ids of effects that are no candidates.
        hypotheses: effects of one's own, which join the catalogue's.
        level: probability of seeing a gap where there is none, 1e-6 to 0.5; None: 0.02.
        null_replicates: simulated captures without effects, 12 to 100000; None: 48.
        max_effects: effects in one explanation at most, 1 to 64, beside such as are too slight to be named; None: 16.
        threads: of the host, 1 to 1024; None: as many as the machine has. The report does not depend on it.
        evidence: False: no pictures and curves are collected for :meth:`Diagnosis.write_html`; None: True.
        window: the part of the image that is judged, (x, y, width, height) with even x and y, or "whole"; None: all of
            a small capture, a strip through the optical axis of a large one.
        frames: of each sequence at most, from the middle of each half; 0: all; None: what takes minutes.
        tolerances: a JSON file with what is accepted of the simulator's error; ``report["acceptance"]`` says whether it
            is (``docs/reference/gap-report.md``).
        progress: True: a bar on standard error; or a function of (what is being done, fraction done), which cancels by
            returning False. It is called often, on this thread.
        camera, dots_px, dots_sigma_px: of a dict of codes, as for :meth:`Capture.from_arrays`.
        context: whose device simulates; None for :func:`default_context`.

    Raises:
        CancelledError: the progress function returned False.
        InvalidDataError: the capture cannot be judged, or a hypothesis made pixels that are not finite.

    What a hypothesis or the progress function raises ends the diagnosis and is raised here.
    """
    given = {name: value for name, value in locals().items() if name in _OPTIONS}
    opened = _capture(capture, camera, dots_px, dots_sigma_px, progress)
    try:
        return _run("clspDiagnose", [opened], hypotheses=hypotheses, tolerances=tolerances, **given)
    finally:
        if opened is not capture:
            opened.close()


def compare(
    real: CaptureLike,
    sim: CaptureLike,
    *,
    profile: Profile | None = None,
    seed: int | None = None,
    without: Iterable[str] = (),
    level: float | None = None,
    null_replicates: int | None = None,
    max_effects: int | None = None,
    threads: int | None = None,
    evidence: bool | None = None,
    window: str | Sequence[int] | None = None,
    frames: int | None = None,
    progress: bool | Progress | None = None,
    camera: Mapping[str, Any] | None = None,
    dots_px: npt.ArrayLike | None = None,
    dots_sigma_px: float | None = None,
    context: Context | None = None,
) -> Diagnosis:
    """Compares a real capture with frames of any simulator: where they differ, and which catalogued effects, put on the
    simulated frames as far as finished frames allow, would close how much.

    Sequences are paired by name where scene and motion agree, else by scene and motion. The result is that of
    :func:`diagnose`, with `sim` of its statistics from the simulated capture; parameters are what its frames lack.
    ``report["compare"]`` has the pairs, the levels, the read noise, and the effects that cannot be put on finished
    frames. The method: ``docs/guide/gap-compare.md``. Blocks; Ctrl-C cancels. The same seed gives the same report.

    Args:
        real: what the camera recorded: a :class:`Capture`, the folder of a capture set, or a dict of name to codes.
        sim: what the simulator drew of the same scenes, likewise; frames of the same size and bits.
        profile: the camera that both sets are of: its effects make both scatter, which is no gap; None: one without
            effects.
        seed, without, level, null_replicates, max_effects, threads, evidence, window, frames, progress, context: as
            for :func:`diagnose`; window and frames are the same in both sets.
        camera, dots_px, dots_sigma_px: of dicts of codes, as for :meth:`Capture.from_arrays`; the same for both.

    Raises:
        CancelledError: the progress function returned False.
        InvalidArgumentError: the captures have no pair of sequences, or frames of different size or bits.
    """
    given = {name: value for name, value in locals().items() if name in _OPTIONS}
    if camera is not None and not (isinstance(real, Mapping) or isinstance(sim, Mapping)):
        raise TypeError("camera belongs to dicts of arrays; a Capture or a folder has its own")
    opened: list[Capture] = []
    try:
        for capture in (real, sim):
            of_arrays = (camera, dots_px, dots_sigma_px) if isinstance(capture, Mapping) else (None, None, None)
            opened.append(_capture(capture, *of_arrays, progress))
        return _run("clspCompare", opened, hypotheses=(), profile=profile, **given)
    finally:
        for capture, argument in zip(opened, (real, sim)):
            if capture is not argument:
                capture.close()


_OPTIONS = (
    "without",
    "progress",
    "context",
    "seed",
    "level",
    "null_replicates",
    "max_effects",
    "threads",
    "evidence",
    "window",
    "frames",
)


def _run(
    function: str,
    captures: list[Capture],
    *,
    hypotheses: Iterable[Hypothesis],
    without: Iterable[str],
    window: str | Sequence[int] | None,
    progress: bool | Progress | None,
    context: Context | None,
    profile: Profile | None = None,
    tolerances: str | os.PathLike[str] | None = None,
    **numbers: Any,
) -> Diagnosis:
    """clspDiagnose() or clspCompare()."""
    call = _DiagnosisCall()
    desc = _ARGUMENTS.describe(numbers)
    _set_window(desc, window)
    if profile is not None:
        if not isinstance(profile, Profile):
            raise TypeError(f"profile must be a clspeckle.Profile, got {_check.kind(profile)}")
        desc.profile = profile._get()
    if tolerances is not None:
        desc.tolerance_file = _check.path(tolerances, "tolerances")
    level = numbers["level"]
    if level is not None and not _LEAST_LEVEL <= desc.level <= _MOST_LEVEL:
        raise _check.range_error("level", level, f"{_LEAST_LEVEL:g} to {_MOST_LEVEL:g}")
    for name, (least, most) in _RANGES.items():
        number = numbers[name]
        if number is not None and not least <= number <= most:
            raise _check.range_error(name, number, f"{least} to {most}")
    ids = _ids(without)
    desc.without = call.keep((ctypes.c_char_p * max(1, len(ids)))(*ids))
    desc.without_count = len(ids)
    structs = [call.hypothesis(hypothesis) for hypothesis in hypotheses]
    pointers = [ctypes.pointer(struct) for struct in structs]
    desc.hypotheses = call.keep((ctypes.POINTER(_library.ClspHypothesis) * max(1, len(pointers)))(*pointers))
    desc.hypothesis_count = len(structs)
    if progress is not None and not isinstance(progress, bool) and not callable(progress):
        raise TypeError(f"progress must be True, False, None or a function, got {_check.kind(progress)}")
    bar = _Bar() if progress is True else None
    report: Progress | None = progress if callable(progress) else bar
    desc.progress = call.progress(report)
    device = resolve_context(context)
    handles = [capture._get() for capture in captures]
    try:
        with call.running():
            return Diagnosis._of(create(function, device._get(), *handles, ctypes.byref(desc)))
    finally:
        if bar is not None:
            bar.clear()

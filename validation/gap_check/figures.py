"""Wilson's interval, and the figures that the score is made of."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

NORMAL_975 = 1.959963984540054


def wilson(successes: int, count: int) -> tuple[float, float]:
    """Wilson's 95 % interval of a proportion (J. Am. Stat. Assoc. 22 (1927) 209); (0, 1) of nothing."""
    if count == 0:
        return 0.0, 1.0
    z2 = NORMAL_975**2
    share = successes / count
    centre = (share + z2 / (2 * count)) / (1 + z2 / count)
    half = NORMAL_975 / (1 + z2 / count) * np.sqrt(share * (1 - share) / count + z2 / (4 * count**2))
    return float(max(centre - half, 0.0)), float(min(centre + half, 1.0))


@dataclass(frozen=True)
class Figure:
    """One line of the table: a proportion with Wilson's interval, or a mean or median with none."""

    id: str
    text: str
    on: str  # the kind of sets, as the protocol letters them: a ... e
    value: float | None
    count: int  # of sets (or effects, or parameters: `unit`)
    successes: int | None = None
    low: float | None = None
    high: float | None = None
    unit: str = "sets"
    target: tuple[float, float] | None = None  # between which the value is to lie

    @property
    def met(self) -> bool | None:
        if self.target is None or self.value is None:
            return None
        return self.target[0] <= self.value <= self.target[1]


def proportion(
    id: str,
    text: str,
    on: str,
    hits: list[bool],
    target: tuple[float, float] | None = None,
    unit: str = "sets",
) -> Figure:
    """The share of hits."""
    successes, count = sum(hits), len(hits)
    low, high = wilson(successes, count)
    value = successes / count if count else None
    return Figure(id, text, on, value, count, successes, low if count else None, high if count else None, unit, target)


def quantity(
    id: str,
    text: str,
    on: str,
    values: list[float],
    median: bool = False,
    unit: str = "sets",
    target: tuple[float, float] | None = None,
) -> Figure:
    """The mean, or the median, of values."""
    value = float(np.median(values) if median else np.mean(values)) if values else None
    return Figure(id, text, on, value, len(values), unit=unit, target=target)

"""Tables, plots and HTML of results, for notebooks. Their packages are imported when they are asked for."""

from __future__ import annotations

import html
import importlib
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any


def optional(package: str, what: str) -> Any:
    """A package that clspeckle does not require.

    Raises:
        ImportError: it is not installed, or broken; with what to do.
    """
    try:
        return importlib.import_module(package)
    except ImportError as error:
        name = package.partition(".")[0]
        raise ImportError(
            f"{what} needs {name}, which cannot be imported ({error}); install it: pip install {name}"
        ) from error


def data_frame(columns: Mapping[str, Any], what: str) -> Any:
    """A pandas.DataFrame of columns of one length."""
    return optional("pandas", what).DataFrame(dict(columns))


def rounded(value: float, deviation: float) -> str:
    """As many digits as the standard deviation leaves: its second digit is the last one; four without one."""
    if not (math.isfinite(value) and math.isfinite(deviation) and deviation > 0):
        return f"{value:.4g}"
    decimals = 1 - math.floor(math.log10(deviation))
    nearest = round(value, decimals)
    if decimals <= 6:
        return f"{nearest:.{max(decimals, 0)}f}"
    digits = math.floor(math.log10(abs(nearest))) + decimals + 1 if nearest else 1
    return f"{nearest:.{min(max(digits, 1), 15)}g}"


def html_table(head: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Cells are escaped."""
    lines = ["<tr>" + "".join(f"<th>{html.escape(cell)}</th>" for cell in head) + "</tr>"]
    lines += ["<tr>" + "".join(f"<td>{html.escape(str(cell))}</td>" for cell in row) + "</tr>" for row in rows]
    return "<table>" + "".join(lines) + "</table>"


def gap_figure(where: Sequence[Any], steps: Sequence[Any], distance_before: float, title: str) -> Any:
    """A matplotlib Figure: the worst statistics' z without and with the effects, and the distance effect by effect."""
    figure = optional("matplotlib.figure", "plot()").Figure(
        figsize=(10, 1.6 + 0.28 * max(4, len(where))), layout="tight"
    )
    left, right = figure.subplots(1, 2, gridspec_kw={"width_ratios": (3, 2)})
    figure.suptitle(title)
    places = range(len(where))
    left.barh([k - 0.2 for k in places], [place.z for place in where], 0.4, label="simulator", color="#D55E00")
    if steps:
        left.barh(
            [k + 0.2 for k in places], [place.z_after for place in where], 0.4, label="with effects", color="#0072B2"
        )
        left.legend()
    left.set_yticks(list(places), [f"{place.sequence}: {place.statistic}" for place in where])
    left.invert_yaxis()
    left.axvline(0, color="0.5", linewidth=0.8)
    left.set_xlabel("z, standard deviations of chance")
    if not where:
        left.text(0.5, 0.5, "no statistic differs", ha="center", va="center", transform=left.transAxes)
    names = ["simulator", *(f"+ {step.effect}" for step in steps)]
    right.bar(range(len(names)), [distance_before, *(step.distance_after for step in steps)], color="#0072B2")
    right.set_xticks(range(len(names)), names, rotation=30, ha="right")
    right.set_ylabel("distance left")
    return figure

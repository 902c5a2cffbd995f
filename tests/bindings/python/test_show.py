"""What a notebook shows of results: repr, HTML, figures, tables; and what is said where their packages are missing."""

from __future__ import annotations

import html.parser
import math
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_diagnosis import HYPOTHESIS, QUICK, codes

import clspeckle
from clspeckle import _show, errors


@pytest.fixture(scope="module")
def found(context: clspeckle.Context) -> clspeckle.Diagnosis:
    """Of a camera whose gap has a cause among the hypotheses."""
    return clspeckle.diagnose(codes(20), hypotheses=[HYPOTHESIS], context=context, **QUICK)


@pytest.fixture(scope="module")
def dots(context: clspeckle.Context) -> clspeckle.DepthResult:
    image = clspeckle.Dots((40, 60), [(20.0, 20.0), (40.0, 20.5)], sigma_px=1.3, scale=100, context=context).render()
    return clspeckle.Depth((40, 60), dot_sigma_px=1.3, context=context).measure(image)


class Cells(html.parser.HTMLParser):
    """Texts of the cells; elements must nest."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.cells: list[str] = []
        self.feed(text)
        self.close()
        assert not self.open

    def handle_starttag(self, tag: str, attrs: Any) -> None:
        self.open.append(tag)
        if tag in ("td", "th"):
            self.cells.append("")

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self.open and self.open[-1] in ("td", "th"):
            self.cells[-1] += data


def test_repr_names_the_effects_and_their_parameters(found: clspeckle.Diagnosis) -> None:
    slope = found.ranking[0].parameters["slope"]
    assert repr(found).startswith("<clspeckle.Diagnosis named: ramp (slope = 0.06")
    assert f"{slope:.3f}" in repr(found)
    assert " to " in repr(found)


def test_html_has_the_verdict_the_effects_and_the_worst_statistics(found: clspeckle.Diagnosis) -> None:
    text = found._repr_html_()
    cells = Cells(text).cells
    assert text.startswith("<p><b>named</b>: ")
    assert "ramp" in cells
    assert any(cell.startswith("slope = 0.06") for cell in cells)
    assert found.where[0].statistic in cells
    assert f"{found.where[0].z:+.1f}" in cells
    for rung in found.report["cause"].get("rungs", []):
        assert rung["rung"] in cells


def test_html_escapes_names() -> None:
    assert "<img" not in _show.html_table(("<img src=x>",), [("<b>&",)])
    assert Cells(_show.html_table(("a",), [("<b>&",)])).cells == ["a", "<b>&"]


def test_plot_shows_each_statistic_and_each_effect(found: clspeckle.Diagnosis, tmp_path: Path) -> None:
    figure = found.plot()
    left, right = figure.axes
    shown = found.where[:12]
    assert [label.get_text() for label in left.get_yticklabels()] == [f"{p.sequence}: {p.statistic}" for p in shown]
    lengths = [bar.get_width() for bar in left.patches]
    np.testing.assert_allclose(lengths, [p.z for p in shown] + [p.z_after for p in shown])
    heights = [bar.get_height() for bar in right.patches]
    np.testing.assert_allclose(heights, [found.shrink.distance_before, found.shrink.steps[0].distance_after])
    figure.savefig(tmp_path / "found.png")
    assert (tmp_path / "found.png").stat().st_size > 5000


def test_plot_without_a_gap(context: clspeckle.Context) -> None:
    same = clspeckle.diagnose(codes(0), context=context, **QUICK)
    assert same.verdict == "none"
    assert repr(same) == "<clspeckle.Diagnosis none>"
    assert len(same.plot().axes) == 2
    Cells(same._repr_html_())


@pytest.mark.parametrize("which", ["where", "ranking", "screening", "quantities", "steps"])
def test_tables_have_a_row_for_each_entry(found: clspeckle.Diagnosis, which: str) -> None:
    entries = found.shrink.steps if which == "steps" else getattr(found, which)
    frame = found.table(which)
    assert len(frame) == len(entries) > 0
    for name in set(frame.columns) & set(dir(entries[0])):
        for given, kept in zip(frame[name], entries):
            value = getattr(kept, name)
            assert given == value or (isinstance(value, float) and math.isnan(value)) or value is None


def test_the_ranking_has_columns_of_parameters(found: clspeckle.Diagnosis) -> None:
    frame = found.table("ranking")
    first = found.ranking[0]
    assert frame["ramp.slope"][0] == first.parameters["slope"]
    assert (frame["ramp.slope.low"][0], frame["ramp.slope.high"][0]) == first.intervals["slope"]


def test_dots_as_a_table(dots: clspeckle.DepthResult) -> None:
    frame = dots.table()
    assert len(frame) == len(dots.dots) == 2
    np.testing.assert_array_equal(frame["x_px"], dots.dots["x_px"])
    np.testing.assert_array_equal(frame["covariance_px2_2"], dots.dots["covariance_px2"][:, 2])
    assert set(frame["reason_text"]) <= set(dots.reasons())


def test_what_is_no_list_is_refused(found: clspeckle.Diagnosis) -> None:
    with pytest.raises(errors.InvalidArgumentError, match="which is 'wher', expected"):
        found.table("wher")


def test_missing_packages_are_named(
    found: clspeckle.Diagnosis, dots: clspeckle.DepthResult, monkeypatch: pytest.MonkeyPatch
) -> None:
    for package in ("matplotlib", "matplotlib.figure", "pandas"):
        monkeypatch.setitem(sys.modules, package, None)
    for call, package in ((found.plot, "matplotlib"), (found.table, "pandas"), (dots.table, "pandas")):
        with pytest.raises(ImportError, match=f"needs {package}, .* pip install {package}"):
            call()


@pytest.mark.parametrize(
    ("value", "deviation", "text"),
    [
        (0.066612, 0.00123, "0.0666"),
        (1234.5, 87.0, "1234"),
        (1264.5, 870.0, "1260"),
        (2.9e-6, 1.2e-8, "2.9e-06"),
        (0.001, 2.0, "0.0"),
        (5.0, math.nan, "5"),
        (5.0, 0.0, "5"),
        (math.nan, 1.0, "nan"),
    ],
)
def test_digits_are_those_of_the_uncertainty(value: float, deviation: float, text: str) -> None:
    assert _show.rounded(value, deviation) == text

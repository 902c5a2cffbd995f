"""The report on a dark screen, on a phone and on paper, as a browser shows it."""

from __future__ import annotations

import os
import re
import subprocess
from pathlib import Path

import browser
import pytest

pytestmark = browser.needed

COLORS = """
var style = window.getComputedStyle(document.body);
var panel = window.getComputedStyle(document.querySelector("figcaption"));
return [style.backgroundColor, style.color, panel.color];
"""
FOLDED = """
var closed = function () { return document.querySelectorAll("details:not([open])").length; }, before = closed();
window.dispatchEvent(new window.Event("beforeprint"));
return [before, closed()];
"""
# Wider than the screen: what neither scrolls by itself nor lies in something that does.
WIDTH = "return [document.documentElement.scrollWidth, window.innerWidth];"
FIGURES = """
return [document.querySelectorAll('script[type="application/json"]').length,
        document.querySelectorAll(".plot svg").length, document.querySelectorAll(".failed").length];
"""


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("reports")
    subprocess.run([Path(os.environ["CLSPECKLE_BIN"]) / "gap_report_samples", folder], check=True, capture_output=True)
    return folder / "named.html"


def luminance(color: str) -> float:
    """Relative, as WCAG 2 defines it."""
    parts = [int(part) / 255 for part in re.findall(r"\d+", color)[:3]]
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in parts]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


@pytest.mark.parametrize("dark", [False, True])
def test_browser_screen_has_its_colors(dark: bool, report: Path, tmp_path: Path) -> None:
    options = ["--force-dark-mode"] if dark else []
    ground, *inks = (luminance(c) for c in browser.ask(report, COLORS, tmp_path, *options))
    assert (ground < 0.05) if dark else (ground > 0.95)
    for ink in inks:
        contrast = (max(ground, ink) + 0.05) / (min(ground, ink) + 0.05)
        assert contrast >= 4.5, "WCAG 2, level AA"


def test_browser_paper_unfolds(report: Path, tmp_path: Path) -> None:
    before, after = browser.ask(report, FOLDED, tmp_path)
    assert before > 3
    assert after == 0
    kept = tmp_path / "folded.html"
    kept.write_text(report.read_text().replace('"beforeprint"', '"never"'))
    pages = [len(re.findall(rb"/Type\s*/Page\b", browser.pdf(page, tmp_path))) for page in (report, kept)]
    assert pages[0] > pages[1] >= 1


@pytest.mark.parametrize("width", [390, 1280])
def test_browser_fits_the_screen(width: int, report: Path, tmp_path: Path) -> None:
    wide, screen = browser.ask(report, WIDTH, tmp_path, width=width)
    assert screen == width
    assert wide <= width


def test_browser_draws_every_figure(report: Path, tmp_path: Path) -> None:
    wanted, drawn, failed = browser.ask(report, FIGURES, tmp_path)
    assert wanted == drawn > 3
    assert failed == 0

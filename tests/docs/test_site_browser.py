"""Pages of the site on a desk and on a phone, as a browser shows them: nothing is wider than the screen, equations are
drawn."""

from __future__ import annotations

from pathlib import Path

import browser
import pytest

pytestmark = browser.needed

PAGES = ("index", "tutorials/engine", "guide/captures", "reference/configuration", "results/performance")
WIDTH = "return [document.documentElement.scrollWidth, window.innerWidth];"
EQUATIONS = """
return [document.querySelectorAll(".math").length, document.querySelectorAll(".math mjx-container").length,
        document.querySelectorAll("mjx-merror, [data-mjx-error]").length, document.documentElement.scrollWidth];
"""


@pytest.mark.parametrize("width", [390, 1280])
@pytest.mark.parametrize("page", PAGES)
def test_browser_fits_the_screen(page: str, width: int, site: Path, tmp_path: Path) -> None:
    wide, screen = browser.ask(site / f"{page}.html", WIDTH, tmp_path, width=width)
    assert screen == width
    assert wide <= width


@pytest.mark.parametrize("page", sorted(p.stem for p in (browser.ROOT / "docs" / "method").glob("*.md")))
def test_browser_draws_the_equations(page: str, site: Path, tmp_path: Path) -> None:
    marked, drawn, wrong, wide = browser.ask(site / "method" / f"{page}.html", EQUATIONS, tmp_path, width=390)
    assert marked == drawn > 0
    assert wrong == 0
    assert wide <= 390

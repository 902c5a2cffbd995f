"""Pages of the method: equations, figures, and of each source authors, year, title and DOI, where it has one."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGES = sorted((ROOT / "docs" / "method").glob("*.md"))
# Works that their publishers gave no DOI, or one that leads nowhere.
WITHOUT_DOI = (
    "EMVA Standard 1288",
    "Real-time statistical simulation of dynamic laser speckle",
    "speckle_Memory-effect_range",
    "Decentering distortion of lenses",
    "A practical algorithm for the determination of phase",
    "Introduction to Fourier Optics",
    "A simple sequentially rejective multiple test procedure",
    "Estimation with quadratic loss",
)
# A work whose DOI does not follow from journal, volume and page, and which nobody could check: these find it.
UNCHECKED = ("Analytical derivation of the optimum triplicator",)
NAME = r"[A-Z][\w-]+(?: [A-Z]\w+)?"
NAMED = re.compile(rf"\b({NAME})(?:, {NAME})*(?: and {NAME}| et al\.)? \(?((?:19|20)\d\d)\b(?!-)")
MARKED = re.compile(r"```math\n(.+?)```", re.DOTALL)


def text_of(page: Path) -> str:
    """Of its sentences alone, on one line."""
    text = page.read_text().partition("\n## Sources\n")[0]
    return " ".join(re.sub(r"```.*?```|`[^`]*`", " ", text, flags=re.DOTALL).split())


def sources(page: Path) -> list[str]:
    listed = page.read_text().partition("\n## Sources\n")[2]
    return [" ".join(entry.split()) for entry in re.split(r"^- ", listed, flags=re.MULTILINE)[1:]]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_has_equations(page: Path) -> None:
    assert MARKED.search(page.read_text())


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_has_a_figure(page: Path) -> None:
    assert re.search(r"^!\[[^\]]+\]\([^)]+\.png\)$", page.read_text(), re.MULTILINE)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_no_equation_is_plain_text(page: Path) -> None:
    """Beside its fenced blocks a page has commands, whose words have no equals sign between blanks."""
    text = re.sub(r"```.*?```", "", page.read_text(), flags=re.DOTALL)
    assert re.findall(r"^    .* = .*$", text, re.MULTILINE) == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_names_its_sources(page: Path) -> None:
    entries = sources(page)
    assert entries
    assert any("https://doi.org/10." in entry for entry in entries)
    for entry in entries:
        assert any(title in entry for title in WITHOUT_DOI + UNCHECKED) or re.search(
            r"\[doi:(10\.\S+)\]\(https://doi\.org/\1\)", entry
        ), entry
        assert re.search(r"(19|20)\d\d", entry) or "states neither" in entry or "github.com" in entry, entry


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_every_work_that_is_named_is_listed(page: Path) -> None:
    lists = sources(page)
    if "inference.md#sources" in page.read_text():
        lists += sources(page.parent / "inference.md")
    for name, year in NAMED.findall(text_of(page)):
        assert any(name in entry and year in entry for entry in lists), f"{name} {year}"


def test_no_exception_is_left_over() -> None:
    listed = "".join(entry for page in PAGES for entry in sources(page))
    assert [title for title in WITHOUT_DOI + UNCHECKED if title not in listed] == []

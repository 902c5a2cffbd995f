"""The site of all pages is built by one command without a warning; what is broken fails it."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PICTURES = sorted(path for folder in (ROOT / "docs").rglob("images") for path in folder.rglob("*.png"))
SCRIPTS = ("docs/figures/*.py", "bench/*.py", "validation/**/*.py", "examples/office/*.py", "scripts/demo.sh")


def test_it_has_all_pages_and_a_search(site: Path) -> None:
    pages = [p.relative_to(ROOT / "docs").with_suffix(".html") for p in (ROOT / "docs").rglob("*.md")]
    assert len(pages) > 30
    assert [page for page in pages if not (site / page).is_file()] == []
    assert (site / "searchindex.js").stat().st_size > 100_000


def test_equations_need_no_network(site: Path) -> None:
    assert (site / "_static" / "mathjax" / "tex-chtml.js").is_file()
    for page in (ROOT / "docs" / "method").glob("*.md"):
        built = (site / "method" / page.with_suffix(".html").name).read_text()
        assert built.count('<div class="math notranslate') == page.read_text().count("```math\n")
        assert "_static/mathjax/tex-chtml.js" in built
        assert "cdn." not in built


def test_no_link_is_left_as_text(site: Path) -> None:
    pages = [p for p in site.rglob("*.html") if "doxygen" not in p.parts and "_static" not in p.parts]
    code = re.compile(r"<(pre|code)\b.*?</\1>|<script.*?</script>", re.DOTALL)
    assert [p.name for p in pages if re.search(r"\]\((file|https?|\.\.)", code.sub("", p.read_text()))] == []


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[there](no-such-page.md)", "no-such-page"),
        ("[there](#no-such-part)", "no-such-part"),
        ("![it](none.png)", "none"),
    ],
)
def test_a_broken_link_fails(text: str, words: str, tmp_path: Path) -> None:
    (tmp_path / "conf.py").write_text('extensions = ["myst_parser"]\nmyst_heading_anchors = 4\n')
    (tmp_path / "index.md").write_text(f"# Title\n\n{text}\n")
    done = subprocess.run(
        [sys.executable, "-m", "sphinx", "-q", "-W", "-b", "html", tmp_path, tmp_path / "out"],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode != 0
    assert words in done.stderr


@pytest.mark.parametrize("picture", PICTURES, ids=lambda path: path.name)
def test_every_figure_is_made_by_a_command_and_shown(picture: Path) -> None:
    scripts = "".join(path.read_text() for pattern in SCRIPTS for path in ROOT.glob(pattern))
    folder = picture.parent.name
    pages = [ROOT / "README.md", *(ROOT / "docs").rglob("*.md"), *(ROOT / "examples").rglob("*.md")]
    texts = [re.sub(r" \\\n +", " ", page.read_text()) for page in pages]  # a command that goes on is one line
    command = re.compile(rf"^    .*\.py .*{re.escape(picture.name)}", re.MULTILINE)
    made = picture.stem in scripts or folder == "tutorials" or any(command.search(text) for text in texts)
    assert made, f"no command makes {picture.name}"
    assert any(f"{picture.name})" in text for text in texts), f"no page shows {picture.name}"

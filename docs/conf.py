"""One site of all pages, built by scripts/docs.sh: MyST reads them, Breathe the C interface, autodoc the package."""

from __future__ import annotations

import logging
import os
import re
import subprocess
from pathlib import Path
from typing import Any

from docutils import nodes
from docutils.parsers.rst import Directive
from sphinx.application import Sphinx

ROOT = Path(__file__).resolve().parents[1]
BUILD = Path(os.environ.get("CLSPECKLE_BUILD_DIR", ROOT / "build"))

project = "clSpeckle"
author = "The clSpeckle authors"
extensions = ["myst_parser", "breathe", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
exclude_patterns = ["figures", "requirements.txt"]
html_theme = "furo"
html_title = "clSpeckle"
# The site needs no network: what draws its equations is a part of it.
html_static_path = [str(Path(__import__("sphinx-mathjax-offline").__file__).parent / "static")]
mathjax_path = "mathjax/tex-chtml.js"
myst_enable_extensions = ["dollarmath", "colon_fence"]
myst_fence_as_directive = ["math"]  # as forges have equations, too
myst_heading_anchors = 4
breathe_projects = {"clspeckle": os.environ.get("CLSPECKLE_DOXYGEN_XML", str(ROOT / "build" / "doxygen" / "xml"))}
breathe_default_project = "clspeckle"
breathe_domain_by_extension = {"h": "c"}
autodoc_member_order = "groupwise"
autodoc_typehints = "none"
napoleon_use_ivar = True
# Shapes such as (height, width) name no member; a struct and its typedef share a name.
suppress_warnings = ["ref.python", "duplicate_declaration.c"]
python_use_unqualified_type_names = True
# Macros of the headers that stand before a function.
c_id_attributes = ["CLSP_API"]


def help_of(*words: str) -> str:
    done = subprocess.run([BUILD / "bin" / "clspeckle", *words, "--help"], check=True, capture_output=True, text=True)
    return done.stdout


def subcommands(text: str) -> list[str]:
    lines = text.split("\nSubcommands:\n")[1].split("\n\n")[0].splitlines() if "\nSubcommands:\n" in text else []
    return [line.split()[0] for line in lines if line.startswith("  ") and not line.startswith("   ")]


class ProgramHelp(Directive):
    """Sections with the help of the program and of all its commands."""

    def run(self) -> list[nodes.Node]:
        found: list[nodes.Node] = []

        def add(words: tuple[str, ...]) -> None:
            text = help_of(*words)
            name = " ".join(("clspeckle", *words))
            section = nodes.section(ids=[nodes.make_id(name)], names=[name])
            section += nodes.title(text=name)
            section += nodes.literal_block(text, text, language="text")
            found.append(section)
            for command in subcommands(text):
                add((*words, command))

        add(())
        return found


def with_headers(app: Sphinx, docname: str, source: list[str]) -> None:
    """Every header of the C interface, by Breathe, in the place of the page's block."""
    names = [header.name for header in sorted((ROOT / "capi" / "include" / "clspeckle").glob("*.h"))]
    block = "## {0}\n\n```{{eval-rst}}\n.. doxygenfile:: {0}\n   :project: clspeckle\n```\n"
    source[0] = source[0].replace("```{c-headers}\n```", "\n".join(block.format(name) for name in names))


# Files of the checkout, which pages link to, are no pages of the site: their links lead to the repository. Where none is
# told, their words stay, without a link.
def leave_the_site(app: Sphinx, docname: str, source: list[str]) -> None:
    page = Path(app.env.doc2path(docname)).parent

    def outside(match: re.Match[str]) -> str:
        target, _, anchor = match[2].partition("#")
        path = (page / target).resolve()
        if path.is_relative_to(ROOT / "docs") or not path.exists():
            return match[0]
        words = match[1]
        if not REPOSITORY:
            return words
        return f"[{words}]({REPOSITORY}/{path.relative_to(ROOT).as_posix()}{'#' + anchor if anchor else ''})"

    source[0] = re.sub(r"\[([^\]]*)\]\((?!https?:|#)([^)\s]+)\)", outside, source[0])


REPOSITORY = os.environ.get("CLSPECKLE_REPOSITORY", "").rstrip("/")


def is_told(record: logging.LogRecord) -> bool:
    """Several parameters that share their words ("width, height") are no expression of C."""
    return not str(record.msg).startswith("Unparseable C expression")


def setup(app: Sphinx) -> dict[str, Any]:
    for name in ("sphinx.sphinx.domains.c", "sphinx.domains.c"):
        logging.getLogger(name).addFilter(is_told)
    app.add_directive("program-help", ProgramHelp)
    app.connect("source-read", with_headers)
    app.connect("source-read", leave_the_site)
    return {"parallel_read_safe": True}

"""One site of all pages, built by scripts/docs.sh: MyST reads them, Breathe the C interface, autodoc the package."""

from __future__ import annotations

import json
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
copyright = "2026 The clSpeckle authors"
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


def output_of(*words: str) -> str:
    return subprocess.run([BUILD / "bin" / "clspeckle", *words], check=True, capture_output=True, text=True).stdout


def help_of(*words: str) -> str:
    return output_of(*words, "--help")


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


class ConfigurationKeys(Directive):
    """A table of the keys of render's JSON configuration: the option that says what each is, and its default."""

    def run(self) -> list[nodes.Node]:
        values = json.loads(output_of("render", "--dump-config"))
        help_text = help_of("render")
        found: list[nodes.Node] = []
        for group, keys in values.items():
            if group == "effects":  # the catalogue's
                continue
            part = re.split(r"\n\n\n?(?=\S)", help_text.split(f"\nConfiguration: {group}:\n")[1])[0]
            options = re.findall(r"^  (--[a-z][\w-]*)", part, re.MULTILINE)
            if len(options) != len(keys):
                raise self.error(f"configuration {group}: {len(keys)} keys, {len(options)} options in render's help")
            for (key, value), option in zip(keys.items(), options):
                words = option[2:].replace("-", "_")
                if not (words.endswith(key) or words == group):
                    raise self.error(f"configuration {group}.{key}: its option in the help of render is {option}")
                found.append(row(f"{group}.{key}", option, json.dumps(value)))
        return [table_of(("key", "option of render, which has its meaning", "default"), found)]


def row(key: str, *cells: str) -> nodes.row:
    first = nodes.entry("", nodes.paragraph("", "", nodes.literal(key, key, ids=[nodes.make_id("key-" + key)])))
    return nodes.row("", first, *(nodes.entry("", nodes.paragraph("", "", nodes.literal(c, c))) for c in cells))


def table_of(heads: tuple[str, ...], rows: list[nodes.Node]) -> nodes.table:
    head = nodes.thead("", nodes.row("", *(nodes.entry("", nodes.paragraph(text=words)) for words in heads)))
    columns = [nodes.colspec(colwidth=1) for _ in heads]
    return nodes.table("", nodes.tgroup("", *columns, head, nodes.tbody("", *rows), cols=len(heads)))


def with_headers(app: Sphinx, docname: str, source: list[str]) -> None:
    """Every header of the C interface, by Breathe, in the place of the page's block."""
    names = [header.name for header in sorted((ROOT / "capi" / "include" / "clspeckle").glob("*.h"))]
    block = "## {0}\n\n```{{eval-rst}}\n.. doxygenfile:: {0}\n   :project: clspeckle\n```\n"
    source[0] = source[0].replace("```{c-headers}\n```", "\n".join(block.format(name) for name in names))


# Files of the checkout, which pages link to, are no pages of the site: their links lead to the repository. Where none
# is told, their words stay, without a link.
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
    app.add_directive("configuration-keys", ConfigurationKeys)
    app.connect("source-read", with_headers)
    app.connect("source-read", leave_the_site)
    return {"parallel_read_safe": True}

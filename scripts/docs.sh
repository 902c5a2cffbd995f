#!/usr/bin/env bash
# Builds the site of all pages into build/site (or the folder given): Doxygen reads the headers, Sphinx the rest. Every
# warning is an error: a broken link, a symbol without words. The library must be built (scripts/build.sh); doxygen is a
# Debian package.
# usage: scripts/docs.sh [FOLDER]
set -euo pipefail
cd "$(dirname "$0")/.."
site="${1:-build/site}"
python="${CLSP_PYTHON:-.venv/bin/python}"
command -v doxygen >/dev/null || { echo "doxygen is missing; install it: apt-get install doxygen" >&2; exit 1; }
"$python" -c 'import breathe, furo, myst_parser, sphinx; __import__("sphinx-mathjax-offline")' 2>/dev/null ||
    "$python" -m pip install -q --disable-pip-version-check -r docs/requirements.txt
"$python" scripts/undocumented.py
work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT
(cat docs/Doxyfile; echo "OUTPUT_DIRECTORY = $work") | doxygen -
CLSPECKLE_DOXYGEN_XML="$work/xml" "$python" -m sphinx -q -W --keep-going -j auto -d "$work/trees" -b html docs "$site"
mkdir -p "$site/doxygen"
cp -r "$work/html/." "$site/doxygen/"
echo "site: $site/index.html"

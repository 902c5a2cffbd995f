"""Pages as a browser shows them: headless Chromium. Without it the tests are skipped, which fails a run of all."""

from __future__ import annotations

import html
import json
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[1]
PROGRAM = next((path for name in ("chromium", "chromium-browser", "google-chrome") if (path := shutil.which(name))), "")
needed = pytest.mark.skipif(not PROGRAM, reason="Chromium is not installed")
TIME_MS = 20_000  # of the page's own clock, which runs as fast as it can

# The page in a frame as wide as a screen: Chromium's own windows have at least 500 px.
SCREEN = """<!DOCTYPE html><meta charset="utf-8">
<style>body {{ margin: 0 }} iframe {{ border: 0; height: 2000px }}</style>
<body><iframe id="screen" style="width:{width}px" src="{address}"></iframe><pre id="answer"></pre><script>
addEventListener("load", function () {{ setTimeout(function () {{
    var view = document.getElementById("screen").contentWindow;
    var answer = (function (window, document) {{ {code} }})(view, view.document);
    document.getElementById("answer").textContent = JSON.stringify(answer);
}}, 10000); }});
</script></body>"""


def run(address: str, *options: str) -> str:
    command = [
        PROGRAM,
        "--headless",
        "--no-sandbox",
        "--disable-gpu",
        "--allow-file-access-from-files",
        *options,
        address,
    ]
    return subprocess.run(command, check=True, capture_output=True, text=True, timeout=120).stdout


def ask(page: Path, code: str, folder: Path, *options: str, width: int = 1280) -> Any:
    """What a function's body of JavaScript returns, once the page is loaded and drawn."""
    screen = folder / f"{page.stem}-screen.html"
    screen.write_text(SCREEN.format(width=width, address=page.resolve().as_uri(), code=code))
    text = run(screen.as_uri(), "--dump-dom", f"--virtual-time-budget={TIME_MS}", *options)
    answer = re.search(r'<pre id="answer">(.+?)</pre>', text, re.DOTALL)
    assert answer, "the page's script did not end"
    return json.loads(html.unescape(answer[1]))


def pdf(page: Path, folder: Path) -> bytes:
    """The page as it is printed."""
    file = folder / f"{page.stem}.pdf"
    run(page.resolve().as_uri(), f"--print-to-pdf={file}", f"--virtual-time-budget={TIME_MS}")
    return file.read_bytes()

#!/usr/bin/env python3
"""Diagnoses every capture set of a folder of real data and writes the results as one page, beside what others measured.

    scripts/real_cameras.py DATA [--program build/bin/clspeckle] [--out docs/results/real.md]

DATA holds one folder a set; those with a capture.json are diagnosed. PUBLISHED has what the sets' sources say of them.
"""

from __future__ import annotations

import argparse
import datetime
import json
import subprocess
import sys
import tempfile
import textwrap
import time
from pathlib import Path
from typing import Any

# Of each set: a number of the report's `emva1288`, its path there, and what another program or the source gives.
_CROP, _FULL = "`emva1288` 1.0.2, the same crop", "`emva1288` 1.0.2, full frames"
PUBLISHED: dict[str, list[tuple[str, tuple[str, ...], str, str]]] = {
    "emva_ccd": [
        ("system gain", ("values", "system_gain"), "0.2801 DN/e", _FULL),
        ("dark noise", ("values", "dark_noise"), "3.07 DN", _FULL),
        ("PRNU of pixels, without light", ("values", "prnu_pixel"), "0.265 % with it", _FULL),
        ("PRNU of pixels, section 8", ("section_8", "as_recorded", "prnu_percent", "pixel"), "0.250 %", _CROP),
        ("PRNU of rows, section 8", ("section_8", "as_recorded", "prnu_percent", "row"), "0.155 %", _CROP),
        ("PRNU of columns, section 8", ("section_8", "as_recorded", "prnu_percent", "column"), "0.0165 %", _CROP),
        ("DSNU, section 8", ("section_8", "as_recorded", "dsnu_dn", "total"), "0.027 DN", _CROP),
    ],
    "laser_board": [
        ("system gain", ("values", "system_gain"), "1.23 DN/e", "frequencies at which speckle has no power"),
        ("system gain", ("values", "system_gain"), "1.32 to 1.47 DN", "variance over mean, dark noise in it"),
    ],
}


def number(value: Any, digits: int = 4) -> str:
    return f"{value:.{digits}g}" if isinstance(value, int | float) else "–"


def table(header: list[str], rows: list[list[str]]) -> str:
    lines = ["| " + " | ".join(header) + " |", "|" + "---|" * len(header)]
    return "\n".join([*lines, *("| " + " | ".join(row) + " |" for row in rows)]) + "\n"


def section(name: str, report: dict[str, Any], seconds: float) -> str:
    cause, shrink = report["cause"], report["shrink"]
    verdict = f"Verdict: `{cause['verdict']}`"
    if cause["effects"]:
        verdict += ", named: " + ", ".join(f"`{effect}`" for effect in cause["effects"])
    verdict += (
        f". {100 * shrink['fraction']:.0f} % of the gap is gone (95 % interval {100 * shrink['ci95'][0]:.0f} to "
        f"{100 * shrink['ci95'][1]:.0f} %). It took {seconds:.0f} s."
    )
    text = f"## {name}\n\n{textwrap.fill(verdict, 120)}\n\n"
    text += table(
        ["scene", "verdict", "distance", "with the effects", "effects that take something away"],
        [
            [
                rung["rung"],
                rung["verdict"],
                number(rung["distance_before"], 3),
                number(rung["distance_after"], 3),
                ", ".join(rung["effects"]) or "–",
            ]
            for rung in cause.get("rungs", [])
        ],
    )
    steps = [step["effect"] for step in shrink["steps"]]
    fitted = [entry for entry in cause["ranking"] if entry["effect"] in steps]
    text += "\n" + table(
        ["fitted effect", "parameter", "value", "95 % interval", "conditional"],
        [
            [
                entry["effect"],
                parameter,
                number(value),
                " to ".join(number(end) for end in entry["intervals"].get(parameter, [])) or "–",
                "yes" if entry.get("conditional") else "no",
            ]
            for entry in fitted
            for parameter, value in entry["parameters"].items()
        ],
    )
    rows = []
    for label, path, published, source in PUBLISHED.get(name, []):
        entry: Any = report["emva1288"]
        for key in path:
            entry = entry[key]
        if not isinstance(entry, dict):
            entry = {"value": entry, "unit": "DN" if path[-2] == "dsnu_dn" else "%"}
        found = "unknown: " + entry["unknown"] if "unknown" in entry else f"{number(entry['value'])} {entry['unit']}"
        interval = " to ".join(number(end) for end in entry.get("interval") or [])
        rows.append([label, found, interval or "–", published, source])
    if rows:
        text += "\n" + table(["EMVA 1288, closed form", "here", "95 % interval", "published", "by"], rows)
    after = sorted(shrink["per_statistic"], key=lambda entry: -abs(entry["z_after"] or 0))[:5]
    text += "\nWhat is left, in standard deviations:\n\n" + table(
        ["sequence", "statistic", "before", "with the effects"],
        [
            [entry["sequence"], entry["statistic"], number(entry["z_before"], 3), number(entry["z_after"], 3)]
            for entry in after
        ],
    )
    return text


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=Path, help="folder of capture sets")
    parser.add_argument("--program", type=Path, default=Path("build/bin/clspeckle"), help="the command line program")
    parser.add_argument("--out", type=Path, default=Path("docs/results/real.md"), help="the page")
    arguments = parser.parse_args()
    sets = sorted(path.parent for path in arguments.data.glob("*/capture.json"))
    if not sets:
        print(f"{arguments.data} holds no folder with a capture.json; give the folder of the sets", file=sys.stderr)
        return 1
    text = (
        f"# Real cameras\n\nMade by `scripts/real_cameras.py DATA` on {datetime.date.today()}: every capture set there "
        "is "
        "diagnosed with seed 0.\n[EMVA 1288](../method/emva1288.md) numbers are of the frames alone; fitted effects "
        "are "
        "the diagnosis's\n([diagnosis](../method/diagnosis.md)). `conditional`: a scene in which the effect shows has "
        "a "
        "residual.\n\n"
    )
    for folder in sets:
        print(f"{folder.name} ...", file=sys.stderr, flush=True)
        with tempfile.TemporaryDirectory() as out:
            report_path, start = Path(out) / "report.json", time.monotonic()
            command = [str(arguments.program), "diagnose", str(folder), "--json", str(report_path), "--quiet"]
            done = subprocess.run(command, check=False, capture_output=True, text=True)
            if done.returncode != 0:
                print(done.stderr, file=sys.stderr)
                return done.returncode
            text += section(folder.name, json.loads(report_path.read_text()), time.monotonic() - start) + "\n"
    arguments.out.parent.mkdir(parents=True, exist_ok=True)
    arguments.out.write_text(text)
    return 0


if __name__ == "__main__":
    sys.exit(main())

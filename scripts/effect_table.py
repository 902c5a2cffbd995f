#!/usr/bin/env python3
"""Writes the tables of docs/reference/effects.md from the catalogue's records (`clspeckle effects --json`).

    scripts/effect_table.py [--check] PROGRAM

--check writes nothing, and fails where a table is not what the records say. Text between the tables stays.
"""

from __future__ import annotations

import argparse
import json
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

PAGE = Path(__file__).resolve().parents[1] / "docs/reference/effects.md"
TABLE = r"(<!-- effects of the stage {} -->\n).*?(<!-- end -->\n)"
HEAD = "| effect | what happens | parameter | unit | weak | strong | accepted |\n|---|---|---|---|---|---|---|\n"


def number(value: float) -> str:
    return f"{value:.6g}"


def rows(effect: dict[str, Any]) -> str:
    lines = ""
    for i, parameter in enumerate(effect["parameters"]):
        unit = "" if parameter["unit"] == "1" else parameter["unit"]
        weak, strong = (number(parameter[name]) for name in ("weak", "strong"))
        accepted = f"{number(parameter['minimum'])} to {number(parameter['maximum'])}"
        name, what = (f"`{effect['id']}`", effect["summary"].replace("|", "\\|")) if i == 0 else ("", "")
        cells = (name, what, f"`{parameter['name']}`", unit, weak, "" if strong == weak else strong, accepted)
        lines += "| " + " | ".join(cells) + " |\n"
    return re.sub(r" +\|", " |", lines)


def written(page: str, effects: list[dict[str, Any]]) -> str:
    stages = list(dict.fromkeys(effect["stage"] for effect in effects))
    for stage in stages:
        table = HEAD + "".join(rows(effect) for effect in effects if effect["stage"] == stage)
        page, count = re.subn(
            TABLE.format(re.escape(stage)), lambda m, t=table: m[1] + "\n" + t + "\n" + m[2], page, flags=re.DOTALL
        )
        if count != 1:
            sys.exit(
                f"{PAGE.name} has {count} places for the effects of the stage {stage}; it needs one, between "
                f"'<!-- effects of the stage {stage} -->' and '<!-- end -->'"
            )
    return page


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program", help="the program clspeckle")
    parser.add_argument("--check", action="store_true", help="write nothing; fail where the page is stale")
    arguments = parser.parse_args()
    answer = subprocess.run([arguments.program, "effects", "--json"], capture_output=True, text=True, check=True).stdout
    page = PAGE.read_text(encoding="utf-8")
    new = written(page, json.loads(answer)["effects"])
    if arguments.check:
        if new != page:
            print(f"{PAGE.name} is stale: run scripts/effect_table.py {arguments.program}", file=sys.stderr)
        return int(new != page)
    PAGE.write_text(new, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())

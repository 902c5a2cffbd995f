"""The page of all experiments: figures, verdicts, and what was assumed where the thesis is silent."""

from __future__ import annotations

import datetime
import platform
import shutil
import sys
import textwrap
from collections.abc import Sequence
from pathlib import Path

import clspeckle

from .experiment import Experiment, Record, read_record, write_whole

COLUMNS = 118

HEAD = """# The thesis, figure by figure

*Real-time statistical simulation of dynamic laser speckle* is what this library goes back to. Its experiments and
figures are repeated here with the library, each with a verdict: a number that was measured beside the one that theory
says, and a tolerance that is stated. The page is written by

    pip install -r validation/thesis/requirements.txt
    PYTHONPATH=validation python -m thesis run --out OUT
    PYTHONPATH=validation python -m thesis page --out OUT --page docs/results/thesis.md

"""

ASSUMPTIONS = """## Figures elsewhere

- Fig. 5 and 16 from a diffractive element's own phase, without a camera: [doe.md](../method/doe.md).
- Fig. 22 to 24 beside real speckle: [motion.md](../method/motion.md).
- Fig. 25, airflow: [optics.md](../method/optics.md). Fig. 36 shows measurements, of which the thesis gives no numbers.

## What the thesis leaves out, and what was assumed

- **Pixel pitch, lens, focal length, resolution.** Not given. A pitch of 2.9 um and f/5.6 at 940 nm (D = 0.55), unless
  an experiment says otherwise.
- **The element's design and the layout of its dots.** Company secrets. Dots lie on a lattice here: averages over dots
  do not depend on where they lie.
- **The material's lengths.** Read off its Fig. 22 to 24: 0.5 mm, 3 mm, 0.25 degrees. The thesis gives no functional
  form; the one here ends, as its curves do.
- **Full scale.** Codes have 10 bits; the noise of 0.015 is of the top code.
- **f/0.** Means that no speckle is added.
"""


def filled(text: str) -> str:
    """Paragraphs and items in lines of at most 118 columns; headings, tables, figures and code stay."""
    lines = []
    for line in text.split("\n"):
        if line.startswith(("#", "|", "!", "    ")) or len(line) <= COLUMNS:
            lines.append(line)
        else:
            indent = "  " if line.startswith("- ") else ""
            lines += textwrap.wrap(
                line, COLUMNS, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False
            )
    return "\n".join(lines)


def table(record: Record) -> str:
    lines = ["| | measured | expected | tolerance | why | |", "|---|---|---|---|---|---|"]
    for v in record.verdicts:
        mark = "passed" if v.passed else "**failed**"
        lines.append(f"| {v.what} | {v.value:.4g} | {v.expected:.4g} | {v.tolerance:.2g} | {v.theory} | {mark} |")
    return "\n".join(lines)


def write_page(experiments: Sequence[Experiment], out: Path, page: Path) -> None:
    """Writes the page of all experiments that OUT holds, and copies their figures; says which have not run."""
    records = {experiment.name: read_record(experiment, out / experiment.name) for experiment in experiments}
    missing = [name for name, record in records.items() if record is None]
    if len(missing) == len(records):
        raise SystemExit(f"thesis: {out} has no result of any experiment; run them first")
    images = page.parent / "images" / "thesis"
    images.mkdir(parents=True, exist_ok=True)
    device = clspeckle.default_context().info().device_name
    sections, passed, count, seconds = [], 0, 0, 0.0
    for experiment in experiments:
        record = records[experiment.name]
        if record is None:
            continue
        passed += sum(v.passed for v in record.verdicts)
        count += len(record.verdicts)
        seconds += record.seconds
        image = images / f"{experiment.name}.png"
        write_whole(image, lambda path, name=experiment.name: shutil.copyfile(out / name / "figure.png", path))
        sections.append(
            f"## Fig. {experiment.figures}: {experiment.title}\n\n{experiment.summary}\n\n"
            f"![{experiment.title}](images/thesis/{experiment.name}.png)\n\n{table(record)}\n"
        )
    summary = (
        f"{datetime.date.today().isoformat()}, {device}, Python {platform.python_version()}: {passed} of {count} "
        "verdicts passed, "
        f"{seconds / 60:.1f} minutes. But for run times the numbers are the same each time.\n"
    )
    if missing:
        summary += f"\nNot run: {', '.join(missing)}.\n"
    text = filled(HEAD + summary + "\n" + "\n".join(sections) + "\n" + ASSUMPTIONS)
    write_whole(page, lambda path: path.write_text(text))
    print(f"page: {page}")
    for name in missing:
        print(f"thesis: {out} has no result of {name}; the page leaves it out", file=sys.stderr)

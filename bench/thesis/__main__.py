"""Repeats the experiments and figures of the thesis with clSpeckle.

Each experiment runs from its settings in config.json, and leaves in OUT/NAME its data (data.npz), its figure (figure.png) and its
verdicts (verdicts.json): what was measured beside what theory says. `page` makes a page of all that OUT holds.

Examples (with the folder `bench` on PYTHONPATH):
  python -m thesis list
  python -m thesis run --out thesis-figures
  python -m thesis run decorrelation beam_profile --out thesis-figures
  python -m thesis page --out thesis-figures --page docs/thesis.md
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

from . import (
    aperture_series,
    beam_profile,
    before_after,
    decorrelation,
    depth_estimates,
    doe_defects,
    intensity_law,
    run_time,
    scenes,
    sensor_noise,
    wavelength_shift,
)
from .experiment import Experiment, Record, carry_out
from .page import write_page

MODULES = (
    wavelength_shift,
    doe_defects,
    sensor_noise,
    decorrelation,
    beam_profile,
    run_time,
    intensity_law,
    aperture_series,
    depth_estimates,
    scenes,
    before_after,
)
EXPERIMENTS: list[Experiment] = [experiment for module in MODULES for experiment in module.EXPERIMENTS]


def parser() -> argparse.ArgumentParser:
    result = argparse.ArgumentParser(
        prog="thesis", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    actions = result.add_subparsers(dest="action", required=True, metavar="ACTION")
    actions.add_parser("list", help="the experiments and the thesis's figures")
    run = actions.add_parser("run", help="runs experiments; exit status 1 if a verdict fails")
    run.add_argument("names", nargs="*", metavar="NAME", help="all if none is named")
    run.add_argument(
        "--config",
        type=Path,
        default=Path(__file__).with_name("config.json"),
        help="settings by experiment (default: %(default)s)",
    )
    page = actions.add_parser("page", help="writes a page with every figure and verdict")
    page.add_argument(
        "--page", type=Path, required=True, help="Markdown file; figures go into the folder images/thesis beside it"
    )
    for action in (run, page):
        action.add_argument("--out", type=Path, required=True, help="folder of the results")
    return result


def show(record: Record) -> None:
    for verdict in record.verdicts:
        mark = "passed" if verdict.passed else "FAILED"
        print(
            f"  {mark}  {verdict.what}: {verdict.value:.6g}, expected {verdict.expected:.6g} within {verdict.tolerance:.2g}"
        )


def main() -> int:
    arguments = parser().parse_args()
    if arguments.action == "list":
        for experiment in EXPERIMENTS:
            print(f"{experiment.name:18} Fig. {experiment.figures:12} {experiment.title}")
        return 0
    if arguments.action == "page":
        write_page(EXPERIMENTS, arguments.out, arguments.page)
        return 0
    by_name = {experiment.name: experiment for experiment in EXPERIMENTS}
    for name in arguments.names:
        if name not in by_name:
            print(f"thesis: there is no experiment {name!r}; there are: {', '.join(by_name)}", file=sys.stderr)
            return 2
    try:
        settings = json.loads(arguments.config.read_text())
    except (OSError, ValueError) as error:
        print(f"thesis: the settings {arguments.config} cannot be read: {error}", file=sys.stderr)
        return 2
    failed = 0
    for name in arguments.names or by_name:
        if name not in settings:
            print(f"thesis: {arguments.config} has no settings of {name}", file=sys.stderr)
            return 2
        experiment = by_name[name]
        print(f"{name} (Fig. {experiment.figures}): {experiment.title}", flush=True)
        record = carry_out(
            experiment,
            settings[name],
            arguments.out / name,
            lambda text: print(f"  ... {text}", file=sys.stderr, flush=True),
        )
        show(record)
        failed += not record.passed
        print(f"  {record.seconds:.1f} s", flush=True)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())

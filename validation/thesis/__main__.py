"""Repeats the experiments and figures of the thesis with clSpeckle.

Each experiment runs from its settings in config.json, and leaves in OUT/NAME its data (data.npz), its figure
(figure.png) and its verdicts (verdicts.json): what was measured beside what theory says. `page` makes a page of all
that OUT holds.

Examples (with the folder `validation` on PYTHONPATH):
  python -m thesis list
  python -m thesis run --out thesis-figures
  python -m thesis run decorrelation beam_profile --out thesis-figures
  python -m thesis page --out thesis-figures --page docs/results/thesis.md
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path
from typing import Any

try:
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
    from clspeckle._json_file import read_json

    from .experiment import Experiment, Record, carry_out
    from .page import write_page
except ModuleNotFoundError as error:
    needs = Path(__file__).with_name("requirements.txt")
    sys.exit(f"thesis: {error.name} is not installed: {sys.executable} -m pip install -r {needs}")

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
            f"  {mark}  {verdict.what}: {verdict.value:.6g}, expected {verdict.expected:.6g} within "
            f"{verdict.tolerance:.2g}"
        )


def refuse(message: str) -> int:
    print(f"thesis: {message}", file=sys.stderr)
    return 2


def read_settings(path: Path, names: list[str]) -> dict[str, dict[str, Any]]:
    """The settings of all experiments that are to run."""
    settings = read_json(path)
    if not isinstance(settings, dict):
        raise ValueError("an object with the settings of each experiment is needed")
    for name in names:
        if name not in settings:
            raise ValueError(f"there are no settings of {name}")
        if not isinstance(settings[name], dict):
            raise ValueError(f"the settings of {name} are {settings[name]!r}, an object is needed")
    return settings


def check_folder(folder: Path) -> None:
    """Fails before an experiment runs, not when its results are to be written."""
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryFile(dir=folder):
        pass


def main() -> int:
    arguments = parser().parse_args()
    if arguments.action == "list":
        for experiment in EXPERIMENTS:
            print(f"{experiment.name:18} Fig. {experiment.figures:12} {experiment.title}")
        return 0
    if arguments.action == "page":
        try:
            write_page(EXPERIMENTS, arguments.out, arguments.page)
        except (OSError, ValueError, KeyError, TypeError) as error:
            return refuse(f"the page {arguments.page} of {arguments.out} cannot be made: {error!r}")
        return 0
    by_name = {experiment.name: experiment for experiment in EXPERIMENTS}
    for name in arguments.names:
        if name not in by_name:
            return refuse(f"there is no experiment {name!r}; there are: {', '.join(by_name)}")
    names = arguments.names or list(by_name)
    try:
        settings = read_settings(arguments.config, names)
    except (OSError, ValueError) as error:
        return refuse(f"the settings {arguments.config} cannot be read: {error}")
    try:
        check_folder(arguments.out)
    except OSError as error:
        return refuse(f"nothing can be written to {arguments.out}: {error}")
    failed = 0
    for name in names:
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

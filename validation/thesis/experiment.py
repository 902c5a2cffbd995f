"""What every experiment of the thesis has: settings, a run that yields data and verdicts, and a drawing."""

from __future__ import annotations

import dataclasses
import json
import os
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")
import numpy as np
from clspeckle._json_file import read_json
from matplotlib.figure import Figure

Config = Mapping[str, Any]
Progress = Callable[[str], None]


@dataclasses.dataclass(frozen=True)
class Verdict:
    """A number that was measured beside the one that theory says."""

    what: str
    value: float
    expected: float
    tolerance: float
    theory: str
    """Where the expected value and the tolerance come from."""

    @property
    def passed(self) -> bool:
        return bool(abs(self.value - self.expected) <= self.tolerance)  # never with NaN


@dataclasses.dataclass
class Outcome:
    """Of a run: arrays by name, all that the drawing needs, and the verdicts."""

    arrays: dict[str, np.ndarray]
    verdicts: list[Verdict]


@dataclasses.dataclass(frozen=True)
class Experiment:
    """One or more figures of the thesis.

    name: of its settings in config.json and of its folder. figures: of the thesis. summary: what is shown, and where
    the thesis and this differ. timed: its numbers are times, and differ from run to run.
    """

    name: str
    figures: str
    title: str
    summary: str
    run: Callable[[Config, Progress], Outcome]
    draw: Callable[[Figure, Outcome, Config], None]
    timed: bool = False


@dataclasses.dataclass(frozen=True)
class Record:
    """What a finished experiment left in its folder."""

    experiment: Experiment
    verdicts: list[Verdict]
    seconds: float

    @property
    def passed(self) -> bool:
        return all(verdict.passed for verdict in self.verdicts)


def write_whole(path: Path, write: Callable[[Path], object]) -> None:
    """Writes beside the path, then renames: nobody meets half a file."""
    temporary = path.with_name(f".{path.stem}.{os.getpid()}{path.suffix}")
    try:
        write(temporary)
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def carry_out(experiment: Experiment, config: Config, folder: Path, progress: Progress) -> Record:
    """Runs, draws, and writes data.npz, figure.png and verdicts.json."""
    start = time.perf_counter()
    outcome = experiment.run(config, progress)
    seconds = time.perf_counter() - start
    folder.mkdir(parents=True, exist_ok=True)
    figure = Figure(layout="constrained")
    experiment.draw(figure, outcome, config)
    write_whole(folder / "figure.png", lambda path: figure.savefig(path, dpi=80))
    write_whole(folder / "data.npz", lambda path: np.savez_compressed(path, **outcome.arrays))
    record = Record(experiment, outcome.verdicts, seconds)
    entries = [{**dataclasses.asdict(verdict), "passed": verdict.passed} for verdict in outcome.verdicts]
    text = json.dumps(
        {"experiment": experiment.name, "config": dict(config), "seconds": round(seconds, 2), "verdicts": entries},
        indent=1,
    )
    write_whole(folder / "verdicts.json", lambda path: path.write_text(text + "\n"))
    return record


def read_record(experiment: Experiment, folder: Path) -> Record | None:
    """What an earlier run left; None if it left nothing."""
    path = folder / "verdicts.json"
    if not path.is_file():
        return None
    stored = read_json(path)
    verdicts = [
        Verdict(**{key: value for key, value in entry.items() if key != "passed"}) for entry in stored["verdicts"]
    ]
    return Record(experiment, verdicts, stored["seconds"])

"""Runs a diagnosis over capture sets, without their keys, and notes how long each took."""

from __future__ import annotations

import functools
import json
import os
import shlex
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, TypeVar

from .json_file import read_json, read_object
from .plan import draw_sets, load_plan, set_name, write_drawn

DEFAULT_COMMAND = "clspeckle diagnose"

T = TypeVar("T")


@dataclass(frozen=True)
class CheckSet:
    """A capture set with its key."""

    name: str
    capture: Path
    key: dict[str, Any]
    write: Callable[[Path], None] | None = None  # writes the set if it is not there


@dataclass
class Run:
    """How a diagnosis of one set went."""

    exit_status: int
    wall_s: float
    peak_memory_mib: float  # Linux counts from the process that starts it: never below the runner's own
    command: str


def key_kind(key: dict[str, Any]) -> str:
    """The kind of a set; keys of other generators may not say it."""
    if "kind" in key:
        return str(key["kind"])
    if key.get("without"):
        return "without"
    if not key["effects"]:
        return "null"
    if not key.get("in_catalogue", True):
        return "outside"
    return {1: "single", 2: "pair"}.get(len(key["effects"]), "many")


def find_sets(folder: Path) -> list[CheckSet]:
    """Sets of `generate` (keys/NAME.json, captures/NAME), or folders that hold key.json beside capture.json.

    Captures of `generate` that are not there are drawn again, from plan.json, while they are needed.
    """
    sets = []
    drawn: dict[str, Callable[[Path], None]] = {}
    if (folder / "plan.json").is_file():
        plan = load_plan(str(folder / "plan.json"))
        for index, drawn_set in enumerate(draw_sets(plan)):
            drawn[set_name(index)] = functools.partial(write_drawn, plan=plan, entry=drawn_set)
    for path in sorted((folder / "keys").glob("*.json")):
        capture = folder / "captures" / path.stem
        if (capture / "capture.json").is_file() or path.stem in drawn:
            sets.append(CheckSet(path.stem, capture, read_object(path), drawn.get(path.stem)))
    for path in sorted(folder.glob("*/key.json")):
        if (path.parent / "capture.json").is_file():
            sets.append(CheckSet(path.parent.name, path.parent, read_object(path)))
    if not sets:
        raise ValueError(f"{folder} holds no capture sets with keys; `python -m gap_check generate` writes them")
    return sets


def progress(items: Iterable[T], total: int, label: str) -> Iterator[T]:
    """A progress bar: tqdm's if it is installed, else a line that counts."""
    try:
        from tqdm import tqdm
    except ImportError:
        return _count(items, total, label)
    return iter(tqdm(items, total=total, desc=label, unit="set"))


def _count(items: Iterable[T], total: int, label: str) -> Iterator[T]:
    begin = time.monotonic()
    terminal = sys.stderr.isatty()
    for done, item in enumerate(items, 1):
        left = (time.monotonic() - begin) / done * (total - done)
        if terminal or done == total or done % max(1, total // 20) == 0:
            end = "\r" if terminal and done < total else "\n"
            print(f"{label}: {done} / {total}, {left:.0f} s left", end=end, file=sys.stderr, flush=True)
        yield item


def command_line(command: str, capture: Path, report: Path, without: Iterable[str]) -> list[str]:
    """COMMAND CAPTURE --json REPORT [--without ...]; {capture}, {report} and {without} in COMMAND take other places."""
    names = ",".join(without)
    words = shlex.split(command)
    if any("{capture}" in word for word in words):
        filled = []
        for word in words:
            if word == "{without}":
                filled += ["--without", names] if names else []
            else:
                filled.append(word.replace("{capture}", str(capture)).replace("{report}", str(report)))
        if names and "{without}" not in words:
            raise ValueError(f"the command {command!r} has no {{without}}, which sets with withheld effects need")
        return filled
    return [*words, str(capture), "--json", str(report), *(["--without", names] if names else [])]


def read_report(path: Path) -> dict[str, Any] | None:
    """A report, or None if there is none that is whole."""
    try:
        report = read_json(path)
    except (OSError, ValueError):
        return None
    return report if isinstance(report, dict) and "cause" in report else None


def last_lines(log: Path, count: int = 20) -> list[str]:
    """The end of a log, for eyes: what a terminal would still show of a line that was written over."""
    return [line.rsplit("\r", 1)[-1] for line in log.read_text(errors="replace").rstrip().split("\n")[-count:]]


def diagnose(entry: CheckSet, reports: Path, command: str, timeout_s: float) -> Run:
    """Runs the diagnosis on one set. Its key is never within its reach: it sees links to the other files alone."""
    report, partial = reports / f"{entry.name}.json", reports / f"{entry.name}.partial.json"
    partial.unlink(missing_ok=True)
    with tempfile.TemporaryDirectory() as temporary, (reports / f"{entry.name}.log").open("wb") as log:
        capture = Path(temporary) / entry.name
        if (entry.capture / "capture.json").is_file():
            capture.mkdir()
            for source in entry.capture.iterdir():
                if source.name != "key.json":
                    (capture / source.name).symlink_to(source.resolve())
        elif entry.write:
            entry.write(capture)
        words = command_line(command, capture, partial, entry.key.get("without", []))
        begin = time.monotonic()
        process = subprocess.Popen(words, stdin=subprocess.DEVNULL, stdout=log, stderr=subprocess.STDOUT)
        expired = threading.Timer(timeout_s, process.kill)
        expired.start()
        try:
            _, status, usage = os.wait4(process.pid, 0)  # this child's own memory
        except BaseException:
            process.kill()
            raise
        finally:
            expired.cancel()
        process.returncode = os.waitstatus_to_exitcode(status)
        run = Run(process.returncode, time.monotonic() - begin, usage.ru_maxrss / 1024, shlex.join(words))
    if run.exit_status == 0 and read_report(partial) is not None:
        partial.replace(report)
    (reports / f"{entry.name}.run").write_text(json.dumps(asdict(run), indent=1) + "\n")
    return run


def run_sets(
    sets: list[CheckSet],
    reports: Path,
    command: str = DEFAULT_COMMAND,
    jobs: int = 1,
    timeout_s: float = 1800.0,
    finished: Callable[[CheckSet, Run], None] | None = None,
) -> None:
    """Diagnoses all sets that have no report yet."""
    reports.mkdir(parents=True, exist_ok=True)
    waiting = [s for s in sets if read_report(reports / f"{s.name}.json") is None]
    if len(waiting) < len(sets):
        print(f"{len(sets) - len(waiting)} of {len(sets)} sets have a report already", file=sys.stderr)
    with ThreadPoolExecutor(max_workers=max(1, jobs)) as pool:
        runs = {pool.submit(diagnose, s, reports, command, timeout_s): s for s in waiting}
        try:
            for future in progress(as_completed(runs), len(runs), "diagnosed"):
                run = future.result()
                if run.exit_status != 0:
                    name = runs[future].name
                    log = reports / f"{name}.log"
                    print(f"{name}: exit status {run.exit_status}; see {log}, which ends with:", file=sys.stderr)
                    print("\n".join(last_lines(log)), file=sys.stderr)
                if finished:
                    finished(runs[future], run)
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise

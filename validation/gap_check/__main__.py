"""The withheld-effect check from the command line: see `python -m gap_check --help`."""

from __future__ import annotations

import argparse
import json
import os
import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path

try:
    from .effects import EFFECTS
    from .outcome import read_outcomes
    from .plan import PLANS, Plan, SetPlan, load_plan, set_name, write_drawn, write_plan
    from .power import EFFECTS as POWER_EFFECTS
    from .power import FRAMES, power
    from .runner import DEFAULT_COMMAND, find_sets, progress, run_sets
    from .scorer import score
    from .tables import markdown
except ModuleNotFoundError as error:
    needs = Path(__file__).with_name("requirements.txt")
    sys.exit(f"gap_check: {error.name} is not installed: {sys.executable} -m pip install -r {needs}")

DESCRIPTION = """\
Draws capture sets with known gaps by an independent generator, has a diagnosis look at them without their keys, and
prints how often it was right.

  generate   writes OUT/plan.json, OUT/keys/ and OUT/captures/
  run        diagnoses OUT's sets into OUT/reports/; sets that have a report are skipped, so a stopped run goes on
  score      prints the table; writes OUT/score/score.json, score.md and figures
  all        the three in turn; without --keep, a capture set exists only while it is diagnosed (a set of 40 frames
             takes 15 MB, the full plan 8 GB)
  one        a single capture set with chosen effects, for looking at
  power      effects below their weakest strength, for 4, 8, 16 and 32 frames: what can be seen; OUT/power.{json,md,png}
  effects    lists what the generator can switch on

Examples (with the folder `validation` on PYTHONPATH):
  python -m gap_check all --plan small --out check --command "build/bin/clspeckle diagnose"
  python -m gap_check score --out practice --reports reports   # sets that hold key.json themselves
  python -m gap_check one --out set --effect defocus=0.5 --effect shot_noise=1
"""


def _arguments(argv: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m gap_check", description=DESCRIPTION, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    commands = parser.add_subparsers(dest="action", required=True, metavar="ACTION")
    made = {name: commands.add_parser(name) for name in ("generate", "run", "score", "all", "power", "one", "effects")}
    for name in ("generate", "run", "score", "all", "power", "one"):
        made[name].add_argument("--out", type=Path, required=True, help="folder of the sets, keys and reports")
    for name in ("generate", "all"):
        add = made[name].add_argument
        add("--plan", default="small", help=f"one of {', '.join(PLANS)}, or a JSON file with the members of a plan")
        add("--seed", type=int, help="another seed than the plan's")
        add("--frames", type=int, help="another number of frames per sequence")
    for name in ("generate", "run", "all", "power"):
        made[name].add_argument("--jobs", type=int, default=1, help="how many at once (default 1)")
    for name in ("run", "all", "power"):
        add = made[name].add_argument
        add("--command", default=DEFAULT_COMMAND,
            help="the diagnosis; CAPTURE --json REPORT [--without EFFECTS] is appended, or stands where {capture}, "
                 f"{{report}} and {{without}} are (default: {DEFAULT_COMMAND})")  # fmt: skip
        add("--timeout", type=float, default=1800.0, help="seconds after which a diagnosis is ended (default 1800)")
    for name in ("run", "score", "all"):
        made[name].add_argument("--reports", type=Path, help="folder of the reports (default: OUT/reports)")
    for name in ("score", "all"):
        made[name].add_argument("--score", type=Path, help="folder of the score (default: OUT/score)")
        made[name].add_argument("--no-figures", action="store_true", help="only the table")
        made[name].add_argument("--require", action="store_true", help="exit status 1 if an aim of the table is missed")
    add = made["power"].add_argument
    add("--frames", type=int, nargs="+", default=list(FRAMES), help="numbers of frames (default: %(default)s)")
    add("--effects", nargs="+", default=list(POWER_EFFECTS), metavar="ID", help="default: %(default)s")
    add("--repeats", type=int, default=3, help="sets at each strength (default %(default)s)")
    add("--seed", type=int, default=1)
    add("--no-figures", action="store_true", help="only the table")
    made["all"].add_argument("--keep", action="store_true", help="leave all capture sets in OUT/captures")
    add = made["one"].add_argument
    add("--effect", action="append", default=[], metavar="ID=STRENGTH", help="0: weak, 1: strong; may be repeated")
    add("--width", type=int, default=192)
    add("--height", type=int, default=160)
    add("--border", type=int, default=0, help="pixels on each side that are simulated, but not recorded (default 0)")
    add("--frames", type=int, default=40)
    add("--seed", type=int, default=1)
    return parser.parse_args(argv)


def _write(out: Path, index: int, plan: Plan, entry: SetPlan) -> None:
    folder = out / "captures" / set_name(index)
    if not (folder / "capture.json").is_file():
        write_drawn(folder, plan, entry)


def _plan(arguments: argparse.Namespace) -> Plan:
    plan = load_plan(arguments.plan)
    if arguments.seed is not None:
        plan = replace(plan, seed=arguments.seed)
    if arguments.frames is not None:
        plan = replace(plan, frames=arguments.frames)
    return plan


def _generate(out: Path, plan: Plan, jobs: int) -> None:
    sets = write_plan(out, plan)
    if jobs <= 1:
        for index, entry in progress(list(enumerate(sets)), len(sets), "written"):
            _write(out, index, plan, entry)
        return
    with ProcessPoolExecutor(jobs) as pool:
        pending = [pool.submit(_write, out, index, plan, entry) for index, entry in enumerate(sets)]
        for future in progress(pending, len(pending), "written"):
            future.result()


def _score(arguments: argparse.Namespace) -> int:
    outcomes, missing = read_outcomes(find_sets(arguments.out), arguments.reports or arguments.out / "reports")
    if not outcomes:
        raise ValueError(f"no reports of the sets in {arguments.out}; `python -m gap_check run` makes them")
    folder: Path = arguments.score or arguments.out / "score"
    folder.mkdir(parents=True, exist_ok=True)
    result = score(outcomes, missing)
    (folder / "score.json").write_text(json.dumps(result, indent=1) + "\n")
    text = markdown(result)
    if not arguments.no_figures:
        from .plots import plot_score  # matplotlib takes seconds to load

        plot_score(result, folder)
    (folder / "score.md").write_text(text)
    print(text)
    return int(arguments.require and any(figure["met"] is False for figure in result["figures"]))


def _one(arguments: argparse.Namespace) -> None:
    strengths = {}
    for item in arguments.effect:
        name, _, strength = item.partition("=")
        if name not in EFFECTS:
            raise ValueError(f"no effect is called {name!r}; there are: {', '.join(EFFECTS)}")
        strengths[name] = float(strength) if strength else 0.6
    plan = Plan("one", arguments.width, arguments.height, frames=arguments.frames, border_px=arguments.border)
    write_drawn(arguments.out, plan, SetPlan("one", strengths, arguments.seed, arguments.seed))
    print(f"{arguments.out}: {json.dumps(SetPlan('one', strengths, 0, 0).effects) if strengths else 'nothing'}")


def _list_effects() -> None:
    for info in EFFECTS.values():
        ranges = ", ".join(f"{name} {weak:g} to {strong:g}" for name, (weak, strong) in info.ranges.items())
        print(f"{info.stage:8s} {info.id:24s} {'' if info.in_catalogue else '(in no catalogue) '}{ranges}")


def main(argv: list[str] | None = None) -> int:
    arguments = _arguments(argv)
    # One thread each: jobs say how many run at once.
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    try:
        if arguments.action == "effects":
            _list_effects()
        elif arguments.action == "one":
            _one(arguments)
        if arguments.action == "generate" or (arguments.action == "all" and arguments.keep):
            _generate(arguments.out, _plan(arguments), arguments.jobs)
        elif arguments.action == "all":
            sets = write_plan(arguments.out, _plan(arguments))
            print(f"{len(sets)} sets", file=sys.stderr)
        if arguments.action == "power":
            print(power(arguments.out, arguments.command, arguments.jobs, arguments.timeout, arguments.frames,
                        arguments.effects, arguments.repeats, arguments.seed, not arguments.no_figures))  # fmt: skip
        if arguments.action in ("run", "all"):
            reports = arguments.reports or arguments.out / "reports"
            run_sets(find_sets(arguments.out), reports, arguments.command, arguments.jobs, arguments.timeout)
        if arguments.action in ("score", "all"):
            return _score(arguments)
    except (OSError, ValueError) as error:
        print(f"gap_check: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("gap_check: interrupted; the same command goes on", file=sys.stderr)
        return 130
    return 0


if __name__ == "__main__":
    sys.exit(main())

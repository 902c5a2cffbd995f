#!/usr/bin/env python3
"""One benchmark program beside another build of it: how many times the time of the first does the second take?

Both run in turn, round by round, so that what else the machine does meets both. What counts is the processor time of
all threads of a process, for each iteration; the time on the wall stands beside it. The interval is a bootstrap over
rounds, which keeps the two runs of a round together. Times in which a kernel is compiled do not count: a benchmark
warms up before it is timed.

    python3 bench/two_programs.py EARLIER/build/bin/clspeckle-bench build/bin/clspeckle-bench \
        --filter '^frame/.*D_percent:50.*fill_percent:0/' --rounds 20
    python3 bench/two_programs.py EARLIER/build/bin/clspeckle-bench-gap build/bin/clspeckle-bench-gap \
        --filter '^BM_GapSimulator' --rounds 20
"""

from __future__ import annotations

import argparse
import json
import random
import statistics
import subprocess
import sys
from pathlib import Path

CLOCKS = ("cpu_time", "real_time")
DRAWS = 2000  # of the bootstrap
Times = dict[str, dict[str, list[float]]]  # benchmark, clock: ms of an iteration, one number a round


def run_once(program: Path, pattern: str, seconds: float, times: Times) -> None:
    """Runs the program's benchmarks once and adds their times."""
    command = [str(program), f"--benchmark_filter={pattern}", f"--benchmark_min_time={seconds}"]
    run = subprocess.run([*command, "--benchmark_format=json"], capture_output=True, text=True, check=False)
    if run.returncode:
        sys.exit(f"{program} failed: {run.stderr.strip()}")
    for entry in json.loads(run.stdout or '{"benchmarks": []}')["benchmarks"]:
        if "error_message" in entry:
            sys.exit(f"{program}: {entry['name']}: {entry['error_message']}")
        scale = {"ns": 1e-6, "us": 1e-3, "ms": 1.0, "s": 1e3}[entry["time_unit"]]
        clocks = times.setdefault(entry["name"], {clock: [] for clock in CLOCKS})
        for clock in CLOCKS:
            clocks[clock].append(scale * entry[clock])


def median_ratio(pairs: list[tuple[float, float]]) -> float:
    return statistics.median(second for _, second in pairs) / statistics.median(first for first, _ in pairs)


def quantiles(values: list[float]) -> tuple[float, float]:
    """The middle 95 %."""
    ordered = sorted(values)
    return ordered[int(0.025 * len(ordered))], ordered[int(0.975 * len(ordered))]


def compare(first: Times, second: Times, clock: str, seed: int) -> dict[str, dict[str, float]]:
    """Ratios of the second program's times to the first one's: of each benchmark, and their geometric mean as `all`."""
    names = [name for name in first if name in second]
    rng = random.Random(seed)
    rounds = len(first[names[0]][clock])
    pairs = {name: list(zip(first[name][clock], second[name][clock], strict=True)) for name in names}
    drawn: dict[str, list[float]] = {name: [] for name in (*names, "all")}
    for _ in range(DRAWS):
        chosen = rng.choices(range(rounds), k=rounds)
        for name in names:
            drawn[name].append(median_ratio([pairs[name][i] for i in chosen]))
        drawn["all"].append(statistics.geometric_mean(drawn[name][-1] for name in names))
    table: dict[str, dict[str, float]] = {}
    for name in names:
        low, high = quantiles(drawn[name])
        table[name] = {
            "first_ms": statistics.median(first[name][clock]),
            "second_ms": statistics.median(second[name][clock]),
            "least": min(second[name][clock]) / min(first[name][clock]),
            "median": median_ratio(pairs[name]),
            "low": low,
            "high": high,
        }
    low, high = quantiles(drawn["all"])
    table["all"] = {
        "least": statistics.geometric_mean(table[name]["least"] for name in names),
        "median": statistics.geometric_mean(table[name]["median"] for name in names),
        "low": low,
        "high": high,
    }
    return table


def print_table(title: str, table: dict[str, dict[str, float]]) -> None:
    print(f"\n| {title} | first, ms | second, ms | least / least | median / median | 95 % |\n|---|---|---|---|---|---|")
    for name, row in table.items():
        milliseconds = [f"{row[key]:.4g}" if key in row else "" for key in ("first_ms", "second_ms")]
        ratios = f"{row['least']:.3f} | {row['median']:.3f} | {row['low']:.3f} to {row['high']:.3f}"
        print(f"| {name} | {milliseconds[0]} | {milliseconds[1]} | {ratios} |", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add = parser.add_argument
    add("first", type=Path, help="a program of Google Benchmark, the reference")
    add("second", type=Path, help="another build of it")
    add("--filter", default=".", help="regular expression of benchmarks (default: all that both have)")
    add("--rounds", type=int, default=20, help="runs of each program (default %(default)s)")
    add("--seconds", type=float, default=0.1, help="least time of a benchmark in a run (default %(default)s)")
    add("--seed", type=int, default=1, help="of the bootstrap (default %(default)s)")
    add("--json", type=Path, help="all times and ratios as JSON, the times after each round")
    arguments = parser.parse_args()
    if arguments.rounds < 2:
        parser.error("--rounds: at least 2 are needed for an interval")
    first: Times = {}
    second: Times = {}
    times: dict[str, object] = {"first": first, "second": second}
    for done in range(arguments.rounds):
        run_once(arguments.first, arguments.filter, arguments.seconds, first)
        run_once(arguments.second, arguments.filter, arguments.seconds, second)
        if not first.keys() & second.keys():
            sys.exit(f"no benchmark of both programs matches {arguments.filter!r}; --benchmark_list_tests lists them")
        print(f"round {done + 1} of {arguments.rounds}", file=sys.stderr, flush=True)
        if arguments.json:
            arguments.json.write_text(json.dumps(times, indent=1) + "\n")
    tables = {clock: compare(first, second, clock, arguments.seed) for clock in CLOCKS}
    print_table("processor time", tables["cpu_time"])
    print_table("time on the wall", tables["real_time"])
    if arguments.json:
        arguments.json.write_text(json.dumps({**times, "ratios": tables}, indent=1) + "\n")


if __name__ == "__main__":
    main()

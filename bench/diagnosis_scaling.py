#!/usr/bin/env python3
"""Time and memory of `clspeckle diagnose` against the number of frames and of pixels.

Sets of six sequences are drawn by `clspeckle capture make` with one effect, and diagnosed one after the other; a
straight line says what is fixed and what grows. Processor time is of all threads; memory is the
largest resident set.

    .venv/bin/python bench/diagnosis_scaling.py --plot docs/images/gap-check/scaling.png
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from tqdm import tqdm

FRAMES = (8, 16, 32, 64)
SIZES = ((96, 80), (136, 112), (192, 160), (272, 224), (384, 320))  # areas double
COMMON_FRAMES, COMMON_SIZE = 16, (192, 160)


@dataclass
class Run:
    width: int
    height: int
    frames: int
    seconds: float
    processor_seconds: float
    memory_mb: float
    verdict: str


def run(program: Path, effect: str, width: int, height: int, frames: int) -> Run:
    with tempfile.TemporaryDirectory() as folder:
        capture, report = Path(folder, "set"), Path(folder, "report.json")
        make = [str(program), "capture", "make", str(capture), "--quiet", "--seed", "1", "--effect", effect]
        make += ["--width", str(width), "--height", str(height), "--frames", str(frames)]
        subprocess.run(make, check=True)
        command = [str(program), "diagnose", str(capture), "--json", str(report), "--quiet"]
        # A process of its own for each: the largest resident set is of all children so far.
        child = [sys.executable, __file__, "--child", *command]
        done = subprocess.run(
            child, check=True, capture_output=True, text=True, env={**os.environ, "POCL_AFFINITY": "0"}
        )
        seconds, processor, memory = json.loads(done.stdout.splitlines()[-1])
        verdict = json.loads(report.read_text())["cause"]["verdict"]
    return Run(width, height, frames, seconds, processor, memory, verdict)


def child(command: list[str]) -> None:
    import time

    began = time.perf_counter()
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    print(json.dumps([time.perf_counter() - began, used.ru_utime + used.ru_stime, used.ru_maxrss / 1024]))


def line(x: list[float], y: list[float]) -> tuple[float, float]:
    slope, offset = np.polyfit(x, y, 1, w=1 / np.array(y))
    return float(slope), float(offset)


def table(title: str, runs: list[Run], amounts: list[float], unit: str) -> list[str]:
    lines = [
        f"| {title} | elapsed, s | processor, s | memory, MB | verdict |",
        "|---|---|---|---|---|",
    ]
    for r in runs:
        name = f"{r.width} x {r.height}" if title == "image" else str(r.frames)
        lines.append(f"| {name} | {r.seconds:.1f} | {r.processor_seconds:.1f} | {r.memory_mb:.0f} | {r.verdict} |")
    time_slope, time_offset = line(amounts, [r.processor_seconds for r in runs])
    memory_slope, memory_offset = line(amounts, [r.memory_mb for r in runs])
    lines.append(
        f"\nProcessor time {time_offset:.1f} s + {time_slope:.3g} s per {unit}; "
        f"memory {memory_offset:.0f} MB + {memory_slope:.3g} MB per {unit}.\n"
    )
    return lines


def plot(by_frames: list[Run], by_pixels: list[Run], path: Path) -> None:
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(2, 2, figsize=(9, 6))
    for column, (runs, label) in enumerate(((by_frames, "frames of a sequence"), (by_pixels, "thousand pixels"))):
        x = [float(r.frames) if column == 0 else 1e-3 * r.width * r.height for r in runs]
        for row, (values, name) in enumerate(
            (([r.processor_seconds for r in runs], "processor time, s"), ([r.memory_mb for r in runs], "memory, MB"))
        ):
            axis = axes[row][column]
            slope, offset = line(x, values)
            axis.plot(x, values, "o")
            axis.plot([0, max(x)], [offset, offset + slope * max(x)], "k--", lw=1)
            axis.set(xlabel=label, ylabel=name, xlim=(0, None), ylim=(0, None))
    figure.tight_layout()
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)


def main() -> None:
    if sys.argv[1:2] == ["--child"]:
        child(sys.argv[2:])
        return
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--program", type=Path, default=Path("build/bin/clspeckle"), help="default: %(default)s")
    parser.add_argument("--effect", default="defocus:waves=1", help="what is on in the captures (default: %(default)s)")
    parser.add_argument("--plot", type=Path, help="a PNG")
    parser.add_argument("--json", type=Path, help="all runs")
    arguments = parser.parse_args()
    run(arguments.program, arguments.effect, *SIZES[0], 8)  # kernels are compiled once
    cases = [(*COMMON_SIZE, frames) for frames in FRAMES]
    cases += [(*size, COMMON_FRAMES) for size in SIZES]
    for size in SIZES:  # and once for each size of image
        run(arguments.program, arguments.effect, *size, 4)
    runs = [run(arguments.program, arguments.effect, *case) for case in tqdm(cases, desc="sets")]
    by_frames, by_pixels = runs[: len(FRAMES)], runs[len(FRAMES) :]
    print("\n".join(table("frames", by_frames, [float(r.frames) for r in by_frames], "frame of all sequences")))
    print("\n".join(table("image", by_pixels, [1e-3 * r.width * r.height for r in by_pixels], "thousand pixels")))
    if arguments.plot:
        plot(by_frames, by_pixels, arguments.plot)
    if arguments.json:
        partial = arguments.json.with_suffix(arguments.json.suffix + ".part")
        partial.write_text(json.dumps([asdict(r) for r in runs], indent=1))
        partial.replace(arguments.json)


if __name__ == "__main__":
    main()

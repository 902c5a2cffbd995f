#!/usr/bin/env python3
"""The same frames by everything at hand, in one run: NumPy, SciPy, FFTW, VkFFT, clFFT, the passes of clSpeckle's own
engine in C++, and that engine.

A frame goes from stored phases and an ideal image to the intensity behind a round aperture: exp(i phase) sqrt(ideal),
transform, mask, inverse transform, squared modulus. VkFFT is timed on its two transforms alone. All take turns, several
times in each round, and the fastest times are compared: whatever else the machine does only adds to them. Ratios mean
more than times.

    build/bin/clspeckle-bench must be built (-DCLSP_BUILD_BENCH=ON; with Debian's libvkfft-dev for VkFFT)
    .venv/bin/pip install scipy tqdm
    .venv/bin/python bench/side_by_side.py --plot docs/images/performance/side-by-side.png
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path

import numpy as np
import scipy.fft
from numpy.typing import NDArray
from tqdm import tqdm

SIZES = ((512, 512), (1024, 1024), (1280, 720), (1920, 1080), (2048, 2048), (4096, 4096))
REPETITIONS = 3  # of each case in a round
DIAMETERS = (25, 50, 100)  # percent of what the sampling resolves
# Bytes that a frame of the device's own engine must move for each pixel: phase and ideal image are read, the intensity
# is written (4 each). Of the complex lines between the passes a part D is kept, written twice and read twice (8 each).
FRAME_BYTES = (12.0, 32.0)
ENGINES = {
    "intensity/own": "own",
    "intensity/own_unpolarized": "own, p = 0",
    "intensity/own_sensor": "own, sensor",
    "intensity/native": "native",
    "intensity/native_rows_first": "native, rows first",
    "intensity/clfft": "clFFT",
    "intensity/clfft_unpolarized": "clFFT, p = 0",
    "fftw_frame": "FFTW",
    "vkfft_forward_and_inverse": "VkFFT, transforms",
}
Key = tuple[str, int, int, int]  # what, width, height, diameter


def mask_of(width: int, height: int, diameter: float) -> NDArray[np.float64]:
    u, v = np.fft.fftfreq(width), np.fft.fftfreq(height)[:, None]
    return (u**2 + v**2 <= 0.25 * diameter**2).astype(np.float64)


def array_frame(width: int, height: int, diameter: int, double: bool) -> Callable[[], object]:
    """A frame by NumPy in complex128, or by SciPy in complex64 with as many workers as cores."""
    kind = np.float64 if double else np.float32
    phase = np.random.default_rng(1).uniform(-np.pi, np.pi, (height, width)).astype(kind)
    ideal, mask = np.ones_like(phase), mask_of(width, height, 0.01 * diameter).astype(kind)
    if double:
        return lambda: np.abs(np.fft.ifft2(np.fft.fft2(np.sqrt(ideal) * np.exp(1j * phase)) * mask)) ** 2
    i, cores = np.complex64(1j), os.cpu_count() or 1

    def frame() -> object:
        spectrum = scipy.fft.fft2(np.sqrt(ideal) * np.exp(i * phase), workers=cores)
        return np.abs(scipy.fft.ifft2(spectrum * mask, workers=cores)) ** 2

    return frame


def time_arrays(what: str, sizes: list[tuple[int, int]], double: bool, times: dict[Key, list[float]]) -> None:
    for width, height in sizes:
        frame = array_frame(width, height, 50, double)
        frame()
        for _ in range(REPETITIONS):
            began = time.perf_counter()
            frame()
            times[(what, width, height, 50)].append(1e3 * (time.perf_counter() - began))


def time_programs(
    program: Path, sizes: list[tuple[int, int]], seconds: float, times: dict[Key, list[float]], extra: dict[str, float]
) -> None:
    """All engines of the benchmark program, in turn."""
    names = "|".join(f"{name}/width:{w}/height:{h}/" for name in ENGINES for w, h in sizes)
    command = [
        str(program),
        f"--benchmark_filter=^({names}|copy_)",
        f"--benchmark_min_time={seconds}",
        f"--benchmark_repetitions={REPETITIONS}",
        "--benchmark_enable_random_interleaving=true",
        "--benchmark_format=json",
    ]
    run = subprocess.run(command, capture_output=True, text=True, check=False, env={**os.environ, "POCL_AFFINITY": "1"})
    if run.returncode:
        sys.exit(f"{program} failed: {run.stderr.strip()}")
    for result in json.loads(run.stdout)["benchmarks"]:
        if result["run_type"] != "iteration":
            continue
        if result.get("error_occurred"):
            print(f"{result['name']}: {result['error_message']}", file=sys.stderr)
            continue
        name, *parts = result["name"].replace("intensity/", "intensity+").split("/")
        name = name.replace("intensity+", "intensity/")
        if name.startswith("copy_"):
            extra[name] = max(extra.get(name, 0.0), result["bytes_per_second"])
            continue
        arguments = dict(part.split(":") for part in parts if ":" in part)
        key = (ENGINES[name], int(arguments["width"]), int(arguments["height"]), int(arguments.get("D%", 50)))
        times[key].append(result["real_time"])
        if "workspace_MB" in result:
            extra[f"workspace {key[0]} {key[1]} x {key[2]} {key[3]}"] = result["workspace_MB"]


def jitter(frames: int) -> dict[str, object]:
    """Times of single frames of a whole pipeline, sensor and all, and their power spectrum."""
    import clspeckle

    pipeline = clspeckle.Pipeline(
        phase=clspeckle.Phase(shape=(1024, 1024)),
        aperture=clspeckle.Aperture(shape=(1024, 1024), relative_diameter=0.5),
        sensor=clspeckle.Sensor(shape=(1024, 1024)),
        seed=1,
    )
    ideal = np.ones((1024, 1024), np.float32)
    for _ in range(5):
        pipeline.render(ideal)
    spent = []
    for _ in range(frames):
        began = time.perf_counter()
        pipeline.render(ideal)
        spent.append(1e3 * (time.perf_counter() - began))
    values = np.array(spent)
    power = np.abs(np.fft.rfft(values - values.mean())) ** 2 / frames
    return {
        "frames": frames,
        "median_ms": float(np.median(values)),
        "p99_ms": float(np.percentile(values, 99)),
        "worst_ms": float(values.max()),
        "times_ms": [round(float(v), 4) for v in values],
        "power_ms2": [round(float(v), 6) for v in power],
    }


def cost_law(fastest: dict[Key, float]) -> tuple[float, float, float]:
    """Nanoseconds per pixel of the device's own engine, a + b D, by relative least squares; the largest relative
    error."""
    cases = [(k, t) for k, t in fastest.items() if k[0] == "own"]
    time_per_pixel = np.array([1e6 * t / (k[1] * k[2]) for k, t in cases])
    design = np.array([[1.0, 0.01 * k[3]] for k, _ in cases]) / time_per_pixel[:, None]
    (a, b), *_ = np.linalg.lstsq(design, np.ones(len(cases)), rcond=None)
    return float(a), float(b), float(np.abs(design @ np.array([a, b]) - 1).max())


def table(fastest: dict[Key, float], sizes: list[tuple[int, int]]) -> list[str]:
    whats = ["NumPy", "SciPy", "FFTW", "VkFFT, transforms", "clFFT", "native", "native, rows first"]
    lines = [
        "| image (width x height), D = 0.5, p = 1 | own, ms | "
        + " | ".join(f"{w} / own" for w in whats)
        + " | p = 0 / p = 1 | with sensor / without |",
        "|" + "---|" * (len(whats) + 4),
    ]
    for width, height in sizes:
        own = fastest.get(("own", width, height, 50))
        if not own:
            continue
        ratios = [fastest.get((w, width, height, 50)) for w in whats]
        unpolarized = fastest.get(("own, p = 0", width, height, 50))
        exposed = fastest.get(("own, sensor", width, height, 50))
        lines.append(
            f"| {width} x {height} | {own:.2f} | "
            + " | ".join(
                f"{r / own:.{2 if w.startswith('native') else 1}f}" if r else "-"
                for w, r in zip(whats, ratios, strict=True)
            )
            + "".join(f" | {t / own:.2f}" if t else " | -" for t in (unpolarized, exposed))
            + " |"
        )
    return lines


def diameters_table(fastest: dict[Key, float], sizes: list[tuple[int, int]], bandwidth: float) -> list[str]:
    lines = [
        "| image | D | own, ms | FFTW / own | clFFT / own | times the floor |",
        "|---|---|---|---|---|---|",
    ]
    for width, height in sizes:
        for diameter in DIAMETERS:
            own = fastest.get(("own", width, height, diameter))
            if not own:
                continue
            others = [fastest.get((w, width, height, diameter)) for w in ("FFTW", "clFFT")]
            moved = (FRAME_BYTES[0] + FRAME_BYTES[1] * 0.01 * diameter) * width * height
            cells = [f"{o / own:.1f}" if o else "-" for o in others]
            lines.append(
                f"| {width} x {height} | {0.01 * diameter:g} | {own:.2f} | {cells[0]} | {cells[1]} "
                f"| {1e-3 * own * bandwidth / moved:.1f} |"
            )
    return lines


def plot(fastest: dict[Key, float], law: tuple[float, float, float], path: Path) -> None:
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    from matplotlib.ticker import NullFormatter

    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4.2))
    for what in ("NumPy", "SciPy", "clFFT", "VkFFT, transforms", "FFTW", "own"):
        points = sorted((k[1] * k[2], t) for k, t in fastest.items() if k[0] == what and k[3] == 50)
        if points:
            left.loglog(*zip(*points, strict=True), marker="o", label=what)
    left.set(xlabel="pixels", ylabel="frame, ms", title="D = 0.5, p = 1", ylim=(0.02, None))
    left.xaxis.set_minor_formatter(NullFormatter())
    left.legend(loc="lower right", ncols=2)
    sizes = sorted({k[1:3] for k in fastest if k[0] == "own"}, key=lambda s: s[0] * s[1])
    for width, height in sizes:
        points = sorted(
            (0.01 * k[3], 1e6 * t / (width * height)) for k, t in fastest.items() if k[:3] == ("own", width, height)
        )
        right.plot(*zip(*points, strict=True), marker="o", label=f"{width} x {height}")
    d = np.linspace(0.25, 1)
    right.plot(d, law[0] + law[1] * d, "k--", label=f"{law[0]:.2f} + {law[1]:.2f} D")
    right.set(xlabel="D", ylabel="own engine, ns per pixel", ylim=(0, None))
    right.legend(fontsize=8)
    figure.tight_layout()
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument(
        "--program",
        type=Path,
        default=Path("build/bin/clspeckle-bench"),
        help="the benchmark program (default: %(default)s)",
    )
    parser.add_argument("--rounds", type=int, default=5, help="rounds (default: %(default)s)")
    parser.add_argument(
        "--seconds", type=float, default=0.1, help="least time of each benchmark in a round (default: %(default)s)"
    )
    parser.add_argument("--largest", type=int, default=4096, help="widest image (default: %(default)s)")
    parser.add_argument(
        "--jitter",
        type=int,
        default=0,
        metavar="FRAMES",
        help="time so many single frames, too (needs the Python package)",
    )
    parser.add_argument("--plot", type=Path, help="a PNG of the times")
    parser.add_argument("--json", type=Path, help="all times, in ms")
    arguments = parser.parse_args()
    if not arguments.program.is_file():
        parser.error(f"{arguments.program} is not there; build it with -DCLSP_BUILD_BENCH=ON")
    sizes = [s for s in SIZES if s[0] <= arguments.largest]
    times: dict[Key, list[float]] = defaultdict(list)
    extra: dict[str, float] = {}
    for _ in tqdm(range(arguments.rounds), desc="rounds"):
        time_arrays("NumPy", sizes, True, times)
        time_arrays("SciPy", sizes, False, times)
        time_programs(arguments.program, sizes, arguments.seconds, times, extra)
    fastest = {key: min(values) for key, values in times.items()}
    law = cost_law(fastest)
    bandwidth = max(value for name, value in extra.items() if name.startswith("copy_"))
    print("\n".join(table(fastest, sizes)), "\n")
    print("\n".join(diameters_table(fastest, sizes, bandwidth)))
    floor = f"{FRAME_BYTES[0]:g} + {FRAME_BYTES[1]:g} D bytes per pixel"
    print(f"\nCopies at {1e-9 * bandwidth:.1f} GB/s (read and written); the floor moves {floor}.")
    print(f"Cost of our engine: {law[0]:.2f} + {law[1]:.2f} D ns per pixel, to {100 * law[2]:.0f} %.")
    spread = jitter(arguments.jitter) if arguments.jitter else None
    if spread:
        print(
            f"Single frames, 1024 x 1024, whole pipeline: median {spread['median_ms']:.2f} ms, "
            f"p99 {spread['p99_ms']:.2f}, worst {spread['worst_ms']:.2f}."
        )
    if arguments.plot:
        plot(fastest, law, arguments.plot)
    if arguments.json:
        report = {"/".join(map(str, key)): value for key, value in fastest.items()}
        partial = arguments.json.with_suffix(arguments.json.suffix + ".part")
        partial.write_text(json.dumps({"fastest_ms": report, "other": extra, "cost": law, "jitter": spread}, indent=1))
        partial.replace(arguments.json)


if __name__ == "__main__":
    main()

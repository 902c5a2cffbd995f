#!/usr/bin/env python3
"""Frames on a GPU by the device's own engine, by clFFT and, where CuPy is installed, by CuPy (cuFFT), in one run.

A frame goes from stored phases and an ideal image to the intensity behind a round aperture: exp(i phase) sqrt(ideal),
transform, mask, inverse transform, squared modulus, in single precision. Frames follow each other without a wait, as a
renderer's do, and a frame's time is the whole divided by their number. CuPy has two frames: as one writes it in NumPy,
and with kernels of its own for field and intensity, the transforms in place.

    build/bin/clspeckle-bench must be built (-DCLSP_BUILD_BENCH=ON)
    python3 bench/gpu_side_by_side.py --json gpu.json
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

SIZES = ((512, 512), (1024, 1024), (1280, 720), (1920, 1080), (2048, 2048), (4096, 4096))
DIAMETERS = (25, 50, 100)  # percent of what the sampling resolves
FRAMES = 50  # of CuPy between two waits
ROUNDS = 7
# As in side_by_side.py: bytes per pixel that must move, and those for each unit of D.
FRAME_BYTES = (12.0, 32.0)
Times = dict[tuple[str, int, int, int], float]  # what, width, height, diameter: us


def names_of(sizes: list[tuple[int, int]]) -> list[str]:
    """Of the program's benchmarks, those that start fast first: clFFT compiles its kernels anew at every start."""
    names = [f"intensity/own_streamed/width:{w}/height:{h}/D%:{d}/" for w, h in sizes for d in DIAMETERS]
    for engine in ("own_sensor_streamed", "own_unpolarized_streamed", "own"):
        names += [f"intensity/{engine}/width:{w}/height:{h}/D%:50/" for w, h in sizes]
    names += ["frame_of_dots/", "copy_on_device/"]
    return names + [f"intensity/clfft_streamed/width:{w}/height:{h}/D%:50/" for w, h in sizes]


def program_times(program: Path, names: list[str], seconds: float, limit: float) -> tuple[Times, dict[str, float]]:
    """One process for each, so that what was measured is kept when a run is stopped."""
    times: Times = {}
    extra: dict[str, float] = {}
    announced = False
    for name in names:
        command = [str(program), f"--benchmark_filter=^{name}", f"--benchmark_min_time={seconds}"]
        command.append("--benchmark_format=json")
        try:
            run = subprocess.run(command, capture_output=True, text=True, check=False, timeout=limit)
        except subprocess.TimeoutExpired:  # a driver's compiler may take minutes for a kernel
            print(f"{name}: stopped after {limit:g} s", file=sys.stderr, flush=True)
            continue
        if run.returncode:
            sys.exit(f"{program} failed: {run.stderr.strip()}")
        report = json.loads(run.stdout)
        if not announced:
            print(f"{report['context']['opencl_device']}, {report['context']['opencl_platform']}\n", flush=True)
            announced = True
        for result in report["benchmarks"]:
            add_result(result, times, extra)
    return times, extra


def add_result(result: dict[str, Any], times: Times, extra: dict[str, float]) -> None:
    if result.get("error_occurred"):
        print(f"{result['name']}: {result['error_message']}", file=sys.stderr)
        return
    name, *parts = result["name"].replace("intensity/", "intensity+").split("/")
    if name == "copy_on_device":
        extra["bytes_per_second"] = result["bytes_per_second"]
        return
    arguments = dict(part.split(":") for part in parts if ":" in part)
    width, height = int(arguments["width"]), int(arguments["height"])
    us = 1e3 * result["real_time"]  # benchmarks are in ms
    if name == "frame_of_dots":
        what = f"dots {width} x {height}, {'streamed' if arguments['streamed'] == '1' else 'waited for'}"
        extra[what] = us
    else:
        what = name.replace("intensity+", "")
        times[(what, width, height, int(arguments["D%"]))] = us
        what += f" {width} x {height}, D = {0.01 * int(arguments['D%']):g}"
    print(f"{what}: {us:.1f} us", file=sys.stderr, flush=True)


def cupy_frame(cupy: Any, width: int, height: int, own_kernels: bool) -> Callable[[], Any]:
    phase = cupy.random.default_rng(1).uniform(-cupy.pi, cupy.pi, (height, width)).astype(cupy.float32)
    ideal = cupy.ones((height, width), cupy.float32)
    u, v = cupy.fft.fftfreq(width), cupy.fft.fftfreq(height)[:, None]
    mask = (u**2 + v**2 <= 0.25 * 0.5**2).astype(cupy.float32)
    if not own_kernels:
        i = cupy.complex64(1j)
        return lambda: cupy.abs(cupy.fft.ifft2(cupy.fft.fft2(cupy.sqrt(ideal) * cupy.exp(i * phase)) * mask)) ** 2
    from cupyx.scipy import fft

    field = cupy.ElementwiseKernel(
        "float32 phase, float32 ideal",
        "complex64 field",
        "float s, c; sincosf(phase, &s, &c); const float a = sqrtf(ideal); field = complex<float>(a * c, a * s)",
        "clspeckle_bench_field",
    )
    power = cupy.ElementwiseKernel(
        "complex64 field",
        "float32 power",
        "power = field.real() * field.real() + field.imag() * field.imag()",
        "clspeckle_bench_power",
    )

    def frame() -> Any:
        spectrum = fft.fft2(field(phase, ideal), overwrite_x=True)
        spectrum *= mask
        return power(fft.ifft2(spectrum, overwrite_x=True))

    return frame


def cupy_times(sizes: list[tuple[int, int]]) -> Times:
    try:
        import cupy
    except ImportError:
        print("without CuPy, which is not installed", file=sys.stderr)
        return {}
    times: Times = {}
    for width, height in sizes:
        for what, own_kernels in (("CuPy", False), ("CuPy, own kernels", True)):
            frame = cupy_frame(cupy, width, height, own_kernels)
            for _ in range(3):
                frame()
            rounds = []
            for _ in range(ROUNDS):
                cupy.cuda.Device().synchronize()
                began = time.perf_counter()
                for _ in range(FRAMES):
                    frame()
                cupy.cuda.Device().synchronize()
                rounds.append(1e6 * (time.perf_counter() - began) / FRAMES)
            times[(what, width, height, 50)] = sorted(rounds)[ROUNDS // 2]
    return times


def print_tables(times: Times, extra: dict[str, float], sizes: list[tuple[int, int]]) -> None:
    others = {"CuPy": "CuPy", "CuPy, own kernels": "CuPy, own kernels", "clFFT": "clfft_streamed"}
    print("| image, D = 0.5 | own, us | waited for, us | " + " | ".join(f"{o} / own" for o in others), end="")
    print(" | p = 0 / p = 1 | with sensor / without |\n" + "|---" * (len(others) + 5) + "|")
    for width, height in sizes:
        own = times.get(("own_streamed", width, height, 50))
        if own is None:
            continue
        cells = [f"{width} x {height}", f"{own:.1f}"]
        waited = times.get(("own", width, height, 50))
        cells.append(f"{waited:.1f}" if waited else "-")
        for what in (*others.values(), "own_unpolarized_streamed", "own_sensor_streamed"):
            us = times.get((what, width, height, 50))
            cells.append(f"{us / own:.2f}" if us else "-")
        print("| " + " | ".join(cells) + " |")
    bandwidth = extra.get("bytes_per_second")
    if bandwidth:
        print("\n| image | " + " | ".join(f"D = {0.01 * d:g}, us (times the floor)" for d in DIAMETERS) + " |")
        print("|---" * (len(DIAMETERS) + 1) + "|")
        for width, height in sizes:
            cells = [f"{width} x {height}"]
            for d in DIAMETERS:
                us = times.get(("own_streamed", width, height, d))
                floor = 1e6 * (FRAME_BYTES[0] + FRAME_BYTES[1] * 0.01 * d) * width * height / bandwidth
                cells.append(f"{us:.1f} ({us / floor:.1f})" if us else "-")
            print("| " + " | ".join(cells) + " |")
        print(f"\nCopies at {1e-12 * bandwidth:.2f} TB/s (read and written).")
    for name, us in extra.items():
        if name.startswith("dots"):
            print(f"5303 {name}: {us:.1f} us")


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument(
        "--program",
        type=Path,
        default=Path("build/bin/clspeckle-bench"),
        help="the benchmark program (default: %(default)s)",
    )
    parser.add_argument(
        "--seconds", type=float, default=0.1, help="least time of each benchmark (default: %(default)s)"
    )
    parser.add_argument(
        "--limit", type=float, default=600, help="most seconds of each benchmark, with its start (default: %(default)s)"
    )
    parser.add_argument("--largest", type=int, default=4096, help="widest image (default: %(default)s)")
    parser.add_argument(
        "--no-clfft", dest="clfft", action="store_false", help="leave clFFT out: it takes long to start"
    )
    parser.add_argument("--json", type=Path, help="all times, in us")
    arguments = parser.parse_args()
    if not arguments.program.is_file():
        parser.error(f"{arguments.program} is not there; build it with -DCLSP_BUILD_BENCH=ON")
    sizes = [s for s in SIZES if s[0] <= arguments.largest]
    names = [n for n in names_of(sizes) if arguments.clfft or "clfft" not in n]
    times = cupy_times(sizes)
    measured, extra = program_times(arguments.program, names, arguments.seconds, arguments.limit)
    times.update(measured)
    print_tables(times, extra, sizes)
    if arguments.json:
        partial = arguments.json.with_suffix(arguments.json.suffix + ".part")
        partial.write_text(
            json.dumps({"us": {"/".join(map(str, k)): v for k, v in times.items()}, "other": extra}, indent=1)
        )
        partial.replace(arguments.json)


if __name__ == "__main__":
    main()

"""Designs the same 5303 beams with clspeckle and with slmsuite (PyPI), and measures both phases alike with NumPy.

slmsuite, https://github.com/slmsuite/slmsuite, is no dependency: install it into an environment of its own.

    python3 -m venv slm && slm/bin/pip install slmsuite
    PYTHONPATH=bindings/python/src CLSPECKLE_LIBRARY=build/lib/libclspeckle.so slm/bin/python bench/compare_slmsuite.py
"""

from __future__ import annotations

import importlib.metadata
import time

import numpy as np
from numpy.typing import NDArray
from slmsuite.holography.algorithms import Hologram

import clspeckle

SIDE, ITERATIONS = 512, 100


def power_budget(phase: NDArray, orders: NDArray, envelope: NDArray) -> str:
    """Efficiency with and without the envelope of the pixels, and the uniformity error."""
    field = np.fft.fft2(np.exp(1j * phase.astype(np.float64))) / phase.size
    grid = np.abs(field[orders[:, 1] % SIDE, orders[:, 0] % SIDE]) ** 2
    powers = grid * envelope**2
    spread = (powers.max() - powers.min()) / (powers.max() + powers.min())
    uniformity = f"{100 * powers.std() / powers.mean():.2f} | {100 * spread:.1f}"
    return f"{100 * powers.sum():.1f} | {100 * grid.sum():.1f} | {uniformity}"


def main() -> None:
    orders = clspeckle.dot_layout(5303).orders
    envelope = np.sinc(orders[:, 0] / SIDE) * np.sinc(orders[:, 1] / SIDE)
    target = np.zeros((SIDE, SIDE), np.float32)
    target[orders[:, 1] + SIDE // 2, orders[:, 0] + SIDE // 2] = 1 / envelope
    print(
        f"| slmsuite {importlib.metadata.version('slmsuite')} and clspeckle | efficiency % | grid % | RMS % | peak to "
        "peak % | s |"
    )
    for rule, method in {"gs": "GS", "gsw": "WGS-Leonardo", "nogrette": "WGS-Nogrette", "kim": "WGS-Kim"}.items():
        start = np.random.default_rng(0).uniform(-np.pi, np.pi, (SIDE, SIDE))
        hologram = Hologram(target, phase=start)
        began = time.perf_counter()
        hologram.optimize(method, maxiter=ITERATIONS, verbose=False)
        seconds = time.perf_counter() - began
        print(f"| slmsuite {method} | {power_budget(hologram.get_phase(), orders, envelope)} | {seconds:.1f} |")
        design = clspeckle.design_doe(orders, shape=(SIDE, SIDE), levels=0, rule=rule, iterations=ITERATIONS)
        print(
            f"| clspeckle {rule} | {power_budget(design.phase, orders, envelope)} | {design.seconds:.1f} |", flush=True
        )


if __name__ == "__main__":
    main()

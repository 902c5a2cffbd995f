"""Draws the figures of docs/method/doe.md into docs/images and prints the numbers beside them.

PYTHONPATH=bindings/python/src CLSPECKLE_LIBRARY=build/lib/libclspeckle.so .venv/bin/python docs/figures/doe.py

The design is made here, by weighted Gerchberg-Saxton (Di Leonardo, Ianni, Ruocco, Opt. Express 15, 1913, 2007), so that
the page needs nothing else; --design NAME.npy takes another one.
"""

from __future__ import annotations

import argparse
import dataclasses
from pathlib import Path

import clspeckle
import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from numpy.typing import NDArray

CELL = 640
PITCH = 0.9e-6
WAVELENGTH = 940e-9
DOTS = 2509
HALF_FIELD = (0.42, 0.30)  # of the dots, in direction cosines
BEAM = clspeckle.Beam("skewed", covariance_m2=(3.0e-4**2, 2.4e-4**2), skew=(1.5, 0.5))
DEFECTS = clspeckle.DoeDefects(
    levels=2, relative_depth_error=0.06, rounding_sigma_m=0.2e-6, etch_noise_rms_m=25e-9, feature_samples=2
)


def layout(count: int, rng: np.random.Generator) -> NDArray[np.int64]:
    """Orders of a jittered lattice over the field. Order (0, 0) is left to the undiffracted light."""
    spacing = WAVELENGTH / (CELL * PITCH)
    half = np.array(HALF_FIELD) / spacing
    step = np.sqrt(4 * half[0] * half[1] / count)
    columns = int(np.ceil(2 * half[0] / step)) + 1
    rows = int(np.ceil(count / columns)) + 1
    x, y = np.meshgrid(np.linspace(-half[0], half[0], columns), np.linspace(-half[1], half[1], rows))
    points = np.stack([x.ravel(), y.ravel()], axis=1)
    points += rng.uniform(-0.3, 0.3, points.shape) * step
    orders = np.unique(np.rint(points).astype(np.int64), axis=0)
    orders = orders[np.any(np.abs(orders) > 1, axis=1)]
    return rng.permutation(orders)[:count]


def gerchberg_saxton(orders: NDArray[np.int64], iterations: int, rng: np.random.Generator) -> NDArray[np.float32]:
    """A phase whose cell sends the same power to all orders."""
    at = orders[:, 1] % CELL, orders[:, 0] % CELL
    goal = 1 / (np.sinc(orders[:, 0] / CELL) * np.sinc(orders[:, 1] / CELL))  # against the pixels' envelope
    weight = goal.copy()
    far = np.zeros((CELL, CELL), complex)
    far[at] = weight * np.exp(2j * np.pi * rng.random(len(orders)))
    for _ in range(iterations):
        phase = np.angle(np.fft.ifft2(far))
        reached = np.fft.fft2(np.exp(1j * phase))[at]
        amplitude = np.abs(reached) / goal
        weight *= amplitude.mean() / amplitude
        far[:] = 0
        far[at] = weight * np.exp(1j * np.angle(reached))
    return phase.astype(np.float32)


def show(axes: plt.Axes, made: clspeckle.DoePattern, title: str) -> None:
    """Square root of the intensity; what is brighter than a bright dot is white."""
    x, y = made.info.half_extent_x, made.info.half_extent_y
    values = made.texels.astype(np.float64)
    bright = np.sort(values.reshape(16, 32, 16, 32).max(axis=(1, 3)).ravel())[-8]
    axes.imshow((values / bright).clip(0, 1) ** 0.5, cmap="gray", extent=(-x, x, y, -y))
    axes.set_title(title, fontsize=9)
    axes.set_xlabel("u")


def power_budget(made: clspeckle.DoePattern, name: str) -> None:
    info = made.info
    print(
        f"{name:34} dots {info.dots:.4f}  zero order {info.zero_order:.5f}  ghosts {info.ghosts:.4f}  scatter "
        f"{info.scatter:.4f}  "
        f"sum {info.dots + info.zero_order + info.ghosts + info.scatter:.7f}  RMS {info.uniformity_rms:.3f}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--design", type=Path, help="NAME.npy with NAME.json beside it")
    parser.add_argument("--folder", type=Path, default=Path(__file__).resolve().parents[1] / "images")
    arguments = parser.parse_args()
    if arguments.design:
        design = clspeckle.DoeElement.load(arguments.design)
    else:
        rng = np.random.default_rng(16)
        orders = layout(DOTS, rng)
        design = clspeckle.DoeElement(gerchberg_saxton(orders, 30, rng), PITCH, WAVELENGTH, orders=orders)

    figure, panels = plt.subplots(1, 2, figsize=(11, 5.2), layout="constrained")
    made = clspeckle.DoePattern(design, beam=BEAM, image_shape=(2048, 2048))
    power_budget(made, "multi-level, no defect")
    # The brightest texel of each 4 x 4, or no dot would be seen.
    info, texels = made.info, made.texels
    coarse = texels.reshape(512, 4, 512, 4).max(axis=(1, 3))
    extent = (-info.half_extent_x, info.half_extent_x, info.half_extent_y, -info.half_extent_y)
    panels[0].imshow((coarse / np.quantile(coarse, 0.999)).clip(0, 1) ** 0.5, cmap="gray", extent=extent)
    panels[0].set_title(f"{info.dot_count} dots, phase of any depth", fontsize=9)
    binary = clspeckle.DoePattern(design, beam=BEAM, defects=DEFECTS, image_shape=(2048, 2048))
    power_budget(binary, "binary, with defects")
    coarse = binary.texels.reshape(512, 4, 512, 4).max(axis=(1, 3))
    panels[1].imshow((coarse / np.quantile(coarse, 0.999)).clip(0, 1) ** 0.5, cmap="gray", extent=extent)
    panels[1].set_title("the same with two levels only, and the defects of the zoom: twins", fontsize=9)
    for axes in panels:
        axes.set_xlabel("u")
        axes.set_ylabel("v")
    figure.savefig(arguments.folder / "doe_pattern.png", dpi=90)

    figure, panels = plt.subplots(1, 3, figsize=(12.5, 4.4), layout="constrained")
    close = {"half_extent": 0.035, "image_shape": (512, 512)}
    ideal = np.asarray(design.orders, float)[:, :2] * [info.order_spacing_x, info.order_spacing_y]
    round_beam = clspeckle.Beam(covariance_m2=(3.0e-4**2,) * 2)
    show(panels[0], clspeckle.DoePattern.ideal(ideal, beam=round_beam, **close), "ideal dots")
    show(
        panels[1], clspeckle.DoePattern(design, beam=BEAM, defects=DEFECTS, **close), "binary, with defects: by orders"
    )
    sharp = dataclasses.replace(
        DEFECTS, rounding_sigma_m=0.0
    )  # rounding would need more samples than an aperture may have
    whole = clspeckle.DoePattern(design, beam=BEAM, defects=sharp, evaluation="aperture", **close)
    print(f"aperture: {whole.info.device_memory_bytes / 2**20:.0f} MiB of device memory")
    show(panels[2], whole, "without rounding, by the whole aperture")
    figure.savefig(arguments.folder / "doe_zoom.png", dpi=90)

    figure, axes = plt.subplots(figsize=(6, 5.4), layout="constrained")
    quarter = {"half_extent": (0.5, 0.4), "image_shape": (800, 1000)}
    layers = [clspeckle.DoePattern(design, lines=[line], **quarter) for line in (940e-9, 910e-9)]
    for made, name in zip(layers, ("at 940 nm", "at 910 nm")):
        power_budget(made, name)
    # What is dim in one colour is white in it: red dots are dark in green and blue.
    red, blue = ((t / np.quantile(t, 0.999)).clip(0, 1) ** 0.4 for t in (made.texels for made in layers))
    picture = np.stack([1 - blue, 1 - np.maximum(red, blue), 1 - red], axis=-1)
    axes.imshow(picture, extent=(-0.5, 0.5, 0.4, -0.4))
    axes.set_xlim(0.15, 0.45)
    axes.set_ylim(0.32, 0.02)
    axes.set_title("designed for 940 nm (red), used at 910 nm (blue)", fontsize=9)
    axes.set_xlabel("u")
    axes.set_ylabel("v")
    figure.savefig(arguments.folder / "doe_wavelength.png", dpi=90)


if __name__ == "__main__":
    main()

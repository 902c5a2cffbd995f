"""Draws the figures of docs/method/optics.md into docs/images: pupils, point spreads and speckle, a distortion grid.

PYTHONPATH=bindings/python/src CLSPECKLE_LIBRARY=build/lib/libclspeckle.so .venv/bin/python docs/figures/optics.py
"""

from __future__ import annotations

import argparse
from pathlib import Path

import clspeckle
import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from numpy.typing import NDArray

SIDE = 128
DIAMETER = 0.5

# Pupils of thesis Fig. 8 and their relatives.
PUPILS: dict[str, dict[str, object]] = {
    "circle": {},
    "soft rim 0.4": {"soft_rim": 0.4},
    "ring, obstruction 0.5": {"pupil": "ring", "obstruction_ratio": 0.5},
    "5 blades": {"blade_count": 5, "blade_rotation_rad": -np.pi / 2},
    "6 blades, curvature 0.7": {"blade_count": 6, "blade_curvature": 0.7},
    "image (a double slit)": {"pupil_image": np.tile(np.float32([0, 1, 0, 0, 0, 0, 1, 0]), (8, 1))},
}

ABERRATIONS: dict[str, dict[str, object]] = {
    "in focus": {},
    "defocus, w = 0.6": {"defocus_waves": 0.6},
    "defocus, w = 1.5": {"defocus_waves": 1.5},
    "astigmatism, 0.25 RMS": {"zernike_waves": {6: 0.25}},
    "coma, 0.25 RMS": {"zernike_waves": {8: 0.25}},
    "spherical, 0.25 RMS": {"zernike_waves": {11: 0.25}},
}


def aperture(side: int, **options: object) -> clspeckle.Aperture:
    """An aperture of unit mean, so that images have the same brightness."""
    return clspeckle.Aperture((side, side), relative_diameter=DIAMETER, normalization="unit_mean", **options)


def point_spread(pupil: NDArray, half: int) -> NDArray[np.float64]:
    """|IFFT2 P|^2 around its centre, peak of the unaberrated circle about 1."""
    field = np.fft.fftshift(np.fft.ifft2(pupil))
    middle = len(field) // 2
    part = field[middle - half : middle + half + 1, middle - half : middle + half + 1]
    return np.abs(part) ** 2


def show(axes: plt.Axes, image: NDArray, title: str = "", **options: object) -> None:
    axes.imshow(image, cmap="gray", interpolation="nearest", **options)
    axes.set_xticks([])
    axes.set_yticks([])
    if title:
        axes.set_title(title, fontsize=8)


def draw_pupils(path: Path) -> None:
    """Pupil, point spread (square root, to show the tails), speckle of a flat wall."""
    state = clspeckle.Phase((SIDE, SIDE), seed=1)
    state.refresh(0)
    flat = np.ones((SIDE, SIDE), np.float32)
    figure, axes = plt.subplots(3, len(PUPILS), figsize=(10, 5.2))
    for column, (name, options) in zip(axes.T, PUPILS.items()):
        stage = aperture(SIDE, **options)
        pupil = stage.pupil()
        show(column[0], np.fft.fftshift(pupil)[24:-23, 24:-23], name)
        show(column[1], np.sqrt(point_spread(pupil, 12)))
        show(column[2], stage.intensity(state, flat)[:64, :64], vmin=0, vmax=4)
    for row, name in zip(axes, ("pupil", "point spread, root", "speckle, 64 px")):
        row[0].set_ylabel(name, fontsize=8)
    figure.tight_layout(pad=0.4)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def draw_aberrations(path: Path) -> None:
    """Point spread, a wall with dots, the same speckled: the dots widen, the grain stays."""
    state = clspeckle.Phase((SIDE, SIDE), seed=2)
    state.refresh(0)
    y, x = np.mgrid[:SIDE, :SIDE]
    dots = np.exp(-(((x + 8) % 16 - 8) ** 2 + ((y + 8) % 16 - 8) ** 2) / (2 * 1.3**2)).astype(np.float32)
    figure, axes = plt.subplots(3, len(ABERRATIONS), figsize=(10, 5.2))
    for column, (name, options) in zip(axes.T, ABERRATIONS.items()):
        stage = aperture(SIDE, **options)
        spread = point_spread(stage.pupil(), 12)
        show(column[0], np.sqrt(spread), name)
        whole = np.abs(np.fft.ifft2(stage.pupil())) ** 2
        mean = np.fft.ifft2(np.fft.fft2(dots) * np.fft.fft2(whole)).real
        show(column[1], mean[:64, :64], vmin=0, vmax=0.35)
        show(column[2], stage.intensity(state, dots)[:64, :64], vmin=0, vmax=0.9)
    for row, name in zip(axes, ("point spread, root", "mean of dots, 64 px", "dots with speckle")):
        row[0].set_ylabel(name, fontsize=8)
    figure.tight_layout(pad=0.4)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def draw_lens(path: Path) -> None:
    """A grid through a barrel and a pincushion lens with the points that their formula gives; vignetting and glare."""
    height, width = 120, 160
    y, x = np.mgrid[:height, :width]
    grid = (0.1 + 0.9 * ((x % 20 == 10) | (y % 20 == 10))).astype(np.float32)
    crossings = np.stack(np.meshgrid(np.arange(10, width, 20), np.arange(10, height, 20)), axis=-1)
    figure, axes = plt.subplots(1, 4, figsize=(10, 2.3))
    for axis, k1 in zip(axes, (-0.1, 0.1)):
        lens = clspeckle.Lens((height, width), k1=k1)
        show(axis, lens.distort(grid), f"k1 = {k1}", vmin=0, vmax=1)
        points = lens.distort_points(crossings).reshape(-1, 2)
        axis.plot(points[:, 0], points[:, 1], "o", markersize=3, markerfacecolor="none", color="tab:red", linewidth=0.5)
        axis.set_xlim(-0.5, width - 0.5)
        axis.set_ylim(height - 0.5, -0.5)
    flat = np.ones((height, width), np.float32)
    show(
        axes[2],
        clspeckle.Lens((height, width), vignetting_corner_loss=0.45).finish(flat),
        "corner loss 0.45",
        vmin=0,
        vmax=1,
    )
    dot = (np.hypot(x - 80, y - 60) < 6).astype(np.float32) * 10
    lens = clspeckle.Lens((height, width), glare_fraction=0.2, glare_scale_px=6, ambient=0.02)
    show(
        axes[3],
        np.log10(np.maximum(lens.finish(dot), 1e-3)),
        "glare 0.2 over 6 px, ambient light (log)",
        vmin=-2,
        vmax=1,
    )
    figure.tight_layout(pad=0.4)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "--output", type=Path, default=Path(__file__).parents[1] / "images", help="folder of the images"
    )
    folder = parser.parse_args().output
    folder.mkdir(parents=True, exist_ok=True)
    draw_pupils(folder / "optics_pupils.png")
    draw_aberrations(folder / "optics_aberrations.png")
    draw_lens(folder / "optics_lens.png")


if __name__ == "__main__":
    main()

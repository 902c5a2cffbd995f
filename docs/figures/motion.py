"""The figure of docs/method/motion.md: autocorrelation of speckle along the three motions of the thesis (its Fig. 22 to
24), and the correlation of real speckle behind a moving pinhole beside simulations of the same series.

usage: motion.py FILE.png [--spark FOLDER]

FOLDER holds the images -20.bmp to 20.bmp of CONTRIBUTING.md. Left out, three panels are drawn.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import clspeckle
import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

sys.path[:0] = [str(Path(__file__).resolve().parents[2] / folder) for folder in ("tests", "validation")]
from reference import motion
from thesis.decorrelation import draw_series, moving_series
from thesis.theory import field_correlation

EXPERIMENTS = {  # length, displacement per step and number of steps as in the thesis
    "lateral": (0.5e-3, 7e-6, 200),
    "axial": (3e-3, 35e-6, 200),
    "rotation": (np.deg2rad(0.25), np.deg2rad(2.5) / 280, 80),
}


def draw_experiment(axes: plt.Axes, kind: str) -> None:
    length, step, count = EXPERIMENTS[kind]
    draw_series(axes, kind, moving_series(kind, step, count, (256, 256), 5.6, 22), step, length)


def spark_image(folder: Path, index: int) -> np.ndarray:
    raw = np.fromfile(folder / f"{index}.bmp", np.uint8)
    return raw[1078:].reshape(540, 720)[::-1].astype(np.float64)


def draw_spark(axes: plt.Axes, folder: Path) -> None:
    """At the place of the speckle and the largest anywhere: measured, a field that fades as R^2, and one that slides
    behind a pinhole."""
    n = np.arange(1, 16)
    measured = motion.Series([spark_image(folder, k) for k in range(-20, 21)])
    registered = [measured.registered(step) for step in n]
    mean, spread = np.array([v.mean() for v in registered]), np.array([v.std() for v in registered])
    shape, step_px, border = (540, 720), 8, 32
    rate = -measured.position[-1, 1] / 40
    large = tuple(k + 2 * border for k in shape)
    shift = np.zeros((*large, 2), np.float32)
    shift[..., 0] = step_px
    aperture = clspeckle.Aperture(large, relative_diameter=1.03 / 7.1)

    def simulated(length: float, noise: float, pinhole: bool) -> motion.Series:
        phase = clspeckle.Phase(large, dynamics="continuous", translate=True, polarization_count=1, seed=3)
        rng = np.random.default_rng(3)
        phase.refresh(0)
        images = []
        for index in range(31):
            if pinhole:
                kernel = motion.pinhole_kernel(2 * step_px, step_px, length, index)
                kernel = np.fft.fft2(kernel, large)
                field = phase.field(0)[: large[0], : large[1]]
                image = np.abs(np.fft.ifft2(np.fft.fft2(field) * kernel)) ** 2
            else:
                image = aperture.intensity(phase, np.ones(large, np.float32)).astype(np.float64)
            image = image[border:-border, border:-border]
            images.append(image + rng.normal(0, np.sqrt(noise / (1 - noise)) * image.std(), shape))
            phase.advance(index + 1, path=0.0 if pinhole else 1 / length, shift=shift)
        return motion.Series(images)

    length, noise = motion.fitted(field_correlation, n, mean, spread, rate, shape[1])
    fading = simulated(length, noise, False)
    airy_length, airy_noise = motion.fitted(motion.airy, n, mean, spread, rate, shape[1])
    pinhole = simulated(airy_length, airy_noise, True)
    x = 0.05 * n
    axes.errorbar(x, mean, spread, fmt="o", markersize=4, color="tab:blue", label="measured, at its place")
    axes.plot(
        x,
        [fading.registered(k).mean() for k in n],
        color="tab:red",
        linewidth=2,
        label=f"simulated, {0.05 * length:.2f} mm",
    )
    curve = (1 - airy_noise) * (1 - rate * n / shape[1]) * motion.airy(n / airy_length) ** 2
    axes.plot(x, curve, "k--", linewidth=1, label=f"pinhole, {0.05 * airy_length:.2f} mm")
    axes.plot(
        x,
        [measured.maximum(k).mean() for k in n],
        "s",
        markersize=4,
        mfc="none",
        color="0.5",
        label="measured, largest",
    )
    axes.plot(x, [pinhole.maximum(k).mean() for k in n], ":", color="0.5", label="pinhole simulated, largest")
    axes.set(
        title="real speckle, moving pinhole", xlabel="displacement, mm", ylim=(-0.03, 1), ylabel="cross-correlation"
    )
    axes.legend(loc="upper right", fontsize=8)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("figure", type=Path, help="PNG file to write")
    parser.add_argument("--spark", type=Path, help="folder of the 41 images")
    arguments = parser.parse_args()
    panels = 4 if arguments.spark else 3
    figure, axes = plt.subplots(1, panels, figsize=(4 * panels, 3.4), constrained_layout=True)
    for axis, kind in zip(axes, EXPERIMENTS):
        draw_experiment(axis, kind)
    axes[0].set_ylabel("autocorrelation of the intensity")
    if arguments.spark:
        draw_spark(axes[3], arguments.spark)
    figure.savefig(arguments.figure, dpi=100)


if __name__ == "__main__":
    main()

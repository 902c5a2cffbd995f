"""The figure of docs/motion.md: autocorrelation of speckle along the three motions of the thesis (its Fig. 22 to 24), and the peak correlation of
real speckle behind a moving pinhole beside a simulation of the same series.

usage: motion.py FILE.png [--spark FOLDER]      (FOLDER: shared/data/spark_memory_effect beside the checkout; left out, three panels are drawn)
"""

from __future__ import annotations

import argparse
from pathlib import Path

import clspeckle
import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

SHAPE = (256, 256)
KNOTS_PER_PATH = 0.9386677
EXPERIMENTS = {  # title, axis label, length, displacement per step and number of steps as in the thesis, factor of the axis
    "lateral": ("along X (thesis 3.2.4)", "displacement, mm", 0.5e-3, 7e-6, 200, 1e3),
    "axial": ("along Z (3.2.5)", "displacement, mm", 3e-3, 35e-6, 200, 1e3),
    "rotation": ("about Y (3.2.6)", "rotation, degrees", np.deg2rad(0.25), np.deg2rad(2.5) / 280, 80, 180 / np.pi),
}


def bell(path: np.ndarray) -> np.ndarray:
    """The field's correlation over a path (phase.h)."""
    d = KNOTS_PER_PATH * path
    return np.where(d < 2, (1 - d / 2) * np.cos(np.pi * d / 2) + np.sin(np.pi * d / 2) / np.pi, 0.0)


def pose(kind: str, step: float) -> np.ndarray:
    """How the device, or the board, moves by a step."""
    matrix = np.eye(4)
    if kind == "rotation":
        c, s = np.cos(step), np.sin(step)
        matrix[:3, :3] = [[c, 0, s], [0, 1, 0], [-s, 0, c]]
        matrix[:3, 3] = np.array([0, 0, 1]) - matrix[:3, :3] @ [0, 0, 1]
    else:
        matrix[0 if kind == "lateral" else 2, 3] = step
    return matrix


def series(kind: str, step: float, count: int) -> np.ndarray:
    """Intensities behind an f/5.6 aperture while a board at 1 m moves; (frames, pixels)."""
    motion = clspeckle.Motion(SHAPE, intrinsics=(2e5, 2e5, 127.5, 127.5))
    phase = clspeckle.Phase(SHAPE, dynamics="continuous", polarization_count=1, seed=22)
    aperture = clspeckle.Aperture(SHAPE, f_number=5.6)
    depth, ideal = np.ones(SHAPE, np.float32), np.ones(SHAPE, np.float32)
    given = clspeckle.MotionInput(depth=depth, previous_from_current=pose(kind, step))
    phase.refresh(0)
    frames = [aperture.intensity(phase, ideal).ravel()]
    for index in range(1, count + 1):
        phase.advance(index, path=motion.compute(given)["path"])
        frames.append(aperture.intensity(phase, ideal).ravel())
    return np.array(frames)


def draw_experiment(axes: plt.Axes, kind: str) -> None:
    title, label, length, step, count, factor = EXPERIMENTS[kind]
    frames = series(kind, step, count)
    displacement = step * np.arange(count + 1) * factor
    # Single pixels: like the thesis's thin lines, the product with the first frame's deviation, over a few that were bright.
    deviations = frames / frames.mean() - 1
    rng = np.random.default_rng(0)
    for pixel in rng.choice(np.flatnonzero(deviations[0] > 0.8), 12, replace=False):
        axes.plot(displacement, deviations[:, pixel] / deviations[0, pixel], color="0.8", linewidth=0.7)
    mean = [np.corrcoef(frames[0], frame)[0, 1] for frame in frames]
    axes.plot(displacement, mean, color="tab:red", linewidth=2, label=f"{frames.shape[1]} pixels")
    axes.plot(displacement, bell(displacement / factor / length) ** 2, "k--", linewidth=1, label="R²")
    axes.set(title=title, xlabel=label, ylim=(-1.1, 1.4), xlim=(0, displacement[-1]))
    axes.legend(loc="upper right", fontsize=8)


def spark_image(folder: Path, index: int) -> np.ndarray:
    raw = np.fromfile(folder / f"{index}.bmp", np.uint8)
    return raw[1078:].reshape(540, 720)[::-1].astype(np.float64)


def peaks(images: list[np.ndarray], steps: range) -> tuple[np.ndarray, np.ndarray]:
    """Mean and spread over the reference images of the peak of the normalised cross-correlation."""
    spectra = [np.fft.rfft2(image - image.mean()) / image.std() for image in images]
    values = [
        [
            np.fft.irfft2(spectra[k].conj() * spectra[k + step], s=images[0].shape).max() / images[0].size
            for k in range(len(images) - step)
        ]
        for step in steps
    ]
    return np.array([np.mean(v) for v in values]), np.array([np.std(v) for v in values])


def draw_spark(axes: plt.Axes, folder: Path) -> None:
    steps = range(1, 16)
    mean, spread = peaks([spark_image(folder, k) for k in range(-20, 21)], steps)
    n = np.array(steps)

    def misfit(length: float, noise: float) -> float:
        model = (1 - noise) * (1 - 8 * n / 720) * bell(n / length) ** 2
        return float(np.sum((model - mean)[n <= 8] ** 2))

    _, length, noise = min(
        (misfit(length, noise), length, noise) for length in np.arange(6, 14, 0.05) for noise in np.arange(0, 0.08, 0.005)
    )
    shape = (540, 720)
    phase = clspeckle.Phase(shape, dynamics="continuous", translate=True, polarization_count=1, seed=3)
    aperture = clspeckle.Aperture(shape, relative_diameter=1.03 / 7.1)
    shift = np.zeros((*shape, 2), np.float32)
    shift[..., 0] = -8
    rng = np.random.default_rng(3)
    phase.refresh(0)
    images = []
    for index in range(1, 21):
        image = aperture.intensity(phase, np.ones(shape, np.float32)).astype(np.float64)
        images.append(image + rng.normal(0, np.sqrt(noise / (1 - noise)) * image.std(), shape))
        phase.advance(index, path=1 / length, shift=shift)
    simulated, _ = peaks(images, steps)
    axes.errorbar(0.05 * n, mean, spread, fmt="o", markersize=4, color="tab:blue", label="measured, spread of 21 to 40")
    axes.plot(0.05 * n, simulated, color="tab:red", linewidth=2, label=f"simulated, length {0.05 * length:.2f} mm")
    axes.set(title="real speckle, moving pinhole", xlabel="displacement, mm", ylim=(0, 1), ylabel="peak cross-correlation")
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

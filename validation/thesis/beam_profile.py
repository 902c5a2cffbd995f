"""Fig. 27, 32 and 38: the beam's profile comes back when speckled dots are averaged."""

from __future__ import annotations

import clspeckle
import numpy as np
from matplotlib.figure import Figure
from scipy import optimize

from . import theory
from .experiment import Config, Experiment, Outcome, Progress, Verdict


def lattice(count: int, spacing_px: int, margin_px: int) -> tuple[tuple[int, int], np.ndarray]:
    """The smallest image about square that has so many dots on whole pixels, and their (x, y)."""
    columns = int(np.ceil(np.sqrt(count)))
    index = np.arange(count)
    positions = margin_px + spacing_px * np.stack([index % columns, index // columns], axis=-1)
    side = 2 * margin_px + spacing_px * (columns - 1) + 1
    return (side + side % 2, side + side % 2), positions


def patches(image: np.ndarray, positions: np.ndarray, reach: int) -> np.ndarray:
    """(dots, 2 reach + 1, 2 reach + 1) around the dots."""
    offsets = np.arange(-reach, reach + 1)
    rows, columns = positions[:, 1, None, None] + offsets[:, None], positions[:, 0, None, None] + offsets
    return image[rows, columns]


def gaussian_width(patch: np.ndarray) -> float:
    """Of a Gaussian fitted to a patch with the dot in the middle."""
    reach = patch.shape[0] // 2
    y, x = np.mgrid[-reach : reach + 1, -reach : reach + 1]
    square = (x * x + y * y).ravel()
    fit, _ = optimize.curve_fit(
        lambda q, a, s: a * np.exp(-q / (2 * s * s)), square, patch.ravel(), p0=(patch.max(), 2.0)
    )
    return float(abs(fit[1]))


def expected_patch(
    config: Config, diameter: float, oversampling: int, shape: tuple[int, int], positions: np.ndarray
) -> np.ndarray:
    """Mean of many speckled dots: the ideal ones spread by the lens, integrated over the pixel (E|h * U|^2 of a field
    without correlation). The lens's far wings bring light from the neighbours, too."""
    s = oversampling
    sigma = config["sigma_px"]
    axis = np.arange(-config["margin_px"], config["margin_px"] + 1)
    dot = np.exp(-(axis[:, None] ** 2 + axis**2) / (2 * sigma**2))
    ideal = np.zeros(shape)
    rows, columns = positions[:, 1, None, None] + axis[:, None], positions[:, 0, None, None] + axis
    inside = (rows >= 0) & (rows < shape[0]) & (columns >= 0) & (columns < shape[1])
    rows, columns, light = np.broadcast_arrays(rows, columns, dot)
    np.add.at(ideal, (rows[inside], columns[inside]), light[inside])
    fine = ideal.repeat(s, axis=0).repeat(s, axis=1)  # the ideal image is constant over a pixel
    spread = np.fft.irfft2(np.fft.rfft2(fine) * np.fft.rfft2(theory.point_spread(fine.shape, diameter / s)), fine.shape)
    pixel = spread.reshape(shape[0], s, shape[1], s).mean(axis=(1, 3))
    return patches(pixel, positions, config["patch_reach_px"]).mean(axis=0)


def averaged(config: Config, which: str, progress: Progress) -> tuple[dict[str, np.ndarray], list[Verdict]]:
    setting = config[which]
    diameter = theory.relative_diameter(setting["f_number"], config["pixel_pitch_m"], config["wavelength_m"])
    oversampling = setting["oversampling"]
    shape, positions = lattice(setting["dots"], config["spacing_px"], config["margin_px"])
    camera = clspeckle.Pipeline.from_parameters(
        shape,
        dots=clspeckle.Dots(shape, positions.astype(float), sigma_px=config["sigma_px"]),
        f_number=setting["f_number"],
        pixel_pitch_m=config["pixel_pitch_m"],
        wavelength_m=config["wavelength_m"],
        degree_of_polarization=setting["degree_of_polarization"],
        oversampling=oversampling,
        normalization="unit_mean",
        output="intensity",
        seed=config["seed"],
    )
    progress(f"{setting['dots']} dots, {setting['frames']} frames")
    total = np.zeros((2 * config["patch_reach_px"] + 1,) * 2)
    for index in range(setting["frames"]):
        found = patches(camera.render(frame_index=index, refresh="all"), positions, config["patch_reach_px"])
        total += found.mean(axis=0, dtype=float)
    mean = total / setting["frames"]
    expected = expected_patch(config, diameter, oversampling, shape, positions)
    count = setting["dots"] * setting["frames"]
    contrast = theory.contrast(setting["degree_of_polarization"])
    # Of a mean of so many pixels: the contrast times the mean; integration over the pixel only lowers it.
    error = float(np.sqrt((((mean - expected) / expected.max()) ** 2).mean()))
    noise = contrast / np.sqrt(count) * float(np.sqrt(((expected / expected.max()) ** 2).mean()))
    middle = expected[expected > 0.5 * expected.max()]
    width, expected_width = gaussian_width(mean), gaussian_width(expected)
    name = f"{setting['dots']} dots, {setting['frames']} frame" + ("s" if setting["frames"] > 1 else "")
    verdicts = [
        Verdict(
            f"difference from the spread dot, {name}, of its peak (RMS)",
            error,
            0.0,
            2.5 * noise,
            f"E|h * U|^2: the ideal dot spread by the lens; 2.5 times the deviation of a mean of {count} patches",
        ),
        Verdict(
            f"width of a Gaussian fitted, {name}, px",
            width,
            expected_width,
            4 * expected_width * contrast / np.sqrt(count * middle.size / 4),
            "that of the spread dot; 4 deviations, the dot's core being a quarter as many speckles as pixels",
        ),
    ]
    return {f"{which}_mean": mean, f"{which}_expected": expected, f"{which}_patches": found[:25]}, verdicts


def run(config: Config, progress: Progress) -> Outcome:
    arrays, verdicts = averaged(config, "measurement", progress)
    more_arrays, more = averaged(config, "single_frame", progress)
    return Outcome({**arrays, **more_arrays}, verdicts + more)


def draw(figure: Figure, outcome: Outcome, config: Config) -> None:
    figure.set_size_inches(12, 4)
    left, middle, right = figure.subfigures(1, 3)
    reach = config["patch_reach_px"]
    x = np.arange(-reach, reach + 1)
    for part, which, title in ((left, "measurement", "Fig. 27"), (middle, "single_frame", "Fig. 32")):
        setting = config[which]
        axes = part.subplots()
        mean, expected = outcome.arrays[f"{which}_mean"], outcome.arrays[f"{which}_expected"]
        peak = expected.max()
        axes.plot(x, mean[reach] / peak, "o", label="mean, across")
        axes.plot(x, mean[:, reach] / peak, "s", mfc="none", label="mean, down")
        axes.plot(x, expected[reach] / peak, "k-", linewidth=1, label="dots spread by the lens")
        axes.plot(x, np.exp(-(x**2) / (2 * config["sigma_px"] ** 2)), "k:", label="ideal dot")
        axes.set(title=f"{title}: {setting['dots']} dots, {setting['frames']} frame(s)", xlabel="px")
        axes.legend(fontsize=8)
    for axes, patch in zip(right.subplots(5, 5).flat, outcome.arrays["single_frame_patches"]):
        axes.imshow(patch, cmap="gray", vmin=0)
        axes.set(xticks=[], yticks=[])
    right.suptitle("Fig. 38: single dots")


EXPERIMENTS = [
    Experiment(
        "beam_profile",
        "27, 32, 38",
        "The beam's profile from speckled dots",
        "Averaged over 100 frames of 5303 dots, and over 2500 dots of a single unpolarized frame at f/2.8, speckle "
        "leaves the dot's shape. The mean is the ideal "
        "dot spread by the lens and integrated over the pixel, a little wider than the beam; the thesis takes it for "
        "the beam itself.",
        run,
        draw,
    )
]

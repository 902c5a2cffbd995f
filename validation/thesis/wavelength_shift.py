"""Fig. 5: a laser off the element's wavelength moves the dots away from the axis or towards it."""

from __future__ import annotations

import clspeckle
import numpy as np
from matplotlib.figure import Figure

from .beam_profile import patches
from .experiment import Config, Experiment, Outcome, Progress, Verdict


def centres(image: np.ndarray, near: np.ndarray, reach: int) -> np.ndarray:
    """Centroids around whole pixels, (dots, 2) as x, y."""
    found = patches(image, near, reach).astype(float)
    offsets = np.arange(-reach, reach + 1)
    total = found.sum(axis=(1, 2))
    x, y = (found.sum(axis=1) @ offsets) / total, (found.sum(axis=2) @ offsets) / total
    return near + np.stack([x, y], axis=-1)


def run(config: Config, progress: Progress) -> Outcome:
    shape = tuple(config["shape"])
    spacing, reach = config["spacing_px"], config["patch_reach_px"]
    axis = np.array([(shape[1] - 1) / 2, (shape[0] - 1) / 2])
    counts = (np.array(shape[::-1]) / 2 - reach - 1) // spacing
    x, y = np.meshgrid(np.arange(-counts[0], counts[0] + 1), np.arange(-counts[1], counts[1] + 1))
    design = axis + spacing * np.stack([x.ravel(), y.ravel()], axis=-1)
    shift = (config["wavelength_m"] - config["design_wavelength_m"]) / config["design_wavelength_m"]
    progress("two wavelengths")
    dots = clspeckle.Dots(shape, design, sigma_px=config["sigma_px"])
    before = dots.render()
    dots.configure(relative_wavelength_shift=shift)
    after = dots.render()
    first = centres(before, np.round(design).astype(int), reach)
    second = centres(after, np.round(axis + (1 + shift) * (design - axis)).astype(int), reach)
    radius, moved = np.linalg.norm(first - axis, axis=1), second - first
    outward = ((moved * (first - axis)).sum(axis=1))[radius > 0] / radius[radius > 0]
    slope = float((outward * radius[radius > 0]).sum() / (radius**2).sum())
    verdicts = [
        Verdict(
            "shift by distance from the axis",
            slope,
            shift,
            1e-5,
            "a grating deflects in proportion to the wavelength: (910 - 940) / 940",
        ),
        Verdict(
            "largest shift across that direction, px",
            float(np.abs(np.cross(moved, (first - axis) / np.maximum(radius, 1)[:, None])).max()),
            0.0,
            1e-3,
            "the shift is radial",
        ),
        Verdict(
            "shift of the dot on the axis, px",
            float(np.linalg.norm(moved[radius.argmin()])),
            0.0,
            1e-3,
            "the zero order stays",
        ),
    ]
    return Outcome(
        {"first": first, "second": second, "radius": radius, "moved": np.linalg.norm(moved, axis=1)}, verdicts
    )


def draw(figure: Figure, outcome: Outcome, config: Config) -> None:
    figure.set_size_inches(10, 4)
    picture, curve = figure.subplots(1, 2)
    for key, color, wavelength in (
        ("first", "tab:red", "design_wavelength_m"),
        ("second", "tab:blue", "wavelength_m"),
    ):
        picture.plot(*outcome.arrays[key].T, ".", markersize=3, color=color, label=f"{config[wavelength] * 1e9:.0f} nm")
    picture.set(title="dots (Fig. 5)", aspect="equal", xlabel="px", ylabel="px")
    picture.invert_yaxis()
    picture.legend(loc="upper right")
    curve.plot(outcome.arrays["radius"], outcome.arrays["moved"], ".", markersize=3)
    curve.set(title="shift", xlabel="distance from the axis, px", ylabel="px")


EXPERIMENTS = [
    Experiment(
        "wavelength_shift",
        "5",
        "A laser of 910 nm behind an element for 940 nm",
        "Every dot moves towards the axis by 3.2 % of its distance. Centres are measured in rendered frames.",
        run,
        draw,
    )
]

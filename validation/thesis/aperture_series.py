"""Fig. 33 and 34: a dot behind smaller and smaller apertures, and the light that is left."""

from __future__ import annotations

import clspeckle
import numpy as np
from matplotlib.figure import Figure

from . import theory
from .beam_profile import lattice, patches
from .experiment import Config, Experiment, Outcome, Progress, Verdict


def run(config: Config, progress: Progress) -> Outcome:
    shape, positions = lattice(config["dots"], config["spacing_px"], config["margin_px"])
    dots = clspeckle.Dots(shape, positions.astype(float), sigma_px=config["sigma_px"])
    ideal = dots.render()
    diameters = np.linspace(1.0, config["smallest"], config["steps"]) * config["largest_relative_diameter"]
    totals = np.empty((len(diameters), config["frames"]))
    shown = []
    progress(f"{len(diameters)} apertures")
    phase = clspeckle.Phase(shape, polarization_count=1, seed=config["seed"])
    for k, diameter in enumerate(diameters):
        aperture = clspeckle.Aperture(shape, relative_diameter=float(diameter), normalization="transmission")
        for index in range(config["frames"]):
            phase.refresh(index)
            image = aperture.intensity(phase, ideal)
            totals[k, index] = image.sum(dtype=float)
        shown.append(patches(image, positions, config["patch_reach_px"])[config["shown_dot"]])
    left = totals.mean(axis=1) / totals[0].mean()
    # Exactly: the pupil's part of the frequency grid. The same phases for all apertures; each total is a sum over many
    # speckles.
    exact = np.array([theory.pupil(shape, float(d)).mean() for d in diameters])
    exact /= exact[0]
    error = totals.std(axis=1, ddof=1) / totals.mean(axis=1) / np.sqrt(config["frames"])
    deviation = np.hypot(error, error[0])
    relative = diameters / diameters[0]
    # A parabola through the origin, as the thesis fits one.
    factor = float((left * relative**2).sum() / (relative**4).sum())
    verdicts = [
        Verdict(
            "largest difference from the pupil's area, in standard errors",
            float(np.abs((left - exact) / deviation)[1:].max()),
            0.0,
            4.0,
            "energy behind the aperture is the part of the spectrum that it passes (Parseval); standard errors over "
            "frames",
        ),
        Verdict(
            "factor of D^2", factor, 1.0, 0.01, "area of a circle; 1 %: the disc on a grid of frequencies, and speckle"
        ),
    ]
    return Outcome({"relative_diameter": relative, "left": left, "shown": np.array(shown), "error": error}, verdicts)


def draw(figure: Figure, outcome: Outcome, config: Config) -> None:
    figure.set_size_inches(11, 4)
    pictures, curve = figure.subfigures(1, 2)
    for axes, image, relative in zip(
        pictures.subplots(3, 3).flat, outcome.arrays["shown"], outcome.arrays["relative_diameter"]
    ):
        axes.imshow((image / outcome.arrays["shown"][0].max()).clip(0, 1) ** (1 / 2.2), cmap="gray", vmin=0, vmax=1)
        axes.set(xticks=[], yticks=[])
        axes.set_title(f"{relative:.0%}", fontsize=9)
    axes = curve.subplots()
    axes.plot(outcome.arrays["relative_diameter"], outcome.arrays["left"], "o", label="simulated")
    x = np.linspace(0, 1, 100)
    axes.plot(x, x**2, color="tab:orange", label="D²")
    axes.set(title="total intensity (Fig. 34)", xlabel="aperture's diameter, of the largest", ylabel="of the largest")
    axes.legend()


EXPERIMENTS = [
    Experiment(
        "aperture_series",
        "33, 34",
        "Smaller and smaller apertures",
        "Dots behind apertures from full diameter to a fifth, the same phases each time; square roots as in the "
        "thesis's picture (gamma 2.2). What is left of the "
        "light is the pupil's area.",
        run,
        draw,
    )
]

"""Fig. 31: the law of one pixel's intensity over many independent images."""

from __future__ import annotations

import clspeckle
import numpy as np
from matplotlib.figure import Figure
from scipy import stats

from . import theory
from .experiment import Config, Experiment, Outcome, Progress, Verdict

# Name: field, degree of polarization, which relative diameter of the settings.
CASES = {
    "polarized": ("circular_gaussian", 1.0, "relative_diameter"),
    "unpolarized": ("circular_gaussian", 0.0, "relative_diameter"),
    "polarized, one phasor per pixel, open aperture": ("unit_phasor", 1.0, "open_relative_diameter"),
    "unpolarized, one phasor per pixel, open aperture": ("unit_phasor", 0.0, "open_relative_diameter"),
}


def samples(config: Config, field: str, p: float, diameter: float) -> np.ndarray:
    """One pixel of many images."""
    shape = tuple(config["shape"])
    camera = clspeckle.Pipeline.from_parameters(
        shape,
        field=field,
        degree_of_polarization=p,
        polarization_count=1 if p == 1 else 2,
        relative_diameter=diameter,
        normalization="unit_mean",
        output="intensity",
        seed=config["seed"],
    )
    ideal = np.ones(shape, np.float32)
    row, column = config["pixel"]
    frames = camera.frames(clspeckle.Frame(ideal, refresh="all", frame_index=k) for k in range(config["images"]))
    return np.array([image[row, column] for image in frames], float)


def law(p: float) -> stats.rv_continuous:
    """Of unit mean: exponential, or the Gamma law of shape 2 (the sum of two equal exponential ones)."""
    return stats.expon() if p == 1 else stats.gamma(2, scale=0.5)


def run(config: Config, progress: Progress) -> Outcome:
    arrays, verdicts = {}, []
    count = config["images"]
    bound = theory.kolmogorov_bound(count)
    for name, (field, p, which) in CASES.items():
        progress(name)
        diameter = config[which]
        x = samples(config, field, p, diameter)
        arrays[name] = x.astype(np.float32)
        deficit = theory.unit_phasor_deficit(tuple(config["shape"]), diameter) if field == "unit_phasor" else 0.0
        contrast = theory.contrast(p, deficit)
        form = "sqrt((1 + p^2) / 2)" if not deficit else "sqrt((1 + p^2) / 2 (1 - sum |h|^4 / (sum |h|^2)^2))"
        verdicts.append(
            Verdict(
                f"contrast, {name}",
                x.std() / x.mean(),
                contrast,
                4 * theory.contrast_deviation(contrast, count),
                f"{form} (Goodman); 4 standard errors of {count} samples",
            )
        )
        if not deficit:
            distance = stats.kstest(x, law(p).cdf).statistic
            what = "exponential" if p == 1 else "Gamma law of shape 2"
            verdicts.append(
                Verdict(
                    f"distance from the {what}, {name}",
                    distance,
                    0.0,
                    bound,
                    "Kolmogorov's bound, exceeded by chance once in 1000",
                )
            )
    # The thesis calls its eq. 38, x exp(-x), a Rayleigh law. That one is another law, and the samples are as far from
    # it as it is.
    rayleigh = stats.rayleigh(scale=np.sqrt(2 / np.pi))
    grid = np.linspace(0, 12, 100001)
    apart = np.abs(rayleigh.cdf(grid) - law(0).cdf(grid)).max()
    distance = stats.kstest(arrays["unpolarized"].astype(float), rayleigh.cdf).statistic
    verdicts.append(
        Verdict(
            "distance from a Rayleigh law, unpolarized",
            distance,
            apart,
            bound,
            "distance of the Gamma law of shape 2 from the Rayleigh law of the same mean: the thesis's name for eq. 38 "
            "is wrong",
        )
    )
    return Outcome(arrays, verdicts)


def draw(figure: Figure, outcome: Outcome, config: Config) -> None:
    figure.set_size_inches(12, 3.6)
    axes = figure.subplots(1, 3)
    x = np.linspace(0, 6, 400)
    bins = np.linspace(0, 6, 80)
    for axis, name, p in ((axes[0], "polarized", 1), (axes[1], "unpolarized", 0)):
        axis.hist(outcome.arrays[name], bins, density=True, color="0.75")
        axis.plot(x, law(p).pdf(x), color="tab:red", label="exponential" if p else "Gamma, shape 2")
        axis.set(title=name, xlabel="intensity / mean", ylabel="density")
    axes[1].plot(x, stats.rayleigh(scale=np.sqrt(2 / np.pi)).pdf(x), "k:", label="Rayleigh")
    open_name = "polarized, one phasor per pixel, open aperture"
    axes[2].hist(outcome.arrays[open_name], bins, density=True, color="0.75")
    axes[2].plot(x, law(1).pdf(x), color="tab:red", label="exponential")
    axes[2].set(title=f"one phasor per pixel, D = {config['open_relative_diameter']:g}", xlabel="intensity / mean")
    for axis in axes:
        axis.legend()


EXPERIMENTS = [
    Experiment(
        "intensity_law",
        "31",
        "The intensity of a single pixel",
        "64 000 independent images of 128 x 128 for each case, one pixel of each. Polarized speckle follows the "
        "exponential law, unpolarized the "
        "law of eq. 38, x exp(-x): a Gamma law of shape 2, which the thesis calls Rayleigh. One phasor per pixel, as "
        "in the thesis, falls "
        "short of full contrast, the more the wider the aperture: the offset that the thesis puts down to the small "
        "image.",
        run,
        draw,
    )
]

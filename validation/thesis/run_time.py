"""Fig. 30 and section 4.1: run time against pixels, and memory."""

from __future__ import annotations

import time

import clspeckle
import numpy as np
from matplotlib.figure import Figure

from . import theory
from .experiment import Config, Experiment, Outcome, Progress, Verdict


def numpy_frame(rng: np.random.Generator, mask: np.ndarray) -> np.ndarray:
    """The thesis's CPU version of a polarized frame (3.3): complex128, one phasor per pixel."""
    field = np.exp(2j * np.pi * rng.random(mask.shape))
    return np.abs(np.fft.ifft2(np.fft.fft2(field) * mask)) ** 2


def median_time(work: object, repeats: int) -> float:
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        work()  # type: ignore[operator]
        times.append(time.perf_counter() - start)
    return float(np.median(times))


def run(config: Config, progress: Progress) -> Outcome:
    rng = np.random.default_rng(config["seed"])
    pixels, times = [], {"NumPy": [], "polarized": [], "unpolarized": []}
    workspace = {}
    for side in config["sides"]:
        progress(f"{side} x {side}")
        shape = (side, side)
        pixels.append(side * side)
        mask = theory.pupil(shape, config["relative_diameter"])
        repeats = max(3, min(config["most_repeats"], int(config["pixels_each"] / (side * side))))
        times["NumPy"].append(median_time(lambda shape=mask: numpy_frame(rng, shape), max(2, repeats // 8)))
        for name, count in (("polarized", 1), ("unpolarized", 2)):
            phase = clspeckle.Phase(shape, polarization_count=count, field="unit_phasor", seed=config["seed"])
            aperture = clspeckle.Aperture(
                shape, relative_diameter=config["relative_diameter"], degree_of_polarization=2.0 - count
            )
            camera = clspeckle.Pipeline(phase=phase, aperture=aperture)
            ideal, image = np.ones(shape, np.float32), np.empty(shape, np.float32)
            camera.render(ideal, out=image)
            times[name].append(
                median_time(lambda c=camera, i=ideal, o=image: c.render(i, refresh="all", out=o), repeats)
            )
            workspace[name] = aperture.info().workspace_bytes
    pixels = np.array(pixels, float)
    large = pixels >= config["fit_from_side"] ** 2
    ours, both, theirs = (np.array(times[name]) for name in ("polarized", "unpolarized", "NumPy"))
    # The exponent of time = c (n log n)^e over the large sizes.
    exponent = float(np.polyfit(np.log(pixels[large] * np.log(pixels[large])), np.log(ours[large]), 1)[0])
    # The thesis's arrays at the largest size: two complex images, a phase map, in single precision (section 4.1).
    thesis_bytes = {"polarized": 5 * 4 * pixels[-1], "unpolarized": 6 * 4 * pixels[-1]}
    verdicts = [
        Verdict("exponent of n log n", exponent, 1.0, 0.25, "the Fourier transforms dominate; 0.25: caches"),
        Verdict(
            "unpolarized over polarized, largest size",
            float(both[-1] / ours[-1]),
            1.75,
            0.75,
            "twice the transforms (thesis 4.1), but not twice the images that are read and written: 1 to 2.5",
        ),
        Verdict(
            "log10 of NumPy's time over ours, largest size",
            float(np.log10(theirs[-1] / ours[-1])),
            2.0,
            1.0,
            "the thesis's Fig. 30: seconds against milliseconds; from 10 to 1000 times",
        ),
    ]
    for name, most in thesis_bytes.items():
        own = workspace[name] + 4 * pixels[-1] * (1 if name == "polarized" else 2)
        verdicts.append(
            Verdict(
                f"work memory and phases over the thesis's, {name}, largest size",
                float(own / most),
                0.5,
                0.5,
                "at most what section 4.1 counts: 80 MB at 2048 x 2048, 96 MB with a second phase map",
            )
        )
    return Outcome({"pixels": pixels, **{name: np.array(t) for name, t in times.items()}}, verdicts)


def draw(figure: Figure, outcome: Outcome, config: Config) -> None:
    figure.set_size_inches(7, 4)
    axes = figure.subplots()
    for name in ("NumPy", "unpolarized", "polarized"):
        axes.loglog(outcome.arrays["pixels"], 1e3 * outcome.arrays[name], "o-", markersize=3, label=name)
    n = outcome.arrays["pixels"]
    reference = n * np.log(n)
    axes.loglog(n, 1e3 * outcome.arrays["polarized"][-1] * reference / reference[-1], "k:", label="n log n")
    axes.set(title="one frame (Fig. 30)", xlabel="pixels", ylabel="ms")
    axes.legend()


EXPERIMENTS = [
    Experiment(
        "run_time",
        "30",
        "Run time and memory",
        "Medians of frames of uniform light through Python, on this machine, beside the thesis's own way in NumPy. "
        "Times differ from run to run; verdicts are on ratios.",
        run,
        draw,
        timed=True,
    )
]

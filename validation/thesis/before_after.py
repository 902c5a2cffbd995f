"""Fig. 39: a frame before and after its speckle."""

from __future__ import annotations

import clspeckle
import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from . import theory
from .experiment import Config, Experiment, Outcome, Progress, Verdict
from .scene_files import Scene, truth


def axis_ratios(depth: clspeckle.Depth, frame: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Longer over shorter axis of the ellipses that were fitted within a pixel of places; NaN where there is none."""
    dots = depth.measure(frame).dots
    dots = dots[np.isfinite(dots["shape_px2"]).all(axis=1)]
    centres = np.stack([dots["x_px"], dots["y_px"]], axis=-1)
    ratios = np.full(len(places), np.nan)
    xx, xy, yy = dots["shape_px2"].T
    middle, half = (xx + yy) / 2, np.hypot((xx - yy) / 2, xy)
    for k, place in enumerate(places):
        distance = np.linalg.norm(centres - place, axis=1)
        nearest = distance.argmin()
        if distance[nearest] < 1.0:
            ratios[k] = np.sqrt((middle[nearest] + half[nearest]) / (middle[nearest] - half[nearest]))
    return ratios


def independent(ideal: np.ndarray, diameter: float, rng: np.random.Generator) -> np.ndarray:
    """Unpolarized speckle of an image in NumPy, float64: two fields of circular Gaussian numbers through the pupil."""
    aperture = theory.pupil(ideal.shape, diameter)
    # The mean stays: each field's power is that of the light that the pupil lets pass.
    aperture = aperture / np.sqrt(aperture.mean())
    intensity = np.zeros(ideal.shape)
    for _ in range(2):
        field = rng.normal(size=ideal.shape) + 1j * rng.normal(size=ideal.shape)
        intensity += np.abs(np.fft.ifft2(np.fft.fft2(field * np.sqrt(ideal / 4)) * aperture)) ** 2
    return intensity


def run(config: Config, progress: Progress) -> Outcome:
    scene = Scene(config["scene"])
    left, top, width, height = config["crop"]
    shape = (height, width)
    full_scale = 2 ** config["bits"] - 1
    ideal = scene.pattern().lookup(scene.geometry)[top : top + height, left : left + width]
    ideal = ideal * np.float32(config["peak_of_full_scale"] * full_scale / np.percentile(ideal, 99.9))
    lens = {
        "f_number": config["f_number"],
        "pixel_pitch_m": scene.pixel_pitch_m,
        "wavelength_m": scene.wavelength_m,
        "degree_of_polarization": 0.0,
        "normalization": "unit_mean",
        "seed": config["seed"],
    }
    black, noise = config["black_level_dn"], config["read_noise_dn"]
    camera = clspeckle.Pipeline.from_parameters(
        shape, **lens, bits=config["bits"], exposure_gain_dn=1.0, black_level_dn=black, read_noise_dn=noise
    )
    progress("before and after")
    before = camera.render(ideal, frame_index=0, illumination="incoherent")
    after = camera.render(ideal, frame_index=0)
    # The same speckle before the sensor.
    intensity = clspeckle.Pipeline.from_parameters(shape, **lens, output="intensity").render(ideal)

    diameter = theory.relative_diameter(config["f_number"], scene.pixel_pitch_m, scene.wavelength_m)
    spread = theory.point_spread(shape, diameter)
    mean = np.real(np.fft.ifft2(np.fft.fft2(ideal.astype(float)) * np.fft.fft2(spread)))
    lit = mean > config["lit_of_peak"] * np.percentile(mean, 99.9)
    ratio = (intensity / np.maximum(mean, 1e-12))[lit]
    # Pixels of one speckle are not independent: the correlation of the intensity is that of the field, squared.
    correlation = np.abs(np.fft.ifft2(theory.pupil(shape, diameter))) ** 2
    speckles = int(lit.sum() * correlation[0, 0] / correlation.sum())
    contrast = theory.contrast(0.0)
    verdicts = [
        Verdict(
            "mean of speckled over smooth image, where there is light",
            float(ratio.mean()),
            1.0,
            5 * contrast / np.sqrt(speckles),
            "speckle takes as much as it gives; the smooth image is the ideal one through the lens; 5 standard errors "
            f"of {speckles} speckles",
        ),
        Verdict(
            "contrast of that ratio",
            float(ratio.std() / ratio.mean()),
            contrast,
            5 * theory.contrast_deviation(contrast, speckles),
            "at every pixel, on dots as between them, the field is a circular Gaussian: unpolarized 1 / sqrt(2); 5 "
            "standard errors",
        ),
    ]
    # Where the laser gives nothing; after, the lens brings a little light there from the dots.
    dark = ideal == 0
    halo = float((mean[dark] ** 2).mean() * contrast**2 + mean[dark].var())
    for name, frame, light in (("before", before, 0.0), ("after", after, halo)):
        codes = frame[dark].astype(float)
        # Of a standard deviation, with the fourth moment: speckle is no normal law.
        moments = [((codes - codes.mean()) ** k).mean() for k in (2, 4)]
        standard_error = 0.5 * np.sqrt((moments[1] / moments[0] - moments[0]) / codes.size)
        verdicts.append(
            Verdict(
                f"noise of the dark pixels {name}, codes",
                float(codes.std()),
                float(np.sqrt(noise**2 + 1 / 12 + light)),
                float(5 * standard_error),
                "the additive noise is in both: read noise and rounding"
                + (", and the speckled halos of dots" if light else "")
                + f"; 5 standard errors of {int(dark.sum())} pixels",
            )
        )

    progress("shapes of dots")
    met = truth(scene)
    places = met["pixel"][met["visible"]] - (left, top)
    places = places[((places > 8) & (places < np.array([width, height]) - 9)).all(axis=1)]
    # None of the dots' identities is asked for: detection and fits alone.
    fits = clspeckle.Depth(
        shape, dot_sigma_px=scene.sigma_px, black_level_dn=black, read_noise_dn=noise, min_correlation=0.4
    )
    rng = np.random.default_rng(config["seed"])
    simulated = black + independent(ideal.astype(float), diameter, rng) + rng.normal(0, noise, shape)
    ratios = np.stack([axis_ratios(fits, frame, places) for frame in (before, after, simulated)])
    ratios = ratios[:, np.isfinite(ratios).all(axis=0)]
    median_before, median_after, median_simulated = (float(np.median(row)) for row in ratios)
    # 1.2533 sd / sqrt(n) is a median's standard error where the law is normal; two of them, 5 of the sum.
    tolerance = 5 * 1.2533 * np.hypot(ratios[1].std(), ratios[2].std()) / np.sqrt(ratios.shape[1])
    verdicts += [
        Verdict(
            "longer over shorter axis of a dot after, median",
            median_after,
            median_simulated,
            float(tolerance),
            f"that of the same dots with speckle by NumPy in float64; {ratios.shape[1]} dots, 5 standard errors of the "
            "difference of the medians",
        ),
        Verdict(
            "part of that elongation that is there before",
            (median_before - 1) / (median_after - 1),
            0.0,
            0.35,
            "the thesis: more round before; what is left are slopes, texture and noise",
        ),
    ]
    arrays = {"before": before, "after": after, "ratios": ratios.astype(np.float32)}
    return Outcome(arrays, verdicts)


def draw(figure: Figure, outcome: Outcome, config: Config) -> None:
    figure.set_size_inches(15, 7.6)
    axes = figure.subplot_mosaic(
        [["before", "after", "shape"], ["before zoom", "after zoom", "shape"]], width_ratios=(1, 1, 0.7)
    )
    x, y, width, height = config["zoom"]
    for key, title in (("before", "before speckle"), ("after", "after (Fig. 39)")):
        signal = np.sqrt(np.maximum(outcome.arrays[key].astype(float) - config["black_level_dn"], 0))
        limit = np.percentile(signal, 99.8)
        axes[key].imshow(signal, cmap="gray", vmax=limit)
        axes[key].add_patch(Rectangle((x - 0.5, y - 0.5), width, height, fill=False, color="tab:orange"))
        axes[key].set(title=title, xticks=[], yticks=[])
        near = signal[y : y + height, x : x + width]
        axes[f"{key} zoom"].imshow(near, cmap="gray", vmax=limit, interpolation="nearest")
        axes[f"{key} zoom"].set(xticks=[], yticks=[])
    bins = np.linspace(1, 2.5, 46)
    for row, label, style in zip(
        outcome.arrays["ratios"],
        ("before", "after", "after, by NumPy"),
        ({"color": "0.6"}, {"color": "tab:blue"}, {"color": "black", "linestyle": "--"}),
    ):
        axes["shape"].hist(np.minimum(row, 2.5), bins, histtype="step", label=label, **style)
    axes["shape"].set(title="longer over shorter axis of the dots", yticks=[])
    axes["shape"].legend(fontsize=8)


EXPERIMENTS = [
    Experiment(
        "before_after",
        "39",
        "A frame before and after its speckle",
        "The office desk under its dots, with the same noise in both frames, and a lens that gives a little speckle "
        "(f/4). Before, dots are round; "
        "after, no dot is. The thesis shows the two pictures and gives no number.",
        run,
        draw,
    )
]

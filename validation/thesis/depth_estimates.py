"""Fig. 28 and 35: what speckle does to depth, at rest and in motion, and with the lens's aperture."""

from __future__ import annotations

import clspeckle
import numpy as np
from matplotlib.figure import Figure

from . import theory
from .experiment import Config, Experiment, Outcome, Progress, Verdict


class Rig:
    """A wall that faces a camera, and a laser beside it: dots where the camera sees them."""

    def __init__(self, config: Config) -> None:
        self.config = config
        self.shape: tuple[int, int] = tuple(config["shape"])
        focal, baseline, self.depth_m = config["focal_length_px"], config["baseline_m"], config["depth_m"]
        centre = (self.shape[1] - 1) / 2, (self.shape[0] - 1) / 2
        layout = clspeckle.dot_layout(
            config["dots"],
            lattice=False,
            half_angle_x_rad=np.arctan(0.5 * self.shape[1] / focal),
            half_angle_y_rad=np.arctan(0.5 * self.shape[0] / focal),
            seed=config["seed"],
        )
        u, v = layout.directions.T
        tangent = layout.directions / np.sqrt(1 - u**2 - v**2)[:, None]
        pose = np.eye(3, 4)
        pose[0, 3] = -baseline
        self.places = focal * tangent + centre + (focal * baseline / self.depth_m, 0.0)
        self.dots = clspeckle.Dots(self.shape, self.places, sigma_px=config["sigma_px"])
        self.metres_per_px = self.depth_m**2 / (focal * baseline)
        self.estimate = clspeckle.Depth(
            self.shape,
            tangent,
            pose,
            (focal, focal, *centre),
            near_m=0.7 * self.depth_m,
            far_m=1.5 * self.depth_m,
            dot_sigma_px=config["fitted_sigma_px"],
            black_level_dn=config["black_level_dn"],
            min_correlation=config["min_correlation"],
        )

    def camera(self, f_number: float) -> clspeckle.Pipeline:
        full_scale = 2 ** self.config["bits"] - 1
        return clspeckle.Pipeline.from_parameters(
            self.shape,
            dots=self.dots,
            f_number=f_number,
            pixel_pitch_m=self.config["pixel_pitch_m"],
            wavelength_m=self.config["wavelength_m"],
            degree_of_polarization=self.config["degree_of_polarization"],
            oversampling=2,
            normalization="unit_mean",
            bits=self.config["bits"],
            exposure_gain_dn=self.config["peak_of_full_scale"] * full_scale,
            black_level_dn=self.config["black_level_dn"],
            read_noise_dn=self.config["noise_of_full_scale"] * full_scale,
            seed=self.config["seed"],
        )

    def depths(self, frame: np.ndarray) -> np.ndarray:
        """Of each dot of the pattern, in metres; NaN where none was placed."""
        result = self.estimate.measure(frame)
        depth = np.full(len(self.places), np.nan)
        placed = result.placed
        depth[placed["dot_index"]] = placed["depth_m"]
        return depth


def spread(depths: np.ndarray) -> float:
    """Standard deviation of a normal law with the same quartiles: a few wrong identities do not count."""
    low, high = np.nanpercentile(depths, [25, 75])
    return float((high - low) / 1.349)


def consistency_run(config: Config, progress: Progress) -> Outcome:
    rig = Rig(config)
    frames = config["frames"]
    series = {}
    for name, refresh in (("still", None), ("moving", "all")):
        progress(f"{frames} frames, {name}")
        camera = rig.camera(config["f_number"])
        series[name] = np.array([rig.depths(camera.render(frame_index=k, refresh=refresh)) for k in range(frames)])
    always = np.isfinite(series["still"]).sum(axis=0) >= 0.8 * frames
    always &= np.isfinite(series["moving"]).sum(axis=0) >= 0.8 * frames
    within = {name: np.median([spread(column) for column in depths[:, always].T]) for name, depths in series.items()}
    between = spread(np.nanmean(series["still"][:, always], axis=0))
    verdicts = [
        Verdict(
            "log10 of the fluctuation in motion over that at rest",
            float(np.log10(within["moving"] / within["still"])),
            1.0,
            0.35,
            "the thesis: an order of magnitude between noise and speckle; from 4.5 to 22 times",
        ),
        Verdict(
            "bias from dot to dot at rest over the fluctuation in motion",
            between / within["moving"],
            1.0,
            0.2,
            "what is new in each frame in motion is fixed at rest: the same law; 20 %: quartiles of hundreds of dots",
        ),
    ]
    return Outcome({name: depths[:, always][:, :10] for name, depths in series.items()}, verdicts)


def consistency_draw(figure: Figure, outcome: Outcome, config: Config) -> None:
    figure.set_size_inches(10, 3.8)
    axes = figure.subplots(1, 2, sharey=True)
    for axis, (name, title) in zip(axes, (("still", "nothing moves"), ("moving", "new speckle in each frame"))):
        axis.plot(outcome.arrays[name], linewidth=1)
        axis.set(title=f"{title} (Fig. 28)", xlabel="frame")
    axes[0].set_ylabel("depth of ten dots, m")


def f_number_run(config: Config, progress: Progress) -> Outcome:
    rig = Rig(config)
    arrays, spreads, verdicts = {}, {}, []
    ideal = rig.dots.render()
    for f_number in (0.0, *config["f_numbers"]):
        name = f"f/{f_number:g}"
        progress(name)
        camera = rig.camera(f_number or config["f_numbers"][0])
        depths = []
        for k in range(config["frames"]):
            # f/0 of the thesis: no speckle, the other noises stay.
            frame = (
                camera.render(frame_index=k, refresh="all")
                if f_number
                else camera.render(ideal, frame_index=k, illumination="incoherent")
            )
            depths.append(rig.depths(frame))
        depth = np.array(depths)
        arrays[name] = depth.astype(np.float32)
        spreads[f_number] = spread(depth)
        count = int(np.isfinite(depth).sum())
        verdicts.append(
            Verdict(
                f"median depth, {name}, m",
                float(np.nanmedian(depth)),
                rig.depth_m,
                5 * 1.2533 * spreads[f_number] / np.sqrt(count),
                f"that of the wall; 5 standard errors of a median of {count} dots",
            )
        )
    first, last = config["f_numbers"][0], config["f_numbers"][-1]
    contrast = theory.contrast(config["degree_of_polarization"])
    pitch, wavelength = config["pixel_pitch_m"], config["wavelength_m"]
    for f_number in config["f_numbers"]:
        # Dorsch, Haeusler, Herrmann, Applied Optics 33, 1306 (1994): C lambda / (2 pi sin u), sin u = 1 / (2 F) behind
        # the lens.
        law_px = contrast * wavelength * f_number / (np.pi * pitch)
        verdicts.append(
            Verdict(
                f"deviation of depth over Dorsch's law, f/{f_number:g}",
                spreads[f_number] / (law_px * rig.metres_per_px),
                1.3,
                0.4,
                "C lambda F / pi on the sensor, the least that a centroid can reach; fits and pixels add to it: 0.9 to "
                "1.7 times",
            )
        )
    verdicts.append(
        Verdict(
            f"deviation at f/{last:g} over f/{first:g}",
            spreads[last] / spreads[first],
            last / first,
            0.3 * last / first,
            "in proportion to the f-number (Dorsch); the thesis's Fig. 35 and 36 grow likewise",
        )
    )
    arrays["spreads"] = np.array([[f, s] for f, s in spreads.items()])
    return Outcome(arrays, verdicts)


def f_number_draw(figure: Figure, outcome: Outcome, config: Config) -> None:
    figure.set_size_inches(12, 3.6)
    names = [name for name in outcome.arrays if name.startswith("f/")]
    axes = figure.subplots(1, len(names) + 1)
    reach = 4 * outcome.arrays["spreads"][-1, 1]
    bins = np.linspace(config["depth_m"] - reach, config["depth_m"] + reach, 60)
    for axis, name in zip(axes, names):
        depth = outcome.arrays[name]
        axis.hist(depth[np.isfinite(depth)], bins, density=True, color="0.6")
        axis.set(title=name if name != "f/0" else "no speckle (f/0)", xlabel="depth, m", yticks=[])
    f_number, deviation = outcome.arrays["spreads"].T
    metres = config["depth_m"] ** 2 / (config["focal_length_px"] * config["baseline_m"])
    x = np.linspace(0, f_number[-1], 10)
    law = (
        theory.contrast(config["degree_of_polarization"])
        * config["wavelength_m"]
        * x
        / (np.pi * config["pixel_pitch_m"])
    )
    axes[-1].plot(f_number, 1e3 * deviation, "o", label="simulated")
    axes[-1].plot(x, 1e3 * law * metres, "k--", label="Dorsch's law")
    axes[-1].set(title="deviation", xlabel="f-number", ylabel="mm")
    axes[-1].legend(fontsize=8)


EXPERIMENTS = [
    Experiment(
        "depth_consistency",
        "28",
        "Depth of ten dots, at rest and in motion",
        "A wall at 1 m, 30 frames. At rest each dot has a bias of its own, that of its speckle, and fluctuates with "
        "the noise; when the speckle is new "
        "in each frame the bias becomes the fluctuation.",
        consistency_run,
        consistency_draw,
    ),
    Experiment(
        "depth_f_number",
        "35",
        "Depth of a wall at 1 m with the f-number",
        "The same exposure for all apertures, as the thesis has it. The thesis's detector is not known; this is the "
        "library's. Dorsch's law is the least "
        "deviation that speckle leaves to any triangulation. The thesis's measurements (its Fig. 36, no numbers given) "
        "grow likewise, and are wider.",
        f_number_run,
        f_number_draw,
    ),
]

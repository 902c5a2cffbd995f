"""Three scenes from three sources, from G-buffers to the depth of their dots."""

from __future__ import annotations

import clspeckle
import numpy as np
from matplotlib.figure import Figure

from . import theory
from .depth_estimates import spread
from .experiment import Config, Experiment, Outcome, Progress, Verdict
from .scene_files import Scene, truth

SCENES = {"office": "office desk (Mitsuba)", "depth_map": "Aloe (measured depth)", "blender": "Suzanne (Blender)"}
WRONG_PX = 2.0  # a dot farther from its place is taken for another one; dots are at least 6 px apart


class Chain:
    """One scene, its dots' true places, a camera and the depth of its frames."""

    def __init__(self, name: str, config: Config) -> None:
        self.config = config
        self.scene = scene = Scene(name)
        self.truth = truth(scene)
        self.pattern = scene.pattern()
        self.ideal = self.pattern.lookup(scene.geometry)
        self.near_m, self.far_m = (float(f(scene.depth[scene.depth > 0])) for f in (np.min, np.max))
        full_scale = 2 ** config["bits"] - 1
        # Brightest dots at the given part of full scale; the laser's power is whatever makes them so.
        self.gain_dn = config["peak_of_full_scale"] * full_scale / float(np.percentile(self.ideal, 99.9))
        # A dot's shift along its line per unit of inverse depth.
        met = np.isfinite(self.truth["inverse"])
        rate = scene.along(np.where(met, self.truth["inverse"], 1.0))[1]
        self.pixels_per_q = np.linalg.norm(rate, axis=1)
        self.line = rate / self.pixels_per_q[:, None]
        bare = clspeckle.Geometry(depth=scene.depth, intrinsics=scene.intrinsics, visibility=scene.visibility)
        plain = self.pattern.lookup(bare)
        self.plain = plain * (self.ideal.mean() / plain.mean())

    def depth(self, read_noise_dn: float, black_level_dn: float) -> clspeckle.Depth:
        full_scale = 2 ** self.config["bits"] - 1
        return clspeckle.Depth(
            self.scene.shape,
            self.scene.directions,
            self.scene.pose,
            self.scene.intrinsics,
            near_m=0.85 * self.near_m,
            far_m=1.2 * self.far_m,
            dot_sigma_px=self.scene.sigma_px,
            read_noise_dn=read_noise_dn,
            black_level_dn=black_level_dn,
            saturation_dn=full_scale if black_level_dn else 0,
            # Where the noise is not known, nothing below a thousandth of the brightest dots is looked at.
            min_amplitude_dn=0.0 if read_noise_dn else 1e-3 * self.config["peak_of_full_scale"] * full_scale,
        )

    def camera(self) -> clspeckle.Pipeline:
        return clspeckle.Pipeline.from_parameters(
            self.scene.shape,
            pattern=self.pattern,
            f_number=self.config["f_number"],
            pixel_pitch_m=self.scene.pixel_pitch_m,
            wavelength_m=self.scene.wavelength_m,
            degree_of_polarization=self.config["degree_of_polarization"],
            oversampling=2,
            normalization="unit_mean",
            bits=self.config["bits"],
            exposure_gain_dn=self.gain_dn,
            black_level_dn=self.config["black_level_dn"],
            read_noise_dn=self.config["read_noise_dn"],
            seed=self.config["seed"],
        )

    def errors_px(self, result: clspeckle.DepthResult) -> tuple[np.ndarray, np.ndarray]:
        """Of each dot of the pattern, along its line: how far off it was placed (NaN: not), and what was expected of
        that."""
        error, deviation = np.full((2, len(self.scene.directions)), np.nan)
        placed = result.placed
        index = placed["dot_index"]
        error[index] = (1 / placed["depth_m"] - self.truth["inverse"][index]) * self.pixels_per_q[index]
        deviation[index] = placed["depth_sd_m"] / placed["depth_m"] ** 2 * self.pixels_per_q[index]
        return error, deviation


def shares(error: np.ndarray, visible: np.ndarray) -> tuple[float, float]:
    """Of the visible dots: how many were placed, and how many of these wrongly."""
    found = error[visible]
    placed = np.isfinite(found)
    return float(placed.mean()), float((np.abs(found[placed]) > WRONG_PX).mean())


def texture_shift(chain: Chain) -> np.ndarray:
    """Of each dot along its line, in px: what an albedo that changes across it does to the fit of a Gaussian G, to
    first order.

    The image is a G; least squares project it on dG/dx: x of the weights a G^2, twice, over the mean of a under G^2.
    """
    pixel, sigma = chain.truth["pixel"], chain.scene.sigma_px
    reach = int(np.ceil(3 * sigma))
    albedo = np.pad(chain.scene.geometry.albedo.astype(float), reach, mode="edge")
    j, i = np.mgrid[-reach : reach + 1, -reach : reach + 1]
    shift = np.full(len(pixel), np.nan)
    for dot in np.nonzero(chain.truth["visible"])[0]:
        x, y = np.rint(pixel[dot]).astype(int)
        patch = albedo[y : y + 2 * reach + 1, x : x + 2 * reach + 1]
        dx, dy = i + x - pixel[dot, 0], j + y - pixel[dot, 1]
        weight = np.exp(-(dx**2 + dy**2) / sigma**2)
        mean = (weight * patch).sum()
        along = dx * chain.line[dot, 0] + dy * chain.line[dot, 1]
        shift[dot] = 2 * (weight * patch * along).sum() / mean
    return shift


def without_noise(chain: Chain, title: str) -> tuple[list[Verdict], np.ndarray, np.ndarray]:
    """Verdicts, each dot's error, and its amplitude over the noise."""
    depth = chain.depth(0.0, 0.0)
    visible = chain.truth["visible"]
    result = depth.measure(chain.ideal * chain.gain_dn)
    error, _ = chain.errors_px(result)
    amplitude = np.zeros(len(visible))
    amplitude[result.placed["dot_index"]] = result.placed["amplitude_dn"]
    plain_error, _ = chain.errors_px(depth.measure(chain.plain * chain.gain_dn))
    placed, wrong = shares(error, visible)
    shift = texture_shift(chain)
    both = visible & np.isfinite(error)
    slope = float((error * shift)[both].sum() / (shift**2)[both].sum())
    rest = float(np.sqrt(((error - slope * shift)[both] ** 2).sum() / (error[both] ** 2).sum()))
    verdicts = [
        Verdict(
            f"{title}: visible dots placed, without noise",
            placed,
            1.0,
            0.005,
            f"{int(visible.sum())} dots with nothing but their own lit surface within 3 sigma; all but 0.5 %",
        ),
        Verdict(
            f"{title}: of these wrongly", wrong, 0.0, 0.002, "farther than 2 px from their true place; at most 0.2 %"
        ),
        Verdict(
            f"{title}: median error of a dot without texture, px",
            float(np.nanmedian(np.abs(plain_error[visible]))),
            0.0,
            0.01,
            "even albedo, no shading: a dot lies where its beam meets the depth map; what is left is curvature and "
            "slope",
        ),
        Verdict(
            f"{title}: error through texture over the predicted one",
            slope,
            1.0,
            0.1,
            "a changing albedo moves a dot's fit, to first order by 2 sum(x a G^2) / sum(a G^2): slope of errors over "
            f"it, median {np.median(np.abs(error[both])):.3f} px; "
            f"{rest:.0%} of their RMS is left",
        ),
    ]
    return verdicts, error, amplitude / chain.config["read_noise_dn"]


def with_noise(chain: Chain, title: str) -> Verdict:
    config = chain.config
    camera = chain.camera()
    depth = chain.depth(config["read_noise_dn"], config["black_level_dn"])
    still, _ = chain.errors_px(chain.depth(0.0, 0.0).measure(chain.plain * chain.gain_dn))
    scaled = []
    for index in range(config["noisy_frames"]):
        frame = camera.render(chain.plain, frame_index=index, illumination="incoherent")
        error, deviation = chain.errors_px(depth.measure(frame))
        scaled.append(((error - still) / deviation)[chain.truth["visible"]])
    values = np.concatenate(scaled)
    values = values[np.isfinite(values)]
    return Verdict(
        f"{title}: deviation of depth through noise over the predicted one",
        spread(values),
        1.0,
        0.1,
        f"even albedo, no speckle: {len(values)} depths, each over its own standard deviation (Cramer-Rao bound); 10 "
        "%: quartiles, rounding to codes",
    )


def run(config: Config, progress: Progress) -> Outcome:
    arrays: dict[str, np.ndarray] = {}
    verdicts: list[Verdict] = []
    for name in config["scenes"]:
        title = SCENES[name]
        progress(title)
        chain = Chain(name, config)
        some, still, signal_to_noise = without_noise(chain, title)
        verdicts += [*some, with_noise(chain, title)]
        frame = chain.camera().render(chain.scene.geometry)
        error, _ = chain.errors_px(chain.depth(config["read_noise_dn"], config["black_level_dn"]).measure(frame))
        clear = chain.truth["visible"] & (signal_to_noise > config["least_signal_to_noise"])
        placed, wrong = shares(error, clear)
        law_px = (
            theory.contrast(config["degree_of_polarization"])
            * chain.scene.wavelength_m
            * config["f_number"]
            / (np.pi * chain.scene.pixel_pitch_m)
        )
        verdicts += [
            Verdict(
                f"{title}: visible dots placed, speckle and noise",
                placed,
                1.0,
                0.02,
                f"{int(clear.sum())} dots {config['least_signal_to_noise']} times the noise or more; all but 2 %",
            ),
            Verdict(
                f"{title}: of these wrongly, speckle and noise",
                wrong,
                0.0,
                0.01,
                "farther than 2 px from their true place; at most 1 %",
            ),
            Verdict(
                f"{title}: wrong among all placed dots, speckle and noise",
                float((np.abs(error[np.isfinite(error)]) > WRONG_PX).mean()),
                0.0,
                0.02,
                f"edges and dark places included: {int(np.isfinite(error).sum())} dots whose beams meet one surface; "
                "at most 2 %",
            ),
            Verdict(
                f"{title}: deviation through speckle over Dorsch's law",
                spread((error - still)[clear]) / law_px,
                1.3,
                0.4,
                "against the same dot without noise; C lambda F / pi on the sensor, the least that a centroid can "
                "reach; fits and pixels add to it: 0.9 "
                "to 1.7 times",
            ),
        ]
        shown = np.isfinite(error)
        z = 1 / chain.truth["inverse"][shown]
        arrays[f"{name}_frame"] = frame
        arrays[f"{name}_pixel"] = chain.truth["pixel"][shown].astype(np.float32)
        arrays[f"{name}_depth_m"] = z.astype(np.float32)
        arrays[f"{name}_error_m"] = (-error[shown] * z**2 / chain.pixels_per_q[shown]).astype(np.float32)
        arrays[f"{name}_law_m"] = (law_px * z**2 / chain.pixels_per_q[shown]).astype(np.float32)
    return Outcome(arrays, verdicts)


def draw(figure: Figure, outcome: Outcome, config: Config) -> None:
    names = config["scenes"]
    figure.set_size_inches(15, 3.9 * len(names))
    axes = figure.subplots(len(names), 3, squeeze=False)
    for row, name in zip(axes, names):
        of = {key: outcome.arrays[f"{name}_{key}"] for key in ("frame", "pixel", "depth_m", "error_m", "law_m")}
        signal = np.maximum(of["frame"].astype(float) - config["black_level_dn"], 0)
        row[0].imshow(np.sqrt(signal), cmap="gray", vmax=np.sqrt(np.percentile(signal, 99.8)))
        row[0].set_title(f"{SCENES[name]}: recorded frame")
        points = {"c": of["depth_m"] + of["error_m"], "cmap": "viridis"}
        limits = np.percentile(of["depth_m"], [1, 99])
        drawn = row[1].scatter(*of["pixel"].T, s=5, vmin=limits[0], vmax=limits[1], **points)
        figure.colorbar(drawn, ax=row[1])
        row[1].set_title("measured depth of the dots, m")
        scaled = of["error_m"] / of["law_m"]
        drawn = row[2].scatter(*of["pixel"].T, s=5, c=scaled, cmap="coolwarm", vmin=-4, vmax=4)
        figure.colorbar(drawn, ax=row[2])
        typical = 1e3 * np.median(np.abs(of["error_m"]))
        row[2].set_title(f"its error over Dorsch's law (median magnitude {typical:.1f} mm)")
        for axis in row:
            axis.set(xlim=(-0.5, of["frame"].shape[1] - 0.5), ylim=(of["frame"].shape[0] - 0.5, -0.5), aspect="equal")
            axis.set(xticks=[], yticks=[])


EXPERIMENTS = [
    Experiment(
        "scenes",
        "28 and 35 in scenes",
        "From G-buffers of three sources to depth",
        "The office desk of our own script; a measured depth map (Middlebury 2006, Aloe) with its photograph; a scene "
        "of Blender's objects, by "
        "Cycles. Each with its own dots, through the whole camera, to the depth of every dot. Errors are those of "
        "speckle, as on the thesis's wall; "
        "dots at edges and in dark places are among the drawn ones, and not among those of the verdicts.",
        run,
        draw,
    )
]

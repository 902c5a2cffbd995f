"""Fig. 16: where a beam splitter's light goes that should be in its dots."""

from __future__ import annotations

import clspeckle
import numpy as np
from matplotlib.figure import Figure

from .experiment import Config, Experiment, Outcome, Progress, Verdict


def binary_power_budget(phase: np.ndarray, orders: np.ndarray, error: float) -> tuple[float, float]:
    """Zero order and sum of the wanted orders of a cell with two levels whose depth is 1 + error times what it should
    be.

    The transmission s is 1 or -1; with the error t = (1 - w) / 2 + s (1 + w) / 2, w = exp(i pi error): a constant,
    which is zero order alone, and the design times cos(pi error / 2). So P(0) = sin^2 + cos^2 S(0)^2 and P(m, n) =
    cos^2 |S(m, n)|^2, under the envelope of square pixels.
    """
    height, width = phase.shape
    field = np.fft.fft2(np.exp(1j * phase.astype(float))) / phase.size
    m, n = orders.T
    power = np.abs(field[n % height, m % width]) ** 2 * np.sinc(m / width) ** 2 * np.sinc(n / height) ** 2
    cosine = np.cos(0.5 * np.pi * error) ** 2
    return float(1 - cosine + cosine * np.abs(field[0, 0]) ** 2), float(cosine * power.sum())


def box_sums(image: np.ndarray, centres: np.ndarray, reach: int) -> np.ndarray:
    """Light around each pixel (x, y), NaN where the box leaves the image."""
    table = np.pad(np.cumsum(np.cumsum(image.astype(float), axis=0), axis=1), ((1, 0), (1, 0)))
    x, y = np.rint(centres).astype(int).T
    inside = (x >= reach) & (y >= reach) & (x < image.shape[1] - reach) & (y < image.shape[0] - reach)
    x0, x1, y0, y1 = (np.where(inside, v, 0) for v in (x - reach, x + reach + 1, y - reach, y + reach + 1))
    return np.where(inside, table[y1, x1] - table[y0, x1] - table[y1, x0] + table[y0, x0], np.nan)


def covariance(image: np.ndarray, centre: np.ndarray, reach: int) -> np.ndarray:
    """Of the Gaussian around a pixel (x, y), in px^2: its logarithm is a parabola, fitted above a fifth of the peak."""
    x, y = np.rint(centre).astype(int)
    patch = image[y - reach : y + reach + 1, x - reach : x + reach + 1].astype(float)
    rows, columns = np.nonzero(patch > 0.2 * patch.max())
    dx, dy = columns - reach, rows - reach
    terms = np.stack([dx * dx, dx * dy, dy * dy, dx, dy, np.ones(len(dx))], axis=1)
    xx, xy, yy = np.linalg.lstsq(terms, np.log(patch[rows, columns]), rcond=None)[0][:3]
    # A pixel's own width adds its variance, 1/12.
    return np.linalg.inv([[-2 * xx, -xy], [-xy, -2 * yy]]) - np.eye(2) / 12


def axis_ratio(matrix: np.ndarray) -> float:
    low, high = np.linalg.eigvalsh(matrix)
    return float(np.sqrt(high / low))


class Splitter:
    """A binary element that was designed for dots, and what becomes of it."""

    def __init__(self, config: Config) -> None:
        self.config = config
        self.cell: tuple[int, int] = tuple(config["cell"])
        layout = clspeckle.dot_layout(config["dots"], shape=self.cell, point_symmetric=True, seed=config["seed"])
        self.design = clspeckle.design_doe(layout.orders, shape=self.cell, levels=2, seed=config["seed"])
        self.orders = self.design.orders
        xx, xy, yy = (1e-12 * value for value in config["beam_covariance_um2"])
        self.beam = clspeckle.Beam(covariance_m2=(xx, xy, yy))
        # A Gaussian beam's far field, in direction cosines.
        self.spot = (config["wavelength_m"] / (4 * np.pi)) ** 2 * np.linalg.inv([[xx, xy], [xy, yy]])

    def element(self, phase: np.ndarray, levels: int, orders: np.ndarray) -> clspeckle.DoeElement:
        return clspeckle.DoeElement(
            phase, self.config["pixel_pitch_m"], self.config["wavelength_m"], levels=levels, orders=orders
        )

    def pattern(self, defects: clspeckle.DoeDefects | None = None, **other: object) -> clspeckle.DoePattern:
        element = other.pop("element", None) or self.element(self.design.phase, 2, self.orders)
        side = self.config["texels"]
        return clspeckle.DoePattern(
            element,
            beam=self.beam,
            defects=defects,
            image_shape=(side, side),
            half_extent=self.config["half_extent"],
            evaluation="orders",
            **other,
        )

    def texel_of(self, orders: np.ndarray) -> np.ndarray:
        """Where orders lie in the texels, as (x, y)."""
        height, width = self.cell
        wavelength, pitch = self.config["wavelength_m"], self.config["pixel_pitch_m"]
        directions = orders * wavelength / (np.array([width, height]) * pitch)
        return (directions / self.config["half_extent"] + 1) * self.config["texels"] / 2 - 0.5


def depth_errors(splitter: Splitter) -> tuple[dict[str, np.ndarray], list[Verdict]]:
    errors = np.array(splitter.config["depth_errors"])
    measured, expected = np.zeros((2, 2, len(errors)))
    for k, error in enumerate(errors):
        info = splitter.pattern(clspeckle.DoeDefects(relative_depth_error=float(error))).info
        measured[:, k] = info.zero_order, info.dots
        expected[:, k] = binary_power_budget(splitter.design.phase, splitter.orders, float(error))
    verdicts = [
        Verdict(
            f"largest difference of the {name} share from theory, etch depth off by {errors.min():+.0%} to "
            f"{errors.max():+.0%}",
            float(np.abs(measured[row] - expected[row]).max()),
            0.0,
            1e-5,
            why,
        )
        for row, (name, why) in enumerate(
            (
                ("zero order's", "sin^2(pi e / 2) + cos^2(pi e / 2) S(0)^2, S by a Fourier transform in float64"),
                ("dots'", "cos^2(pi e / 2) times their share without error, under the pixels' envelope"),
            )
        )
    ]
    return {"depth_errors": errors, "zero_order": measured[0], "dots": measured[1]}, verdicts


def twins(splitter: Splitter) -> list[Verdict]:
    """A design with any phase, made with two levels: its twin is what most ghosts are."""
    config = splitter.config
    layout = clspeckle.dot_layout(config["twin_dots"], shape=splitter.cell, seed=config["seed"] + 1)
    design = clspeckle.design_doe(layout.orders, shape=splitter.cell, levels=0, seed=config["seed"])
    wanted = {tuple(order) for order in layout.orders.tolist()}
    alone = np.array([order for order in layout.orders.tolist() if (-order[0], -order[1]) not in wanted])
    texels = splitter.pattern(
        clspeckle.DoeDefects(levels=2), element=splitter.element(design.phase, 0, layout.orders)
    ).texels
    reach = config["box_texels"]
    dots, ghosts = (box_sums(texels, splitter.texel_of(sign * alone), reach) for sign in (1, -1))
    known = np.isfinite(dots) & np.isfinite(ghosts)
    ratio = ghosts[known] / dots[known]
    return [
        Verdict(
            "ghost -(m, n) over its dot (m, n), two levels: the ratio farthest from 1",
            float(ratio[np.abs(ratio - 1).argmax()]),
            1.0,
            1e-3,
            f"a transmission of 1 and -1 is real, so the far field is even; {len(ratio)} dots without a wanted twin, "
            "light in boxes of "
            f"{2 * reach + 1} texels",
        )
    ]


def captures(splitter: Splitter, pattern: clspeckle.DoePattern, progress: Progress) -> np.ndarray:
    """Mean of frames of a wall, each with its own speckle, in codes above the black level."""
    config = splitter.config
    shape = (config["image_px"], config["image_px"])
    centre = (config["image_px"] - 1) / 2
    focal = config["focal_length_px"]
    lookup = pattern.pattern(filter="area")
    geometry = clspeckle.Geometry(
        depth=np.ones(shape, np.float32), intrinsics=(focal, focal, centre, centre), normal=None
    )
    ideal = lookup.lookup(geometry)
    camera = clspeckle.Pipeline.from_parameters(
        shape,
        f_number=config["f_number"],
        degree_of_polarization=0.0,
        normalization="unit_mean",
        bits=config["bits"],
        exposure_gain_dn=config["peak_of_full_scale"] * 2 ** config["bits"] / float(np.percentile(ideal, 99)),
        black_level_dn=config["black_level_dn"],
        seed=config["seed"],
    )
    mean = np.zeros(shape)
    for k in range(config["frames"]):
        mean += camera.render(ideal, frame_index=k, refresh="all")
    progress(f"mean of {config['frames']} frames")
    return mean / config["frames"] - config["black_level_dn"]


def run(config: Config, progress: Progress) -> Outcome:
    splitter = Splitter(config)
    progress(f"{len(splitter.orders)} dots, two levels: {splitter.design.efficiency:.1%} of the light in them")
    arrays, verdicts = depth_errors(splitter)
    verdicts += twins(splitter)

    defects = clspeckle.DoeDefects(
        relative_depth_error=config["shown_depth_error"],
        etch_noise_rms_m=config["etch_noise_m"],
        refractive_index=config["refractive_index"],
    )
    shown = splitter.pattern(defects)
    quiet = splitter.pattern(clspeckle.DoeDefects(relative_depth_error=config["shown_depth_error"])).info
    info = shown.info
    phase_rms = 2 * np.pi * (config["refractive_index"] - 1) * config["etch_noise_m"] / config["wavelength_m"]
    verdicts.append(
        Verdict(
            "share of the light in the dots that etch noise leaves",
            info.dots / quiet.dots,
            float(np.exp(-(phase_rms**2))),
            1e-4,
            f"exp(-s^2), s = 2 pi (n - 1) sigma / lambda = {phase_rms:.3f}; the rest is scattered between the dots",
        )
    )
    texels = shown.texels
    reach = config["box_texels"]
    places = splitter.texel_of(splitter.orders)
    inside = np.isfinite(box_sums(texels, places, reach))
    ratios = np.array([axis_ratio(covariance(texels, place, reach)) for place in places[inside]])
    verdicts.append(
        Verdict(
            "longer over shorter axis of a dot, median",
            float(np.median(ratios)),
            axis_ratio(splitter.spot),
            0.015,
            "that of the far field of the beam, lambda^2 / (4 pi)^2 times the inverse of its covariance; "
            f"{len(ratios)} dots, and a "
            "hundredth for other orders under their flanks",
        )
    )
    ideal = clspeckle.DoePattern.ideal(
        splitter.orders * config["wavelength_m"] / (np.array(splitter.cell[::-1]) * config["pixel_pitch_m"]),
        beam=clspeckle.Beam(covariance_m2=(1e-12 * config["beam_covariance_um2"][0],) * 2),
        wavelength_m=config["wavelength_m"],
        image_shape=(config["texels"], config["texels"]),
        half_extent=config["half_extent"],
    )
    arrays["ideal"] = captures(splitter, ideal, progress)
    mean = arrays["mean"] = captures(splitter, shown, progress)

    # In the wall's image: the zero order over a dot, by light in boxes that a dot's neighbours do not reach.
    directions = splitter.orders * config["wavelength_m"] / (np.array(splitter.cell[::-1]) * config["pixel_pitch_m"])
    tangent = directions / np.sqrt(1 - (directions**2).sum(axis=1, keepdims=True))
    middle = (config["image_px"] - 1) / 2
    box = config["box_px"]
    # Scattered light is even over a few dots: what lies between them is taken off.
    floor = float(np.percentile(mean, 5))
    light = box_sums(mean - floor, middle + config["focal_length_px"] * tangent, box)
    centre = box_sums(mean - floor, np.array([[middle, middle]]), box)[0]
    dots = light[np.isfinite(light)]
    looks = 2 * config["frames"]
    share = info.zero_order / np.mean(shown.dot_shares[np.isfinite(light)])
    verdicts.append(
        Verdict(
            f"zero order over a dot in the mean of {config['frames']} frames",
            float(centre / dots.mean()),
            float(share),
            float(share * 0.1),
            f"by the pattern's power budget; 10 %: a speckle of {looks} looks deviates by {1 / np.sqrt(looks):.0%}, "
            "and tails leave the boxes alike",
        )
    )
    return Outcome(arrays, verdicts)


def draw(figure: Figure, outcome: Outcome, config: Config) -> None:
    figure.set_size_inches(14, 4.6)
    left, middle, right = figure.subplots(1, 3)
    for axis, key, title in (
        (left, "ideal", "ideal dots"),
        (middle, "mean", f"two levels, {config['shown_depth_error']:.0%} too deep, etch noise (Fig. 16)"),
    ):
        image = np.maximum(outcome.arrays[key], 0)
        axis.imshow(np.sqrt(image), cmap="gray", vmax=np.sqrt(np.percentile(image, 99.5)))
        axis.set(title=title, xticks=[], yticks=[])
    errors = outcome.arrays["depth_errors"]
    fine = np.linspace(errors.min(), errors.max(), 200)
    right.plot(100 * errors, 100 * outcome.arrays["zero_order"], "o", label="zero order")
    right.plot(100 * errors, 100 * outcome.arrays["dots"], "s", label="all dots")
    at_zero = np.abs(errors).argmin()
    cosine = np.cos(0.5 * np.pi * fine) ** 2
    start = {key: outcome.arrays[key][at_zero] for key in ("zero_order", "dots")}
    right.plot(100 * fine, 100 * (1 - cosine + cosine * start["zero_order"]), "k--", linewidth=1, label="theory")
    right.plot(100 * fine, 100 * cosine * start["dots"], "k--", linewidth=1)
    right.set(title="share of the light", xlabel="etch depth error, %", ylabel="%")
    right.legend(fontsize=8)


EXPERIMENTS = [
    Experiment(
        "doe_defects",
        "16",
        "Defects of the beam splitter",
        "A binary design for an oval beam, on a wall, the mean of 100 frames with independent speckle as in the "
        "thesis. The dots are oval with the beam; "
        "an etch depth that is off leaves light undiverted in the bright center dot; etch noise scatters light between "
        "the dots. The thesis "
        "gives no design and no numbers, so that the verdicts are those of closed forms.",
        run,
        draw,
    )
]

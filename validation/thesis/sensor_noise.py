"""Fig. 19 to 21: dark frames, and what a resting board shows over time."""

from __future__ import annotations

import clspeckle
import numpy as np
from matplotlib.figure import Figure

from .experiment import Config, Experiment, Outcome, Progress, Verdict


def dark_run(config: Config, progress: Progress) -> Outcome:
    shape = tuple(config["shape"])
    full_scale = 2 ** config["bits"] - 1
    sigma_dn = config["noise_of_full_scale"] * full_scale
    camera = clspeckle.Pipeline.from_parameters(
        shape,
        bits=config["bits"],
        black_level_dn=config["black_level_dn"],
        read_noise_dn=sigma_dn,
        hot_pixel_fraction=config["hot_pixel_fraction"],
        hot_pixel_mean_dn=config["hot_pixel_mean_dn"],
        seed=config["seed"],
    )
    total, square = np.zeros(shape), np.zeros(shape)
    image = np.empty(shape, np.uint16)
    progress("dark frames")
    for index in range(config["frames"]):
        camera.render(frame_index=index, illumination="dark", out=image)
        total += image
        square += image.astype(float) ** 2
    count = config["frames"]
    mean = total / count - config["black_level_dn"]
    # Codes are whole numbers: that adds the variance of a uniform law of width 1.
    variance = (square - total**2 / count) / (count - 1) - 1 / 12
    hot = mean > 0.5 * sigma_dn
    cool = ~hot
    pixels = mean.size
    seen_fraction = config["hot_pixel_fraction"] * np.exp(-0.5 * sigma_dn / config["hot_pixel_mean_dn"])
    # An exponential law has no memory: beyond the threshold it is the same law again. Codes end at the top one.
    hot_excess = mean[hot] - 0.5 * sigma_dn
    top = full_scale - config["black_level_dn"] - 0.5 * sigma_dn
    expected_excess = config["hot_pixel_mean_dn"] * (1 - np.exp(-top / config["hot_pixel_mean_dn"]))
    return Outcome(
        {"single": image, "mean": mean.astype(np.float32)},
        [
            Verdict(
                "temporal noise, of full scale",
                np.sqrt(variance[cool].mean()) / full_scale,
                config["noise_of_full_scale"],
                4 * config["noise_of_full_scale"] / np.sqrt(2 * count * pixels),
                "the noise that was asked for (thesis 3.2.3: 0.015); 4 standard errors",
            ),
            Verdict(
                "mean of the pixels that are not hot, DN",
                mean[cool].mean(),
                0.0,
                4 * sigma_dn / np.sqrt(count * pixels) + 0.5 * config["hot_pixel_fraction"] * sigma_dn,
                "dark frames are the black level; 4 standard errors, and what faint hot pixels add at most",
            ),
            Verdict(
                "fraction of hot pixels",
                hot.mean(),
                seen_fraction,
                4 * np.sqrt(seen_fraction / pixels),
                "what was asked for, times the part of an exponential law above half a deviation; 4 binomial "
                "deviations",
            ),
            Verdict(
                "mean offset of hot pixels beyond that, DN",
                hot_excess.mean(),
                expected_excess,
                4 * config["hot_pixel_mean_dn"] / np.sqrt(hot.sum()),
                "an exponential law has no memory; 4 standard errors",
            ),
        ],
    )


def dark_draw(figure: Figure, outcome: Outcome, config: Config) -> None:
    figure.set_size_inches(9, 3.8)
    axes = figure.subplots(1, 2)
    full_scale = 2 ** config["bits"] - 1
    part = np.s_[:128, :128]
    for axis, image, title in (
        (
            axes[0],
            (outcome.arrays["single"][part].astype(float) - config["black_level_dn"]) / full_scale,
            "one dark frame",
        ),
        (axes[1], outcome.arrays["mean"][part] / full_scale, f"mean of {config['frames']}"),
    ):
        shown = axis.imshow(image, cmap="viridis")
        figure.colorbar(shown, ax=axis, label="of full scale")
        axis.set(title=title, xticks=[], yticks=[])


def still_series(config: Config, boiling_frames: float | None) -> np.ndarray:
    """(frames, height, width), of full scale, of a board that rests."""
    shape = tuple(config["shape"])
    full_scale = 2 ** config["bits"] - 1
    camera = clspeckle.Pipeline.from_parameters(
        shape,
        f_number=config["f_number"],
        bits=config["bits"],
        black_level_dn=config["black_level_dn"],
        read_noise_dn=config["noise_of_full_scale"] * full_scale,
        exposure_gain_dn=config["mean_of_full_scale"] * full_scale,
        normalization="unit_mean",
        boiling_correlation_frames=boiling_frames,
        seed=config["seed"],
    )
    ideal = np.ones(shape, np.float32)
    frames = [camera.render(ideal, frame_index=index).astype(float) for index in range(config["frames"])]
    return (np.array(frames) - config["black_level_dn"]) / full_scale


def still_run(config: Config, progress: Progress) -> Outcome:
    progress("a resting board")
    still = still_series(config, None)
    progress("a board that changes slowly")
    drift = still_series(config, config["boiling_correlation_frames"])
    sigma = config["noise_of_full_scale"]
    count = len(still)
    top = 1 - config["black_level_dn"] / (2 ** config["bits"] - 1)

    def chosen(series: np.ndarray) -> np.ndarray:
        """The thesis's pixels (3.2.2): at least a tenth of full scale on average, never overexposed. (frames,
        pixels)"""
        good = (series.mean(axis=0) > 0.1) & (series.max(axis=0) < 0.999 * top)
        return series[:, good]

    pixels = chosen(still)
    deviations = pixels - pixels.mean(axis=0)
    lags = np.arange(config["lags"])
    power = (deviations**2).sum(axis=0)
    acf = np.array([(deviations[: count - k] * deviations[k:]).sum(axis=0) / power for k in lags])
    # Deviations from a series' own mean add up to 0, which makes all lags together -1/2.
    bias = -(count - lags[1:]) / (count * (count - 1))
    error = np.abs(acf[1:].mean(axis=1) - bias).max()
    drifting = chosen(drift)
    steps = np.arange(1, count)
    growth = np.abs(pixels - pixels[0]).mean(axis=1), np.abs(drifting - drifting[0]).mean(axis=1)
    # Speckle of unit mean that keeps the part r^2 of its intensity's deviations: twice the variance (1 - r^2). All
    # pixels count here, and codes end at full scale, which 1 / mean_of_full_scale mean intensities reach.
    tau = config["boiling_correlation_frames"]
    late = slice(count // 2, None)
    square = ((drift - drift[0]) ** 2).mean(axis=(1, 2))[late]
    kept = np.exp(-2 * np.arange(count)[late] / tau)
    expected_square = (2 * sigma**2 + 2 * config["mean_of_full_scale"] ** 2 * (1 - kept)).mean()
    nine = still[: count // 9 * 9].reshape(-1, 9, *still.shape[1:]).mean(axis=1)
    independent = still[0].size
    return Outcome(
        {
            "acf": acf[:, :150].astype(np.float32),
            "acf_mean": acf.mean(axis=1),
            "still": growth[0],
            "drift": growth[1],
            "pixel": pixels[:, 0],
            "steps": np.r_[0, steps],
        },
        [
            Verdict(
                "largest mean autocorrelation beyond lag 0",
                error,
                0.0,
                4.5 / np.sqrt(pixels.shape[1] * count),
                "white noise, its known bias taken off; 4.5 standard errors, the largest of all lags",
            ),
            Verdict(
                "mean absolute difference from the first frame, of full scale",
                growth[0][1:].mean(),
                2 * sigma / np.sqrt(np.pi),
                4 * sigma / np.sqrt(pixels.shape[1]),
                "E|n1 - n2| = 2 sigma / sqrt(pi) of Gaussian noise; 4 standard errors of the first frame",
            ),
            Verdict(
                "its growth from the first to the last third",
                growth[0][2 * count // 3 :].mean() / growth[0][1 : count // 3].mean(),
                1.0,
                0.02,
                "nothing changes but the noise",
            ),
            Verdict(
                "mean squared difference with slow change, of full scale",
                square.mean(),
                expected_square,
                0.06 * expected_square,
                "2 sigma^2 + 2 mean^2 (1 - exp(-2 t / tau)); 6 %: the variance of the few thousand speckles in the "
                "picture",
            ),
            Verdict(
                "deviation of the mean of nine frames, of full scale",
                nine.std(axis=0, ddof=1).mean(),
                sigma / 3,
                0.03 * sigma / 3 + sigma / 3 * 4 / np.sqrt(2 * independent * len(nine)),
                "sigma / 3 (thesis 3.2.3: below 0.005); the mean of estimated deviations is 1.6 % low with 16 of them",
            ),
        ],
    )


def still_draw(figure: Figure, outcome: Outcome, config: Config) -> None:
    figure.set_size_inches(12, 3.6)
    axes = figure.subplots(1, 3)
    axes[0].plot(outcome.arrays["acf"], color="0.8", linewidth=0.5)
    axes[0].plot(outcome.arrays["acf_mean"], color="tab:red", linewidth=2)
    axes[0].set(title="autocorrelation (Fig. 20)", xlabel="lag, frames")
    steps = outcome.arrays["steps"]
    axes[1].plot(steps, outcome.arrays["pixel"])
    axes[1].set(title="one pixel (Fig. 21)", xlabel="frame", ylabel="of full scale")
    axes[2].plot(steps, outcome.arrays["still"], label="noise alone")
    axes[2].plot(steps, outcome.arrays["drift"], label=f"change in {config['boiling_correlation_frames']:g} frames")
    axes[2].set(
        title="difference from the first frame (Fig. 21)", xlabel="frame", ylabel="mean, of full scale", ylim=(0, None)
    )
    axes[2].legend()


EXPERIMENTS = [
    Experiment(
        "dark_frame",
        "19",
        "Dark frames",
        "No light: black level, Gaussian noise of 0.015 of full scale that is new in each frame, and a few hot pixels "
        "that stay.",
        dark_run,
        dark_draw,
    ),
    Experiment(
        "stationary",
        "20, 21",
        "A board at rest",
        "150 frames of speckle that stands still. What varies is noise, and uncorrelated from frame to frame. The "
        "thesis saw differences grow slowly "
        "and blamed dust and air; a surface that changes over thousands of frames does the same, and is off by "
        "default.",
        still_run,
        still_draw,
    ),
]

"""Fig. 22 to 24 and 26: how far the device may move, and which surfaces live."""

from __future__ import annotations

import clspeckle
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from . import theory
from .experiment import Config, Experiment, Outcome, Progress, Verdict

MOTIONS = {  # title, axis label, factor of the axis
    "lateral": ("along X (thesis 3.2.4)", "displacement, mm", 1e3),
    "axial": ("along Z (3.2.5)", "displacement, mm", 1e3),
    "rotation": ("about Y (3.2.6)", "rotation, degrees", 180 / np.pi),
}


def pose(kind: str, step: float) -> np.ndarray:
    """How the device, or the board, moves by a step."""
    matrix = np.eye(4)
    if kind == "rotation":
        c, s = np.cos(step), np.sin(step)
        matrix[:3, :3] = [[c, 0, s], [0, 1, 0], [-s, 0, c]]
        matrix[:3, 3] = np.array([0, 0, 1]) - matrix[:3, :3] @ [0, 0, 1]
    else:
        matrix[0 if kind == "lateral" else 2, 3] = step
    return matrix


def moving_series(kind: str, step: float, count: int, shape: tuple[int, int], f_number: float, seed: int) -> np.ndarray:
    """Intensities of a board at 1 m while the device moves, by frame and pixel: (count + 1, pixels)."""
    # So long a focal length that all pixels see the board from the same direction.
    motion = clspeckle.Motion(shape, intrinsics=(2e5, 2e5, (shape[1] - 1) / 2, (shape[0] - 1) / 2))
    phase = clspeckle.Phase(shape, dynamics="continuous", polarization_count=1, seed=seed)
    aperture = clspeckle.Aperture(shape, f_number=f_number)
    depth, ideal = np.ones(shape, np.float32), np.ones(shape, np.float32)
    given = clspeckle.MotionInput(depth=depth, previous_from_current=pose(kind, step))
    phase.refresh(0)
    frames = [aperture.intensity(phase, ideal).ravel()]
    for index in range(1, count + 1):
        phase.advance(index, path=motion.compute(given)["path"])
        frames.append(aperture.intensity(phase, ideal).ravel())
    return np.array(frames)


def draw_series(axes: Axes, kind: str, frames: np.ndarray, step: float, length: float) -> None:
    """Single pixels, their mean and the theory, as in the thesis."""
    title, label, factor = MOTIONS[kind]
    displacement = step * np.arange(len(frames)) * factor
    # Single pixels: the product with the first frame's deviation, over a few that were bright.
    deviations = frames / frames.mean() - 1
    rng = np.random.default_rng(0)
    for pixel in rng.choice(np.flatnonzero(deviations[0] > 0.8), 12, replace=False):
        axes.plot(displacement, deviations[:, pixel] / deviations[0, pixel], color="0.8", linewidth=0.7)
    axes.plot(displacement, correlation(frames), color="tab:red", linewidth=2, label=f"{frames.shape[1]} pixels")
    axes.plot(
        displacement, theory.field_correlation(displacement / factor / length) ** 2, "k--", linewidth=1, label="theory"
    )
    axes.set(title=title, xlabel=label, ylim=(-1.1, 1.4), xlim=(0, displacement[-1]))
    axes.legend(loc="upper right", fontsize=8)


def correlation(frames: np.ndarray) -> np.ndarray:
    return np.array([np.corrcoef(frames[0], frame)[0, 1] for frame in frames])


def settings(config: Config, kind: str) -> tuple[float, float, int]:
    """Correlation length, step and number of steps; angles in radians."""
    entry = config[kind]
    if kind == "rotation":
        return np.deg2rad(entry["length_degrees"]), np.deg2rad(entry["step_degrees"]), entry["steps"]
    return entry["length_m"], entry["step_m"], entry["steps"]


def motion_run(config: Config, progress: Progress) -> Outcome:
    shape = tuple(config["shape"])
    diameter = theory.relative_diameter(config["f_number"], 2.9e-6, 940e-9)
    # Independent speckles: one for each frequency that the pupil lets through.
    speckles = theory.pupil(shape, diameter).sum()
    arrays, verdicts = {}, []
    for kind, (title, _, _) in MOTIONS.items():
        progress(title)
        length, step, count = settings(config, kind)
        frames = moving_series(kind, step, count, shape, config["f_number"], config["seed"])
        arrays[kind] = frames.astype(np.float32)
        measured = correlation(frames)
        expected = theory.field_correlation(step * np.arange(count + 1) / length) ** 2
        verdicts.append(
            Verdict(
                f"largest difference from theory, {title}",
                np.abs(measured - expected).max(),
                0.0,
                4 / np.sqrt(speckles),
                f"|R|^2 of the path (phase.h); 4 deviations of a correlation of {speckles} speckles",
            )
        )
        at = round(length / step)
        verdicts.append(
            Verdict(
                f"correlation at the thesis's length, {title}",
                measured[at],
                expected[at],
                4 / np.sqrt(speckles),
                "1/e^2 there: what the thesis calls vanished by eye",
            )
        )
    return Outcome(arrays, verdicts)


def motion_draw(figure: Figure, outcome: Outcome, config: Config) -> None:
    figure.set_size_inches(12, 3.6)
    for axes, kind in zip(figure.subplots(1, 3), MOTIONS):
        length, step, _ = settings(config, kind)
        draw_series(axes, kind, outcome.arrays[kind], step, length)


def living_run(config: Config, progress: Progress) -> Outcome:
    shape = tuple(config["shape"])
    frame_time = 1 / config["frames_per_second"]
    names = list(config["correlation_time_s"])
    materials = [clspeckle.Material(correlation_time_s=config["correlation_time_s"][name]) for name in names]
    materials.append(clspeckle.Material())
    names.append("board")
    camera = clspeckle.Pipeline.from_parameters(
        shape,
        materials=materials,
        motion={"intrinsics": (1e3, 1e3, 0.0, 0.0)},
        polarization_count=2,
        f_number=config["f_number"],
        normalization="unit_mean",
        output="intensity",
        seed=config["seed"],
    )
    identity = np.repeat(np.arange(len(names), dtype=np.uint8), shape[1] // len(names) + 1)[: shape[1]]
    ids = np.broadcast_to(identity, shape).copy()
    ideal, depth = np.ones(shape, np.float32), np.ones(shape, np.float32)
    still = clspeckle.MotionInput(depth=depth, previous_from_current=np.eye(4), frame_time_s=frame_time)
    progress("skin, cloth and a board")
    frames = np.array(
        [
            camera.render(ideal, material=ids, motion=still if index else None, frame_index=index)
            for index in range(config["frames"])
        ]
    )
    diameter = theory.relative_diameter(config["f_number"], 2.9e-6, 940e-9)
    lags = np.arange(config["lags"])
    arrays, verdicts = {"lags": lags}, []
    edge = 8  # as far as the lens spreads light from one material into the next
    for k, name in enumerate(names):
        columns = np.flatnonzero(identity == k)[edge:-edge]
        part = frames[:, :, columns].reshape(len(frames), -1)
        part = part - part.mean(axis=1, keepdims=True)
        variance = (part**2).mean()
        acf = np.array([(part[: len(part) - lag] * part[lag:]).mean() for lag in lags]) / variance
        arrays[name] = acf
        tau = config["correlation_time_s"].get(name, np.inf)
        expected = np.exp(-2 * lags * frame_time / tau) if tau > 0 else (lags == 0) * 1.0
        speckles = part.shape[1] * theory.pupil(shape, diameter).mean()
        # Where correlation lasts, only the first image counts; where none is, all do.
        tolerance = 4 / np.sqrt(speckles)
        verdicts.append(
            Verdict(
                f"largest difference from theory, {name}",
                np.abs(acf - expected).max(),
                0.0,
                tolerance,
                "exp(-2 t / tau) of the intensity; 4 deviations of a correlation of one image's speckles",
            )
        )
    return Outcome(arrays, verdicts)


def living_draw(figure: Figure, outcome: Outcome, config: Config) -> None:
    figure.set_size_inches(6, 3.6)
    axes = figure.subplots()
    time_s = outcome.arrays["lags"] / config["frames_per_second"]
    for name, acf in outcome.arrays.items():
        if name != "lags":
            axes.plot(time_s, acf, "o-", markersize=3, label=name)
    axes.set(title="autocorrelation (Fig. 26)", xlabel="lag, s")
    axes.legend()


EXPERIMENTS = [
    Experiment(
        "decorrelation",
        "22, 23, 24",
        "Moving along X, along Z, turning about Y",
        "The speckle of a board while the device moves by the thesis's steps. The lengths (0.5 mm, 3 mm, 0.25 degrees) "
        "are the thesis's and settings "
        "of a material; the shape of the curves is the model's, and its correlation ends.",
        motion_run,
        motion_draw,
    ),
    Experiment(
        "living_surfaces",
        "26",
        "Skin and cloth",
        "A person who sits still, at 30 frames per second: on skin and cloth no correlation lasts from one frame to "
        "the next, on the board beside them "
        "all does.",
        living_run,
        living_draw,
    ),
]

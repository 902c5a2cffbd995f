"""Draws a figure of the steps of a page in docs/method into docs/images: model, sensor, dots, statistics, inference.

PYTHONPATH=bindings/python/src CLSPECKLE_LIBRARY=build/lib/libclspeckle.so .venv/bin/python docs/figures/steps.py
"""

from __future__ import annotations

import argparse
import subprocess
import tempfile
from pathlib import Path
from typing import Any

import clspeckle
import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from numpy.typing import NDArray

Image = NDArray[Any]
GRAY = "gray"


def grid(shape: tuple[int, int], pitch: float) -> Image:
    """Places of dots on a lattice, that begins half a pitch from the border."""
    ys, xs = (np.arange(0.5 * pitch, side, pitch) for side in shape)
    return np.stack(np.meshgrid(xs, ys), axis=-1).reshape(-1, 2)


def show(axes: Any, image: Image, title: str, low: float | None = None, high: float | None = None, **more: Any) -> None:
    axes.imshow(image, cmap=more.pop("cmap", GRAY), vmin=low, vmax=high, interpolation="nearest", **more)
    axes.set_title(title, fontsize=9)
    axes.set(xticks=[], yticks=[])


def draw_model(out: Path) -> None:
    """A frame, from the ideal image to codes."""
    shape, f_number = (96, 96), 8.0
    ideal = clspeckle.Dots(shape, grid(shape, 24), sigma_px=4).render()
    phase = clspeckle.Phase(shape, seed=1)
    phase.refresh(0)
    aperture = clspeckle.Aperture(shape, f_number=f_number)
    field = np.sqrt(ideal) * phase.field()[: shape[0], : shape[1]]
    intensity = aperture.intensity(phase, ideal)
    codes = clspeckle.Sensor(shape, exposure_gain_dn=1500.0, read_noise_dn=6.0).expose(intensity, frame_index=0)
    figure, axes = plt.subplots(1, 5, figsize=(10, 2.5), constrained_layout=True)
    show(axes[0], ideal, "ideal image $I_0$")
    show(axes[1], field.real, "field $U$, real part", -1.5, 1.5, cmap="RdBu")
    show(axes[2], np.fft.fftshift(np.abs(aperture.pupil())), f"pupil $P$ at f/{f_number:g}")
    show(axes[3], intensity, "intensity $I$")
    show(axes[4], codes, "codes")
    save(figure, out / "model_steps.png")


def draw_sensor(out: Path) -> None:
    """What steps of the sensor do to a ramp, and the photon transfer."""
    shape, gain = (64, 128), 900.0
    ramp = np.broadcast_to(np.linspace(0, 1.2, shape[1], dtype=np.float32), shape)
    camera = {"exposure_gain_dn": gain, "read_noise_dn": 1.0, "conversion_gain_dn_per_e": 1.0}
    steps: dict[str, dict[str, Any]] = {
        "gain and converter": {},
        "+ crosstalk, pixel gains": {"crosstalk_fraction": 0.1, "prnu": 0.06},
        "+ shot noise": {"shot_noise": True},
        "+ full well": {"full_well_e": 700.0},
        "+ columns, rows, hot pixels": {
            "column_offset_dn": 12.0,
            "row_noise_dn": 12.0,
            "hot_pixel_fraction": 0.004,
            "hot_pixel_mean_dn": 300.0,
        },
    }
    figure = plt.figure(figsize=(10, 3.6), constrained_layout=True)
    places = figure.add_gridspec(len(steps), 2, width_ratios=(2, 1.6))
    given: dict[str, Any] = {}
    for place, (name, members) in enumerate(steps.items()):
        given.update(members)
        codes = clspeckle.Sensor(shape, seed=1, **camera, **given).expose(ramp, frame_index=0)
        axes = figure.add_subplot(places[place, 0])
        show(axes, codes[:24], "", 0, 1023, aspect="auto")
        axes.set_ylabel(name, rotation=0, ha="right", va="center", fontsize=9)
    axes = figure.add_subplot(places[:, 1])
    sensor = clspeckle.Sensor(shape, seed=1, shot_noise=True, full_well_e=700.0, **camera)
    means, variances = [], []
    for level in np.linspace(0.02, 1.0, 25):
        even = np.full(shape, level, np.float32)
        first, second = (sensor.expose(even, frame_index=frame).astype(float) for frame in (0, 1))
        means.append(0.5 * (first + second).mean() - 64)
        variances.append(0.5 * ((first - second) ** 2).mean())
    line = np.array([0.0, 720.0])
    axes.plot(line, line + 1, color="0.6", label="$K = 1$ DN per electron")
    axes.plot(means, variances, "o", markersize=4, label="two frames of each level")
    axes.set(xlabel="mean above the black level, DN", ylabel="variance over time, DN$^2$")
    axes.set_title("photon transfer: the variance falls at the full well", fontsize=9)
    axes.legend(fontsize=8)
    save(figure, out / "sensor_steps.png")


def draw_dots(out: Path) -> None:
    """Each defect alone."""
    shape = (72, 72)
    places = grid(shape, 24)
    defects: dict[str, dict[str, Any]] = {
        "ideal": {},
        "skewed beam, s = 1.2": {"beam_skew": 1.2},
        "flat-topped beam, f = 1": {"beam_flatness": 1.0},
        "zero order, r = 3": {"zero_order_relative_intensity": 3.0},
        "ghosts, r = 0.3": {"ghost_relative_intensity": 0.3},
        "scatter, 20 %": {"scatter_fraction": 0.2},
        "wavelength, d = 0.1": {"relative_wavelength_shift": 0.1},
    }
    figure, axes = plt.subplots(1, len(defects), figsize=(12, 2.1), constrained_layout=True)
    for one, (name, members) in zip(axes, defects.items(), strict=True):
        show(one, clspeckle.Dots(shape, places, sigma_px=3, **members).render(), name, 0, 1.5)
    save(figure, out / "dots_defects.png")


def draw_statistics(out: Path) -> None:
    """The images that statistics of a sequence are of: a board at rest, with shot noise."""
    shape = (96, 96)
    camera = clspeckle.Pipeline.from_parameters(
        shape, f_number=5.6, exposure_gain_dn=150.0, seed=3, shot_noise=True, conversion_gain_dn_per_e=0.5,
    )  # fmt: skip
    frames = np.stack([camera.render(np.ones(shape, np.float32)) for _ in range(32)]).astype(float) - 64
    level = frames.mean(axis=(1, 2), keepdims=True)
    frames *= frames.mean() / level
    mean = frames.mean(axis=0)
    residual = frames[0] - mean
    variance = frames.var(axis=0, ddof=1)
    power = np.abs(np.fft.fftshift(np.fft.fft2(mean - mean.mean()))) ** 2
    figure, axes = plt.subplots(1, 5, figsize=(12, 2.6), constrained_layout=True)
    show(axes[0], mean, "mean image $M$", 0, np.quantile(mean, 0.99))
    show(axes[1], residual, "residual $e_0$", cmap="RdBu")
    show(axes[2], variance, "variance over time $V$", 0, np.quantile(variance, 0.99))
    show(axes[3], np.log10(power + 1), "power spectrum of $M$", cmap="magma")
    axes[4].plot(mean.ravel() / mean.mean(), variance.ravel(), ".", markersize=1)
    axes[4].set(xlabel="$M / m$", ylabel="$V$, DN$^2$")
    axes[4].set_title("shot noise is the slope", fontsize=9)
    save(figure, out / "statistics_steps.png")


def draw_inference(out: Path, program: Path) -> None:
    """A diagnosis: statistic by statistic without and with the effects, and the gap after each of them."""
    effects = {"shot_noise": "dn_per_electron=0.25", "prnu": "sigma=0.01", "defocus": "waves=0.8"}
    with tempfile.TemporaryDirectory() as folder:
        given = [word for name, value in effects.items() for word in ("--effect", f"{name}:{value}")]
        command = [program, "capture", "make", Path(folder) / "set", "--frames", "16", "--seed", "5", *given]
        subprocess.run(command, check=True)
        found = clspeckle.diagnose(Path(folder) / "set")
    report = found.report
    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 3.2), constrained_layout=True)
    rows = report["shrink"]["per_statistic"]
    before = np.array([abs(row["z_before"] or 0) for row in rows])
    after = np.array([abs(row["z_after"] or 0) for row in rows])
    order = np.argsort(-before)
    left.plot(before[order], color="0.6", label="baseline simulator")
    left.plot(after[order], ".", markersize=3, label="simulator with the effects")
    left.axhline(3, ls=":", color="k", linewidth=0.8)
    left.set(
        yscale="symlog",
        ylim=(0, None),
        xlabel="statistics, by what they differ",
        ylabel="distance, standard deviations",
    )
    left.set_title(f"{len(rows)} statistics on frames that no fit has seen", fontsize=9)
    left.legend(fontsize=8)
    steps = [("baseline", found.shrink.distance_before)]
    steps += [("+ " + step.effect, step.distance_after) for step in found.shrink.steps]
    names, heights = zip(*steps, strict=True)
    right.bar(names, heights, color=["0.6", *["tab:blue"] * (len(steps) - 1)])
    right.set(ylabel="distance that is left")
    right.set_title(f"verdict: {found.verdict}; {100 * found.shrink.fraction:.1f} % of the gap is gone", fontsize=9)
    save(figure, out / "inference_steps.png")


def save(figure: Any, path: Path) -> None:
    figure.savefig(path, dpi=110)
    plt.close(figure)
    print(path)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, default=Path("docs/images"), help="folder for the figures")
    parser.add_argument("--program", type=Path, default=Path("build/bin/clspeckle"), help="the command line program")
    arguments = parser.parse_args()
    arguments.output.mkdir(parents=True, exist_ok=True)
    draw_model(arguments.output)
    draw_sensor(arguments.output)
    draw_dots(arguments.output)
    draw_statistics(arguments.output)
    draw_inference(arguments.output, arguments.program)


if __name__ == "__main__":
    main()

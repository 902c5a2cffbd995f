#!/usr/bin/env python3
"""A rig of a dot projector and two cameras: what speckle, f-number and polarization cost in disparity.

    python3 examples/active_stereo/active_stereo.py [--f-number 5.6] [--figure FILE] [--json FILE] [--real LEFT RIGHT]

Each camera sees the same dots, but speckle of its own: the angle between the cameras is far beyond the angle over which
speckle stays alike. Two figures are printed for each lens and polarization:

* the noise of the least-squares shift of a window, measured and by theory (below);
* the noise of OpenCV's semi-global matcher on the codes of both sensors, and the share of pixels it matches wrongly.

Theory. In a window with mean light M and slope g = dM/dx, the shift that fits best is e = sum g (L - R) / sum g^2.
Light of a rough surface is I(k) at its points, lens and pupil make the field's response h, and M = I * h^2. By the
moment theorem of circular Gaussian fields, the codes of two pixels are correlated by

    cov(i, j) = (1 + P^2) / 2 |sum_k h(i - k) h(j - k) I(k)|^2,     var e = sum_ij g_i g_j (cov_L + cov_R) / (sum g^2)^2

at a degree of polarization P (J. W. Goodman, Speckle Phenomena in Optics, 2nd ed., 2020, sections 3.3, 4.4 and 5.2).

Needs NumPy and opencv-python-headless (PyPI); Matplotlib for the figure.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import sys
from pathlib import Path

import numpy as np

import clspeckle

WINDOW = 15
REACH = 16  # of the pupil's response, px
TRUE_DISPARITY_PX = 40  # a whole number: no interpolation in between


@dataclasses.dataclass(frozen=True)
class Rig:
    """A projector at the origin, cameras half a baseline to its left and right; all look along +z."""

    width: int = 640
    height: int = 480
    focal_px: float = 600.0
    baseline_m: float = 0.05
    dots: int = 12000
    dot_sigma: float = 0.0018  # tangent of the angle: 1.1 px
    half_extent: float = 0.65

    def pattern(self, seed: int = 1) -> clspeckle.Pattern:
        """Dots in random places, as active stereo has them: no two neighbourhoods are alike."""
        random = np.random.default_rng(seed)
        side = 2048
        texels = np.zeros((side, side), np.float32)
        per_texel = 2 * self.half_extent / side
        sigma = self.dot_sigma / per_texel
        reach = int(np.ceil(4 * sigma))
        for x, y in random.uniform(reach, side - 1 - reach, (self.dots, 2)):
            rows, columns = (np.arange(int(c) - reach, int(c) + reach + 1) for c in (y, x))
            dot = np.exp(-((rows[:, None] - y) ** 2 + (columns - x) ** 2) / (2 * sigma**2))
            texels[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1] += dot
        return clspeckle.Pattern(texels, half_extent_x=self.half_extent, half_extent_y=self.half_extent)

    def plane(self, side: int, slope: float = 0.0) -> tuple[clspeckle.Geometry, np.ndarray]:
        """The plane z = z0 + slope x as the left (side -1) or right (1) camera sees it, and its disparity in px."""
        eye = 0.5 * side * self.baseline_m
        v, u = np.indices((self.height, self.width), dtype=float)
        right, down = (u - self.width / 2) / self.focal_px, (v - self.height / 2) / self.focal_px
        far = self.focal_px * self.baseline_m / TRUE_DISPARITY_PX
        z = (far + slope * eye) / (1 - slope * right)
        normal = np.array([slope, 0, -1]) / np.hypot(slope, 1)
        geometry = clspeckle.Geometry(
            position=np.stack([eye + right * z, down * z, z], -1).astype(np.float32),
            normal=np.broadcast_to(normal, (*z.shape, 3)).astype(np.float32),
        )
        return geometry, self.focal_px * self.baseline_m / z


def response(shape: tuple[int, int], relative_diameter: float) -> np.ndarray:
    """h of a circular pupil, (height, width) with the middle at (0, 0) and the sum of squares 1."""
    y, x = (np.fft.fftfreq(n) for n in shape)
    h = np.fft.ifft2(np.hypot(y[:, None], x) < relative_diameter / 2).real
    return h / np.sqrt((h**2).sum())


def blurred(image: np.ndarray, kernel: np.ndarray) -> np.ndarray:
    return np.fft.irfft2(np.fft.rfft2(image) * np.fft.rfft2(kernel), s=image.shape)


def least_squares(ideal: list[np.ndarray], seen: list[np.ndarray], relative_diameter: float, polarization: float):
    """Standard deviation over windows of the shift that fits best: measured, and by theory; in px."""
    h = response(ideal[0].shape, relative_diameter)
    mean = [blurred(image, h**2) for image in ideal]
    shift = (TRUE_DISPARITY_PX, 0)  # a column of the left camera is so much further on in the right one
    slope = np.gradient(mean[0], axis=1)
    y, x = np.divmod(np.arange(WINDOW**2), WINDOW)
    # From the light around a window to its pixels.
    size = WINDOW + 2 * REACH
    v, u = np.divmod(np.arange(size**2), size)
    from_light = h[y[:, None] + REACH - v, x[:, None] + REACH - u]
    measured, theory = [], []
    for top in range(REACH, ideal[0].shape[0] - WINDOW - REACH, WINDOW):
        for left in range(REACH + TRUE_DISPARITY_PX, ideal[0].shape[1] - WINDOW - REACH, WINDOW):
            g = slope[top : top + WINDOW, left : left + WINDOW].ravel()
            energy = (g**2).sum()
            noise = np.zeros(WINDOW**2)
            variance = 0.0
            for sign, light, average, image, further in zip((1, -1), ideal, mean, seen, shift):
                begin = left - TRUE_DISPARITY_PX + further
                inside = np.s_[top : top + WINDOW, begin : begin + WINDOW]
                noise += sign * (image - average)[inside].ravel()
                if len(measured) % 8 == 0:  # every eighth window says enough
                    around = light[top - REACH : top + WINDOW + REACH, begin - REACH : begin + WINDOW + REACH].ravel()
                    covariance = ((from_light * around) @ from_light.T) ** 2 * (1 + polarization**2) / 2
                    variance += g @ covariance @ g / energy**2
            if len(measured) % 8 == 0:
                theory.append(variance)
            measured.append(g @ noise / energy)
    return float(np.std(measured)), float(np.sqrt(np.mean(theory)))


def match(left: np.ndarray, right: np.ndarray, most_px: int = 64) -> np.ndarray:
    """OpenCV's semi-global matcher on two images of 8 bits: disparity in px, NaN where it finds none."""
    import cv2

    block = 7
    matcher = cv2.StereoSGBM_create(
        0, most_px, block, P1=8 * block**2, P2=32 * block**2, uniquenessRatio=5, disp12MaxDiff=1,
        mode=cv2.STEREO_SGBM_MODE_SGBM_3WAY,
    )  # fmt: skip
    disparity = matcher.compute(left, right).astype(float) / 16
    disparity[disparity < 0] = np.nan
    return disparity


def eight_bits(codes: np.ndarray) -> np.ndarray:
    """Codes above the black level, the brightest thousandth saturated."""
    light = np.clip(codes.astype(float) - np.percentile(codes, 1), 0, None)
    return np.clip(light * (255 / np.percentile(light, 99.9)), 0, 255).astype(np.uint8)


def roughness(disparity: np.ndarray) -> float:
    """Noise of a disparity map without its truth: second differences over 8 px, of which a plane has none."""
    second = disparity[:, 16:] - 2 * disparity[:, 8:-8] + disparity[:, :-16]
    second = second[np.isfinite(second)]
    return float(1.4826 * np.median(np.abs(second)) / np.sqrt(6)) if second.size else float("nan")


def measure(rig: Rig, f_number: float, polarization: float, seed: int) -> dict:
    """One row of the table."""
    shape = (rig.height, rig.width)
    pattern = rig.pattern()
    camera = {"f_number": f_number, "degree_of_polarization": polarization, "polarization_count": 2}
    camera["normalization"] = "unit_mean"  # the same exposure behind each lens
    wall = [rig.plane(side) for side in (-1, 1)]
    ideal = [pattern.lookup(geometry) for geometry, _ in wall]
    seen, codes = [], []
    tilted = [rig.plane(side, slope=0.2) for side in (-1, 1)]
    for number in (0, 1):
        # Speckle of its own for each camera: another seed.
        own = {**camera, "seed": 2 * seed + number}
        with clspeckle.Pipeline.from_parameters(shape, pattern=pattern, output="intensity", **own) as pipeline:
            seen.append(pipeline.render(wall[number][0], refresh="all"))
        gain = 600 / float(np.percentile(ideal[number], 99))
        with clspeckle.Pipeline.from_parameters(shape, pattern=pattern, exposure_gain_dn=gain, **own) as pipeline:
            codes.append(pipeline.render(tilted[number][0], refresh="all"))
            diameter = pipeline.aperture.info().relative_diameter
    measured, theory = least_squares(ideal, seen, diameter, polarization)
    disparity = match(*(eight_bits(c) for c in codes))
    inside = np.s_[8:-8, 72:-8]
    error = (disparity - tilted[0][1])[inside]
    found = np.isfinite(error)
    right = found & (np.abs(np.where(found, error, 9)) < 1)
    return {
        "f_number": f_number,
        "degree_of_polarization": polarization,
        "contrast": float(np.sqrt((1 + polarization**2) / 2)),
        "least_squares_px": measured,
        "theory_px": theory,
        "matcher_px": float(1.4826 * np.median(np.abs(error[right] - np.median(error[right])))),
        "wrong_share": float(1 - right.mean()),
        "codes": codes,
        "disparity": disparity,
    }


def figure(row: dict, path: Path) -> None:
    """Both codes and the disparity of one row."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    sheet, axes = plt.subplots(1, 3, figsize=(12, 3.4), layout="constrained")
    for axis, codes, title in zip(axes, row["codes"], ("left camera", "right camera")):
        axis.imshow(codes[120:280, 200:420], cmap="gray")
        axis.set_title(f"{title}, part", fontsize=9)
    low, high = np.nanpercentile(row["disparity"], (1, 99))
    shown = axes[2].imshow(row["disparity"], cmap="viridis", vmin=low, vmax=high)
    axes[2].set_title(f"disparity, f/{row['f_number']:g}, P = {row['degree_of_polarization']:g}", fontsize=9)
    sheet.colorbar(shown, ax=axes[2], label="px")
    for axis in axes:
        axis.set(xticks=[], yticks=[])
    sheet.savefig(path, dpi=80)


def real_pair(left: Path, right: Path) -> dict:
    """What the matcher makes of two rectified images of a real camera."""
    import cv2

    images = [cv2.imread(str(path), cv2.IMREAD_GRAYSCALE) for path in (left, right)]
    for path, image in zip((left, right), images):
        if image is None:
            raise SystemExit(f"{path}: no image that OpenCV reads")
    if images[0].shape != images[1].shape:
        raise SystemExit(f"{left} is {images[0].shape}, {right} is {images[1].shape}; expected a rectified pair")
    disparity = match(*images, most_px=128)
    return {"matched_share": float(np.isfinite(disparity).mean()), "roughness_px": roughness(disparity)}


def main() -> int:
    parser = argparse.ArgumentParser(description="What speckle costs active stereo.")
    parser.add_argument("--seed", type=int, default=1, help="of the speckle and noise (default 1)")
    parser.add_argument("--f-number", type=float, nargs="+", default=[4.0, 5.6, 8.0], help="lenses (default 4 5.6 8)")
    parser.add_argument("--figure", type=Path, help="write a picture of the last row")
    parser.add_argument("--json", type=Path, help="write the table")
    parser.add_argument("--real", type=Path, nargs=2, metavar=("LEFT", "RIGHT"), help="match a real pair, too")
    arguments = parser.parse_args()
    try:
        import cv2  # noqa: F401
    except ImportError:
        print("the matcher is OpenCV's: python3 -m pip install opencv-python-headless", file=sys.stderr)
        return 1
    rows = []
    print("f-number  P    contrast  least squares  theory     semi-global  wrong")
    for f_number in arguments.f_number:
        for polarization in (1.0, 0.0):
            row = measure(Rig(), f_number, polarization, arguments.seed)
            rows.append(row)
            print(
                f"f/{f_number:<6g} {polarization:3.1f}   {row['contrast']:.3f}     {row['least_squares_px']:.3f} px"
                f"       {row['theory_px']:.3f} px   {row['matcher_px']:.3f} px     {100 * row['wrong_share']:.1f} %",
                flush=True,
            )
    result = {"rows": [{k: v for k, v in row.items() if not isinstance(v, (list, np.ndarray))} for row in rows]}
    simulated = roughness(rows[-1]["disparity"])
    if arguments.real:
        result["real"] = real_pair(*arguments.real)
        print(
            f"real pair: {100 * result['real']['matched_share']:.0f} % matched, noise "
            f"{result['real']['roughness_px']:.3f} px without truth; the last row: {simulated:.3f} px"
        )
    if arguments.figure:
        figure(rows[-1], arguments.figure)
    if arguments.json:
        arguments.json.write_text(json.dumps(result, indent=1) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())

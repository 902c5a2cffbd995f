"""Estimators of EMVA Standard 1288, release 3.1, chapters 6 and 8, and the split into columns, rows and pixels that
release 4.0 added: from raw frames to the parameters of a camera.

They know nothing of the library: frames in, numbers out.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

QUANTIZATION_VARIANCE = 1 / 12


def temporal(first: NDArray, second: NDArray) -> tuple[float, float]:
    """Mean and temporal variance of a pair of frames of the same light (equations 18 and 20): the difference cancels
    what is fixed."""
    a, b = first.astype(np.float64), second.astype(np.float64)
    return float((a.mean() + b.mean()) / 2), float(np.mean((a - b) ** 2) / 2 - (a.mean() - b.mean()) ** 2 / 2)


def spatial_variance(frames: NDArray) -> float:
    """Of the mean over the frames, less what temporal noise leaves of itself in it (equations 32 to 34)."""
    stack = frames.astype(np.float64)
    count = stack.shape[0]
    return float(stack.mean(axis=0).var(ddof=1) - stack.var(axis=0, ddof=1).mean() / count)


@dataclass
class Result:
    """What the standard reports."""

    system_gain_dn_per_e: float
    quantum_efficiency: float
    dark_noise_e: float
    saturation_capacity_e: float
    linearity_error_percent: float


def photon_transfer(photons: NDArray, bright: NDArray, dark: NDArray) -> Result:
    """Section 6.6: `photons` per pixel and exposure, ascending; `bright` (exposures, 2, height, width); `dark` (2,
    height, width)."""
    dark_mean, dark_variance = temporal(*dark)
    pairs = np.array([temporal(*pair) for pair in bright])
    mean, variance = pairs[:, 0] - dark_mean, pairs[:, 1] - dark_variance
    saturation = int(np.argmax(pairs[:, 1]))
    used = mean <= 0.7 * mean[saturation]
    used[saturation:] = False
    gain = float(np.sum(mean[used] * variance[used]) / np.sum(mean[used] ** 2))
    responsivity = float(np.sum(photons[used] * mean[used]) / np.sum(photons[used] ** 2))
    # Section 6.7: a line through 5 % to 95 % of saturation with relative weights, and the mean relative deviation
    # from it.
    linear = (mean >= 0.05 * mean[saturation]) & (mean <= 0.95 * mean[saturation])
    linear[saturation:] = False
    weights = 1 / mean[linear]
    slope, offset = np.polyfit(photons[linear], mean[linear], 1, w=weights)
    deviation = 100 * (mean[linear] - (offset + slope * photons[linear])) / (offset + slope * photons[linear])
    return Result(
        system_gain_dn_per_e=gain,
        quantum_efficiency=responsivity / gain,
        dark_noise_e=float(np.sqrt(max(dark_variance - QUANTIZATION_VARIANCE, 0.0)) / gain),
        saturation_capacity_e=responsivity / gain * float(photons[saturation]),
        linearity_error_percent=float(np.mean(np.abs(deviation))),
    )


def dsnu1288_e(dark: NDArray, gain_dn_per_e: float) -> float:
    """Equation 41, from frames in the dark."""
    return float(np.sqrt(spatial_variance(dark)) / gain_dn_per_e)


def prnu1288(bright: NDArray, dark: NDArray) -> float:
    """Equation 42, from frames at half of saturation and in the dark."""
    difference = spatial_variance(bright) - spatial_variance(dark)
    return float(np.sqrt(difference) / (bright.mean(dtype=np.float64) - dark.mean(dtype=np.float64)))


def split_variance(frames: NDArray) -> NDArray[np.float64]:
    """Spatial variances of columns, rows and pixels (release 4.0): those of the means of columns and of rows, each less
    what the pixels leave of themselves in a mean, and that of the rest, less what temporal noise leaves of itself."""
    stack = frames.astype(np.float64)
    average = stack.mean(axis=0)
    height, width = average.shape
    columns, rows = average.mean(axis=0), average.mean(axis=1)
    rest = average - columns - rows[:, None] + average.mean()
    pixels = np.sum(rest**2) / ((height - 1) * (width - 1))
    temporal_part = stack.var(axis=0, ddof=1).mean() / stack.shape[0]
    return np.array([columns.var(ddof=1) - pixels / height, rows.var(ddof=1) - pixels / width, pixels - temporal_part])


def split_prnu1288(bright: NDArray, dark: NDArray) -> NDArray[np.float64]:
    """PRNU1288 of columns, rows and pixels, from frames at half of saturation and in the dark; 0 where the dark frames
    vary more."""
    difference = np.maximum(split_variance(bright) - split_variance(dark), 0.0)
    return np.sqrt(difference) / (bright.mean(dtype=np.float64) - dark.mean(dtype=np.float64))

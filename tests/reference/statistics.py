"""First-order statistics, histogram and autocovariance (statistics.h)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.signal
from numpy.typing import NDArray


@dataclass(frozen=True)
class Moments:
    """The members of ClspMoments."""

    count: int
    mean: float
    standard_deviation: float
    contrast: float
    skewness: float
    excess_kurtosis: float
    minimum: float
    maximum: float


def moments(image: NDArray, mask: NDArray[np.uint8] | None = None) -> Moments:
    """Moments of the pixels whose mask is not 0. The standard deviation is divided by count - 1; skewness and excess
    kurtosis are g1 = m3 / m2^(3/2) and g2 = m4 / m2^2 - 3 of the central moments (means over count)."""
    values = np.asarray(image, dtype=np.float64)
    values = values.ravel() if mask is None else values[np.asarray(mask) != 0]
    mean = float(values.mean())
    deviation = values - mean
    standard_deviation = float(np.sqrt(np.sum(deviation**2) / (values.size - 1))) if values.size > 1 else 0.0
    second = float(np.mean(deviation**2))
    nan = float("nan")
    return Moments(
        count=values.size,
        mean=mean,
        standard_deviation=standard_deviation,
        contrast=standard_deviation / mean if mean != 0 else nan,
        skewness=float(np.mean(deviation**3)) / second**1.5 if second > 0 else nan,
        excess_kurtosis=float(np.mean(deviation**4)) / second**2 - 3 if second > 0 else nan,
        minimum=float(values.min()),
        maximum=float(values.max()),
    )


def histogram(
    image: NDArray, low: float, high: float, bins: int, mask: NDArray[np.uint8] | None = None
) -> NDArray[np.int64]:
    """Counts in `bins` equal bins of [low, high), between the count below low and the count at or above high."""
    values = np.asarray(image, dtype=np.float64)
    values = values.ravel() if mask is None else values[np.asarray(mask) != 0]
    edges = low + (high - low) * np.arange(bins + 1) / bins
    return np.bincount(np.searchsorted(edges, values, side="right"), minlength=bins + 2)


def autocovariance(image: NDArray, max_lag: int) -> NDArray[np.float64]:
    """Autocovariance of the image less its mean, each lag divided by its number of pairs, 1 at lag (0, 0) in the
    centre."""
    values = np.asarray(image, dtype=np.float64)
    deviation = values - values.mean()
    height, width = values.shape
    full = scipy.signal.correlate(deviation, deviation, mode="full", method="fft")
    lags = np.arange(-max_lag, max_lag + 1)
    sums = full[height - 1 - max_lag : height + max_lag, width - 1 - max_lag : width + max_lag]
    means = sums / ((height - np.abs(lags))[:, None] * (width - np.abs(lags))[None, :])
    return means / means[max_lag, max_lag]

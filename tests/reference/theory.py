"""Closed-form statistics of fully developed speckle.

Sources: J. W. Goodman, "Speckle Phenomena in Optics" (2nd ed., SPIE 2020), chapters 2 (random walks), 3 (first-order
laws, partial polarization) and 4 (autocorrelation, circular pupil, integrated speckle); thesis section 2.5 (eq. 36 to
40).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.special
from numpy.typing import NDArray


def contrast(degree_of_polarization: float) -> float:
    """sqrt((1 + p^2) / 2)."""
    return float(np.sqrt((1 + degree_of_polarization**2) / 2))


def intensity_cdf(intensity: NDArray, degree_of_polarization: float) -> NDArray[np.float64]:
    """Distribution function of I with mean 1: the sum of independent exponentials with means a = (1 + p)/2, b = (1 -
    p)/2. Exponential at p = 1, Gamma(2) at p = 0."""
    x = np.maximum(np.asarray(intensity, dtype=np.float64), 0.0)
    p = degree_of_polarization
    if p == 1:
        return -np.expm1(-x)
    if p == 0:
        return 1 - (1 + 2 * x) * np.exp(-2 * x)
    a, b = (1 + p) / 2, (1 - p) / 2
    return 1 - (a * np.exp(-x / a) - b * np.exp(-x / b)) / (a - b)


def sample_intensity(
    rng: np.random.Generator, shape: tuple[int, ...], degree_of_polarization: float
) -> NDArray[np.float64]:
    """Independent draws from intensity_cdf()."""
    p = degree_of_polarization
    return rng.exponential((1 + p) / 2, shape) + (rng.exponential((1 - p) / 2, shape) if p < 1 else 0.0)


def airy_autocovariance(distance_px: NDArray, diameter: float) -> NDArray[np.float64]:
    """Normalized autocovariance of the intensity behind a circular pupil, |2 J1(pi D r) / (pi D r)|^2."""
    x = np.pi * diameter * np.asarray(distance_px, dtype=np.float64)
    safe = np.where(x == 0, 1.0, x)
    return np.where(x == 0, 1.0, (2 * scipy.special.j1(safe) / safe) ** 2)


def field_correlation(pupil: NDArray[np.float64]) -> NDArray[np.complex128]:
    """Complex coherence factor mu of the field behind a pupil, on the periodic grid, lag 0 first: white noise
    filtered by P has the power spectrum |P|^2."""
    correlation = np.fft.ifft2(pupil**2)
    return correlation / correlation[0, 0].real


def contrast_standard_error(pupil: NDArray[np.float64], degree_of_polarization: float) -> float:
    """Standard error of the contrast sd/mean estimated from all pixels of one image on the periodic grid.

    The influence function of the contrast at intensity I (mean 1, contrast c) is ((I - 1)^2 - c^2)/(2c) - c (I - 1).
    For I = a I_1 + b I_2 it expands in Laguerre polynomials L_n of I_1 and I_2, and for two exponential intensities
    with coherence factor mu, cov(L_m, L_n) = |mu|^(2n) for m = n, else 0 (the bivariate exponential density expands in
    these). So n var = (a^4 + b^4 + a^2 b^2)/c^2 sum |mu|^4 + ((c a - a^2/c)^2 + (c b - b^2/c)^2) sum |mu|^2;
    for p = 1 it is sum |mu|^4: n_eff = n / sum |mu|^4 independent pixels.
    """
    power = np.abs(field_correlation(pupil)) ** 2
    p = degree_of_polarization
    a, b, c = (1 + p) / 2, (1 - p) / 2, contrast(p)
    second = (a**4 + b**4 + a**2 * b**2) / c**2 * np.sum(power**2)
    first = ((c * a - a**2 / c) ** 2 + (c * b - b**2 / c) ** 2) * np.sum(power)
    return float(np.sqrt((first + second) / power.size))


def mean_standard_error(pupil: NDArray[np.float64], degree_of_polarization: float) -> float:
    """Standard error of the mean intensity of one image on the periodic grid, over the true mean: c sqrt(sum |mu|^2 /
    n)."""
    power = np.abs(field_correlation(pupil)) ** 2
    return float(contrast(degree_of_polarization) * np.sqrt(np.sum(power) / power.size))


def integrated_contrast(pupil: NDArray[np.float64], oversampling: int, degree_of_polarization: float) -> float:
    """Contrast after the mean over oversampling^2 samples per pixel (Goodman, chapter 4: c^2 = var / mean^2 is the
    double average of |mu|^2 over the pixel)."""
    power = np.abs(field_correlation(pupil)) ** 2
    offsets = np.arange(oversampling)
    lag = offsets[:, None] - offsets[None, :]
    average = power[lag[:, :, None, None], lag[None, None, :, :]].mean()
    return float(contrast(degree_of_polarization) * np.sqrt(average))


def unit_phasor_contrast(pupil: NDArray[np.float64]) -> float:
    """Contrast of polarized speckle from one unit phasor per sample, on the periodic grid without oversampling.

    With h the impulse response of the pupil, U = sum h_k exp(i phi_k) and E|U|^4 = 2 (sum |h|^2)^2 - sum |h|^4
    (Goodman, chapter 2, random walk with few steps), so c^2 = 1 - sum |h|^4 / (sum |h|^2)^2. It tends to 0 at a
    full aperture, where each pixel has a single phasor (the "slight offset" of the thesis's figure 31, and its f/0).
    """
    power = np.abs(np.fft.ifft2(pupil)) ** 2
    return float(np.sqrt(1 - np.sum(power**2) / np.sum(power) ** 2))


def exposure_contrast(path: float, correlation: Callable[[NDArray], NDArray]) -> float:
    """Contrast of speckle whose field correlation over a path l is correlation(l), integrated over a path L:
    C^2 = 2 / L^2 int_0^L (L - l) correlation(l)^2 dl (Goodman, Statistical Optics, 6.2)."""
    lags = np.linspace(0.0, path, 20001)
    return float(np.sqrt(2 / path**2 * np.trapezoid((path - lags) * correlation(lags) ** 2, lags)))


def lines_contrast(offsets: NDArray, weights: NDArray, dephasing_rad: float, heights: float = np.inf) -> float:
    """Contrast of several laser lines: |E exp(i (k - l) s h)| = exp(-((k - l) s)^2 / 2) is the coherence of two lines'
    fields, and intensities of partially correlated speckles add (Goodman, Speckle Phenomena in Optics, 3.3). An image
    point that sums but `heights` heights sees the mean of so many phasors: |mu|^2 grows by (1 - |mu|^2) / heights."""
    weights = np.asarray(weights) / np.sum(weights)
    squared = np.exp(-((np.subtract.outer(offsets, offsets) * dephasing_rad) ** 2))
    squared += (1 - squared) / heights
    return float(np.sqrt(np.sum(np.outer(weights, weights) * squared)))


def rician_contrast(specular_over_speckle: float) -> float:
    """Contrast of speckle on a constant field of r times its mean intensity: sqrt(1 + 2 r) / (1 + r) (Goodman, Speckle
    Phenomena in Optics, 3.2)."""
    r = specular_over_speckle
    return float(np.sqrt(1 + 2 * r) / (1 + r))


def area_contrast(diameter: float, fill_factor: float) -> float:
    """Contrast of speckle behind a circular pupil, integrated over a centred square of that part of a pixel's area:
    C^2 = int int mu^2(x, y) tri(x / a) tri(y / a) dx dy / a^2 (Goodman, Speckle Phenomena in Optics, 4.7)."""
    side = np.sqrt(fill_factor)
    nodes, weights = np.polynomial.legendre.leggauss(64)
    x, w = side * (nodes + 1) / 2, side * weights / 2
    distance = np.hypot(x[:, None], x[None, :])
    triangle = np.outer(1 - x / side, 1 - x / side)
    return float(np.sqrt(4 / side**2 * np.sum(np.outer(w, w) * triangle * airy_autocovariance(distance, diameter))))

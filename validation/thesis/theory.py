"""Closed forms that the experiments are held against, in float64 and apart from the library's kernels.

Goodman: J. W. Goodman, Speckle Phenomena in Optics, 2nd edition.
"""

from __future__ import annotations

import numpy as np


def pupil(shape: tuple[int, int], relative_diameter: float) -> np.ndarray:
    """The circular pupil on the grid of frequencies of an FFT; the rim is out (thesis eq. 24)."""
    fy, fx = np.fft.fftfreq(shape[0])[:, None], np.fft.fftfreq(shape[1])
    return fx**2 + fy**2 < (relative_diameter / 2) ** 2


def point_spread(shape: tuple[int, int], relative_diameter: float) -> np.ndarray:
    """Of the intensity, with sum 1 and the origin at [0, 0]."""
    spread = np.abs(np.fft.ifft2(pupil(shape, relative_diameter))) ** 2
    return spread / spread.sum()


def relative_diameter(f_number: float, pixel_pitch_m: float, wavelength_m: float) -> float:
    """D, in units of the sampling frequency (thesis 2.3)."""
    return pixel_pitch_m / (wavelength_m * f_number)


def contrast(degree_of_polarization: float, missing: float = 0.0) -> float:
    """Of partially polarized speckle (Goodman 4.4). missing: what one polarization's squared contrast lacks to 1."""
    return float(np.sqrt(0.5 * (1 + degree_of_polarization**2) * (1 - missing)))


def unit_phasor_deficit(shape: tuple[int, int], relative_diameter: float) -> float:
    """What the squared contrast lacks to 1 where each sample has one phasor: sum |h|^4 / (sum |h|^2)^2 (Goodman
    3.6)."""
    spread = point_spread(shape, relative_diameter)
    return float(np.sum(spread**2))


def contrast_deviation(contrast: float, samples: int) -> float:
    """Standard error of the contrast of independent samples of a Gamma law (delta method on mean and variance)."""
    return float(contrast * np.sqrt((0.5 + 0.5 * contrast**2) / samples))


def kolmogorov_bound(samples: int) -> float:
    """Distance of an empirical law from the true one that is exceeded once in a thousand times (Kolmogorov)."""
    return 1.949 / float(np.sqrt(samples))


def field_correlation(path: np.ndarray) -> np.ndarray:
    """Of the surface's field over a path in correlation lengths (phase.h)."""
    d = 0.9386677 * path
    return np.where(d < 2, (1 - d / 2) * np.cos(np.pi * d / 2) + np.sin(np.pi * d / 2) / np.pi, 0.0)

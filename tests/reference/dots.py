"""Ideal projected dots and their defects (dots.h)."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import quad


def hermite3(a: NDArray) -> NDArray:
    """He3, the third Hermite polynomial of probability theory."""
    return np.polynomial.hermite_e.hermeval(a, [0, 0, 0, 1])


def skewed_flux(skew: float) -> float:
    """Light of the clipped Gram-Charlier profile over that of the Gaussian, by quadrature."""

    def profile(a: float) -> float:
        return math.exp(-a * a / 2) * max(0.0, 1 + skew / 6 * (a**3 - 3 * a)) / math.sqrt(2 * math.pi)

    return sum(quad(profile, low, low + 1, epsabs=1e-13, epsrel=1e-12, limit=400)[0] for low in range(-12, 12))


def profile(u: NDArray, v: NDArray, skew: float = 0.0, angle_rad: float = 0.0, flatness: float = 0.0) -> NDArray:
    """g at (u, v), both in sigmas."""
    value = np.exp(-((u**2 + v**2) ** (1 + 2 * flatness)) / 2)
    if skew:
        along = u * np.cos(angle_rad) + v * np.sin(angle_rad)
        value = value * np.maximum(0, 1 + skew / 6 * hermite3(along)) / skewed_flux(skew)
    return value


def lattice_offset(positions: NDArray) -> NDArray:
    """Half the sum of the median vectors to the nearest neighbours to the right and below (at most 1024 dots)."""
    half = np.zeros(2)
    for right in (True, False):
        vectors = []
        for position in positions:
            d = positions - position
            along, across = (d[:, 0], d[:, 1]) if right else (d[:, 1], d[:, 0])
            sector = (along > 0) & ((np.abs(across) <= along) if right else (np.abs(across) < along))
            if sector.any():
                d = d[sector]
                vectors.append(d[np.argmin(np.sum(d**2, axis=1))])
        if vectors:
            half += np.median(vectors, axis=0) / 2
    return half


def render(
    shape: tuple[int, int],
    positions_px: ArrayLike,
    *,
    sigma_px: ArrayLike = 2.0,
    peaks: ArrayLike | None = None,
    scale: float = 1.0,
    principal_point_px: tuple[float, float] | None = None,
    relative_wavelength_shift: float = 0.0,
    beam_skew: float = 0.0,
    beam_skew_angle_rad: float = 0.0,
    beam_flatness: float = 0.0,
    zero_order_relative_intensity: float = 0.0,
    ghost_relative_intensity: float = 0.0,
    ghost_offset_px: tuple[float, float] | None = None,
    scatter_fraction: float = 0.0,
) -> NDArray[np.float64]:
    """I0, every dot over the whole image."""
    height, width = shape
    positions = np.asarray(positions_px, np.float64).reshape(-1, 2)
    sigmas = np.broadcast_to(np.asarray(sigma_px, np.float64), len(positions))
    weights = np.ones(len(positions)) if peaks is None else np.asarray(peaks, np.float64)
    centre = np.array(((width - 1) / 2, (height - 1) / 2) if principal_point_px is None else principal_point_px)
    mean_sigma, mean_weight = sigmas.mean(), weights.mean()
    if ghost_relative_intensity:
        offset = lattice_offset(positions) if ghost_offset_px is None else np.array(ghost_offset_px)
        positions = np.concatenate([positions, positions + offset])
        sigmas = np.concatenate([sigmas, sigmas])
        weights = np.concatenate([weights, ghost_relative_intensity * weights])
    positions = centre + (1 + relative_wavelength_shift) * (positions - centre)
    if zero_order_relative_intensity:
        positions = np.concatenate([positions, centre[None]])
        sigmas = np.append(sigmas, mean_sigma)
        weights = np.append(weights, zero_order_relative_intensity * mean_weight)
    y, x = np.mgrid[:height, :width].astype(np.float64)
    image = np.zeros(shape)
    for (px, py), sigma, weight in zip(positions, sigmas, weights):
        image += weight * profile((x - px) / sigma, (y - py) / sigma, beam_skew, beam_skew_angle_rad, beam_flatness)
    image *= scale
    return (1 - scatter_fraction) * image + scatter_fraction * image.mean()

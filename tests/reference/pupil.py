"""Pupil shapes and aberrations (aperture.h), on the frequency grid in float64.

Sources: M. Born, E. Wolf, "Principles of Optics", chapter 9 (Strehl ratio, Zernike's circle polynomials); R. J. Noll,
"Zernike polynomials and atmospheric turbulence", J. Opt. Soc. Am. 66 (1976) 207 (indices and normalization); J. W.
Goodman, "Introduction to Fourier Optics", chapters 4 and 6.
"""

from __future__ import annotations

from math import factorial

import numpy as np
from numpy.typing import NDArray

from . import aperture
from .phase import FieldGrid

MARGIN = 2.0**-41
"""Relative distance by which boundaries that are not decided in integers lie inside."""


def coordinates(grid: FieldGrid, diameter: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(u, v) of each grid frequency, FFT order; the rim of the full circle at 1."""
    gh, gw = grid.shape
    u = 2 * aperture.frequencies(gw) * grid.oversampling / (gw * diameter)
    v = 2 * aperture.frequencies(gh) * grid.oversampling / (gh * diameter)
    return np.broadcast_to(u[None, :], grid.shape), np.broadcast_to(v[:, None], grid.shape)


def polygon_inside(
    u: NDArray, v: NDArray, blade_count: int, rotation_rad: float = 0.0, curvature: float = 0.0
) -> NDArray[np.bool_]:
    """Points within all blades: half planes (curvature 0), or discs of radius 1 / curvature whose rims go through two
    neighbouring vertices and bulge outwards. Vertices at rotation_rad + 2 pi k / n on the unit circle."""
    inside = np.hypot(u, v) < 1 - MARGIN
    for k in range(blade_count):
        middle = rotation_rad + 2 * np.pi * (k + 0.5) / blade_count
        normal = np.array([np.cos(middle), np.sin(middle)])
        chord = np.cos(np.pi / blade_count)
        along = u * normal[0] + v * normal[1]
        if curvature == 0:
            inside &= along < chord * (1 - MARGIN)
        else:
            radius = 1 / curvature
            centre = chord - np.sqrt(radius**2 - np.sin(np.pi / blade_count) ** 2)
            inside &= np.hypot(u - centre * normal[0], v - centre * normal[1]) < radius * (1 - MARGIN)
    return inside


def polygon_area(blade_count: int, curvature: float = 0.0) -> float:
    """Area within a unit circle's inscribed polygon; with curved blades, plus the segments between chords and arcs."""
    n = blade_count
    area = 0.5 * n * np.sin(2 * np.pi / n)
    if curvature > 0:
        radius = 1 / curvature
        half_angle = np.arcsin(np.sin(np.pi / n) / radius)
        area += n * radius**2 * (half_angle - np.sin(half_angle) * np.cos(half_angle))
    return float(area)


def noll(index: int) -> tuple[int, int]:
    """(n, m) of Noll's index; m < 0 for sines."""
    n = 0
    while (n + 1) * (n + 2) // 2 < index:
        n += 1
    position = index - n * (n + 1) // 2  # 1 to n + 1 within the order
    m = 2 * (position // 2) if n % 2 == 0 else 2 * ((position - 1) // 2) + 1
    return n, m if index % 2 == 0 else -m


def zernike(index: int, rho: NDArray, theta: NDArray) -> NDArray[np.float64]:
    """Noll's orthonormal polynomial, by the sum of factorials of Born and Wolf 9.2.1."""
    n, m = noll(index)
    k = abs(m)
    radial = sum(
        (-1) ** s
        * factorial(n - s)
        / (factorial(s) * factorial((n + k) // 2 - s) * factorial((n - k) // 2 - s))
        * np.asarray(rho, dtype=np.float64) ** (n - 2 * s)
        for s in range((n - k) // 2 + 1)
    )
    if m == 0:
        return np.sqrt(n + 1) * radial
    return np.sqrt(2 * (n + 1)) * radial * (np.cos(k * theta) if m > 0 else np.sin(k * theta))


def wavefront(u: NDArray, v: NDArray, defocus_waves: float = 0.0, zernike_waves: NDArray | None = None) -> NDArray:
    """W in waves."""
    rho, theta = np.hypot(u, v), np.arctan2(v, u)
    waves = defocus_waves * rho**2
    for i, coefficient in enumerate(() if zernike_waves is None else zernike_waves):
        if coefficient:
            waves = waves + coefficient * zernike(4 + i, rho, theta)
    return waves


def point_spread(pupil: NDArray) -> NDArray[np.float64]:
    """|IFFT2 P|^2: the intensity of a point of unit amplitude, origin first."""
    field = np.fft.ifft2(pupil)
    return field.real**2 + field.imag**2

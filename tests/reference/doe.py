"""The pattern of a diffractive element (doe.h), in float64: sums and matrix products, written from the header's
equations."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.special import erf


def cell_orders(phase: NDArray) -> NDArray[np.float64]:
    """|c_mn|^2 of a cell's transform over its number of samples, FFT order."""
    field = np.exp(1j * np.asarray(phase, np.float64))
    return np.abs(np.fft.fft2(field) / field.size) ** 2


def edges(count: int, half_extent: float) -> NDArray[np.float64]:
    """Edges of the texels in direction cosines."""
    return np.linspace(-half_extent, half_extent, count + 1)


def gaussian_shares(centre: NDArray, sigma: float, at: NDArray) -> NDArray[np.float64]:
    """Shares of normal laws with these centres between neighbouring edges; (centres, edges - 1)."""
    return np.diff(0.5 * (1 + erf((at[None, :] - np.asarray(centre)[:, None]) / (np.sqrt(2) * sigma))), axis=1)


def order_image(
    phase: NDArray,
    pitch_m: float,
    wavelength_m: float,
    sigma_m: tuple[float, float],
    shape: tuple[int, int],
    half_extent: tuple[float, float],
    envelope: bool = True,
) -> NDArray[np.float64]:
    """Share of the power in each texel: every order that reaches the image as a Gaussian of sigma lambda / (4 pi
    sigma_m)."""
    rows, columns = phase.shape
    power = cell_orders(phase)
    maps, bins = [], []
    for count, sigma, texels, extent in zip((columns, rows), sigma_m, shape[::-1], half_extent):
        spacing = wavelength_m / (count * pitch_m)
        if envelope:
            reach = int(1.3 * extent / spacing) + 2
            order = np.arange(-reach, reach + 1)
            damping = np.sinc(order / count) ** 2
        else:
            order = np.arange(-(count // 2), (count - 1) // 2 + 1)
            damping = np.ones(len(order))
        spread = gaussian_shares(order * spacing, wavelength_m / (4 * np.pi * sigma), edges(texels, extent))
        maps.append(spread * damping[:, None])
        bins.append(order % count)
    return maps[1].T @ power[np.ix_(bins[1], bins[0])] @ maps[0]


def aperture_image(
    field: NDArray,
    pitch_m: float,
    wavelength_m: float,
    shape: tuple[int, int],
    half_extent: tuple[float, float],
    oversampling: int = 2,
    envelope: bool = True,
) -> NDArray[np.float64]:
    """Share of the power in each texel: |FT|^2 of the field at `oversampling` directions per pixel, each one an
    interval."""
    waves, shares = [], []
    for count, texels, extent in zip(field.shape[::-1], shape[::-1], half_extent):
        bin_width = wavelength_m / (count * pitch_m)
        reach = int(extent / bin_width) + 2 if envelope else count // 2
        order = (
            np.arange(-reach * oversampling, reach * oversampling + (oversampling if envelope else 0)) / oversampling
        )
        waves.append(np.exp(-2j * np.pi * np.outer(order, np.arange(count)) / count))
        at = edges(texels, extent) / bin_width
        low, high = order[:, None] - 0.5 / oversampling, order[:, None] + 0.5 / oversampling
        overlap = np.clip(np.minimum(at[None, 1:], high) - np.maximum(at[None, :-1], low), 0, None) * oversampling
        damping = np.sinc(order / count) ** 2 if envelope else np.ones(len(order))
        shares.append(overlap * damping[:, None])
    power = np.abs(waves[1] @ field @ waves[0].T) ** 2
    power /= field.size * np.sum(np.abs(field) ** 2) * oversampling**2
    return shares[1].T @ power @ shares[0]


def texel_shares(texels: NDArray, half_extent: tuple[float, float], power_w: float = 1.0) -> NDArray[np.float64]:
    """Back from radiant intensities J to shares: dP = J du dv / cos."""
    height, width = texels.shape
    u = (edges(width, half_extent[0])[1:] + edges(width, half_extent[0])[:-1]) / 2
    v = (edges(height, half_extent[1])[1:] + edges(height, half_extent[1])[:-1]) / 2
    cosine = np.sqrt(np.clip(1 - u[None, :] ** 2 - v[:, None] ** 2, 0, None))
    area = 4 * half_extent[0] * half_extent[1] / (width * height)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(cosine > 0, texels.astype(np.float64) * area / cosine, 0.0) / power_w

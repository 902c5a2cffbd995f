"""The lens's aperture (aperture.h; thesis sections 2.3, 2.9 and 3.3): pupil and intensity."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from .phase import FieldGrid


def relative_diameter(f_number: float, pixel_pitch_m: float, wavelength_m: float) -> float:
    """D in cycles per pixel: the field's cutoff is 1 / (2 wavelength f_number) cycles per metre on either side
    (Goodman, "Introduction to Fourier Optics", coherent transfer function), a disc of diameter 1 / (wavelength
    f_number)."""
    return pixel_pitch_m / (wavelength_m * f_number)


def frequencies(n: int) -> NDArray[np.int64]:
    """Integer frequencies in FFT order; the Nyquist frequency of an even n counts as negative."""
    return np.fft.fftfreq(n, 1.0 / n).round().astype(np.int64)


def circle_support(grid: FieldGrid, diameter: float) -> NDArray[np.bool_]:
    """Grid frequencies inside the circular pupil, decided exactly:
    kx^2 GH^2 + ky^2 GW^2 < (1 - 2^-40) (D/s)^2 GW^2 GH^2 / 4. The rim is out, as in thesis eq. 24."""
    gh, gw = grid.shape
    limit = (1 - Fraction(1, 2**40)) * (Fraction(diameter) / grid.oversampling) ** 2 * gw**2 * gh**2 / 4
    # An integer is below the rational limit exactly when it is below its ceiling.
    ceiling = -((-limit.numerator) // limit.denominator)
    kx2 = frequencies(gw)[None, :] ** 2
    ky2 = frequencies(gh)[:, None] ** 2
    return kx2 * gh**2 + ky2 * gw**2 < ceiling


def radius(grid: FieldGrid, diameter: float) -> NDArray[np.float64]:
    """Distance of each grid frequency from the axis, 1 at the rim."""
    fy, fx = _cycles_per_pixel(grid)
    return np.hypot(fx[None, :], fy[:, None]) / (diameter / 2)


def _cycles_per_pixel(grid: FieldGrid) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    gh, gw = grid.shape
    return frequencies(gh) * grid.oversampling / gh, frequencies(gw) * grid.oversampling / gw


def circle_pupil(grid: FieldGrid, diameter: float, soft_rim: float = 0.0) -> NDArray[np.float64]:
    """Circular pupil; over the part soft_rim of the radius it falls from 1 to 0 by a raised cosine. Times the
    oversampling: z has unit variance on each sample, so that its power per cycle falls as 1 / oversampling^2, but the
    light must not."""
    pupil = circle_support(grid, diameter) * float(grid.oversampling)
    if soft_rim > 0:
        into_rim = (radius(grid, diameter) - (1 - soft_rim)) / soft_rim
        pupil *= 0.5 * (1 + np.cos(np.pi * np.clip(into_rim, 0, 1)))
    return pupil


def image_pupil(grid: FieldGrid, diameter: float, image: NDArray) -> NDArray[np.float64]:
    """Pupil from an image of amplitude transmissions that covers the square of side D, looked up bilinearly. 0
    outside; the square's boundary is out, as the circle's rim is. Times the oversampling, as the circle."""
    fy, fx = _cycles_per_pixel(grid)
    image = np.asarray(image, dtype=np.float64)
    rows, columns = image.shape
    # Texel centres lie at (i + 1/2) / rows of the side.
    weight_y, inside_y = _bilinear_weights(fy / diameter, rows)
    weight_x, inside_x = _bilinear_weights(fx / diameter, columns)
    return grid.oversampling * (weight_y @ image @ weight_x.T) * inside_y[:, None] * inside_x[None, :]


def _bilinear_weights(position: NDArray[np.float64], texels: int) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Rows of interpolation weights at positions in (-1/2, 1/2) over an axis of texels; clamped to the edge texels."""
    texel = np.clip((position + 0.5) * texels - 0.5, 0, texels - 1)
    low = np.minimum(np.floor(texel).astype(int), max(texels - 2, 0))
    high = np.minimum(low + 1, texels - 1)
    weights = np.zeros((position.size, texels))
    index = np.arange(position.size)
    np.add.at(weights, (index, low), 1 - (texel - low))
    np.add.at(weights, (index, high), texel - low)
    return weights, np.abs(position) < 0.5


def mean_transmission(pupil: NDArray[np.float64]) -> float:
    """Mean of |P|^2 over the grid's frequencies: E[I] / I0 of a flat image (Parseval)."""
    return float(np.mean(pupil**2))


def unit_mean(pupil: NDArray[np.float64]) -> NDArray[np.float64]:
    """The pupil scaled so that the mean of |P|^2 is 1."""
    return pupil / np.sqrt(mean_transmission(pupil))


def clean_irradiance(irradiance: NDArray) -> NDArray[np.float64]:
    """NaN, infinite and negative pixels count as 0."""
    values = np.asarray(irradiance, dtype=np.float64)
    return np.where(np.isfinite(values) & (values > 0), values, 0.0)


def spectrum(grid: FieldGrid, irradiance: NDArray, z: NDArray) -> NDArray[np.complex128]:
    """FFT2(sqrt(I0) z) on the field grid."""
    amplitude = np.sqrt(grid.expand(clean_irradiance(irradiance)))
    return np.fft.fft2(amplitude * np.asarray(z, dtype=np.complex128))


def filtered_intensity(grid: FieldGrid, spectrum_u: NDArray[np.complex128], pupil: NDArray) -> NDArray[np.float64]:
    """|IFFT2(spectrum P)|^2, its mean over the samples of each pixel (thesis eq. 32, and integration over the pixel's
    area)."""
    s = grid.oversampling
    field = np.fft.ifft2(spectrum_u * pupil)[: s * grid.height, : s * grid.width]
    samples = field.real**2 + field.imag**2
    return samples.reshape(grid.height, s, grid.width, s).mean(axis=(1, 3))


def polarized_sum(
    first: NDArray[np.float64], second: NDArray[np.float64] | None, degree_of_polarization: float
) -> NDArray[np.float64]:
    """(1 + p)/2 I_1 + (1 - p)/2 I_2 (thesis eq. 40; Goodman, "Statistical Optics", partially polarized light)."""
    total = 0.5 * (1 + degree_of_polarization) * first
    if degree_of_polarization < 1:
        if second is None:
            raise ValueError("a degree of polarization below 1 needs two polarizations")
        total = total + 0.5 * (1 - degree_of_polarization) * second
    return total


def intensity(
    grid: FieldGrid,
    irradiance: NDArray,
    fields: Sequence[NDArray],
    pupil: NDArray,
    degree_of_polarization: float = 1.0,
) -> NDArray[np.float64]:
    """The speckled image, height x width."""
    count = 1 if degree_of_polarization == 1 else 2
    images = [filtered_intensity(grid, spectrum(grid, irradiance, z), pupil) for z in fields[:count]]
    return polarized_sum(images[0], images[1] if count == 2 else None, degree_of_polarization)

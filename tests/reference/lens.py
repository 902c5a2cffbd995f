"""What a lens does beside diffraction (lens.h): Brown and Conrady's distortion, glare, ambient light, vignetting.

Sources: D. C. Brown, "Decentering distortion of lenses", Photogrammetric Engineering 32 (1966) 444, in the form of
OpenCV's camera model (calib3d, "Camera Calibration and 3D Reconstruction"); R. G. Keys, "Cubic convolution
interpolation for digital image processing", IEEE Trans. ASSP 29 (1981) 1153.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .phase import FieldGrid


@dataclass(frozen=True)
class Distortion:
    """A distortion of a width x height image; without focal lengths r = 1 in the farthest corner pixel's centre."""

    width: int
    height: int
    k1: float = 0.0
    k2: float = 0.0
    k3: float = 0.0
    p1: float = 0.0
    p2: float = 0.0
    principal_point_px: tuple[float, float] | None = None
    focal_length_px: tuple[float, float] | None = None

    @property
    def principal(self) -> NDArray[np.float64]:
        """(cx, cy)"""
        return np.array(self.principal_point_px or ((self.width - 1) / 2, (self.height - 1) / 2), dtype=np.float64)

    @property
    def corner(self) -> float:
        """Pixels from the principal point to the farthest corner pixel's centre."""
        corners = np.array([[0, 0], [self.width - 1, 0], [0, self.height - 1], [self.width - 1, self.height - 1]])
        return float(np.linalg.norm(corners - self.principal, axis=1).max())

    @property
    def unit(self) -> NDArray[np.float64]:
        """Pixels of a radius of 1 along each axis."""
        return np.array(self.focal_length_px or (self.corner, self.corner), dtype=np.float64)

    def distort(self, points: NDArray) -> NDArray[np.float64]:
        """Where ideal points (..., 2) are imaged."""
        x, y = np.moveaxis((np.asarray(points, dtype=np.float64) - self.principal) / self.unit, -1, 0)
        r2 = x**2 + y**2
        radial = 1 + self.k1 * r2 + self.k2 * r2**2 + self.k3 * r2**3
        moved = np.stack(
            [
                x * radial + 2 * self.p1 * x * y + self.p2 * (r2 + 2 * x**2),
                y * radial + self.p1 * (r2 + 2 * y**2) + 2 * self.p2 * x * y,
            ],
            axis=-1,
        )
        return self.principal + self.unit * moved

    def undistort(self, points: NDArray, iterations: int = 400) -> NDArray[np.float64]:
        """The ideal points, by p <- p + (q - distort(p)), which contracts for distortions that are not too strong."""
        target = np.asarray(points, dtype=np.float64)
        ideal = target.copy()
        for _ in range(iterations):
            ideal += target - self.distort(ideal)
        return ideal

    def slope(self, points: NDArray) -> NDArray[np.float64]:
        """d distort / d point at ideal points (..., 2): (..., 2, 2), [i, j] the slope of component i along axis j."""
        x, y = np.moveaxis((np.asarray(points, dtype=np.float64) - self.principal) / self.unit, -1, 0)
        r2 = x**2 + y**2
        radial = 1 + self.k1 * r2 + self.k2 * r2**2 + self.k3 * r2**3
        by_r2 = self.k1 + 2 * self.k2 * r2 + 3 * self.k3 * r2**2  # d radial / d r2
        xx = radial + 2 * x**2 * by_r2 + 2 * self.p1 * y + 6 * self.p2 * x
        xy = 2 * x * y * by_r2 + 2 * self.p1 * x + 2 * self.p2 * y
        yy = radial + 2 * y**2 * by_r2 + 6 * self.p1 * y + 2 * self.p2 * x
        in_units = np.stack([np.stack([xx, xy], -1), np.stack([xy, yy], -1)], -2)
        return in_units * self.unit[:, None] / self.unit

    def distort_shift(self, shift: NDArray) -> NDArray[np.float64]:
        """Vectors (height, width, 2) between ideal pixels, as the lens shows them: nearest to each source, times its
        slope there."""
        sources = self.sources()
        return np.einsum("...ij,...j->...i", self.slope(sources), warp(shift, sources, "nearest"))

    def sources(self) -> NDArray[np.float64]:
        """Source (x, y) in the ideal image of every pixel of the distorted one, (height, width, 2)."""
        y, x = np.mgrid[: self.height, : self.width].astype(np.float64)
        return self.undistort(np.stack([x, y], axis=-1))


def _cubic(f: NDArray[np.float64], tap: int) -> NDArray[np.float64]:
    """Keys' kernel with a = -1/2 at the distance of tap -1, 0, 1 or 2 from f in [0, 1)."""
    d = np.abs(tap - f)
    return np.where(d <= 1, (1.5 * d - 2.5) * d**2 + 1, ((-0.5 * d + 2.5) * d - 4) * d + 2)


def _linear(f: NDArray[np.float64], tap: int) -> NDArray[np.float64]:
    return np.maximum(0.0, 1 - np.abs(tap - f))


def warp(image: NDArray, sources: NDArray[np.float64], interpolation: str, outside: float = 0.0) -> NDArray:
    """image at the sources; beyond its border by more than half a pixel `outside`, between by its edge pixels."""
    height, width = image.shape[:2]
    x, y = sources[..., 0], sources[..., 1]
    inside = (x >= -0.5) & (x < width - 0.5) & (y >= -0.5) & (y < height - 0.5)
    if interpolation == "nearest":
        columns, rows = np.floor(x + 0.5).astype(int), np.floor(y + 0.5).astype(int)
        result = image[rows.clip(0, height - 1), columns.clip(0, width - 1)]
    else:
        weight = _cubic if interpolation == "cubic" else _linear
        taps = (-1, 0, 1, 2)
        x0, y0 = np.floor(x), np.floor(y)
        shape = inside.shape + (1,) * (image.ndim - 2)
        result = np.zeros(inside.shape + image.shape[2:])
        least = np.zeros_like(result)
        for j in taps:
            for i in taps:
                pixel = image[(y0 + j).astype(int).clip(0, height - 1), (x0 + i).astype(int).clip(0, width - 1)].astype(
                    np.float64
                )
                result += (weight(y - y0, j) * weight(x - x0, i)).reshape(shape) * pixel
                least = np.minimum(least, pixel)
        if interpolation == "cubic":
            result = np.maximum(result, least)
    result = np.array(result)
    result[~inside] = outside
    return result


def exponential_spread(height: int, width: int, scale_px: float) -> NDArray[np.float64]:
    """exp(-r / scale_px) on a periodic grid, offset 0 first, sum 1."""
    dy, dx = np.fft.fftfreq(height, 1 / height), np.fft.fftfreq(width, 1 / width)
    spread = np.exp(-np.hypot(dy[:, None], dx[None, :]) / scale_px)
    return spread / spread.sum()


def gaussian_spread(height: int, width: int, sigma_px: float) -> NDArray[np.float64]:
    """exp(-r^2 / (2 sigma^2)) on a periodic grid, offset 0 first, sum 1."""
    dy, dx = np.fft.fftfreq(height, 1 / height), np.fft.fftfreq(width, 1 / width)
    spread = np.exp(-(dy[:, None] ** 2 + dx[None, :] ** 2) / (2 * sigma_px**2))
    return spread / spread.sum()


def glare_grid(height: int, width: int, scale_px: float) -> FieldGrid:
    """The grid of the glare's transform: half of a guard of 20 scales (at most two image sides) on each side."""
    guard = int(np.ceil(2 * min(10 * scale_px, max(height, width))))
    return FieldGrid(width, height, 1, guard)


def spread_light(light: NDArray, scale_px: float) -> NDArray[np.float64]:
    """h * light on the padded periodic grid."""
    height, width = light.shape
    grid = glare_grid(height, width, scale_px)
    extended = grid.expand(np.asarray(light, dtype=np.float64))
    transfer = np.fft.fft2(exponential_spread(*grid.shape, scale_px))
    return np.fft.ifft2(np.fft.fft2(extended) * transfer).real[:height, :width]


def vignetting(
    distortion: Distortion, corner_loss: float, focal_length_px: tuple[float, float] | None = None
) -> NDArray[np.float64]:
    """(1 - corner_loss r^2), times cos^4 if focal lengths are given."""
    y, x = np.mgrid[: distortion.height, : distortion.width].astype(np.float64)
    dx, dy = x - distortion.principal[0], y - distortion.principal[1]
    factor = 1 - corner_loss * (dx**2 + dy**2) / distortion.corner**2
    if focal_length_px is not None:
        angle = np.arctan(np.hypot(dx / focal_length_px[0], dy / focal_length_px[1]))
        factor *= np.cos(angle) ** 4
    return factor


def finish(
    light: NDArray,
    distortion: Distortion,
    *,
    glare_fraction: float = 0.0,
    glare_scale_px: float = 6.0,
    ambient: float = 0.0,
    vignetting_corner_loss: float = 0.0,
    cos4_focal_length_px: tuple[float, float] | None = None,
) -> NDArray[np.float64]:
    """v ((1 - g) L + g (h * L) + ambient)."""
    value = np.asarray(light, dtype=np.float64)
    if glare_fraction > 0:
        value = (1 - glare_fraction) * value + glare_fraction * spread_light(value, glare_scale_px)
    return (value + ambient) * vignetting(distortion, vignetting_corner_loss, cos4_focal_length_px)

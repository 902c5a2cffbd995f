"""How far surface points have moved (motion.h; thesis sections 3.2.4 to 3.2.8), and the correlation of a series of
images that move, in float64."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.optimize
import scipy.special
from numpy.typing import NDArray

LATERAL_M, AXIAL_M, ROTATION_RAD = 0.5e-3, 3e-3, np.deg2rad(0.25)


def rotation(axis: tuple[float, float, float], angle: float) -> NDArray[np.float64]:
    """The matrix that turns by `angle` about `axis` (Rodrigues)."""
    x, y, z = np.asarray(axis, dtype=np.float64) / np.linalg.norm(axis)
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k


def points(
    depth: NDArray, intrinsics: tuple[float, float, float, float], along_ray: bool = False
) -> NDArray[np.float64]:
    """Positions of the pixels of a depth image."""
    fx, fy, cx, cy = intrinsics
    y, x = np.mgrid[: depth.shape[0], : depth.shape[1]].astype(np.float64)
    rays = np.stack([(x - cx) / fx, (y - cy) / fy, np.ones_like(x)], -1)
    if along_ray:
        rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    return rays * np.asarray(depth, dtype=np.float64)[..., None]


def pixels(position: NDArray, intrinsics: tuple[float, float, float, float]) -> NDArray[np.float64]:
    """Where positions lie in the image, (x, y)."""
    fx, fy, cx, cy = intrinsics
    return np.stack([fx * position[..., 0] / position[..., 2] + cx, fy * position[..., 1] / position[..., 2] + cy], -1)


def displacement(now: NDArray, before: NDArray) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Lateral (>= 0) and axial part of now - before, seen from the origin."""
    view = now / np.linalg.norm(now, axis=-1, keepdims=True)
    delta = now - before
    axial = np.sum(delta * view, axis=-1)
    return np.linalg.norm(delta - axial[..., None] * view, axis=-1), axial


def angle_between(a: NDArray, b: NDArray) -> NDArray[np.float64]:
    """Angle between vectors; the arc cosine would lose small ones."""
    return np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), np.sum(a * b, axis=-1))


def path(
    lateral: NDArray,
    axial: NDArray,
    angle: NDArray | float,
    lengths: tuple[NDArray | float, NDArray | float, NDArray | float] = (LATERAL_M, AXIAL_M, ROTATION_RAD),
) -> NDArray[np.float64]:
    """In correlation lengths."""
    return np.sqrt((lateral / lengths[0]) ** 2 + (axial / lengths[1]) ** 2 + (angle / lengths[2]) ** 2)


# --- A series of images of speckle that moves and fades ---

HIGH_PASS = (
    0.01  # cycles per pixel; slower is the illumination's envelope (periods above 100 px, 14 speckles of the images)
)


class Series:
    """The normalised cross-correlation of each pair of images `step` apart, without the mean and all that is slower
    than `high_pass`."""

    def __init__(self, images: Sequence[NDArray], high_pass: float = HIGH_PASS) -> None:
        self.shape = images[0].shape
        height, width = self.shape
        self.fy, self.fx = np.fft.fftfreq(height), np.fft.rfftfreq(width)
        self.weight = np.full(self.fx.size, 2.0)  # the half of the spectrum that rfft2 leaves out
        self.weight[0] = 1
        if width % 2 == 0:
            self.weight[-1] = 1
        slow = np.hypot(self.fy[:, None], self.fx) < high_pass
        slow[0, 0] = True
        self.spectra = []
        for image in images:
            spectrum = np.where(slow, 0, np.fft.rfft2(image))
            self.spectra.append(spectrum / np.sqrt(np.sum(self.weight * np.abs(spectrum) ** 2)))
        moves = [self.displacement(a, b) for a, b in zip(self.spectra, self.spectra[1:])]
        self.position = np.vstack([np.zeros(2), np.cumsum(moves, axis=0)])

    def at(self, a: NDArray, b: NDArray, dy: NDArray, dx: NDArray) -> NDArray[np.float64]:
        """The correlation at displacements (dy) x (dx), also between pixels."""
        rows = np.exp(2j * np.pi * np.outer(dy, self.fy))
        return ((rows @ (a.conj() * b * self.weight)) @ np.exp(2j * np.pi * np.outer(self.fx, dx))).real

    def map(self, a: NDArray, b: NDArray) -> NDArray[np.float64]:
        return np.fft.irfft2(a.conj() * b, s=self.shape) * (self.shape[0] * self.shape[1])

    def displacement(self, a: NDArray, b: NDArray) -> NDArray[np.float64]:
        """(y, x) of the correlation's maximum, to 0.05 px."""
        found = np.unravel_index(self.map(a, b).argmax(), self.shape)
        whole = [(k + n // 2) % n - n // 2 for k, n in zip(found, self.shape)]
        fine = np.arange(-15, 16) * 0.05
        best = np.unravel_index(self.at(a, b, whole[0] + fine, whole[1] + fine).argmax(), (fine.size, fine.size))
        return np.array([whole[0] + fine[best[0]], whole[1] + fine[best[1]]])

    def pairs(self, step: int) -> range:
        return range(len(self.spectra) - step)

    def registered(self, step: int) -> NDArray[np.float64]:
        """Of each pair, at the displacement that the single steps between its images add up to."""
        moved = [self.position[k + step] - self.position[k] for k in self.pairs(step)]
        return np.array(
            [
                self.at(self.spectra[k], self.spectra[k + step], d[:1], d[1:])[0, 0]
                for k, d in zip(self.pairs(step), moved)
            ]
        )

    def maximum(self, step: int) -> NDArray[np.float64]:
        """Of each pair, the largest value anywhere."""
        return np.array([self.map(self.spectra[k], self.spectra[k + step]).max() for k in self.pairs(step)])


def airy(path: NDArray) -> NDArray[np.float64]:
    """Correlation of the field when the Airy pattern of a round pinhole slides over a diffuser: the overlap of the
    pattern with itself is the Fourier transform of the pinhole's disc, 2 J1(x) / x. `path` counts in distances at which
    this is 1/e (x = 2.5838)."""
    x = 2.583838 * np.asarray(path, dtype=np.float64)
    return 2 * scipy.special.j1(x) / x


def fitted(
    correlation, steps: NDArray, means: NDArray, spreads: NDArray, pixels_per_step: float, width: int
) -> tuple[float, float]:
    """The length in steps and the fraction of white noise with which (1 - noise) correlation(step / length)^2 fits
    best; of the image's width `pixels_per_step` leave it with each step."""

    def model(step, length, noise):
        return (1 - noise) * (1 - pixels_per_step * step / width) * correlation(step / length) ** 2

    found, _ = scipy.optimize.curve_fit(model, steps, means, p0=(10, 0.01), sigma=spreads, bounds=([4, 0], [20, 0.1]))
    return float(found[0]), float(found[1])


def pinhole_kernel(diameter_px: float, step_px: float, length_steps: float, index: int) -> NDArray[np.complex128]:
    """What blurs the diffuser's white field T when a round pinhole at the distance z1 before it has moved by `index`
    steps.

    From a point u of the pinhole the diffuser's point r is reached with the phase k (r - u)^2 / 2 z1, and from there
    the image's point x at z2 with k (x - r)^2 / 2 z2: the sum over r depends on u / z1 + x / z2 alone. With u in pixels
    of the image (u z2 / z1), p = index * step_px and c = k (z1 / z2)^2 / z1:
        U(x) = sum over |u| < diameter / 2 of exp(i c (u + p)^2 / 2) T(x + u + p).
    At the displacement p the correlation is 2 J1(x) / x with x = c p diameter / 2, which gives c from the length."""
    radius = diameter_px / 2
    c = 2.583838 / (radius * step_px * length_steps)
    extent = int(np.ceil(radius))
    y, x = np.mgrid[-extent : extent + 1, -extent : extent + 1]
    # A convolution: T(x - u), so u is mirrored. exp(i c p^2 / 2) is the same everywhere.
    return (np.hypot(y, x) < radius) * np.exp(1j * c * ((x**2 + y**2) / 2 - index * step_px * x))

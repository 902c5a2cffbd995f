"""What the tests of the generator share: its sequences in short, and what is measured on them. No part of the check."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.special import j1

from gap_check.camera import SEQUENCES, Camera
from gap_check.effects import Setting
from gap_check.generator import generate_sequence
from gap_check.light import intensity, speckle
from gap_check.scene import ideal_image

Array = NDArray[np.float64]

BY_NAME = {s.name: s for s in SEQUENCES}
FRAMES = 24


def laser(camera: Camera, name: str = "board_moving", frames: int = FRAMES, seed: int = 5, **effects: Setting) -> Array:
    """Intensity of a board or of dots behind the lens."""
    image = ideal_image(camera, BY_NAME[name], effects, seed)
    return speckle(camera, BY_NAME[name], image, effects, frames, seed)


def light(camera: Camera, name: str = "board_moving", frames: int = FRAMES, seed: int = 5, **effects: Setting) -> Array:
    """Light on the sensor, with all that happens to it after the lens."""
    image = ideal_image(camera, BY_NAME[name], effects, seed)
    return intensity(camera, BY_NAME[name], image, effects, frames, seed)


def codes(camera: Camera, name: str, frames: int = FRAMES, seed: int = 5, **effects: Setting) -> Array:
    return generate_sequence(camera, BY_NAME[name], effects, frames, seed).astype(float)


def contrast(pattern: Array) -> float:
    return float(pattern.std() / pattern.mean())


def correlation(pattern: Array, dy: int, dx: int) -> float:
    """Periodic autocorrelation of the fluctuations at a lag."""
    delta = pattern - pattern.mean()
    return float((delta * np.roll(delta, (dy, dx), axis=(-2, -1))).mean() / delta.var())


def airy(diameter: float, lag: float) -> float:
    """|mu|^2 of a circular pupil: (2 J1(u) / u)^2, u = pi D lag."""
    u = np.pi * diameter * lag
    return float((2 * j1(u) / u) ** 2) if u else 1.0


def moments(image: Array) -> tuple[Array, Array]:
    """Centroid (x, y) and variances along x and y of an image's light."""
    places = np.stack(np.meshgrid(np.arange(image.shape[1]), np.arange(image.shape[0])))  # x, y
    share = image / image.sum()
    centre = (share * places).sum(axis=(1, 2))
    return centre, (share * (places - centre[:, None, None]) ** 2).sum(axis=(1, 2))

"""Conditions of the lab that are no fault of the camera: a lamp and a beam that are not even."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.float64]


@dataclass(frozen=True)
class Conditions:
    """The lamp lights flats, the beam boards and dots. Lengths are parts of the way from the axis to the corner."""

    lamp_slope: float = 0.0  # change of the lamp's light from the axis to the corner's distance, along its direction
    lamp_direction_deg: float = 0.0
    lamp_curvature: float = 0.0  # loss at the corner's distance from the lamp's own center
    lamp_center: tuple[float, float] = (0.0, 0.0)
    beam_loss: float = 0.0  # of a Gaussian beam at a corner straight across from its center
    beam_center: tuple[float, float] = (0.0, 0.0)

    def lamp(self, x: Image, y: Image) -> Image:
        """Light of the lamp at points about the axis, in units of the corner's distance."""
        angle = np.deg2rad(self.lamp_direction_deg)
        r2 = (x - self.lamp_center[0]) ** 2 + (y - self.lamp_center[1]) ** 2
        return 1 + self.lamp_slope * (x * np.cos(angle) + y * np.sin(angle)) - self.lamp_curvature * r2

    def beam(self, x: Image, y: Image) -> Image:
        """Light of the beam at such points, 1 at its center."""
        r2 = (x - self.beam_center[0]) ** 2 + (y - self.beam_center[1]) ** 2
        return np.asarray((1 - self.beam_loss) ** (r2 / (1 + np.hypot(*self.beam_center)) ** 2))


EVEN = Conditions()


def draw_conditions(rng: np.random.Generator) -> Conditions:
    """An uneven lamp and an uneven beam, as labs have them."""

    def center(reach: float) -> tuple[float, float]:
        angle, radius = rng.uniform(0, 2 * np.pi), reach * np.sqrt(rng.random())
        return float(radius * np.cos(angle)), float(radius * np.sin(angle))

    return Conditions(
        lamp_slope=float(rng.uniform(0.03, 0.15)),
        lamp_direction_deg=float(rng.uniform(0, 360)),
        lamp_curvature=float(rng.uniform(0.0, 0.08)),
        lamp_center=center(0.5),
        beam_loss=float(rng.uniform(0.1, 0.3)),
        beam_center=center(0.4),
    )

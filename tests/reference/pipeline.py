"""A whole frame (pipeline.h; thesis figure 29)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from . import aperture
from .phase import PhaseState
from .sensor import Sensor


@dataclass
class Pipeline:
    """Phase refresh, aperture, sensor: keeps the phase state from frame to frame."""

    phase: PhaseState
    pupil: NDArray[np.float64]
    degree_of_polarization: float = 1.0
    sensor: Sensor | None = None

    def intensity(
        self,
        irradiance: NDArray,
        frame_index: int,
        refresh_mask: NDArray[np.uint8] | None = None,
        refresh_all: bool = False,
    ) -> NDArray[np.float64]:
        """Refreshes the phases (all of them in the first frame; without a mask none) and speckles the image."""
        if refresh_all or not self.phase.drawn:
            self.phase.refresh(frame_index)
        elif refresh_mask is not None:
            self.phase.refresh(frame_index, refresh_mask)
        fields = [self.phase.field(k) for k in range(self.phase.polarization_count)]
        return aperture.intensity(self.phase.grid, irradiance, fields, self.pupil, self.degree_of_polarization)

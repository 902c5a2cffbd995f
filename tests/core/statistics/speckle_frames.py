"""Frames of speckle from the library, for the tests of its laws."""

from __future__ import annotations

import clspeckle
import numpy as np

from reference import aperture, phase

SIZE = 512
GAUSSIAN = "circular_gaussian"


class Camera:
    """Independent frames of a flat (or given) image, over the mean transmission of the aperture."""

    def __init__(self, context, diameter, p=1.0, field=GAUSSIAN, size=SIZE, seed=81, oversampling=1, guard_px=0):
        self.grid = phase.FieldGrid(size, size, oversampling, guard_px)
        options = {"oversampling": oversampling, "guard_px": guard_px, "context": context}
        self.state = clspeckle.Phase(
            (size, size), field=field, polarization_count=1 if p == 1 else 2, seed=seed, **options
        )
        self.stage = clspeckle.Aperture((size, size), relative_diameter=diameter, degree_of_polarization=p, **options)
        self.pupil = aperture.circle_pupil(self.grid, diameter)
        self.transmission = self.stage.info().mean_transmission
        self.flat = np.ones((size, size), np.float32)

    def frames(self, count, irradiance=None):
        for frame_index in range(count):
            self.state.refresh(frame_index)
            image = self.stage.intensity(self.state, self.flat if irradiance is None else irradiance)
            yield image.astype(np.float64) / self.transmission

    def spaced(self, count, pitch):
        """Pixels `pitch` apart of `count` frames, as one row of samples."""
        return np.concatenate([frame[::pitch, ::pitch].ravel() for frame in self.frames(count)])

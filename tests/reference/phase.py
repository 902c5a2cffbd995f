"""The surface's random field (phase.h; thesis sections 2.4, 2.5 and 3.3)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from . import philox

STREAM_PHASE = 1  # + polarization
STREAM_MAGNITUDE = 3  # + polarization
LARGEST_RADIX = 13
CIRCULAR_GAUSSIAN = "circular_gaussian"
UNIT_PHASOR = "unit_phasor"


def grid_length(minimum: int) -> int:
    """Smallest n >= minimum with no prime factor above 13."""
    n = minimum
    while True:
        rest = n
        for prime in (2, 3, 5, 7, 11, 13):
            while rest % prime == 0:
                rest //= prime
        if rest == 1:
            return n
        n += 1


@dataclass(frozen=True)
class FieldGrid:
    """The grid of the field of a width x height image."""

    width: int
    height: int
    oversampling: int = 1
    guard_px: int = 0

    @property
    def grid_width(self) -> int:
        return grid_length(self.oversampling * (self.width + self.guard_px))

    @property
    def grid_height(self) -> int:
        return grid_length(self.oversampling * (self.height + self.guard_px))

    @property
    def shape(self) -> tuple[int, int]:
        """(grid_height, grid_width)"""
        return self.grid_height, self.grid_width

    def pixel_columns(self) -> NDArray[np.intp]:
        """Image column that each grid column takes its value from."""
        return _pixel_of_sample(self.width, self.oversampling, self.grid_width)

    def pixel_rows(self) -> NDArray[np.intp]:
        """Image row that each grid row takes its value from."""
        return _pixel_of_sample(self.height, self.oversampling, self.grid_height)

    def expand(self, image: NDArray) -> NDArray:
        """An image on the field grid: samples take their pixel's value, padding that of the nearest edge pixel."""
        if image.shape != (self.height, self.width):
            raise ValueError(f"image of shape {image.shape}, expected {(self.height, self.width)}")
        return image[np.ix_(self.pixel_rows(), self.pixel_columns())]


def _pixel_of_sample(pixels: int, oversampling: int, grid: int) -> NDArray[np.intp]:
    """Nearest pixel of each sample along one axis of a periodic grid; on a tie the last pixel."""
    sample = np.arange(grid)
    covered = oversampling * pixels
    past_end = sample - covered + 1
    before_start = grid - sample
    padding = np.where(past_end <= before_start, pixels - 1, 0)
    return np.where(sample < covered, sample // oversampling, padding)


def draw(grid: FieldGrid, field: str, seed: int, frame_index: int, polarization: int) -> NDArray[np.complex128]:
    """Fresh z on the whole grid, E|z|^2 = 1.

    Unit phasor: exp(i phi), phi from stream 1 + polarization (thesis section 3.3). Circular Gaussian (thesis eq. 33
    to 36; Goodman, "Speckle Phenomena in Optics", chapter 2): the magnitude is sqrt(-ln u), u from stream 3 +
    polarization, so that |z|^2 is exponential with mean 1.
    """
    height, width = grid.shape
    z = philox.phasor(philox.image_words(height, width, seed, frame_index, STREAM_PHASE + polarization))
    if field == CIRCULAR_GAUSSIAN:
        u = philox.image_uniform(height, width, seed, frame_index, STREAM_MAGNITUDE + polarization)
        z = z * np.sqrt(-np.log(u))
    elif field != UNIT_PHASOR:
        raise ValueError(f"unknown field {field!r}")
    return z


class PhaseState:
    """The persistent field; refresh() draws anew where a mask says so."""

    def __init__(
        self, grid: FieldGrid, field: str = CIRCULAR_GAUSSIAN, polarization_count: int = 2, seed: int = 0
    ) -> None:
        self.grid = grid
        self.field_kind = field
        self.polarization_count = polarization_count
        self.seed = seed
        self._fields: list[NDArray[np.complex128]] | None = None

    def refresh(self, frame_index: int, mask: NDArray[np.uint8] | None = None) -> None:
        """New values where mask is not 0; everywhere without a mask and at the first call."""
        fresh = [draw(self.grid, self.field_kind, self.seed, frame_index, k) for k in range(self.polarization_count)]
        if self._fields is None or mask is None:
            self._fields = fresh
            return
        drawn = self.grid.expand(np.asarray(mask)) != 0
        self._fields = [np.where(drawn, new, old) for new, old in zip(fresh, self._fields, strict=True)]

    @property
    def drawn(self) -> bool:
        """Whether there has been a refresh."""
        return self._fields is not None

    def field(self, polarization: int) -> NDArray[np.complex128]:
        """z of one polarization."""
        if self._fields is None:
            raise RuntimeError("the phase has not been refreshed yet")
        return self._fields[polarization]

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


STREAM_NEXT_PHASE = 0x20  # + polarization
STREAM_NEXT_MAGNITUDE = 0x22  # + polarization
STREAM_PATH_START = 0x24
STREAM_BOIL_PHASE = 0x26  # + polarization; + 2 for B
STREAM_BOIL_MAGNITUDE = 0x2A  # + polarization; + 2 for B


def _unit_correlation_knots() -> float:
    """The d at which path_correlation() is 1/e, by bisection."""
    low, high = 0.0, 2.0
    for _ in range(100):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if knot_correlation(middle) > np.exp(-1.0) else (low, middle)
    return low


def knot_correlation(knots: NDArray | float) -> NDArray:
    """R(d) of phase.h: the field's correlation over d knots, the mean over t of what cos and sin leave."""
    d = np.asarray(knots, dtype=np.float64)
    return np.where(d < 2, (1 - d / 2) * np.cos(np.pi * d / 2) + np.sin(np.pi * d / 2) / np.pi, 0.0)


KNOTS_PER_PATH = _unit_correlation_knots()


def path_correlation(path: NDArray | float) -> NDArray:
    """The same over a path in correlation lengths."""
    return knot_correlation(KNOTS_PER_PATH * np.asarray(path, dtype=np.float64))


class MovingPhaseState:
    """A state that advances: along a path (if continuous), in time, and with its surface (phase.h)."""

    def __init__(
        self,
        grid: FieldGrid,
        field: str = CIRCULAR_GAUSSIAN,
        polarization_count: int = 2,
        seed: int = 0,
        continuous: bool = True,
    ) -> None:
        self.grid, self.field_kind, self.polarization_count, self.seed = grid, field, polarization_count, seed
        self.continuous = continuous
        self.rest = np.zeros((*grid.shape, 2))

    def _gaussian(self, frame_index: int, phase_stream: int, magnitude_stream: int) -> NDArray[np.complex128]:
        height, width = self.grid.shape
        turn = philox.phasor(philox.image_words(height, width, self.seed, frame_index, phase_stream))
        return turn * np.sqrt(-np.log(philox.image_uniform(height, width, self.seed, frame_index, magnitude_stream)))

    def _fresh(self, frame_index: int, substep: int = 0) -> tuple[list[NDArray], list[NDArray], NDArray]:
        """A, B and t as a refresh draws them."""
        height, width = self.grid.shape
        more = 256 * substep
        a, b = [], []
        for k in range(self.polarization_count):
            if self.field_kind == UNIT_PHASOR:
                words = philox.image_words(height, width, self.seed, frame_index, more + STREAM_PHASE + k)
                a.append(philox.phasor(words))
            else:
                a.append(self._gaussian(frame_index, more + STREAM_PHASE + k, more + STREAM_MAGNITUDE + k))
            b.append(self._gaussian(frame_index, more + STREAM_NEXT_PHASE + k, more + STREAM_NEXT_MAGNITUDE + k))
        start = philox.image_words(height, width, self.seed, frame_index, more + STREAM_PATH_START)
        return a, b, start.astype(np.float64) / 2.0**32

    def refresh(self, frame_index: int) -> None:
        self.a, self.b, self.t = self._fresh(frame_index)
        self.rest = np.zeros((*self.grid.shape, 2))

    def _origins(self, shift: NDArray, new: NDArray) -> tuple[NDArray, NDArray, NDArray, NDArray]:
        """Row and column that each sample's state comes from, the rest of its shift, and whether there is such a place.

        `new`: samples that are replaced anyway and take nothing.
        """
        height, width = self.grid.shape
        inside_height = self.grid.oversampling * self.grid.height
        inside_width = self.grid.oversampling * self.grid.width
        y, x = np.mgrid[:height, :width]
        on_grid = self.grid.oversampling * shift[np.ix_(self.grid.pixel_rows(), self.grid.pixel_columns())]
        finite = np.isfinite(on_grid).all(-1)
        on_grid = np.where(finite[..., None], on_grid, 0.0)
        # What comes from outside of the image brings the rest of the nearest sample inside.
        near_x = np.clip(x + np.rint(on_grid[..., 0]).astype(int), 0, inside_width - 1)
        near_y = np.clip(y + np.rint(on_grid[..., 1]).astype(int), 0, inside_height - 1)
        total = np.where(finite[..., None], on_grid + self.rest[near_y, near_x], 0.0)
        whole = np.rint(total)
        still = (whole == 0).all(-1)
        column, row = x + whole[..., 0].astype(int), y + whole[..., 1].astype(int)
        in_image = (row >= 0) & (column >= 0) & (row < inside_height) & (column < inside_width)
        in_image &= (y < inside_height) & (x < inside_width)  # padding that moves is new
        known = finite & (still | in_image)
        column, row = np.where(still, x, column), np.where(still, y, row)
        # Of several samples from one place the first one in the order of rows keeps it.
        place = np.where(known & ~new, row * width + column, -1 - (y * width + x)).ravel()
        first = np.zeros(place.size, bool)
        first[np.unique(place, return_index=True)[1]] = True
        known &= first.reshape(known.shape)
        return np.where(known, row, y), np.where(known, column, x), total - whole, known

    def advance(
        self,
        frame_index: int,
        path: NDArray | float = 0.0,
        correlation: NDArray | float = 1.0,
        shift: NDArray | None = None,
        mask: NDArray | None = None,
        substep: int = 0,
    ) -> None:
        """One step; NaN and values out of range replace their pixel."""

        def on_grid(value: NDArray | float) -> NDArray:
            return self.grid.expand(np.broadcast_to(np.asarray(value), (self.grid.height, self.grid.width)))

        knots = KNOTS_PER_PATH * on_grid(path).astype(np.float64)
        r = on_grid(correlation).astype(np.float64)
        replaced = ~(knots >= 0) | (knots >= 2) | ~((r >= 0) & (r <= 1))
        if mask is not None:
            replaced |= on_grid(mask) != 0
        knots, r = np.where(replaced, 0.0, knots), np.where(replaced, 1.0, r)
        a, b, t = self.a, self.b, self.t
        if shift is not None:
            row, column, rest, known = self._origins(np.asarray(shift, dtype=np.float64), replaced)
            replaced |= ~known
            a, b, t = [z[row, column] for z in a], [z[row, column] for z in b], t[row, column]
            self.rest = rest
        fresh_a, fresh_b, fresh_t = self._fresh(frame_index, substep)
        passed = np.floor(t + knots).astype(int)
        more = 256 * substep
        for k in range(self.polarization_count):
            new_a = np.where(passed == 0, a[k], np.where(passed == 1, b[k], fresh_a[k]))
            new_b = np.where(passed == 0, b[k], fresh_b[k])
            if np.any(r < 1):
                w = self._gaussian(frame_index, more + STREAM_BOIL_PHASE + k, more + STREAM_BOIL_MAGNITUDE + k)
                v = self._gaussian(frame_index, more + STREAM_BOIL_PHASE + 2 + k, more + STREAM_BOIL_MAGNITUDE + 2 + k)
                new_a = r * new_a + np.sqrt(1 - r**2) * w
                new_b = r * new_b + np.sqrt(1 - r**2) * v
            a[k] = np.where(replaced, fresh_a[k], new_a)
            b[k] = np.where(replaced, fresh_b[k], new_b)
        self.a, self.b = a, b
        self.t = np.where(replaced, fresh_t, t + knots - passed)

    def field(self, polarization: int) -> NDArray[np.complex128]:
        """z of one polarization."""
        if not self.continuous:
            return self.a[polarization]
        angle = np.pi * self.t / 2
        return np.cos(angle) * self.a[polarization] + np.sin(angle) * self.b[polarization]

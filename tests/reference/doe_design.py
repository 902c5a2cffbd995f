"""Beam splitters in float64, written from the equations of doe_design.h and dot_layout.h: no code of the library."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Orders = npt.NDArray[np.int64]
Array = npt.NDArray[np.float64]


def envelope(orders: Orders, shape: tuple[int, int]) -> Array:
    """Amplitude of orders (m, n) behind square pixels that fill a cell of (height, width)."""
    return np.sinc(orders[:, 0] / shape[1]) * np.sinc(orders[:, 1] / shape[0])


@dataclass(frozen=True)
class Books:
    """Where the light of a phase goes; parts of the incoming light."""

    powers: Array
    efficiency: float
    grid_efficiency: float
    uniformity_rms: float
    uniformity_peak_to_peak: float
    zero_order: float
    ghost: float
    ghost_order: tuple[int, int]
    other_orders: float
    beyond: float


def books(phase: npt.NDArray[np.floating], orders: npt.ArrayLike, weights: Array | None = None) -> Books:
    """The powers of the orders of a cell, by one Fourier transform."""
    wanted = np.asarray(orders, np.int64)
    height, width = phase.shape
    field = np.fft.fft2(np.exp(1j * phase.astype(np.float64))) / phase.size
    m = np.fft.fftfreq(width, 1 / width)
    n = np.fft.fftfreq(height, 1 / height)
    grid = np.abs(field) ** 2
    all_powers = grid * (np.sinc(n / height) ** 2)[:, None] * (np.sinc(m / width) ** 2)[None, :]
    at = (wanted[:, 1] % height, wanted[:, 0] % width)
    powers = all_powers[at]
    ratio = powers / (np.ones(len(wanted)) if weights is None else weights)
    unwanted = all_powers.copy()
    unwanted[at] = 0
    zero = float(all_powers[0, 0])
    in_band = float(all_powers.sum())
    other = float(unwanted.sum() - unwanted[0, 0])
    unwanted[0, 0] = 0
    row, column = np.unravel_index(int(np.argmax(unwanted)), unwanted.shape)
    return Books(
        powers=powers,
        efficiency=float(powers.sum()),
        grid_efficiency=float(grid[at].sum()),
        uniformity_rms=float(ratio.std() / ratio.mean()),
        uniformity_peak_to_peak=float((ratio.max() - ratio.min()) / (ratio.max() + ratio.min())),
        zero_order=zero,
        ghost=float(unwanted.max()),
        ghost_order=(int(m[column]), int(n[row])),
        other_orders=other,
        beyond=float(grid.sum()) - in_band,
    )


def weighted_gerchberg_saxton(
    orders: npt.ArrayLike,
    shape: tuple[int, int],
    levels: int,
    iterations: int,
    quantization_iterations: int,
    seed: int,
    weighted: bool = True,
) -> Array:
    """A plain implementation: weights times mean / amplitude, soft quantization at the end. Returns the phase."""
    wanted = np.asarray(orders, np.int64)
    at = (wanted[:, 1] % shape[0], wanted[:, 0] % shape[1])
    behind = envelope(wanted, shape)
    weights = np.ones(len(wanted))
    phases = np.random.default_rng(seed).uniform(0, 2 * np.pi, len(wanted))
    total = iterations + (quantization_iterations if levels else 0)
    angle = np.zeros(shape)
    for step in range(total):
        far = np.zeros(shape, complex)
        far[at] = weights / behind * np.exp(1j * phases)
        angle = np.angle(np.fft.ifft2(far))
        if levels and step >= iterations:
            fraction = min(1.0, (step - iterations + 1) / (0.8 * quantization_iterations))
            steps = angle * levels / (2 * np.pi)
            nearest = np.round(steps)
            taken = (np.abs(steps - nearest) < fraction / 2) | (fraction >= 1 - 1e-9)
            angle = np.where(taken, nearest, steps) * 2 * np.pi / levels
        amplitudes = np.fft.fft2(np.exp(1j * angle))[at] * behind
        phases = np.angle(amplitudes)
        if weighted:
            weights *= np.abs(amplitudes).mean() / np.maximum(np.abs(amplitudes), 1e-300)
            weights /= weights.mean()
    return angle


def change_of_cost(
    phase: Array, orders: npt.ArrayLike, wanted_powers: Array, row: int, column: int, new_phase: float
) -> float:
    """By how much the cost of the direct binary search, sum (P - S)^2 / S, changes with one pixel's phase."""

    def cost(of: Array) -> float:
        return float(((books(of, orders).powers - wanted_powers) ** 2 / wanted_powers).sum())

    changed = phase.copy()
    changed[row, column] = new_phase
    return cost(changed) - cost(phase)


@dataclass(frozen=True)
class Neighborhoods:
    """How alike the dots of a layout are."""

    least: float
    mean: float
    pairs: int
    mean_neighbors: float


def neighborhoods(directions: Array, row_half_height: float, radius: float, tolerance: float) -> Neighborhoods:
    """difference(i, j) = 1 - 2 matches / (neighbours of i + neighbours of j) over all pairs of a row."""
    count = len(directions)
    offsets = directions[None, :, :] - directions[:, None, :]
    near = np.hypot(offsets[..., 0], offsets[..., 1]) <= radius
    near[np.arange(count), np.arange(count)] = False
    lists = [offsets[i][near[i]] for i in range(count)]
    differences = []
    for i in range(count):
        for j in range(i + 1, count):
            if abs(directions[i, 1] - directions[j, 1]) > row_half_height * (1 + 1e-9):
                continue
            both = len(lists[i]) + len(lists[j])
            matches = 0
            if len(lists[i]) and len(lists[j]):
                between = lists[i][:, None, :] - lists[j][None, :, :]
                matches = int((np.hypot(between[..., 0], between[..., 1]) <= tolerance).any(axis=1).sum())
            differences.append(1 - 2 * matches / both if both else 0.0)
    mean_neighbors = sum(map(len, lists)) / count
    return Neighborhoods(min(differences), float(np.mean(differences)), len(differences), mean_neighbors)

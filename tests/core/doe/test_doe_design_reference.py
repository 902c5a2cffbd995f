"""The design tool against float64 NumPy (reference/doe_design.py): figures, convergence, search, layouts."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
import pytest
from reference import doe_design as reference

import clspeckle

SHAPE = (96, 128)
PITCH = 2e-6

Note = Callable[[str, float], None]


def grid(count: int, seed: int) -> npt.NDArray[np.int64]:
    """`count` orders at random in the middle of the band."""
    rng = np.random.default_rng(seed)
    m, n = np.meshgrid(np.arange(-20, 21), np.arange(-15, 16))
    places = np.stack([m.ravel(), n.ravel()], axis=1)
    return rng.permutation(places[np.any(places != 0, axis=1)])[:count]


def symmetric(count: int, seed: int) -> npt.NDArray[np.int64]:
    half = grid(4 * count, seed)
    half = half[(half[:, 1] > 0) | ((half[:, 1] == 0) & (half[:, 0] > 0))][: count // 2]
    return np.concatenate([half, -half])


@pytest.mark.parametrize("levels", [0, 2, 5, 8])
@pytest.mark.parametrize("shape", [(96, 128), (90, 77)])
def test_figures_are_those_of_a_float64_transform(levels: int, shape: tuple[int, int], measured: Note) -> None:
    orders = symmetric(80, 1)
    weights = np.tile(np.random.default_rng(2).uniform(0.5, 2, len(orders) // 2), 2)
    design = clspeckle.design_doe(
        orders, weights, shape=shape, pixel_pitch_m=PITCH, levels=levels, search_sweeps=2 * (levels > 0)
    )
    books = reference.books(design.phase, orders, weights)
    measured("power of an order, relative", float(np.abs(design.powers / books.powers - 1).max()))
    np.testing.assert_allclose(design.powers, books.powers, rtol=1e-4)
    for name in (
        "efficiency",
        "grid_efficiency",
        "uniformity_rms",
        "uniformity_peak_to_peak",
        "other_orders",
        "beyond",
    ):
        assert getattr(design, name) == pytest.approx(getattr(books, name), rel=1e-5, abs=1e-6), name
    assert design.zero_order == pytest.approx(books.zero_order, rel=1e-3, abs=1e-10)
    assert design.largest_ghost == pytest.approx(books.ghost, rel=1e-4)
    m, n = design.ghost_order
    # With two levels the ghost has a twin of the same power.
    assert design.ghost_order == books.ghost_order or (levels == 2 and (-m, -n) == books.ghost_order)
    total = design.efficiency + design.zero_order + design.other_orders + design.beyond
    assert total == pytest.approx(1, abs=1e-6)


@pytest.mark.parametrize("levels", [0, 8])
def test_a_plain_numpy_implementation_gets_no_further(levels: int, measured: Note) -> None:
    """Ten seeds each, 100 orders: efficiencies scatter by 0.3 % between seeds, so that means of ten agree within 0.5
    %."""
    orders = grid(100, 3)
    ours, theirs = [], []
    for seed in range(10):
        design = clspeckle.design_doe(orders, shape=SHAPE, pixel_pitch_m=PITCH, levels=levels, seed=seed, iterations=60,
                                      quantization_iterations=40)  # fmt: skip
        phase = reference.weighted_gerchberg_saxton(orders, SHAPE, levels, 60, 40, seed)
        books = reference.books(phase, orders)
        ours.append((design.efficiency, design.uniformity_rms))
        theirs.append((books.efficiency, books.uniformity_rms))
    ours_mean, theirs_mean = np.mean(ours, axis=0), np.mean(theirs, axis=0)
    measured("efficiency less the reference's", float(abs(ours_mean[0] - theirs_mean[0])))
    assert ours_mean[0] == pytest.approx(theirs_mean[0], rel=0.005)
    assert ours_mean[1] < 1.25 * theirs_mean[1]
    # Without weights the dots are unequal.
    plain = reference.books(reference.weighted_gerchberg_saxton(orders, SHAPE, 0, 60, 0, 0, weighted=False), orders)
    assert plain.uniformity_rms > 3 * theirs_mean[1]


def test_history_is_that_of_the_reference_when_it_ends(measured: Note) -> None:
    orders = grid(60, 4)
    for iterations in (1, 7):
        design = clspeckle.design_doe(orders, shape=SHAPE, pixel_pitch_m=PITCH, levels=0, iterations=iterations)
        longer = clspeckle.design_doe(orders, shape=SHAPE, pixel_pitch_m=PITCH, levels=0, iterations=iterations + 1)
        books = reference.books(design.phase, orders)
        assert len(longer.history) == iterations + 1
        step = longer.history[iterations - 1]
        measured("step of the history, relative", abs(step[0] / books.efficiency - 1))
        assert step[0] == pytest.approx(books.efficiency, rel=1e-4)
        assert step[1] == pytest.approx(books.uniformity_rms, rel=1e-3)


@pytest.mark.parametrize("levels", [2, 4])
def test_after_the_search_no_pixel_can_be_bettered(levels: int, measured: Note) -> None:
    """Every pixel's steps by brute force: the forecast of the device for all pixels at once has missed none."""
    shape, orders = (12, 16), np.array([[3, 1], [-2, 2], [1, -4], [5, 0]])
    if levels == 2:
        orders = np.concatenate([orders, -orders])
    parameters = {
        "shape": shape,
        "pixel_pitch_m": PITCH,
        "levels": levels,
        "iterations": 5,
        "quantization_iterations": 3,
    }
    before = clspeckle.design_doe(orders, **parameters)
    design = clspeckle.design_doe(orders, search_sweeps=500, **parameters)
    assert design.search_changes > 0
    assert design.search_sweeps < 500
    assert design.uniformity_rms < before.uniformity_rms
    wanted = np.full(len(orders), 1.01 * design.powers.mean())
    phase = design.phase.astype(np.float64)
    changes = [
        reference.change_of_cost(phase, orders, wanted, row, column, phase[row, column] + step)
        for row in range(shape[0])
        for column in range(shape[1])
        for step in (2 * np.pi / levels, -2 * np.pi / levels)
    ]
    measured("best change of the cost that was left", -min(changes))
    assert min(changes) > -1e-7


@pytest.mark.parametrize("compensate", [True, False])
def test_envelope(compensate: bool) -> None:
    orders = np.array([[0, 3], [20, -3], [40, 5], [50, 30]])
    design = clspeckle.design_doe(
        orders, shape=SHAPE, pixel_pitch_m=PITCH, levels=0, iterations=300, compensate_envelope=compensate
    )
    behind = reference.envelope(orders, SHAPE) ** 2
    even = design.powers if compensate else design.powers / behind
    np.testing.assert_allclose(even, even.mean(), rtol=0.02)
    assert behind.min() < 0.6


def test_binary_is_point_symmetric() -> None:
    orders = grid(30, 5)
    with pytest.raises(clspeckle.errors.InvalidArgumentError, match="no mirror image"):
        clspeckle.design_doe(orders, shape=SHAPE, pixel_pitch_m=PITCH, levels=2)
    design = clspeckle.design_doe(orders, shape=SHAPE, pixel_pitch_m=PITCH, levels=2, mirror_orders=True)
    assert set(np.unique(design.phase)) <= {np.float32(0), np.float32(np.pi)}
    books = reference.books(design.phase, design.orders)
    np.testing.assert_allclose(books.powers, reference.books(design.phase, -design.orders).powers, rtol=1e-9)


@pytest.mark.parametrize("lattice", [True, False])
def test_neighbourhoods_are_those_of_brute_force(lattice: bool, measured: Note) -> None:
    layout = clspeckle.dot_layout(300, lattice=lattice, shape=(160, 200), seed=3)
    brute = reference.neighborhoods(
        layout.directions, layout.row_half_height, layout.neighborhood_radius, layout.tolerance
    )
    assert layout.pair_count == brute.pairs
    assert layout.min_difference == pytest.approx(brute.least)
    assert layout.mean_difference == pytest.approx(brute.mean)
    assert layout.mean_neighbors == pytest.approx(brute.mean_neighbors)
    offsets = layout.directions[:, None] - layout.directions[None]
    distances = np.hypot(offsets[..., 0], offsets[..., 1]) + 10 * np.eye(len(offsets))
    assert distances.min() >= layout.min_distance * (1 - 1e-9)
    # Dots in each quarter: 75 +- 5 standard deviations of a Poisson process, more than which a least distance allows.
    quarters, _, _ = np.histogram2d(*layout.directions.T, bins=2)
    assert np.all(np.abs(quarters - 75) < 5 * np.sqrt(75))


def test_snap_and_evaluate() -> None:
    directions = np.array([[0.1, -0.2], [0.03, 0.04]])
    snapped = clspeckle.snap_directions(directions, shape=(100, 200), pixel_pitch_m=1e-6, wavelength_m=1e-6)
    assert snapped.orders.tolist() == [[20, -20], [6, 4]]
    np.testing.assert_allclose(snapped.errors, 0, atol=1e-12)
    rng = np.random.default_rng(6)
    phase = rng.uniform(0, 6, (100, 200)).astype(np.float32)
    measured_design = clspeckle.evaluate_doe(phase, snapped.orders, pixel_pitch_m=1e-6)
    np.testing.assert_allclose(measured_design.powers, reference.books(phase, snapped.orders).powers, rtol=1e-4)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"orders": np.empty((0, 2), int)}, "orders has shape"),
        ({"orders": [[1.5, 2]]}, "integers"),
        ({"orders": [[1, 2], [1, 2]]}, "twice"),
        ({"weights": [1, 2]}, "weights"),
        ({"weights": [np.nan, 1, 1]}, "weight of"),
        ({"shape": (0, 8)}, "shape"),
        ({"levels": 1}, "levels"),
        ({"rule": "newton"}, "rule"),
        ({"pixel_pitch_m": np.nan}, "pixel_pitch_m"),
        ({"pixel_pitch_m": 1e-8}, "90 degrees"),
    ],
)
def test_bad_input(change: dict[str, object], words: str) -> None:
    arguments = {"orders": [[1, 2], [3, -4], [5, 6]], "shape": (32, 32), "pixel_pitch_m": PITCH, **change}
    with pytest.raises((clspeckle.ClspeckleError, TypeError), match=words):
        clspeckle.design_doe(**arguments)


LONG_CALLS = {
    "design_doe": lambda progress: clspeckle.design_doe(
        [[1, 2], [4, 0]], shape=(32, 32), pixel_pitch_m=PITCH, progress=progress
    ),
    "dot_layout": lambda progress: clspeckle.dot_layout(
        60, shape=(96, 96), pixel_pitch_m=1e-6, half_angle_x_rad=0.2, half_angle_y_rad=0.2, progress=progress
    ),
    "DoePattern": lambda progress: clspeckle.DoePattern(
        clspeckle.DoeElement(np.eye(8, dtype=np.float32), PITCH),
        lines=[930e-9, 950e-9],
        image_shape=(64, 64),
        progress=progress,
    ),
}


@pytest.mark.parametrize("name", LONG_CALLS)
def test_progress_cancels_and_lets_exceptions_through(name: str) -> None:
    call = LONG_CALLS[name]
    told: list[float] = []

    def stop(what: str, fraction: float) -> bool:
        told.append(fraction)
        return fraction < 0.3

    with pytest.raises(clspeckle.errors.CancelledError):
        call(stop)
    assert told == sorted(told)
    assert told[-1] >= 0.3

    def fail(what: str, fraction: float) -> None:
        raise KeyError(what)

    with pytest.raises(KeyError):
        call(fail)
    with pytest.raises(TypeError, match="progress"):
        call("a bar")

"""The advance of the phase state against the float64 reference, its laws, and its persistence."""

from __future__ import annotations

import clspeckle
import numpy as np
import pytest
import scipy.stats

from reference import phase

# height, width, oversampling, guard_px: plain, odd, padded for the FFT (17, 29), padded by guard and oversampled
GRIDS = [(64, 64, 1, 0), (33, 55, 1, 0), (17, 29, 1, 0), (17, 19, 2, 5)]


def make(
    context, grid, seed=12, polarization_count=2, dynamics="continuous", translate=False, field="circular_gaussian"
):
    height, width, oversampling, guard_px = grid
    state = clspeckle.Phase(
        (height, width),
        oversampling=oversampling,
        guard_px=guard_px,
        polarization_count=polarization_count,
        dynamics=dynamics,
        translate=translate,
        field=field,
        seed=seed,
        context=context,
    )
    expected = phase.MovingPhaseState(
        phase.FieldGrid(width, height, oversampling, guard_px),
        field,
        polarization_count,
        seed,
        dynamics == "continuous",
    )
    return state, expected


def correlation(a, b):
    """Of two fields with E|z|^2 = 1."""
    return float(np.mean((a.astype(np.complex128) * b.astype(np.complex128).conj()).real))


def random_path(shape, rng):
    """None, small, up to several knots, infinite."""
    path = rng.choice([0.0, 0.01, 0.3, 1.5, 2.0, 2.5, np.inf], shape) * rng.uniform(0.5, 1.0, shape)
    return path.astype(np.float32)


@pytest.mark.parametrize("polarization_count", [1, 2])
@pytest.mark.parametrize("grid", GRIDS)
def test_advance_of_a_seed(context, measured, grid, polarization_count):
    """Paths, correlations, masks and substeps, mixed over eight steps: z within 2e-5 of the reference (t is exact to
    2^-32, so what is left is the single-precision product of path and knots and the rounding of cos and sin)."""
    state, expected = make(context, grid, polarization_count=polarization_count)
    rng = np.random.default_rng(7)
    state.refresh(0)
    expected.refresh(0)
    shape = grid[:2]
    for index in range(1, 9):
        path = random_path(shape, rng)
        r = rng.choice([0.0, 0.5, 0.99, 1.0], shape).astype(np.float32) if index % 2 else 1.0
        mask = (rng.random(shape) < 0.1).astype(np.uint8) if index % 3 == 0 else None
        substep = 127 if index == 5 else 0
        frame_index = 2**40 + index
        state.advance(frame_index, path=path, correlation=r, mask=mask, substep=substep)
        expected.advance(frame_index, path, r, None, mask, substep)
        for k in range(polarization_count):
            error = np.abs(state.field(k) - expected.field(k)).max()
            measured("error of z", error)
            assert error < 2e-5
    state.check()


@pytest.mark.parametrize("grid", GRIDS)
def test_uniform_path_and_correlation(context, grid):
    """Numbers for all pixels do what images of them do, bit for bit."""
    uniform, expected = make(context, grid)
    image, _ = make(context, grid)
    for state in (uniform, image):
        state.refresh(0)
    expected.refresh(0)
    for index in range(1, 6):
        uniform.advance(index, path=0.4, correlation=0.8)
        image.advance(index, path=np.full(grid[:2], 0.4), correlation=np.full(grid[:2], 0.8))
        expected.advance(index, np.float32(0.4), np.float32(0.8))
    assert np.array_equal(uniform.save(), image.save())
    assert np.abs(uniform.field(1) - expected.field(1)).max() < 2e-5


def test_bad_values_replace_their_pixel_and_are_reported(context):
    state, expected = make(context, (17, 19, 2, 5))
    state.refresh(0)
    expected.refresh(0)
    path = np.zeros((17, 19), np.float32)
    path[3, 4], path[5, 6], path[16, 18] = np.nan, -1e-3, -np.inf
    r = np.ones((17, 19), np.float32)
    r[7, 8], r[9, 10], r[11, 12] = np.nan, 1.001, -0.1
    state.advance(1, path=path, correlation=r)
    expected.advance(1, path, r)
    assert np.abs(state.field(0) - expected.field(0)).max() < 1e-6
    with pytest.raises(clspeckle.errors.InvalidDataError, match=r"3 pixels.* 3 with one out of range.* x = 4, y = 3"):
        state.check()
    state.check()


@pytest.mark.parametrize("dynamics", ["replace", "continuous"])
def test_nothing_happens_where_nothing_moves(context, dynamics):
    """Path 0, correlation 1, shift 0, mask 0: the bits of the whole state stay."""
    state, _ = make(context, (17, 29, 1, 0), dynamics=dynamics, translate=True)
    state.refresh(0)
    saved = state.save()
    shape = (17, 29)
    path = np.zeros(shape) if dynamics == "continuous" else None
    state.advance(1, path=path, correlation=np.ones(shape), mask=np.zeros(shape, bool))
    state.advance(2, shift=np.zeros((*shape, 2)))
    state.advance(3)
    assert np.array_equal(state.save(), saved)


@pytest.mark.parametrize("field", ["circular_gaussian", "unit_phasor"])
def test_the_rule_of_the_thesis(context, field):
    """Kept or replaced: an advance by a mask is a refresh by that mask, bit for bit."""
    mask = np.random.default_rng(3).random((17, 29)) < 0.3
    advanced, _ = make(context, (17, 29, 1, 0), dynamics="replace", field=field)
    refreshed, _ = make(context, (17, 29, 1, 0), dynamics="replace", field=field)
    for state in (advanced, refreshed):
        state.refresh(0)
    advanced.advance(1, mask=mask)
    refreshed.refresh(1, mask)
    assert np.array_equal(advanced.save(), refreshed.save())
    assert not np.array_equal(advanced.save()[:100], make_saved(context, field)[:100]) or not mask[0].any()


def make_saved(context, field):
    state, _ = make(context, (17, 29, 1, 0), dynamics="replace", field=field)
    state.refresh(0)
    return state.save()


def test_substeps_draw_anew(context):
    state, _ = make(context, (32, 32, 1, 0))
    state.refresh(0)
    seen = [state.field(0)]
    for substep in (0, 1, 2, 127):
        state.advance(1, path=np.inf, substep=substep)
        seen.append(state.field(0))
    for i, a in enumerate(seen):
        for b in seen[:i]:
            assert not np.any(a == b)


# --- Moving with the surface ---


def shift_image(grid, x, y):
    image = np.empty((grid[0], grid[1], 2), np.float32)
    image[...] = (x, y)
    return image


@pytest.mark.parametrize("dynamics", ["replace", "continuous"])
@pytest.mark.parametrize("grid", [(24, 32, 1, 0), (17, 29, 1, 0), (15, 18, 2, 3)])
@pytest.mark.parametrize("shift", [(1, 0), (0, -1), (3, -2), (-5, 4)])
def test_whole_shifts_move_the_field_exactly(context, grid, dynamics, shift):
    """Bit for bit; what comes from outside of the image is new, and so is the padding."""
    state, _ = make(context, grid, dynamics=dynamics, translate=True)
    state.refresh(0)
    before = [state.field(k) for k in (0, 1)]
    state.advance(1, shift=shift_image(grid, *shift))
    height, width, s = grid[0] * grid[2], grid[1] * grid[2], grid[2]
    dx, dy = s * shift[0], s * shift[1]
    y, x = np.mgrid[: state.grid_shape[0], : state.grid_shape[1]]
    inside = (x + dx >= 0) & (y + dy >= 0) & (x + dx < width) & (y + dy < height) & (x < width) & (y < height)
    for k in (0, 1):
        after = state.field(k)
        assert np.array_equal(after[inside], before[k][(y + dy)[inside], (x + dx)[inside]])
        assert not np.isin(after[~inside], before[k]).any()


@pytest.mark.parametrize("grid", [(24, 64, 1, 0), (15, 40, 2, 3)])
@pytest.mark.parametrize("fraction", [0.02, 0.3, -0.45, 1.7])
def test_fractions_of_a_sample_add_up(context, grid, fraction):
    """After n frames the field is the first one shifted by round(n f) samples, and no grain is there twice."""
    state, _ = make(context, grid, translate=True, polarization_count=1)
    state.refresh(0)
    before = state.field(0)
    s = grid[2]
    for n in range(1, 21):
        state.advance(n, shift=shift_image(grid, fraction, 0))
        total = n * s * np.float64(np.float32(fraction))
        if abs(total % 1 - 0.5) < 1e-3:
            continue  # half a sample rounds either way
        after, whole = state.field(0), round(total)
        inner = slice(max(0, -whole), s * grid[1] - max(0, whole))
        rows = slice(0, s * grid[0])
        moved = before[rows, inner.start + whole : inner.stop + whole]
        assert np.array_equal(after[rows, inner], moved), n
        assert np.unique(after).size == after.size


def smooth_shift(grid):
    """A surface that comes nearer, turns and moves: the samples of an image part."""
    y, x = np.mgrid[: grid[0], : grid[1]].astype(np.float64)
    return np.stack([-0.13 * (x - 13.2) + 0.05 * y + 0.3, -0.05 * x - 0.11 * (y - 7.9) - 0.7], -1).astype(np.float32)


@pytest.mark.parametrize("dynamics", ["replace", "continuous"])
@pytest.mark.parametrize("grid", [(24, 32, 1, 0), (17, 29, 1, 0), (15, 18, 2, 3)])
def test_shift_of_a_growing_surface(context, grid, dynamics):
    """Four frames of a motion that spreads samples against the reference, with a mask and a path on top; no grain is
    there twice."""
    state, expected = make(context, grid, dynamics=dynamics, translate=True)
    state.refresh(0)
    expected.refresh(0)
    rng = np.random.default_rng(5)
    for index in range(1, 5):
        mask = (rng.random(grid[:2]) < 0.05).astype(np.uint8)
        path = np.full(grid[:2], 0.05, np.float32) if dynamics == "continuous" else 0.0
        shift = smooth_shift(grid)
        state.advance(index, shift=shift, mask=mask, path=path if dynamics == "continuous" else None)
        expected.advance(index, path, 1.0, shift, mask)
        for k in (0, 1):
            after = state.field(k)
            assert np.abs(after - expected.field(k)).max() < 2e-5
            assert np.unique(after).size == after.size


def test_shifts_that_are_no_numbers(context):
    state, expected = make(context, (12, 16, 1, 0), translate=True)
    state.refresh(0)
    expected.refresh(0)
    shift = np.zeros((12, 16, 2), np.float32)
    shift[1, 2, 0], shift[3, 4, 1], shift[5, 6, 0], shift[7, 8] = np.nan, np.inf, 1e30, (-40000, 3)
    state.advance(1, shift=shift)
    expected.advance(1, shift=np.where(np.abs(shift) > 1e4, np.nan, shift))
    assert np.abs(state.field(0) - expected.field(0)).max() < 1e-6
    with pytest.raises(clspeckle.errors.InvalidDataError, match=r"2 pixels.* x = 2, y = 1"):
        state.check()


@pytest.mark.parametrize("grid", [(24, 32, 1, 0), (15, 18, 2, 3)])
def test_save_and_restore_with_the_rest_of_the_shift(context, grid):
    """A state that is saved between two fractional shifts goes on as if nothing had happened, bit for bit."""
    state, _ = make(context, grid, translate=True)
    other, _ = make(context, grid, translate=True, seed=12)
    state.refresh(0)
    for index in range(1, 4):
        state.advance(index, shift=shift_image(grid, 0.3, -0.2), path=0.2)
    saved = state.save()
    other.restore(saved)
    for index in range(4, 7):
        for each in (state, other):
            each.advance(index, shift=shift_image(grid, 0.3, -0.2), path=0.2, correlation=0.9)
        assert np.array_equal(state.save(), other.save())
    assert not np.array_equal(state.save(), saved)
    sample_bytes = 2 * 16 + 4 + 8
    assert saved.size == sample_bytes * state.grid_shape[0] * state.grid_shape[1]


# --- Laws. n = 2^18 samples and two polarizations, fixed seed. The mean of z z'* over n independent pairs has a
# standard error of at most 1/sqrt(2n) = 1.4e-3 (of the real part), and t, which both polarizations share, adds at most
# that of R: bounds are 5e-3, 3.5 errors. A process with correlations of an exponential, exp(-p), would miss the bell's
# 0.974 at p = 0.15 by 0.11. ---

N = (512, 512, 1, 0)
BOUND = 5e-3


@pytest.fixture(scope="module")
def start(context):
    state, _ = make(context, N, seed=31)
    state.refresh(0)
    return state.save(), [state.field(k) for k in (0, 1)]


def measure(context, start, steps, at):
    """Field correlation with the start after steps of the same length, where they reach the paths `at`."""
    state, _ = make(context, N, seed=31)
    state.restore(start[0])
    result = []
    for index, length in enumerate(steps, 1):
        state.advance(index, path=length)
        if index in at:
            result.append(np.mean([correlation(state.field(k), start[1][k]) for k in (0, 1)]))
    return np.array(result)


@pytest.mark.parametrize("step", [0.03, 0.15, 0.6, 1.2])
def test_correlation_over_the_path_is_the_bell(context, measured, start, step):
    """The same curve for steps of any length, and exactly nothing beyond two knots (a path of 2.13)."""
    count = round(2.4 / step)
    at = sorted({max(1, round(p / step)) for p in (0.15, 0.3, 0.6, 1.0, 1.2, 1.5, 1.8, 2.4)})
    found = measure(context, start, [step] * count, at)
    expected = phase.path_correlation(np.array(at) * step)
    measured("difference of correlation", np.abs(found - expected).max())
    assert np.abs(found - expected).max() < BOUND
    assert expected[-1] == 0.0


def test_correlation_length_is_the_path_of_one(context, start):
    """1/e at a path of 1: where the measured curve crosses 1/e lies within 2 % of it (its slope there is -0.77, so
    BOUND is 0.7 %)."""
    steps = np.arange(1, 41) * 0.03
    found = measure(context, start, [0.03] * 40, range(1, 41))
    crossing = np.interp(-np.exp(-1), -found, steps)
    assert abs(crossing - 1) < 0.02


def test_fields_stay_circular_gaussian(context):
    """After many steps of path and time |z|^2 is exponential with mean 1 (Kolmogorov-Smirnov at level 1e-3; a mean off
    by 3 % would be rejected), the polarizations are independent, and t is still uniform."""
    state, _ = make(context, N, seed=32)
    state.refresh(0)
    for index in range(1, 12):
        state.advance(index, path=0.37, correlation=0.97)
    z, other = (state.field(k).astype(np.complex128).ravel() for k in (0, 1))
    assert scipy.stats.kstest(np.abs(z) ** 2, "expon").pvalue > 1e-3
    assert scipy.stats.kstest(np.angle(z) / (2 * np.pi) % 1, "uniform").pvalue > 1e-3
    assert abs(np.mean(z * other.conj())) < 3.5 / np.sqrt(z.size)
    t = state.save()[: 4 * z.size].view(np.uint32) / 2.0**32
    assert scipy.stats.kstest(t, "uniform").pvalue > 1e-3


@pytest.mark.parametrize("dynamics", ["replace", "continuous"])
def test_time_decorrelates_exponentially(context, measured, dynamics):
    """r = exp(-dt / tau) per step: after k steps exp(-k dt / tau), within BOUND."""
    state, _ = make(context, N, seed=33, dynamics=dynamics)
    state.refresh(0)
    z = [state.field(k) for k in (0, 1)]
    for step in range(1, 9):
        state.advance(step, correlation=np.exp(-0.25))
        found = np.mean([correlation(state.field(k), z[k]) for k in (0, 1)])
        measured("difference of correlation", abs(found - np.exp(-0.25 * step)))
        assert abs(found - np.exp(-0.25 * step)) < BOUND


def test_path_and_time_multiply(context, start):
    state, _ = make(context, N, seed=31)
    state.restore(start[0])
    for index in range(1, 5):
        state.advance(index, path=0.2, correlation=0.9)
    found = np.mean([correlation(state.field(k), start[1][k]) for k in (0, 1)])
    assert abs(found - 0.9**4 * phase.path_correlation(0.8)) < BOUND


@pytest.mark.parametrize("grid", [*GRIDS, (70, 131, 1, 3)])
@pytest.mark.parametrize("dynamics", ["replace", "continuous"])
def test_lanes_and_samples_give_the_same_bits(monkeypatch, grid, dynamics):
    """The kernel with explicit vectors and the one of a sample each: numbers and images, values out of range, masks."""
    results = []
    for engine in ("cpu", "clfft"):
        monkeypatch.setenv("CLSPECKLE_FFT", engine)
        with clspeckle.Context() as context:
            state, _ = make(context, grid, dynamics=dynamics)
            rng = np.random.default_rng(7)
            shape = grid[:2]
            state.refresh(0)
            for index in range(1, 13):
                odd_path = random_path(shape, rng) * rng.choice([1, 1, 1, np.nan, -1], shape).astype(np.float32)
                odd_r = rng.choice([0, 0.5, 0.99, 1, 1.2, -1e-9, np.nan], shape).astype(np.float32)
                mask = rng.random(shape) < 0.1
                path = (0.0, 0.37, odd_path)[index % 3] if dynamics == "continuous" else 0.0
                r = (1.0, 0.9, odd_r, odd_r)[index % 4]
                state.advance(index, path=path, correlation=r, mask=mask if index % 5 == 0 else None)
            with pytest.raises(clspeckle.errors.InvalidDataError) as caught:
                state.check()
            results.append((state.save(), str(caught.value)))
    assert np.array_equal(results[0][0].view(np.uint8), results[1][0].view(np.uint8))
    assert results[0][1] == results[1][1]

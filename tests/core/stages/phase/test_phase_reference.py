"""The phase state against the float64 reference, and its persistence."""

from __future__ import annotations

import clspeckle
import numpy as np
import pytest
import scipy.stats

from reference import phase

# height, width, oversampling, guard_px: plain, odd, thin, padded for the FFT (17, 29, 53), padded by guard, oversampled
GRIDS = [
    (64, 64, 1, 0),
    (33, 55, 1, 0),
    (1, 64, 1, 0),
    (7, 7, 1, 0),
    (17, 29, 1, 0),
    (19, 17, 1, 3),
    (17, 19, 2, 5),
    (29, 53, 3, 1),
]


def make(context, grid, field="circular_gaussian", polarization_count=2, seed=12):
    height, width, oversampling, guard_px = grid
    state = clspeckle.Phase(
        (height, width),
        oversampling=oversampling,
        guard_px=guard_px,
        field=field,
        polarization_count=polarization_count,
        seed=seed,
        context=context,
    )
    expected = phase.PhaseState(phase.FieldGrid(width, height, oversampling, guard_px), field, polarization_count, seed)
    return state, expected


def random_mask(shape, seed=13):
    """About a third of the pixels, with values other than 1; the corners and edges, which rule the padding, are
    mixed."""
    rng = np.random.default_rng(seed)
    return np.where(rng.random(shape) < 1 / 3, rng.integers(1, 256, shape), 0).astype(np.uint8)


@pytest.mark.parametrize("oversampling", [1, 2, 3, 8])
@pytest.mark.parametrize("guard_px", [0, 1, 13])
def test_grid(oversampling, guard_px):
    for width, height in ((1, 1), (17, 848), (53, 1001), (101, 1933)):
        grid = clspeckle.field_grid((height, width), oversampling=oversampling, guard_px=guard_px)
        assert grid.shape == phase.FieldGrid(width, height, oversampling, guard_px).shape


@pytest.mark.parametrize("field", ["circular_gaussian", "unit_phasor"])
@pytest.mark.parametrize("grid", GRIDS)
def test_field_of_a_seed(context, measured, grid, field):
    """z of both polarizations within 1e-6 (measured 3.7e-7 on PoCL, all of it from the Gaussian magnitude)."""
    state, expected = make(context, grid, field)
    for frame_index in (0, 5, 2**40 + 3):
        state.refresh(frame_index)
        expected.refresh(frame_index)
        for k in (0, 1):
            error = np.abs(state.field(k) - expected.field(k)).max()
            measured("error of z", error)
            assert error < 1e-6


@pytest.mark.parametrize("field", ["circular_gaussian", "unit_phasor"])
def test_large_field(context, measured, field):
    """The bound of 1e-6 over 4 million samples, u down to 2e-7 and up to 1."""
    state, expected = make(context, (1440, 1440, 1, 0), field, seed=2**64 - 1)
    state.refresh(1)
    expected.refresh(1)
    for k in (0, 1):
        error = np.abs(state.field(k) - expected.field(k)).max()
        measured("error of z", error)
        assert error < 1e-6


def test_one_polarization(context):
    state, expected = make(context, (20, 30, 1, 0), polarization_count=1)
    state.refresh(4)
    expected.refresh(4)
    assert np.abs(state.field(0) - expected.field(0)).max() < 1e-6
    with pytest.raises(clspeckle.ClspeckleError):
        state.field(1)


@pytest.mark.parametrize("field", ["circular_gaussian", "unit_phasor"])
@pytest.mark.parametrize("grid", GRIDS)
def test_mask_refreshes_exactly_the_masked_pixels(context, grid, field):
    """Samples of masked pixels, and padding nearest to them, are those of a fresh draw at the new frame index, bit
    for bit; all others keep their bits."""
    state, expected = make(context, grid, field)
    fresh, _ = make(context, grid, field)
    mask = random_mask(grid[:2])
    state.refresh(6)
    before = [state.field(k) for k in (0, 1)]
    state.refresh(7, mask)
    fresh.refresh(7)
    drawn = expected.grid.expand(mask) != 0
    for k in (0, 1):
        assert np.array_equal(state.field(k), np.where(drawn, fresh.field(k), before[k]))
        assert not np.any(before[k] == fresh.field(k))
    state.refresh(8, np.zeros(grid[:2], np.uint8))
    assert np.array_equal(state.field(0), np.where(drawn, fresh.field(0), before[0]))


@pytest.mark.parametrize("value", [1, 128, 255])
def test_any_mask_value_but_zero_refreshes(context, value):
    state, _ = make(context, (8, 8, 1, 0))
    state.refresh(0)
    before = state.field(0)
    mask = np.zeros((8, 8), np.uint8)
    mask[2, 3] = value
    state.refresh(1, mask)
    assert np.array_equal(state.field(0) != before, mask != 0)


def test_first_refresh_draws_everything(context):
    masked, _ = make(context, (17, 29, 1, 0))
    full, _ = make(context, (17, 29, 1, 0))
    masked.refresh(9, np.zeros((17, 29), np.uint8))
    full.refresh(9)
    assert np.array_equal(masked.field(0), full.field(0))
    assert np.array_equal(masked.field(1), full.field(1))


def test_no_field_before_the_first_refresh(context):
    state, _ = make(context, (8, 8, 1, 0))
    with pytest.raises(clspeckle.errors.InvalidStateError):
        state.field(0)
    with pytest.raises(clspeckle.errors.InvalidStateError):
        state.save()


@pytest.mark.parametrize("field", ["circular_gaussian", "unit_phasor"])
@pytest.mark.parametrize("grid", [(33, 55, 1, 0), (17, 19, 2, 5)])
def test_save_and_restore_are_bit_exact(context, grid, field):
    """Into the same state after other draws, and into a state of another seed that was never refreshed; a masked
    refresh after that draws only what the mask says."""
    state, expected = make(context, grid, field)
    other, _ = make(context, grid, field, seed=99)
    state.refresh(1)
    state.refresh(2, random_mask(grid[:2]))
    saved = state.save()
    kept = [state.field(k) for k in (0, 1)]
    state.refresh(3)
    assert not np.array_equal(state.field(0), kept[0])
    state.restore(saved)
    other.restore(saved.tobytes())
    for k in (0, 1):
        assert np.array_equal(state.field(k), kept[k])
        assert np.array_equal(other.field(k), kept[k])
    assert np.array_equal(other.save(), saved)
    mask = random_mask(grid[:2], seed=14)
    state.refresh(4, mask)
    other.refresh(4, mask)
    unmasked = expected.grid.expand(mask) == 0
    for after in (state.field(0), other.field(0)):
        assert np.array_equal(after[unmasked], kept[0][unmasked])


def test_laws_of_the_fields(context):
    """n = 2^18 samples, fixed seed, Kolmogorov-Smirnov at level 1e-3 (critical distance 3.8e-3). Gaussian: |z|^2
    exponential with mean 1 (a mean off by 3 %, distance 1.1e-2, would be rejected); phases uniform, both fields;
    polarizations, and real and imaginary part, uncorrelated to 3.5 standard errors."""
    n = 1 << 18
    for field in ("circular_gaussian", "unit_phasor"):
        state, _ = make(context, (512, 512, 1, 0), field, seed=21)
        state.refresh(0)
        z, other = (state.field(k).astype(np.complex128).ravel() for k in (0, 1))
        power = np.abs(z) ** 2
        if field == "circular_gaussian":
            assert scipy.stats.kstest(power, "expon").pvalue > 1e-3
        else:
            assert np.abs(power - 1).max() < 1e-6
        turns = np.angle(z) / (2 * np.pi) % 1
        assert scipy.stats.kstest(turns, "uniform").pvalue > 1e-3
        assert abs(np.mean(z * other.conj())) < 3.5 / np.sqrt(n)
        assert abs(np.mean(z.real * z.imag)) < 3.5 * 0.5 / np.sqrt(n)
        assert abs(np.mean(z)) < 3.5 / np.sqrt(n)
